#!/usr/bin/env python3
"""What modes.mesh_error = "refinement" says of cases whose eigenvalues are known, at three meshes of each element type.

    tests/evidence/mesh_error.py [CASE ...]

Prints the effectivity, the error that is expected of the growth rate over its true one, and in brackets the bar over the error of the
corrected value: above 1 it holds the exact one. Frequencies have the same ones up to a part in a hundred.
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "runs"))
from mesh_cases import CASES, ELEMENTS, write_case  # noqa: E402

MESHES = {"thick ring": (1, 2, 3)}


def main():
    program = os.environ.get("SQUEAL", str(ROOT / "build" / "squeal"))
    print("| case | element | effectivity at three meshes (bar over error of the corrected value) |\n|---|---|---|")
    good = bars = total = 0
    for case in sys.argv[1:] or CASES:
        for element in ELEMENTS:
            cells = []
            for n in MESHES.get(case, (1, 2, 4)):
                with tempfile.TemporaryDirectory() as place:
                    exact = write_case(Path(place), case, element, n).real
                    subprocess.run([program, f"{place}/scene.toml", "--output", f"{place}/out", "--set", "modes.mesh_error=refinement"],
                                   check=True, stdout=subprocess.DEVNULL)
                    mode = json.loads(Path(place, "out", "report.json").read_text())["modes"]["mesh_error"]["modes"][0]
                value, corrected = mode["growth_rate"], mode["corrected_growth_rate"]
                effectivity, ratio = abs((corrected - value) / (exact - value)), mode["growth_error"] / abs(corrected - exact)
                cells.append(f"{effectivity:.2f} ({ratio:.2g})")
                total, good, bars = total + 1, good + (0.5 < effectivity < 2), bars + (ratio >= 1)
            print(f"| {case} | {element} | {', '.join(cells)} |", flush=True)
    print(f"\nEffectivity between 0.5 and 2 in {good} of {total}; the bar holds the exact value in {bars} of {total}.")


main()
