"""The brake corner on its coarse mesh: degrees of freedom, pairs, forces and the unstable mode are those of inputs/corner/README.md."""

import re

import pytest
from conftest import INPUTS

SCENE = INPUTS / "corner" / "scene.toml"
PAGE = (INPUTS / "corner" / "README.md").read_text()
COARSE = ["--set", "mesh.parameters.size=9000"]


def test_the_coarse_mesh_is_the_pages(squeal):
    run = squeal(SCENE, *COARSE, "--dry-run", ranks=1)
    assert run.code == 0, run.errors
    (size, pairs), = re.findall(r"^\| 9000 \| ([\d ]+) \| (\d+) \|$", PAGE, re.M)
    assert f"{size.replace(' ', '')} degrees of freedom, {pairs} contact pairs" in run.printed + run.errors


def test_the_coarse_corner_squeals_as_the_page_says_and_its_joints_take_energy(converged):
    """Energy closes through micro-slip from the first step on: pairs that slipped on the path are at their limit."""
    report = converged(SCENE, *COARSE, "--set", "modes.band=7000", "--set", "transient.start=mode", "--set", "transient.amplitude=4e-6",
                       "--set", "transient.periods=1", "--set", "transient.steps_per_period=64", ranks=1).report
    (frequency, growth), = re.findall(r"^\| unstable modes \| ([\d ]+) Hz, ([\d ]+) 1/s \|", PAGE, re.M)
    (mode,) = [mode for mode in report["modes"]["modes"] if mode["unstable"]]
    assert mode["frequency_hz"] == pytest.approx(float(frequency.replace(" ", "")), rel=1e-3)
    assert mode["growth_rate"] == pytest.approx(float(growth.replace(" ", "")), rel=1e-3)
    transient = report["transient"]
    assert transient["energy_defect_max"] < 1e-9
    work = transient["joint_work"]
    assert work[0] == work[1] == 0 and max(work) <= 0 and min(work) < 0
    assert [work[leading] for leading in (3, 5)] == [0, 0]  # they stand 0.1 mm away
