"""Contacts that nothing drives, from a scene file: a pad between the disc it rubs on and the abutment that holds it."""

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
[friction]
coefficient = 0.4
[modes]
band = 5000
{more}
"""


@pytest.fixture
def scene(tmp_path):
    def write(force=-1000, joint="", more=""):
        file = tmp_path / "scene.toml"
        file.write_text(SCENE.format(force=force, joint=joint, more=more))
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


def test_what_does_not_know_such_contacts_says_so(scene, squeal):
    wrong = {
        "is the last one": step("press", load=0.5),
        "holds 2 factors": step("press", forces=[1, 1]),
        "moves nothing": '[transient]\n[[initial]]\non = "pad"\n',
        "[sensitivity] does not know": "[sensitivity]\n",
    }
    for words, more in wrong.items():
        run = squeal(scene(more=more), ranks=1)
        assert run.code not in (0, 3) and words in run.errors, (words, run.code, run.errors)
