"""Contacts that nothing drives, from a scene file: a pad between the disc it rubs on and the abutment that holds it."""

import struct

import pytest

SCENE = """
[[point]]
name = "pad"
at = [0, 0, 0]
mass = 1
free = "x y"
[[point]]
name = "disc"
at = [0, 0, 0]
mass = 1
free = "y"
[[point]]
name = "bracket"
at = [0, 0, 0]
mass = 1
free = "x"
[[spring]]
from = "disc"
direction = "y"
stiffness = 5e7
damping = 2e3
[[spring]]
from = "bracket"
direction = "x"
stiffness = 3e7
damping = 2e3
[[force]]
on = "pad"
vector = [0, {force}, 0]
[[contact]]
rotor = "disc"
stator = "pad"
normal = "y"
tangents = ["x"]
velocity = [1, 0, 0]
[[contact]]
rotor = "pad"
stator = "bracket"
normal = "x"
tangents = ["y"]
{joint}
{friction}
[modes]
band = 5000
{more}
"""


@pytest.fixture
def scene(tmp_path):
    def write(force=-1000, joint="", more="", friction=""):
        file = tmp_path / "scene.toml"
        friction = "[friction]\ncoefficient = 0.4\n" + friction
        file.write_text(SCENE.format(force=force, joint=joint, more=more, friction=friction))
        return file

    return write


def step(name, **factors):
    return f'[[step]]\nname = "{name}"\n' + "".join(f"{key} = {value}\n" for key, value in factors.items())


@pytest.mark.parametrize("ranks", [1, 2])
def test_the_clamp_force_is_that_of_the_path(scene, converged, ranks):
    paths = {
        1000 / 1.16: {},
        500 / 0.84: {"force": -500, "more": step("press", load=2) + step("release")},
        1000: {"more": step("press", friction=0) + step("turn")},
    }
    for clamp, how in paths.items():
        equilibrium = converged(scene(**how), ranks=ranks).report["equilibrium"]
        assert equilibrium["contacts"][0]["normal_force_sum"] == pytest.approx(clamp, rel=1e-9)
        pairs = equilibrium["undriven_pairs"]
        assert pairs["stick"] + pairs["slip"] == 1 and pairs["index"] == 1


def test_the_joint_has_a_friction_of_its_own(scene, converged):
    clamp = converged(scene(joint="friction = 0.1"), ranks=1).report["equilibrium"]["contacts"][0]["normal_force_sum"]
    assert clamp == pytest.approx(1000 / 1.04, rel=1e-9)
    smooth = converged(scene(joint="friction = 0"), ranks=1).report["equilibrium"]
    assert smooth["contacts"][0]["normal_force_sum"] == pytest.approx(1000, rel=1e-9)
    assert "undriven_pairs" not in smooth


def test_a_start_in_motion_is_given_by_keys(scene, converged):
    moving = '[transient]\nstart = "equilibrium"\nsteps = 200\nstep_size = 1e-5\n[[initial]]\non = "disc"\nvelocity = [0, 1e-3, 0]\n'
    transient = converged(scene(more=moving), ranks=1).report["transient"]
    assert transient["energy_defect_max"] < 1e-9
    assert len(transient["joint_work"]) == 2 and transient["joint_work"][1] < 1e-12


@pytest.mark.parametrize("ranks", [1, 3])
def test_elastic_slip_goes_on_from_a_state_file(scene, converged, tmp_path, ranks):
    def state_after(steps, start, name):
        file = scene(joint="slip_compliance = 2e-8",
                     more=f'[transient]\nstart = "{start}"\nsteps = {steps}\nstep_size = 1e-5\nsave_state = "{name}"\n'
                          'load_factor = [[0, 0.4]]\n')
        return converged(file, ranks=ranks).report["equilibrium"]["contacts"][0]["normal_force_sum"], (tmp_path / name).read_bytes()

    clamp, _ = state_after(50, "equilibrium", "middle.state")
    assert clamp == pytest.approx(1000 / 1.16, rel=0.3)
    _, twice = state_after(50, "middle.state", "twice.state")
    _, once = state_after(100, "equilibrium", "once.state")
    assert len(once) == len(twice) == 3 * 8 + 8 * (4 + 4 + 4)
    vectors = [[text[i:i + 32] for i in (8, 48, 88)] for text in (once, twice)]
    for one, other in zip(*vectors):
        assert struct.unpack(">4d", one) == pytest.approx(struct.unpack(">4d", other), rel=1e-6, abs=1e-12)


def test_friction_by_a_table_is_that_of_the_drive(scene, converged):
    table = "factor_at_speed = [[0, 2], [0.5, 1.5], [1.5, 0.5]]\n"  # 1 at the drive's 1 m/s
    clamp = converged(scene(joint="friction = 0.4", friction=table), ranks=1)
    assert clamp.report["equilibrium"]["contacts"][0]["normal_force_sum"] == pytest.approx(1000 / 1.16, rel=1e-9)


def test_what_does_not_know_such_contacts_says_so(scene, squeal, tmp_path):
    wrong = {
        "is the last one": step("press", load=0.5),
        "holds 2 factors": step("press", forces=[1, 1]),
        "moves nothing": '[transient]\n[[initial]]\non = "pad"\n',
    }
    runs = {words: scene(more=more).read_text() for words, more in wrong.items()}
    runs |= {words: scene(joint=joint).read_text() for words, joint in {
        "factor_at_speed is on a coefficient": "factor_at_speed = [[0, 2], [1, 1]]",
        "does not change with the speed": "friction = 0.3\nslip_compliance = 1e-9\nfactor_at_speed = [[0, 2], [1, 1]]",
        "one with a rotation or velocity slides": "velocity = [0, 0, 1]\nslip_compliance = 1e-9",
    }.items()}
    runs["[sensitivity] of pairs that slide does not know"] = scene(
        more="[sensitivity]\n", friction="slipped_pairs_stick = false\n").read_text()
    for words, text in runs.items():
        (tmp_path / "wrong.toml").write_text(text)
        run = squeal(tmp_path / "wrong.toml", ranks=1)
        assert run.code not in (0, 3) and words in run.errors, (words, run.code, run.errors)
