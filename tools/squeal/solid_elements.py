"""Solid elements as fields.h5 has them: shape functions, rules of integration, strains, elasticity.

Strains are xx yy zz xy yz zx, shears in full. The incompatible modes of 8-node bricks and 6-node wedges are part of the strain, as
src/solid/README.md tells: their amplitudes follow from the nodes' displacements.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
from squeal.surface import HEX_EDGES, PYRAMID_EDGES, TETRA_EDGES, WEDGE_EDGES

Rule = tuple[np.ndarray, np.ndarray]  # points and weights of the reference element


def _exponents(allowed: Callable[[tuple[int, ...]], bool], lowest: int = 0) -> np.ndarray:
    return np.array([powers for powers in product(range(3), range(3), range(lowest, 3)) if allowed(powers)])


TETRA4 = _exponents(lambda p: sum(p) <= 1)
TETRA10 = _exponents(lambda p: sum(p) <= 2)
BRICK8 = _exponents(lambda p: max(p) <= 1)
BRICK20 = _exponents(lambda p: max(p) <= 1 or sorted(p)[1] <= 1)
BRICK27 = _exponents(lambda p: True)
WEDGE6 = _exponents(lambda p: p[0] + p[1] <= 1 and p[2] <= 1)
WEDGE15 = _exponents(lambda p: p[0] + p[1] <= 2 and sum(p) <= 3)
WEDGE18 = _exponents(lambda p: p[0] + p[1] <= 2)
PYRAMID5 = _exponents(lambda p: max(p[:2]) <= sum(p) <= 1, -1)  # the apex is the origin: src/mesh/shapes.cpp
PYRAMID13 = _exponents(lambda p: max(p[:2]) <= sum(p) <= 2 and p[0] * p[1] < 4, -2)

CUBE = np.array([(-1, -1, -1), (1, -1, -1), (1, 1, -1), (-1, 1, -1), (-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)], float)
PRISM = np.array([(0, 0, -1), (1, 0, -1), (0, 1, -1), (0, 0, 1), (1, 0, 1), (0, 1, 1)], float)
SIMPLEX = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], float)
APEX = np.array([(-1, -1, -1), (1, -1, -1), (1, 1, -1), (-1, 1, -1), (0, 0, 0)], float)
ROOT = 1 / np.sqrt(3)


def with_middles(corners: np.ndarray, sides: tuple[tuple[int, ...], ...]) -> np.ndarray:
    return np.concatenate([corners, [corners[list(side)].mean(axis=0) for side in sides]])


def brick_rule(n: int) -> Rule:
    x, w = np.polynomial.legendre.leggauss(n)
    return np.array(list(product(x, repeat=3))), np.array([a * b * c for a, b, c in product(w, repeat=3)])


def _tetra_points(a: float) -> list[tuple[float, ...]]:
    """The four points with three equal barycentric coordinates a."""
    return [tuple(1 - 3 * a if k == i else a for k in range(1, 4)) for i in range(4)]


FOUR: Rule = (np.array(_tetra_points((5 - np.sqrt(5)) / 20)), np.full(4, 1 / 24))  # exact for squares


def tetra_rule_of_14() -> Rule:
    """Exact for polynomials of degree 5: the two sets of four points and the six of edges whose moments are right (Walkington 2000)."""
    a, b, c = 0.31088591926330060980, 0.092735250310891226402, 0.045503704125649649492
    six = [tuple((0.5 - c if k in pair else c) for k in range(1, 4)) for pair in ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3))]
    weights = [0.11268792571801585080] * 4 + [0.073493043116361949544] * 4 + [0.042546020777081466438] * 6
    return np.array(_tetra_points(a) + _tetra_points(b) + six), np.array(weights) / 6


def _prism_rule() -> Rule:
    triangle = ((1 / 6, 1 / 6), (2 / 3, 1 / 6), (1 / 6, 2 / 3))
    return np.array([(*place, z) for place in triangle for z in (-ROOT, ROOT)]), np.full(6, 1 / 6)


def collapsed_prism_rule(n: int) -> Rule:
    """The brick's with y shrunk to nothing at x = 1."""
    points, weights = brick_rule(n)
    x, y = (points[:, :2].T + 1) / 2
    return np.stack([x, y * (1 - x), points[:, 2]], axis=1), weights / 4 * (1 - x)


def pyramid_rule(n: int) -> Rule:
    """The brick's shrunk to nothing at the apex."""
    points, weights = brick_rule(n)
    t = (points[:, 2] + 1) / 2
    return np.stack([points[:, 0] * t, points[:, 1] * t, -t], axis=1), weights / 2 * t**2


@dataclass(frozen=True)
class Solid:
    """A kind of solid element. centre: of the reference element."""

    corners: np.ndarray
    edges: tuple[tuple[int, ...], ...]  # between corners; of quadratic elements in the order of their mid-side nodes
    exponents: np.ndarray  # of the monomials that span the shape functions
    order: int
    rule: Rule
    samples: np.ndarray  # where strains are better than elsewhere
    centre: np.ndarray
    modes: int = 0  # incompatible ones
    middles: tuple[tuple[int, ...], ...] = ()  # corners round the nodes behind the mid-side ones

    @cached_property
    def nodes(self) -> np.ndarray:
        return with_middles(self.corners, (*self.edges, *self.middles)) if self.order == 2 else self.corners

    @cached_property
    def _coefficients(self) -> np.ndarray:
        return np.linalg.inv(monomials(self.nodes, self.exponents))

    def gradients(self, xi: np.ndarray) -> np.ndarray:
        """dN_n/dxi_k as (point, k, n)."""
        parts = []
        for k in range(3):
            lowered = self.exponents.copy()
            lowered[:, k] -= lowered[:, k] != 0
            parts.append(monomials(xi, lowered) * self.exponents[:, k] @ self._coefficients)
        return np.stack(parts, axis=1)

    def values(self, xi: np.ndarray) -> np.ndarray:
        """N_n as (point, n)."""
        return monomials(xi, self.exponents) @ self._coefficients

    def corner_values(self, xi: np.ndarray) -> np.ndarray:
        """The linear functions of the corners, which sum to one."""
        linear = {8: BRICK8, 6: WEDGE6, 5: PYRAMID5, 4: TETRA4}[len(self.corners)]
        return monomials(xi, linear) @ np.linalg.inv(monomials(self.corners, linear))

    def mode_values(self, xi: np.ndarray) -> np.ndarray:
        """Values of the incompatible modes: (point, mode)."""
        x, y, z = xi.T
        return np.stack({3: [1 - x * x, 1 - y * y, 1 - z * z], 4: [x * x - x, y * y - y, x * y, 1 - z * z]}[self.modes], axis=-1)

    def mode_gradients(self, xi: np.ndarray) -> np.ndarray:
        """Gradients of the incompatible modes, less their values at the centre: (point, k, mode)."""
        x, y, z = (xi - self.centre).T
        zero = np.zeros_like(x)
        if self.modes == 3:  # 1 - xi_k^2
            rows = ((-2 * x, zero, zero), (zero, -2 * y, zero), (zero, zero, -2 * z))
        else:  # xi^2 - xi, eta^2 - eta, xi eta, 1 - zeta^2
            rows = ((2 * x, zero, y, zero), (zero, 2 * y, x, zero), (zero, zero, zero, -2 * z))
        return np.moveaxis(np.array(rows), 2, 0)


THIRD = np.array([1 / 3, 1 / 3, 0])
QUARTER = np.full(3, 0.25)
ZERO = np.zeros(3)
MEAN = np.array([0, 0, -0.75])  # of a pyramid
# By XDMF's code.
KINDS = {
    6: Solid(SIMPLEX, TETRA_EDGES, TETRA4, 1, FOUR, QUARTER[None], QUARTER),
    38: Solid(SIMPLEX, TETRA_EDGES, TETRA10, 2, tetra_rule_of_14(), FOUR[0], QUARTER),
    9: Solid(CUBE, HEX_EDGES, BRICK8, 1, brick_rule(2), ZERO[None], ZERO, 3),
    48: Solid(CUBE, HEX_EDGES, BRICK20, 2, brick_rule(3), brick_rule(2)[0], ZERO),
    50: Solid(CUBE, HEX_EDGES, BRICK27, 2, brick_rule(3), brick_rule(2)[0], ZERO, 0,
              ((0, 3, 7, 4), (1, 2, 6, 5), (0, 1, 5, 4), (2, 3, 7, 6), (0, 1, 2, 3), (4, 5, 6, 7), tuple(range(8)))),
    8: Solid(PRISM, WEDGE_EDGES, WEDGE6, 1, _prism_rule(), THIRD[None], THIRD, 4),
    40: Solid(PRISM, WEDGE_EDGES, WEDGE15, 2, collapsed_prism_rule(3), _prism_rule()[0], THIRD),
    41: Solid(PRISM, WEDGE_EDGES, WEDGE18, 2, collapsed_prism_rule(3), _prism_rule()[0], THIRD, 0, ((0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5))),
    7: Solid(APEX, PYRAMID_EDGES, PYRAMID5, 1, pyramid_rule(2), MEAN[None], MEAN),
    39: Solid(APEX, PYRAMID_EDGES, PYRAMID13, 2, pyramid_rule(3), pyramid_rule(2)[0], MEAN),
}


def monomials(x: np.ndarray, exponents: np.ndarray) -> np.ndarray:
    """x^a y^b z^c at points whose coordinates come last; a pole is zero, at the apex of a pyramid."""
    powers = [np.ones_like(x), x, x * x]
    if exponents.min() < 0:  # as powers[-1] and so on
        inverse = np.divide(1, x, out=np.zeros_like(x), where=x != 0)
        powers += [inverse**3, inverse**2, inverse]
    return np.stack([powers[a][..., 0] * powers[b][..., 1] * powers[c][..., 2] for a, b, c in exponents], axis=-1)


def elasticity(part: dict[str, Any]) -> np.ndarray:
    """Stresses of unit strains, 6 x 6. Of an orthotropic part those of the isotropic one with its mean moduli, since they only
    weigh strains here."""
    of = part.get("orthotropic")
    young, poisson = (np.mean(of["young"]), np.mean(of["poisson"])) if of else (part["young"], part["poisson"])
    shear = young / (2 * (1 + poisson))
    D = np.diag([2 * shear] * 3 + [shear] * 3)
    D[:3, :3] += 2 * shear * poisson / (1 - 2 * poisson)
    return D


def strain_operator(gradients: np.ndarray) -> np.ndarray:
    """Strains of unit displacements of nodes, (..., 6, 3 n), from gradients (..., 3, n)."""
    B = np.zeros((*gradients.shape[:-2], 6, gradients.shape[-1], 3))
    x, y, z = (gradients[..., k, :] for k in range(3))
    for row, component, value in ((0, 0, x), (1, 1, y), (2, 2, z), (3, 0, y), (3, 1, x), (4, 1, z), (4, 2, y), (5, 0, z), (5, 2, x)):
        B[..., row, :, component] = value
    return B.reshape(*B.shape[:-2], -1)


class Elements:
    """Elements of one kind: places and strains of displacements at points of the reference element."""

    def __init__(self, kind: Solid, places: np.ndarray, D: np.ndarray) -> None:
        """places: (element, node, 3). D: elasticity of each element."""
        self.kind, self.places, self.D = kind, places, D

    def _jacobians(self, xi: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        natural = self.kind.gradients(xi)
        J = np.einsum("qkn,enl->eqkl", natural, self.places)
        return natural, J, np.linalg.det(J)

    def at(self, xi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Places (element, point, 3) and determinants of the Jacobian (element, point)."""
        return np.einsum("qn,enl->eql", self.kind.values(xi), self.places), self._jacobians(xi)[2]

    def operators(self, xi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Strains of unit displacements and of unit incompatible modes: (element, point, 6, columns)."""
        natural, J, det = self._jacobians(xi)
        B = strain_operator(np.linalg.solve(J, np.broadcast_to(natural, (len(J), *natural.shape))))
        if not self.kind.modes:
            return B, np.zeros((*B.shape[:3], 0))
        _, J0, det0 = self._jacobians(self.kind.centre[None])
        inner = np.linalg.solve(J0, np.broadcast_to(self.kind.mode_gradients(xi), (len(J), len(xi), 3, self.kind.modes)))
        return B, strain_operator(inner * (det0 / det)[..., None, None])

    @cached_property
    def amplitudes(self) -> np.ndarray:
        """Amplitudes of the incompatible modes under unit displacements: they do no work with what they add."""
        points, weights = self.kind.rule
        B, G = self.operators(points)
        w = weights * self._jacobians(points)[2]
        K = np.einsum("eqia,eij,eqjb,eq->eab", G, self.D, G, w, optimize=True)
        return -np.linalg.solve(K, np.einsum("eqia,eij,eqjb,eq->eab", G, self.D, B, w, optimize=True))

    def displacements(self, xi: np.ndarray, u: np.ndarray) -> np.ndarray:
        """(element, point, 3, field) of nodal displacements (element, node, 3, field)."""
        moved = np.einsum("qn,enkf->eqkf", self.kind.values(xi), u)
        if not self.kind.modes:
            return moved
        inner = (self.amplitudes @ u.reshape(len(u), -1, u.shape[-1])).reshape(len(u), -1, 3, u.shape[-1])
        return moved + np.einsum("qm,emkf->eqkf", self.kind.mode_values(xi), inner)

    def strains(self, xi: np.ndarray, u: np.ndarray) -> np.ndarray:
        """(element, point, 6, field) of nodal displacements (element, node, 3, field)."""
        B, G = self.operators(xi)
        u = u.reshape(len(u), -1, u.shape[-1])
        strain = np.einsum("eqia,eaf->eqif", B, u)
        return strain if not self.kind.modes else strain + np.einsum("eqia,eaf->eqif", G, self.amplitudes @ u)
