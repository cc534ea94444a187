"""What a deck says and no scene can mean: refused at its line. What it can hardly mean, such as mixed units: told."""

import numpy as np
from squeal.deck_files import Problem
from squeal.mesh_model import FLAT, corners_of

SOLID_DENSITY = (20, 23000)  # [kg/m3] of solids, as squeal's own warnings have them
SOLID_MODULUS = (1e4, 1.3e12)  # [Pa]
SPEED_OF_SOUND = (10, 20000)  # [m/s]
LARGEST_LOSS_FACTOR = 10


def check_model(model):
    """Refuses what squeal refuses of the scene, by the deck's own lines; contacts of one surface are left out and told."""
    used = {part.material: name for name, part in reversed(model.parts.items()) if part.material in model.materials}
    for material in sorted(used, key=str):
        check_material(model, material)
    for name, part in model.parts.items():
        for key, least in (("thickness", "0 or above"), ("offset", "a number")):
            value = getattr(part, key)
            if not np.isfinite(value) or key == "thickness" and value < 0:
                raise Problem(f"{part.place or model.source}: {key} {value:g} of the shells of {name}: expected {least}")
    check_doubles(model)
    drop_contacts_of_one_surface(model)
    check_contacts(model)
    check_joints(model)


def check_material(model, material):
    """Constants of one material, whatever part has it."""
    constants = model.materials[material]

    def refuse(key, value, expected):
        place = model.material_places.get((material, key)) or model.material_places.get((material, None)) or model.source
        raise Problem(f"{place}: material {material}: {value}: expected {expected}")

    young, poisson, density = (constants.get(key) for key in ("young", "poisson", "density"))
    if young is not None and young < 0:
        refuse("young", f"Young's modulus {young:g}", "a number above 0")
    if poisson is not None and not -1 < poisson < 0.5:
        near = "; 0.49 to 0.499 does for rubber, which hardly changes its volume" if poisson == 0.5 else ""
        refuse("poisson", f"Poisson's ratio {poisson:g}", f"a number above -1 and below 0.5{near}")
    if density is not None and density < 0:
        refuse("density", f"density {density:g}", "a number above 0")
    for key, name in (("alpha", "damping ALPHA"), ("beta", "damping BETA"), ("loss_factor", "loss factor")):
        if constants.get(key, 0) < 0:
            refuse(key, f"{name} {constants[key]:g}", "0 or a number above; a negative one would feed every motion")
    if constants.get("loss_factor", 0) > LARGEST_LOSS_FACTOR:
        refuse("loss_factor", f"loss factor {constants['loss_factor']:g}", f"at most {LARGEST_LOSS_FACTOR}: those of rubber reach 2")
    if "orthotropic" in constants:
        of = constants["orthotropic"]
        if min(*of["young"], *of["shear"]) <= 0:
            refuse("orthotropic", f"moduli {listed(of['young'])} and shear moduli {listed(of['shear'])}", "numbers above 0")
        if not does_positive_work(of["young"], of["poisson"]):
            refuse("orthotropic", f"Poisson's ratios {listed(of['poisson'])}", "nu12 sqrt(E2/E1) and its like below 1, and not all near it: "
                   "with these a load would do negative work")


def listed(values):
    return ", ".join(f"{value:g}" for value in values)


def does_positive_work(young, ratios):
    """Whether the compliance of direct stresses, scaled by the moduli, is positive definite."""
    scaled, root = np.eye(3), np.sqrt(young)
    for (i, j), ratio in zip(((0, 1), (0, 2), (1, 2)), ratios):
        scaled[i, j] = scaled[j, i] = -ratio * root[j] / root[i]
    return bool(np.isfinite(scaled).all() and np.linalg.eigvalsh(scaled)[0] > 0)


def check_doubles(model):
    """Two elements on the same nodes have mass and stiffness twice, or are one of the mesh, which drops the other."""
    by_kind = {}
    for name, part in model.parts.items():
        for n in part.elements:
            by_kind.setdefault(model.elements[n][0], []).append((n, name))
    for kind, found in by_kind.items():
        nodes = np.sort(np.array([model.elements[n][1] for n, _ in found]), axis=1)
        order = np.lexsort(nodes.T)
        same = np.flatnonzero((nodes[order][1:] == nodes[order][:-1]).all(axis=1))
        if not len(same):
            continue
        (first, one), (second, other) = sorted((found[order[same[0]]], found[order[same[0] + 1]]))
        remedy = "give one shell the thickness of both, or each layer nodes of its own and a tie between them" if kind in FLAT else "take one of them out"
        which = f"both of {one}" if one == other else f"of {one} and {other}"
        raise Problem(f"{place_of(model, second)}: the elements {first} and {second}, {which}, have the same nodes"
                      + (f", and so have {len(same) - 1} others" if len(same) > 1 else "") + f": {remedy}")


def place_of(model, number):
    place = model.places.get(number, model.source)
    return place.place_of(number) if hasattr(place, "place_of") else place


def drop_contacts_of_one_surface(model):
    """Codes have contacts of a surface with itself, and of both sides as slave and as master; a scene has neither."""
    known, kept = {}, []
    faces = {name: frozenset(map(corners_of, model.surfaces.get(name, ()))) or name for row in model.contacts for name in row[:2]}
    for slave, master, keys in model.contacts:
        sides = frozenset((faces[slave], faces[master]))
        if len(sides) == 1:
            model.notes.append(f"the contact of {slave} with itself: name the parts of it that meet as two surfaces")
        elif before := known.get(sides):
            model.notes.append(f"a second contact of {slave} (slave) and {master} (master): the first, whose slave is {before}, stays")
        else:
            known[sides] = slave
            kept.append((slave, master, keys))
    model.contacts[:] = kept
    for slave, master in [tie for tie in model.ties if tie[0] == tie[1]]:
        model.notes.append(f"the tie of {slave} to itself, which joins nothing")
        model.ties.remove((slave, master))


def check_contacts(model):
    for slave, master, keys in model.contacts:
        for key, name in (("friction", "friction"), ("static_coefficient", "static friction")):
            if keys.get(key, 0) < 0:
                raise Problem(f"{model.contact_places.get((slave, master)) or model.source}: the contact of {slave} (slave) and {master} (master): {name} {keys[key]:g}: expected 0 or a number above")


def check_joints(model):
    joints = model.joints
    for values, what in ((joints.mass, "mass"), (joints.inertia, "inertia")):
        for node, value in values.items():
            if np.min(value if what == "mass" else value[:3]) < 0:
                raise Problem(f"{model.source}: the {what} {listed(np.ravel(value))} at node {node}: expected 0 or above")
    for name, value in model.masses:
        if value < 0:
            raise Problem(f"{model.source}: the mass {value:g} on {name}: expected 0 or above")
    for a, b, *_, keys, where in (*joints.springs, *joints.connectors):
        ends = " and ".join(f"node {node}" if node is not None else "the ground" for node in (a, b))
        for key in ("stiffness", "damping"):
            if np.min(keys.get(key, 0)) < 0:
                raise Problem(f"{model.source}, {where}: the {key} {listed(np.ravel(keys[key]))} between {ends}: expected 0 or above")
    for name, *_, keys, where in joints.beams:
        if not keys["young"] > 0 or not -1 < keys["poisson"] < 0.5 or keys.get("density", 0) < 0:
            raise Problem(f"{model.source}, {where}: the beam {name} has Young's modulus {keys['young']:g}, Poisson's ratio {keys['poisson']:g} and "
                          f"density {keys.get('density', 0):g}: expected a modulus above 0, a ratio above -1 and below 0.5, a density of 0 or above")


def is_solid(density):
    return SOLID_DENSITY[0] <= density <= SOLID_DENSITY[1]


def doubts_about(model, length, force):
    """Sentences about materials that in these units are those of no solid."""
    found = []
    for material in dict.fromkeys(part.material for part in model.parts.values() if part.material in model.materials):
        constants = model.materials[material]
        young = max(np.ravel(constants.get("orthotropic", constants).get("young", 0))) * force / length**2
        density = constants.get("density", 0) * force / length**4
        if not young or not density:
            continue
        doubt = ""
        if not is_solid(density):
            doubt = f"a density of {density:g} kg/m3 is that of no solid; steel has 7850"
        elif not SOLID_MODULUS[0] <= young <= SOLID_MODULUS[1]:
            doubt = f"a Young's modulus of {young:g} Pa is that of no solid; steel has 2.1e11"
        elif not SPEED_OF_SOUND[0] <= np.sqrt(young / density) <= SPEED_OF_SOUND[1]:
            doubt = f"sound would travel at {np.sqrt(young / density):.3g} m/s by its modulus and density; in steel it does at 5200"
        if doubt:
            found.append(f"material {material}: {doubt}. Does the deck mix units? With --length {length:g} and --force {force:g} its modulus is in "
                         f"units of {force / length**2:g} Pa and its density in units of {force / length**4:g} kg/m3")
    return found
