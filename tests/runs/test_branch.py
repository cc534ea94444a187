"""Branches of cycles: against single runs, exact thresholds, other ranks; bad input; the picture."""

import subprocess
import sys

import numpy as np
import pytest
from conftest import INPUTS, ROOT
from models import sticking_slider, write_coexistence, write_matrices, write_scene

SCENE = [INPUTS / "oscillator" / "scene.toml", "--set", "transient.enabled=false", "--set", "cycle.steps_per_period=200",
         "--set", "fidelity=full"]
HOPF = 0.17649288  # exact: the characteristic polynomial of the sliding oscillator has an imaginary pair


def branch_of(key, start, end):
    return ["--set", f"branch.key={key}", "--set", f"branch.from={start}", "--set", f"branch.to={end}"]


def events(report):
    return [(event["kind"], event["parameter"], event["error"]) for event in report["branch"]["events"]]


@pytest.fixture(scope="module")
def friction(module_run):
    return module_run(*SCENE, *branch_of("friction.coefficient", 0.15, 0.5), ranks=1)


def test_points_are_the_cycles_of_single_runs(friction, converged):
    """At three frictions, from their own estimates: period, energy, amplitude and multiplier."""
    points = friction["branch"]["points"]
    for wanted in (0.2, 0.35, 0.45):
        point = min(points, key=lambda point: abs(point["parameter"] - wanted))
        single = converged(*SCENE, "--set", f"friction.coefficient={point['parameter']!r}", ranks=1).report["cycle"]
        # The step is off by 8e-5 of the period. The phase of its grid against the events moves a twentieth of that.
        assert point["period"] == pytest.approx(single["period"], rel=5e-6)
        assert point["mean_fluctuating_energy"] == pytest.approx(single["mean_fluctuating_energy"], rel=1e-3)
        assert point["peak_to_peak"]["pad_y"] == pytest.approx(single["peak_to_peak"]["pad_y"], rel=1e-3)
        largest = single["multipliers"]["values"][0]
        bar = point["multipliers"][0]["error"] + largest["error"] + 1e-6
        assert abs(point["multipliers"][0]["real"] - largest["real"]) < bar


def test_the_branch_starts_at_the_hopf_point(friction):
    """Friction is linear below first lift-off, so the branch ends straight above the Hopf point, its multiplier 1."""
    branch = friction["branch"]
    found = {kind: (parameter, error) for kind, parameter, error in events(friction)}
    assert abs(found["Hopf"][0] - HOPF) < found["Hopf"][1] + 1e-8
    # the step moves the threshold: Re(lambda_h) = Re(lambda) (1 - (omega h)^2/4), which vanishes where Re(lambda) does
    assert abs(found["first lift-off"][0] - HOPF) < 1e-6
    assert branch["ends"] == {"backward": "linear motion", "forward": "bound"}
    first = branch["points"][0]
    assert first["open_steps"] == 0 and abs(first["multipliers"][0]["real"] - 1) < 1e-6
    assert branch["points"][-1]["parameter"] == 0.5
    assert found["first stick"][0] - found["first stick"][1] > HOPF
    for point in branch["points"]:
        assert (point["stick_steps"] > 0) == (point["parameter"] > found["first stick"][0])


@pytest.mark.parametrize("key, start, end, override", [
    ("contact.0.velocity.0", 0.5, 0.8, "contact.0.velocity=[{},0,0]"),
    ("force.0.vector.1", -1.2, -0.9, "force.0.vector=[0,{},0]"),
])
def test_any_number_of_the_scene(key, start, end, override, converged):
    """Models are built again at each value: the last point is the cycle of the scene with that value."""
    report = converged(*SCENE, *branch_of(key, start, end), "--set", "branch.points=3", ranks=1).report
    points = report["branch"]["points"]
    assert [points[0]["parameter"], points[-1]["parameter"]] == [start, end]
    single = converged(*SCENE, "--set", override.format(end), ranks=1).report["cycle"]
    assert points[-1]["period"] == pytest.approx(single["period"], rel=5e-6)
    assert points[-1]["mean_fluctuating_energy"] == pytest.approx(single["mean_fluctuating_energy"], rel=1e-3)


def test_ranks_agree_on_the_events(module_run):
    """From the Hopf point past first stick: all events lie there."""
    narrow = [*SCENE, *branch_of("friction.coefficient", 0.15, 0.22), "--set", "friction.coefficient=0.2", "--set",
              "branch.points=2", "--set", "cycle.steps_per_period=100"]
    one, other = (module_run(*narrow, ranks=ranks) for ranks in (1, 2))
    for report in (one, other):
        assert [kind for kind, *_ in events(report)] == ["Hopf", "first lift-off", "first stick"]
    for (_, first, error), (_, second, _) in zip(events(one), events(other)):
        assert abs(first - second) <= error + 1e-9
    for first, second in zip(one["branch"]["points"], other["branch"]["points"], strict=True):
        assert first["parameter"] == pytest.approx(second["parameter"], rel=1e-6)
        assert first["period"] == pytest.approx(second["period"], rel=2e-5)  # 5e-6 at 200 steps


PIN = [INPUTS / "pin_on_disc" / "scene.toml", "--set", "modes.method=full", "--set", "transient.enabled=false", "--set",
       "cycle.steps_per_period=32", "--set", "branch.points=2"]


NINE_PAIRS = [*PIN, "--set", "mesh.parameters.divisions=2", "--set", "damping.beta=6e-7", "--set", "friction.coefficient=0.27",
              *branch_of("friction.coefficient", 0.269, 0.274)]  # one of them grazes on the way


@pytest.fixture(scope="module")
def brake(module_run):
    return module_run(*NINE_PAIRS, ranks=1)


def test_a_branch_of_a_mesh_passes_its_own_cycle(brake):
    """The scene's cycle is the answer of one friction; the branch finds it again among its points."""
    branch = brake["branch"]
    assert branch["ends"] == {"backward": "bound", "forward": "bound"}
    own, point = brake["cycle"], min(branch["points"], key=lambda point: abs(point["parameter"] - 0.27))
    assert point["parameter"] == pytest.approx(0.27, rel=1e-9)
    assert point["frequency_hz"] == pytest.approx(1 / own["period"], rel=2e-5)
    assert point["mean_fluctuating_energy"] == pytest.approx(own["mean_fluctuating_energy"], rel=2e-3)


def test_ranks_agree_on_a_branch_of_a_mesh(brake, module_run):
    other = module_run(*NINE_PAIRS, ranks=2)
    assert [kind for kind, *_ in events(brake)] == [kind for kind, *_ in events(other)] == ["grazing"]
    for (_, first, error), (_, second, other_error) in zip(events(brake), events(other)):
        # Halves of the intervals that are left. A pair that grazes between two steps is seen or not by the phase of the grid,
        # so that a bisection may go on with the other half where processors round otherwise.
        assert abs(first - second) <= 3 * (error + other_error)
    for first, second in zip(brake["branch"]["points"], other["branch"]["points"], strict=True):
        # the step is off by 3.5e-3 of the period, and the phase of its grid against the events moves a twentieth of that
        assert first["period"] == pytest.approx(second["period"], rel=1.7e-4)


def test_a_number_that_moves_the_contact_is_followed(converged):
    """Without verdicts, and with the equilibrium's modes beside the points up to the one that squeals: they take longest."""
    run = converged(*PIN, *branch_of("contact.0.gap", 0.95e-9, 1.05e-9), "--set", "contact.0.gap=1e-9", "--set",
                    "branch.points=1", "--set", "modes.band=6000", "-cycle_multipliers", "0", ranks=1)
    branch = run.report["branch"]
    assert branch["key"] == "contact.0.gap" and branch["name"] == "pin_face on disc_face"
    assert branch["name"] in run.printed


def test_a_branch_passes_jumps_of_the_map_to_its_fold_and_hopf_point(converged, tmp_path):
    """Single runs downwards, each from the state of the one before, hold a stable cycle at mu = 0.444 and fall to rest at 0.443;
    the equilibrium is stable up to 0.49977. At 0.45 the map of a period jumps, where the branch ended once."""
    scene = write_coexistence(tmp_path, {"coefficient": 0.55}, cycle={"tolerance": 1e-7})
    run = converged(scene, *branch_of("friction.coefficient", 0.36, 0.6), "--set", "branch.points=12", ranks=1)
    branch = run.report["branch"]
    fold, = [event["parameter"] for event in branch["events"] if event["kind"] == "fold"]
    hopf, = [event["parameter"] for event in branch["events"] if event["kind"] == "Hopf"]
    assert 0.443 < fold < 0.444 and hopf == pytest.approx(0.499772, abs=1e-5)
    assert branch["points"][0]["parameter"] == pytest.approx(hopf, abs=1e-4)


@pytest.mark.parametrize("key, start, end, words", [
    ("friction.coefficent", 0.2, 0.4, "not in the scene"),
    ("friction.direction_damping", 0.2, 0.4, "not a number"),
    ("force.0.vector", 0.2, 0.4, "name an entry"),
    ("mesh.parameters.size", 0.2, 0.4, "change the mesh"),
    ("cycle.tolerance", 0.2, 0.4, "known: part"),
    ("spring.9.stiffness", 0.2, 0.4, "not in the scene"),
    ("friction.coefficient", 0.3, 0.3, "give a range"),
    ("friction.coefficient", 0.4, 0.5, "must lie between"),
    ("friction.coefficient", -0.1, 0.5, "zero or a positive number"),
])
def test_bad_branches_are_refused_before_the_first_stage(key, start, end, words, squeal):
    run = squeal(*SCENE, *branch_of(key, start, end), "--dry-run", ranks=1)
    assert run.code == 1
    assert len(run.messages) == 1 and words in run.messages[0] and "--set branch." in run.messages[0]
    assert "model …" not in run.printed


def test_a_branch_needs_a_cycle(squeal):
    run = squeal(*SCENE, *branch_of("friction.coefficient", 0.2, 0.4), "--set", "cycle.enabled=false", ranks=1)
    assert run.code == 1 and "[cycle]" in run.messages[0]
    run = squeal(*SCENE, *branch_of("friction.coefficient", 0.1, 0.4), "--set", "friction.coefficient=0.12", ranks=1)
    assert run.code == 0 and run.report["branch"]["outcome"] == "skipped"


def test_the_picture_is_drawn(converged):
    run = converged(*SCENE, *branch_of("friction.coefficient", 0.28, 0.32), "--set", "branch.points=3", ranks=1)
    subprocess.run([sys.executable, ROOT / "tools" / "plot", run.output, "--only", "branch"], check=True, capture_output=True)
    assert (run.output / "branch.png").stat().st_size > 10000


def test_falling_friction_is_followed_round_its_fold_to_the_hopf_point(converged, tmp_path):
    """Steps that only slide are not linear where friction falls. Own sweeps upwards: the sticking cycle attracts beside the
    stable equilibrium and has gone beyond the fold."""
    write_matrices(tmp_path / "m", [[0, 1, -1], [1, 0, 0]], [0], [0.13124423], [0, -1, 0], M=np.diag([1, 1, 0.82634314]),
                   C=np.diag([0.00498815, 0.00498815, 0.00412192]),
                   K=[[1.01375113, -0.31402273, 0], [-0.31402273, 1.11350367, 0], [0, 0, 2.79410604]])
    scene = write_scene(tmp_path, matrices={"folder": "m"}, modes={"band": 1e9}, cycle={"steps_per_period": 200},
                        friction={"coefficient": 0.12142547, "static_coefficient": 0.19125306, "decay_speed": 0.07532168})
    branch = converged(scene, *branch_of("friction.coefficient", 0.1, 0.3), ranks=1).report["branch"]
    assert branch["ends"]["forward"] == "small amplitude"
    hopf, = [event for event in branch["events"] if event["kind"] == "Hopf" and event["parameter"] > 0.18][:1]
    fold, = [event for event in branch["events"] if event["kind"] == "fold"]
    assert fold["parameter"] > hopf["parameter"] + fold["error"]
    last = branch["points"][-1]
    assert last["parameter"] == pytest.approx(hopf["parameter"], rel=1e-4)  # 1e-2 of its way from the fold


def test_a_branch_is_followed_where_the_map_of_a_period_jumps(converged, tmp_path):
    """Friction of two directions turns in steps of the grid of time, and some orbits close on neither side of the jump. Cycles
    of single runs at 0.45, 0.5, 0.65 and 0.7 have mean energies of 0.86981, 0.88573, 0.92224 and 0.93295 J; half of the bar is
    the cubic between points, half the jumps' residuals of up to 1e-4."""
    write_matrices(tmp_path / "m", [[0, 1, 0, -1], [1, 0, 0, 0], [0, 0, 1, 0]], [0], [0.30302196, -0.80665068], [0, -1, 0, 0],
                   M=np.diag([0.64946477, 0.40263725, 0.76986867, 0.96158865]),
                   C=np.diag([0.00187686, 0.00116356, 0.00222481, 0.00277885]),
                   K=[[0.8271456, 0.01018081, -0.03251772, 0.12373557], [0.01018081, 1.13737841, 0.04752635, 0.13725626],
                      [-0.03251772, 0.04752635, 0.97594384, -0.01520235], [0.12373557, 0.13725626, -0.01520235, 0.54711067]])
    scene = write_scene(tmp_path, matrices={"folder": "m"}, modes={"band": 1e6}, friction={"coefficient": 0.60578577},
                        cycle={"steps_per_period": 200}, fidelity="full")
    branch = converged(scene, *branch_of("friction.coefficient", 0.424, 0.9086), ranks=1).report["branch"]
    points = branch["points"]
    assert all(point["residual"] <= 1e-4 and point["stability"] == "stable" for point in points)
    energies = np.interp([0.45, 0.5, 0.65, 0.7], *zip(*((p["parameter"], p["mean_energy"]) for p in points)))
    assert energies == pytest.approx([0.86981, 0.88573, 0.92224, 0.93295], rel=1e-3)


def test_a_branch_goes_round_the_corner_where_stick_begins(converged, tmp_path):
    """The stable cycle sticks up to its end: marching with 400 to 8000 steps a period holds it at mu = 4.2423 and no longer at
    4.2426. The branch turns there at once, to cycles that only slide and repel, and no point of it is beyond its fold."""
    scene = sticking_slider(tmp_path, {"coefficient": 4.15}, cycle={"steps_per_period": 400, "start": "mode", "amplitude": 1.3})
    branch = converged(scene, *branch_of("friction.coefficient", 4.1, 4.3), "--set", "branch.points=4", ranks=1).report["branch"]
    fold, = [event for event in branch["events"] if event["kind"] == "fold"]
    assert 4.2423 - fold["error"] <= fold["parameter"] <= 4.2426 + fold["error"] and fold["error"] < 1e-3
    assert all(point["parameter"] <= fold["parameter"] + fold["error"] for point in branch["points"])
    assert {point["stability"] for point in branch["points"]} >= {"stable", "unstable"}
