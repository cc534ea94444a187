"""Contact of meshes that do not match: Hertz's line contact, the disc brake meshed apart."""

import subprocess
import sys

import h5py
import numpy as np
import pytest
from conftest import INPUTS, ROOT
from models import Mesh, bricks, bricks20, lattice, quads, tetrahedra10, triangles6, write_scene

OFF = {"enabled": False}


def quads8(nodes):
    """8-node cells, gmsh's order, of a lattice (2n+1, 2m+1) of node numbers."""
    places = ((0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1))
    n = [size - 2 for size in nodes.shape]
    return np.stack([nodes[i:n[0] + i:2, j:n[1] + j:2].ravel() for i, j in places], axis=-1)


def graded(first, fine, ratio, end):
    """Places from 0 in steps of `first` up to `fine`, then in growing steps to `end`."""
    places = list(np.linspace(0, fine, round(fine / first) + 1))
    step = first
    while places[-1] < end:
        step *= ratio
        places.append(places[-1] + step)
    return np.array(places)


def with_middles(places):
    return np.interp(np.arange(2 * len(places) - 1) / 2, np.arange(len(places)), places)


CELLS = {"brick": ("quad", bricks, quads), "brick20": ("quad8", bricks20, quads8),
         "tetrahedron10": ("triangle6", tetrahedra10, triangles6)}


def body(mesh, name, x, z, width, height, kind):
    """A slab of one cell across y; its surface is z = height(x), z grows away from it."""
    y = np.array([0, width])
    face_kind, solids, faces = CELLS[kind]
    if kind != "brick":
        x, y, z = map(with_middles, (x, y, z))
    grid = np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1)
    grid[..., 2] += height(grid[..., 0]) * np.clip(1 - np.abs(grid[..., 2]) / np.abs(z).max(), 0, 1)
    nodes = mesh.add_nodes(grid)
    mesh.add(name, kind, solids(nodes))
    for face, k in (("face", 0), ("end", -1)):
        mesh.add(f"{name}:{face}", face_kind, faces(nodes[:, :, k]))
    mesh.add_points("x=0", nodes[0])
    mesh.add_points("sides", nodes.reshape(-1))
    return nodes


def line_contact(converged, folder, per_radius, kind, ratio):
    """Errors of radius (from the second moment, a^2/4) and peak pressure; spacing of nodes a/per_radius on the slave.
    The coarse mesh is on two ranks, the finer ones on one."""
    radius, a, young, poisson, width = 1.0, 0.02, 1e9, 0.3, 0.01
    stiffness = young / (2 * (1 - poisson**2))
    load = np.pi * a**2 * stiffness / (4 * radius)  # a metre of length
    peak = 2 * load / (np.pi * a)
    step = a / per_radius * (1 if kind == "brick" else 2)
    mesh = Mesh()
    for name, h, sign in (("plane", ratio * step, -1), ("cylinder", step, 1)):
        x, z = graded(h, 1.5 * a, 1.3, 40 * a), sign * graded(h, 0.6 * a, 1.3, 40 * a)
        body(mesh, name, x, z, width, (lambda s: np.minimum(s, 3 * a)**2 / (2 * radius)) if sign > 0 else (lambda s: 0 * s),
             kind)
    mesh.write(folder / "bodies.msh")
    end = graded(step, 1.5 * a, 1.3, 40 * a)[-1]
    scene = write_scene(folder, title="line contact", mesh={"file": "bodies.msh"}, modes=OFF, estimate=OFF,
                        friction={"coefficient": 0.0},
                        part=[{"name": name, "young": young, "poisson": poisson, "density": 1} for name in ("plane", "cylinder")],
                        contact=[{"rotor": "plane:face", "stator": "cylinder:face", "normal": "z", "reach": 1e-3}],
                        pressure=[{"on": "cylinder:end", "value": load / 2 / end}],
                        support=[{"on": "plane:end", "fixed": "z"}, {"on": "x=0", "fixed": "x"}, {"on": "sides", "fixed": "y"}])
    run = converged(scene, ranks=2 if per_radius == 6 else 1)
    with h5py.File(run.output / "fields.h5") as fields:
        x, force = fields["pairs/position"][:, 0], fields["pairs/reaction"][:, 0]
        pressure = fields["pairs/pressure"][:]
    assert force.sum() == pytest.approx(load / 2 * width, rel=1e-9)
    found = 2 * np.sqrt((force * x**2).sum() / force.sum())
    return found / a - 1, pressure.max() / peak - 1, run.report["equilibrium"]["iterations"]


@pytest.mark.parametrize("kind, sizes, bound", [("brick", (6, 12, 24), 0.013), ("brick20", (6, 12), 0.013),
                                                ("tetrahedron10", (6, 12), 0.018)])
def test_a_cylinder_presses_as_hertz_says(converged, tmp_path, kind, sizes, bound):
    """The plane's elements are 1.5 times as long as the cylinder's. With 6, 12 and 24 nodes a contact radius the radius is
    off by 0.38, 0.11, 0.016 % (8-node bricks), 1.09, 0.34, 0.10 % (20-node bricks) and 1.50, 0.37, 0.11 % (10-node
    tetrahedra): second order. The bound is a fifth above the largest at 6 and falls with order 1.6; quadratic elements run
    without 24. Peak pressures are off by 0.72, 0.003, 0.098 %, by 0.18, 0.05, 0.007 % and by 0.70, 0.10, 0.013 %: second
    order of quadratic elements, first order bounds all. Matching meshes have radii off by 0.75, 0.15, 0.026 %, by 1.12,
    0.41, 0.10 % and by 1.14, 0.43, 0.11 %. Status iterations: below 30 on all meshes."""
    found = {}
    for n in sizes:
        for ratio in (1.5, 1.0):
            folder = tmp_path / f"{n} {ratio}"
            folder.mkdir()
            found[n, ratio] = line_contact(converged, folder, n, kind, ratio)
        radius, peak, iterations = found[n, 1.5]
        assert abs(radius) < bound * (6 / n)**1.6
        assert abs(peak) < 0.01 * 6 / n
        assert max(iterations, found[n, 1.0][2]) < 30
    assert abs(found[6, 1.5][0]) > (sizes[-1] / 6)**1.5 * abs(found[sizes[-1], 1.5][0])  # squares at second order


def test_the_disc_brake_meshed_apart(converged):
    """10-node tetrahedra: 1 and 2 ranks agree, all of the pistons' force passes through the pads, moments balance."""
    one, two = (converged(INPUTS / "disc_brake" / "scene.toml", "--set", "transient.periods=1", ranks=ranks).report
                  for ranks in (1, 2))
    assert len(one["modes"]["modes"]) > 20
    for a, b in zip(one["modes"]["modes"], two["modes"]["modes"], strict=True):
        assert b["frequency_hz"] == pytest.approx(a["frequency_hz"], rel=1e-9)
        assert b["growth_rate"] == pytest.approx(a["growth_rate"], rel=1e-6, abs=1e-6)
    assert one["modes"]["unstable_count"] == 3
    # Each pad is a sector of 50 degrees between 85 and 135 mm under 1 MPa; its sides' chords take 1e-4 of it.
    force = 1e6 * np.radians(50) / 2 * (0.135**2 - 0.085**2)
    for contact in one["equilibrium"]["contacts"]:
        assert contact["normal_force_sum"] == pytest.approx(force, rel=2e-4)
        assert 0.5 * 0.085 * force < contact["torque"] < 0.5 * 0.135 * force
    for contact in one["model"]["contacts"]:
        assert contact["covered_area"] == pytest.approx(contact["slave_area"], rel=1e-12)
        assert contact["offset"] < 1e-12
    assert one["transient"]["energy_defect_max"] < 1e-10


def test_what_faces_nothing_is_told(converged, tmp_path):
    """The upper block hangs over by a quarter, in linear tetrahedra: two warnings, and the force balances."""
    mesh = Mesh()
    cut = [(0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)]
    for name, n, low, shift in (("lower", 4, 0, 0), ("upper", 3, 1, 0.25)):
        nodes = mesh.add_nodes(lattice((n, n, 2), lambda x, y, z: (x + shift, y, z + low)))
        mesh.add(name, "tetrahedron", np.concatenate([bricks(nodes)[:, c] for c in cut]))
        for face, k in (("bottom", 0), ("top", -1)):
            cells = quads(nodes[:, :, k])
            mesh.add(f"{name}:{face}", "triangle", np.concatenate([cells[:, [0, 1, 2]], cells[:, [0, 2, 3]]]))
    mesh.write(tmp_path / "bodies.msh")
    scene = write_scene(tmp_path, title="overhang", mesh={"file": "bodies.msh"}, modes=OFF, estimate=OFF,
                        friction={"coefficient": 0.0},
                        part=[{"name": name, "young": 1e9, "poisson": 0.3, "density": 1} for name in ("lower", "upper")],
                        contact=[{"rotor": "lower:top", "stator": "upper:bottom"}],
                        pressure=[{"on": "upper:top", "value": 1e6}],
                        support=[{"on": "lower:bottom", "fixed": "all"}, {"on": "upper:top", "fixed": "x y"}])
    report = converged(scene).report
    stiff, uncovered, *_ = report["model"]["warnings"]  # the density of 1 is warned of too
    assert stiff.startswith("300 4-node tetrahedra") and "Mesh.ElementOrder = 2" in stiff
    assert uncovered.startswith("25 % of the area of 'upper:bottom' does not face 'lower:top'")
    assert report["model"]["contacts"][0]["covered_area"] == pytest.approx(0.75, rel=1e-12)
    assert report["equilibrium"]["normal_force_sum"] == pytest.approx(1e6, rel=1e-9)


def test_bricks_become_tetrahedra_that_still_match(converged, tmp_path):
    """Two stacked blocks of 2 x 2 x 2 bricks by jobs/tetrahedra.py: a pair at each of 5 x 5 corners and mid-sides, and a
    uniform pressure through them to 1e-10."""
    mesh = Mesh()
    for name, low in (("lower", 0), ("upper", 1)):
        nodes = mesh.add_nodes(lattice((2, 2, 2), lambda x, y, z: (x + 0.2 * x * y, y - 0.1 * x, low + z)))
        mesh.add(name, "brick", bricks(nodes))
        for face, k in (("bottom", 0), ("top", -1)):
            mesh.add(f"{name}:{face}", "quad", quads(nodes[:, :, k]))
    mesh.write(tmp_path / "bricks.msh")
    subprocess.run([sys.executable, ROOT / "jobs" / "tetrahedra.py", tmp_path / "bricks.msh", tmp_path / "bodies.msh"], check=True)
    scene = write_scene(tmp_path, title="split", mesh={"file": "bodies.msh"}, modes=OFF, estimate=OFF,
                        friction={"coefficient": 0.0},
                        part=[{"name": name, "young": 1e9, "poisson": 0.0, "density": 1} for name in ("lower", "upper")],
                        contact=[{"rotor": "lower:top", "stator": "upper:bottom"}],
                        pressure=[{"on": "upper:top", "value": 1e6}],
                        support=[{"on": "lower:bottom", "fixed": "all"}, {"on": "upper:top", "fixed": "x y"}])
    run = converged(scene, ranks=1)
    assert run.report["model"]["elements"] == 2 * 8 * 6
    with h5py.File(run.output / "fields.h5") as fields:
        assert fields["pairs/pressure"][:] == pytest.approx(np.full(25, 1e6), rel=1e-10)
