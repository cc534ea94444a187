"""Sweeps: points and thresholds against single runs and exact values, followed modes, other ranks; bad input; pictures."""

import csv
import json
import subprocess
import sys

import numpy as np
import pytest
from conftest import INPUTS, ROOT, interrupted

OSCILLATOR = [INPUTS / "oscillator" / "scene.toml", "--set", "transient.enabled=false", "--set", "cycle.enabled=false"]
PIN = [INPUTS / "pin_on_disc" / "scene.toml", "--set", "mesh.parameters.divisions=1", "--set", "cycle.enabled=false",
       "--set", "modes.method=full", "--set", "modes.band=10000"]
NINE_PAIRS = [*PIN, "--set", "mesh.parameters.divisions=2"]
HOPF = 0.17649288  # exact: the characteristic polynomial of the sliding oscillator has an imaginary pair


def sweep_of(key="friction.coefficient", start=0.05, end=0.5, **more):
    settings = {"key": key, "from": start, "to": end, **more}
    return [word for name, value in settings.items() for word in ("--set", f"sweep.{name}={value}")]


def rows_of(folder):
    with open(folder / "sweep.csv", newline="") as file:
        return list(csv.DictReader(file))


def modes_at(rows, value, direction=1, key="friction.coefficient"):
    """Eigenvalues at a point, by falling growth rate."""
    return [complex(float(row["growth_rate"]), 2 * np.pi * float(row["frequency_hz"])) for row in rows
            if row["frequency_hz"] and abs(float(row[key]) - value) <= 1e-12 * abs(value) and int(row["direction"]) == direction]


def lambdas(report):
    return [complex(mode["growth_rate"], 2 * np.pi * mode["frequency_hz"]) for mode in report["modes"]["modes"]]


def same_modes(found, wanted, tolerance):
    """Each is there, once; growth rates and frequencies to a part of the eigenvalue's size."""
    found = list(found)
    assert len(found) == len(wanted), (len(found), len(wanted))
    for one in wanted:
        nearest = min(found, key=lambda other: abs(other - one))
        assert abs(nearest - one) <= tolerance * abs(one), (nearest, one)
        found.remove(nearest)


@pytest.fixture(scope="module")
def pin(tmp_path_factory):
    from conftest import Run
    run = Run([*PIN, *sweep_of(end=0.35, points=4, directions="both")], 1, tmp_path_factory.mktemp("pin"))
    assert run.code == 0, run.printed[-2000:] + run.errors[-2000:]
    return run


def test_points_are_single_runs(pin, converged):
    """The basis, made once and corrected by residuals, gives what the full problem gives at each friction, and is
    no whole space."""
    assert pin.report["sweep"]["basis_shapes"] < 0.6 * pin.report["model"]["dofs"]
    rows = rows_of(pin.output)
    for mu in (0.05, 0.15, 0.35):
        single = converged(*PIN, "--set", f"friction.coefficient={mu}", ranks=1).report
        # backward errors of both vectors are below 1e-8; lambda is off by their product, magnified: 3e-10 at most is seen
        same_modes(modes_at(rows, mu), lambdas(single), 1e-9)


def test_the_other_direction_is_a_single_run(pin, converged):
    single = converged(*PIN, "--set", "friction.coefficient=0.35", "--set",
                       "contact.0.rotation={axis='z', rate=-20}", ranks=1).report
    same_modes(modes_at(rows_of(pin.output), 0.35, -1), lambdas(single), 1e-9)


def test_modes_are_followed(pin):
    """All of them: the same pairs are closed at all points. Where pairs open between two points, modes may be lost."""
    sweep = pin.report["sweep"]
    assert sweep["lost_modes"] == 0 and sweep["least_mac"] >= 0.9
    rows = rows_of(pin.output)
    for direction in (1, -1):
        for value in {float(row["friction.coefficient"]) for row in rows}:
            tracks = [row["track"] for row in rows
                      if float(row["friction.coefficient"]) == value and int(row["direction"]) == direction]
            assert len(set(tracks)) == len(tracks)


def test_a_mode_has_one_number_in_both_directions(pin):
    """The pin is its own mirror image, so that each mode of one direction is one of the other, also beside lock-in."""
    sweep, modes = pin.report["sweep"], names(rows_of(pin.output))
    mu = min(float(value) for value, _ in modes)
    first, second = ([tracks for (value, turned), tracks in modes.items() if float(value) == mu and turned == direction]
                     for direction in ("1", "-1"))
    assert first == second
    forward, back = ([(t["track"], t["change"]) for t in sweep["thresholds"] if t["direction"] == direction]
                     for direction in (1, -1))
    assert forward == back
    for entry in sweep["unstable_tracks"]:
        there = [p for p in sweep["points"] if p["direction"] == entry["direction"]]
        assert 0 < entry["unstable_points"] < entry["points"] <= len(there)


def test_thresholds_of_the_pin_are_where_single_runs_change(pin, converged):
    thresholds = [t for t in pin.report["sweep"]["thresholds"] if t["direction"] == 1]
    assert thresholds
    mu, change = thresholds[0]["values"][0], thresholds[0]["change"]
    counts = [converged(*PIN, "--set", f"friction.coefficient={mu + step}", ranks=1).report["modes"]["unstable_count"]
              for step in (-1e-4 * mu, 1e-4 * mu)]
    assert counts[1] - counts[0] == change


def test_pairs_that_open_leave_no_mode_of_rounding(converged):
    """Three of nine pairs open on the way. Shapes that lie on pivots alone gave eigenvalues of any size, and a basis that
    grew in search of them, to 398 shapes of 475 degrees of freedom."""
    small = [*NINE_PAIRS, "--set", "damping.beta=6e-7", "--set", "modes.band=8000"]
    run = converged(*small, *sweep_of(end=0.6, points=7, directions="both"), ranks=1)
    assert run.report["sweep"]["basis_shapes"] < 475 / 2
    single = converged(*small, "--set", "friction.coefficient=0.6", "--set", "contact.0.rotation={axis='z', rate=-20}",
                       ranks=1).report
    same_modes(modes_at(rows_of(run.output), 0.6, -1), lambdas(single), 1e-9)


def test_modes_unstable_up_to_a_change_of_contact_alone_are_found(converged):
    """As the pin stiffens a mode becomes unstable, and stable again where one of nine pairs opens. Neither end of the step shows
    it. The pin is its own mirror image, so that both directions have the same thresholds."""
    key = "part.pin.young"
    small = [*NINE_PAIRS, "--set", "modes.band=11000"]
    sweep = converged(*small, *sweep_of(key=key, start=1.7e10, end=1.88e10, points=2, directions="both"), ranks=1).report["sweep"]
    assert [p["unstable_modes"] for p in sweep["points"] if not p["inserted"]] == [0] * 4
    found, reversed_ = ([t for t in sweep["thresholds"] if t["direction"] == direction] for direction in (1, -1))
    assert [t["change"] for t in found] == [t["change"] for t in reversed_] == [1, -1]
    for one, other in zip(found, reversed_):
        assert other["values"][0] == pytest.approx(one["values"][0], rel=2e-5)
        before, behind = (converged(*small, "--set", f"{key}={one['values'][0] * factor}", ranks=1).report["modes"]["unstable_count"]
                          for factor in (1 - 1e-4, 1 + 1e-4))
        assert behind - before == one["change"]
    for direction in (1, -1):
        assert {p["closed"] for p in sweep["points"] if p["direction"] == direction} == {8, 9}
    assert sweep["steps_cut_short"] == 0


@pytest.mark.parametrize("values", ["[-1, 1]", "[-1, 0, 1]"])
def test_contact_that_opens_at_zero_is_found(values, converged):
    """The oscillator's pad is held by its load alone: it opens where that is zero, to 1e-5 of the step's larger end."""
    sweep = converged(*OSCILLATOR, "--set", "sweep.key=force.0.vector.1", "--set", f"sweep.values={values}", ranks=1).report["sweep"]
    places = [(p["values"][0], p["closed"]) for p in sweep["points"]]
    assert len(places) <= 4 and {closed for _, closed in places} == {0, 1}
    assert max(force for force, closed in places if closed) == pytest.approx(0, abs=1e-5)
    assert min(force for force, closed in places if not closed) == pytest.approx(0, abs=1e-5)


@pytest.mark.parametrize("values", ["[0.05,0.5]", "[0.05,0.275,0.5]", "[0.1,2.5]", "[0.1,0.3,0.9,1.6,2.5]"])
def test_the_exact_threshold_of_the_oscillator(values, converged):
    """Whatever the points: lock-in lies between two of them, where modes cannot be told apart, and the growth rate is
    flat before it. The mode that it names is the unstable one at every later point."""
    run = converged(*OSCILLATOR, "--set", "sweep.key=friction.coefficient", "--set", f"sweep.values={values}", ranks=1)
    sweep = run.report["sweep"]
    assert [t["change"] for t in sweep["thresholds"]] == [1]
    threshold = sweep["thresholds"][0]
    assert threshold["values"][0] == pytest.approx(HOPF, abs=threshold["error"])
    assert threshold["error"] <= 1e-5 * json.loads(values)[-1]
    assert sweep["lost_modes"] == 0 and sweep["least_mac"] >= 0.9
    unstable = {row["track"] for row in rows_of(run.output) if float(row["growth_rate"]) > 1e-6}
    assert unstable == {str(threshold["track"])}


@pytest.mark.parametrize("key, value, override, unit", [
    ("spring.0.damping", 0.03, "spring.0.damping={}", "N s/m"),
    ("contact.0.velocity.0", 0.9, "contact.0.velocity=[{},0,0]", "m/s"),
    ("force.0.vector.1", -2.0, "force.0.vector=[0,{},0]", "N"),
    ("point.pad.mass", 1.3, "point.pad.mass={}", "kg"),
])
def test_any_number_of_the_scene(key, value, override, unit, converged):
    run = converged(*OSCILLATOR, "--set", f"sweep.key={key}", "--set", f"sweep.values=[{0.9 * value}, {value}]", ranks=1)
    single = converged(*OSCILLATOR, "--set", override.format(value), ranks=1).report
    same_modes(modes_at(rows_of(run.output), value, key=key), lambdas(single), 1e-10)
    assert run.report["sweep"]["units"] == [unit]


def test_a_modulus_of_the_pin(converged):
    """K and M change with the number: the basis of one modulus is corrected for the other."""
    run = converged(*PIN, *sweep_of("part.pin.young", 4e9, 6e9, points=3), ranks=1)
    single = converged(*PIN, "--set", "part.pin.young=6e9", ranks=1).report
    same_modes(modes_at(rows_of(run.output), 6e9, key="part.pin.young"), lambdas(single), 1e-9)


def write_table(folder, *points):
    file = folder / "points.csv"
    file.write_text("friction.coefficient,spring.0.damping\n" + "".join(f"{mu},{damping}\n" for mu, damping in points))
    return file


def test_design_points_have_the_modes_of_the_first(converged, tmp_path):
    """Each point is a single run; its modes are named by the first point's, though lock-in lies between."""
    table = write_table(tmp_path, (0.1, 0.02), (0.3, 0.02), (0.3, 0.05), (0.15, 0.03))
    run = converged(*OSCILLATOR, "--set", f"sweep.table={table}", ranks=1)
    rows = rows_of(run.output)
    assert run.report["sweep"]["units"] == ["-", "N s/m"] and run.report["sweep"]["thresholds"] == []
    for mu, damping in ((0.1, 0.02), (0.3, 0.05)):
        single = converged(*OSCILLATOR, "--set", f"friction.coefficient={mu}", "--set", f"spring.0.damping={damping}", ranks=1).report
        same_modes(modes_at([row for row in rows if float(row["spring.0.damping"]) == damping], mu), lambdas(single), 1e-9)
    names_at = {}
    for row in rows:
        names_at.setdefault((row["friction.coefficient"], row["spring.0.damping"]), []).append(row["track"])
    assert sorted(names_at["0.10000000000000001", "0.02"]) == ["0", "1"]
    unstable = {row["track"] for row in rows if float(row["growth_rate"]) > 1e-6}
    assert len(names_at) == 4 and len(unstable) == 1  # the partner that grows


@pytest.mark.parametrize("ranks", [2, 3])
def test_ranks_agree(ranks, pin, squeal):
    """The same modes, under the same names, and the same thresholds."""
    other = squeal(*PIN, *sweep_of(end=0.35, points=4, directions="both"), ranks=ranks)
    assert other.code == 0
    first, second = rows_of(pin.output), rows_of(other.output)
    for direction in (1, -1):
        for mu in (0.05, 0.15, 0.25, 0.35):
            same_modes(modes_at(first, mu, direction), modes_at(second, mu, direction), 1e-9)
    assert names(first) == names(second)
    for a, b in zip(pin.report["sweep"]["thresholds"], other.report["sweep"]["thresholds"], strict=True):
        assert a["track"] == b["track"] and a["direction"] == b["direction"]
        assert a["values"][0] == pytest.approx(b["values"][0], abs=a["error"] + b["error"])


def names(rows):
    """The modes' numbers at each point, by rising frequency."""
    points = {}
    for row in sorted((row for row in rows if row["frequency_hz"]), key=lambda row: float(row["frequency_hz"])):
        value = row.get("friction.coefficient") or row["point.pad.mass"]
        points.setdefault((value, row["direction"]), []).append(row["track"])
    return points


def test_points_that_fail_are_passed_over(squeal):
    """Turned round, friction presses the pad on: beyond D_nn/D_nt = 2.87/0.185 = 15.5 there is no equilibrium."""
    run = squeal(*OSCILLATOR, "--set", "contact.0.velocity=[-0.6,0,0]", "--set", "sweep.key=friction.coefficient", "--set",
                 "sweep.values=[0.1, 0.3, 50]", ranks=1)
    assert run.code == 2
    sweep = run.report["sweep"]
    assert sweep["outcome"] == "not converged"
    assert "1 of 3 points failed, the first at friction.coefficient = 50: " in sweep["reason"]
    assert [p["outcome"] == "converged" for p in sweep["points"] if not p["inserted"]] == [True, True, False]
    assert sweep["points"][-1]["reason"]


def test_a_point_put_in_between_is_none_of_the_scene(converged):
    """Either rotation opens another one of nine pairs; halfway between nothing drives them, which sweeps do not know. Modes are
    followed without that point, which is said once though the step is divided there for several reasons."""
    sweep = converged(*NINE_PAIRS, "--set", "modes.band=7000", "--set", "friction.coefficient=0.5",
                      *sweep_of(key="contact.0.rotation.rate", start=-20, end=20, points=2), ranks=1).report["sweep"]
    assert [(p["values"][0], p["outcome"]) for p in sweep["points"] if p["inserted"]] == [(0, "not converged")]
    assert "1 of 1 points put in between failed, the first at contact.0.rotation.rate = 0" in sweep["reason"]


def test_equilibrium_alone(converged):
    sweep = converged(*PIN, *sweep_of(points=3, stages="equilibrium"), ranks=1).report["sweep"]
    assert [p["closed"] > 0 for p in sweep["points"]] == [True] * 3 and "growth_rate" not in sweep["points"][0]
    opening = converged(*OSCILLATOR, "--set", "sweep.key=force.0.vector.1", "--set", "sweep.values=[-1, 1]", "--set",
                        "sweep.stages=equilibrium", ranks=1).report["sweep"]
    assert [p["closed"] for p in opening["points"]] == [1, 0]  # none is put in between for modes


@pytest.mark.parametrize("settings, words", [
    (sweep_of("friction.coefficent"), "not in the scene"),
    (sweep_of("friction.direction_damping"), "not a number"),
    (sweep_of("mesh.parameters.size"), "change the mesh"),
    (sweep_of("cycle.tolerance"), "known: part"),
    (sweep_of(start=0.3, end=0.3), "give a range"),
    (sweep_of(start=-0.1), "zero or a positive number"),
    (sweep_of(points=1), "at least two"),
    (sweep_of(points="[3,4]"), "a positive number"),
    (sweep_of(values="[0.1]"), "keep one form"),
    (sweep_of("['friction.coefficient','spring.0.damping']"), "names 2 numbers: give one, or a table of points"),
    (sweep_of(directions="all"), "none of one, both"),
    (sweep_of(stages="squeal"), "none of equilibrium, modes"),
    (["--set", "sweep.key=friction.coefficient"], "give a range"),
    ([*sweep_of(), "--set", "contact.0.friction=0.3"], "changes nothing, since each contact has friction of its own"),
])
def test_bad_sweeps_are_refused_before_the_first_stage(settings, words, squeal):
    run = squeal(*OSCILLATOR, *settings, "--dry-run", ranks=1)
    assert run.code == 1
    assert len(run.messages) == 1 and words in run.messages[0] and "--set sweep." in run.messages[0], run.errors
    assert "model …" not in run.printed


def test_the_pictures_are_drawn(pin, converged, tmp_path):
    table = write_table(tmp_path, *((mu, damping) for mu in (0.1, 0.2, 0.3) for damping in (0.02, 0.05)))
    designed = converged(*OSCILLATOR, "--set", f"sweep.table={table}", "--set", "sweep.directions=both", ranks=1)
    for run in (pin, designed):
        subprocess.run([sys.executable, ROOT / "tools" / "plot", run.output, "--only", "sweep"], check=True, capture_output=True)
        assert (run.output / "sweep.png").stat().st_size > 10000


@pytest.mark.parametrize("ranks, divisions, start, end, points", [(1, 2, 0.4, 0.5, 3), (2, 1, 0.05, 0.35, 24)])
def test_an_interrupted_sweep_keeps_its_points_and_begins_again(ranks, divisions, start, end, points, squeal, tmp_path):
    """What is done is written; the restart finds the same points and thresholds as in one piece. Between
    0.4 and 0.5 a pair of nine opens: points are put in, and one mode ends there and another begins."""
    pin = PIN[:PIN.index("modes.method=full") - 1]  # modes leave the scene's own band and come back
    pin += ["--set", f"mesh.parameters.divisions={divisions}"]
    sweep = sweep_of(start=start, end=end, points=points)
    ask = [*pin, *sweep, "--output", tmp_path / "in_two"]
    whole = squeal(*pin, *sweep, ranks=ranks)
    code, printed, errors = interrupted(r"^  sweep +\d", *ask, ranks=ranks)
    assert code == 3 or ranks == 2, errors
    if code == 3:  # what is done is in the results
        ended = json.loads((tmp_path / "in_two" / "report.json").read_text())["sweep"]
        at = [p["values"][0] for p in ended["points"]]
        assert ended["outcome"] == "interrupted" and f"of {points} points" in ended["reason"]
        assert set(at) <= {p["values"][0] for p in whole.report["sweep"]["points"]}
        assert [p["inserted"] for p in ended["points"]].count(False) < points
        assert {float(row["friction.coefficient"]) for row in (rows_of(tmp_path / "in_two") if at else [])} == set(at)
        code = squeal(*ask, "--restart", ranks=ranks).code
    assert whole.code == code == 0
    one, two = whole.report["sweep"], json.loads((tmp_path / "in_two" / "report.json").read_text())["sweep"]
    assert [p["values"] for p in one["points"]] == [p["values"] for p in two["points"]]
    tracks = [[(row["friction.coefficient"], row["track"]) for row in rows_of(folder)]
              for folder in (whole.output, tmp_path / "in_two")]
    assert tracks[0] == tracks[1]  # of modes that left the band for a while, too
    for a, b in zip(one["thresholds"], two["thresholds"], strict=True):
        assert a["values"][0] == pytest.approx(b["values"][0], abs=a["error"] + b["error"]) and a["track"] == b["track"]
