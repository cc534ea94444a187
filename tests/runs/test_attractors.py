"""The motions that many starts lead to, on the oscillator."""

import pytest
from conftest import INPUTS
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


BLOCK_ON_BELT = """
point = [{ name = "block", at = [0, 0, 0], mass = 0.538, free = "x y" }, { name = "belt", at = [0, 0, 0], free = "none" }]
spring = [{ from = "block", direction = "x", stiffness = 6957, damping = 5.946 }]
force = [{ on = "block", vector = [0, -10, 0] }]
contact = [{ rotor = "belt", stator = "block", normal = [0, 1, 0], tangents = [[1, 0, 0]], velocity = [0.05, 0, 0] }]
friction = { coefficient = 0.2, static_coefficient = 0.6, decay_speed = 1e-3 }
modes = { band = 100 }
cycle = { }
"""


@pytest.mark.parametrize("speed, frequency", [(1e-3, 16.620), (2e-3, 16.50094)])
def test_falling_friction_drives_stick_slip_beside_stable_sliding(converged, tmp_path, speed, frequency):
    """Without a word of the scene, at as many steps as have one solution. The frequencies are of event-driven
    integration, from displacements above 1.1 V/omega; smaller ones die out."""
    scene = tmp_path / "scene.toml"
    scene.write_text(BLOCK_ON_BELT)
    report = converged(scene, "--set", f"friction.decay_speed={speed}", ranks=1).report
    assert report["heard"].startswith("silent: no mode grows in the band, but ")
    rest, motion = sorted(report["attractors"]["motions"], key=lambda motion: motion["frequency_hz"])
    assert rest["kind"] == "rest" and motion["kind"] == "steady"
    assert abs(motion["frequency_hz"] - frequency) < motion["frequency_error"] < 0.02 * frequency
