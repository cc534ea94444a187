"""Derivatives against central differences of single runs, powers against the growth rate, changes against their prediction."""

import re

import h5py
import numpy as np
import pytest
from conftest import INPUTS, Run
from models import write_coexistence, write_scene

OSCILLATOR = [INPUTS / "oscillator" / "scene.toml", "--set", "transient.enabled=false", "--set", "cycle.enabled=false"]
# Two directions, so that friction turns and the equilibrium enters; two unstable modes. One element across the pin.
PIN = [INPUTS / "pin_on_disc" / "scene.toml", "--set", "mesh.parameters.divisions=1", "--set", "cycle.enabled=false",
       "--set", "modes.method=full", "--set", "modes.band=25000", "--set", "friction.coefficient=0.5"]

LOSSY = [*PIN, "--set", "part.pin.loss_factor=0.01", "--set", "part.disc.loss_factor=1e-6", "--set", "damping.loss_frequency=5000"]
SPINNING = [*PIN, "--set", "part.disc.rotation={axis='z',rate=300}"]
HEAVY = [*PIN, "--set", "rigid_body.holder.inertia=[1e-4,2e-4,3e-4,0,0,0]"]
SCENES = {"oscillator": OSCILLATOR, "pin": PIN, "heavy holder": HEAVY, "lossy pin": LOSSY, "spinning disc": SPINNING}
# Numbers whose derivatives are held against differences: of a size, and zero or next to it in the scene.
SIZED = {
    "oscillator": ["friction.coefficient", "spring.0.stiffness", "spring.0.damping", "point.pad.mass", "point.disc.mass"],
    "pin": ["friction.coefficient", "part.pin.young", "part.pin.density", "damping.beta", "rigid_body.holder.mass",
            "contact.0.rotation.rate", "part.pin.poisson"],
    "falling friction": ["friction.coefficient", "friction.static_coefficient", "friction.decay_speed", "contact.0.velocity.1",
                         "contact.1.velocity.0", "force.0.vector.2"],
    "compliant pads": ["friction.coefficient", "contact.0.compliance", "spring.3.stiffness", "force.0.vector.2"],
    "pads in abutments": ["friction.coefficient", "contact.2.friction", "contact.3.slip_compliance", "spring.3.stiffness", "force.0.vector.2"],
    "lossy pin": ["part.pin.loss_factor", "part.pin.young"],
    "spinning disc": ["part.disc.rotation.rate"],
}
ZEROS = [
    ("pin", "part.pin.loss_factor", 1e-5, ["damping.loss_frequency=5000"]),
    ("pin", "spring.0.damping", 300.0, []),
    ("lossy pin", "part.disc.loss_factor", 1e-4, []), # 1e-6: a ten-thousandth of it would drown in rounding
    ("falling friction", "contact.0.compliance", 1e-10, []),
    ("falling friction", "contact.0.normal.0", 1e-3, []),
    ("falling friction", "contact.0.gap", 1e-7, []),
]


# The first one slips at its equilibrium, the other sticks with an elastic slip.
ABUTMENTS = [{"rotor": "caliper", "stator": "top", "normal": [0, -1, 0], "friction": 0.3},
             {"rotor": "caliper", "stator": "bottom", "normal": [0, -1, 0], "friction": 0.9, "slip_compliance": 2e-7}]


def two_pads(folder, compliance=0, abutments=(), **friction):
    """A disc between two pads of a caliper, all of them points: two contacts of different drive, two tangents each."""
    ground = [("disc", "z", 1.2e7, 15), ("disc", "x", 9e8, 50), ("disc", "y", 6e8, 50), ("top", "y", 1e7, 8),
              ("top", "x", 1.3e7, 8), ("top", [0.05, 1, -1], 4e6, 9), ("bottom", "y", 2.3e7, 5), ("bottom", "x", 1.7e7, 5),
              ("bottom", "z", 3e6, 5), ("bottom", [0.1, 1, 1], 5e6, 5), ("caliper", [1, 0, 0.3], 3e7, 30),
              ("caliper", [0, 1, -0.4], 4e7, 30), ("caliper", [0.2, 0.3, 1], 8e6, 10)]
    springs = [{"from": a, "direction": d, "stiffness": k, "damping": c} for a, d, k, c in ground]
    springs.append({"from": "top", "to": "caliper", "direction": "z", "stiffness": 4e6, "damping": 6})
    masses = {"disc": 0.3, "top": 0.4, "bottom": 0.55, "caliper": 0.9}
    return write_scene(folder, point=[{"name": name, "at": [0.1, 0, 0], "mass": m, "free": "x y z"} for name, m in masses.items()],
                       spring=springs, force=[{"on": "caliper", "vector": [20, 0, -900]}, {"on": "bottom", "vector": [0, 15, 850]}],
                       contact=[{"rotor": "disc", "stator": "top", "normal": [0, 0, 1], "velocity": [0.3, 2, 0],
                                 "compliance": compliance},
                                {"rotor": "disc", "stator": "bottom", "normal": [0, 0, -1], "velocity": [-0.5, 1.7, 0]}, *abutments],
                       friction={"coefficient": 0.5, **friction}, modes={"band": 5000})


def sensitivity_of(*numbers):
    return ["--set", "sensitivity.numbers=[" + ",".join(f"'{number}'" for number in numbers) + "]"]


def lambda_of(report, near):
    modes = [complex(mode["growth_rate"], 2 * np.pi * mode["frequency_hz"]) for mode in report["modes"]["modes"]]
    return min(modes, key=lambda mode: abs(mode - near))


def overridden(key, value):
    head, _, last = key.rpartition(".")
    if head.endswith("rotation"):
        return f"{head}={{axis='z',rate={value!r}}}"
    return f"{key}={value!r}"


@pytest.fixture(scope="module")
def explained(tmp_path_factory):
    """Arguments of a scene by its name, and its run with the derivatives by all of its numbers, once."""
    found = {}

    def explain(name):
        if name not in found:
            folder = tmp_path_factory.mktemp("scene")
            arguments = {"compliant pads": lambda: [two_pads(folder, compliance=2e-9)],
                         "pads in abutments": lambda: [two_pads(folder, abutments=ABUTMENTS)],
                         "falling friction": lambda: [two_pads(folder, static_coefficient=0.6, decay_speed=1.5)],
                         }.get(name, lambda: SCENES[name])()
            keys = SIZED.get(name, ["friction.coefficient"]) + [key for scene, key, *_ in ZEROS if scene == name]
            run = Run([*arguments, *sensitivity_of(*keys)], 1, tmp_path_factory.mktemp("explained"))
            assert run.code == 0, run.printed[-2000:] + run.errors[-2000:]
            for mode in run.report["sensitivity"]["modes"]:
                assert [d["key"] for d in mode["derivatives"]] == keys
            found[name] = arguments, run
        return found[name]

    return explain


def first_mode(run):
    """Of the sensitivities: its eigenvalue and its derivatives by key."""
    mode = run.report["sensitivity"]["modes"][0]
    return complex(mode["growth_rate"], 2 * np.pi * mode["frequency_hz"]), {d["key"]: d for d in mode["derivatives"]}


@pytest.mark.parametrize("scene", SIZED)
def test_derivatives_are_central_differences(scene, explained, converged):
    arguments, run = explained(scene)
    own, derivatives = first_mode(run)
    for key in SIZED[scene]:
        d = derivatives[key]
        found = d["value"] * complex(d["growth_rate_by"], 2 * np.pi * d["frequency_hz_by"])
        step = 1e-4  # its square is below the tolerance, and rounding over it
        sides = [lambda_of(converged(*arguments, "--set", overridden(key, d["value"] * (1 + sign * step)), ranks=1).report, own)
                 for sign in (1, -1)]
        wanted = (sides[0] - sides[1]) / (2 * step)
        assert abs(found - wanted) <= 1e-6 * max(abs(wanted), 1e-2 * abs(own)), (key, found, wanted)


def test_weak_nonlinear_numbers_move_modes_as_they_must(converged):
    """Friction that turns with the motion damps by load over speed, and with all pairs closed nothing else knows of either: what
    both do cancels. At 20 000 rad/s they move an eigenvalue by 4e-6 of itself per unit of theirs, so that rounding leaves 3e-7."""
    run = converged(*PIN, "--set", "contact.0.rotation.rate=20000", *sensitivity_of("contact.0.rotation.rate", "force.0.vector.2"), ranks=1)
    by = [d["value"] * complex(d["growth_rate_by"], 2 * np.pi * d["frequency_hz_by"])
          for d in run.report["sensitivity"]["modes"][0]["derivatives"]]
    assert abs(by[0]) > 1e-2 and abs(by[0] + by[1]) <= 1e-6 * abs(by[0]), by


@pytest.mark.parametrize("scene, key, step, needs", ZEROS)
def test_derivatives_at_zero_are_one_sided_differences(scene, key, step, needs, explained, converged):
    arguments, run = explained(scene)
    own, derivatives = first_mode(run)
    d = derivatives[key]
    assert d["known"]
    found = complex(d["growth_rate_by"], 2 * np.pi * d["frequency_hz_by"])
    needed = [word for need in needs for word in ("--set", need)]
    sides = [lambda_of(run.report, own)]
    sides += [lambda_of(converged(*arguments, *needed, "--set", overridden(key, d["value"] + i * step), ranks=1).report, own)
              for i in range(1, 4)]
    wanted = np.dot([-11, 18, -9, 2], sides) / (6 * step) # of third order: off by up to 3e-7
    assert abs(found - wanted) <= 1e-6 * abs(wanted), (key, found, wanted)


FEEDS = "contact_powers", "falling_friction_powers", "turning_friction_powers"


def power_defect(mode):
    """Over |lambda|, by which the terms are rounded."""
    return (sum(sum(mode[key]) for key in FEEDS) - mode["damping_power"] - 2 * mode["growth_rate"]) / (2 * np.pi * mode["frequency_hz"])


@pytest.mark.parametrize("scene", ["compliant pads", "pads in abutments", "lossy pin", "spinning disc", "falling friction"])
def test_powers_sum_beyond_rigid_pairs_and_symmetric_matrices(scene, explained):
    for mode in explained(scene)[1].report["sensitivity"]["modes"]:
        assert abs(power_defect(mode)) <= 1e-10
        assert mode["damping_power"] > 0 and max(mode["turning_friction_powers"]) <= 0
        falls = scene == "falling friction"
        assert all(power > 0 if falls else power == 0 for power in mode["falling_friction_powers"])


def test_falling_friction_feeds_a_mass_on_a_belt(tmp_path, converged):
    """By its slope alone: 2 sigma m = -mu' N - c."""
    mass, load, slope, damping = 2.0, 300.0, -0.3 / 0.8 * np.exp(-1.5 / 0.8), 4.0
    points = [{"name": "belt", "at": [0, 0, 0], "free": "none"}, {"name": "block", "at": [0, 0, 0], "mass": mass, "free": "x z"}]
    scene = write_scene(tmp_path, point=points, spring=[{"from": "block", "direction": "x", "stiffness": 4e5, "damping": damping}],
                        force=[{"on": "block", "vector": [0, 0, -load]}],
                        contact=[{"rotor": "belt", "stator": "block", "normal": [0, 0, 1], "tangents": [[1, 0, 0]], "velocity": [1.5, 0, 0]}],
                        friction={"coefficient": 0.2, "static_coefficient": 0.5, "decay_speed": 0.8}, modes={"band": 500})
    [mode] = converged(scene, *sensitivity_of("friction.coefficient"), ranks=1).report["sensitivity"]["modes"]
    assert mode["falling_friction_powers"] == pytest.approx([-slope * load / mass], rel=1e-9)
    assert mode["damping_power"] == pytest.approx(damping / mass, rel=1e-9)
    assert mode["contact_powers"] == mode["turning_friction_powers"] == pytest.approx([0], abs=1e-9)
    assert abs(power_defect(mode)) <= 1e-10


def test_powers_sum_to_twice_the_growth_rate(explained):
    pin = explained("pin")[1]
    modes = pin.report["sensitivity"]["modes"]
    assert len(modes) == pin.report["modes"]["unstable_count"] >= 1
    for mode in modes:
        # beside |lambda|, by which the terms are rounded
        size = 2 * np.pi * mode["frequency_hz"]
        assert abs(power_defect(mode)) <= 1e-10
        assert mode["power_defect"] == pytest.approx(0, abs=1e-10 * size)
    with h5py.File(pin.output / "fields.h5") as fields:
        for number, mode in enumerate(modes, 1):
            assert fields[f"modes/{number}/pair_power"][()].sum() == pytest.approx(sum(mode["contact_powers"]), rel=1e-12)


@pytest.mark.parametrize("scene, held", [
    ("pin", {"part disc", "part pin", "rigid_body holder", "spring holder to ground"}),
    ("heavy holder", {"part disc", "part pin", "rigid_body holder", "spring holder to ground"}),
    ("compliant pads", {"point disc", "point top", "point bottom", "point caliper", "contact top on disc", "spring top to caliper"}),
    ("pads in abutments", {"contact bottom on caliper", "spring top to caliper"}),
    ("lossy pin", {"part disc", "part pin"}),
    ("spinning disc", {"part disc", "part pin"}),
])
def test_shares_sum_to_one(scene, held, explained):
    modes = explained(scene)[1].report["sensitivity"]["modes"]
    assert modes
    for mode in modes:
        found = {f"{share['table']} {share['name']}".strip(): share for share in mode["shares"]}
        assert held <= set(found)
        for energy in ("kinetic", "strain"):
            shares = [share[energy] for share in mode["shares"]]
            assert sum(shares) == pytest.approx(1, abs=1e-9)
            assert scene == "spinning disc" or min(shares) > -1e-9  # a spin takes from the stiffness
        if scene == "compliant pads":
            assert found["contact top on disc"]["strain"] > 1e-5 and found["contact top on disc"]["kinetic"] == 0


def test_matrices_hold_all_energy(tmp_path, converged):
    scene = write_coexistence(tmp_path, {"coefficient": 0.55}, {"enabled": False})
    for mode in converged(scene, *sensitivity_of("friction.coefficient"), ranks=1).report["sensitivity"]["modes"]:
        [share] = mode["shares"]
        assert share == {"table": "matrices", "name": "", "kinetic": 1, "strain": 1}


def test_changes_move_the_growth_as_predicted(tmp_path, squeal):
    text = (INPUTS / "oscillator" / "scene.toml").read_text()
    scene = tmp_path / "scene.toml"
    scene.write_text(text + '\n[sensitivity]\n[[change]]\nprobe = "pad_y"\nmass = 2e-3\ndamping = 1e-3\n'
                     '[[change]]\nprobe = "pad_x"\nstiffness = 2e-3\n')
    run = squeal(scene, "--set", "transient.enabled=false", "--set", "cycle.enabled=false", ranks=1)
    assert run.code == 0, run.errors
    mode = run.report["sensitivity"]["modes"][0]
    assert "probe pad_y, mass 0.002 kg, damping 0.001 N s/m, stiffness 0 N/m, predicted growth rate" in run.printed
    springs = [share["name"] for share in mode["shares"] if share["table"] == "spring"]
    assert "spring.1 (pad to ground)" in springs and len(set(springs)) == len(springs)
    for change in mode["changes"]:
        moved = change["computed"]["growth_rate"] - mode["growth_rate"]
        assert abs(moved) > 1e-6
        assert change["predicted"]["growth_rate"] - mode["growth_rate"] == pytest.approx(moved, rel=0.1)
    # the same damper as a spring of the scene
    single = squeal(INPUTS / "oscillator" / "scene.toml", "--set", "transient.enabled=false", "--set", "cycle.enabled=false",
                    "--set", "spring.0.stiffness=1.002", "--set", "force.0.vector=[0,-1,0]", ranks=1).report
    wanted = single["modes"]["modes"][0]["growth_rate"]
    assert mode["changes"][1]["computed"]["growth_rate"] == pytest.approx(wanted, rel=1e-9)


def test_numbers_are_called_by_name(tmp_path, converged):
    pin = (PIN[0].read_text() + "\n[sensitivity]\n").replace('"pin.geo"', f'"{PIN[0].parent / "pin.geo"}"')
    (tmp_path / "pin.toml").write_text(pin)
    names, spinning = ({d["key"]: d["name"] for d in converged(tmp_path / "pin.toml", *arguments, ranks=1).report["sensitivity"]["modes"][0]
                        ["derivatives"]} for arguments in (PIN[1:], SPINNING[1:]))
    assert spinning == {**names, "part.disc.rotation.rate": ""}
    assert names == {"friction.coefficient": "", "damping.beta": "", "part.disc.young": "", "part.disc.density": "", "part.pin.young": "",
                     "part.pin.density": "", "rigid_body.holder.mass": "", "spring.0.stiffness": "holder to ground",
                     "contact.0.rotation.rate": "pin_face on disc_face"}
    text = two_pads(tmp_path).read_text().replace('"top"', '"the top.1"')
    (tmp_path / "points.csv").write_text("point.'the top.1'.mass,force.0.vector.2\n0.3,-950\n0.4,-900\n")
    (tmp_path / "scene.toml").write_text(text + "\n[sensitivity]\n[sweep]\ntable = 'points.csv'\n")
    run = converged(tmp_path / "scene.toml", ranks=1)
    numbers = {d["key"]: d for d in run.report["sensitivity"]["modes"][0]["derivatives"]}
    mass = numbers['point."the top.1".mass']
    assert mass["value"] == 0.4 and mass["known"]
    sweep = run.report["sweep"]
    assert sweep["names"] == ["point.'the top.1'.mass", "on caliper"] and sweep["units"] == ["kg", "N"]
    assert ", force.0.vector.2, names point.'the top.1'.mass, on caliper" in " ".join(run.printed.split())


def test_ranks_agree(explained, squeal):
    run = squeal(*PIN, *sensitivity_of("friction.coefficient", "part.pin.young"), ranks=2)
    assert run.code == 0
    for one, other in zip(explained("pin")[1].report["sensitivity"]["modes"], run.report["sensitivity"]["modes"], strict=True):
        for a, b in zip(one["derivatives"][:2], other["derivatives"], strict=True):
            size = 2 * np.pi * one["frequency_hz"]
            assert a["value"] * (a["growth_rate_by"] - b["growth_rate_by"]) == pytest.approx(0, abs=1e-8 * size)


def test_a_stable_scene_has_nothing_to_explain(converged):
    report = converged(*OSCILLATOR, "--set", "friction.coefficient=0.1", *sensitivity_of("friction.coefficient"),
                       ranks=1).report
    assert report["sensitivity"]["outcome"] == "skipped"


@pytest.mark.parametrize("lines, words", [
    ("[sensitivity]\nnumbers = ['friction.coefficent']", "not in the scene"),
    ("[sensitivity]\nnumbers = ['friction.decay_speed']", "is 0, and nothing beside that is a scene"),
    ("[sensitivity]\nnumbers = ['point.0.mass', 'spring.0.damping', 'point.0.mass']", 'names "point.0.mass" twice'),
    ("[[change]]\nprobe = 'pad_y'\nmass = 1", "give that table too"),
    ("[sensitivity]\n[[change]]\nprobe = 'pad_z'\nmass = 1", "is not defined"),
    ("[sensitivity]\n[[change]]\nprobe = 'pad_y'", "neither mass, damping nor stiffness"),
    ("[sensitivity]\n[[change]]\nprobe = 'pad_y'\nmass = -1", "zero or a positive number"),
])
def test_bad_input_is_refused_before_the_first_stage(lines, words, tmp_path, squeal):
    scene = tmp_path / "scene.toml"
    scene.write_text((INPUTS / "oscillator" / "scene.toml").read_text() + "\n" + lines + "\n")
    run = squeal(scene, "--dry-run", ranks=1)
    assert run.code == 1
    assert len(run.messages) == 1 and words in run.messages[0] and "scene.toml, line" in run.messages[0], run.errors
    assert "model …" not in run.printed
