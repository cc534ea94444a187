#!/usr/bin/env python3
"""Makes arm.pch and nodes.csv: a clamped steel arm as Nastran writes a reduced structure, by Craig and Bampton (1968).

Twenty Euler-Bernoulli elements along y, 140 mm long, 16 mm wide in x and 8 mm high in z. The free end keeps its six motions;
eight modes with this end held follow as scalar points. Lengths are in mm, forces in N, masses in t.
"""

from pathlib import Path

import numpy as np
import scipy.linalg

FOLDER = Path(__file__).parent
LENGTH, WIDTH, HEIGHT, ELEMENTS, MODES = 140.0, 16.0, 8.0, 20, 8
YOUNG, SHEAR, DENSITY = 210e3, 210e3 / 2.6, 7.85e-9
TIP = 1001


def bar(stiffness, inertia):
    """Stiffness and consistent mass of a two-node bar in extension or torsion, per length of the element."""
    return stiffness * np.array([[1, -1], [-1, 1]]), inertia / 6 * np.array([[2, 1], [1, 2]])


def beam(bending, line_mass, h):
    """Of a deflection w and a rotation w' at each end."""
    K = bending / h**3 * np.array([[12, 6 * h, -12, 6 * h], [6 * h, 4 * h * h, -6 * h, 2 * h * h],
                                   [-12, -6 * h, 12, -6 * h], [6 * h, 2 * h * h, -6 * h, 4 * h * h]])
    M = line_mass * h / 420 * np.array([[156, 22 * h, 54, -13 * h], [22 * h, 4 * h * h, 13 * h, -3 * h * h],
                                        [54, 13 * h, 156, -22 * h], [-13 * h, -3 * h * h, -22 * h, 4 * h * h]])
    return K, M


def arm():
    """Matrices of the nodes from the clamped end to the free one, six motions each; the clamped end is left out."""
    h, area = LENGTH / ELEMENTS, WIDTH * HEIGHT
    about_x, about_z = WIDTH * HEIGHT**3 / 12, HEIGHT * WIDTH**3 / 12
    torsion = WIDTH * HEIGHT**3 * (1 / 3 - 0.21 * HEIGHT / WIDTH * (1 - (HEIGHT / WIDTH) ** 4 / 12))
    x, y, z, rx, ry, rz = range(6)
    parts = [([y, y + 6], bar(YOUNG * area / h, DENSITY * area * h), [1, 1]),
             ([ry, ry + 6], bar(SHEAR * torsion / h, DENSITY * (about_x + about_z) * h), [1, 1]),
             ([z, rx, z + 6, rx + 6], beam(YOUNG * about_x, DENSITY * area, h), [1, 1, 1, 1]),
             ([x, rz, x + 6, rz + 6], beam(YOUNG * about_z, DENSITY * area, h), [1, -1, 1, -1])]  # rz = -dx/dy
    K, M = np.zeros((2, 6 * ELEMENTS + 6, 6 * ELEMENTS + 6))
    for e in range(ELEMENTS):
        for rows, matrices, sign in parts:
            own = 6 * e + np.array(rows)
            for A, part in zip((K, M), matrices):
                A[np.ix_(own, own)] += part * np.outer(sign, sign)
    return K[6:, 6:], M[6:, 6:]


def reduced(K, M):
    """Static shapes of the last six rows, and modes with these held. Columns: kept rows, then modes."""
    kept, inner = slice(len(K) - 6, None), slice(0, len(K) - 6)
    _, modes = scipy.linalg.eigh(K[inner, inner], M[inner, inner], subset_by_index=(0, MODES - 1))
    T = np.zeros((len(K), 6 + MODES))
    T[kept, :6] = np.eye(6)
    T[inner, :6] = -np.linalg.solve(K[inner, inner], K[inner, kept])
    T[inner, 6:] = modes
    return T.T @ K @ T, T.T @ M @ T


def write_dmig(file, matrices):
    names = [(TIP, motion) for motion in range(1, 7)] + [(9001 + mode, 0) for mode in range(MODES)]
    lines = []
    for name, A in matrices.items():
        scale = np.sqrt(np.diag(A))
        lines.append(f"DMIG,{name},0,6,2,0,,,{len(names)}")
        for j, (node, motion) in enumerate(names):
            lines.append(f"DMIG*   {name:16}{node:16d}{motion:16d}")
            lines += [f"*,{names[i][0]},{names[i][1]},{A[i, j]:.15e}" for i in range(j, len(names))
                      if abs(A[i, j]) > 1e-10 * scale[i] * scale[j]]
    file.write_text("\n".join(lines) + "\n")


K, M = reduced(*arm())
write_dmig(FOLDER / "arm.pch", {"KAAX": K, "MAAX": M})
(FOLDER / "nodes.csv").write_text(f"{TIP}, 90, 0, 25\n")
