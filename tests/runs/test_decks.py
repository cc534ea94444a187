"""tools/mesh: what decks say beside their mesh becomes tables of a scene that runs without an edit."""

import re
import subprocess
import sys
import tomllib

import numpy as np
import pytest
from conftest import load_tool
from models import SHAPES

TOOL = load_tool("mesh")
# two bricks of edge 1 above each other, which share no node: the upper one slides on the lower one
AT = [(x, y, z) for z in (0, 1, 1, 2) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
NODES = "*NODE\n" + "".join(f"{i}, {x}, {y}, {z}\n" for i, (x, y, z) in enumerate(AT, 1))
BRICKS = NODES + (
    "100, 0.5, 0.5, 3\n101, 0.5, 0.5, 5\n*ELEMENT, TYPE=C3D8, ELSET=low\n1, 1,2,3,4,5,6,7,8\n"
    "*ELEMENT, TYPE=C3D8, ELSET=high\n2, 9,10,11,12,13,14,15,16\n*SURFACE, NAME=low_top\nlow, S2\n*SURFACE, NAME=high_bottom\nhigh, S1\n"
    "*SURFACE, NAME=high_top\nhigh, S2\n*NSET, NSET=base\n1,2,3,4\n*NSET, NSET=all_low, ELSET=low\n*MATERIAL, NAME=m\n*ELASTIC\n2e11, 0.25\n"
    "*DENSITY\n7800\n*SOLID SECTION, ELSET=low, MATERIAL=m\n*SOLID SECTION, ELSET=high, MATERIAL=m\n*BOUNDARY\nbase, 1, 3\n")
GRIDS = "".join(f"GRID,{i},,{x}.,{y}.,{z}.\n" for i, (x, y, z) in enumerate(AT, 1)) + (
    "GRID,100,,.5,.5,3.\nGRID,101,,.5,.5,5.\nCHEXA,1,1,1,2,3,4,5,6\n,7,8\nCHEXA,2,2,9,10,11,12,13,14\n,15,16\nPSOLID,1,1\nPSOLID,2,1\n"
    "MAT1,1,2.+11,,.25,7800.\nSPC1,1,123,1,2,3,4\n")


def converted(tmp_path, text, name="deck.inp", words=()):
    """The scene of a deck, and what was left out."""
    (tmp_path / name).write_text(text)
    old = sys.argv
    sys.argv = ["mesh", str(tmp_path / name), str(tmp_path / "out"), *words]
    (tmp_path / "out" / "scene.toml").unlink(missing_ok=True)
    try:
        TOOL.main()
    finally:
        sys.argv = old
    written = (tmp_path / "out" / "scene.toml").read_text()
    return tomllib.loads(written), [line[18:] for line in written.splitlines() if line.startswith("# Not taken over: ")]


def test_couplings_masses_and_loads_of_reference_nodes(tmp_path, squeal):
    """In mm, N and t: a rigid coupling with a mass, a spring to the ground and a force, held but along z."""
    scene, left_out = converted(tmp_path, BRICKS + (
        "*NSET, NSET=hand\n100\n*COUPLING, CONSTRAINT NAME=grip, REF NODE=hand, SURFACE=HIGH_TOP\n*KINEMATIC\n1, 6\n"
        "*ELEMENT, TYPE=MASS, ELSET=lump\n50, 100\n*MASS, ELSET=lump\n3\n*ELEMENT, TYPE=SPRING1, ELSET=soft\n51, 100\n"
        "*SPRING, ELSET=soft\n3\n2e6\n*BOUNDARY\nhand, 1, 2\nhand, 4, 6\n*STEP\n*STATIC\n*CLOAD\nhand, 3, -7\n*END STEP\n"), words=("--length", "0.001"))
    assert left_out == []
    assert scene["rigid_body"] == [{"name": "grip", "surfaces": "high_top", "at": [0.0005, 0.0005, 0.003], "mass": 3000, "free": "z"}]
    assert scene["spring"] == [{"from": "grip", "direction": "z", "stiffness": 2e9}]
    assert scene["force"] == [{"on": "grip", "vector": [0, 0, -7]}]
    assert scene["support"] == [{"on": "base", "fixed": "x y z"}]
    assert squeal(tmp_path / "out" / "scene.toml", "--dry-run", ranks=1).code == 0


@pytest.mark.parametrize("text, table, expected", [
    ("*COUPLING, REF NODE=100, SURFACE=high_top, CONSTRAINT NAME=c\n*DISTRIBUTING\n1, 3\n*CLOAD\n100, 6, 4\n", "coupling",
     [{"name": "c", "on": "high_top", "at": [0.5, 0.5, 3]}]),
    ("*COUPLING, REF NODE=100, SURFACE=high_top, CONSTRAINT NAME=c\n*KINEMATIC\n1, 2\n", "rigid_body",
     [{"name": "c", "surfaces": "high_top", "at": [0.5, 0.5, 3], "free": "all", "motions": "x y"}]),
    ("*NSET, NSET=lid\n13,14,15,16\n*MPC\nBEAM, lid, 100\n", "rigid_body",
     [{"name": "node_100", "surfaces": "lid", "at": [0.5, 0.5, 3], "free": "all"}]),
    ("*NSET, NSET=lid\n13,14,15,16\n*RIGID BODY, NSET=lid, REF NODE=100\n", "rigid_body",
     [{"name": "node_100", "surfaces": "lid", "at": [0.5, 0.5, 3], "free": "all"}]),
    ("*MPC\nBEAM, 101, 100\n", "connector", [{"from": "node_101", "to": "node_100", "locked": "all"}]),
    ("*NODE\n102, 0.5, 0.5, 3\n*EQUATION\n2\n100, 3, 1., 102, 3, -1.\n", "connector", [{"from": "node_100", "to": "node_102", "locked": "z"}]),
    ("*ELEMENT, TYPE=SPRINGA, ELSET=s\n50, 13, 100\n*SPRING, ELSET=s\n\n5e6\n", "spring",
     [{"from": "node_13", "to": "node_100", "direction": [0.5, 0.5, 1], "stiffness": 5e6}]),
    ("*ELEMENT, TYPE=SPRING2, ELSET=s\n50, 101, 100\n*SPRING, ELSET=s\n5, 5\n8\n", "connector",
     [{"from": "node_101", "to": "node_100", "stiffness": [0, 0, 0, 0, 8, 0]}]),
    ("*ELEMENT, TYPE=DASHPOT1, ELSET=s\n50, 13\n*DASHPOT, ELSET=s\n2\n40\n", "spring", [{"from": "node_13", "direction": "y", "damping": 40}]),
    ("*ELEMENT, TYPE=MASS, ELSET=s\n50, 13\n51, 14\n*MASS, ELSET=s\n0.5\n", "mass", [{"on": "s_masses", "mass": 1}]),
    ("*ELEMENT, TYPE=B31, ELSET=pin\n50, 100, 101\n*BEAM SECTION, ELSET=pin, SECTION=CIRC, MATERIAL=m\n0.1\n0,1,0\n", "beam",
     [{"name": "pin_50", "from": "node_100", "to": "node_101", "young": 2e11, "poisson": 0.25, "density": 7800, "diameter": 0.2, "elements": 1}]),
    ("*CLOAD\nbase, 2, 2.5\n", "force", [{"on": "base", "vector": [0, 10, 0]}]),
    ("*DSLOAD\nhigh_top, P, 3e5\n", "pressure", [{"on": "high_top", "value": 3e5}]),
    ("*DLOAD\nhigh, P2, 3e5\n", "pressure", [{"on": "high_P2", "value": 3e5}]),
    ("*TRANSFORM, NSET=base, TYPE=C\n0.5,0.5,0, 0.5,0.5,1\n", "support",
     [{"on": "base", "fixed": "x y z"}]),
    ("*NSET, NSET=rim\n13,14,15,16\n*TRANSFORM, NSET=rim, TYPE=C\n0.5,0.5,0, 0.5,0.5,1\n*BOUNDARY\nrim, 1\n", "support",
     [{"on": "base", "fixed": "x y z"}, {"on": "rim", "fixed": "x", "cylinder": {"axis": [0, 0, 1], "centre": [0.5, 0.5, 0]}}]),
    ("*BOUNDARY\n100, 1, 6\n100, 3, 3, 0.002\n*COUPLING, REF NODE=100, SURFACE=high_top\n*KINEMATIC\n", "support",
     [{"on": "node_100", "fixed": "z", "displacement": [0, 0, 0.002], "rotation": [0, 0, 0]}, {"on": "base", "fixed": "x y z"}]),
])
def test_keywords_of_an_input_deck(tmp_path, text, table, expected):
    scene, left_out = converted(tmp_path, BRICKS + text)
    assert scene[table] == expected and left_out == []


def test_gravity_and_axes_of_materials(tmp_path):
    axes = "*ORIENTATION, NAME=o, SYSTEM=CYLINDRICAL\n0,0,0, 0,0,1\n*MATERIAL, NAME=n\n*ELASTIC, TYPE=ENGINEERING CONSTANTS\n"
    axes += "5e9,4e9,3e9,.1,.2,.3,2e9,1e9,\n3e9\n*DENSITY\n2500\n*SOLID SECTION, ELSET=high, MATERIAL=n, ORIENTATION=o\n"
    scene, left_out = converted(tmp_path, BRICKS + axes + "*ELSET, ELSET=both\nlow, high\n*DLOAD\nboth, GRAV, 9.81, 0, 0, -2\n")
    assert scene["gravity"] == [0, 0, -9.81] and left_out == []
    assert scene["part"][1] == {"name": "high", "density": 2500, "orthotropic": {
        "young": [5e9, 4e9, 3e9], "poisson": [0.1, 0.2, 0.3], "shear": [2e9, 1e9, 3e9], "cylinder": {"axis": [0, 0, 1], "centre": [0, 0, 0]}}}


RUBBING = ("*SURFACE INTERACTION, NAME=rub\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n1e12\n*FRICTION\n0.\n"
           "*CONTACT PAIR, INTERACTION=rub\nhigh_bottom, low_top\n")


def test_steps_friction_and_motion(tmp_path, squeal):
    """Pressure in two steps at rest, then rotation with friction, then modes: the last step's values, and factors of the others."""
    scene, left_out = converted(tmp_path, BRICKS + RUBBING + (
        "*STEP, NAME=touch\n*STATIC\n*DSLOAD\nhigh_top, P, 1e5\n*END STEP\n*STEP, NAME=press\n*STATIC\n*DSLOAD\nhigh_top, P, 4e5\n*END STEP\n"
        "*STEP, NAME=turn\n*STATIC\n*MOTION, ROTATION, TYPE=VELOCITY\nall_low, 20., 0,0,0, 0,0,1\n*CHANGE FRICTION, INTERACTION=rub\n"
        "*FRICTION, EXPONENTIAL DECAY\n0.5, 0.4, 2.\n*END STEP\n*STEP\n*FREQUENCY\n20, , 9000.\n*END STEP\n"
        "*STEP\n*COMPLEX FREQUENCY\n20, , 8000.\n*END STEP\n*BOUNDARY\nhigh_top, 1, 2\n*NSET, NSET=high_top\n13,14,15,16\n"))
    assert left_out == [] and scene["modes"] == {"band": 8000}
    assert scene["contact"] == [{"rotor": "low_top", "stator": "high_bottom", "friction": 0.4, "compliance": 1e-12,
                                 "static_coefficient": 0.5, "decay_speed": 0.5,
                                 "rotation": {"axis": [0, 0, 1], "centre": [0, 0, 0], "rate": 20}}]
    assert scene["pressure"] == [{"on": "high_top", "value": 4e5}]
    assert scene["step"] == [{"name": "touch", "pressures": [0.25], "friction": 0}, {"name": "press", "friction": 0}, {"name": "turn"}]
    assert squeal(tmp_path / "out" / "scene.toml", "--dry-run", ranks=1).code == 0


def test_the_moving_side_is_the_rotor(tmp_path):
    """Also where it is the slave; a contact of no moving side sticks or slips by itself."""
    more = "*MOTION, TRANSLATION, TYPE=VELOCITY\nall_high, 2, 3.\n*NSET, NSET=all_high, ELSET=high\n"
    scene, _ = converted(tmp_path, BRICKS + RUBBING + more)
    assert scene["contact"] == [{"rotor": "high_bottom", "stator": "low_top", "slave": "rotor", "friction": 0, "compliance": 1e-12, "velocity": [0, 3, 0]}]
    scene, _ = converted(tmp_path, BRICKS + RUBBING)
    assert set(scene["contact"][0]) == {"rotor", "stator", "friction", "compliance"}


def test_bolts(tmp_path, squeal):
    """By a surface across a shank of two bricks, tightened in the first step and kept in the second."""
    shank = NODES + (
        "200, 0,0,4\n201, 1,0,4\n202, 1,1,4\n203, 0,1,4\n300, 0,0,0\n*ELEMENT, TYPE=C3D8, ELSET=bolt\n1, 9,10,11,12,13,14,15,16\n"
        "2, 13,14,15,16,200,201,202,203\n*MATERIAL, NAME=m\n*ELASTIC\n2e11, 0.25\n*DENSITY\n7800\n*SOLID SECTION, ELSET=bolt, MATERIAL=m\n"
        "*SURFACE, NAME=cut\n1, S2\n*NSET, NSET=ends\n9,10,11,12,200,201,202,203\n*BOUNDARY\nends, 1, 3\n"
        "*PRE-TENSION SECTION, SURFACE=cut, NODE=300\n")
    steps = "*STEP\n*STATIC\n*CLOAD\n300, 1, 5000.\n*END STEP\n*STEP\n*STATIC\n*BOUNDARY, FIXED\n300, 1, 1\n*END STEP\n"
    scene, left_out = converted(tmp_path, shank + steps)
    assert left_out == [] and "step" not in scene
    assert scene["bolt"] == [{"name": "bolt_300", "section": "cut", "tension": 5000, "axis": [0, 0, -1]}]
    assert squeal(tmp_path / "out" / "scene.toml", "--dry-run", ranks=1).code == 0


def test_nodes_and_elements_that_keywords_make(tmp_path):
    """A row of bricks by *NGEN, *NFILL, *ELGEN and *ELCOPY in a turned *SYSTEM, and a node in cylindrical coordinates."""
    text = ("*SYSTEM\n10,0,0, 10,1,0\n9,0,0\n*NODE\n1, 0,0,0\n5, 4,0,0\n21, 0,1,0\n25, 4,1,0\n*NGEN, NSET=front\n1, 5\n*NGEN, NSET=back\n21, 25, 1\n"
            "*NCOPY, CHANGE NUMBER=100, OLD SET=front, NEW SET=front_top, SHIFT\n0,0,1\n,\n*NCOPY, CHANGE NUMBER=100, OLD SET=back, NEW SET=back_top, SHIFT\n0,0,1\n,\n"
            "*SYSTEM\n*NODE, SYSTEM=C\n500, 2, 90, 1\n*NODE\n600, 0,0,0\n602, 0,4,0\n*NSET, NSET=p\n600\n*NSET, NSET=q\n602\n*NFILL, NSET=mid\np, q, 2, 1\n"
            "*ELEMENT, TYPE=C3D8\n1, 1,2,22,21, 101,102,122,121\n*ELGEN, ELSET=row\n1, 2, 1, 1\n*ELCOPY, OLD SET=row, NEW SET=more, SHIFT NODES=2, ELEMENT SHIFT=10\n")
    (tmp_path / "deck.inp").write_text(text)
    model = TOOL.read_deck(tmp_path / "deck.inp")
    for number, at in {1: (10, 0, 0), 3: (10, 2, 0), 23: (9, 2, 0), 123: (9, 2, 1), 500: (0, 2, 1), 601: (0, 2, 0)}.items():
        assert np.allclose(model.nodes[number], at, rtol=0, atol=1e-15), number
    assert {n: nodes[:2] for n, (_, nodes) in model.elements.items()} == {1: (1, 2), 2: (2, 3), 11: (3, 4), 12: (4, 5)}
    assert model.notes == [f"the set {name}, whose nodes no element has" for name in ("mid", "p", "q")]


@pytest.mark.parametrize("card, table, expected", [
    ("RBE2,7,100,123456,13,14,15,16\nCONM2,8,100,,5.,,,,\n,1.,,2.,,,3.\n", "rigid_body",
     [{"name": "rbe2_7_node", "surfaces": "rbe2_7", "at": [0.5, 0.5, 3], "mass": 5, "inertia": [1, 2, 3, 0, 0, 0], "free": "all"}]),
    ("RBE2,7,100,123,13,14,15,16\nSPC1,1,1246,100\n", "rigid_body",
     [{"name": "rbe2_7_node", "surfaces": "rbe2_7", "at": [0.5, 0.5, 3], "free": "z ry", "motions": "x y z"}]),
    ("RBE3,7,,100,123456,1.,123,13,14\n,15,16\nMOMENT,2,100,,3.,0.,0.,1.\n", "coupling",
     [{"name": "rbe3_7_node", "on": "rbe3_7", "at": [0.5, 0.5, 3]}]),
    ("CELAS2,9,4.+6,13,2\n", "spring", [{"from": "node_13", "direction": "y", "stiffness": 4e6}]),
    ("PELAS,3,4.+6\nCELAS1,9,3,13,2,100,2\n", "spring", [{"from": "node_13", "to": "node_100", "direction": "y", "stiffness": 4e6}]),
    ("PBUSH,3,K,1.,2.,3.,4.,5.,6.\n,B,7.,8.,9.\nCBUSH,9,3,100,101,0\n", "connector", None),
    ("PBUSH,3,K,1.,2.,3.,4.,5.,6.\n,B,7.,8.,9.\nCBUSH,9,3,100,101,1.,0.,0.\n", "connector",
     [{"from": "node_100", "to": "node_101", "stiffness": [1, 2, 3, 4, 5, 6], "damping": [7, 8, 9, 0, 0, 0], "axis_1": [0, 0, 1], "axis_2": [1, 0, 0]}]),
    ("PBAR,3,1,4.-2,1.-4,2.-4,3.-4\nCBAR,9,3,100,101,1.,0.,0.\n", "beam",
     [{"name": "bar_9", "from": "node_100", "to": "node_101", "young": 2e11, "poisson": 0.25, "density": 7800, "area": 0.04,
       "bending": [1e-4, 2e-4], "torsion": 3e-4, "elements": 1, "axis_2": [1, 0, 0]}]),
    ("PLOAD4,2,2,3.+5,,,,13,15\n", "pressure", [{"on": "pressed", "value": 3e5}]),
    ("FORCE,2,13,,2.,0.,0.,-1.\nFORCE,2,13,,1.,1.,0.,0.\n", "force", [{"on": "node_13", "vector": [1, 0, -2]}]),
    ("CORD2C,5,,.5,.5,0.,.5,.5,1.\n,1.5,.5,0.\nGRID,13,,0.,0.,2.,5\nSPC1,1,1,13\n", "support",
     [{"on": "spc_1_123", "fixed": "x y z"}, {"on": "spc_1_1_in_5", "fixed": "x", "cylinder": {"axis": [0, 0, 1], "centre": [0.5, 0.5, 0]}}]),
])
def test_cards_of_bulk_data(tmp_path, card, table, expected):
    grids = GRIDS.replace("GRID,13,,0.,0.,2.\n", "") if "GRID,13" in card else GRIDS
    scene, left_out = converted(tmp_path, grids + card, "deck.bdf")
    if expected is None:
        assert table not in scene and "without an orientation" in left_out[0]
    else:
        assert scene[table] == expected and left_out == []


@pytest.mark.parametrize("section, axis", [("PRETENS,5,,21", [0, 0, -1]), ("PRETENS,5,,21,VECTOR,0.,0.,-2.", [0, 0, -2]),
                                           ("PRETENS,5,,21,GRIDS,13,14,15", [0, 0, 1]), ("PRETENS,5,,21,CID,4", [0, 0, 1]),
                                           ("PRETENS,5,9", None), ("BOLT,5,1,9", None)])
def test_bolts_of_optistruct_and_simcenter(tmp_path, squeal, section, axis):
    """Across a shank of two bricks, or along a bar: by the force that the case control selects, alone or in a sum."""
    shank = GRIDS + ("GRID,17,,0.,0.,4.\nGRID,18,,1.,0.,4.\nGRID,19,,1.,1.,4.\nGRID,20,,0.,1.,4.\nCHEXA,3,2,13,14,15,16,17,18\n,19,20\n"
                     "SURF,21,ELFACE\n,2,13,15\nPBAR,3,1,4.-2,1.-4,2.-4,3.-4\nCBAR,9,3,100,101,1.,0.,0.\nRBE2,7,100,123456,17,18,19,20\n"
                     "SPC1,1,123456,101\nSPC1,1,123,9,10,11,12\nCORD2R,4,,0.,0.,0.,1.,0.,0.\n,0.,0.,1.\n")
    force = "BOLTFOR,70,500.,5" if section.startswith("BOLT") else "PTFORC1,70,500.,5\nPTADD,72,70\nPTFORCE,71,5,900."
    case = "SUBCASE 1\n  BOLTLD = 70\n" if section.startswith("BOLT") else "SUBCASE 1\n  PRETENSION = 72\n"
    scene, left_out = converted(tmp_path, f"{case}BEGIN BULK\n{shank}{section}\n{force}\n", "deck.fem")
    assert scene["bolt"] == [{"name": "bolt_5", **({"section": "surf_21", "axis": axis} if axis else {"beam": "bar_9"}), "tension": 500}]
    assert left_out == ([] if section.startswith("BOLT") else ["forces of bolts 71, which the case control does not select"])
    assert squeal(tmp_path / "out" / "scene.toml", "--dry-run", ranks=1).code == 0


@pytest.mark.parametrize("card, words", [
    ("PBAR,3,1,4.-2,1.-4,2.-4,3.-4\nCBAR,9,3,100,101,1.,0.,0.\n,45\n", "released motions of CBAR 9"),
    ("PBAR,3,1,4.-2,1.-4,2.-4,3.-4\nCBAR,9,3,100,101,1.,0.,0.\n,,,,,1.\n", "offsets of CBAR 9"),
    ("PELAS,3,5.,.1\nCELAS1,9,3,100,1\n", "loss factor .1 of CELAS1 9"), ("CELAS2,9,5.,100,1,,,.1\n", "loss factor .1 of CELAS2 9"),
    ("CONM2,9,100,3,5.\n", "coordinate system 3 of CONM2 9"), ("PBUSH,3,K,1.,,,,,\n,RCV,1.\nCBUSH,9,3,100,101,1.,0.,0.\n", "RCV of PBUSH 3"),
])
def test_fields_that_no_scene_has_are_said(tmp_path, card, words):
    _, left_out = converted(tmp_path, GRIDS + card, "deck.bdf")
    assert len(left_out) == 1 and words in left_out[0]


@pytest.mark.parametrize("card", ["EIGRL,5,,9000.\n", "EIGR,5,LAN,,9000.\n", "EIGRA,5,,9000.\n"])
def test_the_band_of_bulk_data(tmp_path, card):
    scene, left_out = converted(tmp_path, GRIDS + card, "deck.bdf")
    assert scene["modes"] == {"band": 9000} and left_out == []


def test_a_range_may_end_beyond_the_deck(tmp_path):
    """THRU 99999999 is what preprocessors write for all; a longer one than any deck has is refused where nothing bounds it."""
    text = GRIDS.replace("SPC1,1,123,1,2,3,4", "SPC1,1,123,1,THRU,2147483646") + "SET1,7,5,THRU,99999999\n"
    converted(tmp_path, text, "deck.bdf")
    model = TOOL.read_deck(tmp_path / "deck.bdf")
    assert set(model.surfaces) >= {"set_7"} and model.supports[0][1] == ["x", "y", "z"]
    (tmp_path / "deck.bdf").write_text(GRIDS + "RBE2,7,100,123,1,THRU,99999999\n")
    with pytest.raises(TOOL.Problem, match="1 THRU 99999999"):
        TOOL.read_deck(tmp_path / "deck.bdf")


def test_nodes_and_weights_of_mean_couplings(tmp_path):
    """RBE3 of two weights: the nodes of each are a group."""
    scene, left_out = converted(tmp_path, GRIDS + "RBE3,7,,100,123,1.,123,13,14\n,2.,123,15,16\n", "deck.bdf")
    assert scene["coupling"] == [{"name": "rbe3_7_node", "on": ["rbe3_7", "rbe3_7_2"], "at": [0.5, 0.5, 3], "weights": [1, 2]}]
    model = TOOL.read_deck(tmp_path / "deck.bdf")
    assert model.node_sets == {"rbe3_7": [13, 14], "rbe3_7_2": [15, 16]} and len(left_out) == 1


def test_names_surfaces_and_contacts_of_optistruct(tmp_path, squeal):
    """Small fields, continuations, names in comments, SURF by corners of faces, CONTACT by PCONT, and the selected load."""
    def row(*fields):
        return "".join(f"{field:<8}" for field in fields) + "\n"

    text = "SUBCASE 1\n  SPC = 1\n  LOAD = 3\nBEGIN BULK\n" + GRIDS + '$HMNAME PROP                   1"strip" 4\n$HMNAME PROP                   2"pad" 4\n'
    text += '$HMNAME CONTACTSURF           11"strip_top"\n' + row("SURF", 11, "ELFACE") + row("+", 1, 5, 7, 0)
    text += '$HMNAME CONTACTSURF           12"pad_bottom"\n' + row("SURF", 12, "ELFACE") + row("+", 2, 9, 11, 0)
    text += '$HMSET        4        1 "corner"\n' + row("SET", 4, "GRID", "LIST") + row("+", 13)
    text += row("CONTACT", 1, 50, 12, 11) + row("PCONT", 50, "", "", 0.4) + row("EIGRL", 5, "", "9000.")
    text += "PLOAD4,2,2,1.,,,,13,15\nLOAD,3,2.,5.+4,2\nENDDATA\n"
    scene, left_out = converted(tmp_path, text, "deck.fem")
    assert left_out == [] and [part["name"] for part in scene["part"]] == ["strip", "pad"]
    assert scene["contact"] == [{"rotor": "strip_top", "stator": "pad_bottom", "friction": 0.4}]
    assert scene["pressure"] == [{"on": "pressed", "value": 1e5}] and scene["modes"] == {"band": 9000}
    assert '"corner"' in (tmp_path / "out" / "deck.msh").read_text()
    assert scene["rotor"][0]["part"] == "strip" and "velocity" in squeal(tmp_path / "out" / "scene.toml", "--dry-run", ranks=1).messages[0]
    (tmp_path / "out" / "scene.toml").write_text(driven(tmp_path / "out" / "scene.toml"))
    assert squeal(tmp_path / "out" / "scene.toml", "--dry-run", ranks=1).code == 0


@pytest.mark.parametrize("deck", ["inp", "bdf"])
def test_named_faces_of_quadratic_solids(tmp_path, deck):
    """gmsh writes them as CPS6 and CTRIA6: surfaces where they lie on solids."""
    at = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (.5, 0, 0), (.5, .5, 0), (0, .5, 0), (0, 0, .5), (.5, 0, .5), (0, .5, .5)]
    if deck == "inp":
        text = "*NODE\n" + "".join(f"{i}, {x}, {y}, {z}\n" for i, (x, y, z) in enumerate(at, 1))
        text += "*ELEMENT, TYPE=CPS6, ELSET=Surface1\n1, 1,3,2,7,6,5\n*ELEMENT, TYPE=C3D10, ELSET=Volume1\n2, 1,2,3,4,5,6,7,8,9,10\n*ELSET, ELSET=foot\n1\n"
    else:
        text = "".join(f"GRID,{i},,{x:.1f},{y:.1f},{z:.1f}\n" for i, (x, y, z) in enumerate(at, 1))
        text += "CTRIA6,1,9,1,3,2,7,6,5\nCTETRA,2,2,1,2,3,4,5,6\n,7,8,9,10\n"
    (tmp_path / f"deck.{deck}").write_text(text)
    model = TOOL.read_deck(tmp_path / f"deck.{deck}")
    assert model.surfaces["foot" if deck == "inp" else "property_9"] == [(1, 3, 2, 7, 6, 5)]
    assert len(model.parts) == 1 and model.notes == []


def cdb(elements, more="", at=AT):
    """A deck as CDWRITE has it: bricks of SOLID185 with material 1, and other elements."""
    nodes = "".join(f"{i:9d}{0:9d}{0:9d}{x:21.13E}{y:21.13E}{z:21.13E}\n" for i, (x, y, z) in enumerate(at, 1))
    rows = "".join("".join(f"{v:9d}" for v in [material, kind, real, 1, 0, 0, 0, 0, len(of), 0, label, *of][:19])
                   + ("\n" + "".join(f"{v:9d}" for v in of[8:]) if len(of) > 8 else "") + "\n" for label, material, kind, real, of in elements)
    return (f"/COM,ANSYS RELEASE 19.2\n/PREP7\nET,1,185\nET,2,170\nET,3,174\nET,4,186\nNBLOCK,6,SOLID,{len(at)},{len(at)}\n(3i9,6e21.13e3)\n"
            f"{nodes}N,R5.3,LOC,       -1,\nEBLOCK,19,SOLID,{len(elements)},{len(elements)}\n(19i9)\n{rows}       -1\n"
            "MPDATA,R5.0, 1,EX  ,     1, 1, 2.00000000E+11    ,\nMPDATA,R5.0, 1,NUXY,     1, 1, 0.250000000    ,\n"
            f"MPDATA,R5.0, 1,DENS,     1, 1, 7800.00000    ,\n{more}/GO\nFINISH\n")


BRICK_ROWS = [(1, 1, 1, 1, [*range(1, 9)]), (2, 1, 1, 1, [*range(9, 17)])]


def test_commands_of_ansys(tmp_path, squeal):
    """Components with a range, supports, a force, an acceleration, and a contact pair whose material has the friction."""
    rows = [*BRICK_ROWS, (3, 3, 2, 7, [5, 6, 7, 8]), (4, 3, 3, 7, [9, 12, 11, 10])]
    more = ("CMBLOCK,BASE,NODE,       2  ! users node component\n(8i10)\n         1        -4\nCMBLOCK,LOW,ELEM,       1\n(8i10)\n         1\n"
            "MPDATA,R5.0, 1,MU  ,     3, 1, 0.400000000    ,\nF,13,FZ,-8.,0.\nACEL,0.,0.,9.81\nCE,R5.0,DEFI,2,1,0.\n"
            + "".join(f"D,{n},{label},0.,0.\n" for n in range(1, 5) for label in ("UX", "UY", "UZ")))
    scene, left_out = converted(tmp_path, cdb(rows, more), "deck.cdb")
    assert left_out == ["CE: 1 equation of no rigid coupling between a node of elements and one of none (line 45)"]
    assert [part["name"] for part in scene["part"]] == ["material_1"] and scene["part"][0]["young"] == 2e11
    assert scene["support"] == [{"on": "BASE", "fixed": "x y z"}] and scene["gravity"] == [0, 0, -9.81]
    assert scene["force"] == [{"on": "node_13", "vector": [0, 0, -8]}]
    assert scene["contact"] == [{"rotor": "target_7", "stator": "contact_7", "friction": 0.4, "velocity": scene["contact"][0]["velocity"]}]
    (tmp_path / "out" / "scene.toml").write_text(driven(tmp_path / "out" / "scene.toml"))
    assert squeal(tmp_path / "out" / "scene.toml", "--dry-run", ranks=1).code == 0


@pytest.mark.parametrize("component, table, expected", [
    ("       1\n(8i10)\n         1\n", "rotor", [{"part": "TURNS", "axis": [0, 0, 1], "rate": 10}]),
    ("       1\n(8i10)\n         3\n", "contact", [{"rotor": "target_7", "stator": "contact_7", "friction": 0.4, "rotation": {"axis": [0, 0, 1], "rate": 10}}]),
])
def test_rotors_of_ansys(tmp_path, component, table, expected):
    """CMROTATE of solids is a [[rotor]], of one side's elements the drive of their contact."""
    rows = [(1, 1, 1, 1, [*range(1, 9)]), (2, 2, 1, 1, [*range(9, 17)]), (3, 3, 2, 7, [5, 6, 7, 8]), (4, 3, 3, 7, [9, 12, 11, 10])]
    more = f"CMBLOCK,TURNS,ELEM,{component}MPDATA,R5.0, 1,MU  ,     3, 1, 0.4    ,\nCMROTATE,TURNS,,,10\n"
    scene, left_out = converted(tmp_path, cdb(rows, more), "deck.cdb")
    assert scene[table] == expected and left_out == []


@pytest.mark.parametrize("pilot, option, table", [(1, "", "rigid_body"), (1, "KEYOPT,3,4,1\n", "coupling"), (0, "KEYOPT,3,12,5\n", "tie")])
def test_bonded_and_pilot_contacts_of_ansys(tmp_path, pilot, option, table):
    """A target of one node leads the contact's surface; a contact that is always bonded is a tie."""
    rows = [*BRICK_ROWS, (3, 3, 2, 7, [17] if pilot else [5, 6, 7, 8]), (4, 3, 3, 7, [9, 12, 11, 10])]
    scene, left_out = converted(tmp_path, cdb(rows, option, [*AT, (0.5, 0.5, 3)]), "deck.cdb")
    assert len(scene[table]) == 1 and "contact" not in scene and left_out == []


@pytest.mark.parametrize("constants", ["R,9,2,2,2,.1,.2,.3\n", "RLBLOCK,       1,       9,       6,       7\n(2i8,6g16.9)\n(7g16.9)\n"
                                       + f"{9:8d}{6:8d}" + "".join(f"{v:16.9G}" for v in (2, 2, 2, .1, .2, .3)) + "\n"])
def test_masses_of_ansys(tmp_path, constants):
    """At the pilot of a surface, with its inertia, and at a node of an element, which has none."""
    rows = [*BRICK_ROWS, (3, 3, 2, 7, [17]), (4, 3, 3, 7, [9, 12, 11, 10]), (5, 1, 5, 9, [17]), (6, 1, 6, 9, [13])]
    deck = cdb(rows, constants + "KEYOPT,6,3,2\n", [*AT, (0.5, 0.5, 3)]).replace("ET,4,186\n", "ET,4,186\nET,5,21\nET,6,21\n")
    scene, left_out = converted(tmp_path, deck, "deck.cdb")
    assert scene["rigid_body"][0]["mass"] == 2 and scene["rigid_body"][0]["inertia"] == [0.1, 0.2, 0.3, 0, 0, 0]
    assert scene["mass"] == [{"on": "node_13", "mass": 2}] and left_out == []


def rigid_equations(leader, at, scale=-2.0):
    """What CERIG makes: of each follower and motion, its own term and those of the leading node."""
    lines = []
    for node in (13, 14, 15, 16):
        arm = np.subtract(AT[node - 1], at)
        for i, label in enumerate(("UX", "UY", "UZ")):
            turning = np.cross(arm, np.eye(3)[i])
            terms = [(node, label, scale), (leader, label, -scale)]
            terms += [(leader, "ROT" + axis, -scale * v) for axis, v in zip("XYZ", turning) if v]
            lines.append(f"CE,R5.0,DEFI,{len(terms):8d},{len(lines) + 1:8d}, 0.00000000    \n")
            lines += ["CE,R5.0,NODE," + ",".join(f"{n:8d},{of:4s}, {v:.8f}    " for n, of, v in terms[k : k + 2]) + "\n" for k in range(0, len(terms), 2)]
    return "".join(lines)


@pytest.mark.parametrize("group", [True, False])
def test_rigid_regions_of_ansys(tmp_path, group):
    """Equations of a rigid region are a coupling; with a coefficient that is no rigid motion they are left out and said."""
    equations = rigid_equations(17, (0.5, 0.5, 3)) if group else rigid_equations(17, (0.7, 0.9, 4))
    scene, left_out = converted(tmp_path, cdb(BRICK_ROWS, "D,1,ALL,0,,4\n" + equations, [*AT, (0.5, 0.5, 3)]), "deck.cdb")
    assert ("rigid_body" in scene) == group and (left_out == []) == group
    if group:
        assert scene["rigid_body"] == [{"name": "node_17", "surfaces": "region_17", "at": [0.5, 0.5, 3], "free": "all"}]
    else:
        assert left_out[0].startswith("CE: 12 equations of no rigid coupling")


@pytest.mark.parametrize("tension", ["F,21,FX,500.,0.\n", "SLOAD,4,PL01,LOCK,FORC,500.,1,2\n"])
def test_bolts_of_ansys(tmp_path, squeal, tension):
    """A shank that PRETS179 cuts: its sides are joined again, and their faces are the section of a [[bolt]]."""
    at = [(x, y, z) for z in (0, 1, 1, 2) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))] + [(0, 0, 2), (1, 0, 2), (1, 1, 2), (0, 1, 2), (0, 0, 9)]
    rows = [*BRICK_ROWS, *((10 + i, 1, 5, 0, [5 + i, 9 + i, 21]) for i in range(4))]
    more = "SECTYPE,       4,PRETENSION,     ,M12\nSECDATA,      21, 0.0, 0.0, 1.0\nD,1,ALL,0,,4\nD,13,UX,0,,16,,UY,UZ\n" + tension
    deck = cdb(rows, more, at).replace("ET,4,186\n", "ET,4,186\nET,5,179\n")
    for label in range(10, 14):  # the section of these elements
        deck = deck.replace("".join(f"{v:9d}" for v in (1, 5, 0, 1, 0, 0, 0, 0, 3, 0, label)), "".join(f"{v:9d}" for v in (1, 5, 0, 4, 0, 0, 0, 0, 3, 0, label)))
    scene, left_out = converted(tmp_path, deck, "deck.cdb")
    assert left_out == [] and "force" not in scene and "point" not in scene
    assert scene["bolt"] == [{"name": "M12", "section": "M12_section", "tension": 500, "axis": [0, 0, 1]}]
    assert squeal(tmp_path / "out" / "scene.toml", "--dry-run", ranks=1).code == 0


def test_axes_of_nodes_of_ansys(tmp_path):
    """Nodes that are turned about z hold the radial motion; a force on one of them is along its own x axis."""
    turned = "".join(f"N,{n},{x},{y},{z},{np.degrees(np.arctan2(y, x)) if x or y else 0}\n" for n, (x, y, z) in enumerate(AT[:4], 1) if x or y)
    scene, left_out = converted(tmp_path, cdb(BRICK_ROWS, turned + "D,2,UX,0,,4\nF,4,FX,-3.\nD,13,ALL,0,,16\n"), "deck.cdb")
    assert left_out == [] and scene["support"][0] == {"on": "held_1", "fixed": "x"}  # of node 2, which is not turned
    assert scene["support"][1] == {"on": "held_2", "fixed": "x", "cylinder": {"axis": [0, 0, 1], "centre": [0, 0, 0]}}
    assert scene["force"] == [{"on": "node_4", "vector": pytest.approx([0, -3, 0], abs=1e-12)}]


@pytest.mark.parametrize("option, table, expected", [
    ("", "spring", {"from": "node_13", "to": "node_17", "direction": [0.5, 0.5, 1], "stiffness": 2e6, "damping": 3}),
    ("KEYOPT,5,2,3\n", "spring", {"from": "node_13", "to": "node_17", "direction": "z", "stiffness": 2e6, "damping": 3}),
    ("KEYOPT,5,3,2\n", None, "of another kind")])
def test_springs_and_bands_of_ansys(tmp_path, option, table, expected):
    """COMBIN14 along its line, or along an axis; one of planes is left out. MODOPT has the band."""
    deck = cdb([*BRICK_ROWS, (9, 1, 5, 8, [13, 17])], option + "R,8,2.E6,3.\nMODOPT,QRDAMP,20,0,8000\n", [*AT, (0.5, 0.5, 3)])
    scene, left_out = converted(tmp_path, deck.replace("ET,4,186\n", "ET,4,186\nET,5,14\n"), "deck.cdb")
    assert scene["modes"] == {"band": 8000}
    if table:
        assert scene[table] == [expected] and left_out == []
    else:
        assert "spring" not in scene and expected in left_out[0]


def test_pressures_damping_and_thickness_of_ansys(tmp_path):
    """SFE on a solid and on a SURF154 of its face, damping of all, layers of a shell, and what no scene has."""
    rows = [*BRICK_ROWS, (3, 1, 5, 1, [13, 14, 15, 16]), (4, 1, 6, 1, [1, 4, 3, 2])]
    more = ("SFE,2,2,PRES,1,3.E5,3.E5,3.E5,3.E5\nSFE,3,1,PRES,0,R5.0\n 3.E5 3.E5 3.E5 3.E5\nBETAD,2E-7\nDMPSTR,0.01\nSECTYPE,1,SHELL\n"
            "SECBLOCK,2\n 0.002, 1, 0, 3\n 0.003, 1, 0, 3\nOMEGA,0,0,12\nCGOMEGA,0,0,0\n")
    scene, left_out = converted(tmp_path, cdb(rows, more).replace("ET,4,186\n", "ET,4,186\nET,5,154\nET,6,181\n"), "deck.cdb")
    assert [part.get("thickness") for part in scene["part"]] == [None, 0.005] and scene["part"][0]["beta"] == 2e-7
    assert scene["part"][0]["loss_factor"] == 0.01 and scene["pressure"] == [{"on": "pressed", "value": 3e5}]
    model = TOOL.read_deck(tmp_path / "deck.cdb")
    assert {frozenset(face) for face in model.surfaces["pressed"]} == {frozenset((9, 10, 14, 13)), frozenset((13, 14, 15, 16))}
    assert left_out == ["OMEGA,0,0,12 (line 47)"]


def test_nodes_with_one_force_are_a_group(tmp_path):
    """Commands and cards alike: the sum of their forces acts on all; so are nodes of a line each that are held alike."""
    more = "".join(f"F,{n},FZ,-8.\n" for n in (13, 14, 15, 16)) + "F,9,FX,3.\n"
    scene, _ = converted(tmp_path, cdb(BRICK_ROWS, more), "deck.cdb")
    assert scene["force"] == [{"on": "node_9", "vector": [3, 0, 0]}, {"on": "loaded_1", "vector": [0, 0, -32]}]
    bdf = GRIDS + "".join(f"FORCE,2,{n},,8.,0.,0.,-1.\n" for n in (13, 14, 15, 16))
    assert converted(tmp_path, bdf, "deck.bdf")[0]["force"] == [{"on": "loaded_1", "vector": [0, 0, -32]}]
    steps = "".join(f"*STEP\n*STATIC\n*CLOAD\n13, 3, {size}\n14, 3, {size}\n*END STEP\n" for size in (-2, -8))
    scene, _ = converted(tmp_path, BRICKS + "*BOUNDARY\n13, 1\n14, 1\n" + steps)
    assert scene["force"] == [{"on": "loaded_1", "vector": [0, 0, -16]}] and scene["step"][0]["forces"] == [0.25]
    assert scene["support"] == [{"on": "base", "fixed": "x y z"}, {"on": "loaded_1", "fixed": "x"}]


WRONG_NAMES = {
    "deck.inp": [("*CONTACT PAIR\nhigh_botom, low_top\n", "'high_botom' is not defined .is it high_bottom"), ("*TIE, NAME=t\nlow_top, high\n", "'high'"),
                 ("*CONTACT PAIR, INTERACTION=rubb\nhigh_bottom, low_top\n*SURFACE INTERACTION, NAME=rub\n", "is it rub"),
                 ("*DSLOAD\nhigh_tops, P, 1.\n", "is it high_top"), ("*COUPLING, REF NODE=100, SURFACE=lid, CONSTRAINT NAME=c\n*KINEMATIC\n", "'lid'"),
                 ("*CLOAD\n999, 3, 1.\n", "node 999"), ("*BOUNDARY\n999, 1\n", "node 999"), ("*BOUNDARY\nbas, 1\n", "is it base"),
                 ("*SOLID SECTION, ELSET=low, MATERIAL=m, ORIENTATION=o\n", "orientation 'o'"),
                 ("*MOTION, TRANSLATION\nbase, , 3.\n", "MOTION.*blank.*a set of nodes, a motion from 1 to 3, and a velocity"),
                 ("*MOTION, TRANSLATION\nlow, 1, 3.\n", "MOTION.*'low' is a set of elements; expected a node or a set of nodes"),
                 ("*CHANGE FRICTION, INTERACTION=rub\n*FRICTION\n0.1\n", "interaction 'RUB'")],
    "deck.bdf": [("CONTACT,1,0.5,12,11\n", "surface '12'"), ("SURF,11,ELFACE,,,,,,\n,1,5,7\nSURF,12,ELFACE,,,,,,\n,2,9,11\nCONTACT,1,50,12,11\n", "property '50'"),
                 ("CBAR,9,3,100,101,1.,0.,0.\n", "property '3'"), ("LOAD,3,1.,1.,7\nFORCE,2,13,,1.,1.,0.,0.\n", "set '7'"), ("CELAS1,9,3,100,3\n", "property '3'")],
    "deck.cdb": [("R,5,1,1,1\n", "MASS21: the real constant '9'"), ("CMROTATE,DISK,,,10\n", "component of elements 'DISK'.*known are DISC")],
}


@pytest.mark.parametrize("name, more, words", [(name, *case) for name, cases in WRONG_NAMES.items() for case in cases])
def test_what_a_deck_names_and_does_not_define_is_refused(tmp_path, name, more, words):
    """With its line, the nearest name and those that are there: nothing of the kind is lost and called complete."""
    mass = [(7, 1, 5, 9, [13])] if "R,5" in more else []
    component = "CMBLOCK,DISC,ELEM,       1\n(8i10)\n         1\n"
    (tmp_path / name).write_text({"deck.inp": BRICKS + more, "deck.bdf": ("LOAD = 3\nBEGIN BULK\n" if "LOAD" in more else "") + GRIDS + more, "deck.cdb": cdb(mass + BRICK_ROWS, component + more).replace("ET,4", "ET,5,21\nET,4")}[name])
    with pytest.raises(TOOL.Problem, match=f"line .*{words}" if "LOAD" not in more else words):
        TOOL.read_deck(tmp_path / name)


def test_a_contact_whose_surface_has_no_faces_stays_with_a_gap(tmp_path, squeal, capsys):
    scene, _ = converted(tmp_path, BRICKS + "*SURFACE, NAME=drum, TYPE=CYLINDER\nSTART, 0, 1\n*CONTACT PAIR\nhigh_bottom, drum\n")
    assert scene["contact"][0]["rotor"].startswith("FILL IN [a surface]: drum") and "1 line with FILL IN" in capsys.readouterr().out
    assert "FILL IN" in squeal(tmp_path / "out" / "scene.toml", "--dry-run", ranks=1).messages[0]


def test_a_deck_without_a_contact_says_so(tmp_path, capsys):
    converted(tmp_path, BRICKS)
    said = capsys.readouterr().out
    assert "no contact was found" in said and "scene.toml: complete" in said and "FILL IN" not in (tmp_path / "out" / "scene.toml").read_text()


def test_moduli_in_megapascal_need_a_unit(tmp_path):
    """The largest decides: a shim of rubber in a deck of steel is none; a unit that is given is believed."""
    deck = BRICKS.replace("2e11", "2e5")
    with pytest.raises(SystemExit, match="2e.05|200000.*--length 0.001 --force 1.*--length 1"):
        converted(tmp_path, deck)
    assert converted(tmp_path, deck, words=("--length", "1"))[0]["part"][0]["young"] == 2e5
    assert converted(tmp_path, deck, words=("--length", "0.001"))[0]["part"][0]["young"] == 2e11
    converted(tmp_path, BRICKS + "*MATERIAL, NAME=rubber\n*ELASTIC\n5e5, 0.4\n")


def test_loss_factors_ask_for_no_frequency(tmp_path, squeal):
    """Modes need none. Where the deck says one, it is that."""
    lossy = GRIDS.replace("7800.\n", "7800.,,,0.02\n")
    scene, _ = converted(tmp_path, lossy + "EIGRL,5,,9000.\n", "deck.bdf")
    assert scene["damping"] == {"loss_frequency": 4500} and scene["estimate"] == {"enabled": False}
    assert squeal(tmp_path / "out" / "scene.toml", "--dry-run", ranks=1).code == 0
    scene, left_out = converted(tmp_path, lossy + "PARAM,W4,12566.370614359\n", "deck.bdf")
    assert scene["damping"]["loss_frequency"] == pytest.approx(2000) and "estimate" not in scene and left_out == []


def test_mid_side_nodes_of_ansys_are_all_or_none(tmp_path):
    """Tetrahedra of SOLID187 without mid-side nodes are linear, as CDWRITE has them; some without others are refused."""
    at = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (.5, 0, 0), (.5, .5, 0), (0, .5, 0), (0, 0, .5), (.5, 0, .5), (0, .5, .5)]

    def kind(nodes):
        (tmp_path / "deck.cdb").write_text(cdb([(1, 1, 4, 1, nodes)], "", at).replace("ET,4,186", "ET,4,187"))
        return TOOL.read_deck(tmp_path / "deck.cdb").elements[1][0]

    assert [kind([1, 2, 3, 4]), kind([*range(1, 11)]), kind([1, 2, 3, 4, *[0] * 6])] == ["tet4", "tet10", "tet4"]
    with pytest.raises(TOOL.Problem, match="line .*all mid-side nodes or none"):
        kind([1, 2, 3, 4, 5, 0, 7, 8, 9, 10])


def test_degenerate_bricks_of_ansys(tmp_path):
    """Bricks that repeat corners are wedges, pyramids and tetrahedra."""
    rows = [(1, 1, 1, 1, [1, 2, 3, 3, 5, 6, 7, 7]), (2, 1, 1, 1, [9, 10, 11, 11, 13, 13, 13, 13]), (3, 1, 1, 1, [1, 2, 3, 4, 5, 5, 5, 5])]
    (tmp_path / "deck.cdb").write_text(cdb(rows))
    model = TOOL.read_deck(tmp_path / "deck.cdb")
    assert list(model.elements.values()) == [("wedge6", (1, 2, 3, 5, 6, 7)), ("tet4", (9, 10, 11, 13)), ("pyramid5", (1, 2, 3, 4, 5))]


@pytest.mark.parametrize("kind, corners, repeated", [("wedge15", 6, [0, 1, 2, 2, 3, 4, 5, 5]), ("pyramid13", 5, [0, 1, 2, 3, 4, 4, 4, 4]),
                                                     ("tet10", 4, [0, 1, 2, 2, 3, 3, 3, 3]), ("hex20", 8, range(8))])
def test_degenerate_bricks_of_ansys_with_mid_sides(tmp_path, kind, corners, repeated):
    """Every mid-side node of SOLID186 is in the middle of its corners, as the manual draws them, and of gmsh's sides."""
    sides = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
    at = [np.array(p, float) for p in [(0, 0, 0), (3, 1, 0), (2, 4, 1), (0, 3, 1), (1, 1, 5), (4, 1, 6), (3, 5, 7), (1, 4, 6)][:corners]]
    nodes, known = [repeated[i] + 1 for i in range(8)], {}
    for a, b in sides:
        ends = frozenset((repeated[a], repeated[b]))
        if len(ends) == 1:
            nodes.append(repeated[a] + 1)
            continue
        if ends not in known:
            at.append(sum(at[i] for i in ends) / 2)
            known[ends] = len(at)
        nodes.append(known[ends])
    (tmp_path / "deck.cdb").write_text(cdb([(1, 1, 4, 1, nodes)], "", at))
    model = TOOL.read_deck(tmp_path / "deck.cdb")
    (found, nodes), = model.elements.values()
    assert found == kind and len(set(nodes)) == len(nodes) == len(at)
    of_gmsh = SHAPES[{"hex20": "brick20"}.get(kind, kind)][1]
    for node, ends in zip(nodes[corners:], of_gmsh):
        assert model.nodes[node] == pytest.approx((model.nodes[nodes[ends[0]]] + model.nodes[nodes[ends[1]]]) / 2, abs=1e-12)


@pytest.mark.parametrize("card, keys, notes", [
    ("MAT2,3,80.,20.,0.,80.,0.,30.,7.\n,,,,,.02\n", {"young": 75, "poisson": 0.25, "density": 7, "loss_factor": 0.02}, 0),
    ("MAT2,3,80.,20.,5.,80.,0.,30.,7.\n", {"young": "FILL", "poisson": "FILL", "density": 7}, 1),
    ("MAT8,3,75.,75.,.25,30.,,,7.\n", {"young": 75, "poisson": 0.25, "density": 7}, 0),
    ("MAT8,3,75.,60.,.25,30.,,,7.\n", {"young": "FILL", "poisson": "FILL", "density": 7}, 1)])
def test_materials_of_shells_of_nastran(tmp_path, card, keys, notes):
    """Isotropic ones are known by their plane stiffness; of others the density remains, and the rest is told."""
    scene, left_out = converted(tmp_path, "GRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\nGRID,3,,0.,1.,0.\nCTRIA3,1,1,1,2,3\nPSHELL,1,3,.1,3\n" + card, "deck.bdf")
    part, = scene["part"]
    for key, value in keys.items():
        assert str(part[key]).startswith("FILL IN") if value == "FILL" else part[key] == pytest.approx(value)
    assert sum("not isotropic" in note for note in left_out) == notes


def test_mat9_has_its_loss_factor(tmp_path):
    text = GRIDS.replace("PSOLID,2,1", "PSOLID,2,9") + "MAT9,9,4.,1.,1.,,,,4.\n,1.,,,,4.,,,\n,2.,,,2.,,2.,1.\n,,,,,,,.03\n"
    scene, left_out = converted(tmp_path, text, "deck.bdf")
    assert scene["part"][1]["loss_factor"] == 0.03 and scene["part"][1]["orthotropic"]["shear"] == [2, 2, 2]


@pytest.mark.parametrize("name", ["deck.txt", "deck.bdf", "deck"])
def test_the_reader_is_chosen_by_what_a_file_holds(tmp_path, name):
    for text in (BRICKS, GRIDS, cdb(BRICK_ROWS)):
        (tmp_path / name).write_text(text)
        assert len(TOOL.read_deck(tmp_path / name).elements) == 2


def universal():
    """The brake's mesh as Salome writes it: solids and faces by groups of elements, the lid and the foot by groups of nodes."""
    nodes = "".join(f"{i:10d}{1:10d}{1:10d}{11:10d}\n{x:25.16E}{y:25.16E}{z:25.16E}\n" for i, (x, y, z) in enumerate(AT, 1))
    cells = {1: (115, range(1, 9)), 2: (115, range(9, 17)), 3: (44, (5, 6, 7, 8)), 4: (44, (9, 12, 11, 10))}
    elements = "".join(f"{n:10d}{kind:10d}{1:10d}{1:10d}{7:10d}{len(of):10d}\n" + "".join(f"{i:10d}" for i in of) + "\n" for n, (kind, of) in cells.items())
    groups = {"low": [(8, 1)], "high": [(8, 2)], "low_top": [(8, 3)], "high_bottom": [(8, 4)], "base": [(7, n) for n in range(1, 5)],
              "LID": [(7, n) for n in range(13, 17)]}
    rows = "".join("".join(f"{v:10d}" for v in (i, 0, 0, 0, 0, 0, 0, len(of))) + f"\n{name}\n"
                   + "".join(f"{kind:10d}{n:10d}{0:10d}{0:10d}\n" for kind, n in of) for i, (name, of) in enumerate(groups.items(), 1))
    return "".join(f"    -1\n{number:6d}\n{text}    -1\n" for number, text in ((2411, nodes), (2412, elements), (2467, rows)))


def write_med(file):
    meshio = pytest.importorskip("meshio")
    cells = [("hexahedron", np.arange(16).reshape(2, 8)), ("quad", np.array([(4, 5, 6, 7), (8, 11, 10, 9)]))]
    mesh = meshio.Mesh(np.array(AT, float), cells, cell_data={"cell_tags": [np.array([-1, -2]), np.array([-3, -4])]},
                       point_data={"point_tags": np.repeat([1, 0, 2], (4, 8, 4))})
    mesh.cell_tags = {-1: ["low"], -2: ["high"], -3: ["low_top"], -4: ["high_bottom"]}
    mesh.point_tags = {1: ["base"], 2: ["LID"]}
    meshio.write(file, mesh)


def test_one_brake_in_five_formats(module_run, tmp_path):
    """The same mesh, material, coupling, spring, mass, friction and force: the same eigenvalues."""
    inp = BRICKS + ("*COUPLING, CONSTRAINT NAME=c, REF NODE=100, SURFACE=high_top\n*KINEMATIC\n*ELEMENT, TYPE=MASS, ELSET=lump\n50, 100\n"
                    "*MASS, ELSET=lump\n64\n*ELEMENT, TYPE=SPRING1, ELSET=s\n51, 100\n*SPRING, ELSET=s\n3\n1048576.\n*BOUNDARY\n100, 1, 2\n100, 4, 6\n"
                    "*SURFACE INTERACTION, NAME=rub\n*FRICTION\n0.5\n*CONTACT PAIR, INTERACTION=rub\nhigh_bottom, low_top\n*CLOAD\n100, 3, -4096.\n")
    bdf = GRIDS + ("RBE2,7,100,123456,13,14,15,16\nCONM2,8,100,,64.\nCELAS2,9,1048576.,100,3\nSPC1,1,12456,100\nFORCE,2,100,,4096.,0.,0.,-1.\n"
                   "SURF,11,ELFACE,,,,,,\n,1,5,7\nSURF,12,ELFACE,,,,,,\n,2,9,11\nCONTACT,1,0.5,12,11\n")
    found = []
    for text, name in ((inp, "deck.inp"), (bdf, "deck.bdf")):
        folder = tmp_path / name
        folder.mkdir()
        scene, left_out = converted(folder, text, name)
        assert left_out == [] and scene["contact"][0]["friction"] == 0.5
        found.append(eigenvalues(module_run(slid(folder / "out" / "scene.toml"), ranks=1)))
    folder = tmp_path / "deck.cdb"
    folder.mkdir()
    more = "MPDATA,R5.0, 1,MU  ,     3, 1, 0.5    ,\n" + "".join(f"D,{n},{label},0.,0.\n" for n in range(1, 5) for label in ("UX", "UY", "UZ"))
    more += "CMBLOCK,LID,NODE,       4\n(8i10)\n        13        14        15        16\n"
    converted(folder, cdb([*BRICK_ROWS, (3, 3, 2, 7, [5, 6, 7, 8]), (4, 3, 3, 7, [9, 12, 11, 10])], more), "deck.cdb")
    body = ('[[rigid_body]]\nname = "c"\nsurfaces = "LID"\nat = [0.5, 0.5, 3]\nmass = 64\nfree = "z"\n[[spring]]\nfrom = "c"\ndirection = "z"\n'
            'stiffness = 1048576\n[[force]]\non = "c"\nvector = [0, 0, -4096]\n')
    scene = folder / "out" / "scene.toml"
    scene.write_text(scene.read_text() + body)
    found.append(eigenvalues(module_run(slid(scene), ranks=1)))
    law = "young = 2e11\npoisson = 0.25\ndensity = 7800\n"
    physics = (f'[mesh]\nfile = "deck.msh"\n[[part]]\nname = "low"\n{law}[[part]]\nname = "high"\n{law}[[support]]\non = "base"\nfixed = "all"\n{body}'
               '[[contact]]\nrotor = "low_top"\nstator = "high_bottom"\nvelocity = [1, 0, 0]\nfriction = 0.5\n'
               '[modes]\nmethod = "full"\nband = 2000\n[estimate]\nenabled = false\n')
    for name, write in (("deck.unv", lambda file: file.write_text(universal())), ("deck.med", write_med)):
        write(tmp_path / f"of_{name}")
        subprocess.run([sys.executable, TOOL.__file__, tmp_path / f"of_{name}", tmp_path / f"from_{name}"], check=True)
        (tmp_path / f"from_{name}" / "scene.toml").write_text(physics.replace("deck.msh", f"of_{name}".replace(name[-3:], "msh")))
        found.append(eigenvalues(module_run(tmp_path / f"from_{name}" / "scene.toml", ranks=1)))
    assert len(found) == 5 and len(found[0]) > 3
    for other in found[1:]:
        np.testing.assert_allclose(other, found[0], rtol=1e-10)


UNV = """    -1
  2411
         1         1         1        11
   0.0000000000000000D+00   0.0000000000000000D+00   0.0000000000000000D+00
         2         1         1        11
   1.0000000000000000D+00   0.0000000000000000D+00   0.0000000000000000D+00
         3         1         1        11
   0.0000000000000000D+00   1.0000000000000000D+00   0.0000000000000000D+00
         4         1         1        11
   0.0000000000000000D+00   0.0000000000000000D+00   1.0000000000000000D+00
    -1
    -1
  2412
         1        11         2         1         7         2
         0         1         1
         1         2
         2        41         2         1         7         3
         1         3         2
         3       111         2         1         7         4
         1         2         3         4
    -1
    -1
  2467
         1         0         0         0         0         0         0         1
foot
         8         2         0         0
         2         0         0         0         0         0         0         2
tips
         7         3         0         0         7         4         0         0
         3         0         0         0         0         0         0         1
wedge
         8         3         0         0
    -1
"""


def test_universal_files_keep_groups(tmp_path):
    """Groups of nodes, faces and solids by Salome's dataset; lines are left out."""
    (tmp_path / "deck.unv").write_text(UNV)
    model = TOOL.read_deck(tmp_path / "deck.unv")
    assert model.elements[3] == ("tet4", (1, 2, 3, 4)) and list(model.parts) == ["wedge"]
    assert model.surfaces == {"foot": [(1, 3, 2)]} and model.node_sets == {"tips": [3, 4]}
    assert model.notes == ["1 lines"]


@pytest.mark.parametrize("old, new, words", [
    ("       111         2         1         7         4", "       112         2         1         7         6", ["line 19", "nodes of element 3", "expected 6"]),
    ("wedge\n         8         3         0         0\n", "wedge\n", ["line 30", "0 entities of wedge"]),
    ("       111 ", "       113 ", ["line 19", "4 nodes of descriptor 113", "expected 15"]),
    ("1.0000000000000000D+00   0.0000000000000000D+00   0.0000000000000000D+00\n         3", "x 0 0\n         3", ["line 6", "'x'"]),
])
def test_bad_universal_files_are_refused(tmp_path, old, new, words):
    assert old in UNV
    (tmp_path / "deck.unv").write_text(UNV.replace(old, new, 1))
    with pytest.raises(TOOL.Problem) as refused:
        TOOL.read_deck(tmp_path / "deck.unv")
    assert all(word in str(refused.value) for word in words), refused.value


def test_bodies_of_step_files_are_parts(tmp_path):
    """Two boxes by gmsh: parts by the names of the solids, faces by numbers, volumes and areas of the boxes."""
    (tmp_path / "a.geo").write_text('SetFactory("OpenCASCADE");\nBox(1) = {0, 0, 0, 40, 20, 10};\nBox(2) = {0, 0, 10, 10, 10, 5};\n')
    subprocess.run(["gmsh", "a.geo", "-0", "-o", "a.step", "-v", "1"], cwd=tmp_path, check=True)
    text = (tmp_path / "a.step").read_text()
    assert text.count("MANIFOLD_SOLID_BREP(''") == 2
    text = text.replace("MANIFOLD_SOLID_BREP(''", "MANIFOLD_SOLID_BREP('disc'", 1).replace("MANIFOLD_SOLID_BREP(''", "MANIFOLD_SOLID_BREP('pad 1'")
    with pytest.raises(TOOL.Problem, match="give --size"):
        (tmp_path / "a.step").write_text(text)
        TOOL.read_deck(tmp_path / "a.step")
    model = TOOL.read_deck(tmp_path / "a.step", 10.0)
    volume = {name: sum(np.linalg.det([model.nodes[n] - model.nodes[model.elements[e][1][0]] for n in model.elements[e][1][1:4]]) / 6
                        for e in part.elements) for name, part in model.parts.items()}
    assert volume == {"disc": pytest.approx(8000, rel=1e-12), "pad_1": pytest.approx(500, rel=1e-12)}
    assert {name for name in model.surfaces if name.startswith("pad_1")} == {f"pad_1_face_{i}" for i in range(1, 7)}
    assert all(kind == "tet10" for kind, _ in model.elements.values())


def driven(scene):
    """Its text with a velocity in the one gap that a deck without a motion leaves."""
    text, count = re.subn(r'velocity = "FILL IN .*"', "velocity = [1, 0, 0]", scene.read_text())
    assert count == 1 and "FILL IN [" not in text
    return text


def slid(scene):
    """The scene with its contact driven, and its modes alone."""
    scene.write_text(driven(scene) + '\n[modes]\nmethod = "full"\nband = 2000\n\n[estimate]\nenabled = false\n')
    return scene


def eigenvalues(report):
    found = [complex(m["growth_rate"], 2 * np.pi * m["frequency_hz"]) for m in report["modes"]["modes"]]
    return np.array(sorted(found, key=lambda value: value.imag))


ROUND = """title = "round"
gravity = [0, 0, -9.8125]
[mesh]
file = "deck.msh"
[[part]]
name = "low"
young = 2e11
poisson = 0.25
density = 7800
beta = 1e-7
[[part]]
name = "high"
orthotropic = { young = [8e9, 4e9, 2e9], poisson = [0.125, 0.25, 0.25], shear = [2e9, 1e9, 1e9], axis_1 = [0, 1, 0], axis_2 = [1, 0, 0] }
density = 2500
[[support]]
on = "base"
fixed = "x y z"
[[rigid_body]]
name = "grip"
surfaces = "high_top"
at = [0.5, 0.5, 3]
mass = 64
inertia = [8, 8, 4, 0, 0, 0]
free = "x y z"
[[point]]
name = "anchor"
at = [0.5, 0.5, 5]
free = "none"
[[spring]]
from = "grip"
to = "anchor"
direction = "x"
stiffness = 1e6
damping = 64
[[spring]]
from = "grip"
direction = "y"
stiffness = 2e6
[[coupling]]
name = "mean"
on = "low_top"
at = [0.5, 0.5, 1]
mass = 2
[[beam]]
name = "rod"
from = "grip"
to = "mean"
young = 2e11
poisson = 0.25
density = 7800
diameter = 0.125
elements = 2
[[mass]]
on = "corner"
mass = 3
[[force]]
on = "grip"
vector = [0, 0, -65536]
[[pressure]]
on = "high_top"
value = 1e4
[[bolt]]
name = "tight"
beam = "rod"
tension = 1024
[[contact]]
rotor = "low_top"
stator = "high_bottom"
velocity = [0.5, 0.25, 0]
friction = 0.375
static_coefficient = 0.5
decay_speed = 0.5
compliance = 1e-12
[[step]]
name = "tighten"
forces = [0.25]
pressures = [0]
friction = 0
bolts = "tight"
[[step]]
name = "turn"
[modes]
method = "full"
band = 2000
[estimate]
enabled = false
"""


def test_a_scene_goes_to_a_deck_and_back(module_run, tmp_path):
    """Contacts, a bolt along a beam, couplings, springs, steps and friction: what comes back runs as it is, with the same modes."""
    converted(tmp_path, BRICKS + "*NSET, NSET=corner\n13\n")
    scene = tmp_path / "out" / "scene.toml"
    scene.write_text(ROUND)
    before = eigenvalues(module_run(scene, ranks=1))
    old = sys.argv
    sys.argv = ["mesh", str(scene), str(tmp_path / "back.inp"), "--to", "inp"]
    try:
        TOOL.main()
    finally:
        sys.argv = old
    (tmp_path / "second").mkdir()
    returned, left_out = converted(tmp_path / "second", (tmp_path / "back.inp").read_text())
    assert left_out == [] and len(returned["contact"]) == len(returned["bolt"]) == 1 and len(returned["step"]) == 2
    assert returned["step"][0]["friction"] == 0 and returned["contact"][0]["velocity"] == [0.5, 0.25, 0]
    file = tmp_path / "second" / "out" / "scene.toml"
    file.write_text(file.read_text().replace("[modes]", '[estimate]\nenabled = false\n\n[modes]\nmethod = "full"'))
    after = eigenvalues(module_run(file, ranks=1))
    assert len(before) > 3
    np.testing.assert_allclose(after, before, rtol=1e-9)
