"""The jobs, started as scripts: they fail with their runs, tabulate their own and go on from where they were ended."""

import json
import os
import shutil
import subprocess
import time

import pytest

from conftest import INPUTS, ROOT, cores, wait_for


def job(folder, name="mu_sweep.sh", wait=True, arguments=(), **knobs):
    environment = os.environ | {"OUTPUT": str(folder), "RANKS": "1", "SCENE": str(INPUTS / "oscillator" / "scene.toml")} | knobs
    run = subprocess.Popen([ROOT / "jobs" / name, *arguments], cwd="/", env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                           text=True)
    return (run, *run.communicate(timeout=300)) if wait else run


def test_a_sweep_tabulates_its_own_runs_and_skips_those_that_are_done(tmp_path):
    run, printed, errors = job(tmp_path, MU="0.2")
    assert run.returncode == 0, errors
    run, printed, errors = job(tmp_path, MU="0.3")
    table = printed.splitlines()[printed.splitlines().index(next(line for line in printed.splitlines() if "unstable  freq" in line)):]
    assert len(table) == 2 and table[1].split()[0] == "0.3"
    before = (tmp_path / "mu_0.3" / "report.json").read_bytes()
    run, printed, errors = job(tmp_path, MU="0.3")
    assert run.returncode == 0 and (tmp_path / "mu_0.3" / "report.json").read_bytes() == before


def test_a_sweep_fails_with_its_runs(tmp_path):
    for knobs in ({"SCENE": "no.toml"}, {"SQUEAL": "/bin/false"}):
        run, printed, errors = job(tmp_path, MU="0.2", **knobs)
        assert run.returncode == 1 and "mu_0.2: exit code" in errors and "unstable" not in printed


def test_a_run_of_other_arguments_or_inputs_is_not_done(tmp_path):
    """An earlier one's table came out, with exit code 0."""
    shutil.copytree(INPUTS / "oscillator", tmp_path / "scene")
    scene, report = tmp_path / "scene" / "matrices.toml", tmp_path / "out" / "mu_0.2" / "report.json"
    knobs = {"SCENE": str(scene), "MU": "0.2"}
    assert job(tmp_path / "out", **knobs)[0].returncode == 0
    first = report.read_bytes()
    assert job(tmp_path / "out", **knobs)[0].returncode == 0 and report.read_bytes() == first
    for changed in (scene, tmp_path / "scene" / "matrices" / "notes.txt"):
        with open(changed, "a") as file:
            file.write("# a word\n")
        before = report.read_bytes()
        assert job(tmp_path / "out", **knobs)[0].returncode == 0 and report.read_bytes() != before, changed
    run, printed, errors = job(tmp_path / "out", arguments=["--set", "wrong.key=1"], **knobs)
    assert run.returncode == 1 and "unstable" not in printed
    run, printed, errors = job(tmp_path / "out", MU="0.2", SCENE=str(tmp_path / "no.toml"))
    assert run.returncode == 1 and "unstable" not in printed


def test_a_signal_ends_a_job_and_the_next_start_goes_on(tmp_path):
    run = job(tmp_path, "long_run.sh", wait=False, PERIODS="100000")
    wait_for(lambda: (tmp_path / "estimate" / ".partial" / "history.h5").exists())
    time.sleep(0.5)  # until a step is made: the run has 100000 periods
    run.terminate()
    run.communicate(timeout=300)
    assert run.returncode == 3
    report = json.loads((tmp_path / "estimate" / "report.json").read_text())
    assert report["exit_code"] == 3 and (tmp_path / "estimate" / "checkpoint").exists()
    assert not (tmp_path / "mode").exists()


def columns_of(folder):
    head, *rows = (line.split(",") for line in (folder / "table.csv").read_text().splitlines())
    return {name: [row[k] for row in rows] for k, name in enumerate(head)}


PIN = {"SCENE": str(INPUTS / "pin_on_disc" / "scene.toml")}
QUICK = [word for stage in ("modes", "estimate", "cycle") for word in ("--set", f"{stage}.enabled=false")]


def test_scaling_jobs_tabulate_and_draw(tmp_path):
    with cores(2):
        run, printed, errors = job(tmp_path / "strong", "strong_scaling.sh", arguments=QUICK, COUNTS="1 2", **PIN)
    assert run.returncode == 0, errors
    strong = columns_of(tmp_path / "strong")
    assert strong["ranks"] == ["1", "2"] and strong["dofs"] == ["2821", "2821"] and float(strong["whole run eff."][0]) == 1
    reports = [json.loads((tmp_path / "strong" / f"ranks_{n}" / "report.json").read_text()) for n in (1, 2)]
    assert [r["model"]["ranks"] for r in reports] == [1, 2]
    t = [sum(r["timings"].values()) for r in reports]
    assert abs(float(strong["whole run eff."][1]) - t[0] / t[1] / 2) < 0.006  # of two decimals
    with cores(2):
        run, printed, errors = job(tmp_path / "weak", "weak_scaling.sh", arguments=QUICK, COUNTS="1 2", PER_RANK="2",
                                   KEY="mesh.parameters.divisions", **PIN)
    assert run.returncode == 0, errors
    weak = columns_of(tmp_path / "weak")
    assert weak["dofs"][1] == "2821" and int(weak["dofs"][0]) < 1000
    for kind in ("strong", "weak"):
        assert (tmp_path / kind / "chart.png").stat().st_size > 5000


@pytest.mark.parametrize("script, knobs, message", [
    ("strong_scaling.sh", {"COUNTS": "0 2"}, "COUNTS: '0' is no whole number from 1 on"),
    ("weak_scaling.sh", {"COUNTS": "1 a"}, "COUNTS: 'a' is"),
    ("weak_scaling.sh", {"COUNTS": "1 2", "PER_RANK": "-5"}, "PER_RANK: '-5' is"),
    ("many_runs.sh", {"SIDE": "none"}, "SIDE: 'none' is"),
])
def test_a_bad_knob_ends_a_job_with_one_message_before_any_run(tmp_path, script, knobs, message):
    run, printed, errors = job(tmp_path / "out", script, arguments=QUICK, **knobs, **PIN)
    assert run.returncode == 1 and errors.startswith(message) and len(errors.splitlines()) == 1
    assert not list(tmp_path.glob("out/*"))


def test_jobs_say_what_they_are_for(tmp_path):
    run, printed, errors = job(tmp_path / "out", "many_runs.sh", arguments=["--help"])
    assert run.returncode == 0 and "Knobs: SCENE, KEY, VALUES" in printed and not (tmp_path / "out").exists()


def test_many_runs_go_side_by_side_and_skip_those_that_are_done(tmp_path):
    """The first two wait for each other."""
    together = tmp_path / "together"
    together.write_text(f"#!/bin/sh\ntouch {tmp_path}/begun_$$\nuntil [ $(ls {tmp_path} | grep -c begun_) -ge 2 ]; do sleep 0.02; done\n"
                        f'exec {os.environ["SQUEAL"]} "$@"\n')
    together.chmod(0o755)
    knobs = {"KEY": "friction.coefficient", "VALUES": "0.1 0.2 0.3", "SIDE": "2", "SQUEAL": str(together), **PIN}
    with cores(2):
        run, printed, errors = job(tmp_path, "many_runs.sh", arguments=QUICK, **knobs)
    assert run.returncode == 0, errors
    assert columns_of(tmp_path)["value"] == ["0.1", "0.2", "0.3"]
    times = {line.split()[0]: tuple(map(float, line.split()[1:])) for line in (tmp_path / "times.txt").read_text().splitlines()}
    first, second = sorted(times.values())[:2]
    assert second[0] < first[1]  # two at a time
    assert max(sum(start <= at < end for start, end in times.values()) for at, _ in times.values()) == 2
    assert (tmp_path / "chart.png").stat().st_size > 5000
    before = (tmp_path / "times.txt").read_bytes()
    run, printed, errors = job(tmp_path, "many_runs.sh", arguments=QUICK, **knobs)
    assert run.returncode == 0 and (tmp_path / "times.txt").read_bytes() == before
    run, printed, errors = job(tmp_path / "bad", "many_runs.sh", arguments=QUICK, **{**knobs, "SCENE": "no.toml"})
    assert run.returncode == 1 and "value_0.1: exit code 1" in (tmp_path / "bad" / "value_0.1.txt").read_text()


def test_many_runs_end_in_order_and_go_on(tmp_path):
    knobs = {"KEY": "friction.coefficient", "VALUES": "0.3 0.4 0.5", "SIDE": "2"}
    run = job(tmp_path, "many_runs.sh", wait=False, arguments=["--set", "cycle.enabled=false", "--set", "transient.periods=100000"], **knobs)
    wait_for(lambda: len(list(tmp_path.glob("*/.partial/history.h5"))) == 2)
    run.terminate()
    printed = run.communicate(timeout=300)
    assert run.returncode == 3, [*printed, *(text.read_text() for text in tmp_path.glob("value_*.txt"))]
    assert not (tmp_path / "times.txt").exists() and not (tmp_path / "value_0.5").exists()
    for value in ("0.3", "0.4"):
        assert json.loads((tmp_path / f"value_{value}" / "report.json").read_text())["exit_code"] == 3


def test_the_study_in_python_runs(tmp_path):
    run = subprocess.run([ROOT / "jobs" / "study.py"], cwd=tmp_path, capture_output=True, text=True, timeout=200)
    assert run.returncode == 0, run.stderr
    assert "friction 0.3: mode 1" in run.stdout and "1.000 alike" in run.stdout  # of the mode with itself
    assert (tmp_path / "results" / "study" / "study.png").stat().st_size > 10000
