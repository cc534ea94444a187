"""Sound of a vibrating surface at a microphone, by the Rayleigh integral: of each harmonic of angular frequency omega,

    p = i omega rho / 2 pi  *  integral of v_n exp(-i k R) / R over the surface,     k = omega / c,

with v_n the normal velocity and R the distance to the microphone. It is exact for a plane surface in a rigid baffle.
"""

import wave

import numpy as np
from squeal.surface import triangles

RHO, C = 1.204, 343.2  # [kg/m3], [m/s] of air at 20 degrees Celsius
REFERENCE = 20e-6  # [Pa] of sound pressure levels
AUDIBLE = 20000.0  # [Hz]
RATE = 48000  # [Hz] of sound.wav
PARTS = 4  # a wavelength is at least so many sides of a triangle with one quadrature
BANDS = np.arange(-17, 14)  # third octaves about 1000 * 10^(n/10) Hz: 20 Hz to 20 kHz
NAMES = ("20", "25", "31.5", "40", "50", "63", "80", "100", "125", "160", "200", "250", "315", "400", "500", "630", "800",
         "1k", "1.25k", "1.6k", "2k", "2.5k", "3.15k", "4k", "5k", "6.3k", "8k", "10k", "12.5k", "16k", "20k")


def _points(parts):
    """Barycentric coordinates of a triangle's quadrature, and their weights: the middles of the sides of parts^2 smaller
    triangles, exact for quadratic functions."""
    corners = [((i, j), (i + 1, j), (i, j + 1)) for i in range(parts) for j in range(parts - i)]
    corners += [((i + 1, j), (i + 1, j + 1), (i, j + 1)) for i in range(parts) for j in range(parts - i - 1)]
    corners = np.array(corners) / parts
    middles = ((corners + np.roll(corners, -1, axis=1)) / 2).reshape(-1, 2)
    places, count = np.unique(middles.round(12), axis=0, return_counts=True)
    return np.column_stack([1 - places.sum(axis=1), places]), count / count.sum()


class Radiator:
    """Points on the faces that a microphone sees, and how nodes' velocities come to them."""

    def __init__(self, nodes, faces, shells, microphone, highest):
        """faces: outward ones; shells have two sides, of which the near one counts; highest: frequency [Hz]."""
        self.faces = [*faces, *shells]
        corners = np.concatenate([triangles(nodes[rim]) for rim in self.faces])
        area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
        towards = np.asarray(microphone, float) - corners.mean(axis=1)
        facing = np.einsum("ni,ni->n", area, towards)
        is_shell = np.array([k >= len(faces) for k, rim in enumerate(self.faces) for _ in rim])
        area[is_shell & (facing < 0)] *= -1
        longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        parts = np.maximum(1, np.ceil(longest * PARTS * highest / C)).astype(int)
        self.groups = []  # of triangles that are cut into as many parts: which, area vectors, coordinates, weights, distances
        for count in np.unique(parts):
            which = np.flatnonzero((parts == count) & ((facing > 0) | is_shell))
            coordinates, weights = _points(count)
            points = np.einsum("qc,nci->nqi", coordinates, corners[which])
            distance = np.linalg.norm(microphone - points, axis=2)
            self.groups.append((which, area[which], coordinates, weights, distance))

    def sources(self, shapes):
        """Of all points of the quadrature: distances [m], and of real shapes (shape, node, component) what each point adds to
        the integral of v_n / R, as (point, shape)."""
        distances, fluxes = [], []
        corners = np.stack([np.concatenate([triangles(shape[rim]) for rim in self.faces]) for shape in shapes], axis=-1)
        for which, area, coordinates, weights, distance in self.groups:
            flux = np.einsum("ncis,ni,qc->nqs", corners[which], area, coordinates, optimize=True) * (weights / distance)[:, :, None]
            distances.append(distance.ravel())
            fluxes.append(flux.reshape(-1, len(shapes)))
        return np.concatenate(distances), np.concatenate(fluxes)

    def pressure(self, velocity, omega):
        """Complex amplitude [Pa] of nodes' complex velocities (node, component) [m/s]."""
        corners = np.concatenate([triangles(velocity[rim]) for rim in self.faces])
        total = 0
        for which, area, coordinates, weights, distance in self.groups:
            flux = np.einsum("nci,ni->nc", corners[which], area) @ coordinates.T
            total += ((flux * np.exp(-1j * omega / C * distance) / distance) @ weights).sum()
        return 1j * omega * RHO / (2 * np.pi) * total


def inside(nodes, faces, place):
    """Whether a place is within closed outer faces, or on them: their solid angle there is 4 pi, 2 pi on a face, outside 0."""
    if not faces:
        return False
    a, b, c = np.moveaxis(np.concatenate([triangles(nodes[rim]) for rim in faces]) - np.asarray(place, float), 1, 0)
    x, y, z = (np.linalg.norm(side, axis=1) for side in (a, b, c))
    dot = lambda p, q: np.einsum("ni,ni->n", p, q)
    volume = dot(a, np.cross(b, c))  # van Oosterom and Strackee
    angle = 2 * np.arctan2(volume, x * y * z + dot(a, b) * z + dot(a, c) * y + dot(b, c) * x)
    return bool(abs(angle.sum()) > np.pi)


def harmonics_of(time, motion, period):
    """Complex amplitudes of velocity (harmonic, node, component) of displacements at times over one period, by least
    squares on the harmonics that this many samples tell apart."""
    count = max(1, len(time) // 2 - 1)
    phase = 2 * np.pi * np.outer(time / period, np.arange(1, count + 1))
    base = np.concatenate([np.ones((len(time), 1)), np.cos(phase), np.sin(phase)], axis=1)
    found = np.linalg.lstsq(base, motion.reshape(len(time), -1), rcond=None)[0].reshape(-1, *motion.shape[1:])
    amplitude = found[1 : count + 1] - 1j * found[count + 1 :]
    return amplitude * (2j * np.pi * np.arange(1, count + 1) / period)[:, None, None]


def a_weight(frequency):
    """[dB], by IEC 61672."""
    f2 = np.asarray(frequency, float) ** 2
    response = 12194.0**2 * f2**2 / ((f2 + 20.6**2) * np.sqrt((f2 + 107.7**2) * (f2 + 737.9**2)) * (f2 + 12194.0**2))
    return 20 * np.log10(response) + 2.0


def level(pressure):
    """[dB] of the root mean square of complex amplitudes together."""
    return 10 * np.log10(max(np.sum(np.abs(pressure) ** 2) / 2, 1e-300) / REFERENCE**2)


def third_octaves(frequency, pressure):
    """Level of each band of BANDS [dB]; nan where nothing sounds."""
    place = np.round(10 * np.log10(np.asarray(frequency) / 1000))
    return np.array([level(pressure[place == band]) if (place == band).any() else np.nan for band in BANDS])


def tones(frequency, pressure, seconds):
    """Sound pressure in time [Pa] of complex amplitudes, at RATE."""
    time = np.arange(round(seconds * RATE)) / RATE
    return sum((p * np.exp(2j * np.pi * f * time)).real for f, p in zip(frequency, pressure))


def write_wave(file, signal):
    """A signal at RATE as 16 bits, faded in and out; returns the pressure [Pa] of full scale, twice the peak."""
    time = np.arange(len(signal)) / RATE
    scale = 2 * np.abs(signal).max()
    fade = np.minimum(1, np.minimum(time, time[::-1]) / 0.05)
    samples = np.round(signal / scale * np.sin(np.pi / 2 * fade) ** 2 * 32767).astype("<i2")
    with wave.open(str(file), "wb") as out:
        out.setnchannels(1)
        out.setsampwidth(2)
        out.setframerate(RATE)
        out.writeframes(samples.tobytes())
    return scale
