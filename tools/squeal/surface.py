"""The outer surface of a mesh, from XDMF's mixed topology: its faces, areas and normals, and the part of a face that
belongs to each of its nodes."""

import numpy as np

# Faces of each solid, by its corners in the order of the file, which turn round the outward normal.
HEX = ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))
WEDGE = ((0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5))
PYRAMID = ((0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4))
TETRA = ((0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3))
HEX_EDGES = ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7))
TETRA_EDGES = ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))
WEDGE_EDGES = ((0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5))
PYRAMID_EDGES = ((0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 4), (2, 4), (3, 4))
# Solids by XDMF's code: number of nodes, faces, edges that have a mid-side node.
SOLIDS = {9: (8, HEX, ()), 48: (20, HEX, HEX_EDGES), 50: (27, HEX, HEX_EDGES), 8: (6, WEDGE, ()), 40: (15, WEDGE, WEDGE_EDGES),
          41: (18, WEDGE, WEDGE_EDGES), 7: (5, PYRAMID, ()), 39: (13, PYRAMID, PYRAMID_EDGES), 6: (4, TETRA, ()), 38: (10, TETRA, TETRA_EDGES)}
SHELLS = {5: 4, 4: 3, 36: 6, 37: 8, 35: 9}  # number of nodes
VTK = {9: 12, 48: 25, 50: 29, 8: 13, 40: 26, 41: 32, 7: 14, 39: 27, 6: 10, 38: 24, 5: 9, 4: 5, 36: 22, 37: 23, 35: 28}  # its number of each kind; the order of nodes is the same
POINT = 1  # its number of nodes follows


def elements(topology):
    """Code and nodes of every element that is not a point."""
    at = 0
    while at < len(topology):
        code, at = int(topology[at]), at + 1
        if code == POINT:
            at += 1 + int(topology[at])
            continue
        count = SHELLS[code] if code in SHELLS else SOLIDS[code][0]
        yield code, topology[at : at + count].tolist()
        at += count


def _rim(code, nodes):
    """The nodes round each face of a solid, mid-side ones between their corners."""
    _, faces, edges = SOLIDS[code]
    corners = len({k for face in faces for k in face})
    middle = {frozenset(edge): nodes[corners + k] for k, edge in enumerate(edges)}
    for face in faces:
        rim = []
        for a, b in zip(face, (*face[1:], face[0])):
            rim.append(nodes[a])
            if edges:
                rim.append(middle[frozenset((a, b))])
        yield rim


def _shell_rim(nodes):
    """The nodes round a shell, mid-side ones between their corners."""
    corners = 3 if len(nodes) in (3, 6) else 4
    return nodes if len(nodes) == corners else [n for k in range(corners) for n in (nodes[k], nodes[corners + k])]


def outer(elements):
    """Faces of the outer surface of these elements, each as the nodes round it: those of one solid only, outward; and shells."""
    shells, met = [], {}
    for code, nodes in elements:
        if code in SHELLS:
            shells.append(_shell_rim(nodes))
            continue
        for rim in _rim(code, nodes):
            met.setdefault(frozenset(rim), []).append(rim)
    return [twins[0] for twins in met.values() if len(twins) == 1], shells


def faces(topology):
    """Those of the whole mesh."""
    return outer(elements(topology))


def by_part(topology, part):
    """Elements of each part, by its index. part: that of every element, points included, which have -1."""
    found = {}
    for number, element in zip(part[part >= 0].tolist(), elements(topology)):
        found.setdefault(number, []).append(element)
    return found


def volume(elements, nodes, thickness):
    """Of solids, by the cones from one of their corners to their faces, and of shells of this thickness [m3]."""
    total = 0.0
    for code, of in elements:
        if code in SHELLS:
            a, b, c = np.moveaxis(triangles(nodes[_shell_rim(of)]), 1, 0)
            total += thickness * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
            continue
        for rim in _rim(code, of):
            a, b, c = np.moveaxis(triangles(nodes[rim] - nodes[of[0]]), 1, 0)
            total += (a * np.cross(b, c)).sum() / 6
    return total


def turns(elements, nodes):
    """Angles [rad] between the normals of flat faces of the outer surface that share a side: where round parts are meshed by chords."""
    met, solids = {}, list(elements)
    corners_of = {code: len({k for face in faces for k in face}) for code, (_, faces, _) in SOLIDS.items()}
    corners = {node for code, of in solids if code in SOLIDS for node in of[: corners_of[code]]}
    for rim in outer(solids)[0]:
        own = [node for node in rim if node in corners]
        places = nodes[own]
        size = np.linalg.norm(places - places.mean(axis=0), axis=1).max()
        if len(rim) > len(own):
            between = nodes[[node for node in rim if node not in corners]]
            middles = (places + np.roll(places, -1, axis=0)) / 2
            if min(np.abs(np.roll(between, shift, axis=0) - middles).max() for shift in (0, 1)) > 1e-4 * size:
                continue
        normal = np.cross(places[1] - places[0], places[2] - places[0])
        for a, b in zip(own, (*own[1:], own[0])):
            met.setdefault(frozenset((a, b)), []).append(normal / np.linalg.norm(normal))
    return np.array([np.arctan2(np.linalg.norm(np.cross(*pair)), np.dot(*pair)) for pair in met.values() if len(pair) == 2])


def triangles(polygon):
    """A polygon of points (n, 3) as triangles about its centre: (n, 3, 3)."""
    following = np.roll(polygon, -1, axis=0)
    return np.stack([np.broadcast_to(polygon.mean(axis=0), polygon.shape), polygon, following], axis=1)


def node_cells(rim, nodes):
    """The part of a face that belongs to each of its nodes: polygons of the node, two middles of edges and the centre."""
    places = nodes[rim]
    centre, after = places.mean(axis=0), (places + np.roll(places, -1, axis=0)) / 2
    before = np.roll(after, 1, axis=0)
    return [np.array([places[k], after[k], centre, before[k]]) for k in range(len(rim))]


def amplitude(shape):
    """Largest length over a period of Re(shape e^(i omega t)), node by node."""
    real, imaginary = shape.real, shape.imag
    a, b, c = (real**2).sum(axis=1), (imaginary**2).sum(axis=1), (real * imaginary).sum(axis=1)
    return np.sqrt((a + b) / 2 + np.hypot((a - b) / 2, c))


def widest_phase(shape):
    """The phase [rad] at which the norm of Re(shape e^(i phase)) over all nodes is largest."""
    real, imaginary = shape.real, shape.imag
    a, b, c = (real**2).sum(), (imaginary**2).sum(), (real * imaginary).sum()
    return np.arctan2(-2 * c, a - b) / 2
