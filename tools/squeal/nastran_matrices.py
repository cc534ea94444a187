"""Matrices as Nastran writes them: DMIG entries, whose rows are named by node and component, and OUTPUT4 files."""

import re
import struct

import numpy as np
import scipy.sparse as sparse
from squeal.deck_files import Problem, number, whole
from squeal.nastran_cards import fields_of
from squeal.vendor_matrices import Labelled, both_triangles, chosen


# ---- Nastran: DMIG


class DmigColumn:
    def __init__(self, place, node, dof):
        self.place, self.node, self.dof = place, node, dof
        self.nodes, self.dofs, self.values = [], [], []


def read_dmig(file, name):
    """The matrix or load of this name; without a name the only one of the file."""
    heads, columns, current = {}, {}, None
    for first, data, place in dmig_lines(file):
        if first:
            matrix = data[0].upper()
            if data[1] == "0" and matrix not in heads:
                heads[matrix], columns[matrix], current = (place, data), [], None
                continue
            if matrix not in heads:
                raise Problem(f"{place}: a column of {matrix}: expected its header before, DMIG {matrix} 0 …")
            current = DmigColumn(place, data[1], data[2])
            columns[matrix].append(current)
            data = data[4:]
        for i in range(0, len(data) - 2 if current else 0, 4):
            if data[i]:
                current.nodes.append(data[i])
                current.dofs.append(data[i + 1])
                current.values.append(data[i + 2])
    return dmig_matrix(*one_of(file, heads, name), columns)


def one_of(file, found, name):
    """The entry of this name, or the only one."""
    if not found:
        raise Problem(f"{file}: no matrix; expected an OUTPUT4 file, text or binary, or a punch file with DMIG entries")
    return found[chosen(file, found, name)]


def dmig_lines(file):
    """(whether it starts an entry, its fields, its place) of the lines of DMIG entries; long fields are the usual ones."""
    within = False
    with open(file, encoding="latin-1") as stream:
        for n, line in enumerate(stream, 1):
            start = line[:1]
            if start == "*" and "," not in line:
                if within:
                    yield False, [line[8:24].strip(), line[24:40].strip(), line[40:56].strip(), line[56:72].strip()], \
                        f"{file}, line {n}"
                continue
            line = line.split("$")[0].rstrip()
            if not line:
                continue
            first, data = fields_of(line)
            card = first.rstrip("*").upper()
            if card == "DMIG":
                within = True
                yield True, data, f"{file}, line {n}"
            elif card == "" or card[0] in "+*":
                if within:
                    yield False, data, f"{file}, line {n}"
            else:
                within = False


def dmig_matrix(place, head, columns):
    form, kind = whole(head[2], place), whole(head[3], place)
    if kind not in (1, 2):
        raise Problem(f"{place}: {head[0]} is complex (TIN {kind}); expected a real matrix, TIN 1 or 2")
    if form not in (1, 2, 6, 9):
        raise Problem(f"{place}: {head[0]} has the form {form}; expected 1 (square), 6 (symmetric), 2 or 9 (a load)")
    columns = columns[head[0].upper()]
    if form in (2, 9) and len(columns) > 1:
        raise Problem(f"{columns[1].place}: {head[0]} has {len(columns)} columns, a load each: expected one; keep "
                      "the column of the load that is meant")
    nodes, dofs, values = [], [], []
    for column in columns:
        at = f"{column.place} and below"
        nodes += converted(column.nodes, int, lambda text: whole(text, at, "a node's number"))
        dofs += converted(column.dofs, int, lambda text: whole(text or "0", at, "a component"))
        values += converted(column.values, float, lambda text: number(text, at, "a value"))
    rows, values = np.array([nodes, dofs], np.int64).T.reshape(-1, 2), np.array(values)
    if form in (2, 9):
        return Labelled(rows, None, values)
    own = np.array([[whole(c.node, c.place), whole(c.dof or "0", c.place)] for c in columns], np.int64).reshape(-1, 2)
    return Labelled(rows, np.repeat(own, [len(column.nodes) for column in columns], axis=0), values, form == 6)


def converted(texts, quickly, carefully):
    try:
        return list(map(quickly, texts))
    except ValueError:
        return [carefully(text) for text in texts]


# ---- Nastran: OUTPUT4


def read_op4(file, name):
    """The matrix of this name, or the only one, of a text or binary file, dense or sparse."""
    data = file.read_bytes()
    marker = data[:4]
    for order in "<>":
        if marker in (struct.pack(order + "i", 24), struct.pack(order + "i", 48)):
            found = dict(binary_op4(file, data, order))
            break
    else:
        found = dict(text_op4(file, data))
    return one_of(file, found, name)


class Op4Columns:
    """Gathers the columns of one matrix."""

    def __init__(self, place, shape, form, kind):
        if kind not in (1, 2):
            raise Problem(f"{place}: a complex matrix (type {kind}); expected a real one, 1 or 2")
        self.place, self.shape, self.form, self.kind = place, shape, form, kind
        self.rows, self.columns, self.values = [], [], []

    def add(self, column, row, values):
        if not (0 < column <= self.shape[1] and 0 < row and row + len(values) - 1 <= self.shape[0]):
            raise Problem(f"{self.place}: column {column} has rows {row} to {row + len(values) - 1}, beyond the "
                          f"{self.shape[0]} x {self.shape[1]} of its head")
        self.rows.extend(range(row - 1, row - 1 + len(values)))
        self.columns.extend([column - 1] * len(values))
        self.values.extend(values)

    def matrix(self):
        places = np.array([self.rows, self.columns], np.int64).reshape(2, -1)
        matrix = sparse.coo_matrix((np.array(self.values, float), places), self.shape)
        matrix.eliminate_zeros()
        return both_triangles(matrix) if self.form == 6 else matrix.tocsr()


def binary_op4(file, data, order):
    """Fortran records: head (columns, rows, form, type, name); a record a column; one of column `columns + 1` at the end."""
    at, current, name, wide = 0, None, "", False
    while at < len(data):
        if at + 4 > len(data):
            raise Problem(f"{file}: truncated at byte {at}; expected a record's length")
        length = struct.unpack_from(order + "i", data, at)[0]
        if length < 0 or at + length + 8 > len(data):
            raise Problem(f"{file}: truncated at byte {at}: a record of {length} bytes; {len(data) - at} are left")
        record, place = data[at + 4 : at + 4 + length], f"{file}, byte {at}"
        at += length + 8
        if current is None:
            if length not in (24, 48):
                raise Problem(f"{place}: a record of {length} bytes; expected a matrix's head of 24")
            wide = length == 48  # integers and words of 8 bytes
            columns, rows, form, kind = struct.unpack_from(order + ("4q" if wide else "4i"), record)
            name = (record[32:48] if wide else record[16:24]).decode("latin-1").strip().upper()
            current, big = Op4Columns(place, (abs(rows), columns), form, kind), rows < 0
            continue
        word = 8 if wide else 4
        if length < 3 * word:
            raise Problem(f"{place}: a record of {length} bytes; expected a column's three integers")
        column, row, words = struct.unpack_from(order + ("3q" if wide else "3i"), record)
        body = record[3 * word :]
        if column > current.shape[1]:
            yield name, current.matrix()
            current = None
        elif row > 0:
            current.add(column, row, values_of(body, order, current.kind, place))
        else:
            for row, part in strings_of(body, order, word, big, place):
                current.add(column, row, values_of(part, order, current.kind, place))
    if current is not None:
        raise Problem(f"{file}: truncated: the matrix {name} has no end")


def values_of(body, order, kind, place):
    size = 4 if kind == 1 else 8
    if len(body) % size:
        raise Problem(f"{place}: {len(body)} bytes of values; expected a multiple of {size}")
    return struct.unpack(f"{order}{len(body) // size}{'f' if kind == 1 else 'd'}", body)


def strings_of(body, order, word, big, place):
    """Runs of rows of a sparse column: each has its length in words plus one and its row, in one word or in two."""
    at, form = 0, order + ("q" if word == 8 else "i")
    while at < len(body):
        first = struct.unpack_from(form, body, at)[0]
        at += word
        if big:
            words, row = first - 1, struct.unpack_from(form, body, at)[0]
            at += word
        else:
            words, row = (first >> 16) - 1, first & 0xFFFF
        if words <= 0 or at + words * word > len(body):
            raise Problem(f"{place}: a run of {words} words; {(len(body) - at) // word} are left")
        yield row, body[at : at + words * word]
        at += words * word


def text_op4(file, data):
    """Heads and columns as in the binary form, in lines: three integers begin a column, one or two a run of rows of a
    sparse one, and lines with a decimal point hold values in Fortran's fixed fields."""
    current, name, skip = None, "", False
    for n, line in enumerate(data.decode("latin-1").splitlines(), 1):
        if current is None:
            if skip or not line.strip():  # the one value of the closing column
                skip = False
                continue
            current, name, width = text_head(line, f"{file}, line {n}")
            column = row = 0
            continue
        if "." in line:
            if row == 0:
                raise Problem(f"{file}, line {n}: '{line.strip()[:60]}': values; expected three integers that begin a column")
            line = line.rstrip()
            fields = [line[i : i + width] for i in range(0, len(line), width)]
            values = converted(fields, float, lambda text: number(text, f"{file}, line {n}"))
            current.add(column, row, values)
            row += len(values)
            continue
        words = converted(line.split(), int, lambda text: whole(text, f"{file}, line {n}"))
        if len(words) == 3:
            column, row = words[:2]
            if column > current.shape[1]:
                yield name, current.matrix()
                current, skip = None, True
        elif len(words) == 2:
            row = words[1]
        elif len(words) == 1:
            row = words[0] & 0xFFFF
        else:
            raise Problem(f"{file}, line {n}: '{line.strip()[:60]}': expected a column's three integers, or values")
    if current is not None:
        raise Problem(f"{file}: truncated: the matrix {name} has no end")


def text_head(line, place):
    head = re.match(r"\s*(\d+)\s*(-?\d+)\s+(\d)\s+(\d)\s*([A-Za-z]\w*)\s.*?\d*[EDG](\d+)\.\d+", line)
    if not head:
        raise Problem(f"{place}: '{line.strip()[:60]}': expected a matrix's head: columns, rows, form, type, name and format, "
                      "such as 1P,3E23.16")
    columns, rows, form, kind = (int(head[i]) for i in range(1, 5))
    return Op4Columns(place, (abs(rows), columns), form, kind), head[5].upper(), int(head[6])
