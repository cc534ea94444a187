#!/usr/bin/env python3
"""How far the energy estimate lies from the limit cycle, over friction and damping: inputs/tgv/estimates.png.

The small TGV brake; a run a point, which lies in results/estimates and is not made again. Points with a cycle whose full residual
is below 1e-2 count; the others are named. A quarter of an hour of one processor from nothing.
"""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tools"))
from squeal import common
import squeal

common.needs("h5py", "matplotlib", "numpy")
import numpy as np

plt = common.pyplot(dpi=120, font_size=9)
SMALL = {"mesh.parameters.size": 4000, "mesh.parameters.pin_radius": 0.0175, "mesh.parameters.pin_height": 0.04,
         "damping.alpha": 0, "modes.band": 5000, "modes.method": "full", "transient.enabled": False, "accuracy": 0.01}
WORDS = ["-cycle_multipliers", 0, "-cycle_max_periods", 120, "-cycle_free_periods", 20, "-settled_periods", 16,
         "-settled_exponents", 1]
GRID = {1.1e-6: (0.19, 0.195, 0.2, 0.21, 0.22, 0.24, 0.25, 0.3), 9e-7: (0.165, 0.175, 0.19, 0.2),
        1.3e-6: (0.225, 0.235, 0.25)}  # friction by beta [s]
LIMIT = 900  # [s] of a run


def points(beta):
    """Friction, the estimate over first lift-off, its energy over the cycle's, and the cycle's frequency over the mode's."""
    for friction in GRID[beta]:
        folder = Path("results/estimates") / f"beta_{beta:g}_mu_{friction:g}"
        try:
            run = squeal.Results(folder) if (folder / "report.json").exists() else squeal.run(
                ROOT / "inputs" / "tgv", SMALL | {"damping.beta": beta, "friction.coefficient": friction}, options=WORDS,
                output=folder, limit=LIMIT)
        except squeal.TookTooLong as error:
            print(f"beta {beta:g}, mu {friction:g}: {str(error).rpartition(': ')[2]}", flush=True)
            continue
        mode, cycle, estimate = run.report["modes"]["modes"][0], run.report["cycle"], run.report["estimate"]
        if cycle.get("residual_full", 1) > 1e-2 or not estimate.get("mean_energy"):
            print(f"beta {beta:g}, mu {friction:g}: {cycle['outcome']}, {cycle.get('reason', '')}", flush=True)
            continue
        ratio = estimate["mean_energy"] / cycle["mean_fluctuating_energy"]
        lifted = estimate["amplitude"] / estimate["lift_off_amplitude"]
        print(f"beta {beta:g}, mu {friction:g}: growth {mode['growth_rate']:.3g} 1/s, estimate {lifted:.3g} times first lift-off, "
              f"its energy {ratio:.3g} times the cycle's, {cycle['frequency_hz']:.1f} Hz", flush=True)
        yield friction, lifted, ratio, cycle["frequency_hz"] / mode["frequency_hz"]


def main():
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.2), sharey=True)
    for (beta, mark), shade in zip(zip(GRID, "osD"), (common.BLUE, common.ORANGE, common.GREEN)):
        found = np.array(list(points(beta)))
        if not len(found):
            continue
        near = found[:, 3] > 0.95
        for axes, x in ((left, found[:, 0]), (right, found[:, 1])):
            axes.plot(x[near], found[near, 2], mark, color=shade, label=f"beta = {beta:g} s")
            axes.plot(x[~near], found[~near, 2], mark, color=shade, mfc="none")
        left.plot(found[:, 0], found[:, 2], "-", color=shade, lw=0.8)
    right.plot([1, 10], [1, 10], ":", color="0.4", label="as many times as first lift-off")
    right.set_xscale("log")
    for axes in (left, right):
        axes.set_yscale("log")
        axes.axhline(1, color="0.3", lw=0.8)
        axes.set_yticks([0.5, 1, 2, 5, 10], ["0.5", "1", "2", "5", "10"])
        axes.minorticks_off()
    left.set(xlabel="friction coefficient", ylabel="energy of the estimate over that of the cycle [-]")
    right.set(xlabel="estimated amplitude over first lift-off [-]")
    left.plot([], [], "ko", mfc="none", label="cycle far below the mode's frequency")
    left.legend()
    right.legend(handles=right.get_lines()[-2:-1], loc="lower right")
    figure.suptitle("how far the estimate lies from the cycle, small TGV brake")
    file = ROOT / "inputs" / "tgv" / "estimates.png"
    common.save_small(figure, file)
    print(file)


if __name__ == "__main__":
    common.tool(main)
