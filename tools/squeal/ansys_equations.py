"""What an Ansys deck says by equations: rigid regions of CE, and bolts of PRETS179, whose two sides it cuts apart."""

import re

import numpy as np
from squeal.common import counted
from squeal.deck_files import Problem, number, whole
from squeal.mesh_model import MOTIONS

MOTION_OF = {"UX": 0, "UY": 1, "UZ": 2, "ROTX": 3, "ROTY": 4, "ROTZ": 5}


class Equation:
    """Coefficients by node and motion; their sum is a constant."""

    def __init__(self, place):
        self.place, self.terms, self.constant, self.is_known = place, {}, 0.0, True

    def add(self, words):
        """Node, label, coefficient and so on."""
        for i in range(0, len(words) - 2, 3):
            if not words[i] or words[i] == "0":
                continue
            key = whole(words[i], self.place), MOTION_OF.get(words[i + 1].upper())
            self.is_known &= key[1] is not None
            self.terms[key] = self.terms.get(key, 0.0) + number(words[i + 2], self.place)


def read_equation(words, place, deck):
    """CE,R5.0,DEFI,terms,equation,constant, then CE,R5.0,NODE,... of two terms a line; or CE,equation,constant,..."""
    words = words + [""] * 6
    if words[1].upper().startswith("R") and words[2].upper() == "DEFI":
        deck.equations.append(Equation(place))
        deck.equations[-1].constant = number(words[5] or "0", place)
    elif words[1].upper().startswith("R"):
        if not deck.equations:
            raise Problem(f"{place}: terms of no equation; expected CE,R5.0,DEFI before them")
        deck.equations[-1].add(words[3:])
    else:
        name = words[1].upper()
        equation = deck.numbered.get(name) if name.isdecimal() else None
        if equation is None:
            equation = deck.numbered[name] = Equation(place)
            deck.equations.append(equation)
        equation.constant += number(words[2] or "0", place)
        equation.add(words[3:])


def rigid_regions(deck):
    """Equations by which a node of elements moves rigidly with one that no element has: those of a node are a rigid coupling.
    Others are left out."""
    model = deck.model
    used = {node for _, nodes in model.elements.values() for node in nodes}
    followers, others = {}, []  # motions by leading node and follower
    for equation in deck.equations:
        found = follower_of(equation, used, deck)
        if found:
            leader, follower, motion = found
            followers.setdefault(leader, {}).setdefault(follower, set()).add(motion)
        else:
            others.append(equation)
    for leader, of in followers.items():
        alike = {}
        for follower, motions in of.items():
            alike.setdefault(tuple(sorted(motions)), []).append(follower)
        for motions, nodes in alike.items():
            name = model.unused(f"region_{leader}" + ("" if len(alike) == 1 else "_" + "".join(MOTIONS[m] for m in motions)))
            model.node_sets[name] = nodes
            names = MOTIONS if motions in ((0, 1, 2), (0, 1, 2, 3, 4, 5)) else [MOTIONS[m] for m in motions]
            model.joints.rigid.append((leader, name, " ".join(names), f"CE of node {leader}"))
    if others:
        deck.note(f"CE: {counted(len(others), 'equation')} of no rigid coupling between a node of elements and one of none", others[0].place)


def follower_of(equation, used, deck):
    """The leading node, the follower and its motion, where the equation says that it moves rigidly."""
    nodes = {node for node, _ in equation.terms}
    if len(nodes) != 2 or len(nodes & used) != 1 or equation.constant or not equation.is_known or not nodes <= deck.model.nodes.keys():
        return None
    follower, = nodes & used
    leader, = nodes - used
    own = [(motion, value) for (node, motion), value in equation.terms.items() if node == follower and value]
    if len(own) != 1 or nodes & deck.angles.keys():
        return None
    motion, value = own[0]
    arm = np.asarray(deck.model.nodes[follower]) - deck.model.nodes[leader]
    expected = np.zeros(6)
    expected[motion] = 1
    if motion < 3:
        expected[3:] = np.cross(arm, expected[:3])
    given = np.array([-equation.terms.get((leader, m), 0.0) / value for m in range(6)])
    exact = np.abs(given - expected).max() <= 1e-6 * max(1.0, np.abs(arm).max())  # of nine digits
    return (leader, follower, motion) if exact else None


def bolts(deck):
    """PRETS179 from nodes of side A to those of side B at the same places: the sides are joined, and their faces are the
    section of a bolt. The force on its node K, or SLOAD, is the tension."""
    for section, elements in deck.bolts.items():
        place, pairs = elements[0][0], {}
        for where, nodes in elements:
            if len(nodes) < 3 or any(node not in deck.model.nodes for node in nodes[:2]):
                raise Problem(f"{where}: PRETS179 of the nodes {nodes}; expected two of the mesh and the node of the bolt")
            if nodes[0] != nodes[1]:
                pairs[nodes[1]] = nodes[0]
        add_bolt(deck, section, elements[0][1][2], pairs, place)


def add_bolt(deck, section, node, pairs, place):
    model, side = deck.model, set(pairs.values())
    name = deck.section_names.get(section) or f"bolt_{section}"
    force = deck.tension.get(section, model.joints.forces.get(node, [0.0])[0])
    faces = [face for face in model.free_faces(model.solids()).values() if side.issuperset(face)]
    if force <= 0 or not faces:
        what = f"which {'a force of ' + format(force, 'g') if force else 'no force on its node and no SLOAD'} tightens" if faces else "whose nodes cover no face of solids"
        deck.note(f"PRETS179 of section {section}, {what}: its sides stay apart", place)
        return
    model.join_nodes(pairs)
    for of in deck.of_pair.values():
        for key, given in of.items():
            if isinstance(given, list):
                of[key] = [tuple(pairs.get(n, n) for n in face) for face in given]
    for before in pairs.keys() & deck.held.keys():
        deck.held.setdefault(pairs[before], {}).update(deck.held.pop(before))
    for before in pairs.keys() & model.joints.forces.keys():
        there = model.joints.forces.setdefault(pairs[before], [0.0] * 6)
        there[:] = [a + b for a, b in zip(there, model.joints.forces.pop(before))]
    surface = model.unused(f"{name}_section")
    model.surfaces[surface] = faces
    direction = deck.directions.get(section, ())
    model.bolts.append((surface, {"name": name, "tension": force, "axis": list(direction) if any(direction) else model.normal_of(surface)}))
    model.joints.forces.pop(node, None)
    deck.held.pop(node, None)
    model.joints.of_bolts.add(node)


# ---- sections and tensions


def section_type(words, place, deck):
    """SECTYPE,section,type,subtype,name: of the data that follow."""
    deck.section = whole(words[1] if len(words) > 1 else "", place)
    if len(words) > 2 and words[2].upper().startswith("PRET") and len(words) > 4 and words[4]:
        deck.section_names[deck.section] = re.sub(r"\W", "_", words[4])
    deck.is_pretension = len(words) > 2 and words[2].upper().startswith("PRET")


def section_data(words, place, deck):
    """SECDATA of a bolt: its node and direction; of a shell: the thickness of a layer."""
    values = [number(word or "0", place) for word in words[1:5]]
    if deck.is_pretension:
        deck.directions[deck.section] = values[1:4]
    elif values:
        deck.thickness[deck.section] = deck.thickness.get(deck.section, 0.0) + values[0]


MIDDLE_BY_WORD = {"TOP": -0.5, "BOT": 0.5, "MID": 0.0}  # of the thickness


def section_offset(words, place, deck):
    """SECOFFSET,TOP, BOT or MID: where in a shell its nodes are."""
    word = words[1].upper()[:3] if len(words) > 1 else ""
    if word in MIDDLE_BY_WORD:
        deck.middles[deck.section] = MIDDLE_BY_WORD[word]
    elif not deck.is_pretension:
        deck.note(f"SECOFFSET,{','.join(words[1:])} of section {deck.section}", place)


def section_block(words, lines, deck):
    """SECBLOCK: the layers of a shell, a line each, or the node and direction of a bolt."""
    for _ in range(whole(words[1] if len(words) > 1 else "", lines.place())):
        if not lines.more():
            raise Problem(f"{lines.place()}: SECBLOCK ends before its {words[1]} lines")
        section_data(["", *(word.strip() for word in lines.next().split(","))], lines.place(), deck)


def section_load(words, place, deck):
    """SLOAD,section,label,what,FORC or DISP,value: the last force counts."""
    words = words + [""] * 6
    if words[4].upper().startswith("FORC"):
        deck.tension[whole(words[1], place)] = number(words[5] or "0", place)
    elif words[4].upper().startswith("DISP") and number(words[5] or "0", place):
        deck.note(f"the adjustment of section {words[1]} by SLOAD", place)
