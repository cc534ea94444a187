"""An installed squeal runs and draws without the source tree."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest


def test_an_installation_runs_and_plots_from_another_folder(tmp_path):
    build = Path(os.environ["SQUEAL"]).resolve().parent
    if not (build / "cmake_install.cmake").exists():
        pytest.skip("squeal does not lie in its build folder")
    prefix, work = tmp_path / "prefix", tmp_path / "work"
    subprocess.run(["cmake", "--install", build, "--prefix", prefix], check=True, capture_output=True)
    shared = prefix / "share" / "squeal"
    shutil.copytree(shared / "inputs" / "oscillator", work / "scene")
    environment = {key: value for key, value in os.environ.items() if key != "SQUEAL"}
    done = subprocess.run([shared / "tools" / "run", "scene"], cwd=work, env=environment | {"RANKS": "1"},
                          capture_output=True, text=True, timeout=500)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    ended = subprocess.run([shared / "tools" / "run", "scene", "--output", "ended", "--set",
                            "transient.enabled=false", "--set", "cycle.free_periods=2", "-cycle_max_periods", "3", "-settled_periods",
                            "4"], cwd=work,
                           env=environment | {"RANKS": "1"}, capture_output=True, text=True, timeout=500)
    assert ended.returncode == 2 and "exit code 2: a stage did not reach its result" in ended.stderr
    assert "abort" not in ended.stdout + ended.stderr
    word = subprocess.run([prefix / "bin" / "squeal", "plot", "results/scene", "--only", "modes", "--output", "by_word"], cwd=work,
                          env=environment, capture_output=True, text=True, timeout=300)
    assert word.returncode == 0 and (work / "by_word" / "modes.png").exists(), word.stderr
    named = subprocess.run([prefix / "bin" / "squeal", "run", "oscillator", "--dry-run"], cwd=work, env=environment,
                           capture_output=True, text=True, timeout=300)
    assert named.returncode == 0 and "degrees of freedom" in named.stdout, named.stderr
    results = work / "results" / "scene"
    assert (results / "report.json").exists()
    assert {"modes.png", "cycle.png"} <= {file.name for file in results.iterdir()}
    for tool in sorted((shared / "tools").iterdir()):
        if tool.suffix or tool.is_dir() or "python" not in tool.read_text().splitlines()[0]:
            continue
        help_text = subprocess.run([tool, "--help"], cwd=work, env=environment, capture_output=True, text=True)
        assert help_text.returncode == 0, f"{tool.name}: {help_text.stderr[-2000:]}"
