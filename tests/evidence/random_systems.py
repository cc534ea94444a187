#!/usr/bin/env python3
"""Answers on random frictional systems, each held against event-driven integration that shares no code with squeal.

    tests/evidence/random_systems.py SEED FOLDER --systems 300      # goes on where FOLDER has results
    tests/evidence/random_systems.py SEED FOLDER --table            # what FOLDER has, without another run

Needs SQUEAL, the program, a C++ compiler and Eigen. A system has 2 to 10 degrees of freedom and 1 to 3 pairs with random normals,
tangents, gaps and drives, and in half of them friction that falls with speed. Those without exactly one equilibrium, or where sliding is not well
posed, are drawn anew. squeal is asked as a user would, without steps, start or tolerance.

A cycle is corrected by Newton's method on the flow of events.cpp from squeal's own state. Period, mean energy, multipliers and
verdict of squeal are held against that exact cycle. Another motion is integrated from squeal's own samples and from a small start. It is periodic where it
closes, irregular where neighbours part. Each system is a line of FOLDER/results.jsonl.
"""

import argparse
import json
import os
import re
import struct
import subprocess
import time
from pathlib import Path

import h5py
import numpy as np

from event_driven import Reference, compiled, system


# --- squeal ------------------------------------------------------------------------------------------------------------------------


def vector_file(values):
    return struct.pack(">ii", 1211214, len(values)) + np.asarray(values, ">f8").tobytes()


def matrix_file(A):
    rows = [np.flatnonzero(row) for row in A]
    data = struct.pack(">iiii", 1211216, *A.shape, sum(map(len, rows)))
    return data + np.array([len(row) for row in rows], ">i4").tobytes() + np.concatenate(rows).astype(">i4").tobytes() + A[A != 0].astype(">f8").tobytes()


def write_scene(folder, s, band):
    matrices = folder / "matrices"
    matrices.mkdir(parents=True, exist_ok=True)
    B = np.empty((2 * len(s["gap"]), len(s["K"])))
    B[::2], B[1::2] = s["Bn"], s["Bt"]
    for name, A in dict(M=s["M"], C=s["C"], K=s["K"], B=B).items():
        (matrices / f"{name}.petsc").write_bytes(matrix_file(A))
    for name in ("gap", "drive", "F"):
        (matrices / f"{name}.petsc").write_bytes(vector_file(s[name]))
    text = f'[matrices]\nfolder = "matrices"\n[friction]\ncoefficient = {s["kinetic"]!r}\n'
    if s["rest"] != s["kinetic"]:
        text += f'static_coefficient = {s["rest"]!r}\ndecay_speed = {s["decay"]!r}\n'
    text += f'[modes]\nband = {band!r}\n[cycle]\nsave_state = "{folder / "state"}"\n'
    for i in range(len(s["K"])):
        text += f'[[probe]]\nname = "d{i}"\non = "dof:{i}"\n'
    (folder / "scene.toml").write_text(text)


def read_state(path):
    data = path.read_bytes()
    vectors = []
    while data:
        count = struct.unpack(">ii", data[:8])[1]
        vectors.append(np.frombuffer(data[8:8 + 8 * count], ">f8").astype(float))
        data = data[8 + 8 * count:]
    return np.concatenate(vectors)


def settled_state(folder, n):
    with h5py.File(folder / "out" / "history.h5") as file:
        t = file["settled/time"][:]
        u = np.array([file[f"settled/probes/d{i}"][:] for i in range(n)])
    k = len(t) - len(t) // 8
    return np.concatenate([u[:, k], (u[:, k + 1] - u[:, k - 1]) / (t[k + 1] - t[k - 1])])


# --- comparison --------------------------------------------------------------------------------------------------------------------


def compare_cycle(report, ref, state, line):
    """Faults of a cycle and its verdict, with the true errors and the bars."""
    cycle, faults = report["cycle"], []
    multipliers = cycle.get("multipliers", {})
    verdict = multipliers.get("stability", "none")
    exact = ref.cycle(state, cycle["period"])
    largest = abs(exact["multipliers"][0])
    errors = report["fidelity"].get("error_estimates", {})
    bar = lambda *names: sum(abs(errors.get(name) or 0) for name in names)
    period = cycle["period"]
    whole = round(exact["period"] / period)
    line.update(verdict=verdict, said=multipliers.get("largest"), said_bar=multipliers.get("largest_error"), largest=largest, noise=exact["noise"],
                complex=bool(abs(exact["multipliers"][0].imag) > 1e-9), moved=exact["moved"],
                period=[abs(period / exact["period"] - 1), bar("frequency", "step_frequency")],
                energy=[abs(cycle["mean_fluctuating_energy"] / exact["energy"] - 1), bar("energy", "step_energy")],
                steps=cycle["steps_per_period"])
    if abs(exact["period"] / period - 1) > 0.1 or exact["moved"] > 0.3:
        faults.append("no such cycle")
        return faults, exact
    if verdict == "stable" and largest > 1 + 3 * exact["noise"]:
        faults.append("WRONG VERDICT: stable")
    if verdict == "unstable" and largest < 1 - 3 * exact["noise"]:
        faults.append("WRONG VERDICT: unstable")
    if verdict not in ("stable", "unstable"):
        faults.append("undecided cycle")
    if line["said"] is not None and abs(line["said"] - largest) > line["said_bar"] + exact["noise"]:
        faults.append("bar of the multiplier")
    for name in ("period", "energy"):
        error, bar_ = line[name]
        if error > bar_ + 1e-7:
            faults.append(f"bar of the {name}")
    return faults, exact


def kind_of(ref, motion, period):
    """Kind of a motion by events: it closes, neighbours part, or neither."""
    try:
        closed = ref.cycle(motion["state"], motion["closes"]) if motion["misses"] < 0.1 else None
        if closed and abs(closed["multipliers"][0]) < 1 + closed["noise"]:
            return "periodic", closed, None
    except (ArithmeticError, np.linalg.LinAlgError):
        pass
    rate, bar = ref.exponent(motion["state"], period)
    if rate > bar:
        return "irregular", None, (rate, bar)
    return "quasi-periodic or slow", None, (rate, bar)


def energies_agree(e, e_bar, f, f_bar):
    return abs(e - f) <= e_bar + f_bar + 0.005 * max(e, f)


def judge(folder, library, seed, number, line):
    s, u0, of, values, vectors, random = system(seed, number)
    ref = Reference(library, s, u0, values)
    report = json.loads((folder / "out" / "report.json").read_text())
    cycle, settled = report["cycle"], report["settled"]
    faults = []
    growing = values[(values.real > 1e-8 * abs(values)) & (values.imag >= 0)]
    line.update(n=ref.n, pairs=ref.m, growing=len(growing), ratio=float(max(values.real / abs(values))), falling=s["rest"] != s["kinetic"],
                outcome=cycle["outcome"], kind=settled.get("kind"), heard=report["heard"], code=report["exit_code"])
    if report["modes"]["unstable_count"] != len(growing):
        faults.append(f"modes: {report['modes']['unstable_count']} unstable, {len(growing)} by dense algebra")
    if not len(growing):
        return faults + ([] if report["heard"].startswith("silent") else ["not silent"])
    if report["exit_code"] != 0:
        faults.append(f"exit code {report['exit_code']}")
    fastest = int(np.argmax(values.real))
    period = 2 * np.pi / abs(values[fastest].imag)
    exact = None
    said = None  # energy, bar
    if cycle["outcome"] in ("converged", "unstable cycle") and (folder / "state").exists():
        try:
            found, exact = compare_cycle(report, ref, read_state(folder / "state"), line)
            faults += found
            said = (exact["energy"], 0.0)
        except (ArithmeticError, np.linalg.LinAlgError) as error:
            faults.append(f"no exact cycle: {error}")
    elif cycle["outcome"] in ("settled",) and settled.get("mean_fluctuating_energy"):
        mean = settled["mean_fluctuating_energy"]
        said = (mean["mean"], mean["error"] + settled.get("step_error", 0))
        period = settled["period"]
        other = ref.motion(settled_state(folder, ref.n), period, 320, 100)
        kind, closed, rate = kind_of(ref, other, period)
        line.update(reference_kind=kind, reference_energy=other["energy"], reference_bar=other["bar"], exponent=rate, said_energy=said,
                    drift=other["drift"], spread=[other["earlier"], other["spread"]])
        if closed is not None:
            line.update(largest=abs(closed["multipliers"][0]), closes=closed["period"])
        if settled["kind"] == "undecided":
            faults.append("undecided kind")
        elif settled["kind"] != kind and not (settled["kind"] == "quasi-periodic" and kind.startswith("quasi")):
            faults.append(f"WRONG KIND: {settled['kind']}, {kind} by events")
        if not energies_agree(*said, other["energy"], other["bar"]):
            faults.append("bar of the settled energy")
    elif cycle["outcome"] not in ("skipped",):
        faults.append(f"cycle {cycle['outcome']}")
    grown = ref.rest + 1e-3 * ref.scale.mean() * (vectors[:, fastest] / np.linalg.norm(vectors[:, fastest])).real
    rate = max(values.real)
    periods = int(min(1000, 100 + 12 / rate / period))
    motion = ref.motion(grown, period, 128, periods)
    line.update(grown_energy=motion["energy"], grown_bar=motion["bar"])
    if said is not None and not energies_agree(*said, motion["energy"], motion["bar"]):
        line["other"] = True  # growth from sliding leads elsewhere
    return faults


def one(folder, library, seed, number, timeout):
    case = folder / f"{number:04d}"
    s, _, _, values, _, _ = system(seed, number)
    write_scene(case, s, float(1.3 * max(abs(values)) / (2 * np.pi)))
    begun = time.time()
    cpu = os.times()
    run = subprocess.Popen([os.environ["SQUEAL"], case / "scene.toml", "--output", case / "out"], stdout=(case / "printed").open("w"),
                           stderr=subprocess.STDOUT)
    line = dict(number=number)
    try:
        run.wait(timeout=timeout)
    except subprocess.TimeoutExpired:
        run.kill()
        run.wait()
        return dict(line, faults=["too long"], seconds=timeout)
    line.update(wall=round(time.time() - begun, 2), seconds=round(os.times().children_user - cpu.children_user, 2))
    if run.returncode == 1 or not (case / "out" / "report.json").exists():
        return dict(line, faults=["error: " + (case / "printed").read_text()[-300:]])
    try:
        line["faults"] = judge(case, library, seed, number, line)
    except (ArithmeticError, np.linalg.LinAlgError) as error:
        line["faults"] = [f"reference: {error}"]
    return line


def table(lines):
    count = len(lines)
    part = lambda of: f"{of} of {count}"
    print(f"\nsystems {count}")
    kinds = {}
    for line in lines:
        for fault in line["faults"]:
            fault = re.sub(r"[0-9.e+-]{3,}|:.*", "", fault) if not fault.startswith("WRONG") else fault
            kinds.setdefault(fault, []).append(line["number"])
    for fault, numbers in sorted(kinds.items(), key=lambda item: -len(item[1])):
        print(f"  {len(numbers):4d}  {fault}: {numbers[:20]}")
    print("  undecided:", part(sum(any(f.startswith("undecided") for f in line["faults"]) for line in lines)))
    for name, pair in dict(period=lambda l: l.get("period"), energy=lambda l: l.get("energy"),
                           multiplier=lambda l: l.get("said") is not None and "largest" in l and [abs(l["said"] - l["largest"]), l["said_bar"]]).items():
        pairs = [pair(line) for line in lines if pair(line) and "no such cycle" not in line["faults"]]
        if pairs:
            held = sum(error <= bar + 1e-7 for error, bar in pairs)
            ratios = sorted(bar / max(error, 1e-12) for error, bar in pairs)
            print(f"  bars of the {name}: {held} of {len(pairs)} hold, median width {ratios[len(ratios) // 2]:.1f} errors")
    print("  growth from sliding leads elsewhere:", [line["number"] for line in lines if line.get("other")])
    seconds = sorted(line.get("seconds", 0) for line in lines)
    print(f"  seconds of squeal: median {seconds[count // 2]:.2f}, largest {seconds[-1]:.1f}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("seed", type=int)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--systems", type=int, default=300)
    parser.add_argument("--only", type=int, nargs="*")
    parser.add_argument("--timeout", type=float, default=600)
    parser.add_argument("--table", action="store_true")
    parser.add_argument("--judge", action="store_true", help="judge anew what squeal said before")
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    log = given.folder / "results.jsonl"
    done = {line["number"]: line for line in map(json.loads, log.read_text().splitlines())} if log.exists() else {}
    if not given.table:
        library = compiled(given.folder)
        for number in given.only if given.only is not None else range(given.systems):
            if number in done and given.only is None and not given.judge:
                continue
            if given.judge and number in done:
                line = {k: done[number][k] for k in ("number", "wall", "seconds") if k in done[number]}
                try:
                    line["faults"] = judge(given.folder / f"{number:04d}", library, given.seed, number, line)
                except (ArithmeticError, np.linalg.LinAlgError) as error:
                    line["faults"] = [f"reference: {error}"]
            else:
                line = one(given.folder, library, given.seed, number, given.timeout)
            done[number] = line
            with log.open("a") as file:
                file.write(json.dumps(line, default=float) + "\n")
            print(number, line.get("seconds"), line.get("outcome"), line.get("kind"), line["faults"], "other" if line.get("other") else "", flush=True)
    if done:
        table([done[k] for k in sorted(done)])


if __name__ == "__main__":
    main()
