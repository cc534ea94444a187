"""Files of an estimate of the mesh's error: a field that ParaView reads beside fields.xdmf, and a picture."""

from pathlib import Path

import h5py
import matplotlib
import numpy as np
from squeal.mesh_estimate import MeshEstimate, ModeEstimate
from squeal.plot_basis import heading, plt, squeal_colours
from squeal.plot_shape import pyvista, show
from squeal import Missing, Results
from squeal.surface import outer

NAME = "mesh_error"
HEIGHT = 800  # pixels
DECADES = 3  # of the colours


def densities(found: MeshEstimate, mode: ModeEstimate) -> np.ndarray:
    """abs(change of the eigenvalue) that each element makes, over its volume [1/(s m3)]: it does not jump with the elements' sizes."""
    result = np.zeros(found.cells)
    for block in found.blocks:
        _, weights = block.elements.kind.rule
        volume = (weights * np.abs(block.elements.at(block.elements.kind.rule[0])[1])).sum(axis=1)
        result[block.cells] = np.abs(mode.of_cells[block.cells]) / volume
    return result


def write_fields(run: Results, found: MeshEstimate) -> Path:
    """mesh_error.h5 and the .xdmf that ParaView opens: of each mode the parts of the elements, real, imaginary, by closed pairs and by volume."""
    place = run.folder / f"{NAME}.xdmf"
    topology = run.field("mesh/topology")
    item = '<DataItem Dimensions="{size}" NumberType="{kind}" Precision="{bytes}" Format="HDF">{file}.h5:/{data}</DataItem>'
    mesh = item.format(size=len(topology), kind="Int", bytes=4, file="fields", data="mesh/topology")
    nodes = item.format(size=f"{len(found.nodes)} 3", kind="Float", bytes=8, file="fields", data="mesh/nodes")
    text = ['<?xml version="1.0"?>\n<!DOCTYPE Xdmf SYSTEM "Xdmf.dtd" []>\n<Xdmf Version="3.0">\n  <Domain>\n'
            f'    <Information Name="run" Value="{run.report["run"]}"/>\n    <Grid Name="mesh error" GridType="Uniform">\n'
            f'      <Topology TopologyType="Mixed" NumberOfElements="{found.cells}">{mesh}</Topology>\n'
            f'      <Geometry GeometryType="XYZ">{nodes}</Geometry>\n']
    with h5py.File(run.folder / f"{NAME}.h5", "w") as file:
        file.attrs["run"] = run.report["run"]
        for mode in found.modes:
            what = f"mode {mode.number}, {mode.lam.imag / (2 * np.pi):.0f} Hz: mesh error of"
            for name, words, values in (("growth", "growth rate [1/s]", mode.of_cells.real),
                                        ("frequency", "frequency [Hz]", mode.of_cells.imag / (2 * np.pi)),
                                        ("contact", "growth rate by closed pairs [1/s]", mode.of_contact.real),
                                        ("density", "eigenvalue, by volume [1/(s m3)]", densities(found, mode))):
                data = f"modes/{mode.number}/{name}"
                file[data] = values
                text.append(f'      <Attribute Name="{what} {words}" AttributeType="Scalar" Center="Cell">'
                            + item.format(size=found.cells, kind="Float", bytes=8, file=NAME, data=data) + "</Attribute>\n")
    place.write_text("".join(text) + "    </Grid>\n  </Domain>\n</Xdmf>\n")
    return place


def surface_of(found: MeshEstimate) -> tuple[list[list[int]], np.ndarray]:
    """Faces of the outer surface of all parts, and the element that each belongs to."""
    faces, owners = [], []
    for part in sorted({block.part for block in found.blocks}):
        elements = [(block.code, nodes.tolist()) for block in found.blocks if block.part == part for nodes in block.nodes]
        cells = [cell for block in found.blocks if block.part == part for cell in block.cells]
        around: dict[int, set[int]] = {}
        for cell, (_, nodes) in zip(cells, elements):
            for node in nodes:
                around.setdefault(node, set()).add(cell)
        for rim in outer(elements)[0]:
            faces.append(rim)
            owners.append(next(iter(set.intersection(*(around[node] for node in rim)))))
    return faces, np.array(owners)


def picture(found: MeshEstimate, values: np.ndarray, faces: list[list[int]], owners: np.ndarray, rise: float) -> np.ndarray:
    """RGB array of the surface, coloured by values of the elements from 0 to 1, seen from this angle above [degree]."""
    pv = pyvista()
    mesh = pv.PolyData(found.nodes, faces=np.concatenate([[len(rim), *rim] for rim in faces]))
    mesh.cell_data["value"] = values[owners]
    plotter = pv.Plotter(off_screen=True, window_size=(round(1.25 * HEIGHT), HEIGHT))
    plotter.set_background("white")
    plotter.enable_anti_aliasing("ssaa")
    plotter.add_mesh(mesh, scalars="value", cmap=squeal_colours(), clim=(0, 1), show_edges=True, edge_color="#808890", line_width=0.6,
                     edge_opacity=0.6, show_scalar_bar=False, ambient=0.5, diffuse=0.6)
    a, e = np.radians((-35, rise))
    plotter.camera.parallel_projection = True
    plotter.view_vector((np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)), viewup=(0, 0, 1))
    plotter.reset_camera()
    plotter.camera.zoom(1.25)
    image = plotter.screenshot(return_img=True)
    plotter.close()
    return np.asarray(image)


def cumulative(axes, found: MeshEstimate, mode: ModeEstimate, label: str) -> None:
    """How much of the error the worst elements make."""
    cells = np.concatenate([block.cells for block in found.blocks])
    parts = np.sort(np.abs(mode.of_cells[cells]))[::-1]
    axes.plot(100 * np.arange(1, len(parts) + 1) / len(parts), 100 * parts.cumsum() / parts.sum(), lw=1.8, label=label)


def draw(run: Results, found: MeshEstimate):
    """The first mode's error over the surface, from above and below, and how the error of each mode gathers in few elements."""
    mode = found.modes[0]
    density = densities(found, mode)
    value = np.clip(1 + np.log10(np.maximum(density, 1e-300) / density.max()) / DECADES, 0, 1)
    figure = plt.figure(figsize=(14, 4.6))
    grid = figure.add_gridspec(1, 3, width_ratios=(1, 1, 0.75))
    try:
        faces, owners = surface_of(found)
        for k, (rise, words) in enumerate(((28, "from above"), (-28, "from below"))):
            axes = figure.add_subplot(grid[0, k])
            show(axes, picture(found, value, faces, owners, rise), f"mode at {mode.lam.imag / (2 * np.pi):.4g} Hz, {words}")
        colours = matplotlib.cm.ScalarMappable(matplotlib.colors.LogNorm(10.0**-DECADES, 1), squeal_colours())
        figure.colorbar(colours, ax=axes, shrink=0.8, label="error by volume, over its largest [-]")
        last = figure.add_subplot(grid[0, 2])
    except Missing:
        last = figure.add_subplot(grid[0, :])
    for each in found.modes:
        cumulative(last, found, each, f"{each.lam.imag / (2 * np.pi):.5g} Hz, {each.lam.real:.4g} 1/s")
    last.set(xlabel="elements, the worst first [%]", ylabel="part of the error [%]", title="where the error is", ylim=(0, 102))
    last.legend(fontsize=8)
    figure.suptitle(heading([run], "what the mesh leaves open, by recovered strains"))
    return figure
