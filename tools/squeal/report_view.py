"""The 3D view of tools/report: outer faces of each part, complex shapes of modes and of the cycle, states of the contact, as
arrays that a browser unpacks."""

import base64
import zlib

import numpy as np
from squeal.plot_basis import PART_COLOURS, STATES, cycle_words, mode_words, scene_of
from squeal.plot_places import places_of
from squeal.plot_shape import swing_of
from squeal import Missing
from squeal.surface import amplitude, by_part, outer

ROOM = 2.4e6  # bytes of the motions of all runs of a page; those of modes that grow more slowly are left out beyond it
HARMONICS = 8  # at most, of a cycle
REST_OF_MOTION = 0.01  # part of the cycle's motion that its harmonics may lack


def packed(array):
    """Base64 of an array's bytes, compressed."""
    return base64.b64encode(zlib.compress(np.ascontiguousarray(array).tobytes(), 9)).decode()


def corners(rim):
    """A face as triangles between its nodes; a mid-side node follows each corner where there are six or eight."""
    if len(rim) < 6:
        return [(rim[0], rim[k], rim[k + 1]) for k in range(1, len(rim) - 1)]
    middles = rim[1::2]
    cut = [(middles[k - 1], rim[2 * k], middles[k]) for k in range(len(middles))]
    return cut + corners(middles)


class Surface:
    """The nodes on outer faces of a run's parts, each once, and the faces of each part by them."""

    def __init__(self, run):
        self.parts = {}
        for number, elements in sorted(by_part(run.field("mesh/topology"), run.field("mesh/part")).items()):
            solid, shells = outer(elements)
            rims = solid + shells
            edges = {(min(pair), max(pair)) for rim in rims for pair in zip(rim, rim[1:] + rim[:1])}
            self.parts[number] = np.array([t for rim in rims for t in corners(rim)]), np.array(sorted(edges))
        if not self.parts:
            raise Missing("the scene has points, and no surface to draw")
        self.kept = np.unique(np.concatenate([triangles.ravel() for triangles, _ in self.parts.values()]))
        self.place = np.full(len(run.nodes), -1)
        self.place[self.kept] = np.arange(len(self.kept))

    def packed_parts(self, run):
        kind = np.uint16 if len(self.kept) < 2**16 else np.uint32
        scene = scene_of(run).get("part", [])
        name = lambda number: scene[number]["name"] if number < len(scene) else f"part {number}"
        return [{"name": name(number), "colour": PART_COLOURS[k % len(PART_COLOURS)],
                 "triangles": packed(self.place[triangles].astype(kind)), "edges": packed(self.place[edges].astype(kind))}
                for k, (number, (triangles, edges)) in enumerate(self.parts.items())]


def harmonics(time, motion):
    """Complex amplitudes of a periodic motion, as (harmonic, node, component), as many as hold nearly all of it, and the part
    that they lack. time: over the period."""
    motion = motion - motion.mean(axis=0)
    whole = max((motion**2).sum(), 1e-300)
    found, lacking = [], 1.0
    for k in range(1, min(HARMONICS, (len(time) - 1) // 2) + 1):
        turns = np.exp(-2j * np.pi * k * time)
        found.append(2 * np.tensordot(turns, motion, axes=1) / len(time))
        lacking = np.sqrt(max(whole - len(time) / 2 * sum((np.abs(c) ** 2).sum() for c in found), 0) / whole)
        if lacking < REST_OF_MOTION:
            break
    return np.array(found), lacking


def motion_of(run, surface, name, shapes, more):
    """shapes: complex, (harmonic, node, component), of the surface's nodes."""
    swing = swing_of(run.nodes[surface.kept], amplitude(shapes[0]))
    return {"name": name, "scale": swing / max(np.abs(shapes).max(), 1e-300), "harmonics": len(shapes),
            "shape": packed(np.stack([shapes.real, shapes.imag], axis=-1).astype(np.float32))} | more


def cycle_motion(run, surface):
    try:
        time, motion = run.motion()
    except Missing:
        return []
    cycle = run.stage("cycle")
    shapes, lacking = harmonics(time / cycle["period"], motion[:, surface.kept])
    words = f"{len(shapes)} harmonics of its motion are shown, which lack {max(100 * lacking, 0.01):.2g} % of it"
    return [motion_of(run, surface, f"{cycle_words(run)}, {cycle['frequency_hz']:.5g} Hz", shapes, {"mode": 0, "words": words})]


def motions_of(run, surface, room):
    """The cycle's and the modes' that have room, the fastest growing first; and the numbers of modes that have none."""
    found, left_out = cycle_motion(run, surface), []
    modes = run.report.get("modes", {}).get("modes", [])
    room -= sum(len(motion["shape"]) for motion in found)
    for number in run.mode_numbers():
        mode = modes[number - 1]
        if room < 32 * len(surface.kept):
            left_out.append(number)
            continue
        words = "grows" if mode["unstable"] else "dies out"
        found.append(motion_of(run, surface, f"mode {number}: {mode_words(mode['frequency_hz'], mode['growth_rate'])}",
                               run.shape(number)[None, surface.kept], {"mode": number, "words": words}))
        room -= len(found[-1]["shape"])
    return found, left_out


def contact_of(run, surface):
    """Pressure of every node, status of the pairs round the cycle, and what is marked on each contact."""
    if not run.report["model"]["pairs"]:
        return {}
    node = run.field("pairs/node")
    pressure = run.field("equilibrium/pressure")[surface.kept]
    found = {"pressure": packed(pressure.astype(np.float32)), "highest": float(pressure.max()),
             "pairs": packed(surface.place[node].astype(np.int32)), "contacts": [], "states": STATES}
    try:
        status = run.series("cycle", "status")
        found |= {"steps": len(status), "status": packed(status.astype(np.uint8))}
    except Missing:
        pass
    for place in places_of(run):
        of = np.flatnonzero(run.field("pairs/contact") == place.number)
        touching = set(node[of].tolist())
        stator = [k for k, (triangles, _) in enumerate(surface.parts.values()) if touching & set(triangles.ravel().tolist())]
        found["contacts"].append(place.marks() | {"parts": stator})
    return found


def view_of(run, room):
    """Everything that the view of a run needs; Missing where it has no surface."""
    surface = Surface(run)
    motions, left_out = motions_of(run, surface, room)
    return {"run": run.folder.name, "nodes": len(surface.kept), "positions": packed(run.nodes[surface.kept].astype(np.float32)),
            "parts": surface.packed_parts(run), "motions": motions, "left_out": left_out, "contact": contact_of(run, surface)}


def views(runs):
    """Of the runs that have a surface, and why the others have none."""
    found, reasons = [], []
    for run in runs:
        try:
            found.append(view_of(run, ROOM / len(runs)))
        except Missing as reason:
            reasons.append(f"{run.folder.name}: {reason}")
    return found, reasons
