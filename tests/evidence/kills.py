#!/usr/bin/env python3
"""Kills runs at random seconds, restarts them to their end, and holds their answers against a run in one go.

    tests/evidence/kills.py SCENE --kills 15 [--checkpoint 0.1] [--seed 1] [-- arguments of squeal]

Needs SQUEAL, the program. Fails where an answer differs by more than the tolerances below.
"""

import argparse
import json
import os
import random
import subprocess
import sys
import tempfile
import time
from pathlib import Path

TOLERANCES = {"frequency_hz": 1e-6, "mean_fluctuating_energy": 1e-4}  # relative


def command(scene, output, *arguments):
    return [os.environ["SQUEAL"], str(scene), "--output", str(output), *arguments]


def report_of(output):
    return json.loads((output / "report.json").read_text())


def differences(straight, other):
    """Sentences of what differs: outcomes of stages, the cycle's verdict, its numbers."""
    found = [f"{name}: {entry['outcome']} became {other[name]['outcome']}" for name, entry in straight.items()
             if isinstance(entry, dict) and "outcome" in entry and entry["outcome"] != other[name]["outcome"]]
    one, two = straight["cycle"], other["cycle"]
    stabilities = [cycle.get("multipliers", {}).get("stability") for cycle in (one, two)]
    if stabilities[0] != stabilities[1]:
        found.append(f"stability: {stabilities[0]} became {stabilities[1]}")
    for key, tolerance in TOLERANCES.items():
        if one.get(key) and abs(two[key] / one[key] - 1) > tolerance:
            found.append(f"{key}: {one[key]} became {two[key]}")
    return found


def killed(command_line, seconds):
    """Whether the run was killed before its end."""
    run = subprocess.Popen(command_line, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        run.wait(timeout=seconds)
        return False
    except subprocess.TimeoutExpired:
        run.kill()
        run.wait()
        return True


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", type=Path)
    parser.add_argument("--kills", type=int, default=15)
    parser.add_argument("--checkpoint", default="0.1")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args(sys.argv[1:sys.argv.index("--")] if "--" in sys.argv else None)
    arguments = sys.argv[sys.argv.index("--") + 1:] if "--" in sys.argv else []
    chance = random.Random(given.seed)
    with tempfile.TemporaryDirectory() as place:
        begun = time.time()
        subprocess.run(command(given.scene, Path(place, "straight"), *arguments), stdout=subprocess.DEVNULL)
        longest = time.time() - begun
        straight = report_of(Path(place, "straight"))
        kills, wrong, resumed = 0, 0, 0
        while kills < given.kills:
            output = Path(place, f"run{kills}")
            line = command(given.scene, output, *arguments, "--checkpoint", given.checkpoint, "--restart")
            if not killed(line, chance.uniform(0, longest)):
                continue
            kills += 1
            done = subprocess.run(line, capture_output=True, text=True)
            resumed += "goes on from the checkpoint" in done.stdout or "of the checkpoint" in done.stdout
            found = differences(straight, report_of(output))
            wrong += bool(found)
            for sentence in found:
                print(f"kill {kills}: {sentence}")
    print(f"{kills} kills of a run of {longest:.1f} s: {kills - wrong} ended with the same answer, {resumed} went on from checkpoints")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
