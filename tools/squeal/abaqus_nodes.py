"""Nodes and elements of Abaqus that keywords make or move, as *NODE and *ELEMENT that hold them: *SYSTEM, *NGEN, *NFILL,
*NCOPY, *ELGEN, *ELCOPY, and *NODE in cylindrical or spherical coordinates."""

import numpy as np
from squeal.deck_files import Block, Problem, node_table, number, span, whole

REFUSED = {"NMAP": "maps nodes", "SYMMETRIC MODEL GENERATION": "makes nodes"}


class Made:
    """What is known while the blocks are gone through: nodes and sets of nodes and elements by number."""

    def __init__(self):
        self.origin, self.axes = np.zeros(3), np.eye(3)  # of *SYSTEM, axes in columns
        self.nodes, self.node_sets = {}, {}
        self.elements, self.element_sets = {}, {}  # (type, nodes) by number


def made_explicit(blocks):
    """The blocks with every node in global coordinates and every element in a line of its own."""
    if not any(block.name in MAKERS or block.name in REFUSED or is_curved(block) for block in blocks):
        return blocks
    made, found = Made(), []
    for block in blocks:
        if block.name in REFUSED:
            raise Problem(f"{block.place}: *{block.name} {REFUSED[block.name]}: let the preprocessor write all of them")
        if block.name in HANDLERS:
            found += HANDLERS[block.name](block, made)
        else:
            found.append(block)
        remember(found[-1:] if block.name not in HANDLERS else [], made)
    return found


def is_curved(block):
    return block.name == "NODE" and block.options.get("SYSTEM", "R").upper() not in ("R", "")


def remember(blocks, made):
    """Sets that later keywords may name; nodes and elements are remembered where they are read."""
    for block in blocks:
        key = block.name if block.name in ("NSET", "ELSET") else None
        if key and block.options.get(key):
            sets = made.node_sets if key == "NSET" else made.element_sets
            sets.setdefault(block.options[key].upper(), []).extend(members(block, sets))


def members(block, sets):
    found = []
    for place, fields in block.rows():
        if "GENERATE" in block.options and len(fields) in (2, 3):
            first, last, step = [*(whole(field or "1", place) for field in fields), 1][:3]
            found += span(first, last, step, place)
        elif "GENERATE" not in block.options:
            for field in fields:
                found += [int(field)] if field.isdecimal() else sets.get(field.upper(), [])
    return found


def floats(fields, place, count):
    """So many numbers; absent ones are 0."""
    return np.array([number(field or "0", place) for field in (list(fields) + ["0"] * count)[:count]])


def turned(start, end, angle, at):
    """A point turned by an angle in degrees about the line from start to end."""
    axis, arm, angle = (end - start) / np.linalg.norm(end - start), at - start, np.radians(angle)
    return start + np.cos(angle) * arm + np.sin(angle) * np.cross(axis, arm) + (1 - np.cos(angle)) * axis * (axis @ arm)


def explicit(name, options, block, rows):
    """A block that holds these rows, in the place of the block that makes them."""
    made = Block(block.place, name, options)
    file, _, line = block.place.rpartition(", line ")
    for row in rows:
        made.add(file, int(line), ", ".join(repr(float(v)) if isinstance(v, (float, np.floating)) else str(v) for v in row))
    return [made]


def node_block(block, made, nodes):
    options = {"NSET": block.options["NSET"]} if block.options.get("NSET") else {}
    made.nodes.update(nodes)
    if options:
        made.node_sets.setdefault(options["NSET"].upper(), []).extend(nodes)
    return explicit("NODE", options, block, [(n, *at) for n, at in nodes.items()])


def system(block, made):
    """Origin, a point of x', and in a second line a point in the plane of x' and y'. Nothing is the global system."""
    made.origin, made.axes = np.zeros(3), np.eye(3)
    rows = list(block.rows())
    if not rows or not rows[0][1]:
        return []
    place, fields = rows[0]
    made.origin = floats(fields, place, 3)
    if len(fields) > 3:
        x = floats(fields[3:], place, 3) - made.origin
        y = np.array([-x[1], x[0], 0.0]) if len(rows) < 2 else floats(rows[1][1], rows[1][0], 3) - made.origin
        z = np.cross(x, y)
        if not np.linalg.norm(z) > 1e-12 * np.linalg.norm(x) * np.linalg.norm(y):
            raise Problem(f"{rows[-1][0]}: the points of *SYSTEM lie on a line; expected an origin, a point of the x axis "
                          "and one beside it")
        made.axes = np.stack([x / np.linalg.norm(x), np.cross(z, x) / np.linalg.norm(np.cross(z, x)), z / np.linalg.norm(z)], axis=1)
    return []


def cartesian(kind, at, place):
    a, b, c = at
    if kind in ("R", ""):
        return at
    if kind == "C":  # radius, angle, height
        return np.array([a * np.cos(np.radians(b)), a * np.sin(np.radians(b)), c])
    if kind == "S":  # radius, angle about z, angle from the plane of x and y
        flat = a * np.cos(np.radians(c))
        return np.array([flat * np.cos(np.radians(b)), flat * np.sin(np.radians(b)), a * np.sin(np.radians(c))])
    raise Problem(f"{place}: SYSTEM={kind}: expected R, C or S")


def node(block, made):
    kind = block.options.get("SYSTEM", "R").upper()
    moved = kind not in ("R", "") or np.any(made.origin) or not np.array_equal(made.axes, np.eye(3))
    nodes = {}
    for place, fields in block.rows():
        if not 1 <= len(fields) <= 7:
            raise Problem(f"{place}: {len(fields)} fields; expected a node's number and its x, y, z")
        at = floats(fields[1:4], place, 3)
        nodes[whole(fields[0], place)] = made.origin + made.axes @ cartesian(kind, at, place) if moved else at
    if moved:
        return node_block(block, made, nodes)
    made.nodes.update(nodes)
    if block.options.get("NSET"):
        made.node_sets.setdefault(block.options["NSET"].upper(), []).extend(nodes)
    return [block]


def known_node(text, place, made):
    n = whole(text, place)
    if n not in made.nodes:
        raise Problem(f"{place}: node {n} is not defined above")
    return made.nodes[n]


def generated(block, made):
    """*NGEN: nodes between two, on a straight line or on an arc about a centre."""
    kind, nodes = block.options.get("LINE", "").upper(), {}
    if kind not in ("", "C"):
        raise Problem(f"{block.place}: *NGEN, LINE={kind}: expected a straight line or LINE=C")
    for place, fields in block.rows(2, "the first node, the last node[, step]"):
        first, last = whole(fields[0], place), whole(fields[1], place)
        step = whole(fields[2], place) if len(fields) > 2 and fields[2] else 1
        start, end = known_node(fields[0], place, made), known_node(fields[1], place, made)
        if last <= first or step < 1 or (last - first) % step:
            raise Problem(f"{place}: nodes {first} to {last} by steps of {step}: expected ascending numbers that a "
                          "whole number of steps reaches")
        numbers = list(span(first, last, step, place))
        nodes.update((n, start + i / (len(numbers) - 1) * (end - start) if not kind else
                      on_arc(fields, place, made, start, end, i / (len(numbers) - 1))) for i, n in enumerate(numbers))
        nodes[first], nodes[last] = start, end
    return node_block(block, made, nodes)


def on_arc(fields, place, made, start, end, share):
    more = fields[3:] + [""] * 7
    centre = known_node(more[0], place, made) if more[0] else floats(more[1:4], place, 3)
    axis = floats(more[4:7], place, 3) if any(more[4:7]) else np.cross(start - centre, end - centre)
    if not np.linalg.norm(axis) > 0:
        raise Problem(f"{place}: the arc has no plane: expected a centre beside the line of its ends, or a normal")
    a, b, axis = start - centre, end - centre, axis / np.linalg.norm(axis)
    angle = np.degrees(np.arctan2(axis @ np.cross(a, b), a @ b)) % 360
    return turned(centre, centre + axis, share * (angle or 360), start)


def filled(block, made):
    """*NFILL: nodes between those of two sets, by intervals and a step of numbers."""
    if set(block.options) - {"NSET"}:
        raise Problem(f"{block.place}: *NFILL with {', '.join(sorted(set(block.options) - {'NSET'}))}: expected even "
                      "intervals without a singularity")
    nodes = {}
    for place, fields in block.rows(4, "two sets of nodes, the number of intervals, and the step of numbers"):
        missing = [name for name in fields[:2] if name.upper() not in made.node_sets]
        if missing:
            raise Problem(f"{place}: the node set '{missing[0]}' is not defined above")
        count, step = whole(fields[2], place), whole(fields[3], place)
        if not 0 < count < 10**6:
            raise Problem(f"{place}: {count} intervals: expected 1 or more")
        for a, b in zip(made.node_sets[fields[0].upper()], made.node_sets[fields[1].upper()]):
            start, end = known_node(str(a), place, made), known_node(str(b), place, made)
            nodes.update((a + i * step, start + i / count * (end - start)) for i in range(1, count))
    return node_block(block, made, nodes)


def copied(block, made):
    """*NCOPY, SHIFT: a set moved by a vector, then turned about an axis."""
    old, options = block.options.get("OLD SET", "").upper(), block.options
    if old not in made.node_sets or "SHIFT" not in options:
        raise Problem(f"{block.place}: *NCOPY: expected OLD SET=NAME of a set that is defined above, and SHIFT")
    by, rows = whole(options.get("CHANGE NUMBER", ""), block.place), list(block.rows())
    shift = floats(rows[0][1], rows[0][0], 3) if rows else np.zeros(3)
    turn = floats(rows[1][1], rows[1][0], 7) if len(rows) > 1 else np.zeros(7)
    nodes = {}
    for n in made.node_sets[old]:
        at = known_node(str(n), block.place, made) + shift
        nodes[n + by] = turned(turn[:3], turn[3:6], turn[6], at) if np.any(turn[:3] != turn[3:6]) else at
    block.options = {"NSET": options["NEW SET"]} if options.get("NEW SET") else {}
    return node_block(block, made, nodes)


def element(block, made):
    """Remembers the elements of a block, each by its lines: one that ends in a comma goes on."""
    fields, numbers = [], []
    for text in block.texts:
        fields += [field.strip() for field in text.split(",")]
        if fields[-1] == "":
            fields.pop()
            continue
        if all(field.isdecimal() for field in fields):
            made.elements[int(fields[0])] = (block.options.get("TYPE", ""), [int(field) for field in fields[1:]])
            numbers.append(int(fields[0]))
        fields = []
    if block.options.get("ELSET"):
        made.element_sets.setdefault(block.options["ELSET"].upper(), []).extend(numbers)
    return [block]


def element_blocks(block, made, elements, name):
    """A block for each type of element."""
    found = []
    made.elements.update(elements)
    if name:
        made.element_sets.setdefault(name.upper(), []).extend(elements)
    for kind in dict.fromkeys(of for of, _ in elements.values()):
        options = {"TYPE": kind, **({"ELSET": name} if name else {})}
        found += explicit("ELEMENT", options, block, [(n, *nodes) for n, (of, nodes) in elements.items() if of == kind])
    return found


def elements_generated(block, made):
    """*ELGEN: rows, layers and blocks of elements like a master element, which stays."""
    elements, masters = {}, []
    for place, fields in block.rows(2, "the master element, the number of elements in the row, and steps"):
        master = whole(fields[0], place)
        if master not in made.elements:
            raise Problem(f"{place}: element {master} is not defined above")
        kind, nodes = made.elements[master]
        rows = [(0, 0)]
        for i in range(1, len(fields), 3):
            count, by_node, by_element = ([whole(field or "1", place) for field in fields[i : i + 3]] + [1, 1])[:3]
            if not 0 < count <= 10**7:
                raise Problem(f"{place}: {count} elements: expected 1 or more")
            rows = [(n + k * by_node, e + k * by_element) for k in range(count) for n, e in rows]
        elements.update((master + e, (kind, [node + n for node in nodes])) for n, e in rows if e)
        masters.append(master)
    name = block.options.get("ELSET", "")
    if name:
        made.element_sets.setdefault(name.upper(), []).extend(masters)
    found = element_blocks(block, made, elements, name)
    return found + (explicit("ELSET", {"ELSET": name}, block, [(n,) for n in masters]) if name else [])


def elements_copied(block, made):
    """*ELCOPY: a set with numbers of nodes and elements shifted."""
    old, options = block.options.get("OLD SET", "").upper(), block.options
    if old not in made.element_sets:
        raise Problem(f"{block.place}: *ELCOPY: expected OLD SET=NAME of a set that is defined above")
    by_node = whole(options.get("SHIFT NODES", ""), block.place)
    by = whole(options.get("ELEMENT SHIFT", ""), block.place)
    elements = {n + by: (made.elements[n][0], [node + by_node for node in made.elements[n][1]]) for n in made.element_sets[old]}
    return element_blocks(block, made, elements, options.get("NEW SET", ""))


HANDLERS = {"SYSTEM": system, "NGEN": generated, "NFILL": filled, "NCOPY": copied, "ELGEN": elements_generated,
            "ELCOPY": elements_copied, "NODE": node, "ELEMENT": element}
MAKERS = set(HANDLERS) - {"NODE", "ELEMENT"}


def abaqus_nodes(blocks):
    """Numbers and positions of all *NODE blocks of a flat deck, in order."""
    tables, slow = [], []
    blocks = made_explicit(blocks)
    for block in blocks:
        if block.name in ("INSTANCE", "ASSEMBLY"):
            raise Problem(f"{block.place}: *{block.name}: the solver numbers the nodes of parts anew; write a flat deck "
                          "(in Abaqus/CAE: Model, Edit Attributes, Do not use parts and assemblies in input files)")
        if block.name == "NODE" and block.texts:
            table = block.table(4, float)
            slow += [block] if table is None else []
            tables.append(table)
    if not slow and tables:
        table = np.concatenate(tables)
        labels = table[:, 0].astype(np.int64)
        if len(np.unique(labels)) == len(labels) and labels.min() > 0 and labels.max() < 2**31 and (labels == table[:, 0]).all():
            return labels, table[:, 1:]
    nodes = []
    for block in blocks:
        for place, fields in block.rows() if block.name == "NODE" else ():
            if not 1 <= len(fields) <= 7:
                raise Problem(f"{place}: {len(fields)} fields; expected a node's number and its x, y, z")
            position = [number(field or "0", place) for field in fields[1:4]]
            nodes.append((place, whole(fields[0], place), position + [0.0] * (3 - len(position))))
    return node_table(nodes)
