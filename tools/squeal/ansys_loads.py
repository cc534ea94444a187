"""Supports, loads and damping of an Ansys deck. Nodes may have their motions along axes of their own."""

import numpy as np
from squeal.deck_files import number, span, whole
from squeal.mesh_model import FLAT, MOTIONS, corners_of

MOTION_OF = {"UX": "x", "UY": "y", "UZ": "z", "ROTX": "rx", "ROTY": "ry", "ROTZ": "rz"}
FORCE_OF = {name: i for i, name in enumerate(("FX", "FY", "FZ", "MX", "MY", "MZ"))}
# where the faces of Ansys stand among those of Abaqus; degenerate bricks have no face 4, and tetrahedra of theirs a face 5
FACES = {"hex": {1: 0, 2: 2, 3: 3, 4: 4, 5: 5, 6: 1}, "wed": {1: 0, 2: 2, 3: 3, 5: 4, 6: 1}, "tet": {1: 0, 2: 1, 3: 2, 4: 3, 5: 3}}


def nodes_of(words, place, deck):
    """One node, those up to the sixth word by steps of the seventh, those of a component, or all."""
    text = words[1] if len(words) > 1 else ""
    if text.upper() == "ALL":
        return list(deck.model.nodes)
    named = next((nodes for name, nodes in deck.model.node_sets.items() if name.upper() == text.upper()), None)
    if named is not None:
        return named
    first = whole(text, place, "a node, a component of nodes, or ALL")
    last, step = (whole(word or "0", place) for word in (words[5:7] + ["0", "0"])[:2])
    return [n for n in span(first, last, step or 1, place) if n in deck.model.nodes] if last > first else [first]


def support(words, place, deck):
    """D,node,label,value, …, last node, step, other labels."""
    value = number(words[3] or "0", place) if len(words) > 3 else 0.0
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
    place, words = lines.place(), words + [""] * 6
    values = words[5:9]
    if values[0].upper().startswith("R"):
        values = lines.next().replace(",", " ").split() if lines.more() else []
    values = [number(value, place) for value in values if value]
    if words[3].upper() != "PRES" or words[4] == "2":
        deck.left_out[f"SFE of {words[3]}"] += 1
    elif values and any(values):
        if any(value != values[0] for value in values if value):
            deck.note(f"other pressures at the corners of element {words[1]}", place)
        deck.pressed.append((whole(words[1], place), whole(words[2], place), values[0], place))


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
    free = model.free_faces(model.solids()) if deck.pressed else {}
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
    model.press(pressed)
