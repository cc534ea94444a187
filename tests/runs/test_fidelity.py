"""No more model than the scene needs: what the reduced model says of itself is true, and it is refused where it is none."""

import json
import re

import numpy as np
import pytest
from conftest import INPUTS, interrupted
from models import write_matrices, write_scene

# Whether the cycle attracts is asked nowhere here, and takes longer to find out than the cycle itself.
PIN = [INPUTS / "pin_on_disc" / "scene.toml", "--set", "modes.method=full", "-cycle_multipliers", "0"]


def energy(report):
    return report["cycle"]["mean_fluctuating_energy"]


@pytest.fixture(scope="module")
def reduced(module_run):
    return [module_run(*PIN, "--set", "fidelity=reduced", ranks=ranks) for ranks in (1, 2)]


@pytest.fixture(scope="module")
def fitted(module_run):
    """To an accuracy of 3e-2 and, as the reference, of 1e-2."""
    return [module_run(*PIN, "--set", "cycle.steps_per_period=0", "--set", f"accuracy={accuracy}", ranks=1) for accuracy in (3e-2, 1e-2)]


def test_ranks_agree(reduced):
    """1e-4 and 2e-3: a cycle of 60 steps depends on where among them it begins, by up to its step's error (1e-3 of the
    period, 2e-2 of the energy); it begins in phase, but free motion, which lift-off makes chaotic, got there."""
    for other in reduced[1:]:
        assert other["cycle"]["period"] == pytest.approx(reduced[0]["cycle"]["period"], rel=1e-4)
        assert energy(other) == pytest.approx(energy(reduced[0]), rel=2e-3)
        # an attachment of which about 1e-5 is new, where such shapes are dropped, may stay on some ranks alone
        assert abs(other["fidelity"]["size"] - reduced[0]["fidelity"]["size"]) <= 1


def test_error_estimates_hold(reduced, fitted):
    """The cycle at the finer accuracy lies within the estimates of the coarser one, and of the mere reduced model."""
    reference = fitted[1]
    for run in (reduced[0], fitted[0]):
        estimates = run["fidelity"]["error_estimates"]
        off = abs(energy(run) / energy(reference) - 1)
        assert off < estimates["energy"] + estimates["step_energy"] + 1e-2
        off = abs(run["cycle"]["period"] / reference["cycle"]["period"] - 1)
        assert off < estimates["frequency"] + estimates["step_frequency"] + 1e-2


def test_accuracy_is_met(fitted):
    for run, accuracy in zip(fitted, (3e-2, 1e-2)):
        fidelity = run["fidelity"]
        assert fidelity["used"] == "reduced" and run["cycle"]["outcome"] == "converged"
        assert fidelity["size"] < run["model"]["dofs"] / 10
        assert max(fidelity["error_estimates"].values()) <= accuracy
    assert energy(fitted[0]) == pytest.approx(energy(fitted[1]), rel=4e-2)


def test_corrections_converge_to_the_full_cycle(fitted):
    """Corrections converge to the full model's cycle: its own full-space residual ends far below the reduced cycle's."""
    residuals = [record["residual_full"] for record in fitted[1]["cycle"]["newton"]]
    assert residuals[-1] < 0.2 * residuals[0]


def test_few_modes_make_a_small_model(module_run, reduced):
    run = module_run(*PIN, "--set", "fidelity=reduced", "-reduced_modes", "1", ranks=1)
    assert run["fidelity"]["modes"] < reduced[0]["fidelity"]["modes"]


def test_small_model_is_not_reduced(module_run, tmp_path):
    """Three degrees of freedom: the oscillator is shot at as it is, to its own tolerance."""
    scene = INPUTS / "oscillator" / "scene.toml"
    run = module_run(scene, "--set", "cycle.enabled=true", ranks=1)
    assert run["fidelity"]["used"] == "full" and "not small" in run["fidelity"]["reason"]
    assert run["cycle"]["outcome"] == "converged" and run["cycle"]["residual_full"] <= 1e-8


def test_full_shooting_from_the_reduced_cycle(module_run):
    """The same tolerance on the full residual, the reduced monodromy for a preconditioner: no free periods, and fewer
    than half of the periods that the start from the estimate takes."""
    common = [*PIN, "--set", "cycle.tolerance=1e-6"]
    runs = [module_run(*common, "--set", f"fidelity={model}", ranks=1) for model in ("full", "auto")]
    for run in runs:
        assert run["cycle"]["outcome"] == "converged" and run["cycle"]["residual_full"] <= 1e-6
    old, new = (run["cycle"] for run in runs)
    assert new["periods_integrated"] < 0.5 * old["periods_integrated"]
    # one orbit, begun at another phase of its 64 steps, is another discrete one: 1e-3 of the period, as the step's error
    assert new["period"] == pytest.approx(old["period"], rel=1e-3)


def test_several_unstable_modes_are_refused(squeal):
    """Hardly damped, three modes grow: a reduced cycle from the first alone would say nothing of the others."""
    run = squeal(*PIN, "--set", "damping.beta=3e-8", "--set", "fidelity=reduced", ranks=1)
    assert run.code == 2 and run.report["modes"]["unstable_count"] > 1
    assert run.report["cycle"]["outcome"] == "refused" and "several modes" in run.report["cycle"]["reason"]


def test_a_reduced_search_cut_short_says_where_it_ended(squeal):
    """No period of the full model is made, so that it has no residual; the warning is of a key that nothing uses."""
    run = squeal(*PIN, "--set", "fidelity=reduced", "--set", "cycle.tolerance=1e-7", "-cycle_max_periods", "3", ranks=1)
    cycle = run.report["cycle"]
    assert run.code == 2 and cycle["outcome"] == "not converged" and cycle["residual_full"] is None
    assert re.search(r"ended at a residual of [1-9]\.\de-\d\d, 3e-07 asked for", cycle["reason"])
    assert run.report["fidelity"]["full_periods"] == 0 and "residual full" not in run.printed
    assert "nothing uses it" in run.printed


@pytest.mark.parametrize("speed, exact", [(0.3, 0.773368), (2, 4.627213)])
def test_steps_of_a_small_model_are_enough_for_the_accuracy(module_run, speed, exact):
    """Exact energies, by matrix exponentials between events. Each number of steps has a cycle and a verdict of its own."""
    run = module_run(INPUTS / "oscillator" / "scene.toml", "--set", "transient.enabled=false", "--set", "cycle.steps_per_period=0",
                     "--set", "cycle.tolerance=0", "--set", f"contact.0.velocity=[{float(speed)},0,0]", ranks=1)
    estimates, cycle = run["fidelity"]["error_estimates"], run["cycle"]
    assert cycle["outcome"] == "converged" and cycle["residual_full"] <= 1e-5
    assert cycle["multipliers"]["stability"] == "stable" and cycle["periods_integrated"] <= 60
    off = abs(cycle["mean_energy"] - exact) / energy(run)
    assert off <= estimates["energy"] + estimates["step_energy"] <= 1e-3


def test_cycles_that_agree_by_chance_are_not_taken_for_accurate(tmp_path, converged):
    """The oscillator at mu = 0.1 with a pad that a dashpot drives: its cycle sticks and never opens. The energies at 64, 128 and
    192 steps agree to 8e-5 and are 2e-3 away from 0.4304238 J, that of 16000 steps. Beginning half a step later tells."""
    K = [[1.1, -0.1, 0], [-0.1, 0.5, 0], [0, 0, 1.2]]
    write_matrices(tmp_path / "model", [[0, 1, -1], [1, 0, 0]], [0], [0.6], [0, -1, 0], M=np.diag([1, 1, 0.5]), K=K,
                   C=np.diag([-0.05, 0.02, 0.02]))
    scene = write_scene(tmp_path, matrices={"folder": "model"}, friction={"coefficient": 0.1}, modes={"band": 1}, cycle={})
    run = converged(scene, ranks=1).report
    assert run["cycle"]["mean_fluctuating_energy"] == pytest.approx(0.4304238, rel=1e-3)  # the accuracy asked for


def test_a_cycle_stays_where_the_run_is_ended_while_finer_steps_are_tried(tmp_path):
    """At theta 0.4 the error falls with the step alone, and 1e-6 takes very many."""
    code, printed, errors = interrupted("finer steps", INPUTS / "oscillator" / "scene.toml", "--set", "transient.enabled=false", "--set",
                                        "cycle.steps_per_period=0", "--set", "cycle.theta=0.4", "--set", "accuracy=1e-6", "--output", tmp_path)
    report = json.loads((tmp_path / "report.json").read_text())
    assert code == 3 and report["cycle"]["outcome"] == "converged", errors
    assert "squeals at" in report["heard"] and "the run was ended at" in report["fidelity"]["reason"]
