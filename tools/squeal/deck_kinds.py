"""Which reader a deck belongs to, by what it holds, and what is done with every model."""

import re

from squeal.abaqus_deck import read_inp
from squeal.ansys_deck import read_cdb
from squeal.deck_files import Problem
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
        told = sorted(model.notes, key=lambda note: " of type " not in note and "the cards" not in note)[:3]
        raise Problem(f"{file}: no solid and no shell elements" + (f"; left out are {'; '.join(told)}" if told else ""))
    model.add_parts_of_the_rest("body")
    model.drop_loose_nodes()
    model.drop_idle_supports()
    model.separate_names()
    model.name_faces_of_node_sets()
    model.drop_ties_without_faces()
    if not model.parts and not any(model.surfaces.values()):
        raise Problem(f"{file}: no solid elements, and no shells with a property")
    return model
