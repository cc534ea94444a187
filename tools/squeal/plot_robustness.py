"""Picture of random samples: probability of each unstable mode, the damping ratios of all samples, and what drives them."""

import numpy as np
from squeal.plot_basis import heading, plt, those_with
from squeal.plot_sweep import COLOURS
from squeal.plot_numbers import words_of
from squeal import Missing

SHOWN = 8  # modes, those that are unstable most often


def robustness_of(results):
    robustness = results.stage("robustness")
    if robustness["samples"] == 0:
        raise Missing("the run has no random samples")
    return robustness


def name_of(mode, modes):
    """By its frequency; of partners that have locked in by their growth rates too."""
    if mode["mode"] < 0:
        return "other modes"
    words = lambda of: f"{of['median_frequency_hz']:.0f} Hz" if of["median_frequency_hz"] >= 10 else f"{of['median_frequency_hz']:.3g} Hz"
    alike = sum(of["mode"] >= 0 and words(of) == words(mode) for of in modes) > 1
    return words(mode) + (f", {mode['median_growth_rate']:+.3g} 1/s" if alike else "")


def draw_probabilities(axes, robustness):
    """A bar for any mode and one for each of the first modes, with its interval."""
    entries = [("any mode", robustness["any"])] + [(name_of(mode, robustness["modes"]), mode) for mode in robustness["modes"][:SHOWN]]
    for place, (_, entry) in enumerate(entries):
        middle = 100 * entry["probability"]
        error = [[middle - 100 * entry["lower"]], [100 * entry["upper"] - middle]]
        axes.barh(place, middle, height=0.6, xerr=error, capsize=4, error_kw={"ecolor": "0.2", "lw": 1.2},
                  color="0.55" if place == 0 else COLOURS[(place - 1) % len(COLOURS)])
    axes.set_yticks(range(len(entries)), [name for name, _ in entries])
    axes.invert_yaxis()
    axes.set_xlim(0, max(1e-3, min(103, 110 * max(entry["upper"] for _, entry in entries))))
    axes.set_xlabel(f"probability of instability [%], {100 * robustness['confidence']:.3g} % interval")


def draw_growth(axes, table):
    """Histogram of growth over omega of the mode where it is largest; unstable samples in red."""
    chosen = (table["known"] == 1) & (table["frequency_hz"] > 0)
    ratio = 100 * table["growth_rate"][chosen] / (2 * np.pi * table["frequency_hz"][chosen])
    width = max(np.ptp(ratio) / 40, 1e-12)
    bins = width * np.arange(np.floor(ratio.min() / width), np.ceil(ratio.max() / width) + 1.5)  # zero is an edge
    unstable = table["unstable_modes"][chosen] > 0
    axes.hist(ratio[~unstable], bins=bins, color="0.7", label="stable")
    axes.hist(ratio[unstable], bins=bins, color=COLOURS[0], label="unstable")
    axes.axvline(0, color="0.2", lw=0.8)
    axes.set_xlabel("largest growth rate over angular frequency [%]")
    axes.set_ylabel("number of samples")
    axes.set_ylim(top=1.25 * axes.get_ylim()[1])  # the legend hides no bar
    axes.legend(fontsize=8, ncols=2, loc="upper center")


def draw_drivers(axes, robustness):
    """Rank correlations of the numbers with growth."""
    numbers = robustness["numbers"]
    for place, number in enumerate(numbers):
        value = number["rank_correlation"]
        axes.barh(place, value, height=0.6, color=COLOURS[0] if value > 0 else COLOURS[1])
    axes.axvline(0, color="0.2", lw=0.8)
    axes.set_xlim(-1, 1)
    axes.set_xticks([-1, -0.5, 0, 0.5, 1])
    axes.set_yticks(range(len(numbers)), [words_of(number["key"], number["name"]).replace(" of ", "\nof ") for number in numbers])
    axes.invert_yaxis()
    axes.set_xlabel("rank correlation with growth [-]")


def draw_robustness(runs):
    (results, robustness), *_ = those_with(runs, robustness_of)
    lines = results.lines("robustness")
    table = {name: np.array([float(line[name] or "nan") for line in lines])
             for name in ("known", "growth_rate", "frequency_hz", "unstable_modes")}
    rows = max(len(robustness["numbers"]), 1 + min(SHOWN, len(robustness["modes"])))
    figure, axes = plt.subplots(1, 3, figsize=(13.5, 2.4 + 0.35 * rows))
    for ax in axes:
        ax.set_axisbelow(True)  # the grid
    draw_probabilities(axes[0], robustness)
    draw_growth(axes[1], table)
    draw_drivers(axes[2], robustness)
    figure.suptitle(heading([results], f"{robustness['samples']} random samples, "
                            f"residuals below {robustness['residual']:.1e} in the full problem"))
    return figure
