"""What a run leaves behind: every key of report.json, files that open and have the model's sizes, figures."""

import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree

import h5py
import numpy as np
import pytest
from conftest import INPUTS, ROOT

KEYS = {
    "model": "dofs pairs elements ranks memory_bytes factor_seconds condensed_operator_seconds",
    "equilibrium": "outcome iterations closed normal_force_sum normal_force_min normal_force_max residual",
    "modes": "outcome method unstable_count modes",
    "estimate": "outcome amplitude lift_off_amplitude reversal_amplitude damping_rate friction_rate_linear",
    "transient": "outcome theta steps step_size periods growth_rate_fit growth_rate_predicted energy_defect_max",
    "cycle": "outcome period frequency_hz steps_per_period residual_projected residual_full newton_iterations "
             "periods_integrated mean_energy mean_fluctuating_energy open_pairs_mean open_pairs_max stick_pairs_max "
             "peak_to_peak",
    "timings": "model equilibrium modes estimate transient cycle",
}

SCENES = {
    "oscillator": ["--set", "cycle.steps_per_period=100", "--set", "transient.periods=20", "--set",
                   "transient.steps_per_period=50", "-cycle_snes_monitor"],
    # coarse, and damped like this, it has a cycle that is found in a second; the subspace is asked for
    "pin_on_disc": ["--set", "mesh.parameters.divisions=2", "--set", "damping.beta=6e-7", "--set", "fidelity=full", "--set",
                    "cycle.steps_per_period=40", "--set", "transient.enabled=true", "--set",
                    "transient.periods=20", "--set", "transient.steps_per_period=40", "-cycle_subspace_newtons", "10",
                    "-cycle_snes_monitor"],
}


@pytest.mark.parametrize("scene", SCENES)
def test_every_file_is_whole(converged, scene):
    run = converged(INPUTS / scene / "scene.toml", *SCENES[scene], "--set", "fidelity=full", "-log_view",
                    ranks=1 if scene == "oscillator" else 2)
    report = run.report
    for stage, keys in KEYS.items():
        assert not set(keys.split()) - set(report[stage]), stage
    growth = [mode["growth_rate"] for mode in report["modes"]["modes"]]
    assert growth == sorted(growth, reverse=True)
    for mode in report["modes"]["modes"]:
        assert {"frequency_hz", "growth_rate", "damping_ratio", "backward_error"} <= set(mode)
    assert [(tried["name"], tried["outcome"]) for tried in report["cycle"]["attempts"]] == [("cycle, full model", "converged")]
    assert (run.output / "resolved.toml").exists() and (run.output / "options.txt").exists()

    # Two ranks solve the reduced system alike: each of its norms is printed once.
    norms = re.findall(r"SNES Function norm (\S+)", run.printed)
    assert len(norms) == len(set(norms))
    assert norms or scene == "oscillator"  # whose three degrees of freedom take Newton with the exact tangent
    for stage in KEYS["timings"].split():
        assert re.search(rf"^ *\d+: +{stage}: ", run.printed, re.M), "-log_view has no such stage"

    check_history(run, report)
    check_fields(run, report)
    check_figures(run)


def check_history(run, report):
    with h5py.File(run.output / "history.h5") as history:
        steps = {"transient": report["transient"]["steps"], "cycle": report["cycle"]["steps_per_period"]}
        for stage, count in steps.items():
            for name in ("time", "energy", "fluctuating_energy", "damping_power", "open", "stick", "slip"):
                assert history[stage][name].shape == (count,)
            assert set(history[stage]["probes"]) == set(report["cycle"]["peak_to_peak"])
            in_all = sum(history[stage][name][:] for name in ("open", "stick", "slip"))
            assert (in_all == report["model"]["pairs"]).all()
        assert history["cycle/status"].shape == (report["cycle"]["steps_per_period"], report["model"]["pairs"])
        assert np.mean(history["cycle/energy"][:]) == pytest.approx(report["cycle"]["mean_energy"], rel=1e-12)


def check_fields(run, report):
    with h5py.File(run.output / "fields.h5") as fields:
        nodes = fields["mesh/nodes"].shape[0]
        assert fields["mesh/part"].shape[0] >= report["model"]["elements"]  # and the points
        assert fields["equilibrium/displacement"].shape == (nodes, 3)
        # each reaction stands at both nodes of its pair
        assert fields["equilibrium/normal_reaction"][:].sum() == pytest.approx(
            2 * report["equilibrium"]["normal_force_sum"], rel=1e-12)
        assert len(fields["modes"]) == report["modes"]["unstable_count"]
        for part in ("real", "imaginary"):
            assert fields["modes/1"][part].shape == (nodes, 3)
        assert len(fields["cycle"]) == 32  # -cycle_samples
        # every data set that the text names is there, in the size it says
        for item in ElementTree.parse(run.output / "fields.xdmf").iter("DataItem"):
            file, name = item.text.split(":")
            assert file == "fields.h5"
            assert fields[name].shape == tuple(map(int, item.get("Dimensions").split()))


def check_figures(run):
    plot = subprocess.run([sys.executable, ROOT / "tools" / "plot", run.output], check=True, capture_output=True, text=True)
    names = ["modes", "estimate", "energy", "spectrum", "spectrogram", "cycle", "powers", "liftoff", "newton"]
    if run.report["model"]["elements"] > 0:
        names += ["pressure", "contact"]  # on surfaces
        names += [] if "need PyVista" in plot.stdout else ["shape"]
    for name in names:
        assert (run.output / f"{name}.png").read_bytes().startswith(b"\x89PNG"), name


@pytest.mark.parametrize("scene", ["oscillator/scene.toml", "oscillator/matrices.toml", "pin_on_disc/scene.toml"])
def test_dry_run_prints_the_model_and_writes_nothing(converged, scene):
    run = converged(INPUTS / scene, "--dry-run")
    for words in ("degrees of freedom", "contact pairs", "memory forecast"):
        assert words in run.printed
    assert not run.output.exists()


def test_help_explains_arguments_and_options(converged):
    printed = converged("-help").printed
    for words in ("friction", "--reference keys", "-settled_periods", "-modes_", "-transient_contact_solver", "-cycle_finish"):
        assert words in printed
    assert printed.count("--dry-run  ") == 1  # by one rank
