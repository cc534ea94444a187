"""Which reader a deck belongs to, by what it holds, and what is done with every model."""

import re

import numpy as np
from squeal.abaqus_deck import read_inp
from squeal.ansys_deck import read_cdb
from squeal.common import counted
from squeal.deck_checks import check_model
from squeal.deck_files import Problem
from squeal.mesh_model import FLAT, KINDS, Part
from squeal.nastran_deck import read_bdf
from squeal.step_deck import read_step
from squeal.unv_deck import read_unv

# what a line of the beginning looks like, and how many of its like are there at most before the reader is chosen
SIGNS = {
    "abaqus": re.compile(r"^\*(HEADING|NODE|ELEMENT|PART|INCLUDE|PREPRINT|NSET|SURFACE|MATERIAL|SYSTEM|ASSEMBLY)\b", re.I),
    "ansys": re.compile(r"^(/PREP7|/COM|/NOPR|NBLOCK|EBLOCK|ET\s*,|CMBLOCK|MPDATA)", re.I),
    "nastran": re.compile(r"^(BEGIN BULK|SOL\s+\d+|CEND|GRID[\s*,]|CHEXA|CTETRA|MAT1[\s*,]|PSOLID|SUBCASE|CORD2|INCLUDE\s*['\"])", re.I),
    "unv": re.compile(r"^\s+-1\s*$"),
    "step": re.compile(r"^ISO-10303-21"),
}
READERS = {"abaqus": read_inp, "ansys": read_cdb, "nastran": read_bdf, "unv": read_unv}
LINES = 5000  # of the beginning that are looked at
ENDINGS = {".inp": "abaqus", ".bdf": "nastran", ".nas": "nastran", ".dat": "nastran", ".fem": "nastran", ".cdb": "ansys",
           ".unv": "unv", ".step": "step", ".stp": "step"}


def kind_of(file):
    """The code that a text file is of; what the ending says where no line says it, and "" for others."""
    with open(file, "rb") as stream:
        head = stream.read(400_000)
    if b"\0" in head[:4096]:
        return ""
    found = dict.fromkeys(SIGNS, 0)
    for line in head.decode("latin-1").splitlines()[:LINES]:
        for kind, sign in SIGNS.items():
            found[kind] += bool(sign.match(line))
    best = max(found, key=found.get)
    return best if found[best] else ENDINGS.get(file.suffix.lower(), "")


@np.errstate(invalid="ignore", over="ignore")  # of numbers beyond all sizes, which are refused by a message
def read_deck(file, size=0.0):
    if not file.is_file():
        raise Problem(f"there is no file {file}")
    kind = kind_of(file)
    if kind in READERS:
        return finished(READERS[kind](file), file)
    if kind == "step":
        return finished(read_step(file, size), file)
    from squeal import common

    common.needs("meshio")
    from squeal.meshio_deck import read_any

    return finished(read_any(file), file)


def finished(model, file):
    """Parts of all solids, groups with names of their own, faces where contacts and couplings need them."""
    if not model.elements:
        raise Problem(f"{file}: no solid and no shell elements{told(model)}")
    model.add_parts_of_the_rest("body")
    model.drop_loose_nodes()
    model.drop_idle_supports()
    model.separate_names()
    model.name_faces_of_node_sets()
    model.drop_ties_without_faces()
    split_orders(model)
    check_model(model)
    gap_contacts_without_faces(model)
    turn_supports_on_axes(model)
    if not model.parts:
        raise Problem(f"{file}: no solid elements, and no shells with a property{told(model)}")
    return model


def told(model):
    """What was left out, elements first."""
    notes = sorted(model.notes, key=lambda note: " of type " not in note and "the cards" not in note)[:3]
    return f"; left out are {'; '.join(notes)}" if notes else ""


def split_orders(model):
    """A part has elements of one order; those of the other are a part of their own."""
    for name, part in list(model.parts.items()):
        linear = [n for n in part.elements if len(model.elements[n][1]) == len_of_corners(model, n)]
        if 0 < len(linear) < len(part.elements):
            shown, taken = model.unused(f"{name}_linear"), set(linear)
            model.notes.append(f"that {counted(len(linear), 'element')} of {name} are linear beside quadratic ones: they are the part {shown}")
            model.parts[shown] = Part(linear, part.material, part.thickness, part.offset)
            model.parts[shown].axes, model.parts[shown].place = part.axes, part.place
            part.elements = [n for n in part.elements if n not in taken]


def len_of_corners(model, number):
    kind = model.elements[number][0]
    return (KINDS.get(kind) or FLAT[kind])[1]


def gap_contacts_without_faces(model):
    """A side that is a set of nodes without faces is a gap that is to be filled."""
    for i, (*sides, keys) in enumerate(model.contacts):
        shown = [name if name in model.surfaces or name.startswith("FILL IN") else
                 f"FILL IN [a surface]: {name} of the deck covers no faces of its elements" for name in sides]
        model.contacts[i] = (*shown, keys)


def turn_supports_on_axes(model):
    """Nodes on the axis of a cylinder have no radial direction: they are held along the axis, and across it where all is held."""
    for name, motions, keys in list(model.supports):
        if "cylinder" not in keys:
            continue
        axis, centre = (np.array(keys["cylinder"][key], float) for key in ("axis", "centre"))
        axis /= np.linalg.norm(axis)
        nodes = model.node_sets.get(name) or sorted({n for face in model.surfaces[name] for n in face})
        arms = np.array([model.nodes[n] for n in nodes]) - centre
        near = np.linalg.norm(np.cross(arms, axis), axis=1) <= 1e-9 * max(1e-300, np.abs(arms).max())
        if not near.any():
            continue
        pairs = [({"x", "y"}, keys.get("displacement", ())), ({"rx", "ry"}, keys.get("rotation", ()))]
        lost = [m for m in motions for pair, moved in pairs if m in pair and (not pair <= set(motions) or any(moved[:2]))]
        at = [n for n, on in zip(nodes, near) if on]
        if lost:
            model.notes.append(f"the motions {' '.join(lost)} of {counted(len(at), 'node')} of {name} on the axis of its cylinder, where none is radial")
        across = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
        across /= np.linalg.norm(across)
        others = {key: of for key, of in keys.items() if key != "cylinder"} | {"axis_1": across.tolist(), "axis_2": np.cross(axis, across).tolist()}
        for title, of, held, more in ((name + "_off_axis", [n for n, on in zip(nodes, near) if not on], motions, keys),
                                      (name + "_on_axis", at, [m for m in motions if m not in lost], others)):
            if of and held:
                shown = model.unused(title)
                model.node_sets[shown] = of
                model.supports.append((shown, held, more))
        model.supports.remove((name, motions, keys))
