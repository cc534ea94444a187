"""tools/mesh: habits of decks as preprocessors and releases write them, each in a small deck of our own."""

import random
import re
import tomllib

import numpy as np
import pytest
from conftest import ROOT
from test_decks import AT, BRICK_ROWS, BRICKS, GRIDS, TOOL, cdb, converted
from fuzz_cases import spoil_field, spoil_lines  # whose folder load_tool has made known
from fuzz_decks import DECKS

CORNER = ROOT / "inputs/corner/scene.toml"
HEAD = "/batch\n*DIM,_dir,string,248\n_dir(1) = 'D:\\work, and more\\'\n/com,--- Data in MKS units\n/prep7\nSHPP,OFF,,NOWARN\netcon,set\n"
BODIES = ('/com,*********** Elements for Body 1 "SYS\\Disc" ***********\net,1,185\neblock,19,solid,,1\n(19i9)\n{low}-1\n'
          '/com,*********** Elements for Body 2 "Pad, outer" ***********\net,2,185\neblock,19,solid,,1\n(19i9)\n{high}-1\n')
MATERIALS = "/wb,mat,start   !  starting to send\nMP,DENS,1,7850,\t! kg m^-3\nMP,EX,1,2e11,\nMP,NUXY,1,0.3,\nMP,UVID,1,6a302e30-541f\nMP,EX,2,1e10,\nMP,NUXY,2,0.3,\nMP,DENS,2,2500,\n"


def row(*values):
    return "".join(f"{v:9d}" for v in values) + "\n"


def workbench(more, remote=""):
    """The two bricks as Workbench writes them: a block of nodes ends with the next command, each body has a title."""
    nodes = "".join(f"{i:9d}{x:20.9E}{y:20.9E}{z:20.9E}\n" for i, (x, y, z) in enumerate([*AT, (0.5, 0.5, 3)], 1))
    low = row(1, 1, 1, 1, 0, 0, 0, 0, 8, 0, 1, *range(1, 9))
    high = row(2, 2, 2, 1, 0, 0, 0, 0, 8, 0, 2, *range(9, 17))
    return f"{HEAD}nblock,3,,17\n(1i9,3e20.9e3)\n{nodes}/wb,elem,start  ! set\n{BODIES.format(low=low, high=high)}{MATERIALS}{remote}{more}/solu\nsolve\nfini\n"


def pair(contact, target, faces, options=""):
    """A contact of Workbench, by parameters and blocks of no solids; of the numbers of two types and of two faces."""
    blocks = "".join(f"eblock,10,,,1\n(15i9)\n{row(10 * contact + i, kind, contact, contact, 0, *face)}-1\n"
                     for i, (kind, face) in enumerate(zip((contact, target), faces)))
    return f"*set,tid,{target}\n*set,cid,{contact}\net,cid,174\net,tid,170\n{options}{blocks}"


UNDER, OVER = (5, 6, 7, 8), (9, 12, 11, 10)


def test_bodies_contacts_and_supports_of_workbench(tmp_path, squeal):
    """Names of bodies; a contact that is written from both sides is one; D on a selected component."""
    both = pair(4, 5, (OVER, UNDER), "mp,mu,cid,0.3\nkeyo,cid,8,2\n") + pair(6, 7, (UNDER, OVER), "mp,mu,cid,0.3\n")
    fixed = "CMBLOCK,_FIXEDSU,NODE,        4\n(8i10)\n         1         2         3         4\ncmsel,s,_FIXEDSU\nd,all,all\nnsel,all\n"
    scene, left_out = converted(tmp_path, workbench(both + fixed), "ds.dat")
    assert [(part["name"], part["young"]) for part in scene["part"]] == [("Disc", 2e11), ("Pad_outer", 1e10)]
    assert [contact["friction"] for contact in scene["contact"]] == [0.3]
    assert scene["support"] == [{"on": "_FIXEDSU", "fixed": "all"}]
    assert left_out == ["the contact elements of real constant 6, which are those of 4 with the sides changed"]


def test_remote_points_tables_and_pressures_of_workbench(tmp_path, squeal):
    """A pilot by EN and attributes; tables have their last value; SF acts on the surface elements that are selected."""
    remote = ("*set,tid,5\n*set,cid,4\net,cid,174\net,tid,170\nkeyo,cid,12,5   ! bonded\nkeyo,cid,4,2\neblock,10,,,1\n(15i9)\n" + row(40, 4, 4, 4, 0, *OVER)
              + "-1\n*set,_npilot,17\n_npilot9=_npilot\ntype,tid\nmat ,cid\nreal,cid\ntshape,pilo\nen,41,_npilot\ntshape\n")
    more = ("et,9,154\neblock,10,,,1\n(15i9)\n" + row(90, 9, 9, 9, 0, 13, 14, 15, 16) + "-1\n*DIM,_load,TABLE,2,1,1,TIME,\n_load(1,0,1) = 0.\n_load(2,0,1) = 1.\n"
            "_load(1,1,1) = 0.\n_load(2,1,1) = 1000.\n*DIM,_move,TABLE,2,1,1,TIME,\n_move(1,1,1) = 0.\n_move(2,1,1) = .001\n"
            "esel,s,type,,9\nnsle\nsf,all,pres,%_load%\nnsel,all\nesel,all\nd,_npilot9,ux,0.\nd,_npilot9,uz,%_move%\n")
    scene, left_out = converted(tmp_path, workbench(more, remote), "ds.dat")
    assert left_out == []
    assert scene["pressure"] == [{"on": "pressed", "value": 1000}]
    assert scene["rigid_body"][0]["free"] == "y z rx ry rz"
    assert squeal(tmp_path / "out" / "scene.toml", "--dry-run", ranks=1).code == 0
    assert scene["support"] == [{"on": scene["rigid_body"][0]["name"], "fixed": "z", "displacement": [0, 0, 0.001], "rotation": [0, 0, 0]}]


@pytest.mark.parametrize("select, words", [
    ("nsel,s,loc,z,0\nd,all,all\n", "D,ALL,ALL on the nodes of NSEL,S,LOC,Z,0: name them in a component and select it by CMSEL"),
    ("d,17,ux,%_missing%\n", "the table %_missing% of D on node 17, which has no numbers: it is held"),
    ("cmsel,s,_nothing\ncm,more,node\n", "the component more of the nodes or elements that are selected"),
])
def test_selections_of_ansys_that_are_not_known_are_said(tmp_path, select, words):
    scene, left_out = converted(tmp_path, workbench(select), "ds.dat")
    assert any(words in note for note in left_out) and "support" not in scene


def test_blocks_of_newer_releases_of_ansys(tmp_path):
    """ETBLOCK has the types and their options, DBLOCK supports, SFEBLOCK pressures; lines of load steps are numbered."""
    rows = [*BRICK_ROWS, (3, 3, 2, 7, [5, 6, 7, 8]), (4, 3, 3, 7, [9, 12, 11, 10])]
    types = "ETBLOCK,        3,        3\n(2i9,19a9)\n" + row(1, 185, 0, 1) + row(2, 170, 0) + row(3, 174, *[0] * 11, 5) + "       -1\n"
    more = ("DBLOCK,         4\n(i9,a6,2(pg16.9))\n" + "".join(f"{n:9d}  UZ    0.00000000      0.00000000    \n" for n in (1, 2, 3, 4))
            + "SFEBLOCK,4,PRES,         1,         2,0\n(i9,i4,i4,6(pg20.9))\n" + "".join(
                f"        2   6   {part}" + f"      {value:.8f}    " * 4 + "\n" for part, value in ((1, 30.0), (2, 0.0))) + "SFE,end,LOC,       -1,\n"
            "ACEL,0.,0.,9.81                                                         S     11\n")
    deck = cdb(rows, more).replace("ET,1,185\nET,2,170\nET,3,174\nET,4,186\n", types)
    scene, left_out = converted(tmp_path, deck, "deck.cdb")
    assert len(scene["tie"]) == 1 and scene["support"] == [{"on": "held_1", "fixed": "z"}] and scene["gravity"] == [0, 0, -9.81]
    assert scene["pressure"] == [{"on": "pressed", "value": 30}] and left_out == ["the commands SFE of PRES (1)"]


def test_contacts_of_ansys_lie_on_shells_too(tmp_path):
    """A plate of SHELL181 bonded to a brick; an orthotropic material is none of shells."""
    rows = [(1, 1, 1, 1, [*range(1, 9)]), (2, 2, 5, 1, [9, 10, 11, 12]), (3, 3, 2, 7, [5, 6, 7, 8]), (4, 3, 3, 7, [9, 10, 11, 12])]
    more = "KEYOPT,3,12,5\n" + "".join(f"MP,{label},2,{value}\n" for label, value in zip(
        "EX EY EZ PRXY PRXZ PRYZ GXY GXZ GYZ DENS".split(), (1e9, 2e9, 3e9, .1, .1, .1, 1e9, 1e9, 1e9, 1000))) + "SECTYPE,1,SHELL\nSECDATA,.01\n"
    scene, left_out = converted(tmp_path, cdb(rows, more).replace("ET,4,186\n", "ET,4,186\nET,5,181\n"), "deck.cdb")
    assert scene["tie"] == [{"slave": "contact_7", "master": "target_7"}] and left_out == []
    shell = next(part for part in scene["part"] if "thickness" in part)
    assert "orthotropic" not in shell and "orthotropic, which solids can be alone" in shell["young"]


@pytest.mark.parametrize("text, notes", [
    ("*BOUNDARY\nbase, 0, 0, 20.\n", ["the degrees of freedom from 0 on of base"]),
    ("*MPC\nPLANE, base\n", ["*MPC of type PLANE"]),
    ("*DLOAD\nlow, NEWTON\n", ["*DLOAD of type NEWTON"]),
    ("*EQUATION, REMOVE\n1, 3\n", ["*EQUATION, REMOVE"]),
    ("*STEP\n*SUBSTRUCTURE GENERATE\n*END STEP\n", ["*SUBSTRUCTURE GENERATE"]),
    ("*ELEMENT, TYPE=S4, ELSET=skin\n9, 13,14,15,16\n*SURFACE, NAME=rim\nskin, S4\n*SURFACE, NAME=lid\nskin, S2\n",
     ["S4 of the surface rim, which are edges of flat elements", "the surface rim: of no solid and no shell elements",
      "stiffness and mass of 1 shell without a *SHELL SECTION: they are surfaces"]),
    ("*DISTRIBUTION, NAME=turned\n, 1., 0., 0., 0., 1., 0.\n*ORIENTATION, NAME=o\nturned\n",
     ["*ORIENTATION o, which is of no two points", "*DISTRIBUTION"]),
])
def test_keywords_of_calculix_that_no_scene_has_are_said(tmp_path, text, notes):
    assert sorted(re.sub(r" \(line \d+\)", "", note) for note in converted(tmp_path, BRICKS + text)[1]) == sorted(notes)


def test_habits_of_abaqus_cae(tmp_path):
    """Gravity on a blank is on all; a set may name its node twice; a velocity holds nothing."""
    text = ("*Nset, nset=ref\n100,\n*Nset, nset=ref, internal\n100,\n*Coupling, constraint name=c, ref node=ref, surface=high_top\n*Kinematic\n"
            "*Boundary, type=VELOCITY\nref, 3, 3, 5.\n*Boundary, type=DISPLACEMENT\nref, 1, 1\n*Dload\n, GRAV, 9.8, 0., 0., -1.\n")
    scene, left_out = converted(tmp_path, BRICKS + text)
    assert scene["gravity"] == [0, 0, -9.8] and scene["rigid_body"][0]["free"] == "y z rx ry rz"
    assert scene["support"] == [{"on": "base", "fixed": "x y z"}]
    assert [note.partition(" (")[0] for note in left_out] == ["TYPE=VELOCITY of *BOUNDARY"]


@pytest.mark.parametrize("text, table, expected", [
    ("*coupling,surface=high_top,refnode=100,constraintname=load\n*distributing\n1,6\n", "coupling", [{"name": "load", "on": "high_top", "at": [0.5, 0.5, 3]}]),
    ("*ELEMENT, TYPE=DCOUP3D, ELSET=c\n9, 100\n*DISTRIBUTING COUPLING, ELSET=c\n13, 1.\n14, 1.\n", "coupling",
     [{"name": "node_100", "on": ["node_13", "node_14"], "at": [0.5, 0.5, 3]}]),
    ("*SURFACEINTERACTION, NAME=glue\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TIED\n1e9\n*CONTACT PAIR, INTERACTION=glue\nhigh_bottom, low_top\n", "tie",
     [{"slave": "high_bottom", "master": "low_top"}]),
    ("*NSET, NSET=lid\n13,14\n*SURFACE, NAME=lid, TYPE=NODE\n13,\n14,\n15,\n16,\n*COUPLING, REF NODE=100, SURFACE=lid, CONSTRAINT NAME=c\n*KINEMATIC\n1, 6\n", "rigid_body",
     [{"name": "c", "surfaces": "lid_surface", "at": [0.5, 0.5, 3], "free": "all"}]),
])
def test_spellings_and_names_of_calculix(tmp_path, text, table, expected):
    """Without blanks in options and keywords; tied contacts; couplings of DCOUP3D; surfaces and sets of one name."""
    scene, left_out = converted(tmp_path, BRICKS + text)
    assert scene[table] == expected and "contact" not in scene
    assert all("it is lid_surface" in note for note in left_out)


@pytest.mark.parametrize("rows, keys, left_out", [
    (".3, , , 20.\n.28, , , 200.\n.25, , , 400.\n", {"friction": 0.3}, ["2 of the 3 lines of *FRICTION, of other pressures or temperatures"]),
    (".3, 0., , 20.\n.2, 1., , 20.\n.1, 0., , 90.\n", {"friction": 0.3, "factor_at_speed": [[0, 1], [1, pytest.approx(2 / 3)]]},
     ["1 of the 3 lines of *FRICTION, of other pressures or temperatures"]),
])
def test_friction_by_temperature(tmp_path, rows, keys, left_out):
    text = f"*SURFACE INTERACTION, NAME=i\n*FRICTION\n{rows}*CONTACT PAIR, INTERACTION=i\nhigh_bottom, low_top\n"
    scene, notes = converted(tmp_path, BRICKS + text)
    assert {key: scene["contact"][0].get(key) for key in keys} == keys and ("factor_at_speed" in scene["contact"][0]) == ("factor_at_speed" in keys)
    assert [note.partition(" (")[0] for note in notes] == left_out


def test_coordinates_that_are_not_given_are_zero(tmp_path):
    (tmp_path / "deck.inp").write_text("*NODE\n1\n2, 1.\n3, 0., 1.\n4, 0., 0., 1.\n*ELEMENT, TYPE=C3D4, ELSET=e\n1, 1,2,3,4\n")
    assert np.array_equal(TOOL.read_deck(tmp_path / "deck.inp").nodes[1], [0, 0, 0])


@pytest.mark.parametrize("old, new", [
    ("GRID,101,,.5,.5,5.\n", "GRID,101,1,0.,0.,2.\nCORD1R,1,100,200,201\nGRID,200,,.5,.5,4.\nGRID,201,,1.5,.5,3.\n"),
    ("GRID,101,,.5,.5,5.\n", "GRID,101,2,0.,0.,2.\nCORD1R,1,100,201,200,2,100,200,201\nGRID,200,,.5,.5,4.\nGRID,201,,1.5,.5,3.\n"),
])
def test_systems_by_nodes(tmp_path, old, new):
    (tmp_path / "deck.bdf").write_text("BEGIN BULK\n" + GRIDS.replace(old, new))
    assert np.allclose(TOOL.read_deck(tmp_path / "deck.bdf").nodes[101], [0.5, 0.5, 5])


@pytest.mark.parametrize("head, text, notes", [
    ("BEGING BULK\n", "SPC,7,100,,20.\n", ["SPC 7 of 1 node without motions from 1 to 6", "a choice of supports in the case control: all are there, SPC 1, 7"]),
    ("LOAD = 9\nBEGIN BULK\n", "QVOL,9,5.,1,1\n", ["the cards QVOL (1)"]),
    ("BEGIN BULK\n", "INCLUDE 'parts\n/more.inc'\n", ["the cards QVOL (1)"]),
])
def test_habits_of_bulk_data(tmp_path, head, text, notes):
    """BEGIN BULK by its first letters; supports of temperatures; loads that are there and not read; names over two lines."""
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts/more.inc").write_text("QVOL,9,5.,1,1\n")
    assert sorted(converted(tmp_path, head + GRIDS + text, "deck.bdf")[1]) == sorted(notes)


def test_rigid_bushings_quadratic_shells_and_sections_by_stations(tmp_path):
    more = ("PBUSH,4,K,RIGID,2.,,,,RIGID\nCBUSH,11,4,100,101,1.,0.,0.\nPBEAML,5,1,,ROD\n,.1,,YES,.5,.1\nCBEAM,12,5,100,101,1.,0.,0.\n"
            "PSHELL,9,1,.01,1\nGRID,30,,3.,0.,0.\nGRID,31,,4.,0.,0.\nGRID,32,,4.,1.,0.\nGRID,33,,3.,1.,0.\nGRID,34,,5.,0.,0.\nGRID,35,,5.,1.,0.\nGRID,36,,6.,0.,0.\n"
            "CQUAD8,20,9,30,31,32,33\nCTRIA6,21,9,34,36,35\nCQUADR,22,9,31,34,35,32\nCTRIAR,23,9,30,31,36\n")
    scene, left_out = converted(tmp_path, "BEGIN BULK\n" + GRIDS + more, "deck.fem")
    assert scene["connector"][0]["locked"] == "x rz" and scene["connector"][0]["stiffness"] == [0, 2, 0, 0, 0, 0]
    assert scene["beam"][0]["diameter"] == pytest.approx(0.2)
    assert scene["part"][2]["thickness"] == 0.01 and left_out == []


REGIONS = "BSURFS,1,,,,1,5,6,7\nBSURFS,2,,,,2,9,10,11\nPSHELL,9,1,.01,1\nCQUAD4,20,9,13,14,15,16\nBSURF,3,20\n"


@pytest.mark.parametrize("case, cards, contacts, ties, left_out", [
    ("BCSET = 100\n", "BCTADD,100,101\nBCTSET,101,2,1,.4,0.,.25\nBCTSET,102,2,1,.2\n", [("region_1", "region_2", 0.4)], [],
     ["BCTSET 102, which the case control does not select"]),
    ("", "BCTSET,101,2,1,,,.25,,,+\n+,,3,1,.3\n", [("region_1", "region_2", 0), ("region_1", "region_3", 0.3)], [], []),
    ("BGSET = 5\n", "BGSET,5,2,1,.01\n", [], [("region_2", "region_1")], []),
])
def test_regions_of_nx_nastran(tmp_path, case, cards, contacts, ties, left_out):
    """Pairs of faces of solids and of flat elements, which the case control selects, in contact or glued."""
    scene, notes = converted(tmp_path, case + "BEGIN BULK\n" + GRIDS + REGIONS + cards, "deck.dat")
    assert [(of["rotor"], of["stator"], of["friction"]) for of in scene.get("contact", [])] == contacts
    assert [(of["slave"], of["master"]) for of in scene.get("tie", [])] == ties
    assert [of.get("reach", 0) for of in scene.get("contact", [])] == [0.25, 0][: len(contacts)]
    assert [note.partition(" (")[0] for note in notes if "PSHELL" not in note] == left_out


def test_a_region_that_is_not_defined_is_refused(tmp_path):
    (tmp_path / "deck.bdf").write_text("BEGIN BULK\n" + GRIDS + REGIONS + "BCTSET,101,2,7\n")
    with pytest.raises(TOOL.Problem, match="BCTSET 101: the region '7' is not defined.*known are 1, 2, 3"):
        TOOL.read_deck(tmp_path / "deck.bdf")


def test_repeated_cards_are_refused(tmp_path):
    (tmp_path / "deck.bdf").write_text("BEGIN BULK\nGRID,1,,0.,0.,0.\n=,*1,=,*1.,==\n")
    with pytest.raises(TOOL.Problem, match="line 3.*repeats the card above: let the preprocessor write all cards"):
        TOOL.read_deck(tmp_path / "deck.bdf")


@pytest.mark.parametrize("form", ["small", "large", "free", "nastran"])
def test_cards_at_once_and_one_by_one_are_the_same(tmp_path, form):
    """Fields of 8 and of 16 characters are read at once, others one by one; blank ones are zeros, 1.5-3 is 1.5E-3."""
    at = [f"{x:.1f}" if x else "" for point in AT for x in point]
    if form == "nastran":
        at = [text.replace("1.0", "10.-1") for text in at]
    fields = [["GRID", str(i), "", *at[3 * i - 3 : 3 * i]] for i in range(1, 17)] + [
        ["CHEXA", str(e), str(e), *map(str, range(8 * e - 7, 8 * e + 1))] for e in (1, 2)]
    lines = []
    for name, *more in fields:
        if form == "free":
            lines += [",".join([name if not i else "", *more[i : i + 8]]) for i in range(0, len(more), 8)]
            continue
        count, width = (4, 16) if form == "large" else (8, 8)
        star = "*" if form == "large" else ""
        lines += [f"{(name if not i else '') + star:8}" + "".join(f"{text:>{width}}" for text in more[i : i + count]) for i in range(0, len(more), count)]
    (tmp_path / "deck.bdf").write_text("BEGIN BULK\n" + "\n".join(lines) + "\nENDDATA\n")
    model = TOOL.read_deck(tmp_path / "deck.bdf")
    assert [tuple(model.nodes[i]) for i in range(1, 17)] == AT
    assert model.elements == {1: ("hex8", tuple(range(1, 9))), 2: ("hex8", tuple(range(9, 17)))}
    assert [part.elements for part in model.parts.values()] == [[1], [2]]


def test_notes_that_are_alike_are_few(tmp_path):
    bars = "PBARL,5,1,,BAR\n,.1,.2\n" + "".join(f"CBAR,{n},5,1,101,1.,0.,0.\n" for n in range(20, 40))
    left_out = converted(tmp_path, "BEGIN BULK\n" + GRIDS + bars, "deck.bdf")[1]
    assert len(left_out) == 5 and left_out[-1] == "16 others like the last one"


def test_a_part_has_elements_of_one_order(tmp_path, squeal):
    """A set of linear and of quadratic bricks is two parts."""
    at = [(x, y, z) for z in (5, 6) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
    mids = [tuple(np.add(at[a], at[b]) / 2) for a, b in ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7))]
    more = "*NODE\n" + "".join(f"{i}, {x}, {y}, {z}\n" for i, (x, y, z) in enumerate([*at, *mids], 201))
    more += "*ELEMENT, TYPE=C3D20, ELSET=high\n9, " + ", ".join(map(str, range(201, 212))) + ",\n" + ", ".join(map(str, range(212, 221))) + "\n"
    more += "*ELSET, ELSET=lid\n9,\n*SURFACE, NAME=lid\nlid, S2\n"
    scene, left_out = converted(tmp_path, BRICKS + more)
    assert [part["name"] for part in scene["part"]] == ["low", "high", "high_linear"]
    assert any("1 element of high are linear" in note for note in left_out)
    assert squeal(tmp_path / "out" / "scene.toml", "--dry-run", ranks=1).code == 0


@pytest.mark.parametrize("motions, expected, lost", [
    ("1, 2, 0", [("base_off_axis", "x y"), ("base_on_axis", "x y")], 0), ("1, 1, 0.001", [("base_off_axis", "x")], 1)])
def test_nodes_on_the_axis_of_a_cylinder(tmp_path, squeal, motions, expected, lost):
    """Node 1 is on it: no direction is radial there; what holds all across the axis holds it as well."""
    deck = BRICKS.replace("*BOUNDARY\nbase, 1, 3\n", f"*TRANSFORM, NSET=base, TYPE=C\n0,0,0, 0,0,1\n*BOUNDARY\nbase, {motions}\n")
    scene, left_out = converted(tmp_path, deck)
    assert [(support["on"], support["fixed"]) for support in scene["support"]] == expected
    assert len(left_out) == lost and all("on the axis of its cylinder" in note for note in left_out)
    assert squeal(tmp_path / "out" / "scene.toml", "--dry-run", ranks=1).code == 0


def test_sides_without_faces_are_gaps(tmp_path):
    scene, _ = converted(tmp_path, BRICKS + "*SURFACE, NAME=dots, TYPE=NODE\n9,\n10,\n*SURFACE INTERACTION, NAME=i\n*CONTACT PAIR, INTERACTION=i\ndots, low_top\n")
    assert scene["contact"][0]["stator"] == "FILL IN [a surface]: dots of the deck covers no faces of its elements"


def test_ties_of_cyclic_symmetry_are_none(tmp_path):
    scene, left_out = converted(tmp_path, BRICKS + "*TIE, CYCLIC SYMMETRY, NAME=t\nhigh_bottom, low_top\n")
    assert "tie" not in scene and left_out[0].startswith("*TIE, CYCLIC SYMMETRY")


def test_a_mesh_of_skins_alone_is_refused(tmp_path):
    (tmp_path / "deck.inp").write_text("*NODE\n1, 0., 0.\n2, 1., 0.\n3, 0., 1.\n*ELEMENT, TYPE=CPS3, ELSET=e\n1, 1,2,3\n")
    with pytest.raises(TOOL.Problem, match="no solid elements, and no shells with a property"):
        TOOL.read_deck(tmp_path / "deck.inp")


def test_the_corner_loses_nothing(tmp_path):
    """Its scene as a deck and back has the same tables: laws of friction and damping stand where they act."""
    source = CORNER.read_text()
    (tmp_path / "scene.toml").write_text(re.sub(r"^size = \d+", "size = 3000", source, flags=re.M))
    (tmp_path / "brake.geo").write_bytes((CORNER.parent / "brake.geo").read_bytes())
    assert TOOL.write_deck(tmp_path / "scene.toml", tmp_path / "corner.inp") == ["[probe]"]
    given, (scene, left_out) = tomllib.loads(source), converted(tmp_path, (tmp_path / "corner.inp").read_text())
    assert left_out == []
    for contact in given["contact"]:
        contact.setdefault("friction", given["friction"]["coefficient"])
    given["step"] = [{**step, "name": step["name"].replace(",", "")} for step in given["step"]]
    given["part"] = [{**given["damping"], **part} for part in given["part"]]
    for table in ("part", "support", "tie", "rigid_body", "spring", "force", "pressure", "step", "contact", "modes"):
        assert plain(scene[table]) == plain(given[table]), table


def plain(value):
    """Directions as numbers, and what a table has unless it says otherwise."""
    if isinstance(value, list):
        return [plain(of) for of in value]
    if not isinstance(value, dict):
        return {"z": [0, 0, 1]}.get(value, value) if isinstance(value, str) else value
    if "rate" in value:
        return {"centre": [0, 0, 0], **value, "axis": plain(value["axis"])}
    return {key: of if key == "direction" else plain(of) for key, of in value.items()}


def test_arrays_of_the_old_vtk_format_are_groups(tmp_path):
    pytest.importorskip("meshio")
    (tmp_path / "deck.vtk").write_text(DECKS["deck.vtk"])
    assert list(TOOL.read_deck(tmp_path / "deck.vtk").parts) == ["part_1", "part_2"]


@pytest.mark.parametrize("name", list(DECKS))
def test_spoilt_decks_get_one_message(tmp_path, name):
    """A few of what tools/fuzz makes of each deck: read, or refused by one sentence."""
    for seed in range(40):
        text, source = DECKS[name], random.Random(seed)
        for _ in range(source.randint(1, 3)):
            text = (spoil_field if source.random() < 0.6 else spoil_lines)(text, source)
        (tmp_path / name).write_text(text, errors="replace")
        try:
            model = TOOL.read_deck(tmp_path / name)
            TOOL.skeleton(model, "deck.msh", 1.0, 1.0)
            TOOL.write_msh(model, tmp_path / "deck.msh")
        except (TOOL.Problem, OSError) as problem:
            assert "\n" not in str(problem)
