"""tools/plot: its measures on motions known in closed form, its maps and labels, its formats, several runs at once."""

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import INPUTS, ROOT

sys.path.insert(0, str(ROOT / "tools"))
from squeal import plot_basis  # noqa: E402
from squeal import plot_captions  # noqa: E402
from squeal import plot_response  # noqa: E402
from squeal import plot_spectra  # noqa: E402
from squeal import surface  # noqa: E402
from matplotlib.text import Text  # noqa: E402


def plot(*words):
    done = subprocess.run([sys.executable, ROOT / "tools" / "plot", *map(str, words)], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_levels_of_a_sampled_cycle():
    """An amplitude of 1 mm/s is 117.0 dB re 1 nm/s; the mean and the phase do not count."""
    period, n = 0.4e-3, 64
    time = np.arange(n) * period / n
    speeds = {1: 1e-3, 3: 2e-5}
    values = 5e-6 + sum(v * period / (2 * np.pi * k) * np.cos(2 * np.pi * k * time / period + k) for k, v in speeds.items())
    frequency, amplitude = plot_spectra.harmonics(values, period)
    assert frequency[:3] == pytest.approx([2500, 5000, 7500], rel=1e-12)
    for k, v in speeds.items():
        assert abs(amplitude[k - 1]) == pytest.approx(v, rel=1e-9)
    assert plot_spectra.decibel(amplitude[0]) == pytest.approx(20 * np.log10(1e-3 / np.sqrt(2) / 1e-9), abs=1e-6)
    assert np.abs(amplitude[[1, *range(3, len(amplitude))]]).max() < 1e-12


def test_a_windowed_spectrum_and_a_spectrogram_find_the_line():
    step, f = 1e-5, 3150.0
    time = step * np.arange(8000)
    values = 3 + 1e-6 * np.sin(2 * np.pi * f * time)
    frequency, amplitude = plot_spectra.windowed(values, step)
    at = amplitude.argmax()
    assert frequency[at] == pytest.approx(f, abs=1 / (8000 * step))
    # f lies on a point of the spectrum, so that the Hann window keeps the amplitude
    assert amplitude[at] == pytest.approx(2 * np.pi * f * 1e-6, rel=1e-3)
    _, frequency, power = plot_spectra.framed(values, step, 1 / f)
    assert frequency[power.argmax(axis=1)] == pytest.approx(f, rel=0.03)  # ten periods resolve a tenth; padded four times


class Drifting:
    """A run that settles: its holder drifts, and its pin swings at 4 kHz."""
    title, report, step = "drift", {}, 1e-5

    def stage(self, name):
        if name != "settled":
            raise plot_spectra.Missing(name)

    def series(self, _, name):
        return self.step * np.arange(4000)

    def probes(self, _):
        time = self.series("settled", "time")
        return {"holder": 3e-4 * np.sin(2 * np.pi * 25 * time), "pin": 1e-4 * np.sin(2 * np.pi * 4000 * time)}


def test_a_spectrogram_is_of_the_probe_that_swings_most_within_a_period():
    """Not of one that drifts further over all of them; a probe that is asked for is shown."""
    *_, period, words = plot_spectra.spectrogram_of(Drifting(), "probe")
    assert period == pytest.approx(1 / 4000) and words == "velocity of pin"
    assert plot_spectra.draw_spectrogram([Drifting()], "probe").axes[0].get_title() == "drift: spectrogram, velocity of pin"
    assert plot_spectra.spectrogram_of(Drifting(), "holder")[-1] == "velocity of holder"


class Shifted:
    """A run whose probe's first harmonic is largest at a step of 64."""

    def __init__(self, step):
        turns = 2 * np.pi * (np.arange(64) - step) / 64
        self.values = 3 + np.cos(turns) + 0.3 * np.sin(2 * turns)

    def probes(self, _):
        return {"still": np.zeros(64), "pin": self.values}


@pytest.mark.parametrize("step", [0, 1, 17, 63])
def test_cycles_that_are_compared_start_alike(step):
    runs = [Shifted(0), Shifted(step)]
    assert [plot_basis.start_of(run, runs) for run in runs] == [0, step]
    assert np.roll(runs[1].values, -step) == pytest.approx(runs[0].values)
    assert plot_basis.start_of(runs[1], runs[1:]) == 0  # alone


def test_labels_keep_apart():
    """Places at least a gap apart, in order, within the axes while there is room; far ones stay where they are."""
    random = np.random.default_rng(1)
    for _ in range(200):
        places = np.sort(random.uniform(0.4, 0.6, random.integers(1, 13)))
        spread = plot_basis.spread(places, 0.06)
        assert (np.diff(spread) >= 0.06 - 1e-12).all()
        assert spread[0] >= 0 and spread[-1] <= 1 + 1e-12
    assert plot_basis.spread([0.1, 0.5, 0.9], 0.06) == pytest.approx([0.1, 0.5, 0.9])


def test_labels_of_many_modes_do_not_overlap():
    """Twelve modes nearly on one point: no two texts share a pixel."""
    figure, axes = plot_basis.plt.subplots(figsize=(9, 4.8))
    axes.plot([0, 10], [-5, 5])
    plot_basis.label_column(axes, [(4 + 0.01 * k, 2 + 0.001 * k) for k in range(12)], [f"{k}: 3197.8 Hz, +12.6 1/s" for k in range(12)])
    figure.canvas.draw()
    boxes = sorted((Text.get_window_extent(text) for text in axes.texts), key=lambda box: box.y0)
    assert len(boxes) == 12
    assert all(below.y1 <= above.y0 for below, above in zip(boxes, boxes[1:]))


class Ended:
    """A run whose cycle ended so."""
    title = "ended"

    def __init__(self, outcome, reason=""):
        self.report = {"cycle": {"outcome": outcome, "reason": reason, "period": 1}, "model": {"pairs": 2}}

    def stage(self, name):
        if name not in self.report:
            raise plot_spectra.Missing(name)
        return self.report[name]

    def series(self, _, name):
        return {"status": np.zeros((4, 2)), "time": np.arange(4) / 4}[name]

    def probes(self, _):
        return {}

    def field(self, name):
        raise plot_spectra.Missing(name)


@pytest.mark.parametrize("run, title, closed", [
    (Ended("converged"), "limit cycle", True), (Ended("unstable cycle"), "limit cycle that repels", True),
    (Ended("settled", "unstable cycle: it repels"), "limit cycle that repels\n(not the settled motion)", True),
    (Ended("settled", "not periodic: a slow drift"), "last period of the search, not periodic\n(not the settled motion)", False),
    (Ended("not converged"), "last period of the search, not converged", False)])
def test_the_period_that_was_kept_is_called_what_it_is(run, title, closed):
    """Where the settled motion is the answer, the picture shows what the search for a cycle left."""
    from squeal import plot_motion

    assert plot_motion.draw_lift_off([run]).axes[0].get_title() == title
    assert plot_basis.is_closed(run) == closed


# One element of each kind, its nodes in VTK's order: corners of the unit cube, wedge, pyramid and tetrahedron, then middles.
CUBE = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)], float)
WEDGE = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (0, 1, 1)], float)
PYRAMID = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1)], float)
TETRA = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], float)


def with_middles(corners, edges):
    return np.concatenate([corners, [(corners[a] + corners[b]) / 2 for a, b in edges]])


@pytest.mark.parametrize("code, nodes, faces, volume, area", [
    (9, CUBE, 6, 1, 6), (48, with_middles(CUBE, surface.HEX_EDGES), 6, 1, 6), (8, WEDGE, 5, 0.5, 3 + np.sqrt(2)),
    (50, np.concatenate([with_middles(CUBE, surface.HEX_EDGES), np.full((7, 3), 9.0)]), 6, 1, 6),
    (40, with_middles(WEDGE, surface.WEDGE_EDGES), 5, 0.5, 3 + np.sqrt(2)), (7, PYRAMID, 5, 1 / 3, 2 + np.sqrt(2)),
    (39, with_middles(PYRAMID, surface.PYRAMID_EDGES), 5, 1 / 3, 2 + np.sqrt(2)),
    (6, TETRA, 4, 1 / 6, 1.5 + np.sqrt(3) / 2), (38, with_middles(TETRA, surface.TETRA_EDGES), 4, 1 / 6, 1.5 + np.sqrt(3) / 2)])
def test_the_surface_of_one_element(code, nodes, faces, volume, area):
    """Outward faces enclose its volume (Gauss), and the parts of its nodes are its area."""
    solid, shells = surface.faces(np.array([code, *range(len(nodes))]))
    assert len(solid) == faces and not shells
    parts = [triangle for rim in solid for triangle in surface.triangles(nodes[rim])]
    normals = np.array([np.cross(b - a, c - a) / 2 for a, b, c in parts])
    assert sum((np.mean(part, axis=0) @ normal) / 3 for part, normal in zip(parts, normals)) == pytest.approx(volume)
    cells = [triangle for rim in solid for cell in surface.node_cells(rim, nodes) for triangle in surface.triangles(cell)]
    assert sum(np.linalg.norm(np.cross(b - a, c - a)) / 2 for a, b, c in cells) == pytest.approx(area)


def test_elements_that_touch_share_no_outer_face():
    shifted = list(range(4, 8)) + list(range(8, 12))
    solid, _ = surface.faces(np.array([9, *range(8), 9, *shifted, 1, 1, 3]))  # two cubes and a point
    assert len(solid) == 10


class Driven:
    """A run whose ten probes are each driven."""
    title, report = "ten probes", {"response": {"residual": 1e-6}}

    def responses(self):
        return np.arange(1.0, 9), {(f"p{i}", f"p{j}"): np.ones(8) * (1 + 1j) for i in range(10) for j in range(10)}


def test_the_legend_of_responses_covers_no_curve_and_what_is_left_out_is_named():
    figure = plot_response.draw_response([Driven()])
    figure.canvas.draw()
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == [f"p{k}" for k in range(8)]
    assert all(axes.get_legend() is None and axes.get_tightbbox().y0 >= legend.get_window_extent().y1 for axes in figure.axes)
    assert figure._suptitle.get_text().endswith("not drawn: driven at p3, p4, p5, p6, p7, p8, p9, read at p8, p9")


class Symmetric(Driven):
    """A run whose transfers between two probes are rounding: all of one, and of the other at half of the frequencies."""

    def responses(self):
        h = 1e-7 * np.exp(1j * np.arange(8))
        part = h * np.where(np.arange(8) < 4, 1e-3, 1e-9)
        return np.arange(1.0, 9), {("a", "a"): h, ("a", "b"): 1e-9 * h, ("a", "c"): part}


def test_a_response_that_is_rounding_has_no_phase():
    """Nothing below the residual's part of the largest response at the frequency; the title names a curve that is nowhere."""
    figure = plot_response.draw_response([Symmetric()])
    above, below = figure.axes
    assert above.get_title() == "driven at a; beyond the axes: b"
    assert [np.isfinite(line.get_ydata()).sum() for line in below.lines] == [7, 0, 3]  # a turn is a gap
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["a", "b", "c", "within the residual's reach: no phase"]
    assert above.get_ylim()[0] == pytest.approx(-205)  # 5 dB below what is known


@pytest.fixture(scope="module")
def pins(tmp_path_factory):
    import squeal

    coarse = {"mesh.parameters.divisions": 2, "damping.beta": 6e-7, "cycle.steps_per_period": 40, "modes.method": "full"}
    return [squeal.run(INPUTS / "pin_on_disc", coarse | {"friction.coefficient": mu}, options=["-cycle_multipliers", "0"],
                       output=tmp_path_factory.mktemp(f"mu{mu}")).folder for mu in (0.3, 0.32)]


def test_formats_and_dots(pins, tmp_path):
    plot(pins[0], "--output", tmp_path, "--format", "pdf", "svg", "png", "--dpi", "50", "--only", "modes", "contact", "pressure")
    for name in ("modes", "contact", "pressure"):
        assert (tmp_path / f"{name}.pdf").read_bytes().startswith(b"%PDF")
        assert b"<svg" in (tmp_path / f"{name}.svg").read_bytes()[:2000]
        assert (tmp_path / f"{name}.png").read_bytes().startswith(b"\x89PNG")
    from PIL import Image

    assert Image.open(tmp_path / "modes.png").width == 50 * 9  # inches


def test_several_runs_are_compared(pins, tmp_path):
    """What the third lacks, and what shows one run, is said."""
    (tmp_path / "bare").mkdir()
    shutil.copy(pins[0] / "report.json", tmp_path / "bare")
    printed = plot(*pins, tmp_path / "bare", "--output", tmp_path / "out", "--only", "modes", "estimate", "spectrum", "cycle", "powers",
                   "pressure", "liftoff", "newton", "sweep", "animation")
    assert "compare_pressure lacks bare: there is no fields.h5" in printed
    assert all(f"compare_{name} left out: it shows one run" in printed for name in ("sweep", "animation"))
    names = {file.name for file in (tmp_path / "out").iterdir()}
    assert names == {f"compare_{name}.png" for name in ("modes", "estimate", "spectrum", "cycle", "powers", "pressure", "liftoff",
                                                        "newton")}, printed


def test_3d_pictures_or_a_word(pins, tmp_path):
    printed = plot(pins[0], "--output", tmp_path, "--only", "shape", "animation")
    if "need PyVista" in printed:
        assert not list(tmp_path.iterdir())
        return
    from PIL import Image

    animation = Image.open(tmp_path / "animation.gif")
    assert animation.n_frames == 24
    frames = []
    for k in (0, 6, 12):
        animation.seek(k)
        frames.append(np.asarray(animation.convert("RGB"), float))
    assert np.abs(frames[0] - frames[2]).max() > 50  # it moves
    shape = np.asarray(Image.open(tmp_path / "shape.png").convert("RGB"), float)
    red = (shape[:, :, 0] > 1.8 * shape[:, :, 1]) & (shape[:, :, 0] > 100)
    assert red.mean() > 0.005  # something is drawn as moving


def test_without_pyvista_a_word_says_so(pins, tmp_path, monkeypatch):
    monkeypatch.setenv("SQUEAL_PYTHON", str(tmp_path / "none"))
    printed = plot(pins[0], "--output", tmp_path, "--only", "shape", "modes")
    assert "shape left out: 3D pictures need PyVista" in printed and (tmp_path / "modes.png").exists()


@pytest.mark.parametrize("closed", [True, False])
def test_a_phase_portrait_is_closed_where_the_period_is(closed):
    """A drifting circle: no velocity of the open one comes from its gap."""
    time = np.arange(200) / 200
    place, speed = plot_basis.portrait(np.cos(2 * np.pi * time) + (0 if closed else 5 * time), 1 / 200, closed)
    assert (len(place) == 201) == closed and (place[0] == place[-1]) == closed
    assert np.abs(speed).max() <= 2 * np.pi + (0 if closed else 5)


@pytest.mark.parametrize("line, last", [(0.17, 25 * 0.17), (600, 15000), (4000, 20000), (18000, 90000)])
def test_the_axis_of_a_spectrum_ends_soon_beyond_its_line(line, last):
    """Beside a floor 60 dB below that reaches to a thousand times its frequency."""
    frequency = line * np.arange(1, 8001) / 8
    amplitude = np.where(frequency == line, 1.0, 1e-3)
    assert plot_spectra.last_shown([(frequency, amplitude), (frequency, 0.1 * amplitude)]) == pytest.approx(last)


def test_a_cycle_keeps_its_harmonics_on_the_axis():
    frequency = 4840.0 * np.arange(1, 100)
    assert plot_spectra.last_shown([(frequency, 1e-3 * (4840 / frequency) ** 9)]) == 4840 * 3  # the fourth is 108 dB below


def test_the_legend_of_a_spectrum_tells_which_lines_are_beyond_its_axes(monkeypatch):
    frequency = np.arange(1.0, 100)
    lines = {"pin": (frequency, 1e-3 / frequency, False), "still": (frequency, 1e-9 / frequency, False)}
    monkeypatch.setattr(plot_spectra, "spectra_of", lambda run: ("words", lines))
    legend = plot_spectra.draw_spectrum([Driven()]).axes[0].get_legend()
    assert [text.get_text() for text in legend.get_texts()] == ["pin", "still, beyond the axes"]


def test_a_mode_of_a_small_part_is_drawn_from_near():
    from squeal import plot_shape

    class Shaped:
        nodes = np.arange(30.0).reshape(10, 3)

        def shape(self, number):
            return (np.arange(10) < number)[:, None] * np.ones(3) * 1j

    assert plot_shape.is_local(Shaped(), 3) and not plot_shape.is_local(Shaped(), 8)


@pytest.mark.parametrize("scale, low, high", [(0.011, -1e5, 3), (4.4, -5e3, 2e3), (1e-9, -1e4, 0.5), (1e-12, -3, -1)])
def test_ticks_of_a_logarithm_away_from_zero_keep_apart(scale, low, high):
    from squeal.plot_stability import symlog_ticks

    ticks = np.array(symlog_ticks(scale, low, high))
    assert 0 in ticks and len(ticks) <= 13 and np.abs(ticks[ticks != 0]).min() >= 2 * scale


@pytest.mark.parametrize("scale, high, tick", [(67.3, 67.3, 60), (4.2, 8.9, 8), (0.05, 0.051, 0.05)])
def test_a_side_without_a_decade_has_a_number(scale, high, tick):
    from squeal.plot_stability import symlog_ticks

    assert max(symlog_ticks(scale, -1e4, high)) == pytest.approx(tick)


def table_sweep(**names):
    """Points of four numbers: two that touch and turn, one apart, one that failed."""
    points = [{"values": [load, speed, offset], "direction": 1, "outcome": "converged", "closed": closed, "growth_rate": growth}
              for load, speed, offset, closed, growth in ((5, 2, -1, 9, 7.0), (5, -2, 1, 9, -1.0), (-5, 2, 1, 0, -1.0))]
    points.append({"values": [7, 0, 1], "direction": 1, "outcome": "failed", "reason": "nothing drives a pair there", "closed": 9})
    return {"keys": ["numbers.load", "numbers.speed", "mesh.parameters.offset"], "names": ["force.0.vector.2", "rotor.0.rate", ""], "points": points}


def test_points_where_nothing_touches_or_that_failed_are_not_quiet_ones():
    from squeal import plot_sweep

    class Swept:
        title, folder = "matrix", Path("matrix")

        def lines(self, stage):
            return [{"numbers.load": "5", "numbers.speed": "2", "mesh.parameters.offset": "-1", "direction": "1", "growth_rate": "7", "frequency_hz": "900"}]

    sweep = table_sweep()
    figure = plot_sweep.draw_occurrence(Swept(), sweep)
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels[:2] == ["speed above 0: 1 of 1 point unstable", "speed below 0: 0 of 1 point unstable"]  # not the offset, which has both signs too
    assert figure.not_counted == ["Nothing touches at 1 point, not counted: load -5, speed 2, mesh offset 1.",
                                  "1 point failed: load 7, speed 0, mesh offset 1 (nothing drives a pair there)."]
    caption = plot_captions.of_sweep([], figure)
    assert all(sentence in caption for sentence in figure.not_counted)


def test_the_line_of_a_mode_passes_through_its_thresholds():
    from squeal import plot_sweep

    x, frequency, growth = plot_sweep.with_thresholds([0.2, 0.3], [1580, 1590], [-50, 60], [{"values": [0.297], "frequency_hz": 1583}])
    assert x.tolist() == [0.2, 0.297, 0.3] and frequency.tolist() == [1580, 1583, 1590] and growth.tolist() == [-50, 0, 60]


def test_a_map_of_design_points_shows_the_planes_between_them():
    """Thin triangles and numbers of units far apart included: the growth rate of a plane is met everywhere, and 0 below it."""
    from squeal import plot_sweep

    values = np.random.default_rng(5).uniform((0.1, 2e9), (0.8, 4e9), (12, 2))
    plane = lambda x, y: 10 * x - 4e-9 * y + 8
    x, y, level = plot_sweep.level_within(values, plane(*values.T))
    known = np.isfinite(level)
    assert 0.5 < known.mean() < 1 and level[known] == pytest.approx(np.maximum(plane(*np.meshgrid(x, y)), 0)[known], abs=1e-9)
    assert np.isnan(plot_sweep.level_within(values[:2], np.ones(2))[2]).all()  # no triangle


def test_modes_of_a_sweep_look_different():
    from squeal import plot_sweep

    assert len({plot_sweep.look_of_mode(place) for place in range(64)}) == 64


@pytest.mark.parametrize("dots", ["-3", "0", "1e9", "nan"])
def test_dots_that_are_no_resolution_are_refused(tmp_path, dots):
    done = subprocess.run([sys.executable, ROOT / "tools" / "plot", tmp_path, "--dpi", dots], capture_output=True, text=True)
    assert done.returncode == 1 and done.stderr == f"plot: --dpi {dots} is no whole number from 20 to 1200\n"
