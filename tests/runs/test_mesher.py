"""Meshes and geometries that would run commands, or that gmsh dies of: one message, and nothing is touched."""

import os
import resource
import shutil
import subprocess

import numpy as np
import pytest
from models import STEEL, Mesh, bricks, lattice, write_scene
from test_bad_input import BLOCKS, BLOCKS_GEO


def write_blocks(folder, geometry, name="blocks.geo"):
    (folder / name).write_text(geometry)
    (folder / "scene.toml").write_text(BLOCKS.replace("blocks.geo", name))
    return folder / "scene.toml"


def brick_scene(folder):
    """A bar of bricks in a mesh file."""
    mesh = Mesh()
    nodes = mesh.add_nodes(lattice((3, 2, 2), lambda x, y, z: (0.3 * x, 0.1 * y, 0.1 * z)))
    mesh.add("bar", "brick", bricks(nodes))
    mesh.add("end", "quad", np.stack([nodes[0, :-1, :-1], nodes[0, 1:, :-1], nodes[0, 1:, 1:], nodes[0, :-1, 1:]], -1).reshape(-1, 4))
    mesh.write(folder / "bar.msh")
    return write_scene(folder, mesh={"file": "bar.msh"}, part=[dict(STEEL, name="bar")],
                       support=[{"on": "end", "fixed": "all"}], modes={"band": 5000})


def refused(run, *words):
    assert run.code == 1, run.printed + run.errors
    assert len(run.messages) == 1, run.errors
    for word in words:
        assert word in run.messages[0]
    assert "PETSC ERROR" not in run.errors and "MPI_ABORT" not in run.errors


@pytest.mark.parametrize("name", ["blocks.geo", "innocent.msh", "blocks.txt"])
def test_no_command_of_a_mesh_file_is_run(squeal, tmp_path, name):
    scene = write_blocks(tmp_path, f'SystemCall "id > {tmp_path}/PWNED";\n' + BLOCKS_GEO, name)
    refused(squeal(scene, "--dry-run"), name, "SystemCall")
    assert not (tmp_path / "PWNED").exists()


@pytest.mark.parametrize("statement", ["System 'touch PWNED';", "NonBlockingSystemCall 'touch PWNED';", 'Merge "fake.msh";',
                                       'Include "fake.msh";', 'If (1) SystemCall Str("touch ", "PWNED"); EndIf'])
def test_a_command_however_given_is_one_message(squeal, tmp_path, statement):
    (tmp_path / "fake.msh").write_text('SystemCall "touch PWNED";\n')
    scene = write_blocks(tmp_path, statement.replace("PWNED", f"{tmp_path}/PWNED") + "\n" + BLOCKS_GEO)
    refused(squeal(scene, "--dry-run", ranks=1), "blocks.geo", "SystemCall", "--allow-scripts")
    assert not list(tmp_path.rglob("PWNED"))


@pytest.mark.parametrize("statement", ['Save "PWNED.msh";', 'Printf("x") > "PWNED";', 'Printf("x") >> "old";', 'CreateDir "PWNED";',
                                       'Print "PWNED.geo_unrolled";', 'Mesh 3; Save "old";', 'General.ErrorFileName = "PWNED"; Abort;',
                                       'OnelabRun("x", "touch PWNED");'])
def test_nothing_is_written(squeal, tmp_path, statement):
    """Where gmsh tells that it cannot, this is the message; otherwise the mesh is as if the statement were not there."""
    for name in ["PWNED", "old"]:
        statement = statement.replace(f'"{name}', f'"{tmp_path}/{name}')
    (tmp_path / "old").write_text("kept")
    scene = write_blocks(tmp_path, BLOCKS_GEO + statement + "\n")
    before = sorted(tmp_path.iterdir())
    run = squeal(scene, "--dry-run", ranks=1)
    if run.code != 0:
        refused(run, "blocks.geo")
    assert sorted(tmp_path.iterdir()) == before and (tmp_path / "old").read_text() == "kept"


def test_allow_scripts_lets_the_user_have_it(squeal, tmp_path):
    scene = write_blocks(tmp_path, f'CreateDir "{tmp_path}/made";\n' + BLOCKS_GEO)
    run = squeal(scene, "--dry-run", "--allow-scripts", "--set", "mesh.parameters.shift=0")
    assert run.code == 0, run.errors
    assert (tmp_path / "made").is_dir()


@pytest.mark.parametrize("ranks", [1, 2])
def test_a_crash_of_gmsh_is_one_message(squeal, tmp_path, ranks):
    """A brick with 5 of its 8 nodes kills libgmsh 4.8 by SIGSEGV; later versions refuse it."""
    scene = brick_scene(tmp_path)
    lines = (tmp_path / "bar.msh").read_text().splitlines()
    first = next(i for i, line in enumerate(lines) if line.startswith("1 5 2"))
    lines[first] = " ".join(lines[first].split()[:-3])
    (tmp_path / "bar.msh").write_text("\n".join(lines) + "\n")
    refused(squeal(scene, "--dry-run", ranks=ranks), "bar.msh", "gmsh")


def test_a_signal_that_ends_the_mesher_is_named(tmp_path):
    """Whatever its reason is; here a mesher that kills itself stands beside a copy of the program."""
    shutil.copy(os.environ["SQUEAL"], tmp_path / "squeal")
    scene = brick_scene(tmp_path)

    def run():
        done = subprocess.run([tmp_path / "squeal", scene, "--dry-run"], capture_output=True, text=True, timeout=300)
        assert done.returncode == 1 and len(done.stderr.splitlines()) == 1, done.stderr
        return done.stderr

    assert "squeal_mesher is missing" in run()
    (tmp_path / "squeal_mesher").write_text("#!/bin/sh\nkill -SEGV $$\n")
    (tmp_path / "squeal_mesher").chmod(0o755)
    message = run()
    assert "bar.msh" in message and "crashed (signal 11" in message
    (tmp_path / "squeal_mesher").write_text("#!/bin/sh\nenv > " + str(tmp_path / "environment") + "\nprintf cut >&3\n")
    assert "gave no mesh" in run()
    names = [line.split("=")[0] for line in (tmp_path / "environment").read_text().splitlines()]
    assert names and not [name for name in names if name.startswith(("OMPI_", "PMIX_", "ORTE_"))]


def test_a_mesh_beyond_the_memory_ends_the_mesher_alone(tmp_path):
    scene = write_blocks(tmp_path, BLOCKS_GEO.replace("Curve{:} = 3", "Curve{:} = 400"))

    def limit():
        resource.setrlimit(resource.RLIMIT_AS, (1000 << 20, 1000 << 20))

    done = subprocess.run([os.environ["SQUEAL"], scene, "--dry-run"], capture_output=True, text=True, timeout=200,
                          preexec_fn=limit)
    assert done.returncode == 1 and len(done.stderr.splitlines()) == 1, done.stderr
    assert "blocks.geo" in done.stderr and "gmsh" in done.stderr and "bad_alloc" not in done.stderr


@pytest.mark.parametrize("name", ["a" * 200 + "/" + "b" * 30000, "/dev/zero", "."])
def test_odd_names_of_meshes_end(squeal, tmp_path, name):
    scene = brick_scene(tmp_path)
    refused(squeal(scene, "--dry-run", "--set", f"mesh.file={name}", ranks=1), "file")
