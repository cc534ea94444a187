"""Matrices as Abaqus, CalculiX and Ansys write them, with the nodes and motions of their rows where the file has them.

Every reader returns Labelled, whose rows are (node, dof), or a sparse matrix or array without names. dof counts from 1 to
6: x y z rx ry rz; 0 is a scalar point or a modal coordinate. Of a symmetric matrix the files may hold one triangle.
"""

import re
import warnings

import numpy as np
import scipy.sparse as sparse
from squeal.deck_files import Problem, lines_of, number, whole

DOF_NAMES = {name: dof for dof, names in enumerate(["-", "X UX DX T1", "Y UY DY T2", "Z UZ DZ T3", "RX ROTX DRX R1",
                                                    "RY ROTY DRY R2", "RZ ROTZ DRZ R3"]) for name in names.split()}
LAGRANGE = 63  # dof of a Lagrange multiplier


class Labelled:
    """Entries of a matrix, or of a vector when it has no columns, between rows named (node, dof). half: whether one
    triangle stands for both; None where the file does not say."""

    def __init__(self, rows, columns, values, half=None):
        self.rows, self.columns, self.values, self.half = rows, columns, values, half

    def labels(self):
        both = [self.rows] if self.columns is None else [self.rows, self.columns]
        return np.concatenate(both)

    def array(self, position):
        """On the order that position(labels) gives; n is the number of rows."""
        n, rows = position.size, position(self.rows)
        if self.columns is None:
            return np.bincount(rows, self.values, n)
        return sparse.csr_matrix((self.values, (rows, position(self.columns))), (n, n))


class Untold:
    """A matrix without names whose file does not say whether one triangle stands for both."""

    half = None

    def __init__(self, matrix):
        self.matrix, self.shape = matrix.tocsr(), matrix.shape

    def array(self, position):
        return self.matrix


def places_of(matrix):
    """1 wherever the matrix has an entry, be it 0."""
    places = matrix.tocsr().copy()
    places.sum_duplicates()
    places.data = np.ones(places.nnz)
    return places


def is_triangle(matrix):
    """Whether entries beside the diagonal are there, and no two of them face each other across it."""
    places = places_of(matrix)
    facing = places.multiply(places.T).nnz if places.shape[0] == places.shape[1] else places.nnz
    return facing < places.nnz and facing == (places.diagonal() > 0).sum()


def both_triangles(matrix, sign=1):
    """The whole of a symmetric matrix, or of a skew one by the sign -1, whose entries may be there once."""
    if matrix.shape[0] != matrix.shape[1]:
        return matrix.tocsr()
    matrix = matrix.tocsr()
    mirrored = sign * matrix.T.tocsr()
    return (matrix + (mirrored - mirrored.multiply(places_of(matrix)))).tocsr()


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
    if abs(table).max(initial=0) > 2**53:
        raise Problem(f"{file}: a number of {abs(table).max():.3g}: expected {what}")
    return table.astype(np.int64)


# ---- Abaqus: *MATRIX GENERATE with *MATRIX OUTPUT


def read_abaqus(file, half=None):
    """MATRIX INPUT, `node, dof, node, dof, value`, or COORDINATE, `row column value`, both with numbers from 1. The
    keyword above the first may say whether the matrix is symmetric."""
    first, keywords = head_of(file)
    fields = len(first.replace(",", " ").split())
    for keyword in keywords:
        if kind := re.search(r"TYPE\s*=\s*(UN)?SYMMETRIC", keyword.upper()):
            half = kind[1] is None
        if "SCALE" in keyword.upper():
            raise Problem(f"{file}: '{keyword[:60]}': a scale factor; expected the entries as they are: scale them "
                          "and take the factor out")
    if fields == 5:
        what = "node, dof, node, dof, value"
        table = numbers_in(file, 5, what)
        labels = integers(file, table[:, :4], what)
        return Labelled(labels[:, :2], labels[:, 2:], table[:, 4], half)
    if fields == 3:
        what = "row, column, value"
        table = numbers_in(file, 3, what)
        places = integers(file, table[:, :2], what) - 1
        if (places < 0).any():
            raise Problem(f"{file}: a row or column below 1: expected {what}, numbers from 1")
        n = places.max() + 1
        if n > 100 * len(table) + 1000:
            raise Problem(f"{file}: a row or column {n}, but {len(table)} entries in all: expected {what}")
        matrix = sparse.coo_matrix((table[:, 2], places.T), (n, n))
        return both_triangles(matrix) if half else Untold(matrix)
    raise Problem(f"{file}: {fields} values in its first line of data: expected 'node, dof, node, dof, value' or "
                  "'row column value'")


def head_of(file):
    """The first line of data, and the keywords above it."""
    keywords = []
    with open(file, encoding="latin-1") as stream:
        for line in map(str.strip, stream):
            if line.startswith("*") and not line.startswith("**"):
                keywords.append(line)
            elif line and not line.startswith(("*", "%")):
                return line, keywords
    return "", keywords


def read_user_element(file, name):
    """A substructure as *USER ELEMENT, LINEAR: its nodes in comments below ELEMENT NODES, lists of motions, then of
    each *MATRIX the columns down to the diagonal, or in whole of an UNSYMM element. A list of motions holds from its
    node on."""
    nodes, motions, matrices, state, unsymmetric, count = [], [], {}, "", False, None
    for n, line in lines_of(file):
        line, place = line.strip(), f"{file}, line {n}"
        fields = [field.strip() for field in line.strip("*").split(",") if field.strip()]
        if line.startswith("**"):
            if "ELEMENT NODES" in line.upper():
                state = "nodes"
            elif state == "nodes" and re.fullmatch(r"[-\d\s,*]*", line):
                nodes += [whole(field, place, "a node's number") for field in fields]
        elif line.startswith("*"):
            key, *options = [" ".join(field.upper().split()) for field in fields]
            options = dict(option.replace(" =", "=").replace("= ", "=").partition("=")[::2] for option in options)
            state = "motions" if key == "USER ELEMENT" else "matrix" if key == "MATRIX" else ""
            if state == "motions":
                if count is not None:
                    raise Problem(f"{place}: a second *USER ELEMENT: expected one substructure a file")
                count, unsymmetric = whole(options.get("NODES", ""), place, "NODES=, their number"), "UNSYMM" in options
            elif state == "matrix":
                values = matrices.setdefault(options.get("TYPE", ""), [])
                if values:
                    raise Problem(f"{place}: a second *MATRIX, TYPE={options.get('TYPE', '')}")
        elif state in ("nodes", "motions"):
            state = "motions"
            first, *dofs = [whole(field, place, "a motion") for field in (["1"] if not motions else []) + fields]
            if not (motions[-1][0] if motions else 0) < first <= count or not dofs:
                raise Problem(f"{place}: '{line[:60]}': expected the place of a node, 2 to {count} and ascending, "
                              "and its motions")
            motions.append((first, dofs))
        elif state == "matrix":
            values += [number(field, place) for field in fields]
    if not motions or not matrices:
        missing = "*MATRIX" if motions else "motions"
        raise Problem(f"{file}: no {missing}: expected *USER ELEMENT, its motions and *MATRIX")
    if nodes and len(nodes) != count:
        raise Problem(f"{file}: {len(nodes)} nodes below ELEMENT NODES; expected NODES={count}")
    if count > max(map(len, matrices.values())):
        raise Problem(f"{file}: NODES={count}, but fewer values: expected a column for each motion of each node")
    rows = rows_of_element(nodes or range(1, count + 1), motions, count)
    if len(np.unique(rows, axis=0)) < len(rows):
        raise Problem(f"{file}: a node's motion is there twice")
    key = chosen(file, matrices, name)
    i, j = np.indices((len(rows), len(rows))).reshape(2, -1)[::-1] if unsymmetric else np.tril_indices(len(rows))
    if len(matrices[key]) != len(i):
        raise Problem(f"{file}: {len(matrices[key])} values of {key}; expected {len(i)} for {len(rows)} motions")
    found = Labelled(rows[i], rows[j], np.array(matrices[key]), not unsymmetric)
    if nodes:
        return found
    matrix = sparse.csr_matrix((found.values, (i, j)))
    return matrix if unsymmetric else both_triangles(matrix)


def rows_of_element(nodes, motions, count):
    ends = [first for first, _ in motions[1:]] + [count + 1]
    return np.array([(nodes[at - 1], dof) for (first, dofs), end in zip(motions, ends) for at in range(first, end)
                     for dof in dofs], np.int64)


def chosen(file, found, name):
    """The name of one of several, or of the only one."""
    if name is None and len(found) > 1:
        raise Problem(f"{file}: holds {', '.join(found)}: say which by \"{file.name}:NAME\"")
    key = next(iter(found)) if name is None else name.upper()
    if key not in found:
        raise Problem(f"{file}: no matrix {key}; it holds {', '.join(found)}")
    return key


def read_node_values(file):
    """A load as `node, dof, value`, such as what *MATRIX OUTPUT, LOAD writes."""
    what = "node, dof, value"
    table = numbers_in(file, 3, what)
    labels = integers(file, table[:, :2], what)
    found, counts = np.unique(labels, axis=0, return_counts=True)
    if (counts > 1).any():
        node, dof = found[np.argmax(counts > 1)]
        raise Problem(f"{file}: node {node}, dof {dof} is there {counts.max()} times: expected one load")
    return Labelled(labels, None, table[:, 2])


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
        if (loads := whole(lines[4][14:28].strip() or "1", f"{file}, line 5", "the number of right-hand sides")) > 1:
            raise Problem(f"{file}, line 5: {loads} right-hand sides; expected one: write the matrix with one load")
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
            if len(fields) != 3 or not fields[0].isdecimal():
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
    if text.isdecimal() and int(text) <= 6:
        return int(text)
    if text.upper().startswith("LAGR"):
        return LAGRANGE
    if text.upper() not in DOF_NAMES:
        raise Problem(f"{place}: '{text}': expected a motion: 0 to 6, a name such as x, UX, DX, ROTX, or - for none")
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
