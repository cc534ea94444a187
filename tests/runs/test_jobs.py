"""The jobs, started as scripts: they fail with their runs, tabulate their own and go on from where they were ended."""

import json
import os
import subprocess
import time

from conftest import INPUTS, ROOT


def job(folder, name="mu_sweep.sh", wait=True, **knobs):
    environment = os.environ | {"OUTPUT": str(folder), "RANKS": "1", "SCENE": str(INPUTS / "oscillator" / "scene.toml")} | knobs
    run = subprocess.Popen([ROOT / "jobs" / name], cwd="/", env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                           text=True)
    return (run, *run.communicate(timeout=120)) if wait else run


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


def test_a_signal_ends_a_job_and_the_next_start_goes_on(tmp_path):
    run = job(tmp_path, "long_run.sh", wait=False, PERIODS="100000")
    end = time.time() + 30
    while not (tmp_path / "estimate.partial" / "history.h5").exists() and time.time() < end:
        time.sleep(0.05)
    time.sleep(0.5)
    run.terminate()
    run.communicate(timeout=60)
    assert run.returncode == 3
    report = json.loads((tmp_path / "estimate" / "report.json").read_text())
    assert report["exit_code"] == 3 and (tmp_path / "estimate" / "checkpoint").exists()
    assert not (tmp_path / "mode").exists()


def test_the_study_in_python_runs(tmp_path):
    run = subprocess.run([ROOT / "jobs" / "study.py"], cwd=tmp_path, capture_output=True, text=True, timeout=200)
    assert run.returncode == 0, run.stderr
    assert "friction 0.3: mode 1" in run.stdout and "1.000 alike" in run.stdout  # of the mode with itself
    assert (tmp_path / "results" / "study" / "study.png").stat().st_size > 10000
