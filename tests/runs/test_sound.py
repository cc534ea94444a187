"""tools/sound: the Rayleigh integral against closed forms, levels, and the spectrum of sound.wav against the probe's."""

import re
import subprocess
import sys
import wave

import numpy as np
import pytest
from conftest import INPUTS, ROOT

sys.path.insert(0, str(ROOT / "tools"))
from squeal import plot_spectra  # noqa: E402
from squeal import sound_field  # noqa: E402
from squeal import sound_record  # noqa: E402
import squeal  # noqa: E402
from squeal.sound_field import C, RHO  # noqa: E402

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
    scale = sound_field.write_wave(tmp_path / "sound.wav", sound_field.tones(frequency, pressure, 2))
    found = scale * lines_of(tmp_path / "sound.wav", frequency)
    expected, amplitude = plot_spectra.harmonics(probe, period)
    assert expected[:8] == pytest.approx(frequency, rel=1e-12)
    for k in heard:
        assert found[k] / abs(amplitude[k]) == pytest.approx(on_axis(1, frequency[k], z), rel=0.01)
    assert max(found[k] for k in range(8) if k not in heard) < 1e-3 * found[0]  # 16 bits and their fades


def torus(time):
    """Velocity [m/s] of a motion of two frequencies, and its tones [Hz] with their amplitudes."""
    tones = {2431.7: 1e-3, 2431.7 - 171.3: 3e-4, 2431.7 + 171.3: 2e-4, 4863.4: 1e-4, 171.3: 5e-5}
    return sum(v * np.cos(2 * np.pi * f * time + k) for k, (f, v) in enumerate(tones.items())), tones


def recorded_piston(seconds, z, step=1 / 100e3):
    """The sound in time of a piston that moves as the torus, recorded on two shapes of which one is a rotation of no flux."""
    nodes, faces = piston(6)
    v, tones = torus(step * np.arange(round(seconds / step)))
    tilt = np.column_stack([np.zeros((len(nodes), 2)), nodes[:, 0]])
    heard = sound_record.Heard(sound_field.Radiator(nodes, faces, [], (0, 0, z), 20000), np.stack([moving(nodes, 1).real, tilt]),
                               np.column_stack([v, 0.1 * v]), step)
    return heard, tones


def test_the_record_of_a_torus_sounds_as_its_tones_through_the_piston(tmp_path):
    """Each line of the record and of its .wav is that of the velocity by the closed form, to 1 %; levels are sums of
    tones, to 0.1 dB. Neither lines of sum nor of difference appear."""
    z = 0.3
    heard, tones = recorded_piston(0.7, z)
    wanted = {f: on_axis(v, f, z) for f, v in tones.items()}
    found = dict(zip(*heard.lines()))
    for f, p in wanted.items():
        if p > 0.02 * max(wanted.values()):
            nearest = min(found, key=lambda g: abs(g - f))
            assert nearest == pytest.approx(f, abs=0.02) and found[nearest] == pytest.approx(p, rel=0.01)
    scale = sound_field.write_wave(tmp_path / "sound.wav", sound_record.repeated(heard.sampled(sound_field.RATE), 2 * sound_field.RATE))
    once = scale * lines_of(tmp_path / "sound.wav", list(wanted))
    assert once[0] == pytest.approx(wanted[2431.7], rel=0.02)  # the joints cost the rest some of their length
    sums = np.array(list(wanted.values()))
    weights = 10 ** (sound_field.a_weight(np.array(list(wanted))) / 20)
    for signal, amplitudes in ((heard.pressure(), sums), (heard.weighted(), sums * weights)):
        level, low, high = sound_record.mean_level(signal)
        assert level == pytest.approx(sound_field.level(amplitudes), abs=0.1) and low <= level <= high < level + 1
    bands = [band if band is None else sound_record.mean_level(band)[0] for band in heard.third_octaves()]
    of = dict(zip(sound_field.NAMES, bands))
    assert of["2.5k"] == pytest.approx(sound_field.level(sums[:3]), abs=0.1)
    assert of["5k"] == pytest.approx(sound_field.level(sums[3:4]), abs=0.1)
    assert of["160"] == pytest.approx(sound_field.level(sums[4:]), abs=0.1)
    assert max(of[name] for name in ("500", "1k", "10k")) < of["2.5k"] - 50 and of["20"] is None


def test_levels_that_vary_have_bars_that_hold_other_records():
    """Noise of one level in 40 records: the bar of 95 % of one holds the mean of all, in 33 of them at least."""
    random = np.random.default_rng(1)
    slow = np.exp(np.convolve(random.normal(size=42000), np.ones(2000) / 45, "valid"))[:40000]  # correlated over 2000 samples
    records = [np.roll(slow, k) * random.normal(size=40000) for k in range(0, 40000, 1000)]
    records = [r * np.exp(0.3 * np.repeat(random.normal(size=80), 500)) for r in records]
    levels = [sound_record.mean_level(r) for r in records]
    middle = 10 * np.log10(np.mean([np.mean(r**2) for r in records]) / sound_field.REFERENCE**2)
    assert sum(low <= middle <= high for _, low, high in levels) >= 33


def levels_of(folder):
    """Of all and A-weighted [dB], and by third octaves, from sound.txt that the tool has just written."""
    done = subprocess.run([sys.executable, ROOT / "tools" / "sound", folder, "--seconds", "1"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    numbers = re.findall(r"([\d.]+) dB", done.stdout.splitlines()[0])
    bands = {name: float(db) for name, db in re.findall(r"^ +(\S+) Hz third octave +([\d.]+) dB", done.stdout, re.M)}
    return float(numbers[0]), float(numbers[1]), bands, done.stdout


PIN = {"modes.method": "full", "cycle.steps_per_period": 60}


@pytest.fixture(scope="module")
def cycle(tmp_path_factory):
    """The pin's cycle, which attracts."""
    return squeal.run(INPUTS / "pin_on_disc", PIN | {"transient.enabled": False}, options=["-cycle_multipliers", "0"],
                      output=tmp_path_factory.mktemp("pin") / "cycle")


def test_a_settled_periodic_motion_is_as_loud_as_the_cycle(tmp_path, cycle):
    """A search that is cut short goes on from beside it: levels are the cycle's to 0.3 dB, since slow
    modes still decay."""
    near = {"transient.start": "estimate", "transient.periods": 100, "transient.steps_per_period": 60, "cycle.start": "transient",
            "fidelity": "full", "cycle.tolerance": 1e-10}
    settled = squeal.run(INPUTS / "pin_on_disc", PIN | near, output=tmp_path / "settled", options=[
        "-cycle_multipliers", "0", "-cycle_free_periods", "6", "-cycle_max_periods", "12", "-settled_periods", "64", "-settled_exponents", "1"])
    entry = settled.report["settled"]
    assert entry["outcome"] == "settled" and entry["shapes"] > 10 and entry["energy_beside_shapes"] < 1e-3
    time, coordinates, shapes = settled.settled_shapes()
    assert len(time) == 64 * 20 and time[-1] == settled.series("settled", "time")[-1]
    weighted, whole, bands, text = levels_of(settled.folder)
    of_cycle = levels_of(cycle.folder)
    assert weighted == pytest.approx(of_cycle[0], abs=0.3) and whole == pytest.approx(of_cycle[1], abs=0.3)
    for name, level in of_cycle[2].items():
        if level > of_cycle[1] - 20:
            assert bands[name] == pytest.approx(level, abs=0.3)
    assert "Levels are means over" in text and "rigid plane" in text


def test_a_run_sounds_at_the_harmonics_of_its_cycle(cycle):
    f0 = cycle.report["cycle"]["frequency_hz"]
    done = subprocess.run([sys.executable, ROOT / "tools" / "sound", cycle.folder, "--at", "0.09", "0", "0.4", "--seconds", "1"],
                          capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert f0 < sound_field.AUDIBLE
    levels = {float(f): float(db) for f, db in re.findall(r"^ +([\d.]+) Hz +([-\d.]+) dB$", done.stdout, re.M)}
    assert list(levels) == pytest.approx(f0 * np.arange(1, len(levels) + 1), abs=0.1)
    scale = float(re.search(r"Full scale of sound.wav is (\S+) Pa", done.stdout)[1])
    found = scale * lines_of(cycle.folder / "sound.wav", f0 * np.arange(1, len(levels) + 1))
    loudest = max(levels.values())
    for amplitude, db in zip(found, levels.values()):
        if db > loudest - 50:  # what 16 bits hold well
            assert 20 * np.log10(amplitude / np.sqrt(2) / 20e-6) == pytest.approx(db, abs=0.1)
    assert "rigid plane" in (cycle.folder / "sound.txt").read_text() and (cycle.folder / "sound.png").exists()


def test_what_is_inside_a_body():
    """Two cubes that share a face: their middles, the face between them and the outer ones."""
    from squeal import surface

    cube = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], float)
    nodes = np.concatenate([cube + (0, 0, z) for z in range(3)])
    faces, _ = surface.faces(np.array([9, *range(8), 9, *range(4, 12)]))
    for place, expected in (((0.5, 0.5, 0.5), True), ((0.3, 0.6, 1), True), ((0.3, 0.6, 2), True), ((0.5, 0.5, 2.01), False), ((5, 0.2, 1), False)):
        assert sound_field.inside(nodes, faces, place) == expected, place


@pytest.mark.parametrize("words, message", [
    (["--at", "0", "0", "nan"], "--at nan is no number"), (["--at", "0", "inf", "0"], "--at inf"), (["--seconds", "-1"], "--seconds -1 is no number"),
    (["--seconds", "nan"], "--seconds nan")])
def test_numbers_that_mean_nothing_are_refused(tmp_path, words, message):
    done = subprocess.run([sys.executable, ROOT / "tools" / "sound", tmp_path, *words], capture_output=True, text=True)
    assert done.returncode == 1 and message in done.stderr and done.stderr.count("\n") == 1 and not list(tmp_path.iterdir())
