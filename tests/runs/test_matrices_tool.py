"""tools/matrices: what goes around comes around, and what does not fit is refused in one sentence."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sparse

TOOL = Path(__file__).resolve().parents[2] / "tools" / "matrices"
NAMES = ("M", "C", "K", "B", "F", "gap", "drive", "compliance")


def convert(*arguments):
    return subprocess.run([sys.executable, TOOL, *map(str, arguments)], capture_output=True, text=True)


def model(n=12, pairs=3, tangential=2):
    random = np.random.default_rng(7)
    half = sparse.random(n, n, 0.3, random_state=8)
    K = (half + half.T + 10 * sparse.eye(n)).tocsr() / 3  # thirds: every digit is needed
    B = sparse.random((1 + tangential) * pairs, n, 0.4, random_state=9).tocsr()
    return {"M": sparse.eye(n).tocsr() * 0.1, "C": 1e-7 * K, "K": K, "B": B, "F": random.normal(size=n),
            "gap": random.normal(size=pairs), "drive": random.normal(size=tangential * pairs),
            "compliance": random.uniform(size=pairs) * 1e-9}


def save(folder, arrays):
    folder.mkdir()
    for name, array in arrays.items():
        if sparse.issparse(array):
            sparse.save_npz(folder / f"{name}.npz", array)
        else:
            np.save(folder / f"{name}.npy", array)
    return folder


@pytest.mark.parametrize("tangential", [1, 2])
def test_round_trip_keeps_every_byte(tmp_path, tangential):
    save(tmp_path / "a", model(tangential=tangential))
    path = [("a", "b", "petsc"), ("b", "c", "mtx"), ("c", "d", "petsc"), ("d", "e", "npz"), ("e", "f", "petsc")]
    for source, target, kind in path:
        done = convert(tmp_path / source, tmp_path / target, "--to", kind)
        assert done.returncode == 0, done.stderr
    for name in NAMES:
        first = (tmp_path / "b" / f"{name}.petsc").read_bytes()
        assert first == (tmp_path / "d" / f"{name}.petsc").read_bytes()
        assert first == (tmp_path / "f" / f"{name}.petsc").read_bytes()


def test_petsc_layout_is_the_documented_one(tmp_path):
    arrays = model(n=2, pairs=1, tangential=1)
    arrays["K"] = sparse.csr_matrix([[2.0, -1.0], [-1.0, 3.0]])
    arrays["gap"] = np.array([0.5])
    assert convert(save(tmp_path / "a", arrays), tmp_path / "b").returncode == 0
    ints = np.array([1211216, 2, 2, 4, 2, 2, 0, 1, 0, 1], ">i4").tobytes()
    assert (tmp_path / "b" / "K.petsc").read_bytes() == ints + np.array([2, -1, -1, 3], ">f8").tobytes()
    gap = np.array([1211214, 1], ">i4").tobytes() + np.array([0.5], ">f8").tobytes()
    assert (tmp_path / "b" / "gap.petsc").read_bytes() == gap


def test_a_bundle_of_dense_arrays_is_the_same_model(tmp_path):
    arrays = model()
    np.savez(tmp_path / "all.npz", **{k: v.toarray() if sparse.issparse(v) else v for k, v in arrays.items()})
    assert convert(tmp_path / "all.npz", tmp_path / "b").returncode == 0
    assert convert(save(tmp_path / "a", arrays), tmp_path / "c").returncode == 0
    for name in NAMES:
        assert (tmp_path / "b" / f"{name}.petsc").read_bytes() == (tmp_path / "c" / f"{name}.petsc").read_bytes()


def unsymmetric(arrays):
    K = arrays["K"].tolil()
    K[0, 1] += 1
    return {"K": K.tocsr()}


@pytest.mark.parametrize(
    "change, message",
    [
        (lambda a: {"F": a["F"][:-1]}, "F has 11 entries, M has 12 rows"),
        (lambda a: {"C": a["C"][:5, :5]}, "C is 5 x 5"),
        (lambda a: {"B": a["B"][:-1]}, "B has 8 rows, gap 3 entries"),
        (lambda a: {"B": a["B"][:, :4]}, "B has 4 columns"),
        (lambda a: {"drive": a["drive"][:4]}, "drive has 4 entries"),
        (lambda a: {"compliance": a["compliance"][:2]}, "compliance has 2 entries, gap 3"),
        (lambda a: {"gap": np.array([np.nan, 0, 0])}, "not finite"),
        (lambda a: {"K": a["K"] * 1j}, "K is not real"),
        (unsymmetric, "K is not symmetric"),
        (lambda a: {"gap": np.eye(3)}, "gap is a vector"),
    ],
)
def test_what_does_not_fit_is_refused_and_nothing_is_written(tmp_path, change, message):
    arrays = model()
    done = convert(save(tmp_path / "a", {**arrays, **change(arrays)}), tmp_path / "b")
    assert done.returncode == 1
    assert message in done.stderr and done.stderr.count("\n") == 1
    assert not (tmp_path / "b").exists()


def test_truncated_and_missing_files_are_named(tmp_path):
    assert convert(save(tmp_path / "a", model()), tmp_path / "b").returncode == 0
    file = tmp_path / "b" / "K.petsc"
    whole = file.read_bytes()
    for wrong, message in ((whole[:-3], "truncated"), (whole + b"x", "follow the end"), (b"text, not PETSc", "not a PETSc")):
        file.write_bytes(wrong)
        done = convert(tmp_path / "b", tmp_path / "c", "--to", "mtx")
        assert done.returncode == 1 and "K.petsc" in done.stderr and message in done.stderr
    file.unlink()
    assert "no file for K" in convert(tmp_path / "b", tmp_path / "c").stderr
    assert "there is no folder" in convert(tmp_path / "nowhere", tmp_path / "c").stderr
    assert "a file is in the way" in convert(tmp_path / "a", tmp_path / "a" / "gap.npy").stderr


def test_a_compliance_needs_pairs(tmp_path):
    arrays = {name: array for name, array in model().items() if name in ("M", "K", "compliance")}
    done = convert(save(tmp_path / "a", arrays), tmp_path / "b")
    assert done.returncode == 1 and "compliance is that of contact pairs" in done.stderr


def test_the_units_of_a_compliance(tmp_path):
    """In mm and kN: 1 mm/kN is 1e-6 m/N."""
    arrays = model(n=4, pairs=1)
    save(tmp_path / "a", arrays)
    lines = [f'{name} = "a/{name}.np{"z" if sparse.issparse(array) else "y"}"' for name, array in arrays.items()]
    (tmp_path / "dofs.txt").write_text("1 x\n1 y\n2 x\n2 y\n")
    (tmp_path / "model.toml").write_text("\n".join([*lines, 'dofs = "dofs.txt"', "length = 1e-3", "force = 1e3", ""]))
    done = convert(tmp_path / "model.toml", tmp_path / "b", "--to", "npz")
    assert done.returncode == 0, done.stderr
    np.testing.assert_allclose(np.load(tmp_path / "b" / "compliance.npy"), 1e-6 * arrays["compliance"], rtol=1e-15)


def test_what_a_model_before_had_is_removed(tmp_path):
    """Of the files that the tool writes; others stay, and those of a model that is refused."""
    arrays, out = model(), tmp_path / "out"
    for name in ("M", "K"):
        arrays[name] = arrays[name].toarray()
    save(tmp_path / "a", arrays)
    (tmp_path / "a" / "dofs.txt").write_text("".join(f"{node} {motion}\n" for node in range(1, 5) for motion in "xyz"))
    (tmp_path / "a" / "nodes.txt").write_text("".join(f"{node} {node} 0 0\n" for node in range(1, 5)))
    assert convert(tmp_path / "a", out).returncode == 0
    (out / "notes.txt").write_text("mine")
    before = {file.name: file.read_bytes() for file in out.iterdir()}
    assert len(before) == len(NAMES) + 3
    save(tmp_path / "bad", {"M": arrays["M"], "K": arrays["K"][:5]})
    assert convert(tmp_path / "bad", out).returncode == 1
    assert {file.name: file.read_bytes() for file in out.iterdir()} == before
    save(tmp_path / "less", {"M": arrays["M"], "K": arrays["K"]})
    assert convert(tmp_path / "less", out).returncode == 0
    assert sorted(file.name for file in out.iterdir()) == ["K.petsc", "M.petsc", "notes.txt"]


def test_what_is_read_is_never_written_over_or_removed(tmp_path):
    folder = save(tmp_path / "a", model())
    before = {file.name: file.read_bytes() for file in folder.iterdir()}
    done = convert(folder, folder, "--to", "npz")
    assert done.returncode == 1 and "M.npz is read" in done.stderr and "another folder" in done.stderr
    (folder / "model.toml").write_text('K = "K.npz"\nM = "M.npz"\ndofs = "dofs.txt"\n')
    (folder / "dofs.txt").write_text("".join(f"{node} x\n" for node in range(12)))
    done = convert(folder / "model.toml", folder)
    assert done.returncode == 1 and "dofs.txt is read" in done.stderr
    assert {name: (folder / name).read_bytes() for name in before} == before and not list(folder.glob("*.petsc"))
