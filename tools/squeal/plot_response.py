"""Picture of frequency responses: magnitude in dB and phase, a column for each probe that is driven."""

import numpy as np
from matplotlib.lines import Line2D
from squeal.plot_basis import colour, frequency_unit, heading, label_of, legend_below, plt, those_with

MOST_COLUMNS, MOST_LINES = 3, 8
DEPTH = 140  # dB below the largest that are drawn


def level(h):
    """dB re 1 m/N."""
    return 20 * np.log10(np.maximum(np.abs(h), 1e-300))


def unwound(h):
    """Phase in degrees, with gaps where it jumps by a turn."""
    phase = np.degrees(np.angle(h))
    return np.where(np.append(np.abs(np.diff(phase)) > 180, False), np.nan, phase)


def least_known(run, table):
    """The receptance at each frequency up to which one may be rounding. The reported residual force, over a unit force, holds the
    rounding of the solution; it moves a probe by that part of the largest receptance. What DEPTH hides says nothing either."""
    return max(run.report["response"]["residual"], 10 ** (-DEPTH / 20)) * np.max([np.abs(h) for h in table.values()], axis=0)


def draw_column(above, below, lines, unit):
    """lines: of each probe its name, colour, frequency, receptance and where that is known. Returns the probes beyond the axes."""
    for _, shade, frequency, h, known in lines:
        if not known.all():
            above.plot(frequency, level(h), lw=1.2, ls=":", color=shade)
        for axes, values in ((above, level(h)), (below, unwound(h))):
            axes.plot(frequency, np.where(known, values, np.nan), lw=1.2, color=shade)
    top = max(level(h).max() for *_, h, _ in lines)
    bottom = max(min(level(h[known]).min(initial=top) for *_, h, known in lines), top - DEPTH) - 5
    above.set_ylim(bottom, top + 5)
    above.set_ylabel("displacement over force [dB re 1 m/N]")
    below.set_ylim(-190, 190)
    below.set_yticks([-180, -90, 0, 90, 180])
    below.set_ylabel("phase [degrees]")
    below.set_xlabel(f"frequency [{unit}]")
    for axes in (above, below):
        axes.grid(alpha=0.3)
    return [name for name, _, _, h, _ in lines if level(h).max() < bottom]


def draw_response(runs):
    found = [(run, *of, least_known(run, of[1])) for run, of in those_with(runs, lambda run: run.responses())]
    every = list(dict.fromkeys(i for _, _, table, _ in found for i, _ in table))
    driven = every[:MOST_COLUMNS]
    read = list(dict.fromkeys(label_of(run, runs, j) for run, _, table, _ in found for i, j in table if i in driven))
    left_out = [f"{word} {', '.join(names)}" for word, names in (("driven at", every[MOST_COLUMNS:]), ("read at", read[MOST_LINES:]))
                if names]
    shades = {label: colour(place) for place, label in enumerate(read[:MOST_LINES])}
    size, unit = frequency_unit(max(frequency[-1] for _, frequency, _, _ in found))
    figure, axes = plt.subplots(2, len(driven), figsize=(max(8, 5.4 * len(driven)), 6.8), squeeze=False, sharex=True,
                                height_ratios=[2.4, 1], layout="constrained")
    unknown = False
    for column, name in enumerate(driven):
        lines = [(label, shades[label], frequency / size, h, np.abs(h) > least) for run, frequency, table, least in found
                 for (i, j), h in table.items() if i == name and (label := label_of(run, runs, j)) in shades]
        # the runs of the first lines may not be driven here
        beyond = draw_column(*axes[:, column], lines, unit) if lines else []
        axes[0, column].set_title(f"driven at {name}" + (f"; beyond the axes: {', '.join(beyond)}" if beyond else ""), fontsize=10)
        unknown |= any(not known.all() for *_, known in lines)
    unstable = any(run.report.get("modes", {}).get("unstable_count", 0) for run, *_ in found)
    figure.suptitle(heading([run for run, *_ in found], "frequency responses about sliding" +
                            (", formal: a mode is unstable" if unstable else "") +
                            (f"; not drawn: {', '.join(left_out)}" if left_out else "")))
    legend = {label: Line2D([], [], color=shade, lw=1.2) for label, shade in shades.items()}
    if unknown:
        legend["within the residual's reach: no phase"] = Line2D([], [], color="0.4", lw=1.2, ls=":")
    legend_below(figure, legend)  # covers no curve
    return figure
