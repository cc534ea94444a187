"""Universal Files of Salome, Ideas and gmsh to a mesh_model.Model: datasets of nodes (2411, 15), elements (2412), groups
(2467, 2477, 2452, 2435)."""

import numpy as np
from squeal.deck_files import Problem, lines_of, number, whole
from squeal.mesh_model import FLAT, KINDS, Model, Part

# squeal's kinds by the descriptors of elements; others have no kind
KIND_OF = {111: "tet4", 118: "tet10", 115: "hex8", 116: "hex20", 112: "wedge6", 113: "wedge15", 312: "pyramid5", 313: "pyramid13", 41: "tri3", 91: "tri3", 42: "tri6", 92: "tri6",
           44: "quad4", 94: "quad4", 45: "quad8", 95: "quad8"}
BEAMS = {11, 21, 22, 23, 24}  # lines, which have a line of their own for orientation
GROUPS = {"2467", "2477", "2452", "2435"}
# of parabolic elements the file lists corners and mid-sides in turn around each face
CORNERS_IN_TURN = {"tri6": [0, 2, 4, 1, 3, 5], "quad8": [0, 2, 4, 6, 1, 3, 5, 7],
                   "wedge15": [0, 2, 4, 9, 11, 13, 1, 3, 5, 10, 12, 14, 6, 7, 8], "pyramid13": [0, 2, 4, 6, 12, 1, 3, 5, 7, 8, 9, 10, 11],
                   "tet10": [0, 2, 4, 9, 1, 3, 5, 6, 7, 8],
                   "hex20": [0, 2, 4, 6, 12, 14, 16, 18, 1, 3, 5, 7, 13, 15, 17, 19, 8, 9, 10, 11]}


def read_unv(file):
    model = Model(file)
    left_out, groups = {}, []
    for name, rows in datasets(file):
        if name in ("2411", "15", "781"):
            read_nodes(rows, name, model)
        elif name == "2412":
            read_elements(rows, model, left_out)
        elif name in GROUPS:
            groups.append(rows)
        elif name not in ("164", "2420", "151"):  # units, systems, a heading
            model.notes.append(f"dataset {name} ({rows[0][0].rpartition(', ')[2] if rows else 'empty'})")
    if not model.nodes:
        raise Problem(f"{file}: no dataset 2411 of nodes")
    for rows in groups:
        read_groups(rows, model)
    model.notes += [f"{count} {what}" for what, count in left_out.items()]
    return model


def datasets(file):
    """(number, lines with places) between lines of -1."""
    found, rows, name = [], None, None
    for n, line in lines_of(file):
        if line.strip() == "-1":
            if rows is None:
                rows, name = [], None
            else:
                found.append((name or "", rows))
                rows = None
        elif rows is not None and name is None:
            name = line.strip()
        elif rows is not None:
            rows.append((f"{file}, line {n}", line))
    return found


def read_nodes(rows, name, model):
    if name == "15":  # one line a node
        for place, line in rows:
            words = line.split()
            if len(words) < 7:
                raise Problem(f"{place}: {len(words)} fields; expected a node's number, three others, x, y, z")
            model.nodes[whole(words[0], place)] = np.array([number(word, place) for word in words[4:7]])
        return
    for (place, head), (below, line) in zip(rows[::2], rows[1::2]):
        words = line.split()
        if not head.split() or len(words) != 3:
            raise Problem(f"{below}: {len(words)} fields; expected x, y, z of the node in the line above")
        label = whole(head.split()[0], place)
        if not 0 < label < 2**31:
            raise Problem(f"{place}: node {label}: expected a number from 1 to {2**31 - 1}")
        model.nodes[label] = np.array([number(word, below) for word in words])


def read_elements(rows, model, left_out):
    """A line of number, descriptor, property, material, colour and number of nodes; then nodes, eight a line."""
    parts, i = {}, 0
    while i < len(rows):
        place, line = rows[i]
        values = [whole(word, place) for word in line.split()]
        if len(values) < 6:
            raise Problem(f"{place}: {len(values)} fields; expected an element's number, descriptor, property, material, "
                          "colour and number of nodes")
        label, kind, _, material, _, count = values[:6]
        i += 2 if kind in BEAMS else 1
        nodes = []
        while len(nodes) < count and i < len(rows):
            nodes += [whole(word, rows[i][0]) for word in rows[i][1].split()]
            i += 1
        if count < 1 or len(nodes) != count:
            raise Problem(f"{place}: {len(nodes)} nodes of element {label}; expected {count}")
        shape = KIND_OF.get(kind)
        if shape is None:
            what = "lines" if kind in BEAMS else f"elements of descriptor {kind}"
            left_out[what] = left_out.get(what, 0) + 1
            continue
        if count != (KINDS.get(shape) or FLAT[shape])[2]:
            raise Problem(f"{place}: {count} nodes of descriptor {kind}; expected {(KINDS.get(shape) or FLAT[shape])[2]}")
        order = CORNERS_IN_TURN.get(shape, range(count))
        model.add_element(place, label, shape, [nodes[j] for j in order], "abaqus")
        if shape in KINDS:
            parts.setdefault(material, []).append(label)


def read_groups(rows, model):
    """A head with the number of entities in its eighth field, a name, and entities of a kind, a number and two others."""
    i = 0
    while i + 1 < len(rows):
        place, line = rows[i]
        values = line.split()
        if len(values) < 8:
            raise Problem(f"{place}: {len(values)} fields; expected the eight of a group")
        count, name = whole(values[7], place), rows[i + 1][1].strip() or f"group_{values[0]}"
        i, entities = i + 2, []
        while len(entities) < 4 * count and i < len(rows):
            entities += [whole(word, rows[i][0]) for word in rows[i][1].split()]
            i += 1
        if len(entities) < 4 * count:
            raise Problem(f"{place}: {len(entities) // 4} entities of {name}; expected {count}")
        add_group(model, name, list(zip(entities[::4], entities[1::4])))


def add_group(model, name, entities):
    """Kind 7 are nodes, 8 elements: a group of solids is a part, where no other has its elements."""
    nodes = [n for kind, n in entities if kind == 7 and n in model.nodes]
    elements = [n for kind, n in entities if kind == 8 and n in model.elements]
    lost = len(entities) - len(nodes) - len(elements)
    if lost:
        model.notes.append(f"{lost} of the {len(entities)} entities of {name}, which are no nodes and no elements of the mesh")
    solids, flat = model.solids_and_faces(elements)
    if nodes:
        model.node_sets.setdefault(name, []).extend(nodes)
    if flat:
        model.surfaces.setdefault(name, []).extend(flat)
    taken = {n for part in model.parts.values() for n in part.elements}
    if solids and taken.isdisjoint(solids):
        model.parts.setdefault(name, Part([])).elements.extend(solids)
    elif solids:
        model.element_sets.setdefault(name, []).extend(solids)
