"""Geometries of STEP files, meshed by gmsh's OpenCASCADE, to a mesh_model.Model: a part for each solid by its name, a surface
for each of its faces."""

import re
import tempfile
from pathlib import Path

import numpy as np
from squeal.deck_files import Problem
from squeal.mesh_model import FLAT, KINDS, Model, Part
from squeal.msh_mesh import KIND_OF, read_mesh

GEOMETRY = """SetFactory("OpenCASCADE");
v() = ShapeFromFile("{file}");
For i In {{0 : #v() - 1}}
  Physical Volume(Sprintf("body_%g", i + 1)) = {{v(i)}};
  f() = Boundary{{ Volume{{v(i)}}; }};
  For j In {{0 : #f() - 1}}
    Physical Surface(Sprintf("body_%g_face_%g", i + 1, j + 1)) = {{Abs(f(j))}};
  EndFor
EndFor
MeshSize{{ PointsOf{{ Volume{{:}}; }} }} = {size!r};
Mesh.MeshSizeMax = {size!r};
Mesh.ElementOrder = 2;
"""


def read_step(file, size):
    """Tetrahedra of 10 nodes and of this size, in the file's unit as gmsh takes it, which is mm."""
    if not size > 0:
        raise Problem(f"{file}: a geometry, of which a mesh is to be made: give --size, the size of its elements in mm")
    if '"' in str(file.resolve()):
        raise Problem(f"{file}: a path with a quotation mark, which gmsh cannot read: give it another name")
    with tempfile.TemporaryDirectory() as folder:
        geometry = Path(folder) / "bodies.geo"
        geometry.write_text(GEOMETRY.format(file=file.resolve(), size=size))
        mesh = read_mesh(geometry, {})
    model = Model(file)
    model.nodes = {n: np.array(at) for n, at in mesh.nodes.items()}
    shown, label = names_of_bodies(file, mesh), 0
    for dimension, names, kind, cells in mesh.blocks:
        for name in names:
            body, _, face = name.partition("_face_")
            name = shown.get(body, body) + (f"_face_{face}" if face else "")
            if dimension == 2 and KIND_OF.get(kind) in FLAT:
                model.surfaces.setdefault(name, []).extend(map(tuple, cells.tolist()))
            elif KIND_OF.get(kind) in KINDS:
                part = model.parts.setdefault(name, Part([]))
                for nodes in cells.tolist():
                    label += 1
                    model.elements[label] = (KIND_OF[kind], tuple(nodes))
                    part.elements.append(label)
    return model


def names_of_bodies(file, mesh):
    """Names of solids in the order of the file, where each has one of its own."""
    text = file.read_text(encoding="latin-1")
    names = re.findall(r"MANIFOLD_SOLID_BREP\s*\(\s*'([^']*)'", text)
    bodies = [name for name in mesh.names() if re.fullmatch(r"body_\d+", name)]
    clean = [re.sub(r"[\"\s,]+", "_", name).strip("_") for name in names]
    if len(set(clean)) != len(bodies) or not all(clean):
        return {}
    return {f"body_{i}": name for i, name in enumerate(clean, 1)}


def table_of_faces(model, length):
    """A line a surface: its name, middle and area, in SI."""
    lines = []
    for name, faces in model.surfaces.items():
        area, middle = 0.0, np.zeros(3)
        for face in faces:
            a, b, c = (model.nodes[n] for n in face[:3])
            size = np.linalg.norm(np.cross(b - a, c - a)) / 2
            area, middle = area + size, middle + size * (a + b + c) / 3
        x, y, z = middle / (area or 1) * length
        lines.append(f"{name}: middle {x:.6g}, {y:.6g}, {z:.6g} m, area {area * length**2:.6g} m2")
    return lines
