"""squeal from Python: runs a scene, and reads what a run found.

    sys.path.insert(0, "tools")
    import squeal

    results = squeal.run("inputs/pin_on_disc", {"friction.coefficient": 0.25}, ranks=2)
    results.report["cycle"]["frequency_hz"]  # every number of report.json
    results.modes()                          # tables: of modes, pairs, sweep, thresholds, derivatives, samples …
    results.shape(1)                         # complex displacements of a mode, node by node
    results.probes("cycle")                  # arrays against results.series("cycle", "time")

results = squeal.Results("results/pin_on_disc") reads a run made before. Tables are pandas' DataFrames. What a run did not
compute raises Missing, what goes wrong SquealError.
"""

import csv
import functools
import json
import subprocess
from pathlib import Path

import common

common.needs("h5py", "numpy")
import h5py
import numpy as np
from common import PROGRAM, ROOT, SquealError

FORMAT_VERSION = 1  # of report.json and the HDF5 files, the latest that is read


class Missing(SquealError):
    """What this run has no data for, and why."""


class TookTooLong(SquealError):
    """A run was stopped at its limit of time."""


def pandas():
    """The module, where a table is asked for: tools that make none do without."""
    try:
        import pandas
    except ImportError:
        raise SquealError("tables need the python module pandas; tools/setup installs it") from None
    return pandas


def table(columns):
    """A pandas.DataFrame of columns by name."""
    return pandas().DataFrame({name: list(values) for name, values in columns.items()})


def table_of(records):
    """A table of dicts, a row each; what one lacks is NaN."""
    return pandas().DataFrame.from_records(records)


@functools.cache
def environment():
    """Settings of Open MPI and BLAS, those of tools/environment."""
    words = ["bash", "-c", '. "$1" && env -0', "bash", str(ROOT / "tools" / "environment")]
    text = subprocess.run(words, check=True, capture_output=True, text=True).stdout
    return dict(entry.partition("=")[::2] for entry in text.split("\0") if entry)


def scene_file(scene):
    """A folder's scene.toml, or the file itself."""
    scene = Path(scene)
    return scene / "scene.toml" if scene.is_dir() else scene


def run(scene, overrides=None, ranks=1, options=(), output=None, limit=None):
    """Runs a scene, a folder or a file, and returns its Results, also where a stage reached none (results.exit_code).

    overrides: values of the scene's keys. options: further words of the command line. output: the results folder, else
    results/<scene>. limit: seconds after which the run is stopped, which raises TookTooLong.
    """
    if not PROGRAM.exists():
        raise SquealError(f"{PROGRAM} is missing: tools/build makes it, or say where it is by SQUEAL=FILE")
    file = scene_file(scene)
    name = file.stem if file.name != "scene.toml" else file.resolve().parent.name
    output = Path(output) if output else Path("results") / name
    command = [*(["mpirun", "-n", ranks] if ranks > 1 else []), PROGRAM, file, *options, "--output", output]
    for key, value in (overrides or {}).items():
        command += ["--set", f"{key}={toml(value)}"]
    command = [str(word) for word in command]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=limit, env=environment())
    except subprocess.TimeoutExpired:
        raise TookTooLong(f"{' '.join(command)}: stopped after {limit:g} s") from None
    if done.returncode not in (0, 2, 3):
        raise SquealError(f"{' '.join(command)}\n{done.stderr.strip()}")
    return Results(output)


def toml(value):
    """A value of Python's as --set takes it; a text stays as it is, but within lists and tables."""
    def inner(part):
        return json.dumps(part) if isinstance(part, str) else toml(part)

    if isinstance(value, (bool, np.bool_)):
        return str(value).lower()
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(key)} = {inner(part)}" for key, part in value.items()) + "}"
    if isinstance(value, (list, tuple, np.ndarray)):
        return "[" + ",".join(map(inner, value)) + "]"
    return str(value)


def number_label(key, name="", unit="-"):
    """A number of a scene as a reader knows it: its key, the name of what the key calls by its place, its unit."""
    return key + (f" ({name})" if name else "") + (f" [{unit}]" if unit != "-" else "")


def read_report(folder):
    """report.json of a results folder; an error where it cannot be read, or other files are of another run."""
    folder = Path(folder)
    file = folder / "report.json"
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


def head_of(file):
    """The first bytes of a file, where the identity of its run stands."""
    with open(file, "rb") as content:
        return content.read(65536)


class Results:
    """A results folder: the numbers of its report, and the arrays of its HDF5 files."""

    def __init__(self, folder):
        self.folder = Path(folder)
        self.report = read_report(self.folder)
        self.title = self.report.get("title") or self.folder.name

    @property
    def exit_code(self):
        return self.report["exit_code"]

    def stage(self, name):
        """The report of a stage that ran."""
        entry = self.report.get(name, {})
        outcome = entry.get("outcome", "missing")
        if outcome in ("off", "skipped", "missing"):
            raise Missing(f"{name} {outcome}" + (f": {entry['reason']}" if entry.get("reason") else ""))
        return entry

    def _array(self, file, name):
        if not (self.folder / file).exists():
            raise Missing(f"there is no {file}")
        with h5py.File(self.folder / file) as content:
            if name not in content:
                raise Missing(f"{file} has no {name}")
            return content[name][()]

    def _names(self, file, group):
        if not (self.folder / file).exists():
            return []
        with h5py.File(self.folder / file) as content:
            return list(content.get(group, ()))

    def field(self, name):
        """A data set of fields.h5."""
        return self._array("fields.h5", name)

    def series(self, run, name):
        """A data set of history.h5; run: transient, cycle or settled."""
        values = self._array("history.h5", f"{run}/{name}")
        if len(values) == 0:
            raise Missing(f"{run}: no step was made")
        return values

    def probes(self, run):
        """Displacements of the probes [m], by name; empty where the run made no step."""
        return {name: self.series(run, f"probes/{name}") for name in self._names("history.h5", f"{run}/probes")}

    def responses(self):
        """Frequencies [Hz], and complex receptances [m/N] by the names of the probe that is driven and the one that is read."""
        driven = dict.fromkeys(peak["excitation"] for peak in self.stage("response")["peaks"])
        read = dict.fromkeys(peak["probe"] for peak in self.stage("response")["peaks"])
        values = {(i, j): self.series("response", f"receptance/{i}/{j}") for i in driven for j in read}
        return self.series("response", "frequency"), {pair: h[:, 0] + 1j * h[:, 1] for pair, h in values.items()}

    @property
    def nodes(self):
        """Positions [m], one node a row."""
        return self.field("mesh/nodes")

    def mode_numbers(self):
        """Those of the modes whose shapes are there: the unstable ones, or all with -modes_shapes all."""
        return sorted(map(int, self._names("fields.h5", "modes")))

    def shape(self, number):
        """Complex displacements of a mode, one node a row; modes count from 1, by falling growth rate."""
        if number not in self.mode_numbers():
            remedy = "-modes_shapes all keeps those of all modes" if self._names("fields.h5", "mesh") else "a scene of matrices has none"
            raise Missing(f"there is no shape of mode {number}: {remedy}")
        return self.field(f"modes/{number}/real") + 1j * self.field(f"modes/{number}/imaginary")

    def motion(self):
        """Times [s] and displacements [m] over one period of the cycle, as (sample, node, component)."""
        count = sum(name.startswith("displacement_") for name in self._names("fields.h5", "cycle"))
        if count == 0:
            raise Missing("there is no motion of a cycle")
        cycle = self.stage("cycle")
        steps = cycle["steps_per_period"]
        time = np.ceil(np.arange(1, count + 1) * steps / count) * cycle["period"] / steps
        return time, np.stack([self.field(f"cycle/displacement_{i}") for i in range(count)])

    def settled_shapes(self):
        """Times [s], coordinates [m/s kg^1/2] as (sample, shape) and shapes [kg^-1/2] as (shape, node, component) of a settled
        motion: its velocity is the sum of coordinates times shapes."""
        self.stage("settled")
        time, coordinates = self.series("settled", "shapes/time"), self.series("settled", "shapes/coordinate")
        return time, coordinates, np.stack([self.field(f"settled/shape_{k + 1}") for k in range(coordinates.shape[1])])

    def modes(self):
        """A row a mode: frequency_hz, growth_rate, damping_ratio, backward_error, unstable."""
        return table_of(self.stage("modes").get("modes", []))

    def multipliers(self):
        """A row a Floquet multiplier of the cycle: real, imaginary, error."""
        return table_of(self.stage("cycle").get("multipliers", {}).get("values", []))

    def iterations(self):
        """A row an iteration of the shooting: stage, periods, period and residuals."""
        return table_of(self.stage("cycle").get("newton", []))

    def _csv(self, stage):
        """The table of a stage in a file of its own."""
        self.stage(stage)
        return pandas().read_csv(self.folder / f"{stage}.csv")

    def lines(self, stage):
        """The lines of the same file as dicts of texts, without pandas."""
        self.stage(stage)
        with open(self.folder / f"{stage}.csv", newline="") as file:
            return list(csv.DictReader(file))

    def sweep(self):
        """A row a mode of a point: the swept numbers, direction, track, frequency_hz, growth_rate and more."""
        return self._csv("sweep")

    def thresholds(self):
        """A row a threshold of a sweep: the swept numbers, direction, error, track, frequency_hz, change."""
        sweep = self.stage("sweep")
        return table_of([dict(zip(sweep["keys"], entry["values"])) | {k: v for k, v in entry.items() if k != "values"}
                         for entry in sweep.get("thresholds", [])])

    def derivatives(self):
        """A row a number of the scene for each unstable mode: mode, key, value, growth_rate_by, frequency_hz_by, name."""
        return self._of_sensitive_modes("derivatives")

    def energy_shares(self):
        """A row a part, body, spring or compliant contact for each unstable mode: mode, table, name, kinetic and strain."""
        return self._of_sensitive_modes("shares")

    def changes(self):
        """A row a [[change]] for each unstable mode: mode, probe, what is added, predicted and computed growth rate."""
        return self._of_sensitive_modes("changes")

    def _of_sensitive_modes(self, what):
        return table_of([{"mode": number} | entry for number, mode in enumerate(self.stage("sensitivity")["modes"], 1)
                         for entry in mode.get(what, [])])

    def samples(self):
        """A row a random sample: its numbers, unstable_modes, growth_rate, frequency_hz and mode."""
        return self._csv("robustness")

    def squeal_probabilities(self):
        """A row a mode that is unstable in some sample: probability with its bounds, growth rates and frequencies."""
        return table_of(self.stage("robustness")["modes"])

    def pairs(self):
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

    def followed_period(self):
        """Of the mode that grows fastest [s]."""
        modes = [mode for mode in self.stage("modes").get("modes", []) if mode["frequency_hz"] > 0]
        if not modes:
            raise Missing("no mode oscillates: there is no period to average over")
        return 1 / modes[0]["frequency_hz"]  # largest growth first

    def followed_frequency(self):
        return 1 / self.followed_period()

    def periodic(self):
        """The report of a cycle that closes, whether it attracts or repels; Missing where none was found."""
        cycle = self.stage("cycle")
        if cycle["outcome"] not in ("converged", "unstable cycle"):
            raise Missing(f"there is no limit cycle: {cycle['outcome']}")
        return cycle

    def converged_cycle(self):
        cycle = self.report.get("cycle", {})
        return cycle if cycle.get("outcome") == "converged" else {}
