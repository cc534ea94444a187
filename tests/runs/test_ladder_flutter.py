"""Flutter by friction against exact answers: thresholds, complete counts, the energy estimate's roots, the scaling law.

In each scene of its own the unsymmetric stiffness is what it is in a brake: a spring k pressed through a closed pair by a
massless node turns the normal motion y into a reaction -k y, and friction -mu r_n into a force on x.
"""

import numpy as np
import pytest
from conftest import INPUTS
from models import write_matrices, write_scene

both = pytest.mark.parametrize("ranks", [1, 2])
OFF = {"enabled": False}


def unstable_modes(converged, scene, ranks, *arguments):
    modes = converged(scene, *arguments, ranks=ranks).report["modes"]
    assert modes["outcome"] == "converged" and modes["count_check"].startswith("confirmed")
    return modes


def eigenvalue(mode):
    return mode["growth_rate"] + 2j * np.pi * mode["frequency_hz"]


def two_modes(folder, damping=(0, 0)):
    """M = I, K = [[23.25, k - 11 mu], [k, 18.75]] (after Hoffmann et al. 2002), from points and springs."""
    k = 3.897114317029974  # the spring along (1, 1) brings it to all four entries
    return write_scene(
        folder, title="two coupled modes", estimate=OFF, modes={"band": 1.0},
        point=[{"name": "mass", "at": [0, 0, 0], "mass": 1.0, "free": "x y"}, {"name": "belt", "at": [0, 0, 0], "free": "y"}],
        spring=[{"from": "mass", "to": "ground", "direction": [1, 1, 0], "stiffness": 2 * k},
                {"from": "mass", "to": "ground", "direction": "x", "stiffness": 23.25 - k, "damping": damping[0]},
                {"from": "mass", "to": "ground", "direction": "y", "stiffness": 18.75 - 11 - k, "damping": damping[1]},
                {"from": "belt", "to": "ground", "direction": "y", "stiffness": 11.0}],
        force=[{"on": "mass", "vector": [0, -1, 0]}],
        contact=[{"rotor": "belt", "stator": "mass", "normal": "y", "tangents": [[1, 0, 0]], "velocity": [-1, 0, 0]}])


@both
@pytest.mark.parametrize("damping, critical, margin", [((0, 0), .472377492973330, 1e-9), ((.2, .02), .395110300148, 1e-6),
                                                       ((.02, .2), .395453847416, 1e-6), ((.05, .05), .473602175363, 1e-6)])
def test_two_modes_flutter_from_the_exact_friction_on(converged, tmp_path, damping, critical, margin, ranks):
    """At the threshold the undamped pair is defective: 1e-9 beyond, its growth is 1e-5; a bracket is the sharpest test."""
    scene = two_modes(tmp_path, damping)
    for mu, count in ((critical - margin, 0), (critical + margin, 1)):
        assert unstable_modes(converged, scene, ranks, "--set", f"friction.coefficient={mu!r}")["unstable_count"] == count


@both
def test_two_modes_beyond_the_threshold(converged, tmp_path, ranks):
    modes = unstable_modes(converged, two_modes(tmp_path), ranks, "--set", "friction.coefficient=0.5")
    assert abs(eigenvalue(modes["modes"][0]) - (.118690019 + 4.584112490j)) < 1e-8  # all the digits that are given


@both
@pytest.mark.parametrize("mu, count", [(.38, 44), (.36, 17)])
def test_every_unstable_mode_of_a_chain_is_found(converged, tmp_path, mu, count, ranks):
    """50 cells with closed contact, C = .02 I: 44 and 17 unstable modes, the rightmost to all the digits given."""
    cells, k = 50, 4.5 * np.sqrt(3) / 2
    n = 3 * cells  # x and y of each cell, and its belt's node
    x, y, belt = (np.arange(i, n, 3) for i in range(3))
    K = np.zeros((n, n))
    K[x, x], K[x, y], K[y, x], K[y, y], K[belt, belt] = 2 + 17, k, k, 18.75 - 11, 11
    K[x[1:], x[:-1]] = K[x[:-1], x[1:]] = -1
    M = np.zeros((n, n))
    M[x, x] = M[y, y] = 1
    B = np.zeros((2 * cells, n))
    B[np.arange(0, 2 * cells, 2), y], B[np.arange(0, 2 * cells, 2), belt] = 1, -1
    B[np.arange(1, 2 * cells, 2), x] = 1
    load = np.zeros(n)
    load[y] = -1
    write_matrices(tmp_path / "chain", B, np.zeros(cells), -np.ones(cells), load, M=M, C=.02 * M, K=K)
    scene = write_scene(tmp_path, title="chain", estimate=OFF, modes={"band": 10.0}, matrices={"folder": "chain"},
                        friction={"coefficient": mu})
    modes = unstable_modes(converged, scene, ranks)
    assert len(modes["modes"]) == 2 * cells
    assert modes["unstable_count"] == count
    if mu == .38:
        assert abs(eigenvalue(modes["modes"][0]) - (.111240406422 + 4.328534114602j)) < 1e-11


def oscillator(mu, speed):
    return [INPUTS / "oscillator" / "scene.toml", "--set", f"friction.coefficient={mu}", "--set",
            f"contact.0.velocity=[{float(speed)},0,0]", "--set", "transient.enabled=false"]


def share_of_y(mode):
    """|y| of the mode over its largest entry, from the pad's x-equation with the reaction that the disc's asks for."""
    growth = eigenvalue(mode)
    x_over_y = .1 / (growth**2 + .02 * growth + 1.1)  # friction off
    reaction = -(.5 * growth**2 + .02 * growth + 1.2)
    x_over_y += mode["mu"] * reaction / (growth**2 + .02 * growth + 1.1)
    return 1 / max(1, abs(x_over_y))


@both
@pytest.mark.parametrize("mu, speed, exact, published, digits", [
    (.3, .6, .471991674487, .471996196, 1.1e-5), (.3, 1, .796805571968, .796797853, 1.1e-5),
    (.3, 2, 1.612609298722, 1.612637123, 1.8e-5), (.18, 1e9, 1.5749186005534, 1.574918604, 3e-9)])
def test_the_energy_estimate_has_its_exact_roots(converged, mu, speed, exact, published, digits, ranks):
    """Exact: the same balance by adaptive quadrature split at each lift-off and reversal (SciPy), to 1e-10. The three
    published roots at mu = .3 are 1e-5 to 1.7e-5 off these: the friction force jumps at a reversal, and a rule of equal
    steps that does not split there is off by so much. Where nothing reverses, the first harmonic of a clipped wave is known
    and the root exact; the published one is 2e-9 off it."""
    report = converged(*oscillator(mu, speed), "--set", "cycle.enabled=false", ranks=ranks).report
    estimate = report["estimate"]
    assert estimate["outcome"] == "balance"
    amplitude = estimate["amplitude"] * share_of_y({**report["modes"]["modes"][0], "mu": mu})
    assert amplitude == pytest.approx(exact, rel=1e-10)
    assert amplitude == pytest.approx(published, rel=digits)


@both
def test_lift_off_alone_balances_no_strong_friction(converged, ranks):
    report = converged(*oscillator(.3, 1e9), "--set", "cycle.enabled=false", ranks=ranks).report
    assert report["estimate"]["outcome"] == "no balance" and report["estimate"]["amplitude"] is None


@both
def test_double_load_and_drive_double_the_cycle(converged, ranks):
    """If (u, v, r, T) is a cycle for (F, v_d), (2u, 2v, 2r, T) is one for (2F, 2v_d): 1e-10, no length of the program's
    own being in the way."""
    tight = ["--set", "cycle.tolerance=1e-11"]
    once = converged(*oscillator(.3, 1), *tight, ranks=ranks).report["cycle"]
    twice = converged(*oscillator(.3, 2), *tight, "--set", "force.0.vector=[0,-2,0]", ranks=ranks).report["cycle"]
    assert twice["period"] == pytest.approx(once["period"], rel=1e-10)
    assert twice["mean_energy"] == pytest.approx(4 * once["mean_energy"], rel=1e-10)
    for name, swing in once["peak_to_peak"].items():  # read off 400 samples, whose phase is free
        assert twice["peak_to_peak"][name] == pytest.approx(2 * swing, rel=1e-9)
