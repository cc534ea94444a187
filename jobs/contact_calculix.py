#!/usr/bin/env python3
"""Compares a scene's frictional equilibrium by squeal and by CalculiX, on one mesh: forces, moments, displacements.

    apt-get install calculix-ccx
    jobs/contact_calculix.py FOLDER block|corner [--size 9000] [--travel 1e-4] [--stiffness 1e13 1e14 ...] [--increments 16] [--spring 0]
                             [--ray]

`block` is a block pressed on another and dragged: its forces are known. `corner` is inputs/corner. In CalculiX the rotor's supports move
with the drive, for TRAVEL seconds in the step of the full load, in proportion in the others, and once more under the full load. The
penalty stiffness [N/m3], of normals and of sticking alike, is raised until no force changes by more than 0.2 %. SPRING [N/m] holds each
body without a support to the ground, softly, along x, y and z. `--ray` leaves the steps out: all loads rise in proportion. FOLDER gets the scene, the deck of each stiffness, and what both programs
write. Contacts with a gap are left out of the deck: they have to stay open. SQUEAL names another program than build/squeal.
"""

import argparse
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import h5py
import numpy as np
from corner_calculix import SIDES

ROOT = Path(__file__).resolve().parent.parent
ALIKE = 2e-3  # change of forces, relative, at which stiffness is high enough
DRAG = 1e10  # N/m3: slope of sticking where a drive makes all pairs slip; stiffer ones throw the first iteration off
REACH = 1e-3  # m, of ties

BLOCK_GEO = """DefineConstant[order = 2];
Mesh.ElementOrder = order; Mesh.SecondOrderIncomplete = 1;
For i In {0:1}
  x = 0.025 * i; y = 0.015 * i;
  p = newp; Point(p) = {x, y, 0}; q = newc;
  out[] = Extrude{0.1 - 2 * x, 0, 0}{ Point{p}; Layers{i == 0 ? 5 : 4}; };
  out[] = Extrude{0, 0.06 - 2 * y, 0}{ Curve{out[1]}; Layers{i == 0 ? 3 : 4}; Recombine; };
  face = out[1];
  solid[] = Extrude{0, 0, i == 0 ? -0.02 : 0.02}{ Surface{face}; Layers{2}; Recombine; };
  If (i == 0)
    Physical Surface("base") = {solid[0]}; Physical Surface("top") = {face}; Physical Volume("rail") = {solid[1]};
  Else
    Physical Surface("head") = {solid[0]}; Physical Surface("sole") = {face}; Physical Volume("block") = {solid[1]};
  EndIf
EndFor
"""
BLOCK_SCENE = """title = "A block pressed on another and dragged"
mesh = { file = "block.geo", parameters = { order = 2 } }
part = [ { name = "rail", young = 120e9, poisson = 0.26, density = 7200 }, { name = "block", young = 2e9, poisson = 0.25, density = 2600 } ]
support = [ { on = "base", fixed = "all" }, { on = "head", fixed = "x y" } ]
pressure = [ { on = "head", value = 1e6 } ]
contact = [ { rotor = "top", stator = "sole", velocity = [1, 0, 0] } ]
friction = { coefficient = 0.3 }
"""


def write_scene(folder, name, size, ray):
    if name == "block":
        (folder / "block.geo").write_text(BLOCK_GEO)
        (folder / "scene.toml").write_text(BLOCK_SCENE)
    else:
        text = (ROOT / "inputs/corner/scene.toml").read_text()
        (folder / "brake.geo").write_bytes((ROOT / "inputs/corner/brake.geo").read_bytes())
        text = re.sub(r"^size = \d+", f"size = {size}", text, flags=re.M)
        (folder / "scene.toml").write_text(re.sub(r"\[\[step\]\]\n(.+\n)+", "", text) if ray else text)
    subprocess.run([ROOT / "tools/mesh", folder / "scene.toml", folder / "squeal.inp", "--to", "inp"], check=True, stdout=subprocess.DEVNULL)
    return tomllib.loads((folder / "scene.toml").read_text())


# ---- the deck
class Deck:
    """The model of a deck that tools/mesh wrote, with equations for rigid surfaces, and its loads by steps."""

    def __init__(self, text):
        self.nodes, self.elements, self.sets, self.surfaces, self.lines, self.steps = {}, {}, {}, {}, [], []
        self.turning = {}  # of a reference node: the node whose motions are its rotations
        for block in re.split(r"^(?=\*)", text, flags=re.M):
            head, *rows = block.splitlines() or [""]
            keyword = head.split(",")[0]
            words = [[w.strip() for w in row.split(",") if w.strip()] for row in rows]
            take = getattr(self, {"*NODE": "take_nodes", "*ELEMENT": "take_elements", "*ELSET": "take_set", "*NSET": "take_set",
                                  "*SURFACE": "take_surface", "*COUPLING": "take_coupling", "*BOUNDARY": "take_boundary",
                                  "*TIE": "take_tie"}.get(keyword, "take_other"))
            take(head, rows, words)

    def take_nodes(self, head, rows, words):
        self.nodes.update({int(w[0]): np.array([float(v) for v in w[1:4]]) for w in words})
        self.lines += ["*NODE", *(f"{w[0]}, " + ", ".join(f"{float(v):.12e}" for v in w[1:4]) for w in words)]

    def take_elements(self, head, rows, words):
        kind = re.search(r"TYPE=(\w+)", head)[1]
        if kind.startswith("DASHPOT"):
            return
        if kind.startswith("C3D"):
            flat, count = [int(w) for row in words for w in row], 1 + int(re.search(r"C3D(\d+)", kind)[1])
            self.elements.update({flat[i]: flat[i + 1:i + count] for i in range(0, len(flat), count)})
            self.sets[re.search(r"ELSET=(\w+)", head)[1]] = [flat[i] for i in range(0, len(flat), count)]
        self.lines += [head.replace("TYPE=C3D8,", "TYPE=C3D8I,"), *rows]

    def take_set(self, head, rows, words):
        if "every" not in head:
            self.sets[head.split("SET=")[1]] = [int(w) for row in words for w in row]
        self.lines += [head, *rows]

    def take_surface(self, head, rows, words):
        if head.startswith("*SURFACE, NAME="):
            corners = 8 if max(map(len, self.elements.values())) == 20 else 4
            self.surfaces[head.split("NAME=")[1]] = sorted({self.elements[e][k - 1] for name, side in words for e in self.sets[name]
                                                            for k in SIDES[side][:corners]})
            self.lines += [head, *rows]

    def take_coupling(self, head, rows, words):
        """u = u_ref + theta x (x - x_ref), a linear equation for each motion of each node."""
        node, surface = re.search(r"REF NODE=(\d+), SURFACE=(\w+)", head).groups()
        turn = self.turning[int(node)] = max(self.nodes) + 1
        self.nodes[turn] = at = self.nodes[int(node)]
        self.lines += ["*NODE", f"{turn}, " + ", ".join(f"{v:.12e}" for v in at)]
        for n in self.surfaces[surface]:
            arm = self.nodes[n] - at
            for i in range(3):
                j, k = (i + 1) % 3, (i + 2) % 3  # (theta x arm)_i = theta_j arm_k - theta_k arm_j
                terms = [(n, i, 1.0), (node, i, -1.0), (turn, j, -arm[k]), (turn, k, arm[j])]
                terms = [t for t in terms if abs(t[2]) > 1e-12]
                self.lines += ["*EQUATION", str(len(terms)), ", ".join(f"{t[0]}, {t[1] + 1}, {t[2]:.12e}" for t in terms)]

    def take_boundary(self, head, rows, words):
        kept = []
        for target, first, *_ in words:
            if int(first) > 3 and target.isdigit() and int(target) in self.turning:
                kept.append(f"{self.turning[int(target)]}, {int(first) - 3}, {int(first) - 3}")
            elif int(first) <= 3:
                kept.append(f"{target}, {first}, {first}")
        self.lines += ["*BOUNDARY", *kept] if kept else []

    def take_tie(self, head, rows, words):
        self.lines += [head.replace("*TIE,", f"*TIE, ADJUST=NO, POSITION TOLERANCE={REACH},"), *rows]

    def take_other(self, head, rows, words):
        keyword = head.split(",")[0]
        if keyword == "*STEP":
            self.steps.append([])
        elif self.steps and keyword in ("*CLOAD", "*DSLOAD"):
            self.steps[-1] += [head, *rows]
        elif not self.steps and keyword in ("*MATERIAL", "*ELASTIC", "*DENSITY", "*SOLID SECTION", "*SPRING", "*TRANSFORM"):
            self.lines += [head, *rows]

    def bodies(self):
        """Sets of nodes that elements join."""
        root = {}

        def find(n):
            while root.setdefault(n, n) != n:
                root[n] = n = root[root[n]]
            return n

        for nodes in self.elements.values():
            for n in nodes[1:]:
                root[find(n)] = find(nodes[0])
        found = {}
        for n in list(root):
            found.setdefault(find(n), set()).add(n)
        return list(found.values())


def drive(contact, at):
    """Velocity of the rotor there, or None."""
    if "rotation" in contact:
        turn = contact["rotation"]
        axis = {"x": [1, 0, 0], "y": [0, 1, 0], "z": [0, 0, 1]}.get(turn["axis"], turn["axis"])
        return turn["rate"] * np.cross(axis, at - np.array(turn.get("centre", [0, 0, 0])))
    return np.array(contact["velocity"], float) if any(contact.get("velocity", ())) else None


def contacts_of(scene):
    return [c for c in scene["contact"] if not c.get("gap")]


def travels(scene, travel):
    """Seconds of the drive in each step, in proportion to the pressure there, so that friction never has to wait for slip; and once more."""
    shares = [np.mean(step.get("pressures", [1.0])) for step in scene.get("step", [{}])]
    return [*(travel * s for s in shares), travel]


def write_deck(deck, scene, stiffness, travel, increments, spring):
    lines = ["*HEADING", scene["title"], *deck.lines]
    lines += ["*NSET, NSET=every_node", *(f"{n}," for n in deck.nodes if n not in deck.turning.values())]
    held = {n for s in scene["support"] for n in deck.sets.get(s["on"], [])}
    if spring:
        label = 10 ** 6
        for body in deck.bodies():
            if not body & held:
                for i in (1, 2, 3):
                    lines += [f"*ELEMENT, TYPE=SPRING1, ELSET=ground_{label}"]
                    first = label
                    for n in sorted(body):
                        lines.append(f"{label}, {n}")
                        label += 1
                    lines += [f"*SPRING, ELSET=ground_{first}", str(i), f"{spring / len(body):.6e}"]
    for i, c in enumerate(contacts_of(scene)):
        mu = c.get("friction", scene["friction"]["coefficient"])
        lines += [f"*SURFACE INTERACTION, NAME=pair_{i}", "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", f"{stiffness:g}"]
        slope = stiffness if drive(c, np.zeros(3)) is None else DRAG
        lines += ["*FRICTION", f"{mu}, {slope:g}"] if mu else []
        lines += [f"*CONTACT PAIR, INTERACTION=pair_{i}, TYPE=SURFACE TO SURFACE", f"{c['stator']}, {c['rotor']}"]
    driven = [c for c in scene["contact"] if drive(c, np.zeros(3)) is not None]
    rotors = {n: c for c in driven for body in deck.bodies() if body & set(deck.surfaces[c["rotor"]]) for n in body & held}
    steps = [step for step in deck.steps if step]
    gone = np.cumsum(travels(scene, travel))
    before = 0.0
    for time, step in zip(gone, [*steps, []]):
        first = min(max(before / (time - before), 0.02), 1 / increments) if before else 0.25  # the load at most doubles
        before = time
        lines += ["*STEP, INC=2000", "*STATIC", f"{first:.6f}, 1., 1e-6, {max(first, 1 / increments):.6f}", *step, "*BOUNDARY"]
        for n, c in rotors.items():
            lines += [f"{n}, {k + 1}, {k + 1}, {v * time:.12e}" for k, v in enumerate(drive(c, deck.nodes[n]))]
        lines += ["*NODE PRINT, NSET=every_node, FREQUENCY=99999", "U"]
        for c in contacts_of(scene):
            lines += [f"*CONTACT PRINT, SLAVE={c['stator']}, MASTER={c['rotor']}, FREQUENCY=99999", "CF"]
        lines += ["*END STEP"]
    return "\n".join([*lines, ""])


# ---- both programs
def by_squeal(folder, scene):
    """Force and moment about the origin on each contact's stator; place and displacement of each node."""
    off = [word for stage in ("transient", "cycle", "modes", "estimate") for word in ("--set", f"{stage}.enabled=false")]
    program = os.environ.get("SQUEAL", ROOT / "build/squeal")
    subprocess.run([program, "scene.toml", "--output", "out", *off], cwd=folder, stdout=open(folder / "squeal.log", "w"), check=True)
    with h5py.File(folder / "out/fields.h5") as file:
        pairs = {name: np.array(data) for name, data in file["pairs"].items()}
        moved, at = np.array(file["equilibrium/displacement"]), np.array(file["mesh/nodes"])
    frame = np.stack([pairs["normal"], pairs["tangent_1"], pairs["tangent_2"]], 1)
    forces = np.einsum("pi,pij->pj", pairs["reaction"], frame)
    moments = np.cross(pairs["position"], forces)
    mine = [i for i, c in enumerate(scene["contact"]) if not c.get("gap")]
    wrench = [np.concatenate([a[pairs["contact"] == i].sum(0) for a in (forces, moments)]) for i in mine]
    return np.array(wrench), at, moved


def by_calculix(folder, name):
    """Wrench of each contact and displacement of each node, at the end of each step that was reached."""
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    with open(folder / f"{name}.log", "w") as log:
        subprocess.run(["ccx", name], cwd=folder, env=environment, stdout=log, stderr=subprocess.STDOUT)
    ends = []
    for text in (folder / f"{name}.dat").read_text().split(" displacements ")[1:]:
        moved, *contacts = text.split("statistics for slave set")
        rows = [line.split() for line in moved.splitlines()[1:] if line.strip()]
        wrench = [[float(v) for v in part.partition("(mx,my,mz)")[2].split()[:6]] for part in contacts]
        ends.append((np.array(wrench), {int(row[0]): np.array([float(v) for v in row[1:4]]) for row in rows}))
    return ends


def without_drive(deck, scene, moved, time):
    """Displacements less the travel of the rotors."""
    carried = {n: c for c in scene["contact"] if drive(c, np.zeros(3)) is not None
               for body in deck.bodies() if body & set(deck.surfaces[c["rotor"]]) for n in body}
    return {n: u - time * drive(carried[n], deck.nodes[n]) if n in carried else u for n, u in moved.items()}


def share(a, b):
    return np.linalg.norm(a - b) / np.linalg.norm(a)


def compare(deck, scene, ours, theirs, travel):
    wrench, at, moved = ours
    print(f"{'contact':44s} {'N squeal':>10s} {'N CalculiX':>10s} {'apart':>8s} {'friction':>10s} {'apart':>8s} {'moment':>8s} {'line':>8s}")
    for c, a, b in zip(contacts_of(scene), wrench, theirs[-1][0]):
        n = normal_of(deck, c)
        normal, friction = [w[:3] @ n for w in (a, b)], [w[:3] - (w[:3] @ n) * n for w in (a, b)]
        size = [np.linalg.norm(f) for f in friction]
        print(f"{c['stator'] + ' on ' + c['rotor']:44s} {normal[0]:10.2f} {normal[1]:10.2f} {normal[1] / normal[0] - 1:+8.3%} {size[0]:10.2f} "
              f"{share(friction[0], friction[1]):8.3%} {share(a[3:], b[3:]):8.3%} {1e3 * np.linalg.norm(a[3:] - b[3:]) / np.linalg.norm(a[:3]):5.3f} mm")
    labels = [n for n in deck.nodes if n in theirs[-1][1]][:len(at)]
    there = without_drive(deck, scene, theirs[-1][1], sum(travels(scene, travel)))
    assert np.abs(at - [deck.nodes[n] for n in labels]).max() < 1e-9, "nodes of both programs are not in the same order"
    apart = np.linalg.norm(moved - [there[n] for n in labels], axis=1)
    largest = np.linalg.norm(moved, axis=1).max()
    print(f"displacement: largest {largest:.4e} m, apart by {apart.max() / largest:.3%} of it at most, {np.sqrt((apart**2).mean()) / largest:.3%} in the mean")


def normal_of(deck, contact):
    """Of the plane of a stator's face, into the stator."""
    at = np.array([deck.nodes[n] for n in deck.surfaces[contact["stator"]]])
    normal = np.linalg.svd(at - at.mean(0))[2][2]
    inside = np.mean([deck.nodes[n] for body in deck.bodies() if body & set(deck.surfaces[contact["stator"]]) for n in body], 0)
    return normal * np.sign(normal @ (inside - at.mean(0)))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("scene", choices=["block", "corner"])
    parser.add_argument("--size", default="9000")
    parser.add_argument("--travel", type=float, default=1e-4)
    parser.add_argument("--stiffness", type=float, nargs="+", default=[1e13, 1e14, 1e15])
    parser.add_argument("--increments", type=int, default=16)
    parser.add_argument("--spring", type=float, default=0.0)
    parser.add_argument("--ray", action="store_true")
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    scene = write_scene(given.folder, given.scene, given.size, given.ray)
    deck = Deck((given.folder / "squeal.inp").read_text())
    ours, before = by_squeal(given.folder, scene), None
    for stiffness in given.stiffness:
        name = f"stiffness_{stiffness:g}"
        (given.folder / f"{name}.inp").write_text(write_deck(deck, scene, stiffness, given.travel, given.increments, given.spring))
        theirs = by_calculix(given.folder, name)
        wanted = 1 + len([step for step in deck.steps if step])
        print(f"stiffness {stiffness:g} N/m3: {len(theirs)} of {wanted} steps converged")
        if len(theirs) < wanted:
            break
        print(f"the last travel changed forces by {max(share(a[:3], b[:3]) for a, b in zip(theirs[-1][0], theirs[-2][0])):.3%} at most")
        compare(deck, scene, ours, theirs, given.travel)
        if before is not None:
            change = max(share(a[:3], b[:3]) for a, b in zip(theirs[-1][0], before))
            print(f"forces changed by {change:.3%} at most from the stiffness before")
            if change < ALIKE:
                break
        before = theirs[-1][0]


if __name__ == "__main__":
    main()
