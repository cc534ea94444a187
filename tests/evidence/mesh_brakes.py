#!/usr/bin/env python3
"""What modes.mesh_error = "refinement" says of brakes, beside the finest meshes that are known.

    tests/evidence/mesh_brakes.py [CASE ...]

Prints, of each mode whose truth is known, growth rates [1/s] on the scene's mesh and the finer one, the corrected value with its bar, and
the truth; the effectivity, the error that is expected over the true one; and the bar over the error of the corrected value. Above 1 it
holds the truth. s, of the shape, is how far its parts are out of phase; |d| is how far the eigenvalue moves. Ends with counts.
The larger meshes take 7 GB and two minutes. RANKS=n: MPI ranks (1).
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))
from squeal import Results  # noqa: E402

OFF = ["cycle.enabled=false", "transient.enabled=false", "estimate.enabled=false", "modes.mesh_error=refinement"]
SMALL = ["mesh.parameters.size=4000", "mesh.parameters.pin_radius=0.0175", "mesh.parameters.pin_height=0.04", "damping.alpha=0",
         "damping.beta=1.1e-6", "modes.band=4000"]
PIN, TETRAHEDRA = ["modes.band=6000"], f"mesh.file={ROOT}/inputs/pin_on_disc/pin_tetrahedra.geo"
# scene, overrides, and of each mode its frequency [Hz] on this mesh and its growth rate on the finest mesh that is known [1/s]
CASES = {
    "small brake": ("tgv", SMALL, {3198: 80.8}),
    "small brake, pins 3:2": ("tgv", [*SMALL, "mesh.parameters.pin_refinement=1.5"], {3184: 80.8}),
    "tgv, 5 048": ("tgv", ["mesh.parameters.size=4000", "modes.band=4000"], {3523: 5.2}),
    "pin, bricks, 4": ("pin_on_disc", PIN, {5057: 150}),
    "pin, bricks, 6": ("pin_on_disc", [*PIN, "mesh.parameters.divisions=6"], {4958: 150}),
    "pin, tetrahedra, 4": ("pin_on_disc", [*PIN, TETRAHEDRA], {4952: 150}),
    "disc_brake": ("disc_brake", [], {5378: 164.7, 7044: 226.7}),
    "tgv, 33 224": ("tgv", ["modes.band=3600"], {3333: 5.2}),
}
for mu, truth in ((0.35, 325), (0.4, 430), (0.5, 317)):
    for n, hz in ((4, {0.35: 5021, 0.4: 4960, 0.5: 4700}), (6, {0.35: 4915, 0.4: 4882, 0.5: 4676})):
        keys = [*PIN, f"friction.coefficient={mu}", f"mesh.parameters.divisions={n}"]
        CASES[f"pin, bricks, {n}, mu = {mu}"] = ("pin_on_disc", keys, {hz[mu]: truth})


def run(scene, keys, folder):
    words = [os.environ.get("SQUEAL", str(ROOT / "build" / "squeal")), ROOT / "inputs" / scene, "--output", folder, "-modes_shapes", "all"]
    for key in [*keys, *OFF]:
        words += ["--set", key]
    ranks = os.environ.get("RANKS", "1")
    subprocess.run(["mpirun", "-n", ranks, *words] if ranks != "1" else words, check=True, stdout=subprocess.DEVNULL, cwd=ROOT)
    return Results(folder)


def phases(results, frequency):
    """s = sqrt(1 - |phi'phi|^2/(phi^H phi)^2) of the mode."""
    number = 1 + min(range(len(results.stage("modes")["modes"])), key=lambda k: abs(results.stage("modes")["modes"][k]["frequency_hz"] - frequency))
    shape = results.shape(number).ravel()
    return np.sqrt(max(0, 1 - abs(shape @ shape)**2 / (shape.conj() @ shape).real**2))


def main():
    print("| case | degrees of freedom, of the finer mesh | mode [Hz] | growth | finer | corrected, bar | finest | effectivity | bar over error | s | abs(d) |")
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    good = held = total = 0
    for name in sys.argv[1:] or CASES:
        scene, keys, truths = CASES[name]
        with tempfile.TemporaryDirectory() as folder:
            results = run(scene, keys, folder)
            error, dofs = results.report["modes"]["mesh_error"], results.report["model"]["dofs"]
            for frequency, truth in truths.items():
                mode = min(error["modes"], key=lambda mode: abs(mode["frequency_hz"] - frequency))
                value, corrected, bar = (mode[key] for key in ("growth_rate", "corrected_growth_rate", "growth_error"))
                effectivity, ratio = (corrected - value) / (truth - value), bar / abs(corrected - truth)
                moved = abs(complex(mode["held_growth_rate"] - value, 2 * np.pi * (mode["held_frequency_hz"] - mode["frequency_hz"])))
                print(f"| {name} | {dofs}, {error['dofs']} | {mode['frequency_hz']:.0f} | {value:.1f} | {mode['finer_growth_rate']:.1f} | {corrected:.1f} +- {bar:.1f} | "
                      f"{truth} | {effectivity:.2f} | {ratio:.2f} | {phases(results, frequency):.2f} | {moved:.0f} |", flush=True)
                total, good, held = total + 1, good + (0.5 < effectivity < 2), held + (ratio >= 1)
    print(f"\nEffectivity between 0.5 and 2 in {good} of {total}; the bar holds the finest value in {held} of {total}.")


main()
