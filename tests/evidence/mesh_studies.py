#!/usr/bin/env python3
"""Bars of the mesh on a threshold of friction and on a cycle, by tools/convergence on two meshes, beside what is exact or finer.

    tests/evidence/mesh_studies.py

The flutter pair of tests/runs/mesh_cases.py, of 8-node bricks. Its threshold follows from its characteristic equation; its cycle comes
to a limit on 16 divisions. Prints the values on two meshes, the limit with its bar, and what is exact, or finer.
"""

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "runs"))
import mesh_cases  # noqa: E402

STUDIES = """
[sweep]
key = "friction.coefficient"
from = 0.05
to = 0.6

[cycle]
steps_per_period = 100
tolerance = 1e-8
"""


def exact_threshold():
    """The friction from which the pair grows, by bisection."""
    low, high = 0.05, 0.5
    for _ in range(40):
        mesh_cases.FRICTION = (low + high) / 2
        low, high = (low, mesh_cases.FRICTION) if mesh_cases.exact_pair().real > 1e-4 else (mesh_cases.FRICTION, high)
    mesh_cases.FRICTION = 0.5
    return high


def table_of(n, divisions):
    """Values of each result on two meshes or one, and the limit with the bar."""
    with tempfile.TemporaryDirectory() as place:
        mesh_cases.write_case(Path(place), "flutter pair", "hex8", n)
        scene = Path(place, "scene.toml")
        scene.write_text(scene.read_text() + STUDIES)
        done = subprocess.run([sys.executable, ROOT / "tools" / "convergence", scene, "mesh.refine", *map(str, divisions),
                               "--output", Path(place, "out")], capture_output=True, text=True)
        if done.returncode:
            raise SystemExit(done.stdout + done.stderr)
    found = re.findall(r"^\| ([^|]+) \|(.*)\| ([-\d.e+]+) \+- ([-\d.e+]+) \|$", done.stdout, re.M)
    return {name: ([float(v) for v in cells.split("|")[: len(divisions)]], float(limit), float(bar)) for name, cells, limit, bar in found}


def main():
    finest = {name: limit for name, (_, limit, _) in table_of(4, (0, 1, 2)).items()}
    finest["threshold 1"] = exact_threshold()
    print("| divisions | result | on both meshes | limit and bar | exact, or of 4, 8, 16 divisions | error over bar |\n|---|---|---|---|---|---|")
    for n in (1, 2):
        for name, (values, limit, bar) in table_of(n, (0, 1)).items():
            if name.startswith("frequency") or name not in finest:
                continue
            print(f"| {n}, {2 * n} | {name} | {values[0]:.7g}, {values[1]:.7g} | {limit:.7g} +- {bar:.2g} | {finest[name]:.7g} | "
                  f"{abs(limit - finest[name]) / bar:.2f} |", flush=True)


main()
