"""Meshes of Abaqus and CalculiX: an input deck to a mesh_model.Model."""

import re

from squeal.abaqus_parts import flattened
from squeal.deck_files import Problem, abaqus_nodes, blocks_of, number, whole
from squeal.mesh_model import FLAT, KINDS, MOTIONS, Model, Part

SOLIDS = {"4": "tet4", "6": "wedge6", "8": "hex8", "10": "tet10", "20": "hex20"}
SHELLS = {"3": "tri3", "4": "quad4"}
SKINS = {"3": "tri3", "4": "quad4", "6": "tri6", "8": "quad8"}
NAMED_SUPPORTS = {"ENCASTRE": "x y z rx ry rz", "PINNED": "x y z", "XSYMM": "x ry rz", "YSYMM": "y rx rz", "ZSYMM": "z rx ry",
                  "XASYMM": "y z rx", "YASYMM": "x z ry", "ZASYMM": "x y rz"}
OPTIONS = {"NODE": "NSET SYSTEM INPUT", "ELEMENT": "TYPE ELSET INPUT", "SURFACE": "NAME TYPE INTERNAL INPUT",
           "BOUNDARY": "INPUT", "ELASTIC": "TYPE", "DENSITY": "", "DAMPING": "ALPHA BETA STRUCTURAL",
           "TIE": "NAME ADJUST", "SOLID SECTION": "ELSET MATERIAL ORIENTATION CONTROLS",
           "SHELL SECTION": "ELSET MATERIAL ORIENTATION CONTROLS COMPOSITE"}  # what is read of keywords
READ = {*OPTIONS, "ELSET", "NSET", "MATERIAL", "CONTACT PAIR", "SYSTEM"}
SILENT = set("HEADING,PREPRINT,STEP,END STEP,OUTPUT,NODE OUTPUT,ELEMENT OUTPUT,CONTACT OUTPUT,ENERGY OUTPUT,"
             "MODAL OUTPUT,NODE FILE,EL FILE,CONTACT FILE,NODE PRINT,EL PRINT,CONTACT PRINT,RESTART,FILE FORMAT,"
             "PRINT".split(","))  # these ask for results
MADE = ("ELGEN", "ELCOPY")


def kind_of(name, place):
    """The kind of an element type, None if it is no mesh of solids, shells or surfaces."""
    if solid := re.match(r"[CD]C?3D(\d+)", name):
        if solid[1] not in SOLIDS:
            raise Problem(f"{place}: elements {name}: expected solids with 4, 6, 8, 10 or 20 nodes")
        return SOLIDS[solid[1]]
    if shell := re.match(r"(?:S|STRI)(\d)", name):
        if shell[1] not in SHELLS:
            raise Problem(f"{place}: elements {name}: expected shells with 3 or 4 nodes")
        return SHELLS[shell[1]]
    if skin := re.match(r"SFM3D(\d)", name):
        return SKINS.get(skin[1])
    return None


class Sets:
    """Sets by name, in any letters; those of the deck are written as it writes them first."""

    def __init__(self):
        self.names, self.items = {}, {}

    def extend(self, name, items):
        self.names.setdefault(name.upper(), name)
        self.items.setdefault(name.upper(), []).extend(items)

    def get(self, name, place, what):
        if name.upper() not in self.items:
            raise Problem(f"{place}: {what} '{name}' is not defined above; known are {', '.join(self.names.values()) or 'none'}")
        return self.items[name.upper()]


class Elements:
    """What *ELEMENT and *ELSET say beside the elements of the model."""

    def __init__(self):
        self.sets = Sets()
        self.unnamed = Sets()  # elements without ELSET, by type
        self.left_out = {}  # number: type
        self.shells = set()  # those that are no skins


def read_inp(file):
    blocks = flattened(blocks_of(file))
    model = Model(file)
    labels, positions = abaqus_nodes(blocks)
    model.nodes = dict(zip(labels.tolist(), positions))
    if not model.nodes:
        raise Problem(f"{file}: no *NODE")
    nodes, elements = Sets(), Elements()
    for block in blocks:
        if block.name in MADE:
            raise Problem(f"{block.place}: *{block.name} makes elements: let the preprocessor write all of them")
        if block.name == "NODE" and "NSET" in block.options:
            nodes.extend(block.options["NSET"], (whole(fields[0], place) for place, fields in block.rows()))
        elif block.name == "ELEMENT":
            read_elements(block, model, elements)
    for block in blocks:
        if block.name == "ELSET":
            read_set(block, "ELSET", elements.sets)
        elif block.name == "NSET":
            read_set(block, "NSET", nodes, elements.sets, model)
    note_what_is_left_out(blocks, model, elements)
    read_materials(blocks, model)
    read_sections(blocks, model, elements)
    model.node_sets = {nodes.names[name]: list(dict.fromkeys(items)) for name, items in nodes.items.items()}
    read_surfaces(blocks, model, elements, nodes)
    read_boundaries(blocks, model, nodes)
    name_element_sets(model, elements)
    read_pairs(blocks, model)
    return model


def line_of(place, model):
    file, _, line = place.rpartition(", ")
    return line if file == str(model.source) else place


def note_what_is_left_out(blocks, model, elements):
    types = list(elements.left_out.values())
    model.notes += [f"{types.count(name)} elements of type {name}" for name in dict.fromkeys(types)]
    found = {}
    for block in blocks:
        if block.name not in READ | SILENT:
            found.setdefault(f"*{block.name}", []).append(block.place)
        for key, value in block.options.items() if block.name in OPTIONS else ():
            if key not in OPTIONS[block.name].split() and f"{key}={value}".upper() not in ("OFFSET=SMID", "OP=MOD"):
                found.setdefault(f"{key}{'=' if value else ''}{value} of *{block.name}", []).append(block.place)
    for what, places in found.items():
        times = f"{len(places)} times, first in " if len(places) > 1 else ""
        model.notes.append(f"{what} ({times}{line_of(places[0], model)})")


def read_elements(block, model, elements):
    name = block.options.get("TYPE", "").upper()
    kind = kind_of(name, block.place)
    numbers = read_known(block, model, name, kind) if kind else first_numbers(block)
    if kind is None:
        elements.left_out.update((n, name) for n in numbers)
    elif not name.startswith("SFM"):
        elements.shells.update(numbers)
    if "ELSET" in block.options:
        elements.sets.extend(block.options["ELSET"], numbers)
    else:
        elements.unnamed.extend(f"elements_{name}", numbers)


def read_known(block, model, name, kind):
    numbers, fields, size = [], [], 1 + (KINDS.get(kind) or FLAT[kind])[2]
    for place, more in block.rows():
        fields += more
        if len(fields) < size:
            continue
        if len(fields) > size:
            raise Problem(f"{place}: {len(fields)} fields; expected an element's number and {size - 1} nodes of {name}")
        values = [whole(field, place) for field in fields]
        model.add_element(place, values[0], kind, values[1:], "abaqus")
        numbers.append(values[0])
        fields = []
    if fields:
        raise Problem(f"{block.lines[-1][0]}: {len(fields) - 1} nodes of {name}; expected {size - 1}")
    return numbers


def first_numbers(block):
    """Numbers of elements whose number of nodes is not known here: a line that ends in a comma goes on."""
    numbers, goes_on = [], False
    for place, line in block.lines:
        if not goes_on:
            numbers.append(whole(line.split(",")[0], place))
        goes_on = line.endswith(",")
    return numbers


def read_set(block, key, sets, element_sets=None, model=None):
    if not block.options.get(key):
        raise Problem(f"{block.place}: *{key} without a name; expected {key}=NAME")
    name = block.options[key]
    if key == "NSET" and "ELSET" in block.options:
        numbers = element_sets.get(block.options["ELSET"], block.place, "the element set")
        sets.extend(name, dict.fromkeys(node for n in numbers if n in model.elements for node in model.elements[n][1]))
        return
    found = []
    for place, fields in block.rows():
        if "GENERATE" in block.options:
            if len(fields) not in (2, 3):
                raise Problem(f"{place}: {len(fields)} fields; expected first, last[, step]")
            first, last, step = [*(whole(field or "1", place) for field in fields), 1][:3]
            if step < 1 or last < first:
                raise Problem(f"{place}: {first} to {last} by steps of {step}; expected ascending numbers")
            found += range(first, last + 1, step)
        else:
            for field in fields:
                found += [int(field)] if field.isdecimal() else sets.get(field, place, "the set")
    sets.extend(name, found)


def read_materials(blocks, model):
    current = None
    for block in blocks:
        if block.name == "MATERIAL":
            current = model.materials.setdefault(block.options.get("NAME", "").upper(), {})
        elif block.name in ("ELASTIC", "DENSITY", "DAMPING"):
            line = line_of(block.place, model)
            if current is None:
                raise Problem(f"{block.place}: *{block.name} before any *MATERIAL; expected it below one")
            if block.name == "DAMPING":
                keys = (("ALPHA", "alpha"), ("BETA", "beta"), ("STRUCTURAL", "loss_factor"))
                current.update((key, number(block.options[of], block.place)) for of, key in keys if of in block.options)
                continue
            kind = block.options.get("TYPE", "ISOTROPIC").upper()
            if not kind.startswith("ISO"):
                model.notes.append(f"*ELASTIC, TYPE={kind} is not isotropic ({line})")
                continue
            expected = (2, "Young's modulus and Poisson's ratio") if block.name == "ELASTIC" else (1, "a density")
            rows = list(block.rows(*expected))
            if len(rows) > 1:
                model.notes.append(f"all but the first line of *{block.name} ({line}), as of other temperatures")
            for place, fields in rows[:1]:
                if block.name == "DENSITY":
                    current["density"] = number(fields[0], place)
                else:
                    current.update(young=number(fields[0], place), poisson=number(fields[1], place))


def read_sections(blocks, model, elements):
    """A part for every section; a later section takes its elements from earlier ones. Solids without one are parts by
    their sets."""
    owner = {}
    for block in blocks:
        if block.name not in ("SOLID SECTION", "SHELL SECTION"):
            continue
        name = block.options.get("ELSET", "")
        numbers = elements.sets.get(name, block.place, "the element set")
        part = Part([], block.options.get("MATERIAL", "").upper())
        if block.name == "SHELL SECTION":
            read_thickness(block, part, model)
        shown = elements.sets.names[name.upper()]
        kinds = FLAT if block.name == "SHELL SECTION" else KINDS
        fit = [n for n in numbers if n in model.elements and model.elements[n][0] in kinds]
        others = sum(n in model.elements for n in numbers) - len(fit)
        if others:
            line = line_of(block.place, model)
            model.notes.append(f"*{block.name} ({line}) of {others} elements of another kind in {shown}")
        if fit:
            model.parts[shown] = part
            owner.update((n, shown) for n in fit)
    for n, name in owner.items():
        model.parts[name].elements.append(n)
    model.parts = {name: part for name, part in model.parts.items() if part.elements}
    for sets in (elements.sets, elements.unnamed):
        for key, numbers in sets.items.items():
            free = [n for n in numbers if n in model.elements and n not in owner and model.elements[n][0] in KINDS]
            if free and sets.names[key] not in model.parts:
                model.parts[sets.names[key]] = Part(free)
                owner.update((n, sets.names[key]) for n in free)


def read_thickness(block, part, model):
    """The thickness in the first line; of layers, each with a line, the sum, and their material where it is one."""
    rows = [(place, fields) for place, fields in block.rows() if fields and fields[0]]
    if "COMPOSITE" not in block.options:
        part.thickness = number(rows[0][1][0], rows[0][0]) if rows else 0.0
        return
    part.thickness = sum(number(fields[0], place) for place, fields in rows)
    materials = {fields[2].upper() if len(fields) > 2 else "" for _, fields in rows}
    part.material = materials.pop() if len(materials) == 1 else None
    model.notes.append(f"the {len(rows)} layers of *SHELL SECTION ({line_of(block.place, model)}): the part has their "
                       "thickness together" + ("" if part.material else " and no material"))


def read_surfaces(blocks, model, elements, nodes):
    for block in blocks:
        if block.name != "SURFACE":
            continue
        name, kind = block.options.get("NAME", ""), block.options.get("TYPE", "ELEMENT").upper()
        if not name or name in model.surfaces:
            raise Problem(f"{block.place}: the surface '{name}': expected NAME=NAME, which no other surface has")
        rows = list(block.rows(1, "an element, a node or a set, and a face"))
        line = line_of(block.place, model)
        sides = {fields[1].upper() for _, fields in rows if len(fields) > 1}
        if kind not in ("ELEMENT", "NODE") or "COMBINE" in block.options or any(re.match("E", side) for side in sides):
            model.notes.append(f"the surface {name} ({line}): of no faces of elements")
        elif kind == "NODE":
            found = []
            for place, fields in rows:
                found += [int(fields[0])] if fields[0].isdecimal() else nodes.get(fields[0], place, "the node set")
            if name in model.node_sets and set(model.node_sets[name]) != set(found):
                raise Problem(f"{block.place}: the surface '{name}' has other nodes than the set of this name: give it "
                              "another name")
            model.node_sets[name] = found
        else:
            faces = []
            for place, fields in rows:
                of, side = fields[0], fields[1].upper() if len(fields) > 1 else ""
                numbers = [int(of)] if of.isdecimal() else elements.sets.get(of, place, "the element set")
                faces += faces_of(model, numbers, side, place, elements.left_out)
            if faces:
                model.surfaces[name] = faces
            else:
                model.notes.append(f"the surface {name} ({line}): of no solid and no shell elements")


def faces_of(model, numbers, side, place, left_out):
    unknown = [n for n in numbers if n not in model.elements and n not in left_out]
    if unknown:
        raise Problem(f"{place}: element {unknown[0]} is not defined")
    numbers = [n for n in numbers if n in model.elements]
    if side in ("", "SPOS", "SNEG"):
        flat = [model.elements[n][1] for n in numbers if model.elements[n][0] in FLAT]
        solid = [n for n in numbers if model.elements[n][0] in KINDS]
        free = model.free_faces(model.solids()) if solid else {}
        return flat + [face for key, face in model.free_faces(solid).items() if key in free]
    faces = []
    for n in numbers:
        all_faces = model.faces(n)
        if not re.fullmatch(r"S[1-6]", side) or not int(side[1]) <= len(all_faces):
            raise Problem(f"{place}: face '{side}' of element {n}: expected S1 to S{len(all_faces)}, SPOS or SNEG")
        faces.append(all_faces[int(side[1]) - 1])
    return faces


def read_boundaries(blocks, model, nodes):
    """Supports by set and motions; a single node gets a set of its own."""
    held, turned = {}, turned_nodes(blocks, nodes)
    for block in blocks:
        if block.name != "BOUNDARY":
            continue
        for place, fields in block.rows(2, "a node or a set, and a motion from 1 to 6 or a word such as ENCASTRE"):
            name = fields[0]
            if name.isdecimal():
                numbers = model.node_sets.setdefault(f"node_{name}", [int(name)])
                name = f"node_{name}"
            else:
                numbers = nodes.get(name, place, "the node set")
                name = nodes.names[name.upper()]
            motions = motions_of(fields, place, name, model)
            oblique = [n for n in numbers if n in turned]
            if oblique and motions and not ({"x", "y", "z"} <= motions and len(motions) in (3, 6)):
                raise Problem(f"{place}: {' '.join(sorted(motions))} of node {oblique[0]} in the turned system of "
                              f"{turned[oblique[0]]}: expected all translations, or motions along the global axes")
            if motions:
                held.setdefault(name, set()).update(motions)
    model.supports = [(name, [m for m in MOTIONS if m in motions]) for name, motions in held.items()]


def turned_nodes(blocks, nodes):
    """Places of *TRANSFORM by the nodes whose motions it turns."""
    found = {}
    for block in blocks:
        if block.name == "TRANSFORM":
            of = nodes.get(block.options.get("NSET", ""), block.place, "the node set")
            found.update(dict.fromkeys(of, block.place))
    return found


def motions_of(fields, place, name, model):
    """Motions that a line of *BOUNDARY holds; those beyond 6, such as temperatures, are no motions."""
    word = fields[1].upper()
    if word in NAMED_SUPPORTS:
        return set(NAMED_SUPPORTS[word].split())
    first = whole(word, place, "a motion from 1 to 6, or a word such as ENCASTRE")
    last = whole(fields[2], place) if len(fields) > 2 and fields[2] else first
    if not 1 <= first <= last:
        raise Problem(f"{place}: motions {first} to {last}; expected 1 to 6")
    if last > 6:
        model.notes.append(f"the degrees of freedom from {max(first, 7)} on of {name} ({line_of(place, model)})")
    if first <= 6 and len(fields) > 3 and number(fields[3] or "0", place) != 0:
        model.notes.append(f"the prescribed motion {fields[3]} of {name} ({line_of(place, model)}): it is held at zero")
    return {MOTIONS[i - 1] for i in range(first, min(last, 6) + 1)}


def name_element_sets(model, elements):
    """Solids of a set are a group, and its flat elements a surface; a section's set is the part already."""
    for key, numbers in elements.sets.items.items():
        name = elements.sets.names[key]
        kinds = [model.elements[n][0] if n in model.elements else None for n in numbers]
        solids = [n for n, kind in zip(numbers, kinds) if kind in KINDS]
        flat = [n for n, kind in zip(numbers, kinds) if kind in FLAT]
        part = model.parts[name].elements if name in model.parts else []
        if solids and not (part and model.elements[part[0]][0] in KINDS):
            model.element_sets[name] = solids
        if flat and not (part and model.elements[part[0]][0] in FLAT):
            add_surface(model, name, flat)
        unknown = [n for n in numbers if n not in model.elements and n not in elements.left_out]
        if unknown and len(unknown) < len(numbers):
            model.notes.append(f"{len(unknown)} elements of the set {name} that are not there, {unknown[0]} the first")
        if numbers and not solids and not flat:
            model.notes.append(f"the set {name}, whose elements are left out or not there")
    owned = {n for part in model.parts.values() for n in part.elements}
    for key, numbers in elements.unnamed.items.items():
        flat = [n for n in numbers if n in model.elements and model.elements[n][0] in FLAT and n not in owned]
        if flat:
            add_surface(model, elements.unnamed.names[key], flat)
    bare = [n for n, (kind, _) in model.elements.items() if kind in FLAT and n in elements.shells and n not in owned]
    if bare:
        model.notes.append(f"stiffness and mass of {len(bare)} shells without a *SHELL SECTION: they are surfaces")


def add_surface(model, name, flat):
    faces = [model.elements[n][1] for n in flat]
    if {frozenset(face) for face in model.surfaces.get(name, faces)} != {frozenset(face) for face in faces}:
        shown = model.unused(name + "_elements")
        model.notes.append(f"the name {name} of a set of flat elements, which a surface has: it is {shown}")
        name = shown
    model.surfaces[name] = faces


def read_pairs(blocks, model):
    known = {name.upper(): name for name in [*model.node_sets, *model.surfaces]}
    for block in blocks:
        if block.name in ("TIE", "CONTACT PAIR"):
            for place, fields in block.rows(1, "the slave surface and the master surface"):
                missing = [name for name in fields[:2] if name.upper() not in known]
                if missing or len(fields) < 2:
                    what = f"whose surface {missing[0]} is not there" if missing else "which has one surface"
                    model.notes.append(f"*{block.name} ({line_of(place, model)}), {what}")
                else:
                    pairs = model.ties if block.name == "TIE" else model.contacts
                    pairs.append(tuple(known[name.upper()] for name in fields[:2]))
