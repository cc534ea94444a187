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


def end_of(line, first=31):
    """Name, node and direction of a response in the sixth line of a data set 58; those of the reference begin at 56."""
    return line[first:first + 10].strip(), int(line[first + 10:first + 20]), int(line[first + 20:first + 24])


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
    ends = [end_of(lines[5]) for number, lines in sets if number == 58]
    assert [(name, direction) for name, _, direction in ends] == [("holder", 3), ("pin", 2)]
    for (name, node, direction), at in zip(ends, ([0.09, 0, 0.025], [0.09, 0, 0])):
        assert run.nodes[node - 1] == pytest.approx(at, abs=1e-9)
        moved = run.field("equilibrium/displacement")[node - 1, direction - 1]  # not that of the disc at the same place
        assert moved == pytest.approx(run.report["equilibrium"]["probes"][name], rel=1e-12)


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


@pytest.fixture(scope="module")
def responses(tmp_path_factory):
    """Responses of the oscillator, and their file. Its probes share ten letters, the point, but no direction."""
    values = {"transient.enabled": False, "cycle.enabled": False, "response.from": 0.02, "response.to": 0.6, "response.count": 59,
              "friction.coefficient": 0.1, "probe.0.name": "long_probe_x", "probe.1.name": "long_probe_y"}
    run = squeal.run(INPUTS / "oscillator", values, output=tmp_path_factory.mktemp("responses") / "run")
    assert uff(run.folder).returncode == 0
    return run


def test_responses_are_written_by_their_columns(responses):
    """Of dataset 58 line 6 says what it is, lines 7 and 8 the lines and units, and complex numbers stand two a line."""
    frequency, table = responses.responses()
    sets = [lines for number, lines in data_sets(responses.folder / "squeal.uff") if number == 58]
    assert len(sets) == len(table) == 4
    directions = {"long_probe_x": 1, "long_probe_y": 2}
    for lines, ((driven, read), h) in zip(sets, table.items()):
        assert end_of(lines[5]) == ("long_probe", 1, directions[read])
        assert end_of(lines[5], 56) == ("long_probe", 1, directions[driven])
        assert int(lines[5][:5]) == 4
        kind, count, _ = (int(lines[6][10 * k:10 * k + 10]) for k in range(3))
        assert (kind, count) == (6, len(frequency))
        numbers = np.array([float(word) for line in lines[11:] for word in line.replace("D", "E").split()])
        assert numbers[0::2] + 1j * numbers[1::2] == pytest.approx(h, rel=1e-10)


def test_a_probe_of_matrices_has_the_number_of_dofs_txt(tmp_path):
    """No file places it, so that there is no data set 15."""
    values = {"modes.enabled": False, "cycle.enabled": False, "response.from": 1000, "response.to": 2000, "response.count": 2}
    run = squeal.run(INPUTS / "strip_calculix", values, output=tmp_path / "run")
    assert uff(run.folder).returncode == 0
    ((number, lines),) = [(number, lines) for number, lines in data_sets(run.folder / "squeal.uff") if number != 164]
    assert number == 58 and end_of(lines[5]) == end_of(lines[5], 56) == ("lining", 138, 3)


def table_of(text):
    return [line.split() for line in text.splitlines()[1:]]


def test_responses_read_back_are_the_same(responses, tmp_path):
    """Twice as much is 6.02 dB, and accelerations are made displacements."""
    done = uff(responses.folder, "--measured", responses.folder / "squeal.uff")
    assert done.returncode == 0, done.stderr
    rows = table_of(done.stdout)
    assert [(float(row[3]), float(row[4])) for row in rows] == [(1, 0)] * 4
    script = ("import sys, numpy as np, pyuff\n"
              "sets = [s for s in pyuff.UFF(sys.argv[1]).read_sets() if s['type'] == 58]\n"
              "for s in sets:\n"
              "    s['data'] = 2 * s['data'] * (2j * np.pi * s['x']) ** 2\n"
              "    s['ordinate_spec_data_type'] = 12\n"
              "pyuff.UFF(sys.argv[2]).write_sets(sets[:1], 'overwrite')\n")
    done = subprocess.run([PYTHON, "-c", script, responses.folder / "squeal.uff", tmp_path / "test.uff"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    done = uff(responses.folder, "--measured", tmp_path / "test.uff")
    assert done.returncode == 0, done.stderr
    (row,) = table_of(done.stdout)
    assert float(row[3]) == 1 and float(row[4]) == pytest.approx(20 * np.log10(2), abs=1e-3)


def test_responses_of_other_or_of_several_probes_are_refused(responses, tmp_path):
    text = (responses.folder / "squeal.uff").read_text()
    (tmp_path / "other.uff").write_text(text.replace(" long_probe ", " other      "))
    (tmp_path / "alike.uff").write_text(re.sub(r"(long_probe +)1   [12]", r"\g<1>9   0", text))
    for name, message in (("other", "other (node 1, direction 1) driven at other (node 1, direction 1), fits none of"),
                          ("alike", "fits 4 of the run's responses between long_probe_x (node 1, direction 1), long_probe_y")):
        done = uff(responses.folder, "--measured", tmp_path / f"{name}.uff")
        assert done.returncode == 1 and f"{name}.uff: dataset 3" in done.stderr and message in done.stderr, done.stderr
        assert done.stderr.count("\n") == 1 and not done.stdout


@pytest.mark.parametrize("word", ["nan", "1.2x3"])
def test_numbers_that_are_none_are_refused_with_their_line(responses, tmp_path, word):
    lines = (responses.folder / "squeal.uff").read_text().splitlines()
    at = next(k for k, line in enumerate(lines) if line.strip() == "58") + 12
    lines[at] = word.rjust(20) + lines[at][20:]
    (tmp_path / "test.uff").write_text("\n".join(lines) + "\n")
    done = uff(responses.folder, "--measured", tmp_path / "test.uff")
    assert done.returncode == 1 and f"line {at + 1}, which has '{word}'" in done.stderr and done.stderr.count("\n") == 1, done.stderr


def test_what_is_no_file_of_datasets_is_refused(responses, tmp_path):
    (tmp_path / "cut.uff").write_text((responses.folder / "squeal.uff").read_text()[:40])
    for words, message in ((["--measured", tmp_path / "cut.uff"], "no whole dataset"), (["--measured", tmp_path], "no file"),
                           (["--output", responses.folder / "report.json" / "x.uff"], "report.json")):
        done = uff(responses.folder, *words)
        assert done.returncode == 1 and message in done.stderr and done.stderr.count("\n") == 1, done.stderr
    assert uff(responses.folder, "--output", tmp_path / "new" / "x.uff").returncode == 0


def test_help_needs_no_package(monkeypatch, tmp_path):
    monkeypatch.setenv("SQUEAL_PYTHON", str(tmp_path))
    assert uff("--help").returncode == 0
