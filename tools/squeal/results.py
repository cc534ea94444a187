"""Results of a run: the numbers of its report, and the arrays of its HDF5 files."""

import csv
import html
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np
from squeal.common import SquealError

if TYPE_CHECKING:
    import pandas as pd
    import pyvista as pv
    import xarray as xr

FORMAT_VERSION = 1  # of report.json and the HDF5 files, the latest that is read


class Missing(SquealError):
    """What this run has no data for, and why."""


def pandas() -> ModuleType:
    """The module, where a table is asked for: tools that make none do without."""
    try:
        import pandas
    except ImportError:
        raise SquealError("tables need the python module pandas; tools/setup installs it") from None
    return pandas


def table(columns: Mapping[str, Iterable[Any]]) -> "pd.DataFrame":
    """A pandas.DataFrame of columns by name."""
    return pandas().DataFrame({name: list(values) for name, values in columns.items()})


def table_of(records: Iterable[Mapping[str, Any]]) -> "pd.DataFrame":
    """A table of dicts, a row each; what one lacks is NaN."""
    return pandas().DataFrame.from_records(records)


def number_label(key: str, name: str = "", unit: str = "-") -> str:
    """A number of a scene as a reader knows it: its key, the name of what the key calls by its place, its unit."""
    return key + (f" ({name})" if name not in ("", key) else "") + (f" [{unit}]" if unit != "-" else "")


def hertz(frequency: float) -> str:
    """A frequency with four significant digits, five from 1000 Hz on."""
    return f"{frequency:.5g} Hz" if 1000 <= abs(frequency) < 1e5 else f"{frequency:.4g} Hz"


def read_report(folder: str | Path) -> dict[str, Any]:
    """report.json of a results folder; an error where it cannot be read, or other files are of another run."""
    folder = Path(folder)
    file = folder / "report.json"
    if not folder.exists():
        near = [other for other in folder.parent.glob("*") if (other / "report.json").exists()]
        known = f"; results are in {', '.join(map(str, sorted(near)[:5]))}" if near else ""
        raise SquealError(f"there is no folder {folder}{known}")
    if not file.exists():
        raise SquealError(f"{folder} has no report.json: it is no results folder, or its run goes on or was killed; "
                          f"what that has is in {folder}/.partial")
    try:
        report = json.loads(file.read_text())
    except json.JSONDecodeError as error:
        raise SquealError(f"{file} is no JSON: {error}") from None
    if report.get("format_version", 0) > FORMAT_VERSION:
        raise SquealError(f"{file} has format_version {report['format_version']}, these tools read up to "
                          f"{FORMAT_VERSION}: take the tools of the squeal that wrote it")
    for name in ("history.h5", "fields.h5", "fields.xdmf", "resolved.toml", "options.txt"):
        if (folder / name).exists() and "run" in report and report["run"].encode() not in head_of(folder / name):
            raise SquealError(f"{file} is of the run {report['run']}, and {name} beside it is of another one: "
                              "run squeal again, or copy all files of one run")
    return report


def head_of(file: str | Path) -> bytes:
    """The first bytes of a file, where the identity of its run stands."""
    with open(file, "rb") as content:
        return content.read(65536)


class Results:
    """A results folder: the numbers of its report, and the arrays of its HDF5 files."""

    def __init__(self, folder: str | Path) -> None:
        self.folder = Path(folder)
        self.report = read_report(self.folder)
        self.title = self.report.get("title") or self.folder.name

    def __repr__(self) -> str:
        return f"Results({str(self.folder)!r}): {self.title}; " + "; ".join(" ".join(filter(None, row)) for row in self._answers())

    def _repr_html_(self) -> str:
        """As a notebook shows it."""
        rows = "".join("<tr>" + "".join(f"<td>{html.escape(word)}</td>" for word in row) + "</tr>" for row in self._answers())
        return f"<b>{html.escape(self.title)}</b> <code>{html.escape(str(self.folder))}</code><table>{rows}</table>"

    def _answers(self) -> list[tuple[str, str, str]]:
        """A row a stage that was asked for: its name, its outcome, its answer."""
        rows = [("model", "", f"{self.report['model']['dofs']} degrees of freedom")] if "model" in self.report else []
        for name, entry in self.report.items():
            outcome = entry.get("outcome") if isinstance(entry, dict) else None
            if outcome not in (None, "off"):
                rows.append((name, outcome, self._answer(name, entry)))
        return [*rows, ("exit code", str(self.exit_code), "")]

    @staticmethod
    def _answer(name: str, entry: Mapping[str, Any]) -> str:
        """What a stage says first."""
        if name == "modes":
            unstable = [hertz(mode["frequency_hz"]) for mode in entry.get("modes", []) if mode["unstable"]]
            return f"{len(unstable)} unstable" + (f": {', '.join(unstable[:5])}" if unstable else "")
        if "frequency_hz" in entry:
            return hertz(entry["frequency_hz"])
        return str(entry.get("reason") or "")

    @property
    def exit_code(self) -> int:
        """0: every stage converged, 2: a stage did not, 3: it was asked to end."""
        return self.report["exit_code"]

    def stage(self, name: str) -> dict[str, Any]:
        """The report of a stage that ran."""
        entry = self.report.get(name, {})
        outcome = entry.get("outcome", "missing")
        if outcome in ("off", "skipped", "missing"):
            raise Missing(f"{name} {outcome}" + (f": {entry['reason']}" if entry.get("reason") else ""))
        return entry

    def _array(self, file: str, name: str) -> np.ndarray:
        if not (self.folder / file).exists():
            raise Missing(f"there is no {file}")
        import h5py

        with h5py.File(self.folder / file) as content:
            if name not in content:
                raise Missing(f"{file} has no {name}")
            return content[name][()]

    def _names(self, file: str, group: str) -> list[str]:
        if not (self.folder / file).exists():
            return []
        import h5py

        with h5py.File(self.folder / file) as content:
            return list(content.get(group, ()))

    def field(self, name: str) -> np.ndarray:
        """A data set of fields.h5."""
        return self._array("fields.h5", name)

    def series(self, run: str, name: str) -> np.ndarray:
        """A data set of history.h5; run: transient, cycle or settled."""
        values = self._array("history.h5", f"{run}/{name}")
        if len(values) == 0:
            raise Missing(f"{run}: no step was made")
        return values

    def probes(self, run: str) -> dict[str, np.ndarray]:
        """Displacements of the probes [m], by name; empty where the run made no step."""
        return {name: self.series(run, f"probes/{name}") for name in self._names("history.h5", f"{run}/probes")}

    def responses(self) -> tuple[np.ndarray, dict[tuple[str, str], np.ndarray]]:
        """Frequencies [Hz], and complex receptances [m/N] by the names of the probe that is driven and the one that is read."""
        driven = dict.fromkeys(peak["excitation"] for peak in self.stage("response")["peaks"])
        read = dict.fromkeys(peak["probe"] for peak in self.stage("response")["peaks"])
        values = {(i, j): self.series("response", f"receptance/{i}/{j}") for i in driven for j in read}
        return self.series("response", "frequency"), {pair: h[:, 0] + 1j * h[:, 1] for pair, h in values.items()}

    @property
    def nodes(self) -> np.ndarray:
        """Positions [m], one node a row."""
        return self.field("mesh/nodes")

    def mode_numbers(self) -> list[int]:
        """Those of the modes whose shapes are there: the unstable ones, or all with -modes_shapes all."""
        return sorted(map(int, self._names("fields.h5", "modes")))

    def shape(self, number: int) -> np.ndarray:
        """Complex displacements of a mode, one node a row; modes count from 1, by falling growth rate."""
        if number not in self.mode_numbers():
            remedy = "-modes_shapes all keeps those of all modes" if self._names("fields.h5", "mesh") else "a scene of matrices has none"
            raise Missing(f"there is no shape of mode {number}: {remedy}")
        return self.field(f"modes/{number}/real") + 1j * self.field(f"modes/{number}/imaginary")

    def mesh(self, mode: int | None = None) -> "pv.UnstructuredGrid":
        """The mesh for PyVista; of a mode also real, imaginary and amplitude at each node."""
        try:
            import pyvista
        except ImportError:
            raise SquealError("mesh() needs the python module pyvista: pip install pyvista, or build/python") from None
        from squeal.surface import VTK, elements

        found = [(VTK[code], nodes) for code, nodes in elements(self.field("mesh/topology"))]
        if not found:
            raise Missing("the scene has points, and no elements")
        cells = np.concatenate([[len(nodes), *nodes] for _, nodes in found])
        grid = pyvista.UnstructuredGrid(cells, [kind for kind, _ in found], self.nodes)
        if mode is not None:
            shape = self.shape(mode)
            grid["real"], grid["imaginary"], grid["amplitude"] = shape.real, shape.imag, np.linalg.norm(shape, axis=1)
        return grid

    def motion(self) -> tuple[np.ndarray, np.ndarray]:
        """Times [s] and displacements [m] over one period of the cycle, as (sample, node, component)."""
        count = sum(name.startswith("displacement_") for name in self._names("fields.h5", "cycle"))
        if count == 0:
            raise Missing("there is no motion of a cycle")
        cycle = self.stage("cycle")
        steps = cycle["steps_per_period"]
        time = np.ceil(np.arange(1, count + 1) * steps / count) * cycle["period"] / steps
        return time, np.stack([self.field(f"cycle/displacement_{i}") for i in range(count)])

    def settled_shapes(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Times [s], coordinates [m/s kg^1/2] as (sample, shape) and shapes [kg^-1/2] as (shape, node, component) of a settled
        motion: its velocity is the sum of coordinates times shapes."""
        self.stage("settled")
        time, coordinates = self.series("settled", "shapes/time"), self.series("settled", "shapes/coordinate")
        return time, coordinates, np.stack([self.field(f"settled/shape_{k + 1}") for k in range(coordinates.shape[1])])

    def modes(self) -> "pd.DataFrame":
        """A row a mode: frequency_hz, growth_rate, damping_ratio, backward_error, unstable."""
        return table_of(self.stage("modes").get("modes", []))

    def multipliers(self) -> "pd.DataFrame":
        """A row a Floquet multiplier of the cycle: real, imaginary, error."""
        return table_of(self.stage("cycle").get("multipliers", {}).get("values", []))

    def iterations(self) -> "pd.DataFrame":
        """A row an iteration of the shooting: stage, periods, period and residuals."""
        return table_of(self.stage("cycle").get("newton", []))

    def _csv(self, stage: str) -> "pd.DataFrame":
        """The table of a stage in a file of its own."""
        self.stage(stage)
        return pandas().read_csv(self.folder / f"{stage}.csv")

    def lines(self, stage: str) -> list[dict[str, str]]:
        """The lines of the same file as dicts of texts, without pandas."""
        self.stage(stage)
        with open(self.folder / f"{stage}.csv", newline="") as file:
            return list(csv.DictReader(file))

    def sweep(self) -> "pd.DataFrame":
        """A row a mode of a point: the swept numbers, direction, track, frequency_hz, growth_rate and more."""
        return self._csv("sweep")

    def to_xarray(self) -> "xr.Dataset":
        """The sweep over its numbers, the direction of rotation and the track of each mode; NaN where a point lacks one."""
        try:
            import xarray  # noqa: F401, of pandas's
        except ImportError:
            raise SquealError("to_xarray() needs the python module xarray; tools/setup installs it") from None
        keys, table = self.stage("sweep")["keys"], self.sweep()
        found = table[table["track"].notna()].astype({"track": int}).set_index([*keys, "direction", "track"])
        data = found[["frequency_hz", "growth_rate", "damping_ratio", "backward_error", "mac"]].to_xarray()
        for name, unit in (("frequency_hz", "Hz"), ("growth_rate", "1/s"), *zip(keys, self.stage("sweep").get("units", []))):
            data[name].attrs["units"] = unit
        return data

    def thresholds(self) -> "pd.DataFrame":
        """A row a threshold of a sweep: the swept numbers, direction, error, track, frequency_hz, change."""
        sweep = self.stage("sweep")
        return table_of([dict(zip(sweep["keys"], entry["values"])) | {k: v for k, v in entry.items() if k != "values"}
                         for entry in sweep.get("thresholds", [])])

    def derivatives(self) -> "pd.DataFrame":
        """A row a number of the scene for each unstable mode: mode, key, value, growth_rate_by, frequency_hz_by, name."""
        return self._of_sensitive_modes("derivatives")

    def energy_shares(self) -> "pd.DataFrame":
        """A row a part, body, spring or compliant contact for each unstable mode: mode, table, name, kinetic and strain."""
        return self._of_sensitive_modes("shares")

    def changes(self) -> "pd.DataFrame":
        """A row a [[change]] for each unstable mode: mode, probe, what is added, predicted and computed growth rate."""
        return self._of_sensitive_modes("changes")

    def _of_sensitive_modes(self, what: str) -> "pd.DataFrame":
        return table_of([{"mode": number} | entry for number, mode in enumerate(self.stage("sensitivity")["modes"], 1)
                         for entry in mode.get(what, [])])

    def samples(self) -> "pd.DataFrame":
        """A row a random sample: its numbers, unstable_modes, growth_rate, frequency_hz and mode."""
        return self._csv("robustness")

    def squeal_probabilities(self) -> "pd.DataFrame":
        """A row a mode that is unstable in some sample: probability with its bounds, growth rates and frequencies."""
        return table_of(self.stage("robustness")["modes"])

    def pairs(self) -> "pd.DataFrame":
        """A row a contact pair: node, contact, place, normal, area, gap, pressure and reactions at equilibrium."""
        columns = {name: self.field(f"pairs/{name}") for name in self._names("fields.h5", "pairs")}
        if not columns:
            raise Missing("fields.h5 has no contact pairs")
        split = {"position": ("x", "y", "z"), "reaction": ("normal_reaction", "friction_1", "friction_2"),
                 **{name: [f"{name}_{axis}" for axis in "xyz"] for name in ("normal", "tangent_1", "tangent_2")}}
        flat = {}
        for name, values in columns.items():
            flat |= dict(zip(split[name], values.T)) if name in split else {name: values}
        return table(flat)

    def followed_period(self) -> float:
        """Of the mode that grows fastest [s]."""
        modes = [mode for mode in self.stage("modes").get("modes", []) if mode["frequency_hz"] > 0]
        if not modes:
            raise Missing("no mode oscillates: there is no period to average over")
        return 1 / modes[0]["frequency_hz"]  # largest growth first

    def followed_frequency(self) -> float:
        """Of the same mode [Hz]."""
        return 1 / self.followed_period()

    def periodic(self) -> dict[str, Any]:
        """The report of a cycle that closes, whether it attracts or repels; Missing where none was found."""
        cycle = self.stage("cycle")
        if cycle["outcome"] not in ("converged", "unstable cycle"):
            raise Missing(f"there is no limit cycle: {cycle['outcome']}")
        return cycle

    def converged_cycle(self) -> dict[str, Any]:
        """The report of a cycle that attracts; empty where there is none."""
        cycle = self.report.get("cycle", {})
        return cycle if cycle.get("outcome") == "converged" else {}
