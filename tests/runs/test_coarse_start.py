"""cycle.start = "coarse": the cycle of a coarser mesh starts the search for the scene's own."""

import pytest
from conftest import INPUTS

PIN = INPUTS / "pin_on_disc" / "scene.toml"
TOLERANCE = 1e-8
GIVEN = ["--set", "modes.method=full", "--set", f"cycle.tolerance={TOLERANCE}", "-cycle_multipliers", "0"]


def coarse(keys):
    return ["--set", "cycle.start=coarse", *(word for key in keys for word in ("--set", f"cycle.{key}"))]


def test_the_cycle_is_that_of_the_default_start(converged):
    """On two ranks by a mesh file of its own and parameters of the geometry; the default start on one."""
    scene = [PIN, *GIVEN, "--set", "fidelity=full", "--set", "mesh.parameters.divisions=5"]
    default = converged(*scene, ranks=1).report["cycle"]
    file = f"coarse_mesh={INPUTS / 'pin_on_disc' / 'pin.geo'}"
    report = converged(*scene, *coarse([file, "coarse_parameters={divisions=4}"]), ranks=2).report
    coarser = report["coarse"]
    assert coarser["outcome"] == "converged" and coarser["dofs"] == 2821 and coarser["pairs"] == 25
    assert coarser["residual"] <= 1e-3 and coarser["mean_fluctuating_energy"] > 0 and coarser["periods"] > 10
    assert coarser["frequency_hz"] == pytest.approx(report["cycle"]["frequency_hz"], rel=0.1)
    assert report["cycle"]["residual_full"] <= TOLERANCE
    # no free periods, and the contact of the first one for a preconditioner: 25, by the estimated one 35, from the estimate 49
    assert report["cycle"]["periods_integrated"] <= default["periods_integrated"] - 20
    # cycles of 60 steps differ by where among the steps their events fall: 2.4e-5 and 1.3e-3 seen; the step's own
    # error of the period is 1e-3
    assert report["cycle"]["period"] == pytest.approx(default["period"], rel=1e-4)
    assert report["cycle"]["mean_fluctuating_energy"] == pytest.approx(default["mean_fluctuating_energy"], rel=5e-3)


def test_without_a_cycle_there_the_search_is_skipped(squeal):
    """The pin's mesh of three divisions squeals at 19 kHz, and no cycle attracts: 40 periods find none, nor do more."""
    run = squeal(PIN, *GIVEN, *coarse(["coarse_parameters={divisions=3}"]), "-cycle_max_periods", "40", ranks=1)
    report = run.report
    assert run.code == 2 and report["coarse"]["outcome"] == "not converged"
    assert report["cycle"]["outcome"] == "skipped" and "take a finer one" in report["cycle"]["reason"]


WRONG = {
    "no coarser mesh": ([PIN, *coarse([])], "needs a coarser mesh: give coarse_parameters"),
    "matrices": ([INPUTS / "oscillator" / "matrices.toml", *coarse(["coarse_parameters={n=1}"])], "needs a [mesh]"),
    "not coarser": ([PIN, *coarse(["coarse_parameters={divisions=4}"])], "coarse_parameters or cycle.coarse_mesh to a coarser one"),
    "another geometry": ([PIN, *coarse(["coarse_parameters={divisions=2,outer_radius=0.101}"])], "of the coarse mesh: both meshes"),
    "other parts": ([PIN, *coarse([f"coarse_mesh={INPUTS / 'disc_brake' / 'brake.geo'}"])], 'cycle.start = "coarse": '),
    "unknown parameter": ([PIN, *coarse(["coarse_parameters={size=2}"])], 'cycle.start = "coarse": '),
    "no start": ([PIN, "--set", "cycle.coarse_parameters={divisions=2}"], 'belong to start = "coarse"'),
}


@pytest.mark.parametrize("case", WRONG)
def test_bad_input_is_refused_before_the_first_stage(squeal, case):
    arguments, words = WRONG[case]
    run = squeal(*arguments, ranks=2 if case == "other parts" else 1)
    assert run.code == 1 and len(run.messages) == 1 and words in run.messages[0], run.errors
    assert "equilibrium …" not in run.printed
