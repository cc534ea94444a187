"""Scenes of other codes as wholes: matrices beside the mesh of the same deck, and CalculiX's matrices beside dense algebra."""

import itertools
import shutil
import subprocess
import sys

import numpy as np
import pytest
import scipy.linalg
from conftest import INPUTS, ROOT
from models import write_scene

STRIP = INPUTS / "strip_calculix"
STEEL, LINING = (210e3, 0.3, 7.85e-9), (3e3, 0.25, 2.5e-9)  # MPa, -, t/mm3


def run_tool(name, *arguments):
    done = subprocess.run([sys.executable, ROOT / "tools" / name, *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def eigenvalues(report):
    found = [complex(mode["growth_rate"], 2 * np.pi * mode["frequency_hz"]) for mode in report["modes"]["modes"]]
    return np.array(sorted(found, key=lambda value: value.imag))


# ---- matrices made here, and the mesh of the same deck


def tetrahedra(low, high):
    """Places of the corners of six 4-node tetrahedra a cell."""
    for cell in itertools.product(*(range(a, b) for a, b in zip(low, high))):
        for path in itertools.permutations(np.eye(3, dtype=int)):
            corners = np.cumsum([cell, *path], axis=0)
            if np.linalg.det(corners[1:] - corners[0]) < 0:
                corners = corners[[0, 2, 1, 3]]
            yield [tuple(place) for place in corners]


def element(x, material):
    """Exact stiffness and consistent mass of a 4-node tetrahedron, by its constant strain."""
    young, poisson, density = material
    corners = np.c_[np.ones(4), x]
    volume, gradients = np.linalg.det(corners) / 6, np.linalg.inv(corners)[1:].T
    B = np.hstack([[[a, 0, 0], [0, b, 0], [0, 0, c], [b, a, 0], [0, c, b], [c, 0, a]] for a, b, c in gradients])
    shear = young / (2 * (1 + poisson))
    D = np.diag([2 * shear] * 3 + [shear] * 3)
    D[:3, :3] += young * poisson / ((1 + poisson) * (1 - 2 * poisson))
    return volume * B.T @ D @ B, density * volume / 20 * np.kron(np.ones((4, 4)) + np.eye(4), np.eye(3))


class StripDeck:
    """A lining on a strip in mm, N, s and t: a deck, and its matrices as Abaqus writes them."""

    def __init__(self):
        parts = {"strip": ((0, 0, -1), (6, 1, 0), STEEL), "lining": ((1, 0, 0), (3, 1, 1), LINING)}
        self.cells = {part: list(tetrahedra(low, high)) for part, (low, high, _) in parts.items()}
        self.material = {part: material for part, (*_, material) in parts.items()}
        places = [(part, p) for part, cells in self.cells.items() for p in sorted({p for cell in cells for p in cell})]
        self.nodes = {key: 10 * number for number, key in enumerate(places, 1)}  # numbers with gaps

    def position(self, place):
        return np.array([11.0, 9.0, 7.0]) * place + 0.3 * np.sin(np.arange(3) + np.array(place)) * (place[2] > 0)

    def those(self, part, test):
        return [number for (of, place), number in self.nodes.items() if of == part and test(place)]

    def write_deck(self, file, sets=None):
        lines = ["*NODE"] + [f"{n}, " + ", ".join(f"{x:.17g}" for x in self.position(place)) for (_, place), n in self.nodes.items()]
        number = itertools.count(1)
        for part, cells in self.cells.items():
            young, poisson, density = self.material[part]
            lines.append(f"*ELEMENT, TYPE=C3D4, ELSET={part}")
            lines += [f"{next(number)}, " + ", ".join(str(self.nodes[part, p]) for p in cell) for cell in cells]
            lines += [f"*MATERIAL, NAME={part}", "*ELASTIC", f"{young}, {poisson}", "*DENSITY", f"{density}",
                      f"*SOLID SECTION, ELSET={part}, MATERIAL={part}"]
        sets = sets or {"ends": self.those("strip", lambda p: p[0] in (0, 6)), "face": self.those("strip", lambda p: p[2] == 0),
                "foot": self.those("lining", lambda p: p[2] == 0), "top": self.those("lining", lambda p: p[2] == 1)}
        lines += [line for name, of in sets.items() for line in (f"*NSET, NSET={name}", ", ".join(map(str, of)))]
        file.write_text("\n".join([*lines, "*BOUNDARY", "ends, 1, 3", "top, 1, 2", ""]))
        return sets

    def write_matrices(self, folder, sets):
        """The lower triangle; held motions carry 1e36."""
        rows = {(node, c): 3 * i + c - 1 for i, node in enumerate(self.nodes.values()) for c in (1, 2, 3)}
        K, M = np.zeros((2, len(rows), len(rows)))
        for part, cells in self.cells.items():
            for cell in cells:
                own = [rows[self.nodes[part, p], c] for p in cell for c in (1, 2, 3)]
                stiffness, mass = element(np.array([self.position(p) for p in cell]), self.material[part])
                K[np.ix_(own, own)] += stiffness
                M[np.ix_(own, own)] += mass
        held = [rows[n, c] for n in sets["ends"] for c in (1, 2, 3)] + [rows[n, c] for n in sets["top"] for c in (1, 2)]
        K[held, held] += 1e36
        names = [f"{node},{c}" for node, c in rows]
        for name, A in (("K", K), ("M", M)):
            (folder / f"{name}.mtx").write_text("".join(f"{names[i]}, {names[j]}, {A[i, j]:.17e}\n"
                                                        for i, j in zip(*np.nonzero(np.tril(A)))))
        pairs = [(self.nodes["strip", place], n) for (of, place), n in self.nodes.items() if of == "lining" and place[2] == 0]
        (folder / "pairs.csv").write_text("".join(f"{a}, {b}\n" for a, b in pairs))
        (folder / "model.toml").write_text('K = "K.mtx"\nM = "M.mtx"\nnodes = "deck.inp"\nlength = 0.001\n[[contact]]\n'
                                           'pairs = "pairs.csv"\nnormal = "z"\ntangents = ["x"]\nvelocity = [1, 0, 0]\n')


def test_matrices_have_the_eigenvalues_of_the_mesh_of_their_deck(converged, tmp_path):
    """Both ways of one deck to the same modes: penalties, pairs of nodes, units; parts, sets, supports, contact of faces."""
    deck = StripDeck()
    sets = deck.write_deck(tmp_path / "deck.inp")
    deck.write_matrices(tmp_path, sets)
    run_tool("matrices", tmp_path / "model.toml", tmp_path / "matrices")
    run_tool("mesh", tmp_path / "deck.inp", tmp_path / "mesh", "--length", "0.001")
    physics = {"friction": {"coefficient": 0.4}, "damping": {"beta": 1e-8}, "modes": {"method": "full", "band": 60000}}
    top = ",".join(map(str, sets["top"]))
    force = {"force": [{"on": f"node:{top}", "vector": [0, 0, -100]}]}
    of_matrices = converged(write_scene(tmp_path, matrices={"folder": "matrices"}, **force, **physics), ranks=2)
    skeleton = (tmp_path / "mesh" / "scene.toml").read_text().partition("# [[contact]]")[0]
    (tmp_path / "more").mkdir()
    more = write_scene(tmp_path / "more", **physics, force=[{"on": "top", "vector": [0, 0, -100]}],
                       contact=[{"rotor": "face", "stator": "foot", "tangents": ["x"], "velocity": [1, 0, 0]}])
    (tmp_path / "mesh" / "scene.toml").write_text(skeleton + more.read_text())
    of_mesh = converged(tmp_path / "mesh" / "scene.toml", ranks=1)
    found, expected = eigenvalues(of_matrices.report), eigenvalues(of_mesh.report)
    assert len(found) == len(expected) > 5
    np.testing.assert_allclose(found, expected, rtol=1e-10)
    pressed = [run.report["equilibrium"]["normal_force_sum"] for run in (of_matrices, of_mesh)]
    np.testing.assert_allclose(pressed, 100, rtol=1e-10)


# ---- a superelement


def reduced(K, M, kept, count):
    """Craig and Bampton: static shapes of the kept rows, and `count` modes with these held. Columns: kept rows, then modes."""
    inner = np.setdiff1d(np.arange(len(K)), kept)
    _, modes = scipy.linalg.eigh(K[np.ix_(inner, inner)], M[np.ix_(inner, inner)])
    shapes = np.zeros((len(K), len(kept) + count))
    shapes[kept, np.arange(len(kept))] = 1
    shapes[inner, : len(kept)] = -np.linalg.solve(K[np.ix_(inner, inner)], K[np.ix_(inner, kept)])
    shapes[np.ix_(inner, len(kept) + np.arange(count))] = modes[:, :count]
    return shapes.T @ K @ shapes, shapes.T @ M @ shapes


def nastran_superelement(file, seam, K, M):
    """DMIG: nodes, and scalar points behind."""
    names = [(n, c) for n in seam for c in (1, 2, 3)] + [(9001 + i, 0) for i in range(len(K) - 3 * len(seam))]
    text = ""
    for name, A in (("STIFFNESS", K), ("MASS", M)):
        text += f"DMIG,{name[:4]},0,6,2,0,,,{len(names)}\n"
        for j, (node, c) in enumerate(names):
            text += f"DMIG*   {name[:4]:16}{node:16d}{c:16d}\n"
            text += "".join(f"*,{names[i][0]},{names[i][1]},{A[i, j]:.17e}\n" for i in range(j, len(names)))
    file.write_text(text)
    return "STIF", "MASS"


def abaqus_superelement(file, seam, K, M):
    """*USER ELEMENT, LINEAR: nodes, and those of modal coordinates behind, with one motion each."""
    modes = range(1, len(K) - 3 * len(seam) + 1)
    nodes = [*seam, *(-i for i in modes)]
    text = f"*USER ELEMENT, NODES={len(nodes)}, LINEAR\n** ELEMENT NODES\n"
    text += "".join(f"** {', '.join(map(str, nodes[i : i + 8]))}\n" for i in range(0, len(nodes), 8)) + "1, 2, 3\n"
    text += f"{len(seam) + 1}, 1\n" if modes else ""
    for name, A in (("STIFFNESS", K), ("MASS", M)):
        text += f"*MATRIX,TYPE={name}\n"
        for j in range(len(A)):
            column = [f"{a:.17e}" for a in A[: j + 1, j]]
            text += "".join(", ".join(column[k : k + 4]) + "\n" for k in range(0, j + 1, 4))
    file.write_text(text)
    return "STIFFNESS", "MASS"


def write_superelement(deck, folder, cells, count, write):
    """A part of the strip on its nodes next to the mesh and on modes."""
    own = sorted({deck.nodes["strip", p] for cell in cells for p in cell})
    rows = {node: 3 * i for i, node in enumerate(own)}
    K, M = np.zeros((2, 3 * len(own), 3 * len(own)))
    for cell in cells:
        places = [rows[deck.nodes["strip", p]] + c for p in cell for c in range(3)]
        stiffness, mass = element(np.array([deck.position(p) for p in cell]), STEEL)
        K[np.ix_(places, places)] += stiffness
        M[np.ix_(places, places)] += mass
    held = [rows[n] + c for n in deck.those("strip", lambda p: p[0] == 6) for c in range(3)]
    seam = deck.those("strip", lambda p: p[0] == 4)
    free = np.setdiff1d(np.arange(len(K)), held)
    kept = np.searchsorted(free, [rows[n] + c for n in seam for c in range(3)])
    K, M = reduced(K[np.ix_(free, free)], M[np.ix_(free, free)], kept, len(free) - len(kept) if count is None else count)
    file = folder / ("strip.pch" if write is nastran_superelement else "strip.mtx")
    stiffness, mass = write(file, seam, K, M)
    (folder / "super.toml").write_text(f'K = "{file.name}:{stiffness}"\nM = "{file.name}:{mass}"\nnodes = "deck.inp"\n'
                                       "length = 0.001\n")
    run_tool("matrices", folder / "super.toml", folder / "super")


@pytest.mark.parametrize("name", ["F", "G", "H"])
def test_what_a_superelement_cannot_have_is_refused(squeal, tmp_path, name):
    """Left aside, a load or gyroscopic terms of the substructure would be missing without a word."""
    deck = StripDeck()
    sets = deck.write_deck(tmp_path / "deck.inp")
    whole = deck.cells["strip"]
    far = [cell for cell in whole if min(p[0] for p in cell) >= 4]
    write_superelement(deck, tmp_path, far, 0, nastran_superelement)
    shutil.copy(tmp_path / "super" / "K.petsc", tmp_path / "super" / f"{name}.petsc")
    deck.cells["strip"] = [cell for cell in whole if cell not in far]
    sets["seam"] = deck.those("strip", lambda p: p[0] == 4)
    deck.write_deck(tmp_path / "joined.inp", sets)
    run_tool("mesh", tmp_path / "joined.inp", tmp_path / "joined", "--length", "0.001")
    (tmp_path / "more").mkdir()
    more = write_scene(tmp_path / "more", superelement=[{"name": "far", "folder": "../super", "on": "seam"}]).read_text()
    scene = tmp_path / "joined" / "scene.toml"
    scene.write_text(scene.read_text().partition("# [[contact]]")[0] + more)
    run = squeal(scene)
    assert run.code == 1
    assert f"{name}.petsc: a superelement has M, K and C alone" in run.messages[0]


@pytest.mark.parametrize("count, write", [(None, nastran_superelement), (0, nastran_superelement),
                                          (None, abaqus_superelement)])
def test_superelement_takes_the_place_of_a_part_of_the_mesh(converged, tmp_path, count, write):
    """With all its modes a reduced half of the strip is that half: the eigenvalues are those of the whole mesh, to the rounding of
    the reduction. With none it is stiffer, and the lowest frequency lies above."""
    deck = StripDeck()
    sets = deck.write_deck(tmp_path / "deck.inp")
    whole = deck.cells["strip"]
    far = [cell for cell in whole if min(p[0] for p in cell) >= 4]
    write_superelement(deck, tmp_path, far, count, write)
    physics = {"friction": {"coefficient": 0.4}, "damping": {"beta": 1e-8}, "modes": {"method": "full", "band": 60000},
               "force": [{"on": "top", "vector": [0, 0, -100]}],
               "contact": [{"rotor": "face", "stator": "foot", "tangents": ["x"], "velocity": [1, 0, 0]}]}
    found = {}
    for name, cells, extra in (("whole", whole, {}), ("joined", [cell for cell in whole if cell not in far],
                                                      {"superelement": [{"name": "far", "folder": "../super", "on": "seam"}]})):
        deck.cells["strip"] = cells
        sets["seam"] = deck.those("strip", lambda p: p[0] == 4)
        deck.write_deck(tmp_path / f"{name}.inp", sets if name == "joined" else None)
        run_tool("mesh", tmp_path / f"{name}.inp", tmp_path / name, "--length", "0.001")
        (tmp_path / "more").mkdir(exist_ok=True)
        more = write_scene(tmp_path / "more", **physics, **extra).read_text()
        scene = tmp_path / name / "scene.toml"
        scene.write_text(scene.read_text().partition("# [[contact]]")[0] + more)
        found[name] = eigenvalues(converged(scene, ranks=2 if name == "joined" else 1).report)
    if count is None:
        np.testing.assert_allclose(found["joined"], found["whole"], rtol=1e-9)
    else:
        assert found["joined"][0].imag > 1.0001 * found["whole"][0].imag


# ---- the scene of CalculiX's matrices


def dense_problem():
    """Mass, damping, stiffness of steady sliding with all pairs closed, read without the tool: (lambda^2 M + lambda C + K) Z y
    is square to Y, where Z keeps the pairs closed and Y takes out r_n along B_n + mu B_t."""
    rows = [tuple(map(int, line.split("."))) for line in (STRIP / "strip.dof").read_text().split()]
    place = {key: i for i, key in enumerate(rows)}

    def matrix(name):
        i, j, values = np.loadtxt(STRIP / name).T
        A = np.zeros((len(rows), len(rows)))
        A[i.astype(int) - 1, j.astype(int) - 1] = values
        A[j.astype(int) - 1, i.astype(int) - 1] = values
        return 1e3 * A  # N/mm and t

    K, M = matrix("strip.sti"), matrix("strip.mas")
    pairs = np.loadtxt(STRIP / "pairs.csv", delimiter=",", skiprows=1, dtype=int)
    B = np.zeros((2, len(pairs), len(rows)))  # along z and x
    for pair, (rotor, stator) in enumerate(pairs):
        for which, dof in enumerate((3, 1)):
            B[which, pair, place[stator, dof]], B[which, pair, place[rotor, dof]] = 1, -1
    Z, Y = scipy.linalg.null_space(B[0]), scipy.linalg.null_space(B[0] + 0.4 * B[1])
    return [Y.T @ A @ Z for A in (M, 8e-7 * K, K)]


def nearest_eigenvalue(problem, start):
    """Two-sided inverse iteration."""
    M, C, K = problem
    value, x, y = start, np.ones(len(M), complex), np.ones(len(M), complex)
    for _ in range(3):
        factor = scipy.linalg.lu_factor(value**2 * M + value * C + K)
        for _ in range(2):
            x = scipy.linalg.lu_solve(factor, (2 * value * M + C) @ x)
            y = scipy.linalg.lu_solve(factor, (2 * value * M + C).T @ y, trans=1)
            x, y = x / np.linalg.norm(x), y / np.linalg.norm(y)
        roots = np.roots([y @ A @ x for A in (M, C, K)])
        value = roots[np.argmin(abs(roots - value))]
    return value


def test_calculix_scene_has_the_eigenvalues_of_dense_algebra(converged):
    run = converged(STRIP / "scene.toml", "--set", "cycle.enabled=false", "--set", "estimate.enabled=false", ranks=1)
    assert run.report["equilibrium"]["closed"] == run.report["model"]["pairs"] == 18
    found, problem = eigenvalues(run.report), dense_problem()
    assert len(found) == 24 and sum(value.real > 0 for value in found) == 1
    exact = np.array([nearest_eigenvalue(problem, value * (1 + 1e-6)) for value in found])
    assert len(np.unique(np.round(exact, 3))) == 24
    np.testing.assert_allclose(found, exact, rtol=1e-10)


def test_calculix_matrices_are_what_the_tool_makes(tmp_path):
    run_tool("matrices", STRIP / "model.toml", tmp_path / "out")
    written = sorted(file.name for file in (tmp_path / "out").iterdir())
    assert written == sorted(file.name for file in (STRIP / "matrices").iterdir())
    for name in written:
        assert (tmp_path / "out" / name).read_bytes() == (STRIP / "matrices" / name).read_bytes(), name
