"""The mesh in 3D, deformed and coloured by PyVista off screen: the mode that squeals, and one period of the cycle moving."""

import os

import matplotlib
import numpy as np
from squeal.plot_basis import (RED, SLIP, STICK, cycle_words, heading, length_unit, mode_words, plt, squeal_colours, strongest,
                        those_with)
from squeal.plot_motion import lift_off_of, measure_of
from squeal import Missing
from squeal.surface import amplitude, faces, widest_phase

SWING, WHOLE = 0.12, 0.05  # what moves most is drawn moving by these parts of the size of the moving region and of all
FRAMES = 24  # at most, of an animation
MODES = 6  # at most so many shapes side by side


def pyvista():
    """PyVista, without a display."""
    os.environ.pop("DISPLAY", None)
    try:
        import pyvista as module
        from vtkmodules.vtkCommonCore import vtkLogger
    except ImportError:
        raise Missing("3D pictures need PyVista: pip install pyvista, which tools/setup does in a clone") from None
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)  # it warns of a display that is not needed
    module.OFF_SCREEN = True
    return module


def swing_of(nodes, size):
    """Length [m] that what moves most is drawn moving by, such that the moving region and the whole keep their form. size: how
    much each node moves."""
    moving = nodes[size > 0.25 * size.max()]
    whole = np.linalg.norm(np.ptp(nodes, axis=0))
    return min(SWING * np.linalg.norm(np.ptp(moving, axis=0)) or whole, WHOLE * whole)


class Stage:
    """A run's surface in a PyVista window, seen from one place however it is deformed."""

    def __init__(self, run, size, height, edges=True):
        """size: how much each node moves, to choose the view; height: of the pictures [pixels]; edges: of the elements."""
        self.nodes = run.nodes
        solid, shells = faces(run.field("mesh/topology"))
        rims = solid + shells
        if not rims:
            raise Missing("the scene has points, and no surface to draw")
        self.size = size / size.max()
        self.moving = self.nodes[self.size > 0.25]
        self.swing = swing_of(self.nodes, size)
        pv = pyvista()
        self.mesh = pv.PolyData(self.nodes, faces=np.concatenate([[len(rim), *rim] for rim in rims]))
        self.mesh["value"] = self.size
        self.plotter = pv.Plotter(off_screen=True, window_size=(round(1.25 * height), height))
        self.plotter.set_background("white")
        self.plotter.enable_anti_aliasing("ssaa")
        self.plotter.add_mesh(self.mesh, scalars="value", cmap=squeal_colours(), clim=(0, 1), show_edges=edges,
                              edge_color="#808890", line_width=0.6, edge_opacity=0.6, show_scalar_bar=False, ambient=0.5, diffuse=0.6,
                              lighting=True, smooth_shading=False)
        self.towards = self._towards()

    def _towards(self):
        """From the mesh to the eye, which stands on the side that moves, above it."""
        middle = (self.nodes.max(axis=0) + self.nodes.min(axis=0)) / 2
        aside = np.average(self.nodes, axis=0, weights=self.size**2) - middle
        a, e = np.arctan2(aside[1], aside[0]) - np.radians(35), np.radians(30)
        return np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])

    def picture(self, displacement, value, near):
        """RGB array with nodes displaced [m] and coloured by a value from 0 to 1; near: of what moves most."""
        self.mesh.points = self.nodes + displacement
        self.mesh["value"] = value
        shown = self.moving if near else self.nodes
        middle = (shown.max(axis=0) + shown.min(axis=0)) / 2
        side = np.cross([0, 0, 1], self.towards)
        up = np.cross(self.towards, side / np.linalg.norm(side))
        across, high = (np.ptp(shown @ axis) for axis in (side / np.linalg.norm(side), up))
        camera = self.plotter.camera
        camera.parallel_projection = True
        camera.focal_point, camera.up = middle, (0, 0, 1)
        camera.position = middle + 10 * np.linalg.norm(np.ptp(self.nodes, axis=0)) * self.towards
        camera.parallel_scale = (0.72 if near else 0.54) * max(high, across / 1.25)
        self.plotter.renderer.reset_camera_clipping_range()
        self.plotter.render()
        return self.plotter.screenshot(return_img=True)

    def close(self):
        self.plotter.close()


def unstable_shapes(run):
    """Numbers of the unstable modes whose shapes are there."""
    modes = run.stage("modes")["modes"]
    numbers = [k for k in run.mode_numbers() if modes[k - 1]["unstable"]]
    if not numbers:
        raise Missing("no mode grows, or the run has no fields.h5")
    return numbers


def mode_pictures(run, number, height, views):
    """RGB arrays of a mode at its widest phase, one a view: near or not."""
    shape = run.shape(number)
    stage = Stage(run, amplitude(shape), height)
    motion = (shape * np.exp(1j * widest_phase(shape))).real
    motion *= stage.swing / np.abs(motion).max()
    pictures = [stage.picture(motion, stage.size, near) for near in views]
    stage.close()
    return pictures


def is_local(run, number):
    """Whether what moves in a mode is small beside the whole, which would hide it."""
    size = amplitude(run.shape(number))
    diagonal = lambda nodes: np.linalg.norm(np.ptp(nodes, axis=0))
    return diagonal(run.nodes[size > 0.25 * size.max()]) < 0.5 * diagonal(run.nodes)


def colour_bar(figure, axes):
    bar = matplotlib.cm.ScalarMappable(cmap=squeal_colours())
    figure.colorbar(bar, ax=axes, shrink=0.8, label="amplitude over its largest")


def show(axes, picture, title):
    axes.imshow(picture)
    axes.grid(False)
    axes.set(xticks=[], yticks=[], title=title)
    axes.spines[:].set_visible(False)


def draw_period(above, below, run):
    """The probe that swings most, and how much of the contact is open and sticks, against time over one period of the cycle."""
    time = 1e3 * run.series("cycle", "time")  # [ms]
    name, values = strongest(run.probes("cycle"))
    size, unit = length_unit(values)
    above.plot(time, values / size, color=SLIP, lw=1.8)
    above.set(ylabel=f"{name} [{unit}]", title="one period of the limit cycle")
    _, opened, stuck, area = lift_off_of(run)
    below.step(time, 100 * opened, where="mid", color=RED, lw=1.6, label="open")
    below.step(time, 100 * stuck, where="mid", color=STICK, lw=1.6, label="sticking")
    below.set(xlabel="time [ms]", ylabel=f"contact's {measure_of(run, area)} [%]")
    below.set_ylim(bottom=0)
    below.legend(fontsize=8, loc="lower center", bbox_to_anchor=(0.5, 1), ncol=2, frameon=False)


def words_of(run, number):
    mode = run.stage("modes")["modes"][number - 1]
    return mode_words(mode["frequency_hz"], mode["growth_rate"])


def draw_shape(runs):
    """The mode that grows fastest of each run: all of it, what moves most, and the cycle of a single run."""
    found = those_with(runs, lambda run: (unstable_shapes(run)[0], mode_pictures(run, unstable_shapes(run)[0], 900, (False, True))))
    run = found[0][0]
    has_cycle = len(found) == 1 and bool(run.converged_cycle()) and bool(run.probes("cycle"))
    widths = [1, 1, 0.7][: 3 if has_cycle else 2]
    figure = plt.figure(figsize=(5.2 * sum(widths), 4.4 * len(found)))
    grid = figure.add_gridspec(2 * len(found), len(widths), width_ratios=widths)
    for k, (one, (number, (whole, near))) in enumerate(found):
        axes = [figure.add_subplot(grid[2 * k : 2 * k + 2, column]) for column in (0, 1)]
        prefix = f"{one.folder.name}: " if len(runs) > 1 else "squealing mode, "
        show(axes[0], whole, f"{prefix}{words_of(one, number)}")
        show(axes[1], near, "what moves most, exaggerated")
        colour_bar(figure, axes[1])
    if has_cycle:
        above = figure.add_subplot(grid[0, 2])
        draw_period(above, figure.add_subplot(grid[1, 2], sharex=above), run)
    return figure


def draw_shapes(runs):
    """All unstable modes side by side, where a run has several."""
    found = [(run, k) for run, numbers in those_with(runs, unstable_shapes) for k in numbers[:MODES]]
    if len(found) < 2:
        raise Missing("one mode grows: shape shows it")
    columns = min(3, len(found))
    rows = -(-len(found) // columns)
    figure, grid = plt.subplots(rows, columns, figsize=(4.6 * columns, 3.9 * rows), squeeze=False)
    for axes, (run, number) in zip(grid.flat, found):
        prefix = f"{run.folder.name}: " if len(runs) > 1 else ""
        near = is_local(run, number)
        show(axes, mode_pictures(run, number, 600, (near,))[0], prefix + words_of(run, number) + ("\nwhat moves most" if near else ""))
    for axes in list(grid.flat)[len(found) :]:
        axes.remove()
    colour_bar(figure, list(grid.flat)[: len(found)])
    figure.suptitle(heading(runs, "unstable modes, exaggerated"))
    return figure


def moving(run):
    """Displacements about their mean [m] over one period, (frame, node, component), and what they are of."""
    try:
        time, motion = run.motion()
        frames = motion[np.arange(min(FRAMES, len(motion))) * len(motion) // min(FRAMES, len(motion))]
        return frames - motion.mean(axis=0), f"{cycle_words(run)}, {run.stage('cycle')['frequency_hz']:.4g} Hz, very slowly"
    except Missing:
        number = unstable_shapes(run)[0]
        turns = np.exp(2j * np.pi * np.arange(FRAMES) / FRAMES)
        return (turns[:, None, None] * run.shape(number)).real, f"mode, {words_of(run, number)}"


def animate(run, file, height=330):
    """A GIF of one period that repeats, whole and near."""
    from PIL import Image, ImageDraw, ImageFont

    motion, words = moving(run)
    lengths = np.linalg.norm(motion, axis=2)
    stage = Stage(run, lengths.max(axis=0), height, edges=False)  # a third of the bytes
    scale = stage.swing / np.abs(motion).max()
    if "very slowly" in words:
        words += f", {float(f'{scale:.1g}'):.0f} times exaggerated"
    frames = []
    font = ImageFont.truetype(matplotlib.font_manager.findfont("DejaVu Sans"), 15)
    for frame, length in zip(motion, lengths / lengths.max()):
        both = [stage.picture(scale * frame, length, near) for near in (False, True)]
        picture = Image.fromarray(np.concatenate(both, axis=1))
        ImageDraw.Draw(picture).text((10, 8), words, fill="black", font=font)
        frames.append(picture)
    stage.close()
    sheet = Image.new("RGB", (frames[0].width, 4 * height))  # one palette for all: colours do not flicker
    for k in range(4):
        sheet.paste(frames[k * len(frames) // 4], (0, k * height))
    palette = sheet.quantize(200)
    frames = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    frames[0].save(file, format="GIF", save_all=True, append_images=frames[1:], duration=60, loop=0, optimize=True)
