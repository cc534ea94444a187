"""Pictures of where squeal may start: modes, estimate, and how the shooting and the branch went."""

import numpy as np
from squeal.plot_basis import (RED, SLIP, colour, frequency_unit, heading, label_column, label_of, legend_below, length_unit, mode_words, plt,
                        those_with)
from squeal.plot_numbers import axis_label, unit_of_key, words_of
from squeal import Missing

LABELS = 12  # at most so many modes have one


def found_modes(run):
    modes = run.stage("modes")
    if not modes.get("modes"):
        raise Missing("no mode was found")
    return modes


def symlog_ticks(scale, low, high):
    """Zero and decades beyond scale, at most six a side: matplotlib's own ones near zero stand on one another's labels. A side that
    reaches scale and has no decade has the number of one digit before its end."""
    ticks = [0.0]
    for end in (low, high):
        first, last = np.ceil(np.log10(2 * scale)), np.floor(np.log10(max(abs(end), 1e-300)))
        sign = np.sign(end)
        decades = [sign * 10.0**k for k in np.arange(first, last + 1, max(1, np.ceil((last - first + 1) / 6)))]
        digit = 10.0 ** np.floor(np.log10(max(abs(end), 1e-300)))
        ticks += decades or [sign * digit * np.floor(abs(end) / digit + 1e-9)] * (abs(end) >= scale)
    return sorted(set(ticks))


def draw_mesh_bars(axes, modes, size):
    """Where the mesh leads each mode that it was asked about, with the bar of its growth rate."""
    asked = [mode for mode in modes.get("mesh_error", {}).get("modes", []) if np.isfinite(mode.get("growth_error") or np.nan)]
    if asked:
        frequency, growth, bar = (np.array([mode[name] for mode in asked], float)
                                  for name in ("corrected_frequency_hz", "corrected_growth_rate", "growth_error"))
        axes.vlines(frequency / size, growth - bar, growth + bar, color="0.3", lw=1.4)
        axes.plot(frequency / size, growth, "_", ms=9, color="0.3", label="limit of the mesh, with its bar")


def draw_modes(runs):
    found = those_with(runs, found_modes)
    largest = max(mode["frequency_hz"] for _, modes in found for mode in modes["modes"])
    size, unit = frequency_unit(largest)
    figure, axes = plt.subplots(figsize=(9, 4.8))
    points, texts, growths = [], [], []
    for k, (run, modes) in enumerate(found):
        frequency = np.array([mode["frequency_hz"] for mode in modes["modes"]])
        growth = np.array([mode["growth_rate"] for mode in modes["modes"]])
        unstable = np.array([mode["unstable"] for mode in modes["modes"]], dtype=bool)
        shades = (SLIP, RED) if len(found) == 1 else (colour(k), colour(k))
        count = f"{unstable.sum()} of {len(unstable)}"
        for chosen, mark, wide, shade, words in ((~unstable, "o", 4, shades[0], "stable"), (unstable, "^", 8, shades[1], f"unstable, {count}")):
            line, = axes.plot(frequency[chosen] / size, growth[chosen], mark, ms=wide, color=shade, label=label_of(run, runs, words))
            line.of_modes = {"run": run.folder.name, "modes": [int(number) + 1 for number in np.flatnonzero(chosen)]}
        draw_mesh_bars(axes, modes, size)
        points += [(f / size, g) for f, g in zip(frequency[unstable], growth[unstable])]
        texts += [f"{label_of(run, runs)} {mode_words(f, g)}".strip() for f, g in zip(frequency[unstable], growth[unstable])]
        growths.append(growth)
    growths = np.concatenate(growths)
    axes.axhline(0, color="0.3", lw=0.8)
    axes.set_ylabel("growth rate [1/s]")
    # Damping grows with frequency squared: without this scale the unstable modes would lie on the axis.
    scale = max(min((g for _, g in points), default=np.median(np.abs(growths))), 1e-12)
    if np.abs(growths).max() > 20 * scale:
        axes.set_yscale("symlog", linthresh=scale)
        axes.set_yticks(symlog_ticks(scale, growths.min(), growths.max()))
        axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.margins(y=0.12)
    words = f", {found[0][1]['unstable_count']} unstable of {len(found[0][1]['modes'])}" if len(found) == 1 else ""
    if len(points) > LABELS:
        words += f", the {LABELS} that grow fastest labelled"
    axes.set(xlabel=f"frequency [{unit}]", xlim=(0, 1.05 * max(largest / size, 1e-9)), title=heading(runs, f"modes{words}"))
    legend_below(figure, {label: handle for handle, label in zip(*axes.get_legend_handles_labels())})  # leaders cross the axes
    order = sorted(range(len(points)), key=lambda k: -points[k][1])[:LABELS]
    if order:
        label_column(axes, [points[k] for k in order], [texts[k] for k in order])
    return figure


def estimate_curve(run):
    estimate = run.stage("estimate")
    curve = estimate.get("curve", {})
    q, rate = (np.array(curve.get(key, []), float) for key in ("amplitude", "friction_rate"))
    if len(q) < 2:
        raise Missing("the estimate has no curve")
    return estimate, q, rate


def draw_estimate(runs):
    found = those_with(runs, estimate_curve)
    alone = len(found) == 1
    figure, axes = plt.subplots(figsize=(8, 4.5))
    for k, (run, (estimate, q, rate)) in enumerate(found):
        axes.plot(q, rate, color=SLIP if alone else colour(k), lw=2, label=label_of(run, runs, "injected by friction, $P_R/E$"))
        axes.axhline(estimate["damping_rate"], color=RED if alone else colour(k), ls="-" if alone else ":",
                     label=label_of(run, runs, "dissipated by damping, $P_C/E$"))
        for key, style, name in (("lift_off_amplitude", ":", "first lift-off"),
                                 ("reversal_amplitude", "-.", "first slip reversal")):
            value = estimate.get(key)
            if alone and value is not None and q.min() <= value <= q.max():
                axes.axvline(value, color="0.35", ls=style, label=f"{name}, {value:.3g} m")
        if estimate.get("amplitude"):
            axes.plot(estimate["amplitude"], estimate["damping_rate"], "o", ms=9, color="black" if alone else colour(k),
                      zorder=5, label=label_of(run, runs, f"balance, {estimate['amplitude']:.3g} m"))
    axes.set_xscale("log")
    outcome = f", {found[0][1][0]['outcome']}" if alone else ""
    axes.set(xlabel="amplitude of the mode, its largest entry [m]", ylabel="power over mean energy [1/s]",
             title=heading(runs, f"energy estimate{outcome}"))
    axes.legend(fontsize=8)
    return figure


def newton_records(run):
    cycle = run.stage("cycle")
    if not cycle.get("newton"):
        raise Missing("the cycle kept no history of its iterations")
    return cycle


def draw_newton(runs):
    found = those_with(runs, newton_records)
    figure, axes = plt.subplots(figsize=(8, 4.5))
    value = lambda record, key: np.nan if record[key] is None or record[key] <= 0 else record[key]
    for k, (run, cycle) in enumerate(found):
        records = cycle["newton"]
        periods = [record["periods"] for record in records]
        axes.semilogy(periods, [value(record, "residual_full") for record in records], color="0.75", lw=1, zorder=1)
        for stage, marker in zip(dict.fromkeys(record["stage"] for record in records), "osD^vP*X"):
            chosen = [record for record in records if record["stage"] == stage]
            x = [record["periods"] for record in chosen]
            line, = axes.semilogy(x, [value(r, "residual_full") for r in chosen], marker, ms=6,
                                  color=colour(k) if len(found) > 1 else None, label=label_of(run, runs, f"{stage}: full space"))
            projected = [value(record, "residual_projected") for record in chosen]
            if np.isfinite(projected).any():
                axes.semilogy(x, projected, marker, ms=9, mfc="none", color=line.get_color(),
                              label=label_of(run, runs, f"{stage}: projected"))
        if cycle.get("tolerance") and k == 0:
            axes.axhline(cycle["tolerance"], color=RED, ls="--", lw=1, label="tolerance (full space)")
    outcome = f", {found[0][1]['outcome']}" if len(found) == 1 else ""
    axes.set(xlabel="periods integrated", ylabel="residual [-]", title=heading(runs, f"shooting{outcome}"))
    axes.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False)
    return figure


EVENT_MARKS = {"Hopf": "*", "first lift-off": "v", "fold": "D", "period doubling": "s", "Neimark-Sacker": "o",
               "first stick": "^", "grazing": "|"}


def runs_of(labels):
    """Ranges of places of one label, each with the first place of the next range, so that lines join."""
    start = 0
    for place in range(1, len(labels) + 1):
        if place == len(labels) or labels[place] != labels[start]:
            yield labels[start], slice(start, min(place + 1, len(labels)))
            start = place


def draw_along(axes, points, values, shade, name):
    """A value along the branch: solid where the cycle is stable, dashed where it is not, dotted where that is open."""
    parameter = np.array([point["parameter"] for point in points])
    styles = {"stable": "-", "unstable": "--"}
    for label, place in runs_of([point["stability"] for point in points]):
        axes.plot(parameter[place], values[place], styles.get(label, ":"), color=shade, lw=1.8)
    axes.plot([], [], color=shade, lw=1.8, label=name)


def mark_events(axes, events, points, values):
    """Events on the line of a value: at its nearest point by parameter and energy."""
    parameter = np.array([point["parameter"] for point in points])
    energy = np.array([point["mean_fluctuating_energy"] for point in points])
    spread = max(np.ptp(parameter), 1e-300), max(np.ptp(energy), 1e-300)
    seen = set()
    for event in events:
        kind = event["kind"]
        if kind == "Hopf":
            continue
        nearest = np.argmin(np.hypot((parameter - event["parameter"]) / spread[0],
                                     (energy - event["mean_fluctuating_energy"]) / spread[1]))
        axes.plot(event["parameter"], values[nearest], EVENT_MARKS[kind], color="black", ms=7, zorder=5,
                  mfc="black" if kind == "grazing" else "white", label=None if kind in seen else kind)
        seen.add(kind)


def branch_of(run):
    branch = run.stage("branch")
    if len(branch["points"]) < 2:
        raise Missing("the branch has a single point")
    return branch


def draw_branch(runs):
    (run, branch), *_ = those_with(runs, branch_of)
    points, equilibria = branch["points"], branch["equilibria"]
    figure, (above, middle, below) = plt.subplots(3, 1, figsize=(8, 8.5), sharex=True)
    swings = {name: np.array([point["peak_to_peak"][name] for point in points]) for name in points[0]["peak_to_peak"]}
    if swings:
        name, amplitude = max(swings.items(), key=lambda item: item[1].max())
        size, unit = length_unit(amplitude)
        label = f"{name}, peak to peak [{unit}]"
    else:
        amplitude, size = np.sqrt([point["mean_fluctuating_energy"] for point in points]), 1
        label = "root of the fluctuating energy [J$^{1/2}$]"
    frequency = np.array([point["frequency_hz"] for point in points])
    draw_along(above, points, amplitude / size, SLIP, "cycle")
    mark_events(above, branch["events"], points, amplitude / size)
    above.set(ylabel=label, ylim=(0, 1.08 * amplitude.max() / size), title=heading([run], f"limit cycle against {words_of(branch['key'], branch['name'])}"))
    draw_along(middle, points, frequency, SLIP, "cycle")
    mark_events(middle, branch["events"], points, frequency)
    at = np.array([equilibrium["parameter"] for equilibrium in equilibria])
    modal = np.array([equilibrium["frequency_hz"] for equilibrium in equilibria])
    near = np.abs(modal - np.median(frequency)) < 0.3 * np.median(frequency)  # another mode would flatten the rest
    middle.plot(at[near], modal[near], ".-", color="0.6", lw=1, label="least stable mode")
    middle.set(ylabel="frequency [Hz]")
    middle.ticklabel_format(axis="y", useOffset=False)
    below.plot(at, [equilibrium["growth_rate"] for equilibrium in equilibria], ".-", color=RED, lw=1.4,
               label="least stable mode")
    below.axhline(0, color="0.3", lw=0.8)
    for event in branch["events"]:
        if event["kind"] == "Hopf":
            below.plot(event["parameter"], 0, EVENT_MARKS["Hopf"], color="black", ms=10, zorder=5)
    if any(event["kind"] == "Hopf" for event in branch["events"]):
        below.plot([], [], EVENT_MARKS["Hopf"], color="black", ms=10, ls="none", label="Hopf")
    below.set(ylabel="growth rate [1/s]", xlabel=axis_label(branch["key"], branch["name"], unit_of_key(run, branch["key"])))
    for style, stability in (("-", "stable"), ("--", "unstable"), (":", "undecided")):
        if any(point["stability"] == stability for point in points):
            above.plot([], [], style, color="0.3", label=stability)
    for axes in (above, middle, below):
        axes.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False)
    return figure
