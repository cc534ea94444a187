"""Parts that spin: a ring's doublets from a scene, the order of ranks, and scenes that are refused."""

import numpy as np
import pytest
from conftest import INPUTS
from models import STEEL, Mesh, bricks, lattice, write_scene
from test_contact_compliance import compare_fidelities

RADIUS, THICKNESS, RATE = 0.4, 0.01, 60.0
SPIN = {"axis": "z", "rate": RATE}


def ring(folder, cells, turn=0.0, **part):
    """A free ring of 8-node bricks about z; `turn` leaves out that share of the circle."""
    mesh = Mesh()
    angle = lambda a: 2 * np.pi * (1 - turn) * a
    place = lambda a, b, c: ((RADIUS + THICKNESS * (0.5 - b)) * np.cos(angle(a)), (RADIUS + THICKNESS * (0.5 - b)) * np.sin(angle(a)),
                             2 * THICKNESS * (c - 0.5))
    grid = lattice((cells, 1, 1), place)
    nodes = mesh.add_nodes(grid if turn else grid[:-1])
    mesh.add("ring", "brick", bricks(nodes if turn else np.concatenate([nodes, nodes[:1]])))
    mesh.write(folder / "ring.msh")
    return write_scene(folder, mesh={"file": "ring.msh"}, part=[{"name": "ring", **STEEL, "poisson": 0.0, **part}],
                       modes={"band": 180})


def doublet(n, rate):
    common = n * (n**2 - 1) / (n**2 + 1)
    mean = np.sqrt(rate**2 + (n**2 + 1) * STEEL["young"] * THICKNESS**2 / (12 * STEEL["density"] * RADIUS**4))
    return common * np.array([mean - rate, mean + rate]) / (2 * np.pi)


@pytest.mark.parametrize("ranks", [1, 2])
def test_the_doublets_of_a_free_ring_and_its_nutation(tmp_path, converged, ranks):
    run = converged(ring(tmp_path, 72, rotation=SPIN), ranks=ranks)
    found = np.array([mode["frequency_hz"] for mode in run.report["modes"]["modes"]])
    assert all(mode["backward_error"] < 1e-12 for mode in run.report["modes"]["modes"])
    nutation = RATE * 2 / (1 + (2 * THICKNESS / RADIUS) ** 2 / 6) / (2 * np.pi)  # I_p/I_d of a thin ring
    # 1 % is the mesh's second order at n = 3, as tests/verify/spin.cpp measures it; the ring tilts softly, which changes
    # the nutation by (rate/elastic)^2
    for exact in (*doublet(2, RATE), *doublet(3, RATE)):
        assert np.abs(found / exact - 1).min() < 1e-2
    assert np.abs(found / nutation - 1).min() < 2e-2
    lower, upper = (found[np.abs(found - exact).argmin()] for exact in doublet(2, RATE))
    assert upper - lower == pytest.approx(2.4 * RATE / (2 * np.pi), rel=1e-2)


def test_without_a_rate_nothing_changes(tmp_path, converged):
    runs = [converged(ring(tmp_path, 12, **part), ranks=1) for part in ({}, {"rotation": {"axis": "z", "rate": 0}})]
    first, second = ([mode["frequency_hz"] for mode in run.report["modes"]["modes"]] for run in runs)
    assert first == second


@pytest.mark.parametrize("part, words", [
    ({"rotation": {"rate": 5}}, ["rotation", "axis"]),
    ({"rotation": {"axis": "z"}}, ["rotation", "rate"]),
    ({"rotation": {"axis": "x", "rate": 5}}, ["[[part]] ring", "solid of revolution", "axis and centre"]),
    ({"rotation": {"axis": "z", "centre": [0.1, 0, 0], "rate": 5}}, ["[[part]] ring", "solid of revolution"]),
    ({"rotation": SPIN, "thickness": 0.01}, ["[[part]] ring", "rotation is for solids"]),
])
def test_parts_that_cannot_spin_are_refused(tmp_path, squeal, part, words):
    run = squeal(ring(tmp_path, 12, **part), ranks=1)
    assert run.code == 1
    assert all(word in str(run.messages) for word in words)


def test_a_ring_with_a_gap_is_refused(tmp_path, squeal):
    run = squeal(ring(tmp_path, 12, turn=0.02, rotation=SPIN), ranks=2)
    assert run.code == 1 and "solid of revolution" in str(run.messages)


def test_a_pin_on_a_disc_that_spins_has_the_same_cycle_by_both_models(converged):
    """At five times the rate of the drive, so that the terms of spin matter."""
    words = ["--set", "damping.beta=8e-7", "--set", "friction.coefficient=0.35"]
    full = compare_fidelities(converged, *words, "--set", 'part.0.rotation={axis = "z", rate = 100}')
    assert full["modes"]["unstable_count"] == 1


def test_parts_of_matrix_scenes_are_refused(squeal):
    run = squeal(INPUTS / "oscillator" / "matrices.toml", "--set", "part.0.rotation.rate=5", ranks=1)
    assert run.code == 1 and "part" in str(run.messages)
