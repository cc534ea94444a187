#!/usr/bin/env python3
"""A study from Python, cell by cell as in a notebook: how friction makes the pin on the disc squeal.

    jobs/study.py          # five runs of two seconds each; tables, and results/study/study.png
"""

# %% squeal's own module, and what it needs
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tools"))
import squeal

from squeal import common
import numpy as np

plt = common.pyplot()
folder = Path("results/study")
coarse = {"mesh.parameters.divisions": 2, "damping.beta": 6e-7, "cycle.steps_per_period": 40}

# %% one run a friction coefficient; shapes of all modes are kept, and where no cycle attracts few periods are enough
friction = [0.2, 0.25, 0.3, 0.35, 0.4]
options = ["-modes_shapes", "all", "-cycle_multipliers", "0", "-settled_periods", "16"]
runs = [squeal.run(ROOT / "inputs" / "pin_on_disc", coarse | {"friction.coefficient": mu}, options=options,
                   output=folder / f"mu_{mu}") for mu in friction]

# %% tables: of the study, and of the modes and the contact pairs of one run
print(squeal.table({
    "friction": friction,
    "unstable modes": [run.report["modes"]["unstable_count"] for run in runs],
    "growth rate [1/s]": [max(run.modes()["growth_rate"]) for run in runs],
    "cycle": [run.report["cycle"]["outcome"] for run in runs],
    "frequency [Hz]": [run.report["cycle"].get("frequency_hz", np.nan) for run in runs],
}))
print(squeal.table_of(runs[2].report["modes"]["modes"][:8]))
pairs = runs[2].pairs()
print(f"largest pressure at rest {max(pairs['pressure']) / 1e3:.0f} kPa on {len(pairs)} pairs")

# %% how like the squealing mode of one friction coefficient is to all modes of another, by the cosine of their shapes
squealing = runs[2].shape(1).ravel()
for run, mu in zip(runs, friction):
    likeness = [abs(np.vdot(shape, squealing)) / np.linalg.norm(shape) / np.linalg.norm(squealing)
                for shape in (run.shape(k).ravel() for k in run.mode_numbers())]
    best = int(np.argmax(likeness))
    print(f"friction {mu}: mode {best + 1} at {run.modes()['frequency_hz'][best]:.0f} Hz is {likeness[best]:.3f} alike")

# %% a picture
figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4))
left.plot(friction, [max(run.modes()["growth_rate"]) for run in runs], "o-", color=common.RED)
left.axhline(0, color="0.4", lw=0.8)
left.set(xlabel="friction coefficient", ylabel="largest growth rate [1/s]")
for run, mu in zip(runs, friction):
    if run.converged_cycle():
        right.plot(run.series("cycle", "time") / run.report["cycle"]["period"], 1e6 * run.probes("cycle")["pin"], label=f"{mu}")
right.set(xlabel="time over period [-]", ylabel="pin [µm]")
right.legend(title="friction")
figure.savefig(folder / "study.png")
print(folder / "study.png")
