"""The jobs under a real Slurm of one node: they fail with their runs, end in order, and go on when they are queued again."""

import functools
import json
import os
import time

import pytest
import slurm as one_node
from conftest import INPUTS, ROOT
from cores import cores

if not one_node.is_installed():
    pytest.skip("slurm-wlm is not installed: the jobs are not tested under Slurm", allow_module_level=True)

OSCILLATOR = INPUTS / "oscillator" / "scene.toml"
WRONG_KEY = ["--set", "friktion.coefficient=1"]


@pytest.fixture(scope="module")
def slurm(tmp_path_factory):
    """More cores than there are: the short jobs run side by side, on the one that other tests leave them."""
    with cores(1):
        running = one_node.Slurm(tmp_path_factory.mktemp("slurm"), cores=24)
        yield running
        running.stop()


def submit_to(slurm, folder, job, arguments=(), options=(), **knobs):
    """Submits a job from the root folder, with nothing of this environment; knobs are given one by one."""
    given = {"SCENE": OSCILLATOR, "OUTPUT": folder, "MU": "0.2", "SQUEAL": os.environ["SQUEAL"]} | knobs
    exported = ",".join(["--export=NONE", *(f"{name}={value}" for name, value in given.items())])
    return slurm.submit(ROOT / "jobs" / job, [exported, f"--output={folder}/%x-%j.txt", *options], arguments)


@pytest.fixture
def submit(slurm, tmp_path):
    return functools.partial(submit_to, slurm, tmp_path)


@pytest.fixture(scope="module", autouse=True)
def limited(slurm, tmp_path_factory):
    """Folder and number of a job that would never end; Slurm looks at limits of time every half minute only."""
    folder = tmp_path_factory.mktemp("limited")
    return folder, submit_to(slurm, folder, "long_run.sh", options=["--time=1", "--ntasks=1"], PERIODS=100000)


def printed(job):
    with open(job["StdOut"], errors="replace") as file:
        return file.read()


def rows_of_table(text):
    """First column of the sweep's table."""
    lines = text.splitlines()
    header = max((i for i, line in enumerate(lines) if "unstable  frequency" in line), default=len(lines))
    return [line.split()[0] for line in lines[header + 1:]]


def report_of(folder):
    return json.loads((folder / "report.json").read_text())


def processes_of(folder):
    commands = []
    for pid in filter(str.isdigit, os.listdir("/proc")):
        try:
            with open(f"/proc/{pid}/cmdline", "rb") as file:
                commands.append(file.read().decode(errors="replace"))
        except OSError:
            pass
    return [command for command in commands if "squeal" in command and str(folder) in command]


def test_jobs_fail_with_their_runs(slurm, submit, tmp_path):
    """Each of these ended as COMPLETED where a job looked at its last command alone."""
    killed = tmp_path / "killed"
    killed.write_text("#!/bin/sh\nkill -9 $$\n")  # as the kernel does where memory runs out
    killed.chmod(0o755)
    first = slurm.ended(submit("mu_sweep.sh"))
    assert first["JobState"] == "COMPLETED" and rows_of_table(printed(first)) == ["0.2"]  # from anywhere, --export=NONE
    submit = functools.partial(submit, OMPI_MCA_odls_base_sigkill_timeout=1)  # mpirun need not wait for ranks that are gone
    jobs = {
        "no scene": submit("mu_sweep.sh", SCENE="no.toml", MU="0.3"),  # beside the results of the first job
        "wrong key": submit("mu_sweep.sh", WRONG_KEY, MU="0.31"),
        "killed": submit("mu_sweep.sh", MU="0.32", SQUEAL=killed),
        "too many ranks": submit("mu_sweep.sh", options=["--ntasks=1"], MU="0.33", RANKS=2),
        "heard": submit("heard_sweep.sh", SCENE="no.toml", OUTPUT=tmp_path / "heard"),
        "chart": submit("chart.sh", WRONG_KEY, OUTPUT=tmp_path / "chart", GROUPS_OF_RUNS="auto"),
        "long": submit("long_run.sh", SCENE="no.toml", OUTPUT=tmp_path / "long"),
    }
    for name, number in jobs.items():
        job = slurm.ended(number)
        assert (job["JobState"], job["ExitCode"]) == ("FAILED", "1:0"), name
        assert "exit code" in printed(job) and not rows_of_table(printed(job)), name


def test_one_task_takes_one_value_and_a_dependent_job_makes_the_table(slurm, submit, tmp_path):
    """By srun as well, whose tasks find each other by PMIx."""
    array = submit("mu_sweep.sh", options=["--array=1-2", "--ntasks=1"], MU="0.2 0.3")
    launched = submit("mu_sweep.sh", MU="0.25", LAUNCH="srun --mpi=pmix", OUTPUT=tmp_path / "srun")
    table = submit("mu_sweep.sh", options=["--ntasks=1", f"--dependency=afterok:{array}"], MU="0.2 0.3")
    job = slurm.ended(table)
    assert job["JobState"] == "COMPLETED" and rows_of_table(printed(job)) == ["0.2", "0.3"]
    assert "equilibrium …" not in printed(job)  # nothing is computed again
    assert [rows_of_table(printed(slurm.job(f"{array}_{task}"))) for task in (1, 2)] == [["0.2"], ["0.3"]]
    job = slurm.ended(launched)
    assert job["JobState"] == "COMPLETED" and ", 2 ranks" in printed(job)
    assert report_of(tmp_path / "srun" / "mu_0.25")["exit_code"] == 0


def test_a_run_that_does_not_converge_is_no_failure(slurm, submit, tmp_path):
    """The second start is computed, too."""
    job = slurm.ended(submit("long_run.sh", ["--set", "transient.theta=1"], options=["--ntasks=1"], PERIODS=2,
                             OMPI_MCA_odls_base_sigkill_timeout=1))
    assert job["JobState"] == "COMPLETED", printed(job)[-2000:]
    assert [report_of(tmp_path / start)["exit_code"] for start in ("estimate", "mode")] == [2, 2]


def test_the_time_limit_queues_a_job_again_which_goes_on(slurm, limited):
    """Slurm's signal comes up to a minute early. A cancelled job ends in order as well, and is not queued again."""
    folder, number = limited
    one_node.wait_for(lambda: slurm.job(number)["Restarts"] == "1", 300, lambda: str(slurm.job(number)))
    assert not processes_of(folder)
    report = report_of(folder / "estimate")
    assert report["exit_code"] == 3 and report["transient"]["outcome"] == "interrupted"
    steps = report["transient"]["steps"]
    time.sleep(5)  # the credential of the ended start is revoked meanwhile
    slurm.command("scontrol", "update", f"jobid={number}", "starttime=now", "timelimit=60")
    job = slurm.wait_for_state(number, ("RUNNING",))
    one_node.wait_for(lambda: printed(job).count("goes on from the checkpoint") == 1, 300, lambda: printed(job)[-2000:])
    assert printed(job).count("ended by SIGUSR1: results so far") == 1  # the log goes on
    slurm.command("scancel", number)
    assert slurm.ended(number)["JobState"] == "CANCELLED"
    one_node.wait_for(lambda: not processes_of(folder), 300, lambda: str(processes_of(folder)))
    report = report_of(folder / "estimate")
    assert report["exit_code"] == 3 and report["transient"]["steps"] > steps
    assert (folder / "estimate" / "checkpoint" / "transient").exists() and not (folder / "mode").exists()
    assert slurm.job(number)["JobState"] == "CANCELLED"
