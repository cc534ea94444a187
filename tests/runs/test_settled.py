"""The way to the cycle from any start, and what a motion settles on where no cycle attracts."""

import math

import h5py
import numpy as np
import pytest
from conftest import INPUTS
from models import sticking_slider, write_coexistence, write_matrices, write_scene

OSCILLATOR = [INPUTS / "oscillator" / "scene.toml", "--set", "transient.enabled=false"]
PERIOD, ENERGY = 5.954461004653, 1.77650678461  # exact, at V = 0.6


# each scene with few steps and with many
@pytest.mark.parametrize("mu, speed, steps", [(0.3, 0.3, 50), (0.3, 0.3, 400), (0.3, 0.6, 100), (0.3, 0.6, 1600), (0.3, 1, 200), (0.3, 2, 50),
                                              (0.3, 2, 800), (0.25, 10, 50), (0.25, 10, 400), (0.9, 1, 100), (0.9, 1, 800)])
def test_every_oscillator_reaches_its_cycle_from_the_default_start(converged, steps, mu, speed):
    cycle = converged(*OSCILLATOR, "--set", f"cycle.steps_per_period={steps}", "--set", f"friction.coefficient={mu}", "--set",
                      f"contact.0.velocity=[{float(speed)},0,0]", ranks=1).report["cycle"]
    assert cycle["outcome"] == "converged" and cycle["multipliers"]["stability"] == "stable"
    assert cycle["residual_full"] <= 1e-8 and cycle["periods_integrated"] <= 60


def with_foot(folder, mass, stiffness):
    """The oscillator on a small foot of its own, which impacts: a spring and a dashpot in either direction below the pad."""
    text = (INPUTS / "oscillator" / "scene.toml").read_text()
    foot = f"""[[point]]
name = "foot"
at = [0, 0, 0]
mass = {mass}
free = "x y"
"""
    for direction, factor in (("y", 1), ("x", 2)):
        foot += f"""
[[spring]]
from = "pad"
to = "foot"
direction = "{direction}"
stiffness = {factor * stiffness}
damping = 0.02
"""
    text = text.replace("[[spring]]", foot + "\n[[spring]]", 1).replace('stator = "pad"', 'stator = "foot"')
    (folder / "scene.toml").write_text(text.replace("band = 1 ", "band = 10 "))
    return [folder / "scene.toml", "--set", "transient.enabled=false"]


@pytest.mark.parametrize("mass, steps", [(0.01, 50), (0.01, 400), (0.05, 200), (0.05, 1600)])
def test_an_impacting_foot_keeps_no_oscillator_from_its_cycle(squeal, tmp_path, mass, steps):
    run = squeal(*with_foot(tmp_path, mass, 3), "--set", f"cycle.steps_per_period={steps}", ranks=1)
    cycle = run.report["cycle"]
    assert run.code == 0 and cycle["outcome"] == "converged"
    assert cycle["residual_full"] <= 1e-8 and cycle["periods_integrated"] <= 60


def drum_brake(folder, stiffness):
    """A shoe on three massless feet against a drum; a spring across each foot, so that the friction of one loads others."""
    points, springs, forces, contacts = [{"name": "shoe", "at": [0, 0, 0], "mass": 1.0, "free": "x y"}], [], [], []
    for axis in ("x", "y"):
        springs.append({"from": "shoe", "direction": axis, "stiffness": 1.0, "damping": 0.02})
    for i, angle in enumerate(np.radians([0, 120, 240])):
        normal, tangent = [np.cos(angle), np.sin(angle), 0], [-np.sin(angle), np.cos(angle), 0]
        points += [{"name": f"foot{i}", "at": [0, 0, 0], "free": "x y"}, {"name": f"drum{i}", "at": [0, 0, 0], "free": "none"}]
        springs += [{"from": "shoe", "to": f"foot{i}", "direction": direction, "stiffness": k, "damping": 0.02}
                    for direction, k in ((normal, stiffness), (tangent, 2 * stiffness))]
        forces.append({"on": f"foot{i}", "vector": normal})
        contacts.append({"rotor": f"drum{i}", "stator": f"foot{i}", "normal": [-x for x in normal], "tangents": [tangent],
                         "velocity": tangent})
    return write_scene(folder, title="drum", point=points, spring=springs, force=forces, contact=contacts,
                       friction={"coefficient": 0.3}, modes={"band": 3.0}, cycle={"steps_per_period": 800, "tolerance": 1e-6})


@pytest.mark.parametrize("stiffness, ratio, ranks", [(0.3, 0.026, 1), (3.0, 0.110, 1), (1.0, 0.073, 2)])
def test_massless_feet_and_strong_growth_lead_to_a_cycle(converged, tmp_path, stiffness, ratio, ranks):
    """8 degrees of freedom, six of them without mass; the equilibrium grows by up to 11 % of the frequency a radian."""
    report = converged(drum_brake(tmp_path, stiffness), ranks=ranks).report
    mode, cycle = report["modes"]["modes"][0], report["cycle"]
    assert mode["growth_rate"] / (2 * np.pi * mode["frequency_hz"]) == pytest.approx(ratio, rel=0.02)
    assert cycle["outcome"] == "converged" and cycle["periods_integrated"] <= 60


@pytest.mark.parametrize("stiffness", [0.3, 3.0])
def test_velocities_without_mass_have_no_multipliers(converged, tmp_path, stiffness):
    """At theta = 1/2 the step keeps them with factors of 1 in modulus, at 0.55 it damps them away. What the structure itself
    has agrees within the bars and 0.01, as that theta also damps 0.05 (omega h)^2/h of the motion."""
    scene = drum_brake(tmp_path, stiffness)
    multipliers = [converged(scene, "--set", f"cycle.theta={theta}", ranks=1).report["cycle"]["multipliers"]
                   for theta in (0.5, 0.55)]
    largest = [math.hypot(one["values"][0]["real"], one["values"][0]["imaginary"]) for one in multipliers]
    assert [one["stability"] for one in multipliers] == ["stable", "stable"] and max(largest) < 0.6
    assert abs(largest[0] - largest[1]) < sum(one["values"][0]["error"] for one in multipliers) + 0.01


def test_the_cycle_starts_from_a_mode_a_transient_or_a_file(converged, squeal, tmp_path):
    base = [INPUTS / "oscillator" / "scene.toml", "--set", "cycle.steps_per_period=100", "--set", "cycle.tolerance=1e-8"]
    state = tmp_path / "end.state"
    after = converged(*base, "--set", "transient.start=estimate", "--set", "transient.periods=40", "--set",
                      "transient.steps_per_period=100", "--set", f"transient.save_state={state}", "--set",
                      "cycle.start=transient", "--set", "cycle.free_periods=0", ranks=1).report["cycle"]
    filed = converged(*base, "--set", "transient.enabled=false", "--set", f"cycle.start={state}", "--set",
                      "cycle.free_periods=0", ranks=1).report["cycle"]
    small = converged(*base, "--set", "transient.enabled=false", "--set", "cycle.start=mode", "--set",
                      "cycle.amplitude=0.2", ranks=1).report["cycle"]
    for cycle in (after, filed, small):
        assert cycle["period"] == pytest.approx(PERIOD, rel=1e-3) and cycle["mean_energy"] == pytest.approx(ENERGY, rel=0.01)
    # the same state, once in memory and once from the file
    assert filed["period"] == pytest.approx(after["period"], rel=1e-9)
    assert filed["newton"][0]["residual_full"] < 0.05  # 40 periods have settled

    refused = squeal(INPUTS / "pin_on_disc" / "scene.toml", "--set", "mesh.parameters.divisions=2", "--set",
                     f"cycle.start={state}", ranks=1)
    assert refused.code == 1 and len(refused.messages) == 1
    assert "end.state" in refused.messages[0] and "degrees of freedom" in refused.messages[0]
    assert "equilibrium" not in refused.printed  # found before the first stage


def test_a_skipped_transient_is_no_start(squeal):
    run = squeal(INPUTS / "oscillator" / "scene.toml", "--set", "transient.theta=0.6", "--set", "transient.steps_per_period=20",
                 "--set", "cycle.start=transient", ranks=1)
    assert run.code == 2 and run.report["transient"]["outcome"] == "refused"
    assert run.report["cycle"]["outcome"] == "skipped" and "transient" in run.report["cycle"]["reason"]


def test_where_no_cycle_of_the_pin_attracts_the_settled_motion_answers(converged):
    """At mu = 0.4 direct integration settles on no cycle: its energy wanders by factors, on this coarse mesh as on finer ones."""
    pin = [INPUTS / "pin_on_disc" / "scene.toml", "--set", "modes.method=full", "--set", "friction.coefficient=0.4", "--set",
           "fidelity=full", "--set", "mesh.parameters.divisions=2", "--set", "damping.beta=6e-7"]
    run = converged(*pin, "-cycle_free_periods", "80", "-settled_periods", "256", ranks=1)
    report = run.report
    settled = report["settled"]
    assert report["cycle"]["outcome"] == settled["outcome"] == "settled"
    assert settled["kind"] in ("irregular", "quasi-periodic", "undecided")
    if settled["kind"] == "undecided":
        assert settled["between"] and settled["would_decide"]
    assert f"\n  heard        {report['heard']}\n" in run.printed
    assert "no cycle attracts" in report["heard"]
    attempts = report["cycle"]["attempts"]
    assert [attempt["name"] for attempt in attempts] == ["cycle, full model", "settled motion"]
    # where there is no cycle to find, the search's path decides how it ends without one
    assert attempts[0]["outcome"] in ("not periodic", "not converged") and attempts[0]["reason"] and attempts[1]["outcome"] == "settled"
    assert all(attempt["name"] in run.printed for attempt in attempts)
    assert f"{settled['base_frequencies_hz']['first']:.5g}" in report["heard"]
    energy = settled["mean_fluctuating_energy"]
    assert 0 < energy["error"] < energy["mean"]
    strongest = settled["lines"][0]
    assert 0 < strongest["frequency_error"] < 0.1 * strongest["frequency_hz"]
    for part in ("open", "stick", "slip"):
        assert 0 <= settled[f"{part}_fraction"]["mean"] <= 1
    assert sum(settled[f"{part}_fraction"]["mean"] for part in ("open", "stick", "slip")) == pytest.approx(1, rel=1e-12)
    # what friction gives damping takes, over a motion that is stationary: within the bars and the energy stored
    balance = sum(settled[f"{part}_power"]["mean"] * sign for part, sign in (("contact", 1), ("load", 1), ("damping", -1)))
    bars = sum(settled[f"{part}_power"]["error"] for part in ("contact", "load", "damping"))
    assert abs(balance) <= bars
    with h5py.File(run.output / "history.h5") as file:
        group = file["settled"]
        time, pin_moves = group["time"][:], group["probes/pin"][:]
        frequency, amplitude = group["spectrum/frequency"][:], group["spectrum/amplitude"][:]
        peak = np.argmin(abs(frequency - settled["lines"][0]["frequency_hz"]))
        assert amplitude[peak] == max(amplitude[peak - 1 : peak + 2])
    assert (np.diff(time) > 0).all() and settled["periods"] == int(time[-1] / settled["period"] * (1 + 1e-9))
    # swings are within periods of the motion itself, whatever the search ended with: 1 %, as windows begin elsewhere
    base = settled["base_frequencies_hz"]
    own = max(base["closes_after"], 1) / base["first"]
    few = 16 * own > time[-1] - (settled["discarded"] % settled["periods"]) * settled["period"]
    assert few or settled["period"] == pytest.approx(own, rel=1e-9)
    ends = np.searchsorted(time, np.arange(settled["discarded"] % settled["periods"], settled["periods"] + 1) * settled["period"])
    swings = [np.ptp(pin_moves[start:end]) for start, end in zip(ends, ends[1:])]
    assert settled["peak_to_peak"]["pin"]["mean"] == pytest.approx(np.mean(swings), rel=0.01)


def test_a_given_state_is_followed_by_the_mode_that_it_is_most_of(converged, tmp_path):
    """The pin below its threshold, from its cycle above. By the period of the mode that decays slowest, 1155 Hz, four turns of
    the cycle came out as one. 500 periods of direct integration settle on 4878.6 Hz and 5.45 um."""
    pin, state = INPUTS / "pin_on_disc" / "scene.toml", tmp_path / "cycle.state"
    no_verdict = ["-cycle_multipliers", "0"]
    converged(pin, *no_verdict, "--set", f"cycle.save_state={state}", ranks=1)
    report = converged(pin, *no_verdict, "--set", f"cycle.start={state}", "--set", "friction.coefficient=0.25", ranks=1).report
    assert report["modes"]["unstable_count"] == 0
    assert report["cycle"]["frequency_hz"] == pytest.approx(4878.6, rel=1e-3)  # by steps of another length
    assert report["cycle"]["peak_to_peak"]["pin"] == pytest.approx(5.45e-6, rel=1e-2)


def test_a_given_state_leads_to_a_cycle_beside_a_stable_equilibrium(converged, squeal, tmp_path):
    """Between mu = 0.45 and 0.5 both attract. Slip that reverses makes the cycle, which a small motion never reaches."""
    scene = write_coexistence(tmp_path, {"coefficient": 0.55}, cycle={"save_state": str(tmp_path / "cycle.state")})
    unstable = converged(scene, ranks=1).report
    assert unstable["modes"]["unstable_count"] == 1 and unstable["cycle"]["multipliers"]["stability"] == "stable"
    start = ["--set", "cycle.save_state=", "--set", f"cycle.start={tmp_path}/cycle.state"]
    silent = converged(scene, "--set", "friction.coefficient=0.47", "--set", "cycle.save_state=", ranks=1).report
    assert silent["modes"]["unstable_count"] == 0 and silent["heard"] == "silent: no mode grows in the band"
    runs = [converged(scene, "--set", "friction.coefficient=0.47", *start, ranks=ranks).report for ranks in (1, 2)]
    for run in runs:
        assert run["modes"]["unstable_count"] == 0 and run["cycle"]["multipliers"]["stability"] == "stable"
        assert "stable equilibrium" in run["heard"]
        assert run["cycle"]["period"] == pytest.approx(runs[0]["cycle"]["period"], rel=1e-6)
        assert run["cycle"]["mean_fluctuating_energy"] < unstable["cycle"]["mean_fluctuating_energy"]
    # large random starts find it, too; whether all others have settled by then is another matter
    starts = squeal(scene, "--set", "friction.coefficient=0.47", "--set", "cycle.save_state=", "--set", "cycle.starts=6",
                    ranks=1).report
    assert "starts lead to a motion at" in starts["heard"]
    energies = [motion["mean_fluctuating_energy"] for motion in starts["attractors"]["motions"] if motion["kind"] == "steady"]
    assert energies == pytest.approx([runs[0]["cycle"]["mean_fluctuating_energy"]], rel=1e-2)


def test_a_grid_too_coarse_for_a_light_foot_is_no_irregular_motion(squeal, tmp_path):
    """At 64 steps a period the foot's impacts make the motion wander. Integration at 300 to 16000 steps from other starts has
    one cycle. Its step errors at 256 steps and more: 1e-3 of the period, 1 % of the energy, the multiplier's bar."""
    foot, along, across = 2.3e-6, 0.86504664, 0.77501542
    K = [[1.39502825 + along, -0.23846152, -along, 0], [-0.23846152, 1.10310753 + across, 0, -across],
         [-along, 0, along, 0], [0, -across, 0, across]]
    C = [[0.0782, 0, -4.3e-5, 0], [0, 0.0782, 0, -3.9e-5], [-4.3e-5, 0, 4.3e-5, 0], [0, -3.9e-5, 0, 3.9e-5]]
    write_matrices(tmp_path / "m", [[0, 0, 0, 1], [0, 0, 1, 0]], [0], [2.22508972], [0, -1, 0, 0],
                   M=np.diag([1, 1, foot, foot]), C=C, K=K)
    scene = write_scene(tmp_path, matrices={"folder": "m"}, friction={"coefficient": 0.76632756}, modes={"band": 1e9},
                        cycle={})
    run = squeal(scene, "-settled_periods", "128", ranks=1)
    cycle = run.report["cycle"]
    assert run.code == 0 and "squeals at" in run.report["heard"]
    steps = [attempt["steps_per_period"] for attempt in cycle["attempts"]]
    assert steps == sorted(steps) and steps[-1] >= 256 and cycle["attempts"][-1]["outcome"] == "converged"
    assert cycle["period"] == pytest.approx(1 / 0.19081, rel=1e-3)
    assert cycle["mean_fluctuating_energy"] == pytest.approx(11.89, rel=1e-2)
    largest = cycle["multipliers"]["values"][0]
    assert abs(math.hypot(largest["real"], largest["imaginary"]) - 0.677) < largest["error"] + 1e-3


def test_bars_of_multipliers_hold_what_impacts_within_a_step_change(squeal, tmp_path):
    """A rigid pad whose two corners hit. Central differences of event-driven integration have the largest multiplier -0.963163.
    Tangents of steps alone had 0.956 to 0.987, by the points of their steps at which the corners hit."""
    write_matrices(tmp_path / "m", [[0, 1, -1, -1, 1], [1, 0, 0.55321627, 0, -0.2], [0, 1, 1, -1, -1], [1, 0, 0.55321627, 0, -0.2]],
                   [0, 0], [0.32756219, 0.32756219], [0, -1, 0, 0, 0], M=np.diag([1, 1, 0.4810073, 0.44105631, 0.49414496]),
                   C=np.diag([0.00846301, 0.00846301, 0.00407077, 0.00373267, 0.00418196]),
                   K=[[0.98784625, 0.06515682, 0.21394039, 0, 0], [0.06515682, 1.31761424, -0.16422969, 0, 0],
                      [0.21394039, -0.16422969, 0.7785392, 0, 0], [0, 0, 0, 2.43607547, 0], [0, 0, 0, 0, 1.80893223]])
    scene = write_scene(tmp_path, matrices={"folder": "m"}, modes={"band": 1e6}, friction={"coefficient": 0.43902544}, cycle={})
    cycle = squeal(scene, ranks=1).report["cycle"]
    largest = cycle["multipliers"]["values"][0]
    assert abs(complex(largest["real"], largest["imaginary"]) + 0.963163) <= largest["error"] < 0.15


@pytest.mark.parametrize("friction, speed, damping, across, disc, mass, along, exact", [
    (0.758, 4.5476, 0.0112, 0.282, 1.397, 0.262, 0.471, 0.821614),  # bounces once: it touches and leaves at once
    (0.636, 4.0933, 0.0244, 0.217, 1.031, 0.442, 0.429, 0.282240),  # an impact takes all sliding, which goes on the other way
    (0.545, 4.0258, 0.0062, 0.307, 1.289, 0.229, 0.354, 0.838230),  # sliding turns within a step
])
def test_events_inside_steps_carry_small_motions_on(squeal, friction, speed, damping, across, disc, mass, along, exact):
    """The oscillator where it lifts off far, against central differences of event-driven integration. Tangents of steps alone were
    off by 0.06 at any number of steps, and the multiplier of the shift in time by 0.1. What the grid moves that by is no part of the
    bar of a pair that turns."""
    values = {"friction.coefficient": friction, "contact.0.velocity": f"[{speed},0,0]", "spring.0.damping": damping,
              "spring.1.damping": damping, "spring.3.damping": damping, "spring.2.stiffness": across, "spring.3.stiffness": disc,
              "spring.1.stiffness": along, "point.disc.mass": mass, "cycle.steps_per_period": 0, "cycle.tolerance": 0,
              "transient.enabled": "false"}
    run = squeal(INPUTS / "oscillator" / "scene.toml", *(word for key, value in values.items() for word in ("--set", f"{key}={value}")), ranks=1)
    found = run.report["cycle"]["multipliers"]
    assert run.code == 0 and found["stability"] == "stable" and found["trivial_error"] < 0.01
    assert abs(found["largest"] - exact) <= found["largest_error"] + found["trivial_error"] and found["largest_error"] < 0.01


@pytest.mark.parametrize("steps", [100, 400])
def test_bars_where_pairs_stick_are_no_wider_than_the_grids_differ(converged, tmp_path, steps):
    """The largest multiplier, of a complex pair, is 0.8837 at 3201 and 6401 steps a period. That of the shift in time misses 1 by
    3e-2 and 1e-2. At 100 steps the pair is off by 8e-4, and bars may be five times as wide and 2e-3."""
    cycle = converged(sticking_slider(tmp_path, {"coefficient": 2.887202266}, cycle={"steps_per_period": steps, "start": "mode",
                                                                                  "amplitude": 1.3}), ranks=1).report["cycle"]
    largest = cycle["multipliers"]["values"][0]
    off = abs(abs(complex(largest["real"], largest["imaginary"])) - 0.8837)
    assert cycle["multipliers"]["method"] == "whole" and off <= largest["error"] + 2e-4
    assert largest["error"] < 5 * off + 2e-3


def pads_on_discs(folder):
    """Two pads on springs, each against the mass of a disc of its own that moves along the normal."""
    at, belt = [0, 0, 0], [[1, 0, 0]]
    points, springs, forces, contacts = [], [], [], []
    for i, (m, disc, x, y, oblique, slope, c, below, load, speed) in enumerate(
            [(0.6813, 0.3456, 0.82858, 0.6134, 0.24844, 0.8313, 0.003244, 1.2013, 1.158, 1.118),
             (1.558, 0.5512, 1.9879, 0.80488, 0.19062, 0.8026, 0.007635, 1.4221, 1.473, 0.6337)]):
        points += [{"name": f"pad{i}", "at": at, "mass": m, "free": "x y"}, {"name": f"disc{i}", "at": at, "mass": disc, "free": "y"}]
        springs += [{"from": f"pad{i}", "direction": "x", "stiffness": x, "damping": c},
                    {"from": f"pad{i}", "direction": "y", "stiffness": y, "damping": c},
                    {"from": f"pad{i}", "direction": [1.0, -slope, 0], "stiffness": oblique},
                    {"from": f"disc{i}", "direction": "y", "stiffness": below, "damping": 0.02}]
        forces.append({"on": f"pad{i}", "vector": [0, -load, 0]})
        contacts.append({"rotor": f"disc{i}", "stator": f"pad{i}", "normal": [0, 1, 0], "tangents": belt, "velocity": [speed, 0, 0]})
    springs += [{"from": "pad0", "to": "pad1", "direction": "x", "stiffness": 0.059189, "damping": 0.002},
                {"from": "disc0", "to": "disc1", "direction": "y", "stiffness": 0.26171, "damping": 0.002}]
    return write_scene(folder, point=points, spring=springs, force=forces, contact=contacts, friction={"coefficient": 0.6041},
                       modes={"band": 2.0}, cycle={"enabled": True})


def test_impacts_leave_the_verdict_decided(converged, tmp_path):
    """Beside the cycle motions decay by 0.994 a period, known to 2e-3, and an integrator of its own settles on it from three
    starts. Without what events inside steps do the shift in time misses 1 by 0.1."""
    found = converged(pads_on_discs(tmp_path), ranks=1).report["cycle"]["multipliers"]
    largest = found["values"][0]
    assert found["stability"] == "stable" and max(largest["error"], found["trivial_error"]) < 0.01
    assert abs(math.hypot(largest["real"], largest["imaginary"]) - 0.994) <= largest["error"] + 2e-3


def test_exponents_that_finer_steps_change_show_no_irregular_motion(squeal, tmp_path):
    """Two bodies on massless feet, a torus: at 2048 steps a period two motions that begin 1e-7 apart are no further apart after 140.
    At 64 and 256 steps small differences grow by 5.6 a period."""
    at, belt = [0, 0, 0], [[1, 0, 0]]
    points = [{"name": "belt", "at": at, "free": "none"}]
    springs, forces, contacts = [], [], []
    for i, (mass, x, y) in enumerate([(1.0, 1.0, 0.4), (1.3, 1.2, 0.6)]):
        body, foot = f"body{i}", f"foot{i}"
        points += [{"name": body, "at": at, "mass": mass, "free": "x y"}, {"name": foot, "at": at, "free": "x y"}]
        springs += [{"from": body, "direction": "x", "stiffness": x, "damping": 0.02},
                    {"from": body, "direction": "y", "stiffness": y, "damping": 0.02},
                    {"from": body, "direction": [1, -1, 0], "stiffness": 0.3},
                    {"from": foot, "to": body, "direction": "x", "stiffness": 20.0, "damping": 0.05},
                    {"from": foot, "to": body, "direction": "y", "stiffness": 1.5, "damping": 0.05}]
        forces.append({"on": body, "vector": [0, -1, 0]})
        contacts.append({"rotor": "belt", "stator": foot, "normal": [0, 1, 0], "tangents": belt, "velocity": [0.6, 0, 0]})
    springs.append({"from": "body0", "to": "body1", "direction": "x", "stiffness": 0.2})
    scene = write_scene(tmp_path, point=points, spring=springs, force=forces, contact=contacts, friction={"coefficient": 0.45},
                        modes={"band": 2.0}, cycle={"steps_per_period": 256})
    run = squeal(scene, "-settled_periods", "128", "-cycle_free_periods", "20", ranks=1)
    settled = run.report["settled"]
    assert run.code == 0 and settled["exponents"][0]["mean"] > 1
    assert settled["kind"] == "undecided" and "irregular and what finer steps than" in settled["reason"]
    assert "four times as many change the largest exponent to" in settled["reason"]
