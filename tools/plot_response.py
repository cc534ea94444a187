"""Picture of frequency responses: magnitude in dB and phase, a column for each probe that is driven."""

import numpy as np
from matplotlib.lines import Line2D
from plot_basis import colour, frequency_unit, heading, label_of, legend_below, plt, those_with

MOST_COLUMNS, MOST_LINES = 3, 8
DEPTH = 140  # dB below the largest that are drawn


def level(h):
    """dB re 1 m/N."""
    return 20 * np.log10(np.maximum(np.abs(h), 1e-300))


def unwound(h):
    """Phase in degrees, with gaps where it jumps by a turn."""
    phase = np.degrees(np.angle(h))
    return np.where(np.append(np.abs(np.diff(phase)) > 180, False), np.nan, phase)


def draw_column(above, below, lines, unit):
    """lines: colour, frequency and receptance."""
    for shade, frequency, h in lines:
        above.plot(frequency, level(h), lw=1.2, color=shade)
        below.plot(frequency, unwound(h), lw=1.2, color=shade)
    top = max(level(h).max() for _, _, h in lines)
    above.set_ylim(max(min(level(h).min() for _, _, h in lines), top - DEPTH) - 5, top + 5)
    above.set_ylabel("displacement over force [dB re 1 m/N]")
    below.set_ylim(-190, 190)
    below.set_yticks([-180, -90, 0, 90, 180])
    below.set_ylabel("phase [degrees]")
    below.set_xlabel(f"frequency [{unit}]")
    for axes in (above, below):
        axes.grid(alpha=0.3)


def draw_response(runs):
    found = those_with(runs, lambda run: run.responses())
    every = list(dict.fromkeys(i for _, (_, table) in found for i, _ in table))
    driven = every[:MOST_COLUMNS]
    read = list(dict.fromkeys(label_of(run, runs, j) for run, (_, table) in found for i, j in table if i in driven))
    left_out = [f"{word} {', '.join(names)}" for word, names in (("driven at", every[MOST_COLUMNS:]), ("read at", read[MOST_LINES:]))
                if names]
    shades = {label: colour(place) for place, label in enumerate(read[:MOST_LINES])}
    size, unit = frequency_unit(max(frequency[-1] for _, (frequency, _) in found))
    figure, axes = plt.subplots(2, len(driven), figsize=(max(8, 5.4 * len(driven)), 6.8), squeeze=False, sharex=True,
                                height_ratios=[2.4, 1], layout="constrained")
    for column, name in enumerate(driven):
        lines = [(shades[label_of(run, runs, j)], frequency / size, h) for run, (frequency, table) in found
                 for (i, j), h in table.items() if i == name and label_of(run, runs, j) in shades]
        axes[0, column].set_title(f"driven at {name}", fontsize=10)
        if lines:  # the runs of the first lines may not be driven here
            draw_column(*axes[:, column], lines, unit)
    unstable = any(run.report.get("modes", {}).get("unstable_count", 0) for run, _ in found)
    figure.suptitle(heading([run for run, _ in found], "frequency responses about sliding" +
                            (", formal: a mode is unstable" if unstable else "") +
                            (f"; not drawn: {', '.join(left_out)}" if left_out else "")))
    legend_below(figure, {label: Line2D([], [], color=shade, lw=1.2) for label, shade in shades.items()})  # covers no curve
    return figure
