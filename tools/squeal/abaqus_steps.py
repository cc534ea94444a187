"""Keywords of Abaqus and CalculiX about contacts, friction, motions, loads, and the order of steps."""

import re

import numpy as np
from squeal.deck_files import Problem, number, undefined, whole

STATIC = ("STATIC", "VISCO", "DYNAMIC", "COUPLED TEMPERATURE-DISPLACEMENT")
COMPONENTS = 6


class Steps:
    """What acts at the end of each step."""

    def __init__(self):
        self.name, self.loads, self.static = "", {}, False
        self.ends = []  # (name, loads, friction of interactions, bolts tightened)
        self.tightened = []
        self.interactions, self.current = {}, None  # keys of [[contact]] by name
        self.pairs = []  # (slave, master, name of the interaction)
        self.gaps = {}  # by slave and master
        self.drives = []  # (nodes, keys)
        self.bands = []
        self.in_step = False


def step(block, deck):
    deck.steps.name = block.options.get("NAME", "") or f"step {len(deck.steps.ends) + 1}"
    deck.steps.static, deck.steps.tightened, deck.steps.in_step = False, [], True


def procedure(block, deck):
    deck.steps.static = True


def end_step(block, deck):
    steps = deck.steps
    steps.in_step = False
    if steps.static:
        friction = {name: dict(keys) for name, keys in steps.interactions.items()}
        steps.ends.append((steps.name, dict(steps.loads), friction, list(steps.tightened)))


def frequency(block, deck):
    """The upper end of the range; a shift or none where the deck asks for a number of modes alone."""
    for place, fields in list(block.rows())[:1]:
        upper = number(fields[2], place) if len(fields) > 2 and fields[2] else 0.0
        if upper > 0:
            deck.steps.bands.append((block.name == "COMPLEX FREQUENCY", upper))


def interaction(block, deck):
    deck.steps.current = block.options.get("NAME", "").upper()
    deck.steps.interactions[deck.steps.current] = {}


def change_friction(block, deck):
    name = block.options.get("INTERACTION", "").upper()
    if name not in deck.steps.interactions:
        raise undefined(block.place, "*CHANGE FRICTION: the interaction", name, deck.steps.interactions)
    deck.steps.current = name


def friction(block, deck):
    rows = [(place, [number(field or "0", place) for field in fields]) for place, fields in block.rows(1, "a coefficient of friction")]
    keys = deck.steps.interactions.get(deck.steps.current)
    if keys is None:
        deck.note("*FRICTION outside of a *SURFACE INTERACTION", block.place)
        return
    for key in ("friction", "static_coefficient", "decay_speed", "factor_at_speed", "slip_compliance"):
        keys.pop(key, None)
    if "ROUGH" in block.options or "LAGRANGE" in block.options:
        deck.note(f"{'ROUGH' if 'ROUGH' in block.options else 'LAGRANGE'} of *FRICTION", block.place)
    if not rows:
        return
    first = rows[0][1]
    if "EXPONENTIAL DECAY" in block.options:
        if len(first) < 3:
            raise Problem(f"{rows[0][0]}: {len(first)} numbers; expected static and kinetic coefficient and decay")
        keys["friction"] = first[1]
        keys |= {"static_coefficient": first[0], "decay_speed": 1 / first[2]} if first[2] > 0 else {}
    elif len(rows) > 1 and first[0] > 0:
        keys["friction"] = first[0]
        at = [(of[1] if len(of) > 1 else 0.0, of[0] / first[0]) for _, of in rows if of[2:] == first[2:]]  # at one pressure and temperature
        keys |= {"factor_at_speed": at} if len(at) > 1 else {}
        if len(at) < len(rows):
            deck.note(f"{len(rows) - len(at)} of the {len(rows)} lines of *FRICTION, of other pressures or temperatures", block.place)
    else:
        keys["friction"] = first[0]
        if len(first) > 1 and first[1] > 0 and "ANISOTROPIC" not in block.options:
            keys["slip_compliance"] = 1 / first[1]  # CalculiX's slope of sticking


def behaviour(block, deck):
    kind, keys = block.options.get("PRESSURE-OVERCLOSURE", "HARD").upper(), deck.steps.interactions.get(deck.steps.current)
    rows = list(block.rows())
    if kind == "LINEAR" and keys is not None and rows and rows[0][1]:
        slope = number(rows[0][1][0], rows[0][0])
        if not slope > 0:
            raise Problem(f"{rows[0][0]}: a slope of {slope:g}; expected one above 0")
        keys["compliance"] = 1 / slope
    elif kind == "TIED" and keys is not None:
        keys["tied"] = True
    elif kind != "HARD":
        deck.note(f"PRESSURE-OVERCLOSURE={kind} of *SURFACE BEHAVIOR", block.place)


def pairs(block, deck):
    """A contact of a surface whose faces are left out keeps its place, and a gap that is to be filled."""
    law = block.options.get("INTERACTION", "").upper()
    laws = [other.options.get("NAME", "") for other in deck.blocks if other.name == "SURFACE INTERACTION"]
    if law and law not in map(str.upper, laws):
        raise undefined(block.place, f"*{block.name}: the interaction", law, laws)
    if cyclic := [key for key in ("CYCLIC SYMMETRY", "MULTISTAGE", "FLUID PERIODIC", "FLUID CYCLIC") if key in block.options]:
        deck.note(f"*TIE, {cyclic[0]}", block.place)
        return
    for place, fields in block.rows(1, "the slave surface and the master surface"):
        names = [deck.face_group(name, place, f"*{block.name}: the surface") for name in fields[:2]]
        if len(fields) < 2:
            deck.note(f"*{block.name}, which has one surface", place)
        elif block.name == "CONTACT PAIR" and "TIED" not in block.options:
            names = [name or f"FILL IN [a surface]: {of} of the deck has no faces of solids or shells" for name, of in zip(names, fields)]
            deck.steps.pairs.append((*names, law))
            deck.model.contact_places[tuple(names)] = place
        elif None in names:
            deck.note(f"*{block.name}, whose surface {fields[names.index(None)]} has no faces", place)
        else:
            deck.model.ties.append(tuple(names))


def clearance(block, deck):
    """An initial gap of the contact of two surfaces."""
    for key in ("SLAVE", "MASTER"):
        deck.face_group(block.options.get(key, ""), block.place, f"*CLEARANCE: the surface {key}")
    names = tuple(block.options.get(key, "").upper() for key in ("SLAVE", "MASTER"))
    if "VALUE" not in block.options or not all(names):
        deck.note("*CLEARANCE without SLAVE, MASTER and VALUE", block.place)
        return
    deck.steps.gaps[names] = number(block.options["VALUE"], block.place)


def motion(block, deck):
    turning = "ROTATION" in block.options
    if block.options.get("TYPE", "DISPLACEMENT").upper() not in ("VELOCITY", "DISPLACEMENT"):
        deck.note(f"*MOTION, TYPE={block.options['TYPE']}", block.place)
        return
    form = "a set of nodes, a rate, and two points of its axis" if turning else "a set of nodes, a motion from 1 to 3, and a velocity"
    velocities = {}  # by set, of which each line has a component
    for place, fields in block.rows(3, form):
        if not all(fields[: 2 if turning else 3]):
            raise Problem(f"{place}: *MOTION, '{', '.join(fields)}' has a blank field; expected {form}")
        nodes = deck.nodes_of(fields[0], f"{place}: *MOTION")
        if not turning:
            direction = whole(fields[1], f"{place}: *MOTION", form)
            if not 1 <= direction <= 3:
                raise Problem(f"{place}: *MOTION of motion {direction}; expected {form}")
            velocity = velocities.setdefault(fields[0].upper(), [0.0] * 3)
            velocity[direction - 1] = number(fields[2], f"{place}: *MOTION")
            keys = {"velocity": velocity}
        else:
            values = [number(field or "0", place) for field in (fields[1:] + ["0"] * 6)[:7]]
            start, end = values[1:4], values[4:7]
            axis = [b - a for a, b in zip(start, end)]
            if not any(axis):
                raise Problem(f"{place}: *MOTION: the axis has one point; expected {form}")
            keys = {"rotation": {"axis": axis, "centre": start, "rate": values[0]}}
        deck.steps.drives.append((set(nodes), keys))


def replaced(block, deck, kind):
    """Loads of a kind that OP=NEW takes away."""
    if block.options.get("OP", "MOD").upper() == "NEW":
        for key in [key for key in deck.steps.loads if key[0] == kind]:
            del deck.steps.loads[key]


def concentrated(block, deck):
    """Of a set of nodes the force acts on each; on the node of a bolt it is the tension."""
    replaced(block, deck, "force")
    loads = deck.steps.loads
    for place, fields in block.rows(3, "a node or a set, a motion from 1 to 6, and a force"):
        nodes, direction, value = deck.nodes_of(fields[0], place), whole(fields[1], place), number(fields[2], place)
        if not 1 <= direction <= COMPONENTS:
            deck.note(f"*CLOAD of degree of freedom {direction}", place)
            continue
        if nodes and nodes[0] in deck.pretension:
            tighten(deck, nodes[0], value, place)
            continue
        alone = [n for n in nodes if n not in deck.used]
        shared = [n for n in nodes if n in deck.used]
        targets = [(n, 1) for n in alone]
        if shared:
            name = deck.nodes.names.get(fields[0].upper(), fields[0]) if not fields[0].isdecimal() else ""
            targets += [(name, len(shared))] if name and len(nodes) > 1 else [(shared[0], 1)]
        for target, count in targets:
            load = np.array(loads.get(("force", target), np.zeros(COMPONENTS)))
            load[direction - 1] = value * count
            loads["force", target] = load


def tighten(deck, node, value, place):
    if value <= 0:
        deck.note(f"the tension {value:g} of the bolt of node {node}: one above 0 tightens it", place)
    else:
        deck.tension[node] = value
        if node not in deck.steps.tightened:
            deck.steps.tightened.append(node)


def surface_pressure(block, deck):
    replaced(block, deck, "pressure")
    for place, fields in block.rows(3, "a surface, P, and a pressure"):
        name = deck.face_group(fields[0], place, "*DSLOAD: the surface")
        if fields[1].upper() != "P" or name is None:
            deck.note(f"*DSLOAD of type {fields[1]} on {fields[0]}" + ("" if name else ", which has no faces"), place)
            continue
        deck.steps.loads["pressure", name] = number(fields[2], place)


def element_load(block, deck):
    """Pressures on faces of elements, and gravity."""
    replaced(block, deck, "pressure")
    model = deck.model
    for place, fields in block.rows(2, "an element or a set, a type such as P1 or GRAV, and its size"):
        kind = fields[1].upper()
        pressed = re.fullmatch(r"P(\d)", kind)
        if kind != "GRAV" and not pressed:
            deck.note(f"*DLOAD of type {fields[1]}", place)
            continue
        if len(fields) < 3:
            raise Problem(f"{place}: *DLOAD, '{', '.join(fields)}': {len(fields)} fields; expected the size of the load behind its type")
        value = number(fields[2], place)
        numbers = deck.elements_of(fields[0], place)
        if kind == "GRAV" and len(fields) > 5:
            axis = np.array([number(field or "0", place) for field in fields[3:6]])
            if not np.linalg.norm(axis) > 0:
                raise Problem(f"{place}: gravity without a direction; expected x, y, z")
            model.gravity = (value * axis / np.linalg.norm(axis)).tolist()
            if not set(model.elements) <= set(numbers):
                deck.note(f"that gravity acts on {fields[0]} alone: in a scene it acts on all", place)
        elif pressed:
            label, side = f"{fields[0]}_{kind}", int(pressed[1])
            faces = [model.faces(n)[side - 1] for n in numbers if n in model.elements and 0 < side <= len(model.faces(n)) > 1]
            if not faces:
                deck.note(f"*DLOAD {kind} of {fields[0]}: no such faces of solids", place)
                continue
            model.surfaces[label] = faces
            deck.steps.loads["pressure", label] = value
        else:
            deck.note("*DLOAD of type GRAV without a direction", place)


def finish(deck):
    """Loads, contacts and steps of the model: its own values are those of the last step."""
    steps, model = deck.steps, deck.model
    ends = steps.ends or [("", dict(steps.loads), {name: dict(keys) for name, keys in steps.interactions.items()}, [])]
    last = ends[-1][1]
    gone = {key for _, loads, *_ in ends for key in loads} - set(last)
    for kind, target in sorted(gone, key=str):
        model.notes.append(f"the {kind} on {target} of earlier steps, which the last one has not")
    order = {}  # keys of a scene's loads by those here
    for (kind, target), value in last.items():
        if kind == "pressure":
            order[kind, target] = ("pressure", len(model.pressures))
            model.pressures.append((target, {"value": value}))
        elif isinstance(target, str):
            order[kind, target] = ("group", len(model.forces))
            model.forces.append((target, {"vector": value[:3].tolist()}))
            if any(value[3:]):
                model.notes.append(f"the moment on {target}, whose nodes have no rotations")
        else:
            order[kind, target] = ("force", target)
            model.joints.forces[target] = value.tolist()
    for node, (block, axis) in deck.pretension.items():
        add_bolt(deck, node, block, axis)
    add_contacts(deck, ends)
    add_steps(deck, ends, order)
    complex_bands = [upper for is_complex, upper in steps.bands if is_complex] or [upper for _, upper in steps.bands]
    model.band = max(complex_bands, default=0.0)


def bolt_name(deck, node):
    """By the set that has its node alone."""
    return next((name for name, nodes in deck.model.node_sets.items() if nodes == [node]), f"bolt_{node}")


def add_bolt(deck, node, block, axis):
    options, model = block.options, deck.model
    if node not in deck.tension:
        deck.note(f"*PRE-TENSION SECTION of node {node}, which no *CLOAD above 0 tightens", block.place)
        return
    keys = {"name": bolt_name(deck, node), "tension": deck.tension[node]}
    surface = deck.face_group(options["SURFACE"], block.place, "*PRE-TENSION SECTION: the surface") if options.get("SURFACE") else None
    if options.get("ELEMENT", "").isdecimal() and int(options["ELEMENT"]) in deck.beams:
        model.joints.bolts.append((deck.beams[int(options["ELEMENT"])], keys))
    elif surface in model.surfaces:
        model.bolts.append((surface, {**keys, "axis": axis or model.normal_of(surface)}))
    else:
        deck.note("*PRE-TENSION SECTION of no surface and no beam that is there", block.place)


def add_contacts(deck, ends):
    """The side whose nodes *MOTION moves is the rotor; a contact without *FRICTION is smooth."""
    model = deck.model
    nodes_of = {name: {n for face in faces for n in face} for name, faces in model.surfaces.items()}
    nodes_of |= {name: set(nodes) for name, nodes in model.node_sets.items() if name not in nodes_of}
    tied = {name for name, keys in deck.steps.interactions.items() if keys.pop("tied", False)}
    model.ties += [(slave, master) for slave, master, name in deck.steps.pairs if name in tied]
    deck.steps.pairs = [pair for pair in deck.steps.pairs if pair[2] not in tied]
    for slave, master, name in deck.steps.pairs:
        keys = {"friction": 0.0, **deck.steps.interactions.get(name, {})}
        keys |= {"gap": gap} if (gap := deck.steps.gaps.get((slave.upper(), master.upper()))) else {}
        for moving, drive in deck.steps.drives:
            if nodes_of.get(master, moving | {0}) <= moving:
                keys |= drive
            elif nodes_of.get(slave, moving | {0}) <= moving:
                keys |= {**drive, "slave": "rotor"}
        if "rotation" in keys or "velocity" in keys or not keys["friction"]:
            keys.pop("slip_compliance", None)
        model.contacts.append((slave, master, keys))
    moved = {n for moving, _ in deck.steps.drives for n in moving}
    if moved and not any("rotation" in keys or "velocity" in keys for *_, keys in model.contacts):
        model.notes.append("*MOTION: it moves all nodes of no surface of a contact")


def add_steps(deck, ends, order):
    """A step for each static one, by factors on the last one's loads and on the friction of driven contacts."""
    model, last = deck.model, ends[-1]
    driven = {name for (slave, master, name), (*_, keys) in zip(deck.steps.pairs, model.contacts) if "rotation" in keys or "velocity" in keys}
    found = []
    for title, loads, laws, tightened in ends:
        factors = {}
        for key, shown in order.items():
            full, now = np.atleast_1d(last[1][key]), np.atleast_1d(loads.get(key, 0.0 * np.atleast_1d(last[1][key])))
            factor = float(full @ now / (full @ full)) if full.any() else 1.0
            if np.abs(now - factor * full).max() > 1e-9 * np.abs(full).max():
                model.notes.append(f"another direction of the force on {key[1]} in {title}: it has the last step's")
            factors[shown] = factor if full.any() else 1.0
        shares = {laws[name].get("friction", 0.0) / last[2][name]["friction"] for name in driven if last[2].get(name, {}).get("friction") and name in laws}
        if len(shares) > 1:
            model.notes.append(f"frictions of contacts in {title} that change by different factors: they have the last step's")
        found.append((title, factors, shares.pop() if len(shares) == 1 else 1.0, [bolt_name(deck, node) for node in tightened]))
    plain = all(factor == 1 for _, factors, share, _ in found for factor in (*factors.values(), share))
    late = any(bolts for *_, bolts in found[1:])
    if len(found) > 1 and not (plain and not late):
        model.steps = found


HANDLERS = {"STEP": step, "END STEP": end_step, "FREQUENCY": frequency, "COMPLEX FREQUENCY": frequency,
            "SURFACE INTERACTION": interaction, "CHANGE FRICTION": change_friction, "FRICTION": friction,
            "SURFACE BEHAVIOR": behaviour, "TIE": pairs, "CONTACT PAIR": pairs, "MOTION": motion, "CLEARANCE": clearance, "CLOAD": concentrated,
            "DSLOAD": surface_pressure, "DLOAD": element_load, **dict.fromkeys(STATIC, procedure)}
OPTIONS = {"FREQUENCY": "EIGENSOLVER,NORMALIZATION,SOLVER,STORAGE,GLOBAL,CYCMPC,ACOUSTIC COUPLING",
           "COMPLEX FREQUENCY": "FRICTION DAMPING,CORIOLIS,FLUTTER,PROPERTY EVALUATION,LEFT EIGENVECTORS",
           "SURFACE INTERACTION": "NAME,USER,PAD THICKNESS", "CHANGE FRICTION": "INTERACTION,RESET",
           "FRICTION": "SLIP TOLERANCE,EXPONENTIAL DECAY,ROUGH,LAGRANGE,ELASTIC SLIP",
           "SURFACE BEHAVIOR": "PRESSURE-OVERCLOSURE,AUGMENTED LAGRANGE,PENALTY,DIRECT",
           "TIE": "NAME,ADJUST,TYPE,CONSTRAINT RATIO,NO ROTATION,CYCLIC SYMMETRY,MULTISTAGE,FLUID PERIODIC,FLUID CYCLIC",
           "CONTACT PAIR": "INTERACTION,TYPE,SMALL SLIDING,TIED,MECHANICAL CONSTRAINT,CPSET,TRACKING,SUPPLEMENTARY CONSTRAINTS",
           "CLEARANCE": "SLAVE,MASTER,VALUE", "MOTION": "TRANSLATION,ROTATION,TYPE", "CLOAD": "OP", "DSLOAD": "OP", "DLOAD": "OP"}
