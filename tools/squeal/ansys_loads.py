"""Supports, loads and damping of an Ansys deck. Nodes may have their motions along axes of their own."""

import numpy as np
from squeal import ansys_selection
from squeal.deck_files import Problem, number, span, whole
from squeal.mesh_model import FLAT, MOTIONS, corners_of

MOTION_OF = {"UX": "x", "UY": "y", "UZ": "z", "ROTX": "rx", "ROTY": "ry", "ROTZ": "rz"}
FORCE_OF = {name: i for i, name in enumerate(("FX", "FY", "FZ", "MX", "MY", "MZ"))}
# where the faces of Ansys stand among those of Abaqus; degenerate bricks have no face 4, and tetrahedra of theirs a face 5
FACES = {"hex": {1: 0, 2: 2, 3: 3, 4: 4, 5: 5, 6: 1}, "wed": {1: 0, 2: 2, 3: 3, 5: 4, 6: 1}, "tet": {1: 0, 2: 1, 3: 2, 4: 3, 5: 3}}


def nodes_of(words, place, deck):
    """One node, those up to the sixth word by steps of the seventh, those of a component, or all."""
    text = words[1] if len(words) > 1 else ""
    if text.upper() == "ALL":
        return ansys_selection.selected_nodes(words, place, deck)
    named = next((nodes for name, nodes in deck.model.node_sets.items() if name.upper() == text.upper()), None)
    if named is not None:
        if not named:
            deck.note(f"{words[0]} on the component {text}, which has no nodes", place)
        return named
    first = whole(text, place, "a node, a component of nodes, or ALL")
    last, step = (whole(word or "0", place) for word in (words[5:7] + ["0", "0"])[:2])
    return [n for n in span(first, last, step or 1, place) if n in deck.model.nodes] if last > first else [first]


def support(words, place, deck):
    """D,node,label,value, …, last node, step, other labels."""
    text = words[3] if len(words) > 3 and words[3] else "0"
    if text[0] == "%":
        deck.note(f"the table {text} of D on node {words[1]}, which has no numbers: it is held", place)
        text = "0"
    value = number(text, place)
    for label in [word.upper() for word in words[2:3] + words[7:] if word]:
        motions = {"ALL": MOTIONS}.get(label, (MOTION_OF[label],) if label in MOTION_OF else ())
        if not motions:
            deck.note(f"D of {label} of node {words[1]}", place)
        for node in nodes_of(words, place, deck):
            deck.held.setdefault(node, {}).update(dict.fromkeys(motions, value))


def force(words, place, deck):
    """F,node,label,value, …, last node, step."""
    label = words[2].upper() if len(words) > 2 else ""
    if label not in FORCE_OF:
        deck.note(f"F of {label} on node {words[1] if len(words) > 1 else ''}", place)
        return
    for node in nodes_of(words, place, deck):
        found = deck.model.joints.forces.setdefault(node, [0.0] * 6)
        found[FORCE_OF[label]] = number(words[3] if len(words) > 3 else "", place)


def surface_load(words, lines, deck):
    """SFE,element,face,PRES,part,values, or R5.0 in their place and the values in the next line."""
    if words[1:2] and words[1].upper() == "END":
        return
    place, words = lines.place(), words + [""] * 6
    values = words[5:9]
    if values[0].upper().startswith("R"):
        values = lines.next().replace(",", " ").split() if lines.more() else []
    if words[1].upper() != "ALL":
        press_element(whole(words[1], place), words[2], words[3], words[4], values, place, deck)
        return
    for n in deck.state.elements or ():
        press_element(n, words[2], words[3], words[4], values, place, deck)
    if deck.state.elements is None or deck.state.unread:
        deck.note(f"SFE on all elements that {deck.state.unread or 'are there'} selects", place)


def press_element(label, side, what, part, values, place, deck):
    """The pressure at the corners of an element's face; part 2 is imaginary."""
    values = [number(value, place) for value in values if value]
    if what.upper() != "PRES" or part == "2":
        deck.left_out[f"SFE of {what}"] += 1
    elif values and any(values):
        if any(value != values[0] for value in values if value):
            deck.note(f"other pressures at the corners of element {label}", place)
        deck.pressed.append((label, whole(side, place), values[0], place))


def rows_of(lines):
    """Fields and places of the lines of a block below its format, up to one that begins with no number."""
    if not lines.more():
        raise Problem(f"{lines.place()}: a block without a format")
    lines.next()
    while lines.more():
        fields = lines.next().split()
        if not fields or not fields[0].isdigit():
            lines.at -= 1
            return
        if len(fields) < 3:
            raise Problem(f"{lines.place()}: {len(fields)} fields; expected a number, two labels and values")
        yield fields, lines.place()


def support_block(words, lines, deck):
    """DBLOCK: node, label, value, imaginary part a line."""
    for fields, place in rows_of(lines):
        support(["D", *fields[:3]], place, deck)


def surface_block(words, lines, deck):
    """SFEBLOCK,kind,label,elements,lines: element, face, part, values a line."""
    label = words[2] if len(words) > 2 else ""
    for fields, place in rows_of(lines):
        press_element(whole(fields[0], place), fields[1], label, fields[2], fields[3:], place, deck)


def gravity(words, place, deck):
    values = [number(word or "0", place) for word in (words[1:] + ["0"] * 3)[:3]]
    if any(values):
        deck.model.gravity = [-v for v in values]  # an acceleration of the frame


def band(words, place, deck):
    """MODOPT,method,number,lowest,highest frequency."""
    deck.model.band = number(words[4] if len(words) > 4 and words[4] else "0", place)


def damping(words, place, deck):
    """ALPHAD, BETAD and DMPSTR of the whole model."""
    value = number(words[1] if len(words) > 1 and words[1] else "0", place)
    if words[0].upper() == "DMPSTR":
        deck.model.loss_factor = value
    else:
        setattr(deck, "alpha" if words[0].upper() == "ALPHAD" else "beta", value)


def left_out_if_any(words, place, deck):
    """CDWRITE writes these with zeros, too."""
    if any(number(word or "0", place) for word in words[1:4]):
        deck.note(",".join(words[:4]), place)


COMMANDS = {"D": support, "F": force, "ACEL": gravity, "MODOPT": band, "ALPHAD": damping, "BETAD": damping, "DMPSTR": damping,
            **dict.fromkeys(("OMEGA", "DOMEGA", "CGOMEGA", "DCGOMG", "DMPRAT"), left_out_if_any)}

# ---- what the whole deck makes


def finish(deck):
    turn_forces(deck)
    supports(deck)
    pressures(deck)


def axes_of(angles):
    """Axes of a node in the columns: turned about z, then x, then y [degrees]."""
    (cz, sz), (cx, sx), (cy, sy) = ((np.cos(a), np.sin(a)) for a in np.radians(angles))
    return (np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]]) @ np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
            @ np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]]))


def turn_forces(deck):
    for node, force in deck.model.joints.forces.items():
        if node in deck.angles:
            axes = axes_of(deck.angles[node])
            force[:] = [float(v) for v in (*(axes @ force[:3]), *(axes @ force[3:]))]


def frame_of(node, held, deck):
    """Keys of the axes of a support: a cylinder about z where x is radial, none where the axes do not matter."""
    if node not in deck.angles or ({"x", "y", "z"} <= held.keys() and len(held) in (3, 6) and not any(held.values())):
        return {}
    axes, (x, y, _) = axes_of(deck.angles[node]), deck.model.nodes[node]
    radius = np.hypot(x, y)
    if radius and np.abs(axes[:, 2] - [0, 0, 1]).max() < 1e-6 and np.abs(axes[:2, 0] - [x / radius, y / radius]).max() < 1e-5:
        return {"cylinder": {"axis": [0.0, 0.0, 1.0], "centre": [0.0, 0.0, 0.0]}}
    return {"axis_1": axes[:, 0].round(9).tolist(), "axis_2": axes[:, 1].round(9).tolist()}


def supports(deck):
    """Nodes that are held alike are a set, by the name of the component that has just these."""
    model = deck.model
    used = {node for _, nodes in model.elements.values() for node in nodes}
    alike = {}
    for node, held in deck.held.items():
        if node not in model.nodes:
            model.notes.append(f"the support of node {node}, which the deck does not define")
        elif node in used:
            frame = frame_of(node, held, deck)
            alike.setdefault((tuple(sorted(held.items())), repr(frame)), (frame, []))[1].append(node)
        else:
            model.joints.held[node] = set(held)
            model.joints.moved[node] = {motion: value for motion, value in held.items() if value}
            if frame_of(node, held, deck):
                model.notes.append(f"the axes of node {node}, which is held along the basic ones")
    names = {frozenset(nodes): name for name, nodes in model.node_sets.items()}
    for i, ((held, _), (frame, nodes)) in enumerate(alike.items(), 1):
        motions = [m for m in MOTIONS if m in dict(held)]
        name = names.get(frozenset(nodes)) or model.unused(f"held_{i}")
        model.node_sets[name] = nodes
        values = [dict(held).get(m, 0.0) for m in MOTIONS]
        keys = frame | ({"displacement": values[:3]} if any(values[:3]) else {})
        model.supports.append((name, motions, keys | ({"rotation": values[3:]} if any(values[3:]) else {})))


def pressures(deck):
    """Faces of solids, and those that surface elements lie on."""
    model, pressed = deck.model, {}
    free = model.free_faces(model.solids()) if deck.pressed or deck.pressed_nodes else {}
    for label, side, value, place in deck.pressed:
        face = None
        if label in deck.skins:
            face = free.get(corners_of(deck.skins[label])) if side == 1 and len(deck.skins[label]) in (3, 4, 6, 8) else None
        elif label in model.elements and model.elements[label][0] not in FLAT:
            index = FACES[model.elements[label][0][:3]].get(side)
            face = None if index is None else model.faces(label)[index]
        if face is None:
            deck.note(f"the pressure on face {side} of element {label}, which is none of a solid", place)
        else:
            pressed.setdefault(value, []).append(face)
    for nodes, value, place in deck.pressed_nodes:
        faces = [face for face in free.values() if nodes.issuperset(face)]
        if faces and value:
            pressed.setdefault(value, []).extend(faces)
        elif not faces:
            deck.note("the pressure of SF on nodes that cover no face of solids", place)
    model.press(pressed)
