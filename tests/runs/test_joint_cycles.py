"""Cycles of the mode-coupling oscillator whose spring ends at a bracket that friction alone holds: three nodes in a row,
each pressed on the floor by its own force, each with its own offset.

Stuck, the bracket is clamped, and the cycle is the oscillator's own. The other values are of 400 steps a period, by an
independent program. The place of events in the grid of time scatters periods by some 1e-6, energies by 1e-4.
"""

import pytest

POINTS = """
[[point]]
name = "pad"
at = [0, 0, 0]
mass = 1
free = "x y"
[[point]]
name = "disc"
at = [0, 0, 0]
mass = 0.5
free = "y"
[[point]]
name = "floor"
at = [0, 0, 0]
mass = 1
free = ""
[[spring]]
from = "pad"
to = "b1"
direction = "x"
stiffness = 1
damping = 0.02
[[spring]]
from = "pad"
direction = "y"
stiffness = 0.4
damping = 0.02
[[spring]]
from = "pad"
direction = [1, -1, 0]
stiffness = 0.2
[[spring]]
from = "disc"
direction = "y"
stiffness = 1.2
damping = 0.02
[[spring]]
from = "b1"
to = "b2"
direction = "x"
stiffness = 4
damping = 0.02
[[spring]]
from = "b2"
to = "b3"
direction = "x"
stiffness = 4
damping = 0.02
{spring}[[force]]
on = "pad"
vector = [0, -1, 0]
[[contact]]
rotor = "disc"
stator = "pad"
normal = "y"
tangents = ["x"]
velocity = [0.6, 0, 0]
[friction]
coefficient = 0.3
[modes]
band = 1
[[probe]]
name = "b1"
on = "b1"
direction = "x"
"""

SPRING = '[[spring]]\nfrom = "b3"\ndirection = "x"\nstiffness = 0.05\n'

NODE = """
[[point]]
name = "b{number}"
at = [0, 0, 0]
mass = 0.05
free = "x y"
[[force]]
on = "b{number}"
vector = [0, {force}, 0]
[[contact]]
rotor = "floor"
stator = "b{number}"
normal = "y"
tangents = ["x"]
friction = 0.5
"""

CYCLE = """
[cycle]
steps_per_period = {steps}
tolerance = 1e-8
"""

# the nodes' preloads
STUCK, MICRO, SLIDING = (2, 20, 20), (1.2, 6, 6), (0.5, 0.15, 0.15)


def scene_text(preloads, steps=400, more="", spring=SPRING):
    nodes = "".join(NODE.format(number=i, force=-p) for i, p in enumerate(preloads, 1))
    return POINTS.replace("{spring}", spring) + nodes + CYCLE.format(steps=steps) + more


@pytest.fixture
def scene(tmp_path):
    def write(*given, **more):
        file = tmp_path / "scene.toml"
        file.write_text(scene_text(*given, **more))
        return file

    return write


def real_values(cycle):
    return [value["real"] for value in cycle["multipliers"]["values"]]


@pytest.mark.parametrize("ranks", [1, 2])
def test_a_stuck_bracket_is_clamped(scene, converged, ranks):
    cycle = converged(scene(STUCK), ranks=ranks).report["cycle"]
    assert cycle["period"] == pytest.approx(5.954461004653, rel=5e-5)  # clamped, exact; the grid of time leaves 1.6e-5 to 3.5e-5, by where the search begins
    assert cycle["mean_energy"] == pytest.approx(1.77650678461, rel=3e-3)  # exact; the grid of time scatters it
    assert cycle["mean_fluctuating_energy"] == pytest.approx(1.478524, rel=5e-3)
    joints = cycle["joints"]
    assert joints["held"] == 3 and joints["slipping"] == joints["at_edge"] == 0
    assert joints["largest_use"] == pytest.approx(0.7404, abs=1e-3)
    node = joints["offsets"][0]
    assert node["contact"] == 1
    if ranks == 1:  # a difference of two periods, which the place of events in the grid of time scatters
        assert node["period_by_offset"] == pytest.approx(0.0064, rel=0.05)
    assert node["least"] == pytest.approx(-0.063, rel=0.01) and node["greatest"] == pytest.approx(0.1021, rel=0.01)
    assert cycle["multipliers"]["offsets_held"] == 3 and cycle["multipliers"]["stability"] == "stable"
    for exact in (0.71516819, 0.43583040):
        assert min(abs(value - exact) for value in real_values(cycle)) < 1e-2  # the grid of time moves them


def test_shorter_steps_come_to_the_clamped_limit(scene, converged):
    coarse, fine = (converged(scene(STUCK, steps), ranks=1).report["cycle"]["period"] for steps in (400, 1600))
    assert abs(fine - 5.954461004653) < 0.5 * abs(coarse - 5.954461004653)  # between first and second order, through onsets of stick
    assert fine == pytest.approx(5.954461004653, rel=1e-5)


def test_a_node_that_slips_both_ways_forgets_its_offset(scene, converged):
    cycle = converged(scene(MICRO), ranks=1).report["cycle"]
    assert cycle["period"] == pytest.approx(5.950161, rel=1e-5)
    assert cycle["mean_energy"] == pytest.approx(1.757916, rel=1e-3)
    assert cycle["mean_fluctuating_energy"] == pytest.approx(1.457592, rel=1e-3)
    assert cycle["peak_to_peak"]["b1"] == pytest.approx(0.0314, rel=5e-3)
    assert cycle["joints"]["held"] == 2 and cycle["joints"]["slipping"] == 1
    assert cycle["joints"]["work"][1] == pytest.approx(-0.0377, rel=3e-3)
    assert cycle["multipliers"]["offsets_held"] == 2
    for exact in (0.715, 0.452):
        assert min(abs(value - exact) for value in real_values(cycle)) < 1e-2


def test_a_bracket_walks_until_its_spring_holds_it(scene, converged):
    cycle = converged(scene(SLIDING), ranks=1).report["cycle"]
    assert cycle["period"] == pytest.approx(5.963757, rel=1e-5)
    assert cycle["mean_fluctuating_energy"] == pytest.approx(0.5562, rel=2e-3)
    assert cycle["joints"]["slipping"] >= 2
    assert sum(cycle["joints"]["work"]) == pytest.approx(-0.0567, rel=0.05)


@pytest.mark.parametrize("load", [12, 30])
def test_a_higher_load_before_leaves_a_joint_at_the_edge_of_its_range(scene, converged, load):
    """400 steps leave 2e-5 of the period; which step holds the joint's last slip moves the energy by 3e-3."""
    press = f'[[step]]\nname = "press"\nforces = [{load}, 1, 1, 1]\n[[step]]\nname = "release"\n'
    cycle = converged(scene(STUCK, more=press), ranks=1).report["cycle"]
    assert cycle["joints"]["largest_use"] == pytest.approx(1, abs=1e-4)
    assert cycle["period"] == pytest.approx(5.95512, rel=5e-5)  # that of 1600 steps
    assert cycle["mean_fluctuating_energy"] == pytest.approx(1.46100, rel=4e-3)


def test_a_joint_that_nothing_holds_walks(scene, squeal):
    file = scene((1.3, 1e-3, 1e-3), 100, spring="")
    file.write_text(file.read_text().replace('from = "pad"\ndirection = [1', 'from = "pad"\nto = "b1"\ndirection = [1'))
    run = squeal(file, "-settled_periods", "128", ranks=1)
    assert "a joint walks by 0.23" in run.report["cycle"]["reason"]
