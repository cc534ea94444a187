"""Results converge at the order of the method, as tools/convergence tells it: the short version of its tables."""

import os
import re
import subprocess
import sys

import pytest
from conftest import INPUTS, ROOT


def printed(folder, scene, key, values, *arguments):
    """What the tool prints."""
    command = [sys.executable, ROOT / "tools" / "convergence", INPUTS / scene / "scene.toml", key, *map(str, values),
               "--output", folder, "--", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, env=os.environ)
    assert done.returncode == 0, done.stderr
    assert (folder / "convergence.png").stat().st_size > 10000
    return done.stdout


def orders(folder, scene, key, values, *arguments):
    """Order and limit of each result."""
    text = printed(folder, scene, key, values, *arguments)
    rows = re.findall(r"^\| ([^|]+?) \|.*\| (\S+) \| (\S+) \| [^|]+ \| \S+ \+- \S+ \|$", text, re.M)
    return {name: (float(order), float(limit)) for name, order, limit in rows if order not in ("order", "none", "---")}


def test_the_period_converges_with_the_square_of_the_step(tmp_path):
    """Second order through impact and stick: 2 within .1 (measured 2.01 at 1600 steps); the limit is the exact period to
    1e-5, a twentieth of what 100 steps a period are off by."""
    found = orders(tmp_path, "oscillator", "cycle.steps_per_period", [100, 200, 400], "--set", "transient.enabled=false",
                   "--set", "cycle.tolerance=1e-9")
    order, limit = found["cycle period [s]"]
    assert order == pytest.approx(2, abs=0.1)
    assert limit == pytest.approx(5.954461004653, rel=1e-5)


def test_two_values_have_a_bar(tmp_path):
    """It holds the exact period, between the orders 1 and infinity, and is no wider than the change."""
    text = printed(tmp_path, "oscillator", "cycle.steps_per_period", [100, 200], "--set", "transient.enabled=false", "--set",
                   "cycle.tolerance=1e-9")
    first, second, limit, bar = map(float, re.search(r"^\| cycle period \[s\] \| (\S+) \| (\S+) \|.*\| (\S+) \+- (\S+) \|$", text, re.M).groups())
    assert abs(limit - 5.954461004653) <= bar <= abs(second - first)


def test_the_frequencies_of_a_clamped_disc_converge_with_its_mesh(tmp_path):
    """About 2, the order of the bricks: 1.4 (the clamped corner of the bore) to 2.6 (two layers in the coarsest mesh)."""
    found = orders(tmp_path, "pin_on_disc", "mesh.parameters.divisions", [4, 6, 8], "--set", "cycle.enabled=false", "--set",
                   "modes.band=3500", "--set", "modes.method=full", "--set", "estimate.enabled=false")
    for i in range(1, 9):
        assert 1.4 < found[f"frequency {i} [Hz]"][0] < 2.6


def test_the_stages_of_the_brake_are_benched():
    """A row a stage, by the clock and by the processor; what they take is no test."""
    done = subprocess.run([sys.executable, ROOT / "tools" / "bench", "brake", "4000", "--ranks", "1"], capture_output=True,
                          text=True, timeout=300, env=os.environ)
    assert done.returncode == 0, done.stderr
    rows = dict(re.findall(r"^\| ([^|]+?) \| ([0-9.e-]+) \|", done.stdout, re.M))
    stages = {"model", "equilibrium", "modes", "estimate", "factor and W", "a step"}
    assert set(rows) == stages | {f"{stage}, processor" for stage in stages} | {"memory [GB]"}
