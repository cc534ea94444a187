"""Runs of the program."""

import functools
import subprocess
import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from squeal.common import SETTINGS, SquealError, program
from squeal.results import Results
from squeal.scene import Scene, scene_file, toml


class TookTooLong(SquealError):
    """A run was stopped at its limit of time."""


@functools.cache
def environment() -> dict[str, str]:
    """Settings of Open MPI and BLAS, those of tools/environment."""
    words = ["bash", "-c", '. "$1" && env -0', "bash", str(SETTINGS)]
    text = subprocess.run(words, check=True, capture_output=True, text=True).stdout
    return dict(entry.partition("=")[::2] for entry in text.split("\0") if entry)


def run(scene: str | Path | Scene, overrides: Mapping[str, Any] | None = None, ranks: int = 1, options: Iterable[Any] = (),
        output: str | Path | None = None, limit: float | None = None) -> Results:
    """Runs a scene, a Scene, folder or file, and returns its Results, also where a stage reached none (results.exit_code).

    overrides: values of the scene's keys. options: further words of the command line. output: the results folder, else
    results/<scene>. limit: seconds after which the run is stopped, which raises TookTooLong.
    """
    if isinstance(scene, Scene):
        with tempfile.TemporaryDirectory(prefix="squeal_") as folder:
            return run(scene.save(folder), overrides, ranks, options, output or Path("results") / scene.name, limit)
    file = scene_file(scene)
    name = file.stem if file.name != "scene.toml" else file.resolve().parent.name
    output = Path(output) if output else Path("results") / name
    command = [*(["mpirun", "-n", ranks] if ranks > 1 else []), program(), file, *options, "--output", output]
    for key, value in (overrides or {}).items():
        command += ["--set", f"{key}={toml(value)}"]
    command = [str(word) for word in command]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=limit, env=environment())
    except subprocess.TimeoutExpired:
        raise TookTooLong(f"{' '.join(command)}: stopped after {limit:g} s") from None
    except FileNotFoundError as error:
        raise SquealError(f"{error.filename} is missing: runs of several ranks need it") from None
    if done.returncode not in (0, 2, 3):
        raise SquealError(f"{' '.join(command)}\n{done.stderr.strip()}")
    return Results(output)


