"""Models of the tests, written as a user would bring them: gmsh meshes, matrix folders, states, scene files."""

import json
import struct
from itertools import permutations

import numpy as np

STEEL = {"young": 210e9, "poisson": 0.3, "density": 7850}

# gmsh's element types: number and dimension
KINDS = {"point": (15, 0), "line": (1, 1), "triangle": (2, 2), "quad": (3, 2), "brick": (5, 3), "wedge": (6, 3),
         "brick20": (17, 3), "quad8": (16, 2), "tetrahedron": (4, 3), "triangle6": (9, 2), "tetrahedron10": (11, 3),
         "quad9": (10, 2), "brick27": (12, 3), "wedge15": (18, 3), "pyramid": (7, 3), "pyramid13": (19, 3)}


class Mesh:
    """Nodes and named groups of elements, written in gmsh's format 2.2. Coincident nodes stay apart."""

    def __init__(self):
        self.nodes, self.groups = [], {}

    def add_nodes(self, positions):
        """Appends an array (..., 3) of positions and returns the array (...) of their numbers."""
        positions = np.asarray(positions, float)
        first, shape = len(self.nodes), positions.shape[:-1]
        self.nodes.extend(positions.reshape(-1, 3))
        return first + np.arange(np.prod(shape, dtype=int)).reshape(shape)

    def add(self, name, kind, elements):
        self.groups.setdefault((name, kind), []).extend(np.atleast_2d(elements))

    def add_points(self, name, nodes):
        self.add(name, "point", np.reshape(nodes, (-1, 1)))

    def write(self, file):
        tags = {}  # of each name in each dimension
        for name, kind in self.groups:
            tags.setdefault((KINDS[kind][1], name), len(tags) + 1)
        lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", str(len(tags))]
        lines += [f'{dimension} {tag} "{name}"' for (dimension, name), tag in tags.items()]
        lines += ["$EndPhysicalNames", "$Nodes", str(len(self.nodes))]
        lines += [f"{i} {x!r} {y!r} {z!r}" for i, (x, y, z) in enumerate(np.array(self.nodes).tolist(), 1)]
        lines += ["$EndNodes", "$Elements", str(sum(map(len, self.groups.values())))]
        number = 0
        for (name, kind), elements in self.groups.items():
            tag = tags[KINDS[kind][1], name]
            for element in elements:
                number += 1
                lines.append(f"{number} {KINDS[kind][0]} 2 {tag} {tag} " + " ".join(str(n + 1) for n in element))
        file.write_text("\n".join(lines + ["$EndElements", ""]))


def lattice(divisions, place):
    """Positions place(a, b, …) of the points a/n, b/m, … of the unit square or cube, as an array (n+1, m+1, …, 3)."""
    unit = np.meshgrid(*[np.linspace(0, 1, n + 1) for n in divisions], indexing="ij")
    return np.stack(np.broadcast_arrays(*place(*unit)), axis=-1)


def quads(nodes):
    """4-node cells of a lattice (n+1, m+1) of node numbers; a lattice of more dimensions gives as many layers."""
    return np.stack([nodes[:-1, :-1], nodes[1:, :-1], nodes[1:, 1:], nodes[:-1, 1:]], axis=-1).reshape(-1, 4)


def bricks(nodes):
    """8-node cells of a lattice (n+1, m+1, l+1) of node numbers."""
    return np.hstack([quads(nodes[:, :, :-1]), quads(nodes[:, :, 1:])])


def bricks20(nodes):
    """20-node cells, gmsh's order of mid-sides, of a lattice of twice as many divisions; some of its nodes are unused."""
    corners = [(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2), (0, 2, 2)]
    edges = [(0, 1), (0, 3), (0, 4), (1, 2), (1, 5), (2, 3), (2, 6), (3, 7), (4, 5), (4, 7), (5, 6), (6, 7)]
    places = corners + [tuple((np.array(corners[a]) + corners[b]) // 2) for a, b in edges]
    n = [size - 2 for size in nodes.shape]
    return np.stack([nodes[i:n[0] + i:2, j:n[1] + j:2, k:n[2] + k:2].ravel() for i, j, k in places], axis=-1)


def _simplices(nodes, edges):
    """Cells of two nodes a side, each cut into simplices along the diagonal from its first corner to its last: corners,
    then the middles of `edges`. Neighbours share their diagonals."""
    n, axes = [size - 2 for size in nodes.shape], np.eye(nodes.ndim, dtype=int)
    cells = []
    for order in permutations(range(nodes.ndim)):
        corners = 2 * np.cumsum([0 * axes[0], *axes[list(order)]], axis=0)
        if np.linalg.det(axes[list(order)]) < 0:
            corners[[-2, -1]] = corners[[-1, -2]]
        places = np.concatenate([corners, [(corners[a] + corners[b]) // 2 for a, b in edges]])
        cells.append(np.stack([nodes[tuple(slice(i, k + i, 2) for i, k in zip(place, n))].ravel() for place in places],
                              axis=-1))
    return np.concatenate(cells)


def tetrahedra10(nodes):
    """10-node tetrahedra in gmsh's order, six a cell, of a lattice of twice as many divisions."""
    return _simplices(nodes, ((0, 1), (1, 2), (0, 2), (0, 3), (2, 3), (1, 3)))


def triangles6(nodes):
    """6-node triangles, two a cell, of a lattice of twice as many divisions: the faces of tetrahedra10."""
    return _simplices(nodes, ((0, 1), (1, 2), (2, 0)))


# Corners of the faces of each shape in gmsh's order, and the corners round the nodes between them (gmsh's manual).
BRICK_FACES = [(0, 3, 2, 1), (0, 1, 5, 4), (0, 4, 7, 3), (1, 2, 6, 5), (2, 3, 7, 6), (4, 5, 6, 7)]
BRICK_EDGES = [(0, 1), (0, 3), (0, 4), (1, 2), (1, 5), (2, 3), (2, 6), (3, 7), (4, 5), (4, 7), (5, 6), (6, 7)]
TET_FACES, TET_EDGES = [(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)], [(0, 1), (1, 2), (2, 0), (3, 0), (3, 2), (3, 1)]
WEDGE_FACES = [(0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)]
WEDGE_EDGES = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 4), (2, 5), (3, 4), (3, 5), (4, 5)]
PYRAMID_FACES = [(0, 1, 4), (3, 0, 4), (1, 2, 4), (2, 3, 4), (0, 3, 2, 1)]
PYRAMID_EDGES = [(0, 1), (0, 3), (0, 4), (1, 2), (1, 4), (2, 3), (2, 4), (3, 4)]
SHAPES = {"brick": (BRICK_FACES, []), "brick20": (BRICK_FACES, BRICK_EDGES), "tetrahedron": (TET_FACES, []),
          "tet10": (TET_FACES, TET_EDGES), "wedge": (WEDGE_FACES, []), "wedge15": (WEDGE_FACES, WEDGE_EDGES),
          "pyramid": (PYRAMID_FACES, []), "pyramid13": (PYRAMID_FACES, PYRAMID_EDGES),
          "brick27": (BRICK_FACES, [*BRICK_EDGES, *BRICK_FACES, tuple(range(8))])}
# A cell of four divisions a side, its corners and its middle, and how it is cut.
CELL = np.array([(0, 0, 0), (4, 0, 0), (4, 4, 0), (0, 4, 0), (0, 0, 4), (4, 0, 4), (4, 4, 4), (0, 4, 4), (2, 2, 2)])
WHOLE, WEDGES = [tuple(range(8))], [(0, 1, 2, 4, 5, 6), (0, 2, 3, 4, 6, 7)]
TETS = [(0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)]
PYRAMIDS = [(0, 1, 2, 3, 8), (0, 4, 5, 1, 8), (0, 3, 7, 4, 8), (5, 6, 2, 1, 8), (2, 6, 7, 3, 8), (4, 7, 6, 5, 8)]


def cell_at(place, cut, shape, nodes):
    """The nodes of an element in the cell at a place of a lattice of four times as many divisions."""
    corners = 4 * np.array(place) + CELL[list(cut)]
    return [nodes[tuple(at)] for at in (*corners, *(corners[list(of)].mean(axis=0).astype(int) for of in SHAPES[shape][1]))]


def cells_of(shape, cuts, nodes):
    """Elements of one shape in all cells of a lattice of four times as many divisions."""
    return np.array([cell_at(place, cut, shape, nodes) for place in np.ndindex(*((n - 1) // 4 for n in nodes.shape)) for cut in cuts])


def closed(nodes):
    """A lattice whose last row is its first: a ring."""
    return np.concatenate([nodes[:-1], nodes[:1]])


def _value(value):
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_value(entry)}" for key, entry in value.items()) + " }"
    if isinstance(value, (list, tuple, np.ndarray)):
        return "[" + ", ".join(_value(entry) for entry in value) + "]"
    return json.dumps(value.item() if isinstance(value, np.generic) else value)


def write_scene(folder, **tables):
    """scene.toml of tables: a dict is a table, a list of dicts a list of tables, anything else a value."""
    values = [f"{name} = {_value(table)}" for name, table in tables.items() if not isinstance(table, (dict, list))]
    text = ["\n".join(values)]
    for name, table in tables.items():
        if isinstance(table, (dict, list)):
            for head, entry in [(f"[{name}]", table)] if isinstance(table, dict) else [(f"[[{name}]]", t) for t in table]:
                text.append("\n".join([head] + [f"{key} = {_value(value)}" for key, value in entry.items()]))
    file = folder / "scene.toml"
    file.write_text("\n\n".join(text) + "\n")
    return file


def _vector(values):
    values = np.atleast_1d(np.asarray(values, float))
    return struct.pack(">ii", 1211214, len(values)) + values.astype(">f8").tobytes()


def write_state(file, u, v):
    """Displacements and velocities to start a transient from."""
    file.write_bytes(_vector(u) + _vector(v))
    return file


def write_sparse(file, A):
    """PETSc's binary format of a matrix."""
    A = np.atleast_2d(np.asarray(A, float))
    rows = [np.flatnonzero(row) for row in A]
    data = struct.pack(">iiii", 1211216, *A.shape, sum(map(len, rows)))
    data += np.array([len(row) for row in rows], ">i4").tobytes() + np.concatenate(rows).astype(">i4").tobytes()
    file.write_bytes(data + A[A != 0].astype(">f8").tobytes())


def write_matrices(folder, B, gap, drive, F, **matrices):
    """The folder of a matrix scene: M, C and K by name."""
    folder.mkdir()
    for name, A in dict(matrices, B=B).items():
        write_sparse(folder / f"{name}.petsc", A)
    for name, values in {"gap": gap, "drive": drive, "F": F}.items():
        (folder / f"{name}.petsc").write_bytes(_vector(values))
    return folder


def sticking_slider(folder, friction, **tables):
    """Three degrees of freedom on one pair, whose friction falls with speed: the cycle sticks once a period."""
    write_matrices(folder / "m", [[-0.855495989, -0.146312857, -0.496708326], [-0.005258296, -0.956745071, 0.290880076]], [0],
                   [0.953932671], [0.705351327, -0.186085676, 0.444300888], M=np.diag([0.993734116, 1.550371814, 1.63931418]),
                   C=[[0.013519347, 7.0115e-05, 0.000374628], [7.0115e-05, 0.020475594, -0.000142082],
                      [0.000374628, -0.000142082, 0.021033343]],
                   K=[[0.679804879, 0.026241817, 0.140211969], [0.026241817, 0.829827935, -0.053176898],
                      [0.140211969, -0.053176898, 0.646545324]])
    return write_scene(folder, matrices={"folder": "m"}, modes={"band": 20.0}, estimate={"enabled": False},
                       friction={"static_coefficient": 4.314953387, "decay_speed": 1.155236965, **friction}, **tables)


def write_coexistence(folder, friction, cycle, **tables):
    """Four degrees of freedom on two pairs. Between mu = 0.45 and 0.5 equilibrium and a cycle attract: slip that reverses makes
    the cycle, which a small motion never reaches."""
    B = [[-0.452, 0.509, -0.503, -0.532], [-0.425, -0.115, -0.514, 0.737], [0.78, 0.143, -0.608, 0.048], [0.084, 0.841, 0.337, 0.415]]
    K = np.array([[0.703, -0.02, -0.257, 0.015], [0, 0.175, -0.036, 0.02], [0, 0, 2.853, -0.101], [0, 0, 0, 0.1186]])
    C = 1e-3 * np.array([[6.32, -0.0865, -1.105, 0.0613], [0, 1.291, -0.134, 0.0803], [0, 0, 23.2, -0.428], [0, 0, 0, 1.058]])
    write_matrices(folder / "matrices", np.array(B), [0.0, 0.0], [0.8746, -0.209], [-0.412, -0.492, 0.923, 0.33],
                   M=np.diag([0.3, 0.05, 1, 0.05]), C=C + np.triu(C, 1).T, K=K + np.triu(K, 1).T)
    return write_scene(folder, matrices={"folder": "matrices"}, friction=friction, modes={"band": 0.36},
                       cycle={"steps_per_period": 128, **cycle}, **tables)


BLOCK_ON_PLATE = """Mesh.ElementOrder = 1;
Point(1) = {-0.06, -0.02, 0}; Point(2) = {0.06, -0.02, 0}; Point(3) = {0.06, 0.02, 0}; Point(4) = {-0.06, 0.02, 0};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4}; Plane Surface(1) = {1};
Transfinite Curve{1, 3} = 7; Transfinite Curve{2, 4} = 3; Transfinite Surface{1}; Recombine Surface{1};
plate[] = Extrude {0, 0, -0.008} { Surface{1}; Layers{2}; Recombine; };
z = 0.5; // apart, so that the contact faces share no nodes
Point(101) = {-0.01, -0.01, z}; Point(102) = {0.01, -0.01, z}; Point(103) = {0.01, 0.01, z}; Point(104) = {-0.01, 0.01, z};
Line(101) = {101, 102}; Line(102) = {102, 103}; Line(103) = {103, 104}; Line(104) = {104, 101};
Curve Loop(101) = {101, 102, 103, 104}; Plane Surface(101) = {101};
Transfinite Curve{101, 102, 103, 104} = 3; Transfinite Surface{101}; Recombine Surface{101};
block[] = Extrude {0, 0, 0.02} { Surface{101}; Layers{2}; Recombine; };
Geometry.AutoCoherence = 0;
Translate {0, 0, -z} { Volume{block[1]}; }
Physical Volume("plate") = plate[1];
Physical Volume("block") = block[1];
Physical Surface("plate_face") = 1;
Physical Surface("plate_end") = {plate[3], plate[5]};
Physical Surface("block_face") = 101;
Physical Surface("block_back") = block[0];
"""


def write_block_on_plate(folder):
    """A scene of 190 degrees of freedom and 9 pairs, a soft block on a clamped plate that slides below it, whose contact
    hits hard: its cycles have multipliers that no model with few shapes has."""
    (folder / "plate.geo").write_text(BLOCK_ON_PLATE)
    (folder / "scene.toml").write_text("""
mesh = { file = "plate.geo" }
part = [ { name = "plate", young = 210e9, poisson = 0.3, density = 7850 },
         { name = "block", young = 3e9, poisson = 0.25, density = 4000 } ]
support = [ { on = "plate_end", fixed = "all" } ]
rigid_body = [ { name = "holder", surfaces = "block_back", at = [0, 0, 0.02], mass = 0.1, free = "z" } ]
force = [ { on = "holder", vector = [0, 0, -100] } ]
contact = [ { rotor = "plate_face", stator = "block_face", velocity = [1, 0, 0] } ]
friction = { coefficient = 0.46 }
damping = { beta = 2e-7 }
modes = { band = 12000 }
probe = [ { name = "b", on = "block_face", at = [0, 0, 0], direction = "x" } ]
cycle = { enabled = true, steps_per_period = 64 }
""")
    return folder / "scene.toml"
