"""Where each contact presses: centre of pressure, effective radius, the way of its rotor, leading and trailing edge."""

import numpy as np
from squeal.plot_basis import scene_of

ALL_ROUND = 330  # degrees about the axis from which on a contact has no edges
EDGE = 0.04  # part of a contact's length along the way that counts as its edge
AXES = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1)}


class Place:
    """A contact of a run in steady sliding. What it has not is None."""

    def __init__(self, number, contact, points, forces, normal):
        """contact: its table in the scene; points, forces: of its pairs [m, N]; normal: their mean, out of the rotor."""
        self.number, self.name = number, f"{contact.get('stator', 'stator')} on {contact.get('rotor', 'rotor')}"
        self.points, self.force = points, forces.sum()
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


def places_of(run):
    """Every contact that has pairs, in the order of the scene."""
    if not run.report["model"]["pairs"] or not (run.folder / "fields.h5").exists():
        return []
    contact, points, normal = (run.field(f"pairs/{name}") for name in ("contact", "position", "normal"))
    forces, tables = run.field("pairs/reaction")[:, 0], scene_of(run).get("contact", [])
    return [Place(int(k), tables[k] if k < len(tables) else {}, points[contact == k], np.maximum(forces[contact == k], 0),
                  normal[contact == k].mean(axis=0)) for k in np.unique(contact)]
