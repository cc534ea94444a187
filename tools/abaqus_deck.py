"""Meshes of Abaqus and CalculiX: an input deck to a mesh_model.Model."""

import re

from abaqus_parts import flattened
from deck_files import Problem, abaqus_nodes, blocks_of, number, whole
from mesh_model import FLAT, KINDS, MOTIONS, Model, Part

SOLIDS = {"4": "tet4", "6": "wedge6", "8": "hex8", "10": "tet10", "20": "hex20"}
SHELLS = {"3": "tri3", "4": "quad4"}
SKINS = {"3": "tri3", "4": "quad4", "6": "tri6", "8": "quad8"}
NAMED_SUPPORTS = {"ENCASTRE": "x y z rx ry rz", "PINNED": "x y z", "XSYMM": "x ry rz", "YSYMM": "y rx rz", "ZSYMM": "z rx ry",
                  "XASYMM": "y z rx", "YASYMM": "x z ry", "ZASYMM": "x y rz"}


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


def read_inp(file):
    blocks = flattened(blocks_of(file))
    model = Model(file)
    labels, positions = abaqus_nodes(blocks)
    model.nodes = dict(zip(labels.tolist(), positions))
    if not model.nodes:
        raise Problem(f"{file}: no *NODE")
    nodes, elements = Sets(), Sets()
    left_out = {}
    for block in blocks:
        if block.name == "NODE" and "NSET" in block.options:
            nodes.extend(block.options["NSET"], (whole(fields[0], place) for place, fields in block.rows()))
        elif block.name == "ELEMENT":
            read_elements(block, model, elements, left_out)
    for block in blocks:
        if block.name == "ELSET":
            read_set(block, "ELSET", elements)
        elif block.name == "NSET":
            read_set(block, "NSET", nodes, elements, model)
    for count, kind in ((count, kind) for kind, count in left_out.items()):
        model.notes.append(f"{count} elements of type {kind}")
    read_materials(blocks, model)
    read_sections(blocks, model, elements)
    for name, items in elements.items.items():
        solids = [n for n in items if n in model.elements and model.elements[n][0] in KINDS]
        if solids and elements.names[name] not in model.parts:
            model.element_sets[elements.names[name]] = solids
    model.node_sets = {nodes.names[name]: list(dict.fromkeys(items)) for name, items in nodes.items.items()}
    read_surfaces(blocks, model, elements, nodes)
    read_boundaries(blocks, model, nodes)
    read_pairs(blocks, model)
    name_skins(model, elements)
    return model


def read_elements(block, model, elements, left_out):
    name = block.options.get("TYPE", "").upper()
    kind = kind_of(name, block.place)
    numbers = []
    if kind is None:
        left_out[name] = left_out.get(name, 0) + len(block.lines)
        return
    size = 1 + (KINDS.get(kind) or FLAT[kind])[2]
    fields = []
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
    elements.extend(block.options.get("ELSET", f"elements_{name}"), numbers)


def read_set(block, key, sets, elements=None, model=None):
    if key not in block.options:
        raise Problem(f"{block.place}: *{key} without a name; expected {key}=NAME")
    name = block.options[key]
    if key == "NSET" and "ELSET" in block.options:
        numbers = elements.get(block.options["ELSET"], block.place, "the element set")
        sets.extend(name, dict.fromkeys(node for n in numbers if n in model.elements for node in model.elements[n][1]))
        return
    found = []
    for place, fields in block.rows():
        if "GENERATE" in block.options:
            if len(fields) not in (2, 3):
                raise Problem(f"{place}: {len(fields)} fields; expected first, last[, step]")
            first, last, step = [*(whole(field, place) for field in fields), 1][:3]
            found += range(first, last + 1, step)
        else:
            for field in fields:
                found += [int(field)] if field.isdigit() else sets.get(field, place, "the set")
    sets.extend(name, found)


def read_materials(blocks, model):
    current = None
    for block in blocks:
        if block.name == "MATERIAL":
            current = model.materials.setdefault(block.options.get("NAME", "").upper(), {})
        elif block.name in ("ELASTIC", "DENSITY") and current is not None and block.lines:
            place, fields = next(block.rows())
            kind = block.options.get("TYPE", "ISOTROPIC").upper()
            if block.name == "DENSITY":
                current["density"] = number(fields[0], place)
            elif not kind.startswith("ISO"):
                current["note"] = f"*ELASTIC, TYPE={kind} is not isotropic"
            elif len(fields) < 2:
                raise Problem(f"{place}: {len(fields)} constants; expected Young's modulus and Poisson's ratio")
            else:
                current.update(young=number(fields[0], place), poisson=number(fields[1], place))


def read_sections(blocks, model, elements):
    """A part for every section; a later section takes its elements from earlier ones."""
    owner = {}
    for block in blocks:
        if block.name not in ("SOLID SECTION", "SHELL SECTION"):
            continue
        name = block.options.get("ELSET", "")
        numbers = elements.get(name, block.place, "the element set")
        part = Part([], block.options.get("MATERIAL", "").upper())
        if block.name == "SHELL SECTION" and block.lines:
            place, fields = next(block.rows())
            part.thickness = number(fields[0], place)
        shown = elements.names[name.upper()]
        model.parts[shown] = part
        owner.update((n, shown) for n in numbers if n in model.elements)
    for n, name in owner.items():
        model.parts[name].elements.append(n)
    model.parts = {name: part for name, part in model.parts.items() if part.elements}
    for key, numbers in elements.items.items():
        free = [n for n in numbers if n in model.elements and n not in owner and model.elements[n][0] in KINDS]
        if free and elements.names[key] not in model.parts:
            model.parts[elements.names[key]] = Part(free)
            owner.update((n, elements.names[key]) for n in free)


def read_surfaces(blocks, model, elements, nodes):
    for block in blocks:
        if block.name != "SURFACE":
            continue
        name = block.options.get("NAME", "")
        if block.options.get("TYPE", "ELEMENT").upper() == "NODE":
            for place, fields in block.rows():
                found = [int(fields[0])] if fields[0].isdigit() else nodes.get(fields[0], place, "the node set")
                model.node_sets.setdefault(name, []).extend(found)
            continue
        faces = []
        for place, fields in block.rows():
            numbers = [int(fields[0])] if fields[0].isdigit() else elements.get(fields[0], place, "the element set")
            faces += faces_of(model, numbers, fields[1].upper() if len(fields) > 1 else "", place)
        model.surfaces[name] = faces


def faces_of(model, numbers, side, place):
    unknown = [n for n in numbers if n not in model.elements]
    if unknown:
        raise Problem(f"{place}: element {unknown[0]} is not defined")
    if side in ("", "SPOS", "SNEG"):
        flat = [model.elements[n][1] for n in numbers if model.elements[n][0] in FLAT]
        solid = [n for n in numbers if model.elements[n][0] in KINDS]
        free = model.free_faces(model.solids()) if solid else {}
        return flat + [face for key, face in model.free_faces(solid).items() if key in free]
    faces = []
    for n in numbers:
        all_faces = model.faces(n)
        if not re.fullmatch(r"S\d", side) or not 1 <= int(side[1]) <= len(all_faces):
            raise Problem(f"{place}: face '{side}' of element {n}: expected S1 to S{len(all_faces)}, SPOS or SNEG")
        faces.append(all_faces[int(side[1]) - 1])
    return faces


def read_boundaries(blocks, model, nodes):
    """Supports by set and motions; a single node gets a set of its own."""
    held = {}
    for block in blocks:
        if block.name != "BOUNDARY":
            continue
        for place, fields in block.rows():
            name = fields[0]
            if name.isdigit():
                model.node_sets.setdefault(f"node_{name}", [int(name)])
                name = f"node_{name}"
            else:
                nodes.get(name, place, "the node set")
                name = nodes.names[name.upper()]
            word = fields[1].upper() if len(fields) > 1 else ""
            if word in NAMED_SUPPORTS:
                held.setdefault(name, set()).update(NAMED_SUPPORTS[word].split())
                continue
            first = whole(word, place, "a motion from 1 to 6, or a word such as ENCASTRE")
            last = whole(fields[2], place) if len(fields) > 2 and fields[2] else first
            if not 1 <= first <= last:
                raise Problem(f"{place}: motions {first} to {last}; expected 1 to 6")
            if len(fields) > 3 and number(fields[3] or "0", place) != 0:
                model.notes.append(f"the prescribed motion {fields[3]} of {name}: it is held at zero")
            held.setdefault(name, set()).update(MOTIONS[i - 1] for i in range(first, min(last, 6) + 1))
    model.supports = [(name, [m for m in MOTIONS if m in motions]) for name, motions in held.items()]


def read_pairs(blocks, model):
    for block in blocks:
        if block.name in ("TIE", "CONTACT PAIR"):
            for place, fields in block.rows():
                if len(fields) < 2:
                    raise Problem(f"{place}: expected the slave surface and the master surface")
                (model.ties if block.name == "TIE" else model.contacts).append(tuple(fields[:2]))
        elif block.name in ("RIGID BODY", "COUPLING", "MPC", "EQUATION", "CLOAD", "DLOAD", "SPRING", "DASHPOT"):
            model.notes.append(f"*{block.name} ({block.place.rpartition(', ')[2]})")


def name_skins(model, elements):
    """Sets of flat elements that are no shells are surfaces."""
    shells = {n for part in model.parts.values() for n in part.elements}
    for key, numbers in elements.items.items():
        flat = [n for n in numbers if n in model.elements and model.elements[n][0] in FLAT and n not in shells]
        if flat:
            model.surfaces.setdefault(elements.names[key], [model.elements[n][1] for n in flat])
