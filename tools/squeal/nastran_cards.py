"""Cards of the bulk data of Nastran and OptiStruct, their coordinate systems, and their tables at once where all have one form."""

import re

import numpy as np
from squeal.deck_files import Problem, included, lines_of, node_table, number, whole

ELEMENTS = ("CHEXA", "CPENTA", "CTETRA", "CPYRAM", "CPYRA", "CQUAD4", "CTRIA3", "CTRIA6", "CQUAD8", "CQUADR", "CTRIAR")
BLANK = b" " * 8


class Card:
    """One bulk data card: its fields as texts, the name left out; absent ones are ''."""

    __slots__ = ("file", "line", "name", "texts", "parsed")

    def __init__(self, file, line, name, text):
        self.file, self.line, self.name = file, line, name
        self.texts, self.parsed = [text], None

    @property
    def place(self):
        return f"{self.file}, line {self.line}"

    @property
    def fields(self):
        if self.parsed is None:
            self.parsed = [field for text in self.texts for field in fields_of(text)[1]]
        return self.parsed

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


class Cards(list):
    """All cards but those of nodes and elements, in the order of the deck; these by their names."""

    def __init__(self):
        self.grids, self.elements = [], {name: [] for name in ELEMENTS}
        self.odd_grids = self.grids  # those with a displacement system or held motions

    def add(self, card):
        (self.grids if card.name == "GRID" else self.elements.get(card.name, self)).append(card)

    def default(self, index):
        """A field of GRDSET."""
        return next((card.field(index) for card in self if card.name == "GRDSET"), "")


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


def sections_of(lines):
    """Numbered lines without comments, of the case control and of the bulk data."""
    lines = [(n, line.split("$")[0].rstrip()) for n, line in lines]
    begin = next((i + 1 for i, (_, line) in enumerate(lines) if line.lstrip()[:4].upper() == "BEGI"), 0)
    return lines[: max(begin - 1, 0)], lines[begin:]


def cards_of(file, bulk=None, depth=0, cards=None):
    """The cards of the bulk data, which are the lines of the file unless they are given."""
    cards = Cards() if cards is None else cards
    rows, names, last = iter(sections_of(lines_of(file))[1] if bulk is None else bulk), {}, None
    for n, line in rows:
        head = line[:8]
        name = names.get(head)
        if name is None:
            if not line.strip():
                continue
            name = (head.partition(",")[0] if "," in line else head.expandtabs(8)[:8]).strip().rstrip("*").upper()
            if line[:7].upper() in ("ENDDATA", "INCLUDE"):
                if line[:1] in "Ee":
                    break
                text = line[7:]
                while text.count("'") == 1 and (more := next(rows, None)):  # a name goes on in the next line
                    text += more[1].strip()
                cards_of(included(file, n, text, depth), None, depth + 1, cards)
                continue
            if name[:1] == "=" or line[0] == "=":
                raise Problem(f"{file}, line {n}: '{line[:40]}' repeats the card above: let the preprocessor write all cards")
            if name and name[0] not in "+*" and "," not in head and len(names) < 1000:
                names[head] = name
        if not name or name[0] in "+*":
            if last is None:
                raise Problem(f"{file}, line {n}: a continuation; expected a card, such as GRID")
            last.texts.append(line)
        else:
            last = Card(file, n, name, line)
            cards.add(last)
    return cards


# ---- many cards at once


def table_of(cards):
    """The fields of these cards as an array of texts; None unless all have as many lines, and small or large fields alike."""
    lines = len(cards[0].texts)
    if any(len(card.texts) != lines for card in cards):
        return None
    joined = "".join([text.ljust(72)[:72] for card in cards for text in card.texts])
    wide = joined.count("*")
    if "," in joined or "\t" in joined or "_" in joined or wide not in (0, lines * len(cards)):
        return None
    texts = np.frombuffer(joined.encode("latin-1"), "S8").reshape(len(cards), lines, 9)[:, :, 1:].reshape(len(cards), -1)
    return np.ascontiguousarray(texts).view("S16") if wide else texts


def is_blank(texts):
    return texts == (BLANK if texts.dtype == "S8" else 2 * BLANK)


def wholes(texts):
    """Whole numbers of texts; None if there is anything else."""
    try:
        return texts.astype(np.int64)
    except ValueError:
        return None


def numbers(texts, cards):
    """Numbers of texts, blank ones 0; in Nastran's forms one by one."""
    texts = np.where(is_blank(texts), b"0", texts)
    try:
        values = texts.astype(float)
    except ValueError:
        values = np.array([[number(text.decode("latin-1").strip(), card.place) for text in row] for card, row in zip(cards, texts)])
    return values if np.isfinite(values).all() else None


class Placed:
    """Where elements that were read at once are."""

    def __init__(self, cards):
        self.cards = cards

    def place_of(self, number):
        return next(card.place for card in self.cards if card.whole(2) == number)


def nastran_nodes(cards):
    """Numbers and positions of all GRID cards, in order."""
    table = table_of(cards.grids) if cards.grids and not cards.default(3) else None
    labels = None if table is None or table.shape[1] != 8 else wholes(table[:, 0])
    if labels is not None and 0 < labels.min() <= labels.max() < 2**31 and len(np.unique(labels)) == len(labels):
        positions = numbers(table[:, 2:5], cards.grids)
        if positions is not None:
            place_in_systems(table[:, 1], positions, cards)
            if not cards.default(7) and not cards.default(8):
                cards.odd_grids = [cards.grids[i] for i in np.flatnonzero(~is_blank(table[:, 5:7]).all(axis=1))]
            return labels, positions
    systems, default, nodes = Systems(cards), cards.default(3), []
    for card in cards.grids:
        place = f"{card.place}, GRID {card.field(2)}"
        system = whole(card.field(3) or default or "0", place)
        position = systems.position(system, [card.number(i, 0.0) for i in (4, 5, 6)], place)
        nodes.append((card.place, card.whole(2), position))
    return node_table(nodes)


def place_in_systems(texts, positions, cards):
    """Positions that are given in a system become those in the basic one."""
    systems = None
    for i in np.flatnonzero(~is_blank(texts)):
        card = cards.grids[i]
        system = card.whole(3)
        if system:
            systems = systems or Systems(cards)
            positions[i] = systems.position(system, positions[i], f"{card.place}, GRID {card.field(2)}")


class Systems:
    """Coordinate systems by number: CORD2R, CORD2C and CORD2S by three points in another system, CORD1R, CORD1C and CORD1S by three nodes."""

    def __init__(self, cards):
        self.grids, self.nodes, self.open = cards.grids, None, set()
        self.known = {0: (np.zeros(3), np.eye(3))}
        self.cards, self.first = {}, {}  # by number; the field of the first of the three points
        for card in cards:
            if re.fullmatch(r"CORD[12][RCS]", card.name):
                self.cards[card.whole(2)], self.first[card.whole(2)] = card, 4 if card.name[4] == "2" else 3
                if card.name[4] == "1" and card.field(6):
                    self.cards[card.whole(6)], self.first[card.whole(6)] = card, 7

    def frame(self, number, place):
        """Origin, and the axes in the columns of a matrix, both in the basic system."""
        if number in self.known:
            return self.known[number]
        card = self.cards.get(number)
        if card is None:
            raise Problem(f"{place}: coordinate system {number}: expected its card, such as CORD2R or CORD1C")
        if number in self.open:
            raise Problem(f"{card.place}: coordinate system {number} is given in itself")
        self.open.add(number)
        i = self.first[number]
        if card.name.startswith("CORD1"):
            origin, on_z, in_plane = (self.node(card.whole(i + k), card.place) for k in range(3))
        else:
            origin, on_z, in_plane = (self.position(card.whole(3, 0), [card.number(i + k, 0.0) for k in range(3)], card.place) for i in (4, 7, 10))
        self.open.discard(number)
        z, x = on_z - origin, in_plane - origin
        y = np.cross(z, x)
        if not np.linalg.norm(y) > 1e-12 * np.linalg.norm(z) * np.linalg.norm(x):
            raise Problem(f"{card.place}: the three points of coordinate system {number} lie on a line")
        z, y = z / np.linalg.norm(z), y / np.linalg.norm(y)
        self.known[number] = origin, np.stack([np.cross(y, z), y, z], axis=1)
        return self.known[number]

    def node(self, number, place):
        """Basic coordinates of a GRID, which CORD1R and its kind name."""
        self.nodes = self.nodes or {card.field(2): card for card in self.grids}
        card = self.nodes.get(str(number))
        if card is None:
            raise Problem(f"{place}: GRID {number} of a coordinate system is not defined")
        return self.position(card.whole(3, 0), [card.number(i, 0.0) for i in (4, 5, 6)], card.place)

    def position(self, number, at, place):
        """Basic coordinates of a point that is given in a system."""
        origin, axes = self.frame(number, place)
        a, b, c = at
        kind = self.kind(number)
        if kind == "C":
            a, b = a * np.cos(np.radians(b)), a * np.sin(np.radians(b))
        elif kind == "S":  # radius, angle from z, angle about z
            polar, around = np.radians(b), np.radians(c)
            a, b, c = a * np.sin(polar) * np.cos(around), a * np.sin(polar) * np.sin(around), a * np.cos(polar)
        return origin + axes @ np.array([a, b, c])

    def kind(self, number):
        return self.cards[number].name[-1] if number in self.cards else "R"

    def keys(self, number, place):
        """Keys of a scene's axes."""
        origin, axes = self.frame(number, place)
        kind = self.kind(number)
        if kind == "S":
            raise Problem(f"{place}: motions along the axes of the spherical system {number}: expected a Cartesian or "
                          "cylindrical one")
        if kind == "C":
            return {"cylinder": {"axis": axes[:, 2].tolist(), "centre": origin.tolist()}}
        return {"axis_1": axes[:, 0].tolist(), "axis_2": axes[:, 1].tolist()}

    def are_basic_axes(self, number, place):
        """Whether motions along the axes of a system are those along x, y and z."""
        if number == 0:
            return True
        _, axes = self.frame(number, place)
        return self.cards[number].name[-1] == "R" and np.abs(axes - np.eye(3)).max() < 1e-12
