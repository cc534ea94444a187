"""The skeleton of a scene for a mesh_model.Model: what the deck says as keys, what it does not say as comments to fill in."""

from squeal.mesh_model import KINDS, MOTIONS


def text(value):
    return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'


def skeleton(model, mesh, length, force):
    lines = [f"# Made of {model.source.name}. Lines with FILL IN need a number or a name, and lose their first #.",
             f"title = {text(model.source.stem)}", "", "[mesh]", f"file = {text(mesh)}"]
    lines += [f"scale = {length!r}"] if length != 1 else ["# Of a deck in mm, N and s? Make this again by tools/mesh … --length 0.001 --force 1, which converts moduli too."]
    for note in model.notes:
        lines += ["", f"# Not taken over: {note}"] if note == model.notes[0] else [f"# Not taken over: {note}"]
    for name, part in model.parts.items():
        lines += ["", "[[part]]", f"name = {text(name)}", *material(model, part, length, force)]
        if model.elements[part.elements[0]][0] not in KINDS:
            lines.append(f"thickness = {part.thickness * length:.12g}" if part.thickness else
                         "# thickness =    # FILL IN [m]: these are shells; or remove this part, if they are the surface of a solid")
    for name, motions in model.supports:
        fixed = "all" if len(motions) == len(MOTIONS) else " ".join(motions)
        lines += ["", "[[support]]", f"on = {text(name)}", f"fixed = {text(fixed)}"]
    if not model.supports:
        lines += ["", "# [[support]]", f"# on = \"\"          # FILL IN: {names_of(model)}", '# fixed = "all"']
    lines += ["", *contacts(model), "", "[damping]", "# beta = 1e-7     # FILL IN [s]: C = alpha M + beta K"]
    if any(line.startswith("loss_factor = ") for line in lines):
        lines.append("# loss_frequency =    # FILL IN [Hz]: where loss factors have their viscous equivalent in time")
    lines.append("")
    lines += ["# [[force]]", f"# on = \"\"          # FILL IN: {names_of(model)}", "# vector = [0, 0, 0]   # FILL IN [N]: the whole force", ""]
    return "\n".join(lines)


def material(model, part, length, force):
    """Stress is force over length squared, density force s2 over length to the fourth."""
    known = model.materials.get(part.material, {}) if part.material else {}
    lines = []
    for key, unit, factor in (("young", "Pa", force / length**2), ("poisson", "-", 1), ("density", "kg/m3", force / length**4)):
        missing = key not in known or (known[key] == 0 and key != "poisson")
        lines.append(f"# {key} =    # FILL IN [{unit}]: the deck has none" if missing else f"{key} = {known[key] * factor:.12g}")
    damping = {**known, "loss_factor": known.get("loss_factor", 0) + model.loss_factor}
    return lines + [f"{key} = {damping[key]:.12g}" for key in ("loss_factor", "alpha", "beta") if damping.get(key)]


def names_of(model):
    names = [*model.surfaces, *model.node_sets]
    return "a named group: " + ", ".join(names) if names else "a named group; the deck has no sets or surfaces"


def contacts(model):
    lines = []
    for slave, master in model.ties:
        lines += ["[[tie]]", f"slave = {text(slave)}", f"master = {text(master)}", ""]
    pairs = model.contacts or [("", "")]
    for slave, master in pairs:
        found = f"the deck has a contact of {slave} (slave) and {master} (master)" if slave else "the surface that moves: " + (
            ", ".join(model.surfaces) or "the deck has no surfaces; name faces or sets of nodes in it")
        lines += ["# [[contact]]", f"# rotor = {text(master)}    # FILL IN: {found}", f"# stator = {text(slave)}    # FILL IN",
                  '# rotation = { axis = "z", centre = [0, 0, 0], rate = 0 }    # FILL IN [rad/s]; or velocity = [0, 0, 0] [m/s]']
    return [*lines, "", "[friction]", "# coefficient = 0.3    # FILL IN [-]"]
