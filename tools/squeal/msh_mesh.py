"""The mesh of a scene, by gmsh's format 4.1, as numbered nodes and groups of elements."""

import re
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from squeal.deck_files import Problem
from squeal.mesh_model import FLAT, KINDS

KIND_OF = {number: kind for kinds in (KINDS, FLAT) for kind, (number, *_) in kinds.items()}
SIZES = {15: 1, 1: 2, 8: 3, **{number: size for kinds in (KINDS, FLAT) for number, _, size, *_ in kinds.values()}}


class Mesh:
    def __init__(self):
        self.nodes = {}  # number: position
        self.blocks = []  # (dimension, names of groups, gmsh's type, rows of nodes)

    def nodes_of(self, name):
        """All nodes of the groups of a name, each once."""
        found = [row.ravel() for _, names, _, row in self.blocks if name in names]
        return np.unique(np.concatenate(found)).tolist() if found else []

    def names(self):
        return sorted({name for _, names, *_ in self.blocks for name in names})


def read_mesh(file, parameters):
    """Geometries are meshed by the program gmsh, and other formats converted by it."""
    if file.suffix == ".msh" and file.read_bytes()[:40].split(b"\n")[1:2] and file.read_bytes()[:40].split(b"\n")[1].startswith(b"4.1 0"):
        return parsed(file)
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / "mesh.msh"
        numbers = [word for name, value in parameters.items() for word in ("-setnumber", name, repr(value))]
        action = ["-3"] if file.suffix in (".geo", ".step", ".stp") else ["-save"]
        command = ["gmsh", str(file), *action, *numbers, "-format", "msh41", "-o", str(made), "-v", "1"]
        try:
            done = subprocess.run(command, capture_output=True, text=True)
        except FileNotFoundError:
            raise Problem("there is no program gmsh; tools/setup installs it") from None
        if done.returncode or not made.exists():
            said = (done.stderr or done.stdout).strip().splitlines()
            raise Problem(f"{file}: gmsh makes no mesh of it: {said[-1] if said else 'it says nothing'}")
        return parsed(made)


def parsed(file):
    sections = dict(re.findall(r"\$(\w+)\n(.*?)\n\$End\1", file.read_text(errors="replace"), flags=re.S))
    try:
        names = {}
        for line in sections.get("PhysicalNames", "0").splitlines()[1:]:
            dimension, tag, name = line.split(None, 2)
            names[int(dimension), int(tag)] = name.strip('"')
        groups = groups_of_entities(sections["Entities"], names)
        mesh = Mesh()
        read_nodes(sections["Nodes"], mesh)
        read_blocks(sections["Elements"], groups, mesh)
    except (KeyError, ValueError, IndexError) as error:
        raise Problem(f"{file}: not as gmsh's format 4.1: {error}") from None
    return mesh


def groups_of_entities(text, names):
    rows = [line.split() for line in text.splitlines()]
    counts, at, groups = [int(word) for word in rows[0]], 1, {}
    for dimension, count in enumerate(counts):
        for row in rows[at : at + count]:
            first = 4 if dimension == 0 else 7
            tags = [abs(int(word)) for word in row[first + 1 : first + 1 + int(row[first])]]
            groups[dimension, int(row[0])] = tuple(names.get((dimension, tag), f"{tag}") for tag in tags)
        at += count
    return groups


def read_nodes(text, mesh):
    rows, at = text.splitlines(), 1
    while at < len(rows):
        count = int(rows[at].split()[3])
        labels = rows[at + 1 : at + 1 + count]
        for label, line in zip(labels, rows[at + 1 + count : at + 1 + 2 * count]):
            mesh.nodes[int(label)] = tuple(float(word) for word in line.split()[:3])
        at += 1 + 2 * count


def read_blocks(text, groups, mesh):
    rows, at = text.splitlines(), 1
    while at < len(rows):
        dimension, entity, kind, count = (int(word) for word in rows[at].split())
        names = groups.get((dimension, entity), ())
        if names:
            if kind not in SIZES:
                raise ValueError(f"elements of type {kind} in {names[0]}")
            cells = np.array([row.split() for row in rows[at + 1 : at + 1 + count]], np.int64)
            mesh.blocks.append((dimension, names, kind, cells[:, 1:]))
        at += 1 + count
