"""Contacts and glue of NX and Simcenter Nastran: regions of element faces (BSURF, BSURFS), and pairs of them (BCTSET, BGSET)."""

import re

from squeal.deck_files import undefined, whole
from squeal.mesh_model import FLAT, corners_of

READ = {"BSURF", "BSURFS", "BCTSET", "BCTADD", "BGSET", "BGADD"}


def read_contacts(cards, case, deck):
    """Pairs that the case control selects, of all its subcases; all where it selects none."""
    regions = {card.field(2): region(card, deck) for card in cards if card.name in ("BSURF", "BSURFS")}
    for name, sums, word in (("BCTSET", "BCTADD", "BCSET"), ("BGSET", "BGADD", "BGSET")):
        chosen = {int(n) for n in re.findall(rf"^\s*{word}\s*=\s*(\d+)", case, flags=re.M | re.I)}
        for card in cards:
            if card.name == sums and card.whole(2) in chosen:
                chosen |= set(deck.listed(card.fields[1:], card.place))
        for card in cards:
            if card.name == name and (not chosen or card.whole(2) in chosen):
                add_pairs(card, regions, deck)
            elif card.name == name:
                deck.note(f"{name} {card.field(2)}, which the case control does not select", card)


def add_pairs(card, regions, deck):
    """Eight fields a pair: number, source, target, friction and distances of the search."""
    for i in range(0, len(card.fields), 8):
        row = (card.fields[i : i + 8] + [""] * 8)[:8]
        if not row[1] and not row[2]:
            continue
        for text in row[1:3]:
            if text not in regions:
                raise undefined(card.place, f"{card.name} {card.field(2)}: the region", text, regions)
        sides = tuple(regions[text] or f"FILL IN [a surface]: region {text} of the deck has no faces of its elements" for text in row[1:3])
        if card.name == "BGSET":
            deck.model.ties.append(sides)
        else:
            reach = deck.number(row[5] or "0", card)
            deck.model.contact_places[sides] = card.place
            deck.model.contacts.append((*sides, {"friction": deck.number(row[3] or "0", card), **({"reach": reach} if reach > 0 else {})}))


def region(card, deck):
    """The name of the surface: of elements and three corners of their faces, or of flat elements; None without faces."""
    model, faces = deck.model, []
    if card.name == "BSURF":
        faces = [model.elements[n][1] for n in deck.listed(card.fields[1:], card.place, max(model.elements, default=0))
                 if n in model.elements and model.elements[n][0] in FLAT]
    for i in range(4, len(card.fields) if card.name == "BSURFS" else 0, 4):
        row = [whole(text, card.place) for text in card.fields[i : i + 4] if text]
        if row:
            of = model.faces(row[0]) if row[0] in model.elements else []
            faces += [face for face in of if set(row[1:]) <= corners_of(face)][:1]
    if not faces:
        deck.note(f"{card.name} {card.field(2)}, which has no faces of elements", card)
        return None
    name = model.unused(f"region_{card.field(2)}")
    model.surfaces[name] = faces
    return name
