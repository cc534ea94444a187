"""Picture of frequency responses: magnitude in dB and phase, a column for each probe that is driven."""

import numpy as np
from plot_basis import colour, frequency_unit, heading, label_of, plt, those_with

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
    """lines: label, frequency and receptance."""
    for place, (label, frequency, h) in enumerate(lines):
        above.plot(frequency, level(h), lw=1.2, color=colour(place), label=label)
        below.plot(frequency, unwound(h), lw=1.2, color=colour(place))
    top = max(level(h).max() for _, _, h in lines)
    above.set_ylim(max(min(level(h).min() for _, _, h in lines), top - DEPTH) - 5, top + 5)
    above.set_ylabel("displacement over force [dB re 1 m/N]")
    above.legend(fontsize=8)
    below.set_ylim(-190, 190)
    below.set_yticks([-180, -90, 0, 90, 180])
    below.set_ylabel("phase [degrees]")
    below.set_xlabel(f"frequency [{unit}]")
    for axes in (above, below):
        axes.grid(alpha=0.3)


def draw_response(runs):
    found = those_with(runs, lambda run: run.responses())
    every = list(dict.fromkeys(i for _, (_, table) in found for i, _ in table))
    driven, left_out = every[:MOST_COLUMNS], every[MOST_COLUMNS:]
    size, unit = frequency_unit(max(frequency[-1] for _, (frequency, _) in found))
    figure, axes = plt.subplots(2, len(driven), figsize=(max(8, 5.4 * len(driven)), 6.8), squeeze=False, sharex=True,
                                height_ratios=[2.4, 1], layout="constrained")
    for column, name in enumerate(driven):
        lines = [(label_of(run, runs, f"{j} driven at {i}"), frequency / size, h)
                 for run, (frequency, table) in found for (i, j), h in table.items() if i == name]
        draw_column(*axes[:, column], lines[:MOST_LINES], unit)
    unstable = any(run.report.get("modes", {}).get("unstable_count", 0) for run, _ in found)
    figure.suptitle(heading([run for run, _ in found], "frequency responses about sliding" +
                            (", formal: a mode is unstable" if unstable else "") +
                            (f"; not drawn: driven at {', '.join(left_out)}" if left_out else "")))
    return figure
