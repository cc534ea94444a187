"""Pictures of tools/atlas: where shooting leads."""

import re

from squeal import common

common.needs("matplotlib", "numpy")
import numpy as np
from atlas_runs import OSCILLATOR, plt, run, runs, save
from squeal.common import BLUE, GREEN, GREY, ORANGE, RED


def basin_map(results):
    """Periods until the oscillator's one cycle is found, over start amplitude and free periods."""
    amplitudes = [0.05, 0.1, 0.2, 0.35, 0.6, 1, 1.7, 3, 5, 9, 14, 20]
    fixed = dict(transient__enabled="false", cycle__steps_per_period=100, cycle__tolerance=1e-6)
    estimate = run(results, OSCILLATOR, **dict(fixed, cycle__enabled="false"))["estimate"]["amplitude"]
    period = 5.954461004653  # exact
    figure, axes = plt.subplots(figsize=(5.4, 3.6))
    for free, colour in zip((0, 5, 10, 20), (BLUE, ORANGE, GREEN, RED)):
        done = [r["cycle"] for r in runs(results, [(OSCILLATOR, [], dict(fixed, cycle__start="mode", cycle__amplitude=a * estimate,
                                                                         cycle__free_periods=free)) for a in amplitudes])]
        found = [c["outcome"] == "converged" and abs(c["period"] / period - 1) < 3e-3 for c in done]
        axes.plot(amplitudes, [c["periods_integrated"] for c in done], color=colour, label=f"{free} free periods")
        for marker, wanted in (("o", True), ("x", False)):
            chosen = [(a, c["periods_integrated"]) for a, c, ok in zip(amplitudes, done, found) if ok == wanted]
            if chosen:
                axes.plot(*zip(*chosen), marker, color=colour)
    axes.set(xscale="log", xlabel="start amplitude over the estimate's", ylabel="periods integrated", ylim=(0, None),
             title="Oscillator: dots find its cycle, crosses do not")
    axes.legend(fontsize=8)
    save(results, "basin_map", figure)


def two_oscillators(folder, slower):
    """inputs/oscillator beside its own copy, `slower` times as slow: two unstable modes without a common period."""
    text = OSCILLATOR.read_text()
    one = text[text.index("[[point]]") : text.index("[friction]")]
    scaled = {"mass": slower**2, "damping": slower}
    two = re.sub(r"(mass|damping) = ([\d.]+)", lambda m: f"{m[1]} = {float(m[2]) * scaled[m[1]]!r}", one)
    two = two.replace('"pad"', '"slow_pad"').replace('"disc"', '"slow_disc"')
    two = two.replace("velocity = [0.6, 0, 0]", f"velocity = [{0.6 / slower!r}, 0, 0]")
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "scene.toml").write_text(text.replace(one, one + two) +
                                       '\n[[probe]]\nname = "slow"\non = "slow_pad"\ndirection = "x"\n')
    return folder / "scene.toml"


def torus_map(results):
    """Two unstable modes without a common period: the motion winds round a torus, and the cycle found repels."""
    scene = two_oscillators(results / "torus", 1.2720196495)
    saved, fixed = results / "torus" / "cycle.state", dict(cycle__steps_per_period=100)
    found = run(results, scene, transient__enabled="false", cycle__save_state=saved, **fixed)["cycle"]
    h = found["period"] / 100
    march = dict(cycle__enabled="false", transient__steps=40000, transient__step_size=h)
    free = run(results, scene, transient__start="estimate", **march)
    found_again = run(results, scene, transient__start=saved, **march)
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.4))
    x, y = (free.history(f"probes/{name}")[20000:] for name in ("pad_x", "slow"))
    left.plot(x, y, ",", color=GREY, alpha=0.5)
    up = np.nonzero((x[:-1] < x.mean()) & (x[1:] >= x.mean()))[0]
    left.plot(x[up], y[up], ".", color=RED, ms=4, label="once a turn of the fast one")
    left.set(xlabel="displacement of the fast pad", ylabel="displacement of the slow pad",
             title="from both estimates: no turn repeats")
    left.legend(loc="upper right")
    slow = found_again.history("probes/slow")
    time = found_again.history("time") / found["period"]
    moved = np.abs(slow - slow[0]).reshape(-1, 200).max(axis=1)
    right.semilogy(time[::200], moved, color=BLUE, label="slow pad, started on the cycle found")
    rate = min(mode["growth_rate"] for mode in free["modes"]["modes"][:2])
    start = np.searchsorted(moved, 1e-6 * moved[-1])
    line = moved[start] * np.exp(rate * found["period"] * (time[::200] - time[200 * start]))
    right.semilogy(time[::200], np.where(line < moved[-1], line, np.nan), "--", color=ORANGE,
                   label="growth rate of its mode")
    largest = found["multipliers"]["values"][0]
    right.set(xlabel="periods of the cycle", ylabel="displacement from rest", ylim=(moved[5] / 10, 20 * moved.max()),
              title=f"outcome: {found['outcome']}; multiplier {np.hypot(largest['real'], largest['imaginary']):.3f}")
    right.legend(loc="lower right")
    save(results, "torus_map", figure)
