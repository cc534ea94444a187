"""Laws of friction and of materials in whole runs: falling friction, orthotropic parts, loss factors."""

import re

import numpy as np
import pytest
from conftest import INPUTS
from models import Mesh, STEEL, bricks, lattice, quads, write_matrices, write_scene

OSCILLATOR = [INPUTS / "oscillator" / "scene.toml", "--set", "friction.coefficient=0.25", "--set",
              "friction.static_coefficient=0.4", "--set", "friction.decay_speed=0.5", "--set", "cycle.steps_per_period=200"]
PIN = [INPUTS / "pin_on_disc" / "scene.toml", "--set", "mesh.parameters.divisions=2", "--set", "damping.beta=6e-7",
       "--set", "friction.static_coefficient=0.35", "--set", "friction.decay_speed=1",
       "--set", "cycle.steps_per_period=64", "--set", "modes.method=full", "-cycle_multipliers", "0"]


def test_falling_friction_gives_the_same_cycle_on_two_ranks(converged):
    cycles = [converged(*OSCILLATOR, ranks=ranks).report["cycle"] for ranks in (1, 2)]
    for other in cycles[1:]:  # rounding, times what a period's contact tolerance of 1e-10 becomes at a residual of 1e-8
        assert other["period"] == pytest.approx(cycles[0]["period"], rel=1e-8)
        assert other["mean_energy"] == pytest.approx(cycles[0]["mean_energy"], rel=1e-7)
    assert cycles[0]["stick_pairs_max"] == 1


def test_falling_friction_closes_the_energy_identity_of_a_run(converged):
    transient = converged(*OSCILLATOR, "--set", "cycle.enabled=false", ranks=1).report["transient"]
    assert transient["energy_defect_max"] < 1e-12


def test_the_reduced_model_follows_falling_friction(converged):
    """The step is the same, so that only the basis differs; the estimate of the model's own error is 1e-3 at most."""
    full, reduced = (converged(*PIN, "--set", f"fidelity={fidelity}", ranks=1).report["cycle"]
                     for fidelity in ("full", "reduced"))
    constant = converged(*PIN, "--set", "fidelity=reduced", "--set", "friction.static_coefficient=0", "--set",
                         "friction.decay_speed=0", ranks=1).report["cycle"]
    assert reduced["period"] == pytest.approx(full["period"], rel=1e-4)
    assert reduced["mean_fluctuating_energy"] == pytest.approx(full["mean_fluctuating_energy"], rel=5e-3)
    assert abs(constant["mean_fluctuating_energy"] / full["mean_fluctuating_energy"] - 1) > 0.02  # the law matters


def test_a_refused_run_names_steps_that_are_not_refused(squeal):
    scene = [*OSCILLATOR, "--set", "friction.decay_speed=0.001", "--set", "cycle.enabled=false", "--set",
             "transient.periods=1"]
    refused = squeal(*scene, "--set", "transient.steps_per_period=20", ranks=1)
    assert refused.code == 2
    outcome = refused.report["transient"]
    assert outcome["outcome"] == "refused"
    steps = int(re.search(r"(\d+) steps a period would do", outcome["reason"])[1])
    run = squeal(*scene, "--set", f"transient.steps_per_period={steps}", ranks=1)
    assert run.report["transient"]["outcome"] != "refused"


def bar(folder, angle, **tables):
    """A slender bar of bricks along x, held in y and z at its sides so that it moves along x alone where its axes are
    its own, clamped at one end."""
    folder.mkdir(exist_ok=True)
    mesh = Mesh()
    nodes = mesh.add_nodes(lattice([20, 1, 1], lambda x, y, z: (x, 0.01 * y, 0.01 * z)))
    mesh.add("bar", "brick", bricks(nodes))
    mesh.add("end", "quad", quads(nodes[0]))
    mesh.write(folder / "bar.msh")
    c, s = float(np.cos(angle)), float(np.sin(angle))
    material = {"young": [12e9, 8e9, 2e9], "poisson": [0.0, 0.0, 0.0], "shear": [3e9, 2e9, 1e9], "axis_1": [c, s, 0.0],
                "axis_2": [-s, c, 0.0]}
    return write_scene(folder, mesh={"file": "bar.msh"}, part=[{"name": "bar", "density": 2000.0, "orthotropic": material}],
                       support=[{"on": "end", "fixed": "x y z"}], modes={"method": "full", "band": 3000}, **tables)


def test_an_orthotropic_bar_vibrates_along_either_of_its_axes(converged, tmp_path):
    """f = sqrt(E/rho)/(4 L); linear elements are off by (k h)^2/24 = 2.6e-4, and the mode must be the one along x."""
    for angle, modulus in ((0, 12e9), (np.pi / 2, 8e9)):
        report = converged(bar(tmp_path / f"{modulus:g}", angle), ranks=1).report
        exact = np.sqrt(modulus / 2000) / 4
        nearest = min((mode["frequency_hz"] for mode in report["modes"]["modes"]), key=lambda f: abs(f - exact))
        assert nearest == pytest.approx(exact, rel=5e-4)


def lossy_bar(folder, eta):
    folder.mkdir(exist_ok=True)
    mesh = Mesh()
    nodes = mesh.add_nodes(lattice([10, 2, 2], lambda x, y, z: (x, 0.1 * y, 0.13 * z)))
    mesh.add("bar", "brick", bricks(nodes))
    mesh.add("end", "quad", quads(nodes[0]))
    mesh.write(folder / "bar.msh")
    part = {"name": "bar", **STEEL}
    tables = {"damping": {"loss_frequency": 700.0}} if eta else {}
    return write_scene(folder, mesh={"file": "bar.msh"}, part=[{**part, "loss_factor": eta} if eta else part],
                       support=[{"on": "end", "fixed": "x y z"}], modes={"band": 3000}, **tables)


@pytest.mark.parametrize("ranks", [1, 2])
def test_a_loss_factor_is_complex_stiffness_at_every_mode(converged, tmp_path, ranks):
    """lambda = i w sqrt(1 + i eta)"""
    eta = 0.06
    plain, lossy = (converged(lossy_bar(tmp_path / f"{e}", e), ranks=ranks).report["modes"]["modes"] for e in (0, eta))
    w = 2 * np.pi * np.sort([mode["frequency_hz"] for mode in plain])
    lossy = sorted(lossy, key=lambda mode: mode["frequency_hz"])
    assert len(w) == len(lossy) > 5
    exact = 1j * w * np.sqrt(1 + 1j * eta)
    for mode, value in zip(lossy, exact):
        assert abs(2 * np.pi * mode["frequency_hz"] * 1j + mode["growth_rate"] - value) < 1e-9 * abs(value)


@pytest.mark.parametrize("ranks", [1, 2])
def test_modes_of_matrices_alone_have_the_skew_parts_of_all_files(converged, tmp_path, ranks):
    """An unsymmetric K and C, and G and H beside them: the pairs of the companion matrix of their sums."""
    random = np.random.default_rng(3)
    skew = [np.triu(random.uniform(-1, 1, (6, 6)), 1) for _ in range(4)]
    skew = [part - part.T for part in skew]
    K, C, M = np.diag(np.linspace(20, 60, 6)), 0.1 * np.eye(6), np.diag(np.linspace(1, 2, 6))
    folder = write_matrices(tmp_path / "matrices", B=np.ones((2, 6)), gap=[0], drive=[1], F=np.zeros(6), M=M,
                            C=C + 0.3 * skew[0], K=K + 4 * skew[1], G=0.2 * skew[2], H=3 * skew[3])
    for name in ("B", "gap", "drive"):
        (folder / f"{name}.petsc").unlink()
    report = converged(write_scene(tmp_path, matrices={"folder": "matrices"}, modes={"band": 10}), ranks=ranks).report
    all_of_C, all_of_K = C + 0.3 * skew[0] + 0.2 * skew[2], K + 4 * skew[1] + 3 * skew[3]
    inverse = np.linalg.inv(M)
    exact = np.linalg.eigvals(np.block([[-inverse @ all_of_C, -inverse @ all_of_K], [np.eye(6), np.zeros((6, 6))]]))
    exact = sorted(exact[exact.imag > 0], key=lambda value: -value.real)
    found = [mode["growth_rate"] + 2j * np.pi * mode["frequency_hz"] for mode in report["modes"]["modes"]]
    assert np.allclose(found, exact, rtol=1e-11, atol=0)
    assert report["modes"]["count_certified_by"] == "all pairs" and report["modes"]["unstable_count"] > 0
    assert report["estimate"]["outcome"] == "skipped"
