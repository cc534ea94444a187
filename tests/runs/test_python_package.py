"""The Python package: a python without its modules, scenes as dicts, studies, and the wheel away from the sources."""

import io
import os
import re
import subprocess
import sys
import zipfile

import pytest
from conftest import INPUTS, ROOT

sys.path.insert(0, str(ROOT / "tools"))
import squeal  # noqa: E402

PYTHON = "/usr/bin/python3"


def test_a_program_without_the_modules_goes_on(tmp_path):
    """The import raises, with a remedy, and replaces nothing."""
    text = f"""
import sys
sys.path.insert(0, {str(ROOT / "tools")!r})
try:
    import squeal
except ImportError as error:
    print("raised:", error)
print("alive")
"""
    # -S: without any module but python's own
    done = subprocess.run([PYTHON, "-S", "-B", "-c", text], capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    first, last = done.stdout.splitlines()
    assert re.match("raised: squeal needs the python module h5py, numpy, .* lacks: pip install h5py numpy", first)
    assert last == "alive"


def test_a_scene_is_a_dict_that_is_edited_and_saved(tmp_path):
    for file in sorted(INPUTS.glob("*/scene.toml")):
        scene = squeal.Scene(file)
        scene.save(tmp_path / f"{scene.name}.toml")
        again = squeal.Scene(tmp_path / f"{scene.name}.toml")
        assert list(again) and scene._with_places(dict(scene)) == dict(again), file
    scene = squeal.Scene(INPUTS / "pin_on_disc")
    scene.set("friction.coefficient", 0.21).set("force.0.vector", [0, 0, -120]).set("response.probes", ["pin"])
    kept = squeal.Scene(scene.save(tmp_path / "edited"))
    assert kept["friction"]["coefficient"] == 0.21 and kept.get_key("force.0.vector") == [0, 0, -120]
    assert kept.get_key("mesh.file") == str(INPUTS / "pin_on_disc" / "pin.geo") and kept["response"] == {"probes": ["pin"]}
    for key in ("force.7.vector", "frictio.coefficient", "title.x"):
        with pytest.raises(squeal.SquealError, match=f"there is no {key}"):
            kept.get_key(key)
    with pytest.raises(squeal.SquealError, match="no-such.toml: No such file"):
        squeal.Scene("no-such.toml")


def test_named_numbers_stand_wherever_a_key_takes_one():
    """In lists, with a minus and in nested tables; a text of the same name stays one."""
    from squeal.scene import with_numbers

    scene = {"numbers": {"load": 3, "disc": 5.0}, "part": [{"name": "disc", "young": "disc"}], "force": [{"on": "load", "vector": [0, 0, "-load"]}],
             "contact": [{"rotation": {"axis": "disc", "rate": "disc"}, "factor_at_speed": [["load", 1]]}], "branch": {"from": "load"},
             "spring": [{"from": "disc", "stiffness": "load"}], "step": [{"bolts": ["load"], "forces": ["load", 1]}], "sensitivity": {"numbers": ["load"]}}
    assert with_numbers(scene) == {
        "numbers": {"load": 3, "disc": 5.0}, "part": [{"name": "disc", "young": 5}], "force": [{"on": "load", "vector": [0, 0, -3]}],
        "contact": [{"rotation": {"axis": "disc", "rate": 5}, "factor_at_speed": [[3, 1]]}], "branch": {"from": 3},
        "spring": [{"from": "disc", "stiffness": 3}], "step": [{"bolts": ["load"], "forces": [3, 1]}], "sensitivity": {"numbers": ["load"]}}


def test_the_keys_that_take_texts_are_known():
    """Keys of the page: texts, words, paths, motions and directions, for which no number stands by name."""
    from squeal.scene import ENDS, TEXTS

    rows = re.findall(r"^\| `(\w+)` \| ([^|]*) \|[^|]*\| ?([^|]*?) ?\|", (INPUTS / "KEYS.md").read_text(), re.M)
    plain = {key for key, unit, value in rows if unit in ("text", "texts", "word", "path", "motions") or value == "direction"}
    assert plain - {*ENDS} == TEXTS
    assert {key for key, unit, value in rows if unit not in ("text", "texts", "word", "path", "motions", "switch", "table") and value != "direction"} & TEXTS == set()


def test_a_folder_that_is_not_there_is_said_to_be_none(tmp_path):
    with pytest.raises(squeal.SquealError, match="there is no folder .*/nowhere$"):
        squeal.Results(tmp_path / "nowhere")
    (tmp_path / "pin_on_disc").mkdir()
    (tmp_path / "pin_on_disc" / "report.json").write_text("{}")
    with pytest.raises(squeal.SquealError, match="there is no folder .*; results are in .*pin_on_disc$"):
        squeal.Results(tmp_path / "pin_on_dics")


@pytest.mark.parametrize("frequency, words", [(0.16873, "0.1687 Hz"), (12.3456, "12.35 Hz"), (5057.23, "5057.2 Hz"), (123456, "1.235e+05 Hz")])
def test_frequencies_keep_their_digits(frequency, words):
    from squeal.results import Results

    assert Results._answer("cycle", {"frequency_hz": frequency}) == words


def test_places_are_the_paths_that_are_read():
    """Of the page of keys: those of existing files and folders."""
    keys = re.findall(r"^\| `(\w+)` \| path \|[^|]*\| existing", (INPUTS / "KEYS.md").read_text(), re.M)
    from squeal.scene import PLACES

    assert set(PLACES) == set(keys)


def test_a_study_keeps_what_failed_and_shows_progress(tmp_path):
    scene = squeal.Scene(INPUTS / "oscillator").set("cycle.enabled", False).set("transient.enabled", False)
    bar = io.StringIO()
    found = squeal.study(scene, {"friction.coefficient": [0.1, -1, 0.3]}, output=tmp_path, progress=bar)
    assert list(found.errors) == [1] and "friction.coefficient" in str(found.errors[1])
    assert repr(found) == "Study of 3 points: 2 runs, 1 failed"
    table = found.table(unstable=lambda run: run.report["modes"]["unstable_count"])
    assert table["friction.coefficient"].tolist() == [0.1, -1, 0.3]
    assert table["unstable"][0] == 0 < table["unstable"][2] and table["unstable"].isna().tolist() == [False, True, False]
    lines = bar.getvalue().splitlines()
    assert len(lines) == 4 and lines[0].startswith("[....") and re.search(r"#\] 3/3, \d+ s  1 failed$", lines[-1])


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """A folder with the wheel's files, as pip lays them."""
    folder = tmp_path_factory.mktemp("wheel")
    subprocess.run([PYTHON, "-m", "hatchling", "build", "-t", "wheel", "-d", folder], cwd=ROOT / "tools", check=True,
                   capture_output=True)
    [wheel] = folder.glob("squeal_fem-*-py3-none-any.whl")
    with zipfile.ZipFile(wheel) as content:
        content.extractall(folder / "site")
    return folder / "site"


def outside(site, text, **more):
    """Runs a text in Debian's python with the wheel, away from the sources."""
    environment = {key: value for key, value in os.environ.items() if key not in ("SQUEAL", "SQUEAL_PYTHON")}
    return subprocess.run([PYTHON, "-B", "-c", text], env=environment | {"PYTHONPATH": str(site)} | more, cwd=site.parent,
                          capture_output=True, text=True)


def test_the_wheel_runs_without_the_sources(site):
    text = f'import squeal; print(squeal.__file__, repr(squeal.run({str(INPUTS / "oscillator")!r}, output="results")))'
    done = outside(site, text, SQUEAL=os.environ["SQUEAL"])
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(str(site)) and "exit code 0" in done.stdout


def test_without_the_program_the_wheel_says_how_to_get_it(site, tmp_path):
    (tmp_path / "bin").mkdir()
    done = outside(site, f'import squeal; squeal.run({str(INPUTS / "oscillator")!r})', PATH=str(tmp_path / "bin"))
    assert done.returncode == 1 and "is missing: tools/build makes it, a Debian package or a container brings it" in done.stderr


def test_every_entry_point_is_a_tool(site):
    [entries] = site.glob("*.dist-info/entry_points.txt")
    found = re.findall(r"^squeal-(\w+) = squeal\.entry:(\w+)$", entries.read_text(), re.M)
    assert {name for name, _ in found} == {"plot", "report", "mesh", "matrices", "sound", "uff"}
    text = f"""
import sys
from squeal import entry
for name, function in {found!r}:
    sys.argv = [f"squeal-{{name}}", "--help"]
    try:
        getattr(entry, function)()
    except SystemExit as end:
        print("ended:", end.code)
"""
    done = outside(site, text)
    assert re.findall(r"^usage: squeal-(\w+)|^ended: (.*)", done.stdout, re.M) == [
        word for name, _ in found for word in ((name, ""), ("", "0"))], done.stderr
    wrong = outside(site, "import sys; sys.argv = ['squeal-report', 'nothing']; from squeal.entry import report; report()")
    assert wrong.returncode == 1 and wrong.stderr.startswith("squeal-report: there is no folder nothing")


def test_the_version_stands_in_one_place(site):
    [metadata] = site.glob("*.dist-info/METADATA")
    version = re.search(r"^Version: (.*)$", metadata.read_text(), re.M)[1]
    done = subprocess.run([os.environ["SQUEAL"], "--version"], capture_output=True, text=True)
    assert done.stdout.splitlines()[0].split() == ["squeal", version]
    assert re.search(rf"^## {re.escape(version)}\b", (ROOT / "tools" / "CHANGELOG.md").read_text(), re.M)
