"""Supports, pressures and rigid bodies on the named surfaces of every solid element, with 3-, 4-, 6- and 8-node faces."""

import itertools

import numpy as np
import pytest
from models import KINDS, Mesh, bricks, bricks20, lattice, write_scene

KINDS.setdefault("tet10", (11, 3))
KINDS.setdefault("triangle6", (9, 2))
SIZE = np.array([0.3, 0.2, 0.5])
YOUNG, PRESSURE, FORCE, OFFSET = 2e9, 3e6, 700.0, 0.04

# Corners of the faces of each shape, and the ends of its mid-sides in gmsh's order.
BRICK_FACES = [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
BRICK_EDGES = [(0, 1), (0, 3), (0, 4), (1, 2), (1, 5), (2, 3), (2, 6), (3, 7), (4, 5), (4, 7), (5, 6), (6, 7)]
TET_FACES, TET_EDGES = [(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)], [(0, 1), (1, 2), (2, 0), (3, 0), (3, 2), (3, 1)]
WEDGE_FACES = [(0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)]
SHAPES = {"brick": (BRICK_FACES, []), "brick20": (BRICK_FACES, BRICK_EDGES), "tetrahedron": (TET_FACES, []),
          "tet10": (TET_FACES, TET_EDGES), "wedge": (WEDGE_FACES, [])}
FACE_KINDS = {(3, False): "triangle", (4, False): "quad", (3, True): "triangle6", (4, True): "quad8"}


def cells_of(kind, nodes):
    if kind == "brick":
        return bricks(nodes)
    if kind == "brick20":
        return bricks20(nodes)
    if kind == "wedge":
        return np.concatenate([bricks(nodes)[:, corners] for corners in ([0, 1, 2, 4, 5, 6], [0, 2, 3, 4, 6, 7])])
    step, cells = (2 if kind == "tet10" else 1), []
    for place in itertools.product(*(range(0, size - step, step) for size in nodes.shape)):
        for path in itertools.permutations(np.eye(3, dtype=int) * step):
            corners = np.cumsum([place, *path], axis=0)
            if np.linalg.det(np.stack(path)) < 0:
                corners[[1, 2]] = corners[[2, 1]]
            middles = [(corners[a] + corners[b]) // 2 for a, b in TET_EDGES] if kind == "tet10" else []
            cells.append([nodes[tuple(at)] for at in (*corners, *middles)])
    return np.array(cells)


def box(kind, file):
    """A box of two by two by three cells, and the surfaces x0, x1, y0 to z1 of its sides."""
    mesh, scale = Mesh(), 2 if kind in ("brick20", "tet10") else 1
    nodes = mesh.add_nodes(lattice([scale * n for n in (2, 2, 3)], lambda *at: [s * x for s, x in zip(SIZE, at)]))
    cells, (faces, edges) = cells_of(kind, nodes), SHAPES[kind]
    corners = max(max(face) for face in faces) + 1
    mesh.add("body", kind, cells)
    at = np.array(mesh.nodes)
    for cell in cells:
        middle = {frozenset(ends): cell[corners + i] for i, ends in enumerate(edges)}
        for face in faces:
            around = list(zip(face, face[1:] + face[:1]))
            numbers = [cell[c] for c in face] + [middle[frozenset(ends)] for ends in around if edges]
            for axis, end in itertools.product(range(3), range(2)):
                if np.allclose(at[numbers][:, axis], end * SIZE[axis]):
                    mesh.add(f"{'xyz'[axis]}{end}", FACE_KINDS[len(face), bool(edges)], [numbers])
    mesh.write(file)


def displacements(run, folder, ranks, **tables):
    part = {"name": "body", "young": YOUNG, "density": 1000, **tables.pop("part")}
    scene = write_scene(folder, mesh={"file": "box.msh"}, part=[part], modes={"enabled": False}, estimate={"enabled": False}, **tables)
    return run(scene, ranks=ranks).report["equilibrium"]["probes"]


@pytest.mark.parametrize("kind", SHAPES)
def test_a_pressure_on_a_surface_strains_a_box_between_rollers_evenly(converged, tmp_path, kind):
    """u_z = -p z/E and u_x = nu p x/E lie in the space of every element."""
    box(kind, tmp_path / "box.msh")
    probes = [{"name": "down", "on": "z1", "at": SIZE, "direction": "z"}, {"name": "out", "on": "x1", "at": SIZE, "direction": "x"},
              {"name": "middle", "on": "z1", "at": [SIZE[0] / 2, SIZE[1] / 2, SIZE[2]], "direction": "z"}]
    found = displacements(converged, tmp_path, 2, part={"poisson": 0.3}, probe=probes, pressure=[{"on": "z1", "value": PRESSURE}],
                          support=[{"on": f"{axis}0", "fixed": axis} for axis in "xyz"])
    assert found["down"] == pytest.approx(-PRESSURE / YOUNG * SIZE[2], rel=1e-10)
    assert found["middle"] == pytest.approx(-PRESSURE / YOUNG * SIZE[2], rel=1e-10)
    assert found["out"] == pytest.approx(0.3 * PRESSURE / YOUNG * SIZE[0], rel=1e-10)


@pytest.mark.parametrize("kind", SHAPES)
def test_a_rigid_body_on_a_surface_takes_a_force_beside_its_centre(converged, tmp_path, kind):
    """Without Poisson's ratio a clamped box under a force F at x = a from its axis has u_z = F L/(E A) + F a^2 L/(E I) and
    u_x = -F a L^2/(2 E I) there. These displacements are quadratic, which 4-node tetrahedra and wedges do not have: with
    them the force is at the centre."""
    box(kind, tmp_path / "box.msh")
    bends = kind not in ("tetrahedron", "wedge")
    a, (width, depth, length) = OFFSET if bends else 0.0, SIZE
    area, inertia = width * depth, depth * width**3 / 12
    body = {"name": "cap", "surfaces": "z1", "at": [width / 2 + a, depth / 2, length], "free": "all"}
    found = displacements(converged, tmp_path, 1, part={"poisson": 0.0}, rigid_body=[body], support=[{"on": "z0", "fixed": "all"}],
                          force=[{"on": "cap", "vector": [0, 0, FORCE]}],
                          probe=[{"name": name, "on": "cap", "direction": name} for name in "xyz"])
    assert found["z"] == pytest.approx(FORCE * length / YOUNG * (1 / area + a**2 / inertia), rel=1e-9)
    assert found["x"] == pytest.approx(-FORCE * a * length**2 / (2 * YOUNG * inertia), rel=1e-9, abs=1e-12 * found["z"])
    assert abs(found["y"]) < 1e-12 * found["z"]


def test_a_surface_that_is_not_there_is_named(squeal, tmp_path):
    box("brick", tmp_path / "box.msh")
    body = {"name": "cap", "surfaces": "z2", "at": [0, 0, 0], "free": "all"}
    for key, entry in (("rigid_body", body), ("pressure", {"on": "z2", "value": 1.0}), ("support", {"on": "z2", "fixed": "all"})):
        scene = write_scene(tmp_path, mesh={"file": "box.msh"}, part=[{"name": "body", "young": 1e9, "poisson": 0, "density": 1}], **{key: [entry]})
        run = squeal(scene, "--dry-run", ranks=1)
        assert run.code == 1 and "z2" in run.messages[0] and "did you mean 'z" in run.messages[0]
