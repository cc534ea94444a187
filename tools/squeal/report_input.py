"""What was run, for the page of tools/report: materials and masses, contacts and friction, loads, speed, supports; and what
differs between runs."""

import numpy as np
from squeal.plot_basis import scene_of
from squeal.plot_places import places_of
from squeal.report_tables import number, table, text
from squeal import Missing, number_label
from squeal.surface import by_part, volume

ASIDE = ("mesh.file",)  # its folder says nothing of the model


def masses(run, parts):
    """Of each part [kg], by its elements; None where the mesh is not there."""
    try:
        elements, nodes = by_part(run.field("mesh/topology"), run.field("mesh/part")), run.nodes
    except Missing:
        return [None] * len(parts)
    return [float(part.get("density", 0) * volume(elements.get(k, []), nodes, part.get("thickness", 0))) for k, part in enumerate(parts)]


def materials(run, scene):
    parts = scene.get("part", [])
    rows = [[text(part["name"]), number(part.get("young", 0) / 1e9), number(part.get("poisson"), 3), number(part.get("density")),
             number(1e3 * part["thickness"]) if part.get("thickness") else "solid", number(mass, 4)]
            for part, mass in zip(parts, masses(run, parts))]
    rows += [[text(body["name"]), "rigid", "–", "–", "–", number(body.get("mass"), 4)] for body in scene.get("rigid_body", [])]
    rows += [[text(body["name"]), "point", "–", "–", "–", number(body.get("mass"), 4)] for body in scene.get("point", [])]
    head = ["part", "Young's modulus [GPa]", "Poisson's ratio [-]", "density [kg/m³]", "thickness [mm]", "mass [kg]"]
    return "<h3>Materials and masses</h3>" + table(head, rows) if rows else ""


def vector(values, digits=4):
    return ", ".join(number(float(value), digits) for value in values)


def drive(contact):
    """How its rotor moves."""
    rotation, velocity = contact.get("rotation", {}), contact.get("velocity", [])
    if rotation.get("rate"):
        return f"{number(float(rotation['rate']))} rad/s, {number(rotation['rate'] * 30 / np.pi, 3)} rpm"
    return f"{vector(velocity)} m/s" if np.any(velocity) else "not driven"


def friction_words(scene, contact):
    """Its own coefficient and law, else those of all contacts."""
    of = scene.get("friction", {}) | {name: contact[name] for name in ("static_coefficient", "decay_speed") if contact.get(name)}
    own = contact.get("friction")
    words = number(of.get("coefficient") if own is None else own)
    if of.get("decay_speed"):
        words += f", {number(of.get('static_coefficient'))} at a speed of zero, falling over {number(of['decay_speed'])} m/s"
    return words


def contact_rows(run, scene):
    places = {place.number: place for place in places_of(run)}
    for k, contact in enumerate(scene.get("contact", [])):
        place = places.get(k)
        milli = lambda value: "–" if value is None else number(1e3 * value, 4)
        centre = vector(1e3 * np.where(np.abs(place.centre) < 1e-9, 0, place.centre)) if place else "–"
        yield [text(f"{contact.get('stator', '')} on {contact.get('rotor', '')}"), friction_words(scene, contact), drive(place.contact if place else contact),
               number(float(place.force)) if place else "–", centre, milli(place.radius if place else None),
               number(float(place.speed), 4) if place and place.speed else "–"]


def contacts(run, scene):
    rows = list(contact_rows(run, scene))
    head = ["contact", "friction coefficient [-]", "rotor", "normal force [N]", "centre of pressure [mm]", "effective radius [mm]", "sliding speed there [m/s]"]
    return "<h3>Contacts</h3>" + table(head, rows) if rows else ""


def loads(scene):
    rows = [["force", text(of.get("on", "")), f"{vector(of['vector'])} N"] for of in scene.get("force", [])]
    rows += [["pressure", text(of.get("on", "")), f"{number(of['value'] / 1e6)} MPa"] for of in scene.get("pressure", []) if "value" in of]
    rows += [["support", text(of.get("on", "")), text(f"fixed: {of.get('fixed', '')}")] for of in scene.get("support", [])]
    rows += [["spring", text(f"{of.get('from', '')} to {of.get('to', '')}"), f"{number(float(of['stiffness']))} N/m along {text(of.get('direction', ''))}"]
             for of in scene.get("spring", []) if isinstance(of.get("stiffness"), (int, float))]
    damping = scene.get("damping", {})
    if any(damping.get(name) for name in ("alpha", "beta")):
        rows.append(["damping", "all parts", f"alpha {number(damping.get('alpha', 0))} 1/s, beta {number(damping.get('beta', 0))} s"])
    return "<h3>Loads, supports and damping</h3>" + table(["kind", "on", "value"], rows, "further ones") if rows else ""


def input_of(run):
    """The section of a run; empty where its scene is not there."""
    scene = scene_of(run)
    return f"<section><h2>What was run</h2>{materials(run, scene)}{contacts(run, scene)}{loads(scene)}</section>" if scene else ""


def flat(table_of_scene, key="", name=""):
    """Every value of a scene by its key, with the name of what it belongs to."""
    if isinstance(table_of_scene, dict):
        own = table_of_scene.get("name") or table_of_scene.get("on") or name
        for part, value in table_of_scene.items():
            yield from flat(value, f"{key}.{part}" if key else part, own if isinstance(own, str) else name)
    elif isinstance(table_of_scene, list):
        for k, value in enumerate(table_of_scene):
            yield from flat(value, f"{key}.{k}", name)
    else:
        yield key, (name, table_of_scene)


def differences(runs):
    """What the scenes of these runs have not alike: a row a value, a column a run."""
    scenes = [dict(flat(scene_of(run))) for run in runs]
    rows = []
    for key in dict.fromkeys(key for scene in scenes for key in scene):
        values = [scene[key][1] if key in scene else None for scene in scenes]
        if key not in ASIDE and any(value != values[0] for value in values):
            name = next(scene[key][0] for scene in scenes if key in scene)
            rows.append([text(number_label(key, name if name not in values else "")), *map(number, values)])
    commits = [run.report.get("versions", {}).get("commit") for run in runs]
    if len(set(commits)) > 1:
        rows.append(["squeal's commit", *map(number, commits)])
    return rows
