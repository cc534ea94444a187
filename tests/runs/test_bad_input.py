"""Bad input: one clear message, a non-zero exit code, no results, no hang."""

import struct

import pytest
from conftest import INPUTS

OSCILLATOR = (INPUTS / "oscillator" / "scene.toml").read_text()

BLOCKS_GEO = """
SetFactory("OpenCASCADE");
DefineConstant[ shift = {0, Name "shift"} ];
Box(1) = {0, 0, 0, 1, 1, 1}; Box(2) = {shift, 0, 1, 1, 1, 1};
MeshSize{ PointsOf{ Volume{1, 2}; } } = 1;
Transfinite Curve{:} = 3; Transfinite Surface{:}; Recombine Surface{:}; Transfinite Volume{:};
Physical Volume("lower") = {1}; Physical Volume("upper") = {2};
Physical Surface("floor") = {5}; Physical Surface("under") = {6}; Physical Surface("over") = {11};
Physical Surface("roof") = {12};
"""

BLOCKS = """
[mesh]
file = "blocks.geo"
[[part]]
name = "lower"
young = 1e9
poisson = 0.3
density = 1000
[[part]]
name = "upper"
young = 1e9
poisson = 0.3
density = 1000
[[support]]
on = "floor"
fixed = "x y z"
[[support]]
on = "roof"
fixed = "x y"
[[pressure]]
on = "roof"
value = 1000.0
[[contact]]
rotor = "under"
stator = "over"
velocity = [1, 0, 0]
[friction]
coefficient = 0.2
[modes]
band = 100
"""


def point_scene(old, new):
    def write(folder):
        assert old in OSCILLATOR
        (folder / "scene.toml").write_text(OSCILLATOR.replace(old, new, 1))
        return [folder / "scene.toml"]

    return write


def latin_1(folder):
    (folder / "scene.toml").write_bytes(("# gr\u00fc\u00df\n" + OSCILLATOR).encode("latin-1"))
    return folder / "scene.toml"


def block_scene(old, new, geo_old="", geo_new="", arguments=()):
    def write(folder):
        assert old in BLOCKS and geo_old in BLOCKS_GEO
        (folder / "scene.toml").write_text(BLOCKS.replace(old, new, 1))
        (folder / "blocks.geo").write_text(BLOCKS_GEO.replace(geo_old, geo_new, 1))
        return [folder / "scene.toml", *arguments]

    return write


def matrix_scene(spoil):
    def write(folder):
        for source in (INPUTS / "oscillator" / "matrices").glob("*.petsc"):
            (folder / source.name).write_bytes(source.read_bytes())
        spoil(folder)
        (folder / "scene.toml").write_text('[matrices]\nfolder = "."\n[friction]\ncoefficient = 0.3\n')
        return [folder / "scene.toml"]

    return write


def truncate(folder):
    data = (folder / "K.petsc").read_bytes()
    (folder / "K.petsc").write_bytes(data[: len(data) // 2])


def not_petsc(folder):
    (folder / "M.petsc").write_text("this is no matrix")


def wrong_size(folder):
    (folder / "F.petsc").write_bytes(struct.pack(">ii", 1211214, 2) + struct.pack(">2d", 0, -1))


def missing(folder):
    (folder / "B.petsc").unlink()


def with_nan(folder):
    (folder / "F.petsc").write_bytes(struct.pack(">ii", 1211214, 3) + struct.pack(">3d", 0, float("nan"), 0))


def with_negative_stiffness(folder):
    data = (folder / "K.petsc").read_bytes()
    assert data.count(struct.pack(">d", 1.1)) == 1
    (folder / "K.petsc").write_bytes(data.replace(struct.pack(">d", 1.1), struct.pack(">d", -1.1)))


def with_entries(name, *values):
    """A 3 x 3 matrix file with the entries (0, 1) and (1, 0)."""

    def write(folder):
        data = struct.pack(">9i", 1211216, 3, 3, 2, 1, 1, 0, 1, 0)
        (folder / f"{name}.petsc").write_bytes(data + struct.pack(">2d", *values))

    return write


def without_pairs(folder):
    for name in ("B", "gap", "drive"):
        (folder / f"{name}.petsc").unlink()
    with_entries("H", 1, -1)(folder)


def in_time(write):
    return lambda folder: [*write(folder), "--set", "transient.steps=10", "--set", "transient.step_size=0.1"]


ORTHOTROPIC = """name = "upper"
orthotropic = { young = [1e9, 2e9, 3e9], poisson = [0.1, 0.1, 0.1], shear = [1e9, 1e9, 1e9] }
density = 1000"""
UPPER = 'name = "upper"\nyoung = 1e9\npoisson = 0.3\ndensity = 1000'

# name: how to write it, what the message must speak of
CASES = {
    "surfaces inside each other": (block_scene("", "", "{shift, 0, 1, 1, 1, 1}", "{shift, 0, 0.99, 1, 1, 1}"),
                                   ["blocks.geo", "'under'", "'over'", "0.01 m inside the rotor", "correct the mesh"]),
    "contact twice": (block_scene("[friction]", '[[contact]]\nrotor = "over"\nstator = "under"\nvelocity = [1, 0, 0]\n[friction]'),
                      ["scene.toml", '"over" and "under" are in contact already', "remove one"]),
    "missing scene file": (lambda folder: [folder / "absent.toml"], ["absent.toml"]),
    "value twice in a sweep": (point_scene("[cycle]\n", '[sweep]\nkey = "friction.coefficient"\nvalues = [0.3, 0.2, 0.3]\n[cycle]\n'),
                               ["scene.toml, line", "[sweep] values", "0.3", "twice", "take one of them out"]),
    "cycle from no transient": (point_scene('periods = 10\nsteps_per_period = 400\n\n[cycle]\n',
                                            'periods = 10\nenabled = false\n\n[cycle]\nstart = "transient"\n'),
                                ["[cycle] start", "[transient]"]),
    "amplitude of no mode": (point_scene("[cycle]\n", "[cycle]\namplitude = 0.1\n"), ["[cycle] amplitude", 'start = "mode"']),
    "negative amplitude": (point_scene("[cycle]\n", '[cycle]\nstart = "mode"\namplitude = -0.1\n'), ["amplitude", "-0.1"]),
    "start of no kind": (point_scene("[cycle]\n", '[cycle]\nstart = "estimat"\n'), ["estimat", "estimate, mode, transient"]),
    "no windows": (lambda folder: [*point_scene("[cycle]\n", "[cycle]\n")(folder), "-settled_periods", "-1"],
                   ["-settled_periods", "-1"]),
    "no exponents": (lambda folder: [*point_scene("[cycle]\n", "[cycle]\n")(folder), "-settled_exponents", "-1"],
                     ["-settled_exponents", "-1"]),
    "negative free periods": (lambda folder: [*point_scene("[cycle]\n", "[cycle]\n")(folder), "-cycle_free_periods", "-3"],
                              ["-cycle_free_periods", "-3"]),
    "latin-1": (lambda folder: [latin_1(folder)], ["scene.toml, line 1", "save the file as UTF-8"]),
    "broken TOML": (point_scene("mass = 1\n", "mass = = 1\n"), ["line", "scene.toml"]),
    "unknown key": (point_scene("stiffness = 1.0", "stifness = 1.0"), ["stifness", "stiffness"]),
    "negative mass": (point_scene("mass = 1\n", "mass = -1\n"), ["mass", "-1"]),
    "mu not a number": (point_scene("coefficient = 0.3", "coefficient = nan"), ["[friction] coefficient", "nan"]),
    "decay speed alone": (point_scene("coefficient = 0.3", "coefficient = 0.3\ndecay_speed = 0.4"),
                          ["scene.toml, line 58", "[friction] decay_speed needs the static_coefficient"]),
    "less friction at rest": (point_scene("coefficient = 0.3", "coefficient = 0.3\nstatic_coefficient = 0.2"),
                              ["[friction] static_coefficient without a decay_speed is at least the friction of sliding"]),
    "negative decay speed": (point_scene("coefficient = 0.3", "decay_speed = -1"), ["[friction] decay_speed", "-1"]),
    "negative mu": (point_scene("coefficient = 0.3", "coefficient = -0.3"), ["[friction] coefficient", "-0.3:"]),
    "text for a number": (point_scene("coefficient = 0.3", 'coefficient = "much"'), ["[friction] coefficient", "much"]),
    "contact with no such point": (point_scene('stator = "pad"', 'stator = "padd"'), ["padd", "pad"]),
    "unknown override": (lambda folder: [INPUTS / "oscillator" / "scene.toml", "--set", "friction.coeficient=1"],
                         ["coeficient", "coefficient"]),
    "unknown option": (lambda folder: [INPUTS / "oscillator" / "scene.toml", "-cycel_snes_monitor"], ["-cycel_snes_monitor"]),
    "key as an option": (lambda folder: [INPUTS / "oscillator" / "scene.toml", "-cycle_start", "mode"],
                         ["-cycle_start", "--set cycle.start="]),
    "unknown argument": (lambda folder: [INPUTS / "oscillator" / "scene.toml", "--dry-rnu"], ["--dry-rnu", "--dry-run"]),
    "no scene": (lambda folder: [], ["scene"]),
    "negative density": (block_scene("density = 1000", "density = -1000"), ["density", "-1000"]),
    "missing part": (block_scene('name = "upper"', 'name = "uper"'), ["uper", "upper"]),
    "missing group": (block_scene('on = "floor"', 'on = "flor"'), ["flor", "floor"]),
    "missing mesh file": (block_scene("blocks.geo", "blokcs.geo"), ["blokcs.geo"]),
    "empty mesh": (block_scene("", "", BLOCKS_GEO, "Point(1) = {0, 0, 0};\n"), ["blocks.geo"]),
    "surfaces side by side": (block_scene("", "", "{0, Name", "{1.25, Name"), ["under", "over", "opposite", "correct"]),
    "surfaces apart": (block_scene("", "", "{shift, 0, 1,", "{shift, 0, 1.125,"), ["under", "over", "0.125 m apart", "reach"]),
    "surfaces inside each other": (block_scene('stator = "over"', 'stator = "over"\nreach = 0.2', "{shift, 0, 1,", "{shift, 0, 0.875,"),
                                   ["under", "over", "0.125 m inside", "correct the mesh"]),
    "a normal into the rotor": (block_scene('stator = "over"', 'stator = "over"\nnormal = "-z"'), ["over", "looks away", "turn it"]),
    "surfaces that look the same way": (block_scene('stator = "over"', 'stator = "roof"\nreach = 3'), ["under", "roof", "same way"]),
    "a slave that a support holds": (block_scene('on = "roof"\nfixed = "x y"', 'on = "over"\nfixed = "x y z"', "= 3; Transfinite Sur",
                                                 "= 3; Transfinite Curve{13:24} = 4; Transfinite Sur"),
                                     ["over", 'slave = "rotor"']),
    "singular stiffness": (block_scene('[[support]]\non = "floor"\nfixed = "x y z"\n', "", arguments=["--set", "support.0.fixed=x y z"]),
                           ["part lower"]),
    "no modulus": (block_scene("young = 1e9\n", ""), ["part]] lower", "'young'", "orthotropic"]),
    "no Poisson's ratio": (block_scene("poisson = 0.3\n", ""), ["part]] lower", "'poisson'", "orthotropic"]),
    "two laws of a part": (block_scene(UPPER, ORTHOTROPIC + "\nyoung = 1e9"), ["part]] upper", "orthotropic excludes young", "keep one"]),
    "a negative shear modulus": (block_scene(UPPER, ORTHOTROPIC.replace("shear = [1e9, 1e9", "shear = [1e9, -1e9")),
                                 ["scene.toml, line 11", "young and shear must be above 0"]),
    "axes that are not square": (block_scene(UPPER, ORTHOTROPIC.replace("shear =", 'axis_2 = [1, 1, 0], shear =')),
                                 ["axis_2 must be square to axis_1"]),
    "ratios of no material": (block_scene(UPPER, ORTHOTROPIC.replace("poisson = [0.1", "poisson = [0.9")), ["negative work", "nu12"]),
    "unknown orthotropic key": (block_scene(UPPER, ORTHOTROPIC.replace("shear =", "sheer =")), ["sheer", "shear"]),
    "loss factor without frequency": (block_scene("density = 1000", "density = 1000\nloss_factor = 0.01"),
                                      ["part]] lower", "loss_frequency", "give the squeal's frequency"]),
    "loss factor of no material": (block_scene("density = 1000", "density = 1000\nloss_factor = 1e9"),
                                   ["part]] lower", "loss_factor = 1e+09", "up to 10"]),
    "loss frequency without a factor": (block_scene("[modes]", "[damping]\nloss_frequency = 100\n[modes]"),
                                        ["loss_frequency", "loss_factor"]),
    "damping that no part takes": (
        block_scene("[modes]", "[damping]\nbeta = 1e-6\n[modes]",
                    arguments=[word for part in ("lower", "upper") for word in ("--set", f"part.{part}.beta=1e-6")]),
        ["[damping] beta has no effect", "every [[part]]"]),
    "gyroscopic part that is not skew": (matrix_scene(with_entries("G", 1, 1)), ["G.petsc", "not skew", "C.petsc"]),
    "circulatory part with pairs": (matrix_scene(with_entries("H", 1, -1)), ["H.petsc", "take B, gap, drive and F out"]),
    "circulatory part with a load": (matrix_scene(without_pairs), ["H.petsc", "take B, gap, drive and F out"]),
    "circulatory part in time": (in_time(matrix_scene(with_entries("H", 1, -1))), ["H.petsc", "take [transient] and [cycle] out"]),
    "truncated matrix": (matrix_scene(truncate), ["K.petsc"]),
    "not a PETSc file": (matrix_scene(not_petsc), ["M.petsc"]),
    "sizes that disagree": (matrix_scene(wrong_size), ["F.petsc", "2", "3"]),
    "missing matrix": (matrix_scene(missing), ["B.petsc"]),
    "negative stiffness": (matrix_scene(with_negative_stiffness), ["not positive definite", "dof 0"]),
    "entry not finite": (matrix_scene(with_nan), ["F.petsc"]),
}


# where one rank sees what is wrong, and where each of them may see it: text, mesh, pairs, factor, matrices
ON_TWO_RANKS = {"broken TOML", "missing mesh file", "surfaces apart", "singular stiffness", "truncated matrix", "sizes that disagree",
                "negative stiffness", "unknown option"}


@pytest.mark.parametrize("name", CASES)
def test_one_clear_message(squeal, tmp_path, name):
    write, words = CASES[name]
    run = squeal(*write(tmp_path), ranks=2 if name in ON_TWO_RANKS else 1)
    assert run.code == 1, run.printed + run.errors
    assert len(run.messages) == 1, run.errors
    for word in words:
        assert word in run.messages[0]
    assert not list(run.output.glob("*")), "results of a run that failed"


def test_more_ranks_than_nodes(squeal):
    run = squeal(INPUTS / "oscillator" / "scene.toml", ranks=4)
    assert run.code == 1 and len(run.messages) == 1 and "ranks" in run.messages[0]


def test_unwritable_output(squeal, tmp_path):
    (tmp_path / "taken").write_text("a file, not a folder")
    run = squeal(INPUTS / "oscillator" / "scene.toml", "--output", tmp_path / "taken" / "results", ranks=1)
    assert run.code == 1 and len(run.messages) == 1 and "--output" in run.messages[0]


def test_an_unused_option_is_named(squeal):
    """It has the prefix of a solver, which asks for no such option."""
    run = squeal(INPUTS / "oscillator" / "scene.toml", "--set", "cycle.enabled=false", "--set",
                 "transient.enabled=false", "-modes_pep_monitr", ranks=1)
    assert run.code == 1 and len(run.messages) == 1 and "-modes_pep_monitr" in run.messages[0]
