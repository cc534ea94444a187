"""Sizes of elements that an estimate of the mesh's error asks for, as a file of views that gmsh takes as its background.

The mesh of fewest elements for a given error has equal parts of it in all elements (Ladeveze et al. 1991). Where an element's part
eta goes as h^q in its volume, q twice the order of the shape functions, a factor r on its size leaves eta r^q, and 1/r^3 elements.
The border of the contact falls between nodes, and its part c goes as h. Both together tell how what may be left is shared by the two:

    q eta r^(q + 3) + c r^4 = share,   sum of eta r^q + c r = what may be left
"""

from pathlib import Path

import numpy as np
from squeal.common import SquealError
from squeal.mesh_estimate import Block, MeshEstimate
from squeal.solid_elements import KINDS

FINEST, COARSEST = 1 / 3, 1.5  # factors of one step: beyond them the estimate of this mesh tells little
GROWTH = 0.6  # of sizes over the distance, at most
VIEWS = {6: "SS", 38: "SS", 9: "SH", 48: "SH", 8: "SI"}  # gmsh's names of lists of scalars
HEAD = """// Sizes of elements for {title}: mesh.size_field of a scene takes the file, and so does Merge at the end of a .geo.
// A view has the sizes of one part, within and on the volumes of its name; the least one holds where parts meet.
Mesh.MeshSizeFromPoints = 0;
Mesh.MeshSizeFromCurvature = 0;
Mesh.MeshSizeExtendFromBoundary = 0;
Mesh.MeshSizeMin = 0;
Mesh.MeshSizeMax = {largest:.4g}; // also where no element is near, as beyond chords of curved sides
f = 1000;
"""
# squeal tells a script the tags of named volumes; where a .geo merges it by itself they are not known, and the view is for all.
FIELD = """f += 2;
Field[f] = PostView;
Field[f].ViewIndex = PostProcessing.NbViews - 1;
group = DefineNumber[0, Name "Volumes/{name}"];
v[] = Volume{{:}};
If (group)
  v[] = Physical Volume{{group}};
EndIf
s[] = Unique(Abs(Boundary{{ Volume{{v[]}}; }}));
c[] = Unique(Abs(Boundary{{ Surface{{s[]}}; }}));
p[] = Unique(Abs(Boundary{{ Curve{{c[]}}; }}));
Field[f + 1] = Restrict;
Field[f + 1].InField = f;
Field[f + 1].VolumesList = {{v[]}};
Field[f + 1].SurfacesList = {{s[]}};
Field[f + 1].CurvesList = {{c[]}};
Field[f + 1].PointsList = {{p[]}};
sizes[] += {{f + 1}};
"""
TAIL = """Field[1000] = Min;
Field[1000].FieldsList = {sizes[]};
Background Field = 1000;
"""


def corners_of(block: Block) -> np.ndarray:
    """Places of the corners, (element, corner, 3)."""
    return block.elements.places[:, : len(KINDS[block.code].corners)]


def present_sizes(block: Block) -> np.ndarray:
    """Mean length of each element's edges."""
    places = corners_of(block)
    ends = np.array(KINDS[block.code].edges)
    return np.linalg.norm(places[:, ends[:, 0]] - places[:, ends[:, 1]], axis=2).mean(axis=1)


def factors_for(eta: np.ndarray, q: np.ndarray, left: float, border: np.ndarray | float = 0.0) -> np.ndarray:
    """The rule above: factors on the sizes of elements with the parts eta and those of the border, that leave this part of their sum."""
    border = np.broadcast_to(border, eta.shape)
    wanted = max(left * (eta.sum() + border.sum()), left * eta.sum() + FINEST * border.sum())  # a step takes no more from the border

    def factors(share: float) -> np.ndarray:
        low, high = (np.full(len(eta), np.log(end)) for end in (FINEST, COARSEST))
        for _ in range(45):
            middle = (low + high) / 2
            much = q * eta * np.exp((q + 3) * middle) + border * np.exp(4 * middle) > share
            low, high = np.where(much, low, middle), np.where(much, middle, high)
        return np.exp(low)

    largest = (q * eta + border).max()
    low, high = np.log(largest) - 40, np.log(largest) + 12 * np.log(COARSEST)
    for _ in range(60):
        middle = (low + high) / 2
        r = factors(np.exp(middle))
        low, high = (low, middle) if (eta * r**q + border * r).sum() > wanted else (middle, high)
    return factors(np.exp(low))


def wanted_factors(found: MeshEstimate, left: dict[int, float]) -> list[np.ndarray]:
    """Factors on the sizes of each block's elements: the least that a mode asks for. left: of modes by number, the part of their
    error that may stay."""
    q = np.concatenate([np.full(len(block.cells), 2.0 * KINDS[block.code].order) for block in found.blocks])
    cells = np.concatenate([block.cells for block in found.blocks])
    asked = []
    for mode in found.modes:
        if mode.number in left:
            eta, border = np.abs(mode.of_cells[cells]), np.abs(mode.of_contact[cells])
            smooth, contact = mode.bars
            asked.append(factors_for(eta * (smooth / eta.sum()), q, left[mode.number], border * (contact / max(border.sum(), 1e-300))))
    if not asked:
        raise SquealError("no mode says what the sizes are to be for")
    return np.split(np.min(asked, axis=0), np.cumsum([len(block.cells) for block in found.blocks])[:-1])


def graded(size: np.ndarray, ends: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Sizes at nodes that grow by no more than GROWTH of the distance along edges."""
    for _ in range(100):
        before = size.copy()
        for a, b in ((0, 1), (1, 0)):
            np.minimum.at(size, ends[:, b], size[ends[:, a]] + GROWTH * lengths)
        if np.allclose(size, before, rtol=1e-3):
            break
    return size


def sizes_at_corners(found: MeshEstimate, factors: list[np.ndarray]) -> list[np.ndarray]:
    """Sizes at each block's corners, (element, corner) [m]; nodes have one size in each part."""
    result: list[np.ndarray] = [np.zeros(0)] * len(found.blocks)
    for part in {block.part for block in found.blocks}:
        own = [k for k, block in enumerate(found.blocks) if block.part == part]
        logs, counts = np.zeros((2, len(found.nodes)))
        ends = []
        for k in own:
            block = found.blocks[k]
            corners = block.nodes[:, : len(KINDS[block.code].corners)]
            np.add.at(logs, corners, np.log(present_sizes(block) * factors[k])[:, None])
            np.add.at(counts, corners, 1)
            ends.append(corners[:, KINDS[block.code].edges].reshape(-1, 2))
        size = np.exp(logs / np.maximum(counts, 1))
        edges = np.concatenate(ends)
        size = graded(size, edges, np.linalg.norm(found.nodes[edges[:, 0]] - found.nodes[edges[:, 1]], axis=1))
        for k in own:
            result[k] = size[found.blocks[k].nodes[:, : len(KINDS[found.blocks[k].code].corners)]]
    return result


def write_sizes(file: Path, found: MeshEstimate, factors: list[np.ndarray], scale: float, title: str) -> None:
    """The file of views, one for each part under its name, in the unit of the geometry's file. scale: that unit [m]."""
    corners = sizes_at_corners(found, factors)
    text = [HEAD.format(title=title, largest=max(sizes.max() for sizes in corners) / scale)]
    for part in sorted({block.part for block in found.blocks}):
        text.append(f'View "{found.part_names[part]}" {{\n')
        for block, sizes in zip(found.blocks, corners):
            if block.part == part:
                for places, values in zip(corners_of(block) / scale, sizes / scale):
                    numbers = ",".join(f"{x:.7g}" for x in places.ravel())
                    text.append(f"{VIEWS[block.code]}({numbers}){{{','.join(f'{x:.4g}' for x in values)}}};\n")
        text += ["};\n", FIELD.format(name=found.part_names[part])]
    text.append(TAIL)
    file.write_text("".join(text))


def elements_foreseen(factors: list[np.ndarray]) -> float:
    """How many elements these factors make."""
    return float(sum((factor**-3).sum() for factor in factors))


def left_open(found: MeshEstimate, part: float) -> dict[int, float]:
    """The part of its error that may stay, of each unstable mode or of the first one, such that its bars (ModeEstimate.bars) together are
    this part of its growth rate. They exceed the printed bar where elements' parts cancel."""
    asked = [mode for mode in found.modes if mode.lam.real > 0] or found.modes[:1]
    result = {}
    for mode in asked:
        growth = abs(mode.refined["corrected_growth_rate"] if mode.refined else mode.lam.real)
        result[mode.number] = part * growth / sum(mode.bars)
    return result
