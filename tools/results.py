"""A results folder as tools/plot reads it."""

from pathlib import Path

import common

common.needs("h5py")
import h5py
from common import read_report


class Skip(Exception):
    """A figure that this run has no data for, and why."""


class Results:
    """A results folder: its report, and its history where there is one."""

    def __init__(self, folder):
        self.folder = Path(folder)
        self.report = read_report(self.folder)
        self.title = self.report.get("title") or self.folder.name

    def heading(self, what):
        """The scene's title and what is drawn, on two lines where one would be too long."""
        return f"{self.title}:{' ' if len(self.title) + len(what) < 60 else chr(10)}{what}"

    def stage(self, name):
        entry = self.report.get(name, {})
        outcome = entry.get("outcome", "missing")
        if outcome in ("off", "skipped", "missing"):
            raise Skip(f"{name} {outcome}" + (f": {entry['reason']}" if entry.get("reason") else ""))
        return entry

    def series(self, group, name):
        file = self.folder / "history.h5"
        if not file.exists():
            raise Skip("there is no history.h5")
        with h5py.File(file) as history:
            if f"{group}/{name}" not in history:
                raise Skip(f"history.h5 has no {group}/{name}")
            return history[f"{group}/{name}"][()]

    def probes(self, group):
        with h5py.File(self.folder / "history.h5") as history:
            return {name: values[()] for name, values in history.get(f"{group}/probes", {}).items()}

    def period(self):
        """Of the mode that is followed [s]."""
        modes = [mode for mode in self.stage("modes").get("modes", []) if mode["frequency_hz"] > 0]
        if not modes:
            raise Skip("no mode oscillates: there is no period to average over")
        return 1 / modes[0]["frequency_hz"]  # largest growth first

    def converged_cycle(self):
        cycle = self.report.get("cycle", {})
        return cycle if cycle.get("outcome") == "converged" else {}
