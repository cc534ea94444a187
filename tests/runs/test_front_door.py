"""The first minutes of a user: a short table, named numbers, rotors, design points, and mistakes that are caught."""

import csv
import json
import re
import subprocess

import numpy as np
import pytest
from conftest import INPUTS, ROOT, Run, Short
from test_early_errors import refused

PIN = INPUTS / "pin_on_disc"
QUICK = ["--set", "mesh.parameters.divisions=2"]
MODES = [*QUICK, "--set", "cycle.enabled=false"]
OWN = 'rotation = { axis = "z", rate = 20 }'


def pin_scene(folder, *changes, more=""):
    text = (PIN / "scene.toml").read_text().replace('"pin.geo"', f'"{PIN / "pin.geo"}"').replace("divisions = 4", "divisions = 2")
    text = re.sub(r"^\[cycle\].*?(?=^\[|\Z)", "", text, flags=re.M | re.S)
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    scene = folder / "scene.toml"
    scene.write_text(text + more)
    return scene


@pytest.mark.parametrize("scene", ["pin_on_disc", "oscillator", "strip_calculix", "tie"])
def test_the_table_has_at_most_twenty_lines(tmp_path, scene):
    run = Short([INPUTS / scene, "--set", "cycle.enabled=false", "--set", "transient.enabled=false"], 1, tmp_path)
    assert run.code == 0 and len(run.table) <= 21, run.printed  # the last line names the folder
    assert run.row("heard") == run.report["heard"] and run.row("next") == run.report["next"]
    assert "100 %" not in run.printed  # what tells its progress still works
    assert re.search(r"^  checks +\d+ passed", run.printed, re.M) and re.search(r"^  time +[\d.]+ s", run.printed, re.M)


def test_the_table_says_what_the_model_is_and_what_the_contact_carries(tmp_path):
    run = Short([PIN, *MODES], 1, tmp_path)
    model, contact = run.report["model"], run.report["equilibrium"]["contacts"][0]
    disc, pin = model["parts"]
    assert (disc["name"], pin["name"]) == ("disc", "pin")
    assert 0.9 < disc["mass"] / (7850 * np.pi * (0.12**2 - 0.04**2) * 0.012) < 1  # of chords
    assert pin["mass"] == pytest.approx(5000 * np.radians(14) * (0.1**2 - 0.08**2) / 2 * 0.025, rel=0.02)
    assert f"disc, mass {disc['mass']:.5g} kg; pin, mass {pin['mass']:.5g} kg" in run.printed
    assert contact["normal_force_sum"] == pytest.approx(100, rel=0.05) and contact["closed_share"] == 1
    assert f"pin_face, disc_face, normal force sum {contact['normal_force_sum']:.5g} N" in run.printed
    assert max(model["size"]) == pytest.approx(0.24, rel=0.1) and min(model["size"]) == pytest.approx(0.037, rel=1e-6)


def test_the_next_command_can_be_pasted(tmp_path, squeal):
    """It goes on from an unstable mode to the cycle, with all that was given."""
    run = Short([PIN, *MODES, "--set", "damping.beta=6e-7", "--set", "probe.0.name=a holder's"], 1, tmp_path)
    assert run.report["modes"]["unstable_count"] == 1
    assert run.report["next"].endswith("--set cycle.enabled=true") and "damping.beta=6e-7" in run.report["next"]
    assert "'probe.0.name=a holder'\\''s'" in run.report["next"]
    silent = Short([PIN, *MODES, "--set", "friction.coefficient=0.01"], 1, tmp_path / "silent").report
    assert silent["heard"].startswith("silent") and "sweep.key=friction.coefficient" in silent["next"]
    own = Short([PIN, *MODES, "--set", "contact.0.friction=0.01"], 1, tmp_path / "own").report
    assert "sweep.key=contact.0.friction" in own["next"]


def test_a_number_drives_two_keys_as_both_by_hand(converged, tmp_path):
    changes = [("young = 5e9", 'young = 5e9\nbeta = "loss"'), ("beta = 3e-7", 'beta = "loss"')]
    scene = pin_scene(tmp_path, *changes, more="\n[numbers]\nloss = 2e-7\n[sensitivity]\n"
                      "numbers = ['numbers.loss', 'damping.beta', 'part.pin.beta']\n")
    run = converged(scene, "--set", "sweep.key=numbers.loss", "--set", "sweep.values=[2e-7, 3e-7]", ranks=1)
    points = [point for point in run.report["sweep"]["points"] if not point["inserted"]]
    for point, value in zip(points, ("2e-7", "3e-7"), strict=True):
        by_hand = converged(scene, "--set", f"damping.beta={value}", "--set", f"part.pin.beta={value}", "--set",
                            "sensitivity.numbers=friction.coefficient", ranks=1).report["modes"]["modes"]
        assert point["growth_rate"] == pytest.approx(by_hand[0]["growth_rate"], rel=1e-6)
        assert point["frequency_hz"] == pytest.approx(by_hand[0]["frequency_hz"], rel=1e-9)
    whole, *parts = [by["growth_rate_by"] for by in run.report["sensitivity"]["modes"][0]["derivatives"]]
    assert whole == pytest.approx(sum(parts), rel=1e-4)


def test_a_number_is_random_and_leads_a_branch(converged, tmp_path):
    """As the key that it stands for alone: the same samples, the same branch."""
    text = (INPUTS / "oscillator" / "scene.toml").read_text()
    named = text.replace("[friction]\ncoefficient = 0.3", '[friction]\ncoefficient = "mu"', 1) + "\n[numbers]\nmu = 0.3\n"
    assert named.count('"mu"') == 1, "the oscillator's friction is 0.3"
    reports = []
    for name, key, content in (("key", "friction.coefficient", text), ("named", "numbers.mu", named)):
        folder = tmp_path / name
        folder.mkdir()
        (folder / "scene.toml").write_text(content)
        reports.append(converged(folder, "--set", "transient.enabled=false", "--set", "cycle.steps_per_period=60", "--set",
                                 f"branch.key={key}", "--set", "branch.from=0.29", "--set", "branch.to=0.31", "--set",
                                 "branch.points=3", "--set", "robustness.samples=20", "--set",
                                 f"uncertain=[{{key='{key}', deviation=0.05}}]", ranks=1).report)
    by_key, by_name = reports
    assert by_key["robustness"]["any"]["probability"] == by_name["robustness"]["any"]["probability"]
    assert [point["period"] for point in by_name["branch"]["points"]] == pytest.approx(
        [point["period"] for point in by_key["branch"]["points"]], rel=1e-6)


def test_a_number_of_two_keys_leads_a_branch_and_samples_as_both_by_hand(converged, tmp_path):
    """The damping of two springs: ends of the branch and samples are single runs with both values given."""
    text = (INPUTS / "oscillator" / "scene.toml").read_text().replace("damping = 0.02", 'damping = "loss"', 2) + "\n[numbers]\nloss = 0.02\n"
    assert text.count('"loss"') == 2
    (tmp_path / "scene.toml").write_text(text)
    cycle = ["--set", "transient.enabled=false", "--set", "cycle.steps_per_period=200", "--set", "fidelity=full"]
    random = ["--set", "robustness.samples=12", "--set", "uncertain=[{key='numbers.loss', distribution='uniform', from=0.02, to=0.4}]"]
    along = ["--set", "branch.key=numbers.loss", "--set", "branch.from=0.015", "--set", "branch.to=0.03", "--set", "branch.points=3"]
    run = converged(tmp_path, *cycle, *random, *along, ranks=1)

    def by_hand(value):
        both = [word for i in (0, 1) for word in ("--set", f"spring.{i}.damping={value}")]
        return converged(INPUTS / "oscillator", *cycle, *both, "--set", f"cycle.enabled={str(value < 0.04).lower()}", ranks=1).report

    points = run.report["branch"]["points"]
    assert [points[0]["parameter"], points[-1]["parameter"]] == [0.015, 0.03]
    for point in (points[0], points[-1]):
        alone = by_hand(point["parameter"])["cycle"]
        assert point["period"] == pytest.approx(alone["period"], rel=5e-6)
        assert point["mean_fluctuating_energy"] == pytest.approx(alone["mean_fluctuating_energy"], rel=1e-3)
    with open(run.output / "robustness.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    counts = [by_hand(float(row["numbers.loss"]))["modes"] for row in rows]
    assert [int(row["unstable_modes"]) for row in rows] == [modes["unstable_count"] for modes in counts]
    assert {modes["unstable_count"] for modes in counts} == {0, 1}
    for row, modes in zip(rows, counts, strict=True):
        if modes["unstable_count"]:
            assert float(row["growth_rate"]) == pytest.approx(max(mode["growth_rate"] for mode in modes["modes"]), rel=1e-6)


@pytest.mark.parametrize("ranks", [1, 2])
def test_a_rotor_drives_as_the_contact_does(converged, squeal, tmp_path, ranks):
    rotor = '\n[[rotor]]\npart = "disc"\naxis = "z"\nrate = 20\n'
    own = converged(pin_scene(tmp_path), ranks=ranks).report
    (tmp_path / "rotor").mkdir()
    scene = pin_scene(tmp_path / "rotor", (OWN, ""), more=rotor)
    driven = converged(scene, ranks=ranks).report
    assert driven["modes"]["modes"] == own["modes"]["modes"] and driven["equilibrium"] == own["equilibrium"]
    both = squeal(pin_scene(tmp_path, more=rotor), ranks=ranks)
    refused(both, "[[rotor]] disc", "a drive of its own")
    if ranks == 1:
        refused(squeal(scene, "--set", "rotor.0.part=pin", ranks=1), "exchange rotor and stator")
        slower = converged(scene, "--set", "sweep.key=rotor.0.rate", "--set", "sweep.values=[10,20]", ranks=1).report["sweep"]
        assert slower["points"][-1]["growth_rate"] == pytest.approx(own["modes"]["modes"][0]["growth_rate"], rel=1e-5)


def test_design_points_agree_with_single_runs_and_one_that_fails_costs_no_other(squeal, converged, tmp_path):
    scene = pin_scene(tmp_path, ("vector = [0, 0, -100]", 'vector = [0, 0, "-load"]'), more="\n[numbers]\nload = 100\n")
    points = [(0.3, 100), (-1, 100), (0.35, 200)]
    (tmp_path / "points.csv").write_text("friction.coefficient,numbers.load\n" + "".join(f"{mu},{load}\n" for mu, load in points))
    run = squeal(scene, "--set", "sweep.table=points.csv", ranks=1)
    assert run.code == 2
    found = run.report["sweep"]["points"]
    assert [point["outcome"] == "converged" for point in found] == [True, False, True]
    assert "friction.coefficient" in found[1]["reason"]
    for (mu, load), point in zip(points, found, strict=True):
        if point["outcome"] == "converged":
            alone = converged(scene, "--set", f"friction.coefficient={mu}", "--set", f"numbers.load={load}", ranks=1).report["modes"]
            assert point["unstable_modes"] == alone["unstable_count"]
            assert point["growth_rate"] == pytest.approx(alone["modes"][0]["growth_rate"], rel=1e-5)
    assert len((run.output / "sweep.csv").read_text().splitlines()) > 3


CAUGHT = {
    "a mesh in mm": (["mesh.scale=1000", "rigid_body.holder.at=[90,0,25]"], "is its mesh in mm? then mesh.scale = 0.001"),
    "no damping": (["damping.beta=0"], "nothing damps the structure"),
    "an axis in the surface": (["contact.0.rotation.axis=x"], "along the normal of the contact"),
    "a part at two rates": (["contact.1.rotation.rate=5"], "'disc' turns at 10 rad/s, and in the contact of"),
    "a number that stands nowhere": (["numbers.lost=1"], "'lost' of [numbers] stands nowhere"),
}


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    """The pin's table without a change."""
    return Run([PIN, *QUICK, "--dry-run"], 1, tmp_path_factory.mktemp("plain")).printed


@pytest.mark.parametrize("name", CAUGHT)
def test_what_is_hardly_meant_is_warned_of(converged, plain, name):
    given, words = CAUGHT[name]
    scene = [INPUTS / "disc_brake"] if "contact.1" in given[0] else [PIN, *QUICK]  # that has two faces
    run = converged(*scene, "--dry-run", *[word for key in given for word in ("--set", key)], ranks=1)
    assert "WARNING: " in run.printed and words in run.printed, run.printed[-2000:]
    assert "memory forecast" in plain and words not in plain


def test_a_load_that_pulls_bodies_apart_is_not_taken_for_friction(squeal, tmp_path):
    spring = re.search(r"^\[\[spring\]\].*?(?=^\[)", (PIN / "scene.toml").read_text(), re.M | re.S)[0]
    apart = squeal(pin_scene(tmp_path, (spring, ""), ("[0, 0, -100]", "[0, 0, 100]")), ranks=1)
    equilibrium = apart.report["equilibrium"]
    said = equilibrium.get("reason", "") + " ".join(equilibrium.get("warnings", []))
    assert "pulls a body away" in said and "friction is too large" not in said.replace("nor is there one without friction", "")
    assert not apart.report["heard"].startswith("silent")
    wedged = squeal(PIN, *MODES, "--set", "friction.coefficient=50", ranks=1).report["equilibrium"]
    assert wedged["outcome"] == "no equilibrium" and "without friction there is an equilibrium" in wedged["reason"]


def test_one_dash_is_enough_and_a_misspelt_folder_is_known(squeal, tmp_path):
    run = squeal(PIN, "-dry-run", ranks=1)
    assert run.code == 0 and "memory forecast" in run.printed and not run.output.exists()
    (tmp_path / "pin_on_disc").mkdir()
    (tmp_path / "pin_on_disc" / "scene.toml").write_text("")
    refused(squeal(tmp_path / "pin_on_disk", ranks=1), f"did you mean '{tmp_path}/pin_on_disc'")
    refused(squeal(PIN, "--vers", ranks=1), "did you mean '--version'?")


def test_a_dry_run_prints_the_scene_where_it_is_asked_to(plain, converged):
    resolved = converged(PIN, *QUICK, "--dry-run", "--resolve", ranks=1).printed
    assert "[friction]" not in plain and resolved.index("memory forecast") < resolved.index("[friction]")


@pytest.mark.parametrize("words, code, said", [(["--help"], 0, "tools/run SCENE"), (["--dry-run"], 1, "--dry-run stands before the scene")])
def test_the_script_that_runs_a_scene_tells_its_usage(words, code, said):
    done = subprocess.run([ROOT / "tools" / "run", *words], capture_output=True, text=True, timeout=20)
    assert done.returncode == code and said in done.stdout + done.stderr


def test_a_warning_that_the_motion_settles_disappears(converged):
    """The estimate's doubt about its amplitude goes when the cycle is found."""
    given = [PIN, *QUICK, "--set", "damping.beta=6e-7", "--set", "cycle.steps_per_period=40", "-cycle_multipliers", "0"]
    alone = converged(*given, "--set", "cycle.enabled=false", ranks=1).report["estimate"]
    found = converged(*given, ranks=1).report
    assert found["cycle"]["outcome"] == "converged"
    assert "warnings" not in found["estimate"] and json.dumps(alone).count("first lift-off") <= 1


NEVER_SILENT = {
    "no contact": (r"^\[\[contact\]\].*?(?=^\[)", "", "no contact"),
    "no load": (r"^\[\[force\]\].*?(?=^\[)", "", "nothing presses"),
    "along its normal": (r"rotation = \{.*?\}", "velocity = [0, 0, 1]", "nothing slides"),
}


@pytest.mark.parametrize("name", NEVER_SILENT)
def test_silence_is_not_said_where_friction_feeds_nothing(converged, tmp_path, name):
    part, instead, words = NEVER_SILENT[name]
    scene = pin_scene(tmp_path)
    scene.write_text(re.sub(part, instead, scene.read_text(), flags=re.M | re.S))
    report = converged(scene, ranks=1).report
    assert report["heard"].startswith(words) and " report " in report["next"]


def test_a_table_of_a_spreadsheet_is_read_or_its_form_is_told(converged, squeal, tmp_path):
    rows = "friction.coefficient,force.0.vector.2\r\n0.1,-100\r\n0.3,-90\r\n"
    (tmp_path / "points.csv").write_bytes(b"\xef\xbb\xbf" + rows.encode())
    scene = pin_scene(tmp_path, more='[sweep]\ntable = "points.csv"\n')
    assert len(converged(scene, ranks=1).report["sweep"]["points"]) == 2
    (tmp_path / "points.csv").write_text(rows.replace(",", ";"))
    assert "points.csv, line 1: " in squeal(scene, "--dry-run", ranks=1).messages[0]


def test_help_shows_the_keys_of_a_table(squeal):
    assert squeal("--help", "rotor", ranks=1).printed.startswith("`[[rotor]]`: ")
    unknown = squeal("--help", "roter", ranks=1)
    assert unknown.code == 1 and "--help roter: no such table" in unknown.errors


def test_a_name_that_is_no_number_of_the_scene_is_told_with_the_nearest(squeal, tmp_path):
    scene = pin_scene(tmp_path, ("[0, 0, -100]", '[0, 0, "-clamp"]'), more="[numbers]\nclampp = 100\n")
    assert "no number of [numbers] has that name; did you mean 'clampp'?" in squeal(scene, "--dry-run", ranks=1).messages[0]
