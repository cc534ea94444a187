"""Which part moves in a mode, and which one bends: its shares in the energies, of the shapes that a run kept.

Kinetic and strain energy of the solids, by the elements' own shape functions and rules. Where a run has [sensitivity], its report has
the shares of all that the scene holds, and derivatives beside.
"""

from functools import lru_cache
from typing import Any

import numpy as np
from squeal.mesh_estimate import CHUNK, blocks_of, scene_of
from squeal.results import Missing, Results
from squeal.solid_elements import KINDS, Elements, Rule, brick_rule, collapsed_prism_rule, pyramid_rule, tetra_rule_of_14


def mass_rule(corners: int) -> Rule:
    """Exact for squares of linear functions and, but for curved edges, of quadratic ones."""
    return {8: brick_rule(3), 6: collapsed_prism_rule(3), 5: pyramid_rule(3), 4: tetra_rule_of_14()}[corners]


def solid_energies(run: Results, shapes: np.ndarray) -> tuple[list[str], np.ndarray]:
    """Names of the parts of solids; phi^H M phi and phi^H K phi of each, as (part, energy, mode). shapes: (node, 3, mode)."""
    scene = scene_of(run)
    blocks, _ = blocks_of(run, scene, np.ones(1))
    parts = sorted({block.part for block in blocks})
    found = np.zeros((len(parts), 2, shapes.shape[-1]))
    for block in blocks:
        kind = KINDS[block.code]
        xi, weights = mass_rule(len(kind.corners))
        density = scene["part"][block.part]["density"]
        for first in range(0, len(block.nodes), CHUNK):
            chunk = slice(first, first + CHUNK)
            part = Elements(kind, block.elements.places[chunk], block.elements.D[chunk])
            u = shapes[block.nodes[chunk]]
            kinetic = density * np.einsum("eqkf,eq,q->f", np.abs(part.displacements(xi, u)) ** 2, np.abs(part.at(xi)[1]), weights)
            points, of_points = kind.rule
            strain = part.strains(points, u)
            held = np.einsum("eqif,ij,eqjf,eq,q->f", strain.conj(), block.elements.D[0], strain, np.abs(part.at(points)[1]), of_points, optimize=True)
            found[parts.index(block.part)] += np.stack([kinetic, held.real])
    return [scene["part"][number]["name"] for number in parts], found


@lru_cache(maxsize=8)
def part_shares(run: Results, most: int) -> list[dict[str, Any]]:
    """Number, frequency, growth and shares, by falling kinetic energy, of the first unstable modes whose shapes are there. Empty
    without solids, with parts of shells or orthotropic ones, or without shapes."""
    modes = run.report.get("modes", {}).get("modes", [])
    numbers = [number for number in run.mode_numbers() if number <= len(modes) and modes[number - 1]["unstable"]][:most] if modes else []
    try:
        scene = scene_of(run)
        if not numbers or any(part.get("thickness") or part.get("orthotropic") for part in scene.get("part", [])):
            return []
        names, energies = solid_energies(run, np.stack([run.shape(number) for number in numbers], axis=-1))
    except Missing:
        return []
    shares = energies / energies.sum(axis=0)
    return [{"mode": number, "frequency_hz": modes[number - 1]["frequency_hz"], "growth_rate": modes[number - 1]["growth_rate"],
             "parts": sorted(({"name": name, "kinetic": float(kinetic), "strain": float(strain)}
                              for name, (kinetic, strain) in zip(names, shares[:, :, k])), key=lambda part: -part["kinetic"])}
            for k, number in enumerate(numbers)]
