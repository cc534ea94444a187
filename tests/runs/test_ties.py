"""Ties: a beam of two meshes beside the beam of one, in 8- and 20-node bricks, and a strip of shells that shares a block's nodes."""

import numpy as np
import pytest
from models import Mesh, STEEL, bricks, bricks20, lattice, quads, tetrahedra10, triangles6, write_scene

LENGTH, SIDE = 2.0, 0.2


def quads8(nodes):
    """8-node cells of a lattice of twice as many divisions."""
    places = [(0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1)]
    n = [size - 2 for size in nodes.shape]
    return np.stack([nodes[i:n[0] + i:2, j:n[1] + j:2].ravel() for i, j in places], axis=-1)


def part(mesh, name, low, high, divisions, quadratic):
    """A box of the beam from x = low to high; its ends are the surfaces name-low and name-high."""
    scale = 2 if quadratic else 1
    nodes = mesh.add_nodes(lattice([scale * n for n in divisions], lambda x, y, z: (
        low + (high - low) * x, SIDE * (y - 0.5), SIDE * (z - 0.4))))
    mesh.add(name, "brick20" if quadratic else "brick", (bricks20 if quadratic else bricks)(nodes))
    faces = quads8 if quadratic else quads
    for end, face in (("low", nodes[0, ::1, :][:, ::-1]), ("high", nodes[-1])):
        mesh.add(f"{name}-{end}", "quad8" if quadratic else "quad", faces(face))


def frequencies(run, folder, level, quadratic, tied):
    folder.mkdir()
    mesh = Mesh()
    if tied:
        part(mesh, "left", 0, 0.9, [5 * level, 2 * level, 2 * level], quadratic)
        part(mesh, "right", 0.9, LENGTH, [6 * level, 3 * level, 3 * level], quadratic)
    else:
        part(mesh, "whole", 0, LENGTH, [11 * level, 2 * level, 2 * level], quadratic)
    mesh.write(folder / "beam.msh")
    names = ["left", "right"] if tied else ["whole"]
    tables = {"mesh": {"file": "beam.msh"}, "part": [{"name": name, **STEEL} for name in names],
              "modes": {"method": "full", "band": 2000}}
    if tied:
        tables["tie"] = [{"slave": "right-low", "master": "left-high"}]
    report = run(write_scene(folder, **tables), ranks=2 if level == 1 else 1).report
    return np.sort([mode["frequency_hz"] for mode in report["modes"]["modes"]])


@pytest.mark.parametrize("quadratic", [False, True])
def test_a_tied_beam_tends_to_the_beam_of_one_piece(converged, tmp_path, quadratic):
    """Free in space: the six rigid motions are left out as such, so that as many modes remain, and none near zero. The
    difference is of the order of the elements' error, which falls fourfold or more as the elements are halved; twofold
    is asked, since that of single modes is not monotonic."""
    differences = []
    for level in (1, 2):
        one, two = (frequencies(converged, tmp_path / f"{tied}{level}", level, quadratic, tied) for tied in (False, True))
        assert len(one) == len(two) > 5
        assert two[0] > 0.9 * one[0] > 100
        differences.append(np.max(np.abs(two / one - 1)))
    assert differences[1] < differences[0] / 2
    assert differences[1] < (2e-3 if quadratic else 1e-2)


def test_a_tied_surface_whose_faces_bound_nothing_is_refused(squeal, tmp_path):
    """Triangles over the sides of bricks: taken for a curve, they would be tied node by node."""
    mesh = Mesh()
    part(mesh, "left", 0, 1, [2, 2, 2], False)
    part(mesh, "right", 1, 2, [2, 3, 3], False)
    sides = np.array(mesh.groups.pop(("right-low", "quad")))
    mesh.add("right-low", "triangle", np.vstack([sides[:, [0, 1, 2]], sides[:, [0, 2, 3]]]))
    mesh.write(tmp_path / "beam.msh")
    scene = write_scene(tmp_path, mesh={"file": "beam.msh"}, part=[{"name": name, **STEEL} for name in ("left", "right")],
                        tie=[{"slave": "right-low", "master": "left-high"}])
    run = squeal(scene)
    assert run.code == 1
    assert "beam.msh: surface 'right-low': 18 faces are not on an element of any part" in run.messages[0]


def strip_on_a_block(run, folder, cells, solid, held):
    """Modes of a shell that stands out of a block's face, on the block's own nodes."""
    folder.mkdir()
    mesh = Mesh()
    step, solids, face, faces = {"brick": (1, bricks, "quad", quads),
                                 "tetrahedron10": (2, tetrahedra10, "triangle6", triangles6)}[solid]
    nodes = mesh.add_nodes(lattice([step * cells] * 3, lambda x, y, z: (0.1 * x, 0.1 * y, 0.1 * (z - 0.5))))
    mesh.add("block", solid, solids(nodes))
    mesh.add("back", face, faces(nodes[0]))
    shell = mesh.add_nodes(lattice([2 * cells, cells, 0], lambda x, y, z: (0.1 + 0.2 * x, 0.1 * y, 0.0)))[:, :, 0]
    shell[0] = nodes[-1][::step, step * cells // 2]
    mesh.add("strip", "quad", quads(shell))
    mesh.write(folder / "strip.msh")
    tables = {"mesh": {"file": "strip.msh"}, "part": [{"name": "block", **STEEL}, {"name": "strip", "thickness": 0.004, **STEEL}],
              "modes": {"method": "full", "band": 2000}}
    if held:
        tables["support"] = [{"on": "back", "fixed": "all"}]
    report = run(write_scene(folder, **tables), ranks=1 + cells % 2).report
    return np.sort([mode["frequency_hz"] for mode in report["modes"]["modes"]])


def test_shells_share_nodes_with_tetrahedra(converged, tmp_path):
    """The mid-sides of 10-node tetrahedra on the strip's edge follow its nodes: frequencies differ from those on 8-node bricks
    of the same corners by less than these do from bricks half as long. A free body has no mode near zero."""
    def shared(cells, solid, held):
        return strip_on_a_block(converged, tmp_path / f"{solid}{cells}{held}", cells, solid, held)

    for held in (True, False):
        coarse, fine = (shared(cells, "brick", held) for cells in (4, 8))
        found = shared(4, "tetrahedron10", held)
        assert len(found) == len(coarse) > 3
        assert np.max(np.abs(found / coarse - 1)) < np.max(np.abs(fine / coarse - 1)) < 0.03
        assert found[0] > 50
