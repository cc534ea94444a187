"""Contacts with a normal compliance, as of rough linings, from the scene's key to the cycle."""

import numpy as np
import pytest
import scipy.linalg
from conftest import INPUTS
from models import Mesh, bricks, lattice, quads, write_matrices, write_scene

PIN = [INPUTS / "pin_on_disc" / "scene.toml", "--set", "mesh.parameters.divisions=2", "--set", "modes.method=full"]
SIDE, HEIGHT, COMPLIANCE, PRESSURE = 0.2, 0.1, 2e-9, 3e5


def block_on_bed(folder, young):
    """A block of 3 x 3 bricks on a bed of 2 x 2 that is held; neither contracts across, so that pressure is uniform."""
    mesh = Mesh()
    for name, cells, low, high, face in (("bed", 2, -HEIGHT, 0, -1), ("block", 3, 0, HEIGHT, 0)):
        nodes = mesh.add_nodes(lattice((cells, cells, 2), lambda a, b, c: (SIDE * a, SIDE * b, low + (high - low) * c)))
        mesh.add(name, "brick", bricks(nodes))
        mesh.add(name + "_face", "quad", quads(nodes[:, :, face]))
        mesh.add(name + "_end", "quad", quads(nodes[:, :, -1 - face]))
    mesh.write(folder / "block.msh")
    material = {"young": young, "poisson": 0.0, "density": 2500}
    return write_scene(folder, mesh={"file": "block.msh"}, part=[{"name": name, **material} for name in ("bed", "block")],
                       support=[{"on": "bed", "fixed": "all"}, {"on": "block", "fixed": "x y"}],
                       pressure=[{"on": "block_end", "value": PRESSURE}],
                       contact=[{"rotor": "bed_face", "stator": "block_face", "velocity": [1, 0, 0], "compliance": COMPLIANCE}],
                       friction={"coefficient": 0.3}, probe=[{"name": "top", "on": "block_end", "at": [0, 0, HEIGHT], "direction": "z"}],
                       modes={"band": 3000})


@pytest.mark.parametrize("ranks", [1, 2, 3])
def test_a_block_approaches_by_pressure_times_compliance_and_swings_on_it(tmp_path, converged, ranks):
    young = 1e13
    run = converged(block_on_bed(tmp_path, young), ranks=ranks)
    approach = PRESSURE * (COMPLIANCE + HEIGHT / young)
    assert run.report["equilibrium"]["probes"]["top"] == pytest.approx(-approach, rel=1e-10)
    frequency = np.sqrt(1 / (COMPLIANCE * 2500 * HEIGHT)) / (2 * np.pi)
    modes = [mode["frequency_hz"] for mode in run.report["modes"]["modes"]]
    # a bar on a spring: its own compliance beside the spring's is H/(3 E c)
    assert modes == [pytest.approx(frequency, rel=HEIGHT / (young * COMPLIANCE))]


def test_without_friction_a_compliance_is_a_spring(tmp_path, converged):
    """To the rounding of the eigenvalues, 1e-10."""
    stiffness, points = 3e6, [{"name": "a", "at": [0, 0, 0], "mass": 2.0, "free": "x z"},
                              {"name": "b", "at": [0, 0, 0], "mass": 0.7, "free": "x z"}]
    ground = [{"from": name, "direction": [1, 0, slope], "stiffness": k}
              for name, slope, k in (("a", 0.3, 1e6), ("a", -2.0, 4e5), ("b", 1.1, 2e6), ("b", -0.2, 3e5))]
    contact = {"rotor": "a", "stator": "b", "normal": "z", "tangents": [[1, 0, 0]], "velocity": [1, 0, 0], "compliance": 1 / stiffness}
    common = {"point": points, "force": [{"on": "b", "vector": [0, 0, -50]}], "friction": {"coefficient": 0},
              "modes": {"band": 3000}}
    tables = {"contact": {"spring": ground, "contact": [contact]},
              "spring": {"spring": ground + [{"from": "a", "to": "b", "direction": "z", "stiffness": stiffness}]}}
    found = {}
    for name, own in tables.items():
        (tmp_path / name).mkdir()
        run = converged(write_scene(tmp_path / name, **common, **own), ranks=1)
        found[name] = [mode["frequency_hz"] for mode in run.report["modes"]["modes"]]
    assert len(found["spring"]) == 4
    np.testing.assert_allclose(found["contact"], found["spring"], rtol=1e-10)


@pytest.mark.parametrize("mu", [0.0, 0.3, 0.6])
def test_modes_are_those_of_the_springs_put_into_the_stiffness(tmp_path, converged, mu):
    """Six motions, two pairs of one tangent, of which one is rigid; K + R'B_n/c of the other one by hand."""
    random = np.random.default_rng(7)
    A = random.normal(size=(6, 6))
    K, M, C = A @ A.T + 6 * np.eye(6), np.diag(random.uniform(1, 2, 6)), 0.01 * np.eye(6)
    B = random.normal(size=(4, 6))  # normal, tangential
    gap, drive, c = [-1.0, -1.0], [1.0, -1.0], 0.2
    model = write_matrices(tmp_path / "pairs", B, gap, drive, np.zeros(6), M=M, C=C, K=K)
    (model / "compliance.petsc").write_bytes(b"\x00\x12\x7b\x4e\x00\x00\x00\x02" + np.array([c, 0], ">f8").tobytes())
    scene = {"friction": {"coefficient": mu, "direction_damping": False}, "modes": {"band": 10}}
    run = converged(write_scene(tmp_path, matrices={"folder": "pairs"}, **scene), ranks=2)
    assert run.report["equilibrium"]["closed"] == 2
    rows = B.reshape(2, 2, 6)
    R = [normal + mu * np.sign(v) * tangent for (normal, tangent), v in zip(rows, drive)]
    with_spring = K + np.outer(R[0], rows[0][0]) / c
    # (lambda^2 M + lambda C + K) phi = R_1' r,  B_n,1 phi = 0: the rigid pair's kernel by svd, tested by R_1's
    Z, Y = scipy.linalg.null_space(rows[1][:1]), scipy.linalg.null_space(R[1][None])
    m, d, k = (Y.T @ X @ Z for X in (M, C, with_spring))
    companion = np.block([[np.zeros((5, 5)), np.eye(5)], [-np.linalg.solve(m, k), -np.linalg.solve(m, d)]])
    exact = [value for value in np.linalg.eigvals(companion) if value.imag > 1e-9]
    found = [complex(mode["growth_rate"], 2 * np.pi * mode["frequency_hz"]) for mode in run.report["modes"]["modes"]]
    assert len(found) == len(exact)
    for value in found:
        assert np.abs(np.array(exact) - value).min() < 1e-10 * abs(value)


def pin_modes(converged, compliance):
    run = converged(*PIN, "--set", "cycle.enabled=false", "--set", f"contact.0.compliance={compliance}", ranks=2)
    assert run.report["modes"]["count_certified_by"]
    return [complex(mode["growth_rate"], 2 * np.pi * mode["frequency_hz"]) for mode in run.report["modes"]["modes"]]


def test_a_vanishing_compliance_is_hard_contact_by_order_one(converged):
    rigid, *others = (pin_modes(converged, c) for c in (0, 1e-15, 1e-16))
    distance = [max(np.abs(np.array(modes) - value).min() for value in rigid) for modes in others]
    # the compliance beside that of the pin's lowest element, 5 mm of 5 GPa
    assert distance[0] < 1e-15 / (5e-3 / 5e9) * 10 * abs(rigid[-1])
    assert distance[0] / distance[1] == pytest.approx(10, rel=0.05)


def compare_fidelities(converged, *words):
    """The cycle of the pin by the reduced model and by the full one, in the same steps: only the basis differs. The
    reduced model says of itself that it is off by less than 1e-5 of the period and 1e-3 of the energy."""
    words = [*PIN, *words, "--set", "cycle.steps_per_period=64", "-cycle_multipliers", "0"]
    reduced, full = (converged(*words, "--set", f"fidelity={fidelity}", ranks=1).report for fidelity in ("reduced", "full"))
    assert reduced["fidelity"]["used"] == "reduced" and full["fidelity"]["used"] == "full"
    assert reduced["cycle"]["period"] == pytest.approx(full["cycle"]["period"], rel=1e-5)
    assert reduced["cycle"]["mean_fluctuating_energy"] == pytest.approx(full["cycle"]["mean_fluctuating_energy"], rel=5e-3)
    return full


def test_cycles_of_the_reduced_and_of_the_full_model_agree(converged):
    """At a compliance that is half of the lowest pin element's. One pair stays closed in the reduced model, others lift off."""
    full = compare_fidelities(converged, "--set", "damping.beta=7.5e-7", "--set", "contact.0.compliance=5e-13")
    assert full["cycle"]["open_pairs_max"] > 0


def test_a_negative_compliance_is_refused(squeal):
    run = squeal(*PIN, "--set", "contact.0.compliance=-1e-12", ranks=1)
    assert run.code == 1
    for part in ("compliance", "zero or a positive number"):
        assert part in str(run.messages)


def test_bad_files_are_refused(tmp_path, squeal):
    model = write_matrices(tmp_path / "pairs", [[0, 1], [1, 0]], [0], [1], [0, -1], M=np.eye(2), C=np.zeros((2, 2)), K=np.eye(2))
    scene = write_scene(tmp_path, matrices={"folder": "pairs"}, friction={"coefficient": 0.3})
    for values, part in (([1, 1], "length 2 for the 1 pairs"), ([-1], "entry 0 is -1")):
        (model / "compliance.petsc").write_bytes(b"\x00\x12\x7b\x4e" + len(values).to_bytes(4, "big") + np.array(values, ">f8").tobytes())
        run = squeal(scene, ranks=2)
        assert run.code == 1 and "compliance.petsc" in str(run.messages) and part in str(run.messages)
