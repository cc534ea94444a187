#!/usr/bin/env python3
"""Compares the brake corner with all its contacts tied by squeal and by CalculiX, on one mesh: frequencies of both.

    apt-get install calculix-ccx
    jobs/corner_calculix.py FOLDER [SIZE [HZ [CONTACTS]]]

SIZE is `mesh.parameters.size` of inputs/corner, 9000 unless given; HZ ends the band, 8000 unless given. CONTACTS are those that
are tied, such as 2,3,4,5,6,7; all unless given. Those of the bracket, 2 to 7, have to be among them: CalculiX refuses nodes that a
held surface and a coupling share. Both surfaces of the others are held. FOLDER gets the scene with ties in place of contacts, the
deck that tools/mesh makes of it, and what both programs write. The leading tabs, 0.1 mm away from their abutments, are free in both.
Losses are left out of both.
"""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def tied_scene(size, band, tied):
    """The corner's scene with a tie for each of the contacts that has no gap, and without damping."""
    text = (ROOT / "inputs/corner/scene.toml").read_text()
    text = re.sub(r"^size = \d+", f"size = {size}", text, flags=re.M)
    text = re.sub(r"^(damping|alpha|beta) = .*\n", "", text, flags=re.M)
    text = re.sub(r"^band = .*", f"band = {band}", text, flags=re.M)
    text = text.replace("[damping]\n", "")
    text = re.sub(r"\[friction\].*\n(.+\n)+", "", text)
    text = re.sub(r"\[\[step\]\]\n(.+\n)+", "", text)
    contact = r'\[\[contact\]\].*\nrotor = "(.*)"\nstator = "(.*)"\n((?:.+\n)*)'
    count = iter(range(99))

    def joint(match):
        rotor, stator, more = match.groups()
        if str(next(count)) in tied:
            return "" if "gap =" in more else f'[[tie]]\nslave = "{stator}"\nmaster = "{rotor}"\n'
        return "".join(f'[[support]]\non = "{side}"\nfixed = "all"\n' for side in (rotor, stator))

    return re.sub(contact, joint, text)


def frequency_deck(text, band):
    """Of what tools/mesh writes the model alone, with the keywords of CalculiX for rigid surfaces, and one step."""
    blocks = re.split(r"^(?=\*)", text, flags=re.M)
    faces = {}  # of a surface: the nodes, from elements and sides
    elements, sets = {}, {}
    for block in blocks:
        head, *rows = block.splitlines() or [""]
        words = [[w.strip() for w in row.split(",") if w.strip()] for row in rows]
        if head.startswith("*ELEMENT, TYPE=C3D20"):
            flat = [int(w) for row in words for w in row]
            elements.update({flat[i]: flat[i + 1:i + 21] for i in range(0, len(flat), 21)})
        elif head.startswith("*ELSET"):
            sets[head.split("ELSET=")[1]] = [int(w) for row in words for w in row] if "every" not in head else []
        elif head.startswith("*SURFACE, NAME="):
            faces[head.split("NAME=")[1]] = sorted({elements[e][k - 1] for name, side in words for e in sets[name] for k in SIDES[side]})
    out = []
    for block in blocks:
        head = block.partition("\n")[0]
        if head.startswith("*STEP"):
            break
        if head.startswith(("*ELEMENT, TYPE=DASHPOT", "*DASHPOT", "*KINEMATIC", "*DAMPING")):
            continue
        if head.startswith("*BOUNDARY"):
            block = "".join(row + "\n" for row in block.splitlines() if row.split(", ")[-1] not in "456")
        if head.startswith("*COUPLING"):
            node, surface = re.search(r"REF NODE=(\d+), SURFACE=(\w+)", head).groups()
            block = f"*NSET, NSET=rigid_{surface}\n" + "".join(f"{n},\n" for n in faces[surface]) + (
                f"*RIGID BODY, NSET=rigid_{surface}, REF NODE={node}\n")
        if head.startswith("*TIE"):
            block = block.replace("*TIE,", f"*TIE, ADJUST=NO, POSITION TOLERANCE={REACH},")
        out.append(block)
    short = re.sub(r"-?\d[\d.]*(?:e-?\d+)?", lambda m: m[0] if len(m[0]) < 20 else f"{float(m[0]):.12e}", "".join(out))  # it reads 20 characters
    return short + f"*STEP\n*FREQUENCY, SOLVER=SPOOLES\n{int(band) // 100}, 0., {band}\n*END STEP\n"


SIDES = {"S1": (1, 2, 3, 4, 9, 10, 11, 12), "S2": (5, 6, 7, 8, 13, 14, 15, 16), "S3": (1, 2, 5, 6, 9, 13, 17, 18),
         "S4": (2, 3, 6, 7, 10, 14, 18, 19), "S5": (3, 4, 7, 8, 11, 15, 19, 20), "S6": (4, 1, 8, 5, 12, 16, 20, 17)}  # of C3D20
REACH = 1e-3  # m: more than the chords of the pins' faces are apart


def by_calculix(folder):
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    with open(folder / "ccx.log", "w") as log:
        subprocess.run(["ccx", "tied"], cwd=folder, env=environment, stdout=log, stderr=subprocess.STDOUT, check=True)
    table = (folder / "tied.dat").read_text().partition("PARTICIPATION")[0]
    return [float(m[1]) for m in re.finditer(r"^ +\d+ +\S+ +\S+ +(\S+) +\S+ *$", table, re.M)]


def by_squeal(folder):
    subprocess.run([ROOT / "build/squeal", "scene.toml", "--output", "out"], cwd=folder, stdout=open(folder / "squeal.log", "w"), check=True)
    modes = json.loads((folder / "out/report.json").read_text())["modes"]
    return sorted(mode["frequency_hz"] for mode in modes["modes"])


def main(folder, size="9000", band="8000", contacts="0,1,2,3,4,5,6,7,8,9,10,11"):
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "brake.geo").write_bytes((ROOT / "inputs/corner/brake.geo").read_bytes())
    (folder / "scene.toml").write_text(tied_scene(size, band, contacts.split(",")))
    subprocess.run([ROOT / "tools/mesh", folder / "scene.toml", folder / "squeal.inp", "--to", "inp"], check=True)
    (folder / "tied.inp").write_text(frequency_deck((folder / "squeal.inp").read_text(), band))
    theirs, ours = by_calculix(folder), by_squeal(folder)
    print(f"{len(ours)} modes of squeal and {len(theirs)} of CalculiX below {band} Hz")
    apart = sorted(abs(a / b - 1) for a, b in zip(ours, theirs))
    print(f"apart by {apart[len(apart) // 2]:.2%} in the middle and {apart[-1]:.2%} at most; {sum(d <= 1e-3 for d in apart)} by 0.1 % or less")
    print("squeal [Hz]  CalculiX [Hz]  difference")
    for a, b in zip(ours, theirs):
        print(f"{a:11.3f}  {b:13.3f}  {100 * (a / b - 1):+8.3f} %")


if __name__ == "__main__":
    if not 2 <= len(sys.argv) <= 5:
        sys.exit(__doc__)
    main(*sys.argv[1:])
