"""The house rules that a machine can check: include order, no PETSc below the solids, formatting."""

import re
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FLOORS = ["base", "mesh", "solid", "contact", "analysis", "report"]  # each stands on those before it


def sources(*folders):
    return [f for folder in folders for f in sorted((ROOT / folder).rglob("*.[ch]pp"))]


def allowed_in(folder):
    if folder == "scene":
        return {"scene", "base"}
    floors = FLOORS[: FLOORS.index(folder) + 1] if folder in FLOORS else FLOORS  # src/*.cpp stand above all floors
    return {*floors, "scene"}


def test_includes_run_one_way():
    wrong = [
        f"{file.relative_to(ROOT)} includes {target}"
        for file in sources("src", "include")
        for target in re.findall(r'#include "squeal/(\w+)/', file.read_text())
        if target not in allowed_in(file.parent.name)
    ]
    assert not wrong, "\n".join(wrong)


def test_scene_and_mesh_know_nothing_of_petsc():
    petsc = re.compile(r'#include [<"](petsc|slepc|squeal/base/petsc)')
    assert not [f for f in sources("src", "include") if f.parent.name in ("scene", "mesh") and petsc.search(f.read_text())]


def test_sources_are_formatted():
    files = [str(f) for f in sources("src", "include", "tests")]
    done = subprocess.run(["clang-format", "--dry-run", "--Werror", *files], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[:2000]
