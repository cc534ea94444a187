"""Scenes that can be computed but hardly be meant are refused, or warned of where a rare case may want them."""

import shutil
from xml.etree import ElementTree

import numpy as np
import pytest
from conftest import INPUTS
from models import STEEL, Mesh, bricks, bricks20, lattice, write_matrices, write_scene
from test_mesher import brick_scene, refused

OSCILLATOR = INPUTS / "oscillator" / "scene.toml"


def with_mass(folder, M):
    """The oscillator as matrices, with this mass matrix."""
    shutil.copytree(INPUTS / "oscillator" / "matrices", folder / "matrices")
    shutil.copy(INPUTS / "oscillator" / "matrices.toml", folder / "scene.toml")
    write_matrices(folder / "other", np.zeros((2, 3)), [0], [1], np.zeros(3), M=M, C=M, K=M)
    shutil.copy(folder / "other" / "M.petsc", folder / "matrices" / "M.petsc")
    return folder / "scene.toml"


@pytest.mark.parametrize("ranks", [1, 2])
def test_an_indefinite_mass_is_refused_although_its_diagonal_is_positive(squeal, tmp_path, ranks):
    refused(squeal(with_mass(tmp_path, [[1, 2, 0], [2, 1, 0], [0, 0, 1]]), "--dry-run", ranks=ranks), "M.petsc", "1 of its eigenvalues")


def test_a_mass_that_misses_a_motion_is_accepted(converged, tmp_path):
    converged(with_mass(tmp_path, [[1, 0, 0], [0, 1, 0], [0, 0, 0]]), "--dry-run")


def test_a_structure_without_mass_is_refused(squeal, tmp_path):
    refused(squeal(with_mass(tmp_path, np.zeros((3, 3))), "--dry-run"), "no mass")


def test_a_contact_that_touches_nowhere_is_warned_of(converged):
    run = converged(OSCILLATOR, "--set", "contact.0.gap=10", "--set", "cycle.enabled=false", "--set",
                    "transient.enabled=false", ranks=1)
    assert "nothing touches" in run.printed and "nothing touches" in run.report["equilibrium"]["warnings"][0]
    touching = converged(OSCILLATOR, "--set", "cycle.enabled=false", "--set", "transient.enabled=false", ranks=1)
    assert "nothing touches" not in touching.printed


@pytest.mark.parametrize("drive", ["contact.0.velocity=[1,0,0]", 'rotor=[{part="disc",velocity=[1,0,0]}]'])
def test_sliding_without_friction_is_warned_of(converged, tmp_path, drive):
    scene = OSCILLATOR.read_text()
    head, law, tail = scene.partition("[friction]")
    lines = tail.splitlines(keepends=True)
    next_table = next(i for i, line in enumerate(lines) if line.startswith("["))
    text = head + "".join(lines[next_table:])
    if drive.startswith("rotor"):
        text = "".join(line for line in text.splitlines(keepends=True) if not line.startswith("velocity"))
    assert law and "coefficient" not in text.replace("#", "")
    (tmp_path / "scene.toml").write_text(text)
    said = "contacts slide without friction: [friction] coefficient is 0"
    dry = [tmp_path / "scene.toml", "--dry-run", "--set", drive]
    assert said in converged(*dry, ranks=1).printed
    for given in ("friction.coefficient=0.1", "contact.0.friction=0"):
        assert said not in converged(*dry, "--set", given, ranks=1).printed


def test_a_band_without_modes_is_warned_of_with_the_length_of_the_model(converged, tmp_path):
    scene = brick_scene(tmp_path)
    assert "no mode lies below" not in converged(scene, ranks=1).printed
    run = converged(scene, "--set", "mesh.scale=1e-3", ranks=1)
    assert "no mode lies below 5000 Hz: raise modes.band, or is mesh.scale wrong (the model is 0.0003 m long)" in run.printed
    assert "WARNING: the model is 0.0003 m long" in run.printed
    assert ElementTree.parse(run.output / "fields.xdmf").getroot().get("Version").split(".")[0] == "3"  # meshio reads no other


@pytest.mark.parametrize("key, value, words", [("density", 7.8, "7.8 kg/m3"), ("density", 7.8e6, "7.8e+06 kg/m3"),
                                               ("young", 210, "210 Pa"), ("young", 210e3, "m/s"), ("young", 2.1e14, "2.1e+14 Pa")])
def test_a_slip_of_units_is_warned_of(converged, tmp_path, key, value, words):
    run = converged(brick_scene(tmp_path), "--dry-run", "--set", f"part.bar.{key}={value}", ranks=1)
    assert "WARNING: part 'bar'" in run.printed and words in run.printed
    assert "WARNING" not in converged(brick_scene(tmp_path), "--dry-run", ranks=1).printed


@pytest.mark.parametrize("setting, words", [("mesh.scale=1e-3", "0.00024 m long"), ("force.0.vector=[0,0,0]", "is 0 N"), ("rigid_body.0.mass=1e-300", "grain of dust"),
                                            ("transient.load_factor=[[0,1],[0.1,-1]]", "the other way round")])
def test_a_load_or_mass_that_does_nothing_is_warned_of(converged, setting, words):
    warnings = converged(INPUTS / "pin_on_disc", "--dry-run", "--set", setting, ranks=1).printed
    assert "WARNING" in warnings and words in warnings


@pytest.mark.parametrize("setting, words", [("contact.0.gap=-1", "longer than the model"), ("contact.0.compliance=1e-3", "no layer")])
def test_a_gap_or_compliance_of_another_unit_is_warned_of(converged, setting, words):
    warnings = converged(INPUTS / "pin_on_disc", "--dry-run", "--set", setting, ranks=1).printed
    assert "WARNING: the contact of" in warnings and words in warnings


def test_an_element_that_is_there_twice_is_refused(squeal, tmp_path):
    mesh = Mesh()
    nodes = mesh.add_nodes(lattice((2, 1, 1), lambda x, y, z: (x, y, z)))
    mesh.add("bar", "brick", np.vstack([bricks(nodes), bricks(nodes)[:1]]))
    mesh.write(tmp_path / "bar.msh")
    scene = write_scene(tmp_path, mesh={"file": "bar.msh"}, part=[dict(STEEL, name="bar")])
    refused(squeal(scene, "--dry-run", ranks=1), "bar.msh", "two elements on the same nodes")


def test_mid_sides_on_an_edge_of_a_plain_neighbour_are_refused(squeal, tmp_path):
    mesh = Mesh()
    fine = mesh.add_nodes(lattice((2, 2, 2), lambda x, y, z: (x, y, z)))  # a brick with 20 nodes, and unused ones
    far = mesh.add_nodes(lattice((1, 1, 1), lambda x, y, z: (1 + x, y, z)))
    far[0] = fine[2, ::2, ::2]  # the plain brick shares the corners
    mesh.add("fine", "brick20", bricks20(fine))
    mesh.add("plain", "brick", bricks(far))
    mesh.write(tmp_path / "two.msh")
    scene = write_scene(tmp_path, mesh={"file": "two.msh"}, part=[dict(STEEL, name="fine"), dict(STEEL, name="plain")])
    refused(squeal(scene, "--dry-run", ranks=1), "two.msh", "part 'fine' has the mid-side node", "part 'plain'")


@pytest.mark.parametrize("table, words", [
    (dict(force=[{"on": "end", "vector": [0, 0, 5.0]}]), "would do nothing"),
    (dict(probe=[{"name": "p", "on": "end", "at": [0, 0, 0], "direction": "z"}]), "would read 0"),
    (dict(probe=[{"name": "p", "on": "bar", "at": [1e6, 0, 0], "direction": "z"}]), "the whole mesh measures"),
])
def test_a_force_or_probe_that_would_do_nothing_is_refused(squeal, tmp_path, table, words):
    brick_scene(tmp_path)
    scene = write_scene(tmp_path, mesh={"file": "bar.msh"}, part=[dict(STEEL, name="bar")],
                        support=[{"on": "end", "fixed": "all"}], modes={"band": 5000}, **table)
    refused(squeal(scene, "--dry-run"), words)
