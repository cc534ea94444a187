"""tools/uff: what a Universal File holds, read here by its fixed columns, and its modes compared with the run's own."""

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import INPUTS, ROOT

sys.path.insert(0, str(ROOT / "tools"))
import squeal  # noqa: E402

PYTHON = Path(os.environ.get("SQUEAL_PYTHON", ROOT / "build" / "python")) / "bin" / "python"


def has_pyuff():
    return PYTHON.exists() and subprocess.run([PYTHON, "-c", "import pyuff"], capture_output=True).returncode == 0


pytestmark = pytest.mark.skipif(not has_pyuff(), reason="pyuff is optional: tools/setup installs it into build/python")


def data_sets(file):
    """Number and lines of each data set."""
    blocks = re.split(r"^    -1 *$", file.read_text(), flags=re.M)
    return [(int(lines[0]), lines[1:]) for block in blocks if (lines := block.strip("\n").splitlines()) and lines[0].strip()]


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return squeal.run(INPUTS / "pin_on_disc", {"mesh.parameters.divisions": 2, "cycle.enabled": False, "transient.periods": 2},
                      options=["-modes_shapes", "all"], output=tmp_path_factory.mktemp("uff") / "run")


def uff(*words):
    return subprocess.run([sys.executable, ROOT / "tools" / "uff", *map(str, words)], capture_output=True, text=True)


def test_the_file_holds_nodes_modes_and_motions(run):
    done = uff(run.folder)
    assert done.returncode == 0, done.stderr
    sets = data_sets(run.folder / "squeal.uff")
    (nodes,) = [lines for number, lines in sets if number == 15]
    positions = np.array([[float(line[40 + 13 * k:53 + 13 * k]) for k in range(3)] for line in nodes])
    # six digits
    assert np.allclose(positions, run.nodes, atol=1e-5 * np.ptp(run.nodes, axis=0).max())
    assert sum(number == 55 for number, _ in sets) == len(run.mode_numbers()) > 10
    assert sum(number == 58 for number, _ in sets) == len(run.probes("transient")) > 0


def test_modes_read_back_are_the_same(run):
    assert uff(run.folder).returncode == 0
    done = uff(run.folder, "--measured", run.folder / "squeal.uff")
    assert done.returncode == 0, done.stderr
    rows = [line.split() for line in done.stdout.splitlines()[1:]]
    assert [int(row[-1]) for row in rows] == run.mode_numbers()
    for row, mode in zip(rows, run.report["modes"]["modes"]):
        assert float(row[3]) > 0.999 and float(row[0]) == pytest.approx(mode["frequency_hz"], rel=1e-5)


def test_a_file_without_modes_is_refused(run, tmp_path):
    empty = tmp_path / "empty.uff"
    empty.write_text("    -1\n   164\n         1                  SI         1\n" + "  1.0000000000000000D+00" * 3 +
                     "\n  0.0000000000000000D+00\n    -1\n")
    done = uff(run.folder, "--measured", empty)
    assert done.returncode == 1 and "dataset 55" in done.stderr and "Traceback" not in done.stderr
