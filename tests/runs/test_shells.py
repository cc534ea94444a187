"""Shells of 3 to 9 nodes in scenes: in contact, on solids, with a middle surface beside their nodes."""

import subprocess
import sys
import tomllib

import numpy as np
import pytest
from conftest import load_tool
from models import STEEL, Mesh, bricks, bricks20, closed, lattice, quads, triangles6, write_scene

TOOL = load_tool("mesh")
QUIET = {"modes": {"enabled": False}, "estimate": {"enabled": False}}


def with_mid_sides(nodes, middle):
    """8- or 9-node cells of a lattice of twice as many divisions."""
    places = [(0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1), (1, 1)][: 8 + middle]
    n, m = (size - 2 for size in nodes.shape)
    return np.stack([nodes[i : n + i : 2, j : m + j : 2].ravel() for i, j in places], axis=-1)


CELLS = {"quad": quads, "triangle": lambda nodes: np.vstack([quads(nodes)[:, [0, 1, 2]], quads(nodes)[:, [0, 2, 3]]]),
         "triangle6": triangles6, "quad8": lambda nodes: with_mid_sides(nodes, 0), "quad9": lambda nodes: with_mid_sides(nodes, 1)}
every_kind = pytest.mark.parametrize("kind", CELLS)


@every_kind
@pytest.mark.parametrize("refine", [0, 1])
def test_a_plate_under_pressure_lies_flat_on_a_block(converged, tmp_path, kind, refine):
    """Meshes do not match. The load of a face is its pairs' pressure to rounding, so the plate does not bend."""
    pressure, young, height, mesh = 3e5, 1e9, 0.1, Mesh()
    block = mesh.add_nodes(lattice((6, 6, 2), lambda a, b, c: (0.2 * a, 0.2 * b, height * (c - 1))))
    mesh.add("block", "brick20", bricks20(block))
    mesh.add("block_face", "quad8", with_mid_sides(block[:, :, -1], 0))
    plate = mesh.add_nodes(lattice((4, 4), lambda a, b: (0.2 * a, 0.2 * b, 0 * a)))
    mesh.add("plate", kind, CELLS[kind](plate))
    mesh.add("foot", "quad8", with_mid_sides(block[:, :, 0].T, 0))
    mesh.write(tmp_path / "plate.msh")
    scene = write_scene(tmp_path, mesh={"file": "plate.msh", "refine": refine},
                        part=[{"name": "block", "young": young, "poisson": 0.0, "density": 2500}, {"name": "plate", "thickness": 0.002, **STEEL}],
                        support=[{"on": "block", "fixed": "x y"}, {"on": "foot", "fixed": "z"}, {"on": "plate", "fixed": "x y rz"}],
                        pressure=[{"on": "plate", "value": pressure}], friction={"coefficient": 0.3},
                        contact=[{"rotor": "block_face", "stator": "plate", "velocity": [1, 0, 0]}],
                        probe=[{"name": f"{x} {y}", "on": "plate", "at": [x, y, 0], "direction": "z"} for x in (0, 0.1, 0.2) for y in (0, 0.1, 0.2)], **QUIET)
    run = converged(scene, ranks=1 + refine)
    for name, down in run.report["equilibrium"]["probes"].items():
        assert down == pytest.approx(-pressure / young * height, rel=1e-8), name


@every_kind
def test_an_eccentric_pull_bends_a_strip(converged, tmp_path, kind):
    """A force N at nodes that are e beside the middle surface is a moment N e: w = N e L^2/(2 E I), u = N L/(E A) + e N e L/(E I)."""
    length, width, thickness, offset, force, mesh = 0.4, 0.05, 0.004, 0.003, 70.0, Mesh()
    nodes = mesh.add_nodes(lattice((8, 2), lambda x, y: (length * x, width * y, 0 * x)))
    mesh.add("strip", kind, CELLS[kind](nodes))
    mesh.add_points("clamp", nodes[0])
    mesh.add_points("middle", nodes[-1, 1])
    mesh.add_points("corners", nodes[-1, [0, -1]])
    mesh.write(tmp_path / "strip.msh")
    young = STEEL["young"]
    scene = write_scene(tmp_path, mesh={"file": "strip.msh"}, part=[{"name": "strip", "thickness": thickness, "offset": offset, **STEEL, "poisson": 0.0}],
                        support=[{"on": "clamp", "fixed": "all"}, {"on": "strip", "fixed": "rz"}], force=[{"on": group, "vector": [force / 2, 0, 0]} for group in ("middle", "corners")],
                        probe=[{"name": axis, "on": "middle", "direction": axis} for axis in "xyz"], **QUIET)
    found = converged(scene, ranks=1).report["equilibrium"]["probes"]
    area, inertia = width * thickness, width * thickness**3 / 12
    assert found["z"] == pytest.approx(force * offset * length**2 / (2 * young * inertia), rel=1e-8)
    assert found["x"] == pytest.approx(force * length / (young * area) + force * offset**2 * length / (young * inertia), rel=1e-8)


@every_kind
@pytest.mark.parametrize("inside", [False, True])
def test_a_tube_rings_alike_whichever_surface_its_nodes_are_on(converged, tmp_path, kind, inside):
    """Nodes on the inner or the outer surface, half the thickness beside the middle: frequencies of thin shell theory."""
    thickness, mesh = 0.005, Mesh()
    radius = 0.15 + (-0.5 if inside else 0.5) * thickness
    nodes = mesh.add_nodes(lattice((64, 16), lambda a, z: (radius * np.cos(2 * np.pi * a), radius * np.sin(2 * np.pi * a), 0.2 * z)))
    mesh.add("tube", kind, CELLS[kind](closed(nodes)))
    mesh.write(tmp_path / "tube.msh")
    offset = (0.5 if inside else -0.5) * thickness
    scene = write_scene(tmp_path, mesh={"file": "tube.msh"}, part=[{"name": "tube", "thickness": thickness, "offset": offset, **STEEL}],
                        modes={"method": "full", "band": 450}, estimate={"enabled": False})
    report = converged(scene, ranks=1).report
    exact = np.repeat([147.029, 232.922, 415.467], 2)
    assert np.sort([mode["frequency_hz"] for mode in report["modes"]["modes"]]) == pytest.approx(exact, rel=0.01)
    assert report["model"]["parts"][0]["mass"] == pytest.approx(7850 * 2 * np.pi * 0.15 * 0.2 * thickness, rel=0.003)


def test_quadratic_shells_stand_on_quadratic_solids(converged, tmp_path):
    """A strip out of a block's face shares its corners and mid-side nodes: frequencies of 8-node bricks and 4-node shells on the same
    nodes, within 3 %, and none near zero where nothing holds the body."""
    def frequencies(solid, shell, held):
        mesh, cells = Mesh(), 8
        nodes = mesh.add_nodes(lattice([cells] * 3, lambda x, y, z: (0.1 * x, 0.1 * y, 0.1 * (z - 0.5))))
        mesh.add("block", solid, bricks(nodes) if solid == "brick" else bricks20(nodes))
        mesh.add("back", shell, CELLS[shell](nodes[0]))
        strip = mesh.add_nodes(lattice([16, cells], lambda x, y: (0.1 + 0.2 * x, 0.1 * y, 0 * x)))
        strip[0] = nodes[-1][:, cells // 2]
        mesh.add("strip", shell, CELLS[shell](strip))
        mesh.write(tmp_path / "strip.msh")
        scene = write_scene(tmp_path, mesh={"file": "strip.msh"}, part=[{"name": "block", **STEEL}, {"name": "strip", "thickness": 0.004, **STEEL}],
                            support=[{"on": "back", "fixed": "all"}] if held else [], modes={"method": "full", "band": 2000}, estimate={"enabled": False})
        return np.sort([mode["frequency_hz"] for mode in converged(scene, ranks=2 if held else 1).report["modes"]["modes"]])

    for held in (True, False):
        linear, quadratic = frequencies("brick", "quad", held), frequencies("brick20", "quad8", held)
        assert len(quadratic) == len(linear) > 3 and quadratic[0] > 50
        assert quadratic == pytest.approx(linear, rel=0.03)


# an 8-node shell and a 6-node one beside it, whose upper surface has the nodes
PLATE = [(0, 0), (2, 0), (2, 1), (0, 1), (1, 0), (2, .5), (1, 1), (0, .5), (4, 0), (3, 0), (3, .5)]
EIGHT, SIX = [1, 2, 3, 4, 5, 6, 7, 8], [2, 9, 3, 10, 11, 6]


def abaqus_plate():
    nodes = "".join(f"{i}, {x}, {y}, 0\n" for i, (x, y) in enumerate(PLATE, 1))
    return (f"*NODE\n{nodes}*ELEMENT, TYPE=S8R, ELSET=plate\n1, {str(EIGHT)[1:-1]}\n*ELEMENT, TYPE=STRI65, ELSET=plate\n2, {str(SIX)[1:-1]}\n"
            "*MATERIAL, NAME=m\n*ELASTIC\n2e11, 0.25\n*DENSITY\n7800\n*SHELL SECTION, ELSET=plate, MATERIAL=m, OFFSET=SPOS\n0.125\n"
            "*NSET, NSET=base\n1, 4, 8\n*BOUNDARY\nbase, 1, 6\n")


def nastran_plate():
    grids = "".join(f"GRID,{i},,{x:.1f},{y:.1f},0.\n" for i, (x, y) in enumerate(PLATE, 1))
    return (f"BEGIN BULK\n{grids}CQUAD8,1,1,1,2,3,4,5,6\n,7,8,,,,,,-.0625\nCTRIA6,2,1,2,9,3,10,11,6\n,,-.0625\n"
            "PSHELL,1,1,.125,1\nMAT1,1,2.+11,,.25,7800.\nSPC1,1,123456,1,4,8\n")


def ansys_plate():
    nodes = "".join(f"{i:9d}{0:9d}{0:9d}{x:21.13E}{y:21.13E}\n" for i, (x, y) in enumerate(PLATE, 1))
    cells = [(1, EIGHT), (2, [2, 9, 3, 3, 10, 11, 3, 6])]
    rows = "".join("".join(f"{v:9d}" for v in [1, 1, 1, 1, 0, 0, 0, 0, 8, 0, n, *of]) + "\n" for n, of in cells)
    held = "".join(f"D,{n},ALL,0.\n" for n in (1, 4, 8))
    return (f"/PREP7\nET,1,281\nNBLOCK,6,SOLID,11,11\n(3i9,6e21.13e3)\n{nodes}N,R5.3,LOC,       -1,\nEBLOCK,19,SOLID,2,2\n(19i9)\n{rows}       -1\n"
            "SECTYPE,1,SHELL\nSECDATA,0.125,1\nSECOFFSET,TOP\nMPDATA,R5.0, 1,EX  ,     1, 1, 2.00000000E+11    ,\n"
            f"MPDATA,R5.0, 1,NUXY,     1, 1, 0.250000000    ,\nMPDATA,R5.0, 1,DENS,     1, 1, 7800.00000    ,\n{held}FINISH\n")


def test_a_plate_of_quadratic_shells_from_three_decks_and_back(converged, tmp_path):
    """Offsets by half of the thickness, by OFFSET, ZOFFS and SECOFFSET of SHELL281; the writer's deck has the same shells."""
    def frequencies(text, name):
        (tmp_path / name).write_text(text)
        subprocess.run([sys.executable, TOOL.__file__, tmp_path / name, tmp_path / f"of_{name}"], check=True)
        scene = tmp_path / f"of_{name}" / "scene.toml"
        part, = tomllib.loads(scene.read_text())["part"]
        assert part["thickness"] == 0.125 and part["offset"] == -0.0625 and "Not taken over" not in scene.read_text()
        settings = ("modes.method=full", "modes.band=900", "estimate.enabled=false")
        report = converged(scene, *(word for setting in settings for word in ("--set", setting)), ranks=1).report
        return scene, np.sort([mode["frequency_hz"] for mode in report["modes"]["modes"]])

    scene, expected = frequencies(abaqus_plate(), "plate.inp")
    assert len(expected) > 3
    for text, name in ((nastran_plate(), "plate.bdf"), (ansys_plate(), "plate.cdb")):
        assert frequencies(text, name)[1] == pytest.approx(expected, rel=1e-10)
    subprocess.run([sys.executable, TOOL.__file__, scene, tmp_path / "back.inp", "--to", "inp"], check=True)
    assert frequencies((tmp_path / "back.inp").read_text(), "again.inp")[1] == pytest.approx(expected, rel=1e-10)


def test_shells_of_two_orders_side_by_side_are_refused(squeal, tmp_path):
    """A mid-side node on the edge of a 4-node shell would hang."""
    mesh = Mesh()
    left = mesh.add_nodes(lattice((2, 2), lambda x, y: (x, y, 0 * x)))
    right = mesh.add_nodes([(2, 0, 0), (2, 1, 0)])
    mesh.add("left", "quad8", with_mid_sides(left, 0))
    mesh.add("right", "quad", [[left[2, 0], right[0], right[1], left[2, 2]]])
    mesh.write(tmp_path / "two.msh")
    run = squeal(write_scene(tmp_path, mesh={"file": "two.msh"}, part=[{"name": name, "thickness": 0.1, **STEEL} for name in ("left", "right")]),
                 "--dry-run", ranks=1)
    assert run.code == 1 and "part 'left' has the mid-side node" in run.messages[0] and "by elements of one order" in run.messages[0]


def test_an_offset_is_for_shells(squeal, tmp_path):
    mesh = Mesh()
    mesh.add("block", "brick20", bricks20(mesh.add_nodes(lattice((2, 2, 2), lambda *at: at))))
    mesh.write(tmp_path / "block.msh")
    run = squeal(write_scene(tmp_path, mesh={"file": "block.msh"}, part=[{"name": "block", "offset": 0.1, **STEEL}]), "--dry-run", ranks=1)
    assert run.code == 1 and "offset is for shells" in run.messages[0] and "scene.toml, line" in run.messages[0]
