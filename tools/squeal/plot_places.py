"""Where each contact presses: centre of pressure, effective radius, the way of its rotor, leading and trailing edge."""

import numpy as np
from scipy.spatial import cKDTree
from squeal.plot_basis import scene_of
from squeal.surface import by_part

ALL_ROUND = 330  # degrees about the axis from which on a contact has no edges
EDGE = 0.04  # part of a contact's length along the way that counts as its edge
AXES = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1)}


class Place:
    """A contact of a run in steady sliding. What it has not is None."""

    def __init__(self, number, contact, points, forces, normal):
        """contact: its table in the scene; points, forces: of its pairs [m, N]; normal: their mean, out of the rotor."""
        self.number, self.name = number, f"{contact.get('stator', 'stator')} on {contact.get('rotor', 'rotor')}"
        self.contact, self.points, self.force = contact, points, forces.sum()
        weights = forces if self.force > 0 else np.ones(len(forces))
        self.centre = np.average(points, axis=0, weights=weights)
        self.normal = normal / max(np.linalg.norm(normal), 1e-300)
        self.radius = self.axis = self.way = self.speed = self.leading = self.trailing = None
        if contact.get("rotation", {}).get("rate"):
            self._turns(contact["rotation"], weights)
        elif np.any(contact.get("velocity", 0)):
            velocity = np.array(contact["velocity"], float)
            self.speed = np.linalg.norm(velocity)
            self.way = velocity / self.speed
            self._edges(points @ self.way)

    def _turns(self, rotation, weights):
        axis = rotation["axis"]
        axis = np.array(AXES.get(axis, axis) if isinstance(axis, str) else axis, float)
        self.axis, self.about = axis / np.linalg.norm(axis), np.array(rotation.get("centre", (0, 0, 0)), float)
        arms = self._arm(self.points)
        self.radius = np.average(np.linalg.norm(arms, axis=1), weights=weights)
        self.speed = abs(rotation["rate"]) * self.radius
        arm = self._arm(self.centre)
        across = np.sign(rotation["rate"]) * np.cross(self.axis, arm)
        if np.linalg.norm(arm) < 0.05 * self.radius:  # all round the axis
            return
        self.way = across / np.linalg.norm(across)
        outward = arm / np.linalg.norm(arm)
        angle = np.degrees(np.arctan2(arms @ self.way, arms @ outward))
        if np.ptp(angle) < ALL_ROUND:
            self._edges(angle)

    def _arm(self, points):
        offset = points - self.about
        return offset - np.multiply.outer(offset @ self.axis, self.axis)

    def _edges(self, along):
        """Where the rotor enters and where it leaves. along: the pairs' places along its way."""
        length = np.ptp(along)
        if length > 0:
            self.leading = self.points[along <= along.min() + EDGE * length].mean(axis=0)
            self.trailing = self.points[along >= along.max() - EDGE * length].mean(axis=0)

    def marks(self):
        """What is known of it, in numbers that JSON holds."""
        names = ("name", "force", "centre", "normal", "radius", "axis", "way", "speed", "leading", "trailing")
        plain = lambda value: value.tolist() if isinstance(value, (np.ndarray, np.generic)) else value
        return {name: plain(getattr(self, name)) for name in names} | {"size": float(np.linalg.norm(np.ptp(self.points, axis=0)))}


def drive_of(run, scene, contact, points, node):
    """A contact's table with the drive of the [[rotor]] that it takes: that of the part nearest to its pairs beside their own.
    points, node: of its pairs."""
    rotors = {rotor["part"]: rotor for rotor in scene.get("rotor", [])}
    if not rotors or contact.get("rotation", {}).get("rate") or np.any(contact.get("velocity", 0)):
        return contact
    found = rotors.get(contact.get("rotor"))
    if not found and (run.folder / "fields.h5").exists():
        parts = by_part(run.field("mesh/topology"), run.field("mesh/part"))
        nodes = {scene["part"][k]["name"]: np.unique([at for _, of in elements for at in of]) for k, elements in parts.items()}
        owner = next((name for name, own in nodes.items() if node[0] in own), None)
        beside = {name: np.median(cKDTree(run.nodes[own]).query(points)[0]) for name, own in nodes.items() if name != owner}
        rotor = owner if contact.get("slave") == "rotor" else min(beside, key=beside.get, default=None)
        found = rotors.get(rotor)
    if not found:
        return contact
    turns = {"rotation": {name: found[name] for name in ("axis", "centre", "rate") if name in found}} if found.get("rate") else {}
    return contact | turns | ({"velocity": found["velocity"]} if np.any(found.get("velocity", 0)) else {})


def places_of(run):
    """Every contact that has pairs, in the order of the scene."""
    if not run.report["model"]["pairs"] or not (run.folder / "fields.h5").exists():
        return []
    contact, points, normal, node = (run.field(f"pairs/{name}") for name in ("contact", "position", "normal", "node"))
    forces, scene, found = run.field("pairs/reaction")[:, 0], scene_of(run), []
    tables = scene.get("contact", [])
    for k in np.unique(contact):
        of = contact == k
        driven = drive_of(run, scene, tables[k] if k < len(tables) else {}, points[of], node[of])
        found.append(Place(int(k), driven, points[of], np.maximum(forces[of], 0), normal[of].mean(axis=0)))
    return found
