"""Maps on the contact surfaces: pressure in steady sliding, and open, stick and slip round the limit cycle."""

import numpy as np
from matplotlib.collections import PolyCollection
from squeal.plot_basis import RED, STATES, cycle_words, heading, plt, state_colours, state_legend, those_with, unit_of
from squeal.plot_places import places_of
from squeal import Missing
from squeal.surface import faces, node_cells

INSTANTS = 4


def patches_of(run):
    """Of each contact, by its number: in-plane axes, the parts of its surface and the pair that each belongs to."""
    nodes, pair_node, contact = run.nodes, run.field("pairs/node"), run.field("pairs/contact")
    normal = run.field("pairs/normal")
    solid, shells = faces(run.field("mesh/topology"))
    found = {}
    for number in np.unique(contact):
        pairs = np.flatnonzero(contact == number)
        pair_of = dict(zip(pair_node[pairs].tolist(), pairs.tolist()))
        plane = np.sort(np.argsort(np.abs(normal[pairs]).mean(axis=0))[:2])
        cells, owners = [], []
        for rim in solid + shells:
            if all(node in pair_of for node in rim):
                cells += [cell[:, plane] for cell in node_cells(rim, nodes)]
                owners += [pair_of[node] for node in rim]
        if cells:
            found[int(number)] = plane, 1e3 * np.array(cells), np.array(owners)
    if not found:
        raise Missing("the contact pairs lie on points, not on surfaces")
    return found


def name_of(run, number):
    contacts = run.report["model"].get("contacts", [])
    return f"{contacts[number]['stator']} on {contacts[number]['rotor']}" if number < len(contacts) else f"contact {number}"


def draw_map(axes, patches, values, **style):
    plane, cells, owners = patches
    collection = PolyCollection(cells, array=values[owners], edgecolors="face", linewidths=0.8, **style)  # broad enough: no seams
    axes.add_collection(collection)
    low, high = cells.min(axis=(0, 1)), cells.max(axis=(0, 1))
    margin = 0.04 * (high - low).max()
    axes.set(xlim=(low[0] - margin, high[0] + margin), ylim=(low[1] - margin, high[1] + margin), aspect="equal")
    axes.set_facecolor("white")
    axes.grid(False)
    return collection


def label_plane(axes, patches, first_column):
    plane = patches[0]
    axes.set_xlabel(f"{'xyz'[plane[0]]} [mm]")
    if first_column:
        axes.set_ylabel(f"{'xyz'[plane[1]]} [mm]")


def mark_place(axes, plane, place):
    """Centre of pressure, the way of the rotor, and the edges where it enters and leaves, on a map in millimetres."""
    centre = 1e3 * place.centre[plane]
    axes.plot(*centre, "P", ms=9, color=RED, mec="white", mew=0.8)
    if place.way is None:
        return
    way = place.way[plane]
    reach = 0.25 * min(np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim()))
    axes.annotate("", centre + reach * way, centre, arrowprops={"arrowstyle": "-|>", "color": "white", "lw": 2.4, "shrinkA": 6})
    axes.annotate("", centre + reach * way, centre, arrowprops={"arrowstyle": "-|>", "color": RED, "lw": 1.3, "shrinkA": 6})
    if place.leading is not None:
        for words, at in (("leading", place.leading), ("trailing", place.trailing)):
            axes.text(*(1e3 * at[plane]), words, fontsize=8, ha="center", va="center", color="black",
                      bbox={"boxstyle": "round,pad=0.2", "fc": "white", "ec": "none", "alpha": 0.8})


def place_words(place):
    """Effective radius and the sliding speed there."""
    words = [f"effective radius {1e3 * place.radius:.4g} mm"] if place.radius else []
    return ", ".join(words + ([f"{place.speed:.3g} m/s"] if place.speed else []))


def draw_pressure(runs):
    found = those_with(runs, lambda run: (patches_of(run), run.field("pairs/pressure")))
    count = max(len(patches) for _, (patches, _) in found)
    size, unit = unit_of(np.concatenate([pressure for _, (_, pressure) in found]), "Pa")
    figure, panels = plt.subplots(len(found), count, figsize=(1 + 4.4 * count, 0.9 + 4.0 * len(found)), squeeze=False,
                                  layout="compressed")  # no wide margins beside maps of equal scales
    for row, (run, (patches, pressure)) in zip(panels, found):
        for axes in row[len(patches) :]:
            axes.remove()
        for column, (number, of) in enumerate(patches.items()):
            values = pressure[of[2]] / size
            image = draw_map(row[column], of, pressure / size, cmap="viridis")
            image.set_clim(0, pressure.max() / size)
            label_plane(row[column], of, column == 0)
            prefix = f"{run.folder.name}: " if len(runs) > 1 else ""
            place = next(place for place in places_of(run) if place.number == number)
            mark_place(row[column], of[0], place)
            words = [f"{prefix}{name_of(run, number)}", f"{values.min():.3g} to {values.max():.3g} {unit}", place_words(place)]
            row[column].set_title("\n".join(filter(None, words)), fontsize=9)
        figure.colorbar(image, ax=list(row[: len(patches)]), label=f"contact pressure [{unit}]")
    figure.suptitle(heading(runs, "contact pressure in steady sliding"))
    return figure


def draw_contact(runs):
    """One run only: a row a contact, four instants, then the fractions of the period of each state."""
    (run, (patches, status)), *_ = those_with(runs, lambda run: (patches_of(run), run.series("cycle", "status")))
    steps = len(status)
    first = int((status == 0).sum(axis=1).argmax())
    instants = [(first + k * steps // INSTANTS) % steps for k in range(INSTANTS)]
    columns = INSTANTS + len(STATES)
    spans = [np.ptp(cells, axis=(0, 1)) for _, cells, _ in patches.values()]
    height = max(1.6, min(3.4, 2.1 * max(span[1] / span[0] for span in spans)))
    figure, panels = plt.subplots(len(patches), columns, figsize=(2.3 * columns, 1.4 + height * len(patches)), squeeze=False,
                                  sharex="row", sharey="row")
    for row, (number, of) in zip(panels, patches.items()):
        for axes, step in zip(row, instants):
            draw_map(axes, of, status[step].astype(float), cmap=state_colours()).set_clim(-0.5, 2.5)
            axes.set_title(f"t = {(step - first) % steps / steps:.2f} T", fontsize=9)
        for axes, (state, name) in zip(row[INSTANTS:], enumerate(STATES)):
            image = draw_map(axes, of, 100 * (status == state).mean(axis=0), cmap="inferno_r")
            image.set_clim(0, 100)
            axes.set_title(f"{name}, part of T", fontsize=9)
        for column, axes in enumerate(row):
            label_plane(axes, of, column == 0)
        row[0].set_ylabel(f"{name_of(run, number)}\n{row[0].get_ylabel()}", fontsize=9)
    figure.colorbar(image, ax=list(panels[:, INSTANTS:].flat), label="[% of the period]", shrink=0.8)
    state_legend(panels[0, 0], loc="lower left", bbox_to_anchor=(-0.1, 1.13))
    figure.suptitle(heading([run], f"contact round the {cycle_words(run)}, of {status.shape[1]} pairs; t = 0 when most are open"))
    return figure
