"""tools/sound: the Rayleigh integral against closed forms, levels, and the spectrum of sound.wav against the probe's."""

import re
import subprocess
import sys
import wave

import numpy as np
import pytest
from conftest import INPUTS, ROOT

sys.path.insert(0, str(ROOT / "tools"))
import plot_spectra  # noqa: E402
import sound_field  # noqa: E402
import squeal  # noqa: E402
from sound_field import C, RHO  # noqa: E402

RADIUS = 0.1  # [m] of the piston


def piston(rings, corners=72):
    """Nodes and faces of a disc in z = 0 that looks along z: the middle is a fan of triangles.

    Its polygon has as much area as the circle."""
    radius = RADIUS * np.sqrt(2 * np.pi / corners / np.sin(2 * np.pi / corners))
    turns = 2 * np.pi * np.arange(corners) / corners
    nodes = [(0, 0, 0)] + [(radius * r / rings * np.cos(t), radius * r / rings * np.sin(t), 0) for r in range(1, rings + 1) for t in turns]
    at = lambda ring, k: 1 + (ring - 1) * corners + k % corners
    faces = [[0, at(1, k), at(1, k + 1)] for k in range(corners)]
    faces += [[at(r, k), at(r + 1, k), at(r + 1, k + 1), at(r, k + 1)] for r in range(1, rings) for k in range(corners)]
    return np.array(nodes, float), faces


def on_axis(speed, f, z):
    """Modulus of the pressure on the axis of a baffled piston, by its closed form."""
    return 2 * RHO * C * speed * abs(np.sin(np.pi * f / C * (np.hypot(z, RADIUS) - z)))


def moving(nodes, speed):
    return np.column_stack([np.zeros((len(nodes), 2)), np.full(len(nodes), speed)]).astype(complex)


@pytest.mark.parametrize("f, z", [(100, 0.5), (1000, 0.05), (1000, 2), (3000, 0.1), (3000, 0.5), (8000, 0.5), (8000, 0.9), (15000, 1)])
def test_a_baffled_piston_on_its_axis(f, z):
    """To 1 %; ka from 0.2 to 27. A coarse mesh is cut as finely as the wavelength asks."""
    nodes, faces = piston(4)
    radiator = sound_field.Radiator(nodes, faces, [], (0, 0, z), f)
    assert abs(radiator.pressure(moving(nodes, 2e-3), 2 * np.pi * f)) == pytest.approx(on_axis(2e-3, f, z), rel=0.01)


@pytest.mark.parametrize("f, angle", [(1000, 40), (3000, 30), (5000, 20), (5000, 50)])
def test_the_directivity_of_a_piston_far_away(f, angle):
    """i rho c k a^2 V / 2 r * 2 J1(x)/x with x = k a sin(angle), at 60 m, to 1 % of the value on the axis."""
    from scipy.special import j1

    nodes, faces = piston(6)
    theta, r, k = np.radians(angle), 60.0, 2 * np.pi * f / C
    place = r * np.array([np.sin(theta), 0, np.cos(theta)])
    p = sound_field.Radiator(nodes, faces, [], place, f).pressure(moving(nodes, 1e-3), 2 * np.pi * f)
    front = RHO * C * k * RADIUS**2 * 1e-3 / (2 * r)
    x = k * RADIUS * np.sin(theta)
    assert abs(p) == pytest.approx(front * abs(2 * j1(x) / x), abs=0.01 * front)


def test_what_looks_away_is_silent_and_shells_have_two_sides():
    nodes, faces = piston(4)
    behind = sound_field.Radiator(nodes, faces, [], (0, 0, -0.5), 3000)
    assert behind.pressure(moving(nodes, 1e-3), 2 * np.pi * 3000) == 0
    shell = sound_field.Radiator(nodes, [], faces, (0, 0, -0.5), 3000)
    assert abs(shell.pressure(moving(nodes, 1e-3), 2 * np.pi * 3000)) == pytest.approx(on_axis(1e-3, 3000, 0.5), rel=0.01)


def test_levels_and_weights():
    """1 Pa of root mean square is 94.0 dB; A-weights of IEC 61672's table to 0.1 dB; a tone falls into its band."""
    assert sound_field.level(np.array([np.sqrt(2)])) == pytest.approx(93.979, abs=1e-3)
    for f, weight in {31.5: -39.4, 100: -19.1, 1000: 0.0, 2500: 1.3, 4000: 1.0, 10000: -2.5, 20000: -9.3}.items():
        exact = 1000 * 10 ** (np.round(10 * np.log10(f / 1000)) / 10)  # of which the table's are names
        assert sound_field.a_weight(exact) == pytest.approx(weight, abs=0.11)
    bands = sound_field.third_octaves(np.array([3192.0, 6384.0]), np.array([np.sqrt(2), np.sqrt(2)]))
    heard = {sound_field.NAMES[k]: bands[k] for k in np.flatnonzero(np.isfinite(bands))}
    assert heard == {"3.15k": pytest.approx(93.979, abs=1e-3), "6.3k": pytest.approx(93.979, abs=1e-3)}


def lines_of(file, frequencies):
    """Amplitudes of the .wav at these frequencies, in parts of full scale, under a flat window in the middle."""
    with wave.open(str(file)) as sound:
        rate, samples = sound.getframerate(), np.frombuffer(sound.readframes(sound.getnframes()), "<i2") / 32767
    middle = samples[len(samples) // 10 : -len(samples) // 10]
    window = np.hanning(len(middle))
    time = np.arange(len(middle)) / rate
    return np.array([2 * abs((middle * window * np.exp(-2j * np.pi * f * time)).sum()) / window.sum() for f in frequencies])


def test_the_spectrum_of_the_wave_is_the_probes_times_the_piston(tmp_path):
    """A piston that moves as a probe does, with four harmonics: each line of the .wav over that of the probe's spectrum is
    the closed form to 1 %."""
    period, z, n = 1 / 2431.7, 0.4, 64
    time = period * np.arange(1, n + 1) / n
    turns = 2 * np.pi * time / period
    probe = 1e-6 * (np.cos(turns) + 0.2 * np.sin(2 * turns) + 0.05 * np.cos(3 * turns + 1) + 0.02 * np.cos(5 * turns))
    nodes, faces = piston(4)
    motion = np.zeros((n, len(nodes), 3))
    motion[:, :, 2] = probe[:, None]
    velocity = sound_field.harmonics_of(time, motion, period)
    heard = [0, 1, 2, 4]  # harmonics 1, 2, 3 and 5
    frequency = np.arange(1, 9) / period
    radiator = sound_field.Radiator(nodes, faces, [], (0, 0, z), frequency[-1])
    pressure = np.array([radiator.pressure(velocity[k], 2 * np.pi * frequency[k]) for k in range(8)])
    scale = sound_field.write_wave(tmp_path / "sound.wav", frequency, pressure, 2)
    found = scale * lines_of(tmp_path / "sound.wav", frequency)
    expected, amplitude = plot_spectra.harmonics(probe, period)
    assert expected[:8] == pytest.approx(frequency, rel=1e-12)
    for k in heard:
        assert found[k] / abs(amplitude[k]) == pytest.approx(on_axis(1, frequency[k], z), rel=0.01)
    assert max(found[k] for k in range(8) if k not in heard) < 1e-3 * found[0]  # 16 bits and their fades


def test_a_run_sounds_at_the_harmonics_of_its_cycle(tmp_path):
    run = squeal.run(INPUTS / "pin_on_disc", {"mesh.parameters.divisions": 2, "damping.beta": 6e-7, "cycle.steps_per_period": 40,
                                              "mesh.parameters.pin_height": 0.035},
                     options=["-cycle_multipliers", "0"], output=tmp_path / "run")
    f0 = run.report["cycle"]["frequency_hz"]
    done = subprocess.run([sys.executable, ROOT / "tools" / "sound", run.folder, "--at", "0.09", "0", "0.4", "--seconds", "1"],
                          capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert f0 < sound_field.AUDIBLE
    levels = {float(f): float(db) for f, db in re.findall(r"^ +([\d.]+) Hz +([-\d.]+) dB$", done.stdout, re.M)}
    assert list(levels) == pytest.approx(f0 * np.arange(1, len(levels) + 1), abs=0.1)
    scale = float(re.search(r"Full scale of sound.wav is (\S+) Pa", done.stdout)[1])
    found = scale * lines_of(run.folder / "sound.wav", f0 * np.arange(1, len(levels) + 1))
    loudest = max(levels.values())
    for amplitude, db in zip(found, levels.values()):
        if db > loudest - 50:  # what 16 bits hold well
            assert 20 * np.log10(amplitude / np.sqrt(2) / 20e-6) == pytest.approx(db, abs=0.1)
    assert "rigid plane" in (run.folder / "sound.txt").read_text() and (run.folder / "sound.png").exists()
