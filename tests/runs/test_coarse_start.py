"""cycle.start = "coarse": the cycle of a coarser mesh starts the search for the scene's own."""

import pytest
from conftest import INPUTS

PIN = INPUTS / "pin_on_disc" / "scene.toml"
TOLERANCE = 1e-8
GIVEN = ["--set", "modes.method=full", "--set", f"cycle.tolerance={TOLERANCE}", "-cycle_multipliers", "0"]


def coarse(keys):
    return ["--set", "cycle.start=coarse", *(word for key in keys for word in ("--set", f"cycle.{key}"))]


@pytest.mark.parametrize("friction", [0.3, 0.35])
@pytest.mark.parametrize("fidelity", ["full", "auto"])
def test_the_cycle_is_that_of_the_default_start(converged, friction, fidelity):
    scene = [PIN, *GIVEN, "--set", f"friction.coefficient={friction}", "--set", f"fidelity={fidelity}"]
    default = converged(*scene, ranks=1).report
    for ranks in (1, 2):
        run = converged(*scene, *coarse(["coarse_parameters={divisions=3}"]), ranks=ranks)
        report = run.report
        assert report["coarse"]["outcome"] == "converged" and report["coarse"]["dofs"] < report["model"]["dofs"]
        # slow motions multiply the residual: the multipliers next to 1 are within 1e-3 of it
        for key in ("period", "mean_fluctuating_energy"):
            assert report["cycle"][key] == pytest.approx(default["cycle"][key], rel=1e3 * TOLERANCE)
        assert report["cycle"]["residual_full"] <= TOLERANCE
        if fidelity == "full":
            assert report["cycle"]["periods_integrated"] < default["cycle"]["periods_integrated"]


def test_a_mesh_of_its_own_is_the_same_start(converged):
    start = [PIN, *GIVEN, "--set", "fidelity=full", "--set", "mesh.parameters.divisions=3"]
    own = converged(*start, *coarse(["coarse_parameters={divisions=2}"]), ranks=1).report
    file = converged(*start, *coarse([f"coarse_mesh={INPUTS / 'pin_on_disc' / 'pin.geo'}", "coarse_parameters={divisions=2}"]), ranks=1).report
    for key in ("dofs", "frequency_hz", "periods"):
        assert file["coarse"][key] == own["coarse"][key]
    assert file["cycle"]["period"] == own["cycle"]["period"]


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
    run = squeal(*arguments, ranks=2)
    assert run.code == 1 and len(run.messages) == 1 and words in run.messages[0], run.errors
    assert "equilibrium …" not in run.printed
