"""Every keyword that inputs/FORMATS.md names is in a deck of the tests; those that no other test has; STEP against a .geo."""

import re
import subprocess
import sys
import tomllib

import numpy as np
import pytest
from conftest import INPUTS
from models import STEEL, write_scene
from test_decks import BRICK_ROWS, BRICKS, GRIDS, RUBBING, TOOL, cdb, converted

TESTS = INPUTS.parent / "tests/runs"
LID = "*NSET, NSET=lid\n13,14,15,16\n"
REGIONS = "BSURFS,1,,,,1,5,6,7\nBSURFS,2,,,,2,9,10,11\n"
FRAME = "CORD2R,5,,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\n"


def test_every_keyword_of_the_table_of_formats_is_in_a_deck():
    """Keywords of Abaqus have stars; cards and commands are words of capitals and digits."""
    decks = "".join(file.read_text() for file in TESTS.glob("test_*.py")).replace("\\n", "\n").upper()
    words, code = set(), ""
    for row in (INPUTS / "FORMATS.md").read_text().split("\n## Matrices")[0].splitlines():
        if row.startswith("| "):
            code = row.split("|")[1].strip() or code
            words |= set(re.findall(r"`\*([A-Z][A-Z -]+)`", row))
            if code.startswith(("Nastran", "Ansys")):
                words |= set(re.findall(r"\b[A-Z]{2,}[A-Z0-9]*\b", row.split("|", 2)[2]))
    assert len(words) > 150
    lost = [word for word in sorted(words) if not re.search(rf"(?<![A-Z0-9]){word}(?![A-Z])", decks)]
    assert lost == []


@pytest.mark.parametrize("text, table, expected", [
    (LID + "*KINEMATIC COUPLING, REF NODE=100\nlid, 1, 6\n", "rigid_body",
     [{"name": "node_100", "surfaces": "lid", "at": [0.5, 0.5, 3], "free": "all"}]),
    ("*COUPLING, REF NODE=100, SURFACE=high_top, CONSTRAINT NAME=c\n*KINEMATIC\n*ELEMENT, TYPE=ROTARYI, ELSET=r\n50, 100\n"
     "*ROTARY INERTIA, ELSET=r\n1., 2., 3.\n", "rigid_body",
     [{"name": "c", "surfaces": "high_top", "at": [0.5, 0.5, 3], "inertia": [1, 2, 3, 0, 0, 0], "free": "all"}]),
    (RUBBING + "*CLEARANCE, SLAVE=high_bottom, MASTER=low_top, VALUE=0.01\n", "contact",
     [{"rotor": "low_top", "stator": "high_bottom", "friction": 0, "compliance": 1e-12, "gap": 0.01}]),
])
def test_keywords_of_an_input_deck(tmp_path, text, table, expected):
    scene, left_out = converted(tmp_path, BRICKS + text)
    assert scene[table] == expected and left_out == []


@pytest.mark.parametrize("text, table, expected", [
    ("CDAMP2,9,40.,13,2\n", "spring", [{"from": "node_13", "direction": "y", "damping": 40}]),
    ("PDAMP,3,40.\nCDAMP1,9,3,13,2,100,2\n", "spring", [{"from": "node_13", "to": "node_100", "direction": "y", "damping": 40}]),
    ("RBAR,9,101,100,123456,,,123456\n", "connector", [{"from": "node_101", "to": "node_100", "locked": "all"}]),
    ("PBEAM,3,1,4.-2,1.-4,2.-4,,3.-4\nCBEAM,9,3,100,101,1.,0.,0.\n", "beam",
     [{"name": "bar_9", "from": "node_100", "to": "node_101", "young": 2e11, "poisson": 0.25, "density": 7800, "area": 0.04,
       "bending": [1e-4, 2e-4], "torsion": 3e-4, "elements": 1, "axis_2": [1, 0, 0]}]),
    (REGIONS + "BGSET,4,1,2,.1\nBGSET,5,2,1,.1\nBGADD,7,4\n", "tie", [{"slave": "region_1", "master": "region_2"}]),
    ("GRID,30,,.5,.5,-1.\nCPYRA,5,1,4,3,2,1,30\n", "support", [{"on": "spc_1_123", "fixed": "x y z"}]),
])
def test_cards_of_bulk_data(tmp_path, text, table, expected):
    glued = "BGADD" in text
    scene, left_out = converted(tmp_path, "BGSET = 7\nBEGIN BULK\n" * glued + GRIDS + text, "deck.bdf")
    assert scene[table] == expected and len(left_out) == glued
    assert ("pyramid5" in {kind for kind, _ in TOOL.read_deck(tmp_path / "deck.bdf").elements.values()}) == ("CPYRA" in text)


def test_axes_of_a_property_turn_an_orthotropic_material(tmp_path):
    turned = FRAME.replace(",1.,0.,0.", ",0.,1.,0.")  # its x is the basic y
    law = "MATORT,9,5.+9,4.+9,3.+9,.1,.3,.12,2500.\n,2.+9,1.+9,3.+9\n"
    scene, left_out = converted(tmp_path, GRIDS.replace("PSOLID,2,1", "PSOLID,2,9,5") + turned + law, "deck.fem")  # CORDM is 5
    part = scene["part"][1]
    assert part["orthotropic"] == {"young": [5e9, 4e9, 3e9], "poisson": [0.1, pytest.approx(0.2), 0.3], "shear": [2e9, 3e9, 1e9],
                                   "axis_1": [0, 1, 0], "axis_2": [-1, 0, 0]}
    assert part["density"] == 2500 and left_out == []


def test_old_solids_and_damping_of_all_of_ansys(tmp_path):
    """SOLID45, ALPHAD and BETAD; TARGE170 and CONTA174 are in the decks of test_decks."""
    scene, _ = converted(tmp_path, cdb(BRICK_ROWS, "ALPHAD,3.\nBETAD,2E-7\n").replace("ET,1,185", "ET,1,45"), "deck.cdb")
    assert len(scene["part"]) == 1 and (scene["part"][0]["alpha"], scene["part"][0]["beta"]) == (3, 2e-7)


def test_a_step_file_rings_as_the_same_geometry(converged, tmp_path):
    """A clamped plate of 40 x 20 x 5 mm meshed anew by both ways: lowest frequencies within what half the size changes, and a bit."""
    def frequencies(folder, mesh, clamp, part):
        scene = write_scene(folder, mesh=mesh, part=[{"name": part, **STEEL}], support=[{"on": clamp, "fixed": "all"}],
                            modes={"method": "full", "band": 20000}, estimate={"enabled": False})
        return np.sort([mode["frequency_hz"] for mode in converged(scene, ranks=1).report["modes"]["modes"]])[:4]

    box = 'SetFactory("OpenCASCADE");\nBox(1) = {0, 0, 0, 40, 20, 5};\n'
    (tmp_path / "plate.geo").write_text(box)
    subprocess.run(["gmsh", "plate.geo", "-0", "-o", "plate.step", "-v", "1"], cwd=tmp_path, check=True)
    by_size = {}
    for size in (5, 2.5):
        folder = tmp_path / f"geo{size}"
        folder.mkdir()
        (folder / "plate.geo").write_text(box + f'Physical Volume("plate") = {{1}}; Physical Surface("root") = {{1}};\n'
                                          f"Mesh.MeshSizeMax = {size}; Mesh.MeshSizeMin = {size}; Mesh.ElementOrder = 2;\n")
        by_size[size] = frequencies(folder, {"file": "plate.geo", "scale": 0.001}, "root", "plate")
    subprocess.run([sys.executable, TOOL.__file__, tmp_path / "plate.step", tmp_path / "of_step", "--size", "5", "--length", "0.001"], check=True)
    model = TOOL.read_deck(tmp_path / "plate.step", 5.0)
    root, = (name for name, faces in model.surfaces.items() if all(abs(model.nodes[n][0]) < 1e-9 for face in faces for n in face))
    written = tomllib.loads((tmp_path / "of_step" / "scene.toml").read_text())
    found = frequencies(tmp_path / "of_step", written["mesh"], root, written["part"][0]["name"])
    assert len(found) == 4 and np.all(np.abs(found - by_size[5]) <= 2 * np.abs(by_size[5] - by_size[2.5]) + 1e-4 * found)
