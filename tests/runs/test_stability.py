"""What a user meets where a method would fail: a refusal, a warning with the remedy, or a remedy that is named."""

from conftest import INPUTS

OSCILLATOR = INPUTS / "oscillator" / "scene.toml"
WEAK = ["--set", "friction.coefficient=0.1785"]  # grows at .07 % of its angular frequency


def test_a_step_that_hides_the_instability_is_refused_for_transient_and_cycle(squeal):
    run = squeal(OSCILLATOR, *WEAK, "--set", "transient.theta=0.51", "--set", "cycle.theta=0.51", "--set",
                 "transient.steps_per_period=50", "--set", "cycle.steps_per_period=50", ranks=1)
    assert run.code == 2
    for stage in ("transient", "cycle"):
        assert run.report[stage]["outcome"] == "refused"
        assert "would look stable" in run.report[stage]["reason"] and "or theta = 1/2" in run.report[stage]["reason"]
    assert run.printed.count("REFUSED") == 2


def test_enough_steps_are_not_refused_and_the_refusal_can_be_lifted(squeal):
    short = [OSCILLATOR, *WEAK, "--set", "cycle.enabled=false", "--set", "transient.theta=0.51", "--set",
             "transient.amplitude=0.05", "--set", "transient.periods=3"]
    fine = squeal(*short, "--set", "transient.steps_per_period=100", ranks=1)
    assert fine.code == 0 and 0 < fine.report["transient"]["growth_rate_fit"]
    coarse = squeal(*short, "--set", "transient.steps_per_period=50", "-transient_refuse", "false", ranks=1)
    assert coarse.code == 0 and coarse.report["transient"]["growth_rate_fit"] < 0


def test_fixed_points_beyond_their_bound_are_refused(squeal):
    run = squeal(OSCILLATOR, "--set", "cycle.enabled=false", "-transient_contact_rho", "2", ranks=1)
    assert run.code == 1 and "-transient_contact_rho" in run.messages[0] and "below 2" in run.messages[0]
    run = squeal(OSCILLATOR, "--set", "cycle.enabled=false", "-equilibrium_check_rho", "2.5", ranks=2)
    assert run.code == 1 and len(run.messages) == 1 and "-equilibrium_check_rho" in run.messages[0]


def test_much_friction_warns_that_the_equilibrium_may_not_be_the_only_one(squeal):
    pin = [INPUTS / "pin_on_disc" / "scene.toml", "--set", "mesh.parameters.divisions=2", "--set",
           "cycle.enabled=false", "--set", "modes.band=3000", "--set", "modes.method=full"]
    for friction, uniqueness in ((0.3, "assured"), (5, "not assured")):
        run = squeal(*pin, "--set", f"friction.coefficient={friction}")
        assert run.code == 0 and run.report["equilibrium"]["uniqueness"] == uniqueness
        assert ("other equilibria may exist" in run.printed) == (uniqueness == "not assured")


def oscillator_cycle(squeal, friction, speed):
    return squeal(OSCILLATOR, "--set", f"friction.coefficient={friction}", "--set", f"contact.0.velocity=[{speed},0,0]",
                  "--set", "transient.enabled=false", "--set", "cycle.steps_per_period=100", "--set",
                  "cycle.tolerance=1e-6", ranks=1)


def test_the_estimate_is_below_a_cycle_that_sticks_and_far_above_one_that_only_reversal_would_hold(squeal):
    """Amplitudes from mean energies: a quarter of the cycle's energy, ten times it, 90 000 times it. 5 %: 100 steps."""
    for friction, speed, ratio, words in ((0.3, 0.6, 0.502, "pairs will stick"), (0.2, 10, 3.14, "times first lift-off"),
                                          (0.25, 1000, 298, "times first lift-off")):
        run = oscillator_cycle(squeal, friction, speed)
        assert run.code == 0 and run.report["cycle"]["outcome"] == "converged"  # even from 298 times too far
        found = (run.report["estimate"]["mean_energy"] / run.report["cycle"]["mean_fluctuating_energy"]) ** 0.5
        assert abs(found / ratio - 1) < 0.05
        assert words in run.printed


def test_without_a_balance_no_amplitude_is_claimed_and_the_start_is_named(squeal):
    run = oscillator_cycle(squeal, 0.3, 1e5)
    estimate = run.report["estimate"]
    assert run.code == 0 and estimate["outcome"] == "no balance" and estimate["amplitude"] is None
    assert "-cycle_lift_off_multiple" in run.printed
    fast = oscillator_cycle(squeal, 0.3, 1000).report  # a balance, but the cycle never notices so fast a belt either
    assert fast["estimate"]["outcome"] == "balance"
    assert abs(run.report["cycle"]["period"] / fast["cycle"]["period"] - 1) < 1e-4
