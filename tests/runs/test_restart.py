"""A run that is asked to end does so in order, and one that was killed goes on to the numbers of the straight run."""

import functools
import json
import os
import shutil
import signal
import subprocess
import time

import h5py
import numpy as np
import pytest
from conftest import INPUTS, ROOT, Run, cores, interrupted, wait_for
from test_basin import two_oscillators
from test_mesher import brick_scene

OSCILLATOR = INPUTS / "oscillator" / "scene.toml"
ENDLESS = ["--set", "transient.periods=1e5"]
# a transient and the free periods and Newton steps of a cycle, about a second each
TRANSIENT_AND_CYCLE = ["--set", "transient.periods=100", "--set", "fidelity=full", "--set", "cycle.steps_per_period=2000"]
LOSSY_PIN = [INPUTS / "pin_on_disc" / "scene.toml", "--set", "damping.beta=6e-7", "--set", "cycle.steps_per_period=32"]
WITH_VERDICT = [*LOSSY_PIN, "--set", "mesh.parameters.divisions=2"]
PIN = [*WITH_VERDICT, "-cycle_multipliers", "0"]  # the verdict takes as long as the cycle, and longer on ranks
FOUR_PAIRS = [*LOSSY_PIN, "--set", "mesh.parameters.divisions=1", "-cycle_multipliers", "0"]
OF_THE_CLOCK = {"run", "timings", "processor_seconds", "exit_code", "memory_bytes"}
OF_THE_WAY = {"attempts", "next"}  # a run that goes on begins with the orbit of its checkpoint; the next command has its folder


signal.signal(signal.SIGHUP, signal.SIG_DFL)  # a test under nohup would hand on that it is ignored


def start(output, *arguments, ranks=1, scene=OSCILLATOR, stdout=subprocess.PIPE):
    launcher = [os.environ.get("MPIEXEC", "mpirun"), "-n", ranks] if ranks > 1 else []
    command = [*launcher, os.environ["SQUEAL"], scene, "--output", output, *arguments]
    return subprocess.Popen([str(word) for word in command], stdout=stdout, stderr=subprocess.PIPE, text=True,
                            env=os.environ)


ON_TWO_RANKS = ("test_the_wrapper_passes_signals_on", "test_a_terminal_that_closes_ends_two_ranks_in_order",
                "test_two_ranks_go_on_too", "test_ranks_end_with_their_launcher")


@pytest.fixture(autouse=True)
def own_cores(request):
    """Of the ranks that a test starts: it waits for signals and kills, which must not wait for other tests."""
    given = request.node.callspec.params if hasattr(request.node, "callspec") else {}
    if "where" in given:
        ranks = UNDER_WAY[given["where"]][0]
    else:
        ranks = given.get("ranks", 2 if request.node.name in ON_TWO_RANKS else 1)
    with cores(ranks):
        yield


def partial(output):
    return output / ".partial"


def numbers(value):
    """A report without what the clock and the kill decide."""
    if isinstance(value, dict):
        left_out = OF_THE_CLOCK | OF_THE_WAY
        return {key: numbers(entry) for key, entry in value.items() if key not in left_out and "seconds" not in key}
    return [numbers(entry) for entry in value] if isinstance(value, list) else value


def data_of(file):
    found = {}
    with h5py.File(file) as content:
        content.visititems(lambda name, item: found.update({name: item[()]}) if isinstance(item, h5py.Dataset) else None)
    return found


def assert_same_results(one, other):
    """To the last bit, but for times."""
    reports = [numbers(json.loads((folder / "report.json").read_text())) for folder in (one, other)]
    assert reports[0] == reports[1]
    for name in ("history.h5", "fields.h5"):
        a, b = data_of(one / name), data_of(other / name)
        assert a.keys() == b.keys()
        for key in a:
            assert np.array_equal(a[key], b[key]), key


def assert_close(one, other, rel):
    """Of two parts of reports: the same words and whole numbers, and numbers to a relative difference."""
    if isinstance(one, dict):
        assert one.keys() == other.keys()
        for key in one:
            assert_close(one[key], other[key], rel)
    elif isinstance(one, list):
        assert len(one) == len(other)
        for a, b in zip(one, other):
            assert_close(a, b, rel)
    else:
        assert other == (pytest.approx(one, rel=rel) if isinstance(one, float) else one)


OF_THE_WORK = {"energy_defect_max", "contact_iterations_mean", "residual", "iterations"}  # of contact, whose memory starts anew


def assert_same_answer(one, other, of_cycle=1e-6):
    """To solver tolerance; what no restart goes on with to the last bit. Finer steps are sought until the accuracy is met, which
    is then the tolerance of the cycle."""
    reports = [numbers(json.loads((folder / "report.json").read_text())) for folder in (one, other)]
    for stage in ("equilibrium", "modes", "estimate"):
        assert reports[0][stage] == reports[1][stage]
    transients = [{key: value for key, value in report["transient"].items() if key not in OF_THE_WORK} for report in reports]
    assert_close(*transients, 1e-6)
    if reports[0]["transient"]["outcome"] == "completed":
        energies = [data_of(folder / "history.h5")["transient/energy"] for folder in (one, other)]
        np.testing.assert_allclose(*energies, rtol=1e-6)
    attractors = [{key: value for key, value in report["attractors"].items() if key != "motions"} for report in reports]
    assert attractors[0] == attractors[1]
    motions = [[{key: value for key, value in motion.items() if not key.endswith("error")}
                for motion in report["attractors"].get("motions", [])] for report in reports]
    assert_close(*motions, 1e-6)
    first, second = (report["cycle"] for report in reports)
    verdicts = [cycle.get("multipliers", {}).get("stability") for cycle in (first, second)]  # none: it was not asked for
    assert first["outcome"] == second["outcome"] and verdicts[0] == verdicts[1]
    assert second["frequency_hz"] == pytest.approx(first["frequency_hz"], rel=of_cycle)
    assert second["mean_fluctuating_energy"] == pytest.approx(first["mean_fluctuating_energy"], rel=max(1e-4, of_cycle))


@pytest.mark.parametrize("ranks, scene", [(1, PIN), (2, FOUR_PAIRS[:-2]), (3, FOUR_PAIRS)], ids=["1", "2", "3"])
def test_repeats_are_bitwise_equal(converged, ranks, scene):
    one, other = (converged(*scene, ranks=ranks).output for _ in range(2))
    assert_same_results(one, other)


def test_the_time_limit_ends_a_mesher_that_does_not(tmp_path):
    scene = brick_scene(tmp_path)
    (tmp_path / "endless.geo").write_text("For i In {0:1e18}\nEndFor\n")
    scene.write_text(scene.read_text().replace("bar.msh", "endless.geo"))
    run = subprocess.run([os.environ["SQUEAL"], scene, "--time-limit", "2", "--output", tmp_path / "out"],
                         capture_output=True, text=True, timeout=300)
    assert run.returncode == 3 and "by the time limit before the first stage" in run.stdout, run.stdout + run.stderr


@pytest.mark.parametrize("ranks,number", [(1, signal.SIGTERM), (1, signal.SIGINT), (1, signal.SIGHUP), (1, signal.SIGXCPU),
                                          (2, signal.SIGUSR1), (2, signal.SIGUSR2)])
def test_a_signal_ends_the_run_in_order(tmp_path, ranks, number):
    output = tmp_path / "results"
    run = start(output, *ENDLESS, "--set", f"transient.save_state={output}/end.state", "--checkpoint", "0.05", ranks=ranks)
    wait_for(lambda: (output / "checkpoint" / "transient").exists())
    run.send_signal(number)
    printed, errors = run.communicate(timeout=300)
    assert run.returncode == 3, errors
    report = json.loads((output / "report.json").read_text())
    assert report["exit_code"] == 3 and report["transient"]["outcome"] == "interrupted"
    assert signal.Signals(number).name in report["transient"]["reason"]
    assert report["cycle"]["outcome"] == "skipped" and signal.Signals(number).name in report["cycle"]["reason"]
    steps = report["transient"]["steps"]
    assert len(data_of(output / "history.h5")["transient/time"]) == steps > 0
    assert (output / "end.state").exists() and "--restart" in printed.splitlines()[-1]
    assert not partial(output).exists()


def test_a_signal_after_the_results_leaves_the_exit_code(tmp_path):
    """A scheduler's notice that finds the process on its way out, a hundred times."""
    run = start(tmp_path / "results", "--set", "transient.enabled=false", "--set", "cycle.enabled=false")
    for line in run.stdout:
        if line.startswith("results are in"):
            break
    while run.poll() is None:
        run.send_signal(signal.SIGUSR1)
        time.sleep(0.001)
    assert run.returncode == 0


MODES_ONLY = [INPUTS / "pin_on_disc" / "scene.toml", "--set", "mesh.parameters.divisions=2", "--set", "cycle.enabled=false",
              "--set", "modes.method=full", "--set", "friction.coefficient=0.5"]
UNDER_WAY = {  # where a library or another process is at work: ranks, scene and arguments, what the log shows
    "mesher": (2, [*MODES_ONLY, "--set", "mesh.parameters.divisions=6"], "model …"),
    "basis of the samples": (1, [*MODES_ONLY, "--set", "robustness.samples=1000", "--set", "uncertain=[{key='friction.coefficient', "
                                 "distribution='uniform', from=0.4, to=0.6}]"], "robustness …"),
    # each rank follows it by itself, so that none may wait for another
    "branch on a reduced model": (2, [*FOUR_PAIRS, "--set", "transient.enabled=false", "--set", "fidelity=reduced", "--set",
                                      "branch={key='friction.coefficient', from=0.29, to=0.32, points=600}"],
                                  "branch   "),
}


@pytest.mark.parametrize("where", UNDER_WAY)
def test_a_signal_is_no_error_of_what_is_under_way(tmp_path, where):
    ranks, (scene, *arguments), sign = UNDER_WAY[where]
    log = tmp_path / "log"
    with open(log, "w") as printed:
        run = start(tmp_path / "results", *arguments, ranks=ranks, scene=scene, stdout=printed)
        wait_for(lambda: sign in log.read_text())
        time.sleep(0.1)  # most of what begins so is under way by then
        run.send_signal(signal.SIGUSR1)
        errors = run.communicate(timeout=300)[1]
    assert run.returncode == 3 and "squeal" not in errors, errors + log.read_text()[-500:]
    assert "ended by SIGUSR1" in log.read_text().splitlines()[-1]


@pytest.mark.parametrize("ranks, fidelity, watched", [(1, "reduced", 3000), (2, "auto", 60)])
def test_a_run_that_ends_in_its_verdict_keeps_the_cycle(ranks, fidelity, watched, squeal, tmp_path):
    """It is ended soon after the last line before the verdict, which watches many periods beside the cycle; or before, or when all is
    done, where the machine is busy. The restart decides, to what ranks agree within."""
    asked = [*FOUR_PAIRS[:-2], "--set", "cycle.steps_per_period=64", "--set", f"fidelity={fidelity}", "-cycle_watched_periods", watched]
    whole = squeal(*asked, ranks=ranks)
    lines = whole.printed[:whole.printed.index("settled …")].count("\n")
    for after in (0.1, 0.3, 0.05, 1):
        folder = tmp_path / f"ended_after_{after}"
        code, printed, errors = interrupted(rf"\A(?:.*\n){{{lines}}}", *asked, "--output", folder, ranks=ranks, after=after)
        report = json.loads((folder / "report.json").read_text())
        cycle = report["cycle"]
        # the signal may find the launcher alone, which it ends
        done = report["exit_code"] == 0 and code == -signal.SIGUSR1
        assert done or code == report["exit_code"] and code in (0, 3), errors
        if code == 3 and cycle["outcome"] == "converged" and cycle["multipliers"]["stability"] == "undecided":
            assert "the run was ended" in cycle["multipliers"]["would_decide"]
            assert cycle["frequency_hz"] == pytest.approx(whole.report["cycle"]["frequency_hz"], rel=1e-7)
            break
    found = whole.report["cycle"]["multipliers"]
    again = squeal(*asked, "--output", folder, "--restart", ranks=ranks)
    restarted = json.loads((folder / "report.json").read_text())["cycle"]["multipliers"]
    assert again.code == 0 and restarted["stability"] == found["stability"] == "stable"
    assert restarted["upper_bound"] == pytest.approx(found["upper_bound"], abs=1e-6)


def test_the_wrapper_passes_signals_on(tmp_path):
    """mpirun itself kills its ranks soon after a TERM; launch of tools/environment makes it a USR1."""
    output = tmp_path / "results"
    command = f". {ROOT}/tools/environment; launch mpirun -n 2 $SQUEAL {OSCILLATOR} --output {output} {' '.join(ENDLESS)}"
    wrapper = subprocess.Popen(["bash", "-c", command], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    wait_for(lambda: (partial(output) / "history.h5").exists())
    wrapper.terminate()
    assert wrapper.wait(timeout=300) == 3
    assert json.loads((output / "report.json").read_text())["exit_code"] == 3


def test_a_terminal_that_closes_ends_two_ranks_in_order(tmp_path):
    """It sends HUP to the shell, to mpirun and to the ranks at once."""
    output = tmp_path / "results"
    command = f". {ROOT}/tools/environment; launch mpirun -n 2 $SQUEAL {OSCILLATOR} --output {output} {' '.join(ENDLESS)}"
    shell = subprocess.Popen(["bash", "-c", command], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
    wait_for(lambda: (partial(output) / "history.h5").exists())
    os.killpg(shell.pid, signal.SIGHUP)
    wait_for(lambda: (output / "report.json").exists())
    assert json.loads((output / "report.json").read_text())["exit_code"] == 3
    assert shell.wait(timeout=300) != 0


@pytest.fixture(scope="module")
def straight(tmp_path_factory):
    """Results of the transient and the cycle in one go."""
    run = Run([OSCILLATOR, *TRANSIENT_AND_CYCLE], 1, tmp_path_factory.mktemp("straight"))
    assert run.code == 0, run.errors
    return run.output


def test_the_time_limit_ends_a_cycle_and_restart_ends_it(straight, tmp_path):
    """Whatever it had reached by then."""
    output = tmp_path / "ended"
    limit, code = 0.1, 3  # less than a start takes; however slow the machine is, one of its doubles is enough
    while code == 3:
        run = start(output, *TRANSIENT_AND_CYCLE, "--restart", "--time-limit", limit)
        run.communicate(timeout=300)
        code, limit = run.returncode, 2 * limit
    assert code == 0 and limit > 0.2
    assert_same_answer(straight, output)
    assert not (output / "checkpoint").exists()


@pytest.mark.parametrize("seconds", [0.2, 0.9])
def test_a_killed_run_goes_on_to_the_straight_runs_numbers(straight, tmp_path, seconds):
    output = tmp_path / "killed"
    run = start(output, *TRANSIENT_AND_CYCLE, "--checkpoint", "0.1")
    wait_for(lambda: (output / "checkpoint").exists() or run.poll() is not None)
    time.sleep(seconds)  # wherever it is then
    run.kill()
    run.wait()
    ended = (output / "report.json").exists()  # before it was killed
    assert partial(output).exists() or ended
    again = start(output, *TRANSIENT_AND_CYCLE, "--restart")
    printed, errors = again.communicate(timeout=300)
    assert again.returncode == 0, errors
    assert "goes on from the checkpoint" in printed or ended
    assert_same_answer(straight, output)


STAGES = {  # scene and arguments, what the log of the run or the checkpoints show when it is killed, and how results compare
    "modes": ([OSCILLATOR, *TRANSIENT_AND_CYCLE], "transient", assert_same_answer),
    "finer steps": ([*WITH_VERDICT, "--set", "cycle.steps_per_period=0", "--set", "accuracy=5e-4", "--set",
                     "cycle.tolerance=1e-8"], "cycle, finer steps", functools.partial(assert_same_answer, of_cycle=5e-4)),
    "settled": (["two oscillators"], "settled …", assert_same_results),
    "starts": ([OSCILLATOR, "--set", "transient.enabled=false", "--set", "cycle.starts=6", "--set",
                "cycle.steps_per_period=100"], "attractors …", assert_same_answer),
}


@pytest.mark.parametrize("stage", STAGES)
def test_each_stage_goes_on(tmp_path, stage):
    """Killed where the stage is under way; modes that were kept are not computed again, and the answer is that of one run."""
    (scene, *arguments), sign, compare = STAGES[stage]
    if stage == "settled":
        scene, *arguments = two_oscillators(tmp_path)
    straight, output, log = tmp_path / "straight", tmp_path / "killed", tmp_path / "log"
    whole = start(straight, *arguments, scene=scene)
    assert whole.communicate()[0] and whole.returncode == 0
    with open(log, "w") as printed:
        run = start(output, *arguments, "--checkpoint", "0.05", scene=scene, stdout=printed)
        wait_for(lambda: (output / "checkpoint" / sign).exists() or sign in log.read_text())
        time.sleep(0.2)  # wherever it is then; it may have ended
        run.kill()
    if run.wait() != 0:
        again = start(output, *arguments, "--restart", scene=scene)
        printed, errors = again.communicate()
        assert again.returncode == 0 and "of the checkpoint" in printed, errors + printed
    compare(straight, output)


def test_two_ranks_go_on_too(converged, tmp_path):
    """From the transient of the pin, whose modes MUMPS finds, to the end of its cycle."""
    arguments = [*PIN, "--set", "transient.enabled=true", "--set", "transient.start=mode", "--set", "transient.periods=30"]
    straight = converged(*arguments, ranks=2).output
    scene, *settings = arguments
    output = tmp_path / "ended"
    run = start(output, *settings, "--checkpoint", "0.1", ranks=2, scene=scene)
    wait_for(lambda: (output / "checkpoint" / "transient").exists())  # in the transient, however fast the machine
    run.send_signal(signal.SIGUSR1)
    run.communicate(timeout=300)
    assert run.returncode == 3 and (output / "checkpoint" / "transient").exists()
    again = start(output, *settings, "--restart", ranks=2, scene=scene)
    printed, errors = again.communicate(timeout=300)
    assert again.returncode == 0 and "goes on from the checkpoint" in printed, errors
    assert_same_answer(straight, output)


def test_checkpoints_of_another_scene_are_refused_and_kept(tmp_path):
    output = tmp_path / "results"
    run = start(output, *ENDLESS, "--checkpoint", "0.1")
    wait_for(lambda: (output / "checkpoint" / "transient").exists())
    run.kill()
    run.wait()
    other = start(output, *ENDLESS, "--restart", "--set", "friction.coefficient=0.31")
    errors = other.communicate(timeout=300)[1]
    assert other.returncode == 1 and "another scene" in errors and len(errors.strip().splitlines()) == 1
    assert (output / "checkpoint" / "transient").exists()


@pytest.mark.parametrize("changed", ["a friction", "a matrix", "a mesh"])
def test_a_restart_that_is_refused_leaves_the_results_as_they_were(squeal, tmp_path, changed):
    """It is of another scene, or comes after an input file has changed: modes of the old matrices would stand beside the cycle of the new."""
    shutil.copytree(INPUTS / ("pin_on_disc" if changed == "a mesh" else "oscillator"), tmp_path / "scene")
    scene = tmp_path / "scene" / ("matrices.toml" if changed == "a matrix" else "scene.toml")
    given = [*ENDLESS, "--set", "transient.enabled=true", "--set", "transient.start=mode", *(PIN[1:] if changed == "a mesh" else [])]
    output = tmp_path / "results"
    run = start(output, *given, "--checkpoint", "0.1", scene=scene)
    wait_for(lambda: (output / "checkpoint" / "transient").exists())
    run.send_signal(signal.SIGTERM)
    assert run.communicate(timeout=300) and run.returncode == 3
    if changed == "a matrix":
        with open(tmp_path / "scene" / "matrices" / "C.petsc", "r+b") as file:
            file.seek(-1, os.SEEK_END)
            file.write(b"\x01")  # the last bit of its last entry
    if changed == "a mesh":
        with open(tmp_path / "scene" / "pin.geo", "a") as file:
            file.write("// other words\n")
    before = sorted(tmp_path.rglob("*"))
    again = start(output, *given, "--restart", *(["--set", "friction.coefficient=0.31"] if changed == "a friction" else []), scene=scene)
    errors = again.communicate(timeout=300)[1]
    assert again.returncode == 1 and "another scene" in errors and len(errors.splitlines()) == 1, errors
    assert sorted(tmp_path.rglob("*")) == before


def test_a_single_process_outlives_its_shell(tmp_path):
    """As a run that is left in the background by someone who logs out. MPI, which starts by itself then, used to look like a launcher."""
    output = tmp_path / "results"
    command = f"nohup $SQUEAL {OSCILLATOR} --output {output} {' '.join(ENDLESS)} > {tmp_path}/log 2>&1 & echo $!; sleep 2"
    pid = int(subprocess.run(["bash", "-c", command], capture_output=True, text=True).stdout)
    wait_for(lambda: (partial(output) / "history.h5").exists())
    os.kill(pid, signal.SIGTERM)
    wait_for(lambda: (output / "report.json").exists())
    assert json.loads((output / "report.json").read_text())["exit_code"] == 3


def test_ranks_end_with_their_launcher(tmp_path):
    run = start(tmp_path / "results", *ENDLESS, ranks=2)
    wait_for(lambda: (partial(tmp_path / "results") / "history.h5").exists())
    mine = lambda: [pid for pid in os.listdir("/proc") if pid.isdigit() and str(tmp_path).encode() in command_of(pid)]
    assert len(mine()) == 3
    run.kill()
    wait_for(lambda: not mine())


def command_of(pid):
    try:
        with open(f"/proc/{pid}/cmdline", "rb") as file:
            return file.read()
    except OSError:
        return b""


@pytest.mark.parametrize("argument", [["--time-limit", "soon"], ["--checkpoint", "0"], ["--time-limit"]])
def test_limits_are_numbers_of_seconds(squeal, argument):
    run = squeal(OSCILLATOR, *argument, ranks=1)
    assert run.code == 1 and len(run.messages) == 1 and argument[0] in run.messages[0]
