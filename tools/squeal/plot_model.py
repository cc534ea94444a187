"""The model in 3D: parts in colour, the way of each rotor, centres of pressure, leading and trailing edges."""

import matplotlib
import numpy as np
from squeal.plot_basis import PART_COLOURS, RED, heading, plt, scene_of, those_with
from squeal.plot_places import places_of
from squeal.plot_shape import pyvista, show
from squeal import Missing
from squeal.surface import by_part, outer

HEIGHT = 800  # pixels
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


def add_marks(plotter, pv, places):
    said = set()
    for place in places:
        size = np.linalg.norm(np.ptp(place.points, axis=0))
        thick = max(size, 0.3 * (place.radius or 0)) / 60
        plotter.add_mesh(pv.Sphere(radius=1.6 * thick, center=place.centre), color=RED)
        if place.leading is not None:
            plotter.add_point_labels(np.array([place.leading, place.trailing]), ["leading", "trailing"], font_size=22, shape_opacity=0.75,
                                     show_points=False, always_visible=True, shape_color="white", text_color="black")
        key = tuple(place.axis) if place.axis is not None else place.name
        if place.way is not None and key not in said:
            said.add(key)
            straight = place.centre + np.linspace(0, 0.5 * size, 8)[:, None] * place.way
            add_arrow(plotter, pv, straight if place.axis is None else rotation_arc(place), thick)


def model_pictures(run):
    """RGB arrays of the model from each side."""
    parts, nodes, pv = parts_of(run), run.nodes, pyvista()
    plotter = pv.Plotter(off_screen=True, window_size=(round(1.25 * HEIGHT), HEIGHT))
    plotter.set_background("white")
    plotter.enable_anti_aliasing("ssaa")
    for k, rims in enumerate(parts.values()):
        mesh = pv.PolyData(nodes, faces=np.concatenate([[len(rim), *rim] for rim in rims]))
        plotter.add_mesh(mesh, color=PART_COLOURS[k % len(PART_COLOURS)], show_edges=True, edge_color="#5b6874", line_width=0.6,
                         edge_opacity=0.5, ambient=0.4, diffuse=0.7)
    add_marks(plotter, pv, places_of(run))
    pictures = []
    plotter.camera.parallel_projection = True
    for turn, rise, _ in SIDES:
        a, e = np.radians((turn, rise))
        plotter.view_vector((np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)), viewup=(0, 0, 1))
        plotter.reset_camera()
        plotter.camera.zoom(1.25)
        plotter.render()
        pictures.append(plotter.screenshot(return_img=True))
    plotter.close()
    return list(parts), pictures


def draw_model(runs):
    found = those_with(runs, model_pictures)
    figure, grid = plt.subplots(len(found), len(SIDES), figsize=(5.4 * len(SIDES), 0.9 + 4.2 * len(found)), squeeze=False)
    for row, (run, (names, pictures)) in zip(grid, found):
        prefix = f"{run.folder.name}: " if len(runs) > 1 else ""
        for axes, picture, (_, _, words) in zip(row, pictures, SIDES):
            show(axes, picture, prefix + words)
        patches = [matplotlib.patches.Patch(facecolor=PART_COLOURS[k % len(PART_COLOURS)], edgecolor="0.5", label=name) for k, name in enumerate(names)]
        row[0].legend(handles=patches, fontsize=8, loc="lower left", framealpha=0.8)
    figure.suptitle(heading(runs, "parts, way of the rotor, centres of pressure"))
    return figure
