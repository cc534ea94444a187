"""Pictures of a sweep: frequency and growth of the followed modes against the number, and a map of stability for two."""

import numpy as np
from plot_basis import frequency_unit, heading, plt, those_with
from squeal import Missing

COLOURS = ["#c0272d", "#1b6ca8", "#d95f02", "#2e8b57", "#7b3fa0", "#b5893a", "#008b8b", "#d6409f"]
MARKS = "os^Dvp*X"


def tables_of(results):
    """What history.h5 holds of the sweep; frequencies and growth rates have one column for each followed mode."""
    names = ("value", "direction", "unstable_modes", "frequency", "growth_rate")
    return {name: results.series("sweep", name) for name in names}


def sweep_of(results):
    sweep = results.stage("sweep")
    if sweep["stages"] != "modes":
        raise Missing("the sweep has no modes")
    if sweep["followed_modes"] == 0:
        raise Missing("no mode of the sweep was followed")
    return sweep


def ordered_rows(table, choice):
    """Rows of a choice of points, by rising first number."""
    rows = np.flatnonzero(choice)
    return rows[np.argsort(table["value"][rows, 0], kind="stable")]


def draw_column(axes, table, rows, sweep, size):
    """One direction of rotation: frequencies above, growth rates below; modes that are unstable somewhere in colour."""
    above, below = axes
    number = table["value"][rows, 0]
    coloured = [entry["track"] for entry in sweep["unstable_tracks"]]
    for track in range(table["frequency"].shape[1]):
        frequency, growth = table["frequency"][rows, track], table["growth_rate"][rows, track]
        if track not in coloured:
            above.plot(number, frequency / size, "-", color="0.75", lw=0.8)
            below.plot(number, growth, "-", color="0.8", lw=0.8)
    for place, track in enumerate(coloured):
        frequency, growth = table["frequency"][rows, track], table["growth_rate"][rows, track]
        if np.isnan(frequency).all():
            continue
        colour, mark = COLOURS[place % len(COLOURS)], MARKS[place // len(COLOURS) % len(MARKS)]
        label = f"mode {track}, {np.nanmean(frequency):.0f} Hz" if size == 1000 else f"mode {track}, {np.nanmean(frequency):.3g} Hz"
        above.plot(number, frequency / size, "-", color=colour, marker=mark, ms=3.5, lw=1.4, label=label)
        below.plot(number, growth, "-", color=colour, marker=mark, ms=3.5, lw=1.4)
    below.axhline(0, color="0.3", lw=0.8)
    limit_growth(below, table["growth_rate"][np.ix_(rows, coloured)] if coloured else table["growth_rate"][rows])


def limit_growth(axes, growth):
    """The range of the modes that matter: strongly damped ones would flatten them."""
    if np.isnan(growth).all():
        return
    low, high = np.nanmin(growth), np.nanmax(growth)
    margin = 0.1 * max(high - low, 1e-12)
    axes.set_ylim(low - margin, max(high, 0) + margin)


def draw_chart(results, sweep, table):
    """The lock-in chart. Of two numbers, the first value of the second one."""
    directions = [d for d in (1, -1) if (table["direction"] == d).any()]
    size, unit = frequency_unit(np.nanmax(table["frequency"]))
    figure, axes = plt.subplots(2, len(directions), figsize=(4.2 + 3.6 * len(directions), 7), sharex=True, sharey="row",
                                squeeze=False)
    for column, direction in enumerate(directions):
        rows = ordered_rows(table, table["direction"] == direction)
        draw_column(axes[:, column], table, rows, sweep, size)
        for threshold in sweep["thresholds"]:
            if threshold["direction"] == direction:
                for ax in axes[:, column]:
                    ax.axvline(threshold["values"][0], color="0.4", lw=0.8, ls=":")
        axes[1, column].set_xlabel(sweep["keys"][0])
        if len(directions) > 1:
            axes[0, column].set_title("as in the scene" if direction == 1 else "rotation reversed", fontsize=10)
    axes[0, 0].set_ylabel(f"frequency [{unit}]")
    axes[1, 0].set_ylabel("growth rate [1/s]")
    if any(axes[0, 0].get_legend_handles_labels()[1]):
        handles, labels = axes[0, 0].get_legend_handles_labels()
        figure.get_layout_engine().set(rect=(0, 0.06, 1, 0.94))  # the legend is below
        figure.legend(handles, labels, loc="lower center", ncols=min(4, len(labels)), fontsize=8)
    figure.suptitle(heading([results], "modes against " + sweep["keys"][0]))
    return figure


def draw_map(results, sweep, table):
    """Largest growth rate over the plane of two numbers; points as dots, the thresholds of each mode as its colour."""
    directions = [d for d in (1, -1) if (table["direction"] == d).any()]
    figure, axes = plt.subplots(1, len(directions), figsize=(3.4 + 3.6 * len(directions), 4.6), sharey=True, squeeze=False)
    growth = np.nanmax(table["growth_rate"], axis=1)
    limit = max(np.nanmax(growth), 1e-12)
    tracks = [entry["track"] for entry in sweep["unstable_tracks"]]
    for ax, direction in zip(axes[0], directions):
        rows = np.flatnonzero(table["direction"] == direction)
        first, second, level = table["value"][rows, 0], table["value"][rows, 1], np.clip(growth[rows], 0, limit)
        shade = ax.tripcolor(first, second, level, cmap="YlOrRd", vmin=0, vmax=limit, shading="gouraud")
        stable = table["unstable_modes"][rows] == 0
        ax.plot(first[stable], second[stable], "o", ms=3, mfc="white", mec="0.5", label="stable")
        ax.plot(first[~stable], second[~stable], "o", ms=3, color="0.2", label="unstable")
        for place, track in enumerate(tracks):
            crossings = sorted((t["values"][1], t["values"][0]) for t in sweep["thresholds"]
                               if t["track"] == track and t["direction"] == direction)
            if crossings:
                y, x = zip(*crossings)
                ax.plot(x, y, "-", marker=MARKS[place % len(MARKS)], ms=4, lw=1.2, color=COLOURS[place % len(COLOURS)],
                        label=f"threshold of mode {track}")
        ax.set_xlabel(sweep["keys"][0])
        if len(directions) > 1:
            ax.set_title("as in the scene" if direction == 1 else "rotation reversed", fontsize=10)
    axes[0, 0].set_ylabel(sweep["keys"][1])
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.get_layout_engine().set(rect=(0, 0.06, 1, 0.94))  # the legend is below
    figure.legend(handles, labels, loc="lower center", ncols=min(4, len(labels)), fontsize=8)
    figure.colorbar(shade, ax=axes, label="largest growth rate [1/s]")
    figure.suptitle(heading([results], "stability"))
    return figure


def draw_sweep(runs):
    (results, sweep), *_ = those_with(runs, sweep_of)
    table = tables_of(results)
    if len(sweep["keys"]) == 2:
        return draw_map(results, sweep, table)
    return draw_chart(results, sweep, table)
