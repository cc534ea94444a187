"""Damping, supports, forces and probes on matrix scenes, by row and by node: held against the same by hand."""

import itertools

import numpy as np
import pytest
from models import write_matrices, write_scene, write_sparse

B = np.array([[0, 1, -1.0, 0], [1, 0, 0, 0]])  # normal and tangential row of one pair
M = np.diag([1, 1, 0.5, 2])
K = np.array([[1.1, -0.1, 0, 0], [-0.1, 0.5, 0, 0], [0, 0, 1.2, -0.4], [0, 0, -0.4, 3]])
C = 0.02 * np.eye(4)
F = np.array([0, -1.0, 0, 0.1])
DOFS = "20 x\n20 y\n7 y\n1001 rx\n"


def folder(path, keep=(0, 1, 2, 3), **files):
    """The rows that are kept of the matrices, or others in their place."""
    cut = {"M": M, "K": K, **files}
    for name in cut:
        cut[name] = cut[name][np.ix_(keep, keep)] if np.ndim(cut[name]) == 2 else cut[name][list(keep)]
    load = cut.pop("F", np.zeros(len(keep)))
    write_matrices(path, B[:, list(keep)], [0.0], [0.6], load, **{"C": np.zeros_like(cut["M"]), **cut})
    return path


def eigenvalues(report):
    return [(mode["frequency_hz"], mode["growth_rate"]) for mode in report["modes"]["modes"]]


def test_by_hand_and_by_keys_are_the_same_model(converged, tmp_path):
    """Rayleigh damping, a support and forces in the scene, by row and by node, and all of them in the matrices."""
    alpha, beta, keep = 0.01, 0.02, (0, 1, 2)
    hand = folder(tmp_path / "hand", keep, F=F, C=alpha * M + beta * K)
    bare = folder(tmp_path / "bare")
    (bare / "C.petsc").unlink()
    (bare / "F.petsc").unlink()
    (bare / "dofs.txt").write_text(DOFS)
    base = {"friction": {"coefficient": 0.3}, "modes": {"band": 1}}
    damped = {**base, "damping": {"alpha": alpha, "beta": beta}}
    scenes = {
        "hand": {**base, "matrices": {"folder": "hand"}, "probe": [{"name": "p", "on": "dof:1"}]},
        "rows": {**damped, "matrices": {"folder": "bare"}, "probe": [{"name": "p", "on": "dof:1"}],
                 "support": [{"on": "dof:3", "fixed": "all"}], "force": [{"on": "dof:1", "vector": [-1, 0, 0]}]},
        "nodes": {**damped, "matrices": {"folder": "bare"}, "probe": [{"name": "p", "on": "node:20", "direction": "y"}],
                  "support": [{"on": "node:1000-1002", "fixed": "rx"}], "force": [{"on": "node:20", "vector": [0, -1, 0]}]},
    }
    found = {}
    for (name, scene), ranks in zip(scenes.items(), itertools.cycle((1, 2))):
        run = converged(write_scene(tmp_path, **scene), ranks=ranks)
        found[name] = [np.ravel(eigenvalues(run.report)), run.report["equilibrium"]["probes"]["p"],
                       run.report["equilibrium"]["normal_force_sum"]]
        assert run.report["model"]["dofs"] == 3
    assert len(found["hand"][0]) > 2
    for name in ("rows", "nodes"):
        for ours, theirs in zip(found[name], found["hand"]):
            np.testing.assert_allclose(ours, theirs, rtol=1e-12, atol=1e-14)


def test_bad_maps_and_names_are_refused(squeal, tmp_path):
    bare = folder(tmp_path / "bare")
    base = {"matrices": {"folder": "bare"}, "friction": {"coefficient": 0.3}}
    hold = {"support": [{"on": "node:7", "fixed": "all"}]}
    cases = [
        (None, hold, ["no dofs.txt", "tools/matrices"]),
        (DOFS, {"support": [{"on": "node:8", "fixed": "all"}]}, ["node 8"]),
        (DOFS, {"support": [{"on": "node:7", "fixed": "x"}]}, ["node:7", "no row for the motions"]),
        (DOFS, {"support": [{"on": "dof:0-3", "fixed": "all"}]}, ["hold every row"]),
        (DOFS, {"support": [{"on": "node:7,20", "fixed": "y"}]}, ["pair 0", "cannot move along its normal"]),
        (DOFS, {"force": [{"on": "node:7", "vector": [1, 0, 0]}]}, ["node:7", "motion x"]),
        ("20 x\n20 z z\n", {}, ["dofs.txt, line 2", "20 z z", "1017 x"]),
        ("20 x\n20 y\n20 x\n", {}, ["dofs.txt, line 3", "twice"]),
        ("20 x\n20 y\n", {}, ["dofs.txt", "2 lines", "4 rows"]),
    ]
    for dofs, keys, words in cases:
        (bare / "dofs.txt").unlink(missing_ok=True)
        if dofs is not None:
            (bare / "dofs.txt").write_text(dofs)
        run = squeal(write_scene(tmp_path, **base, **keys), "--dry-run", ranks=1)
        assert run.code == 1 and len(run.messages) == 1, run.errors
        for word in words:
            assert word in run.messages[0], run.messages[0]


def modes_of_matrices(run, folder, band, ranks, **matrices):
    """The report of the modes of matrices without pairs."""
    (folder / "m").mkdir()
    for name, A in matrices.items():
        write_sparse(folder / "m" / f"{name}.petsc", A)
    scene = write_scene(folder, matrices={"folder": "m"}, modes={"band": band}, estimate={"enabled": False})
    return run(scene, ranks=ranks).report["modes"]


def told(modes):
    """All eigenvalues of a report, ascending by imaginary and real part; conjugates are there once."""
    found = [complex(mode["growth_rate"], 2 * np.pi * mode["frequency_hz"]) for mode in modes["modes"]]
    return sorted(found + [complex(value) for value in modes["real_eigenvalues"]], key=lambda value: (value.imag, value.real))


def within(exact, band):
    exact = np.asarray(exact, complex)
    return sorted(exact[(exact.imag >= 0) & (abs(exact) < 2 * np.pi * band)], key=lambda value: (value.imag, value.real))


@pytest.mark.parametrize("stiffness, damping", [((-1.0, 4, 9), (0.01, 0.01, 0.01)), ((1.0, 4, 9), (10, 0.01, 0.01)), ((-1.0, -4, 9), (10, 0.01, 12))])
@pytest.mark.parametrize("ranks", [1, 2])
def test_divergence_and_overdamped_motion_are_listed(converged, tmp_path, stiffness, damping, ranks):
    """Single masses: lambda^2 + c lambda + k = 0. All are found, since the problem is solved whole."""
    modes = modes_of_matrices(converged, tmp_path, 3.0, ranks, M=np.eye(3), C=np.diag(damping), K=np.diag(stiffness))
    exact = np.concatenate([np.roots([1, c, k]) for c, k in zip(damping, stiffness)])
    np.testing.assert_allclose(told(modes), within(exact, 3.0), rtol=1e-12)
    assert modes["unstable_count"] == sum(k < 0 for k in stiffness) and modes["count_certified_by"] == "all pairs"


@pytest.mark.parametrize("circulatory", [0.0, 300.0])
def test_large_matrices_whose_stiffness_is_indefinite(converged, tmp_path, circulatory):
    """A chain on negative springs, with a skew part between its ends: every eigenvalue of the band by dense algebra. No count
    certifies them."""
    n, band = 450, 8.0
    K = 1e4 * (2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)) - 300 * np.eye(n)
    K[0, -1], K[-1, 0] = circulatory, -circulatory
    modes = modes_of_matrices(converged, tmp_path, band, 2, M=np.eye(n), C=3 * np.eye(n), K=K)
    exact = np.linalg.eigvals(np.block([[np.zeros((n, n)), np.eye(n)], [-K, -3 * np.eye(n)]]))
    exact = within(np.where(abs(exact.imag) < 1e-9, exact.real, exact), band)
    assert sum(value.real > 0 for value in exact) > 10
    np.testing.assert_allclose(told(modes), exact, rtol=1e-7)
    assert modes["count_certified_by"] is None and "cannot count" in modes["count_check"]
