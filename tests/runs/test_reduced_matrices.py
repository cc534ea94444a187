"""The brake reduced to its modes and attachment shapes, written as a matrix scene and read again."""

import numpy as np
import pytest
from conftest import INPUTS

PIN = [INPUTS / "pin_on_disc" / "scene.toml", "--set", "cycle.enabled=false", "--set", "transient.enabled=false", "--set",
       "modes.method=full"]


def vectors_of(file):
    """The vectors of a PETSc binary file, one after the other."""
    bytes_, vectors = file.read_bytes(), []
    while bytes_:
        identity, length = np.frombuffer(bytes_, ">i4", 2)
        assert identity == 1211214
        vectors.append(np.frombuffer(bytes_, ">f8", length, 8))
        bytes_ = bytes_[8 + 8 * length :]
    return np.array(vectors)


@pytest.mark.parametrize("mu", [0.3, 0.5])
def test_reduced_matrices_are_the_brake_about_its_equilibrium(converged, mu):
    pin = converged(*PIN, "--set", "modes.reduced_matrices=true", "--set", f"friction.coefficient={mu}", ranks=2)
    folder = pin.output / "reduced"
    scene = pin.output / "again.toml"
    scene.write_text(f'[matrices]\nfolder = "reduced"\n[friction]\ncoefficient = {mu}\n[modes]\nband = 20000\nmethod = "full"\n')
    again = converged(scene, ranks=1)
    # rest in the coordinates of the shapes, with the reactions of the brake: exact to two factorisations
    first, second = pin.report["equilibrium"], again.report["equilibrium"]
    assert second["closed"] == first["closed"]
    for entry in ("normal_force_sum", "normal_force_min", "normal_force_max"):
        assert second[entry] == pytest.approx(first[entry], rel=1e-7)
    # the modes of the full problem are among the shapes: the backward errors of both remain
    first, second = pin.report["modes"]["modes"], again.report["modes"]["modes"]
    assert len(second) == len(first)
    for one, other in zip(first, second):
        size = 2 * np.pi * one["frequency_hz"]
        assert abs(other["frequency_hz"] - one["frequency_hz"]) < 1e-8 * one["frequency_hz"]
        assert abs(other["growth_rate"] - one["growth_rate"]) < 1e-8 * size
    # lifted back, the shapes are motions of the brake in the order of its state files
    shapes, rest = vectors_of(folder / "shapes.petsc"), vectors_of(folder / "u0.petsc")
    assert shapes.shape[1] == rest.shape[1] == pin.report["model"]["dofs"]
    assert shapes.shape[0] == again.report["model"]["dofs"]
