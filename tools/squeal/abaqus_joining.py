"""Keywords of Abaqus and CalculiX that join nodes: couplings, constraints, springs, dashpots, masses, beams, bolts."""

import math

from squeal.deck_files import Problem, number, whole
from squeal.deck_joints import rectangle, tube
from squeal.mesh_model import MOTIONS

BEAMS = ("B31", "B31H", "B33", "B33H", "B31OS")
ALL = " ".join(MOTIONS)


def one_node(text, place, deck):
    numbers = list(dict.fromkeys(deck.nodes_of(text, place)))  # a set may name its node twice
    if len(numbers) != 1:
        raise Problem(f"{place}: '{text}' has {len(numbers)} nodes; expected one, or its number")
    return numbers[0]


def group_of(text, place, deck):
    """The name of a set of nodes, or of a new one of a single node."""
    if not text.isdecimal():
        deck.nodes.get(text, place, "the node set")
        return deck.nodes.names[text.upper()]
    deck.model.node_sets[f"node_{text}"] = [int(text)]
    return f"node_{text}"


def surface_of(text, place, deck):
    found = deck.face_group(text, place, "*COUPLING: the surface")
    if found is None:
        deck.note(f"the coupling to {text}, a surface without faces", place)
    return found


def coupling(block, deck):
    options = block.options
    node = one_node(options.get("REF NODE", ""), block.place, deck)
    surface = surface_of(options.get("SURFACE", ""), block.place, deck)
    deck.coupling = (node, surface, block) if surface else None
    if options.get("CONSTRAINT NAME"):
        deck.model.joints.names.setdefault(node, options["CONSTRAINT NAME"])


def motions_in(block):
    """Motions of lines `first[, last]`; all where there are none."""
    found = set()
    for place, fields in block.rows():
        if not fields:
            continue
        first = whole(fields[0], place, "a motion from 1 to 6")
        last = whole(fields[1], place) if len(fields) > 1 and fields[1] else first
        if not 1 <= first <= last <= 6:
            raise Problem(f"{place}: motions {first} to {last}; expected 1 to 6")
        found.update(MOTIONS[first - 1 : last])
    return " ".join(m for m in MOTIONS if m in found) or ALL


def kinematic(block, deck):
    motions = motions_in(block)
    if deck.coupling:
        node, surface, head = deck.coupling
        deck.model.joints.rigid.append((node, surface, motions, deck.line_of(head.place)))


def distributing(block, deck):
    if block.options.get("WEIGHTING METHOD", "UNIFORM").upper() != "UNIFORM":
        deck.note(f"WEIGHTING METHOD={block.options['WEIGHTING METHOD']} of *DISTRIBUTING, whose nodes weigh the same", block.place)
    if deck.coupling:
        node, surface, head = deck.coupling
        deck.model.joints.mean.append((node, surface, 1.0, deck.line_of(head.place)))


def distributing_coupling(block, deck):
    """Lines of nodes and weights below it follow the node of its element; a zero weight is one, as of all alike."""
    for _, _, nodes in list(lines_of_set(block, deck, ("DCOUP",))):
        for place, fields in block.rows(1, "a node or a set, and a weight"):
            weight = number(fields[1], place) if len(fields) > 1 and fields[1] else 1.0
            deck.model.joints.mean.append((nodes[0], group_of(fields[0], place, deck), weight or 1.0, deck.line_of(place)))


def kinematic_coupling(block, deck):
    node = one_node(block.options.get("REF NODE", ""), block.place, deck)
    for place, fields in block.rows(1, "a set of nodes, and motions"):
        first = whole(fields[1], place) if len(fields) > 1 and fields[1] else 1
        last = whole(fields[2], place) if len(fields) > 2 and fields[2] else (first if len(fields) > 1 else 6)
        if not 1 <= first <= last <= 6:
            raise Problem(f"{place}: motions {first} to {last}; expected 1 to 6")
        motions = " ".join(MOTIONS[first - 1 : last])
        deck.model.joints.rigid.append((node, group_of(fields[0], place, deck), motions, deck.line_of(place)))


def rigid_body(block, deck):
    node = one_node(block.options.get("REF NODE", ""), block.place, deck)
    for key in ("NSET", "TIE NSET", "PIN NSET", "ELSET"):
        name = block.options.get(key)
        if name and key == "ELSET":
            numbers = deck.elements.sets.get(name, block.place, "the element set")
            shown = deck.model.unused(f"{deck.elements.sets.names[name.upper()]}_nodes")
            deck.model.node_sets[shown] = list(dict.fromkeys(
                n for number in numbers if number in deck.model.elements for n in deck.model.elements[number][1]))
            deck.model.joints.rigid.append((node, shown, ALL, deck.line_of(block.place)))
        elif name:
            motions = " ".join(MOTIONS[:3]) if key == "PIN NSET" else ALL
            deck.model.joints.rigid.append((node, group_of(name, block.place, deck), motions, deck.line_of(block.place)))
    if "ANALYTICAL SURFACE" in block.options:
        deck.note("the analytical surface of *RIGID BODY", block.place)


def mpc(block, deck):
    """BEAM, TIE and PIN of a set and a reference node are a rigid coupling, of two reference nodes a locked connector."""
    form = "a type and two nodes or sets"
    for place, fields in block.rows(1, form):
        kind = fields[0].upper()
        if kind not in ("BEAM", "TIE", "PIN"):
            deck.note(f"*MPC of type {kind}", place)
            continue
        if len(fields) < 3:
            raise Problem(f"{place}: *MPC, '{', '.join(fields)}': {len(fields)} fields; expected {form}")
        motions = " ".join(MOTIONS[:3]) if kind == "PIN" else ALL
        node = one_node(fields[-1], place, deck)
        for text in fields[1:-1]:
            followers = deck.nodes_of(text, place)
            if kind != "BEAM" and any(distance(deck, n, node) > 0 for n in followers):
                deck.note(f"*MPC of type {kind} of nodes that are apart", place)
            elif set(followers) <= deck.used:
                deck.model.joints.rigid.append((node, group_of(text, place, deck), motions, deck.line_of(place)))
            else:
                locked = motions if motions != ALL else "all"
                deck.model.joints.connectors += [(n, node, {"locked": locked}, deck.line_of(place)) for n in followers]


def distance(deck, a, b):
    nodes = deck.model.nodes
    return math.dist(nodes[a], nodes[b]) if a in nodes and b in nodes else math.inf


def equation(block, deck):
    """Of one motion: held. Of the same motion of two reference nodes in one place: a connector. Others are left out."""
    if "REMOVE" in block.options:
        deck.note("*EQUATION, REMOVE", block.place)
        return
    rows, i = list(block.rows()), 0
    while i < len(rows):
        place, fields = rows[i]
        count, terms, i = whole(fields[0] if fields else "", place, "the number of terms"), [], i + 1
        while len(terms) < 3 * count and i < len(rows):
            terms += rows[i][1]
            i += 1
        if count < 1 or len(terms) != 3 * count:
            raise Problem(f"{place}: {len(terms)} fields of {count} terms; expected a node, a motion and a coefficient of each")
        nodes = [deck.nodes_of(text, place) for text in terms[::3]]
        motions = [whole(text, place) for text in terms[1::3]]
        factors = [number(text, place) for text in terms[2::3]]
        if count == 2 and motions[0] == motions[1] <= 6 and factors[0] + factors[1] == 0 and all(len(of) == 1 for of in nodes) \
                and not {nodes[0][0], nodes[1][0]} & deck.used and (distance(deck, nodes[0][0], nodes[1][0]) == 0 or motions[0] > 3):
            deck.model.joints.connectors.append((nodes[0][0], nodes[1][0], {"locked": MOTIONS[motions[0] - 1]}, deck.line_of(place)))
        else:
            deck.note(f"*EQUATION of {count} terms", place)


def lines_of_set(block, deck, kinds):
    """(number, type, nodes) of the elements of these types that a block's ELSET has."""
    numbers = deck.elements.sets.get(block.options.get("ELSET", ""), block.place, "the element set")
    found = [(n, *deck.elements.lines[n]) for n in dict.fromkeys(numbers) if n in deck.elements.lines]
    wrong = [kind for _, kind, _ in found if not kind.startswith(kinds)]
    if wrong:
        deck.note(f"*{block.name} of elements of type {wrong[0]}", block.place)
    for n, kind, nodes in found:
        if kind.startswith(kinds):
            deck.elements.left_out.pop(n, None)
            yield n, kind, nodes


def spring(block, deck):
    """SPRING1 and DASHPOT1 to the ground, SPRING2 between motions of two nodes, SPRINGA along the line between them."""
    key = "stiffness" if block.name == "SPRING" else "damping"
    rows = [(place, fields) for place, fields in block.rows() if fields]
    for option in ("NONLINEAR", "ORIENTATION", "RTOL"):
        if option in block.options:
            deck.note(f"{option} of *{block.name}", block.place)
            return
    for _, kind, nodes in list(lines_of_set(block, deck, (block.name,))):
        along_line = kind.endswith("A")
        place, fields = (rows or [(block.place, [])])[0 if along_line or len(rows) < 2 else 1]
        value = number(fields[0] if fields else "", place, f"the {key} in a line below *{block.name}")
        motions = [] if along_line else [whole(text, rows[0][0], "a motion from 1 to 6") for text in rows[0][1] if text]
        add_spring(deck, nodes, motions, {key: value}, block.place)


def add_spring(deck, nodes, motions, keys, place):
    a, b = (*nodes, None)[:2]
    where, joints = deck.line_of(place), deck.model.joints
    if not motions:
        joints.springs.append((a, b, None, keys, where))
    elif len(set(motions)) > 1 or not 1 <= motions[0] <= 6:
        deck.note(f"the spring of motions {motions} of two nodes", place)
    elif motions[0] <= 3:
        joints.springs.append((a, b, MOTIONS[motions[0] - 1], keys, where))
    else:
        (key, value), = keys.items()
        six = [value if i == motions[0] - 1 else 0.0 for i in range(6)]
        joints.connectors.append((a, b, {key: six}, where))


def mass(block, deck):
    """Masses of reference nodes are theirs; those of nodes of elements are shared by a group."""
    rows = list(block.rows(1, "a mass"))
    value = number(rows[0][1][0], rows[0][0]) if rows else 0.0
    shared = []
    for _, _, nodes in list(lines_of_set(block, deck, ("MASS",))):
        if nodes[0] in deck.used:
            shared.append(nodes[0])
        else:
            deck.model.joints.mass[nodes[0]] = deck.model.joints.mass.get(nodes[0], 0.0) + value
    if shared:
        name = deck.model.unused(f"{block.options['ELSET']}_masses")
        deck.model.node_sets[name] = list(dict.fromkeys(shared))
        deck.model.masses.append((name, value * len(shared)))


def rotary_inertia(block, deck):
    """Moments about the axes; products of inertia, whose sign manuals differ about, are left out."""
    for place, fields in list(block.rows(3, "three moments of inertia"))[:1]:
        values = [number(field or "0", place) for field in fields[:6]]
        if any(values[3:]):
            deck.note("the products of inertia of *ROTARY INERTIA", place)
        for _, _, nodes in list(lines_of_set(block, deck, ("ROTARYI",))):
            deck.model.joints.inertia[nodes[0]] = [*values[:3], 0.0, 0.0, 0.0]


def beam_section(block, deck):
    """Each element is a beam between its nodes; round, tubular and rectangular sections."""
    rows = [(place, fields) for place, fields in block.rows() if fields]
    kind, sizes = block.options.get("SECTION", "").upper(), []
    if rows:
        sizes = [number(field, rows[0][0]) for field in rows[0][1]]
    section = section_of(kind, sizes)
    material = deck.model.materials.get(block.options.get("MATERIAL", "").upper(), {})
    if not section or not material.get("young"):
        deck.note(f"*{block.name}, SECTION={kind}" if not section else f"*{block.name} of a material without *ELASTIC", block.place)
        return
    keys = {"young": material["young"], "poisson": material["poisson"],
            **({"density": material["density"]} if material.get("density") else {}), **section}
    if len(rows) > 1 and "diameter" not in keys:
        axis = [number(field or "0", rows[1][0]) for field in (rows[1][1] + ["0", "0"])[:3]]
        keys["bending"].reverse()  # n1 is the width, which bending along it has as its height
        keys["axis_2"] = axis
    for n, _, nodes in list(lines_of_set(block, deck, BEAMS)):
        if len(nodes) < 2:
            raise Problem(f"{block.place}: the beam {n} has one node; expected two")
        name = f"{block.options['ELSET']}_{n}"
        deck.beams[n] = name
        deck.model.joints.beams.append((name, nodes[0], nodes[1], {**keys, "elements": 1}, deck.line_of(block.place)))


def section_of(kind, sizes):
    """Keys of a [[beam]] for a section."""
    if kind == "CIRC" and sizes[:1] and sizes[0] > 0:
        return {"diameter": 2 * sizes[0]}
    if kind == "PIPE" and len(sizes) > 1 and 0 < sizes[1] < sizes[0]:
        return tube(sizes[0], sizes[0] - sizes[1])
    if kind == "RECT" and len(sizes) > 1 and min(sizes[:2]) > 0:
        return rectangle(*sizes[:2])
    return None


def pre_tension(block, deck):
    """A bolt by a surface across its shank, or by a beam; the load on its node tightens it."""
    node = one_node(block.options.get("NODE", ""), block.place, deck)
    rows = list(block.rows())
    axis = [number(field or "0", rows[0][0]) for field in (rows[0][1] + ["0"] * 3)[:3]] if rows and any(rows[0][1]) else None
    deck.pretension[node] = (block, axis)
    deck.model.joints.of_bolts.add(node)


HANDLERS = {"COUPLING": coupling, "KINEMATIC": kinematic, "DISTRIBUTING": distributing, "DISTRIBUTING COUPLING": distributing_coupling,
            "KINEMATIC COUPLING": kinematic_coupling,
            "RIGID BODY": rigid_body, "MPC": mpc, "EQUATION": equation, "SPRING": spring, "DASHPOT": spring, "MASS": mass,
            "ROTARY INERTIA": rotary_inertia, "BEAM SECTION": beam_section, "PRE-TENSION SECTION": pre_tension}
OPTIONS = {"COUPLING": "CONSTRAINT NAME,REF NODE,SURFACE,ALPHA", "KINEMATIC": "", "DISTRIBUTING": "WEIGHTING METHOD,COUPLING",
           "DISTRIBUTING COUPLING": "ELSET", "KINEMATIC COUPLING": "REF NODE", "RIGID BODY": "REF NODE,NSET,TIE NSET,PIN NSET,ELSET,ANALYTICAL SURFACE,POSITION",
           "MPC": "", "EQUATION": "REMOVE", "SPRING": "ELSET,NONLINEAR,ORIENTATION,RTOL", "DASHPOT": "ELSET,NONLINEAR,ORIENTATION,RTOL",
           "MASS": "ELSET", "ROTARY INERTIA": "ELSET", "BEAM SECTION": "ELSET,MATERIAL,SECTION", "PRE-TENSION SECTION":
           "SURFACE,NODE,ELEMENT,NAME"}
