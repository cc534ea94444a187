"""Pictures of a sweep: frequency and growth of the followed modes against the number, and a map of stability for design
points of two numbers."""

import re

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.tri import LinearTriInterpolator, Triangulation
from squeal.plot_basis import frequency_unit, heading, label_row, legend_below, plt, scene_of, those_with
from squeal.plot_numbers import axis_label, value_of, words_of
from squeal.common import counted
from squeal import Missing

COLOURS = ["#c0272d", "#1b6ca8", "#d95f02", "#2e8b57", "#7b3fa0", "#b5893a", "#008b8b", "#d6409f"]
MARKS = "os^Dvp*X"
DRIVES = re.compile(r"\b(rate|velocity)\b")  # keys that move a rotor
NAMED = 3  # points that a caption names
SAME = 0.01  # of its frequency, within which a followed mode is one of the run's own


def tables_of(results, sweep):
    """Points in rows; frequencies and growth rates have one column for each followed mode, NaN where it was not found."""
    points, keys = sweep["points"], (*sweep["keys"], "direction")
    frequency, growth = np.full((2, len(points), sweep["followed_modes"]), np.nan)
    rows = {(*p["values"], p["direction"]): row for row, p in enumerate(points)}
    for line in results.lines("sweep"):
        if line["track"]:
            place = rows[tuple(float(line[key]) for key in keys)], int(line["track"])
            frequency[place], growth[place] = float(line["frequency_hz"]), float(line["growth_rate"])
    return {"value": np.array([p["values"] for p in points]), "direction": np.array([p["direction"] for p in points]),
            "frequency": frequency, "growth_rate": growth}


def sweep_of(results):
    """What was found at the points of a sweep of modes."""
    sweep = results.stage("sweep")
    if not any("growth_rate" in point for point in sweep["points"]):
        raise Missing("the sweep has no modes")
    return sweep


def labels_of(sweep):
    """The swept numbers with their names and units."""
    return [axis_label(*number) for number in zip(sweep["keys"], sweep["names"], sweep["units"])]


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


def hertz(frequency):
    return f"{frequency:.0f}" if frequency >= 1000 else f"{frequency:.3g}"


def look_of_mode(place):
    """Colour and mark, different for 64 modes."""
    return COLOURS[place % len(COLOURS)], MARKS[place // len(COLOURS) % len(MARKS)]


def with_thresholds(number, frequency, growth, thresholds):
    """A mode's values by rising number, with the points where its growth rate is zero: between the points of the sweep the
    line would cross zero elsewhere."""
    x = np.concatenate([number, [t["values"][0] for t in thresholds]])
    order = np.argsort(x, kind="stable")
    return (x[order], np.concatenate([frequency, [t["frequency_hz"] for t in thresholds]])[order],
            np.concatenate([growth, np.zeros(len(thresholds))])[order])


def thresholds_of(sweep, direction, track=None):
    return [t for t in sweep["thresholds"] if t["direction"] == direction and track in (None, t["track"])]


def own_modes(results, sweep, table):
    """By followed mode the number of the run's own mode that it passes through, where the sweep passes the scene's own value."""
    own, modes = value_of(scene_of(results), sweep["keys"][0]), results.report.get("modes", {}).get("modes", [])
    rows = ordered_rows(table, table["direction"] == 1)
    number = table["value"][rows, 0]
    if own is None or not modes or not len(rows) or not number[0] <= own <= number[-1]:
        return {}
    found, frequencies = {}, np.array([mode["frequency_hz"] for mode in modes])
    growths = np.array([mode["growth_rate"] for mode in modes])
    for track in range(table["frequency"].shape[1]):
        at, rising = (np.interp(own, number, table[name][rows, track]) for name in ("frequency", "growth_rate"))
        distance = np.hypot(frequencies - at, (growths - rising) / (2 * np.pi))  # both in Hz: partners that lock in differ in growth
        if np.isfinite(at) and distance.min() < SAME * at:
            found[track] = int(distance.argmin()) + 1
    return found


def draw_column(axes, table, rows, sweep, size, direction, own):
    """One direction of rotation: frequencies above, growth rates below; modes that are unstable somewhere in colour. own: what a
    click on a followed mode shows."""
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
        colour, mark = look_of_mode(place)
        label = f"mode {track}, {hertz(strongest['frequency_hz'])} Hz where it grows most"
        x, along, rising = with_thresholds(number, frequency, growth, thresholds_of(sweep, direction, track))
        for ax, line, points in ((above, along / size, frequency / size), (below, rising, growth)):
            ax.plot(x, line, "-", color=colour, lw=1.4)
            marks, = ax.plot(number, points, ls="", color=colour, marker=mark, ms=3.5)
            if track in own["modes"]:
                marks.of_modes = {"run": own["run"], "modes": [own["modes"][track]] * len(number)}
        above.plot([], [], "-", color=colour, marker=mark, ms=3.5, lw=1.4, label=label)
    below.axhline(0, color="0.3", lw=0.8)


def mark_thresholds(axes, sweep, direction):
    """Dotted lines, with their values in a row above the lowest axes of modes; those that look equal have one label."""
    places = {track: place for place, track in enumerate(strongest_tracks(sweep))}
    values, colours = {}, {}
    for threshold in thresholds_of(sweep, direction):
        value, text = threshold["values"][0], f"{threshold['values'][0]:.4g}"
        shade = look_of_mode(places[threshold["track"]])[0] if threshold["track"] in places else "0.4"
        for ax in axes:
            ax.axvline(value, color="0.4", lw=0.8, ls=":")
        colours[text] = "0.3" if text in values else shade  # of several modes
        values.setdefault(text, value)
    if values:
        axes[0].plot([], [], ls=":", color="0.4", lw=0.8, label="threshold, with its value")
        label_row(axes[1], list(values.values()), list(values), list(colours.values()))


def mark_failed(ax, sweep, direction):
    """Points that failed, at the lower edge."""
    failed = [p for p in sweep["points"] if p["outcome"] != "converged" and p["direction"] == direction]
    for outcome in dict.fromkeys(p["outcome"] for p in failed):
        x = [p["values"][0] for p in failed if p["outcome"] == outcome]
        ax.plot(x, [0.03] * len(x), "x", ms=7, mew=1.8, color="black", transform=ax.get_xaxis_transform(), clip_on=False)
    return {f"point that failed: {p['outcome']}": Line2D([], [], ls="", marker="x", ms=7, mew=1.8, color="black") for p in failed}


def limit_growth(axes, growth):
    """The range of the modes that matter: strongly damped ones would flatten them."""
    if np.isnan(growth).all():
        return
    low, high = np.nanmin(growth), np.nanmax(growth)
    margin = 0.1 * max(high - low, 1e-12)
    axes.set_ylim(low - margin, max(high, 0) + margin)


def by_stability(points):
    """Label, style and points of those that are stable and those that are not."""
    known = [p for p in points if "growth_rate" in p]
    return (("stable", {"mfc": "white", "mec": "0.5"}, [p for p in known if not p["unstable_modes"]]),
            ("unstable", {"color": "0.2"}, [p for p in known if p["unstable_modes"]]))


def draw_chart(results, sweep):
    """The lock-in chart."""
    directions = [d for d in (1, -1) if any(p["direction"] == d for p in sweep["points"])]
    table = tables_of(results, sweep)
    size, unit = frequency_unit(np.nanmax(table["frequency"]))
    figure, axes = plt.subplots(2, len(directions), figsize=(4.2 + 3.6 * len(directions), 7), sharex=True, sharey="row", squeeze=False)
    for column, direction in enumerate(directions):
        own = {"run": results.folder.name, "modes": own_modes(results, sweep, table) if direction == 1 else {}}
        draw_column(axes[:, column], table, ordered_rows(table, table["direction"] == direction), sweep, size, direction, own)
        axes[-1, column].set_xlabel(labels_of(sweep)[0])
        if len(directions) > 1:
            axes[0, column].set_title("as in the scene" if direction == 1 else "rotation reversed", fontsize=10)
    axes[0, 0].set_ylabel(f"frequency [{unit}]")
    axes[1, 0].set_ylabel("growth rate [1/s]")
    coloured = list(strongest_tracks(sweep))
    growth = table["growth_rate"]
    limit_growth(axes[1, 0], growth[:, coloured] if coloured else growth)
    legend = {}
    for column, direction in enumerate(directions):
        legend |= mark_failed(axes[1, column], sweep, direction)
        mark_thresholds(axes[:, column], sweep, direction)
    # A mode keeps its colour: one label each.
    legend = {label: handle for ax in axes[0] for handle, label in zip(*ax.get_legend_handles_labels())} | legend
    figure.suptitle(heading([results], "modes against " + words_of(sweep["keys"][0], sweep["names"][0])))
    legend_below(figure, legend)
    return figure


def level_within(values, growth, count=400):
    """Largest growth rate on a fine grid, in planes between the points; unknown outside of them. On a grid, since the
    shaded triangles of a picture overlap where they are thin, and show colours that stand for no value."""
    low, size = values.min(axis=0), np.ptp(values, axis=0)
    parts = np.linspace(0, 1, count)
    x, y = low[0] + parts * size[0], low[1] + parts * size[1]
    unit = (values - low) / np.where(size > 0, size, 1)  # numbers of different units make no long triangles
    if np.linalg.matrix_rank(unit - unit[0]) < 2:  # no triangle joins them
        return x, y, np.full((count, count), np.nan)
    level = LinearTriInterpolator(Triangulation(*unit.T), growth)(*np.meshgrid(parts, parts))
    return x, y, np.maximum(level.filled(np.nan), 0)


def draw_map(results, sweep):
    """Largest growth rate over the plane of two numbers; points as dots."""
    found = [p for p in sweep["points"] if "growth_rate" in p]
    directions = [d for d in (1, -1) if any(p["direction"] == d for p in found)]
    figure, axes = plt.subplots(1, len(directions), sharex=True, sharey=True, squeeze=False, figsize=(3.4 + 3.6 * len(directions), 5.2))
    limit = max(max(p["growth_rate"] for p in found), 1e-12)
    failures = {}
    for ax, direction in zip(axes[0], directions):
        points = [p for p in sweep["points"] if p["direction"] == direction]
        known = [p for p in points if "growth_rate" in p]
        ax.grid(False)
        x, y, level = level_within(np.array([p["values"] for p in known]), np.array([p["growth_rate"] for p in known]))
        if np.isfinite(level).any():
            ax.pcolormesh(x, y, level, shading="nearest", rasterized=True, cmap="YlOrRd", vmin=0, vmax=limit)
        for label, style, chosen in by_stability(points):
            ax.plot([p["values"][0] for p in chosen], [p["values"][1] for p in chosen], "o", ms=3, label=label, **style)
        failed = [p for p in points if p["outcome"] != "converged"]
        if failed:
            failures["point that failed"], = ax.plot(*zip(*(p["values"] for p in failed)), "x", ms=6, mew=1.6, color="black")
        ax.use_sticky_edges = False  # points at the edge are seen whole
        ax.margins(0.03)
        if len(directions) > 1:
            ax.set_title("as in the scene" if direction == 1 else "rotation reversed", fontsize=10)
        ax.set_xlabel(labels_of(sweep)[0])
    figure.colorbar(plt.cm.ScalarMappable(plt.Normalize(0, limit), "YlOrRd"), ax=axes[0], label="largest growth rate [1/s]")
    axes[0, 0].set_ylabel(labels_of(sweep)[1])
    figure.suptitle(heading([results], "stability"))
    legend_below(figure, {label: handle for ax in axes.flat for handle, label in zip(*ax.get_legend_handles_labels())} | failures)
    return figure


def signs_of(sweep, points):
    """Name and sign at each point of what turns or pulls the rotor, where both signs occur; nothing: it goes one way."""
    for place, (key, driven) in enumerate(zip(sweep["keys"], sweep["names"])):
        if DRIVES.search(f"{key} {driven}"):
            signs = [np.sign(p["values"][place]) * p["direction"] for p in points]
            name = words_of(key, driven)
            break
    else:
        signs, name = [p["direction"] for p in points], "rotation"
    return (name, signs) if signs and min(signs) < 0 < max(signs) else ("", [])


def not_counted(sweep):
    """Sentences about points that are neither quiet nor unstable: nothing touches there, or they failed."""
    at = lambda p: ", ".join(f"{words_of(key, name)} {value:.5g}" for key, name, value in zip(sweep["keys"], sweep["names"], p["values"]))
    listed = lambda points, tell: "; ".join(map(tell, points[:NAMED])) + (f"; and {len(points) - NAMED} others" if len(points) > NAMED else "")
    apart = [p for p in sweep["points"] if p["outcome"] == "converged" and not p.get("closed", 1)]
    failed = [p for p in sweep["points"] if p["outcome"] != "converged"]
    found = [f"Nothing touches at {counted(len(apart), 'point')}, not counted: {listed(apart, at)}."] if apart else []
    reason = lambda p: at(p) + f" ({p.get('reason') or p['outcome']})"
    return found + ([f"{counted(len(failed), 'point')} failed: {listed(failed, reason)}."] if failed else [])


def draw_occurrence(results, sweep):
    """How many of the points of any numbers squeal, by the frequency of their unstable modes. Points where nothing touches are
    not quiet ones."""
    keys = (*sweep["keys"], "direction")
    known = [p for p in sweep["points"] if p["outcome"] == "converged" and p.get("closed", 1)]
    unstable = {}
    for line in results.lines("sweep"):
        if line["growth_rate"] and float(line["growth_rate"]) > 0:
            unstable.setdefault(tuple(float(line[key]) for key in keys), []).append(float(line["frequency_hz"]))
    found = [unstable.get((*p["values"], p["direction"]), []) for p in known]
    every = [f for own in found for f in own] or [0, 1000]
    size, unit = frequency_unit(max(every))
    edges = np.linspace(0, 1.1 * max(every), 45)
    name, signs = signs_of(sweep, known)
    groups = [(f"{name} above 0", 1), (f"{name} below 0", -1)] if signs else [("", None)]
    figure, ax = plt.subplots(figsize=(8, 4), layout="constrained")
    for (label, sign), colour in zip(groups, COLOURS):
        own = [f for i, f in enumerate(found) if sign is None or signs[i] == sign]
        shares = [100 * sum(any(low <= f < high for f in one) for one in own) / max(len(own), 1) for low, high in zip(edges, edges[1:])]
        counts = f"{sum(map(bool, own))} of {counted(len(own), 'point')} unstable"
        ax.stairs(shares, edges / size, fill=True, alpha=0.6, color=colour, label=f"{label}: {counts}" if label else counts)
    ax.set(xlabel=f"frequency of unstable modes [{unit}]", ylabel="points that touch [%]", ylim=(0, 100))
    figure.suptitle(heading([results], "occurrence of unstable modes"))
    legend = {label: handle for handle, label in zip(*ax.get_legend_handles_labels())}
    legend |= {sentence.partition(":")[0]: Line2D([], [], ls="") for sentence in not_counted(sweep)}
    legend_below(figure, legend)
    figure.not_counted = not_counted(sweep)
    return figure


def draw_sweep(runs):
    (results, sweep), *_ = those_with(runs, sweep_of)
    if len(sweep["keys"]) > 2:
        return draw_occurrence(results, sweep)
    if len(sweep["keys"]) == 2:
        return draw_map(results, sweep)
    return draw_chart(results, sweep)
