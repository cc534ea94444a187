"""Contact at rest against exact answers: patch, series stack, overturning block, Hertz, and the sums of every scene."""


import h5py
import numpy as np
import pytest
from conftest import INPUTS
from models import STEEL, Mesh, bricks, bricks20, lattice, quads, write_scene

both = pytest.mark.parametrize("ranks", [1, 2])
OFF = {"enabled": False}


def block(mesh, name, positions, kind="brick"):
    """A block of bricks with its lower and upper faces, and its nodes on x = 0 and on y = 0, as named groups."""
    nodes = mesh.add_nodes(positions)
    mesh.add(name, "brick", bricks(nodes))
    for face, k in (("lower", 0), ("upper", -1)):
        mesh.add(f"{name}:{face}", "quad", quads(nodes[:, :, k]))
    mesh.add_points("x=0", nodes[0])
    mesh.add_points("y=0", nodes[:, 0])
    return nodes


def at_rest(squeal, folder, ranks, mesh, friction=0.0, velocity=(0, 0, 0), **tables):
    mesh.write(folder / "bodies.msh")
    scene = write_scene(folder, title="at rest", mesh={"file": "bodies.msh"}, modes=OFF, estimate=OFF,
                        friction={"coefficient": friction}, **tables)
    return squeal(scene, ranks=ranks)


def normal_reactions(run, positions):
    """Of the pairs at these places (…, 3): both nodes of a pair have its reaction, and squeal numbers them anew."""
    with h5py.File(run.output / "fields.h5") as fields:
        nodes, reaction = fields["mesh/nodes"][:], fields["equilibrium/normal_reaction"][:]
    distance = np.linalg.norm(np.asarray(positions)[..., None, :] - nodes, axis=-1)
    assert distance.min(axis=-1).max() < 1e-9
    return reaction[distance.argmin(axis=-1)]


def tributary_areas(x, cells, nodes):
    """Integral of each bilinear shape function over the plane faces: mean Jacobian and a third of its own excess."""
    area = np.zeros(len(x))
    for cell in cells:
        p = x[cell]
        corner = [np.cross(p[(i + 1) % 4] - p[i], p[i - 1] - p[i])[2] / 4 for i in range(4)]
        area[cell] += np.abs(np.mean(corner) + (corner - np.mean(corner)) / 3)
    return area[nodes]


@both
def test_a_uniform_pressure_passes_through_a_skew_interface(converged, tmp_path, ranks):
    """Two stacked blocks, matching skew 4-node faces: every reaction is pressure x tributary area, 1e-10."""
    def place(low, high):
        def skew(x, y, z):
            bump = x * (1 - x) * y * (1 - y)
            return x + bump * (.8 - y), y + bump * (x - .3), low + (high - low) * z

        return skew

    mesh = Mesh()
    block(mesh, "base", lattice((4, 3, 2), place(0, .5)))
    stator = block(mesh, "block", lattice((4, 3, 2), place(.5, 1.5)))
    mesh.add_points("ground", np.arange(len(mesh.nodes))[np.array(mesh.nodes)[:, 2] == 0])
    run = at_rest(converged, tmp_path, ranks, mesh, pressure=[{"on": "block:upper", "value": 3e6}],
                  part=[{"name": "base", **STEEL}, {"name": "block", "young": 5e9, "poisson": 0.25, "density": 2000}],
                  contact=[{"rotor": "base:upper", "stator": "block:lower"}],
                  support=[{"on": "ground", "fixed": "z"}, {"on": "x=0", "fixed": "x"}, {"on": "y=0", "fixed": "y"}])
    face = stator[:, :, 0]
    x = np.array(mesh.nodes)
    area = tributary_areas(x, quads(face), face)
    assert area.sum() == pytest.approx(1)
    assert normal_reactions(run, x[face]) == pytest.approx(3e6 * area, rel=1e-10)


@both
def test_quadratic_faces_carry_a_uniform_pressure(converged, tmp_path, ranks):
    """One 20-node brick on another: pressure over area of every pair is what presses on top, 1e-10."""
    mesh = Mesh()
    for name, low in (("base", 0), ("block", 1)):
        nodes = mesh.add_nodes(lattice((2, 2, 2), lambda x, y, z: (x, y, low + z)))
        mesh.add(name, "brick20", bricks20(nodes))
        face = nodes[:, :, 0 if low else 2]
        mesh.add(name + ":face", "quad8", [[face[i, j] for i, j in ((0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2),
                                                                    (0, 1))]])
        end = nodes[:, :, 2 if low else 0]
        mesh.add(name + ":end", "quad8", [[end[i, j] for i, j in ((0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2),
                                                                  (0, 1))]])
    run = at_rest(converged, tmp_path, ranks, mesh,
                  part=[{"name": name, "young": 1e9, "poisson": 0.0, "density": 1} for name in ("base", "block")],
                  contact=[{"rotor": "base:face", "stator": "block:face"}], pressure=[{"on": "block:end", "value": 3e6}],
                  support=[{"on": "base:end", "fixed": "x y z"}, {"on": "block:end", "fixed": "x y"}])
    with h5py.File(run.output / "fields.h5") as fields:
        pairs = fields["pairs"]
        assert len(pairs["area"]) == 8 and pairs["area"][:].sum() == pytest.approx(1, rel=1e-12)
        assert pairs["pressure"][:] == pytest.approx(3e6, rel=1e-10)
        assert pairs["reaction"][:, 0] == pytest.approx(3e6 * pairs["area"][:], rel=1e-10)
        pressure = fields["equilibrium/pressure"][:]
        assert sorted(pressure[pressure != 0]) == pytest.approx([3e6] * 16, rel=1e-10)


def quads8(nodes):
    """8-node cells of a lattice of twice as many divisions."""
    places = ((0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1))
    n, m = (size - 2 for size in nodes.shape)
    return np.stack([nodes[i:n + i:2, j:m + j:2].ravel() for i, j in places], axis=-1)


@both
def test_springs_in_series(converged, tmp_path, ranks):
    """A pad of 50 x 50 x 20 mm on 45 mm of steel, 500 N, no Poisson effect: each a spring of its own, 1e-11."""
    mesh = Mesh()
    block(mesh, "disc", lattice((3, 3, 4), lambda x, y, z: (.05 * x, .05 * y, .045 * (z - 1))))
    block(mesh, "pad", lattice((3, 3, 2), lambda x, y, z: (.05 * x, .05 * y, .02 * z)))
    mesh.add_points("ground", np.arange(len(mesh.nodes))[np.array(mesh.nodes)[:, 2] == -.045])
    run = at_rest(converged, tmp_path, ranks, mesh, pressure=[{"on": "pad:upper", "value": 500 / .05**2}],
                  part=[{"name": "disc", "young": 210e9, "poisson": 0.0, "density": 1},
                        {"name": "pad", "young": 1e9, "poisson": 0.0, "density": 1}],
                  contact=[{"rotor": "disc:upper", "stator": "pad:lower"}],
                  support=[{"on": "ground", "fixed": "z"}, {"on": "x=0", "fixed": "x"}, {"on": "y=0", "fixed": "y"}],
                  probe=[{"name": name, "on": name, "at": [.02, .01, 1.0], "direction": "z"}
                         for name in ("pad:upper", "pad:lower", "disc:upper")])
    equilibrium = run.report["equilibrium"]
    interface = -500 * .045 / (210e9 * .05**2)
    assert equilibrium["probes"] == pytest.approx({"pad:upper": interface - 500 * .02 / (1e9 * .05**2),
                                                   "pad:lower": interface, "disc:upper": interface}, rel=1e-11)
    assert equilibrium["normal_force_sum"] == pytest.approx(500, rel=1e-11)


@both
@pytest.mark.parametrize("mu", [0.2, 0.4, 0.66, 0.67])
def test_a_block_dragged_sideways_leans_on_one_foot_until_it_tips(squeal, tmp_path, mu, ranks):
    """Width .2, held sideways at height .15, weight 100: the feet carry 50 +- 100 mu .15/.2, and none can beyond mu = 2/3."""
    mesh = Mesh()
    floor = block(mesh, "floor", lattice((1, 1, 1), lambda x, y, z: (.2 * x, .1 * y, .05 * (z - 1))))
    body = block(mesh, "block", lattice((1, 1, 2), lambda x, y, z: (.2 * x, .1 * y, .3 * z)))
    mesh.add_points("ground", floor[:, :, 0])
    mesh.add_points("middle", body[:, :, 1])
    run = at_rest(squeal, tmp_path, ranks, mesh, mu, force=[{"on": "middle", "vector": [0, 0, -100]}],
                  part=[{"name": name, "young": 210e9, "poisson": 0.3, "density": 1} for name in ("floor", "block")],
                  contact=[{"rotor": "floor:upper", "stator": "block:lower", "velocity": [1.0, 0, 0]}],
                  support=[{"on": "ground", "fixed": "all"}, {"on": "middle", "fixed": "x"}, {"on": "block", "fixed": "y"}])
    equilibrium = run.report["equilibrium"]
    if mu > 2 / 3:
        assert run.code == 2 and equilibrium["outcome"] == "no equilibrium"
        assert "tips" in equilibrium["reason"] or "friction is too large" in equilibrium["reason"]
        return
    assert run.code == 0
    feet = normal_reactions(run, np.array(mesh.nodes)[body[:, :, 0]]).sum(axis=1)
    lean = 100 * mu * .15 / .2
    assert np.sort(feet) == pytest.approx([50 - lean, 50 + lean], rel=1e-10)


@both
@pytest.mark.parametrize("scene, clamp, springs", [
    ("oscillator", 1.0, {}), ("pin_on_disc", 100.0, {"holder": 1e6}),
    ("tgv", 2000.0, {})])
def test_every_scene_carries_its_clamp_force(converged, scene, clamp, springs, ranks):
    """Reactions and the springs beside them together carry the clamp force; friction is mu times each reaction, and
    brakes the rotation by mu sum(r_n R): 1e-9, the equilibrium's own residual being about 1e-12 of the clamp force."""
    small = {"tgv": ["--set", "mesh.parameters.size=4000"]}.get(scene, [])
    run = converged(INPUTS / scene / "scene.toml", *small, "--set", "modes.enabled=false", "--set",
                    "transient.enabled=false", "--set", "cycle.enabled=false", ranks=ranks)
    equilibrium, mu = run.report["equilibrium"], 0.2 if scene == "tgv" else 0.3
    with h5py.File(run.output / "fields.h5") as fields:
        x, part = fields["mesh/nodes"][:], fields["equilibrium"]
        r_n, r_t = part["normal_reaction"][:], part["friction_reaction"][:]
    assert r_t == pytest.approx(mu * r_n, rel=1e-9, abs=1e-12 * clamp)
    if scene == "oscillator":  # y of the disc's spring and of the pad's: 1.2 y2 = -r_n, and the pad's own share
        K = np.array([[1.1, -.1], [-.1, .5]])
        u = [equilibrium["probes"]["pad_x"], equilibrium["probes"]["pad_y"]]
        assert K @ u == pytest.approx([mu * r_n.max(), r_n.max() - clamp], rel=1e-9)
        assert equilibrium["normal_force_sum"] == pytest.approx(-1.2 * u[1], rel=1e-9)
        return
    held = sum(stiffness * equilibrium["probes"][name] for name, stiffness in springs.items())
    assert equilibrium["normal_force_sum"] - held == pytest.approx(clamp, rel=1e-9)
    # each pair counts at both of its nodes
    torque = mu * (r_n * np.hypot(x[:, 0], x[:, 1])).sum() / 2
    assert sum(contact["torque"] for contact in equilibrium["contacts"]) == pytest.approx(torque, rel=1e-9)


def graded(size, n, ratio, end):
    """n equal sizes, then growing ones up to the end."""
    steps = [size] * n
    while sum(steps) < end:
        steps.append(steps[-1] * ratio)
    return np.concatenate([[0], np.cumsum(steps)])


def half_space(mesh, name, r, z, profile, segments=8):
    """A quarter of a cylinder: wedges round the axis, bricks around them. Its circles are polygons of equal area."""
    angle = np.linspace(0, np.pi / 2, segments + 1)
    r = r / np.sqrt(np.sin(angle[1]) / angle[1])
    depth = abs(z) / abs(z).max()

    def at(radius, a, k):
        return radius * np.cos(a), radius * np.sin(a), z[k] + (1 - depth[k]) * profile(radius)

    levels = range(len(z))
    axis = mesh.add_nodes([at(0, 0, k) for k in levels])
    rings = mesh.add_nodes([[[at(radius, a, k) for k in levels] for a in angle] for radius in r[1:]])
    mesh.add(name, "brick", bricks(rings))
    inner = rings[0]
    for j in range(segments):
        below = np.stack([axis[:-1], inner[j, :-1], inner[j + 1, :-1]], axis=-1)
        mesh.add(name, "wedge", np.hstack([below, np.stack([axis[1:], inner[j, 1:], inner[j + 1, 1:]], axis=-1)]))
        mesh.add(f"{name}:end", "triangle", [[axis[-1], inner[j, -1], inner[j + 1, -1]]])
    near = r[1:] < 2 * 6.8753e-4
    faces = rings[near][:, :, 0]
    mesh.add(f"{name}:face", "quad", quads(faces))
    mesh.add(f"{name}:face", "triangle", [[axis[0], inner[j, 0], inner[j + 1, 0]] for j in range(segments)])
    mesh.add(f"{name}:end", "quad", quads(rings[:, :, -1]))
    mesh.add(f"{name}:side", "quad", quads(rings[-1]))
    mesh.add_points("y=0", np.concatenate([axis, rings[:, 0].ravel()]))
    mesh.add_points("x=0", np.concatenate([axis, rings[:, -1].ravel()]))
    return np.concatenate([[axis[0]], faces.ravel()])


@both
def test_a_sphere_presses_as_hertz_says(converged, tmp_path, ranks):
    """Steel, R = .05, 1000 N, ten bricks a contact radius, two half-spaces of 150 radii as in Hertz's theory. Approach
    within 1 %: the far boundary, held, takes .4/150 of it, the mesh the rest. Radius within 3 %, from the second moment
    of the reactions, 2 a^2/5: the circle itself is only known to a brick."""
    radius, load, a, approach, p0 = .05, 1000.0, 6.8753e-4, 9.4541e-6, 1.01007e9
    r, z = graded(a / 10, 13, 1.4, 110 * a), graded(a / 10, 6, 1.4, 110 * a)
    mesh = Mesh()
    half_space(mesh, "plane", r, -z, lambda s: 0)
    face = half_space(mesh, "sphere", r, z, lambda s: min(s, 2.5 * a)**2 / (2 * radius))
    run = at_rest(converged, tmp_path, ranks, mesh, part=[{"name": "plane", **STEEL}, {"name": "sphere", **STEEL}],
                  rigid_body=[{"name": "holder", "surfaces": ["sphere:end", "sphere:side"], "at": [0, 0, .1], "free": "z"}],
                  force=[{"on": "holder", "vector": [0, 0, -load / 4]}],
                  contact=[{"rotor": "plane:face", "stator": "sphere:face", "normal": "z", "reach": 1e-4}],
                  support=[{"on": "plane:end", "fixed": "all"}, {"on": "plane:side", "fixed": "all"},
                           {"on": "x=0", "fixed": "x"}, {"on": "y=0", "fixed": "y"}],
                  probe=[{"name": "holder", "on": "holder", "direction": "-z"}])
    x = np.array(mesh.nodes)[face]
    reaction, distance = normal_reactions(run, x), np.hypot(x[:, 0], x[:, 1])
    assert 4 * reaction.sum() == pytest.approx(load, rel=1e-9)
    found = np.sqrt(2.5 * (reaction * distance**2).sum() / reaction.sum())
    assert found == pytest.approx(a, rel=0.03)
    assert distance[reaction > 0].max() == pytest.approx(a, abs=a / 10)
    assert run.report["equilibrium"]["probes"]["holder"] == pytest.approx(approach, rel=0.01)
    assert 1.5 * load / (np.pi * found**2) == pytest.approx(p0, rel=0.06)  # twice that of the radius
