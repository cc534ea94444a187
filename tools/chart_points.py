"""What the runs of tools/chart found and what it cost: points, lines of one method, the front of all methods."""

from squeal import common

common.needs("h5py", "matplotlib", "numpy", "scipy")
import h5py
import matplotlib
import numpy as np
from chart_runs import CYCLES, tidy
from squeal.common import BLUE, GREEN, GREY, ORANGE, RED
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar

ENERGY, PERIOD = "mean fluctuating energy", "period"


class Point:
    """What was found, what it cost, and what it is called beside its mark; not kept: its residual was not reached."""

    def __init__(self, seconds, value, periods=0, label="", kept=True):
        self.seconds, self.value, self.periods, self.label, self.kept = seconds, value, periods, label, kept


def cycle_point(runs, name, label):
    """None where there is no run or no cycle."""
    report = runs.report(name)
    if not report or report["cycle"]["outcome"] not in CYCLES or "mean_fluctuating_energy" not in report["cycle"]:
        return None
    cycle = report["cycle"]
    periods = report["fidelity"].get("full_periods", cycle["periods_integrated"])
    return Point(report["processor_seconds"]["cycle"],
                 {PERIOD: cycle["period"], ENERGY: cycle["mean_fluctuating_energy"]}, periods, label,
                 cycle["outcome"] == "converged")


def recurrence(time, spline, guess, count):
    """The period [s] over which the last of the motion repeats best, `count` of them apart."""
    h = time[1] - time[0]
    window = time[-1] - np.arange(0, 3 * guess, h)

    def unlike(period):
        return np.mean((spline(window) - spline(window - count * period)) ** 2)

    width = 0.1 * guess / count
    tried = np.linspace(guess - width, guess + width, 201)
    best = tried[np.argmin([unlike(period) for period in tried])]
    step = tried[1] - tried[0]
    bounds = (best - step, best + step)
    return minimize_scalar(unlike, bounds=bounds, method="bounded", options={"xatol": 1e-10 * best}).x


def direct_points(runs, name, guess):
    """Period and mean energy over the last ten periods, all along one transient."""
    report = runs.report(name)
    if not report:
        return []
    with h5py.File(runs.folder / name / "history.h5") as file:
        energy, time = (file[f"transient/{key}"][()] for key in ("fluctuating_energy", "time"))
    points = []
    for length in np.unique(np.geomspace(16 * guess / (time[1] - time[0]), len(time), 25).astype(int)):
        until, spline = time[:length], CubicSpline(time[:length], energy[:length])
        period = guess
        for count in (1, 10):
            period = recurrence(until, spline, period, count)
        end = until[-1]
        mean = spline.integrate(end - 10 * period, end) / (10 * period)
        seconds = report["processor_seconds"]["transient"] * length / len(time)
        points.append(Point(seconds, {PERIOD: period, ENERGY: mean}, (end - time[0]) / guess))
    return points


def error(point, judge, what):
    return abs(point.value[what] / judge.value[what] - 1)


def settled(errors):
    """The largest from here to the finest: a lucky crossing of zero is no accuracy."""
    return np.maximum.accumulate(np.asarray(errors)[::-1])[::-1]


class Line:
    """Points of one method from coarse to fine, and how they are drawn; {} in the label is what a point is called."""

    def __init__(self, label, points, colour, mark, style="-"):
        self.label, self.colour, self.mark, self.style = label, colour, mark, style
        self.points = [point for point in points if point]


def methods(runs, judge):
    """The lines of the first picture."""
    a, point = runs.a, lambda name, label="": cycle_point(runs, tidy(name), label)
    lines = [Line(f"direct transient, {n} steps", direct_points(runs, f"direct_{n}", judge.value[PERIOD]), GREY,
                  "", style) for n, style in zip(a.direct, ("-", "--", ":"))]
    lines += [
        Line("seven unknowns", [point("seven")], ORANGE, "D"),
        Line("shooting from the estimate, {} steps", [point(f"full_{n}", str(n)) for n in a.steps], BLUE, "o"),
        Line("shooting from the reduced cycle, {} steps", [point(f"start_{n}", str(n)) for n in a.steps], GREEN, "s"),
        Line("reduced model alone", [point("reduced_all")], "black", "P"),
        Line("fidelity = auto, accuracy {}", [point(f"auto_{value:.0e}", tidy(f"{value:.0e}")) for value in a.accuracies], RED, "^"),
    ]
    return [line for line in lines if line.points]


def front(lines, judge, what, cost):
    """Least cost for an error: corners of the staircase (cost, error, line, point), cheapest first."""
    reached = []
    for line in lines:
        points = [point for point in line.points if point.kept]
        errors = settled([error(point, judge, what) for point in points]) if points else []
        reached += [(getattr(point, cost), e, line, point) for point, e in zip(points, errors)]
    corners, best = [], np.inf
    for corner in sorted(reached, key=lambda corner: corner[:2]):
        if corner[1] < 0.9 * best:  # less is no gain
            corners.append(corner)
            best = corner[1]
    return corners
