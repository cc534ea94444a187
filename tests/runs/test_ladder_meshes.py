"""Cases of the ladder whose surfaces in contact are meshed 3:2: bars that collide, a block that leans and one that slides.

Exact answers and tolerances are those of the matching cases in test_ladder_contact.py and test_ladder_motion.py. A pair
takes part of every node of the rotor's face below it; on flat surfaces force and moment pass to rounding."""

import h5py
import numpy as np
import pytest
from models import Mesh, bricks, lattice, quads, write_scene, write_state
from test_ladder_motion import history_of

both = pytest.mark.parametrize("ranks", [1, 2])
OFF = {"enabled": False}


class Bodies:
    """Boxes of bricks with their lower and upper faces, and forces that their nodes share as elements share a body force."""

    def __init__(self, folder):
        self.folder, self.mesh, self.force, self.part = folder, Mesh(), [], []

    def add(self, name, divisions, low, high, material):
        nodes = self.mesh.add_nodes(lattice(divisions, lambda *x: [a + (b - a) * t for a, b, t in zip(low, high, x)]))
        self.mesh.add(name, "brick", bricks(nodes))
        for face, k in (("lower", 0), ("upper", -1)):
            self.mesh.add(f"{name}:{face}", "quad", quads(nodes[:, :, k]))
        self.part.append({"name": name, **material})
        return nodes

    def pull(self, name, nodes, vector):
        """The whole force; a node's share is the product of 1 inside and 1/2 at an end, of each direction."""
        ends = [np.where(np.isin(np.arange(n), (0, n - 1)), 0.5, 1.0) for n in nodes.shape]
        weight = np.einsum("i,j,k->ijk", *ends)
        for share in np.unique(weight):
            chosen = weight == share
            self.mesh.add_points(f"{name} {share}", nodes[chosen])
            self.force.append({"on": f"{name} {share}", "vector": np.array(vector) * weight[chosen].sum() / weight.sum()})

    def run(self, squeal, ranks, **tables):
        self.mesh.write(self.folder / "bodies.msh")
        scene = write_scene(self.folder, title="meshes 3:2", mesh={"file": "bodies.msh"}, modes=OFF, estimate=OFF,
                            part=self.part, force=self.force, **tables)
        return squeal(scene, ranks=ranks)

    def march(self, squeal, ranks, free, steps, step_size, defect=1e-12, **tables):
        """From rest without displacement, of `free` degrees of freedom."""
        state = write_state(self.folder / "start.state", np.zeros(free), np.zeros(free))
        return history_of(self.run(squeal, ranks, transient={"start": state.name, "steps": steps, "step_size": step_size},
                                   **tables), defect)


def collide(converged, folder, elements, sections):
    """Two bars of case 17, each pulled to the other by its weight over a gap of 2 x 5: the plane between them stays, and
    each moves as on a wall. The spring, 1e-5 of a bar's, holds what would drift together."""
    folder.mkdir()
    rate, free, bodies, probe = 10 * elements, 1, Bodies(folder), []
    for name, n, sign in zip(("upper", "lower"), sections, (1, -1)):
        ends = sorted((5 * sign, 15 * sign))
        nodes = bodies.add(name, (n, n, elements), (0, 0, ends[0]), (1, 1, ends[1]),
                           {"young": 900, "poisson": 0.0, "density": 1})
        bodies.pull(name, nodes, [0, 0, -100.0 * sign])
        free += (n + 1)**2 * (elements + (sign > 0))
        probe += [{"name": f"{name} {x}", "on": name, "at": [x, x, 5 * sign], "direction": "z"} for x in (0, 1)]
    data = bodies.march(converged, 1, free, round(5.4 * rate), 1 / rate, friction={"coefficient": 0.0}, probe=probe,
                        support=[{"on": name, "fixed": "x y"} for name in ("upper", "lower")],
                        rigid_body=[{"name": "end", "surfaces": "lower:lower", "at": [0.5, 0.5, -15], "free": "z"}],
                        spring=[{"from": "end", "direction": "z", "stiffness": 1e-3}],
                        contact=[{"rotor": "lower:upper", "stator": "upper:lower", "normal": "z", "reach": 11.0}])
    data["gap"] = 5 + (data["upper 0"] - data["lower 0"]) / 2
    return rate, data


@pytest.mark.parametrize("elements", [24, 48])
def test_bars_meshed_apart_collide_as_one_meets_a_wall(converged, tmp_path, elements):
    """Sections of 3 x 3 on 2 x 2 elements move as one element on one does, 1e-10: pressure and gap stay even. Both have the
    ripple of consistent masses. With 24, 48 and 96 elements the first release is late by 0.14 N^(-2/3), the second touch
    early by 1.18, 1.21, 1.25 and the last release by 0.35 N^(-2/3); gaps at 2 and 2.2 are 0.84 and 0.57 to 0.78 of it short."""
    rate, data = collide(converged, tmp_path / "3 on 2", elements, (3, 2))
    _, matching = collide(converged, tmp_path / "1 on 1", elements, (1, 1))
    for name in ("upper 0", "lower 0", "normal_force", "energy"):
        assert np.abs(data[name] - matching[name]).max() < 1e-10 * np.abs(matching[name]).max()
    for name in ("upper", "lower"):
        assert np.abs(data[f"{name} 0"] - data[f"{name} 1"]).max() < 1e-10
    time, front = data["time"], elements**(-2 / 3)
    events = time[1 + np.flatnonzero(np.diff((data["open"] == 0).astype(int)))][[0, 1, 2, -1]]
    assert np.all(np.abs(events - [1, 5 / 3, 11 / 3, 13 / 3]) <= [1 / rate, 0.2 * front, 1.4 * front, 0.4 * front])
    for t, gap in ((2, 1.666667), (2.2, 3.2)):
        assert data["gap"][round(t * rate) - 1] == pytest.approx(gap, abs=0.9 * front)
    pressed = (time > 1.1) & (time < 1.5)  # behind the front's ripple
    assert np.polyfit(time[pressed] - 1, data["normal_force"][pressed], 1) == pytest.approx([300, 300], rel=0.012)
    assert data["contact_power"].max() < 1e-9 * 900  # no step gains energy from contact


def pairs_of(run):
    with h5py.File(run.output / "fields.h5") as fields:
        return fields["pairs/position"][:], fields["pairs/reaction"][:, 0]


@both
@pytest.mark.parametrize("slave", ["stator", "rotor"])
@pytest.mark.parametrize("mu", [0.2, 0.4, 0.66, 0.67])
def test_a_block_meshed_apart_leans_until_it_tips(squeal, tmp_path, mu, slave, ranks):
    """Case 13: the reactions' centre is mu 0.15 ahead of the middle, 1e-10, whichever pairs part, and none is beyond the edge."""
    bodies = Bodies(tmp_path)
    stiff = {"young": 210e9, "poisson": 0.3, "density": 1}
    bodies.add("floor", (2, 2, 1), (0, 0, -0.05), (0.2, 0.1, 0), stiff)
    block = bodies.add("block", (3, 3, 2), (0, 0, 0), (0.2, 0.1, 0.3), stiff)
    bodies.mesh.add_points("middle", block[:, :, 1])
    bodies.force.append({"on": "middle", "vector": [0, 0, -100]})
    run = bodies.run(squeal, ranks, friction={"coefficient": mu},
                     contact=[{"rotor": "floor:upper", "stator": "block:lower", "velocity": [1.0, 0, 0], "slave": slave}],
                     support=[{"on": "floor:lower", "fixed": "all"}, {"on": "middle", "fixed": "x"},
                              {"on": "block", "fixed": "y"}])
    if mu > 2 / 3:
        assert run.code == 2 and run.report["equilibrium"]["outcome"] == "no equilibrium"
        return
    assert run.code == 0
    place, reaction = pairs_of(run)
    assert reaction.sum() == pytest.approx(100, rel=1e-10)
    assert abs((reaction * place[:, 0]).sum() / reaction.sum() - 0.1) == pytest.approx(mu * 0.15, rel=1e-10)
    assert mu < 1 / 3 or (reaction == 0).any()  # the centre has left the middle third


@both
def test_a_block_meshed_apart_slides_to_a_stop_where_coulomb_says(converged, tmp_path, ranks):
    """Case 18 with a body of 3 x 3 x 2 elements, damped within: its centre moves as the mass does, whatever the pressure
    below. Springs hold the top, which is rigid. Sliding shears the block by mu density g height^2/(2 G) at most. The energy
    closes to twice the tolerance of the contact iteration, 1e-10, as elements couple the pairs."""
    mu, g, speed, h, omega, density = 0.3, 9.81, 2.0, 4e-3, 1.0, 750.0
    young, height = 1e7, 0.1
    mass = density * 0.2 * 0.2 * height
    bodies = Bodies(tmp_path)
    material = {"young": young, "poisson": 0.3, "density": density}
    bodies.add("belt", (2, 2, 1), (0, 0, -0.05), (0.2, 0.2, 0), material)
    block = bodies.add("block", (3, 3, 2), (0, 0, 0), (0.2, 0.2, height), material)
    bodies.pull("block", block, [0, 0, -mass * g])
    data = bodies.march(converged, ranks, 2 * 16 * 3 + 5, 200, h, 2e-10, friction={"coefficient": mu}, damping={"beta": 1e-3},
                        support=[{"on": "belt", "fixed": "all"}],
                        rigid_body=[{"name": "top", "surfaces": "block:upper", "at": [0.1, 0.1, 0.05], "free": "x y z rx ry"}],
                        spring=[{"from": "top", "direction": "x", "stiffness": mass * omega**2},
                                {"from": "top", "direction": "y", "stiffness": mass * omega**2}],
                        contact=[{"rotor": "belt:upper", "stator": "block:lower", "velocity": [speed, 0, 0]}],
                        probe=[{"name": "top", "on": "top", "direction": "x"}])
    stop = np.arcsin(speed * omega / (mu * g)) / omega
    slipped = speed * stop - mu * g / omega**2 * (1 - np.cos(omega * stop))
    shear = 1.3 * mu * density * g * height**2 / young
    caught = np.argmax(data["stick"] == 16)
    assert abs(data["time"][caught] - stop) <= h
    assert data["stick"][caught:].min() == 16 and data["open"].max() == 0
    assert abs(speed * data["time"][-1] - data["top"][-1] - slipped) < mu * g * h**2 / 8 + shear
