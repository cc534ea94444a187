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
