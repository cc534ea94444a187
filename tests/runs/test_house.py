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


def includes_of(room):
    files = [f for f in sources("src", "include") if f.parent.name == room]
    return files, {(f.name, target) for f in files for target in re.findall(r'#include "squeal/(\w+)/', f.read_text())}


def test_shooting_knows_no_brake():
    """The shooting solver sees a flow: states, an energy product and a period map, whatever they belong to."""
    files, includes = includes_of("shooting")
    assert files and {target for _, target in includes} <= {"base", "algebra", "shooting"}, includes
    brake = re.compile(r"\b(structure|interface|equilibrium|contact|scene|transient|modes)/\w+\.hpp|Structure&|Interface&")
    assert not [f.name for f in files if brake.search(f.read_text())]


def test_the_reduced_model_knows_no_flow():
    files, includes = includes_of("reduction")
    assert files and not {target for _, target in includes} & {"cycle", "shooting"}, includes


def test_sources_are_formatted():
    files = [str(f) for f in sources("src", "include", "tests")]
    done = subprocess.run(["clang-format", "--dry-run", "--Werror", *files], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[:2000]
