"""The model in 3D: parts in colour, the way of each rotor, centres of pressure, leading and trailing edges."""

import matplotlib
import numpy as np
from squeal.plot_basis import PART_COLOURS, RED, heading, plt, scene_of, those_with
from squeal.plot_places import places_of
from squeal.plot_shape import pyvista, show
from squeal import Missing
from squeal.surface import by_part, outer

HEIGHT, BORDER = 800, 30  # pixels
SIDES = ((-35, 28, "from above"), (-35, -28, "from below"))  # degrees about z and above the plane


def parts_of(run):
    """Faces of each part by its name."""
    names = [part["name"] for part in scene_of(run).get("part", [])]
    found = {}
    for number, elements in sorted(by_part(run.field("mesh/topology"), run.field("mesh/part")).items()):
        solid, shells = outer(elements)
        found[names[number] if number < len(names) else f"part {number}"] = solid + shells
    if not found:
        raise Missing("the scene has points, and no surface to draw")
    return found


def rotation_arc(place):
    """Points of an arc about the axis, on the side of the rotor that the contact leaves free."""
    arm = place.centre - place.about
    arm = arm - (arm @ place.axis) * place.axis
    sense = np.sign(np.cross(place.axis, arm) @ place.way)
    turn = sense * np.pi * np.linspace(0.8, 1.2, 24)[:, None]
    return place.about + (place.centre - place.about) @ place.axis * place.axis + np.cos(turn) * arm + np.sin(turn) * np.cross(place.axis, arm)


def add_arrow(plotter, pv, points, thick):
    tip, way = points[-1], points[-1] - points[-2]
    way = way / np.linalg.norm(way)
    plotter.add_mesh(pv.Spline(points, n_points=60).tube(radius=thick), color="black")
    plotter.add_mesh(pv.Cone(center=tip + 4 * thick * way, direction=way, height=10 * thick, radius=3.4 * thick), color="black")


def add_arrows(plotter, pv, places):
    said = set()
    for place in places:
        size = np.linalg.norm(np.ptp(place.points, axis=0))
        thick = max(size, 0.3 * (place.radius or 0)) / 60
        key = tuple(place.axis) if place.axis is not None else place.name
        if place.way is not None and key not in said:
            said.add(key)
            straight = place.centre + np.linspace(0, 0.5 * size, 8)[:, None] * place.way
            add_arrow(plotter, pv, straight if place.axis is None else rotation_arc(place), thick)


def pixel_of(plotter, point):
    """Where a point is seen, from the left and from above."""
    renderer = plotter.renderer
    renderer.SetWorldPoint(*point, 1.0)
    renderer.WorldToDisplay()
    across, up, _ = renderer.GetDisplayPoint()
    return np.array([across, plotter.window_size[1] - up])


def marks_of(plotter, place):
    """Pixels of its centre of pressure and of its edges by their names."""
    edges = {"leading": place.leading, "trailing": place.trailing} if place.leading is not None else {}
    return pixel_of(plotter, place.centre), {name: pixel_of(plotter, point) for name, point in edges.items()}


def cropped(picture, marks):
    """The picture without the white around it, and the marks in it."""
    rows, columns = (np.flatnonzero((picture < 250).any(axis=(2, axis))) for axis in (1, 0))
    top, left = max(rows[0] - BORDER, 0), max(columns[0] - BORDER, 0)
    moved = [(centre - (left, top), {name: at - (left, top) for name, at in edges.items()}) for centre, edges in marks]
    return picture[top : rows[-1] + BORDER, left : columns[-1] + BORDER], moved


def draw_marks(axes, picture, marks):
    """Over the picture, so that no part hides them: red points, and names away from the centre with lines to the edges."""
    away = 0.07 * picture.shape[1]
    for centre, edges in marks:
        for name, at in edges.items():
            way = at - centre
            length = np.linalg.norm(way)
            way = way / length if length > 1 else np.array([0, -1.0 if name == "leading" else 1.0])
            axes.annotate(name, at, at + away * way, fontsize=8, ha="center", va="center", annotation_clip=False,
                          bbox={"boxstyle": "round,pad=0.2", "fc": "white", "ec": "none", "alpha": 0.8},
                          arrowprops={"arrowstyle": "-", "color": "black", "lw": 0.8, "shrinkA": 0, "shrinkB": 0})
        axes.plot(*centre, "o", ms=8, color=RED, mec="white", mew=0.8, clip_on=False)


def model_pictures(run):
    """RGB arrays of the model from each side, with the pixels of what is marked in them."""
    parts, nodes, pv = parts_of(run), run.nodes, pyvista()
    plotter = pv.Plotter(off_screen=True, window_size=(round(1.25 * HEIGHT), HEIGHT))
    plotter.set_background("white")
    plotter.enable_anti_aliasing("ssaa")
    for k, rims in enumerate(parts.values()):
        mesh = pv.PolyData(nodes, faces=np.concatenate([[len(rim), *rim] for rim in rims]))
        plotter.add_mesh(mesh, color=PART_COLOURS[k % len(PART_COLOURS)], show_edges=True, edge_color="#5b6874", line_width=0.6,
                         edge_opacity=0.5, ambient=0.4, diffuse=0.7)
    places, pictures = places_of(run), []
    add_arrows(plotter, pv, places)
    plotter.camera.parallel_projection = True
    for turn, rise, _ in SIDES:
        a, e = np.radians((turn, rise))
        plotter.view_vector((np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)), viewup=(0, 0, 1))
        plotter.reset_camera()
        plotter.camera.zoom(1.25)
        plotter.render()
        pictures.append(cropped(plotter.screenshot(return_img=True), [marks_of(plotter, place) for place in places]))
    plotter.close()
    return list(parts), pictures


def draw_model(runs):
    found = those_with(runs, model_pictures)
    heights = [max(picture.shape[0] / picture.shape[1] for picture, _ in pictures) for _, (_, pictures) in found]
    figure, grid = plt.subplots(len(found), len(SIDES), figsize=(5.4 * len(SIDES), 0.8 + sum(0.35 + 5.2 * height for height in heights)),
                                height_ratios=heights, squeeze=False)
    for row, (run, (names, pictures)) in zip(grid, found):
        prefix = f"{run.folder.name}: " if len(runs) > 1 else ""
        for axes, (picture, marks), (_, _, words) in zip(row, pictures, SIDES):
            show(axes, picture, prefix + words)
            draw_marks(axes, picture, marks)
        patches = [matplotlib.patches.Patch(facecolor=PART_COLOURS[k % len(PART_COLOURS)], edgecolor="0.5", label=name) for k, name in enumerate(names)]
        row[0].legend(handles=patches, fontsize=8, loc="upper left", bbox_to_anchor=(0, 0), ncols=max(1, min(6, len(patches))), frameon=False)
    figure.suptitle(heading(runs, "parts, way of the rotor, centres of pressure"))
    return figure
