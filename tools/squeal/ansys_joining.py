"""Joints, drives and masses of an Ansys deck: rotors, masses, contact pairs, ties and pilot nodes."""

import math
from enum import StrEnum

from squeal.deck_files import Problem, undefined
from squeal.mesh_model import FLAT, MOTIONS, corners_of


class Side(StrEnum):
    """The two sides of a contact, by the names of their elements."""

    CONTACT = "contact"
    TARGET = "target"


BONDED = (3, 5, 6)  # values of the option 12 of contact elements
BEHAVIOURS = {1: "rough", 2: "without separation", 4: "without separation"}


def rotors_of(deck):
    """Rotations of the parts that a component has elements of, or of the sides of contacts where it has those alone."""
    model, of_side = deck.model, {}
    for name, rate, place in deck.turning:
        if name not in model.element_sets:
            raise undefined(place, "CMROTATE: the component of elements", name, model.element_sets)
        size = math.hypot(*rate)
        turn = {"axis": [v / size for v in rate], "rate": size}
        elements = set(model.element_sets[name])
        parts = [part for part in model.parts.values() if not elements.isdisjoint(part.elements)]
        sides = {deck.sides[n] for n in elements if n in deck.sides}
        if not parts and not sides:
            raise Problem(f"{place}: CMROTATE of {name}, which has no elements of the mesh; expected those of the rotor")
        model.rotors += [(part, turn) for part in parts]
        of_side.update(dict.fromkeys(() if parts else sides, turn))
    return of_side


def masses(deck):
    """MASS21: mass and three moments of inertia, or by its option 3 the mass alone; one of several directions is that along x."""
    joints = deck.model.joints
    for place, node, real, kind in deck.masses:
        if real not in deck.reals:
            raise undefined(place, "MASS21: the real constant", real, deck.reals)
        if node not in deck.model.nodes:
            raise Problem(f"{place}: MASS21 on node {node}, which the deck does not define")
        values = (deck.reals[real] + [0.0] * 6)[:6]
        rotary = deck.options.get((kind, 3), 0) == 0
        joints.mass[node] = joints.mass.get(node, 0.0) + values[0]
        if rotary and len(set(values[:3])) > 1:
            deck.note(f"the masses along y and z at node {node}, other than along x", place)
        if rotary and any(values[3:]):
            joints.inertia[node] = [*values[3:], 0.0, 0.0, 0.0]


def springs(deck):
    """COMBIN14: a stiffness and a damping along the line between its nodes, or by its option 2 along or about an axis."""
    joints = deck.model.joints
    for place, nodes, real, kind in deck.springs:
        if real not in deck.reals:
            raise undefined(place, "COMBIN14: the real constant", real, deck.reals)
        a, b = (nodes + [0, 0])[:2]
        values = (deck.reals[real] + [0.0] * 3)[:3]
        motion, where = deck.options.get((kind, 2), 0), place.rpartition(", ")[2]
        keys = {key: value for key, value in zip(("stiffness", "damping"), values) if value}
        if not keys or motion not in range(7) or not b or deck.options.get((kind, 3), 0) in (1, 2) or deck.angles.keys() & {a, b}:
            deck.note(f"COMBIN14 between the nodes {a} and {b}, of another kind than along its line or an axis", place)
        elif motion < 4:
            joints.springs.append((a, b, MOTIONS[motion - 1] if motion else None, keys, where))
        else:
            joints.connectors.append((a, b, {key: [value if i == motion - 1 else 0.0 for i in range(6)] for key, value in keys.items()}, where))
        if values[2]:
            deck.note(f"the quadratic damping of COMBIN14 at node {a}", place)


def couple(deck, pair, pilot, surface):
    """A surface that follows a pilot node: as one rigid body, or in the mean where forces are distributed."""
    joints, where = deck.model.joints, f"pilot node {pilot}"
    if deck.options.get((pair["type"], 4), 0) == 1:
        joints.mean.append((pilot, surface, 1.0, where))
    else:
        joints.rigid.append((pilot, surface, " ".join(MOTIONS), where))


def faces_that_bear(model):
    """Free faces of solids, and shells, by their corners."""
    shells = {corners_of(nodes): nodes for kind, nodes in model.elements.values() if kind in FLAT}
    return {**shells, **model.free_faces(model.solids())}


def pairs(deck, rotors):
    """Contact and target elements of one real constant are a contact; its material has the friction. Sides that have no faces
    of solids or shells are gaps to be filled. rotors: turns by the sides of contacts."""
    model = deck.model
    free = faces_that_bear(model) if deck.of_pair else {}
    known = {}  # pairs by their faces
    for real, pair in deck.of_pair.items():
        sides = tuple(frozenset(map(corners_of, (face for face in pair.get(side, ()) if len(face) in (3, 4, 6, 8)))) for side in Side)
        if all(sides) and (before := known.setdefault(frozenset(sides), real)) != real:
            model.notes.append(f"the contact elements of real constant {real}, which are those of {before} with the sides changed")
            continue
        names = []
        pilot = [face[0] for face in pair.get(Side.TARGET, ()) if len(face) == 1 and face[0] in model.nodes]
        for side in Side:
            given = [face for face in pair.get(side, []) if side is Side.CONTACT or len(face) > 1]  # of one node is a pilot
            faces = [free[corners_of(face)] for face in given if len(face) in (3, 4, 6, 8) and corners_of(face) in free]
            bare = [face for face in given if len(face) == 1 or pilot and corners_of(face) not in free]  # nodes alone follow a pilot
            dots = [n for face in bare for n in face]
            if len(faces) + len(bare) < len(given):
                model.notes.append(f"{len(given) - len(faces) - len(bare)} {side} elements of real constant {real}, which lie on no solid and no shell")
            names.append(model.unused(f"{side}_{real}") if faces or dots else
                         f"FILL IN [a surface]: real constant {real} of the deck has no {side} elements on faces of solids or shells")
            if faces:
                model.surfaces[names[-1]] = faces
            elif dots:
                model.node_sets[names[-1]] = list(dict.fromkeys(dots))
        if pilot and not names[0].startswith("FILL IN"):
            couple(deck, pair, pilot[0], names[0])
            continue
        if deck.options.get((pair.get("type"), 12), 0) in BONDED and not any(name.startswith("FILL IN") for name in names):
            model.ties.append(tuple(names))
            continue
        if behaviour := BEHAVIOURS.get(deck.options.get((pair.get("type"), 12), 0)):
            model.notes.append(f"that the contact of real constant {real} is {behaviour}: it may open, and slides at its MU")
        model.contact_places[tuple(names)] = model.material_places.get((pair["material"], "MU"), "")
        keys = {"friction": deck.constants.get(pair["material"], {}).get("MU", 0.0)}
        for side, more in ((Side.TARGET, {}), (Side.CONTACT, {"slave": "rotor"})):
            keys |= {"rotation": rotors[real, side], **more} if (real, side) in rotors else {}
        model.contacts.append((*names, keys))
