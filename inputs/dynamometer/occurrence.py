#!/usr/bin/env python3
"""Draws how often a dynamometer's points squeal, by frequency and by direction, from the sweep.csv of a run.
Usage: inputs/dynamometer/occurrence.py results/dynamometer [FILE.png]"""

import csv
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot

BAND = (1250, 16000)  # Hz, in which SAE J2521 counts squeal
WIDTH = 250  # Hz of a bar


def unstable(folder):
    """Of each point: whether the disc turns forward, and the frequencies of its unstable modes in the band."""
    points = {}
    with open(Path(folder) / "sweep.csv") as file:
        for row in csv.DictReader(file):
            place = (row["numbers.load"], row["numbers.speed"], row["friction.coefficient"], row["part.pin.young"])
            known = points.setdefault(place, (float(row["numbers.speed"]) > 0, []))
            grows = row["growth_rate"] and float(row["growth_rate"]) > 0
            if grows and BAND[0] <= float(row["frequency_hz"]) <= BAND[1]:
                known[1].append(float(row["frequency_hz"]))
    return list(points.values())


def main(folder, picture):
    points = unstable(folder)
    edges = [BAND[0] + WIDTH * i for i in range(int((BAND[1] - BAND[0]) / WIDTH) + 1)]
    figure, axes = pyplot.subplots(figsize=(7, 3.2))
    for turns, shift, label, colour in ((True, 0, "forward", "tab:blue"), (False, WIDTH / 2, "backward", "tab:orange")):
        own = [found for forward, found in points if forward == turns]
        shares = [100 * sum(any(low <= f < low + WIDTH for f in found) for found in own) / len(own) for low in edges]
        axes.bar([(low + shift) / 1000 for low in edges], shares, WIDTH / 2000, align="edge", color=colour,
                 label=f"{label}: {sum(map(bool, (found for found in own)))} of {len(own)} points")
    axes.set(xlabel="frequency [kHz]", ylabel="points with an unstable mode [%]", xlim=(BAND[0] / 1000, BAND[1] / 1000), ylim=(0, 100))
    axes.legend(frameon=False)
    figure.savefig(picture, dpi=150, bbox_inches="tight")


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    main(sys.argv[1], sys.argv[2] if len(sys.argv) > 2 else Path(sys.argv[1]) / "occurrence.png")
