"""What pictures show, in sentences made of what is drawn in them."""

from squeal.plot_basis import is_closed
from squeal import Missing


def words_in(figure):
    """Every label of its legends, in one text."""
    legends = [*figure.legends, *(axes.get_legend() for axes in figure.axes if axes.get_legend())]
    return "; ".join(text.get_text() for legend in legends for text in legend.get_texts())


def sentences(*pairs):
    """Those that hold."""
    return " ".join(words for words, holds in pairs if holds)


def closed(runs):
    """Whether the periods kept of all runs that have some close."""
    found = []
    for run in runs:
        try:
            found.append(is_closed(run))
        except Missing:
            continue
    return all(found)


def of_model(runs, figure):
    drawn = "; ".join(axes.get_title() for axes in figure.axes)
    return f"The parts, each in its colour ({drawn}). Red points are centres of pressure, seen through the parts, arrows the way of the rotors, in steady sliding."


def of_shape(runs, figure):
    titles = [axes.get_title() for axes in figure.axes]
    return sentences(("The mode that grows fastest, deformed and coloured by how much each place moves.", True),
                     ("Beside it one period of the limit cycle.", any("limit cycle" in title for title in titles)))


def of_modes(runs, figure):
    drawn = words_in(figure)
    return sentences(("Every mode of the sliding brake below the band.", True),
                     ("The scale of growth is logarithmic away from 0.", figure.axes[0].get_yscale() == "symlog"),
                     ("Triangles above zero grow and may squeal.", any(len(line.get_xdata()) for line in figure.axes[0].lines if line.get_marker() == "^")),
                     ("Bars are where the mesh leads the modes that it was asked about.", "limit of the mesh, with its bar" in drawn),
                     ("Squares are the projection on real modes.", "projection" in drawn))


def of_energy(runs, figure):
    return sentences(("Energy against time, as means over a period.", True),
                     ("Dashed: the limit cycle by shooting.", "limit cycle" in words_in(figure)))


def of_spectrum(runs, figure):
    drawn = words_in(figure)
    return sentences(("Levels of the probes' velocities.", True),
                     ("Each line stands at its frequency; of probes that share one, the first is the broadest.", bool(figure.axes[0].collections)),
                     ("Some are too weak for the axes.", "beyond the axes" in drawn))


def of_cycle(runs, figure):
    what = "One period of the limit cycle" if closed(runs) else "The last period of the search"
    return sentences((f"{what}: velocity against displacement of each probe.", True),
                     ("On the right the state of each contact pair.", any(axes.images for axes in figure.axes)))


def of_powers(runs, figure):
    return sentences(("What feeds the vibration and what takes its energy round one period.", True), ("The means of a limit cycle cancel.", closed(runs)),
                     ("Below, the mechanical energy, which the powers change, with the work against the preload; and the energy of the motion alone.", True))


def of_pressure(runs, figure):
    return sentences(("Contact pressure in steady sliding. Red crosses are centres of pressure.", True),
                     ("Arrows are the way of the rotor over the pad.", any(text.arrow_patch for axes in figure.axes for text in axes.texts if hasattr(text, "arrow_patch"))))


def of_sweep(runs, figure):
    drawn = words_in(figure)
    maps = any(axes.get_label() == "<colorbar>" for axes in figure.axes)
    counts = hasattr(figure, "not_counted")
    return sentences(("Largest growth rate over the plane of two numbers.", maps), ("How many points have an unstable mode near a frequency.", counts),
                     ("Frequency and growth of the modes against a number of the scene.", not maps and not counts),
                     ("Coloured modes are unstable somewhere, grey ones nowhere.", not maps and "grows most" in drawn),
                     ("Dotted lines are thresholds.", "threshold, with its value" in drawn),
                     *((sentence, True) for sentence in getattr(figure, "not_counted", [])),
                     ("Crosses are points that failed.", "point that failed" in drawn))


def of_thresholds(runs, figure):
    return sentences(("Each threshold of the sweep from near: the mode whose stability changes, in red.", True),
                     ("In blue the partner, the mode nearest in frequency.", "partner" in words_in(figure)))
