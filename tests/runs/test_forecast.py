"""The memory that --dry-run forecasts, against what the run takes."""

import re

import pytest
from conftest import INPUTS

STAGES = {
    "equilibrium": ["--set", "modes.enabled=false", "--set", "transient.enabled=false", "--set", "cycle.enabled=false"],
    "modes": ["--set", "transient.enabled=false", "--set", "cycle.enabled=false"],
}
MODELS = {
    "pin": [INPUTS / "pin_on_disc", "--set", "modes.method=full"],
    "brake": [INPUTS / "tgv", "--set", "modes.method=full", "--set", "mesh.parameters.size=4000"],
}


def forecast(printed):
    """MB by stages, and the most."""
    line = next(line for line in printed.splitlines() if "memory forecast" in line)
    stages = {name: float(number) for name, number in re.findall(r"(\w+) (\S+) MB", line)}
    return stages, float(re.search(r"at most (\S+) MB", line)[1])


# the factor of the brake's modes is the largest of a rank; each model, stage and number of ranks meets each other
@pytest.mark.parametrize("model, ranks, stage", [("pin", 1, "equilibrium"), ("pin", 2, "modes"), ("brake", 1, "modes"), ("brake", 2, "equilibrium")])
def test_the_memory_of_a_run_is_its_forecast(converged, model, ranks, stage):
    arguments = [*MODELS[model], *STAGES[stage]]
    stages, most = forecast(converged(*arguments, "--dry-run", ranks=ranks).printed)
    taken = 1e-6 * converged(*arguments, ranks=ranks).report["model"]["memory_bytes"]
    assert stage in stages and most == max(stages.values())
    assert taken / 1.3 < most < 1.3 * taken


@pytest.mark.parametrize("options, kind", [([], "supernodal"), (["-factor_limit", "0"], "mumps"), (["-factor", "mumps"], "mumps")])
def test_the_factor_is_chosen_by_its_forecast_and_told(converged, options, kind):
    printed = converged(*MODELS["pin"], *STAGES["equilibrium"], *options, ranks=2).printed
    line = next(line for line in printed.splitlines() if line.strip().startswith("factor:"))
    share, limit = (float(number) for number in re.findall(r"(\S+) MB", line))
    assert f"factor: {kind}," in line and share > 0
    assert limit == 0 if "-factor_limit" in options else limit > 100 * share  # half of what is free here
