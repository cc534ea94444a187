"""What decks say by nodes of their own: rigid and mean couplings, springs, bushings, beams, masses and loads at reference
nodes, made into the tables of a scene. A reference node becomes a rigid body, a coupling or a point."""

import numpy as np

MOTIONS = ("x", "y", "z", "rx", "ry", "rz")


def tube(outer, inner):
    """Keys of a [[beam]] between two radii."""
    outer, inner = np.float64(outer), np.float64(inner)  # which overflow to what squeal refuses
    bending = np.pi / 4 * (outer**4 - inner**4)
    return {"area": np.pi * (outer**2 - inner**2), "bending": [bending], "torsion": 2 * bending, "shear_factor": 0.5}


def rectangle(width, height):
    """Keys of a [[beam]]; the torsion constant is Roark's approximation."""
    width, height = np.float64(width), np.float64(height)
    long, short = max(width, height), min(width, height)
    torsion = long * short**3 * (1 / 3 - 0.21 * short / long * (1 - short**4 / (12 * long**4)))
    return {"area": width * height, "bending": [width * height**3 / 12, height * width**3 / 12], "torsion": torsion, "shear_factor": 5 / 6}


class Joints:
    """By numbers of nodes, in units of the deck. None for a node is the ground."""

    def __init__(self):
        self.rigid = []  # (node, name of a group, motions that follow, where)
        self.mean = []  # (node, name of a group, weight, where)
        self.springs = []  # (node, node, direction or None for the line between, {"stiffness": , "damping": }, where)
        self.connectors = []  # (node, node, keys, where)
        self.beams = []  # (name, node, node, keys, where)
        self.bolts = []  # (name of a beam, keys)
        self.mass, self.inertia = {}, {}  # by node
        self.held, self.moved = {}, {}  # motions, and their displacements by motion, by node
        self.forces = {}  # six components by node
        self.names = {}  # that the deck gives to nodes
        self.of_bolts = set()  # nodes that stand for a tension

    def call_group(self, name, shown, faces):
        """A group has another name; faces that a set of nodes covers do for rigid couplings alone."""
        for rows in (self.rigid,) if faces else (self.rigid, self.mean):
            rows[:] = [(row[0], shown if row[1] == name else row[1], *row[2:]) for row in rows]

    def rigid_groups(self):
        return {group for _, group, *_ in self.rigid}

    def groups(self):
        return self.rigid_groups() | {group for _, group, *_ in self.mean}

    def ends(self):
        """All nodes that something is joined to, in the order of the deck."""
        found = [row[0] for row in (*self.rigid, *self.mean)]
        found += [node for row in (*self.springs, *self.connectors) for node in row[:2]]
        found += [node for row in self.beams for node in row[1:3]]
        found += [*self.mass, *self.inertia, *self.forces]
        return [node for node in dict.fromkeys(found) if node is not None]


class Tables:
    """Tables of a scene from the joints of a model, in units of the deck."""

    def __init__(self, model):
        self.model, self.joints, self.tables = model, model.joints, []
        self.used = {node for _, nodes in model.elements.values() for node in nodes}
        self.names, self.kinds = {}, {}  # of what a node became

    def make(self):
        self.drop_wrong_followers()
        self.gather_forces()
        self.gather_supports()
        for node in self.joints.ends():
            if node in self.model.nodes:
                self.make_node(node)
        for a, b, direction, keys, where in self.joints.springs:
            self.make_spring(a, b, direction, keys, where)
        for a, b, keys, where in self.joints.connectors:
            self.make_connector(a, b, keys, where)
        for name, a, b, keys, where in self.joints.beams:
            if self.are_bodies((a, b), f"the beam {name}", where):
                self.add("beam", name=name, **{"from": self.names[a], "to": self.names[b]}, **keys)
        beams = {keys["name"] for table, keys in self.tables if table == "beam"}
        for beam, keys in self.joints.bolts:
            if beam in beams:
                self.add("bolt", beam=beam, **keys)
        for node, force in self.joints.forces.items():
            self.make_force(node, force)
        return self.tables

    def add(self, table, **keys):
        self.tables.append((table, keys))

    def note(self, what):
        self.model.notes.append(what)

    def group_of(self, nodes, name):
        """The name of the set that has just these nodes, or of a new one."""
        known = {frozenset(of): shown for shown, of in self.model.node_sets.items()}
        known |= {frozenset(n for face in faces for n in face): shown for shown, faces in self.model.surfaces.items()}
        shown = known.get(frozenset(nodes)) or self.model.unused(name)
        if shown not in self.model.surfaces:
            self.model.node_sets[shown] = nodes
        return shown

    def gather_forces(self):
        """Nodes of elements with one force, which all steps scale alike, are a group with the sum of theirs."""
        model, forces, alike = self.model, self.joints.forces, {}
        for node in [node for node in forces if node in self.used and not any(forces[node][3:])]:
            factors = tuple(of.get(("force", node), 1.0) for _, of, *_ in model.steps)
            alike.setdefault((tuple(forces[node][:3]), factors), []).append(node)
        for (vector, _), nodes in alike.items():
            if len(nodes) < 2:
                continue
            for _, of, *_ in model.steps:
                of["group", len(model.forces)] = of.get(("force", nodes[0]), 1.0)
            model.forces.append((self.group_of(nodes, f"loaded_{len(model.forces) + 1}"), {"vector": [len(nodes) * v for v in vector]}))
            for node in nodes:
                del forces[node]

    def gather_supports(self):
        """Nodes of a line each that are held alike are a group."""
        model, alike = self.model, {}
        for name, motions, keys in model.supports:
            nodes = model.node_sets.get(name, ())
            if len(nodes) == 1 and name == f"node_{nodes[0]}":
                alike.setdefault((tuple(motions), repr(keys)), []).append((name, motions, keys))
        for i, rows in enumerate((rows for rows in alike.values() if len(rows) > 1), 1):
            nodes = [model.node_sets.pop(name)[0] for name, *_ in rows]
            model.supports = [row for row in model.supports if row not in rows]
            model.supports.append((self.group_of(nodes, f"held_{i}"), *rows[0][1:]))

    def drop_wrong_followers(self):
        joints, model = self.joints, self.model
        for rows, what in ((joints.rigid, "rigid coupling"), (joints.mean, "mean coupling")):
            for row in list(rows):
                node, group, _, where = row
                faces = group in model.surfaces
                if node in self.used:
                    self.note(f"the {what} of {group} to node {node} ({where}): the node belongs to elements; a scene's "
                              "reference points are nodes of their own")
                elif node not in model.nodes:
                    self.note(f"the {what} of {group} to node {node} ({where}), which the deck does not define")
                elif not faces and (what == "rigid coupling" or group not in model.node_sets):
                    self.note(f"the {what} of {group} to node {node} ({where}): its nodes cover no face of an element")
                else:
                    continue
                rows.remove(row)

    def make_node(self, node):
        joints, at = self.joints, [float(v) for v in self.model.nodes[node]]
        rigid = [row for row in joints.rigid if row[0] == node]
        mean = [row for row in joints.mean if row[0] == node]
        held = joints.held.get(node, set()) - joints.moved.get(node, {}).keys()  # which make_moved holds
        free = " ".join(m for m in MOTIONS if m not in held) or "none"
        free = "all" if not held else free
        mass = {"mass": joints.mass[node]} if joints.mass.get(node) else {}
        inertia = {"inertia": joints.inertia[node]} if any(joints.inertia.get(node, ())) else {}
        if node in self.used:
            return self.make_mesh_node(node)
        name = self.names[node] = self.model.unused(joints.names.get(node, f"node_{node}"), self.names.values())
        if rigid:
            if mean:
                self.note(f"the mean coupling of {mean[0][1]} to node {node} ({mean[0][3]}), which carries a rigid one")
            motions = {row[2] for row in rigid}
            for row in rigid[1:] if len(motions) > 1 else ():
                self.note(f"the rigid coupling of {row[1]} to node {node} ({row[3]}) by other motions than the first")
            groups = list(dict.fromkeys(row[1] for row in rigid if row[2] == rigid[0][2]))
            follows = {} if rigid[0][2] == " ".join(MOTIONS) else {"motions": rigid[0][2]}
            self.kinds[node] = "rigid_body"
            self.add("rigid_body", name=name, surfaces=groups, at=at, **mass, **inertia, free=free, **follows)
        elif mean:
            weights = [row[2] for row in mean]
            self.kinds[node] = "coupling"
            self.add("coupling", name=name, on=[row[1] for row in mean], at=at,
                     **({"weights": weights} if len(set(weights)) > 1 else {}), **mass, **inertia)
            if held:
                self.add("support", on=name, fixed=" ".join(m for m in MOTIONS if m in held))
        else:
            self.kinds[node] = "point"
            turns = inertia or any(node in row[:2] for row in joints.connectors) or any(node in row[1:3] for row in joints.beams)
            if inertia:
                self.note(f"the inertia at node {node}, which joins no surface: a [[point]] has a mass alone")
            free = " ".join(m for m in (MOTIONS if turns else MOTIONS[:3]) if m not in held) or "none"
            self.add("point", name=name, at=at, **mass, free=free)
        self.make_moved(node, name)

    def make_moved(self, node, name):
        moved = self.joints.moved.get(node, {})
        if moved:
            self.add("support", on=name, fixed=" ".join(m for m in MOTIONS if m in moved),
                     displacement=[moved.get(m, 0.0) for m in MOTIONS[:3]], rotation=[moved.get(m, 0.0) for m in MOTIONS[3:]])

    def make_mesh_node(self, node):
        """A node of elements is a group of its own."""
        name = self.names[node] = self.model.unused(f"node_{node}", self.names.values())
        self.kinds[node] = "group"
        self.model.node_sets[name] = [node]
        if self.joints.mass.get(node):
            self.add("mass", on=name, mass=self.joints.mass[node])
        if any(self.joints.inertia.get(node, ())):
            self.note(f"the inertia at node {node} of elements: it has a mass alone")

    def are_known(self, ends, what, where):
        for node in ends:
            if node is not None and node not in self.names:
                self.note(f"{what} ({where}): node {node} is not defined")
                return False
        return True

    def are_bodies(self, ends, what, where):
        """Connectors and beams join points and bodies; nodes of solids have no rotations."""
        if not self.are_known(ends, what, where):
            return False
        for node in ends:
            if node is not None and self.kinds[node] == "group":
                self.note(f"{what} ({where}): node {node} belongs to elements; a scene joins points, rigid bodies and "
                          "couplings by it")
                return False
        return True

    def make_spring(self, a, b, direction, keys, where):
        ends = [node for node in (a, b) if node is not None]
        if not any(keys.values()):
            self.note(f"the spring at node {a} ({where}), of stiffness and damping 0")
            return
        if not self.are_known(ends, "the spring", where):
            return
        if sum(self.kinds[node] == "group" for node in ends) > 1:
            self.note(f"the spring between the nodes {a} and {b} ({where}): both belong to elements; one end of a [[spring]] "
                      "at most is a group")
            return
        if direction is None and len(ends) == 2:
            direction = [float(v) for v in self.model.nodes[b] - self.model.nodes[a]]
        if direction is None or not any(direction):
            self.note(f"the spring at node {a} ({where}): its ends are at the same place, which gives it no direction")
            return
        first, *rest = sorted(ends, key=lambda node: self.kinds[node] != "group")
        line = {"from": self.names[first], **({"to": self.names[rest[0]]} if rest else {}), "direction": direction}
        for table, known in self.tables:  # a spring and a dashpot side by side are one
            if table == "spring" and line.items() <= known.items() and known.keys().isdisjoint(keys):
                known.update(keys)
                return
        self.add("spring", **line, **keys)

    def make_connector(self, a, b, keys, where):
        ends = [node for node in (a, b) if node is not None]
        if not self.are_bodies(ends, "the bushing", where):
            return
        self.add("connector", **{"from": self.names[ends[0]]}, **({"to": self.names[ends[1]]} if len(ends) > 1 else {}), **keys)

    def make_force(self, node, force):
        if not self.are_known([node], "the force", f"on node {node}"):
            return
        vector, moment = list(force[:3]), list(force[3:])
        if any(moment) and self.kinds[node] in ("group", "point") and "r" not in self.free_of(node):
            self.note(f"the moment on node {node}, which has no rotations")
            moment = [0, 0, 0]
        if any(vector) or any(moment):
            self.add("force", on=self.names[node], **({"vector": vector} if any(vector) else {}),
                     **({"moment": moment} if any(moment) else {}))

    def free_of(self, node):
        return next((keys["free"] for table, keys in self.tables if keys.get("name") == self.names[node]), "")
