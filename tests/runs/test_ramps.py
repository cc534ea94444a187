"""Applications of the brake: load, speed and friction that change in time, from standstill to stop."""

import numpy as np
import pytest
from conftest import INPUTS
from test_ladder_motion import history_of

OSCILLATOR = INPUTS / "oscillator" / "scene.toml"
# The sliding equilibrium is unstable from mu = 0.176 on. Friction rises through that value and falls below it again.
APPLICATION = {"start": '"rest"', "steps": 9000, "step_size": 0.1, "load_factor": [[0, 0], [60, 1]],
               "speed_factor": [[0, 0], [50, 1], [800, 1], [860, 0]],
               "friction_factor": [[100, 0.3], [200, 1], [400, 1], [500, 0.2]]}


def arguments(**changed):
    table = {**APPLICATION, **changed}
    words = [OSCILLATOR, "--set", "cycle.enabled=false"]
    for key, value in table.items():
        words += ["--set", f"transient.{key}={value}"]
    return words


def test_squeal_comes_and_goes_and_the_energies_of_the_application_balance(converged):
    run = converged(*arguments(), ranks=1)
    data = history_of(run)
    h = APPLICATION["step_size"]
    time = data["time"]
    put_in = h * np.cumsum(data["load_power"] + data["contact_power"] - data["damping_power"])
    assert np.abs(put_in - data["energy"]).max() < 1e-10 * np.abs(h * np.cumsum(data["drive_power"])).max()
    heat = data["drive_power"] - data["contact_power"]
    assert heat.min() > -1e-9 * heat.max()  # contact tolerance
    assert h * heat.sum() > 10 * data["energy"].max()  # most of what the drive gives becomes heat

    def swing(first, last):
        window = (time > first) & (time < last)
        return np.ptp(data["pad_x"][window])

    # growth at 0.0245 1/s over 200 s, then decay at 0.01 1/s: the equilibrium itself hardly moves in these windows
    assert swing(380, 400) > 20 * swing(80, 100)
    assert swing(380, 400) > 10 * swing(780, 800)
    stopped = time > 890
    assert data["stick"][stopped].min() == 1
    assert np.isnan(run.report["transient"]["growth_rate_fit"] or np.nan)  # no mode belongs to the ramps


def test_ranks_and_given_factors_of_one_agree(converged):
    short = {"steps": 1500}
    ends = [history_of(converged(*arguments(**short), ranks=ranks)) for ranks in (1, 2)]
    for name in ("pad_x", "energy", "drive_power"):
        np.testing.assert_allclose(ends[1][name], ends[0][name], rtol=0, atol=1e-9 * np.abs(ends[0][name]).max())
    plain = [OSCILLATOR, "--set", "cycle.enabled=false"]
    ones = [word for key in ("load", "speed", "friction") for word in ("--set", f"transient.{key}_factor=[[0, 1]]")]
    one, other = (history_of(converged(*plain, *more, ranks=1)) for more in ([], ones))
    np.testing.assert_array_equal(other["pad_x"], one["pad_x"])


def test_an_equilibrium_stays_until_a_factor_leads_away_from_it(converged):
    still = {"start": '"equilibrium"', "steps": 50, "load_factor": [[0, 1]], "speed_factor": [[0, 1]]}
    for ranks in (1, 2):
        stays = history_of(converged(*arguments(**still, friction_factor=[[0, 1]]), ranks=ranks))
        moves = history_of(converged(*arguments(**still, friction_factor=[[2, 1], [3, 0.5]]), ranks=ranks))
        stretch = np.abs(stays["pad_x"]).max()
        # the equilibrium is solved to 1e-10 of its forces, and grows by a hundredth in these 5 s
        assert np.ptp(stays["pad_x"]) < 1e-9 * stretch and stays["stick"].max() == 0
        assert np.ptp(moves["pad_x"][moves["time"] < 1.95]) < 1e-9 * stretch < 1e-3 * np.ptp(moves["pad_x"])


@pytest.mark.parametrize("load, friction", [([[0, 1], [1, 2]], [[0, 1], [1, 2]]), ([[0, 0.105], [1, 3.9]], [[0, 3.9], [1, 0.105]])])
def test_the_refusal_of_steep_friction_knows_the_ramps(squeal, load, friction):
    """mu r_n reaches four times the scene's own: in the end, or between two times at which it has 0.41 of it."""
    fall = ["--set", "friction.static_coefficient=0.4", "--set", "friction.decay_speed=0.02"]
    words = arguments(start='"mode"', steps=10, step_size=0.2, load_factor=load, friction_factor=friction)
    run = squeal(*words, *fall, ranks=1)
    alone = squeal(*arguments(start='"mode"', steps=10, step_size=0.2, load_factor=[[0, 1]], friction_factor=[[0, 1]]), *fall, ranks=1)
    assert run.report["transient"]["outcome"] == "refused" and "several solutions" in run.report["transient"]["reason"]
    assert alone.report["transient"]["outcome"] != "refused"


BAD = {
    "no rows": ({"load_factor": "1"}, ["transient.load_factor=1", "load_factor", "rows [time in s or speed in m/s, factor]"]),
    "a row of three": ({"load_factor": "[[0, 1, 2]]"}, ["load_factor", "rows [time in s or speed in m/s, factor]"]),
    "times that fall": ({"speed_factor": "[[1, 0], [0.5, 1]]"}, ["speed_factor", "a first number above that of the row before"]),
    "negative friction": ({"friction_factor": "[[0, -1]]"}, ["friction_factor", "zero or above"]),
    "rest under load": ({"load_factor": "[[0, 1]]"}, ["transient.load_factor=[[0, 1]]", 'start = "rest"', "rise from 0"]),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_factors_are_refused(squeal, case):
    changed, words = BAD[case]
    run = squeal(*arguments(**changed), ranks=1)
    assert run.code == 1
    for word in words:
        assert word in run.messages[0], run.messages[0]
