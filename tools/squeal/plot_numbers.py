"""Numbers of a scene in words and units, for the axes of pictures: "Young's modulus of pin [Pa]" for part.pin.young."""

import re

WORDS = {"young": "Young's modulus", "poisson": "Poisson's ratio", "inertia": "moment of inertia", "rate": "rotation rate",
         "alpha": "mass-proportional damping", "beta": "stiffness-proportional damping", "at": "position", "file": "file"}
SILENT = ("vector", "value", "rotation", "parameters")  # the words beside them say enough
WHOLE = ("friction", "damping", "mesh", "modes", "cycle", "transient")  # sections that there is one of


def words_of(key, name=""):
    """Of a key of the scene, whose entry of a list may be told by its number or its name. name: what that entry is of."""
    section, *rest = key.split(".")
    if section == "numbers":  # the scene's own words
        return rest[0].replace("_", " ")
    axis = f" along {'xyz'[int(rest.pop())]}" if len(rest) > 1 and rest[-1] in ("0", "1", "2") else ""
    owner = "" if section in WHOLE or not rest else rest[0] if name in ("", key) else name
    inner = rest[1:] if section not in WHOLE else rest
    words = " ".join(WORDS.get(word, word.replace("_", " ")) for word in inner if word not in SILENT and not word.isdigit())
    kind = section.replace("_", " ")
    if section in WHOLE:
        return words if words.endswith(kind) else f"{kind} {words}".strip() + axis
    if not words:  # force, pressure
        return f"{kind} on {owner}{axis}" if owner else kind + axis
    return f"{words}{axis} of {owner}" if section == "part" else f"{words}{axis} of {kind} {owner}".strip()


def axis_label(key, name="", unit="-"):
    return f"{words_of(key, name)} [{unit}]"


def value_of(scene, key):
    """A number of a scene by its key, where entries of lists are told by number or name; None where it is not there."""
    at = scene
    for word in key.split("."):
        if isinstance(at, list):
            named = [entry for entry in at if isinstance(entry, dict) and entry.get("name") == word]
            at = named[0] if named else at[int(word)] if word.isdigit() and int(word) < len(at) else None
        else:
            at = at.get(word) if isinstance(at, dict) else None
    return at if isinstance(at, (int, float)) else None


def unit_of_key(run, key):
    """What the file of the scene with every default says behind a number."""
    file, section, count = run.folder / "resolved.toml", "", {}
    for line in file.read_text().splitlines() if file.exists() else ():
        header = re.fullmatch(r"(\[+)([\w.]+)\]+", line.strip())
        if header:
            section = header[2]
            if header[1] == "[[":
                section += f".{count.setdefault(header[2], 0)}"
                count[header[2]] += 1
        entry = re.match(r"(\w+) = .*# (\S.*)$", line)
        if entry and (key == f"{section}.{entry[1]}" or key.startswith(f"{section}.{entry[1]}.")):
            return entry[2]
    return "-"
