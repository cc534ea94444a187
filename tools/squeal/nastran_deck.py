"""Decks of Nastran and OptiStruct to a mesh_model.Model: nodes, elements, properties, materials, supports, sets; other
cards by the handlers of nastran_joining. Names come from the comments that preprocessors write."""

import re
from collections import Counter

import numpy as np
from squeal.common import counted
from squeal import nastran_bolts
from squeal import nastran_contacts
from squeal import nastran_joining
from squeal.deck_files import Problem, lines_of, number, span, undefined, whole
from squeal.mesh_model import FLAT, MOTIONS, Model, corners_of
from squeal.nastran_cards import Placed, Systems, cards_of, is_blank, nastran_nodes, sections_of, table_of, wholes
from squeal.nastran_properties import note_shell_fields, read_materials, read_properties

ELEMENTS = {("CHEXA", 8): "hex8", ("CHEXA", 20): "hex20", ("CPENTA", 6): "wedge6", ("CPENTA", 15): "wedge15", ("CPYRAM", 5): "pyramid5",
            ("CPYRAM", 13): "pyramid13", ("CPYRA", 5): "pyramid5", ("CPYRA", 13): "pyramid13", ("CTETRA", 4): "tet4",
            ("CTETRA", 10): "tet10", ("CQUAD4", 4): "quad4", ("CTRIA3", 3): "tri3", ("CTRIA6", 6): "tri6", ("CTRIA6", 3): "tri3", ("CQUAD8", 8): "quad8",
            ("CQUAD8", 4): "quad4", ("CQUADR", 4): "quad4", ("CTRIAR", 3): "tri3"}
CORNERS = {"CHEXA": (8, 20), "CPENTA": (6, 15), "CTETRA": (4, 10), "CQUAD4": (4, 4), "CTRIA3": (3, 3), "CTRIA6": (6, 6),
           "CQUAD8": (8, 8), "CQUADR": (4, 4), "CTRIAR": (3, 3), "CPYRAM": (5, 13), "CPYRA": (5, 13)}
LINEAR_SHELLS = ("CQUAD4", "CTRIA3", "CQUADR", "CTRIAR")  # whose fields behind the nodes are others
UPPER = {"EIGRL": 4, "EIGRA": 4, "EIGR": 5}  # fields of the highest frequency
READ = {*UPPER, "GRID", "GRDSET", "CORD2R", "CORD2C", "CORD2S", "CORD1R", "CORD1C", "CORD1S", "PSOLID", "PSHELL", "MAT1", "MAT2", "MAT8", "MAT9", "MATORT", "SPC", "SPC1", "SPCADD",
        "SET1", "SET3", "PARAM", "ENDDATA", *CORNERS, *nastran_joining.READ, *nastran_bolts.READ, *nastran_contacts.READ}


class Deck:
    """What the handlers of cards share."""

    def __init__(self, file, lines, cards):
        self.model, self.cards = Model(file), cards
        self.names = names_in_comments(lines)
        self.systems, self.turned = Systems(cards), {}
        self.properties = {(card.name, card.field(2)): card for card in cards if card.name in nastran_joining.PROPERTIES}
        self.surfaces = {}  # names of SURF and SET by their numbers
        self.pressed = {}  # faces by pressure
        self.listed = listed

    def line_of(self, card):
        file, _, line = card.place.rpartition(", ")
        return line if file == str(self.model.source) else card.place

    def has_unread(self, beginning, number):
        """Whether a card of such a name that is left out has this number."""
        return any(card.name not in READ and card.name.startswith(beginning) and card.field(2) == number for card in self.cards)

    def note(self, what, card):
        self.model.notes.append(f"{what} ({self.line_of(card)})")

    def number(self, text, card):
        return number(text, f"{card.place}, {card.name}")

    def new_set(self, name, nodes):
        name = self.model.unused(name)
        self.model.node_sets[name] = nodes
        return name

    def distance(self, a, b):
        nodes = self.model.nodes
        return float(np.linalg.norm(nodes[b] - nodes[a])) if a in nodes and b in nodes else 0.0

    def frame_between(self, card, a, b, index):
        """Axes of a line from node to node: x along it, y in the plane of a vector or node of the card; None without one."""
        nodes = self.model.nodes
        if a not in nodes or b not in nodes:
            return None
        if card.field(index) and not card.field(index + 1) and card.field(index).isdecimal():
            plane = nodes.get(card.whole(index), nodes[a]) - nodes[a]
        else:
            plane = np.array([card.number(i, 0.0) for i in range(index, index + 3)])
        x = nodes[b] - nodes[a]
        z = np.cross(x, plane)
        if not np.linalg.norm(z) > 1e-9 * np.linalg.norm(x) * np.linalg.norm(plane):
            return None
        x, z = x / np.linalg.norm(x), z / np.linalg.norm(z)
        return np.stack([x, np.cross(z, x), z], axis=1)

    def face_of(self, number, grids):
        """The face of an element that two grids name: opposite corners, of triangles one corner, of tetrahedra one
        corner and the node that is off the face; of pyramids one corner of the base, or two of a triangle."""
        kind, nodes = self.model.elements.get(number, (None, ()))
        if kind is None or not set(grids) <= set(nodes):
            return None
        if kind in FLAT:
            return nodes
        for face in self.model.faces(number):
            corners = face[: len(corners_of(face))]
            if kind.startswith("tet"):
                if len(grids) == 2 and grids[0] in corners and grids[1] not in corners:
                    return face
            elif kind.startswith("pyramid") and len(grids) == 1:
                if len(corners) == 4 and grids[0] in corners:
                    return face
            elif len(grids) == 1 and len(corners) == 3 and grids[0] in corners:
                return face
            elif len(grids) == 2 and len(corners) == 4 and grids[0] in corners and corners[corners.index(grids[0]) - 2] == grids[1]:
                return face
            elif len(grids) == 2 and len(corners) == 3 and set(grids) <= set(corners):
                return face
        return None


def read_bdf(file):
    lines = list(lines_of(file))
    control, bulk = sections_of(lines)
    cards = cards_of(file, bulk)
    deck = Deck(file, lines, cards)
    model = deck.model
    labels, positions = nastran_nodes(cards)
    model.nodes = dict(zip(labels.tolist(), positions))
    if not model.nodes:
        raise Problem(f"{file}: no GRID")
    left_out = Counter(card.name for card in cards if card.name not in READ)
    if left_out:
        model.notes.append("the cards " + ", ".join(f"{name} ({count})" for name, count in sorted(left_out.items())))
    of_property = {}
    for name, found in cards.elements.items():
        read_elements(name, found, model, of_property)
    note_shell_fields(cards, model)
    read_materials(cards, deck)
    read_properties(cards, deck, of_property)
    case = "\n".join(line for _, line in control)
    deck.turned = turned_nodes(cards)
    read_supports(cards, case, deck)
    read_sets(cards, case, deck)
    for name in ("SURF", None):  # surfaces before contacts
        for card in cards:
            if card.name in nastran_joining.HANDLERS and (card.name == "SURF") == (name == "SURF"):
                nastran_joining.HANDLERS[card.name](card, deck)
    nastran_contacts.read_contacts(cards, case, deck)
    nastran_joining.read_loads(cards, case, deck)
    nastran_bolts.read_bolts(cards, case, deck)
    model.band = max((card.number(UPPER[card.name], 0.0) for card in cards if card.name in UPPER), default=0.0)
    return model


def read_elements(name, cards, model, of_property):
    """Cards of one form at once, others one by one."""
    alike = {}
    for card in cards:
        alike.setdefault(len(card.texts), []).append(card)
    for of in alike.values():
        if not read_at_once(name, of, model, of_property):
            for card in of:
                read_element(card, model, of_property)


def read_at_once(name, cards, model, of_property):
    """Whether all have as many nodes, and nothing is wrong with them."""
    texts = table_of(cards)
    most = CORNERS[name][1]
    if texts is None or texts.shape[1] < 2 + most and name in LINEAR_SHELLS:
        return False
    given = ~is_blank(texts[:, : 2 + most])
    count = int(given[0].sum())
    if not (given == (np.arange(given.shape[1]) < count)).all() or (name, count - 2) not in ELEMENTS:
        return False
    table = wholes(texts[:, :count])
    if table is None or not model.add_elements(Placed(cards), ELEMENTS[name, count - 2], table[:, [0, *range(2, count)]], "nastran"):
        return False
    order = np.argsort(table[:, 1], kind="stable")
    pids, first = np.unique(table[order, 1], return_index=True)
    for pid, numbers in zip(pids.tolist(), np.split(table[order, 0], first[1:])):
        of_property.setdefault(pid, []).extend(numbers.tolist())
    return True


def read_element(card, model, of_property):
    fewest, most = CORNERS[card.name]
    texts = card.fields[2 : 2 + most]
    while texts and texts[-1] == "":
        texts.pop()
    if "" in texts:
        raise Problem(f"{card.place}: {card.name} {card.field(2)} lacks some of its mid-side nodes; expected all or none")
    if card.name in LINEAR_SHELLS:
        texts = texts[:fewest]
    if (card.name, len(texts)) not in ELEMENTS:
        known = [str(count) for name, count in ELEMENTS if name == card.name]
        raise Problem(f"{card.place}: {card.name} {card.field(2)} has {len(texts)} nodes; expected {' or '.join(known)}")
    nodes = [card.whole(4 + i) for i in range(len(texts))]
    number = card.whole(2)
    model.add_element(card.place, number, ELEMENTS[card.name, len(texts)], nodes, "nastran")
    of_property.setdefault(card.whole(3, number), []).append(number)


KEYWORDS = {"PROP": "PROP", "CONTACTSURF": "SURF", "SET": "SET"}


def names_in_comments(lines):
    """Names by keyword and number, as HyperMesh, ANSA and Simcenter write them into comments."""
    names = {}
    for _, line in lines:
        if line[:1] == "P":
            if (found := re.match(r"P(?:SOLID|SHELL)\W+(\d+)", line)) and "next" in names:
                names["PROP", found[1]] = names.pop("next")
        if line[:1] != "$":
            continue
        if found := re.match(r'\$HMNAME (\w+)\s+(\d+)\s*"([^"]+)"', line):
            names[KEYWORDS.get(found[1], found[1]), found[2]] = found[3]
        elif found := re.match(r'\$HMSET\s+(\d+)\s+\d+\s*"([^"]+)"', line):
            names["SET", found[1]] = found[2]
        elif found := re.match(r"\$ANSA_NAME(?:_COMMENT)?;(\d+);P\w+;([^;]+)", line):
            names["PROP", found[1]] = found[2]
        elif found := re.match(r"\$\*\s+Property:\s*(.+)", line):
            names["next"] = found[1].strip()
    return names


def listed(texts, place, largest=0):
    """Numbers of a list with THRU, BY and EXCEPT; what EXCEPT names is out while it is in the range before it. Ranges end at
    the largest number that the deck has of what is listed, if that is given."""
    words, found, i = [text.upper() for text in texts if text], [], 0

    def number_at(i):
        if i >= len(words) or not words[i].isdecimal():
            raise Problem(f"{place}: '{' '.join(words[max(i - 2, 0) : i + 1])}': expected numbers, or first THRU last")
        return int(words[i])

    while i < len(words):
        first = last = number_at(i)
        step, i = 1, i + 1
        if words[i : i + 1] == ["THRU"]:
            last, i = number_at(i + 1), i + 2
        if words[i : i + 1] == ["BY"]:
            step, i = number_at(i + 1), i + 2
        if last > largest >= first:
            last = largest
        chosen = span(first, last, step, place, "THRU")
        if words[i : i + 1] == ["EXCEPT"]:
            i += 1
            out = set()
            while i < len(words) and first <= number_at(i) <= last and words[i + 1 : i + 2] != ["THRU"]:
                out.add(number_at(i))
                i += 1
            chosen = [n for n in chosen if n not in out]
        found += chosen
    return found


def read_supports(cards, case, deck):
    """Of each set number and its motions, a set of nodes; the motions that GRID holds too. Nodes of solids have no
    rotations; nodes that no element has are held as reference points."""
    model = deck.model
    default = cards.default(8)
    applied = applied_supports(cards, case, model)
    held = {}
    for card in cards:
        if card.name in ("SPC", "SPC1") and card.whole(2) not in applied:
            continue
        if card.name == "SPC1":
            nodes = [n for n in listed(card.fields[2:], card.place, max(model.nodes)) if n in model.nodes]
            held.setdefault((card.field(2), card.field(3), 0.0), []).extend(nodes)
            if not nodes:
                deck.note(f"SPC1 {card.field(2)} of nodes that are not defined", card)
        elif card.name == "SPC":
            for i in (3, 6):
                if card.field(i) and card.whole(i) not in model.nodes:
                    deck.note(f"SPC {card.field(2)} of node {card.field(i)}, which is not defined", card)
                elif card.field(i):
                    held.setdefault((card.field(2), card.field(i + 1), card.number(i + 2, 0.0)), []).append(card.whole(i))
    for card in cards.odd_grids:
        if (card.field(8) or default).strip("0"):
            held.setdefault(("grid", card.field(8) or default, 0.0), []).append(card.whole(2))
    used = {node for _, nodes in model.elements.values() for node in nodes}
    turning, idle = model.nodes_with_rotations(), 0
    for (number, digits, value), nodes in held.items():
        if not digits.strip("0"):  # of scalar points and temperatures
            model.notes.append(f"SPC {number} of {counted(len(nodes), 'node')} without motions from 1 to 6")
            continue
        if not digits.isdecimal() or not set(digits) <= set("123456"):
            raise Problem(f"{model.source}: SPC {number} holds '{digits}'; expected digits from 1 to 6")
        motions = [MOTIONS[int(digit) - 1] for digit in sorted(set(digits))]
        for n in nodes:
            if n not in used:
                model.joints.held.setdefault(n, set()).update(motions)
                model.joints.moved.setdefault(n, {}).update(dict.fromkeys(motions, value) if value else {})
        moving = [n for n in dict.fromkeys(nodes) if n in turning or set(digits) & set("123")]
        idle += len(set(nodes) - set(moving))
        hold(deck, f"spc_{number}_{digits}", motions, value, moving)
    if idle:
        model.notes.append(f"the held rotations of {idle} nodes that have none, as nodes of solids")


def hold(deck, name, motions, value, nodes):
    """A support of these nodes for each system that their motions are in."""
    model, by_system = deck.model, {}
    for n in nodes:
        whole_motion = {"x", "y", "z"} <= set(motions) and len(motions) in (3, 6) and not value
        by_system.setdefault(0 if whole_motion else deck.turned.get(n, (0,))[0], []).append(n)
    for system, found in by_system.items():
        shown = name + (f"_in_{system}" if system else "") + (f"_by_{value:g}" if value else "")
        keys = deck.systems.keys(system, str(model.source)) if system else {}
        for key, of in (("displacement", MOTIONS[:3]), ("rotation", MOTIONS[3:])):
            if value and set(of) & set(motions):
                keys = {**keys, key: [value if m in motions else 0.0 for m in of]}
        model.node_sets[shown] = found
        model.supports.append((shown, motions, keys))


def applied_supports(cards, case, model):
    """Numbers of the SPC and SPC1 that the case control selects, of all its subcases; all where it selects none."""
    known = {card.whole(2): card.field(2) for card in cards if card.name in ("SPC", "SPC1")}
    sums = {}
    for card in cards:
        if card.name == "SPCADD":
            sums.setdefault(card.whole(2), []).extend(listed(card.fields[1:], card.place))
    selected = {int(n) for n in re.findall(r"^\s*SPC\s*=\s*(\d+)", case, flags=re.M | re.I)}
    if not selected:
        if len(known) > 1:
            model.notes.append(f"a choice of supports in the case control: all are there, SPC {joined(known)}")
        return set(known)
    if len(selected) > 1:
        model.notes.append(f"the choice of supports by subcases: all are there, SPC {joined(selected)}")
    applied = set()
    for n in selected:
        applied |= {n} if n not in sums else {n, *sums[n]}
    missing = applied - set(known) - set(sums)
    if missing:
        raise undefined(model.source, "case control, SPC: the set", joined(missing), [*known, *sums])
    others = set(known) - applied
    if others:
        model.notes.append(f"SPC {joined(others)}, which the case control does not select")
    return applied


def joined(numbers):
    return ", ".join(map(str, sorted(numbers)))


def turned_nodes(cards):
    """Number of the system and place, of the nodes whose motions are along other axes than the basic ones."""
    systems = Systems(cards)
    default = cards.default(7)
    found = {}
    for card in cards.odd_grids:
        if card.field(7) or default:
            system = whole(card.field(7) or default, card.place)
            if system not in (-1, 0) and not systems.are_basic_axes(system, card.place):
                found[card.whole(2)] = (system, card.place)
    return found


def read_sets(cards, case, deck):
    """SET1 is of nodes, SET and SET3 say what they are of; the case control's SET may be of nodes, elements or others."""
    model = deck.model
    largest = max(max(model.nodes), max(model.elements, default=0))
    for card in cards:
        name = deck.names.get(("SET", card.field(2)), f"set_{card.field(2)}")
        if card.name == "SET1":
            add_set(model, name, listed(card.fields[1:], card.place, largest), "GRID")
        elif card.name == "SET3":
            add_set(model, name, listed(card.fields[2:], card.place, largest), card.field(3).upper())
        elif card.name == "SET" and card.field(4).upper() in ("LIST", ""):
            kind = {"NODE": "GRID", "GRID": "GRID", "ELEM": "ELEM"}.get(card.field(3).upper(), card.field(3))
            add_set(model, name, listed(card.fields[8:], card.place, largest), kind)
            deck.surfaces.setdefault(card.field(2), name)
        elif card.name == "SET":
            deck.note(f"{name}, a SET of {card.field(3)} by {card.field(4)}", card)
    for number, items in re.findall(r"^\s*SET\s+(\d+)\s*=((?:[^\n]*,\s*\n)*[^\n]*)", case, flags=re.M | re.I):
        try:
            numbers = listed(items.replace(",", " ").split(), "", largest)
        except Problem:
            model.notes.append(f"SET {number} of the case control, which is no list of numbers")
            continue
        add_set(model, f"set_{number}", numbers, "GRID")


def add_set(model, name, items, kind):
    items = list(dict.fromkeys(items))
    if kind == "GRID":
        known = [n for n in items if n in model.nodes]
        if known:
            model.node_sets.setdefault(name, []).extend(known)
    elif kind.startswith("ELEM"):
        known = [n for n in items if n in model.elements]
        solids, flat = model.solids_and_faces(known)
        if solids:
            model.element_sets.setdefault(name, []).extend(solids)
        if flat:
            model.surfaces.setdefault(name, []).extend(flat)
    else:
        model.notes.append(f"{name}, a set of {kind}")
        return
    if len(known) < len(items):
        what = "nodes" if kind == "GRID" else "elements of the mesh"
        model.notes.append(f"{len(items) - len(known)} of the {len(items)} numbers of {name}, which are no {what}")
