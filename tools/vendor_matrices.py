"""Matrices as Abaqus, CalculiX and Ansys write them, with the nodes and motions of their rows where the file has them.

Every reader returns Labelled, whose rows are (node, dof), or a sparse matrix or array without names. dof counts from 1 to
6: x y z rx ry rz; 0 is a scalar point. Of a symmetric matrix the files may hold one triangle.
"""

import re
import warnings

import numpy as np
import scipy.sparse as sparse
from deck_files import Problem, number, whole

DOF_NAMES = {name: dof for dof, names in enumerate(["", "X UX DX T1", "Y UY DY T2", "Z UZ DZ T3", "RX ROTX DRX R1",
                                                    "RY ROTY DRY R2", "RZ ROTZ DRZ R3"]) for name in names.split()}
LAGRANGE = 63  # dof of a Lagrange multiplier


class Labelled:
    """Entries of a matrix, or of a vector when it has no columns, between rows named (node, dof)."""

    def __init__(self, rows, columns, values):
        self.rows, self.columns, self.values = rows, columns, values

    def labels(self):
        both = [self.rows] if self.columns is None else [self.rows, self.columns]
        return np.concatenate(both)

    def array(self, position):
        """On the order that position(labels) gives; n is the number of rows."""
        n, rows = position.size, position(self.rows)
        if self.columns is None:
            return np.bincount(rows, self.values, n)
        return both_triangles(sparse.coo_matrix((self.values, (rows, position(self.columns))), (n, n)))


def both_triangles(matrix):
    """The whole of a matrix, of which the entries beside the diagonal may be there once for both triangles."""
    matrix = matrix.tocsr()
    matrix.sum_duplicates()
    upper, lower = sparse.triu(matrix, 1), sparse.tril(matrix, -1)
    if matrix.shape[0] != matrix.shape[1] or (abs(upper).multiply(abs(lower.T))).nnz:
        return matrix  # both are there
    return (matrix + upper.T + lower.T).tocsr()


def numbers_in(file, columns, what):
    """Table of the numbers of a text with `columns` a line, between commas or blanks; lines of comments are left out."""
    data = file.read_bytes()
    if b"\0" in data[:4096]:
        raise Problem(f"{file}: a binary file; expected {what}")
    text = data.decode("latin-1")
    plain = re.sub(r"^[ \t]*[*%#!].*$", "", text, flags=re.M)
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)  # what numpy gives where the text is no number
        try:
            values = np.fromstring(re.sub("[dD]", "E", plain.replace(",", " ")), sep=" ")
            filled = len(re.findall(r"^.*[^\s,].*$", plain, flags=re.M))
            if values.size == columns * filled:
                return values.reshape(-1, columns)
        except (ValueError, DeprecationWarning):
            pass
    for n, line in enumerate(plain.splitlines(), 1):
        fields = line.replace(",", " ").split()
        if fields and len(fields) != columns:
            raise Problem(f"{file}, line {n}: {len(fields)} values in '{line.strip()[:60]}': expected {what}")
        for field in fields:
            number(field, f"{file}, line {n}", what)
    raise Problem(f"{file}: not a table of numbers; expected {what}")


def integers(file, table, what):
    if (table != np.round(table)).any():
        line = np.flatnonzero((table != np.round(table)).any(axis=1))[0]
        raise Problem(f"{file}: entry {line + 1}: {table[line]}: expected {what}")
    return table.astype(np.int64)


# ---- Abaqus: *MATRIX GENERATE with *MATRIX OUTPUT


def read_abaqus(file):
    """MATRIX INPUT, `node, dof, node, dof, value`, or COORDINATE, `row column value`, both with numbers from 1."""
    with open(file, "rb") as stream:
        first = next((line for line in stream if line.strip() and not line.lstrip().startswith((b"*", b"%"))), b"")
    fields = len(first.replace(b",", b" ").split())
    if fields == 5:
        what = "node, dof, node, dof, value"
        table = numbers_in(file, 5, what)
        labels = integers(file, table[:, :4], what)
        return Labelled(labels[:, :2], labels[:, 2:], table[:, 4])
    if fields == 3:
        what = "row, column, value"
        table = numbers_in(file, 3, what)
        places = integers(file, table[:, :2], what) - 1
        if (places < 0).any():
            raise Problem(f"{file}: a row or column below 1: expected {what}, numbers from 1")
        n = places.max() + 1
        return both_triangles(sparse.coo_matrix((table[:, 2], places.T), (n, n)))
    raise Problem(f"{file}: {fields} values in its first line of data: expected 'node, dof, node, dof, value' or "
                  "'row column value'")


def read_node_values(file):
    """A load as `node, dof, value`, such as what *MATRIX OUTPUT, LOAD writes."""
    what = "node, dof, value"
    table = numbers_in(file, 3, what)
    return Labelled(integers(file, table[:, :2], what), None, table[:, 2])


# ---- Ansys: HBMAT


def read_harwell_boeing(file, name):
    """The matrix; or, by the name RHS, the right-hand side behind it."""
    lines = file.read_bytes().decode("latin-1").splitlines()
    expected = "expected a Harwell-Boeing file"
    if len(lines) < 5:
        raise Problem(f"{file}: {len(lines)} lines; {expected}")
    cards = [whole(text or "0", f"{file}, line 2", f"numbers of lines; {expected}") for text in fixed(lines[1], 14, 5)]
    kind = lines[2][:3].upper()
    if kind not in ("RSA", "RUA"):
        raise Problem(f"{file}, line 3: type '{kind}': expected RSA or RUA, a real assembled matrix")
    rows, columns, entries = (whole(text, f"{file}, line 3", "a size") for text in fixed(lines[2][14:], 14, 3))
    formats = [field_of(lines[3][i:j], f"{file}, line 4") for i, j in ((0, 16), (16, 32), (32, 52), (52, 72))]
    at = 5 if cards[4] > 0 else 4
    parts = []
    for count, form, size, what in zip(cards[1:], formats, (columns + 1, entries, entries, rows),
                                       ("pointers", "rows", "values", "right-hand side")):
        place = f"{file}, line {at + 1}"
        if count == 0 and what == "right-hand side":
            parts.append(None)
            continue
        if at + count > len(lines):
            raise Problem(f"{file}: truncated: {len(lines)} lines, {at + count} expected for the {what}")
        parts.append(fixed_table(lines[at : at + count], form, place, what)[:size])
        if len(parts[-1]) < size:
            raise Problem(f"{place}: {len(parts[-1])} numbers of the {what}; expected {size}")
        at += count
    if name is not None and name.upper() == "RHS":
        if parts[3] is None:
            raise Problem(f"{file}: no right-hand side")
        return parts[3]
    starts, indices = parts[0].astype(np.int64) - 1, parts[1].astype(np.int64) - 1
    if starts[0] != 0 or starts[-1] != entries or (np.diff(starts) < 0).any():
        raise Problem(f"{file}: the pointers do not ascend from 1 to {entries + 1}")
    if (indices < 0).any() or (indices >= rows).any():
        raise Problem(f"{file}: a row outside of 1 to {rows}")
    matrix = sparse.csc_matrix((parts[2], indices, starts), (rows, columns))
    return both_triangles(matrix) if kind == "RSA" else matrix.tocsr()


def fixed(line, width, count):
    return [line[i * width : (i + 1) * width].strip() for i in range(count)]


def field_of(text, place):
    """Numbers a line and their width, of a Fortran format such as (8I10) or (1P,4D25.16)."""
    form = re.match(r"\s*\((?:\d*P,?)?\s*(\d*)\s*\(?[IEDFG](\d+)", text.upper())
    if not form and text.strip():
        raise Problem(f"{place}: '{text.strip()}': expected a Fortran format such as (8I10) or (3E25.16)")
    return (int(form[1] or 1), int(form[2])) if form else (0, 0)


def fixed_table(lines, form, place, what):
    count, width = form
    if count == 0:
        raise Problem(f"{place}: the {what} have no format in line 4")
    block = "".join(line[: count * width].ljust(count * width) for line in lines)
    texts = np.frombuffer(block.encode("latin-1"), f"S{width}")
    texts = texts[np.char.strip(texts) != b""]
    try:
        return np.char.replace(np.char.upper(texts), b"D", b"E").astype(float)
    except ValueError:
        return np.array([number(text.decode("latin-1"), f"{place} and below", f"the {what}") for text in texts])


def read_mapping(file):
    """(node, dof) of each row, from `row, node, name of the motion` a line, as Ansys writes it; what is no such line is a
    heading."""
    found = {}
    with open(file, encoding="latin-1") as stream:
        for n, line in enumerate(stream, 1):
            fields = line.replace(",", " ").split()
            if len(fields) != 3 or not fields[0].isdigit():
                if found and fields:
                    raise Problem(f"{file}, line {n}: '{line.strip()[:60]}': expected row, node, motion")
                continue
            if int(fields[0]) in found:
                raise Problem(f"{file}, line {n}: row {fields[0]} is there twice")
            found[int(fields[0])] = (whole(fields[1], f"{file}, line {n}"), dof_of(fields[2], f"{file}, line {n}"))
    missing = set(range(1, len(found) + 1)) - set(found)
    if missing or not found:
        raise Problem(f"{file}: no line for row {min(missing, default=1)}; expected row, node, motion for each row")
    return np.array([found[row] for row in range(1, len(found) + 1)], np.int64)


def dof_of(text, place):
    """1 to 6 of a motion's number or name; 0 of a scalar point."""
    if text.isdigit() and int(text) <= 6:
        return int(text)
    if text.upper().startswith("LAGR"):
        return LAGRANGE
    if text.upper() not in DOF_NAMES:
        raise Problem(f"{place}: '{text}': expected a motion: 0 to 6, or a name such as x, UX, DX, ROTX, DRX")
    return DOF_NAMES[text.upper()]


def read_dof_list(file):
    """(node, dof) of each row in order: `node, motion` a line, or node.motion as CalculiX. Code_Aster's N12 is node 12."""
    found = []
    with open(file, encoding="latin-1") as stream:
        for n, line in enumerate(stream, 1):
            fields = line.split("#")[0].replace(",", " ").split()
            if not fields:
                continue
            if len(fields) == 1:
                fields = fields[0].split(".")
            place = f"{file}, line {n}"
            if len(fields) != 2:
                raise Problem(f"{place}: '{line.strip()[:60]}': expected a node's number and a motion, such as 1017 x")
            found.append((whole(fields[0].lstrip("N"), place, "a node's number"), dof_of(fields[1], place)))
    return np.array(found, np.int64).reshape(-1, 2)
