"""Spectra of the probes' velocities, and spectrograms of one of them or of the energy."""

import contextlib

import numpy as np
from squeal.plot_basis import colour, cycle_words, frequency_unit, heading, label_of, plt, strongest, those_with
from squeal import Missing

REFERENCE = 1e-9  # [m/s], of velocity levels by ISO 1683
FLOOR = 90  # [dB] below the largest
AUDIBLE = 20000.0  # [Hz]


def decibel(amplitude):
    """Level of an amplitude of velocity, by its root mean square."""
    return 20 * np.log10(np.maximum(np.abs(amplitude) / np.sqrt(2), 1e-300) / REFERENCE)


def harmonics(values, period):
    """Frequencies [Hz] and complex amplitudes of velocity of a displacement over one period; the mean is left out."""
    count = (len(values) - 1) // 2
    frequency = np.arange(1, count + 1) / period
    amplitude = 2 * np.fft.rfft(values)[1 : count + 1] / len(values)
    return frequency, 2j * np.pi * frequency * amplitude


def windowed(values, step):
    """Frequencies [Hz] and amplitudes of velocity of a displacement under a Hann window."""
    window = np.hanning(len(values))
    amplitude = 2 * np.abs(np.fft.rfft((values - values.mean()) * window)) / window.sum()
    frequency = np.fft.rfftfreq(len(values), step)
    return frequency, 2 * np.pi * frequency * amplitude


def strongest_line(frequency, amplitude):
    """Frequency [Hz] of the largest amplitude of velocity."""
    return frequency[np.argmax(np.where(frequency > 0, np.abs(amplitude), 0))]


def loudest(lines):
    """Frequencies and amplitudes of the probe with the largest velocity. lines: those of all probes."""
    return max(lines, key=lambda line: np.abs(line[1]).max())


def last_shown(lines):
    """Where the axis of frequencies ends [Hz]: with what is within FLOOR of the largest, but no further than five times the
    strongest line, or 20 kHz where that is heard beside it. lines: frequencies, amplitudes of velocity."""
    top = max(decibel(amplitude).max() for _, amplitude in lines)
    last = max(frequency[decibel(amplitude) > top - FLOOR].max(initial=0) for frequency, amplitude in lines)
    strongest = strongest_line(*loudest(lines))
    return min(last, max(5 * strongest, min(AUDIBLE, 25 * strongest)))


def record_of(run, name):
    """Displacements of the probes in time and the step [s] of a run's transient or settled motion."""
    time = run.series(name, "time")
    if len(time) < 32:
        raise Missing(f"the {name} is too short for a spectrum")
    probes = run.probes(name)
    if not probes:
        raise Missing("the scene has no probes")
    return probes, (time[-1] - time[0]) / (len(time) - 1)


def spectrum_of_cycle(run):
    cycle, probes = run.periodic(), run.probes("cycle")
    if not probes:
        raise Missing("the scene has no probes")
    run.series("cycle", "time")
    return (f"{cycle_words(run)}, harmonics of {cycle['frequency_hz']:.6g} Hz",
            {name: (*harmonics(values, cycle["period"]), True) for name, values in probes.items()})


def spectrum_of_record(run, name):
    run.stage(name)
    probes, step = record_of(run, name)
    half = len(next(iter(probes.values()))) // 2
    words = "settled motion" if name == "settled" else "second half of the transient"
    return words, {probe: (*windowed(values[-half:], step), False) for probe, values in probes.items()}


def spectra_of(run):
    """What is drawn of a run: a title, and of each probe its frequencies, amplitudes and whether these are lines. Where no cycle
    attracts, the settled motion is what is heard."""
    for find in (lambda: spectrum_of_record(run, "settled"), lambda: spectrum_of_cycle(run),
                 lambda: spectrum_of_record(run, "transient")):
        with contextlib.suppress(Missing):
            return find()
    raise Missing("the run has no motion with probes in time")


def draw_spectrum(runs):
    found = those_with(runs, spectra_of)
    figure, axes = plt.subplots(figsize=(8.5, 4.8))
    lines = [(run, name, *of) for run, (_, probes) in found for name, of in list(probes.items())[:6]]
    top = max(decibel(amplitude).max() for _, _, _, amplitude, _ in lines)
    last = last_shown([(frequency, amplitude) for _, _, frequency, amplitude, _ in lines])
    last = max(last, 1.5 * min(frequency[frequency > 0].min() for _, _, frequency, _, _ in lines))
    size, unit = frequency_unit(last)
    for k, (run, name, frequency, amplitude, is_lines) in enumerate(lines):
        shown = (frequency <= 1.02 * last) & (frequency > 0)
        level = decibel(amplitude[shown])
        words = label_of(run, runs, name) + ("" if (level > top - FLOOR).any() else ", beyond the axes")
        if is_lines:  # the first probe's are the broadest, so that all are seen at their frequency
            broad = 1.2 * (len(lines) - k)
            axes.vlines(frequency[shown] / size, top - FLOOR, np.maximum(level, top - FLOOR), color=colour(k), lw=broad)
            seen = level > top - FLOOR
            axes.plot(frequency[shown][seen] / size, level[seen], "os^Dv*"[k % 6], ms=5, color=colour(k), mec="white", mew=0.5, label=words)
        else:
            axes.plot(frequency[shown] / size, level, color=colour(k), lw=1, label=words)
    axes.set(xlabel=f"frequency [{unit}]", ylabel="level of velocity [dB re 1 nm/s]", ylim=(top - FLOOR, top + 5),
             title=heading(runs, found[0][1][0] if len(found) == 1 else "spectra of the probes' velocities"))
    axes.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False)
    return figure


def framed(values, step, period):
    """Times [s], frequencies [Hz] and power of frames of ten periods at most, as (time, frequency)."""
    length = len(values) * step / period
    if length < 8:
        raise Missing(f"a record of {length:.1f} periods is too short for a spectrogram")
    window = round(min(10, length / 4) * period / step)  # resolves a tenth of the frequency at best
    hop = max(1, (len(values) - window) // 400)
    starts = np.arange(0, len(values) - window + 1, hop)
    frames = np.stack([values[k : k + window] for k in starts])
    frames = (frames - frames.mean(axis=1, keepdims=True)) * np.hanning(window)
    power = np.abs(np.fft.rfft(frames, 4 * window, axis=1)) ** 2  # padded: a smooth picture
    return starts * step + window * step / 2, np.fft.rfftfreq(4 * window, step), power


def spectrogram_of(run, of):
    """Times, frequencies, powers and what they are of. of: "probe" (that which swings most), "energy" or a probe's name."""
    for name in ("transient", "settled"):
        try:
            run.stage(name)
            time = run.series(name, "time")
            break
        except Missing as reason:
            last = reason
    else:
        raise last
    step = (time[-1] - time[0]) / (len(time) - 1)
    # Of the motion, not of the mode that grows most: another one may win.
    probes = run.probes(name)
    spectra = [windowed(values, step) for values in probes.values()]
    line = strongest_line(*loudest(spectra)) if probes else 1 / run.followed_period()
    if not line > 0:
        raise Missing("no probe moves")
    period = 1 / line
    if of == "energy":
        values, words = run.series(name, "energy"), "mechanical energy (quadratic: not the motion's own spectrum)"
    else:
        if of != "probe" and of not in probes:
            raise Missing(f"there is no probe {of}: {', '.join(probes) or 'the scene has none'}")
        probe, values = strongest(probes, round(period / step)) if of == "probe" else (of, probes[of])
        values, words = np.gradient(values, step), f"velocity of {probe}"
    return *framed(values, step, period), period, words


def draw_spectrogram(runs, of):
    found = those_with(runs, lambda run: spectrogram_of(run, of))
    figure, panels = plt.subplots(len(found), 1, figsize=(8, 0.8 + 4 * len(found)), squeeze=False)
    for axes, (run, (time, frequency, power, period, words)) in zip(panels.flat, found):
        shown = frequency <= min(10 / period, frequency[-1])
        level = 10 * np.log10(np.maximum(power[:, shown] / power[:, shown].max(), 1e-30))
        size, unit = frequency_unit(frequency[shown].max())
        axes.grid(False)
        image = axes.pcolormesh(time, frequency[shown] / size, level.T, vmin=-FLOOR, vmax=0, shading="auto", cmap="magma",
                                rasterized=True)
        figure.colorbar(image, ax=axes, label="dB of the largest")
        axes.set(xlabel="time [s]", ylabel=f"frequency [{unit}]", title=label_of(run, runs, words) if len(found) > 1 else
                 heading([run], f"spectrogram, {words}"))
    return figure
