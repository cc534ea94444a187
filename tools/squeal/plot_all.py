"""Every picture of tools/plot: its name, what draws it, and what it shows."""

from squeal import common
from squeal import plot_captions
from squeal import plot_contact
from squeal import plot_model
from squeal import plot_motion
from squeal import plot_response
from squeal import plot_robustness
from squeal import plot_shape
from squeal import plot_spectra
from squeal import plot_stability
from squeal import plot_sweep
from squeal import plot_thresholds
from squeal.plot_basis import ABSENT, plt
from squeal import Missing

# Name: what draws it, whether it is of one run only, and what it shows: words, or what makes them of the runs and the figure.
FIGURES = {
    "model": (plot_model.draw_model, True, plot_captions.of_model),
    "shape": (plot_shape.draw_shape, False, plot_captions.of_shape),
    "shapes": (plot_shape.draw_shapes, True, "The unstable modes, the fastest growing first."),
    "modes": (plot_stability.draw_modes, False, plot_captions.of_modes),
    "estimate": (plot_stability.draw_estimate, False, "Power of friction and of damping against amplitude: where they are equal "
                 "the vibration is estimated to settle."),
    "response": (plot_response.draw_response, False, "Displacement of the probes under a unit force at one of them, about "
                 "sliding, as a test rig measures it: magnitude and phase."),
    "energy": (plot_motion.draw_energy, False, plot_captions.of_energy),
    "spectrum": (plot_spectra.draw_spectrum, False, plot_captions.of_spectrum),
    "spectrogram": (plot_spectra.draw_spectrogram, False, "How the spectrum changes with time."),
    "cycle": (plot_motion.draw_cycle, False, plot_captions.of_cycle),
    "powers": (plot_motion.draw_powers, False, plot_captions.of_powers),
    "pressure": (plot_contact.draw_pressure, False, plot_captions.of_pressure),
    "contact": (plot_contact.draw_contact, True, "Where the surfaces are open, stick and slip: four instants of the cycle, and "
                "the parts of the period."),
    "liftoff": (plot_motion.draw_lift_off, False, "How much of the contact is lost, against time."),
    "newton": (plot_stability.draw_newton, False, "How the limit cycle was found: distance from periodic motion against periods "
               "integrated."),
    "branch": (plot_stability.draw_branch, True, "The limit cycle along a number of the scene."),
    "sweep": (plot_sweep.draw_sweep, True, plot_captions.of_sweep),
    "thresholds": (plot_thresholds.draw_thresholds, True, plot_captions.of_thresholds),
    "robustness": (plot_robustness.draw_robustness, True, "How likely modes are unstable where numbers are random, with the "
                   "intervals; growth of the samples; which numbers drive it."),
}
ONE_RUN = "it shows one run; give one results folder"
ANIMATION = "One period, over and over: the whole, and what moves most, exaggerated."


def caption_of(name, runs, figure):
    """What a picture shows; of some by what is drawn in it."""
    words = FIGURES[name][2]
    return words(runs, figure) if callable(words) else words


def figures(runs, only=(), spectrogram="probe"):
    """Name, figure, or the Missing that says why there is none, and the runs that the figure lacks, one after the other; each
    figure is closed by the next."""
    for name, (draw, alone, _) in FIGURES.items():
        if only and name not in only:
            continue
        ABSENT.clear()
        try:
            if alone and len(runs) > 1:
                raise Missing(ONE_RUN)
            figure = draw(runs, spectrogram) if name == "spectrogram" else draw(runs)
        except Missing as reason:
            yield name, reason, []
            continue
        yield name, figure, list(ABSENT)
        plt.close(figure)


def draw_all(runs, folder, a):
    """Files of all pictures; a: the arguments of tools/plot."""
    prefix = "compare_" if len(runs) > 1 else ""
    folder.mkdir(parents=True, exist_ok=True)
    for name, figure, absent in figures(runs, a.only or (), a.spectrogram):
        files = [folder / f"{prefix}{name}.{ending}" for ending in a.format]
        for file in files:
            if isinstance(figure, Missing):
                file.unlink(missing_ok=True)  # of an earlier run
                continue
            common.save_picture(figure, file, a.dpi)
            print(f"plot: {file}")
        if isinstance(figure, Missing):
            print(f"plot: {prefix}{name} left out: {figure}")
        for reason in absent:
            print(f"plot: {prefix}{name} lacks {reason}")
    if not a.only or "animation" in a.only:
        file = folder / f"{prefix}animation.gif"
        try:
            if len(runs) > 1:
                raise Missing(ONE_RUN)
            plot_shape.animate(runs[0], file)
            print(f"plot: {file}")
        except Missing as reason:
            file.unlink(missing_ok=True)
            print(f"plot: {prefix}animation left out: {reason}")
