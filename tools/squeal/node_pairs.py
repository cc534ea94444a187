"""Contact pairs of two nodes each: from a list, positions and a motion of the rotor to B, gap and drive.

The rules are those of a scene's [[contact]]: the normal points out of the rotor, and without tangents the first one is along
the rotor's velocity.
"""

import csv
import math
import re

import numpy as np
import scipy.sparse as sparse
from squeal.abaqus_nodes import abaqus_nodes
from squeal.deck_files import Problem, blocks_of, number, whole
from squeal.nastran_cards import Systems, cards_of, nastran_nodes

COLUMNS = ("rotor", "stator", "nx", "ny", "nz", "area", "gap")
AXES = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1)}
ROUNDING = 1e-6  # of the model's size: positions in decks have as many digits
ROTATION_KEYS = {"axis": (str, list), "centre": list, "rate": (int, float)}


def read_nodes(file):
    """Positions of nodes by number, of an Abaqus or Nastran deck, or `node, x, y, z` a line; and the axes of the
    motions of those whose displacement system is turned, in the columns of a matrix."""
    ending, turned = file.suffix.lower(), {}
    if ending == ".inp":
        blocks = blocks_of(file)
        labels, positions = abaqus_nodes(blocks)
        if place := next((block.place for block in blocks if block.name == "TRANSFORM"), None):
            raise Problem(f"{place}: *TRANSFORM turns the motions of nodes; expected rows along x, y and z: write the "
                          "matrices without it, and take it out of the deck")
    elif ending in (".bdf", ".nas", ".dat"):
        cards = cards_of(file)
        labels, positions = nastran_nodes(cards)
        turned = turned_axes(cards, dict(zip(labels.tolist(), positions)))
    else:
        rows = [(place, fields) for place, fields in rows_of(file) if fields[0].lstrip("-").isdigit()]
        for place, fields in rows:
            if len(fields) != 4:
                raise Problem(f"{place}: {len(fields)} values; expected a node's number and its x, y, z")
        labels = np.array([whole(fields[0], place) for place, fields in rows], np.int64)
        positions = np.array([[number(text, place) for text in fields[1:]] for place, fields in rows]).reshape(-1, 3)
    if not len(labels):
        raise Problem(f"{file}: no nodes; expected *NODE, GRID, or lines 'node, x, y, z'")
    if not np.isfinite(positions).all():
        wrong = labels[~np.isfinite(positions).all(axis=1)][0]
        raise Problem(f"{file}: node {wrong} has a position that is no finite number")
    known = dict(zip(labels.tolist(), positions))
    if len(known) < len(labels):
        raise Problem(f"{file}: {len(labels) - len(known)} node(s) are there twice")
    return known, turned


def turned_axes(cards, positions):
    """Of each GRID with a displacement system (CD) that is not along x, y and z: its axes at the node, in columns."""
    systems, found, default = Systems(cards), {}, cards.default(7)
    for card in cards.odd_grids:
        place, node = f"{card.place}, GRID {card.field(2)}", card.whole(2)
        system = whole(card.field(7) or default or "0", place)
        if system > 0 and not systems.are_basic_axes(system, place):  # -1 is a point of a fluid
            axes = axes_at(systems, system, positions[node], place)
            found[node] = np.where(abs(axes) < 1e-12, 0.0, axes)
    return found


def axes_at(systems, system, position, place):
    """On the axis of a cylinder or sphere there is no radius: the system's own axes hold, as in Nastran."""
    origin, axes = systems.frame(system, place)
    x, y, z = axes.T @ (position - origin)
    kind, radius = systems.cards[system].name[-1], np.hypot(x, y)
    if kind == "R" or radius <= 1e-12 * np.linalg.norm(position - origin) or radius == 0:
        return axes
    c, s = x / radius, y / radius
    if kind == "C":
        return axes @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    sin, cos = np.array([radius, z]) / np.hypot(radius, z)
    return axes @ np.array([[sin * c, cos * c, -s], [sin * s, cos * s, c], [cos, -sin, 0]])


def to_basic_axes(labels, turned):
    """T of u = T u_new, whose rows of turned nodes are along x, y and z, and the labels of u_new."""
    rows = {}
    for row, (node, dof) in enumerate(labels.tolist()):
        if node in turned and 1 <= dof <= 6:
            rows.setdefault((node, dof > 3), []).append(row)
    labels, i, j, values = labels.copy(), [], [], []
    for (node, rotational), own in rows.items():
        along = labels[own, 1] - (4 if rotational else 1)
        axes = turned[node][:, along]
        basic = np.flatnonzero(axes.any(axis=1))
        if len(basic) != len(own):
            raise Problem(f"node {node}: the matrices have the motions {', '.join(map(str, labels[own, 1]))} of its "
                          "displacement system alone, which no motions along x, y and z are: write the matrices before "
                          "supports take rows out, or with displacement systems along x, y and z")
        i += np.repeat(own, len(own)).tolist()
        j += own * len(own)
        values += axes[basic].T.ravel().tolist()
        labels[own, 1] = basic + (4 if rotational else 1)
    others = np.setdiff1d(np.arange(len(labels)), i)
    places = np.concatenate([[i, j], [others, others]], axis=1).astype(np.int64)
    return sparse.csr_matrix((np.r_[values, np.ones(len(others))], places), (len(labels), len(labels))), labels


def rows_of(file):
    """(place, fields) of the lines of a text with commas or blanks; what follows a # is left out."""
    with open(file, encoding="utf-8", errors="replace", newline="") as stream:
        for n, line in enumerate(stream, 1):
            line = line.split("#")[0].strip()
            fields = next(csv.reader([line])) if "," in line else line.split()
            if fields:
                yield f"{file}, line {n}", [field.strip() for field in fields]


def read_pairs(file):
    """(place, values by the names of COLUMNS) of every pair. A first line of names says which columns there are; without it
    they are rotor, stator, then the normal, then the area, then the gap."""
    pairs, columns = [], None
    for place, fields in rows_of(file):
        if columns is None:
            named = not re.fullmatch(r"[-+]?\d+", fields[0])
            columns = [name.lower() for name in fields] if named else list(COLUMNS[: len(fields)])
            normals = {"nx", "ny", "nz"} & set(columns)
            if set(columns) - set(COLUMNS) or columns[:2] != ["rotor", "stator"] or len(normals) not in (0, 3):
                raise Problem(f"{place}: columns {', '.join(columns)}: expected rotor, stator[, nx, ny, nz][, area][, gap]")
            if named:
                continue
        if len(fields) != len(columns):
            raise Problem(f"{place}: {len(fields)} values; expected {len(columns)}: {', '.join(columns)}")
        pair = {name: whole(text, place, "a node's number") if name in COLUMNS[:2] else number(text, place)
                for name, text in zip(columns, fields)}
        if pair["rotor"] == pair["stator"]:
            raise Problem(f"{place}: node {pair['rotor']} is in contact with itself")
        if pair.get("area", 1) <= 0:
            raise Problem(f"{place}: area {pair['area']}: expected a positive number")
        pairs.append((place, pair))
    if not pairs:
        raise Problem(f"{file}: no pairs; expected lines 'rotor node, stator node'")
    return pairs


def vector_of(value, place, expected="three numbers"):
    is_vector = isinstance(value, (list, tuple)) and len(value) == 3
    if not is_vector or not all(type(x) in (int, float) and math.isfinite(x) for x in value):
        raise Problem(f"{place} = {value}: expected {expected}")
    return np.array(value, float)


def direction_of(value, place):
    """Unit vector of "x", "y", "z" or three numbers."""
    expected = '"x", "y", "z" or a vector of three numbers'
    vector = vector_of(AXES.get(value, value) if isinstance(value, str) else value, place, expected)
    if not np.linalg.norm(vector) > 0:
        raise Problem(f"{place} = {value}: expected {expected}, not zero")
    return vector / np.linalg.norm(vector)


def check_motion(contact, place):
    """The rules of a scene's [[contact]] for the motion of its rotor."""
    if "rotation" in contact and "velocity" in contact:
        raise Problem(f"{place}: rotation and velocity exclude each other: keep one")
    rotation = contact.get("rotation", {"axis": "z", "rate": 0})
    for key in ("axis", "rate"):
        if key not in rotation:
            raise Problem(f"{place}, rotation: needs the key '{key}', as in "
                          '{ axis = "z", centre = [0, 0, 0], rate = 20 }')
    direction_of(rotation["axis"], f"{place}, rotation.axis")
    vector_of(rotation.get("centre", [0, 0, 0]), f"{place}, rotation.centre", "three numbers [m]")
    if not math.isfinite(rotation["rate"]):
        raise Problem(f"{place}, rotation.rate = {rotation['rate']}: expected a number [rad/s]")
    vector_of(contact.get("velocity", [0, 0, 0]), f"{place}, velocity", "three numbers [m/s]")
    if isinstance(contact.get("tangents"), list) and not 1 <= len(contact["tangents"]) <= 2:
        raise Problem(f"{place}, tangents: {len(contact['tangents'])} directions; expected one or two")


def velocity_at(contact, position):
    """Velocity of the rotor's surface [m/s]."""
    if "rotation" in contact:
        rotation = contact["rotation"]
        arm = position - np.array(rotation.get("centre", (0, 0, 0)), float)
        return float(rotation["rate"]) * np.cross(direction_of(rotation["axis"], "rotation.axis"), arm)
    return np.array(contact.get("velocity", (0, 0, 0)), float)


def tangents_at(contact, normal, velocity, place):
    """One or two unit vectors square to the normal."""
    wanted = contact.get("tangents", [])
    wanted = [direction_of(t, f"{place} tangents") for t in ([wanted] if isinstance(wanted, str) else wanted)]
    given = len(wanted)
    if not wanted:
        axis = np.eye(3)[np.argmin(abs(normal))]
        wanted = [velocity if np.linalg.norm(square(velocity, normal)) > 0 else axis]
    first = square(wanted[0], normal)
    if not np.linalg.norm(first) > 0:
        raise Problem(f"{place}: the first tangent is along the normal")
    first /= np.linalg.norm(first)
    second = np.cross(normal, first)
    if given == 2 and wanted[1] @ second < 0:
        second = -second
    return [first] if given == 1 else [first, second]


def square(vector, normal):
    """The part square to the normal; zero when only rounding is left."""
    part = vector - (vector @ normal) * normal
    return part if np.linalg.norm(part) > 1e-12 * np.linalg.norm(vector) else np.zeros(3)


class Side:
    """What a node's displacement is on the rows of the matrices."""

    def __init__(self, labels, nodes):
        self.rows = {(int(node), int(dof)): row for row, (node, dof) in enumerate(labels)}
        self.known = {int(node) for node in labels[:, 0]}
        self.nodes = nodes

    def position(self, node, place):
        if node not in self.nodes:
            raise Problem(f"{place}: node {node} has no position")
        return self.nodes[node]

    def entries(self, node, direction, place):
        """(row, coefficient) of direction . u(node); what supports hold has none."""
        if node not in self.known and node not in self.nodes:
            raise Problem(f"{place}: node {node} is neither in the matrices nor among the nodes")
        found = [(self.rows.get((node, dof + 1)), direction[dof]) for dof in range(3)]
        return [(row, factor) for row, factor in found if row is not None and factor != 0]


def normal_of(contact, pair, arm, size, place):
    if "nx" in pair:
        return direction_of([pair["nx"], pair["ny"], pair["nz"]], f"{place}: the normal")
    if "normal" in contact:
        return direction_of(contact["normal"], "[[contact]] normal")
    if np.linalg.norm(arm) <= ROUNDING * size:
        raise Problem(f"{place}: nodes {pair['rotor']} and {pair['stator']} coincide: expected a normal, out of the rotor, as "
                      "columns nx, ny, nz or as the contact's key 'normal'")
    return arm / np.linalg.norm(arm)


def make_pairs(contacts, labels, nodes, unit):
    """B, gap and drive of the contacts; nodes: positions [m] by number; unit: of the gaps in the lists [m]."""
    rows, columns, values, gaps, drive, count = [], [], [], [], [], None
    side = Side(labels, nodes)
    positions = np.array(list(nodes.values()))
    size = np.linalg.norm(np.ptp(positions, axis=0))
    row = 0
    for contact, pairs in contacts:
        for place, pair in pairs:
            ends = [side.position(pair[name], place) for name in ("rotor", "stator")]
            arm = ends[1] - ends[0]
            normal = normal_of(contact, pair, arm, size, place)
            gap = pair["gap"] * unit if "gap" in pair else arm @ normal
            if "gap" not in pair and abs(gap) <= ROUNDING * size:
                gap = 0.0
            if gap < 0 and "gap" not in pair:
                raise Problem(f"{place}: node {pair['stator']} is {-gap:.3g} m inside the rotor: turn the normal, which points "
                              "out of the rotor, or give the column gap")
            velocity = square(velocity_at(contact, ends[0]), normal)
            tangents = tangents_at(contact, normal, velocity, "[[contact]]")
            if count is None:
                count = len(tangents)
            if len(tangents) != count:
                raise Problem("[[contact]] tangents: one contact has one, another two; give all as many")
            for axis in [normal, *tangents]:
                for node, sign in ((pair["stator"], 1), (pair["rotor"], -1)):
                    for column, factor in side.entries(node, axis, place):
                        rows.append(row)
                        columns.append(column)
                        values.append(sign * factor)
                if axis is normal and (not rows or rows[-1] != row):
                    raise Problem(f"{place}: neither node can move along the normal: take the pair out of the list")
                row += 1
            gaps.append(gap)
            drive += [velocity @ axis for axis in tangents]
    B = sparse.csr_matrix((values, (rows, columns)), (row, len(labels)))
    return {"B": B, "gap": np.array(gaps), "drive": np.array(drive)}
