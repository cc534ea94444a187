"""Files that hold one matrix or vector, or several by name: PETSc, numpy, Matrix Market, MATLAB, Code_Aster, and those of
tools/vendor_matrices.py and tools/nastran_matrices.py."""

import re

from squeal import nastran_matrices as nastran
import numpy as np
import scipy.io
import scipy.sparse as sparse
from squeal import vendor_matrices as vendor
from squeal.common import MATRIX_ID, VECTOR_ID
from squeal.deck_files import Problem, number, whole


def read_petsc(file, name):
    """A matrix is id, rows, columns, entries, entries of each row, columns, values; a vector id, size, values."""
    data = file.read_bytes()

    def take(kind, count, at):
        size = np.dtype(kind).itemsize * count
        if count < 0 or at + size > len(data):
            raise Problem(f"{file} is truncated: {len(data)} bytes, at least {at + max(size, 0)} expected")
        return np.frombuffer(data, kind, count, at), at + size

    (kind, first), at = take(">i4", 2, 0)
    if kind == VECTOR_ID:
        values, at = take(">f8", int(first), at)
        result = values.astype(float)
    elif kind == MATRIX_ID:
        (columns, entries), at = take(">i4", 2, at)
        lengths, at = take(">i4", int(first), at)
        indices, at = take(">i4", int(entries), at)
        values, at = take(">f8", int(entries), at)
        if lengths.sum() != entries or (lengths < 0).any():
            raise Problem(f"{file}: the rows hold {lengths.sum()} entries, the head says {entries}")
        pointers = np.concatenate([[0], np.cumsum(lengths)])
        result = sparse.csr_matrix((values.astype(float), indices.astype(np.int32), pointers), (int(first), int(columns)))
    else:
        raise Problem(f"{file} is not a PETSc binary file: it starts with {kind}, not {MATRIX_ID} or {VECTOR_ID}")
    if at != len(data):
        raise Problem(f"{file}: {len(data) - at} bytes follow the end of the data; were PETSc's indices 64-bit?")
    return result


def load_numpy(file):
    """What numpy.save or numpy.savez wrote. Files that hold Python objects may run code: they are refused."""
    try:
        return np.load(file, allow_pickle=False)
    except ValueError:
        raise Problem(f"{file}: holds Python objects, or is no file of numpy; expected arrays of numbers, as numpy.save, "
                      "numpy.savez and scipy.sparse.save_npz write them") from None


def read_npz(file, name):
    """scipy.sparse.save_npz; one array; arrays of several names; or the (values, rows, columns, size) that Code_Aster's
    EXTR_MATR(sparse=True) gives, saved by numpy.savez(FILE, *K)."""
    with load_numpy(file) as data:
        names = list(data.files)
        if "format" in names:
            return sparse.load_npz(file)
        key = name or (names[0] if len(names) == 1 else None)
        if names == ["arr_0", "arr_1", "arr_2", "arr_3"] and not name:
            values, rows, columns, size = (array_of(data, key, file) for key in names)
            return coordinates(file, values, rows, columns, int(size.reshape(-1)[0]))
        if key is None or key not in names:
            raise Problem(f"{file}: holds {', '.join(names)}: say which by \"{file.name}:NAME\"")
        return array_of(data, key, file)


def names_of(file):
    """Names of the arrays of a bundle, .npz or .mat."""
    if file.suffix == ".npz":
        with load_numpy(file) as data:
            return list(data.files)
    if file.suffix == ".mat":
        return matlab_content(file)[0]
    raise Problem(f"{file}: expected a folder, a bundle .npz or .mat, or a .toml that says where the matrices are")


def array_of(data, key, file):
    try:
        return data[key]
    except ValueError:
        raise Problem(f"{file}: {key} holds Python objects; expected an array of numbers") from None


def coordinates(file, values, rows, columns, n):
    """Code_Aster counts from 0, and keeps one triangle of a symmetric matrix."""
    if not len(values) == len(rows) == len(columns):
        raise Problem(f"{file}: {len(values)} values, {len(rows)} rows, {len(columns)} columns; expected as many of each")
    places = np.concatenate([rows, columns])
    if len(places) and (places.min() < 0 or places.max() >= n):
        raise Problem(f"{file}: rows and columns from {places.min()} to {places.max()}; expected 0 to {n - 1}")
    return vendor.Untold(sparse.coo_matrix((values, (rows, columns)), (n, n)))


def read_matlab(file, name):
    names, content = matlab_content(file)
    return content(pick(file, names, name))


def matlab_content(file):
    """Names of the variables, and a function that reads one. Versions 4 to 7 by scipy; 7.3 is HDF5."""
    import h5py

    if h5py.is_hdf5(file):
        with h5py.File(file) as data:
            names = [key for key in data if not key.startswith("#")]

        def read(name):
            with h5py.File(file) as data:
                return read_hdf5(data[name], file)

        return names, read
    try:
        content = scipy.io.loadmat(file)
    except (ValueError, TypeError, NotImplementedError, KeyError) as error:
        raise Problem(f"{file}: not a file of MATLAB ({error})") from None
    return [key for key in content if not key.startswith("__")], content.__getitem__


def pick(file, names, name):
    if name is None and len(names) == 1:
        return names[0]
    if name not in names:
        raise Problem(f"{file}: holds {', '.join(names)}: say which by \"{file.name}:NAME\"")
    return name


def read_hdf5(item, file):
    """A sparse matrix is a group of columns; a dense one is stored by columns."""
    import h5py

    if isinstance(item, h5py.Dataset):
        return item[()].T
    if "ir" not in item or "jc" not in item:
        raise Problem(f"{file}: {item.name} is a structure; expected a matrix")
    rows = int(item.attrs["MATLAB_sparse"])
    starts = item["jc"][()].astype(np.int64)
    values = item["data"][()] if "data" in item else np.zeros(0)
    indices = item["ir"][()].astype(np.int64) if "ir" in item else np.zeros(0, np.int64)
    return sparse.csc_matrix((values, indices, starts), (rows, len(starts) - 1))


def read_mtx(file, name):
    """Matrix Market says so in its first line; else it is Abaqus's, a substructure or an assembled matrix."""
    if is_market(file):
        return read_market(file)
    _, keywords = vendor.head_of(file)
    if any(keyword[1:].strip().upper().startswith("USER ELEMENT") for keyword in keywords):
        return vendor.read_user_element(file, name)
    return vendor.read_abaqus(file)


def read_calculix(file, name):
    """Of a symmetric matrix one triangle, of another one both."""
    return vendor.read_abaqus(file, half=True)


READERS = {".petsc": read_petsc, ".npz": read_npz, ".npy": lambda file, name: load_numpy(file), ".mtx": read_mtx,
           ".mat": read_matlab, ".op4": nastran.read_op4, ".pch": nastran.read_dmig, ".dmig": nastran.read_dmig,
           ".bdf": nastran.read_dmig, ".sti": read_calculix, ".mas": read_calculix,
           **dict.fromkeys((".hb", ".rsa", ".rua", ".matrix"), vendor.read_harwell_boeing)}
LOADS = {".mtx": lambda file, name: load_of_mtx(file), ".txt": lambda file, name: vendor.read_node_values(file),
         ".csv": lambda file, name: vendor.read_node_values(file)}


def load_of_mtx(file):
    return read_market(file) if is_market(file) else vendor.read_node_values(file)


def is_market(file):
    with open(file, "rb") as stream:
        return stream.read(14).lower() == b"%%matrixmarket"


def read_market(file):
    with open(file, encoding="latin-1") as stream:
        if all(not line.strip() or line.startswith("%") for line in stream):  # scipy reads on for ever
            raise Problem(f"{file}: truncated: no sizes below its first line")
    try:
        return scipy.io.mmread(str(file))
    except Exception as error:  # scipy names no line
        check_market(file)
        raise Problem(f"{file}: not a file of Matrix Market ({error})") from None


def check_market(file):
    """Names the first line that has other numbers than the head says."""
    with open(file, encoding="latin-1") as stream:
        words = stream.readline().lower().split()
        lines = [(n, line) for n, line in enumerate(stream, 2) if line.strip() and not line.startswith("%")]
    counts = {"pattern": 0, "complex": 2, "real": 1, "integer": 1}
    if len(words) != 5 or words[2] not in ("coordinate", "array") or words[3] not in counts or not lines:
        raise Problem(f"{file}, line 1: expected '%%MatrixMarket matrix coordinate real general', then its size")
    sparse_form, values = words[2] == "coordinate", counts[words[3]]
    for n, line in lines:
        fields, place = line.split(), f"{file}, line {n}"
        wholes = (3 if sparse_form else 2) if n == lines[0][0] else 2 if sparse_form else 0
        expected = wholes + (0 if n == lines[0][0] else values)
        if len(fields) != expected:
            raise Problem(f"{place}: '{line.strip()[:60]}': expected {expected} values")
        for i, field in enumerate(fields):
            whole(field, place) if i < wholes else number(field, place)
    size = whole(lines[0][1].split()[2], f"{file}, line {lines[0][0]}") if sparse_form else len(lines) - 1
    if len(lines) - 1 != size:
        raise Problem(f"{file}: {len(lines) - 1} entries; expected {size} as line {lines[0][0]} says")


def checked(file, array):
    """scipy follows indices of compressed rows and columns wherever they lead, out of its memory too."""
    if isinstance(array, vendor.Labelled):
        dofs = array.labels()[:, 1]
        if len(dofs) and not 0 <= dofs.min() <= dofs.max() < vendor.LAGRANGE:
            raise Problem(f"{file}: motions from {dofs.min()} to {dofs.max()}; expected 0 to {vendor.LAGRANGE - 1}")
    if sparse.issparse(array) and hasattr(array, "check_format"):
        try:
            array.check_format()
        except ValueError as error:
            raise Problem(f"{file}: rows and columns that do not fit its size of {array.shape[0]} x {array.shape[1]} "
                          f"({error}); was it cut or changed?") from None
    return array


def read_array(file, name, is_load):
    """What the file holds, by its ending: a Labelled, a sparse matrix or an array. Whatever fails names the file."""
    readers = {**READERS, **LOADS} if is_load else READERS
    if file.suffix.lower() not in readers:
        raise Problem(f"{file}: unknown ending; expected one of {', '.join(sorted(readers))}")
    if not file.is_file():
        raise Problem(f"there is no file {file}")
    try:
        return checked(file, readers[file.suffix.lower()](file, name))
    except Problem:
        raise
    except Exception as error:  # the readers of numpy and scipy raise of every kind
        text = re.sub(r"\s+", " ", str(error))
        raise Problem(f"{file}: cannot be read: {'it holds Python objects' if 'pickle' in text else text}") from None
