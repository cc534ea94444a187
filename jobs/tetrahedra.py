#!/usr/bin/env python3
"""Splits the bricks of a mesh of extruded layers into 10-node tetrahedra with the same flat faces; shells stay.

    jobs/tetrahedra.py bricks.msh tetrahedra.msh

Reads and writes gmsh's format 2.2 in text, as `gmsh -3 -format msh22 brake.geo` makes it. Layers are along z. Faces in
contact that match go on matching: their quadrilaterals are cut from the corner that comes first in x, then in y.
"""

import sys

import numpy as np

BRICK, QUAD, TETRAHEDRON10, TRIANGLE6 = 5, 3, 11, 9
SIDES = {TETRAHEDRON10: ((0, 1), (1, 2), (0, 2), (0, 3), (2, 3), (1, 3)), TRIANGLE6: ((0, 1), (1, 2), (2, 0))}


def triangles(quad, rank):
    """Of a quadrilateral (4), cut from its first corner in `rank`: as numbers of its corners."""
    i = int(np.argmin(rank[quad]))
    return [(i, (i + 1) % 4, (i + 2) % 4), (i, (i + 2) % 4, (i + 3) % 4)]


def tetrahedra(low, high, rank):
    """Of a wedge between two triangles: each side is cut from its first corner in `rank` (Dompierre et al. 1999)."""
    if rank[low].min() > rank[high].min():
        low, high = high, low
    first = int(np.argmin(rank[low]))
    (a, b, c), (d, e, f) = np.roll(low, -first), np.roll(high, -first)
    if min(rank[b], rank[f]) < min(rank[c], rank[e]):
        return [(a, b, c, f), (a, b, e, f), (a, d, e, f)]
    return [(a, b, c, e), (a, c, e, f), (a, d, e, f)]


def split(x, elements):
    """Elements (type, groups, nodes) with bricks and their faces replaced, and the positions with mid-sides added."""
    rank = np.empty(len(x), int)
    rank[np.lexsort((np.arange(len(x)), *np.round(x.T[::-1], 9)))] = np.arange(len(x))
    faces = {tuple(sorted(nodes[list(face)])) for kind, _, nodes in elements if kind == BRICK
             for face in ((0, 1, 2, 3), (4, 5, 6, 7))}
    cut = []
    for kind, groups, nodes in elements:
        if kind == BRICK:
            if np.ptp(x[nodes[:4], 2]) > 1e-9 or np.ptp(x[nodes[4:], 2]) > 1e-9:
                sys.exit("tetrahedra.py: a brick has no faces of constant z: extrude the mesh along z")
            for triangle in triangles(nodes[:4], rank):
                wedge = nodes[list(triangle)], nodes[4 + np.array(triangle)]
                cut += [(TETRAHEDRON10, groups, corners) for corners in tetrahedra(*wedge, rank)]
        elif kind == QUAD and tuple(sorted(nodes)) in faces:
            cut += [(TRIANGLE6, groups, nodes[list(triangle)]) for triangle in triangles(nodes, rank)]
        else:
            cut.append((kind, groups, nodes))
    middle, result = {}, []
    for kind, groups, nodes in cut:
        mid = [middle.setdefault(tuple(sorted((nodes[a], nodes[b]))), len(x) + len(middle)) for a, b in SIDES.get(kind, ())]
        result.append((kind, groups, [*nodes, *mid]))
    ends = np.array(list(middle))
    return np.concatenate([x, x[ends].mean(axis=1)]), result


def main(source, target):
    lines = open(source).read().splitlines()
    start = lines.index("$Nodes")
    rows = [line.split() for line in lines[start + 2:lines.index("$EndNodes")]]
    number = {int(row[0]): i for i, row in enumerate(rows)}
    x = np.array([row[1:4] for row in rows], float)
    rows = [list(map(int, line.split())) for line in lines[lines.index("$Elements") + 2:lines.index("$EndElements")]]
    elements = [(row[1], row[2:3 + row[2]], np.array([number[n] for n in row[3 + row[2]:]])) for row in rows]
    x, elements = split(x, elements)
    text = lines[:start] + ["$Nodes", str(len(x))] + [f"{i} {a!r} {b!r} {c!r}" for i, (a, b, c) in enumerate(x.tolist(), 1)]
    text += ["$EndNodes", "$Elements", str(len(elements))]
    text += [" ".join(map(str, [i, kind, *groups, *(int(n) + 1 for n in nodes)])) for i, (kind, groups, nodes) in
             enumerate(elements, 1)]
    with open(target, "w") as file:
        file.write("\n".join(text + ["$EndElements", ""]))


if __name__ == "__main__":
    main(*sys.argv[1:])
