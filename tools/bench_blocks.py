"""The elastic block on a moving belt of tools/bench: matrices, sliding start, scene."""

from squeal import common

common.needs("numpy", "scipy")
import numpy as np
import scipy.sparse as sparse
import scipy.sparse.linalg as linalg

BLOCKS = {"b1k": (8, 8, 4), "b3k": (12, 12, 6), "b10k": (20, 20, 8), "b32k": (32, 32, 10)}
MU, BELT = 0.4, 2.0


def brick(edges, young, poisson, density):
    """Stiffness and mass of an 8-node brick, trilinear, 2 x 2 x 2 Gauss points."""
    corners = np.array([[i, j, k] for k in (-1, 1) for j in (-1, 1) for i in (-1, 1)], float)
    law = np.zeros((6, 6))
    law[:3, :3] = poisson
    law[range(3), range(3)] = 1 - poisson
    law[range(3, 6), range(3, 6)] = (1 - 2 * poisson) / 2
    law *= young / ((1 + poisson) * (1 - 2 * poisson))
    stiffness, mass, half = np.zeros((24, 24)), np.zeros((24, 24)), np.asarray(edges) / 2
    for point in corners / np.sqrt(3):
        factors = 1 + corners * point
        shape = factors.prod(axis=1) / 8
        slope = [corners[:, a] * np.delete(factors, a, 1).prod(axis=1) / 8 / half[a] for a in range(3)]
        strain = np.zeros((6, 24))
        for a in range(3):
            strain[a, a::3] = slope[a]
        strain[3, 0::3], strain[3, 1::3] = slope[1], slope[0]
        strain[4, 1::3], strain[4, 2::3] = slope[2], slope[1]
        strain[5, 0::3], strain[5, 2::3] = slope[2], slope[0]
        stiffness += strain.T @ law @ strain * half.prod()
        mass += density * half.prod() * np.kron(np.outer(shape, shape), np.eye(3))
    return stiffness, mass


def block_on_belt(nx, ny, nz):
    """M C K B F of the free degrees of freedom; the rows of B are n, t1, t2 of each bottom node."""
    stiffness, mass = brick((0.1 / nx, 0.1 / ny, 0.1 / nz), 1e10, 0.3, 2500.0)
    node = np.arange((nx + 1) * (ny + 1) * (nz + 1)).reshape(nz + 1, ny + 1, nx + 1)
    corner = [node[z : nz + z, y : ny + y, x : nx + x].ravel() for z in (0, 1) for y in (0, 1) for x in (0, 1)]
    dofs = (3 * np.array(corner).T[:, :, None] + np.arange(3)).reshape(-1, 24)
    rows, columns, n = np.repeat(dofs, 24, 1).ravel(), np.tile(dofs, (1, 24)).ravel(), 3 * node.size
    K = sparse.csr_matrix((np.tile(stiffness.ravel(), len(dofs)), (rows, columns)), (n, n))
    M = sparse.csr_matrix((np.tile(mass.ravel(), len(dofs)), (rows, columns)), (n, n))
    top = (3 * node[-1].ravel()[:, None] + np.arange(3)).ravel()
    free, pressed = np.setdiff1d(np.arange(n), top), np.zeros(n)
    pressed[3 * node[-1].ravel() + 2] = -1e6 * 0.1 / 1e10
    F = -(K @ pressed)[free]
    K, M = K[free][:, free].tocsr(), M[free][:, free].tocsr()
    bottom = node[0].ravel()
    picked = np.stack([3 * bottom + 2, 3 * bottom, 3 * bottom + 1], 1).ravel()
    B = sparse.csr_matrix((np.ones(len(picked)), (np.arange(len(picked)), picked)), (len(picked), len(free)))
    return M, (20 * M + 2e-7 * K).tocsr(), K, B, F


def sliding_start(M, K, B, F):
    """Sliding equilibrium by statuses, and noise on the velocities away from contact."""
    normal, along, solve = B[0::3], B[1::3], linalg.splu(K.tocsc()).solve
    free, influence = solve(F), solve((normal + MU * along).T.toarray())
    compliance, gap, closed = normal @ influence, normal @ free, np.ones(normal.shape[0], bool)
    for _ in range(60):
        reaction = np.zeros(len(closed))
        reaction[closed] = np.linalg.solve(compliance[np.ix_(closed, closed)], -gap[closed])
        fits = np.where(closed, reaction > 0, gap + compliance @ reaction < -1e-14)
        if (fits == closed).all():
            break
        closed = fits
    u = free + influence @ reaction
    v = 1e-3 * np.random.default_rng(0).standard_normal(len(F))
    v[B.indices] = 0
    u[normal.indices[closed]] = -1e-12  # strictly closed: rounding must not decide which pairs take part
    return u, v


def write_matrices(folder, M, C, K, B, F):
    pairs = B.shape[0] // 3
    for name, A in (("M", M), ("C", C), ("K", K), ("B", B)):
        common.write_petsc(folder / f"{name}.petsc", A)
    for name, x in (("F", F), ("gap", np.zeros(pairs)), ("drive", np.tile([BELT, 0.0], pairs))):
        common.write_petsc(folder / f"{name}.petsc", x)


def write_scene(folder, M, C, K, B, F, u, v):
    write_matrices(folder, M, C, K, B, F)
    common.write_petsc(folder / "state", u, v)
    arrays = {f"{k}_{part}": getattr(A, part) for k, A in dict(M=M, C=C, K=K, B=B).items()
              for part in ("data", "indices", "indptr", "shape")}
    np.savez(folder / "all.npz", **arrays, F=F, u=u, v=v)
