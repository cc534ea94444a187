"""The brake corner on its coarse mesh: degrees of freedom and pairs are those of inputs/corner/README.md."""

import re

from conftest import INPUTS

PAGE = INPUTS / "corner" / "README.md"


def test_the_coarse_mesh_is_the_pages(squeal):
    run = squeal(INPUTS / "corner" / "scene.toml", "--set", "mesh.parameters.size=9000", "--dry-run", ranks=1)
    assert run.code == 0, run.errors
    (size, pairs), = re.findall(r"^\| 9000 \| ([\d ]+) \| (\d+) \|$", PAGE.read_text(), re.M)
    assert f"{size.replace(' ', '')} degrees of freedom, {pairs} contact pairs" in run.printed + run.errors
