"""Supports, pressures and rigid bodies on the named surfaces of every solid element and of mixtures of them, with 3-, 4-, 6-, 8-
and 9-node faces, and on divided meshes."""

import itertools

import numpy as np
import pytest
from models import KINDS, PYRAMIDS, SHAPES, TETS, WEDGES, WHOLE, Mesh, cell_at, lattice, write_scene

KINDS.setdefault("tet10", (11, 3))
SIZE = np.array([0.3, 0.2, 0.5])
YOUNG, PRESSURE, FORCE, OFFSET = 2e9, 3e6, 700.0, 0.04

FACE_KINDS = {3: "triangle", 4: "quad", 6: "triangle6", 8: "quad8", 9: "quad9"}
# The top of the middle layer of a mixture has the diagonals of the tetrahedra above.
UNDER_TETS = [*PYRAMIDS[:5], (4, 5, 6, 8), (4, 6, 7, 8)]
OF_CORNERS = ({8: "brick", 6: "wedge", 5: "pyramid", 4: "tetrahedron"}, {8: "brick20", 6: "wedge15", 5: "pyramid13", 4: "tet10"})
LAYERS = {"brick": [WHOLE] * 3, "wedge": [WEDGES] * 3, "tetrahedron": [TETS] * 3, "pyramid": [PYRAMIDS] * 3, "mixed": [WHOLE, UNDER_TETS, TETS]}
LAYERS |= {"brick20": LAYERS["brick"], "brick27": LAYERS["brick"], "wedge15": LAYERS["wedge"], "tet10": LAYERS["tetrahedron"],
           "pyramid13": LAYERS["pyramid"], "mixed quadratic": LAYERS["mixed"]}
LINEAR = ("tetrahedron", "wedge", "pyramid", "mixed")  # kinds without quadratic displacements


def box(kind, file):
    """A box of two by two by three cells, and the surfaces x0, x1, y0 to z1 of its sides."""
    mesh = Mesh()
    nodes = mesh.add_nodes(lattice([8, 8, 12], lambda *at: [s * x for s, x in zip(SIZE, at)]))
    at = np.array(mesh.nodes)
    for place in itertools.product(range(2), range(2), range(3)):
        for cut in LAYERS[kind][place[2]]:
            shape = kind if kind in SHAPES else OF_CORNERS[kind != "mixed"][len(cut)]
            faces, middles = SHAPES[shape]
            cell = cell_at(place, cut, shape, nodes)
            mesh.add("body", shape, [cell])
            middle = {frozenset(of): cell[len(cut) + i] for i, of in enumerate(middles)}
            for face in faces:
                around = [*map(frozenset, zip(face, face[1:] + face[:1])), frozenset(face)]
                numbers = [cell[c] for c in face] + [middle[of] for of in around if of in middle]
                for axis, end in itertools.product(range(3), range(2)):
                    if np.allclose(at[numbers][:, axis], end * SIZE[axis]):
                        mesh.add(f"{'xyz'[axis]}{end}", FACE_KINDS[len(numbers)], [numbers])
    mesh.write(file)


def displacements(run, folder, ranks, **tables):
    part = {"name": "body", "young": YOUNG, "density": 1000, **tables.pop("part")}
    scene = write_scene(folder, mesh={"file": "box.msh", "refine": tables.pop("refine", 0)}, part=[part], modes={"enabled": False}, estimate={"enabled": False}, **tables)
    return run(scene, ranks=ranks).report["equilibrium"]["probes"]


@pytest.mark.parametrize("refine", [0, 1])
@pytest.mark.parametrize("kind", LAYERS)
def test_a_pressure_on_a_surface_strains_a_box_between_rollers_evenly(converged, tmp_path, kind, refine):
    """u_z = -p z/E and u_x = nu p x/E lie in the space of every element."""
    box(kind, tmp_path / "box.msh")
    probes = [{"name": "down", "on": "z1", "at": SIZE, "direction": "z"}, {"name": "out", "on": "x1", "at": SIZE, "direction": "x"},
              {"name": "middle", "on": "z1", "at": [SIZE[0] / 2, SIZE[1] / 2, SIZE[2]], "direction": "z"}]
    found = displacements(converged, tmp_path, 1 + refine, refine=refine, part={"poisson": 0.3}, probe=probes, pressure=[{"on": "z1", "value": PRESSURE}],
                          support=[{"on": f"{axis}0", "fixed": axis} for axis in "xyz"])
    assert found["down"] == pytest.approx(-PRESSURE / YOUNG * SIZE[2], rel=1e-10)
    assert found["middle"] == pytest.approx(-PRESSURE / YOUNG * SIZE[2], rel=1e-10)
    assert found["out"] == pytest.approx(0.3 * PRESSURE / YOUNG * SIZE[0], rel=1e-10)


@pytest.mark.parametrize("kind", LAYERS)
def test_a_rigid_body_on_a_surface_takes_a_force_beside_its_centre(converged, tmp_path, kind):
    """Without Poisson's ratio a clamped box under a force F at x = a from its axis has u_z = F L/(E A) + F a^2 L/(E I) and
    u_x = -F a L^2/(2 E I) there. These displacements are quadratic, which 4-node tetrahedra, wedges and 5-node pyramids do not
    have: with them the force is at the centre."""
    box(kind, tmp_path / "box.msh")
    bends = kind not in LINEAR
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
