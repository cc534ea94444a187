"""Runs the squeal program as a user does: by itself or by mpirun, a scene file, its output folder."""

import fcntl
import importlib.machinery
import importlib.util
import json
import os
import re
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
INPUTS = ROOT / "inputs"
sys.path.insert(0, str(ROOT / "tests" / "support"))
from cores import cores  # noqa: E402


def load_tool(name):
    """A tool of tools/ as a module, so that a test need not start a python for every call."""
    sys.path.insert(0, str(ROOT / "tools"))
    loader = importlib.machinery.SourceFileLoader(f"tool_{name}", str(ROOT / "tools" / name))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader(loader.name, loader))
    loader.exec_module(module)
    return module


# A run that is refused ends together on all ranks; mpirun would wait two seconds for those that have ended.
NO_WAIT = {"OMPI_MCA_odls_base_sigkill_timeout": "0"}


class Run:
    """One finished run: exit code, what it printed, and report.json when there is one."""

    length = ["--verbose"]  # of the table

    def __init__(self, arguments, ranks, folder):
        # one process needs no launcher, whose start takes as long as all that squeal does in a small run
        launcher = [os.environ.get("MPIEXEC", "mpirun"), "-n", str(ranks)] if ranks > 1 else []
        command = [*launcher, os.environ["SQUEAL"]]
        self.output = Path(folder)
        # The caller's arguments come last, so that its own --output wins.
        command += ["--output", str(folder), *self.length, *map(str, arguments)]
        with cores(ranks):
            done = subprocess.run(command, capture_output=True, text=True, timeout=1000, env={**os.environ, **NO_WAIT})
        self.code, self.printed, self.errors = done.returncode, done.stdout, done.stderr

    @property
    def report(self):
        return json.loads((self.output / "report.json").read_text())

    @property
    def messages(self):
        """squeal's own error messages, one line each (mpirun adds lines of its own when a rank fails)."""
        return re.findall(r"^squeal: .*$", self.errors, re.M)


class Short(Run):
    """A run with the short table, as a user prints it."""

    length = []

    @property
    def table(self):
        return self.printed[self.printed.index("\n\n") + 2:].splitlines()

    def row(self, name):
        return next(line.split(maxsplit=1)[1] for line in self.table if line.split()[:1] == [name])


def wait_for(condition, seconds=600):
    """Waits for an event; the seconds are a guard against a hang, not a limit that a slow machine meets."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it never came true"
        time.sleep(0.02)


def interrupted(sign, *arguments, ranks=1, number=signal.SIGUSR1, after=0):
    """Exit code, what was printed, and errors of a run that gets a signal when a line matches `sign`, or `after` seconds later.
    A pipe that holds one line is read line by line: one process is at most two lines ahead of the signal, however busy the
    machine is. mpirun reads ahead, so that ranks may have ended: then the exit code is not 3."""
    read, write = os.pipe2(os.O_DIRECT)
    fcntl.fcntl(write, fcntl.F_SETPIPE_SZ, 4096)
    launcher = [os.environ.get("MPIEXEC", "mpirun"), "-n", str(ranks)] if ranks > 1 else []
    command = [*launcher, os.environ["SQUEAL"], *map(str, arguments)]
    sent, printed = False, ""
    with cores(ranks), tempfile.TemporaryFile("w+") as errors:
        run = subprocess.Popen(command, stdout=write, stderr=errors, env={**os.environ, **NO_WAIT})
        os.close(write)
        while lines := os.read(read, 65536):
            printed += lines.decode(errors="replace")
            if not sent and re.search(sign, printed, re.M):
                time.sleep(after)
                run.send_signal(number)
                sent = True
        os.close(read)
        code = run.wait()
        errors.seek(0)
        assert sent, f"{sign} was not printed: {printed}{errors.read()}"
        return code, printed, errors.read()


@pytest.fixture
def squeal(tmp_path):
    count = 0

    def run(*arguments, ranks=2):
        nonlocal count
        count += 1
        return Run(arguments, ranks, tmp_path / f"results{count}")

    return run


@pytest.fixture
def converged(squeal):
    """Runs and insists on exit code 0."""

    def run(*arguments, ranks=2):
        done = squeal(*arguments, ranks=ranks)
        assert done.code == 0, done.printed[-2000:] + done.errors[-2000:]
        return done

    return run


@pytest.fixture
def oscillator_scene(tmp_path):
    """Arguments that run inputs/oscillator at a belt speed, from its points or from its matrices."""

    def arguments(form, speed):
        if form == "points":
            return [INPUTS / "oscillator" / "scene.toml", "--set", f"contact.0.velocity=[{speed},0,0]"]
        folder = tmp_path / f"matrices{speed}"
        shutil.copytree(INPUTS / "oscillator" / "matrices", folder)
        (folder / "drive.petsc").write_bytes(struct.pack(">iid", 1211214, 1, speed))  # class id of a Vec, length, entry
        return [INPUTS / "oscillator" / "matrices.toml", "--set", f"matrices.folder={folder}"]

    return arguments


@pytest.fixture(scope="module")
def module_run(tmp_path_factory):
    """Reports of runs that several tests of a file look at."""

    def run(*arguments, ranks):
        done = Run(arguments, ranks, tmp_path_factory.mktemp("results"))
        assert done.code == 0, done.printed[-2000:] + done.errors[-2000:]
        return done.report

    return run
