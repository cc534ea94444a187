"""tools/mesh: what a deck says and no scene can mean is refused at its line or told; decks in mm, N, s and t are the SI scene."""

import numpy as np
import pytest
from test_decks import BRICK_ROWS, BRICKS, GRIDS, NODES, converted, cdb, eigenvalues, slid

PLATE = ("*NODE\n301, 3,0,0\n302, 4,0,0\n303, 4,1,0\n304, 3,1,0\n*ELEMENT, TYPE=S4, ELSET=skin\n50, 301,302,303,304\n"
         "*SHELL SECTION, ELSET=skin, MATERIAL=m\n0.01\n")
LAYER = "*ELEMENT, TYPE=S4, ELSET=more\n51, 304,303,302,301\n*SHELL SECTION, ELSET=more, MATERIAL=m\n0.02\n"
LAW = "2e11, 0.25"
RUB = "*SURFACE INTERACTION, NAME=rub\n*FRICTION\n{mu}\n*CONTACT PAIR, INTERACTION=rub\nhigh_bottom, low_top\n"
AXES = "*MATERIAL, NAME=n\n*ELASTIC, TYPE=ENGINEERING CONSTANTS\n5e9,4e9,3e9,{nu},{nu},{nu},{g},1e9,\n3e9\n*DENSITY\n2500\n*SOLID SECTION, ELSET=high, MATERIAL=n\n"
GRID_PLATE = "PSHELL,9,1,.01,1\nGRID,30,,3.,0.,0.\nGRID,31,,4.,0.,0.\nGRID,32,,4.,1.,0.\nGRID,33,,3.,1.,0.\nCQUAD4,20,9,30,31,32,33\n"
FACES = "SURF,11,ELFACE\n+,1,5,7,0\nSURF,12,ELFACE\n+,2,9,11,0\n"
SHELL_ROWS = [(1, 1, 1, 1, [*range(1, 9)]), (2, 1, 5, 1, [9, 10, 11, 12]), (3, 1, 5, 1, [9, 10, 11, 12])]
SHELL = ("ET,4,186\n", "ET,4,186\nET,5,181\n")
MU = "MPDATA,R5.0, 1,MU  ,     3, 1, {mu}    ,\n"
MEETING = [*BRICK_ROWS, (3, 3, 2, 7, [5, 6, 7, 8]), (4, 3, 3, 7, [9, 12, 11, 10])]


def ansys(old="", new="", more="", rows=BRICK_ROWS):
    text = cdb(rows, more)
    assert old in text
    return text.replace(old, new, 1)


REFUSED = {  # deck, name, and words of the message
    "layers of shells": (BRICKS + PLATE + LAYER, "inp", ["line 52", "elements 50 and 51, of skin and more", "thickness of both"]),
    "layers of shells of one part": (BRICKS + PLATE + LAYER[:LAYER.index("*SHELL")].replace("more", "skin"), "inp", ["both of skin"]),
    "solids twice": (BRICKS + "*ELEMENT, TYPE=C3D8, ELSET=low\n61, 1,2,3,4,5,6,7,8\n", "inp", ["line 43", "1 and 61", "take one of them out"]),
    "a negative thickness": (BRICKS + PLATE.replace("0.01", "-0.01"), "inp", ["line 49", "thickness -0.01", "skin"]),
    "a ratio of 0.7": (BRICKS.replace(LAW, "2e11, 0.7"), "inp", ["line 35", "material M", "Poisson's ratio 0.7", "below 0.5"]),
    "a ratio of 0.5": (BRICKS.replace(LAW, "2e11, 0.5"), "inp", ["line 35", "Poisson's ratio 0.5", "rubber"]),
    "a negative modulus": (BRICKS.replace(LAW, "-2e11, 0.25"), "inp", ["line 35", "-2e+11", "above 0"]),
    "a negative density": (BRICKS.replace("7800", "-7800"), "inp", ["line 37", "density -7800"]),
    "damping that feeds": (BRICKS.replace("*DENSITY", "*DAMPING, BETA=-1e-6\n*DENSITY"), "inp", ["line 36", "BETA -1e-06"]),
    "a loss factor of 50": (BRICKS.replace("*DENSITY", "*DAMPING, STRUCTURAL=50\n*DENSITY"), "inp", ["line 36", "loss factor 50"]),
    "negative shear modulus": (BRICKS + AXES.format(nu=0.1, g=-2e9), "inp", ["line 43", "-2e+09"]),
    "ratios of no material": (BRICKS + AXES.format(nu=0.9, g=2e9), "inp", ["line 43", "0.9, 0.9, 0.9", "negative work"]),
    "negative friction": (BRICKS + RUB.format(mu=-0.3), "inp", ["line 46", "friction -0.3"]),
    "a negative mass": (BRICKS + "*ELEMENT, TYPE=MASS, ELSET=s\n50, 13\n*MASS, ELSET=s\n-0.5\n", "inp", ["mass -0.5"]),
    "a negative spring": (BRICKS + "*ELEMENT, TYPE=SPRING1, ELSET=s\n50, 13\n*SPRING, ELSET=s\n3\n-2e6\n", "inp", ["line 44", "-2e+06", "node 13"]),
    "units mixed": (BRICKS.replace("2e11", "2e5"), "inp", ["200000", "7800", "t/mm3", "--length 0.001"]),
    "layers of CQUAD4": (GRIDS + GRID_PLATE + "PSHELL,10,1,.02,1\nCQUAD4,21,10,30,31,32,33\n", "bdf", ["line 34", "20 and 21"]),
    "a negative thickness of PSHELL": (GRIDS + GRID_PLATE.replace(",.01", ",-.01"), "bdf", ["line 27", "-0.01"]),
    "a ratio by MAT1": (GRIDS.replace(",.25,", ",.7,"), "bdf", ["line 25", "material 1", "0.7"]),
    "a ratio by a shear modulus": (GRIDS.replace("2.+11,,.25", "2.+11,2.+10,"), "bdf", ["line 25", "ratio 4"]),
    "a negative density by MAT1": (GRIDS.replace("7800.", "-7800."), "bdf", ["line 25", "-7800"]),
    "GE that feeds": (GRIDS.replace("7800.", "7800.,,,-.1"), "bdf", ["line 25", "loss factor -0.1"]),
    "MATORT": (GRIDS.replace("PSOLID,2,1", "PSOLID,2,9") + "MATORT,9,5.+9,4.+9,-3.+9,.1,.3,.12,2500.\n,2.+9,1.+9,3.+9\n", "bdf", ["line 27", "-3e+09"]),
    "CONM2": (GRIDS + "RBE2,7,100,123456,13,14,15,16\nCONM2,8,100,,-5.\n", "bdf", ["mass -5", "node 100"]),
    "CELAS2": (GRIDS + "CELAS2,9,-4.+6,13,2\n", "bdf", ["line 27", "-4e+06"]),
    "units mixed by MAT1": (GRIDS.replace("2.+11", "2.+5"), "fem", ["200000", "t/mm3"]),
    "friction of CONTACT": (GRIDS + FACES + "CONTACT,1,-.3,12,11\n", "fem", ["line 31", "friction -0.3"]),
    "layers of SHELL181": (ansys(*SHELL, "SECTYPE,1,SHELL\nSECDATA,.01\n", SHELL_ROWS), "cdb", ["line 31", "2 and 3"]),
    "SECDATA": (ansys(*SHELL, "SECTYPE,1,SHELL\nSECDATA,-.01\n", SHELL_ROWS[:2]), "cdb", ["-0.01", "shells"]),
    "NUXY": (ansys("0.250000000", "0.700000000"), "cdb", ["line 32", "material 1", "0.7"]),
    "DENS": (ansys("7800.00000", "-7800.00000"), "cdb", ["line 33", "-7800"]),
    "EX": (ansys("2.00000000E+11", "-2.0000000E+11"), "cdb", ["line 31", "-2e+11"]),
    "ALPHAD": (ansys(more="ALPHAD,-3.\n"), "cdb", ["ALPHA -3"]),
    "MU": (ansys(more=MU.format(mu=-0.4), rows=MEETING), "cdb", ["line 36", "friction -0.4"]),
    "units mixed by MPDATA": (ansys("2.00000000E+11", "2.0000000E+05"), "cdb", ["200000", "t/mm3"]),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_no_scene_can_mean_is_refused_at_its_line(tmp_path, name):
    deck, kind, words = REFUSED[name]
    with pytest.raises(SystemExit) as refused:
        converted(tmp_path, deck, f"deck.{kind}")
    assert str(refused.value).startswith(f"mesh: {tmp_path}/deck.{kind}") and "\n" not in str(refused.value)
    assert all(word in str(refused.value) for word in words), refused.value
    assert not (tmp_path / "out" / "scene.toml").exists()


SHANK = NODES + ("200, 0,0,4\n201, 1,0,4\n202, 1,1,4\n203, 0,1,4\n300, 0,0,0\n*ELEMENT, TYPE=C3D8, ELSET=bolt\n1, 9,10,11,12,13,14,15,16\n"
                 "2, 13,14,15,16,200,201,202,203\n*MATERIAL, NAME=m\n*ELASTIC\n2e11, 0.25\n*DENSITY\n7800\n*SOLID SECTION, ELSET=bolt, MATERIAL=m\n"
                 "*SURFACE, NAME=cut\n1, S2\n*PRE-TENSION SECTION, SURFACE=cut, NODE=300\n*STEP\n*STATIC\n*CLOAD\n300, 1, {tension}\n*END STEP\n")
TOLD = {  # deck, kind, words of what is left out, and a table that the scene has not
    "a contact with itself": (BRICKS + RUB.format(mu=0.3).replace("high_bottom, low_top", "low_top, low_top"), "inp", "contact of low_top with itself", "contact"),
    "a tie to itself": (BRICKS + "*TIE, NAME=t\nlow_top, low_top\n", "inp", "tie of low_top to itself", "tie"),
    "a section of nothing": (BRICKS + "*ELSET, ELSET=none\n*SOLID SECTION, ELSET=none, MATERIAL=m\n", "inp", "set none, which has no elements (line 43)", ""),
    "a support of nothing": (BRICKS + "*NSET, NSET=none\n*BOUNDARY\nnone, 1, 3\n", "inp", "set none, which has no nodes (line 44)", ""),
    "a bolt of no tension": (SHANK.format(tension=0), "inp", "tension 0 of the bolt of node 300", "bolt"),
    "a bolt that pushes": (SHANK.format(tension=-5), "inp", "tension -5 of the bolt of node 300", "bolt"),
    "a contact of OptiStruct with itself": (GRIDS + FACES + "CONTACT,1,.3,11,11\n", "fem", "contact of surf_11 with itself", "contact"),
    "a tie of OptiStruct to itself": (GRIDS + FACES + "TIE,1,11,11\n", "fem", "tie of surf_11 to itself", "tie"),
    "supports of no grids": (GRIDS.replace("123,1,2,3,4", "123,901,902"), "bdf", "SPC1 1 of nodes that are not defined (line 26)", "support"),
    "a support of no grid": (GRIDS.replace("SPC1,1,123,1,2,3,4", "SPC,1,901,123"), "bdf", "node 901, which is not defined (line 26)", "support"),
    "a spring of nothing": (GRIDS + "CELAS2,9,0.,13,2\n", "bdf", "the spring at node 13 (line 27), of stiffness and damping 0", "spring"),
    "a contact of Ansys with itself": (ansys(more=MU.format(mu=0.3), rows=[*MEETING[:3], (4, 3, 3, 7, [5, 8, 7, 6])]), "cdb", "with itself", "contact"),
    "an empty component of Ansys": (ansys(more="CMBLOCK,BASE,NODE,       0\n(8i10)\nCMSEL,S,BASE\nD,ALL,ALL\nNSEL,ALL\n"), "cdb", "no node is selected", "support"),
}


@pytest.mark.parametrize("name", TOLD)
def test_what_does_nothing_is_told_and_left_out(tmp_path, name):
    deck, kind, words, table = TOLD[name]
    scene, left_out = converted(tmp_path, deck, f"deck.{kind}")
    assert any(words in note for note in left_out), left_out
    assert table not in scene


def test_a_contact_of_both_orders_is_one(tmp_path):
    scene, left_out = converted(tmp_path, BRICKS + RUB.format(mu=0.3) + "low_top, high_bottom\n")
    assert [(of["rotor"], of["stator"]) for of in scene["contact"]] == [("low_top", "high_bottom")]
    assert left_out == ["a second contact of low_top (slave) and high_bottom (master): the first, whose slave is high_bottom, stays"]


@pytest.mark.parametrize("old, new, words, said", [
    ("7800", "7.8e-9", (), "a density of 7.8e-09 kg/m3"), ("2e11", "2e5", ("--length", "0.001"), "a density of 7.8e+15 kg/m3"),
    ("2e11", "2e5", ("--length", "1"), "sound would travel at 5.06 m/s"), ("7800", "7800", ("--length", "0.001"), "a density of 7.8e+15 kg/m3"),
])
def test_units_of_no_solid_are_warned_of(tmp_path, capsys, old, new, words, said):
    converted(tmp_path, BRICKS.replace(old, new), words=words)
    printed = capsys.readouterr().out
    assert f"warning: material M: {said}" in printed and "scene.toml: complete, but for 1 warning above" in printed
    converted(tmp_path, BRICKS)
    assert "warning" not in capsys.readouterr().out


IN_MM = {"inp": (BRICKS + RUB.format(mu=0.25) + "*NSET, NSET=lid\n13,14,15,16\n*BOUNDARY\nlid, 1, 2\n*MOTION, TRANSLATION, TYPE=VELOCITY\nall_low, 1, {v}\n*DSLOAD\nhigh_top, P, {p}\n", (LAW, "{e}, 0.25"), ("7800", "{rho}")),
         "bdf": (GRIDS + "SPC1,1,12,13,14,15,16\nPLOAD4,2,2,{p},,,,13,15\n" + FACES + "CONTACT,1,.25,12,11\n", ("2.+11", "{e}"), ("7800.", "{rho}"))}


@pytest.mark.parametrize("kind", IN_MM)
def test_a_deck_in_millimetres_rings_as_the_one_in_metres(tmp_path, converged, kind):
    """E = 2e5 MPa and 7.8e-9 t/mm3 of bricks of 512 mm: lengths and units are powers of two and ten, which differ by rounding alone."""
    found = {}
    text, *changes = IN_MM[kind]
    for old, new in changes:
        text = text.replace(old, new)
    for name, size, values, words in (("mm", 512, dict(e="2.e5", rho="7.8e-9", p="0.125", v="500."), ("--length", "0.001")),
                                      ("m", 0.512, dict(e="2.e11", rho="7800.", p="1.25e5", v="0.5"), ())):
        deck = text
        for key, value in values.items():
            deck = deck.replace("{" + key + "}", value)
        (tmp_path / name).mkdir()
        converted(tmp_path / name, scaled(deck, size, kind), f"deck.{kind}", words)
        scene = tmp_path / name / "out" / "scene.toml"
        report = converged(slid(scene) if kind == "bdf" else with_modes(scene), ranks=1).report
        found[name] = eigenvalues(report), np.array(report["equilibrium"]["contacts"][0]["normal_force_sum"])
    assert len(found["m"][0]) >= 6 and found["m"][1] > 0
    np.testing.assert_allclose(found["mm"][0], found["m"][0], rtol=1e-10)
    np.testing.assert_allclose(found["mm"][1], found["m"][1], rtol=1e-10)


def with_modes(scene):
    scene.write_text(scene.read_text() + '\n[modes]\nmethod = "full"\nband = 4000\n\n[estimate]\nenabled = false\n')
    return scene


def scaled(deck, size, kind):
    """The deck with its lengths times this size."""
    lines, is_node = [], False
    for line in deck.splitlines():
        is_node = line.startswith("*NODE") or is_node and not line.startswith("*")
        words = line.split(",")
        if is_node and not line.startswith("*"):
            words[1:] = [repr(float(word) * size) for word in words[1:4]]
        elif line.startswith("GRID"):
            words[3:] = [repr(float(word) * size) for word in words[3:6]]
        lines.append(",".join(words))
    return "\n".join(lines) + "\n"
