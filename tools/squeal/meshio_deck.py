"""Meshes that meshio reads, to a mesh_model.Model. meshio lists nodes as VTK does."""

import contextlib
import io

import numpy as np
from squeal.deck_files import Problem
from squeal.mesh_model import FLAT, KINDS, Model, Part

CELLS = {"tetra": "tet4", "tetra10": "tet10", "hexahedron": "hex8", "hexahedron20": "hex20", "wedge": "wedge6",
         "hexahedron27": "hex27", "wedge15": "wedge15", "pyramid": "pyramid5", "pyramid13": "pyramid13",
         "triangle": "tri3", "quad": "quad4", "triangle6": "tri6", "quad8": "quad8", "quad9": "quad9"}
LEFT_OUT = ("vertex", "line", "line3")
MOST_VALUES = 100  # of an array of whole numbers that is taken for groups: more are numbers of the elements


def read_any(file):
    import meshio

    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            mesh = meshio.read(file)
    except (Exception, SystemExit) as error:  # meshio raises of every kind, and may exit
        text = " ".join((str(error) if str(error) not in ("", "1") else said.getvalue() or type(error).__name__).split())
        raise Problem(f"{file}: meshio cannot read it: {text[:200]}") from None
    model = Model(file)
    points = np.zeros((len(mesh.points), 3))
    points[:, : mesh.points.shape[1]] = mesh.points
    model.nodes = dict(enumerate(points, 1))
    groups = groups_of(mesh)
    taken = set()
    number = 0
    for block, cells in enumerate(mesh.cells):
        if cells.type in LEFT_OUT:
            continue
        if cells.type not in CELLS:
            raise Problem(f"{file}: cells '{cells.type}': expected {', '.join(CELLS)}")
        first = number + 1
        for nodes in np.asarray(cells.data) + 1:
            number += 1
            model.add_element(str(file), number, CELLS[cells.type], nodes.tolist(), "vtk")
        for name, places in groups.items():
            if len(chosen := places.get(block, ())):
                add_group(model, name, [first + int(i) for i in chosen], CELLS[cells.type], taken)
    for name, nodes in getattr(mesh, "point_sets", {}).items():
        model.node_sets[name] = [int(i) + 1 for i in np.ravel(nodes)]
    for tag, names in getattr(mesh, "point_tags", {}).items():
        nodes = np.flatnonzero(np.asarray(mesh.point_data["point_tags"]) == tag) + 1
        for name in names:
            model.node_sets.setdefault(name, []).extend(nodes.tolist())
    return model


def add_group(model, name, numbers, kind, taken):
    """A group of solids is a part; where it shares elements with one before, it is a group only."""
    if kind in FLAT:
        model.surfaces.setdefault(name, []).extend(model.elements[n][1] for n in numbers)
    elif taken.isdisjoint(numbers):
        model.parts.setdefault(name, Part([])).elements.extend(numbers)
        taken.update(numbers)
    else:
        model.element_sets.setdefault(name, []).extend(numbers)


def groups_of(mesh):
    """{name: {block: places in it}} of sets, of tags with names, and of arrays of few whole numbers."""
    groups = {}
    for name, blocks in (getattr(mesh, "cell_sets", None) or {}).items():
        if not name.startswith("gmsh:"):
            groups[name] = {b: np.asarray(places, int) for b, places in enumerate(blocks) if places is not None and len(places)}
    names = {}  # of tags, by the array that holds them
    for tag, of in getattr(mesh, "cell_tags", {}).items():
        names.setdefault("cell_tags", {})[tag] = of
    for name, (tag, _) in ((name, tuple(np.ravel(v)[:2])) for name, v in (mesh.field_data or {}).items() if np.size(v) >= 2):
        names.setdefault("gmsh:physical", {}).setdefault(int(tag), []).append(name)
    for key, blocks in mesh.cell_data.items():
        arrays = [np.asarray(values) for values in blocks]
        arrays = [values[:, 0] if values.ndim == 2 and values.shape[1] == 1 else values for values in arrays]  # as of the old .vtk
        if any(values.ndim != 1 or values.dtype.kind not in "iu" for values in arrays) or key == "gmsh:geometrical":
            continue
        tags = np.unique(np.concatenate(arrays)) if arrays else []
        if len(tags) > MOST_VALUES:
            continue
        for tag in tags:
            shown = names.get(key, {}).get(int(tag)) or ([] if key in names else [f"{key.replace(':', '_')}_{tag}"])
            for name in shown:
                found = {b: np.flatnonzero(values == tag) for b, values in enumerate(arrays)}
                groups.setdefault(name, {}).update({b: places for b, places in found.items() if len(places)})
    return groups
