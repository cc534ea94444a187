"""Bolts, beams, joints and moved supports from a scene file, each against its closed form; and what is refused."""

import math

import pytest

# A bolt of 2e8 N/m clamps two plates of 1.6e9 N/m each, which touch in a contact without a drive.
JOINT = """
[[point]]
name = "nut"
at = [0, 0, 0]
free = "none"
[[point]]
name = "head"
at = [0, 0, 0.01]
mass = 1
free = "z"
[[point]]
name = "upper"
at = [0, 0, 0.005]
mass = 1
free = "x z"
[[point]]
name = "lower"
at = [0, 0, 0.005]
mass = 1
free = "z"
[[beam]]
name = "shank"
from = "nut"
to = "head"
young = 2e11
area = 1e-5
bending = 1e-11
torsion = 2e-11
elements = 1
[[bolt]]
name = "bolt"
beam = "shank"
tension = 20000
[[spring]]
from = "head"
to = "upper"
direction = "z"
stiffness = 1.6e9
[[spring]]
from = "lower"
direction = "z"
stiffness = 1.6e9
[[spring]]
from = "upper"
direction = "x"
stiffness = 1e8
[[contact]]
rotor = "lower"
stator = "upper"
normal = "z"
tangents = ["x"]
[friction]
coefficient = 0.2
[modes]
enabled = false
[estimate]
enabled = false
"""

FORCE = '[[force]]\non = "{on}"\nvector = [0, 0, {value}]\n'
AS_FORCE = '[[step]]\nname = "tighten"\nload = 0\nbolts = ["bolt"]\n[[step]]\nname = "load"\nbolts = ["bolt"]\n'


@pytest.fixture
def write(tmp_path):
    def scene(text):
        file = tmp_path / "scene.toml"
        file.write_text(text)
        return file

    return scene


@pytest.mark.parametrize("ranks", [1, 2, 3])
def test_a_bolt_takes_its_share_of_a_load_once_it_is_locked(write, converged, ranks):
    at_head = {X: (20000 - 0.8 * X, 20000 + 0.2 * X) for X in (5000, 20000, 24900)} | {30000: (0, 30000), 40000: (0, 40000)}
    cases = [(FORCE.format(on="head", value=X), *expected) for X, expected in at_head.items()]
    cases.append((FORCE.format(on="upper", value=5000) + FORCE.format(on="lower", value=-5000), 15000, 20000))
    cases.append((FORCE.format(on="head", value=5000) + AS_FORCE, 15000, 20000))
    for more, clamp, tension in cases if ranks == 1 else cases[3:6]:
        equilibrium = converged(write(JOINT + more), ranks=ranks).report["equilibrium"]
        bolt = equilibrium["bolts"][0]
        assert equilibrium["contacts"][0]["normal_force_sum"] == pytest.approx(clamp, rel=1e-9, abs=2e-5), more
        assert bolt["tension"] == pytest.approx(tension, rel=1e-9), more
        if "[[step]]" not in more:
            assert bolt["shortening"] == pytest.approx(1.25e-4, rel=1e-9)


def test_bolts_are_tightened_in_the_order_of_the_steps(write, converged):
    """The second bolt at the same head unloads the first one: both springs and the plates act on one motion."""
    second = JOINT[JOINT.index("[[beam]]"):JOINT.index("[[spring]]")].replace('"shank"', '"other"').replace('"bolt"', '"second"')
    steps = "".join(f'[[step]]\nname = "{name}"\nload = 0\nbolts = ["{name}"]\n' for name in ("bolt", "second"))
    equilibrium = converged(write(JOINT + second + steps + '[[step]]\nname = "load"\n'), ranks=1).report["equilibrium"]
    tensions = {bolt["name"]: bolt["tension"] for bolt in equilibrium["bolts"]}
    # head: plates 8e8 and the locked first bolt 2e8 share 20 kN
    assert tensions["second"] == pytest.approx(20000, rel=1e-9)
    assert tensions["bolt"] == pytest.approx(20000 - 20000 * 2e8 / (8e8 + 2e8), rel=1e-9)


def test_no_load_factor_unloads_a_bolt(write, converged):
    more = FORCE.format(on="head", value=1000) + "\n[transient]\nsteps = 200\nstep_size = 1e-7\nstart = 'equilibrium'\n"
    report = converged(write(JOINT + more + "load_factor = [[0, 1], [1e-6, 0]]\n"), ranks=1).report
    assert report["transient"]["outcome"] == "completed" and report["transient"]["energy_defect_max"] < 1e-9
    assert report["equilibrium"]["bolts"][0]["tension"] == pytest.approx(20200, rel=1e-9)


BEAM = """
[[point]]
name = "root"
at = [0, 0, 0]
free = "none"
[[point]]
name = "tip"
at = [{tip[0]}, {tip[1]}, {tip[2]}]
free = "all"
[[beam]]
name = "pin"
from = "root"
to = "tip"
young = 2.1e11
poisson = 0.3
density = 7850
diameter = 0.01
shear_factor = {shear}
elements = 16
{more}
[[probe]]
name = "tip"
on = "tip"
direction = {across}
[modes]
band = 3000
[estimate]
enabled = false
"""


@pytest.mark.parametrize("ranks", [1, 2, 3])
def test_a_guide_pin_bends_and_swings_as_a_beam(write, converged, ranks):
    length, E, area, I = 0.3, 2.1e11, math.pi * 0.01**2 / 4, math.pi * 0.01**4 / 64
    tip, across, about = [0.18, 0, 0.24], [0.8, 0, -0.6], "y"
    force = f"[[force]]\non = 'tip'\nvector = {[7 * x for x in across]}\n"
    for shear, flexibility in ((0, 0), (0.9, 7 * length / (0.9 * E / 2.6 * area)))[:2 if ranks == 1 else 1]:
        report = converged(write(BEAM.format(tip=tip, across=across, shear=shear, more=force)), ranks=ranks).report
        exact = 7 * length**3 / (3 * E * I) + flexibility
        assert report["equilibrium"]["probes"]["tip"] == pytest.approx(exact, rel=1e-9)
    report = converged(write(BEAM.format(tip=tip, across=across, shear=0, more="[[force]]\non = 'tip'\nmoment = [0, 3, 0]\n")),
                       ranks=ranks).report
    assert abs(report["equilibrium"]["probes"]["tip"]) == pytest.approx(3 * length**2 / (2 * E * I), rel=1e-9)
    found = sorted(mode["frequency_hz"] for mode in report["modes"]["modes"])
    roots = [1.87510407, 4.69409113, 7.85475744]
    exact = [k**2 / (2 * math.pi * length**2) * math.sqrt(E * I / (7850 * area)) for k in roots]
    rotary = 2e-3 + 3e-3  # what the sections' rotation takes off the third one
    for frequency, pair in zip([f for f in exact if f < 3000], zip(found[::2], found[1::2])):
        assert pair == pytest.approx((frequency, frequency), rel=rotary)


def test_a_bushing_and_a_hinge_have_their_frequencies(write, converged):
    """A body on a bushing to the ground swings at sqrt(k/m) along its axes; a hinge leaves it one pendulum."""
    body = """
[[point]]
name = "base"
at = [0, 0, 0]
free = "none"
[[point]]
name = "arm"
at = [0.1, 0, 0]
mass = 2
free = "all"
[[connector]]
from = "base"
to = "arm"
at = {at}
{how}
[modes]
band = 5000
[estimate]
enabled = false
"""
    how = "stiffness = [2e6, 8e6, 18e6, 1e4, 1e4, 1e4]"
    found = converged(write(body.format(at="[0.1, 0, 0]", how=how)), ranks=1).report["modes"]["modes"]
    exact = [math.sqrt(k / 2) / (2 * math.pi) for k in (2e6, 8e6, 18e6)]
    assert sorted(mode["frequency_hz"] for mode in found)[:3] == pytest.approx(exact, rel=1e-9)
    how = 'locked = "x y z rx ry"\nstiffness = [0, 0, 0, 0, 0, 500]'
    found = converged(write(body.format(at="[0, 0, 0]", how=how)), ranks=1).report["modes"]["modes"]
    assert len(found) == 1
    assert found[0]["frequency_hz"] == pytest.approx(math.sqrt(500 / (2 * 0.1**2)) / (2 * math.pi), rel=1e-9)


REFUSED = {
    "no section": (('beam = "shank"\ntension', "tension"), "needs one of the keys 'section' and 'beam'"),
    "unknown beam": (('beam = "shank"', 'beam = "shaft"'), "did you mean 'shank'"),
    "no tension": (("tension = 20000", "tension = 0"), "a positive number"),
    "section without a mesh": (('beam = "shank"\ntension', 'section = "cut"\ntension'), "section needs a [mesh]"),
    "unknown bolt": (("[friction]", '[[step]]\nname = "a"\nbolts = ["belt"]\n[friction]'), "did you mean 'bolt'"),
    "beam of no section": (("area = 1e-5\n", ""), "needs the key 'diameter' [m], or 'area', 'bending' and 'torsion'"),
    "beam between one point": (('to = "head"\nyoung', 'to = "nut"\nyoung'), "has the same point at both ends"),
    "nothing in a connector": (("[friction]", '[[connector]]\nfrom = "head"\nto = "nut"\n[friction]'),
                               "neither locked motions nor stiffness"),
    "five numbers": (("[friction]", '[[connector]]\nfrom = "head"\nstiffness = [1, 2, 3, 4, 5]\n[friction]'), "give 6 or 36"),
    "not symmetric": (("[friction]", '[[connector]]\nfrom = "head"\nstiffness = ' + str(list(range(36))) + "\n[friction]"),
                      "is not symmetric"),
    "axes not square": (("[friction]", '[[connector]]\nfrom = "head"\nlocked = "x"\naxis_1 = "y"\n[friction]'),
                        "axis_2 must be square to axis_1"),
    "coupling on a line": (("[friction]", '[[coupling]]\nname = "c"\nat = [0, 0, 0]\non = ["nut", "head"]\n[friction]'),
                           "coupling c: its 2 nodes are on a line"),
    "weights": (("[friction]", '[[coupling]]\nname = "c"\nat = [0, 0, 0]\non = ["nut", "head"]\nweights = [1]\n[friction]'),
                "give one each"),
    "moved and not fixed": (("[friction]", '[[support]]\non = "head"\nfixed = "x"\ndisplacement = [0, 0, 1e-3]\n[friction]'),
                            "displacement moves z, which 'fixed' does not name"),
    "moved and held": (("[friction]", '[[support]]\non = "nut"\nfixed = "z"\ndisplacement = [0, 0, 1e-3]\n[friction]'),
                       "should move by 0.001"),
    "on the axis": (("[friction]", '[[support]]\non = "head"\nfixed = "x"\ncylinder = {axis = "z"}\n[friction]'),
                    "is on the axis of its cylinder"),
    "moment on nothing that turns": (("[friction]", '[[force]]\non = "head"\nmoment = [0, 0, 1]\n[friction]'),
                                     "let a [[coupling]] or [[rigid_body]] take it"),
    "empty force": (("[friction]", '[[force]]\non = "head"\n[friction]'), "needs the key 'vector' [N] or 'moment' [N m]"),
    "from rest": (("[friction]", '[transient]\nstart = "rest"\nload_factor = [[0, 0], [1, 1]]\n[friction]'),
                  "bolts, gravity and moved supports would let it jump"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_bad_input_is_refused_with_one_message(write, squeal, case):
    (old, new), text = REFUSED[case]
    assert old in JOINT
    done = squeal(write(JOINT.replace(old, new, 1)), ranks=1)
    assert done.code != 0 and len(done.messages) == 1 and text in done.messages[0], done.errors
