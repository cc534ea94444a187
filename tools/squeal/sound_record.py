"""Sound of a motion that is no cycle, from its record on shapes: the Rayleigh integral of sound_field at every frequency of
the record, back in time, so that levels have means over time with their error bars.

The ends of the record are faded, since its transform would join them. What they sound like is left out.
"""

import numpy as np
from squeal.sound_field import AUDIBLE, BANDS, C, REFERENCE, RHO, a_weight

FADE = 0.05  # part of the record at each end
STUDENT = {8: 2.365, 16: 2.131, 32: 2.040}  # t of 95 % by the number of batches
LINES = 12  # strongest ones that are named


def _between(grid, values, at):
    """Values on an even grid, one row a point, between its points: cubic, through the four nearest."""
    place = (at - grid[0]) / (grid[1] - grid[0])
    first = np.clip(np.floor(place).astype(int) - 1, 0, len(grid) - 4)
    x = (place - first)[:, None]
    weights = (-(x - 1) * (x - 2) * (x - 3) / 6, x * (x - 2) * (x - 3) / 2, -x * (x - 1) * (x - 3) / 2, x * (x - 1) * (x - 2) / 6)
    return sum(weight * values[first + k] for k, weight in enumerate(weights))


def transfer(radiator, shapes, frequency):
    """Complex pressure [Pa] at each frequency of each shape as a velocity [m/s], less the factor e^(-i k R_0), and R_0 [m].

    The phase of each shape then turns slowly with frequency: 25 points where the farthest turns once are enough."""
    distance, flux = radiator.sources(shapes)
    middle, spread = (distance.min() + distance.max()) / 2, (distance.max() - distance.min()) / C
    step = min(frequency[-1] / 8, 0.04 / max(spread, 1e-9)) if len(frequency) > 1 else 1
    grid = np.arange(0, frequency[-1] + 4 * step, step)
    values = np.empty((len(grid), flux.shape[1]), complex)
    for k, f in enumerate(grid):
        turn = 2 * np.pi * f / C * (distance - middle)
        values[k] = 1j * f * RHO * (np.cos(turn) @ flux - 1j * (np.sin(turn) @ flux))
    return _between(grid, values, frequency), middle


class Heard:
    """Sound pressure in time [Pa] of coordinates q (sample, shape) at even steps [s], without the ends of the record."""

    def __init__(self, radiator, shapes, q, step):
        self.step = step
        fade = round(FADE * len(q))
        if fade < 8:
            raise ValueError("the record is too short")
        ramp = np.sin(np.pi / 2 * (np.arange(fade) + 0.5) / fade) ** 2
        window = np.concatenate([ramp, np.ones(len(q) - 2 * fade), ramp[::-1]])
        distance = radiator.sources(shapes[:1])[0]
        delays = [int(np.floor(distance.min() / C / step)), int(np.ceil(distance.max() / C / step))]
        self._length = len(q) + delays[1] + fade
        frequency = np.fft.rfftfreq(self._length, step)
        self.highest = min(AUDIBLE, 0.9 * frequency[-1])
        kept = frequency <= self.highest
        self._frequency = frequency
        response, middle = transfer(radiator, shapes, frequency[kept])
        spectrum = np.fft.rfft(q * window[:, None], self._length, axis=0)[kept]
        self._pressure = np.zeros(len(frequency), complex)
        self._pressure[kept] = (response * spectrum).sum(axis=1) * np.exp(-2j * np.pi * frequency[kept] * middle / C)
        self._inner = slice(delays[1] + fade, delays[0] + len(q) - fade)
        if self._inner.stop - self._inner.start < 64:
            raise ValueError("the record is too short")

    def _in_time(self, factor):
        return np.fft.irfft(self._pressure * factor, self._length)[self._inner]

    def pressure(self):
        return self._in_time(1)

    def sampled(self, rate):
        """At another rate [Hz], between points eight times as dense as the record's."""
        dense = 8 * np.fft.irfft(self._pressure, 8 * self._length)[8 * self._inner.start : 8 * self._inner.stop]
        time = np.arange(int(len(dense) / 8 * self.step * rate)) / rate
        return np.interp(time, np.arange(len(dense)) * self.step / 8, dense)

    def weighted(self):
        factor = np.zeros(len(self._frequency))
        factor[1:] = 10 ** (a_weight(self._frequency[1:]) / 20)
        return self._in_time(factor)

    def third_octaves(self):
        """Pressure in time within each band of BANDS; None of those where no wave of the record fits in."""
        place = np.full(len(self._frequency), np.inf)
        place[1:] = np.round(10 * np.log10(self._frequency[1:] / 1000))
        seconds = self.step * (self._inner.stop - self._inner.start)
        for band in BANDS:
            width = 1000 * 10 ** (band / 10) * (10**0.05 - 10**-0.05)
            yield self._in_time(place == band) if width * seconds >= 8 and (place == band).any() else None

    def lines(self):
        """Frequencies [Hz] and amplitudes [Pa] of the strongest lines, refined between the points by the Hann window's shape."""
        signal = self.pressure()
        window = np.hanning(len(signal) + 1)[:-1]
        amplitude = 2 * np.abs(np.fft.rfft(signal * window)) / window.sum()
        peaks = np.flatnonzero((amplitude[1:-1] > amplitude[:-2]) & (amplitude[1:-1] >= amplitude[2:])) + 1
        peaks = peaks[amplitude[peaks] > 1e-2 * amplitude.max()]
        peaks = peaks[np.argsort(-amplitude[peaks])][:LINES]
        side = np.where(amplitude[peaks + 1] > amplitude[peaks - 1], 1, -1)
        ratio = amplitude[peaks + side] / amplitude[peaks]
        away = np.clip((2 * ratio - 1) / (ratio + 1), 0, 0.5)
        height = np.pi * away * (1 - away**2) / np.sin(np.pi * np.maximum(away, 1e-9))
        return (peaks + side * away) / (len(signal) * self.step), amplitude[peaks] * np.where(away > 1e-9, height, 1)


def mean_level(signal):
    """Level [dB] of the mean square, and the ends of its bar of 95 %: by means of 8, 16 and 32 batches, the widest. The lower
    end is -inf where the bar is longer than the mean."""
    squares = signal**2
    mean, bar = squares.mean(), 0
    for count, t in STUDENT.items():
        batches = squares[: len(squares) // count * count].reshape(count, -1).mean(axis=1)
        bar = max(bar, t * batches.std(ddof=1) / np.sqrt(count))
    return tuple(10 * np.log10(value / REFERENCE**2) if value > 0 else -np.inf for value in (mean, mean - bar, mean + bar))


def repeated(signal, count):
    """The signal again and again, `count` samples: each end goes over to where the beginning resembles it most."""
    overlap = len(signal) // 8
    tail = signal[-overlap:]
    size = 1 << (4 * overlap).bit_length()
    likeness = np.fft.irfft(np.fft.rfft(signal[: 2 * overlap], size) * np.conj(np.fft.rfft(tail, size)), size)[:overlap]
    energy = np.concatenate([[0], np.cumsum(signal[: 2 * overlap] ** 2)])
    start = int(np.argmax(likeness / np.sqrt(energy[overlap : 2 * overlap] - energy[:overlap] + 1e-300)))
    rising = (np.arange(overlap) + 0.5) / overlap
    joint = tail * (1 - rising) + signal[start : start + overlap] * rising
    once = np.concatenate([joint, signal[start + overlap : -overlap]])
    whole = np.concatenate([signal[:-overlap], np.tile(once, 1 + max(0, count - len(signal)) // len(once) + 1)])
    return whole[:count]
