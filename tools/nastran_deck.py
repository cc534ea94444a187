"""Meshes of Nastran: bulk data to a mesh_model.Model. Names of properties come from the comments that preprocessors write."""

import re

from deck_files import Problem, Systems, cards_of, lines_of, nastran_nodes
from mesh_model import FLAT, KINDS, MOTIONS, Model, Part

ELEMENTS = {("CHEXA", 8): "hex8", ("CHEXA", 20): "hex20", ("CPENTA", 6): "wedge6", ("CTETRA", 4): "tet4",
            ("CTETRA", 10): "tet10", ("CQUAD4", 4): "quad4", ("CTRIA3", 3): "tri3"}
CORNERS = {"CHEXA": (8, 20), "CPENTA": (6, 15), "CTETRA": (4, 10), "CQUAD4": (4, 4), "CTRIA3": (3, 3)}
READ = {"GRID", "GRDSET", "CORD2R", "CORD2C", "CORD2S", "PSOLID", "PSHELL", "MAT1", "SPC", "SPC1", "SPCADD", "SET1", "SET3", "PARAM", "ENDDATA", *CORNERS}


def read_bdf(file):
    cards = cards_of(file)
    model = Model(file)
    labels, positions = nastran_nodes(cards)
    model.nodes = dict(zip(labels.tolist(), positions))
    if not model.nodes:
        raise Problem(f"{file}: no GRID")
    of_property = {}
    for card in cards:
        if card.name in CORNERS:
            read_element(card, model, of_property)
    read_materials(cards, model)
    read_properties(cards, model, of_property, names_in_comments(file))
    read_supports(cards, model)
    read_sets(cards, file, model)
    left_out = sorted({card.name for card in cards} - READ)
    if left_out:
        model.notes.append("the cards " + ", ".join(left_out))
    return model


def read_element(card, model, of_property):
    fewest, most = CORNERS[card.name]
    texts = card.fields[2 : 2 + most]
    while texts and texts[-1] == "":
        texts.pop()
    if "" in texts:
        raise Problem(f"{card.place}: {card.name} {card.field(2)} lacks some of its mid-side nodes; expected all or none")
    if card.name in ("CQUAD4", "CTRIA3"):
        texts = texts[:fewest]
    if (card.name, len(texts)) not in ELEMENTS:
        raise Problem(f"{card.place}: {card.name} {card.field(2)} has {len(texts)} nodes; expected {fewest} or {most}"
                      + (", of which 15 have no element in squeal" if most == 15 else ""))
    nodes = [card.whole(4 + i) for i in range(len(texts))]
    number = card.whole(2)
    model.add_element(card.place, number, ELEMENTS[card.name, len(texts)], nodes, "nastran")
    of_property.setdefault(card.whole(3, number), []).append(number)


def read_materials(cards, model):
    for card in cards:
        if card.name != "MAT1":
            continue
        young, shear, poisson = (card.number(i, 0.0) for i in (3, 4, 5))
        if card.field(5) == "" and young and shear:
            poisson = young / (2 * shear) - 1
        young = young or 2 * shear * (1 + poisson)
        model.materials[card.field(2)] = {"young": young, "poisson": poisson, "density": card.number(6, 0.0)}


def names_in_comments(file):
    """Names of properties by their numbers, as HyperMesh, ANSA and Simcenter write them into comments."""
    names = {}
    for _, line in lines_of(file):
        if found := re.match(r'\$HMNAME PROP\s+(\d+)\s*"([^"]+)"', line):
            names[int(found[1])] = found[2]
        elif found := re.match(r"\$ANSA_NAME(?:_COMMENT)?;(\d+);P\w+;([^;]+)", line):
            names[int(found[1])] = found[2]
        elif found := re.match(r"\$\*\s+Property:\s*(.+)", line):
            names["next"] = found[1].strip()
        elif (found := re.match(r"P(?:SOLID|SHELL)\W+(\d+)", line)) and "next" in names:
            names[int(found[1])] = names.pop("next")
    return names


def read_properties(cards, model, of_property, names):
    """A part for every property; flat elements on the faces of solids are surfaces, whatever their property."""
    properties = {card.whole(2): card for card in cards if card.name in ("PSOLID", "PSHELL")}
    free = model.free_faces(model.solids())
    for number, elements in of_property.items():
        name = names.get(number, f"property_{number}")
        card = properties.get(number)
        material = card.field(3) if card else None
        flat = [n for n in elements if model.elements[n][0] in FLAT]
        solid = [n for n in elements if model.elements[n][0] in KINDS]
        if solid:
            model.parts[name] = Part(solid, material)
        if flat and all(frozenset(model.elements[n][1]) in free for n in flat):
            model.surfaces[name] = [model.elements[n][1] for n in flat]
        elif flat:
            shown = name if not solid else name + "_shells"
            model.parts[shown] = Part(flat, material, card.number(4, 0.0) if card and card.name == "PSHELL" else 0.0)


def listed(texts, place):
    """Numbers of a list with THRU."""
    words, found = [text.upper() for text in texts if text], []
    i = 0
    while i < len(words):
        if i + 2 < len(words) and words[i + 1] == "THRU":
            found += range(int(words[i]), int(words[i + 2]) + 1)
            i += 3
            continue
        if not words[i].isdigit():
            raise Problem(f"{place}: '{words[i]}': expected numbers, or first THRU last")
        found.append(int(words[i]))
        i += 1
    return found


def read_supports(cards, model):
    """Of each set number and its motions, a set of nodes; the motions that GRID holds too."""
    held = {}
    for card in cards:
        if card.name == "SPC1":
            nodes = [n for n in listed(card.fields[2:], card.place) if n in model.nodes]
            held.setdefault((card.field(2), card.field(3)), []).extend(nodes)
        elif card.name == "SPC":
            for i in (3, 6):
                if card.field(i):
                    held.setdefault((card.field(2), card.field(i + 1)), []).append(card.whole(i))
        elif card.name == "GRID" and card.field(8).strip("0"):
            held.setdefault(("grid", card.field(8)), []).append(card.whole(2))
    turned = turned_nodes(cards)
    for (number, motions), nodes in held.items():
        if not motions.isdigit() or not set(motions) <= set("123456"):
            raise Problem(f"{model.source}: SPC1 {number} holds '{motions}'; expected digits from 1 to 6")
        oblique = [n for n in nodes if n in turned]
        if oblique and not ({"1", "2", "3"} <= set(motions) and len(set(motions) & set("456")) in (0, 3)):
            raise Problem(f"{turned[oblique[0]]}: SPC {number} holds motions {motions} of node {oblique[0]} in a turned system: "
                          "expected all translations, or motions along the basic axes")
        name = f"spc_{number}_{motions}"
        model.node_sets[name] = list(dict.fromkeys(nodes))
        model.supports.append((name, [MOTIONS[int(digit) - 1] for digit in sorted(motions)]))


def turned_nodes(cards):
    """Places of the nodes whose motions are along other axes than the basic ones."""
    systems = Systems(cards)
    default = next((card.field(7) for card in cards if card.name == "GRDSET"), "")
    found = {}
    for card in cards:
        if card.name == "GRID":
            system = card.field(7) or default or "0"
            if system != "-1" and not systems.are_basic_axes(int(system), card.place):
                found[card.whole(2)] = card.place
    return found


def read_sets(cards, file, model):
    """SET1 and the case control's SET are of nodes; SET3 says what it is of."""
    for card in cards:
        if card.name == "SET1":
            add_set(model, f"set_{card.field(2)}", listed(card.fields[1:], card.place), "GRID")
        elif card.name == "SET3":
            add_set(model, f"set_{card.field(2)}", listed(card.fields[2:], card.place), card.field(3).upper())
    text = "\n".join(line.split("$")[0] for _, line in lines_of(file))
    for number, items in re.findall(r"^\s*SET\s+(\d+)\s*=((?:[^\n]*,\s*\n)*[^\n]*)", text.partition("BEGIN BULK")[0], flags=re.M):
        if "ALL" not in items.upper():
            add_set(model, f"set_{number}", listed(items.replace(",", " ").split(), f"{file}, SET {number}"), "GRID")


def add_set(model, name, items, kind):
    if kind == "GRID":
        nodes = [n for n in items if n in model.nodes]
        if nodes:
            model.node_sets[name] = nodes
    elif kind.startswith("ELEM"):
        solids = [n for n in items if n in model.elements and model.elements[n][0] in KINDS]
        flat = [model.elements[n][1] for n in items if n in model.elements and model.elements[n][0] in FLAT]
        if solids:
            model.element_sets[name] = solids
        if flat:
            model.surfaces[name] = flat
