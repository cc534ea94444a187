"""Decks of Abaqus and CalculiX from scenes: what tools/mesh reads, written. Numbers are in SI."""

import tomllib

import numpy as np
from squeal.deck_files import Problem
from squeal.mesh_model import FLAT, KINDS, MOTIONS, Model, Part, corners_of, order_back
from squeal.msh_mesh import KIND_OF, read_mesh
from squeal.scene import with_numbers

TYPES = {"tet4": "C3D4", "tet10": "C3D10", "hex8": "C3D8", "hex20": "C3D20", "wedge6": "C3D6", "wedge15": "C3D15",
         "pyramid5": "C3D5", "hex27": "C3D27", "tri3": "S3", "quad4": "S4", "tri6": "STRI65", "quad8": "S8R", "quad9": "S9R5"}
AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
WRITTEN = set("title gravity numbers mesh part point rigid_body coupling spring connector beam mass support force pressure bolt rotor contact "
              "step tie friction damping modes".split())


def vector(given):
    """A direction: x, -y, or three numbers."""
    if isinstance(given, str):
        return [(-1.0 if given.startswith("-") else 1.0) * v for v in AXES[given.lstrip("-")]]
    return [float(v) for v in given]


def numbers(values):
    return ", ".join(repr(float(v)) for v in values)


def motions(word):
    """Numbers from 1 to 6 of motions."""
    words = MOTIONS if word == "all" else () if word == "none" else word.split()
    return [MOTIONS.index(m) + 1 for m in words]


class Writer:
    def __init__(self, file):
        self.file, self.notes = file, []
        with open(file, "rb") as stream:
            try:
                self.scene = with_numbers(tomllib.load(stream))
            except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
                raise Problem(f"{file}: {error}") from None
        if "mesh" not in self.scene:
            raise Problem(f"{file}: no [mesh]; expected a scene with one")
        self.lines, self.node_of, self.sets = [], {}, set()
        self.scale = self.scene["mesh"].get("scale", 1.0)

    def many(self, table):
        return self.scene.get(table, [])

    def write(self):
        mesh = self.mesh = read_mesh(self.file.parent / self.scene["mesh"]["file"], self.scene["mesh"].get("parameters", {}))
        self.fill_model()
        self.drive_contacts()
        self.next_node = max(mesh.nodes) + 1
        self.next_element = len(self.model.elements) + 1
        self.write_mesh()
        self.write_materials()
        self.write_bodies()
        self.write_springs()
        self.write_beams()
        self.write_supports()
        self.write_contacts()
        self.write_bolts()
        self.write_steps()
        self.notes += [f"[{name}]" for name in self.scene if name not in WRITTEN]
        return "\n".join([*self.lines, ""])

    def fill_model(self):
        """Elements with the groups of the scene's parts; every group as surfaces or sets of nodes."""
        self.model = model = Model(self.file)
        model.nodes = {n: np.array(at) * self.scale for n, at in self.mesh.nodes.items()}
        parts = {part["name"]: part for part in self.many("part")}
        label = 0
        for dimension, names, kind, cells in self.mesh.blocks:
            shape = KIND_OF.get(kind)
            for name in names:
                part = parts.get(name)
                if part is None or dimension != (2 if part.get("thickness", 0) > 0 else 3):
                    continue
                if shape not in TYPES:
                    raise Problem(f"{self.file}: part {name} has elements of gmsh's type {kind}, which have no keyword")
                model.parts.setdefault(name, Part([]))
                for nodes in cells.tolist():
                    label += 1
                    model.elements[label] = (shape, tuple(nodes))
                    model.parts[name].elements.append(label)
            if dimension == 2 and shape in FLAT:
                for name in names:
                    if name not in parts:
                        model.surfaces.setdefault(name, []).extend(map(tuple, cells.tolist()))
        missing = [name for name in parts if name not in model.parts]
        if missing:
            raise Problem(f"{self.file}: part {missing[0]} has no elements; the mesh has {', '.join(self.mesh.names())}")

    def drive_contacts(self):
        """A contact takes the drive of the [[rotor]] whose part has all nodes of its rotor's side."""
        for contact in self.many("contact"):
            side = {n for face in self.model.surfaces.get(contact["rotor"], ()) for n in face}
            for rotor in self.many("rotor") if side else ():
                if side <= {n for label in self.model.parts[rotor["part"]].elements for n in self.model.elements[label][1]}:
                    contact |= {"rotation": rotor} if "rate" in rotor else {"velocity": rotor["velocity"]}

    def add(self, keyword, *rows):
        self.lines += [f"*{keyword}", *rows]

    def listed(self, items):
        return [", ".join(map(str, items[i : i + 12])) + "," for i in range(0, len(items), 12)]

    def write_mesh(self):
        self.add("HEADING", str(self.scene.get("title", self.file.stem)).split("\n")[0])
        self.add("NODE", *(f"{n}, {numbers(at)}" for n, at in self.model.nodes.items()))
        for name, part in self.model.parts.items():
            kinds = dict.fromkeys(self.model.elements[n][0] for n in part.elements)
            for kind in kinds:
                back = order_back(kind)
                rows = []
                for n in part.elements:
                    if self.model.elements[n][0] == kind:
                        fields = [n, *(self.model.elements[n][1][i] for i in back)]
                        rows += [", ".join(map(str, fields[:14])) + ("," if fields[14:] else "")]
                        rows += [", ".join(map(str, fields[14:]))] if fields[14:] else []
                self.add(f"ELEMENT, TYPE={TYPES[kind]}, ELSET={name}", *rows)
        self.add("ELSET, ELSET=every_element", *self.model.parts)
        side_of = {}
        for n in self.model.elements:
            for i, face in enumerate(self.model.faces(n), 1):
                side_of.setdefault(corners_of(face), []).append((n, f"S{i}" if len(self.model.faces(n)) > 1 else "SPOS"))
        for name, faces in self.model.surfaces.items():
            sides = {}
            for face in faces:
                found = side_of.get(corners_of(face))
                if found:
                    sides.setdefault(found[0][1], []).append(found[0][0])
            for side, elements in sides.items():
                self.add(f"ELSET, ELSET={name}_{side}", *self.listed(elements))
            if sides:
                self.add(f"SURFACE, NAME={name}", *(f"{name}_{side}, {side}" for side in sides))

    def need_set(self, name):
        """A set of all nodes of a group, written where it is first named."""
        if name not in self.sets:
            nodes = self.mesh.nodes_of(name)
            if not nodes:
                raise Problem(f"{self.file}: no group {name}; the mesh has {', '.join(self.mesh.names())}")
            self.add(f"NSET, NSET={name}", *self.listed(nodes))
            self.sets.add(name)
        return name

    def write_materials(self):
        for name, part in ((part["name"], part) for part in self.many("part")):
            self.add(f"MATERIAL, NAME=of_{name}")
            law = part.get("orthotropic")
            orientation = ""
            if law:
                values = [*law["young"], *law["poisson"], *law["shear"]]
                self.add("ELASTIC, TYPE=ENGINEERING CONSTANTS", numbers(values[:8]) + ",", numbers(values[8:]))
            else:
                self.add("ELASTIC", numbers([part["young"], part["poisson"]]))
            self.add("DENSITY", numbers([part["density"]]))
            own = part if "alpha" in part or "beta" in part else self.scene.get("damping", {})
            words = [f"{word}={own[key]!r}" for key, word in (("alpha", "ALPHA"), ("beta", "BETA")) if own.get(key)]
            words += [f"STRUCTURAL={part['loss_factor']!r}"] if part.get("loss_factor") else []
            self.lines += ["*DAMPING, " + ", ".join(words)] if words else []
            if law:
                orientation = f", ORIENTATION=axes_{name}"
                if "cylinder" in law:
                    a = law["cylinder"].get("centre", [0, 0, 0])
                    b = [p + q for p, q in zip(a, vector(law["cylinder"]["axis"]))]
                    self.add(f"ORIENTATION, NAME=axes_{name}, SYSTEM=CYLINDRICAL", numbers([*a, *b]))
                else:
                    self.add(f"ORIENTATION, NAME=axes_{name}", numbers([*vector(law.get("axis_1", "x")), *vector(law.get("axis_2", "y"))]))
            if part.get("thickness", 0) > 0:
                offset = f", OFFSET={-part['offset'] / part['thickness']!r}" if part.get("offset") else ""
                self.add(f"SHELL SECTION, ELSET={name}, MATERIAL=of_{name}{offset}", numbers([part["thickness"]]))
            else:
                self.add(f"SOLID SECTION, ELSET={name}, MATERIAL=of_{name}{orientation}")
            self.notes += [f"rotation of part {name}"] if "rotation" in part else []
        self.notes += ["loss_frequency of [damping]"] * ("loss_frequency" in self.scene.get("damping", {}))
        self.notes += [f"{key} of [friction]" for key in ("direction_damping", "slipped_pairs_stick") if key in self.scene.get("friction", {})]

    def new_node(self, name, at):
        self.node_of[name] = self.next_node
        self.add(f"NODE, NSET={name}", f"{self.next_node}, {numbers(at)}")
        self.next_node += 1
        return self.node_of[name]

    def element(self, kind, elset, *nodes):
        self.add(f"ELEMENT, TYPE={kind}, ELSET={elset}", ", ".join(map(str, [self.next_element, *nodes])))
        self.next_element += 1

    def write_bodies(self):
        for table in ("rigid_body", "coupling", "point"):
            for entry in self.many(table):
                name = entry["name"]
                node = self.new_node(name, entry["at"])
                groups = entry.get("surfaces", entry.get("on", []))
                for i, group in enumerate([groups] if isinstance(groups, str) else groups):
                    title = name if i == 0 else f"{name}_{i + 1}"
                    self.write_coupling(table, entry, title, node, group)
                if entry.get("mass"):
                    self.element("MASS", f"mass_of_{name}", node)
                    self.add(f"MASS, ELSET=mass_of_{name}", numbers([entry["mass"]]))
                inertia = entry.get("inertia", [])
                if any(inertia):
                    self.element("ROTARYI", f"inertia_of_{name}", node)
                    self.add(f"ROTARY INERTIA, ELSET=inertia_of_{name}", numbers(inertia[:3]))
                    self.notes += [f"the products of inertia of {name}"] if any(inertia[3:]) else []
                held = [i for i in range(1, 7) if i not in motions(entry.get("free", "all"))]
                if held:
                    self.add("BOUNDARY", *(f"{node}, {i}, {i}" for i in held))
        for i, entry in enumerate(self.many("mass")):
            nodes = self.mesh.nodes_of(entry["on"])
            rows = [f"{self.next_element + k}, {node}" for k, node in enumerate(nodes)]
            self.next_element += len(nodes)
            self.add(f"ELEMENT, TYPE=MASS, ELSET=added_{i}", *rows)
            self.add(f"MASS, ELSET=added_{i}", numbers([entry["mass"] / max(len(nodes), 1)]))

    def write_coupling(self, table, entry, title, node, group):
        if group in self.model.surfaces:
            surface = group
        else:
            surface = f"{group}_nodes"
            if surface not in self.sets:
                self.sets.add(surface)
                self.add(f"SURFACE, NAME={surface}, TYPE=NODE", f"{self.need_set(group)},")
        self.add(f"COUPLING, CONSTRAINT NAME={title}, REF NODE={node}, SURFACE={surface}")
        if table == "rigid_body":
            follow = motions(entry.get("motions", "all"))
            self.add("KINEMATIC", *(f"{i}, {i}" for i in follow))
        else:
            self.add("DISTRIBUTING")
            self.notes += [f"the weights of coupling {entry['name']}"] if len(set(entry.get("weights", []))) > 1 else []

    def write_springs(self):
        for i, spring in enumerate(self.many("spring")):
            self.write_spring(f"spring_{i}", spring)
        for i, connector in enumerate(self.many("connector")):
            self.write_connector(f"connector_{i}", connector)

    def write_spring(self, name, spring):
        ends = [spring["from"]] + ([spring["to"]] if spring.get("to", "ground") != "ground" else [])
        direction = vector(spring["direction"])
        along = [i for i in range(3) if abs(direction[i]) > 1e-12 * np.linalg.norm(direction)]
        nodes = [self.node_of.get(end) for end in ends]
        if None in nodes:
            group = ends[nodes.index(None)]
            of_group = self.mesh.nodes_of(group)
            nodes[nodes.index(None)] = of_group[0] if len(of_group) == 1 else None
        if None in nodes or (len(along) > 1 and not self.is_along(nodes, direction)):
            self.notes.append(f"spring {name.split('_')[1]} from {spring['from']}: SPRING elements join two nodes, along x, y, z or their line")
            return
        for key, kind in (("stiffness", "SPRING"), ("damping", "DASHPOT")):
            if spring.get(key):
                of = f"{name}_{key}"
                motion = [along[0] + 1] * len(nodes)
                kind_of = f"{kind}A" if len(along) > 1 else f"{kind}{len(nodes)}"
                self.element(kind_of, of, *nodes)
                self.add(f"{kind}, ELSET={of}", "" if len(along) > 1 else ", ".join(map(str, motion)), numbers([spring[key]]))

    def is_along(self, nodes, direction):
        if len(nodes) < 2:
            return False
        line = self.position(nodes[1]) - self.position(nodes[0])
        return np.linalg.norm(np.cross(line, direction)) < 1e-9 * np.linalg.norm(line) * np.linalg.norm(direction)

    def position(self, node):
        if node in self.model.nodes:
            return self.model.nodes[node]
        name = next(name for name, n in self.node_of.items() if n == node)
        entries = [e for table in ("rigid_body", "coupling", "point") for e in self.many(table) if e["name"] == name]
        return np.array(entries[0]["at"], float)

    def write_connector(self, name, connector):
        """Between nodes in one place along x, y and z: springs and equations. Others have no keyword of both codes."""
        ends = [connector["from"]] + ([connector["to"]] if connector.get("to", "ground") != "ground" else [])
        nodes = [self.node_of[end] for end in ends]
        apart = len(nodes) > 1 and np.linalg.norm(self.position(nodes[0]) - self.position(nodes[1])) > 0
        away = "at" in connector and np.linalg.norm(np.array(connector["at"]) - self.position(nodes[0])) > 0
        turned = vector(connector.get("axis_1", "x")) != [1, 0, 0] or vector(connector.get("axis_2", "y")) != [0, 1, 0]
        full = any(len(connector.get(key, [])) == 36 for key in ("stiffness", "damping"))
        if connector.get("locked") == "all" and len(nodes) > 1 and apart:
            self.add("MPC", f"BEAM, {nodes[0]}, {nodes[1]}")
        elif apart or away or turned or full or connector.get("loss_factor"):
            self.notes.append(f"connector from {connector['from']}: springs join nodes in one place, along x, y and z")
            return
        else:
            for motion in motions(connector.get("locked", "none")):
                if len(nodes) > 1:
                    self.add("EQUATION", "2", f"{nodes[0]}, {motion}, 1., {nodes[1]}, {motion}, -1.")
                else:
                    self.add("BOUNDARY", f"{nodes[0]}, {motion}, {motion}")
        for key, kind in (("stiffness", "SPRING"), ("damping", "DASHPOT")):
            for i, value in enumerate(connector.get(key, [])):
                if value:
                    of = f"{name}_{key}_{i + 1}"
                    self.element(f"{kind}{len(nodes)}", of, *nodes)
                    self.add(f"{kind}, ELSET={of}", ", ".join([str(i + 1)] * len(nodes)), numbers([value]))

    def write_beams(self):
        self.beam_element = {}
        for beam in self.many("beam"):
            if "diameter" not in beam:
                self.notes.append(f"beam {beam['name']}: its section has no keyword but by its numbers")
                continue
            count = beam.get("elements", 8)
            a, b = self.node_of[beam["from"]], self.node_of[beam["to"]]
            start, end = self.position(a), self.position(b)
            inner = [self.new_node(f"{beam['name']}_{i}", start + (end - start) * i / count) for i in range(1, count)]
            self.add(f"MATERIAL, NAME=of_{beam['name']}")
            self.add("ELASTIC", numbers([beam["young"], beam.get("poisson", 0)]))
            self.lines += ["*DENSITY", numbers([beam["density"]])] if beam.get("density") else []
            chain = [a, *inner, b]
            self.beam_element[beam["name"]] = self.next_element
            for first, second in zip(chain, chain[1:]):
                self.element("B31", beam["name"], first, second)
            self.add(f"BEAM SECTION, ELSET={beam['name']}, SECTION=CIRC, MATERIAL=of_{beam['name']}", numbers([beam["diameter"] / 2]))

    def write_supports(self):
        for i, support in enumerate(self.many("support")):
            name = support["on"]
            target = str(self.node_of[name]) if name in self.node_of else self.need_set(name)
            if "cylinder" in support:
                a = support["cylinder"].get("centre", [0, 0, 0])
                b = [p + q for p, q in zip(a, vector(support["cylinder"]["axis"]))]
                self.add(f"TRANSFORM, NSET={target}, TYPE=C", numbers([*a, *b]))
            elif "axis_1" in support or "axis_2" in support:
                self.add(f"TRANSFORM, NSET={target}, TYPE=R", numbers([*vector(support.get("axis_1", "x")), *vector(support.get("axis_2", "y"))]))
            moved = [*support.get("displacement", [0, 0, 0]), *support.get("rotation", [0, 0, 0])]
            self.add("BOUNDARY", *(f"{target}, {m}, {m}" + (f", {float(moved[m - 1])!r}" if moved[m - 1] else "")
                                   for m in motions(support["fixed"])))

    def law(self, contact):
        return contact if "friction" in contact else {**self.scene.get("friction", {}), "friction": self.scene.get("friction", {}).get("coefficient", 0.0)}

    def friction_rows(self, contact, factor):
        """The keyword and its lines for a law, all of it by a factor."""
        law = self.law(contact)
        mu = law["friction"] * factor
        if law.get("decay_speed") and "static_coefficient" in law:
            return "FRICTION, EXPONENTIAL DECAY", [numbers([law["static_coefficient"] * factor, mu, 1 / law["decay_speed"]])]
        if "factor_at_speed" in law:
            return "FRICTION", [numbers([mu * share, speed]) for speed, share in law["factor_at_speed"]]
        return "FRICTION", [numbers([mu] + ([1 / contact["slip_compliance"]] if contact.get("slip_compliance") else []))]

    def write_contacts(self):
        for tie in self.many("tie"):
            self.add(f"TIE, NAME={tie['slave']}_on_{tie['master']}", f"{tie['slave']}, {tie['master']}")
        first = (self.many("step") or [{}])[0].get("friction", 1.0)
        for i, contact in enumerate(self.many("contact")):
            if contact["rotor"] not in self.model.surfaces or contact["stator"] not in self.model.surfaces:
                self.notes.append(f"contact {i} of {contact['rotor']} and {contact['stator']}, which are no surfaces")
                continue
            driven = "rotation" in contact or any(contact.get("velocity", ()))
            self.add(f"SURFACE INTERACTION, NAME=contact_{i}")
            if contact.get("compliance"):
                self.add("SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", numbers([1 / contact["compliance"]]))
            keyword, rows = self.friction_rows(contact, first if driven else 1.0)
            self.add(keyword, *rows)
            sides = [contact["stator"], contact["rotor"]]
            sides = sides[::-1] if contact.get("slave") == "rotor" else sides
            self.add(f"CONTACT PAIR, INTERACTION=contact_{i}, TYPE=SURFACE TO SURFACE", ", ".join(sides))
            if contact.get("gap"):
                self.add(f"CLEARANCE, SLAVE={sides[0]}, MASTER={sides[1]}, VALUE={float(contact['gap'])!r}")
            self.need_set(contact["rotor"])
            self.notes += [f"{key} of contact {i}" for key in ("gap_file", "reach", "normal", "tangents") if key in contact]

    def write_bolts(self):
        self.bolt_node = {}
        for bolt in self.many("bolt"):
            node = self.new_node(bolt["name"], [0, 0, 0])
            self.bolt_node[bolt["name"]] = node
            if "beam" in bolt and bolt["beam"] in self.beam_element:
                self.add(f"PRE-TENSION SECTION, ELEMENT={self.beam_element[bolt['beam']]}, NODE={node}")
            elif "section" in bolt:
                self.add(f"PRE-TENSION SECTION, SURFACE={bolt['section']}, NODE={node}", numbers(vector(bolt["axis"])))
            else:
                self.notes.append(f"bolt {bolt['name']}, whose beam is left out")

    def write_steps(self):
        for force in self.many("force"):
            if force["on"] not in self.node_of:
                self.need_set(force["on"])
        steps = self.many("step") or [{"name": "load"}]
        bolts = {bolt["name"]: bolt for bolt in self.many("bolt")}
        named = any(step.get("bolts") for step in steps)
        if bolts and not named:
            steps = [{"name": "tighten", "load": 0.0, "friction": steps[0].get("friction", 1.0), "bolts": list(bolts)}, *steps]
        for i, step in enumerate(steps):
            self.add(f"STEP, NAME={step['name'].replace(',', '')}, NLGEOM=NO, UNSYMM=YES")
            self.add("STATIC")
            tightened = step.get("bolts", [])
            for name in [tightened] if isinstance(tightened, str) else tightened:
                self.add("CLOAD", f"{self.bolt_node[name]}, 1, {float(bolts[name]['tension'])!r}")
            self.write_loads(step)
            friction = step.get("friction", 1.0)
            for k, contact in enumerate(self.many("contact")):
                driven = "rotation" in contact or any(contact.get("velocity", ()))
                if i and driven and friction != steps[i - 1].get("friction", 1.0):
                    keyword, rows = self.friction_rows(contact, friction)
                    self.add(f"CHANGE FRICTION, INTERACTION=contact_{k}")
                    self.add(keyword, *rows)
            if i == len(steps) - 1:
                self.write_motions()
            self.add("END STEP")
        band = self.scene.get("modes", {}).get("band", 20000)
        for name in ("FREQUENCY", "COMPLEX FREQUENCY"):
            self.add(f"STEP, NAME={name.replace(' ', '_')}, UNSYMM=YES")
            self.add(name, f"1000, , {float(band)!r}")
            self.add("END STEP")

    def write_loads(self, step):
        if self.scene.get("gravity"):
            size = float(np.linalg.norm(self.scene["gravity"]))
            if size:
                self.add("DLOAD", f"every_element, GRAV, {size!r}, {numbers(np.array(self.scene['gravity']) / size)}")
        forces, pressures, load = step.get("forces", []), step.get("pressures", []), step.get("load", 1.0)
        for i, force in enumerate(self.many("force")):
            factor = load * (forces[i] if i < len(forces) else 1.0)
            target, count = (str(self.node_of[force["on"]]), 1) if force["on"] in self.node_of else (
                force["on"], len(self.mesh.nodes_of(force["on"])))
            values = [*force.get("vector", [0, 0, 0]), *force.get("moment", [0, 0, 0])]
            rows = [f"{target}, {m}, {factor * v / count!r}" for m, v in enumerate(values, 1) if v]
            self.add("CLOAD", *rows)
        for i, pressure in enumerate(self.many("pressure")):
            factor = load * (pressures[i] if i < len(pressures) else 1.0)
            self.add("DSLOAD", f"{pressure['on']}, P, {factor * pressure['value']!r}")

    def write_motions(self):
        for contact in self.many("contact"):
            if contact["rotor"] not in self.model.surfaces:
                continue
            target = contact["rotor"]
            if "rotation" in contact:
                turn = contact["rotation"]
                a = [float(v) for v in turn.get("centre", [0, 0, 0])]
                axis = np.array(vector(turn["axis"]))
                self.add("MOTION, ROTATION, TYPE=VELOCITY", f"{target}, {numbers([turn['rate'], *a, *(a + axis)])}")
            elif any(contact.get("velocity", ())):
                rows = [f"{target}, {m}, {float(v)!r}" for m, v in enumerate(contact["velocity"], 1) if v]
                self.add("MOTION, TRANSLATION, TYPE=VELOCITY", *rows)


def write_deck(scene, target):
    """Writes the deck; returns what it has not."""
    writer = Writer(scene)
    try:
        text = writer.write()
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise Problem(f"{scene}: {type(error).__name__} {error}: expected a scene that squeal reads; see what squeal --dry-run says") from None
    target.write_text(text)
    return writer.notes
