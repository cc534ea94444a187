"""Decks of Abaqus and CalculiX to a mesh_model.Model: nodes, elements, sets, surfaces and supports; other keywords by the
handlers of their modules."""

import difflib
import re

import numpy as np

from squeal.common import counted
from squeal import abaqus_joining
from squeal import abaqus_steps
from squeal.abaqus_nodes import abaqus_nodes, made_explicit
from squeal.abaqus_parts import flattened
from squeal.abaqus_properties import frame_of, read_materials, read_sections
from squeal.deck_files import Problem, blocks_of, number, span, undefined, whole
from squeal.mesh_model import FLAT, KINDS, MOTIONS, Model

SOLIDS = {"4": "tet4", "5": "pyramid5", "6": "wedge6", "8": "hex8", "10": "tet10", "15": "wedge15", "20": "hex20", "27": "hex27"}
SHELLS = {"3": "tri3", "4": "quad4", "6": "tri6", "8": "quad8", "9": "quad9"}
SKINS = {"3": "tri3", "4": "quad4", "6": "tri6", "8": "quad8"}
NAMED_SUPPORTS = {"ENCASTRE": "x y z rx ry rz", "PINNED": "x y z", "XSYMM": "x ry rz", "YSYMM": "y rx rz", "ZSYMM": "z rx ry",
                  "XASYMM": "y z rx", "YASYMM": "x z ry", "ZASYMM": "x y rz"}
# what is read of keywords beside their data
OPTIONS = {"NODE": "NSET,SYSTEM,INPUT", "ELEMENT": "TYPE,ELSET,INPUT", "SURFACE": "NAME,TYPE,INTERNAL,INPUT,COMBINE",
           "BOUNDARY": "INPUT,FIXED", "ELASTIC": "TYPE", "DENSITY": "", "DAMPING": "ALPHA,BETA,STRUCTURAL",
           "SOLID SECTION": "ELSET,MATERIAL,ORIENTATION,CONTROLS", "TRANSFORM": "NSET,TYPE",
           "SHELL SECTION": "ELSET,MATERIAL,CONTROLS,COMPOSITE,OFFSET", **abaqus_joining.OPTIONS, **abaqus_steps.OPTIONS}
# in the order of the deck, once mesh, sets and sections are there
HANDLERS = {**abaqus_joining.HANDLERS, **abaqus_steps.HANDLERS}
READ = {*OPTIONS, *HANDLERS, "ELSET", "NSET", "MATERIAL", "ORIENTATION"}
SILENT = set("HEADING,PREPRINT,OUTPUT,NODE OUTPUT,ELEMENT OUTPUT,CONTACT OUTPUT,ENERGY OUTPUT,MODAL OUTPUT,NODE FILE,"
             "EL FILE,CONTACT FILE,NODE PRINT,EL PRINT,CONTACT PRINT,RESTART,FILE FORMAT,PRINT".split(","))  # ask for results
OTHERS = ("PLASTIC", "DISTRIBUTION", "UNCOUPLED TEMPERATURE-DISPLACEMENT")  # that look like those that are read
SPELLINGS = {name.replace(" ", ""): name for name in (*READ, *SILENT, *",".join(OPTIONS.values()).split(","), "END PART", "END INSTANCE",
                                                      "END ASSEMBLY", "OLD SET", "NEW SET", "CHANGE NUMBER", "SHIFT NODES", "ELEMENT SHIFT")}
LINES = ("SPRING", "DASHPOT", "MASS", "ROTARYI", "DCOUP", *abaqus_joining.BEAMS)  # elements that keywords of their sections read


def kind_of(name, place):
    """The kind of an element type, None if it is no mesh of solids, shells or surfaces."""
    if solid := re.match(r"[CD]C?3D(\d+)", name):
        if solid[1] not in SOLIDS:
            raise Problem(f"{place}: elements {name}: expected solids with 4, 5, 6, 8, 10, 15, 20 or 27 nodes")
        return SOLIDS[solid[1]]
    if shell := re.match(r"(?:S|STRI)(\d)", name):
        if shell[1] not in SHELLS:
            raise Problem(f"{place}: elements {name}: expected shells with 3, 4, 6, 8 or 9 nodes")
        return SHELLS[shell[1]]
    if skin := re.match(r"(?:SFM3D|CPS|CPE)(\d)", name):
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
            raise undefined(place, what, name, self.names.values())
        return self.items[name.upper()]


class Elements:
    """What *ELEMENT and *ELSET say beside the elements of the model."""

    def __init__(self):
        self.sets = Sets()
        self.unnamed = Sets()  # elements without ELSET, by type
        self.left_out = {}  # number: type
        self.lines = {}  # number: (type, nodes) of springs, masses and beams
        self.shells = set()  # those that are no skins


class Deck:
    """What the handlers of keywords share."""

    def __init__(self, file, blocks):
        self.model, self.blocks = Model(file), blocks
        self.nodes, self.elements, self.steps = Sets(), Elements(), abaqus_steps.Steps()
        self.coupling = None  # node, surface and block of the last *COUPLING
        self.pretension, self.tension, self.beams = {}, {}, {}  # by node, by node, by element
        self.used = set()  # nodes of elements
        self.surface_names = {}  # those of surfaces of nodes whose name a set of others has, by theirs in capitals
        self.bare_surfaces = {}  # that are defined and have no faces of elements: their names by their own in capitals

    def line_of(self, place):
        file, _, line = place.rpartition(", ")
        return line if file == str(self.model.source) else place

    def note(self, what, place):
        self.model.notes.append(f"{what} ({self.line_of(place)})")

    def nodes_of(self, text, place):
        if text.isdecimal():
            if int(text) not in self.model.nodes:
                raise Problem(f"{place}: node {text} is not defined")
            return [int(text)]
        if text.upper() not in self.nodes.items and text.upper() in self.elements.sets.items:
            raise Problem(f"{place}: '{text}' is a set of elements; expected a node or a set of nodes, as *NSET, NSET=NAME, ELSET={text} makes of it")
        found = self.nodes.get(text, place, "the node set")
        if not found:
            self.note(f"what is said of the set {text}, which has no nodes", place.partition(": ")[0])
        return found

    def face_group(self, text, place, what):
        """The name of a surface or of a set of nodes, as the deck writes it first; None of one whose faces are left out."""
        if text.upper() in self.bare_surfaces:
            return None
        text = self.surface_names.get(text.upper(), text)
        known = {name.upper(): name for name in (*self.model.node_sets, *self.model.surfaces)}
        if text.upper() not in known:
            raise undefined(place, what, text, [*self.model.surfaces, *self.model.node_sets])
        return known[text.upper()]

    def elements_of(self, text, place):
        """By number or set; a blank is the whole model, as of gravity in decks of Abaqus/CAE."""
        if not text:
            return list(self.model.elements)
        return [int(text)] if text.isdecimal() else self.elements.sets.get(text, place, "the element set")


def read_inp(file):
    deck = Deck(file, made_explicit(flattened([spelled(block) for block in blocks_of(file)])))
    model, blocks, nodes, elements = deck.model, deck.blocks, deck.nodes, deck.elements
    labels, positions = abaqus_nodes(blocks)
    model.nodes = dict(zip(labels.tolist(), positions))
    if not model.nodes:
        raise Problem(f"{file}: no *NODE")
    for block in blocks:
        if block.name == "NODE" and "NSET" in block.options:
            nodes.extend(block.options["NSET"], first_numbers(block))
        elif block.name == "ELEMENT":
            read_elements(block, model, elements)
    for block in blocks:
        if block.name == "ELSET":
            read_set(block, "ELSET", elements.sets)
        elif block.name == "NSET":
            read_set(block, "NSET", nodes, elements.sets, model)
    deck.used = {node for _, of in model.elements.values() for node in of}
    read_materials(deck)
    read_sections(deck)
    model.node_sets = {nodes.names[name]: list(dict.fromkeys(items)) for name, items in nodes.items.items()}
    read_surfaces(deck)
    name_element_sets(model, elements)
    for block in blocks:
        if block.name in HANDLERS:
            HANDLERS[block.name](block, deck)
    abaqus_steps.finish(deck)
    read_boundaries(deck)
    name_nodes(model)
    note_sets(model, elements)
    note_what_is_left_out(deck)
    return model


def spelled(block):
    """With blanks in its keyword and options as they are read: CalculiX takes REFNODE for REF NODE."""
    block.name = SPELLINGS.get(block.name.replace(" ", ""), block.name)
    block.options = {SPELLINGS.get(key.replace(" ", ""), key): value for key, value in block.options.items()}
    return block


def name_nodes(model):
    """Reference nodes have the name of a set that has no other node."""
    for name, items in model.node_sets.items():
        if len(items) == 1:
            model.joints.names.setdefault(items[0], name)


def note_what_is_left_out(deck):
    model = deck.model
    types = list(deck.elements.left_out.values())
    model.notes += [f"{counted(types.count(name), 'element')} of type {name}" for name in dict.fromkeys(types)]
    found = {}
    for block in deck.blocks:
        if block.name not in READ | SILENT:
            near = [] if block.name in OTHERS else difflib.get_close_matches(block.name, READ, 1, 0.85)
            found.setdefault(f"*{block.name}" + (f", is it *{near[0]}?" if near else ""), []).append(block.place)
        for key, value in block.options.items() if block.name in OPTIONS else ():
            if key not in OPTIONS[block.name].split(",") and f"{key}={value}".upper() not in ("OP=MOD", "TYPE=DISPLACEMENT"):
                found.setdefault(f"{key}{'=' if value else ''}{value} of *{block.name}", []).append(block.place)
    for what, places in found.items():
        times = f"{len(places)} times, first in " if len(places) > 1 else ""
        model.notes.append(f"{what} ({times}{deck.line_of(places[0])})")


def read_elements(block, model, elements):
    name = block.options.get("TYPE", "").upper()
    kind = kind_of(name, block.place)
    numbers = read_known(block, model, name, kind) if kind else first_numbers(block)
    if name.startswith(LINES):
        elements.lines.update((of[0], (name, of[1:])) for of in short_lines(block))
    if kind is None:
        elements.left_out.update((n, name) for n in numbers)
    elif not name.startswith(("SFM", "CP")):
        elements.shells.update(numbers)
    if "ELSET" in block.options:
        elements.sets.extend(block.options["ELSET"], numbers)
    else:
        elements.unnamed.extend(f"elements_{name}", numbers)


def read_known(block, model, name, kind):
    numbers, fields, size = [], [], 1 + (KINDS.get(kind) or FLAT[kind])[2]
    table = block.table(size, np.int64)
    if table is not None and model.add_elements(block, kind, table, "abaqus"):
        return table[:, 0].tolist()
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
    """Numbers at the beginning of lines; a line of elements that ends in a comma goes on."""
    numbers, goes_on = [], False
    for i, line in enumerate(block.texts):
        if not goes_on:
            word = line.partition(",")[0].strip()
            numbers.append(int(word) if word.isdecimal() else whole(word, block.place_at(i)))
        goes_on = block.name == "ELEMENT" and line.endswith(",")
    return numbers


def short_lines(block):
    """Number and nodes of elements that have a line each."""
    return [[whole(field, place) for field in fields if field] for place, fields in block.rows(2, "an element's number and its nodes")]


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
            found += span(first, last, step, place)
        else:
            for field in fields:
                found += [int(field)] if field.isdecimal() else sets.get(field, place, "the set")
    sets.extend(name, found)


def read_surfaces(deck):
    model, elements, nodes = deck.model, deck.elements, deck.nodes
    for block in deck.blocks:
        if block.name != "SURFACE":
            continue
        name, kind = block.options.get("NAME", ""), block.options.get("TYPE", "ELEMENT").upper()
        if not name or name in model.surfaces:
            raise Problem(f"{block.place}: the surface '{name}': expected NAME=NAME, which no other surface has")
        rows = list(block.rows(1, "an element, a node or a set, and a face"))
        line = deck.line_of(block.place)
        sides = {fields[1].upper() for _, fields in rows if len(fields) > 1}
        if kind not in ("ELEMENT", "NODE") or "COMBINE" in block.options or any(re.match("E", side) for side in sides):
            model.notes.append(f"the surface {name} ({line}): of no faces of elements")
            deck.bare_surfaces[name.upper()] = name
        elif kind == "NODE":
            found = []
            for place, fields in rows:
                found += [int(fields[0])] if fields[0].isdecimal() else nodes.get(fields[0], place, "the node set")
            if name in model.node_sets and set(model.node_sets[name]) != set(found):
                deck.surface_names[name.upper()] = model.unused(name + "_surface")
                model.notes.append(f"the name {name} of a surface, which a set of other nodes has: it is {deck.surface_names[name.upper()]}")
                name = deck.surface_names[name.upper()]
            model.node_sets[name] = found
        else:
            faces = []
            for place, fields in rows:
                of, side = fields[0], fields[1].upper() if len(fields) > 1 else ""
                numbers = [int(of)] if of.isdecimal() else elements.sets.get(of, place, "the element set")
                if re.fullmatch("S[3-6]", side) and any(model.elements[n][0] in FLAT for n in numbers if n in model.elements):
                    model.notes.append(f"{side} of the surface {name} ({deck.line_of(place)}), which are edges of flat elements")
                    continue
                faces += faces_of(model, numbers, side, place, elements.left_out)
            if faces:
                model.surfaces[name] = faces
            else:
                model.notes.append(f"the surface {name} ({line}): of no solid and no shell elements")
                deck.bare_surfaces[name.upper()] = name


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
        all_faces = model.faces(n) * (2 if model.elements[n][0] in FLAT else 1)  # a shell has S1 and S2
        if not re.fullmatch(r"S[1-6]", side) or not int(side[1]) <= len(all_faces):
            raise Problem(f"{place}: face '{side}' of element {n}: expected S1 to S{len(all_faces)}, SPOS or SNEG")
        faces.append(all_faces[int(side[1]) - 1])
    return faces


def read_boundaries(deck):
    """Supports by set and motions; a single node gets a set of its own. Nodes that no element has are held as
    reference points."""
    model, nodes, turned = deck.model, deck.nodes, turned_nodes(deck)
    held, moved, frames = {}, {}, {}
    for block in deck.blocks:
        if block.name != "BOUNDARY" or "FIXED" in block.options or block.options.get("TYPE", "DISPLACEMENT").upper() != "DISPLACEMENT":
            continue  # a velocity or an acceleration holds nothing, and is told by its option
        for place, fields in block.rows(2, "a node or a set, and a motion from 1 to 6 or a word such as ENCASTRE"):
            name = fields[0]
            if name.isdecimal():
                deck.nodes_of(name, f"{place}: *BOUNDARY")
                numbers = model.node_sets.setdefault(f"node_{name}", [int(name)])
                name = f"node_{name}"
            else:
                numbers = nodes.get(name, place, "the node set")
                name = nodes.names[name.upper()]
                if not numbers:
                    deck.note(f"*BOUNDARY of the set {name}, which has no nodes", place)
            motions, value = motions_of(fields, place, name, deck)
            for n in numbers:
                if n not in deck.used and n in model.nodes:
                    model.joints.held.setdefault(n, set()).update(motions)
                    if value:
                        model.joints.moved.setdefault(n, {}).update(dict.fromkeys(motions, value))
            systems = {turned[n][0] for n in numbers if n in turned}
            if systems and not ({"x", "y", "z"} <= motions and len(motions) in (3, 6) and not value):
                if len(systems) > 1 or any(n not in turned for n in numbers):
                    raise Problem(f"{place}: {' '.join(sorted(motions))} of {name}, whose nodes are in several systems of "
                                  f"*TRANSFORM, one of {systems.pop()}: give each system a set of its own")
                frames[name] = next(turned[n][1] for n in numbers)
            if motions:
                held.setdefault(name, set()).update(motions)
            if value:
                moved.setdefault(name, {}).update(dict.fromkeys(motions, value))
    model.supports = [(name, [m for m in MOTIONS if m in motions], {**frames.get(name, {}), **displacements(moved.get(name))})
                      for name, motions in held.items()]


def displacements(moved):
    """Keys of a support for displacements by motion."""
    if not moved:
        return {}
    keys = {"displacement": [moved.get(m, 0.0) for m in MOTIONS[:3]], "rotation": [moved.get(m, 0.0) for m in MOTIONS[3:]]}
    return {key: values for key, values in keys.items() if any(values)}


def turned_nodes(deck):
    """Place and frame of *TRANSFORM by the nodes whose motions it turns."""
    found = {}
    for block in deck.blocks:
        if block.name == "TRANSFORM":
            of, kind = deck.nodes.get(block.options.get("NSET", ""), block.place, "the node set"), block.options.get("TYPE", "R").upper()
            rows = list(block.rows(6, "two points of a system"))
            if kind not in ("R", "C") or not rows:
                raise Problem(f"{block.place}: *TRANSFORM, TYPE={kind}: expected R or C and two points")
            values = [number(field or "0", rows[0][0]) for field in rows[0][1][:6]]
            found.update(dict.fromkeys(of, (block.place, frame_of(kind, values, rows[0][0]))))
    return found


def motions_of(fields, place, name, deck):
    """Motions that a line of *BOUNDARY holds, and their displacement; those beyond 6, such as temperatures, are no
    motions."""
    word = fields[1].upper()
    if word in NAMED_SUPPORTS:
        return set(NAMED_SUPPORTS[word].split()), 0.0
    first = whole(word, place, "a motion from 1 to 6, or a word such as ENCASTRE")
    last = whole(fields[2], place) if len(fields) > 2 and fields[2] else first
    if not 0 <= first <= last:
        raise Problem(f"{place}: motions {first} to {last}; expected 1 to 6")
    if last > 6 or first == 0:  # temperatures, pressures, flows
        deck.model.notes.append(f"the degrees of freedom from {max(first, 7) if first else 0} on of {name} ({deck.line_of(place)})")
    value = number(fields[3] or "0", place) if 1 <= first <= 6 and len(fields) > 3 else 0.0
    first = first or 7
    return {MOTIONS[i - 1] for i in range(first, min(last, 6) + 1)}, value


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
    owned = {n for part in model.parts.values() for n in part.elements}
    for key, numbers in elements.unnamed.items.items():
        flat = [n for n in numbers if n in model.elements and model.elements[n][0] in FLAT and n not in owned]
        if flat:
            add_surface(model, elements.unnamed.names[key], flat)
    bare = [n for n, (kind, _) in model.elements.items() if kind in FLAT and n in elements.shells and n not in owned]
    if bare:
        model.notes.append(f"stiffness and mass of {counted(len(bare), 'shell')} without a *SHELL SECTION: they are surfaces")


def note_sets(model, elements):
    """Sets whose elements are not there, once what is read of others is known."""
    for key, numbers in elements.sets.items.items():
        name = elements.sets.names[key]
        unknown = [n for n in numbers if n not in model.elements and n not in elements.left_out and n not in elements.lines]
        if unknown and len(unknown) < len(numbers):
            model.notes.append(f"{counted(len(unknown), 'element')} of the set {name} that are not there, {unknown[0]} the first")
        if numbers and not any(n in model.elements or (n in elements.lines and n not in elements.left_out) for n in numbers):
            model.notes.append(f"the set {name}, whose elements are left out or not there")


def add_surface(model, name, flat):
    faces = [model.elements[n][1] for n in flat]
    if {frozenset(face) for face in model.surfaces.get(name, faces)} != {frozenset(face) for face in faces}:
        shown = model.unused(name + "_elements")
        model.notes.append(f"the name {name} of a set of flat elements, which a surface has: it is {shown}")
        name = shown
    model.surfaces[name] = faces
