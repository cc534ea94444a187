"""Results are one whole: a folder holds the files of one run, whatever happens to the runs that write into it."""

import json
import os
import resource
import shutil
import signal
import subprocess

import pytest
from conftest import INPUTS, ROOT, cores, wait_for

SCENE = INPUTS / "oscillator" / "scene.toml"
SHORT = ["--set", "transient.periods=5", "--set", "cycle.enabled=false"]
ENDLESS = ["--set", "transient.periods=1e5"]


def start(output, *arguments, scene=SCENE):
    command = [os.environ["SQUEAL"], scene, "--output", output, *arguments]
    return subprocess.Popen([str(word) for word in command], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)


@pytest.fixture
def endless(tmp_path):
    """A run that goes on until the test ends, in the midst of its transient."""
    runs = []

    def begin(output, *arguments):
        runs.append(start(output, *ENDLESS, *arguments))
        wait_for(lambda: (output / ".partial" / "history.h5").exists())
        return runs[-1]

    yield begin
    for run in runs:
        run.kill()
        run.wait()


def contents(folder):
    return {file.name: file.read_bytes() for file in folder.iterdir() if file.is_file()}


def test_earlier_results_stay_when_a_run_is_killed(converged, endless, tmp_path):
    output = converged(SCENE, *SHORT, ranks=1).output
    before = contents(output)
    run = endless(output)
    run.send_signal(signal.SIGKILL)
    run.wait()
    assert contents(output) == {**before, ".running": contents(output)[".running"]}
    assert converged(SCENE, *SHORT, "--output", output, ranks=1).code == 0  # the lock of the dead one is no obstacle
    after = contents(output)
    assert set(after) == set(before) and after["report.json"] != before["report.json"]
    assert not (output / ".partial").exists()


def test_a_second_run_into_the_same_folder_is_refused(squeal, endless, tmp_path):
    endless(tmp_path / "results")
    second = squeal(SCENE, *SHORT, "--output", tmp_path / "results")
    assert second.code == 1 and len(second.messages) == 1 and "another run" in second.messages[0]
    assert (tmp_path / "results" / ".partial" / "options.txt").exists()


def test_every_file_names_its_run_and_tools_refuse_a_mixture(converged):
    first, second = (converged(SCENE, *SHORT, ranks=1) for _ in range(2))
    names = {"report.json", "history.h5", "fields.h5", "fields.xdmf", "resolved.toml", "options.txt"}
    assert set(contents(first.output)) == names
    run = first.report["run"].encode()
    assert all(run in content for content in contents(first.output).values())
    assert run != second.report["run"].encode()
    plot = [ROOT / "tools" / "plot", first.output]
    for name in names - {"report.json"}:
        kept = (first.output / name).read_bytes()
        shutil.copy(second.output / name, first.output / name)
        done = subprocess.run(plot, capture_output=True, text=True)
        assert done.returncode == 1 and name in done.stderr and "another" in done.stderr
        (first.output / name).write_bytes(kept)
    assert subprocess.run(plot, capture_output=True).returncode == 0


def test_the_working_folder_may_be_the_place_and_keeps_the_users_files(tmp_path):
    shutil.copy(SCENE, tmp_path)
    (tmp_path / "notes.txt").write_text("mine")
    for _ in range(2):
        done = subprocess.run([os.environ["SQUEAL"], "scene.toml", "--output", ".", *SHORT], cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
    names = {"report.json", "history.h5", "fields.h5", "fields.xdmf", "resolved.toml", "options.txt"}
    assert {file.name for file in tmp_path.iterdir()} == names | {"scene.toml", "notes.txt"}
    assert (tmp_path / "notes.txt").read_text() == "mine" and (tmp_path / "scene.toml").read_bytes() == SCENE.read_bytes()


@pytest.mark.parametrize("moved", [None, 0, 3])
def test_a_kill_between_the_moves_loses_nothing(converged, squeal, tmp_path, moved):
    """The next run ends the move, here one that does not get further. `moved`: files, of which the earlier report is gone before the first."""
    output, finished = (converged(SCENE, *SHORT, ranks=1).output for _ in range(2))
    (output / "energy.png").write_text("a picture")
    (output / "sweep.csv").write_text("of the earlier run")
    expected = contents(finished) | {"energy.png": b"a picture"}
    (output / ".running").write_text("a run")
    finished = finished.rename(output / ".finished")
    if moved is not None:
        (output / "sweep.csv").unlink()
        (output / "report.json").unlink()
        for name in sorted(set(expected) - {"energy.png", "report.json"})[:moved]:
            (finished / name).rename(output / name)
    assert squeal(SCENE, "--output", output, "--set", f"transient.save_state={output}/history.h5", ranks=1).code == 1
    assert contents(output) == expected and not finished.exists() and not (output / ".partial").exists()


def test_a_state_may_stand_inside_the_results(converged, tmp_path):
    output = tmp_path / "results"
    for _ in range(2):
        converged(SCENE, *SHORT, "--set", f"transient.save_state={output}/end.state", "--output", output, ranks=1)
        assert (output / "end.state").stat().st_size == 2 * (8 + 8 * 3)
    assert str(output / "end.state") in (output / "resolved.toml").read_text()


@pytest.mark.parametrize("output", ["resolved.toml", "report.json", "same.state"])
def test_no_output_falls_on_an_input(squeal, tmp_path, output):
    """The scene file has the name of a result, or one state would be written over another."""
    scene = tmp_path / (output if output.endswith(".toml") else "scene.toml")
    shutil.copy(SCENE, scene)
    arguments = ["--output", tmp_path] if output == "resolved.toml" else []
    if output == "report.json":
        arguments = ["--set", f"transient.save_state={tmp_path}/report.json", "--output", tmp_path]
    if output == "same.state":
        arguments = ["--set", f"transient.save_state={tmp_path}/a.state", "--set", f"cycle.save_state={tmp_path}/a.state"]
    run = squeal(scene, *arguments, ranks=1)
    assert run.code == 1 and len(run.messages) == 1, run.errors
    assert {file.name for file in tmp_path.iterdir()} == {scene.name}


def make_device(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    return ["--set", f"transient.save_state={tmp_path}/pipe"]


def make_folder_of_a_file(tmp_path):
    (tmp_path / "out" / "history.h5").mkdir()
    (tmp_path / "out" / "history.h5" / "mine.txt").write_text("precious")
    return []


def make_link(tmp_path):
    (tmp_path / "victim").mkdir()
    (tmp_path / "victim" / "report.json").write_text("mine")
    (tmp_path / "out" / ".partial").symlink_to(tmp_path / "victim")
    return []


def make_foreign_partial(tmp_path):
    (tmp_path / "out" / ".partial").mkdir()
    (tmp_path / "out" / ".partial" / "mine.txt").write_text("precious")
    return []


def make_matrices_of_a_results_name(tmp_path):
    shutil.copytree(INPUTS / "oscillator" / "matrices", tmp_path / "out" / "checkpoint")
    return []


def make_scene_on_matrices_of_a_results_name(tmp_path):
    make_matrices_of_a_results_name(tmp_path)
    (tmp_path / "out" / "options.txt").write_text("of a run")
    return ["--set", f"matrices.folder={tmp_path}/out/checkpoint"]


def make_link_to_nothing(tmp_path):
    (tmp_path / "link").symlink_to(tmp_path / "nothing")
    return ["--output", tmp_path / "link"]


REFUSED = {"a pipe": (make_device, "pipe"), "a folder of a file's name": (make_folder_of_a_file, "history.h5 is a folder"),
           "a link": (make_link, "no run has made"), "a folder of another origin": (make_foreign_partial, "no run has made"),
           "a folder of a result's name": (make_matrices_of_a_results_name, "no run has made"),
           "matrices in a result's place": (make_scene_on_matrices_of_a_results_name, "fall on"),
           "a link to nothing": (make_link_to_nothing, "File exists"),
           "a log on the scene": (lambda tmp_path: ["-log_view", f":{SCENE}"], "fall on the scene"),
           "a log on a result": (lambda tmp_path: ["-history", tmp_path / "out" / "report.json"], "report.json")}


@pytest.mark.parametrize("name", REFUSED)
def test_nothing_of_the_users_is_replaced(squeal, tmp_path, name):
    """Each was removed or written over, with exit code 0."""
    make, words = REFUSED[name]
    (tmp_path / "out").mkdir()
    given = make(tmp_path)
    before = sorted(tmp_path.rglob("*")), files_below(tmp_path), SCENE.read_bytes()
    scene = SCENE.with_name("matrices.toml") if any("matrices.folder" in str(word) for word in given) else SCENE
    run = squeal(scene, *([] if "--output" in given else ["--output", tmp_path / "out"]), *given, ranks=1)
    assert run.code == 1 and len(run.messages) == 1 and words in run.messages[0], run.errors
    assert before == (sorted(tmp_path.rglob("*")), files_below(tmp_path), SCENE.read_bytes())


def test_files_of_another_origin_stay_and_results_of_other_stages_go(converged):
    output = converged(SCENE, *SHORT, ranks=1).output
    (output / "energy.png").write_text("a picture")
    (output / "notes").mkdir()
    (output / "sweep.csv").write_text("of the earlier run")
    converged(SCENE, *SHORT, "--output", output, ranks=1)
    assert (output / "energy.png").read_text() == "a picture" and (output / "notes").is_dir()
    assert not (output / "sweep.csv").exists() and not list(output.glob(".*"))


@pytest.mark.parametrize("ranks", [1, 2])
def test_a_reader_that_is_gone_costs_no_results(tmp_path, ranks):
    """mpirun itself asks its ranks to end then, and its exit code is its own."""
    read, write = os.pipe()
    os.close(read)
    output = tmp_path / "results"
    launcher = [os.environ.get("MPIEXEC", "mpirun"), "-n", "2"] if ranks == 2 else []
    with cores(ranks):
        run = subprocess.run([*launcher, os.environ["SQUEAL"], SCENE, *SHORT, "--output", output], stdout=write, stderr=subprocess.DEVNULL)
    os.close(write)
    assert json.loads((output / "report.json").read_text())["exit_code"] in (0, 3)
    assert run.returncode == 0 or ranks == 2


def files_below(folder):
    return {file.relative_to(folder): file.read_bytes() for file in folder.rglob("*") if file.is_file()}


@pytest.mark.parametrize("size", [1000, 30000, 1000000])
def test_no_room_for_a_file_is_one_message_and_leaves_the_folder_as_it_was(converged, tmp_path, size):
    """By the limit on the size of a file, set once MPI has made its own."""
    output = tmp_path / "results"
    converged(SCENE, *SHORT, "--output", output, ranks=1)
    before = files_below(tmp_path)
    run = start(output, "--set", "transient.periods=200", "--set", "cycle.enabled=false")  # a history of 6 MB
    wait_for(lambda: (tmp_path / "results" / ".partial" / "options.txt").exists())
    resource.prlimit(run.pid, resource.RLIMIT_FSIZE, (size, size))
    errors = run.communicate()[1]
    assert run.returncode == 1, errors
    lines = errors.strip().splitlines()
    assert len(lines) == 1 and lines[0].startswith("squeal: error: cannot write") and "MB" in lines[0], errors
    assert files_below(tmp_path) == before


@pytest.fixture
def small_disk(tmp_path):
    """A function that mounts a disk of this size."""
    disk = tmp_path / "disk"
    disk.mkdir()

    def mount(kilobytes):
        command = ["mount", "-t", "tmpfs", "-o", f"size={kilobytes}k", "tmpfs", disk]
        if os.geteuid() != 0 or subprocess.run(command, capture_output=True).returncode != 0:
            pytest.skip("no right to mount here")
        return disk

    yield mount
    subprocess.run(["umount", disk], capture_output=True)


@pytest.mark.parametrize("kilobytes", [4, 32, 64])
def test_a_full_file_system_too(small_disk, kilobytes):
    """HDF5 fails neither when it closes its file nor when MPI ends."""
    disk = small_disk(kilobytes)
    with cores(2):
        done = subprocess.run(["mpirun", "-n", "2", os.environ["SQUEAL"], SCENE, "--set", "cycle.enabled=false", "--output",
                               disk / "results"], capture_output=True, text=True)
    messages = [line for line in done.stderr.splitlines() if line.startswith("squeal: ")]
    assert done.returncode == 1 and len(messages) == 1, done.stderr
    assert "No space left" in messages[0] and "MB are free" in messages[0] and "--output" in messages[0]
    assert not list(disk.iterdir())
