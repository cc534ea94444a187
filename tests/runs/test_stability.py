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
    assert {row.split()[0] for row in run.printed.splitlines() if "REFUSED" in row} == {"transient", "cycle"}


def test_enough_steps_are_not_refused_and_the_refusal_can_be_lifted(squeal):
    short = [OSCILLATOR, *WEAK, "--set", "cycle.enabled=false", "--set", "transient.theta=0.51", "--set",
             "transient.amplitude=0.05", "--set", "transient.periods=3"]
    fine = squeal(*short, "--set", "transient.steps_per_period=100", ranks=1)
    assert fine.code == 0 and 0 < fine.report["transient"]["growth_rate_fit"]
    coarse = squeal(*short, "--set", "transient.steps_per_period=50", "-transient_refuse", "false", ranks=1)
    assert coarse.code == 0 and coarse.report["transient"]["growth_rate_fit"] < 0


def test_a_fixed_point_beyond_its_bound_is_refused(squeal):
    run = squeal(OSCILLATOR, "--set", "cycle.enabled=false", "-transient_contact_rho", "2", ranks=1)
    assert run.code == 1 and "-transient_contact_rho" in run.messages[0] and "below 2" in run.messages[0]


def test_much_friction_warns_that_the_equilibrium_may_not_be_the_only_one(squeal):
    pin = [INPUTS / "pin_on_disc" / "scene.toml", "--set", "mesh.parameters.divisions=2", "--set",
           "cycle.enabled=false", "--set", "modes.band=3000", "--set", "modes.method=full"]
    for friction, uniqueness in ((0.3, "assured"), (5, "not assured")):
        run = squeal(*pin, "--set", f"friction.coefficient={friction}")
        assert run.code == 0 and run.report["equilibrium"]["uniqueness"] == uniqueness
        assert ("other equilibria may exist" in run.printed) == (uniqueness == "not assured")


def oscillator_cycle(squeal, friction, speed, *more):
    return squeal(OSCILLATOR, "--set", f"friction.coefficient={friction}", "--set", f"contact.0.velocity=[{speed},0,0]",
                  "--set", "transient.enabled=false", "--set", "cycle.steps_per_period=100", "--set",
                  "cycle.tolerance=1e-6", *more, ranks=1)


def words_on_the_estimate(squeal, friction, speed):
    """What is printed where no cycle settles it."""
    return oscillator_cycle(squeal, friction, speed, "--set", "cycle.enabled=false").printed


def test_the_estimate_is_below_a_cycle_that_sticks_and_far_above_one_that_only_reversal_would_hold(squeal):
    """Amplitudes from mean energies: a quarter of the cycle's energy, ten times it, 90 000 times it. 5 %: 100 steps."""
    for friction, speed, ratio, words in ((0.3, 0.6, 0.502, "pairs will stick"), (0.2, 10, 3.14, "times first lift-off"),
                                          (0.25, 1000, 298, "times first lift-off")):
        run = oscillator_cycle(squeal, friction, speed)
        assert run.code == 0 and run.report["cycle"]["outcome"] == "converged"  # even from 298 times too far
        found = (run.report["estimate"]["mean_energy"] / run.report["cycle"]["mean_fluctuating_energy"]) ** 0.5
        assert abs(found / ratio - 1) < 0.05
        assert words in words_on_the_estimate(squeal, friction, speed) and words not in run.printed


def test_without_a_balance_no_amplitude_is_claimed_and_the_start_is_named(squeal):
    run = oscillator_cycle(squeal, 0.3, 1e5)
    estimate = run.report["estimate"]
    assert run.code == 0 and estimate["outcome"] == "no balance" and estimate["amplitude"] is None
    assert "first lift-off times 2" in words_on_the_estimate(squeal, 0.3, 1e5)
    fast = oscillator_cycle(squeal, 0.3, 1000).report  # a balance, but the cycle never notices so fast a belt either
    assert fast["estimate"]["outcome"] == "balance"
    assert abs(run.report["cycle"]["period"] / fast["cycle"]["period"] - 1) < 1e-4


def oscillator_in_units(mass, length, time, load):
    """Arguments that give the oscillator in other units, or under a load and a belt `load` times as large."""
    stiffness, damping = mass / time**2, mass / time
    values = {"point.0.mass": mass, "point.1.mass": 0.5 * mass, "spring.0.damping": 0.02 * damping,
              "spring.1.damping": 0.02 * damping, "spring.3.damping": 0.02 * damping,
              "force.0.vector": f"[0,{-mass * length / time**2 * load},0]",
              "contact.0.velocity": f"[{0.6 * length / time * load},0,0]", "transient.amplitude": 0.01 * length * load,
              "modes.band": 1 / time, "cycle.steps_per_period": 100}
    values |= {f"spring.{i}.stiffness": k * stiffness for i, k in enumerate((1.0, 0.4, 0.2, 1.2))}
    return [OSCILLATOR, *(word for key, value in values.items() for word in ("--set", f"{key}={value}"))]


def test_the_oscillator_is_the_same_in_any_unit_and_under_any_load(squeal):
    """To rounding; the cycle to its tolerance of 1e-8. Under a times the load and the belt, a times the cycle."""
    def answers(mass, length, time, load):
        report = squeal(*oscillator_in_units(mass, length, time, load), ranks=1).report
        force, energy = mass * length / time**2 * load, mass * (length / time * load) ** 2
        return [(report["equilibrium"]["normal_force_sum"] / force, 1e-12),
                (report["modes"]["modes"][0]["growth_rate"] * time, 1e-10),
                (report["estimate"]["amplitude"] / length / load, 1e-10),
                (report["transient"]["growth_rate_fit"] * time, 1e-9),
                (report["cycle"]["period"] / time, 1e-8), (report["cycle"]["mean_energy"] / energy, 1e-7)]

    once = answers(1, 1, 1, 1)
    for scales in ((1e-3, 1e3, 1, 1), (1, 1, 1, 1e-6), (1, 1, 1, 1e6), (1e-9, 1e-3, 1e-4, 1e-12)):
        for (value, _), (other, tolerance) in zip(once, answers(*scales)):
            assert abs(other / value - 1) < tolerance, scales


def test_the_pin_is_the_same_in_millimetres_and_under_a_millionth_of_the_load(converged):
    """mm, t, s on 2 ranks against SI: equilibrium, modes, estimate, transient, cycle."""
    common = [INPUTS / "pin_on_disc" / "scene.toml", "--set", "mesh.parameters.divisions=2", "--set",
              "damping.beta=6e-7", "--set", "transient.enabled=true", "--set", "transient.start=mode", "--set",
              "transient.periods=3", "--set", "cycle.steps_per_period=40", "--set", "cycle.tolerance=1e-7",
              "-cycle_multipliers", "0"]
    small = {"mesh.scale": 1000, "part.disc.young": 210e3, "part.pin.young": 5e3, "part.disc.density": 7.85e-9,
             "part.pin.density": 5e-9, "rigid_body.holder.mass": 0.5e-3, "rigid_body.holder.at": "[90.0,0.0,25.0]",
             "spring.0.stiffness": 1e3, "probe.pin.at": "[90.0,0.0,0.0]", "force.0.vector": "[0,0,-1e-4]",
             "contact.0.rotation": '{axis="z",rate=2e-5}'}
    one = converged(*common).report
    two = converged(*common, *(word for key, value in small.items() for word in ("--set", f"{key}={value}"))).report
    for stage, key, factor, tolerance in (
            ("equilibrium", "normal_force_max", 1e-6, 1e-9), ("estimate", "amplitude", 1e-3, 1e-8),
            ("transient", "growth_rate_fit", 1, 1e-8), ("cycle", "period", 1, 1e-7), ("cycle", "mean_energy", 1e-9, 1e-7)):
        assert abs(two[stage][key] / one[stage][key] / factor - 1) < tolerance, (stage, key)
    for a, b in zip(one["modes"]["modes"][:5], two["modes"]["modes"][:5]):
        assert abs(b["frequency_hz"] / a["frequency_hz"] - 1) < 1e-9
        assert abs(b["growth_rate"] / a["growth_rate"] - 1) < 1e-8


def test_springs_of_any_softness_are_carried_by_contact_and_too_stiff_ones_are_warned_of(squeal):
    """Between a soft spring and none the reactions lost digits; now springs across the pairs take over, and say so."""
    def pin(stiffness):
        return squeal(INPUTS / "pin_on_disc" / "scene.toml", "--set", "mesh.parameters.divisions=2", "--set",
                      "cycle.enabled=false", "--set", "modes.band=8000", "--set", "modes.method=full", "--set",
                      f"spring.0.stiffness={stiffness}", ranks=1)

    for stiffness, helped in ((1e-30, True), (1e-4, True), (1e6, False)):
        run = pin(stiffness)
        equilibrium = run.report["equilibrium"]
        assert run.code == 0 and equilibrium["residual"] < 1e-12
        assert (equilibrium["auxiliary_stiffness"] > 0) == helped == ("auxiliary stiffness" in run.printed)
    for stiffness, warned in ((1e12, False), (1e18, True)):  # 1e12 is rigid already: a thousand times the pin
        assert ("are lost in rounding" in pin(stiffness).printed) == warned


def test_every_stage_says_what_its_numbers_are_worth(squeal):
    """The step's own error is the discrete theory's: -(omega h)^2/4 of the growth rate, -(omega h)^2/12 of the frequency."""
    run = squeal(OSCILLATOR, "--set", "transient.steps_per_period=50", "--set", "cycle.steps_per_period=200", ranks=1)
    report = run.report
    for stage, keys in {"equilibrium": ["residual", "force_residual", "uniqueness"],
                        "modes": ["residual", "count_check"], "estimate": ["residual"],
                        "transient": ["growth_rate_bias", "frequency_bias", "energy_defect_max", "residual"],
                        "cycle": ["residual_full", "growth_rate_bias", "frequency_bias"]}.items():
        assert not [key for key in keys if report[stage].get(key) is None], stage
    square = (2 * 3.14159265 / 50) ** 2
    assert abs(report["transient"]["growth_rate_bias"] / (-square / 4) - 1) < 0.02
    assert abs(report["transient"]["frequency_bias"] / (-square / 12) - 1) < 0.02
    assert "warnings" not in report["transient"] and "warnings" not in report["modes"]

    biased = squeal(OSCILLATOR, "--set", "cycle.enabled=false", "--set", "transient.theta=0.7", ranks=1)
    assert "change the growth rate by" in biased.printed and biased.report["transient"]["warnings"]
    edge = squeal(OSCILLATOR, "--set", "cycle.enabled=false", "--set", "friction.coefficient=0.17651", ranks=1)
    assert "within 0.01 % of the threshold" in edge.printed


def test_a_normal_force_that_chatters_is_warned_of(squeal):
    """Nine pairs take 19 kHz with impacts of their nodes' mass, 25 pairs do not; .25 against .0095 of the mean."""
    for divisions, chatters in ((2, True), (4, False)):
        run = squeal(INPUTS / "pin_on_disc" / "scene.toml", "--set", f"mesh.parameters.divisions={divisions}", "--set",
                     "cycle.enabled=false", "--set", "modes.method=full", "--set", "transient.enabled=true", "--set",
                     "transient.periods=4", "--set", "transient.steps_per_period=30", ranks=1)
        assert run.code == 0
        assert (run.report["transient"]["normal_force_chatter"] > 0.1) == chatters
        assert ("the normal force jumps" in run.printed) == chatters


def test_residual_passes_and_slepc_find_the_same_modes(squeal):
    """The pin at mu = 0.3 has two unstable modes below 20 kHz; 1657 degrees of freedom. Growth to 1e-6."""
    full, toar = (squeal(INPUTS / "pin_on_disc" / "scene.toml", "--set", "mesh.parameters.divisions=3", "--set",
                         "modes.band=20000", "--set", "estimate.enabled=false", "--set", "cycle.enabled=false", "--set",
                         f"modes.method={method}", ranks=1).report["modes"] for method in ("full", "toar"))
    for modes in (full, toar):
        assert modes["outcome"] == "converged" and modes["unstable_count"] == 2
        assert modes["count_check"].startswith("confirmed")
    assert len(full["modes"]) == len(toar["modes"])
    for one, other in zip(full["modes"][:2], toar["modes"][:2]):
        assert abs(one["growth_rate"] / other["growth_rate"] - 1) < 1e-6
        assert abs(one["frequency_hz"] / other["frequency_hz"] - 1) < 1e-9
