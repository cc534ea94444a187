#!/usr/bin/env python3
"""The four figures of the paper that squeal implements, made again on inputs/tgv: inputs/tgv/paper.png.

Eigenvalues are of the brake of 33 224 degrees of freedom, motions of the small brake of 5 048. Runs lie in results/paper,
and one that is there is not made again. From nothing they take a quarter of an hour of one processor.
"""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tools"))
from squeal import common
import squeal

common.needs("h5py", "matplotlib", "numpy")
import numpy as np
from squeal.common import BLUE, GREEN, ORANGE, RED
from squeal.plot_motion import energy_of
from squeal.plot_spectra import FLOOR, spectrogram_of

plt = common.pyplot(dpi=120, font_size=9)
SMALL = {"mesh.parameters.size": 4000, "mesh.parameters.pin_radius": 0.0175, "mesh.parameters.pin_height": 0.04,
         "damping.alpha": 0, "damping.beta": 1.1e-6, "modes.band": 5000, "modes.method": "full"}
STILL = {"transient.enabled": False, "cycle.enabled": False}
MARCH = STILL | {"transient.enabled": True, "transient.steps_per_period": 64}
SHOOT = {"transient.enabled": False, "cycle.tolerance": 1e-8}
# The paper's algorithm: the subspace of the mode's shapes alone, and no finish in the full space.
SEVEN = ["-cycle_finish", "none", "-cycle_subspace_newtons", 12, "-cycle_free_periods", 1, "-settled_periods", 64, "-settled_exponents", 1]
TOLERANCE = ["-transient_contact_tolerance", 1e-8]
RUNS = {
    "modes": ({"modes.method": "full", "damping.alpha": 0, "damping.beta": 1.58e-6, **STILL}, []),
    "mode": (SMALL | MARCH | {"transient.start": "mode", "transient.amplitude": 2e-7, "transient.periods": 1500}, TOLERANCE),
    "estimate": (SMALL | MARCH | {"transient.start": "estimate", "transient.periods": 700}, TOLERANCE),
    "auto": (SMALL | SHOOT | {"fidelity": "auto"}, []),
    "full": (SMALL | SHOOT | {"fidelity": "full"}, ["-cycle_multipliers", 0]),
    "seven": (SMALL | SHOOT | {"fidelity": "full"}, SEVEN),
}


def runs():
    found = {}
    for name, (values, words) in RUNS.items():
        folder = Path("results/paper") / name
        done = (folder / "report.json").exists()
        print(f"paper_figures: {name}{', which is there' if done else ''}", flush=True)
        found[name] = squeal.Results(folder) if done else squeal.run(ROOT / "inputs" / "tgv", values, options=words, output=folder)
    return found


def draw_plane(axes, run):
    frequency, growth, unstable = (np.array(run.modes()[name]) for name in ("frequency_hz", "growth_rate", "unstable"))
    axes.plot(frequency[~unstable] / 1000, growth[~unstable], "o", ms=3.5, color=BLUE, label="stable")
    axes.plot(frequency[unstable] / 1000, growth[unstable], "^", ms=8, color=RED, label="unstable")
    for f, g in zip(frequency[unstable], growth[unstable]):
        axes.annotate(f"{f:.1f} Hz, {g:+.1f} 1/s", (f / 1000, g), xytext=(9, 3), textcoords="offset points")
    axes.axhline(0, color="0.3", lw=0.8)
    axes.set_yscale("symlog", linthresh=20)
    axes.set(xlabel="imaginary part, frequency [kHz]", ylabel="real part, growth rate [1/s], log beyond 20", ylim=(-5000, 60),
             title=f"a) eigenvalues at mu = 0.2, {run.report['model']['dofs']} degrees of freedom")
    axes.legend(loc="lower left")


def draw_energy_spectrogram(axes, run):
    time, frequency, power, _, _ = spectrogram_of(run, "energy")
    shown = frequency < 30000
    axes.grid(False)
    level = 10 * np.log10(np.maximum(power[:, shown] / power[:, shown].max(), 1e-30))
    image = axes.pcolormesh(time, frequency[shown] / 1000, level.T, vmin=-FLOOR, vmax=0, shading="auto", cmap="magma",
                            rasterized=True)
    axes.figure.colorbar(image, ax=axes, label="dB of the largest")
    opened = run.series("transient", "time")[np.flatnonzero(run.series("transient", "open"))[0]]
    axes.axvline(opened, color="white", lw=1, ls="--")
    axes.text(opened + 0.005, 28.4, "first lift-off", color="white", va="top")
    axes.set(xlabel="time [s]", ylabel="frequency [kHz]",
             title="b) spectrum of the energy, from a small start on the unstable mode;\nthe energy is quadratic: a tone of f shows at 2 f")


def draw_energies(axes, small, estimate, cycle):
    for run, name, shade in ((small, "from a small motion of the mode", BLUE), (estimate, "from the estimated amplitude", ORANGE)):
        time, energy, _ = energy_of(run)
        axes.plot(time, 1e3 * energy, color=shade, lw=1.6, label=name)
    axes.axhline(1e3 * cycle.report["cycle"]["mean_energy"], color="black", ls="--", lw=1, label="limit cycle by shooting")
    axes.set(xlabel="time [s]", ylabel="mean mechanical energy over a period [mJ]", title="c) two starts, and the cycle where both end",
             xlim=(0, None))
    axes.legend()


def draw_residuals(axes, seven, full, auto):
    table = seven.iterations()
    x, projected, whole = (np.array(table[name], float) for name in ("periods", "residual_projected", "residual_full"))
    on = np.isfinite(projected)
    axes.semilogy(x[on], projected[on], "o-", mfc="none", color=RED, label="seven unknowns: on the subspace")
    axes.semilogy(x[on], whole[on], "o-", color=RED, label="seven unknowns: in the full space")
    for run, name, shade, mark in ((full, "all unknowns, from the estimate", BLUE, "s"),
                                   (auto, "all unknowns, from the reduced model's cycle", GREEN, "D")):
        table = run.iterations()
        axes.semilogy(table["periods"], table["residual_full"], mark + "-", ms=4, color=shade, label=name)
    axes.axhline(1e-8, color="0.4", ls="--", lw=1, label="tolerance")
    axes.set(xlabel="periods of the full model integrated", ylabel="residual [-]", title="d) shooting: the paper's seven unknowns, and all",
             ylim=(1e-15, 1))
    axes.legend(loc="lower left")


def main():
    found = runs()
    figure, panels = plt.subplots(2, 2, figsize=(13, 9.5))
    draw_plane(panels[0, 0], found["modes"])
    draw_energy_spectrogram(panels[0, 1], found["mode"])
    draw_energies(panels[1, 0], found["mode"], found["estimate"], found["auto"])
    draw_residuals(panels[1, 1], found["seven"], found["full"], found["auto"])
    file = ROOT / "inputs" / "tgv" / "paper.png"
    common.save_small(figure, file)
    for name in ("seven", "full", "auto"):
        cycle = found[name].report["cycle"]
        print(f"{name:6} {cycle['frequency_hz']:.3f} Hz, fluctuating energy {cycle['mean_fluctuating_energy']:.5g} J, "
              f"full residual {cycle['residual_full']:.2g} after {cycle['periods_integrated']} periods")
    print(file)


if __name__ == "__main__":
    common.tool(main)
