"""Decks of Ansys, as CDWRITE and Workbench write them, to a mesh_model.Model: blocks of nodes, elements and components, materials,
supports, loads, contact pairs and bolts."""

import re
from collections import Counter

import numpy as np
from squeal import ansys_equations
from squeal import ansys_joining
from squeal import ansys_loads
from squeal import ansys_selection
from squeal.ansys_joining import Side
from squeal.common import counted
from squeal.deck_files import Problem, lines_of, number, span, whole
from squeal.mesh_model import FACE_OF_SIZE, FLAT, KINDS, Model, Part

# squeal's kinds by element type and by the number of different nodes
SOLIDS = {45: 8, 65: 8, 185: 8, 190: 8, 95: 20, 186: 20, 92: 10, 187: 10, 285: 4}
SHELLS = {63: 4, 181: 4, 43: 4, 93: 8, 281: 8}
TARGETS, CONTACTS = {169, 170}, {171, 172, 173, 174, 175, 177}
SKINS = {152, 154}
ELASTIC = {"EX": "young", "PRXY": "poisson", "NUXY": "poisson", "DENS": "density", "DMPR": "loss_factor", "BETD": "beta", "ALPD": "alpha"}
ORTHOTROPIC = ("EX", "EY", "EZ", "PRXY", "PRXZ", "PRYZ", "GXY", "GXZ", "GYZ")
# what bricks stand for where corners repeat, by the first place of each: a kind, its corners and its mid-sides
DEGENERATE = {
    (0, 1, 2, 3, 4, 5, 6, 7): ("hex8", "hex20", range(8), range(12)),
    (0, 1, 2, 2, 4, 5, 6, 6): ("wedge6", "wedge15", (0, 1, 2, 4, 5, 6), (0, 1, 3, 4, 5, 7, 8, 9, 10)),
    (0, 1, 2, 3, 4, 4, 4, 4): ("pyramid5", "pyramid13", range(5), (0, 1, 2, 3, 8, 9, 10, 11)),
    (0, 1, 2, 2, 4, 4, 4, 4): ("tet4", "tet10", (0, 1, 2, 4), (0, 1, 3, 8, 9, 10)),
}
SILENT = set("/COM /NOPR /GOPR /PREP7 /TITLE /SOLU /GO /OUTPUT /UNITS /VIEW /AUTO FINISH NUMOFF *IF *ELSE *ENDIF DOF MPTEMP "
             "EXTOPT TREF IRLF BFUNIF CGLOC KUSE TIME CRPLIM NCNV "
             "NEQIT ERESX TOFFST ANTYPE LSCLEAR FCUM DELTIM KBC SHPP SHELL "
             "/BATCH /CONFIG /WB /NOLIST /GOLIST /GST /EOF /POST1 /XML /AUX15 XMLO *GET *DIM ETCON OUTRES RESCONTROL RESC NSUB NSUBST EQSL "
             "EQSLV DMPOPT DMPOPTION CNTR SOLVE CEWRITE CMWRITE NLDIAG SCOPT RSTSUPPRESS AUTOTS CNCHECK FINI CDWRITE TSHAPE RMODIF "
             "LUMPM MXPAND MODCONTROL QRDOPT".split())


class Deck:
    """What the handlers of commands share."""

    def __init__(self, file):
        self.model = Model(file)
        self.types, self.materials = {}, {}
        self.constants = {}  # of materials by number and label
        self.of_pair = {}  # faces and kind by the number of a real constant, with those of each Side
        self.sides = {}  # (real constant, Side) by the numbers of such elements
        self.reals, self.masses = {}, []  # values by real constant; (place, node, real constant, type) of MASS21
        self.springs = []  # the same of COMBIN14, with two nodes
        self.options = {}  # of element types, by type and number of the option
        self.turning = []  # (name of a component, vector of its rate, place)
        self.frictions = {}
        self.held = {}
        self.bodies = {}  # elements by material and type
        self.left_out, self.other_elements = Counter(), Counter()
        self.angles = {}  # [degrees] about z, x and y, of nodes whose motions are along other axes
        self.skins, self.pressed = {}, []  # nodes of surface elements; (element, face, value, place)
        self.equations, self.numbered = [], {}
        self.bolts = {}  # (place, nodes) of PRETS179, by section
        self.section, self.is_pretension = 0, False  # that data are of
        self.section_names, self.directions, self.tension, self.thickness = {}, {}, {}, {}  # by section
        self.middles = {}  # offsets of the middle surface from the nodes, in thicknesses, by section
        self.systems = Counter()  # elements by material and coordinate system
        self.state = ansys_selection.State()
        self.skin_types, self.pressed_nodes = {}, []  # types of surface elements; (nodes, value, place)
        self.nodes_of, self.add_element = ansys_loads.nodes_of, add_element
        self.alpha = self.beta = 0.0

    def note(self, what, place):
        self.model.notes.append(f"{what} ({place.rpartition(', ')[2]})")


class Lines:
    """Lines with their places, of which blocks take their own."""

    def __init__(self, file):
        self.file, self.rows, self.at = file, list(lines_of(file)), 0

    def next(self):
        self.at += 1
        return self.rows[self.at - 1][1]

    def place(self, back=1):
        return f"{self.file}, line {self.rows[max(self.at - back, 0)][0]}" if self.rows else str(self.file)

    def more(self):
        return self.at < len(self.rows)


def read_cdb(file):
    deck, lines = Deck(file), Lines(file)
    while lines.more():
        line = re.sub(r"\s{2,}S\s+\d+$", "", lines.next().split("!")[0].strip())  # load steps have their lines numbered so
        if line[:4].upper() == "/COM":
            ansys_selection.body_title(line, deck)
        elif line and not ansys_selection.assignment(line, deck):
            for command in line.split("$"):
                read_command(ansys_selection.filled([word.strip() for word in command.split(",")], deck), lines, deck)
    finish(deck)
    return deck.model


def read_command(words, lines, deck):
    name = words[0].upper()
    if name in BLOCKS:
        BLOCKS[name](words, lines, deck)
    elif name in COMMANDS:
        COMMANDS[name](words, lines.place(), deck)
    elif re.match(r"[A-Z/*]", name) and name.split()[0] not in SILENT and not name.startswith("_"):
        deck.left_out[name] += 1


# ---- blocks


def widths_of(text, place):
    """Widths of fields of a Fortran format such as (3i9,6e21.13e3); what letters they have."""
    found = []
    for count, letter, width in re.findall(r"(\d*)([aieg])(\d+)", text.lower()):
        found += [(letter, int(width))] * int(count or 1)
    if not found or len(found) > 100:
        raise Problem(f"{place}: '{text.strip()[:40]}': expected a format such as (3i9,6e21.13e3)")
    return found


def fields_of(line, widths):
    found, at = [], 0
    for _, width in widths:
        if at >= len(line.rstrip()):
            break
        found.append(line[at : at + width].strip())
        at += width
    return found


def read_nodes(words, lines, deck):
    """NBLOCK: number, two others in old forms, x, y, z; absent ones are 0."""
    if not lines.more():
        raise Problem(f"{lines.place()}: NBLOCK without a format")
    widths = widths_of(lines.next(), lines.place())
    first = sum(letter == "i" for letter, _ in widths)
    while lines.more():
        line = lines.next()
        if not line.lstrip()[:1].isdigit():
            lines.at -= line.strip()[:2].upper() not in ("-1", "N,", "")  # Workbench ends a block by the next command
            break
        fields = fields_of(line, widths)
        position = [number(field or "0", lines.place()) for field in fields[first : first + 3]]
        label = whole(fields[0], lines.place())
        add_node(deck, label, position, [number(field or "0", lines.place()) for field in fields[first + 3 : first + 6]], lines.place())


def add_node(deck, label, position, angles, place):
    if not 0 < label < 2**31:
        raise Problem(f"{place}: node {label}: expected a number from 1 to {2**31 - 1}")
    deck.model.nodes[label] = np.array(position + [0.0] * (3 - len(position)))
    if any(angles):
        deck.angles[label] = (angles + [0.0] * 3)[:3]


def node(words, place, deck):
    """N,node,x,y,z,angles; N,R5.3 is the end of a block."""
    if len(words) > 1 and not words[1].upper().startswith("R"):
        values = [number(word or "0", place) for word in words[2:8]]
        add_node(deck, whole(words[1], place), values[:3], values[3:], place)


def read_elements(words, lines, deck):
    """EBLOCK of solids: material, type, real, section, system, four others, count, an empty one, number, nodes. Others: number,
    type, real, material, system, nodes."""
    if not lines.more():
        raise Problem(f"{lines.place()}: EBLOCK without a format")
    widths = widths_of(lines.next(), lines.place())
    solid = len(words) > 2 and words[2].upper() == "SOLID"
    before = {key: len(of) for key, of in deck.bodies.items()}
    while lines.more():
        fields = fields_of(lines.next(), widths)
        place = lines.place()
        if not fields or fields[0] == "-1":
            break
        values = [whole(field, place) for field in fields]
        if len(values) < (11 if solid else 6):
            raise Problem(f"{place}: {len(values)} fields; expected {11 if solid else 5} before the nodes of an element")
        if not solid:
            label, kind, real, material, system = values[:5]
            add_element(deck, place, label, [material, kind, real, 0, system], values[5:])
            continue
        count = values[8]
        while len(values) < 11 + count and lines.more():
            values += [whole(field, place) for field in fields_of(lines.next(), widths)]
        if len(values) != 11 + count:
            raise Problem(f"{place}: {len(values) - 11} nodes; expected {count}")
        add_element(deck, place, values[10], values[:5], values[11:])
    ansys_selection.name_bodies(before, deck)


def kind_of(kind, nodes, place):
    """The kind of a solid, and its nodes without those that a degenerate form repeats."""
    few, most = (4, 10) if SOLIDS[kind] in (4, 10) else (8, 20)
    corners, mids = nodes[:few], nodes[few:most]
    if len(corners) < few or any(mids) and not (all(mids) and len(mids) == most - few):
        raise Problem(f"{place}: an element of type {kind} lacks some of its {few} corners or {most - few} mid-side nodes; expected "
                      "all corners, and all mid-side nodes or none")
    quadratic = any(mids) and kind != 285
    if few == 4:
        return ("tet10", corners + mids) if quadratic else ("tet4", corners)
    found = DEGENERATE.get(tuple(map(corners.index, corners)))
    if not found:
        raise Problem(f"{place}: an element of {len(set(corners))} corners, which are not those of a tetrahedron, pyramid, wedge or brick")
    linear, parabolic, kept, kept_mids = found
    if quadratic:
        return parabolic, [corners[i] for i in kept] + [mids[i] for i in kept_mids]
    return linear, [corners[i] for i in kept]


def add_element(deck, place, label, attributes, nodes):
    material, kind_number, real, section, system = attributes
    kind, model = deck.types.get(kind_number), deck.model
    deck.state.last = max(deck.state.last, label)
    if kind in SOLIDS:
        shape, nodes = kind_of(kind, nodes, place)
        model.add_element(place, label, shape, nodes, "abaqus")
        deck.bodies.setdefault((material, 0), []).append(label)
        deck.systems[material, system] += system != 0
    elif kind in SHELLS:
        nodes = face_of(nodes[: SHELLS[kind]])
        if len(nodes) not in FACE_OF_SIZE:
            raise Problem(f"{place}: a shell of {len(nodes)} different nodes; expected 3, 4, 6 or 8")
        model.add_element(place, label, FACE_OF_SIZE[len(nodes)], nodes, "abaqus")
        deck.bodies.setdefault((material, section or 1), []).append(label)
    elif kind in TARGETS | CONTACTS:
        side = Side.TARGET if kind in TARGETS else Side.CONTACT
        deck.of_pair.setdefault(real, {"material": material}).setdefault(side, []).append(face_of(nodes))
        deck.sides[label] = real, side
        if side is Side.CONTACT:
            deck.of_pair[real] |= {"material": material, "type": kind_number}
    elif kind == 179:
        deck.bolts.setdefault(section, []).append((place, nodes))
    elif kind in SKINS:
        deck.skins[label], deck.skin_types[label] = face_of(nodes), kind_number
    elif kind == 14:
        deck.springs.append((place, nodes, real, kind_number))
    elif kind == 21:
        deck.masses.append((place, nodes[0], real, kind_number))
    else:
        deck.other_elements[f"type {kind}" if kind else f"type number {kind_number}, which no ET or ETBLOCK says"] += 1


def face_of(nodes):
    """Corners, then mid-sides where they are there, without those that a triangle repeats."""
    corners = [n for i, n in enumerate(nodes[:4]) if n and n not in nodes[:i]]
    mids = [n for i, n in enumerate(nodes[4:8]) if n and (len(corners) == 4 or i != 2)]
    return tuple(corners + (mids if len(mids) == len(corners) else []))


def read_component(words, lines, deck):
    """CMBLOCK: numbers, of which a negative one ends a range."""
    if len(words) < 4 or not lines.more():
        raise Problem(f"{lines.place()}: '{','.join(words)[:60]}': expected CMBLOCK,NAME,NODE or ELEM,COUNT")
    name, kind, count, place = words[1], words[2].upper(), whole(words[3], lines.place()), lines.place()
    widths, numbers = widths_of(lines.next(), lines.place()), []
    while lines.more() and len(numbers) < count:
        numbers += [whole(field, lines.place()) for field in fields_of(lines.next(), widths)]
    if len(numbers) != count:
        raise Problem(f"{place}: {len(numbers)} numbers of {name}; expected {count}")
    items = []
    for n in numbers:
        if n >= 0:
            items.append(n)
        elif not items or -n < items[-1]:
            raise Problem(f"{place}: {name} has the range to {-n} without a smaller beginning")
        else:
            items += span(items[-1], -n, 1, place)[1:]
    if kind.startswith("NODE"):
        deck.model.node_sets[name] = items
    else:
        deck.model.element_sets[name] = items


def read_reals(words, lines, deck):
    """RLBLOCK: of each set its number, its count and six values, then seven a line."""
    if not lines.more():
        raise Problem(f"{lines.place()}: RLBLOCK without a format")
    first = widths_of(lines.next(), lines.place())
    more = widths_of(lines.next(), lines.place()) if lines.more() else first
    for _ in range(whole(words[1] if len(words) > 1 else "", lines.place())):
        fields = fields_of(lines.next(), first) if lines.more() else []
        place = lines.place()
        if len(fields) < 2:
            raise Problem(f"{place}: RLBLOCK ends before its {words[1]} sets; expected a set's number, its count and its values")
        values = [number(field or "0", place) for field in fields[2:]]
        while len(values) < whole(fields[1], place) and lines.more():
            values += [number(field or "0", lines.place()) for field in fields_of(lines.next(), more)] or [0.0]
        deck.reals[whole(fields[0], place)] = values


def read_types(words, lines, deck):
    """ETBLOCK: number, element type, and its options from the first on."""
    if not lines.more():
        raise Problem(f"{lines.place()}: ETBLOCK without a format")
    widths = widths_of(lines.next(), lines.place())
    while lines.more():
        fields = fields_of(lines.next(), widths)
        if len(fields) < 2 or fields[0] == "-1":
            break
        values = [whole(field or "0", lines.place()) for field in fields]
        deck.types[values[0]] = values[1]
        deck.options |= {(values[0], i): value for i, value in enumerate(values[2:], 1)}


BLOCKS = {"ETBLOCK": read_types, "DBLOCK": ansys_loads.support_block, "SFEBLOCK": ansys_loads.surface_block,
          "RLBLOCK": read_reals, "SECBLOCK": ansys_equations.section_block, "SFE": ansys_loads.surface_load,
          "NBLOCK": read_nodes, "EBLOCK": read_elements, "CMBLOCK": read_component}

# ---- commands


def element_type(words, place, deck):
    if len(words) < 3:
        raise Problem(f"{place}: '{','.join(words)}': expected ET, a number and an element type")
    deck.types[whole(words[1], place)] = whole(re.sub(r"\D", "", words[2]), place, "an element type such as 185")


def material_data(words, place, deck):
    """MPDATA,R5.0,1,label,number,place,value: the first temperature alone; also without its first two words, and MP."""
    values = words[1:]
    if words[0].upper() == "MP":
        label, material, value = (*values, "", "", "")[:3]
    else:
        if values and values[0].upper().startswith("R"):
            values = values[2:]
        label, material, start, value = (*values, "", "", "", "")[:4]
        if start not in ("", "1") or len(values) > 4 and any(values[4:]):
            deck.left_out["MPDATA of further temperatures"] += 1
        if start not in ("", "1"):
            return
    if label.upper() not in ("UVID", "UMID"):  # names of Workbench
        deck.constants.setdefault(whole(material, place), {})[label.upper()] = number(value, place)
        deck.model.material_places[whole(material, place), ELASTIC.get(label.upper(), "orthotropic" if label.upper() in ORTHOTROPIC else label.upper())] = place


def key_option(words, place, deck):
    if len(words) > 3:
        deck.options[whole(words[1], place), whole(words[2], place)] = whole(words[3] or "0", place)


def real_constants(words, place, deck):
    """R,set,value,…; those of contacts are penalties, which a scene has not."""
    deck.reals[whole(words[1] if len(words) > 1 else "", place)] = [number(word or "0", place) for word in words[2:8]]


def rotation(words, place, deck):
    """CMROTATE,component,x,y,z: the rate about the global axes of the elements that turn."""
    rate = [number(word or "0", place) for word in (words[2:] + ["0"] * 3)[:3]]
    if any(rate):
        deck.turning.append((words[1] if len(words) > 1 else "", rate, place))


COMMANDS = {"R": real_constants, "CMROTATE": rotation, "KEYOPT": key_option, "KEYOP": key_option, "KEYO": key_option,
            "ET": element_type, "MPDATA": material_data, "MP": material_data,
            "N": node, "CE": ansys_equations.read_equation, "SECTYPE": ansys_equations.section_type, "SECDATA": ansys_equations.section_data,
            "SECOFFSET": ansys_equations.section_offset, "SECO": ansys_equations.section_offset,
            "SLOAD": ansys_equations.section_load, **ansys_loads.COMMANDS, **ansys_selection.COMMANDS}


# ---- what the whole deck makes


def finish(deck):
    model = deck.model
    if not model.nodes:
        raise Problem(f"{model.source}: no nodes, as NBLOCK or N; expected a deck that CDWRITE,DB or Workbench writes")
    for material, constants in deck.constants.items():
        model.materials[material] = material_of(constants, material, deck)
    several = Counter(material for material, _ in deck.bodies)
    for (material, section), elements in deck.bodies.items():
        name = deck.state.body_names.get((material, section)) or f"material_{material}" + (f"_shells_{section}" if section and several[material] > 1 else "")
        thickness = deck.thickness.get(section, 0.0) if section else 0.0
        model.parts[model.unused(name)] = Part(elements, material, thickness, thickness * deck.middles.get(section, 0.0))
    ansys_equations.bolts(deck)
    ansys_equations.rigid_regions(deck)
    rotors = ansys_joining.rotors_of(deck)
    name_parts(deck)
    ansys_loads.finish(deck)
    ansys_joining.pairs(deck, rotors)
    ansys_joining.masses(deck)
    ansys_joining.springs(deck)
    model.notes += [f"{counted(count, 'element')} of {name}" for name, count in sorted(deck.other_elements.items())]
    if deck.left_out:
        model.notes.append("the commands " + ", ".join(f"{name} ({count})" for name, count in sorted(deck.left_out.items())))


def name_parts(deck):
    """A part whose elements are those of a component has its name."""
    model = deck.model
    for name, elements in list(model.element_sets.items()):
        elements = [n for n in elements if n not in deck.sides]
        known = [n for n in elements if n in model.elements]
        if len(known) < len(elements):
            model.notes.append(f"{len(elements) - len(known)} of the {len(elements)} elements of {name}, which the mesh has not")
        model.element_sets[name] = known
        same = next((part for part, of in model.parts.items() if set(of.elements) == set(known)), None)
        if same:
            model.parts[name] = model.parts.pop(same)
            del model.element_sets[name]
    for name, elements in list(model.element_sets.items()):
        flat = [model.elements[n][1] for n in elements if model.elements[n][0] in FLAT]
        model.element_sets[name] = [n for n in elements if model.elements[n][0] in KINDS]
        if flat:
            model.surfaces[model.unused(name + "_faces")] = flat
        if not model.element_sets[name]:
            del model.element_sets[name]


def material_of(constants, material, deck):
    if all(label in constants for label in ORTHOTROPIC):
        values = [constants[label] for label in ORTHOTROPIC]
        for (of, system), count in deck.systems.items():
            if of == material and count:
                deck.model.notes.append(f"the coordinate system {system} of {counted(count, 'element')}: material {material} has the basic axes")
        return {"orthotropic": {"young": values[:3], "poisson": values[3:6], "shear": values[6:]}, "density": constants.get("DENS", 0.0),
                **damping_of(constants, deck)}
    others = set(constants) - set(ELASTIC) - {"MU", "GXY", "ALPX", "CTEX", "REFT", "KXX", "C"}
    if others and "EX" in constants:
        deck.model.notes.append(f"{', '.join(sorted(others))} of material {material}")
    return {ELASTIC[label]: value for label, value in constants.items() if label in ELASTIC} | damping_of(constants, deck)


def damping_of(constants, deck):
    """That of the material, to which ALPHAD and BETAD of all add."""
    found = {"alpha": constants.get("ALPD", 0.0) + deck.alpha, "beta": constants.get("BETD", 0.0) + deck.beta,
             "loss_factor": constants.get("DMPR", 0.0)}
    return {key: value for key, value in found.items() if value}
