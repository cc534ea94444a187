"""Bolts of OptiStruct (PRETENS, PTFORCE, PTFORC1, PTADD) and Simcenter (BOLT, BOLTFOR): a bar, or a section across solids,
and the force that tightens it."""

import re

import numpy as np

READ = {"PRETENS", "PTFORCE", "PTFORC1", "PTADD", "BOLT", "BOLTFOR"}


def read_bolts(cards, case, deck):
    """Bolts by the forces that the case control selects in any subcase; by all where it selects none."""
    chosen = {int(n) for n in re.findall(r"^\s*(?:PRETENSION|BOLTLD)\s*=\s*(\d+)", case, flags=re.M | re.I)}
    for card in cards:
        if card.name == "PTADD" and card.whole(2) in chosen:
            chosen |= set(deck.listed(card.fields[1:], card.place))
    tension, others = {}, set()
    for card in cards:
        if card.name == "PTFORCE":
            sections, force = [card.whole(3)], card.number(4)
        elif card.name in ("PTFORC1", "BOLTFOR"):
            sections, force = deck.listed(card.fields[2:], card.place), card.number(3)
        else:
            continue
        if chosen and card.whole(2) not in chosen:
            others.add(card.field(2))
            continue
        tension.update(dict.fromkeys(sections, force))
    if others:
        deck.model.notes.append(f"forces of bolts {', '.join(sorted(others))}, which the case control does not select")
    for card in cards:
        if card.name in ("PRETENS", "BOLT"):
            add_bolt(card, deck, tension)


def add_bolt(card, deck, tension):
    number, model = card.whole(2), deck.model
    solid = card.name == "PRETENS" and card.field(4) != ""
    elements = card.fields[1:2] if card.name == "PRETENS" else card.fields[2:] if card.field(3) == "1" else []
    bars = {name for name, *_ in model.joints.beams}
    found = [f"bar_{element}" for element in elements if f"bar_{element}" in bars]
    if tension.get(number, 1.0) <= 0:
        deck.note(f"{card.name} {number} of the tension {tension[number]:g}: one above 0 tightens it", card)
        return
    if number not in tension:
        deck.note(f"{card.name} {number}, which no force tightens", card)
        return
    keys = {"name": deck.names.get((card.name, card.field(2)), f"bolt_{number}"), "tension": tension[number]}
    surface = deck.surfaces.get(card.field(4), "") if solid else ""
    if surface in model.surfaces:
        model.bolts.append((surface, {**keys, "axis": direction_of(card, deck) or model.normal_of(surface)}))
    elif found:
        model.joints.bolts.append((found[0], keys))
    else:
        deck.note(f"{card.name} {number} of no bar and no SURF that is there: the sections of solids that are read are those of PRETENS", card)


def direction_of(card, deck):
    """A vector, the normal of the plane of three grids, or an axis of a system; None where the card has none."""
    fields = [card.field(i) for i in (6, 7, 8)]
    if fields[0].isdecimal() and all(field.isdecimal() for field in fields):
        missing = [field for field in fields if int(field) not in deck.model.nodes]
        if missing:
            deck.note(f"the plane of PRETENS {card.field(2)}, whose grid {missing[0]} is not defined", card)
            return None
        a, b, c = (deck.model.nodes[int(field)] for field in fields)
        axis = np.cross(b - a, c - a)
    elif fields[0].isdecimal() and not any(fields[1:]):
        system = int(fields[0])
        axis = deck.systems.frame(system, card.place)[1][:, 0 if deck.systems.kind(system) == "R" else 2]
    else:
        axis = np.array([card.number(i, 0.0) for i in (6, 7, 8)])
    return axis.tolist() if axis.any() else None
