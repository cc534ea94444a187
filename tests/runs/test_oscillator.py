"""Limit cycles of the unilateral mode-coupling oscillator against their exact values.

The exact values come from matrix exponentials between contact events. At 400 steps a period the theta-method's period
error is (omega h)^2/12 = 2e-5 between events and first order in h through them: 1e-4 on T, 1 % on the energy.
"""

import pytest
from conftest import INPUTS

EXACT = {0.3: (5.938028240916, 0.77336848489), 0.6: (5.954461004653, 1.77650678461),
         1.0: (5.984555109780, 2.44704680486), 2.0: (5.993768001880, 4.62721318386)}  # belt speed: period, mean energy


@pytest.mark.parametrize("speed", EXACT)
@pytest.mark.parametrize("form", ["points", "matrices"])
def test_period_and_energy(converged, oscillator_scene, speed, form):
    ranks = 2 if form == "points" and speed == 2 else 1  # three unknowns gain nothing by a second rank
    run = converged(*oscillator_scene(form, speed), "--set", "transient.enabled=false", ranks=ranks)
    cycle = run.report["cycle"]
    period, energy = EXACT[speed]
    assert cycle["outcome"] == "converged"
    assert cycle["residual_full"] < 1e-8
    assert cycle["period"] == pytest.approx(period, rel=1e-4)
    assert cycle["mean_energy"] == pytest.approx(energy, rel=1e-2)


def test_sliding_eigenvalue_and_growth(converged, oscillator_scene):
    run = converged(*oscillator_scene("points", 0.6), "--set", "cycle.enabled=false", ranks=1)
    mode = run.report["modes"]["modes"][0]
    assert mode["growth_rate"] == pytest.approx(0.024503265987, rel=1e-9)
    assert mode["frequency_hz"] * 2 * 3.14159265358979 == pytest.approx(1.059820289428, rel=1e-9)
    assert mode["backward_error"] < 1e-12
    transient = run.report["transient"]
    assert transient["growth_rate_fit"] == pytest.approx(transient["growth_rate_predicted"], rel=1e-3)
    assert transient["energy_defect_max"] < 1e-10


def test_doubling_force_and_speed_doubles_the_cycle(converged, oscillator_scene):
    """If (u, v, r, T) is a cycle for (F, v_d), (2u, 2v, 2r, T) is one for (2F, 2v_d): to the shooting's own tolerance."""
    once = converged(*oscillator_scene("points", 1.0), "--set", "transient.enabled=false", ranks=1).report["cycle"]
    twice = converged(*oscillator_scene("points", 2.0), "--set", "force.0.vector=[0,-2,0]", "--set",
                      "transient.enabled=false", ranks=1).report["cycle"]
    assert twice["period"] == pytest.approx(once["period"], rel=1e-7)
    assert twice["mean_energy"] == pytest.approx(4 * once["mean_energy"], rel=1e-6)
