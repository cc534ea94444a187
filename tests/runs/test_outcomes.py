"""Runs that end early or go on: what cannot be is a result that says so, and a state goes from one run to another."""

import numpy as np
import pytest
from conftest import INPUTS
from test_bad_input import CASES

# coarse, and damped so that its cycle is found in a second
PIN = [INPUTS / "pin_on_disc" / "scene.toml", "--set", "mesh.parameters.divisions=2", "--set", "damping.beta=6e-7"]


def test_friction_too_large_is_no_equilibrium(squeal):
    run = squeal(*PIN, "--set", "friction.coefficient=50", "--set", "transient.enabled=true")
    assert run.code == 2
    report = run.report
    assert report["equilibrium"]["outcome"] == "no equilibrium"
    assert "mu = 50" in report["equilibrium"]["reason"]
    for stage in ("modes", "estimate", "transient", "cycle"):
        assert report[stage]["outcome"] == "skipped" and "no equilibrium" in report[stage]["reason"]
    assert "NO EQUILIBRIUM" in run.printed


def test_without_friction_the_chain_stops_after_the_modes(converged):
    report = converged(*PIN, "--set", "friction.coefficient=0", "--set", "transient.enabled=true").report
    assert report["modes"]["outcome"] == "converged" and report["modes"]["unstable_count"] == 0
    for stage in ("estimate", "transient", "cycle"):
        assert report[stage]["outcome"] == "skipped" and "stable" in report[stage]["reason"]


def test_a_cycle_that_may_not_converge_says_so(squeal):
    run = squeal(INPUTS / "oscillator" / "scene.toml", "--set", "transient.enabled=false", "--set",
                 "cycle.free_periods=2", "-cycle_max_periods", "3", "-settled_periods", "4", ranks=1)
    assert run.code == 2
    assert run.report["cycle"]["outcome"] == "not converged" and "periods" in run.report["cycle"]["reason"]


def test_a_body_that_nothing_holds_is_named_on_one_rank_too(squeal, tmp_path):
    write, words = CASES["singular stiffness"]
    run = squeal(*write(tmp_path), ranks=1)
    assert run.code == 1 and len(run.messages) == 1 and words[0] in run.messages[0]


def read_state(file):
    data = file.read_bytes()
    size = int.from_bytes(data[4:8], "big")
    record = 8 + 8 * size
    assert len(data) == 2 * record
    return np.array([np.frombuffer(data[start + 8:start + record], ">f8") for start in (0, record)])


def test_a_state_goes_on_at_any_number_of_ranks(converged, squeal, tmp_path):
    """From the saved cycle on 1 and 2 ranks: the same state afterwards, to what the contact tolerance leaves."""
    cycle = converged(*PIN, "--set", "cycle.steps_per_period=40", "--set", f"cycle.save_state={tmp_path}/cycle.state",
                      "-cycle_multipliers", "0", ranks=1).report["cycle"]
    ends = []
    for ranks in (1, 2):
        end = tmp_path / f"end{ranks}.state"
        report = converged(*PIN, "--set", "cycle.enabled=false", "--set", "transient.enabled=true", "--set",
                           f"transient.start={tmp_path}/cycle.state", "--set", "transient.steps=80", "--set",
                           f"transient.step_size={cycle['period'] / 40}", "--set", f"transient.save_state={end}",
                           ranks=ranks).report
        assert report["transient"]["outcome"] == "completed"
        ends.append(read_state(end))
    begin = read_state(tmp_path / "cycle.state")
    for one, two, first in zip(*ends, begin):
        assert np.abs(one - two).max() < 1e-9 * np.abs(one).max()
        # two periods of the cycle, closed to 1e-5 in the energy norm: a wrong start would be off by its own size
        assert np.abs(one - first).max() < 1e-3 * np.abs(first).max()

    other = squeal(INPUTS / "oscillator" / "scene.toml", "--set", f"transient.start={tmp_path}/cycle.state")
    assert other.code == 1 and len(other.messages) == 1
    assert "cycle.state" in other.messages[0] and "degrees of freedom" in other.messages[0]
    assert not list(other.output.glob("*"))
