"""The error of the mesh in eigenvalues, element by element, by recovered strains (Zienkiewicz and Zhu 1992).

A mode's strains are fitted by polynomials about each corner, over the elements round it that are of one part. What is recovered
is closer to the truth than the strains themselves, so that its distance from them tells the error. With the left vector psi of
a mode phi, of the slope psi'Q'(lambda) phi = 1, an eigenvalue is off by

    lambda - lambda_h = sum over elements of int (e*(psi) - e(psi))' D (e*(phi) - e(phi)) (1 + beta lambda + i eta) dV

Without a left vector the conjugate of phi takes its place, and the slope is that of a structure which is all solids: then friction
does not turn the answer.

A growth rate is a small part of an eigenvalue, and the phase of this sum is not sharp enough to tell its sign where it is below a tenth
of the whole. Where the run has the modes on a finer mesh (modes.mesh_error), the parts are turned and scaled by one factor, so that
their sum is what the shape functions leave open there, with the closed pairs held. What closed pairs that changed make of it is the
contact's part. It is given to the elements of the slave side where the pressure ends.

Caveats: shells, beams and springs have no part in it; a mesh that is too coarse for a mode has nothing to recover.
"""

import tomllib
from collections import defaultdict
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from squeal.results import Missing, Results
from squeal.scene import is_geometry, with_numbers
from squeal.solid_elements import KINDS, TETRA4, TETRA10, Elements, elasticity, monomials
from squeal.surface import elements as elements_of
from squeal.surface import turns

KINK = 40  # degrees: sharper edges are the part's own
CHUNK = 512  # elements at a time
MODES = 8  # at most so many
STABLE = 2  # of these, those of least damping ratio
SAFETY = 1.25  # factor of a bar's part by the shape functions, that of modes.mesh_error
CANCELLED = 0.05  # part of the sum of the elements' moduli below which their sum is chance
SURE = 0.1  # part of the eigenvalue's change from which on its phase is sharp enough for the growth rate


def refined_parts(refined: dict[str, Any]) -> tuple[complex, complex]:
    """What the finer mesh adds to an eigenvalue [1/s]: by its shape functions with the closed pairs held, and by those that changed, or
    how large what others may make is."""
    def of(name: str) -> complex:
        return complex(refined[name + "growth_rate"], 2 * np.pi * refined[name + "frequency_hz"])

    smooth, contact = of("held_") - of(""), of("finer_") - of("held_")
    return 1.5 * smooth, contact or complex(refined["growth_error"] - SAFETY * abs(smooth.real) / 2)


@dataclass
class Block:
    """Elements of one kind and one part."""

    code: int
    part: int
    cells: np.ndarray  # their places among all elements of the file
    nodes: np.ndarray  # (element, node)
    elements: Elements
    stiffening: np.ndarray  # of each mode: 1 + beta lambda + i eta
    beta: float


@dataclass
class ModeEstimate:
    """What the mesh leaves open on one mode."""

    number: int
    lam: complex  # [1/s] on this mesh
    of_cells: np.ndarray  # complex [1/s], of each element of the file
    with_left: bool
    change: complex  # what the recovered strains add to the eigenvalue [1/s]
    of_contact: np.ndarray  # [1/s], of each element: by closed pairs that change
    refined: dict[str, Any] = field(default_factory=dict)  # modes.mesh_error of the report

    @property
    def is_sure(self) -> bool:
        """Whether the recovered strains tell the sign of the growth rate's change."""
        return not self.with_left or abs(self.change.real) > SURE * abs(self.change)

    @property
    def bars(self) -> tuple[float, float]:
        """What the shape functions and the contact's border leave open on the growth rate [1/s]: of the finer mesh where there is one. The
        elements' parts cancel in the first to no less than CANCELLED of them: those of the next mesh cancel otherwise."""
        scale = SAFETY / 3 if self.refined else 1.0
        together = scale * abs(self.of_cells.real.sum())
        smooth = max(together, scale * CANCELLED * np.abs(self.of_cells.real).sum(), 1e-300)
        return smooth, max(self.refined["growth_error"] - together, 0.0) if self.refined else 0.0


@dataclass
class MeshEstimate:
    """What the mesh leaves open on each mode whose shape is there."""

    modes: list[ModeEstimate]
    blocks: list[Block]
    part_names: list[str]
    nodes: np.ndarray
    cells: int  # of the file, points included
    on_contact: np.ndarray  # of each element: whether a face of it is in loaded contact

    def parts(self, values: np.ndarray) -> dict[str, float]:
        """Sums over the elements of each part."""
        sums: dict[str, float] = defaultdict(float)
        for block in self.blocks:
            sums[self.part_names[block.part]] += float(values[block.cells].sum())
        return dict(sums)


def scene_of(run: Results) -> dict[str, Any]:
    """The scene that was run, with every default."""
    file = run.folder / "resolved.toml"
    if not file.exists():
        raise Missing(f"there is no {file}, which has the materials")
    return with_numbers(tomllib.loads(file.read_text()))


def chords(run: Results) -> str:
    """A sentence for a mesh file whose straight sides seem to stand for round ones: its bars do not hold what these make. Empty: none."""
    file = scene_of(run).get("mesh", {}).get("file")
    if file is None or is_geometry(file):
        return ""
    angles = np.degrees(turns(elements_of(run.field("mesh/topology")), run.nodes))
    round_ones = angles[(angles > 1) & (angles < KINK)]
    if not len(round_ones):
        return ""
    turn = float(np.median(round_ones))
    return (f"{len(round_ones)} sides of flat faces turn by {turn:.2g} degrees (up to {round_ones.max():.2g}), as on round parts meshed by chords: these lie "
            f"{100 * (1 - np.cos(np.radians(turn / 2))):.1g} % of the radius within them, and no bar holds what that makes of growth rates; "
            "a finer mesh file, or mid-side nodes on the geometry, tells it")


def mode_vectors(run: Results) -> tuple[list[dict[str, Any]], np.ndarray, list[int]]:
    """The modes that are asked about, their fields (node, 3, field), and the field of each one's left vector or -1."""
    modes = run.stage("modes")["modes"]
    there = [modes[number - 1] | {"number": number} for number in run.mode_numbers()
             if number <= len(modes) and modes[number - 1]["frequency_hz"] != 0]
    stable = sorted((mode for mode in there if not mode["unstable"]), key=lambda mode: mode["damping_ratio"])
    found = ([mode for mode in there if mode["unstable"]] + stable[:STABLE])[:MODES]
    if not found:
        raise Missing("the run kept no shape of a mode that oscillates: -modes_shapes all keeps those of stable ones too")
    columns, left = [run.shape(mode["number"]) for mode in found], []
    for mode in found:
        try:
            real, imaginary = (run.field(f"modes/{mode['number']}/left_{part}") for part in ("real", "imaginary"))
        except Missing:
            left.append(-1)
            continue
        left.append(len(columns))
        columns.append(real + 1j * imaginary)
    return found, np.stack(columns, axis=-1), left


def damping_of(part: dict[str, Any], scene: dict[str, Any]) -> tuple[float, float]:
    """beta and eta of a part."""
    own = "alpha" in part or "beta" in part
    return (part if own else scene.get("damping", {})).get("beta", 0.0), part.get("loss_factor", 0.0)


def blocks_of(run: Results, scene: dict[str, Any], lam: np.ndarray) -> tuple[list[Block], int]:
    """The solids by kind and part, and the number of elements of the file."""
    part = run.field("mesh/part")
    met: dict[tuple[int, int], tuple[list[int], list[list[int]]]] = defaultdict(lambda: ([], []))
    for cell, (code, nodes) in enumerate(elements_of(run.field("mesh/topology"))):
        if code in KINDS:
            cells, rows = met[int(part[cell]), code]
            cells.append(cell)
            rows.append(nodes)
    blocks, places = [], run.nodes
    for (number, code), (cells, rows) in sorted(met.items()):
        of = scene["part"][number]
        beta, eta = damping_of(of, scene)
        nodes = np.array(rows)
        D = np.broadcast_to(elasticity(of), (len(rows), 6, 6))
        blocks.append(Block(code, number, np.array(cells), nodes, Elements(KINDS[code], places[nodes], D),
                            1 + beta * lam + 1j * eta * (lam.imag > 0), beta))
    if not blocks:
        raise Missing("the scene has no solid elements: shells, points and matrices have no estimate")
    return blocks, len(part)


class Recovered:
    """Polynomials for the strains of a part about each of its corners."""

    def __init__(self, blocks: list[Block], nodes: np.ndarray, fields: np.ndarray) -> None:
        """blocks: of one part. nodes: places. fields: (node, 3, field)."""
        self.exponents = TETRA10 if any(KINDS[block.code].order == 2 for block in blocks) else TETRA4
        best = [self._samples(block, KINDS[block.code].samples, fields) for block in blocks]
        self.corners, rows = np.unique(np.concatenate([block.nodes[:, : len(KINDS[block.code].corners)].ravel() for block in blocks]),
                                       return_inverse=True)
        self.of_block, of_element, at = [], [], 0
        for block in blocks:
            shape = (len(block.nodes), len(KINDS[block.code].corners))
            self.of_block.append(rows[at : at + shape[0] * shape[1]].reshape(shape))
            at += shape[0] * shape[1]
            of_element += list(self.of_block[-1])
        self._around: list[list[int]] = [[] for _ in self.corners]
        for element, corners in enumerate(of_element):
            for corner in corners:
                self._around[corner].append(element)
        self._of_element = of_element
        samples = [place_and_strain for block in best for place_and_strain in zip(*block)]
        every: list[Any] = []
        self.centre = nodes[self.corners]
        self.scale = np.ones(len(self.corners))
        self.fits = np.zeros((len(self.corners), len(self.exponents), 6 * fields.shape[-1]), complex)
        for corner in range(len(self.corners)):
            if not self._fit(corner, samples):
                every = every or [pair for block in blocks for pair in zip(*self._samples(block, KINDS[block.code].rule[0], fields))]
                self._fit(corner, every, last=True)

    @staticmethod
    def _samples(block: Block, xi: np.ndarray, fields: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Places and strains of each element at some points: (element, point, 3), (element, point, 6 field)."""
        strains = block.elements.strains(xi, fields[block.nodes])
        return block.elements.at(xi)[0], strains.reshape(*strains.shape[:2], -1)

    def _fit(self, corner: int, samples: list[tuple[np.ndarray, np.ndarray]], last: bool = False) -> bool:
        """Fits the samples of the elements round a corner; of more elements where these do not settle the polynomial. Whether
        any did, or what is there, if it is the last try."""
        ring = self._around[corner]
        for _ in range(3):
            places = np.concatenate([samples[element][0] for element in ring]) - self.centre[corner]
            scale = np.abs(places).max()
            A = monomials(places / scale, self.exponents)
            if len(A) >= len(self.exponents) + 2:
                values = np.concatenate([samples[element][1] for element in ring])
                solution, _, _, singular = np.linalg.lstsq(A.astype(complex), values, rcond=1e-3)
                self.fits[corner], self.scale[corner] = solution, scale
                if singular[-1] > 1e-2 * singular[0] / len(self.exponents):
                    return True
            ring = sorted({near for element in ring for other in self._of_element[element] for near in self._around[other]})
        return last

    def at(self, block: int, chunk: slice, places: np.ndarray, shares: np.ndarray) -> np.ndarray:
        """Strains at points (element, point, 3) of a block's elements: those of their corners, by shares (point, corner)."""
        total = 0
        for k in range(shares.shape[1]):
            corner = self.of_block[block][chunk, k]
            x = (places - self.centre[corner, None]) / self.scale[corner, None, None]
            total = total + shares[None, :, k, None] * np.matmul(monomials(x, self.exponents), self.fits[corner])
        return np.asarray(total)


def energies(block: Block, of_block: int, recovered: Recovered, fields: np.ndarray, left: list[int]) -> tuple[np.ndarray, np.ndarray]:
    """Of each element and mode: int of the products of what is missing in strains of both vectors, and of the strains."""
    kind, count = KINDS[block.code], len(left)
    xi, weights = kind.rule
    shares = kind.corner_values(xi)
    missing, whole = np.zeros((2, len(block.nodes), count), complex)
    for first in range(0, len(block.nodes), CHUNK):
        chunk = slice(first, first + CHUNK)
        part = Elements(kind, block.elements.places[chunk], block.elements.D[chunk])
        places, det = part.at(xi)
        strain = part.strains(xi, fields[block.nodes[chunk]])
        lacking = recovered.at(of_block, chunk, places, shares).reshape(strain.shape) - strain
        w, D = weights * np.abs(det), block.elements.D[0]
        for mode, other in enumerate(left):
            for result, values in ((missing, lacking), (whole, strain)):
                psi = values[..., other] if other >= 0 else values[..., mode].conj()
                result[chunk, mode] = np.einsum("eqi,ij,eqj,eq->e", psi, D, values[..., mode], w, optimize=True)
    return missing, whole


def contact_elements(run: Results, blocks: list[Block], cells: int) -> np.ndarray:
    """Whether each element of the file has a face in loaded contact."""
    result = np.zeros(cells, bool)
    try:
        loaded = run.field("equilibrium/normal_reaction") != 0
    except Missing:
        return result
    for block in blocks:
        corners = block.nodes[:, : len(KINDS[block.code].corners)]
        result[block.cells] = loaded[corners].sum(axis=1) >= 3
    return result


def border_shares(run: Results, blocks: list[Block], cells: int) -> np.ndarray:
    """Of each element the part of the contact's border in it; they sum to 1. The border is where the pressure, as it goes on for half an
    element, reaches zero: elements whose least pressure is below half of its fall. Where no pressure is so low, those of less than its
    mean have it, by what they lack."""
    result = np.zeros(cells)
    try:
        nodes, pressure, area = (run.field(f"pairs/{name}") for name in ("node", "pressure", "area"))
    except Missing:
        return result
    at_nodes = np.full(len(run.nodes), np.nan)
    mean = (pressure * area).sum() / max(area.sum(), 1e-300)
    at_nodes[nodes] = pressure / max(mean, 1e-300)
    lacking = np.zeros(cells)
    for block in blocks:
        own = at_nodes[block.nodes]
        there = np.isfinite(own)
        least = np.where(there, own, np.inf).min(axis=1)
        most = np.where(there, own, -np.inf).max(axis=1)
        result[block.cells] = (there.sum(axis=1) >= 3) & (most > 0) & (3 * least < most)
        lacking[block.cells] = np.where(there, np.maximum(1 - own, 0), 0).sum(axis=1)
    if not result.any():
        result = lacking
    return result / max(result.sum(), 1e-300)


def estimate(run: Results) -> MeshEstimate:
    """The estimate of a run's modes; Missing where it has no shapes or no solids."""
    scene = scene_of(run)
    modes, fields, left = mode_vectors(run)
    lam = np.array([mode["growth_rate"] + 2j * np.pi * mode["frequency_hz"] for mode in modes])
    blocks, cells = blocks_of(run, scene, lam)
    of_cells = np.zeros((cells, len(modes)), complex)
    strain, damped = np.zeros((2, len(modes)), complex)
    for number in sorted({block.part for block in blocks}):
        own = [block for block in blocks if block.part == number]
        recovered = Recovered(own, run.nodes, fields)
        for place, block in enumerate(own):
            missing, whole = energies(block, place, recovered, fields, left)
            of_cells[block.cells] = missing * block.stiffening
            strain += whole.sum(axis=0)
            damped += block.beta * whole.sum(axis=0)
    known = np.array(left) >= 0
    slopes = np.where(known, 1, damped - 2 * (strain + lam * damped) / lam)  # of solids alone: psi'(2 lambda M + beta K) phi
    refined = run.report["modes"].get("mesh_error", {}).get("modes", [])
    of_mode = [next((entry for entry in refined if abs(entry["frequency_hz"] / mode["frequency_hz"] - 1) < 1e-6
                     and np.isfinite(entry.get("finer_frequency_hz") or np.nan)), {}) for mode in modes]
    border = border_shares(run, blocks, cells)
    estimates = []
    for k, mode in enumerate(modes):
        parts, change = of_cells[:, k] / slopes[k], complex(of_cells[:, k].sum() / slopes[k])
        smooth, contact = refined_parts(of_mode[k]) if of_mode[k] else (change, 0)
        estimates.append(ModeEstimate(mode["number"], lam[k], parts * (smooth / change if change else 1), bool(known[k]), change,
                                      contact * border, of_mode[k]))
    return MeshEstimate(estimates, blocks, [part["name"] for part in scene["part"]], run.nodes, cells,
                        contact_elements(run, blocks, cells))
