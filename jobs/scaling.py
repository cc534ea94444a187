#!/usr/bin/env python3
"""Table and chart of runs on several numbers of ranks, or of many runs side by side; the jobs call it.

    jobs/scaling.py strong|weak FOLDER RANKS...     # runs in FOLDER/ranks_N
    jobs/scaling.py many FOLDER VALUE...            # runs in FOLDER/value_V; FOLDER/times.txt: value, start, end [s]

It prints the table, and writes table.csv and chart.png into the folder. The efficiency of a stage on N ranks is
(t_1/t_N) (n_N/n_1)/(N/N_1), with the degrees of freedom n: 1 where a stage's cost is in proportion to n.
"""

import json
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tools"))
import squeal

from squeal import common

common.needs("matplotlib", "numpy")
LEAST = 0.01  # of a run's time: shorter stages are left out


def report_of(folder):
    return json.loads((folder / "report.json").read_text())


def ranks_columns(folder, counts):
    """The columns of the table, and the efficiencies of the stages."""
    reports = [report_of(folder / f"ranks_{n}") for n in counts]
    seconds = [r["timings"] | {"whole run": sum(r["timings"].values())} for r in reports]
    stages = [s for s in seconds[0] if seconds[0][s] >= LEAST * seconds[0]["whole run"]]
    dofs = [r["model"]["dofs"] for r in reports]
    columns = {"ranks": counts, "dofs": dofs}
    efficiency = {}
    for stage in stages:
        columns[f"{stage} [s]"] = [round(s.get(stage, 0), 3) for s in seconds]
        efficiency[stage] = [seconds[0][stage] / s[stage] * n / dofs[0] * counts[0] / ranks
                             for s, n, ranks in zip(seconds, dofs, counts) if s.get(stage)]
        columns[f"{stage} eff."] = [round(e, 2) for e in efficiency[stage]]
    columns["memory [GB]"] = [round(1e-9 * r["model"]["memory_bytes"], 3) for r in reports]
    return columns, efficiency


def draw_ranks(axes, kind, counts, efficiency):
    for stage, values in efficiency.items():
        axes.plot(counts, values, "ko-" if stage == "whole run" else "o-", label=stage, lw=2 if stage == "whole run" else 1)
    axes.axhline(1, color=common.GREY, lw=0.8)
    axes.set(xlabel="ranks", ylabel="efficiency", ylim=(0, None), xscale="log", xticks=counts, xticklabels=counts,
             title=f"{kind} scaling")
    axes.minorticks_off()
    axes.legend()


def many_columns(folder, values):
    reports = [report_of(folder / f"value_{v}") for v in values]
    worst = [(r["modes"].get("modes") or [{}])[0] for r in reports]
    return {"value": values, "exit code": [r["exit_code"] for r in reports], "heard": [r["heard"].split(",")[0] for r in reports],
            "growth rate [1/s]": [m.get("growth_rate", float("nan")) for m in worst],
            "seconds": [round(sum(r["timings"].values()), 2) for r in reports]}


def draw_many(axes, folder):
    """Runs done against time, beside the same runs one after the other."""
    times = [tuple(map(float, line.split()[-2:])) for line in (folder / "times.txt").read_text().splitlines()]
    first = min(start for start, _ in times)
    ends, lengths = sorted(end - first for _, end in times), [end - start for start, end in times]
    steps = range(1, len(times) + 1)
    axes.step(ends, steps, where="post", color=common.BLUE, label="side by side")
    axes.plot([sum(lengths[:k]) for k in steps], steps, "--", color=common.GREY, label="the same times one after the other")
    axes.set(xlabel="time [s]", ylabel="runs done", title=f"{3600 * len(times) / ends[-1]:.0f} runs an hour")
    axes.legend()
    print(f"{len(times)} runs in {ends[-1]:.1f} s, {sum(lengths) / ends[-1]:.2f} at a time on average")


def main():
    kind, folder = sys.argv[1], Path(sys.argv[2])
    figure, axes = common.pyplot().subplots(figsize=(6, 4))
    if kind == "many":
        columns = many_columns(folder, sys.argv[3:])
        draw_many(axes, folder)
    else:
        counts = [int(n) for n in sys.argv[3:]]
        columns, efficiency = ranks_columns(folder, counts)
        draw_ranks(axes, kind, counts, efficiency)
    table = squeal.table(columns)
    print(table.to_string(index=False))
    table.to_csv(folder / "table.csv", index=False)
    common.save_small(figure, folder / "chart.png")


if __name__ == "__main__":
    common.tool(main)
