"""Pictures of motions in time: energy, the cycle's phase portraits, powers round it, and where contact is lost."""

import matplotlib
import numpy as np
from squeal.plot_basis import (RED, SLIP, STICK, colour, cycle_words, heading, is_closed, label_of, length_unit, plt, portrait,
                        start_of, state_colours, state_legend, those_with, unit_of)
from squeal import Missing


def running_mean(values, window):
    total = np.concatenate([[0], np.cumsum(values)])
    return (total[window:] - total[:-window]) / window


def energy_of(run):
    """Time [s], mean energies over a period of the followed mode [J]."""
    transient = run.stage("transient")
    time = run.series("transient", "time")
    window = max(1, round(run.followed_period() / transient["step_size"]))
    if len(time) <= window:
        raise Missing("the transient is shorter than a period")
    middle = time[:-window + 1 or None] + (time[window - 1] - time[0]) / 2
    return middle, *(running_mean(run.series("transient", name), window) for name in ("energy", "fluctuating_energy"))


def draw_energy(runs):
    figure, (above, below) = plt.subplots(2, 1, figsize=(8, 6.5), sharex=True)
    cycle_labelled = False
    for run, (time, energy, fluctuating) in those_with(runs, energy_of):
        line, = above.plot(time, energy, lw=1.6, label=label_of(run, runs) or "transient")
        below.semilogy(time, np.maximum(fluctuating, 1e-300), lw=1.6, color=line.get_color())
    for run in runs:
        cycle = run.converged_cycle()
        if cycle:
            name = None if cycle_labelled else "limit cycle by shooting"
            above.axhline(cycle["mean_energy"], color="0.3", ls="--", lw=1, label=name)
            below.axhline(cycle["mean_fluctuating_energy"], color="0.3", ls="--", lw=1)
            cycle_labelled = True
    above.set(ylabel="mechanical energy [J]", title=heading(runs, "mean over a period of the followed mode"))
    below.set(xlabel="time [s]", ylabel="fluctuating energy [J]")
    above.legend(fontsize=8)
    return figure


def cycle_of(run):
    """The cycle's report and its probes."""
    cycle, probes = run.stage("cycle"), run.probes("cycle")
    if not probes and not run.report["model"]["pairs"]:
        raise Missing("the cycle has neither probes nor contact pairs")
    run.series("cycle", "time")
    return cycle, probes


def draw_status(axes, run):
    """The state of each pair against time over the period."""
    status = run.series("cycle", "status")
    axes.imshow(status.T, aspect="auto", interpolation="nearest", origin="lower", vmin=0, vmax=2, cmap=state_colours(),
                extent=(0, 1, -0.5, status.shape[1] - 0.5))
    axes.yaxis.set_major_locator(matplotlib.ticker.MaxNLocator(integer=True, min_n_ticks=1))
    axes.grid(False)
    axes.set(xlabel="time over period [-]", ylabel="contact pair")
    state_legend(axes, loc="lower center", bbox_to_anchor=(0.5, 1))


def draw_cycle(runs):
    found = those_with(runs, cycle_of)
    shown = list(dict.fromkeys(name for _, (_, probes) in found for name in probes))[:5]
    with_status = len(found) == 1 and bool(found[0][0].report["model"]["pairs"])
    panels = len(shown) + with_status
    if panels == 0:
        raise Missing("the runs have no probes")
    columns = min(panels, 3)
    rows = -(-panels // columns)
    figure, grid = plt.subplots(rows, columns, figsize=(4.6 * columns + 0.8, 4.2 * rows), squeeze=False)
    flat = list(grid.flat)
    for axes, name in zip(flat, shown):
        with_name = [(run, probes[name]) for run, (_, probes) in found if name in probes]
        size, unit = length_unit(np.concatenate([values for _, values in with_name]))
        for k, (run, values) in enumerate(with_name):
            time = run.series("cycle", "time")
            closed = is_closed(run)
            place, speed = portrait(values, time[1] - time[0], closed)
            shade = SLIP if len(found) == 1 else colour(k)
            axes.plot(place / size, speed, lw=1.4, color=shade, label=label_of(run, runs))
            if not closed:
                axes.plot(place[0] / size, speed[0], "o", ms=6, color=shade, label=label_of(run, runs, "start"))
                axes.plot(place[-1] / size, speed[-1], "s", ms=6, mfc="none", color=shade, label=label_of(run, runs, "end"))
        axes.set(xlabel=f"displacement {name} [{unit}]", ylabel="velocity [m/s]")
    if with_status:
        draw_status(flat[len(shown)], found[0][0])
    if shown and flat[0].get_legend_handles_labels()[1]:
        flat[0].legend(fontsize=8)
    for axes in flat[panels:]:
        axes.remove()
    frequency = f", {found[0][1][0]['frequency_hz']:.7g} Hz" if len(found) == 1 else ""
    figure.suptitle(heading(runs, cycle_words(*(run for run, _ in found)) + frequency))
    return figure


POWERS = {"contact_power": ("contact forces", SLIP), "damping_power": ("damping", RED), "load_power": ("load", "0.55")}


ENERGIES = {"energy": ("mechanical energy, whose slope is the sum of powers", "-"),
            "fluctuating_energy": ("energy of the motion about equilibrium", ":")}


def powers_of(run):
    run.stage("cycle")
    return {name: run.series("cycle", name) for name in (*POWERS, "time", *ENERGIES)}


def draw_powers(runs):
    """Powers on the structure round the cycle, and the energies less their means. Damping's power stands with the sign with which
    it takes energy away. The mechanical energy has the work against the preload, which the energy of the motion has not."""
    found = those_with(runs, powers_of)
    figure, (above, below) = plt.subplots(2, 1, figsize=(8, 6.2), sharex=True)
    size, unit = unit_of(np.concatenate([powers[name] for _, powers in found for name in POWERS]), "W")
    e_size, e_unit = unit_of(np.concatenate([powers[name] - powers[name].mean() for _, powers in found for name in ENERGIES]), "J")
    for k, (run, powers) in enumerate(found):
        phase = powers["time"] / run.report["cycle"]["period"]
        powers = {name: np.roll(values, -start_of(run, runs)) for name, values in powers.items()}
        total = np.zeros(len(phase))
        for name, (words, shade) in POWERS.items():
            value = -np.abs(powers[name]) if name == "damping_power" else powers[name]
            total += value
            if len(found) == 1 and np.abs(value).max() > 1e-9 * size:
                above.plot(phase, value / size, color=shade, lw=1.6, label=f"{words}, mean {value.mean() / size:+.3g} {unit}")
        shade = "black" if len(found) == 1 else colour(k)
        above.plot(phase, total / size, color=shade, lw=1.2, ls="--" if len(found) == 1 else "-",
                   label=label_of(run, runs, f"sum, mean {total.mean() / size:+.1g} {unit}"))
        for name, (words, style) in ENERGIES.items():
            mean = powers[name].mean()
            below.plot(phase, (powers[name] - mean) / e_size, color=shade, lw=1.6, ls=style,
                       label=label_of(run, runs, f"{words.replace(', ', chr(10))}\nabout {mean / e_size:.4g} {e_unit}"))
    above.axhline(0, color="0.5", lw=0.8)
    words = cycle_words(*(run for run, _ in found)).replace(" (", "\n(")
    above.set(ylabel=f"power on the structure [{unit}]", title=heading(runs, f"powers round the {words}"))
    above.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False)
    below.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False)
    below.set(xlabel="time over period [-]", ylabel=f"energy less its mean [{e_unit}]", xlim=(0, 1))
    return figure


def areas_of(run):
    """Areas of the pairs [m2]; those of points, which have none, count as 1."""
    try:
        area = run.field("pairs/area")
    except Missing:
        area = np.zeros(1)
    return area if area.sum() > 0 else np.ones(run.report["model"]["pairs"])


def lift_off_of(run):
    """Phase, and the parts of the contact's area that are open and that stick, of a cycle."""
    run.stage("cycle")
    status, area = run.series("cycle", "status"), areas_of(run)
    parts = [(status == state) @ area / area.sum() for state in (0, 1)]
    return run.series("cycle", "time") / run.report["cycle"]["period"], *parts, area.sum()


def measure_of(run, area):
    """The measure that parts of a contact are counted by; area: the sum of areas_of."""
    return "number of pairs" if area == run.report["model"]["pairs"] else f"area of {1e4 * area:.4g} cm²"


def open_in_time(run):
    """Middle of each period [s], least and largest number of open pairs in it over that of all pairs."""
    transient = run.stage("transient")
    opened, time = run.series("transient", "open"), run.series("transient", "time")
    window = max(1, round(run.followed_period() / transient["step_size"]))
    count = len(opened) // window
    if count < 2:
        raise Missing("the transient is shorter than two periods")
    blocks = opened[: count * window].reshape(count, window) / run.report["model"]["pairs"]
    return time[: count * window].reshape(count, window).mean(axis=1), blocks.min(axis=1), blocks.max(axis=1)


def draw_lift_off(runs):
    cycles, transients = [], []
    for take, found in ((lift_off_of, cycles), (open_in_time, transients)):
        try:
            found += those_with(runs, take)
        except Missing as reason:
            last = reason
    if not cycles and not transients:
        raise last
    figure, panels = plt.subplots(1, bool(cycles) + bool(transients), figsize=(5.2 * (bool(cycles) + bool(transients)) + 1, 4),
                                  squeeze=False)
    for k, (run, (phase, opened, stuck, area)) in enumerate(cycles):
        axes = panels[0, 0]
        alone = len(cycles) == 1
        opened, stuck = (np.roll(part, -start_of(run, runs)) for part in (opened, stuck))
        axes.step(phase, 100 * opened, where="mid", color=RED if alone else colour(k), lw=1.6, label=label_of(run, runs, "open"))
        if stuck.any() or alone:
            axes.step(phase, 100 * stuck, where="mid", color=STICK if alone else colour(k), ls="-" if alone else ":", lw=1.6,
                      label=label_of(run, runs, "sticking"))
        axes.set(xlabel="time over period [-]", ylabel=f"part of the contact's {measure_of(run, area)} [%]", xlim=(0, 1),
                 title=cycle_words(*(run for run, _ in cycles)).replace(" (", "\n("))
        axes.legend(fontsize=8)
    for k, (run, (time, least, most)) in enumerate(transients):
        axes = panels[0, -1]
        axes.fill_between(time, 100 * least, 100 * most, step="mid", color=colour(k), alpha=0.45, lw=0,
                          label=label_of(run, runs, "open: least and most in each period"))
        axes.step(time, 100 * most, where="mid", color=colour(k), lw=1)
        axes.set(xlabel="time [s]", ylabel="open pairs [% of all]", title="transient")
        axes.legend(fontsize=8)
    for axes in panels.flat:
        axes.set_ylim(bottom=0)
    figure.suptitle(heading(runs, "where contact is lost"))
    return figure
