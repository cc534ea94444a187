"""Runs of a scene on finer and finer meshes until the bars of its growth rates are small: by sizes from an estimate of the error,
by a number of the geometry, or by dividing every element."""

import re
import shutil
import subprocess
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from squeal.common import SquealError, program
from squeal.mesh_estimate import MeshEstimate, estimate
from squeal.mesh_sizes import elements_foreseen, left_open, wanted_factors, write_sizes
from squeal.results import Missing, Results
from squeal.runs import environment, run
from squeal.scene import Scene, is_geometry

STUDIES = ("transient", "cycle", "branch", "sweep", "response", "robustness", "uncertain", "change", "initial")
STEPS = 12  # at most
MARGIN = 0.9  # the first mesh is aimed at the bar asked for, and each later one lower by this
MORE = 2.5  # times as many elements in a step by sizes, at most: the estimate of a mesh tells little of one much finer
UNIFORM = 2**(-1 / 3)  # factor on all sizes of a step of the uniform path: twice the elements


class Ended(SquealError):
    """The path ended before the bar was small enough."""


@dataclass
class Step:
    """A mesh of a path, and what it left open."""

    dofs: int
    modes: list[dict[str, Any]]  # of modes.mesh_error, those that are asked about
    words: str  # how the mesh was made
    folder: Path

    def ratio(self, mode: dict[str, Any]) -> float:
        """The bar over the growth rate."""
        growth = abs(mode["corrected_growth_rate"])
        return mode["growth_error"] / growth if growth > 0 else np.inf

    @property
    def worst(self) -> float:
        return max(map(self.ratio, self.modes))


@dataclass
class Mesh:
    """Overrides of the scene that make a mesh, and how to say so."""

    overrides: dict[str, Any]
    words: str


def scene_of_modes(scene: str | Path) -> Scene:
    """The scene without what does not bear on its modes, with left vectors and the bar of a finer mesh."""
    result = Scene(scene)
    if "mesh" not in result:
        raise SquealError(f"{result.file}: the scene has no mesh that could be refined")
    for table in STUDIES:
        result.pop(table, None)
    result["modes"] = dict(result.get("modes", {}), mesh_error="refinement")
    result["estimate"] = {"enabled": False}
    result["sensitivity"] = {"numbers": ["part.0.density"]}  # the left vectors are wanted; one number is enough
    return result


class Converging:
    """A scene, what is asked of it, and where its runs go."""

    def __init__(self, scene: str | Path, part: float, most: int, ranks: int, options: Sequence[str], output: Path) -> None:
        """part: of each growth rate that its bar may be. most: degrees of freedom that a run may have."""
        self.scene, self.part, self.most, self.ranks, self.options, self.output = (
            scene_of_modes(scene), part, most, ranks, list(options), output)
        self.place = self.scene.file
        output.mkdir(parents=True, exist_ok=True)
        self.file = self.scene.save(output / "scene.toml")

    def model_of(self, mesh: Mesh) -> tuple[int, int]:
        """Degrees of freedom and elements, by a dry run."""
        words = [str(word) for word in (program(), self.file, *self.options, "--dry-run")]
        for key, value in mesh.overrides.items():
            words += ["--set", f"{key}={value}"]
        done = subprocess.run(words, capture_output=True, text=True, env=environment())
        found = re.search(r"(\d+) degrees of freedom, .*?(\d+) elements", done.stdout)
        if not found:
            raise SquealError(f"{' '.join(words)}\n{done.stderr.strip()}")
        return int(found[1]), int(found[2])

    def step(self, name: str, mesh: Mesh) -> Step:
        """Runs a mesh. Ended: it is too large, or its finer mesh is, or a mode was not found on it."""
        dofs, _ = self.model_of(mesh)
        if dofs > self.most:
            raise Ended(f"the next mesh has {dofs} degrees of freedom, and --most {self.most} allows no more")
        shapes = ["-modes_shapes", "all"]  # of the stable mode nearest to growing, too
        results = run(self.file, mesh.overrides, self.ranks, [*shapes, *self.options], self.output / name)
        error = results.report["modes"].get("mesh_error", {})
        if error.get("outcome") != "converged":
            stage = next((f"{stage} {entry['outcome']}: {entry.get('reason', '')}" for stage, entry in results.report.items()
                          if isinstance(entry, dict) and entry.get("outcome") in ("no equilibrium", "not converged")), "")
            raise Ended(f"at {dofs} degrees of freedom the bar is not known: {error.get('reason') or stage}")
        known = [mode for mode in error["modes"] if "growth_error" in mode]
        asked = [mode for mode in known if mode["growth_rate"] > 0] or known[:1]
        if not asked:
            raise Ended(f"at {dofs} degrees of freedom no mode oscillates")
        return Step(dofs, asked, mesh.words, self.output / name)

    def is_met(self, step: Step) -> bool:
        return step.worst <= self.part

    def sized(self, name: str, found: MeshEstimate, factors: list[np.ndarray], words: str) -> tuple[Mesh, int]:
        """A mesh by sizes, scaled until it has the elements that these foresee, and its number of elements."""
        file = self.output / f"{name}.pos"
        mesh, wanted, scale = Mesh({"mesh.size_field": file.resolve()}, words), elements_foreseen(factors), 1.0
        for _ in range(4):
            write_sizes(file, found, [scale * factor for factor in factors], self.scene["mesh"].get("scale", 1), str(self.scene.get("title", "")))
            _, elements = self.model_of(mesh)
            if abs(elements / wanted - 1) < 0.07:
                break
            scale *= (elements / wanted)**(1 / 3)
        return mesh, elements

    def takes_sizes(self, found: MeshEstimate) -> bool:
        """Whether the geometry's mesh changes with its sizes."""
        if self.scene["mesh"].get("refine", 0) or not is_geometry(self.scene["mesh"]["file"]):
            return False
        file = self.output / "half.pos"
        write_sizes(file, found, [np.full(len(block.cells), 0.5) for block in found.blocks], self.scene["mesh"].get("scale", 1), "")
        before, after = (self.model_of(Mesh(sizes, ""))[1] for sizes in ({}, {"mesh.size_field": file.resolve()}))
        file.unlink()
        return before != after


def path(first: Step, next_mesh: Callable[[int, Step], Mesh], work: Converging, name: str,
         tell: Callable[[Step], None]) -> tuple[list[Step], str]:
    """Steps from a first one until the bar is met, and why it ended before; empty where it is met."""
    steps = [first]
    while not work.is_met(steps[-1]):
        if len(steps) == STEPS:
            return steps, f"{STEPS} meshes did not do"
        try:
            steps.append(work.step(f"{name}_{len(steps)}", next_mesh(len(steps), steps[-1])))
        except (Ended, Missing) as reason:
            return steps, str(reason)
        tell(steps[-1])
    return steps, ""


def by_sizes(work: Converging) -> Callable[[int, Step], Mesh]:
    """The mesh that the estimate of the step before asks for."""
    def next_mesh(number: int, before: Step) -> Mesh:
        found = estimate(Results(before.folder))
        left = {mode: MARGIN**(number - 1) * part for mode, part in left_open(found, work.part).items()}
        most = MORE * sum(len(block.cells) for block in found.blocks)
        while elements_foreseen(factors := wanted_factors(found, left)) > most:
            left = {mode: max(part, part**0.9) for mode, part in left.items()}
        return work.sized(f"sizes_{number}", found, factors, "sizes by the estimate")[0]
    return next_mesh


def by_all_sizes(work: Converging, first: Step) -> Callable[[int, Step], Mesh]:
    """The first mesh's sizes, smaller by one factor everywhere."""
    found = estimate(Results(first.folder))
    def next_mesh(number: int, before: Step) -> Mesh:
        factors = [np.full(len(block.cells), UNIFORM**number) for block in found.blocks]
        return work.sized(f"all_sizes_{number}", found, factors, "all sizes alike")[0]
    return next_mesh


def by_key(work: Converging, key: str, order: int) -> Callable[[int, Step], Mesh]:
    """A number of the geometry, raised as the bar asks for if it goes with this order."""
    try:
        value = [work.scene.get_key(key)]
    except SquealError:
        raise SquealError(f"{work.place}: it gives {key} no value that could be raised: write the present one there") from None
    def next_mesh(number: int, before: Step) -> Mesh:
        factor = min((before.worst / (MARGIN**(number - 1) * work.part))**(1 / order), 1.5)
        value[0] = max(value[0] + 1, int(np.ceil(factor * value[0])))
        return Mesh({key: value[0]}, f"{key} = {value[0]}")
    return next_mesh


def by_division(work: Converging) -> Callable[[int, Step], Mesh]:
    """Every element divided once more."""
    before = work.scene["mesh"].get("refine", 0)
    return lambda number, _: Mesh({"mesh.refine": before + number}, f"mesh.refine = {before + number}")


def clear(output: Path, names: Iterable[str]) -> None:
    """Removes what an earlier path left of these."""
    for name in names:
        for place in output.glob(f"{name}_*"):
            shutil.rmtree(place) if place.is_dir() else place.unlink()
