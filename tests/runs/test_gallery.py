"""Each small scene of a study or law ends with exit code 0 and has its number. They are those of inputs/README.md, without
the dynamometer, of whose kind test_front_door.py has a table. And it prints the block of its README."""

import re

import pytest
from conftest import INPUTS
from test_readme import same

# Folder, key of report.json, value: thresholds are found to 1e-5 of the range, all else is closer.
NUMBERS = [
    ("branch", "cycle.period", 5.956421),
    ("sweep", "sweep.thresholds.0.values.0", 0.2585137),
    ("sensitivity", "sensitivity.modes.0.growth_rate", 940.4109),
    ("change", "sensitivity.modes.0.changes.1.computed.growth_rate", 963.1345),
    ("response", "response.peaks.0.receptance", 1.143748e-06),
    ("robustness", "modes.modes.0.growth_rate", 940.4109),
    ("tie", "modes.count_found", 8),
    ("loss_factors", "sweep.thresholds.0.values.0", 0.09971377),
    ("compliance", "sweep.thresholds.0.values.0", 1.734422e-12),
    ("orthotropic", "modes.modes.0.growth_rate", 182.1206),
    ("superelement", "sweep.thresholds.0.values.0", 0.2276006),
]


@pytest.mark.parametrize("folder, key, value", NUMBERS)
def test_scene_has_its_number(converged, folder, key, value):
    run = converged(INPUTS / folder / "scene.toml", "--verbose", ranks=1)
    left = iter(run.printed.splitlines())
    (block,) = re.findall(r"^```text\n(.*?)^```", (INPUTS / folder / "README.md").read_text(), re.M | re.S)
    for quoted in block.splitlines():
        assert any(same(quoted, line) for line in left), f"README says\n{quoted}"
    found = run.report
    for name in key.split("."):
        found = found[int(name) if name.isdigit() else name]
    assert found == pytest.approx(value, rel=1e-4)
