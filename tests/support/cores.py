"""The machine's cores, which tests share: cores.py COUNT COMMAND… runs a command once as many are free."""

import contextlib
import fcntl
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

held = 0  # cores that this test has
PATIENCE = 3  # [s] that runs of fewer ranks may begin before one that waits for several cores


def lock_cores(folder, count):
    """The locked files of as many free cores of the machine's; none where there are fewer."""
    locked = []
    for number in range(len(os.sched_getaffinity(0))):
        core = open(folder / str(number), "w")
        try:
            fcntl.flock(core, fcntl.LOCK_EX | fcntl.LOCK_NB)
            locked.append(core)
        except BlockingIOError:
            core.close()
        if len(locked) == count:
            return locked
    for core in locked:
        core.close()
    return []


@contextlib.contextmanager
def cores(count):
    """Waits for as many cores that no other test takes, of those that the machine has. Ranks wait for each other at every
    message: beside a run that leaves one of them no core, each message takes a slice of the scheduler's, milliseconds."""
    global held
    wanted = min(count, len(os.sched_getaffinity(0)))
    if held:  # by the test whose run this is
        assert wanted <= held
        yield
        return
    folder = Path(tempfile.gettempdir()) / f"squeal_cores_{os.getuid()}"
    folder.mkdir(exist_ok=True)
    patient_until = time.monotonic() + PATIENCE
    with open(folder / "gathering", "w") as gathering:  # only who has locked it takes cores
        fcntl.flock(gathering, fcntl.LOCK_EX)
        while not (locked := lock_cores(folder, wanted)):
            if time.monotonic() < patient_until:
                fcntl.flock(gathering, fcntl.LOCK_UN)
            time.sleep(0.01)
            fcntl.flock(gathering, fcntl.LOCK_EX)
    held = wanted
    try:
        yield
    finally:
        held = 0
        for core in locked:
            core.close()


if __name__ == "__main__":
    with cores(int(sys.argv[1])):
        sys.exit(subprocess.call(sys.argv[2:]))
