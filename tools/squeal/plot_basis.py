"""What the pictures of tools/plot share: units, colours, labels that keep apart, headings."""

import tomllib

from squeal import common

common.needs("matplotlib", "numpy")
import matplotlib
import numpy as np
from squeal.common import BLUE, ORANGE, RED  # noqa: F401, of the pictures too
from squeal import Missing
from squeal.scene import with_numbers

OPEN, STICK, SLIP = "#c9c9c9", ORANGE, BLUE  # of the contact states 0, 1 and 2
STATES = {"open": OPEN, "stick": STICK, "slip": SLIP}
REST, SQUEAL = "#dfe4ea", ("#f6c65b", "#e8662c", "#a3102a")  # colours of no amplitude, and of more and more
PART_COLOURS = ("#7d93a8", "#c9a227", "#6b8f71", "#a0616a", "#8d7bb0", "#4f9d9d", "#b5835a", "#9aa35b")
plt = common.pyplot(dpi=130)
ABSENT = []  # the runs that a picture which is being drawn lacks, with the reason


def scene_of(run):
    """The scene that was run, with every default and with numbers in place of their names; empty where its file is not there."""
    file = run.folder / "resolved.toml"
    return with_numbers(tomllib.loads(file.read_text())) if file.exists() else {}


def frequency_unit(largest):
    """The unit in which frequencies up to this one [Hz] are easy to read, and its size."""
    return (1000, "kHz") if largest >= 1000 else (1, "Hz")


def unit_of(values, name):
    """Size and name of the unit, with a prefix, in which these values are easy to read."""
    largest = np.abs(values).max()
    prefixes = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))
    size, prefix = next(((size, prefix) for size, prefix in prefixes if largest >= size), prefixes[-1])
    return size, prefix + name


def mode_words(frequency, growth):
    """Of frequency [Hz] and growth rate [1/s]."""
    shown = f"{frequency:.0f}" if frequency >= 1e4 else f"{frequency:.5g}"
    return f"{shown} Hz, " + (f"{growth:+.0f} 1/s" if abs(growth) >= 100 else f"{growth:+.3g} 1/s")


def length_unit(values):
    """The unit in which these displacements [m] are easy to read, and its size."""
    largest = np.abs(values).max()
    units = ((1, "m"), (1e-3, "mm"), (1e-6, "µm"), (1e-9, "nm"))
    return next(((size, unit) for size, unit in units if largest >= 0.1 * size), units[-1])


def names_of(runs):
    """The titles of their scenes, each once; of more than three the first and how many others."""
    titles = list(dict.fromkeys(run.title for run in runs))
    return " and ".join(titles) if len(titles) < 4 else f"{titles[0]} and {len(titles) - 1} others"


def heading(runs, what):
    """What is drawn, after the titles of the scenes; on two lines where one would be too long."""
    title = names_of(runs)
    return f"{title}:{' ' if len(title) + len(what) < 60 else chr(10)}{what}"


def label_of(run, runs, name=""):
    """A line's name: that of its run comes first where there are several."""
    return " ".join(word for word in (run.folder.name if len(runs) > 1 else "", name) if word)


def colour(place):
    return matplotlib.rcParams["axes.prop_cycle"].by_key()["color"][place % 10]


def those_with(runs, take):
    """(run, take(run)) of the runs that have it, the others go to ABSENT; Missing where none has."""
    found, reasons = [], []
    for run in runs:
        try:
            found.append((run, take(run)))
        except Missing as reason:
            reasons.append(f"{run.folder.name}: {reason}" if len(runs) > 1 else str(reason))
    if not found:
        raise Missing("; ".join(reasons))
    ABSENT.extend(reasons)
    return found


def search_outcome(run):
    """How the search for the period that was kept ended. Where the settled motion is the answer, the reason begins with it."""
    cycle = run.stage("cycle")
    return cycle["reason"].partition(":")[0] if cycle["outcome"] == "settled" else cycle["outcome"]


def is_closed(run):
    return search_outcome(run) in ("converged", "unstable cycle")


def cycle_words(*runs):
    """What the periods that were kept are of."""
    if len(runs) > 1:
        return "limit cycles" if all(map(is_closed, runs)) else "periods kept, not all closed"
    outcome = search_outcome(runs[0])
    words = {"converged": "limit cycle", "unstable cycle": "limit cycle that repels"}
    beside = " (not the settled motion)" if runs[0].stage("cycle")["outcome"] == "settled" else ""
    return words.get(outcome, f"last period of the search, {outcome}") + beside


def swing(values, steps):
    """Peak to peak of each whole period of so many steps, their mean: what drifts from one to the next is no swing."""
    steps = min(steps, len(values))
    return np.ptp(values[: len(values) // steps * steps].reshape(-1, steps), axis=1).mean()


def strongest(probes, steps=None):
    """Name and values of the probe that swings most within periods of so many steps, or within one that is all of them."""
    if not probes:
        raise Missing("the scene has no probes")
    return max(probes.items(), key=lambda item: swing(item[1], steps or len(item[1])))


def start_of(run, runs):
    """The step of the period at which cycles that are compared start: where the first harmonic of the probe that swings most
    is largest. One run stays as it is, and so does one without probes."""
    probes = run.probes("cycle")
    if len(runs) == 1 or not probes:
        return 0
    values = strongest(probes)[1]
    return round(-np.angle(np.fft.rfft(values)[1]) / (2 * np.pi) * len(values)) % len(values)


def portrait(values, step, closed):
    """Displacement and velocity over one period, by central differences. closed: the period ends where it began; one that
    does not keeps its gap, since a difference across it is no velocity."""
    if not closed:
        return values, np.gradient(values, step)
    speed = (np.roll(values, -1) - np.roll(values, 1)) / (2 * step)
    return np.append(values, values[0]), np.append(speed, speed[0])


def spread(places, gap):
    """Ascending places at least a gap apart and near the given ascending ones, from 0 to 1 where they fit."""
    places = np.asarray(places, float)
    offsets = gap * np.arange(len(places))
    # Without the gaps the places must ascend: the mean of the running maximum and minimum does, and stays near.
    bare = places - offsets
    ascending = (np.maximum.accumulate(bare) + np.minimum.accumulate(bare[::-1])[::-1]) / 2
    top = max(1 - offsets[-1], 0) if len(places) else 1
    return np.clip(ascending, 0, top) + offsets


def label_column(axes, points, texts):
    """Texts beside points, in a column to the right of the axes, one under the other, with lines to their points."""
    figure = axes.figure
    figure.canvas.draw()  # scales are known
    inverse = axes.transAxes.inverted()
    height = [inverse.transform(axes.transData.transform(point))[1] for point in points]
    order = np.argsort(height, kind="stable")
    gap = 1.7 * 8 / 72 * figure.dpi / axes.get_window_extent().height  # lines of 8 points
    for place, at in zip(order, spread(np.array(height)[order], gap)):
        axes.annotate(texts[place], points[place], xytext=(1.05, at), textcoords=axes.transAxes, fontsize=8, va="center",
                      arrowprops={"arrowstyle": "-", "relpos": (0, 0.5), "color": "0.6", "lw": 0.7, "shrinkA": 1, "shrinkB": 4})


def label_row(axes, places, texts, colours):
    """Texts upright in a row above the axes, side by side, with lines to their places on the upper edge; those that fit."""
    figure = axes.figure
    figure.canvas.draw()  # scales are known
    along = axes.transAxes.inverted().transform(axes.transData.transform([(place, 0) for place in places]))[:, 0]
    gap = 1.4 * 7 / 72 * figure.dpi / axes.get_window_extent().width  # lines of 7 points
    order = np.argsort(along, kind="stable")[: int(1 / gap)]
    for place, at in zip(order, spread(along[order], gap)):
        axes.annotate(texts[place], (along[place], 1), xycoords=axes.transAxes, xytext=(at, 1.05), textcoords=axes.transAxes,
                      fontsize=7, rotation=90, ha="center", va="bottom", color=colours[place],
                      arrowprops={"arrowstyle": "-", "relpos": (0.5, 0), "color": colours[place], "lw": 0.7, "shrinkA": 1, "shrinkB": 0})


def legend_below(figure, legend):
    """A legend of labels and handles below all axes, in as much of the figure as it needs."""
    if not legend:
        return
    columns = max(1, min(len(legend), int(figure.get_figwidth() / (0.5 + 0.065 * max(map(len, legend))))))
    height = (0.2 + 0.175 * -(-len(legend) // columns)) / figure.get_figheight()  # lines of 8 points
    figure.get_layout_engine().set(rect=(0, height, 1, 1 - height))
    figure.legend(legend.values(), legend, loc="lower center", ncols=columns, fontsize=8)


def squeal_colours():
    return matplotlib.colors.LinearSegmentedColormap.from_list("squeal", (REST, *SQUEAL))


def state_legend(axes, **place):
    patches = [matplotlib.patches.Patch(facecolor=shade, edgecolor="0.5", label=name) for name, shade in STATES.items()]
    axes.legend(handles=patches, ncol=3, frameon=False, fontsize=8, **place)


def state_colours():
    return matplotlib.colors.ListedColormap(list(STATES.values()))
