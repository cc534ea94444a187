"""A mesh with its parts, surfaces, sets, materials and boundary conditions, between the decks of other codes and gmsh's
format 4.1.

Node orders: codes number the nodes between corners of quadratic elements by other edges. An order is here the list of the
corners in whose middles the nodes behind the corners are.
"""

import numpy as np
from squeal.common import counted
from squeal.deck_files import Problem
from squeal.deck_joints import Joints

# gmsh's type, number of corners, number of nodes, faces by corners in the order of Abaqus's S1, S2, …
KINDS = {
    "tet4": (4, 4, 4, [(0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)]),
    "hex8": (5, 8, 8, [(0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)]),
    "wedge6": (6, 6, 6, [(0, 1, 2), (3, 5, 4), (0, 3, 4, 1), (1, 4, 5, 2), (2, 5, 3, 0)]),
    "pyramid5": (7, 5, 5, [(0, 1, 2, 3), (0, 4, 1), (1, 4, 2), (2, 4, 3), (3, 4, 0)]),
}
KINDS["tet10"] = (11, 4, 10, KINDS["tet4"][3])
KINDS["hex20"] = (17, 8, 20, KINDS["hex8"][3])
KINDS["hex27"] = (12, 8, 27, KINDS["hex8"][3])
KINDS["wedge15"] = (18, 6, 15, KINDS["wedge6"][3])
KINDS["pyramid13"] = (19, 5, 13, KINDS["pyramid5"][3])
BOTTOM, TOP = [(0, 1), (1, 2), (2, 3), (3, 0)], [(4, 5), (5, 6), (6, 7), (7, 4)]
UP = [(0, 4), (1, 5), (2, 6), (3, 7)]
TET_EDGES = [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]  # of Abaqus, Nastran and VTK
PYRAMID_EDGES = [*BOTTOM, *((i, 4) for i in range(4))]  # of all but gmsh
BELOW, ABOVE, BESIDE = [(0, 1), (1, 2), (2, 0)], [(3, 4), (4, 5), (5, 3)], [(0, 3), (1, 4), (2, 5)]  # of wedges
WHOLE = tuple(range(8))
MIDDLES = {
    "abaqus": {"tet10": TET_EDGES, "hex20": BOTTOM + TOP + UP, "wedge15": BELOW + ABOVE + BESIDE, "pyramid13": PYRAMID_EDGES,
               "hex27": [*BOTTOM, *TOP, *UP, WHOLE, *KINDS["hex8"][3]]},
    "nastran": {"tet10": TET_EDGES, "hex20": BOTTOM + UP + TOP, "wedge15": BELOW + BESIDE + ABOVE, "pyramid13": PYRAMID_EDGES},
    "gmsh": {"tet10": [(0, 1), (1, 2), (2, 0), (3, 0), (3, 2), (3, 1)],
             "hex20": [(0, 1), (0, 3), (0, 4), (1, 2), (1, 5), (2, 3), (2, 6), (3, 7), (4, 5), (4, 7), (5, 6), (6, 7)],
             "wedge15": [(0, 1), (0, 2), (0, 3), (1, 2), (1, 4), (2, 5), (3, 4), (3, 5), (4, 5)],
             "pyramid13": [(0, 1), (0, 3), (0, 4), (1, 2), (1, 4), (2, 3), (2, 4), (3, 4)]},
}
MIDDLES["vtk"] = MIDDLES["abaqus"] | {"hex27": [*BOTTOM, *TOP, *UP, *(KINDS["hex8"][3][i] for i in (5, 3, 2, 4, 0, 1)), WHOLE]}
MIDDLES["gmsh"]["hex27"] = [*MIDDLES["gmsh"]["hex20"], *(KINDS["hex8"][3][i] for i in (0, 2, 5, 3, 4, 1)), WHOLE]
FLAT = {"tri3": (2, 3, 3), "quad4": (3, 4, 4), "tri6": (9, 3, 6), "quad8": (16, 4, 8), "quad9": (10, 4, 9)}
FACE_OF_SIZE = {3: "tri3", 4: "quad4", 6: "tri6", 8: "quad8", 9: "quad9"}
MOTIONS = ("x", "y", "z", "rx", "ry", "rz")


def gmsh_order(kind, code):
    """Where gmsh's nodes of an element stand in the order of another code."""
    corners, nodes = (KINDS.get(kind) or FLAT[kind])[1:3]
    if kind not in MIDDLES["gmsh"]:
        return list(range(nodes))
    place = {frozenset(of): corners + i for i, of in enumerate(MIDDLES[code][kind])}
    return [*range(corners), *(place[frozenset(of)] for of in MIDDLES["gmsh"][kind])]


def order_back(kind):
    """Where Abaqus's nodes of an element stand in gmsh's order."""
    order = gmsh_order(kind, "abaqus")
    return [order.index(i) for i in range(len(order))] if kind in MIDDLES["gmsh"] else list(range(len(order)))


class Part:
    def __init__(self, elements, material=None, thickness=0.0, offset=0.0):
        self.elements, self.material, self.thickness = elements, material, thickness
        self.offset = offset  # of shells: from the nodes to the middle surface, along the normal
        self.place = ""  # in the deck, of its thickness
        self.axes = None  # of an orthotropic material: axis_1 and axis_2, or cylinder


class Model:
    """All by the numbers of the deck. Elements are in gmsh's order of nodes."""

    def __init__(self, source):
        self.source = source
        self.nodes = {}  # number: position
        self.elements = {}  # number: (kind, nodes)
        self.parts = {}  # name: Part; no element is in two
        self.element_sets = {}  # name: numbers of solid elements
        self.surfaces = {}  # name: faces, each a tuple of nodes in gmsh's order
        self.node_sets = {}  # name: nodes
        self.materials = {}  # name: {"young": , "poisson": , "density": , "loss_factor": , "alpha": , "beta": }
        self.material_places = {}  # where a material has a key, or None for all of its keys, by both
        self.loss_factor = 0.0  # of all parts, beside those of their materials
        self.loss_frequency = 0.0  # [Hz] of their viscous equivalent
        self.supports = []  # (name of a node set, motions, other keys of its table)
        self.ties = []  # (slave, master)
        self.contacts = []  # (slave, master, other keys of its table)
        self.contact_places = {}  # by slave and master
        self.rotors = []  # (part, other keys of its table)
        self.forces = []  # (name of a node set, keys): on groups; those on nodes of their own are among the joints
        self.pressures = []  # (name of a surface, keys)
        self.masses = []  # (name of a node set, mass)
        self.bolts = []  # (name of a surface, keys)
        self.joints = Joints()
        self.steps = []  # (name, {key of a load: factor}, factor of friction, names of bolts)
        self.gravity = None
        self.band = 0.0  # [Hz] of the modes that the deck asks for
        self.notes = []  # what the deck has and the scene has not
        self.free_of_all = (-1, {})  # number of solids, and their free faces
        self.places = {}  # of the elements in the deck: texts, or blocks that find them

    def add_element(self, place, number, kind, nodes, code):
        if number in self.elements:
            before = self.places[number]
            before = before if isinstance(before, str) else before.place_of(number)
            raise Problem(f"{place}: element {number} is there twice, first in {before}; give it another number")
        if not 0 < number < 2**31:
            raise Problem(f"{place}: element {number}: expected a number from 1 to {2**31 - 1}")
        missing = [node for node in nodes if node not in self.nodes]
        if missing:
            raise Problem(f"{place}: element {number} has node {missing[0]}, which the deck does not define")
        self.places[number] = place
        self.elements[number] = (kind, tuple(nodes[i] for i in gmsh_order(kind, code)))

    def faces(self, number):
        """Faces of a solid element in Abaqus's order, each with the nodes in the middles of its edges and its own behind its
        corners; of a flat one itself."""
        kind, nodes = self.elements[number]
        if kind in FLAT:
            return [nodes]
        corners = KINDS[kind][1]
        mid = {frozenset(of): nodes[corners + i] for i, of in enumerate(MIDDLES["gmsh"].get(kind, []))}
        found = []
        for face in KINDS[kind][3]:
            sides = [frozenset((face[i], face[(i + 1) % len(face)])) for i in range(len(face))]
            found.append(tuple(nodes[i] for i in face) + tuple(mid[of] for of in (*sides, frozenset(face)) if of in mid))
        return found

    def solids(self):
        return [number for number, (kind, _) in self.elements.items() if kind in KINDS]

    def add_elements(self, block, kind, table, code):
        """Rows of a number and its nodes at once; False, and nothing is added, where one of them is wrong."""
        numbers = table[:, 0].tolist()
        labels = np.fromiter(self.nodes, np.int64, len(self.nodes))
        if not 0 < table[:, 0].min() <= table[:, 0].max() < 2**31 or len(set(numbers)) < len(numbers) or not self.elements.keys().isdisjoint(numbers):
            return False
        if not np.isin(table[:, 1:], labels).all():
            return False
        ordered = table[:, [1 + i for i in gmsh_order(kind, code)]]
        self.elements.update(zip(numbers, ((kind, tuple(nodes)) for nodes in ordered.tolist())))
        self.places.update(dict.fromkeys(numbers, block))
        return True

    def free_faces(self, numbers):
        """Faces that belong to one of these solid elements alone, by their corners. Those of all are found once."""
        count = len(self.solids())
        if len(numbers) < count:
            return self.faces_of_one(numbers)
        if self.free_of_all[0] != count:
            self.free_of_all = count, self.faces_of_one(numbers)
        return self.free_of_all[1]

    def faces_of_one(self, numbers):
        by_kind, owners, keys = {}, [], []
        for n in numbers:
            by_kind.setdefault(self.elements[n][0], []).append(n)
        for kind, of_kind in by_kind.items():
            faces = KINDS[kind][3]
            nodes = np.array([self.elements[n][1] for n in of_kind])
            for i, face in enumerate(faces):
                owners.append(np.stack([of_kind, np.full(len(of_kind), i)], axis=1))
                keys.append(sorted_corners(nodes[:, face]))
        if not keys:
            return {}
        owners, keys = np.concatenate(owners), np.concatenate(keys)
        order = np.lexsort(keys.T)
        differs = (keys[order][1:] != keys[order][:-1]).any(axis=1)
        first = np.concatenate([[True], differs])
        alone = order[first & np.concatenate([differs, [True]])]
        faces = [self.faces(number)[i] for number, i in owners[np.sort(alone)].tolist()]
        return {corners_of(face): face for face in faces}

    def join_nodes(self, same):
        """Nodes of elements and sets become others, which are at the same places."""
        for n, (kind, nodes) in self.elements.items():
            if not same.keys().isdisjoint(nodes):
                self.elements[n] = kind, tuple(same.get(node, node) for node in nodes)
        for name, nodes in self.node_sets.items():
            self.node_sets[name] = list(dict.fromkeys(same.get(node, node) for node in nodes))
        self.free_of_all = (-1, {})

    def press(self, pressed):
        """Faces by their pressures become surfaces."""
        for i, (value, faces) in enumerate(pressed.items(), 1):
            name = self.unused("pressed" if len(pressed) == 1 else f"pressed_{i}")
            self.surfaces[name] = faces
            self.pressures.append((name, {"value": value}))

    def normal_of(self, surface):
        """The mean normal of a surface's faces."""
        total = np.zeros(3)
        for face in self.surfaces[surface]:
            a, b, c = (np.asarray(self.nodes[n]) for n in face[:3])
            total += np.cross(b - a, c - a)
        return (total / (np.linalg.norm(total) or 1)).tolist()

    def drop_loose_nodes(self):
        """Nodes of sets that no element has, such as reference nodes."""
        used = {node for _, nodes in self.elements.values() for node in nodes}
        joined = set(self.joints.ends()) - used | self.joints.of_bolts
        for name, nodes in list(self.node_sets.items()):
            kept = [node for node in dict.fromkeys(nodes) if node in used]
            lost = len(set(nodes) - joined) - len(kept)
            self.node_sets[name] = kept
            if not kept and not lost:
                del self.node_sets[name]  # of reference points
            elif not kept:
                its = " and its support" if any(name == of for of, *_ in self.supports) else ""
                self.notes.append(f"the set {name}{its}, whose nodes no element has")
                del self.node_sets[name]
            elif lost:
                self.notes.append(f"{counted(lost, 'node')} of the set {name}, which no element has")
        self.supports = [support for support in self.supports if support[0] in self.node_sets]

    def drop_idle_supports(self):
        """squeal refuses a support that holds rotations of solids and nothing else."""
        turning = self.nodes_with_rotations()
        kept = []
        for name, motions, keys in self.supports:
            if {"x", "y", "z"} & set(motions) or not turning.isdisjoint(self.node_sets[name]):
                kept.append((name, motions, keys))
            else:
                self.notes.append(f"the support of {name} along {' '.join(motions)}: its nodes have no rotations")
        self.supports = kept

    def nodes_with_rotations(self):
        shells = [n for part in self.parts.values() for n in part.elements if self.elements[n][0] in FLAT]
        return {node for n in shells for node in self.elements[n][1]}

    def unused(self, name, others=()):
        """The name, or one like it that no group has, nor any of the others."""
        while name in others or any(name in of for of in (self.parts, self.surfaces, self.node_sets, self.element_sets)):
            name += "_"
        return name

    def separate_names(self):
        """squeal takes the nodes of all groups of a name. So parts keep their names, then surfaces, then sets of nodes;
        what has other nodes under the same name gets another one."""
        for name, faces in list(self.surfaces.items()):
            if name in self.parts:
                part = [face for n in self.parts[name].elements for face in self.faces(n)]
                shell = self.elements[self.parts[name].elements[0]][0] in FLAT
                if not shell or {corners_of(face) for face in part} != {corners_of(face) for face in faces}:
                    self.move(self.surfaces, name, "_faces", "a surface")
        for name, nodes in list(self.node_sets.items()):
            part = [self.elements[n][1] for n in self.parts[name].elements] if name in self.parts else None
            known = part or self.surfaces.get(name)
            if known and {node for of in known for node in of} == set(nodes):
                del self.node_sets[name]
            elif known:
                self.move(self.node_sets, name, "_nodes", "a set of nodes")
        for name in list(self.element_sets):
            if name in self.parts or name in self.surfaces or name in self.node_sets:
                self.move(self.element_sets, name, "_elements", "a set of elements")

    def move(self, groups, name, ending, what):
        """Under another name, which what names nodes or faces follows."""
        shown = self.unused(name + ending)
        self.notes.append(f"the name {name} of {what}, which another group has: it is {shown}")
        groups[shown] = groups.pop(name)
        if groups is self.node_sets:
            for rows in (self.supports, self.forces, self.masses):
                rows[:] = [(shown if row[0] == name else row[0], *row[1:]) for row in rows]
            self.joints.call_group(name, shown, faces=False)
        elif groups is self.surfaces:
            self.call_faces(name, shown)
            if name not in self.node_sets:
                self.joints.call_group(name, shown, faces=False)

    def call_faces(self, name, shown):
        for rows, ends in ((self.ties, 2), (self.contacts, 2), (self.pressures, 1), (self.bolts, 1)):
            rows[:] = [(*(shown if of == name else of for of in row[:ends]), *row[ends:]) for row in rows]
        self.joints.call_group(name, shown, faces=True)

    def name_faces_of_node_sets(self):
        """A set of nodes that covers free faces is a surface too, NAME_faces where it has other nodes besides: contacts
        and pressures need faces."""
        free = self.free_faces(self.solids())
        touching = {}
        for key, face in free.items():
            for node in face:
                touching.setdefault(node, []).append(key)
        for name, nodes in list(self.node_sets.items()):
            wanted = set(nodes)
            keys = {key for node in nodes for key in touching.get(node, []) if wanted.issuperset(free[key])}
            if keys:
                shown = name
                covered = {node for key in keys for node in free[key]}
                if covered == wanted:
                    del self.node_sets[name]  # the surface has the same nodes
                else:
                    shown = self.unused(name + "_faces")
                    self.call_faces(name, shown)
                    if shown in self.joints.rigid_groups():
                        self.notes.append(f"{counted(len(wanted - covered), 'node')} of {name} in its rigid coupling, which are on no face of it")
                self.surfaces[shown] = [free[key] for key in sorted(keys, key=sorted)]

    def drop_ties_without_faces(self):
        for tie in list(self.ties):
            bare = [name for name in tie if name not in self.surfaces]
            if bare:
                self.notes.append(f"the tie of {tie[0]} (slave) and {tie[1]} (master): {bare[0]} has no faces")
                self.ties.remove(tie)

    def solids_and_faces(self, numbers):
        """Numbers of the solids among elements, and nodes of the flat ones."""
        return ([n for n in numbers if self.elements[n][0] in KINDS],
                [self.elements[n][1] for n in numbers if self.elements[n][0] in FLAT])

    def add_parts_of_the_rest(self, name):
        """Solid elements without a part: a part a connected body."""
        taken = {number for part in self.parts.values() for number in part.elements}
        rest = [number for number in self.solids() if number not in taken]
        if rest:
            bodies = self.bodies(rest)
            for i, body in enumerate(bodies, 1):
                self.parts[self.unused(name if len(bodies) == 1 else f"{name}_{i}")] = Part(body)

    def bodies(self, numbers):
        from scipy.sparse import coo_matrix
        from scipy.sparse.csgraph import connected_components

        index = {node: i for i, node in enumerate(self.nodes)}
        pairs = [(index[self.elements[n][1][0]], index[node]) for n in numbers for node in self.elements[n][1]]
        a, b = np.array(pairs).T
        labels = connected_components(coo_matrix((np.ones(len(a)), (a, b)), (len(index),) * 2), directed=False)[1]
        found = {}
        for number in numbers:
            found.setdefault(labels[index[self.elements[number][1][0]]], []).append(number)
        return list(found.values())


def sorted_corners(corners):
    """Ascending, each once, behind -1 that fill up to four."""
    keys = np.full((len(corners), 4), -1)
    keys[:, 4 - corners.shape[1] :] = np.sort(corners, axis=1)
    keys[:, 1:][keys[:, 1:] == keys[:, :-1]] = -1
    return np.sort(keys, axis=1)


def corners_of(face):
    return frozenset(face[: {6: 3, 8: 4, 9: 4}.get(len(face), len(face))])


# ---- gmsh's format 4.1


def combinations(groups):
    """Items by the groups that they are in: {(names): [items]}, in the order of the items."""
    names = {}
    for name, items in groups.items():
        for item in items:
            names.setdefault(item, []).append(name)
    found = {}
    for item, of in names.items():
        found.setdefault(tuple(sorted(set(of))), []).append(item)
    return found


def blocks_to_write(model):
    """(dimension, names, type, list of node tuples) of every entity: what is in the same groups is one entity."""
    solid, flat = {}, {}
    for name, part in model.parts.items():
        is_solid = part.elements and model.elements[part.elements[0]][0] in KINDS
        (solid if is_solid else flat)[name] = part.elements
    for name, numbers in model.element_sets.items():
        solid.setdefault(name, numbers)
    faces = {name: [(corners_of(face), face) for face in found] for name, found in model.surfaces.items()}
    for name, numbers in flat.items():
        faces.setdefault(name, [])
        faces[name] = faces[name] + [(corners_of(f), f) for n in numbers for f in model.faces(n)]
    first = {}  # one face of those with the same corners
    for found in faces.values():
        for key, face in found:
            first.setdefault(key, face)
    blocks = [(0, names, 15, [(node,) for node in nodes]) for names, nodes in combinations(model.node_sets).items()]
    by_key = {name: [key for key, _ in found] for name, found in faces.items()}
    for names, keys in combinations(by_key).items():
        for kind in FLAT:
            of_kind = [first[key] for key in keys if FACE_OF_SIZE[len(first[key])] == kind]
            blocks += [(2, names, FLAT[kind][0], of_kind)] if of_kind else []
    for names, numbers in combinations(solid).items():
        for kind in KINDS:
            of_kind = [model.elements[n][1] for n in numbers if model.elements[n][0] == kind]
            blocks += [(3, names, KINDS[kind][0], of_kind)] if of_kind else []
    return blocks


def write_msh(model, file):
    blocks = blocks_to_write(model)
    names = sorted({(dimension, name) for dimension, of, *_ in blocks for name in of})
    tags = {key: i for i, key in enumerate(names, 1)}
    used = sorted({node for *_, cells in blocks for cell in cells for node in cell})
    points = np.array([model.nodes[node] for node in used])
    box = " ".join(f"{v:.17g}" for v in (*points.min(axis=0), *points.max(axis=0)))
    entities = {dimension: {} for dimension in range(4)}  # names: number
    for dimension, of, *_ in blocks:
        entities[dimension].setdefault(of, len(entities[dimension]) + 1)
    lines = ["$MeshFormat", "4.1 0 8", "$EndMeshFormat", "$PhysicalNames", str(len(names))]
    lines += [f'{dimension} {tags[dimension, name]} "{name}"' for dimension, name in names]
    lines += ["$EndPhysicalNames", "$Entities", " ".join(str(len(entities[d])) for d in range(4))]
    for d in (0, 2, 3):
        for of, i in entities[d].items():
            place = " ".join(box.split()[:3]) if d == 0 else box
            physical = " ".join(str(tags[d, name]) for name in of)
            lines.append(f"{i} {place} {len(of)} {physical}" + ("" if d == 0 else " 0"))
    top = max(dimension for dimension, *_ in blocks)
    lines += ["$EndEntities", "$Nodes", f"1 {len(used)} {used[0]} {used[-1]}", f"{top} 1 0 {len(used)}", *map(str, used)]
    lines += [f"{x:.17g} {y:.17g} {z:.17g}" for x, y, z in points]
    count = sum(len(cells) for *_, cells in blocks)
    lines += ["$EndNodes", "$Elements", f"{len(blocks)} {count} 1 {count}"]
    number = 0
    for dimension, of, kind, cells in blocks:
        lines.append(f"{dimension} {entities[dimension][of]} {kind} {len(cells)}")
        for cell in cells:
            number += 1
            lines.append(f"{number} " + " ".join(map(str, cell)))
    file.write_text("\n".join([*lines, "$EndElements", ""]))
