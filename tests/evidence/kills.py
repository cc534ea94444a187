#!/usr/bin/env python3
"""Kills runs at random seconds, all ranks at once, restarts them to their end, and holds their answers against straight runs.

    tests/evidence/kills.py [--kills 30] [--seed 1] [--checkpoint 0.1] [--only NAME ...]

Needs SQUEAL, the program. Prints a line for each kill and a table; fails where an answer differs by more than TOLERANCES.
"""

import argparse
import json
import math
import os
import random
import re
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests" / "runs")]
from test_joint_cycles import STUCK, scene_text  # noqa: E402

INPUTS = ROOT / "inputs"
SMALL_PIN = [INPUTS / "pin_on_disc", "--set", "damping.beta=6e-7", "--set", "mesh.parameters.divisions=1"]
RUNS = {  # ranks, scene and arguments
    "oscillator": (1, [INPUTS / "oscillator", "--set", "transient.periods=100", "--set", "fidelity=full", "--set",
                       "cycle.steps_per_period=2000"]),
    "oscillator, 2 ranks": (2, [INPUTS / "oscillator", "--set", "transient.periods=20", "--set", "fidelity=full", "--set",
                                "cycle.steps_per_period=200"]),
    "pin": (1, [*SMALL_PIN, "--set", "cycle.steps_per_period=64"]),
    "pin with a transient, 2 ranks": (2, [*SMALL_PIN, "--set", "cycle.steps_per_period=32", "--set", "transient.enabled=true",
                                          "--set", "transient.start=mode", "--set", "transient.periods=50"]),
    "joints": (1, ["joints"]),
    "sweep": (1, [INPUTS / "sweep"]),
    "sweep, 2 ranks": (2, [INPUTS / "sweep", "--set", "mesh.parameters.divisions=1"]),
    "starts": (1, [INPUTS / "oscillator", "--set", "transient.enabled=false", "--set", "cycle.starts=6", "--set",
                   "cycle.steps_per_period=400"]),
    "starts, 2 ranks": (2, [INPUTS / "oscillator", "--set", "transient.enabled=false", "--set", "cycle.starts=4", "--set",
                            "cycle.steps_per_period=200"]),
}
TOLERANCES = [  # words in a number's name, its relative and its absolute tolerance
    (("multipliers",), (0, 5e-2)),  # bars of a projection and of a whole matrix differ
    (("error", "bar", "half_width"), (0.5, 1e-3)),
    (("chatter",), (0.5, 0)),  # of the grid of time
    (("joints",), (2e-2, 0)),
    (("cycle.mean",), (5e-3, 0)),  # the phase of an orbit places its events in the grid of time: test_joint_cycles.py
    (("",), (1e-4, 1e-9)),  # cycles are sought to 1e-5 of their state
]
# of the clock, of the way to the answer, of rounding
LEFT_OUT = ("second", "memory", "residual", "iterations", "defect", "records", "attempts", "next", "place", "command", "run",
            "ended", "backward", "periods", "seen", "condition", "certificate", "timings", "newton", "versions", "fidelity",
            "by_offset")  # a difference of two orbits, which the grid of time scatters


def command(ranks, arguments, output, *more):
    launcher = [os.environ.get("MPIEXEC", "mpirun"), "-n", ranks] if ranks > 1 else []
    return [str(word) for word in [*launcher, os.environ["SQUEAL"], *arguments, "--output", output, *more]]


def report_of(output):
    return json.loads((output / "report.json").read_text())


def differences(one, other, where=""):
    """Sentences of what differs between two reports, or parts of them."""
    if any(word in where.rpartition(".")[2] for word in LEFT_OUT):
        return []
    if where == ".cycle.multipliers":  # whole or projected, as the way to the orbit allows: the verdict and what decides it
        one, other = ({key: found[key] for key in ("stability", "upper_bound") if key in found} for found in (one, other))
    if isinstance(one, dict) and isinstance(other, dict):
        lone = [f"{where}.{key} is in one alone" for key in one.keys() ^ other.keys() if not any(word in key for word in LEFT_OUT)]
        return lone + [found for key in one.keys() & other.keys() for found in differences(one[key], other[key], f"{where}.{key}")]
    if isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        return [found for i, (a, b) in enumerate(zip(one, other)) for found in differences(a, b, f"{where}[{i}]".lstrip("."))]
    if isinstance(one, str) and isinstance(other, str):  # the words; numbers of sentences stand elsewhere
        one, other = (re.sub(r"[\d.]+(e[+-]?\d+)?", "#", text).replace("+- #", "") for text in (one, other))
    if isinstance(one, float) and isinstance(other, (float, int)):
        relative, absolute = next(pair for words, pair in TOLERANCES if any(word in where for word in words))
        return [] if math.isclose(one, other, rel_tol=relative, abs_tol=absolute) else [f"{where}: {one} became {other}"]
    return [] if one == other else [f"{where}: {one} became {other}"]


def children_of(output):
    """Processes that write into a folder."""
    found = []
    for folder in Path("/proc").iterdir():
        try:
            if folder.name.isdigit() and str(output).encode() in (folder / "cmdline").read_bytes():
                found.append(int(folder.name))
        except OSError:
            pass
    return found


def killed(line, output, seconds):
    """Whether the run was killed, with all of its processes, before its end."""
    run = subprocess.Popen(line, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        run.wait(timeout=seconds)
        return False
    except subprocess.TimeoutExpired:
        for process in children_of(output):
            try:
                os.kill(process, signal.SIGKILL)
            except ProcessLookupError:
                pass
        run.wait()
        return True


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=30)
    parser.add_argument("--checkpoint", default="0.1")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", nargs="*", choices=RUNS, default=list(RUNS))
    given = parser.parse_args()
    chance = random.Random(given.seed)
    table = {name: {"seconds": 0., "kills": 0, "resumed": 0, "wrong": 0} for name in given.only}
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        straight = {}
        for k in range(given.kills):
            name = given.only[k % len(given.only)]
            ranks, arguments = RUNS[name]
            row = table[name]
            if arguments[0] == "joints":
                (place / "joints.toml").write_text(scene_text(STUCK))
                arguments = [place / "joints.toml", *arguments[1:]]
            if name not in straight:
                begun = time.time()
                subprocess.run(command(ranks, arguments, place / "straight"), stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
                row["seconds"] = time.time() - begun
                straight[name] = report_of(place / "straight")
            output, seconds = place / f"run{k}", 0.
            line = command(ranks, arguments, output, "--checkpoint", given.checkpoint, "--restart")
            while not killed(line, output, seconds := chance.uniform(0, row["seconds"])):
                pass
            done = subprocess.run(line, stdin=subprocess.DEVNULL, capture_output=True, text=True)
            resumed = "of the checkpoint" in done.stdout or "from the checkpoint" in done.stdout
            found = differences(straight[name], report_of(output))
            row["kills"] += 1
            row["resumed"] += resumed
            row["wrong"] += bool(found)
            print(f"{name}: killed after {seconds:.2f} s, {'went on' if resumed else 'began anew'}, exit code {done.returncode}: "
                  f"{'; '.join(text[:400] for text in found[:5]) or 'the same answer'}", flush=True)
    print("\n| run | seconds | kills | went on from a checkpoint | other answers |\n|---|---|---|---|---|")
    for name, row in table.items():
        print(f"| {name} | {row['seconds']:.1f} | {row['kills']} | {row['resumed']} | {row['wrong']} |")
    return any(row["wrong"] for row in table.values())


if __name__ == "__main__":
    sys.exit(main())
