"""Pictures of a sweep: frequency and growth of the followed modes against the number, with the motions where they were
sought, and a map of stability for two numbers."""

import numpy as np
from plot_basis import frequency_unit, heading, plt, those_with
from squeal import Missing

COLOURS = ["#c0272d", "#1b6ca8", "#d95f02", "#2e8b57", "#7b3fa0", "#b5893a", "#008b8b", "#d6409f"]
MARKS = "os^Dvp*X"


def tables_of(results):
    """What history.h5 holds of the sweep; frequencies and growth rates have one column for each followed mode."""
    names = ("value", "direction", "unstable_modes", "frequency", "growth_rate")
    return {name: results.series("sweep", name) for name in names}


def motions_of(sweep, direction):
    """Values and motions of one direction of rotation, by rising first number."""
    points = [p for p in sweep["points"] if "motion" in p and p["direction"] == direction]
    return sorted(((p["values"][0], p["motion"]) for p in points), key=lambda pair: pair[0])


def look_of(motion):
    """Mark, filling and label of a motion by what is known of it."""
    if motion["outcome"] == "settled":
        return "D", "none", "settled motion, no cycle attracts"
    if motion["stability"] == "stable":
        return "o", "black", "cycle, attracts"
    if motion["stability"] == "unstable":
        return "o", "none", "cycle, repels"
    return "s", "0.6", "motion, undecided"


def draw_motions(above, energy, motions, size):
    """Frequencies among the modes' and mean energies, with the error of settled motions."""
    for value, motion in motions:
        if motion["frequency_hz"] is None:
            continue
        mark, filling, label = look_of(motion)
        style = {"marker": mark, "mfc": filling, "mec": "black", "color": "black", "ls": "", "ms": 6, "zorder": 5}
        above.plot([value], [motion["frequency_hz"] / size], label=label, **style)
        energy.errorbar([value], [motion["mean_fluctuating_energy"]], yerr=motion["energy_error"] or 0, capsize=2, lw=0.8,
                        **style)


def sweep_of(results):
    """Of two numbers, what a map shows stands at the points; of one, modes must be followed."""
    sweep = results.stage("sweep")
    if not any("growth_rate" in point for point in sweep["points"]):
        raise Missing("the sweep has no modes")
    if len(sweep["keys"]) == 1 and sweep["followed_modes"] == 0:
        raise Missing("modes are not followed through random points of one number")
    return sweep


def labels_of(sweep):
    """The swept numbers with their units."""
    return [key if unit == "-" else f"{key} [{unit}]" for key, unit in zip(sweep["keys"], sweep["units"])]


def strongest_tracks(sweep):
    """Modes that are unstable somewhere, each with the entry of the direction of rotation in which it grows most."""
    strongest = {}
    for entry in sweep["unstable_tracks"]:
        known = strongest.setdefault(entry["track"], entry)
        if entry["greatest_growth_rate"] > known["greatest_growth_rate"]:
            strongest[entry["track"]] = entry
    return strongest


def ordered_rows(table, choice):
    """Rows of a choice of points, by rising first number."""
    rows = np.flatnonzero(choice)
    return rows[np.argsort(table["value"][rows, 0], kind="stable")]


def draw_column(axes, table, rows, sweep, size):
    """One direction of rotation: frequencies above, growth rates below; modes that are unstable somewhere in colour."""
    above, below = axes
    number = table["value"][rows, 0]
    coloured = strongest_tracks(sweep)
    for track in range(table["frequency"].shape[1]):
        frequency, growth = table["frequency"][rows, track], table["growth_rate"][rows, track]
        if track not in coloured:
            above.plot(number, frequency / size, "-", color="0.75", lw=0.8)
            below.plot(number, growth, "-", color="0.8", lw=0.8)
    for place, (track, strongest) in enumerate(coloured.items()):
        frequency, growth = table["frequency"][rows, track], table["growth_rate"][rows, track]
        if np.isnan(frequency).all():
            continue
        colour, mark = COLOURS[place % len(COLOURS)], MARKS[place // len(COLOURS) % len(MARKS)]
        hertz = f"{strongest['frequency_hz']:.0f}" if size == 1000 else f"{strongest['frequency_hz']:.3g}"
        label = f"mode {track}, {hertz} Hz where it grows most"
        above.plot(number, frequency / size, "-", color=colour, marker=mark, ms=3.5, lw=1.4, label=label)
        below.plot(number, growth, "-", color=colour, marker=mark, ms=3.5, lw=1.4)
    below.axhline(0, color="0.3", lw=0.8)


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
    motions = {direction: motions_of(sweep, direction) for direction in directions}
    rows_of_axes = 3 if any(motion["frequency_hz"] for pairs in motions.values() for _, motion in pairs) else 2
    figure, axes = plt.subplots(rows_of_axes, len(directions), figsize=(4.2 + 3.6 * len(directions), 3.5 * rows_of_axes),
                                sharex=True, sharey="row", squeeze=False)
    for column, direction in enumerate(directions):
        rows = ordered_rows(table, table["direction"] == direction)
        draw_column(axes[:2, column], table, rows, sweep, size)
        if rows_of_axes == 3:
            draw_motions(axes[0, column], axes[2, column], motions[direction], size)
        for threshold in sweep["thresholds"]:
            if threshold["direction"] == direction:
                for ax in axes[:, column]:
                    ax.axvline(threshold["values"][0], color="0.4", lw=0.8, ls=":")
        axes[-1, column].set_xlabel(labels_of(sweep)[0])
        if len(directions) > 1:
            axes[0, column].set_title("as in the scene" if direction == 1 else "rotation reversed", fontsize=10)
    axes[0, 0].set_ylabel(f"frequency [{unit}]")
    axes[1, 0].set_ylabel("growth rate [1/s]")
    if rows_of_axes == 3:
        axes[2, 0].set_ylabel("mean energy of the motion [J]")
        energies = [m["mean_fluctuating_energy"] for pairs in motions.values() for _, m in pairs if m["frequency_hz"]]
        if max(energies) > 10 * min(energies) > 0:
            axes[2, 0].set_yscale("log")
    coloured = list(strongest_tracks(sweep))
    limit_growth(axes[1, 0], table["growth_rate"][:, coloured] if coloured else table["growth_rate"])
    legend = {}
    for ax in axes[0]:  # a mode keeps its colour: one label each
        for handle, label in zip(*ax.get_legend_handles_labels()):
            legend.setdefault(label, handle)
    if legend:
        labels, handles = list(legend), list(legend.values())
        figure.get_layout_engine().set(rect=(0, 0.06, 1, 0.94))  # the legend is below
        figure.legend(handles, labels, loc="lower center", ncols=min(4, len(labels)), fontsize=8)
    figure.suptitle(heading([results], "modes against " + sweep["keys"][0]))
    return figure


def draw_map(results, sweep):
    """Largest growth rate over the plane of two numbers; points as dots, the thresholds of each mode as its colour."""
    found = [p for p in sweep["points"] if "growth_rate" in p]
    directions = [d for d in (1, -1) if any(p["direction"] == d for p in found)]
    figure, axes = plt.subplots(1, len(directions), figsize=(3.4 + 3.6 * len(directions), 4.6), sharey=True, squeeze=False)
    limit = max(max(p["growth_rate"] for p in found), 1e-12)
    for ax, direction in zip(axes[0], directions):
        points = [p for p in found if p["direction"] == direction]
        values = np.array([p["values"] for p in points])
        level = np.clip([p["growth_rate"] for p in points], 0, limit)
        if np.linalg.matrix_rank(values - values[0]) == 2:  # else no triangle joins them
            ax.tripcolor(*values.T, level, cmap="YlOrRd", vmin=0, vmax=limit, shading="gouraud")
        stable = np.array([p["unstable_modes"] == 0 for p in points])
        ax.plot(*values[stable].T, "o", ms=3, mfc="white", mec="0.5", label="stable")
        ax.plot(*values[~stable].T, "o", ms=3, color="0.2", label="unstable")
        for place, track in enumerate(strongest_tracks(sweep)):
            for change in (1, -1):  # the ends of an unstable range are two lines
                crossings = sorted((t["values"][1], t["values"][0]) for t in sweep["thresholds"]
                                   if t["track"] == track and t["direction"] == direction and t["change"] == change)
                if crossings:
                    y, x = zip(*crossings)
                    ax.plot(x, y, "-", marker=MARKS[place % len(MARKS)], ms=4, lw=1.2,
                            color=COLOURS[place % len(COLOURS)], label=f"threshold of mode {track}")
        ax.set_xlabel(labels_of(sweep)[0])
        if len(directions) > 1:
            ax.set_title("as in the scene" if direction == 1 else "rotation reversed", fontsize=10)
    axes[0, 0].set_ylabel(labels_of(sweep)[1])
    legend = {label: handle for ax in axes[0] for handle, label in zip(*ax.get_legend_handles_labels())}
    figure.get_layout_engine().set(rect=(0, 0.06, 1, 0.94))  # the legend is below
    figure.legend(legend.values(), legend, loc="lower center", ncols=min(4, len(legend)), fontsize=8)
    shades = plt.cm.ScalarMappable(plt.Normalize(0, limit), "YlOrRd")
    figure.colorbar(shades, ax=axes, label="largest growth rate [1/s]")
    figure.suptitle(heading([results], "stability"))
    return figure


def draw_sweep(runs):
    (results, sweep), *_ = those_with(runs, sweep_of)
    if len(sweep["keys"]) == 2:
        return draw_map(results, sweep)
    return draw_chart(results, sweep, tables_of(results))
