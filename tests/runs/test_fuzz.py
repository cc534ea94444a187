"""A slice of tools/fuzz."""

import os
import re
import subprocess
import sys

from conftest import NO_WAIT, ROOT, cores


def test_malformed_input_ends_in_one_message(tmp_path):
    with cores(2):  # half of the cases run on 2 or 3 ranks
        done = subprocess.run([sys.executable, ROOT / "tools" / "fuzz", "--cases", "60", "--seed", "13", "--keep", tmp_path],
                              capture_output=True, text=True, timeout=550, env={**os.environ, **NO_WAIT})
    assert done.returncode == 0, done.stdout + done.stderr
    ends = dict((end, int(count)) for count, end in re.findall(r"(\d+) with (exit code \d|long)", done.stdout))
    assert ends["exit code 1"] >= 20 and ends["exit code 0"] >= 5, done.stdout  # it refuses, and not everything
