"""Random numbers: samples against single runs, the exact threshold, probabilities, ranks and seeds; bad input; the picture."""

import csv
import subprocess
import sys

import numpy as np
import pytest
from conftest import INPUTS, ROOT

OSCILLATOR = [INPUTS / "oscillator" / "scene.toml", "--set", "transient.enabled=false", "--set", "cycle.enabled=false"]
PIN = [INPUTS / "pin_on_disc" / "scene.toml", "--set", "mesh.parameters.divisions=2", "--set", "cycle.enabled=false",
       "--set", "modes.method=full", "--set", "modes.band=20000"]
HOPF = 0.17649288  # exact: the characteristic polynomial of the sliding oscillator has an imaginary pair
FRICTION = "{key='friction.coefficient', distribution='uniform', from=0.1, to=0.3}"


def random(*numbers, **settings):
    words = [word for name, value in settings.items() for word in ("--set", f"robustness.{name}={value}")]
    return [*words, "--set", f"uncertain=[{', '.join(numbers)}]"]


def rows_of(run):
    with open(run.output / "robustness.csv", newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def friction(tmp_path_factory):
    from conftest import Run
    run = Run([*OSCILLATOR, *random(FRICTION, samples=400)], 1, tmp_path_factory.mktemp("friction"))
    assert run.code == 0, run.printed[-2000:] + run.errors[-2000:]
    return run


def test_samples_are_unstable_beyond_the_exact_threshold(friction):
    for row in rows_of(friction):
        assert (int(row["unstable_modes"]) > 0) == (float(row["friction.coefficient"]) > HOPF)


def test_the_interval_holds_the_exact_probability(friction):
    """0.4 of 400 samples at most 99.99 % of the time: 3.9 deviations of sqrt(p (1 - p)/n) = 0.024."""
    exact = (0.3 - HOPF) / 0.2
    any_mode = friction.report["robustness"]["any"]
    assert any_mode["lower"] < any_mode["probability"] < any_mode["upper"]
    assert abs(any_mode["probability"] - exact) < 3.9 * np.sqrt(exact * (1 - exact) / 400)
    (mode,) = friction.report["robustness"]["modes"]
    assert mode["probability"] == any_mode["probability"] and mode["mode"] >= 0
    (number,) = friction.report["robustness"]["numbers"]
    assert number["rank_correlation"] > 0.9


def test_samples_are_closed(friction):
    """The oscillator has three shapes: the basis holds them all, and only rounding is left."""
    assert friction.report["robustness"]["residual"] < 1e-9


def test_a_skewed_number_is_taken_as_it_is(converged):
    """Its median less half its spread is below zero, where no sample lies."""
    spring = "{key='spring.2.stiffness', distribution='lognormal', mean=0.2, deviation=0.15}"
    run = converged(*OSCILLATOR, *random(FRICTION, spring, samples=100), ranks=1)
    assert run.report["robustness"]["residual"] < 1e-9 and "failed" not in run.printed


POINTS = """title = "a pad on a caliper, on a disc"
point = [{name = "pad", at = [0, 0, 0], mass = 0.4, free = "x y"}, {name = "disc", at = [0, 0, 0], mass = 1.3, free = "x y"},
         {name = "caliper", at = [0, 0.1, 0], mass = 0.2, free = "x y"}]
spring = [{from = "pad", to = "caliper", direction = [1, -1, 0], stiffness = 3e6, damping = 5},
          {from = "pad", to = "ground", direction = "x", stiffness = 1.35e7, damping = 10},
          {from = "pad", to = "ground", direction = "y", stiffness = 9e6, damping = 8},
          {from = "caliper", to = "ground", direction = "y", stiffness = 1e6, damping = 1},
          {from = "caliper", to = "ground", direction = "x", stiffness = 4e6, damping = 2},
          {from = "disc", to = "ground", direction = "y", stiffness = 1.5e7, damping = 4},
          {from = "disc", to = "ground", direction = "x", stiffness = 2e7, damping = 4}]
force = [{on = "pad", vector = [3, -200, 0]}, {on = "caliper", vector = [0, -40, 0]}]
friction = {coefficient = 0.6, static_coefficient = 0.8, decay_speed = 2}
modes = {band = 5000}

[[contact]]
rotor = "disc"
stator = "pad"
normal = [0, 1, 0]
tangents = [[1, 0, 0]]
velocity = [1.5, 0, 0]
compliance = 2e-9
"""


def test_a_mode_keeps_its_number_where_shapes_alone_do_not_tell(converged, tmp_path):
    """The pairs' compliance shows a mode at 4351 Hz as it shows one at 624 Hz, which alone is ever unstable."""
    scene = tmp_path / "scene.toml"
    scene.write_text(POINTS)
    numbers = ["{key='friction.coefficient', deviation=0.08}",
               "{key='contact.0.compliance', distribution='uniform', from=1e-9, to=8e-9}",
               "{key='contact.0.velocity.0', distribution='uniform', from=0.5, to=3}",
               "{key='spring.2.stiffness', distribution='lognormal', deviation=1e6}"]
    run = converged(scene, *random(*numbers, samples=1000), ranks=1)
    modes = run.report["robustness"]["modes"]
    assert sum(mode["unstable_samples"] for mode in modes) > 100
    for mode in modes:
        assert abs(mode["median_frequency_hz"] / mode["frequency_hz_50"] - 1) < 0.1


def test_files_hold_the_same(friction):
    rows = rows_of(friction)
    assert sum(int(row["unstable_modes"]) > 0 for row in rows) == friction.report["robustness"]["any"]["unstable_samples"]


def test_samples_of_the_pin_are_single_runs(converged):
    """Friction, moduli, a density, a load, a rate and damping at once: the most unstable sample and the most stable one."""
    numbers = [FRICTION.replace("0.3", "0.5"), "{key='part.pin.young', distribution='lognormal', deviation=2.5e8}",
               "{key='part.disc.density', deviation=200}", "{key='damping.beta', deviation=1e-8}",
               "{key='contact.0.rotation.rate', deviation=1}"]
    run = converged(*PIN, *random(*numbers, samples=30), ranks=1)
    rows = sorted(rows_of(run), key=lambda row: float(row["growth_rate"]) / float(row["frequency_hz"]))
    assert int(rows[-1]["unstable_modes"]) > 0
    for row in (rows[0], rows[-1]):
        rate = row["contact.0.rotation.rate"]
        single = converged(*PIN, *[word for key, value in row.items() if "." in key and "rotation" not in key
                                   for word in ("--set", f"{key}={value}")],
                           "--set", f"contact.0.rotation={{axis='z', rate={rate}}}", ranks=1).report["modes"]
        assert single["unstable_count"] == int(row["unstable_modes"])
        worst = max(single["modes"], key=lambda mode: mode["growth_rate"] / mode["frequency_hz"])
        assert abs(worst["growth_rate"] - float(row["growth_rate"])) < 1e-6 * 2 * np.pi * worst["frequency_hz"]


def test_ranks_and_seeds(friction, squeal):
    two = squeal(*OSCILLATOR, *random(FRICTION, samples=400), ranks=2)
    assert two.code == 0
    first, second = rows_of(friction), rows_of(two)
    # each sample starts from the closed pairs of another one: only rounding differs
    assert np.allclose([float(row["growth_rate"]) for row in first], [float(row["growth_rate"]) for row in second],
                       rtol=1e-9, atol=1e-9)
    assert two.report["robustness"]["any"] == friction.report["robustness"]["any"]
    other = squeal(*OSCILLATOR, *random(FRICTION, samples=400, seed=2), ranks=1)
    assert rows_of(other)[0] != first[0]


def test_distributions_have_their_moments(converged):
    """Means to four standard errors, deviations to a tenth: 2000 samples, and the cut-off takes 0.1 % of the deviation. A key may have
    quotation marks, and stands in the table as it was given."""
    run = converged(*OSCILLATOR, *random("{key='friction.coefficient', deviation=0.03}",
                                         "{key='point.\"pad\".mass', distribution='lognormal', deviation=0.3}",
                                         samples=2000), ranks=1)
    rows = rows_of(run)
    for key, mean, deviation in (("friction.coefficient", 0.3, 0.03), ('point."pad".mass', 1.0, 0.3)):
        values = np.array([float(row[key]) for row in rows])
        assert abs(values.mean() - mean) < 4 * deviation / np.sqrt(2000), key
        assert abs(values.std() / deviation - 1) < 0.1, key
    assert min(float(row['point."pad".mass']) for row in rows) > 0


@pytest.mark.parametrize("ask, message", [
    (["--set", "robustness.samples=10"], "has no random number"),
    (["--set", "uncertain=[{key='friction.coefficient', deviation=0.1}]"], "is part of [robustness]"),
    (random("{key='friction.coefficent', deviation=0.1}", samples=10), "is not in the scene"),
    (random("{key='friction.coefficient'}", samples=10), "needs a deviation"),
    (random("{key='friction.coefficient', distribution='uniform'}", samples=10), "give from"),
    (random("{key='friction.coefficient', deviation=0.2}", samples=10), "4 deviations from its middle; a smaller deviation"),
    (random("{key='friction.coefficient', deviation=0.1, from=0.1}", samples=10), "not from and to"),
    (random(FRICTION, FRICTION, samples=10), "twice"),
    (random(FRICTION, samples=10, confidence=1), "between 0 and 1"),
])
def test_bad_input(ask, message, squeal):
    run = squeal(*OSCILLATOR, *ask, ranks=1)
    assert run.code == 1 and message in run.errors, run.errors


def test_numbers_that_move_the_contact(converged):
    """The direction of sliding turns, and the rows of contact with it."""
    run = converged(*PIN, "--set", "friction.coefficient=0.4",
                    *random("{key='contact.0.rotation.centre.0', distribution='uniform', from=-0.03, to=0.03}", samples=6), ranks=1)
    row = rows_of(run)[-1]
    single = converged(*PIN, "--set", "friction.coefficient=0.4", "--set",
                       f"contact.0.rotation={{axis='z', rate=20, centre=[{row['contact.0.rotation.centre.0']},0,0]}}", ranks=1)
    worst = max(single.report["modes"]["modes"], key=lambda mode: mode["growth_rate"] / mode["frequency_hz"])
    assert abs(worst["growth_rate"] - float(row["growth_rate"])) < 1e-6 * 2 * np.pi * worst["frequency_hz"]


@pytest.mark.parametrize("ranks", [1, 2])
def test_the_first_sample_that_fails_says_why(ranks, squeal):
    """Turned round, friction presses the pad on: beyond D_nn/D_nt = 2.87/0.185 = 15.5 there is no equilibrium."""
    run = squeal(*OSCILLATOR, "--set", "contact.0.velocity=[-0.6,0,0]",
                 *random("{key='friction.coefficient', distribution='uniform', from=0.1, to=20}", samples=40), ranks=ranks)
    failed = [number for number, row in enumerate(rows_of(run)) if row["known"] == "0"]
    assert failed == [number for number, row in enumerate(rows_of(run)) if float(row["friction.coefficient"]) > 15.5]
    words = f"{len(failed)} of 41 points failed, the first at friction.coefficient = "
    reason = run.report["robustness"]["reason"]
    assert run.code == 2 and reason.startswith(words) and "no set of closed pairs balances the load at mu = " in reason


def test_picture(friction, tmp_path):
    subprocess.run([sys.executable, ROOT / "tools" / "plot", friction.output, "--only", "robustness", "--output", tmp_path],
                   check=True)
    assert (tmp_path / "robustness.png").stat().st_size > 10000
