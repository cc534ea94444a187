"""What can be refused is refused before the first stage: by one message, with exit code 1, in a second."""

import json
import os
import re
import shutil
import signal
import subprocess

import pytest
from conftest import INPUTS, interrupted

OSCILLATOR = INPUTS / "oscillator" / "scene.toml"
STAGES = ("equilibrium …", "modes …")


def refused(run, *words):
    assert run.code == 1, run.printed + run.errors
    assert len(run.messages) == 1, run.errors
    for word in words:
        assert word in run.messages[0], run.messages
    assert "PETSC ERROR" not in run.errors and "MPI_ABORT" not in run.errors and ".cpp" not in run.errors
    assert not [stage for stage in STAGES if stage in run.printed]
    assert not list(run.output.glob("*"))


TOAR = ["--set", "modes.method=toar"]
# what is given, and words of the message
OPTIONS = {
    "ranks among the arguments": (["--ranks", "4"], ["--ranks", "RANKS=4", "mpirun -n 4"]),
    "ranks as the launcher takes them": (["-n", "4"], ["unknown argument -n", "mpirun -n 4"]),
    "an argument near to none": (["--zzzzzzzzzzz"], ["--zzzzzzzzzzz; squeal -help lists"]),
    "a scene twice": ([OSCILLATOR], ["a second scene", "take the other out"]),
    "a scene that is not there twice": (["other.toml"], ["a second scene 'other.toml'"]),
    "a number that a list has not": (["--set", "force.0.vector.3=1"], ["--set force.0.vector.3=1: vector has no entry '3'; known: 0, 1, 2"]),
    "an entry that a list has not": (["--set", "contact.5.gap=0"], ["contact has no entry '5'; did you mean '0'?"]),
    "a number for a table": (["--set", "friction=0.3"], ["[friction] is a table, not a number"]),
    "a number for a list": (["--set", "contact=3"], ["'contact' is a list"]),
    "a number for an entry": (["--set", "contact.0=3"], ["contact.0.KEY=VALUE"]),
    "no key": (["--set", "=.277"], ["--set =.277", "KEY=VALUE"]),
    "a unit beside a number": (["--set", "contact.0.gap=0.1mm"], ["gap = '0.1mm'", "not text [m]"]),
    "no such word": (["-cycle_finish", "magic"], ["-cycle_finish", "multisecant"]),
    "zero": (["-response_tolerance", "0"], ["-response_tolerance", "above 0"]),
    "text for a number": (["-cycle_max_periods", "many"], ["-cycle_max_periods", "many"]),
    "infinite": (["-response_tolerance", "inf"], ["-response_tolerance", "finite"]),
    "a number that overflows": (["-cycle_samples", "4294967297"], ["-cycle_samples", "2147483647"]),
    "an object of PETSc's that squeal has not": (["-mat_type", "magic"], ["-mat_type"]),
    "a mesh that is a folder": (["--set", "mesh.file=."], ["is a folder"]),
    "a mesh that is a device": (["--set", "mesh.file=/dev/zero"], ["no plain file"]),
    "a name that ends a line of C": (["--set", 'probe.0.name="a\\u0000b"'], ["probe", "control characters"]),
    "a solver that its stage has not": (["-reduced_ksp_rtol", "1"], ["-reduced_ksp_rtol"]),
    "a solver that the equilibrium has not": (["-equilibrium_ksp_rtol", "1"], ["-equilibrium_ksp_rtol"]),
    "an eigensolver that needs a preconditioner": (["-modes_pep_type", "jd"], ["-modes_pep_type jd"]),
    "a Newton method that needs subdomains": (["-cycle_snes_type", "aspin"], ["-cycle_snes_type aspin"]),
    "a solver's view of no format": (["-cycle_snes_view", "::magic"], ["-cycle_snes_view", "ascii_info"]),
    "a solver's view on the screen": (["-cycle_snes_monitor_solution", "draw"], ["-cycle_snes_monitor_solution", "draw"]),
    "a solver's view where there is no folder": ([*TOAR, "-modes_pep_view", ":/no/such/y"], ["-modes_pep_view", "/no/such"]),
    "less than one step": (["--set", "transient.periods=1e-9"], ["transient.periods", "one time step"]),
    "no file of options": (["-options_file", "missing"], ["-options_file", "missing"]),
    "a log of no format": (["-log_view", "foo:bar:baz"], ["-log_view", "foo"]),
    "a log of no known format": (["-log_view", ":log.txt:magic"], ["-log_view", "ascii_xml"]),
    "a log where there is no folder": (["-log_view", ":/no/such/x"], ["-log_view", "/no/such"]),
    "a history where there is no folder": (["-history", "/no/such/h"], ["-history", "/no/such"]),
    "a trace whose name is too long": (["-log_trace", "x" * 3000], ["-log_trace", "too long"]),
    "no truth value": (["-malloc_debug", "many"], ["-malloc_debug", "true or false"]),
    "a state where there is no folder": (["--set", "transient.save_state=no/such/x"], ["save_state", "no/such"]),
    "a state that is a folder": (["--set", "transient.save_state=matrices"], ["save_state", "folder"]),
    "a probe without a name": (["--set", "probe.0.name=."], ["probe", "name"]),
    "a number whose square is infinite": (["--set", "force.0.vector=[0,0,1e300]"], ["force", "1e100"]),
    "a number that is too large": (["--set", "modes.band=1e300"], ["band", "1e100"]),
    "a tolerance that no motion meets": (["--set", "cycle.tolerance=1e-30"], ["tolerance = 1e-30", "1e-14 or more"]),
    "a tolerance that any motion meets": (["--set", "cycle.tolerance=2"], ["tolerance", "less than 1"]),
    "an accuracy that any cycle has": (["--set", "accuracy=1"], ["accuracy", "less than 1"]),
    "steps that show no harmonic": (["--set", "cycle.steps_per_period=4"], ["steps_per_period", "at least 8"]),
    "an explicit scheme": (["--set", "transient.theta=0"], ["theta", "above 0"]),
    "samples that overflow": (["-cycle_samples", "3000000000"], ["-cycle_samples", "2147483647"]),
    "more steps than a day holds": (["--set", "transient.steps=1000000000000000", "--set", "transient.step_size=1e-3",
                                     "--set", "cycle.enabled=false"], ["--force"]),
}


ON_TWO_RANKS = ("a scene twice", "a number that a list has not", "a number for a table", "no key")


@pytest.mark.parametrize("name, ranks", [(name, ranks) for name in OPTIONS for ranks in ((1, 2) if name in ON_TWO_RANKS else (1,))])
def test_one_message_before_the_first_stage(squeal, name, ranks):
    given, words = OPTIONS[name]
    refused(squeal(OSCILLATOR, *given, ranks=ranks), *words)


def scene_of(given):
    """A model on which the solver of these options works: small ones are solved whole by LAPACK."""
    if "modes.method=toar" in given:
        return [INPUTS / "pin_on_disc" / "scene.toml", "--set", "mesh.parameters.divisions=2", "--set", "cycle.enabled=false",
                "--set", "modes.method=full", "--set", "modes.band=5000", "--set", "estimate.enabled=false"]
    return [OSCILLATOR, "--set", "transient.enabled=false", "--set", "cycle.steps_per_period=60"]


# what is given beside a run whose cycle needs no subspace, and words of the message by which the stage or the end fails
LATE = {
    "no type of solver": (["-cycle_snes_type", "magic"], ["SNES type magic"]),
    "no type of eigensolver": ([*TOAR, "-modes_pep_type", "magic"], ["PEP type", "magic"]),
    "no type of linear solver": ([*TOAR, "-modes_st_ksp_type", "magic"], ["KSP type magic"]),
    "no number for a solver": ([*TOAR, "-modes_pep_tol", "magic"], ["magic", "no numeric value"]),
    "a linear solver's option that it has not": (["-cycle_ksp_rtoll", "1"], ["-cycle_ksp_rtoll was never used"]),
    "a solver that slices leave out": (["-modes_pep_tol", "1e-9"], ["-modes_pep_tol was never used"]),
    "no option of the eigensolver": ([*TOAR, "-modes_pep_tool", "1"], ["-modes_pep_tool was never used"]),
    "no option of the transformation": ([*TOAR, "-modes_st_ksp_rtoll", "1"], ["-modes_st_ksp_rtoll was never used"]),
    "a control of MUMPS that is the program's own": (["-factor", "mumps", "-factor_mat_mumps_icntl_18", "1"],
                                                     ["-factor_mat_mumps_icntl_18 was never used"]),
    "a factor that the run has not": (["-factor", "supernodal", "-factor_mat_mumps_icntl_14", "9"], ["-factor_mat_mumps_icntl_14 was never used"]),
    "an eigensolver of symmetric problems": ([*TOAR, "-modes_pep_type", "stoar"], ["Hermitian"]),
    "a transformation that the eigensolver cannot use": ([*TOAR, "-modes_st_type", "filter"], ["shift"]),
    "a basis too small for its vectors": ([*TOAR, "-modes_pep_ncv", "1"], ["ncv"]),
    "a Newton method without its parts": (["-cycle_subspace_newtons", "5", "-cycle_snes_type", "shell"], ["SNESShell"]),
}


@pytest.mark.parametrize("name", LATE)
def test_a_solver_that_does_not_take_its_option_ends_the_run(squeal, name):
    given, words = LATE[name]
    run = squeal(*scene_of(given), *given, ranks=1)
    assert run.code == 1 and len(run.messages) == 1, run.errors
    assert all(word in run.messages[0] for word in words), run.messages


# an option of each prefix, a view, and what it prints
VIEWS = {
    "the KSP of the cycle": (["-cycle_subspace_newtons", "5", "-cycle_ksp_type", "gmres", "-cycle_snes_view"], "type: gmres"),
    "the PC of the cycle": (["-cycle_subspace_newtons", "5", "-cycle_pc_type", "svd", "-cycle_snes_view"], "type: svd"),
    "the SNES of the cycle": (["-cycle_subspace_newtons", "5", "-cycle_snes_max_it", "7", "-cycle_snes_view"], "maximum iterations=7"),
    "the PEP of the modes": ([*TOAR, "-modes_pep_max_it", "77", "-modes_pep_view"], "maximum number of iterations: 77"),
    "the ST of the modes": ([*TOAR, "-modes_st_ksp_type", "gmres", "-modes_pep_view"], "type: gmres"),
}


@pytest.mark.parametrize("name", VIEWS)
def test_an_option_of_a_prefix_changes_its_solver_and_the_view_shows_it(squeal, name):
    given, shown = VIEWS[name]
    run = squeal(*scene_of(given), *given, ranks=1)
    assert run.code in (0, 2) and shown in run.printed, run.printed + run.errors


# where factors and real modes are large: an option, what shows it, and the words
FACTORS = {
    "the factor": (["-factor", "mumps", "-factor_mat_mumps_icntl_14", "33", "-factor_mat_mumps_icntl_3", "6",
                    "-factor_mat_mumps_icntl_4", "2"], r"memory relaxation +(\(effective\) )?= +33"),
    "the factor of the modes": (["-modes_mat_mumps_icntl_14", "33", "-modes_mat_mumps_icntl_3", "6",
                                 "-modes_mat_mumps_icntl_4", "2"], r"memory relaxation +(\(effective\) )?= +33"),
    "the pivots of the modes": (["-modes_mat_mumps_cntl_1", "0.125", "-modes_mat_mumps_icntl_3", "6",
                                 "-modes_mat_mumps_icntl_4", "2"], "0.1250"),
}


@pytest.mark.parametrize("name", FACTORS)
def test_an_option_of_a_large_solver_changes_it_and_the_view_shows_it(squeal, name):
    given, shown = FACTORS[name]
    run = squeal(INPUTS / "pin_on_disc", "--set", "mesh.parameters.divisions=3", "--set", "cycle.enabled=false", "--set",
                 "transient.enabled=false", *given, ranks=1)
    assert run.code in (0, 2) and re.search(shown, run.printed), run.printed[-3000:] + run.errors


def test_a_state_that_is_the_results_is_refused(squeal, tmp_path):
    refused(squeal(OSCILLATOR, "--set", f"transient.save_state={tmp_path}/out", "--output", tmp_path / "out", ranks=1),
            "save_state", "a folder")


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("key", ["transient", "cycle"])
def test_a_state_to_start_from_is_read_before_the_first_stage(squeal, tmp_path, key, ranks):
    (tmp_path / "short.state").write_bytes(b"no vector")
    for arguments in ([], ["--dry-run"]):
        refused(squeal(OSCILLATOR, "--set", f"{key}.enabled=true", "--set", f"{key}.start={tmp_path}/short.state", *arguments,
                       ranks=ranks), "short.state", "not a vector in PETSc's binary format")


def test_an_option_that_turns_out_unused_leaves_earlier_results(squeal):
    """The solver asks for it only at work, so the end of the run tells; that comes before the results take their place."""
    given = [OSCILLATOR, "--set", "cycle.enabled=false", "--set", "transient.enabled=false"]
    first = squeal(*given, ranks=1)
    before = first.report
    assert first.code == 0
    run = squeal(*given, "--output", first.output, *TOAR, "-modes_pep_view_vectorz", ranks=1)
    assert run.code == 1 and len(run.messages) == 1 and "-modes_pep_view_vectorz" in run.messages[0], run.errors
    assert first.report == before
    assert not (first.output / ".partial").exists()


@pytest.mark.parametrize("ranks", [1, 2])
def test_a_stage_that_fails_leaves_what_finished(squeal, tmp_path, ranks):
    """One megabyte is too little for the eigensolver's factor, which shows after the equilibrium. The next run removes it."""
    given = [INPUTS / "pin_on_disc", "--output", tmp_path / "results", "--set", "mesh.parameters.divisions=3", "--set",
             "cycle.enabled=false", "--set", "modes.method=toar"]
    run = squeal(*given, "-modes_st_mat_mumps_icntl_23", "1", ranks=ranks)
    partial = tmp_path / "results" / ".partial"
    assert run.code == 1 and f"results in {partial}" in run.errors, run.errors
    report = json.loads((partial / "report.json").read_text())
    assert report["equilibrium"]["outcome"] == "converged"
    assert squeal(*given, ranks=ranks).code == 0
    assert not partial.exists()


def test_a_view_of_a_solver_that_did_not_run_costs_no_results(squeal):
    run = squeal(OSCILLATOR, "-cycle_snes_view", "-cycle_snes_converged_reason", ranks=1)
    assert run.code == 0 and run.report["cycle"]["outcome"] == "converged", run.errors


def test_options_beside_a_matrix_are_not_obeyed(squeal, tmp_path):
    """PETSc reads FILE.info for them, and a log may fall on any file."""
    shutil.copytree(INPUTS / "oscillator", tmp_path / "scene")
    scene = tmp_path / "scene" / "matrices.toml"
    (tmp_path / "scene" / "matrices" / "K.petsc.info").write_text(f"-log_view :{scene}\n-magic 1\n")
    before = scene.read_bytes()
    run = squeal(scene, "--set", "cycle.enabled=false", "--set", "transient.enabled=false", ranks=1)
    assert run.code == 0 and scene.read_bytes() == before, run.errors


def test_a_signal_ends_a_sweep_while_its_equilibria_are_sought(tmp_path):
    """A million of them take minutes, and no mode is sought before."""
    arguments = [OSCILLATOR, "--output", tmp_path / "results", "--set", "sweep.key=friction.coefficient", "--set", "sweep.from=0.1", "--set",
                 "sweep.to=0.5", "--set", "sweep.points=1000000", "--set", "cycle.enabled=false", "--set", "transient.enabled=false"]
    code, printed, errors = interrupted("^sweep", *arguments, number=signal.SIGTERM)
    assert "ended by SIGTERM" in printed and code == 3, errors


def run_here(folder, *arguments, **environment):
    return subprocess.run([os.environ["SQUEAL"], OSCILLATOR, "--dry-run", *arguments], cwd=folder, capture_output=True,
                          text=True, timeout=300, env=os.environ | environment)


def test_a_working_folder_that_is_gone_is_one_message(tmp_path):
    gone = tmp_path / "gone"
    gone.mkdir()
    script = 'cd "$1"; rmdir "$1"; exec "$2" "$3"'
    done = subprocess.run(["bash", "-c", script, "-", gone, os.environ["SQUEAL"], OSCILLATOR], capture_output=True, text=True)
    assert done.returncode == 1 and "working folder" in done.stderr and len(done.stderr.splitlines()) == 1, done.stderr


def test_options_say_where_they_come_from(tmp_path):
    (tmp_path / ".petscrc").write_text("-magic\n")
    assert "PETSC_OPTIONS" not in run_here(tmp_path).stdout  # and no file is obeyed that nobody named
    assert "PETSC_OPTIONS" in run_here(tmp_path, PETSC_OPTIONS="-cycle_samples 20").stdout
    (tmp_path / "options").write_text("# ours\n-cycle_samples 20 -cycle_max_periods 3\n")
    assert run_here(tmp_path, "-options_file", "options").returncode == 0
    (tmp_path / "options").write_text("-history /no/such/h\n")
    for done in (run_here(tmp_path, "-options_file", "options"), run_here(tmp_path, PETSC_OPTIONS="-options_file /no/such/h")):
        assert done.returncode == 1 and "/no/such/h" in done.stderr and len(done.stderr.splitlines()) == 1, done.stderr


def test_the_forecast_is_printed_and_forced(squeal):
    steps = ["--set", "transient.steps=1000000000000", "--set", "transient.step_size=1e-3"]
    run = squeal(OSCILLATOR, "--dry-run", *steps, ranks=1)
    assert run.code == 0 and "1e+12 time steps" in run.printed and "--force" in run.printed
    run = squeal(OSCILLATOR, "--force", "--set", "cycle.enabled=false", "--set", "transient.steps=10", "--set",
                 "transient.step_size=1e-3", ranks=1)
    assert run.code == 0, run.errors


@pytest.mark.parametrize("points", [["sweep.key=friction.coefficient", "sweep.from=0.1", "sweep.to=0.5", "sweep.points=2000000000"],
                                    ["robustness.samples=2000000000",
                                     "uncertain=[{key='friction.coefficient', distribution='uniform', from=0.1, to=0.3}]"]], ids=["sweep", "robustness"])
def test_points_beyond_the_memory_are_refused(squeal, points):
    run = squeal(OSCILLATOR, *[word for point in points for word in ("--set", point)], ranks=1)
    assert run.code == 1 and len(run.messages) == 1 and "GB of memory" in run.messages[0], run.errors


@pytest.mark.parametrize("name", ["a" * 300, "loop"])
def test_an_output_that_no_folder_can_have_is_refused(tmp_path, name):
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    done = subprocess.run([os.environ["SQUEAL"], OSCILLATOR, "--output", tmp_path / name], capture_output=True, text=True,
                          timeout=300, cwd=tmp_path)
    assert done.returncode == 1 and "--output DIR" in done.stderr and len(done.stderr.splitlines()) == 1, done.stderr


def test_a_load_beyond_all_bounds_ends(squeal):
    """Newton's matrix was not finite, and its decomposition did not end."""
    run = squeal(OSCILLATOR, "--set", "force.0.vector.1=-1e16", "--set", "transient.enabled=false", ranks=1)
    assert run.code in (0, 2), run.errors


@pytest.mark.parametrize("force", [1e11, 1e14])
def test_large_reactions_do_not_hold_up_the_estimate(squeal, force):
    """The tolerance of its quadrature is never below the rounding of what it adds."""
    run = squeal(OSCILLATOR, "--set", f"force.0.vector=[0,{-force},0]", "--set", "transient.enabled=false", "--set",
                 "cycle.enabled=false", ranks=1)
    assert run.code in (0, 2), run.errors
    assert run.report["processor_seconds"]["estimate"] < 5
