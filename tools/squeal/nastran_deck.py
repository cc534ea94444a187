"""Meshes of Nastran: bulk data to a mesh_model.Model. Names of properties come from the comments that preprocessors write."""

import re
from collections import Counter

from squeal.deck_files import Problem, Systems, cards_of, lines_of, nastran_nodes, sections_of, whole
from squeal.mesh_model import FLAT, KINDS, MOTIONS, Model, Part

ELEMENTS = {("CHEXA", 8): "hex8", ("CHEXA", 20): "hex20", ("CPENTA", 6): "wedge6", ("CTETRA", 4): "tet4",
            ("CTETRA", 10): "tet10", ("CQUAD4", 4): "quad4", ("CTRIA3", 3): "tri3"}
CORNERS = {"CHEXA": (8, 20), "CPENTA": (6, 15), "CTETRA": (4, 10), "CQUAD4": (4, 4), "CTRIA3": (3, 3)}
READ = {"GRID", "GRDSET", "CORD2R", "CORD2C", "CORD2S", "PSOLID", "PSHELL", "MAT1", "SPC", "SPC1", "SPCADD", "SET1",
        "SET3", "PARAM", "ENDDATA", *CORNERS}
SHELL_FIELDS = {"CQUAD4": {"ZOFFS": (9,), "T1 to T4": (12, 13, 14, 15)},
                "CTRIA3": {"ZOFFS": (8,), "T1 to T3": (12, 13, 14)}}


def read_bdf(file):
    cards = cards_of(file)
    model = Model(file)
    labels, positions = nastran_nodes(cards)
    model.nodes = dict(zip(labels.tolist(), positions))
    if not model.nodes:
        raise Problem(f"{file}: no GRID")
    left_out = Counter(card.name for card in cards if card.name not in READ)
    if left_out:
        model.notes.append("the cards " + ", ".join(f"{name} ({count})" for name, count in sorted(left_out.items())))
    of_property = {}
    for card in cards:
        if card.name in CORNERS:
            read_element(card, model, of_property)
    note_shell_fields(cards, model)
    read_materials(cards, model)
    read_properties(cards, model, of_property, names_in_comments(file))
    case = "\n".join(line for _, line in sections_of(file)[0])
    read_supports(cards, case, model)
    read_sets(cards, case, model)
    return model


def note_shell_fields(cards, model):
    for name, fields in SHELL_FIELDS.items():
        for what, places in fields.items():
            count = sum(any(card.number(i, 0.0) for i in places) for card in cards if card.name == name)
            if count:
                model.notes.append(f"{what} of {count} {name}")


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
    """GE of a material and G of all are loss factors; WTMASS multiplies densities."""
    values = {}
    for card in cards:
        if card.name == "PARAM":
            values[card.field(2).upper()] = card
    others = sorted(set(values) - {"WTMASS", "G", "POST"})
    if others:
        model.notes.append("PARAM " + ", ".join(others))
    mass = values["WTMASS"].number(3, 1.0) if "WTMASS" in values else 1.0
    model.loss_factor = values["G"].number(3, 0.0) if "G" in values else 0.0
    for card in by_number(cards, "MAT1").values():
        young, shear, poisson = (card.number(i, 0.0) for i in (3, 4, 5))
        if card.field(5) == "" and young and shear:
            poisson = young / (2 * shear) - 1
        young = young or 2 * shear * (1 + poisson)
        model.materials[card.field(2)] = {"young": young, "poisson": poisson, "density": card.number(6, 0.0) * mass,
                                          "loss_factor": card.number(9, 0.0)}


def by_number(cards, *names):
    found = {}
    for card in cards:
        if card.name in names:
            before = found.setdefault(card.whole(2), card)
            if before.fields != card.fields:
                raise Problem(f"{card.place}: {card.name} {card.field(2)} is there twice, first in {before.place}; "
                              "keep one")
    return found


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
    properties = by_number(cards, "PSOLID", "PSHELL")
    free = model.free_faces(model.solids())
    for pid, elements in of_property.items():
        name = names.get(pid, f"property_{pid}")
        if model.unused(name) != name:
            name += f"_{pid}"
        card = properties.get(pid)
        material = card.field(3) if card else None
        flat = [n for n in elements if model.elements[n][0] in FLAT]
        solid = [n for n in elements if model.elements[n][0] in KINDS]
        if solid:
            model.parts[name] = Part(solid, material)
        thickness = card.number(4, 0.0) if card and card.name == "PSHELL" else 0.0
        if flat and all(frozenset(model.elements[n][1]) in free for n in flat):
            shown = model.unused(name if not solid else name + "_faces")
            model.surfaces[shown] = [model.elements[n][1] for n in flat]
            if thickness:
                model.notes.append(f"the thickness {thickness:g} of PSHELL {pid}, whose elements lie on solids: {shown} "
                                   "is a surface; a [[part]] with a thickness makes shells of it")
        elif flat:
            model.parts[model.unused(name if not solid else name + "_shells")] = Part(flat, material, thickness)
            note_shell_property(card, model)


def note_shell_property(card, model):
    """What a homogeneous shell of one material has not: other bending, shear or membrane, and a mass of its own."""
    if card is None or card.name != "PSHELL":
        return
    found = ["MID2"] if card.field(5) != card.field(3) else []
    found += ["MID4"] if card.field(12) else []
    for what, i, usual in (("12I/T**3", 6, 1.0), ("TS/T", 8, 5 / 6), ("NSM", 9, 0.0)):
        if abs(card.number(i, usual) - usual) > 1e-3:
            found.append(what)
    if found:
        model.notes.append(f"{', '.join(found)} of PSHELL {card.field(2)}")


def listed(texts, place):
    """Numbers of a list with THRU, BY and EXCEPT; what EXCEPT names is out while it is in the range before it."""
    words, found, i = [text.upper() for text in texts if text], [], 0

    def number_at(i):
        if i >= len(words) or not words[i].isdecimal():
            raise Problem(f"{place}: '{' '.join(words[max(i - 2, 0) : i + 1])}': expected numbers, or first THRU last")
        return int(words[i])

    while i < len(words):
        first = last = number_at(i)
        step, i = 1, i + 1
        if words[i : i + 1] == ["THRU"]:
            last, i = number_at(i + 1), i + 2
        if words[i : i + 1] == ["BY"]:
            step, i = number_at(i + 1), i + 2
        if last < first or step < 1:
            raise Problem(f"{place}: {first} THRU {last} BY {step}: expected ascending numbers")
        chosen = range(first, last + 1, step)
        if words[i : i + 1] == ["EXCEPT"]:
            i += 1
            out = set()
            while i < len(words) and first <= number_at(i) <= last and words[i + 1 : i + 2] != ["THRU"]:
                out.add(number_at(i))
                i += 1
            chosen = [n for n in chosen if n not in out]
        found += chosen
    return found


def read_supports(cards, case, model):
    """Of each set number and its motions, a set of nodes; the motions that GRID holds too. Nodes of solids have no
    rotations."""
    default = next((card.field(8) for card in cards if card.name == "GRDSET"), "")
    applied = applied_supports(cards, case, model)
    held = {}
    for card in cards:
        if card.name in ("SPC", "SPC1") and card.whole(2) not in applied:
            continue
        if card.name == "SPC1":
            nodes = [n for n in listed(card.fields[2:], card.place) if n in model.nodes]
            held.setdefault((card.field(2), card.field(3)), []).extend(nodes)
        elif card.name == "SPC":
            for i in (3, 6):
                if card.field(i):
                    held.setdefault((card.field(2), card.field(i + 1)), []).append(card.whole(i))
                    if card.number(i + 2, 0.0):
                        model.notes.append(f"the enforced motion {card.field(i + 2)} of node {card.field(i)} in SPC "
                                           f"{card.field(2)}: it is held at zero")
        elif card.name == "GRID" and (card.field(8) or default).strip("0"):
            held.setdefault(("grid", card.field(8) or default), []).append(card.whole(2))
    turned, turning, idle = turned_nodes(cards), model.nodes_with_rotations(), 0
    for (number, motions), nodes in held.items():
        if not motions.isdecimal() or not set(motions) <= set("123456"):
            raise Problem(f"{model.source}: SPC {number} holds '{motions}'; expected digits from 1 to 6")
        moving = [n for n in dict.fromkeys(nodes) if n in turning or set(motions) & set("123")]
        idle += len(set(nodes)) - len(moving)
        oblique = [n for n in moving if n in turned]
        if oblique and not ({"1", "2", "3"} <= set(motions) and len(set(motions) & set("456")) in (0, 3)):
            raise Problem(f"{turned[oblique[0]]}: SPC {number} holds motions {motions} of node {oblique[0]} in a turned system: "
                          "expected all translations, or motions along the basic axes")
        if moving:
            name = f"spc_{number}_{motions}"
            model.node_sets[name] = moving
            model.supports.append((name, [MOTIONS[int(digit) - 1] for digit in sorted(set(motions))]))
    if idle:
        model.notes.append(f"the held rotations of {idle} nodes that have none, as nodes of solids")


def applied_supports(cards, case, model):
    """Numbers of the SPC and SPC1 that the case control selects, of all its subcases; all where it selects none."""
    known = {card.whole(2): card.field(2) for card in cards if card.name in ("SPC", "SPC1")}
    sums = {}
    for card in cards:
        if card.name == "SPCADD":
            sums.setdefault(card.whole(2), []).extend(listed(card.fields[1:], card.place))
    selected = {int(n) for n in re.findall(r"^\s*SPC\s*=\s*(\d+)", case, flags=re.M | re.I)}
    if not selected:
        if len(known) > 1:
            model.notes.append(f"a choice of supports in the case control: all are there, SPC {joined(known)}")
        return set(known)
    if len(selected) > 1:
        model.notes.append(f"the choice of supports by subcases: all are there, SPC {joined(selected)}")
    applied = set()
    for n in selected:
        applied |= {n} if n not in sums else {n, *sums[n]}
    missing = applied - set(known) - set(sums)
    if missing:
        model.notes.append(f"SPC {joined(missing)}, which the case control selects and the deck has not")
    others = set(known) - applied
    if others:
        model.notes.append(f"SPC {joined(others)}, which the case control does not select")
    return applied


def joined(numbers):
    return ", ".join(map(str, sorted(numbers)))


def turned_nodes(cards):
    """Places of the nodes whose motions are along other axes than the basic ones."""
    systems = Systems(cards)
    default = next((card.field(7) for card in cards if card.name == "GRDSET"), "")
    found = {}
    for card in cards:
        if card.name == "GRID":
            system = whole(card.field(7) or default or "0", card.place)
            if system != -1 and not systems.are_basic_axes(system, card.place):
                found[card.whole(2)] = card.place
    return found


def read_sets(cards, case, model):
    """SET1 is of nodes, SET3 says what it is of; the case control's SET may be of nodes, elements or other things."""
    for card in cards:
        if card.name == "SET1":
            add_set(model, f"set_{card.field(2)}", listed(card.fields[1:], card.place), "GRID")
        elif card.name == "SET3":
            add_set(model, f"set_{card.field(2)}", listed(card.fields[2:], card.place), card.field(3).upper())
    for number, items in re.findall(r"^\s*SET\s+(\d+)\s*=((?:[^\n]*,\s*\n)*[^\n]*)", case, flags=re.M | re.I):
        try:
            numbers = listed(items.replace(",", " ").split(), "")
        except Problem:
            model.notes.append(f"SET {number} of the case control, which is no list of numbers")
            continue
        add_set(model, f"set_{number}", numbers, "GRID")


def add_set(model, name, items, kind):
    items = list(dict.fromkeys(items))
    if kind == "GRID":
        known = [n for n in items if n in model.nodes]
        if known:
            model.node_sets.setdefault(name, []).extend(known)
    elif kind.startswith("ELEM"):
        known = [n for n in items if n in model.elements]
        solids = [n for n in known if model.elements[n][0] in KINDS]
        flat = [model.elements[n][1] for n in known if model.elements[n][0] in FLAT]
        if solids:
            model.element_sets.setdefault(name, []).extend(solids)
        if flat:
            model.surfaces.setdefault(name, []).extend(flat)
    else:
        model.notes.append(f"{name}, a set of {kind}")
        return
    if len(known) < len(items):
        what = "nodes" if kind == "GRID" else "elements of the mesh"
        model.notes.append(f"{len(items) - len(known)} of the {len(items)} numbers of {name}, which are no {what}")
