"""tools/matrices: every format of other codes gives the eigenvalues of dense algebra, and bad files are refused with file,
line and what was expected."""

import subprocess
import sys

import h5py
import numpy as np
import pytest
import scipy.io
import scipy.linalg
import scipy.sparse as sparse
from conftest import ROOT, load_tool
from output4_files import OP4_FILES

MATRICES = load_tool("matrices")
NODES = np.array([7, 11, 12, 40, 41, 1000])
LABELS = np.array([(node, dof) for node in NODES for dof in (1, 2, 3)])
N = len(LABELS)
POSITIONS = np.array([[0, 0, 0.0], [1, 0, 0], [0, 1, 0], [0, 0, 0], [1, 0, 0.02], [0, 1, 0]])


def spring_model():
    """A positive definite K with thirds, so that every digit is needed, and an M that is not diagonal."""
    half = sparse.random(N, N, 0.3, random_state=5).toarray()
    K = 1e7 * (half @ half.T + np.eye(N)) / 3
    quarter = sparse.random(N, N, 0.1, random_state=6).toarray()
    return {"K": K, "M": 0.1 * (quarter @ quarter.T + np.eye(N))}


def eigenvalues(model):
    dense = {name: A.toarray() if sparse.issparse(A) else A for name, A in model.items()}
    return scipy.linalg.eigh(dense["K"], dense["M"], eigvals_only=True)


def lower(A):
    return [(i, j, A[i, j]) for j in range(N) for i in range(j, N) if A[i, j] != 0]


# ---- writers, each as its code writes


def abaqus(folder, model):
    for name, A in model.items():
        lines = [f"{LABELS[i][0]},{LABELS[i][1]}, {LABELS[j][0]},{LABELS[j][1]}, {v:.16e}" for i, j, v in lower(A)]
        (folder / f"{name}.mtx").write_text("** MATRIX INPUT\n" + "\n".join(lines) + "\n")
    return {}


def abaqus_coordinate(folder, model):
    for name, A in model.items():
        (folder / f"{name}.mtx").write_text("".join(f"{i + 1:8d} {j + 1:8d} {v:25.16e}\n" for i, j, v in lower(A)))
    return {"dofs": listed(folder)}


def listed(folder):
    (folder / "dofs.csv").write_text("".join(f"{node}, {'xyz'[dof - 1]}\n" for node, dof in LABELS))
    return "dofs.csv"


def calculix(folder, model):
    """*FREQUENCY, SOLVER=MATRIXSTORAGE: the upper triangle with numbers from 1, and node.dof of each row."""
    for name, ending in (("K", "sti"), ("M", "mas")):
        (folder / f"job.{ending}").write_text("".join(f"{j + 1} {i + 1} {v:.20e}\n" for i, j, v in lower(model[name])))
    (folder / "job.dof").write_text("".join(f"{node}.{dof}\n" for node, dof in LABELS))
    return {"K": "job.sti", "M": "job.mas", "dofs": "job.dof"}


def dmig(folder, model):
    """Columns of the lower triangle in Nastran's large fields; their values have Fortran's exponents."""
    text = ""
    for name, A in model.items():
        text += f"{'DMIG':8}{name + 'AAX':8}{0:8d}{6:8d}{2:8d}{0:8d}{'':8}{'':8}{N:8d}\n"
        for j in range(N):
            text += f"{'DMIG*':8}{name + 'AAX':16}{LABELS[j][0]:16d}{LABELS[j][1]:16d}\n"
            for i in range(j, N):
                if A[i, j] != 0:
                    value = f"{A[i, j]:.9E}".replace("E", "D")
                    text += f"{'*':8}{LABELS[i][0]:16d}{LABELS[i][1]:16d}{value:>16}\n"
                    A[i, j] = A[j, i] = float(f"{A[i, j]:.9E}")  # ten digits are all that a field holds
    (folder / "both.pch").write_text("$ punched\n" + text)
    return {"K": "both.pch:KAAX", "M": "both.pch:MAAX"}


def dmig_loads(folder, model):
    keys = dmig(folder, model)
    with open(folder / "both.pch", "a") as file:
        file.write("DMIG,FX,0,9,1,0,,,2\n" + "".join(f"DMIG,FX,{case},0,,7,1,{case}.5\n" for case in (1, 2)))
    return {**keys, "F": "both.pch:FX"}


def harwell_boeing(folder, model):
    """As HBMAT: pointers, rows and values of the lower triangle in fixed fields, and a mapping."""
    for name, A in model.items():
        entries = lower(A)
        starts = np.concatenate([[1], 1 + np.cumsum([sum(j == k for _, j, _ in entries) for k in range(N)])])
        blocks = [(starts, 8, "{:10d}"), ([i + 1 for i, _, _ in entries], 8, "{:10d}"), ([v for *_, v in entries], 3, "{:25.16E}"),
                  (np.arange(N) / 7, 3, "{:25.16E}")]
        texts = ["".join(form.format(v) + ("\n" if (k + 1) % per == 0 or k + 1 == len(values) else "")
                         for k, v in enumerate(values)) for values, per, form in blocks]
        counts = [text.count("\n") for text in texts]
        head = f"{name:72}KEY\n" + "".join(f"{c:14d}" for c in [sum(counts), *counts]) + "\n"
        head += f"{'RSA':14}{N:14d}{N:14d}{len(entries):14d}{0:14d}\n"
        head += f"{'(8I10)':16}{'(8I10)':16}{'(3E25.16)':20}{'(3E25.16)':20}\n" + f"{'F':14}{1:14d}{0:14d}\n"
        (folder / f"{name}.hb").write_text(head + "".join(texts))
    rows = "".join(f"{i + 1:12d}{node:12d}   {'UX UY UZ'.split()[dof - 1]}\n" for i, (node, dof) in enumerate(LABELS))
    (folder / "model.mapping").write_text("   Matrix Eqn        Node   DOF\n" + rows)
    return {"K": "K.hb", "M": "M.hb", "F": "K.hb:RHS", "dofs": "model.mapping"}


def op4(folder, model):
    """Binary, dense, double precision, both matrices in one file."""
    data = b""
    for name, A in model.items():
        def record(*parts):
            body = b"".join(np.array(part, "<i4").tobytes() if kind == "i" else np.array(part, "<f8").tobytes()
                            for kind, part in parts)
            return np.array([len(body)], "<i4").tobytes() + body + np.array([len(body)], "<i4").tobytes()
        head = np.array([N, N, 6, 2], "<i4").tobytes() + f"{name}GG".ljust(8).encode()
        data += np.array([24], "<i4").tobytes() + head + np.array([24], "<i4").tobytes()
        for j in range(N):
            data += record(("i", [j + 1, 1, 2 * N]), ("f", A[:, j]))
        data += record(("i", [N + 1, 1, 2]), ("f", [1.0]))
    (folder / "both.op4").write_bytes(data)
    return {"K": "both.op4:KGG", "M": "both.op4:MGG", "dofs": listed(folder)}


def code_aster(folder, model):
    """numpy.savez of EXTR_MATR(sparse=True): values, rows, columns, size; the lower triangle."""
    for name, A in model.items():
        i, j, v = zip(*lower(A))
        np.savez(folder / f"{name}.npz", np.array(v), np.array(i), np.array(j), N)
    (folder / "dofs.txt").write_text("".join(f"N{node} {'DX DY DZ'.split()[dof - 1]}\n" for node, dof in LABELS))
    return {"K": "K.npz", "M": "M.npz", "dofs": "dofs.txt"}


def code_aster_dense(folder, model):
    for name, A in model.items():
        np.save(folder / f"{name}.npy", A)
    return {"K": "K.npy", "M": "M.npy"}


def matlab(folder, model):
    scipy.io.savemat(folder / "model.mat", {name: sparse.csc_matrix(A) for name, A in model.items()})
    return {"K": "model.mat:K", "M": "model.mat:M"}


def matlab_73(folder, model):
    """HDF5: a sparse matrix is a group of columns, a dense one is transposed."""
    with h5py.File(folder / "model.mat", "w") as file:
        K = sparse.csc_matrix(model["K"])
        group = file.create_group("K")
        group.attrs["MATLAB_sparse"] = np.uint64(N)
        for key, value in (("data", K.data), ("ir", K.indices.astype(np.uint64)), ("jc", K.indptr.astype(np.uint64))):
            group[key] = value
        file["M"] = model["M"].T
    return {"K": "model.mat:K", "M": "model.mat:M"}


def matrix_market(folder, model):
    for name, A in model.items():
        scipy.io.mmwrite(folder / f"{name}.mtx", sparse.coo_matrix(A), precision=17, symmetry="symmetric")
    return {}


def npz(folder, model):
    for name, A in model.items():
        sparse.save_npz(folder / f"{name}.npz", sparse.csr_matrix(A))
    return {"K": "K.npz", "M": "M.npz"}


def describe(folder, keys, extra=""):
    keys = {"K": "K.mtx", "M": "M.mtx", **keys}
    file = folder / "model.toml"
    file.write_text("".join(f'{key} = "{value}"\n' for key, value in keys.items()) + extra)
    return file


FORMATS = [abaqus, abaqus_coordinate, calculix, dmig, harwell_boeing, op4, code_aster, code_aster_dense, matlab, matlab_73,
           matrix_market, npz]
NAMED = (abaqus, abaqus_coordinate, calculix, dmig, harwell_boeing, op4, code_aster)


@pytest.mark.parametrize("write", FORMATS, ids=lambda f: f.__name__)
def test_every_format_gives_the_eigenvalues_of_dense_algebra(tmp_path, write):
    model = spring_model()
    keys = write(tmp_path, model)  # DMIG rounds the model to its digits
    found, labels, *_ = MATRICES.read_model(describe(tmp_path, keys))
    for name in "MK":
        np.testing.assert_allclose(found[name].toarray(), model[name], rtol=1e-15, atol=0)
    np.testing.assert_allclose(eigenvalues({k: found[k] for k in "MK"}), eigenvalues(model), rtol=1e-10)
    assert (labels is not None) == (write in NAMED)
    if labels is not None:
        assert (labels == LABELS).all()
    if "F" in keys:
        np.testing.assert_allclose(found["F"], np.arange(N) / 7, rtol=1e-15)
    MATRICES.write_files(tmp_path / "out", "petsc", found, labels, {})
    again, again_labels, *_ = MATRICES.read_model(tmp_path / "out")
    assert all((again[name] != found[name]).nnz == 0 for name in "MK")
    assert labels is None or (again_labels == labels).all()


@pytest.mark.parametrize("kind", OP4_FILES)
def test_output4_in_all_its_forms(tmp_path, kind):
    content = OP4_FILES[kind]
    file = tmp_path / "k.op4"
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    found = MATRICES.matrix_files.read_array(file, None, False).toarray()
    assert (found == [[4, -1, 0], [-1, 3, 1 / 3], [0, 1 / 3, 2]]).all()
    if isinstance(content, bytes):
        file.write_bytes(content[:-9])
        with pytest.raises(MATRICES.Problem, match="k.op4: truncated"):
            MATRICES.matrix_files.read_array(file, None, False)


# ---- pairs, supports, units


PAIRS = "rotor, stator, gap\n7, 40, 0\n11, 41, 0.5\n12, 1000, 0\n"
CONTACT = '''
[[contact]]
pairs = "pairs.csv"
normal = "z"
rotation = { axis = "z", centre = [0, 0, 0], rate = 2 }
'''


def nodes_file(folder, scale=1.0):
    lines = [f"{node}, {x}, {y}, {z}\n" for node, (x, y, z) in zip(NODES, scale * POSITIONS)]
    (folder / "nodes.inp").write_text("*HEADING\nx\n*NODE, NSET=ALL\n" + "".join(lines))


def contact_model(tmp_path, pairs, extra=CONTACT, **keys):
    model = spring_model()
    given = abaqus(tmp_path, model)
    nodes_file(tmp_path)
    (tmp_path / "pairs.csv").write_text(pairs)
    return MATRICES.read_model(describe(tmp_path, {**given, "nodes": "nodes.inp", **keys}, extra))


def row_of(node, dof):
    return int(np.flatnonzero((LABELS == (node, dof)).all(axis=1))[0])


def test_pairs_of_nodes_become_the_rows_of_contact(tmp_path):
    """Rotors 7, 11, 12 at (0,0), (1,0), (0,1) turn about z: velocities 0, 2 y, -2 x; tangents follow, then n x t."""
    found, labels, *_ = contact_model(tmp_path, PAIRS.replace("11, 41, 0.5", "11, 41, 0.25"))
    B = found["B"].toarray()
    expected = np.zeros((9, N))
    tangents = [(1, 0, 0), (0, 1, 0)], [(0, 1, 0), (-1, 0, 0)], [(-1, 0, 0), (0, -1, 0)]
    for pair, (rotor, stator, axes) in enumerate(zip((7, 11, 12), (40, 41, 1000), tangents)):
        for k, axis in enumerate([(0, 0, 1), *axes]):
            for c in range(3):
                expected[3 * pair + k, row_of(stator, c + 1)] += axis[c]
                expected[3 * pair + k, row_of(rotor, c + 1)] -= axis[c]
    assert (B == expected).all()
    assert (found["gap"] == [0, 0.25, 0]).all()
    assert (found["drive"] == [0, 0, 2, 0, 2, 0]).all()


def test_gap_and_normal_come_from_positions_and_lists(tmp_path):
    found, *_ = contact_model(tmp_path, "7 40\n11 41\n12 1000\n")
    np.testing.assert_allclose(found["gap"], [0, 0.02, 0], rtol=1e-14)
    plane = CONTACT.replace('normal = "z"\n', 'tangents = ["x"]\n')
    found, *_ = contact_model(tmp_path, "7 40 0 0.6 0.8 1e-4 1e-3\n", plane)
    assert found["B"].shape == (2, N) and (found["gap"] == [1e-3]).all()
    np.testing.assert_allclose(found["B"].toarray()[0, [row_of(40, 2), row_of(40, 3), row_of(7, 3)]], [0.6, 0.8, -0.8])


def test_penalties_are_supports(tmp_path):
    """Abaqus adds 1e36 to held motions: the eigenvalues are those of the matrices without these rows."""
    model = spring_model()
    held = [row_of(1000, dof) for dof in (1, 2, 3)] + [row_of(7, 2)]
    free = np.setdiff1d(np.arange(N), held)
    expected = eigenvalues({name: A[np.ix_(free, free)] for name, A in model.items()})
    model["K"][held, held] += 1e36
    found, labels, notes, _ = MATRICES.read_model(describe(tmp_path, abaqus(tmp_path, model)))
    np.testing.assert_allclose(eigenvalues({k: found[k] for k in "MK"}), expected, rtol=1e-10)
    assert (labels == LABELS[free]).all() and "4 rows held" in notes[0]


def test_lagrange_multipliers_that_hold_one_motion_are_supports(tmp_path):
    model = spring_model()
    held, factor = row_of(40, 3), 2.5e6
    free = np.setdiff1d(np.arange(N), [held])
    expected = eigenvalues({name: A[np.ix_(free, free)] for name, A in model.items()})
    big = {name: np.zeros((N + 2, N + 2)) for name in "MK"}  # Code_Aster has two multipliers a condition
    for name in "MK":
        big[name][:N, :N] = model[name]
    big["K"][held, N:] = big["K"][N:, held] = factor
    big["K"][N:, N:] = [[-factor, factor], [factor, -factor]]
    for name in "MK":
        np.save(tmp_path / f"{name}.npy", big[name])
    (tmp_path / "dofs.txt").write_text("".join(f"{n} {d}\n" for n, d in LABELS) + "40 LAGR1\n40 LAGR2\n")
    found, labels, *_ = MATRICES.read_model(describe(tmp_path, {"K": "K.npy", "M": "M.npy", "dofs": "dofs.txt"}))
    np.testing.assert_allclose(eigenvalues({k: found[k] for k in "MK"}), expected, rtol=1e-10)


def test_units_of_the_files(tmp_path):
    """N, mm, s, t: K in N/mm and M in t are 1e-3 of N/m and kg; of rotations (here the third dof) N mm and t mm2."""
    model = spring_model()
    scale = np.array([1e-3 if dof < 3 else 1 for _, dof in LABELS])  # q in mm and rad = q in m and rad over this
    foreign = {name: 1e3 * A * np.outer(scale, scale) for name, A in model.items()}
    for name in "MK":
        np.save(tmp_path / f"{name}.npy", foreign[name])
    np.savetxt(tmp_path / "F.txt", [(node, dof if dof < 3 else 4, 5.0) for node, dof in LABELS], fmt="%d %d %g")
    (tmp_path / "dofs.txt").write_text("".join(f"{n} {d if d < 3 else 'rx'}\n" for n, d in LABELS))
    keys = {"K": "K.npy", "M": "M.npy", "F": "F.txt", "dofs": "dofs.txt"}
    found, labels, *_ = MATRICES.read_model(describe(tmp_path, keys, "length = 0.001\n"))
    for name in "MK":
        np.testing.assert_allclose(found[name].toarray(), model[name], rtol=1e-14)
    np.testing.assert_allclose(found["F"], [5.0 if dof < 3 else 5e-3 for _, dof in LABELS], rtol=1e-14)


# ---- bad files


def changed(file, old, new):
    def change(folder):
        text = (folder / file).read_text()
        assert old in text
        (folder / file).write_text(text.replace(old, new, 1))
    return change


def petsc(folder, model):
    for name, A in model.items():
        MATRICES.write_petsc(folder / f"{name}.petsc", sparse.csr_matrix(A))
    return {"K": "K.petsc", "M": "M.petsc"}


def far_index(file):
    data = bytearray(file.read_bytes())
    data[4 * (4 + N) : 4 * (5 + N)] = np.array([100000], ">i4").tobytes()
    file.write_bytes(data)


def far_column(folder):
    K = sparse.load_npz(folder / "K.npz")
    K.indices[0] = 100000
    sparse.save_npz(folder / "K.npz", K)


def doubled_load(folder):
    (folder / "F.csv").write_text("*CLOAD\n7, 1, 5\n*CLOAD\n7, 1, 5\n")
    (folder / "model.toml").open("a").write('F = "F.csv"\n')


def turned_deck(folder):
    (folder / "deck.inp").write_text("*NODE\n7, 0, 0, 0\n*TRANSFORM, NSET=A, TYPE=C\n0, 0, 0, 0, 0, 1\n")
    (folder / "model.toml").open("a").write('nodes = "deck.inp"\n')


def mend_text(file, end):
    file.write_text(file.read_text().partition(end)[0] + end)


def mend_line(file, index, fields):
    lines = file.read_text().split("\n")
    lines[index : index + 1] = [" ".join(fields)] if fields else []
    file.write_text("\n".join(lines))


BAD = {
    "a word among numbers": (abaqus, changed("K.mtx", "7,3, 7,1,", "7,y, 7,1,"),
                             ["K.mtx, line 3", "'y'", "node, dof, node, dof, value"]),
    "a value missing": (abaqus, changed("K.mtx", "7,3, 7,1,", "7,3, 7,"), ["K.mtx, line 3", "4 values"]),
    "map of another model": (abaqus_coordinate, changed("dofs.csv", "1000, z\n", ""), ["dofs.csv has 17 rows", "18"]),
    "a motion twice": (abaqus_coordinate, changed("dofs.csv", "7, y", "7, x"), ["dofs.csv", "twice"]),
    "an unknown motion": (abaqus_coordinate, changed("dofs.csv", "7, y", "7, w"), ["dofs.csv, line 2", "'w'", "UX"]),
    "a row missing in the mapping": (harwell_boeing,
                                     changed("model.mapping", "           2           7", "          19           7"),
                                     ["row 2"]),
    "lines cut off": (harwell_boeing, lambda folder: (folder / "K.hb").write_text("\n".join((folder / "K.hb").read_text().split("\n")[:12])),
                      ["K.hb", "truncated", "12 lines", "for the rows"]),
    "unassembled elements": (harwell_boeing, changed("K.hb", "RSA", "RSE"), ["K.hb, line 3", "RSE", "RSA"]),
    "a complex matrix": (dmig, changed("both.pch", "       6       2       0", "       6       4       0"),
                         ["both.pch, line 2", "complex", "real"]),
    "a name that is not there": (dmig, changed("model.toml", "KAAX", "KGG"), ["no matrix KGG", "KAAX, MAAX"]),
    "no name for several": (dmig, changed("model.toml", ":KAAX", ""), ["both.pch", "KAAX, MAAX", "say which"]),
    "a load twice": (abaqus, doubled_load, ["F.csv: node 7, dof 1 is there 2 times", "one load"]),
    "several loads": (dmig_loads, lambda folder: None, ["both.pch", "FX has 2 columns", "expected one"]),
    "bad number in a field": (dmig, changed("both.pch", "D+0", "Q+0"), ["both.pch", "Q+0", "a value"]),
    "a letter of Matrix Market": (matrix_market, lambda folder: mend_line(folder / "K.mtx", 5, ["1", "2", "x"]),
                                  ["K.mtx, line 6", "'x'"]),
    "an entry of Matrix Market lost": (matrix_market, lambda folder: mend_line(folder / "K.mtx", 5, []),
                                       ["K.mtx", "entries", "line 3"]),
    "a head alone": (matrix_market, lambda folder: mend_text(folder / "K.mtx", "\n%\n"), ["K.mtx: truncated"]),
    "a column beyond the end": (npz, far_column, ["K.npz", "do not fit its size of 18 x 18"]),
    "PETSc's column beyond the end": (petsc, lambda folder: far_index(folder / "K.petsc"),
                                      ["K.petsc", "do not fit its size"]),
    "a motion of none": (abaqus, changed("K.mtx", "7,2, ", "7,99, "), ["K.mtx", "99", "0 to 62"]),
    "a row far away": (abaqus_coordinate, changed("K.mtx", "       3        1", "99999999        1"),
                       ["K.mtx", "99999999"]),
    "no pairs file": (npz, lambda folder: (folder / "model.toml").open("a").write('dofs = "none.txt"'),
                      ["model.toml", "none.txt"]),
    "letters of no alphabet": (npz, lambda folder: (folder / "model.toml").write_bytes(b"K = \"\xff\""),
                               ["model.toml", "not TOML"]),
    "turned motions": (abaqus, lambda folder: turned_deck(folder),
                       ["deck.inp, line 3", "*TRANSFORM", "along x, y and z"]),
    "a huge number of a node": (abaqus_coordinate, changed("dofs.csv", "7, y", "99999999999999999999, y"),
                                ["dofs.csv", "64 bits"]),
    "symmetric of no matrix": (npz, changed("model.toml", "K = ", 'symmetric = ["B"]\nK = '),
                               ["model.toml", "symmetric names B"]),
    "an unknown key": (npz, changed("model.toml", "K = ", "KK = "), ["model.toml", "KK"]),
    "no such file": (npz, changed("model.toml", "K.npz", "L.npz"), ["L.npz"]),
    "an unknown ending": (npz, changed("model.toml", "K.npz", "K.xls"), ["K.xls", ".op4"]),
    "an array of objects": (code_aster_dense, lambda folder: np.save(folder / "K.npy", np.array([{}, None], object), allow_pickle=True),
                            ["K.npy", "Python objects", "arrays of numbers"]),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_files_are_refused_with_file_line_and_what_was_expected(tmp_path, case):
    write, change, words = BAD[case]
    describe(tmp_path, write(tmp_path, spring_model()))
    change(tmp_path)
    with pytest.raises(MATRICES.Problem) as refused:
        MATRICES.read_model(tmp_path / "model.toml")
    for word in words:
        assert word in str(refused.value), refused.value
    assert "pickle" not in str(refused.value) and "\n" not in str(refused.value)


BAD_PAIRS = {
    "unknown node": ("7 40\n11 99\n", CONTACT, ["pairs.csv, line 2", "99", "no position"]),
    "itself": ("7 7\n", CONTACT, ["line 1", "itself"]),
    "columns": ("rotor, stator, area, nx\n", CONTACT, ["line 1", "expected rotor, stator"]),
    "values": ("7 40 0 0\n", CONTACT, ["line 1", "expected"]),
    "normal the wrong way": ("11 41\n", CONTACT.replace('"z"', "[0, 0, -1]"),
                             ["line 1", "inside the rotor", "turn the normal"]),
    "no normal": ("7 40\n", CONTACT.replace('normal = "z"\n', ""), ["line 1", "coincide", "nx, ny, nz"]),
    "a gap of none": ("7 40 0 0 1 1 nan\n", CONTACT, ["line 1", "nan", "expected a number"]),
    "bad axis": ("7 40\n", CONTACT.replace('axis = "z"', 'axis = "w"'), ["rotation.axis", "three numbers"]),
    "unknown key": ("7 40\n", CONTACT.replace("normal", "normale"), ["[[contact]]", "'normale'", "'normal'"]),
    "centre misspelt": ("7 40\n", CONTACT.replace("centre", "center"),
                        ["model.toml", "rotation", "'center'", "'centre'"]),
    "rate misspelt": ("7 40\n", CONTACT.replace("rate", "rpm"), ["rotation", "'rpm'", "rate"]),
    "no rate": ("7 40\n", CONTACT.replace(", rate = 2", ""), ["rotation", "'rate'"]),
    "no axis": ("7 40\n", CONTACT.replace('axis = "z", ', ""), ["rotation", "'axis'"]),
    "two drives": ("7 40\n", CONTACT + "velocity = [1, 0, 0]\n", ["rotation and velocity", "keep one"]),
    "a short velocity": ("7 40\n", CONTACT.replace("rotation", "velocity = [1, 0] #"),
                         ["velocity = [1, 0]", "three numbers"]),
    "a velocity of words": ("7 40\n", CONTACT.replace("rotation", 'velocity = [1, 0, "a"] #'),
                            ["velocity", "three numbers"]),
    "a centre of two": ("7 40\n", CONTACT.replace("0, 0, 0", "0, 0"), ["rotation.centre", "three numbers"]),
    "a rate of text": ("7 40\n", CONTACT.replace("rate = 2", 'rate = "2"'), ["rate = 2", "a number"]),
    "a normal of words": ("7 40\n", CONTACT.replace('"z"', '[0, "a", 1]', 1), ["normal", "three numbers"]),
    "a third tangent": ("7 40\n", CONTACT + 'tangents = ["x", "y", "x"]\n', ["tangents", "3 directions", "one or two"]),
    "no table": ("7 40\n", "contact = [1]\n", ["contact = 1", "[[contact]]"]),
}


@pytest.mark.parametrize("case", BAD_PAIRS)
def test_bad_pairs_are_refused(tmp_path, case):
    pairs, extra, words = BAD_PAIRS[case]
    with pytest.raises(MATRICES.Problem) as refused:
        contact_model(tmp_path, pairs, extra)
    for word in words:
        assert word in str(refused.value), refused.value


def test_the_command_says_one_sentence_and_no_hint_at_pickle(tmp_path):
    np.save(tmp_path / "K.npy", np.array([{}], object), allow_pickle=True)
    np.save(tmp_path / "M.npy", np.eye(1))
    done = subprocess.run([sys.executable, ROOT / "tools" / "matrices", tmp_path, tmp_path / "out"], capture_output=True, text=True)
    assert done.returncode == 1 and done.stderr.count("\n") == 1
    assert "K.npy" in done.stderr and "pickle" not in done.stderr


# ---- one triangle, or all of a matrix


def model_of(folder, K, extra="", **others):
    """Files of MATRIX INPUT of small matrices between the motions of one node; M is 1."""
    for name, A in {"K": K, "M": np.eye(len(K)), **others}.items():
        (folder / f"{name}.mtx").write_text("".join(f"7,{i + 1}, 7,{j + 1}, {A[i][j]}\n" for i in range(len(K))
                                                    for j in range(len(K)) if A[i][j] != 0))
    file = describe(folder, {name: f"{name}.mtx" for name in others}, extra)
    return MATRICES.read_model(file)[0]


SLIDING = [[2, 0.3], [0, 1]]  # a sliding spring: mu k in one entry


def test_one_triangle_is_mirrored_with_a_word_or_kept_by_the_key(tmp_path, capsys):
    assert (model_of(tmp_path, SLIDING)["K"].toarray() == [[2, 0.3], [0.3, 1]]).all()
    said = capsys.readouterr().out
    assert said.count("\n") == 1 and "K.mtx" in said and "symmetric" in said
    assert (model_of(tmp_path, SLIDING, 'symmetric = ["M"]\n')["K"].toarray() == SLIDING).all()
    assert (model_of(tmp_path, SLIDING, "symmetric = []\n")["K"].toarray() == SLIDING).all()
    assert (model_of(tmp_path, [[2, 0.3], [0.1, 1]])["K"].toarray() == [[2, 0.3], [0.1, 1]]).all()
    assert capsys.readouterr().out == ""
    with pytest.raises(MATRICES.Problem, match="K is not symmetric"):
        model_of(tmp_path, [[2, 0.3], [0.1, 1]], 'symmetric = ["K"]\n')


@pytest.mark.parametrize("kind, expected", [("UNSYMMETRIC", SLIDING), ("SYMMETRIC", [[2, 0.3], [0.3, 1]])])
def test_the_head_of_matrix_input_says_what_one_triangle_is(tmp_path, capsys, kind, expected):
    model_of(tmp_path, SLIDING)
    capsys.readouterr()
    file = tmp_path / "K.mtx"
    file.write_text(f"** written by hand\n*MATRIX INPUT, NAME=K, TYPE={kind}\n" + file.read_text())
    assert (MATRICES.read_model(tmp_path / "model.toml")[0]["K"].toarray() == expected).all()
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize("form, expected", [(1, SLIDING), (6, [[2, 0.3], [0.3, 1]])])
def test_dmig_says_by_its_form_what_one_triangle_is(tmp_path, capsys, form, expected):
    text = "".join(f"DMIG,{name},0,{kind},2,0\nDMIG,{name},7,1,,7,1,{a}\nDMIG,{name},7,2,,7,1,{b},\n,7,2,{c}\n"
                   for name, kind, a, b, c in (("K", form, 2.0, 0.3, 1.0), ("M", 6, 1.0, 0.0, 1.0)))
    (tmp_path / "both.pch").write_text(text)
    found, *_ = MATRICES.read_model(describe(tmp_path, {"K": "both.pch:K", "M": "both.pch:M"}))
    assert (found["K"].toarray() == expected).all()
    assert capsys.readouterr().out == ""


def test_one_triangle_of_an_array_is_the_whole_unless_the_key_says_else(tmp_path, capsys):
    np.save(tmp_path / "K.npy", np.array(SLIDING))
    np.save(tmp_path / "M.npy", np.eye(2))
    keys = {"K": "K.npy", "M": "M.npy"}
    assert (MATRICES.read_model(describe(tmp_path, keys))[0]["K"].toarray() == SLIDING).all()
    assert "K.npy: one triangle, taken as all of K" in capsys.readouterr().out
    found = MATRICES.read_model(describe(tmp_path, keys, 'symmetric = ["K"]\n'))[0]
    assert (found["K"].toarray() == [[2, 0.3], [0.3, 1]]).all()
    np.save(tmp_path / "M.npy", np.array(SLIDING))
    with pytest.raises(MATRICES.Problem, match=r'M is not symmetric.*symmetric = \["M"\]'):
        MATRICES.read_model(describe(tmp_path, keys))


def test_one_triangle_of_a_gyroscopic_matrix_is_mirrored_skew(tmp_path, capsys):
    G = [[0, 5], [0, 0]]
    assert (model_of(tmp_path, np.eye(2), G=G)["G"].toarray() == [[0, 5], [-5, 0]]).all()
    assert "G.mtx" in capsys.readouterr().out
    assert (model_of(tmp_path, np.eye(2), G=[[0, 5], [-5, 0]])["G"].toarray() == [[0, 5], [-5, 0]]).all()
    for G in ([[0, 5], [5, 0]], [[1, 5], [-5, 0]]):
        with pytest.raises(MATRICES.Problem, match="G is not skew"):
            model_of(tmp_path, np.eye(2), G=G)
    (tmp_path / "G.mtx").write_text("*MATRIX INPUT, NAME=G, TYPE=SYMMETRIC\n7,1,7,2,5\n")
    with pytest.raises(MATRICES.Problem, match="G is not skew"):
        MATRICES.read_model(tmp_path / "model.toml")


# ---- displacement systems of Nastran's nodes


CYLINDER = "CORD2C,5,,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\n"
BALL = "CORD2S,5,,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\n"
SLANTED = "CORD2R,5,,0.,0.,0.,0.,0.,1.\n,0.6,0.8,0.\n"


def axes_of(kind, x, y, z):
    """Columns: the directions in which the coordinates of a system about z grow at a point."""
    r, R = np.hypot(x, y), np.sqrt(x * x + y * y + z * z)
    if kind == SLANTED:
        return np.array([[0.6, -0.8, 0], [0.8, 0.6, 0], [0, 0, 1]])
    if kind == CYLINDER or r == 0:
        return np.array([[x / r, -y / r, 0], [y / r, x / r, 0], [0, 0, 1]]) if r else np.eye(3)
    return np.array([[x / R, x * z / (r * R), -y / r], [y / R, y * z / (r * R), x / r], [z / R, -r / R, 0]])


def turned_model(folder, kind, places, K, dofs=(1, 2, 3), **keys):
    """K of translations along x, y and z, written along the displacement system, as Nastran does."""
    grids = "".join(f"GRID,{n + 1},,{x},{y},{z},5\n" for n, (x, y, z) in enumerate(places))
    (folder / "nodes.bdf").write_text("BEGIN BULK\n" + kind + grids)
    T = scipy.linalg.block_diag(*[axes_of(kind, *place) for place in places])
    kept = [3 * n + dof - 1 for n in range(len(places)) for dof in dofs]
    rows = [(n + 1, dof) for n in range(len(places)) for dof in dofs]
    for name, A in (("K", T.T @ K @ T), ("M", np.eye(len(K)))):
        np.save(folder / f"{name}.npy", A[np.ix_(kept, kept)])
    (folder / "dofs.txt").write_text("".join(f"{node} {dof}\n" for node, dof in rows))
    loads = (T.T @ np.arange(len(K)))[kept]
    np.savetxt(folder / "F.txt", [(*row, load) for row, load in zip(rows, loads)], fmt="%d %d %.17g")
    (folder / "pairs.csv").write_text("1 2\n")
    keys = {"K": "K.npy", "M": "M.npy", "F": "F.txt", "dofs": "dofs.txt", "nodes": "nodes.bdf", **keys}
    contact = '[[contact]]\npairs = "pairs.csv"\nnormal = "y"\nvelocity = [1, 0, 0]\n'
    return MATRICES.read_model(describe(folder, keys, contact))


@pytest.mark.parametrize("kind", [CYLINDER, BALL, SLANTED])
def test_rows_along_displacement_systems_are_turned_to_x_y_z(tmp_path, kind):
    half = np.random.default_rng(3).normal(size=(9, 9))
    K = half @ half.T
    places = [(0, 0.1, 0), (0.3, 0.4, 0.2), (0, 0, 0)]
    found, labels, *_ = turned_model(tmp_path, kind, places, K)
    np.testing.assert_allclose(found["K"].toarray(), K, rtol=0, atol=1e-14 * abs(K).max())
    np.testing.assert_allclose(found["F"], np.arange(9), atol=1e-14)
    assert (labels == [(node, dof) for node in (1, 2, 3) for dof in (1, 2, 3)]).all()
    assert (found["B"].toarray()[0] == [0, -1, 0, 0, 1, 0, 0, 0, 0]).all()
    assert (found["B"].toarray()[1] == [-1, 0, 0, 1, 0, 0, 0, 0, 0]).all()


def test_motions_of_a_displacement_system_that_are_some_of_x_y_z_are_turned_and_others_refused(tmp_path):
    """Without z the radial and the tangential motions span x and y; the radial one alone is y at (0, r) only."""
    K = np.diag([2.0, 3, 5, 7, 11, 13])
    places = [(0, 0.1, 0), (0, 0.3, 0.2)]
    found, labels, *_ = turned_model(tmp_path, CYLINDER, places, K, dofs=(1, 2))
    assert (found["K"].toarray() == np.diag([2, 3, 7, 11])).all()
    assert labels.tolist() == [[1, 1], [1, 2], [2, 1], [2, 2]]
    found, labels, *_ = turned_model(tmp_path, CYLINDER, places, K, dofs=(1,))
    assert (found["K"].toarray() == np.diag([3, 11])).all() and labels.tolist() == [[1, 2], [2, 2]]
    with pytest.raises(MATRICES.Problem, match="node 2: .*displacement system"):
        turned_model(tmp_path, CYLINDER, [(0, 0.1, 0), (0.3, 0.4, 0)], K, dofs=(1,))


# ---- substructures of Abaqus


def write_substructure(folder, model, unsymmetric=False):
    """As *SUBSTRUCTURE MATRIX OUTPUT: columns down to the diagonal, four values a line, each column on a line of its
    own. The first three nodes have x, y and z, two have y and z, the last one has the coordinates of modes."""
    nodes = [7, 11, 12, 40, 41, -1]
    lists = [(1, (1, 2, 3)), (4, (2, 3)), (6, (1, 2, 3, 4, 5))]
    text = f"**\n** SUBSTRUCTURE\n*USER ELEMENT, NODES= {len(nodes):9d}, LINEAR{', UNSYMM' * unsymmetric}\n"
    text += "** ELEMENT NODES\n** 7, 11, 12, 40,\n** 41, -1\n" + "".join(
        ", ".join(map(str, dofs if at == 1 else (at, *dofs))) + "\n" for at, dofs in lists)
    for name, A in model.items():
        text += f"*MATRIX,TYPE={name}\n"
        for j in range(N):
            column = [f"{a:.16e}" for a in A[: N if unsymmetric else j + 1, j]]
            text += "".join(" , ".join(column[k : k + 4]) + " ,\n" for k in range(0, len(column), 4))
    (folder / "sub.mtx").write_text(text)
    return {"K": "sub.mtx:STIFFNESS", "M": "sub.mtx:mass"}


SUBSTRUCTURE = [*((node, dof) for node in (7, 11, 12) for dof in (1, 2, 3)), (40, 2), (40, 3), (41, 2), (41, 3)]


@pytest.mark.parametrize("unsymmetric", [False, True])
def test_a_substructure_of_abaqus(tmp_path, unsymmetric):
    model = spring_model()
    model["K"][0, 1] += 1e5 * unsymmetric
    names = {"K": "STIFFNESS", "M": "MASS"}
    keys = write_substructure(tmp_path, {names[name]: A for name, A in model.items()}, unsymmetric)
    found, labels, *_ = MATRICES.read_model(describe(tmp_path, keys))
    order = [*range(13, N), *range(13)]  # by number of the node
    for name in "MK":
        np.testing.assert_allclose(found[name].toarray(), model[name][np.ix_(order, order)], rtol=1e-15)
    values = [np.sort_complex(scipy.linalg.eigvals(A, B)) for A, B in
              ((found["K"].toarray(), found["M"].toarray()), (model["K"], model["M"]))]
    np.testing.assert_allclose(*values, rtol=1e-10)
    assert labels[5:].tolist() == [list(row) for row in SUBSTRUCTURE]
    MATRICES.write_files(tmp_path / "out", "petsc", found, labels, {})
    assert (tmp_path / "out" / "dofs.txt").read_text().startswith("-1 -\n" * 5 + "7 x\n")
    again, again_labels, *_ = MATRICES.read_model(tmp_path / "out")
    assert (again["K"] != found["K"]).nnz == 0 and (again_labels[5:] == SUBSTRUCTURE).all()


def test_a_substructure_without_names_of_nodes(tmp_path):
    """Its rows are in the file's order; of far more nodes than values it is refused at once."""
    file = tmp_path / "sub.mtx"
    for count in (2, 99999999999):
        file.write_text(f"*USER ELEMENT, NODES={count}, LINEAR\n1\n*MATRIX, TYPE=STIFFNESS\n2\n-1, 3\n")
        if count == 2:
            found = MATRICES.matrix_files.read_array(file, None, False).toarray()
            assert (found == [[2, -1], [-1, 3]]).all()
        else:
            with pytest.raises(MATRICES.Problem, match="NODES=99999999999, but fewer values"):
                MATRICES.matrix_files.read_array(file, None, False)


def test_nodes_of_modal_coordinates_can_be_named(tmp_path):
    file = describe(tmp_path, abaqus(tmp_path, spring_model()), "modal = [11, 1000]\n")
    found, labels, *_ = MATRICES.read_model(file)
    MATRICES.write_dofs(tmp_path / "dofs.txt", labels)
    lines = (tmp_path / "dofs.txt").read_text().split("\n")
    assert lines[3:6] == ["11 -"] * 3 and lines[-4:-1] == ["1000 -"] * 3 and lines[6] == "12 x"


BAD_SUBSTRUCTURES = {
    "values missing": ((" , ", "\n*END STEP\n", -1), ["sub.mtx", "values of MASS"]),
    "other nodes": (("** 41, -1", "** 41", 0), ["sub.mtx", "5 nodes", "NODES=6"]),
    "a letter": (("e+0", "y+0", 0), ["sub.mtx, line 11", "y+0"]),
    "places": (("4, 2, 3", "9, 2, 3", 0), ["sub.mtx, line 8", "9, 2, 3", "2 to 6"]),
    "a motion twice": (("4, 2, 3", "4, 2, 2", 0), ["sub.mtx", "twice"]),
    "which one": (("*MATRIX,TYPE=MASS", "*MATRIX,TYPE=STRUCTURAL DAMPING", 0),
                  ["no matrix MASS", "STRUCTURAL DAMPING"]),
    "two elements": (("*MATRIX", "*USER ELEMENT, NODES=2\n*MATRIX", 0), ["second *USER ELEMENT"]),
    "no count": (("NODES=", "NODE=", 0), ["sub.mtx, line 3", "NODES="]),
}


@pytest.mark.parametrize("case", BAD_SUBSTRUCTURES)
def test_bad_substructures_are_refused(tmp_path, case):
    (old, new, which), words = BAD_SUBSTRUCTURES[case]
    model = spring_model()
    describe(tmp_path, write_substructure(tmp_path, {"STIFFNESS": model["K"], "MASS": model["M"]}))
    text = (tmp_path / "sub.mtx").read_text()
    head, _, tail = text.rpartition(old) if which else text.partition(old)
    (tmp_path / "sub.mtx").write_text(head + new + tail)
    with pytest.raises(MATRICES.Problem) as refused:
        MATRICES.read_model(tmp_path / "model.toml")
    for word in words:
        assert word in str(refused.value), refused.value
