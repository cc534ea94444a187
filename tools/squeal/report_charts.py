"""Charts of tools/report that answer a pointer: lines, marks, bars and areas of a drawn figure, as numbers. What has an image or
a map stays a picture."""

import base64
import io
import re

import matplotlib
import numpy as np
from matplotlib.collections import LineCollection, PathCollection, PolyCollection, QuadMesh
from matplotlib.colors import to_hex
from PIL import Image

DIGITS = 8  # of a number that is drawn
DASHES = {"--": [6, 4], ":": [2, 3], "-.": [6, 3, 2, 3]}
GRID = 400  # cells a side of an image
COLOUR_BAR = "<colorbar>"  # matplotlib's label of such axes


def plain(words):
    """Without what matplotlib sets as formulas."""
    return re.sub(r"\$([^$]*)\$", lambda formula: re.sub(r"[{}\\]", "", formula[1]), words).replace("\n", " ")


def rounded(values):
    return [float(f"{value:.{DIGITS}g}") if np.isfinite(value) else None for value in np.asarray(values, float)]


def colour_of(value):
    return None if isinstance(value, str) and value == "none" else to_hex(value, keep_alpha=True)


def axis_of(axis, limits):
    """Label, scale, range, and the ticks where they are not those of the numbers alone."""
    scale = axis.get_scale()
    forward = axis.get_transform().transform if scale == "symlog" else np.asarray
    found = {"label": plain(axis.get_label_text()), "log": scale == "log", "range": rounded(forward(np.sort(limits)))}
    fixed = isinstance(axis.get_major_locator(), matplotlib.ticker.FixedLocator)
    if fixed or scale == "symlog":
        places = axis.get_majorticklocs()
        words = axis.get_major_formatter().format_ticks(places)
        if scale == "symlog":
            words = [f"{place:g}" for place in places]
        found["ticks"] = [[place, plain(word)] for place, word in zip(rounded(forward(places)), words)]
    if axis.get_inverted():
        found["inverted"] = True
    return found, forward


def line_of(axes, line, forward):
    """A line or its marks. One that spans the axes at a value is told by where it stands."""
    x, y = (np.asarray(values, float) for values in line.get_data())
    look = {"colour": colour_of(line.get_color()), "width": line.get_linewidth(), "dash": DASHES.get(line.get_linestyle(), [])}
    if line.get_transform() == axes.get_xaxis_transform():
        if len(x) == 2 and x[0] == x[1]:
            return "at_x", look | {"value": rounded(x)[0], "name": label_of(line)}
        y = np.full(len(x), axes.get_ylim()[0])  # marks at the lower edge
    if line.get_transform() == axes.get_yaxis_transform():
        return "at_y", look | {"value": rounded(forward(y[:1]))[0], "name": label_of(line)}
    marker, filling = line.get_marker(), line.get_markerfacecolor()
    found = look | {"x": rounded(x), "y": rounded(forward(y)), "name": name_of(axes, line), "labelled": bool(label_of(line)),
                    "line": line.get_linestyle() not in ("None", "none", "", " "),
                    "mark": None if marker in ("None", "none", "", " ", None) else marker, "size": line.get_markersize(),
                    "filling": colour_of(filling), "rim": colour_of(line.get_markeredgecolor())}
    if forward is not np.asarray:
        found["value"] = rounded(y)
    return "lines", found | getattr(line, "of_modes", {})


def label_of(line):
    return "" if line.get_label().startswith("_") else plain(line.get_label())


def name_of(axes, line):
    """Its own label, or that of a line of its colour."""
    if label_of(line):
        return label_of(line)
    twins = [other.get_label() for other in axes.lines if other.get_color() == line.get_color() and not other.get_label().startswith("_")]
    return plain(twins[0]) if twins else ""


def parts_of(axes, forward):
    """Everything in the axes, by kind, and whether it has a map of cells, which stays a picture."""
    found = {"map": False, "lines": [], "at_x": [], "at_y": [], "segments": [], "areas": [], "images": [image_of(image) for image in axes.images]}
    for line in axes.lines:
        kind, entry = line_of(axes, line, forward)
        found[kind].append(entry)
    for collection in axes.collections:
        colours = [colour_of(shade) for shade in (collection.get_facecolor() if isinstance(collection, (PathCollection, PolyCollection))
                                                  else collection.get_edgecolor())]
        if isinstance(collection, LineCollection):
            ends = [[rounded(segment[:, 0]), rounded(forward(segment[:, 1]))] for segment in collection.get_segments() if len(segment)]
            widths = collection.get_linewidths()
            found["segments"] += [{"colour": colours[k % len(colours)], "width": float(widths[k % len(widths)]), "ends": end} for k, end in enumerate(ends)]
        elif isinstance(collection, PathCollection) and len(collection.get_offsets()):
            x, y = np.asarray(collection.get_offsets()).T
            found["lines"].append({"x": rounded(x), "y": rounded(forward(y)), "name": plain(collection.get_label()), "labelled": False, "line": False,
                                   "mark": "o", "size": 6, "filling": colours[0], "rim": "#000000", "colour": colours[0], "width": 1, "dash": []})
        elif isinstance(collection, PolyCollection) and collection.get_array() is None:
            found["areas"] += [{"colour": colours[k % len(colours)], "corners": [rounded(path.vertices[:, 0]), rounded(forward(path.vertices[:, 1]))]}
                               for k, path in enumerate(collection.get_paths())]
        elif isinstance(collection, QuadMesh):
            found["images"].append(mesh_image(collection))
        else:
            found["map"] = True
    for bar in axes.patches:
        corners = bar.get_path().transformed(bar.get_patch_transform()).vertices[:4]
        found["areas"].append({"colour": colour_of(bar.get_facecolor()), "corners": [rounded(corners[:, 0]), rounded(forward(corners[:, 1]))], "bar": True})
    return found


def image(colours, extent):
    """Of RGBA values, the lowest row first."""
    content = io.BytesIO()
    Image.fromarray((255 * colours[::-1]).round().astype(np.uint8)).save(content, "PNG", optimize=True)
    return {"extent": rounded(extent), "png": f"data:image/png;base64,{base64.b64encode(content.getvalue()).decode()}"}


def image_of(drawn):
    colours = drawn.to_rgba(drawn.get_array())
    return image(colours if drawn.origin == "lower" else colours[::-1], drawn.get_extent())


def mesh_image(mesh):
    """Cells of any width on a grid of equal ones, fine enough for a screen."""
    x, y = mesh.get_coordinates()[0, :, 0], mesh.get_coordinates()[:, 0, 1]
    colours = mesh.to_rgba(mesh.get_array()).reshape(len(y) - 1, len(x) - 1, 4)
    middles = lambda edges: edges[0] + (np.arange(GRID) + 0.5) * (edges[-1] - edges[0]) / GRID
    cell = lambda edges: np.clip(np.searchsorted(edges, middles(edges)) - 1, 0, len(edges) - 2)
    return image(colours[np.ix_(cell(y), cell(x))], (x[0], x[-1], y[0], y[-1]))


def key_of(axes):
    """Names and colours of a legend of patches."""
    legend = axes.get_legend()
    patches = [handle for handle in legend.get_patches()] if legend else []
    names = [text.get_text() for text in legend.get_texts()] if legend else []
    return [[name, colour_of(patch.get_facecolor())] for name, patch in zip(names, patches)] if len(patches) == len(names) else []


def charts_of(figure):
    """Of each axes that has lines, marks or bars: its axes, what is in it, its place, and those whose x it shares. Then whether
    they are the whole figure."""
    chosen = [axes for axes in figure.axes if axes.get_label() != COLOUR_BAR and axes.axison]
    found, whole = [], not any(axes.get_label() == COLOUR_BAR for axes in figure.axes)
    for axes in chosen:
        if any(np.ndim(picture.get_array()) == 3 for picture in axes.images):  # a picture of the mesh
            whole = False
            continue
        x, _ = axis_of(axes.xaxis, axes.get_xlim())
        y, forward = axis_of(axes.yaxis, axes.get_ylim())
        parts = parts_of(axes, forward)
        is_map = parts.pop("map")
        whole &= not is_map
        if is_map or not any(parts[kind] for kind in ("lines", "segments", "areas", "images")):
            continue
        if not x["label"]:  # that of the axes below
            x["label"] = next((plain(other.get_xlabel()) for other in chosen if other.get_xlabel() and axes.get_shared_x_axes().joined(axes, other)), "")
        if not y["label"]:
            y["label"] = next((plain(other.get_ylabel()) for other in chosen if other.get_ylabel() and axes.get_shared_y_axes().joined(axes, other)), "")
        spec = axes.get_subplotspec()
        shares = next(k for k, other in enumerate(chosen) if other is axes or axes.get_shared_x_axes().joined(axes, other))
        box = axes.get_position()
        shape = box.width * figure.get_figwidth() / (box.height * figure.get_figheight())
        found.append({"title": plain(axes.get_title()), "x": x, "y": y, "shares": shares, "shape": round(shape, 3),
                      "columns": spec.get_gridspec().ncols if spec else 1, "key": key_of(axes) + [[line["name"], line["colour"]] for line in parts["at_x"] + parts["at_y"] if line["name"]], **parts})
    return found, whole
