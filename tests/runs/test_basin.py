"""Where shooting leads from a start: to the cycle heard, to another, or to the statement that the motion is no cycle."""

import cmath
import re

import pytest
from conftest import INPUTS

SLOWER = 1.2720196495  # square root of the golden ratio: no common period within any number of turns that matters


def two_oscillators(folder, damping=1.0):
    """inputs/oscillator beside its own copy, slowed; the copy's dashpots `damping` times as strong."""
    text = (INPUTS / "oscillator" / "scene.toml").read_text()
    one = text[text.index("[[point]]"):text.index("[friction]")]
    scaled = {"mass": SLOWER**2, "damping": SLOWER * damping}
    two = re.sub(r"(mass|damping) = ([\d.]+)", lambda m: f"{m[1]} = {float(m[2]) * scaled[m[1]]!r}", one)
    two = two.replace('"pad"', '"pad2"').replace('"disc"', '"disc2"')
    two = two.replace("velocity = [0.6, 0, 0]", f"velocity = [{0.6 / SLOWER!r}, 0, 0]")
    scene = folder / "scene.toml"
    scene.write_text(text.replace(one, one + two))
    return [scene, "--set", "transient.enabled=false", "--set", "cycle.steps_per_period=100"]


def test_a_torus_is_not_periodic(squeal, tmp_path):
    """The cycle of either oscillator leaves the other at rest: it solves the equations and nothing ever settles there."""
    run = squeal(*two_oscillators(tmp_path), ranks=1)
    report = run.report
    assert run.code == 2 and report["modes"]["unstable_count"] == 2
    cycle = report["cycle"]
    assert cycle["outcome"] == "not periodic"
    assert "2 modes are unstable" in cycle["reason"] and "quasi-periodic" in cycle["reason"]
    assert "NOT PERIODIC" in run.printed and "Hz\n" not in run.printed.split("cycle ")[-1]
    # the motion that grows is the sleeping mode's own: 1e-3, what 100 steps a period leave of a growth of 12 %
    largest = cycle["multipliers"]["values"][0]
    rates = [mode["growth_rate"] for mode in report["modes"]["modes"][:2]]
    grown = [cmath.exp(rate * cycle["period"]).real for rate in rates]
    assert min(abs(abs(complex(largest["real"], largest["imaginary"])) - growth) for growth in grown) < 1e-3


def test_beside_a_neighbour_that_is_stable_the_cycle_is_found(squeal, tmp_path):
    run = squeal(*two_oscillators(tmp_path, damping=5), ranks=1)
    assert run.code == 0 and run.report["modes"]["unstable_count"] == 1
    cycle = run.report["cycle"]
    assert cycle["outcome"] == "converged" and cycle["multipliers"]["stability"] == "stable"
    assert cycle["period"] == pytest.approx(5.954461004653, rel=1e-3)  # exact; 100 steps a period leave 3e-4


@pytest.mark.parametrize("start", [["-cycle_start_amplitude", "0.2"], ["-cycle_start_amplitude", "20"],
                                   ["-cycle_start_phase", "180"], ["-cycle_start_period", "0.6"],
                                   ["-cycle_start_period", "1.6"]])
def test_the_oscillator_leads_to_one_cycle_from_afar(converged, start):
    """From 1.6 times the period Newton finds the cycle gone round twice, which is told from the cycle."""
    cycle = converged(INPUTS / "oscillator" / "scene.toml", "--set", "transient.enabled=false", "--set",
                      "cycle.steps_per_period=100", "--set", "cycle.tolerance=1e-6", *start, ranks=1).report["cycle"]
    assert cycle["period"] == pytest.approx(5.954461004653, rel=1e-3)
    assert cycle["mean_energy"] == pytest.approx(1.77650678461, rel=1e-2)


def test_of_two_cycles_of_the_pin_the_start_decides(squeal):
    """The larger has several times the energy, and a period that lift-off has made longer. Both repel at this mesh: in
    direct integration a small motion beside the smaller grows 1.00012 times a period, beside the larger 1.03 times.
    That is what these steps do: by Arnoldi, since the bars of the projection hold what another grid of time changes."""
    pin = [INPUTS / "pin_on_disc" / "scene.toml", "--set", "mesh.parameters.divisions=3", "--set", "modes.method=full",
           "--set", "modes.band=6000", "-cycle_multiplier_method", "arnoldi"]
    smaller, larger = (squeal(*pin, "-cycle_start_amplitude", factor, ranks=1).report["cycle"] for factor in ("1", "3"))
    for cycle, growth, tolerance in (smaller, 1.00012, 3e-5), (larger, 1.03, 0.01):
        assert cycle["outcome"] == "unstable cycle" and cycle["multipliers"]["crossing"] == "Neimark-Sacker"
        largest = cycle["multipliers"]["values"][0]
        assert abs(abs(complex(largest["real"], largest["imaginary"])) - growth) < tolerance
    assert larger["mean_energy"] > 3 * smaller["mean_energy"] and larger["period"] > 1.01 * smaller["period"]


def test_the_projection_finds_the_multiplier_of_arnoldi(squeal):
    """0.00012 above 1 beside a bar of the grid: 2e-5, which 112 columns of Arnoldi show for their own error."""
    cycle = squeal(INPUTS / "pin_on_disc" / "scene.toml", "--set", "mesh.parameters.divisions=3", "--set",
                   "modes.method=full", "--set", "modes.band=6000", "--set", "transient.enabled=false",
                   "--set", "fidelity=full", ranks=1).report["cycle"]
    found = cycle["multipliers"]
    assert found["method"] == "oblique" and found["stability"] == "undecided"
    largest = found["values"][0]
    assert abs(abs(complex(largest["real"], largest["imaginary"])) - 1.000122) < 2e-5
    assert largest["error"] > 1.2e-4 and "reaches across 1" in found["would_decide"]
