"""The surface of a mesh, deformed and coloured, as an image: numpy and nothing else draws it.

Every triangle is put into a buffer that keeps, pixel by pixel, what is nearest to the eye.
"""

import numpy as np

# Of each element in XDMF's mixed topology, by its code: number of nodes, and corners of its faces in VTK's order.
HEX = ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))
WEDGE = ((0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5))
TETRA = ((0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3))
SOLIDS = {9: (8, HEX), 8: (6, WEDGE), 48: (20, HEX), 38: (10, TETRA)}
SHELLS = {5: (0, 1, 2, 3), 4: (0, 1, 2)}
POINT = 1  # its number of nodes follows
FINE = 2  # pixels of the buffer for one of the image, each way
REST, SQUEAL = "#dfe4ea", ("#f6c65b", "#e8662c", "#a3102a")  # colours of no amplitude, and of more and more


def elements(topology):
    """Code and nodes of every element that is not a point."""
    at = 0
    while at < len(topology):
        code, at = int(topology[at]), at + 1
        if code == POINT:
            at += 1 + int(topology[at])
            continue
        count = len(SHELLS[code]) if code in SHELLS else SOLIDS[code][0]
        yield code, topology[at : at + count].tolist()
        at += count


def surface(topology):
    """Faces that belong to one element only, and shells, as rows of four corners; a triangle repeats its last."""
    shells, met = [], {}
    for code, nodes in elements(topology):
        if code in SHELLS:
            shells.append(nodes)
        else:
            for corners in SOLIDS[code][1]:
                face = [nodes[k] for k in corners]
                met.setdefault(tuple(sorted(face)), []).append(face)
    faces = shells + [twins[0] for twins in met.values() if len(twins) == 1]
    return np.array([face if len(face) == 4 else [*face, face[-1]] for face in faces], int).reshape(-1, 4)


def amplitude(real, imaginary):
    """Largest length over a period of Re((real + i imaginary) e^(i omega t)), node by node."""
    a, b, c = (real**2).sum(axis=1), (imaginary**2).sum(axis=1), (real * imaginary).sum(axis=1)
    return np.sqrt((a + b) / 2 + np.hypot((a - b) / 2, c))


def widest(real, imaginary):
    """The displacement at the phase where its norm over all nodes is largest."""
    a, b, c = (real**2).sum(), (imaginary**2).sum(), (real * imaginary).sum()
    phase = np.arctan2(-2 * c, a - b) / 2
    return real * np.cos(phase) - imaginary * np.sin(phase)


def view(azimuth, elevation):
    """Unit vectors of the picture in rows: right, up, towards the eye. Angles in degrees, z is up."""
    a, e = np.radians([azimuth, elevation])
    towards = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    right = np.array([-np.sin(a), np.cos(a), 0.0])
    return np.array([right, np.cross(towards, right), towards])


def image(corners, values, window, height, colours):
    """RGB array of faces, on white.

    corners: (faces, 4, 3), their places to the right, up and towards the eye. values: (faces, 4), from 0 to 1, coloured
    by colours. window: left, right, bottom and top of what is shown. height: of the array [pixels].
    """
    left, right, bottom, top = window
    scale = FINE * height / (top - bottom)
    shape = FINE * height, FINE * round((right - left) * scale / FINE)
    buffer = {"depth": np.full(shape, -np.inf), "value": np.zeros(shape), "light": np.ones(shape)}
    normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
    light = 0.7 + 0.3 * np.abs(normal @ (-0.3, 0.55, 0.78))
    placed = corners * [scale, -scale, 1] + [-left * scale, top * scale, 0]  # columns and rows of the buffer
    for face, value, bright in zip(placed, values, light):
        # The diagonal, opposite to the second corner of one triangle and to the third of the other, is no edge.
        _put_triangle(buffer, face[[0, 1, 2]], value[[0, 1, 2]], bright, (True, False, True))
        _put_triangle(buffer, face[[0, 2, 3]], value[[0, 2, 3]], bright, (True, True, False))
    rgb = colours(buffer["value"])[:, :, :3] * buffer["light"][:, :, None]
    rgb[np.isinf(buffer["depth"])] = 1
    return rgb.reshape(height, FINE, -1, FINE, 3).mean(axis=(1, 3))


def _put_triangle(buffer, corners, values, bright, edges):
    """edges: whether the side opposite to each corner is drawn as a line."""
    a, b, c = corners[:, :2]
    low = np.maximum(np.floor(corners[:, :2].min(axis=0)).astype(int), 0)
    high = np.minimum(np.ceil(corners[:, :2].max(axis=0)).astype(int) + 1, buffer["depth"].shape[::-1])
    area = np.linalg.det([b - a, c - a])
    if (low >= high).any() or abs(area) < 1e-12:
        return
    x, y = np.meshgrid(np.arange(low[0], high[0]) + 0.5 - a[0], np.arange(low[1], high[1]) + 0.5 - a[1])
    second = (x * (c - a)[1] - y * (c - a)[0]) / area
    third = ((b - a)[0] * y - (b - a)[1] * x) / area
    weights = np.stack([1 - second - third, second, third])
    depth = np.tensordot(corners[:, 2], weights, 1)
    here = np.s_[low[1] : high[1], low[0] : high[0]]
    nearest = (weights > -1e-9).all(axis=0) & (depth > buffer["depth"][here])
    sides = np.maximum([np.linalg.norm(side) for side in (c - b, c - a, b - a)], 1e-12)
    distance = weights * (abs(area) / sides)[:, None, None]  # [pixels] to the side opposite to each corner
    line = np.any([edge & (d < 0.8) for edge, d in zip(edges, distance)], axis=0)
    buffer["depth"][here][nearest] = depth[nearest]
    buffer["value"][here][nearest] = np.tensordot(values, weights, 1)[nearest]
    buffer["light"][here][nearest] = (bright * np.where(line, 0.75, 1))[nearest]


def _window(places, margin):
    """Around what is seen at these places, as wide as it is high."""
    low, high = places[:, :2].min(axis=0), places[:, :2].max(axis=0)
    middle, half = (low + high) / 2, (0.5 + margin) * (high - low).max()
    return middle[0] - half, middle[0] + half, middle[1] - half, middle[1] + half


def draw_mode(whole, near, nodes, topology, real, imaginary):
    """The deformed surface of a mode on two axes: all of it, and the neighbourhood of what moves most.

    Returns the colours, for a colour bar from 0 to 1. None: the mesh has no surface.
    """
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LinearSegmentedColormap
    from matplotlib.patches import Rectangle

    faces = surface(topology)
    if not len(faces):
        return None
    size = amplitude(real, imaginary)
    size /= size.max()
    moving = np.flatnonzero(size > 0.25)
    motion = widest(real, imaginary)
    extent = np.linalg.norm(np.ptp(nodes[moving], axis=0)) or np.linalg.norm(np.ptp(nodes, axis=0))
    deformed = nodes + motion * (0.12 * extent / np.abs(motion).max())
    middle = (nodes.max(axis=0) + nodes.min(axis=0)) / 2
    aside = np.average(nodes, axis=0, weights=size**2) - middle  # the eye stands on the side that moves
    seen = deformed @ view(np.degrees(np.arctan2(aside[1], aside[0])) - 35, 28).T
    colours = LinearSegmentedColormap.from_list("squeal", (REST, *SQUEAL))
    frame = _window(seen[moving], 0.25)
    for axes, window in ((whole, _window(seen[np.unique(faces)], 0.02)), (near, frame)):
        axes.imshow(image(seen[faces], size[faces], window, 500, colours), extent=window)
        axes.grid(False)
        axes.set(xticks=[], yticks=[])
    whole.spines[:].set_visible(False)
    near.spines[:].set_visible(True)
    whole.add_patch(Rectangle(frame[::2], frame[1] - frame[0], frame[3] - frame[2], fill=False, ec="0.3", lw=0.8))
    return ScalarMappable(cmap=colours)
