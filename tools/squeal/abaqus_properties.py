"""Materials, their axes, and sections of Abaqus and CalculiX."""

import re

import numpy as np
from squeal.common import counted
from squeal.deck_files import Problem, number, undefined
from squeal.mesh_model import FLAT, KINDS, Part

ORTHOTROPIC = ("ENGINEERING CONSTANTS", "ORTHOTROPIC", "ORTHO")


def read_materials(deck):
    model, current, name = deck.model, None, ""
    for block in deck.blocks:
        if block.name == "MATERIAL":
            name = block.options.get("NAME", "").upper()
            current = model.materials.setdefault(name, {})
        elif block.name in ("ELASTIC", "DENSITY", "DAMPING"):
            if current is None:
                raise Problem(f"{block.place}: *{block.name} before any *MATERIAL; expected it below one")
            if block.name == "DAMPING":
                keys = (("ALPHA", "alpha"), ("BETA", "beta"), ("STRUCTURAL", "loss_factor"))
                given = {key: number(block.options[of], block.place) for of, key in keys if of in block.options}
                current.update(given)
                model.material_places.update(((name, key), block.place) for key in given)
                continue
            kind = block.options.get("TYPE", "ISOTROPIC").upper() if block.name == "ELASTIC" else ""
            if kind in ORTHOTROPIC:
                current["orthotropic"] = orthotropic(block, kind)
                model.material_places[name, "orthotropic"] = block.place
                continue
            if block.name == "ELASTIC" and not kind.startswith("ISO"):
                deck.note(f"*ELASTIC, TYPE={kind}", block.place)
                continue
            expected = (2, "Young's modulus and Poisson's ratio") if block.name == "ELASTIC" else (1, "a density")
            rows = list(block.rows(*expected))
            if len(rows) > 1:
                model.notes.append(f"all but the first line of *{block.name} ({deck.line_of(block.place)}), as of other temperatures")
            for place, fields in rows[:1]:
                model.material_places.update(((name, key), place) for key in (("density",) if block.name == "DENSITY" else ("young", "poisson")))
                if block.name == "DENSITY":
                    current["density"] = number(fields[0], place)
                else:
                    current.update(young=number(fields[0], place), poisson=number(fields[1], place))


def orthotropic(block, kind):
    """Nine constants, or nine stiffnesses of which they are made."""
    values = [number(field or "0", place) for place, fields in block.rows() for field in fields][:9]
    if len(values) < 9:
        raise Problem(f"{block.place}: {len(values)} numbers; expected nine of *ELASTIC, TYPE={kind}")
    if kind.startswith("ENG"):
        return {"young": values[:3], "poisson": values[3:6], "shear": values[6:]}
    a, b, c, d, e, f = values[:6]
    try:
        compliance = np.linalg.inv([[a, b, d], [b, c, e], [d, e, f]])
    except np.linalg.LinAlgError:
        raise Problem(f"{block.place}: these stiffnesses have no inverse; expected D1111, D1122, D2222, D1133, D2233, "
                      "D3333, D1212, D1313, D2323") from None
    young = 1 / np.diag(compliance)
    ratios = [-compliance[i, j] * young[i] for i, j in ((0, 1), (0, 2), (1, 2))]
    return {"young": young.tolist(), "poisson": ratios, "shear": values[6:]}


def square_to(axis, other, place):
    """The direction in the plane of both that is square to the first."""
    axis, other = np.array(axis), np.array(other)
    rest = other - axis * (axis @ other) / (axis @ axis) if axis.any() else axis
    if not np.linalg.norm(rest) > 1e-9 * np.linalg.norm(other):
        raise Problem(f"{place}: the points of the system lie on a line; expected two directions")
    return (rest / np.linalg.norm(rest)).tolist()


def frame_of(kind, values, place):
    """Keys of a scene's axes of two points: of a Cartesian system, or of the axis of a cylinder."""
    first, second = values[:3], values[3:6]
    if kind in ("C", "CYLINDRICAL"):
        axis = [b - a for a, b in zip(first, second)]
        if not any(axis):
            raise Problem(f"{place}: the axis of the cylinder has one point; expected two")
        return {"cylinder": {"axis": axis, "centre": first}}
    if not any(first):
        raise Problem(f"{place}: the first axis is zero; expected a direction")
    return {"axis_1": first, "axis_2": square_to(first, second, place)}


def read_orientations(deck):
    found = {}
    for block in deck.blocks:
        if block.name != "ORIENTATION":
            continue
        kind = block.options.get("SYSTEM", "RECTANGULAR").upper()
        rows = list(block.rows())
        if kind not in ("RECTANGULAR", "CYLINDRICAL") or block.options.get("DEFINITION", "COORDINATES").upper() != "COORDINATES" or not rows \
                or re.match("[A-Za-z_]", "".join(rows[0][1][:1])):
            deck.note(f"*ORIENTATION {block.options.get('NAME', '')}, which is of no two points", block.place)
            continue
        place, fields = rows[0]
        values = [number(field or "0", place) for field in (fields + ["0"] * 9)[:9]]
        if kind == "RECTANGULAR":  # points about an origin
            values = [v - values[6 + i % 3] for i, v in enumerate(values[:6])]
        if len(rows) > 1 and len(rows[1][1]) > 1 and number(rows[1][1][1] or "0", rows[1][0]) != 0:
            deck.note(f"the turn of *ORIENTATION {block.options.get('NAME', '')}", rows[1][0])
        found[block.options.get("NAME", "").upper()] = frame_of(kind, values, place)
    return found


def read_sections(deck):
    """A part for every section; a later section takes its elements from earlier ones. Solids without one are parts by
    their sets."""
    model, elements = deck.model, deck.elements
    owner, axes = {}, read_orientations(deck)
    known = {name.upper(): name for block in deck.blocks if block.name == "ORIENTATION" and (name := block.options.get("NAME"))}
    for block in deck.blocks:
        if block.name not in ("SOLID SECTION", "SHELL SECTION"):
            continue
        name = block.options.get("ELSET", "")
        numbers = elements.sets.get(name, block.place, "the element set")
        if not numbers:
            deck.note(f"*{block.name} of the set {name}, which has no elements", block.place)
        part = Part([], block.options.get("MATERIAL", "").upper())
        turned = block.options.get("ORIENTATION", "")
        if turned and turned.upper() not in known:
            raise undefined(block.place, f"*{block.name}: the orientation", turned, known.values())
        part.axes = axes.get(turned.upper())
        if block.name == "SHELL SECTION":
            read_thickness(block, part, deck)
            part.place = block.place
            part.offset = -part.thickness * offset_of(block, deck)
        shown = elements.sets.names[name.upper()]
        kinds = FLAT if block.name == "SHELL SECTION" else KINDS
        fit = [n for n in numbers if n in model.elements and model.elements[n][0] in kinds]
        others = sum(n in model.elements for n in numbers) - len(fit)
        if others:
            line = deck.line_of(block.place)
            model.notes.append(f"*{block.name} ({line}) of {others} elements of another kind in {shown}")
        if fit:
            model.parts[shown] = part
            owner.update(dict.fromkeys(fit, shown))
    for n, name in owner.items():
        model.parts[name].elements.append(n)
    model.parts = {name: part for name, part in model.parts.items() if part.elements}
    for sets in (elements.sets, elements.unnamed):
        for key, numbers in sets.items.items():
            free = [n for n in numbers if n in model.elements and n not in owner and model.elements[n][0] in KINDS]
            if free and sets.names[key] not in model.parts:
                model.parts[sets.names[key]] = Part(free)
                owner.update(dict.fromkeys(free, sets.names[key]))


MIDDLE_BY_WORD = {"SMID": 0.0, "SPOS": 0.5, "SNEG": -0.5}  # of the thickness


def offset_of(block, deck):
    """The nodes' distance from the middle surface, in thicknesses."""
    word = block.options.get("OFFSET", "SMID").upper()
    if word in MIDDLE_BY_WORD:
        return MIDDLE_BY_WORD[word]
    if re.match(r"[-+.\d]", word):
        return number(word, block.place)
    deck.note(f"OFFSET={word} of *SHELL SECTION, which varies", block.place)
    return 0.0


def read_thickness(block, part, deck):
    """The thickness in the first line; of layers, each with a line, the sum, and their material where it is one."""
    rows = [(place, fields) for place, fields in block.rows() if fields and fields[0]]
    if "COMPOSITE" not in block.options:
        part.thickness = number(rows[0][1][0], rows[0][0]) if rows else 0.0
        return
    part.thickness = sum(number(fields[0], place) for place, fields in rows)
    materials = {fields[2].upper() if len(fields) > 2 else "" for _, fields in rows}
    part.material = materials.pop() if len(materials) == 1 else None
    deck.model.notes.append(f"the {counted(len(rows), 'layer')} of *SHELL SECTION ({deck.line_of(block.place)}): the part has their "
                       "thickness together" + ("" if part.material else " and no material"))
