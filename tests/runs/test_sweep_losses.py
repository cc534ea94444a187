"""Sweeps and random numbers of scenes with loss factors, contacts with a compliance and parts that spin, against single runs."""

import numpy as np
import pytest
from conftest import INPUTS
from models import write_matrices, write_scene
from test_robustness import random
from test_robustness import rows_of as samples_of
from test_sensitivity import overridden, two_pads
from test_sweep import lambdas, modes_at, rows_of, same_modes, sweep_of

PIN = [INPUTS / "pin_on_disc" / "scene.toml", "--set", "mesh.parameters.divisions=1", "--set", "cycle.enabled=false",
       "--set", "modes.method=full", "--set", "modes.band=10000", "--set", "estimate.enabled=false"]
LOSSES_OF_PARTS = ["--set", "part.pin.loss_factor=0.1", "--set", "part.disc.loss_factor=0.002", "--set",
                   "damping.loss_frequency=5000"]
COMPLIANT = ["--set", "contact.0.compliance=5e-13"]
LOSSY = [*PIN, *LOSSES_OF_PARTS]
SOFT = [*PIN, *COMPLIANT]
# Spin needs more shapes for a mode: of the small mesh up to all that there are.
SPINNING = [*PIN, "--set", "mesh.parameters.divisions=2", "--set", "modes.band=5000", "--set",
            "part.disc.rotation={axis='z',rate=300}"]
ALL = [*SPINNING, *LOSSES_OF_PARTS, *COMPLIANT]


def set_to(key, value):
    return ["--set", overridden(key, value)]


@pytest.mark.parametrize("scene, key, values, ranks", [
    (LOSSY, "part.pin.loss_factor", [0.0, 0.6], [2]),
    (SOFT, "contact.0.compliance", [0.0, 1e-12], [2]),
    ([*SPINNING, "--set", "friction.coefficient=0.1"], "part.disc.rotation.rate", [0.0, 500.0], [2]),
    (ALL, "friction.coefficient", [0.3, 0.4], [1, 2]),
], ids=["loss factor", "compliance", "rate", "friction with all"])
def test_points_are_single_runs(scene, key, values, ranks, converged):
    """Values of what spins have no threshold between them, whose search would take nine tenths of the time."""
    sweeps = [converged(*scene, "--set", f"sweep.key={key}", "--set", f"sweep.values={values}", ranks=n) for n in ranks]
    singles = [lambdas(converged(*scene, *set_to(key, value), ranks=1).report) for value in values]
    for sweep in sweeps:
        assert sweep.report["sweep"]["lost_modes"] == 0
        assert sweep.report["sweep"]["basis_shapes"] < 0.6 * sweep.report["model"]["dofs"]  # it is no whole space
        for value, single in zip(values, singles):
            # backward errors of both vectors are below 1e-8; lambda is off by their product, magnified: 3e-10 at most is seen
            same_modes(modes_at(rows_of(sweep.output), value, key=key), single, 1e-9)


def test_near_neighbours_that_losses_mix_stay_two(converged):
    """Two modes of the disc about 19.19 kHz are 5 Hz apart without its loss factor, which damps by 96 Hz."""
    run = converged(*PIN, "--set", "mesh.parameters.divisions=2", "--set", "modes.band=20000", "--set",
                    "part.disc.loss_factor=0.01", "--set", "damping.loss_frequency=5000", "--set", "friction.coefficient=0.25",
                    ranks=1)
    found = lambdas(run.report)
    assert sum(abs(one.imag - 2 * np.pi * 19190) < 2 * np.pi * 10 for one in found) == 2
    assert len(set(np.round(found, 3))) == len(found)  # 1e-8 of 19 kHz


def test_modes_that_losses_merge_on_the_first_basis_are_two_on_a_better_one(converged):
    """On the 86 shapes of the first correction two modes become one at 15.5 kHz, which ended the point."""
    scene = [*PIN, "--set", "mesh.parameters.divisions=2", "--set", "modes.band=20000", "--set", "damping.loss_frequency=5000",
             "--set", "part.disc.loss_factor=0.02"]
    run = converged(*scene, "--set", "sweep.key=part.pin.loss_factor", "--set", "sweep.values=[0.9]", ranks=1)
    single = converged(*scene, "--set", "part.pin.loss_factor=0.9", ranks=1).report
    same_modes(modes_at(rows_of(run.output), 0.9, key="part.pin.loss_factor"), lambdas(single), 1e-9)


def test_losses_as_large_as_the_stiffness(converged):
    run = converged(*LOSSY, "--set", "sweep.key=part.pin.loss_factor", "--set", "sweep.values=[1.6]", ranks=1)
    single = converged(*LOSSY, "--set", "part.pin.loss_factor=1.6", ranks=1).report
    same_modes(modes_at(rows_of(run.output), 1.6, key="part.pin.loss_factor"), lambdas(single), 1e-9)


def test_the_other_direction_turns_parts_that_spin_round(converged):
    run = converged(*ALL, "--set", "sweep.key=friction.coefficient", "--set", "sweep.values=[0.3, 0.35]", "--set",
                    "sweep.directions=both", ranks=1)
    single = converged(*ALL, "--set", "friction.coefficient=0.35", "--set", "contact.0.rotation={axis='z', rate=-20}",
                       "--set", "part.disc.rotation={axis='z', rate=-300}", ranks=1).report
    same_modes(modes_at(rows_of(run.output), 0.35, -1), lambdas(single), 1e-9)


@pytest.mark.parametrize("key, values", [
    ("contact.0.compliance", [0.0, 1e-8, 1e-6]),
    ("friction.coefficient", [0.1, 0.3, 0.6]),
])
def test_single_runs_change_at_the_thresholds(key, values, tmp_path, converged):
    scene = two_pads(tmp_path, compliance=2e-9)
    run = converged(scene, "--set", f"sweep.key={key}", "--set", f"sweep.values={values}", ranks=1)
    thresholds = run.report["sweep"]["thresholds"]
    assert thresholds
    for threshold in thresholds:
        value = threshold["values"][0]
        counts = [converged(scene, "--set", f"{key}={value + step!r}", ranks=1).report["modes"]["unstable_count"]
                  for step in (-1e-4 * value, 1e-4 * value)]
        assert counts[1] - counts[0] == threshold["change"]


def test_a_single_run_changes_at_the_loss_factor_that_stabilises(converged):
    """Friction makes a mode at 6752 Hz unstable; losses of the pin take it away."""
    ask = [*LOSSY, "--set", "friction.coefficient=0.3"]
    run = converged(*ask, *sweep_of("part.pin.loss_factor", 0.0, 0.1, points=2), ranks=1)
    (threshold,) = run.report["sweep"]["thresholds"]
    eta = threshold["values"][0]
    counts = [converged(*ask, "--set", f"part.pin.loss_factor={eta + step!r}", ranks=1).report["modes"]["unstable_count"]
              for step in (-1e-4 * eta, 1e-4 * eta)]
    assert counts[1] - counts[0] == threshold["change"] == -1


def test_ranks_agree(converged):
    ask = [*ALL, *sweep_of(end=0.35, points=4)]
    one, two = (converged(*ask, ranks=ranks) for ranks in (1, 2))
    for value in (0.05, 0.15, 0.25, 0.35):
        same_modes(*(modes_at(rows_of(run.output), value) for run in (one, two)), 1e-9)


def gyroscopic(folder, circulatory):
    """Three masses on springs; G couples two of them, H too where it is asked for."""
    M, K = np.diag([1.0, 2.0, 1.5]), 1e4 * np.array([[3.0, -1, 0], [-1, 4, -1], [0, -1, 2]])
    G = 30 * np.array([[0.0, 1, 0], [-1, 0, 0.5], [0, -0.5, 0]])
    H = 800 * np.array([[0.0, 1, -1], [-1, 0, 0], [1, 0, 0]])
    model = write_matrices(folder / "model", np.eye(3), [], [], np.zeros(3), M=M, K=K, G=G, **({"H": H} if circulatory else {}))
    for name in ("B", "gap", "drive"):
        (model / f"{name}.petsc").unlink()
    return write_scene(folder, matrices={"folder": "model"}, damping={"alpha": 2.0}, modes={"band": 100})


@pytest.mark.parametrize("circulatory", [False, True])
def test_matrices_with_gyroscopic_and_circulatory_parts(circulatory, tmp_path, converged, squeal):
    scene = gyroscopic(tmp_path, circulatory)
    run = converged(scene, "--set", "sweep.key=damping.alpha", "--set", "sweep.values=[0.5,4.0]", ranks=1)
    for alpha in (0.5, 4.0):
        single = converged(scene, "--set", f"damping.alpha={alpha}", ranks=1).report
        same_modes(modes_at(rows_of(run.output), alpha, key="damping.alpha"), lambdas(single), 1e-9)
    if circulatory:
        both = squeal(scene, *sweep_of("damping.alpha", 0.5, 4.0, directions="both"), ranks=1)
        assert both.report["sweep"]["outcome"] == "refused" and "circulatory" in both.report["sweep"]["reason"]
        assert "followed modes" not in both.printed  # nor figures of none


LOSSES = "{key='part.pin.loss_factor', distribution='uniform', from=0.002, to=0.02}"
COMPLIANCE = "{key='contact.0.compliance', distribution='uniform', from=2e-13, to=1e-12}"
RATE = "{key='part.disc.rotation.rate', deviation=50}"
FRICTION = "{key='friction.coefficient', distribution='uniform', from=0.3, to=0.5}"


@pytest.mark.parametrize("scene, numbers", [
    (LOSSY, [LOSSES, FRICTION, "{key='part.pin.young', deviation=2e8}"]),
    (ALL, [LOSSES, COMPLIANCE, RATE, FRICTION]),
], ids=["losses", "all"])
def test_random_numbers_are_single_runs(scene, numbers, converged):
    """Growth within 1e-3 of |lambda|; the losses move it by up to a hundredth."""
    run = converged(*scene, *random(*numbers, samples=8), ranks=1)
    row = max(samples_of(run), key=lambda row: float(row["growth_rate"]))
    changes = [word for key, value in row.items() if "." in key for word in set_to(key, float(value))]
    single = lambdas(converged(*scene, *changes, ranks=1).report)
    found = complex(float(row["growth_rate"]), 2 * np.pi * float(row["frequency_hz"]))
    assert min(abs(found.real - one.real) / abs(one) for one in single if abs(one - found) < 0.01 * abs(one)) < 1e-3


def test_a_number_may_bring_what_the_medians_lack(converged):
    """At the median nothing spins."""
    run = converged(*SPINNING, *random("{key='part.disc.rotation.rate', distribution='uniform', from=-100, to=100}", samples=4),
                    ranks=1)
    for row in samples_of(run):
        single = converged(*SPINNING, *set_to("part.disc.rotation.rate", float(row["part.disc.rotation.rate"])), ranks=1).report
        found = complex(float(row["growth_rate"]), 2 * np.pi * float(row["frequency_hz"]))
        assert min(abs(one - found) for one in lambdas(single)) < 1e-4 * abs(found)
