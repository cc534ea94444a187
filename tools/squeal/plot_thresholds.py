"""Picture of the thresholds of a sweep, each from near: the mode that becomes unstable or stable, and the partner that it meets."""

import numpy as np
from squeal.plot_basis import BLUE, RED, frequency_unit, heading, legend_below, plt, those_with
from squeal.plot_numbers import axis_label, words_of
from squeal.plot_sweep import hertz, ordered_rows, sweep_of, tables_of, thresholds_of, with_thresholds
from squeal import Missing

SHOWN = 4  # thresholds, those of the modes that grow most
BESIDE = 3  # points of the sweep on each side
NEAR = 0.1  # of its frequency, beyond which no mode is a partner


def chosen_thresholds(results):
    """The sweep with its table, and the thresholds that are drawn, by rising number."""
    sweep = sweep_of(results)
    if len(sweep["keys"]) != 1 or not sweep["followed_modes"]:
        raise Missing("the sweep follows no modes along one number")
    growth = {}
    for entry in sweep["unstable_tracks"]:
        growth[entry["track"]] = max(entry["greatest_growth_rate"], growth.get(entry["track"], 0))
    found = sorted(sweep["thresholds"], key=lambda t: -growth.get(t["track"], 0))[:SHOWN]
    if not found:
        raise Missing("the sweep has no threshold")
    return sweep, tables_of(results, sweep), sorted(found, key=lambda t: (-t["direction"], t["values"][0]))


def partner_of(table, row, track):
    """The mode nearest in frequency at a point, where one is near; else None."""
    distance = np.abs(table["frequency"][row] - table["frequency"][row, track])
    distance[track] = np.nan
    if np.isnan(distance).all():
        return None
    nearest = int(np.nanargmin(distance))
    return nearest if distance[nearest] < NEAR * table["frequency"][row, track] else None


def neighbours(table, threshold):
    """Rows of the points beside a threshold, and the one next to it where the mode is unstable."""
    rows = ordered_rows(table, table["direction"] == threshold["direction"])
    number, value = table["value"][rows, 0], threshold["values"][0]
    place = int(np.searchsorted(number, value))
    near = rows[max(0, place - BESIDE) : place + BESIDE]
    beyond = place if threshold["change"] > 0 else place - 1
    return near, rows[min(max(beyond, 0), len(rows) - 1)]


def draw_threshold(axes, sweep, table, threshold, size):
    """Frequency above, growth below."""
    track, (rows, beside) = threshold["track"], neighbours(table, threshold)
    partner = partner_of(table, beside, track)
    for of, shade, name in ((track, RED, "mode whose stability changes"), (partner, BLUE, "partner, nearest in frequency")):
        if of is None:
            continue
        own = [t for t in thresholds_of(sweep, threshold["direction"], of)
               if table["value"][rows, 0].min() < t["values"][0] < table["value"][rows, 0].max()]
        frequency, growth = table["frequency"][rows, of], table["growth_rate"][rows, of]
        x, along, rising = with_thresholds(table["value"][rows, 0], frequency, growth, own)
        for ax, line, points, label in ((axes[0], along / size, frequency / size, name), (axes[1], rising, growth, None)):
            ax.plot(x, line, "-", color=shade, lw=1.6, label=label)
            ax.plot(table["value"][rows, 0], points, "o", ms=4, color=shade)
    for ax in axes:
        ax.axvline(threshold["values"][0], color="0.4", lw=0.9, ls=":")
        ax.ticklabel_format(axis="y", useOffset=False)
    axes[1].axhline(0, color="0.3", lw=0.8)
    error = f" ± {threshold['error']:.1g}" if threshold["error"] else ""
    reversed_words = ", rotation reversed" if threshold["direction"] == -1 else ""
    words = "unstable" if threshold["change"] > 0 else "stable again"
    axes[0].set_title(f"{threshold['values'][0]:.5g}{error}{reversed_words}\n{words} at {hertz(threshold['frequency_hz'])} Hz", fontsize=9)


def draw_thresholds(runs):
    (results, (sweep, table, chosen)), *_ = those_with(runs, chosen_thresholds)
    size, unit = frequency_unit(max(threshold["frequency_hz"] for threshold in chosen))
    figure, axes = plt.subplots(2, len(chosen), figsize=(1.2 + 3.6 * len(chosen), 6.2), sharex="col", squeeze=False)
    for column, threshold in zip(axes.T, chosen):
        draw_threshold(column, sweep, table, threshold, size)
        column[1].set_xlabel(axis_label(sweep["keys"][0], sweep["names"][0], sweep["units"][0]))
    axes[0, 0].set_ylabel(f"frequency [{unit}]")
    axes[1, 0].set_ylabel("growth rate [1/s]")
    figure.suptitle(heading([results], f"thresholds of {words_of(sweep['keys'][0], sweep['names'][0])}"))
    legend_below(figure, {label: handle for ax in axes[0] for handle, label in zip(*ax.get_legend_handles_labels())})
    return figure
