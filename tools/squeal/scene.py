"""A scene as a dict, and values as TOML."""

import json
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
from squeal.common import SquealError

PLACES = ("file", "folder", "gap_file", "size_field", "table")  # keys whose texts are files or folders that are read
# keys whose values are texts or directions, for which no named number stands
TEXTS = frozenset("axis axis_1 axis_2 beam bolts direction directions distribution excitation fidelity file fixed folder free "
                  "gap_file key locked master mesh_error method motions name normal numbers on part probe rotor save_state section size_field "
                  "slave stages start stator surfaces table tangents title".split())
ENDS = ("from", "to")  # names of bodies in tables that join some, numbers in others
JOINING = ("spring", "connector", "beam")


def is_geometry(file: str) -> bool:
    """Whether gmsh meshes this file of a scene's [mesh], which is then no mesh itself."""
    return str(file).endswith((".geo", ".geo_unrolled"))


def with_numbers(scene: dict[str, Any]) -> dict[str, Any]:
    """A scene in which its [numbers] stand in place of their names."""
    numbers = scene.get("numbers", {})
    names = numbers | {f"-{name}": -value for name, value in numbers.items()}
    return {key: _with_names(value, names, key, key) for key, value in scene.items()} if numbers else scene


def _with_names(value: Any, names: dict[str, float], key: str, section: str) -> Any:
    """A value of this key, in a table of this section at the top of the scene."""
    if isinstance(value, dict):
        return {inner: _with_names(part, names, inner, section) for inner, part in value.items()}
    if isinstance(value, list):
        return [_with_names(part, names, key, section) for part in value]
    if not isinstance(value, str) or key in TEXTS or key in ENDS and section in JOINING:
        return value
    return names.get(value, value)


def toml(value: Any) -> str:
    """A value of Python's as --set takes it; a text stays as it is, but within lists and tables."""
    if isinstance(value, (bool, np.bool_)):
        return str(value).lower()
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(key)} = {quoted(part)}" for key, part in value.items()) + "}"
    if isinstance(value, (list, tuple, np.ndarray)):
        return "[" + ",".join(map(quoted, value)) + "]"
    return str(value)


def quoted(value: Any) -> str:
    """A value as it stands in a TOML file: texts in quotes."""
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str) else toml(value)


def is_table(value: Any) -> bool:
    """Whether a value has a head of its own in a file: a dict, or a list of dicts."""
    return isinstance(value, dict) or isinstance(value, list) and bool(value) and all(isinstance(part, dict) for part in value)


def toml_lines(table: dict[str, Any], prefix: str = "") -> list[str]:
    """Lines of a table: its own values, then those that have heads."""
    lines = [f"{key} = {quoted(value)}" for key, value in table.items() if not is_table(value)]
    for key, value in table.items():
        if is_table(value):
            head = f"[{prefix}{key}]" if isinstance(value, dict) else f"[[{prefix}{key}]]"
            for part in [value] if isinstance(value, dict) else value:
                lines += ["", head, *toml_lines(part, f"{prefix}{key}.")]
    return lines


def scene_file(scene: str | Path) -> Path:
    """A folder's scene.toml, or the file itself."""
    scene = Path(scene)
    return scene / "scene.toml" if scene.is_dir() else scene


class Scene(dict[str, Any]):
    """A scene as a nested dict that can be edited, run and saved; comments of its file are not kept."""

    def __init__(self, scene: str | Path) -> None:
        """scene: a folder or a file."""
        self.file = scene_file(scene).resolve()
        try:
            super().__init__(tomllib.loads(self.file.read_text(encoding="utf-8")))
        except OSError as error:
            raise SquealError(f"{self.file}: {error.strerror}") from None
        except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
            raise SquealError(f"{self.file}: {error}") from None

    @property
    def name(self) -> str:
        """That of its folder, or of its file."""
        return self.file.stem if self.file.name != "scene.toml" else self.file.parent.name

    def get_key(self, key: str) -> Any:
        """Value of a key with dots, as --set names it: force.0.vector."""
        place: Any = self
        for word in key.split("."):
            place = self._step(place, word, key)
        return place

    def set(self, key: str, value: Any) -> "Scene":
        """Gives a key with dots a value, and makes tables that are not there yet; returns the scene."""
        *before, last = key.split(".")
        place: Any = self
        for word in before:
            place = place.setdefault(word, {}) if isinstance(place, dict) else self._step(place, word, key)
        if isinstance(place, dict):
            place[last] = value
        else:
            self._step(place, last, key)
            place[int(last)] = value
        return self

    def _step(self, place: Any, word: str, key: str) -> Any:
        try:
            return place[int(word) if isinstance(place, list) else word]
        except (KeyError, IndexError, ValueError, TypeError):
            raise SquealError(f"{self.file}: there is no {key}: nothing is called {word}") from None

    def save(self, target: str | Path) -> Path:
        """Writes it to a .toml file, or to scene.toml in a folder, which is made; files that it names stay where they are."""
        file = Path(target)
        file = file if file.suffix == ".toml" else file / "scene.toml"
        file.parent.mkdir(parents=True, exist_ok=True)
        elsewhere = file.parent.resolve() != self.file.parent
        values = self._with_places(dict(self)) if elsewhere else self
        file.write_text("\n".join(toml_lines(values)) + "\n", encoding="utf-8")
        return file

    def _with_places(self, value: Any) -> Any:
        """A value in which the files that it reads have whole paths."""
        if isinstance(value, dict):
            return {key: str((self.file.parent / part).resolve()) if key in PLACES and isinstance(part, str) else
                    self._with_places(part) for key, part in value.items()}
        return [self._with_places(part) for part in value] if isinstance(value, list) else value
