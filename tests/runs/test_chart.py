"""tools/chart tells the truth: its measures on motions known in closed form, its errors and its choices on the oscillator."""

import importlib.machinery
import importlib.util
import os
import re
import subprocess
import sys

import h5py
import numpy as np
import pytest
from conftest import INPUTS, ROOT

sys.path.insert(0, str(ROOT / "tools"))  # where chart finds its own
loader = importlib.machinery.SourceFileLoader("chart", str(ROOT / "tools" / "chart"))
chart = importlib.util.module_from_spec(importlib.util.spec_from_loader("chart", loader))
loader.exec_module(chart)
import chart_points  # noqa: E402


def point(seconds, error):
    return chart_points.Point(seconds, {chart_points.PERIOD: 1 + error})


def test_period_and_energy_of_a_sampled_motion(tmp_path):
    """Two harmonics at 61.7 samples a period, no whole number: cubic splines know the period to 1e-6 and the mean to 1e-5;
    the guess of 1 % off is of no consequence."""
    period, h = 0.617, 0.01
    time = h * np.arange(4000)
    (tmp_path / "direct_1").mkdir()
    with h5py.File(tmp_path / "direct_1" / "history.h5", "w") as file:
        file["transient/time"] = time
        file["transient/fluctuating_energy"] = (
            3 + np.cos(2 * np.pi * time / period) + 0.3 * np.sin(4 * np.pi * time / period) + 5 * np.exp(-time))

    class Runs:
        folder = tmp_path

        @staticmethod
        def report(_):
            return {"processor_seconds": {"transient": 8.0}}

    points = chart_points.direct_points(Runs, "direct_1", 1.01 * period)
    assert points[-1].seconds == 8 and points[0].seconds < 2.1
    assert points[-1].value[chart_points.PERIOD] == pytest.approx(period, rel=1e-6)
    assert points[-1].value[chart_points.ENERGY] == pytest.approx(3, rel=1e-5)
    assert points[0].value[chart_points.ENERGY] > 3.01  # the start still rings


def test_front_takes_the_cheapest_and_no_lucky_crossing():
    judge = point(0, 0)
    lucky = chart_points.Line("lucky", [point(1, 1e-6), point(2, 1e-2), point(4, 1e-3)], "b", "o")
    dear = chart_points.Line("dear", [point(3, 5e-3), point(8, 1e-4)], "r", "o")
    corners = chart_points.front([lucky, dear], judge, chart_points.PERIOD, "seconds")
    assert [(corner[0], corner[2].label) for corner in corners] == [(1, "lucky"), (3, "dear"), (4, "lucky"), (8, "dear")]
    assert [corner[1] for corner in corners] == pytest.approx([1e-2, 5e-3, 1e-3, 1e-4])
    assert chart.choice(corners, 2e-3, 1e-5).startswith("lucky: 4 s")
    assert "reference itself" in chart.choice(corners, 1e-6, 1e-5) and "none" in chart.choice(corners, 2e-5, 1e-5)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("chart")


def draw(folder, *more, steps=(50, 100), options=()):
    """Exit code, and all that was printed."""
    command = [sys.executable, ROOT / "tools" / "chart", INPUTS / "oscillator" / "scene.toml", "--runs", folder / "runs",
               "--picture", folder / "chart.png", "--at", 50, "--reference", 400, "--steps", *steps, "--direct", 50,
               "--periods", 40, "--only", "step", "full", "direct", *more, "--", *options]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=300, env=os.environ)
    return done.returncode, done.stdout + done.stderr


@pytest.fixture(scope="module")
def drawn(folder):
    return draw(folder)


def test_the_oscillator(drawn, folder):
    """Errors against 400 steps are those against the exact period, the step's second order, to what the reference itself is
    off by (a sixteenth of that of 100 steps); and two pictures."""
    code, printed = drawn
    assert code == 0, printed
    errors = dict(re.findall(r"from the estimate, (\d+) steps .* period ([+-][\d.e+-]+)$", printed, re.M))
    # 50 steps a period: 1.33e-3, 100: 3.4e-4 (inputs/oscillator, 5.954461004653 s)
    assert float(errors["50"]) == pytest.approx(1.33e-3, rel=0.1)
    assert float(errors["100"]) == pytest.approx(0.25 * float(errors["50"]), rel=0.15)
    assert re.search(r"^  1e-2 +\S.* steps: [\d.]+ s +\S.* steps: [\d.]+ s", printed, re.M)  # whoever was quickest
    for name in ("chart.png", "chart_parts.png"):
        assert 10000 < (folder / name).stat().st_size < 120000


def test_runs_of_another_command_are_refused(drawn, folder):
    code, printed = draw(folder, options=["--set", "friction.coefficient=0.25"])
    assert code != 0 and "another command" in printed


def test_what_is_there_is_kept_and_what_did_not_finish_is_said(drawn, folder):
    code, printed = draw(folder, "--limit", 0.001, steps=(50, 100, 200))
    assert code == 0 and "remark: full_200, stopped after 0.001 s" in printed
    code, printed = draw(folder, steps=(50, 100, 200))
    assert code == 0 and "stopped after" not in printed
    assert set(re.findall(r"^chart: (\w+_\d+)", printed, re.M)) == {"full_200"}  # 200 is half the reference: there
