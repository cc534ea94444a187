"""Many runs of a scene, one after the other, with a bar of progress."""

import itertools
import math
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from squeal.common import SquealError
from squeal.results import Results, table
from squeal.runs import run
from squeal.scene import Scene, scene_file

if TYPE_CHECKING:
    import pandas

WIDTH = 30  # of the bar, in characters


class Study:
    """Points and the run of each; a point that failed has an error in place of a run."""

    def __init__(self, points: Sequence[Mapping[str, Any]]) -> None:
        self.points = list(points)
        self.runs: list[Results | None] = [None] * len(self.points)
        self.errors: dict[int, SquealError] = {}

    def __len__(self) -> int:
        return len(self.points)

    def __iter__(self):
        return iter(self.runs)

    def __repr__(self) -> str:
        done = sum(found is not None for found in self.runs)
        return f"Study of {len(self)} points: {done} runs, {len(self.errors)} failed"

    def table(self, **columns: Callable[[Results], Any]) -> "pandas.DataFrame":
        """A row a point: its numbers, then a column for each function of Results; NaN where the run failed or has no such data."""
        values = {key: [point.get(key, math.nan) for point in self.points] for key in self._keys()}
        for name, function in columns.items():
            values[name] = [_known(function, found) for found in self.runs]
        return table(values)

    def _keys(self) -> list[str]:
        return list(dict.fromkeys(key for point in self.points for key in point))


def _known(function: Callable[[Results], Any], found: Results | None) -> Any:
    try:
        return math.nan if found is None else function(found)
    except (SquealError, KeyError):
        return math.nan


class Bar:
    """Progress on a line of its own, written over on a terminal and in a notebook; elsewhere a line a point."""

    def __init__(self, count: int, stream: TextIO) -> None:
        self.count, self.stream, self.start = count, stream, time.monotonic()
        self.over = stream.isatty() or "ipykernel" in sys.modules

    def show(self, done: int, word: str) -> None:
        """done: points that have ended; word: what happens now."""
        filled = WIDTH * done // max(1, self.count)
        spent = time.monotonic() - self.start
        left = f", {spent / done * (self.count - done):.0f} s left" if 0 < done < self.count else ""
        text = f"[{'#' * filled}{'.' * (WIDTH - filled)}] {done}/{self.count}, {spent:.0f} s{left}  {word}"
        self.stream.write(f"\r{text[:118]:<118}" if self.over else text.rstrip() + "\n")
        if self.over and done == self.count:
            self.stream.write("\n")
        self.stream.flush()


def points_of(values: Mapping[str, Iterable[Any]] | Iterable[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Points as they are given, or all combinations of lists of values by key."""
    if isinstance(values, Mapping):
        return [dict(zip(values, point)) for point in itertools.product(*values.values())]
    return [dict(point) for point in values]


def study(scene: str | Path | Scene, values: Mapping[str, Iterable[Any]] | Iterable[Mapping[str, Any]], ranks: int = 1,
          options: Iterable[Any] = (), output: str | Path | None = None, limit: float | None = None,
          progress: TextIO | None = sys.stderr) -> Study:
    """Runs a scene at each point: all combinations of lists of values by key, or a list of dicts of values.

    A point that fails is kept as an error, and the others go on. Runs go to output/1, output/2 …, else to
    results/<scene>_study. progress: where the bar goes; None shows none. For what a mesh does not depend on, [sweep] of a scene
    is one run instead, and follows the modes.
    """
    points, options = points_of(values), list(options)
    found = Study(points)
    name = scene.name if isinstance(scene, Scene) else scene_file(scene).resolve().parent.name
    folder = Path(output) if output else Path("results") / f"{name}_study"
    bar = Bar(len(points), progress) if progress else None
    for number, point in enumerate(points):
        if bar:
            bar.show(number, " ".join(f"{key}={value}" for key, value in point.items()))
        try:
            found.runs[number] = run(scene, point, ranks, options, folder / str(number + 1), limit)
        except SquealError as error:
            found.errors[number] = error
    if bar:
        bar.show(len(points), f"{len(found.errors)} failed" if found.errors else "")
    return found
