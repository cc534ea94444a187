"""Frictional contact of few points, where right values come from closed forms, from trying every set of pairs or from events."""

import numpy as np
import pytest
from models import write_scene
from test_ladder_motion import history_of


def three_points(folder, masses, grounds, links, forces, contacts, **tables):
    """Three points on springs (stiffness, damping, direction), each to ground or the next, and contacts (rotor, stator, normal,
    tangent, velocity, gap); number 3 is the belt, which does not move."""
    names = ["p0", "p1", "p2", "belt"]
    points = [{"name": name, "at": [float(i), 0, 0], "mass": mass, "free": "x y z"} for i, (name, mass) in enumerate(zip(names, masses))]
    points.append({"name": "belt", "at": [0, 0, 0], "free": "none"})
    springs = [{"from": names[i // 3], "to": "ground", "stiffness": k, "damping": c, "direction": n} for i, (k, c, *n) in enumerate(grounds)]
    springs += [{"from": names[i], "to": names[i + 1], "stiffness": k, "damping": c, "direction": n} for i, (k, c, *n) in enumerate(links)]
    pairs = [{"rotor": names[a], "stator": names[b], "normal": n, "tangents": [t], "velocity": v, "gap": gap}
             for a, b, n, t, v, gap in contacts]
    return write_scene(folder, point=points, spring=springs, force=[{"on": name, "vector": f} for name, f in zip(names, forces)],
                       contact=pairs, **tables)


def test_an_equilibrium_is_found_where_sets_of_closed_pairs_repeat(squeal, tmp_path):
    """Of all eight sets of closed pairs one alone fits. It goes on from the equilibria at less friction."""
    scene = three_points(
        tmp_path, [1.361253569439583, 1.6144517523450768, 1.339921780027303],
        [[0.5290256669643174, 0.01, -0.919, 0.271, 0.285], [1.2231975292201813, 0.01, -0.157, -0.326, -0.932],
         [3.9992014994761687, 0.01, -0.392, -0.886, 0.247], [1.909024575292212, 0.01, 0.33, -0.222, -0.917],
         [3.733007067043935, 0.01, 0.847, 0.466, -0.256], [3.689548554519452, 0.01, 0.057, 0.446, 0.893],
         [3.6549985455281213, 0.01, 0.003, -0.941, 0.339], [2.5643721810597224, 0.01, -0.396, -0.891, 0.221],
         [2.157297925832175, 0.01, 0.975, 0.217, 0.051]],
        [[1.77033699328646, 0.01, 0.293, -0.237, -0.926], [1.4343939475168315, 0.01, 0.2, -0.709, -0.676]],
        [[1.5416736789077057, 0.9876670240142337, 1.996798222808113], [0.03531261741734174, -1.383490331390901, -1.5889567491243652],
         [0.39720943759811883, 1.1251286166905132, 1.7428386443970412]],
        [(3, 0, [-0.516, -0.323, -0.793], [0.49355820145920015, -0.8690188811315831, 0.032808406875856316],
          [0.2931756704919611, -0.2224199846717785, -0.1001727502205138], 0.0),
         (2, 1, [-0.195, 0.654, 0.731], [0.5653343055729145, -0.5340708957944954, 0.6286218268622685],
          [0.34399960714938566, -0.324976171677824, 0.3825093565956595], 0.15641310866468955),
         (3, 2, [-0.183, -0.444, -0.877], [0.22833112018236942, 0.848581347150029, -0.47725736958721376],
          [0.30213286909416437, 1.1228619071699628, -0.6315176759722869], 0.0)],
        friction={"coefficient": 0.6567735276216027}, modes={"band": 20.0}, estimate={"enabled": False})
    equilibrium = squeal(scene, ranks=1).report["equilibrium"]
    assert equilibrium["outcome"] == "converged" and equilibrium["closed"] == 2
    assert equilibrium["normal_force_max"] == pytest.approx(5.799468, rel=1e-6)
    assert equilibrium["normal_force_min"] == pytest.approx(0.484357, rel=1e-5)


def test_a_mode_that_comes_back_through_infinity_has_a_threshold(squeal, tmp_path):
    """At mu = 1.174663 the mass of sliding changes its sign (Painleve): an eigenvalue leaves through infinity and comes back as
    a growth of any size, beyond the band."""
    scene = three_points(
        tmp_path, [1.3873821247749676, 0.554454731517144, 1.668441047721994],
        [[1.6368268428571882, 0.001625918231319896, -0.028, -0.799, -0.601], [3.855215064346331, 0.01877417435135445, 0.042, -0.122, 0.992],
         [1.1456648200532857, 0.0022573164879908527, -0.448, -0.696, -0.561], [1.7573670033515325, 0.0089320218897947, 0.042, 0.981, 0.187],
         [3.1029272793317073, 0.010231482577600816, -0.446, 0.168, 0.879], [3.663991933219938, 0.012894075074503287, 0.14, -0.333, 0.933],
         [1.209640779665062, 0.002782941731779085, -0.544, 0.809, 0.223], [3.381839110049579, 0.013857238304885212, 0.866, 0.398, 0.302],
         [1.3933495329525627, 0.01709017399279786, -0.647, 0.042, 0.761]],
        [[0.568361656350073, 0.002376472248909094, 0.755, -0.654, -0.047], [1.1902810563299766, 0.01104627021274609, 0.7, -0.195, -0.687]],
        [[0.29943799561243684, 0.733924445382772, 1.7077699629816885], [-0.7734692529369284, -1.4735008556177247, 1.3726714806317273],
         [0.6760939272588683, 0.2538325183284157, 0.15831102459277]],
        [(1, 0, [-0.173, -0.483, -0.858], [0.22967587531216055, 0.8275282080534208, -0.512156236502105],
          [-0.10962641361971119, 0.36757302153091365, -0.18481631683359123], 0.22395366981812204),
         (3, 1, [0.433, 0.537, -0.724], [0.4322608360729341, -0.8285048609254995, -0.3559919451621723],
          [0.2282296658150353, -0.43744279322879603, -0.18796040699717295], 0.1571056458212503)],
        friction={"coefficient": 0.46666351384148935}, modes={"band": 20.0}, estimate={"enabled": False},
        sweep={"key": "friction.coefficient", "from": 0.05, "to": 1.2, "points": 12})
    sweep = squeal(scene, ranks=1).report["sweep"]
    first, second = sweep["thresholds"]
    assert first["values"][0] == pytest.approx(1.11753, abs=2e-5)
    assert abs(second["values"][0] - 1.174663) <= second["error"] < 0.02 and second["change"] == 1


def block_on_belt(folder, mass, stiffness, damping, load, speed, friction, **tables):
    return write_scene(
        folder, point=[{"name": "block", "at": [0, 0, 0], "mass": mass, "free": "x y"}, {"name": "belt", "at": [0, 0, 0], "free": "none"}],
        spring=[{"from": "block", "direction": "x", "stiffness": stiffness, "damping": damping}],
        force=[{"on": "block", "vector": [0, -load, 0]}],
        contact=[{"rotor": "belt", "stator": "block", "normal": [0, 1, 0], "tangents": [[1, 0, 0]], "velocity": [speed, 0, 0]}],
        friction=friction, probe=[{"name": "x", "on": "block", "direction": "x"}], **tables)


def test_bars_of_the_motions_of_starts_hold_the_error_of_the_step(converged, tmp_path):
    """Stick-slip of period 6.316306 s beside a stable equilibrium, by events. Half of the starts are large enough for it."""
    scene = block_on_belt(tmp_path, 1.0, 1.0, 0.1, 1.0, 1.5, {"coefficient": 0.5, "static_coefficient": 1.0, "decay_speed": 0.5},
                          modes={"band": 1.0}, cycle={"starts": 8})
    report = converged(scene, ranks=1).report
    kinds = {motion["kind"]: motion for motion in report["attractors"]["motions"]}
    assert set(kinds) == {"rest", "steady"} and len(kinds["steady"]["starts"]) >= 3
    assert abs(kinds["steady"]["frequency_hz"] - 0.1583204) <= kinds["steady"]["frequency_error"] < 2e-3
    assert "starts lead to a motion at 0.158" in report["heard"]


def test_friction_that_falls_within_a_step_is_no_motion_of_starts(squeal, tmp_path):
    scene = block_on_belt(tmp_path, 0.538, 6957.0, 5.946, 10.0, 0.05, {"coefficient": 0.2, "static_coefficient": 0.6, "decay_speed": 1e-4},
                          modes={"band": 100.0}, cycle={"starts": 8, "steps_per_period": 128})
    report = squeal(scene, ranks=1).report
    assert report["attractors"]["outcome"] == "refused" and "several solutions" in report["attractors"]["reason"]


@pytest.mark.parametrize("law, cycle, frequency", [({"decay_speed": 1e-3}, {}, 16.620), ({"decay_speed": 2e-3}, {}, 16.50094),
                                                   ({}, {"steps_per_period": 512}, 16.79377)])
def test_falling_friction_drives_stick_slip_beside_stable_sliding(converged, tmp_path, law, cycle, frequency):
    """Without a word of the scene, at as many steps as have one solution; the last law has two levels alone. The frequencies are of
    event-driven integration, from displacements above 1.1 V/omega; smaller ones die out."""
    scene = block_on_belt(tmp_path, 0.538, 6957.0, 5.946, 10.0, 0.05, {"coefficient": 0.2, "static_coefficient": 0.6, **law},
                          modes={"band": 100.0}, cycle=cycle)
    report = converged(scene, ranks=1).report
    assert report["heard"].startswith("silent: no mode grows in the band, but ")
    rest, motion = sorted(report["attractors"]["motions"], key=lambda motion: motion["frequency_hz"])
    assert rest["kind"] == "rest" and motion["kind"] == "steady"
    assert abs(motion["frequency_hz"] - frequency) < motion["frequency_error"] < 0.02 * frequency


@pytest.mark.parametrize("speed, steps, frequency, energy", [(0.1, 64, 0.1254129, 0.017716), (0.5, 64, 0.1586535, 0.135480),
                                                             (0.54, 100, 0.1587792, 0.155127), (0.56, 64, None, None)])
def test_few_steps_see_stick_slip_that_just_lasts(converged, tmp_path, speed, steps, frequency, energy):
    """Friction 0.3 and 0.5 at rest alone. By closed forms between events the cycle lasts up to 0.547 m/s."""
    scene = block_on_belt(tmp_path, 1.0, 1.0, 0.02, 1.0, speed, {"coefficient": 0.3, "static_coefficient": 0.5}, modes={"band": 1.0},
                          cycle={"steps_per_period": steps})
    report = converged(scene, ranks=1).report
    seen = [motion for motion in report["attractors"]["motions"] if motion["kind"] != "rest"]
    assert report["heard"].startswith("silent: no mode grows in the band") and ("but" in report["heard"]) == bool(frequency)
    assert len(seen) == bool(frequency)
    for motion in seen:
        assert motion["kind"] == "steady" and abs(motion["frequency_hz"] - frequency) <= motion["frequency_error"] < 5e-4
        assert abs(motion["mean_fluctuating_energy"] - energy) <= motion["energy_error"] < 0.02 * energy


@pytest.mark.parametrize("rest, sliding, speed, steps", [(0.6, 0.2, 0.05, 100), (0.6, 0.2, 0.05, 400), (0.4, 0.3, 0.02, 200), (0.5, 0.0, 0.1, 150)])
def test_two_levels_of_friction_have_exact_stick_slip(converged, tmp_path, rest, sliding, speed, steps):
    """Without damping the block is let go at rest D = (rest - sliding) N/k beyond steady sliding. Sliding that just keeps ahead of the
    belt goes on: stick would stop it within a step."""
    omega, beyond = np.sqrt(6957 / 0.538), (rest - sliding) * 10 / 6957
    period = 2 * beyond / speed + 2 / omega * (np.pi - np.arctan(beyond * omega / speed))
    swing, fastest = np.hypot(beyond, speed / omega), speed / omega
    def motion(name, displacement):
        (tmp_path / name).mkdir()
        scene = block_on_belt(tmp_path / name, 0.538, 6957.0, 0.0, 10.0, speed, {"coefficient": sliding, "static_coefficient": rest},
                              modes={"band": 100.0}, initial=[{"on": "block", "displacement": [displacement, 0, 0]}],
                              transient={"start": "equilibrium", "steps": 12 * steps, "step_size": period / (steps + 0.37)})
        return history_of(converged(scene, ranks=1), 1e-9)
    x = motion("sticks", 0.98 * swing)["x"][2 * steps:]
    assert np.ptp(x) == pytest.approx(2 * swing, rel=3 / steps)
    x = x - x.mean()
    ups = np.flatnonzero((x[:-1] < 0) & (x[1:] >= 0))
    assert (ups[-1] - ups[0]) / (len(ups) - 1) == pytest.approx(steps + 0.37, abs=1)
    slides = motion("slides", 0.99 * fastest)
    assert np.ptp(slides["x"]) == pytest.approx(1.98 * fastest, rel=20 / steps**2) and not slides["stick"].any()


def test_nothing_is_said_of_a_mode_that_is_not_followed(converged, tmp_path):
    """A box on a conveyor that turns round. It slips first at 4.602 s, by events: displacement 5.1 m at most."""
    time = np.arange(0, 50.5, 0.5)
    scene = block_on_belt(tmp_path, 20.0, 70.0, 10.0, 196.2, 3.0, {"coefficient": 1.5}, modes={"band": 10.0},
                          transient={"start": "rest", "steps": 1000, "step_size": 0.05, "load_factor": [[0, 0], [0.01, 1]],
                                     "speed_factor": [[t, s] for t, s in zip(time.tolist(), np.sin(2 * np.pi * time / 50).tolist())]})
    run = converged(scene, ranks=1)
    shown = run.printed[run.printed.index("  transient    completed"):]
    assert "nan" not in run.printed and "predicted" not in shown and "periods" not in shown and "bias" not in shown


def test_a_chain_with_uneven_dashpots_has_all_its_modes(converged, tmp_path):
    """Eight masses between walls; the first and the last mode are published to all digits given, the others are NumPy's."""
    damping, count = [250.0, *[50.0] * 7, 25.0], 8
    names = ["ground", *(f"P{i}" for i in range(1, count + 1)), "ground"]
    springs = [{"from": a, "to": b, "direction": "x", "stiffness": 1e5, "damping": c}
               for a, b, c in [(names[1], "ground", damping[0]), *zip(names[1:], names[2:], damping[1:])]]
    scene = write_scene(tmp_path, point=[{"name": name, "at": [float(i), 0, 0], "mass": 10.0, "free": "x"}
                                         for i, name in enumerate(names[1:-1])], spring=springs, modes={"band": 40.0})
    modes = converged(scene, ranks=1).report["modes"]["modes"]
    incidence = np.eye(count + 1, count) - np.eye(count + 1, count, -1)
    K, C = (incidence.T @ np.diag(values) @ incidence for values in (np.full(count + 1, 1e5), damping))
    zero, one = np.zeros((count, count)), np.eye(count)
    exact = np.linalg.eigvals(np.block([[zero, one], [-K / 10, -C / 10]]))
    exact = sorted(exact[exact.imag > 0], key=lambda value: value.imag)
    assert [mode["frequency_hz"] for mode in modes] == pytest.approx([value.imag / (2 * np.pi) for value in exact], rel=1e-10)
    assert [mode["growth_rate"] for mode in modes] == pytest.approx([value.real for value in exact], rel=1e-9)
    assert (modes[0]["frequency_hz"], modes[-1]["frequency_hz"]) == pytest.approx((5.5291472398, 31.2948323744), rel=1e-10)
    assert (modes[0]["damping_ratio"], modes[-1]["damping_ratio"]) == pytest.approx((0.015208962, 0.050296429), rel=1e-7)


def test_a_pad_and_a_disc_under_falling_friction(converged, tmp_path):
    """Eigenvalues and derivatives by dense algebra, to the digits given."""
    at = [0, 0, 0]
    scene = write_scene(
        tmp_path, point=[{"name": "pad", "at": at, "mass": 1.0, "free": "x y"}, {"name": "disc", "at": at, "mass": 1.5, "free": "x"}],
        spring=[{"from": "pad", "direction": "x", "stiffness": 100.0, "damping": 0.3},
                {"from": "disc", "direction": "x", "stiffness": 150.0, "damping": 0.1}],
        force=[{"on": "pad", "vector": [0, -10, 0]}],
        contact=[{"rotor": "disc", "stator": "pad", "normal": [0, 1, 0], "tangents": [[1, 0, 0]], "velocity": [2, 0, 0]}],
        friction={"coefficient": 0.3, "static_coefficient": 0.6, "decay_speed": 3.0}, modes={"band": 10.0}, sensitivity={},
        probe=[{"name": "pad", "on": "pad", "direction": "x"}], change=[{"probe": "pad", "damping": 0.2}])
    report = converged(scene, ranks=1).report
    first, second = report["modes"]["modes"]
    assert (first["growth_rate"], first["frequency_hz"]) == pytest.approx((0.3324347, 1.5906698), rel=1e-7)
    assert second["growth_rate"] == pytest.approx(-0.0879204, rel=1e-6)
    mode, = report["sensitivity"]["modes"]
    assert mode["changes"][0]["computed"]["growth_rate"] == pytest.approx(0.2918692, rel=1e-6)
    by = {one["key"]: one["growth_rate_by_percent"] for one in mode["derivatives"]}
    assert (by["spring.0.damping"], by["spring.1.damping"]) == pytest.approx((-0.00069452, -0.00017900), rel=1e-4)


def light_block(folder, friction, speed, **cycle):
    return block_on_belt(folder, 1.0, 1.0, 0.001, 1.0, speed, friction, modes={"band": 1.0}, cycle={"steps_per_period": 64, **cycle})


def test_starts_that_still_move_leave_silence_open(squeal, tmp_path):
    """The fall of friction takes half of a damping of 0.05 %: no start comes to rest in 400 periods."""
    scene = light_block(tmp_path, {"coefficient": 0.3, "static_coefficient": 0.302, "decay_speed": 0.5}, 1.0, starts=4)
    assert squeal(scene, ranks=1).report["heard"].startswith("undecided: no mode grows in the band, but 4 of 4 starts still moved after")


def test_sliding_that_no_pair_leaves_falls_to_rest(converged, tmp_path):
    """Constant friction adds no energy in sliding, however slowly 0.05 % of damping take it."""
    report = converged(light_block(tmp_path, {"coefficient": 0.3}, 1.0, starts=4), ranks=1).report
    (motion,) = report["attractors"]["motions"]
    assert motion["kind"] == "rest" and report["heard"] == "silent: no mode grows in the band"


@pytest.mark.parametrize("steps", [64, 0])
def test_a_mode_at_an_amplitude_leads_to_the_cycle_beside_a_stable_equilibrium(converged, tmp_path, steps):
    """Stick-slip at 0.125413 Hz, by events; the tangent does not see friction that falls at once."""
    scene = block_on_belt(tmp_path, 1.0, 1.0, 0.02, 1.0, 0.1, {"coefficient": 0.3, "static_coefficient": 0.5}, modes={"band": 1.0},
                          cycle={"start": "mode", "amplitude": 0.5, "steps_per_period": steps})
    report = converged(scene, ranks=1).report
    assert report["modes"]["unstable_count"] == 0 and report["heard"].startswith("squeals at 0.125")
    assert report["cycle"]["frequency_hz"] == pytest.approx(0.125413, rel=2e-3)
    assert report["cycle"]["multipliers"]["stability"] == "undecided"


def test_a_small_start_is_finite_where_nothing_lifts_off(converged, tmp_path):
    """It is a tenth of first reversal then, near V over omega. By friction's fall of 0.268 N s/m it grows 2.2 times in the period."""
    scene = block_on_belt(tmp_path, 1.0, 1.0, 0.02, 1.0, 0.2, {"coefficient": 0.3, "static_coefficient": 0.5, "decay_speed": 0.5},
                          modes={"band": 1.0}, cycle={"enabled": False}, transient={"start": "mode", "periods": 1, "steps_per_period": 100})
    x = history_of(converged(scene, ranks=1), 1e-6)["x"]
    assert 0.04 < np.ptp(x) < 2.2 * 0.04
