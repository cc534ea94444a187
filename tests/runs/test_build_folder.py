"""tools/build in a tree that was moved: CMake refuses the build folder of another place, so it is made anew."""

import shutil
import subprocess

from conftest import ROOT

PROJECT = """cmake_minimum_required(VERSION 3.20)
project(small NONE)
option(SQUEAL_WERROR "" OFF)
file(WRITE ${CMAKE_BINARY_DIR}/place.txt "${CMAKE_SOURCE_DIR} ${SQUEAL_WERROR}")
add_custom_target(squeal COMMAND ${CMAKE_COMMAND} -E touch ${CMAKE_BINARY_DIR}/squeal)
"""


def build(tree, **environment):
    return subprocess.run([tree / "tools" / "build"], capture_output=True, text=True, env=environment | {"PATH": "/usr/bin:/bin"})


def test_a_moved_tree_builds(tmp_path):
    tree, moved = tmp_path / "tree", tmp_path / "else where"
    (tree / "tools").mkdir(parents=True)
    shutil.copy(ROOT / "tools" / "build", tree / "tools")
    (tree / "CMakeLists.txt").write_text(PROJECT)
    assert build(tree).returncode == 0 and (tree / "build" / "place.txt").read_text() == f"{tree} OFF"
    again = build(tree, SQUEAL_WERROR="ON")
    assert "anew" not in again.stdout and (tree / "build" / "place.txt").read_text() == f"{tree} ON"
    assert build(tree).returncode == 0 and (tree / "build" / "place.txt").read_text() == f"{tree} ON"  # it stays on

    (tree / "build" / "python").mkdir()
    tree.rename(moved)
    refused = subprocess.run(["cmake", "-S", moved, "-B", moved / "build"], capture_output=True, text=True)
    assert refused.returncode != 0  # why the rule is there
    done = build(moved)
    assert done.returncode == 0 and f"is of a tree in {tree}: it is made anew" in done.stdout, done.stderr
    assert (moved / "build" / "place.txt").read_text() == f"{moved} OFF"
    assert (moved / "build" / "python").is_dir() and (moved / "build" / "squeal").exists()
