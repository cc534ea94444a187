"""Decks of other codes as text: keyword blocks of Abaqus and CalculiX, cards of Nastran, each with its place."""

import re

import numpy as np


class Problem(Exception):
    """What is wrong with the input, in one sentence that names file, line and what was expected."""


def lines_of(file):
    """Numbered lines of a text file; a binary file is refused."""
    data = file.read_bytes()
    if b"\0" in data[:4096]:
        raise Problem(f"{file}: a binary file; expected text")
    return enumerate(data.decode("latin-1").splitlines(), 1)


def included(file, name, depth):
    """A file that a deck includes, beside it."""
    if depth > 8:
        raise Problem(f"{file}: includes go deeper than 8 files")
    other = file.parent / name.strip().strip("'\"")
    if not other.is_file():
        raise Problem(f"{file}: includes {name.strip()}, which is not there")
    return other


# ---- Abaqus and CalculiX


class Block:
    """One keyword: *NAME, KEY=VALUE, ... and the lines of data below it."""

    def __init__(self, place, name, options):
        self.place, self.name, self.options, self.lines = place, name, options, []

    def rows(self):
        """(place, fields) of every line of data."""
        for place, line in self.lines:
            fields = [field.strip() for field in line.split(",")]
            yield place, fields[:-1] if fields[-1] == "" else fields


def blocks_of(file, depth=0):
    """The keyword blocks of an input deck, in order."""
    blocks, head = [], ""
    for number, line in lines_of(file):
        line = line.strip()
        if not line or line.startswith("**"):
            continue
        place = f"{file}, line {number}"
        if head or line.startswith("*"):
            head += line
            if head.endswith(","):
                continue  # goes on in the next line
            name, *words = [word.strip() for word in head[1:].split(",")]
            head = ""
            options = {}
            for word in words:
                key, _, value = word.partition("=")
                options[key.strip().upper()] = value.strip().strip('"')
            if name.upper() == "INCLUDE":
                blocks += blocks_of(included(file, options.get("INPUT", ""), depth), depth + 1)
            else:
                blocks.append(Block(place, " ".join(name.upper().split()), options))
        elif not blocks:
            raise Problem(f"{place}: '{line[:60]}': expected a keyword, such as *NODE")
        else:
            blocks[-1].lines.append((place, line))
    return blocks


def whole(text, place, what="a whole number"):
    try:
        return int(text)
    except ValueError:
        raise Problem(f"{place}: '{text}': expected {what}") from None


def number(text, place, what="a number"):
    """Fortran's forms too: 1.5D+3, and Nastran's 1.5+3."""
    try:
        return float(text)
    except ValueError:
        fixed = re.sub(r"(?<=[\d.])([+-])", r"E\1", re.sub("[dD]", "E", text.strip()))
        try:
            return float(fixed.replace("EE", "E"))
        except ValueError:
            raise Problem(f"{place}: '{text}': expected {what}") from None


def abaqus_nodes(blocks):
    """Numbers and positions of all *NODE blocks, in order."""
    labels, positions = [], []
    for block in blocks:
        if block.name in ("INSTANCE", "ASSEMBLY"):
            raise Problem(f"{block.place}: *{block.name}: the solver numbers the nodes of parts anew; write a flat deck "
                          "(in Abaqus/CAE: Model, Edit Attributes, Do not use parts and assemblies in input files)")
        if block.name != "NODE":
            continue
        if block.options.get("SYSTEM", "R").upper() != "R":
            raise Problem(f"{block.place}: *NODE, SYSTEM={block.options['SYSTEM']}: only Cartesian nodes are read")
        for place, fields in block.rows():
            if not 2 <= len(fields) <= 7:
                raise Problem(f"{place}: {len(fields)} fields; expected a node's number and its x, y, z")
            labels.append(whole(fields[0], place))
            place_of = [number(field or "0", place) for field in fields[1:4]]
            positions.append(place_of + [0.0] * (3 - len(place_of)))
    return np.array(labels, np.int64), np.array(positions, float).reshape(-1, 3)


# ---- Nastran


class Card:
    """One bulk data card: its fields as texts, the name left out; absent ones are ''."""

    def __init__(self, place, name):
        self.place, self.name, self.fields = place, name, []

    def field(self, index):
        """Field `index` as Nastran counts them: 2 is the first after the name."""
        return self.fields[index - 2] if index - 2 < len(self.fields) else ""

    def whole(self, index, default=None):
        text = self.field(index)
        if text == "" and default is not None:
            return default
        return whole(text, f"{self.place}, {self.name}, field {index}")

    def number(self, index, default=None):
        text = self.field(index)
        if text == "" and default is not None:
            return default
        return number(text, f"{self.place}, {self.name}, field {index}")


def fields_of(line):
    """The first field of a line of bulk data and the others: free, small or large fields."""
    if "," in line:
        fields = [field.strip() for field in line.split(",")]
        wide = fields[0].endswith("*")
        data = fields[1:5] if wide else fields[1:9]
    else:
        line = line.expandtabs(8)
        wide = line[:8].rstrip().endswith("*") or line.startswith("*")
        width, count = (16, 4) if wide else (8, 8)
        fields = [line[:8].strip()]
        data = [line[8 + i * width : 8 + (i + 1) * width].strip() for i in range(count)]
    return fields[0], data + [""] * ((4 if wide else 8) - len(data))


def cards_of(file, depth=0):
    """The cards of the bulk data. What stands before BEGIN BULK is left out."""
    lines = [(n, line.split("$")[0].rstrip()) for n, line in lines_of(file)]
    begin = next((i + 1 for i, (_, line) in enumerate(lines) if line.upper().split()[:2] == ["BEGIN", "BULK"]), 0)
    cards = []
    for n, line in lines[begin:]:
        if not line.strip():
            continue
        place = f"{file}, line {n}"
        if line.upper().startswith("ENDDATA"):
            break
        if line.upper().startswith("INCLUDE"):
            cards += cards_of(included(file, line[7:], depth), depth + 1)
            continue
        first, data = fields_of(line)
        if first == "" or first[0] in "+*":
            if not cards:
                raise Problem(f"{place}: a continuation; expected a card, such as GRID")
            cards[-1].fields += data
        else:
            cards.append(Card(place, first.rstrip("*").upper()))
            cards[-1].fields += data
    return cards


def nastran_nodes(cards):
    """Numbers and positions of all GRID cards, in order."""
    grids = [card for card in cards if card.name == "GRID"]
    systems = Systems(cards)
    default = next((card.field(3) for card in cards if card.name == "GRDSET"), "")
    labels, positions = [], []
    for card in grids:
        labels.append(card.whole(2))
        place = f"{card.place}, GRID {card.field(2)}"
        system = whole(card.field(3) or default or "0", place)
        positions.append(systems.position(system, [card.number(i, 0.0) for i in (4, 5, 6)], place))
    return np.array(labels, np.int64), np.array(positions).reshape(-1, 3)


class Systems:
    """Coordinate systems by number: CORD2R, CORD2C and CORD2S, each by three points in another system."""

    def __init__(self, cards):
        self.cards = {card.whole(2): card for card in cards if re.fullmatch(r"CORD[12][RCS]", card.name)}
        self.known = {0: (np.zeros(3), np.eye(3))}

    def frame(self, number, place, depth=0):
        """Origin, and the axes in the columns of a matrix, both in the basic system."""
        if number in self.known:
            return self.known[number]
        card = self.cards.get(number)
        if card is None:
            raise Problem(f"{place}: coordinate system {number}: expected its card, CORD2R, CORD2C or CORD2S")
        if card.name.startswith("CORD1"):
            raise Problem(f"{card.place}: {card.name} {number} is given by nodes: expected CORD2R, CORD2C or CORD2S")
        if depth > len(self.cards):
            raise Problem(f"{card.place}: coordinate system {number} is given in itself")
        base = card.whole(3, 0)
        self.frame(base, card.place, depth + 1)
        origin, on_z, in_plane = (self.position(base, [card.number(i + k, 0.0) for k in range(3)], card.place) for i in (4, 7, 10))
        z, x = on_z - origin, in_plane - origin
        y = np.cross(z, x)
        if not np.linalg.norm(y) > 1e-12 * np.linalg.norm(z) * np.linalg.norm(x):
            raise Problem(f"{card.place}: the three points of coordinate system {number} lie on a line")
        z, y = z / np.linalg.norm(z), y / np.linalg.norm(y)
        self.known[number] = origin, np.stack([np.cross(y, z), y, z], axis=1)
        return self.known[number]

    def position(self, number, at, place):
        """Basic coordinates of a point that is given in a system."""
        origin, axes = self.frame(number, place)
        a, b, c = at
        kind = self.cards[number].name[-1] if number else "R"
        if kind == "C":
            a, b = a * np.cos(np.radians(b)), a * np.sin(np.radians(b))
        elif kind == "S":  # radius, angle from z, angle about z
            polar, around = np.radians(b), np.radians(c)
            a, b, c = a * np.sin(polar) * np.cos(around), a * np.sin(polar) * np.sin(around), a * np.cos(polar)
        return origin + axes @ np.array([a, b, c])

    def are_basic_axes(self, number, place):
        """Whether motions along the axes of a system are those along x, y and z."""
        if number == 0:
            return True
        _, axes = self.frame(number, place)
        return self.cards[number].name[-1] == "R" and np.abs(axes - np.eye(3)).max() < 1e-12
