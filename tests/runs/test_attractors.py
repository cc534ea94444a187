"""The motions that many starts lead to, on the oscillator."""

import pytest
from conftest import INPUTS
from models import write_scene
from test_basin import two_oscillators

SCENE = [INPUTS / "oscillator" / "scene.toml", "--set", "transient.enabled=false", "--set", "cycle.steps_per_period=100"]


def test_all_starts_lead_to_the_cycle_that_attracts(converged):
    report = converged(*SCENE, "--set", "cycle.starts=6", ranks=1).report
    found, cycle = report["attractors"], report["cycle"]
    assert found["outcome"] == "completed" and "other start" not in report["heard"]
    assert found["starts"] == ["mode 1"] + [f"random {i}" for i in range(1, 6)]
    (motion,) = found["motions"]
    assert motion["kind"] == "steady" and sorted(motion["starts"]) == list(range(6))
    # means over periods of the mode, of which the cycle's is a hundredth longer, come within their bar
    assert abs(motion["mean_fluctuating_energy"] - cycle["mean_fluctuating_energy"]) < (
        motion["energy_error"] + 2e-3 * cycle["mean_fluctuating_energy"])
    assert abs(motion["frequency_hz"] - cycle["frequency_hz"]) < motion["frequency_error"] + 1e-4 * cycle["frequency_hz"]


def test_a_small_motion_is_followed_without_being_asked(converged):
    report = converged(*SCENE, ranks=1).report
    (motion,) = report["attractors"]["motions"]
    assert report["attractors"]["starts"] == ["growth of mode 1"] and motion["kind"] == "steady"
    assert abs(motion["frequency_hz"] - report["cycle"]["frequency_hz"]) < motion["frequency_error"]
    assert "other start" not in report["heard"]


def test_ranks(module_run):
    """Ranks agree on what is reached."""
    one, two = (module_run(*SCENE, "--set", "cycle.starts=2", ranks=ranks)["attractors"]["motions"] for ranks in (1, 2))
    assert [motion["starts"] for motion in one] == [motion["starts"] for motion in two]
    for a, b in zip(one, two):
        assert a["mean_fluctuating_energy"] == pytest.approx(b["mean_fluctuating_energy"], rel=1e-6)


def test_several_unstable_modes_show_each_motion(squeal, tmp_path):
    """Without a word of the scene. Two oscillators that do not touch: a mode alone leaves the other at rest, both together and
    random sums do not."""
    run = squeal(*two_oscillators(tmp_path), ranks=1)
    found = run.report["attractors"]
    assert found["starts"][:3] == ["mode 1", "mode 2", "modes 1 and 2"]
    both, *alone = found["motions"]
    assert both["starts"] == list(range(2, 8)) and found["starts"][8] == "growth of mode 1"
    assert sorted(motion["starts"] for motion in alone) == [[0, 8], [1]]
    # the copy is slower and of the same stiffness: the same energy, which sums
    for motion in alone:
        assert motion["mean_fluctuating_energy"] == pytest.approx(both["mean_fluctuating_energy"] / 2, rel=0.03)


def test_a_negative_number_of_starts_is_refused(squeal):
    run = squeal(*SCENE, "--set", "cycle.starts=-1", "--dry-run", ranks=1)
    assert run.code == 1 and len(run.messages) == 1 and "cycle.starts=-1" in run.messages[0]


def test_bars_of_starts_hold_the_step_of_a_motion_locked_to_its_grid(squeal, tmp_path):
    """A block on a belt, friction 0.3 and 0.5 at rest: by events it sticks and slips at 0.150203 Hz. Released with a step's begin it
    takes 68 steps of 64 a period of the mode, and 34 of 32."""
    at = [0, 0, 0]
    scene = write_scene(
        tmp_path, point=[{"name": "block", "at": at, "mass": 1, "free": "x y"}, {"name": "belt", "at": at, "mass": 1, "free": "none"}],
        spring=[{"from": "block", "to": "ground", "direction": "x", "stiffness": 1.0, "damping": 0.02}],
        force=[{"on": "block", "vector": [0, -1, 0]}],
        contact=[{"rotor": "belt", "stator": "block", "normal": [0, 1, 0], "tangents": [[1, 0, 0]], "velocity": [0.2, 0, 0]}],
        friction={"coefficient": 0.3, "static_coefficient": 0.5}, modes={"band": 1}, cycle={"starts": 8})
    motion = squeal(scene, ranks=1).report["attractors"]["motions"][0]
    assert motion["kind"] == "steady"
    assert abs(motion["frequency_hz"] - 0.150203) <= motion["frequency_error"] < 0.01 * 0.150203
