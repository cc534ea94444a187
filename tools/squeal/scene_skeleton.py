"""The scene of a mesh_model.Model. What a scene needs and the deck does not say is a key with the text FILL IN, which squeal
refuses at its line."""

import re

from squeal.deck_joints import MOTIONS, Tables
from squeal.mesh_model import KINDS

# (power of the length unit, power of the force unit) of keys that have units; the time is in s
UNITS = {"at": (1, 0), "mass": (-1, 1), "inertia": (1, 1), "stiffness": (-1, 1), "damping": (-1, 1), "vector": (0, 1),
         "moment": (1, 1), "value": (-2, 1), "tension": (0, 1), "velocity": (1, 0), "centre": (1, 0), "compliance": (3, -1),
         "slip_compliance": (3, -1), "young": (-2, 1), "shear": (-2, 1), "density": (-4, 1), "area": (2, 0), "bending": (4, 0),
         "torsion": (4, 0), "diameter": (1, 0), "thickness": (1, 0), "offset": (1, 0), "displacement": (1, 0), "decay_speed": (1, 0),
         "reach": (1, 0), "gap": (1, 0), "gravity": (1, 0)}
SINGLE = ("friction", "modes", "damping", "estimate", "mesh")  # tables that there is one of
ALIKE = 5  # notes that differ by numbers alone, of which all are shown
BAND = 20000  # [Hz] of a scene that gives none
TURNING = ("stiffness", "damping")  # whose last three of six have the length twice more


def text(value):
    return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'


class Writer:
    """Tables as lines, with their units."""

    def __init__(self, length, force):
        self.length, self.force, self.lines = length, force, []

    def value(self, key, given):
        if isinstance(given, bool):
            return str(given).lower()
        if isinstance(given, str):
            return text(given)
        if isinstance(given, dict):
            return "{ " + ", ".join(f"{name} = {self.value(name, of)}" for name, of in given.items()) + " }"
        powers = UNITS.get(key, (0, 0))
        factor = self.length ** powers[0] * self.force ** powers[1]
        if key == "factor_at_speed":
            return "[" + ", ".join(f"[{speed * self.length:.14g}, {of:.14g}]" for speed, of in given) + "]"
        if isinstance(given, (list, tuple)):
            if given and isinstance(given[0], str):
                return text(given[0]) if len(given) == 1 else "[" + ", ".join(map(text, given)) + "]"
            factors = [factor * (self.length**2 if key in TURNING and len(given) == 6 and i > 2 else 1) for i in range(len(given))]
            return "[" + ", ".join(f"{v * f:.14g}" for v, f in zip(given, factors)) + "]"
        return f"{given * factor:.14g}"

    def table(self, name, keys):
        self.lines += ["", f"[{name}]" if name in SINGLE else f"[[{name}]]"]
        self.lines += [f"{key} = {self.value(key, given)}" for key, given in keys.items()]


def skeleton(model, mesh, length, force):
    tables = Tables(model)
    made = tables.make()  # which may add notes and groups
    writer = Writer(length, force)
    writer.lines = [f"title = {text(model.source.stem)}"]
    if model.gravity is not None:
        writer.lines.append(f"gravity = {writer.value('gravity', model.gravity)}")
    writer.lines += ["", "[mesh]", f"file = {text(mesh)}"]
    writer.lines += [f"scale = {length!r}"] if length != 1 else []
    writer.lines += ["", *(f"# Not taken over: {note}" for note in condensed(model.notes))] if model.notes else []
    groups = [*model.surfaces, *model.node_sets]
    writer.lines += ["", "# Groups of the mesh: " + (", ".join(groups) or "none beside the parts")]
    for name, part in model.parts.items():
        writer.table("part", {"name": name, **material(model, part)})
    for table, keys in made:
        if table not in ("force", "bolt"):
            writer.table(table, keys)
    write_groups(model, writer)
    write_loads(model, made, tables.names, writer)
    for slave, master in model.ties:
        writer.table("tie", {"slave": slave, "master": master})
    write_rotors(model, writer)
    for slave, master, keys in model.contacts:
        rotor = {"rotor": slave, "stator": master, "slave": "rotor"} if keys.get("slave") == "rotor" else {
            "rotor": master, "stator": slave}
        writer.table("contact", {**rotor, **{key: of for key, of in keys.items() if key != "slave"}})
    if not model.contacts and not model.ties:
        writer.lines += ["", "# The deck has no contact: without one nothing rubs."]
    if any(line.startswith("loss_factor = ") for line in writer.lines):
        write_loss(model, writer)
    if model.band:
        writer.table("modes", {"band": model.band})
    gaps = any("FILL IN [" in line for line in writer.lines)
    head = f"# Made of {model.source.name}." + (" squeal refuses lines with FILL IN: the deck does not say what they need." if gaps else "")
    return "\n".join([head, *writer.lines, ""])


def condensed(notes):
    """Of notes that differ by numbers alone the first ones, and how many there are."""
    alike = {}
    for note in notes:
        alike.setdefault(re.sub(r"\d+", "#", note), []).append(note)
    shown = []
    for found in alike.values():
        few = found if len(found) <= ALIKE else found[: ALIKE - 1]
        shown += few + ([f"{len(found) - len(few)} others like the last one"] if len(few) < len(found) else [])
    return shown


def is_driven(keys):
    return "rotation" in keys or "velocity" in keys


def write_rotors(model, writer):
    """Those of the deck. Where contacts rub and nothing moves, the part that has most of their masters' sides, and not their slaves',
    is one whose drive is a gap; where no part is, they are gaps themselves."""
    names = {id(part): name for name, part in model.parts.items()}
    for part, keys in model.rotors:
        writer.table("rotor", {"part": names[id(part)], **keys})
    rubbing = [(slave, master) for slave, master, keys in model.contacts if keys.get("friction", 1)]
    if not rubbing or model.rotors or any(is_driven(keys) for *_, keys in model.contacts):
        return
    nodes = {name: {n for label in part.elements for n in model.elements[label][1]} for name, part in model.parts.items()}
    side = lambda name: {n for face in model.surfaces.get(name, ()) for n in face}
    count = {name: sum(bool(side(master)) and side(master) <= own and not side(slave) <= own for slave, master in rubbing)
             for name, own in nodes.items()}
    part = max(count, key=count.get)
    if count[part]:
        writer.lines += ["", "# The deck moves nothing. Take this table out where contacts stick or slip by themselves."]
        writer.table("rotor", {"part": part, "velocity": "FILL IN [m/s]: such as [1, 0, 0]; or in its place axis = 'z' and rate = 10 [rad/s]"})
        return
    for *_, keys in model.contacts:
        if keys.get("friction", 1):
            keys["velocity"] = "FILL IN [m/s]: such as [1, 0, 0]; or take this key out where the contact sticks or slips by itself"


def write_loss(model, writer):
    """Modes have their loss factors at any frequency. The estimate is off, for which the middle of the band would be a guess."""
    writer.table("damping", {"loss_frequency": model.loss_frequency or (model.band or BAND) / 2})
    if not model.loss_frequency:
        writer.lines[-1] += "  # the middle of the band: modes need none; give the squeal's before a cycle, a transient or the estimate is asked for"
        writer.table("estimate", {"enabled": False})


def write_groups(model, writer):
    for name, motions, keys in model.supports:
        fixed = "all" if len(motions) == len(MOTIONS) else " ".join(motions)
        writer.table("support", {"on": name, "fixed": fixed, **keys})
    for name, mass in model.masses:
        writer.table("mass", {"on": name, "mass": mass})


def write_loads(model, made, names, writer):
    """Forces, pressures and bolts, and the steps, whose factors are in the order of the loads."""
    node_of = {name: node for node, name in names.items()}
    forces = [(("force", node_of[keys["on"]]), keys) for table, keys in made if table == "force"]
    forces += [(("group", i), {"on": name, **keys}) for i, (name, keys) in enumerate(model.forces)]
    for _, keys in forces:
        writer.table("force", keys)
    for name, keys in model.pressures:
        writer.table("pressure", {"on": name, **keys})
    bolts = [keys for table, keys in made if table == "bolt"] + [{"section": name, **keys} for name, keys in model.bolts]
    for keys in bolts:
        writer.table("bolt", {"name": keys["name"], **keys})
    known = {keys["name"] for keys in bolts}
    for name, factors, friction, tightened in model.steps:
        keys = {"name": name}
        of_forces = [factors.get(key, 1.0) for key, _ in forces]
        of_pressures = [factors.get(("pressure", i), 1.0) for i in range(len(model.pressures))]
        keys |= {"forces": of_forces} if any(factor != 1 for factor in of_forces) else {}
        keys |= {"pressures": of_pressures} if any(factor != 1 for factor in of_pressures) else {}
        keys |= {"friction": friction} if friction != 1 else {}
        keys |= {"bolts": [bolt for bolt in tightened if bolt in known]} if known & set(tightened) else {}
        writer.table("step", keys)


def material(model, part):
    known = model.materials.get(part.material, {}) if part.material else {}
    lacks = f"the deck has no material {part.material}" if part.material and part.material not in model.materials else "the deck has none"
    keys, shells = {}, model.elements[part.elements[0]][0] not in KINDS
    if "orthotropic" in known and shells:
        known, lacks = {key: of for key, of in known.items() if key != "orthotropic"}, f"material {part.material} is orthotropic, which solids can be alone"
    if "orthotropic" in known:
        keys["orthotropic"] = {**known["orthotropic"], **(part.axes or {})}
    else:
        for key, unit in (("young", "Pa"), ("poisson", "-")):
            missing = key not in known or (known[key] == 0 and key != "poisson")
            keys[key] = f"FILL IN [{unit}]: {'the deck has none, or 0' if key in known else lacks}" if missing else known[key]
    keys["density"] = known["density"] if known.get("density") else f"FILL IN [kg/m3]: {'the deck has none, or 0' if 'density' in known else lacks}"
    damping = {**known, "loss_factor": known.get("loss_factor", 0) + model.loss_factor}
    keys |= {key: damping[key] for key in ("loss_factor", "alpha", "beta") if damping.get(key)}
    keys |= {"offset": part.offset} if part.offset else {}
    if shells:
        keys["thickness"] = part.thickness or "FILL IN [m]: these are shells; or remove this part, if they are the surface of a solid"
    return keys
