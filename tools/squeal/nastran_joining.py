"""Cards of Nastran and OptiStruct that join, load and rub: rigid elements, springs, bushings, bars, masses, loads,
surfaces, contacts."""

import re

import numpy as np
from squeal.deck_files import Problem, undefined, whole
from squeal.deck_joints import rectangle, tube
from squeal.mesh_model import MOTIONS

ALL = "123456"


def motions_of(digits, place):
    if not digits.isdecimal() or not set(digits) <= set(ALL):
        raise Problem(f"{place}: motions '{digits}'; expected digits from 1 to 6")
    return [MOTIONS[int(digit) - 1] for digit in sorted(set(digits))]


def joined(motions):
    return " ".join(motions)


def rigid(card, deck):
    """RBE2: nodes that move with one."""
    nodes = deck.listed([text for text in card.fields[3:] if "." not in text], card.place)  # a real number is a thermal one
    name = deck.new_set(deck.names.get(("RBE2", card.field(2)), f"rbe2_{card.field(2)}"), nodes)
    motions = motions_of(card.field(4), card.place)
    deck.model.joints.rigid.append((card.whole(3), name, joined(motions), deck.line_of(card)))
    deck.model.joints.names.setdefault(card.whole(3), f"rbe2_{card.field(2)}_node")


def rigid_bar(card, deck):
    """RBAR of all motions between two reference nodes is a locked connector."""
    if (card.field(5) or ALL) not in (ALL,) or card.field(7) not in ("", ALL):
        deck.note(f"RBAR {card.field(2)} of some motions alone", card)
        return
    deck.model.joints.connectors.append((card.whole(3), card.whole(4), {"locked": "all"}, deck.line_of(card)))


def mean(card, deck):
    """RBE3: groups of a weight, motions and nodes."""
    fields, i, count = card.fields, 4, 0
    while i < len(fields) and not fields[i] in ("UM", "ALPHA"):
        if not fields[i]:
            i += 1
            continue
        weight, motions, nodes = deck.number(fields[i], card), fields[i + 1 : i + 2], []
        i += 2
        while i < len(fields) and (fields[i] == "" or fields[i].isdecimal() or fields[i] == "THRU"):
            nodes += [fields[i]] if fields[i] else []
            i += 1
        if set("".join(motions)) - set("123"):
            deck.note(f"motions {motions[0]} of RBE3 {card.field(2)}: nodes follow by translations", card)
        count += 1
        name = deck.new_set(f"rbe3_{card.field(2)}" + (f"_{count}" if count > 1 else ""), deck.listed(nodes, card.place))
        deck.model.joints.mean.append((card.whole(4), name, weight, deck.line_of(card)))
    if "UM" in fields:
        deck.note(f"UM of RBE3 {card.field(2)}", card)
    if card.field(5) and set(card.field(5)) != set(ALL):
        deck.note(f"that RBE3 {card.field(2)} gives motions {card.field(5)} of its node alone: it gives all", card)
    deck.model.joints.names.setdefault(card.whole(4), f"rbe3_{card.field(2)}_node")


def no_property(card, deck, names):
    return undefined(card.place, f"{card.name} {card.field(2)}: the property", card.field(3), [of for name, of in deck.properties if name in names])


def scalar(card, deck):
    """CELAS1, CELAS2, CDAMP1 and CDAMP2: between a motion of one node and the same of another, or the ground."""
    key, by_property = ("stiffness" if card.name.startswith("CELAS") else "damping"), card.name.endswith("1")
    if by_property:
        found = deck.properties.get(("PELAS" if key == "stiffness" else "PDAMP", card.field(3)))
        if found is None:
            raise no_property(card, deck, ("PELAS", "PDAMP"))
        value, loss = found.number(3, 0.0), found.field(4) if found.name == "PELAS" else ""
    else:
        value, loss = card.number(3, 0.0), card.field(8) if key == "stiffness" else ""
    if loss.strip("0."):
        deck.note(f"the loss factor {loss} of {card.name} {card.field(2)}", card)
    ends = [(card.whole(4 + i), card.whole(5 + i, 0)) for i in (0, 2) if card.field(4 + i) not in ("", "0")]
    motions = {motion for _, motion in ends}
    if len(motions) != 1 or not 1 <= min(motions) <= 6 or any(node in deck.turned for node, _ in ends):
        deck.note(f"{card.name} {card.field(2)}, whose ends have other motions or systems", card)
        return
    motion, (a, b) = motions.pop(), ([node for node, _ in ends] + [None])[:2]
    if motion <= 3:
        deck.model.joints.springs.append((a, b, MOTIONS[motion - 1], {key: value}, deck.line_of(card)))
    else:
        six = [value if i == motion - 1 else 0.0 for i in range(6)]
        deck.model.joints.connectors.append((a, b, {key: six}, deck.line_of(card)))


def bushing(card, deck):
    """CBUSH: six constants along the axes of its system, or along the line between its nodes."""
    found = deck.properties.get(("PBUSH", card.field(3)))
    if found is None:
        raise no_property(card, deck, ("PBUSH",))
    keys = constants_of(found, deck)
    a, b = card.whole(4), card.whole(5, 0) or None
    if card.field(9):
        origin, axes = deck.systems.frame(card.whole(9), card.place)
        frame = axes
    elif b is not None and deck.distance(a, b) > 0:
        frame = deck.frame_between(card, a, b, 6)
    else:
        frame = np.eye(3)
    if frame is None:
        deck.note(f"CBUSH {card.field(2)} without an orientation", card)
        return
    if not np.allclose(frame, np.eye(3)):
        keys |= {"axis_1": frame[:, 0].tolist(), "axis_2": frame[:, 1].tolist()}
    if card.field(10) or card.field(11):
        deck.note(f"the place of the spring of CBUSH {card.field(2)}: it is in the middle", card)
    if "locked" in keys or any(any(keys.get(key, ())) for key in ("stiffness", "damping")):
        deck.model.joints.connectors.append((a, b, keys, deck.line_of(card)))


def constants_of(found, deck):
    """Keys of a connector of a PBUSH: rows of a word and six numbers."""
    keys, fields, i = {}, found.fields[1:], 0
    while i < len(fields):
        word, i = fields[i], i + 1
        if word and not word[0].isdigit() and word[0] not in "+-." and word not in ("K", "B", "GE"):
            deck.note(f"{word} of PBUSH {found.field(2)}", found)
        if word in ("K", "B", "GE"):
            texts = (fields[i : i + 6] + [""] * 6)[:6]
            values = [deck.number(text if text not in ("", "RIGID") else "0", found) for text in texts]
            if "RIGID" in texts:
                keys["locked"] = joined([motion for motion, text in zip(MOTIONS, texts) if text == "RIGID"])
            if word == "GE":
                keys |= {"loss_factor": values[0]} if values[0] else {}
            else:
                keys["stiffness" if word == "K" else "damping"] = values
            i += 6
    return keys


def concentrated_mass(card, deck):
    """CONM2 at its node; an offset is left out, which the inertia about the node has."""
    node, mass, joints = card.whole(3), card.number(5, 0.0), deck.model.joints
    offset = [card.number(i, 0.0) for i in (6, 7, 8)]
    i11, i21, i22, i31, i32, i33 = (card.number(i, 0.0) for i in range(10, 16))
    joints.mass[node] = joints.mass.get(node, 0.0) + mass
    if card.field(4) not in ("", "0"):
        deck.note(f"the coordinate system {card.field(4)} of CONM2 {card.field(2)}: its moments are about the basic axes", card)
    if any(offset):
        deck.note(f"the offset {offset} of CONM2 {card.field(2)}: its mass is at node {node}", card)
    if any((i21, i31, i32)):
        deck.note(f"the products of inertia of CONM2 {card.field(2)}", card)
    if any((i11, i22, i33)):
        joints.inertia[node] = [i11, i22, i33, 0.0, 0.0, 0.0]


def bar(card, deck):
    """CBAR and CBEAM by PBAR, PBARL, PBEAM, PBEAML."""
    section, material = None, None
    for name in BAR_PROPERTIES:
        if found := deck.properties.get((name, card.field(3))):
            section = section_of(found)
            material = deck.model.materials.get(found.field(3), {"young": 0})
    if not material and not deck.has_unread("P", card.field(3)):
        raise no_property(card, deck, BAR_PROPERTIES)
    if not section or not material or not material.get("young"):
        deck.note(f"{card.name} {card.field(2)}, of a section or material that is not read", card)
        return
    a, b = card.whole(4), card.whole(5)
    for what, fields in BAR_FIELDS.items():
        if any(card.field(i).strip("0.") for i in fields):
            deck.note(f"{what} of {card.name} {card.field(2)}", card)
    keys = {"young": material["young"], "poisson": material["poisson"],
            **({"density": material["density"]} if material.get("density") else {}), **section, "elements": 1}
    frame = deck.frame_between(card, a, b, 6) if a in deck.model.nodes and b in deck.model.nodes else None
    if frame is not None and "diameter" not in section:
        keys["axis_2"] = frame[:, 1].tolist()
    deck.model.joints.beams.append((f"bar_{card.field(2)}", a, b, keys, deck.line_of(card)))


def section_of(card):
    if card.name in ("PBAR", "PBEAM"):
        area, first, second = (card.number(i, 0.0) for i in (4, 5, 6))
        torsion = card.number(7 if card.name == "PBAR" else 8, 0.0)
        if min(area, first, second, torsion) > 0:
            return {"area": area, "bending": [first, second], "torsion": torsion}
        return None
    kind = card.field(5).upper()
    sizes = [card.number(10 + i, 0.0) for i in range(SIZES.get(kind, 0))]
    if kind == "ROD" and sizes[0] > 0:
        return {"diameter": 2 * sizes[0], "shear_factor": 0.9}
    if kind == "TUBE" and sizes[0] > sizes[1] >= 0:
        return tube(*sizes[:2])
    if kind == "BAR" and min(sizes[:2]) > 0:
        return rectangle(*sizes[:2])
    return None


# ---- loads, each with the factor of its set


def force(card, deck, factor):
    node, size = card.whole(3), card.number(5, 0.0) * factor
    direction = np.array([card.number(i, 0.0) for i in (6, 7, 8)])
    if card.field(4) not in ("", "0"):
        system = card.whole(4)
        if deck.systems.kind(system) != "R":
            deck.note(f"{card.name} on node {node} in a system that is not Cartesian", card)
            return
        direction = deck.systems.frame(system, card.place)[1] @ direction
    found = deck.model.joints.forces.setdefault(node, [0.0] * 6)
    for i in range(3):
        found[i + (3 if card.name == "MOMENT" else 0)] += float(size * direction[i])


def pressure(card, deck, factor):
    """PLOAD4: faces of a size become a surface; the second grid is the opposite corner, of tetrahedra the one beside."""
    size = card.number(4, 0.0) * factor
    if any(card.field(i) not in ("", card.field(4)) for i in (5, 6, 7)):
        deck.note(f"other pressures at the corners of PLOAD4 on element {card.field(3)}", card)
    if card.field(11) or any(card.field(i) for i in (12, 13, 14)):
        deck.note(f"the direction of PLOAD4 on element {card.field(3)}: it acts along the normal", card)
    first, last = card.whole(3), card.whole(9) if card.field(8) == "THRU" else card.whole(3)
    grids = [] if card.field(8) == "THRU" else [int(card.field(i)) for i in (8, 9) if card.field(i).isdecimal()]
    for number in [first] if first == last else [n for n in deck.model.elements if first <= n <= last]:
        face = deck.face_of(number, grids)
        if face is None and first == last:
            deck.note(f"PLOAD4 on element {number}: no such face", card)
        elif face is not None:
            deck.pressed.setdefault(size, []).append(face)


def gravity(card, deck, factor):
    direction = np.array([card.number(i, 0.0) for i in (5, 6, 7)])
    if card.field(3) not in ("", "0"):
        direction = deck.systems.frame(card.whole(3), card.place)[1] @ direction
    deck.model.gravity = (card.number(4, 0.0) * factor * direction).tolist()


LOADS = {"FORCE": force, "MOMENT": force, "PLOAD4": pressure, "GRAV": gravity}


def read_loads(cards, case, deck):
    """Loads that the case control selects; several selections are those of a step each, of which the last is taken."""
    sums = {card.whole(2): card for card in cards if card.name == "LOAD"}
    known = {card.whole(2) for card in cards if card.name in LOADS}
    chosen = list(dict.fromkeys(int(n) for n in re.findall(r"^\s*LOAD\s*=\s*(\d+)", case, flags=re.M | re.I)))
    if len(chosen) > 1:
        deck.model.notes.append(f"LOAD {', '.join(map(str, chosen[:-1]))} of other subcases: the loads are those of LOAD {chosen[-1]}")
    factors = {}
    for number in chosen:
        if number not in known and number not in sums and not deck.has_unread("", str(number)):
            raise undefined(deck.model.source, "case control, LOAD: the set", number, [*sums, *known])
    for number in chosen[-1:] or [n for n in known if not sums]:
        if number in sums:
            card = sums[number]
            overall = card.number(3, 1.0)
            for text in card.fields[3::2]:
                if text and whole(text, card.place) not in known and not deck.has_unread("", text):
                    raise undefined(card.place, "LOAD: the set", text, known)
            for i in range(4, 2 + len(card.fields) - 1, 2):
                if card.field(i + 1):
                    factors[card.whole(i + 1)] = factors.get(card.whole(i + 1), 0.0) + overall * card.number(i, 1.0)
        else:
            factors[number] = factors.get(number, 0.0) + 1.0
    for card in cards:
        if card.name in LOADS and card.whole(2) in factors:
            LOADS[card.name](card, deck, factors[card.whole(2)])
    others = known - set(factors)
    if others:
        deck.model.notes.append(f"loads {', '.join(map(str, sorted(others)))}, which the case control does not select")
    deck.model.press(deck.pressed)


# ---- surfaces and contacts of OptiStruct


def surface(card, deck):
    """SURF: rows of an element and two grids of its face, whatever the side of shells."""
    name = deck.names.get(("SURF", card.field(2)), f"surf_{card.field(2)}")
    if card.field(3).upper() != "ELFACE":
        deck.note(f"{name}, a SURF of {card.field(3)}", card)
        return
    faces = []
    for i in range(8, len(card.fields), 8):
        row = card.fields[i : i + 4]
        if not row[0]:
            continue
        number = whole(row[0], card.place)
        face = deck.face_of(number, [int(text) for text in row[1:3] if text.isdecimal() and text != "0"])
        if face is None:
            raise Problem(f"{card.place}: SURF {card.field(2)}: element {number} has no such face")
        faces.append(face)
    shown = deck.model.unused(name)
    deck.model.surfaces[shown] = faces
    deck.surfaces[card.field(2)] = shown


def contact(card, deck):
    """CONTACT and TIE of two surfaces or sets."""
    first = 3 if card.name == "TIE" else 4
    sides = []
    for i in (first, first + 1):
        if card.field(i) not in deck.surfaces and not deck.has_unread("S", card.field(i)):
            raise undefined(card.place, f"{card.name} {card.field(2)}: the surface", card.field(i), deck.surfaces)
        sides.append(deck.surfaces.get(card.field(i), f"FILL IN [a surface]: {card.field(i)} of the deck has no faces of its elements"))
    slave, master = sides
    what, keys = card.field(3).upper(), {}
    if card.name == "TIE" or what == "FREEZE":
        deck.model.ties.append((slave, master))
        return
    keys["friction"] = 0.0
    if found := deck.properties.get(("PCONT", card.field(3))):
        keys |= friction_of(found, deck)
    elif "." in what:
        keys["friction"] = card.number(3)
    elif what.isdecimal() and not deck.has_unread("PCONT", what):
        raise no_property(card, deck, ("PCONT",))
    elif what not in ("SLIDE", ""):
        deck.note(f"{what} of CONTACT {card.field(2)}: it is smooth", card)
    deck.model.contacts.append((slave, master, keys))
    deck.model.contact_places[slave, master] = card.place


def friction_of(card, deck):
    keys = {"friction": 0.0}
    if "." in card.field(5):
        keys["friction"] = card.number(5)
    elif card.field(5):
        deck.note(f"MU1 = {card.field(5)} of PCONT {card.field(2)}: the contact is smooth", card)
    if card.field(6) and card.number(6) != keys["friction"]:
        deck.note(f"the kinetic coefficient {card.field(6)} of PCONT {card.field(2)}, which has no speed of decay", card)
    if card.field(7):
        keys["gap"] = card.number(7)
    if card.field(4) and card.field(4)[0].isdigit():
        keys["compliance"] = 1 / (card.number(4) or 1.0)
    return keys


HANDLERS = {"RBE2": rigid, "RBAR": rigid_bar, "RBE3": mean, "CELAS1": scalar, "CELAS2": scalar, "CDAMP1": scalar, "CDAMP2": scalar,
            "CBUSH": bushing, "CONM2": concentrated_mass, "CBAR": bar, "CBEAM": bar, "SURF": surface, "CONTACT": contact,
            "TIE": contact}
BAR_FIELDS = {"the released motions": (10, 11), "the offsets": range(12, 18)}
SIZES = {"ROD": 1, "TUBE": 2, "BAR": 2}  # of sections that are read
BAR_PROPERTIES = ("PBAR", "PBARL", "PBEAM", "PBEAML")
PROPERTIES = {"PELAS", "PDAMP", "PBUSH", "PBAR", "PBARL", "PBEAM", "PBEAML", "PCONT"}
READ = {*HANDLERS, *PROPERTIES, *LOADS, "LOAD", "EIGC", "SET"}
