"""squeal from Python: runs started from Python, and what their results hand over as arrays and tables."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import INPUTS, ROOT, cores

sys.path.insert(0, str(ROOT / "tools"))
import squeal  # noqa: E402

COARSE = {"mesh.parameters.divisions": 2, "damping.beta": 6e-7, "cycle.steps_per_period": 40, "modes.method": "full"}


@pytest.fixture(scope="module")
def pin(tmp_path_factory):
    with cores(2):
        return squeal.run(INPUTS / "pin_on_disc", COARSE | {"force.0.vector": [0, 0, -120], "cycle.enabled": True}, ranks=2,
                          options=["-modes_shapes", "all", "-cycle_multipliers", "0", "-cycle_samples", "8"],
                          output=tmp_path_factory.mktemp("pin"))


def test_overrides_reach_the_run(pin):
    assert pin.exit_code == 0 and pin.report["model"]["ranks"] == 2
    assert pin.report["cycle"]["steps_per_period"] == 40
    # the holder's spring takes none of the load while it does not move, and little of it then
    assert 110 < pin.report["equilibrium"]["normal_force_sum"] <= 120


def test_shapes_of_all_modes(pin):
    modes = pin.modes()
    assert pin.mode_numbers() == list(range(1, len(modes) + 1)) and len(modes) > 20
    assert sum(modes["unstable"]) == pin.report["modes"]["unstable_count"] < len(modes)
    for number in pin.mode_numbers():
        shape = pin.shape(number)
        assert shape.shape == pin.nodes.shape
        # The largest entry of a mode is 1; of several within 1e-6 of the largest it is the first that is 1.
        assert np.abs(shape).max() == pytest.approx(1, abs=1.1e-6)
    with pytest.raises(squeal.Missing):
        pin.shape(len(modes) + 1)


def test_the_pairs_carry_the_load(pin):
    pairs, equilibrium = pin.pairs(), pin.report["equilibrium"]
    assert len(pairs) == pin.report["model"]["pairs"]
    total = equilibrium["normal_force_sum"]
    assert sum(pairs["normal_reaction"]) == pytest.approx(total, rel=1e-12)
    assert np.dot(pairs["pressure"], pairs["area"]) == pytest.approx(total, rel=1e-12)
    friction = np.hypot(pairs["friction_1"], pairs["friction_2"]).to_numpy()
    assert friction == pytest.approx(0.3 * pairs["normal_reaction"].to_numpy(), rel=1e-9)  # all slide


def test_the_motion_is_that_of_the_probes(pin):
    time, motion = pin.motion()
    assert motion.shape == (8, len(pin.nodes), 3)
    probe, steps = pin.probes("cycle")["pin"], pin.series("cycle", "time")
    at = [int(np.abs(steps - t).argmin()) for t in time]
    assert steps[at] == pytest.approx(time, rel=1e-12)
    face = {node for node in pin.pairs()["node"]}
    node = min(face, key=lambda k: np.linalg.norm(pin.nodes[k] - (0.09, 0, 0)))
    assert motion[:, node, 1] == pytest.approx(probe[at], rel=1e-12)
    assert len(pin.iterations()) == len(pin.report["cycle"]["newton"])


def test_results_show_their_answers(pin):
    words = repr(pin)
    assert words.startswith(f"Results({str(pin.folder)!r}): pin on disc; model {pin.report['model']['dofs']} degrees of freedom; ")
    assert "modes converged 1 unstable: " in words and f"cycle converged {pin.report['cycle']['frequency_hz']:.5g} Hz" in words
    page = pin._repr_html_()
    assert page.count("<tr>") == page.count("</tr>") == words.count(";") and "<td>cycle</td><td>converged</td>" in page


def test_the_mesh_is_pyvistas(pin):
    """Elements of positive volume, so that the order of their nodes is the one that VTK has, and a mode of largest entry 1."""
    python = Path(os.environ.get("SQUEAL_PYTHON", ROOT / "build" / "python")) / "bin" / "python"
    if not python.exists():
        pytest.skip("PyVista is optional: tools/setup installs it into build/python")
    text = f"""
import sys
sys.path.insert(0, {str(ROOT / "tools")!r})
import squeal
grid = squeal.Results({str(pin.folder)!r}).mesh(mode=1)
print(grid.n_cells, grid.compute_cell_sizes()["Volume"].min() > 0, round(float(grid["amplitude"].max()), 5) >= 1)
"""
    done = subprocess.run([python, "-B", "-c", text], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    cells, positive, moving = done.stdout.split()
    assert int(cells) == pin.report["model"]["elements"] and positive == moving == "True"


def test_errors_are_sentences(tmp_path):
    with pytest.raises(squeal.SquealError, match="coeficient.*did you mean"):
        squeal.run(INPUTS / "oscillator", {"friction.coeficient": 0.3}, output=tmp_path / "a")
    with pytest.raises(squeal.TookTooLong):
        squeal.run(INPUTS / "pin_on_disc", limit=0.01, output=tmp_path / "b")
    with pytest.raises(squeal.SquealError, match="no report.json"):
        squeal.Results(tmp_path)
    stable = squeal.run(INPUTS / "oscillator", {"friction.coefficient": 0}, output=tmp_path / "c")
    with pytest.raises(squeal.Missing, match="cycle skipped"):
        stable.iterations()


def test_tables_of_a_study(tmp_path):
    """A swept number, random ones and a change, given as Python's lists and tables."""
    ask = {"sweep.key": "friction.coefficient", "sweep.from": 0.1, "sweep.to": 0.3, "sweep.points": 5, "uncertain": [{"key": "friction.coefficient", "deviation": 0.05}], "robustness.samples": 20,
           "sensitivity.numbers": ["friction.coefficient"], "change": [{"probe": "pad_x", "mass": 0.01}],
           "transient.enabled": False, "cycle.enabled": False}
    results = squeal.run(INPUTS / "oscillator", ask, output=tmp_path / "study")
    assert results.exit_code == 0
    sweep, thresholds = results.sweep(), results.thresholds()
    assert len(sweep.groupby("friction.coefficient")) >= 5
    data = results.to_xarray()
    assert set(data.dims) == {"friction.coefficient", "direction", "track"}
    assert data["growth_rate"].count() == sweep["track"].notna().sum() and data["frequency_hz"].attrs["units"] == "Hz"
    row = sweep.iloc[-1]
    picked = data.sel({name: row[name] for name in data.dims})
    assert float(picked["growth_rate"]) == row["growth_rate"]
    at = thresholds.iloc[0]
    assert at["friction.coefficient"] == pytest.approx(0.17649288, abs=2 * at["error"])  # exact
    assert set(results.derivatives()["key"]) == {"friction.coefficient"} and len(results.changes()) == 1
    shares = results.energy_shares()
    assert shares[["kinetic", "strain"]].sum().tolist() == pytest.approx([1, 1], abs=1e-9)
    assert len(results.samples()) == 20 and results.squeal_probabilities()["probability"][0] > 0.9
    assert results.probes("cycle") == {}


def test_settings_of_the_environment_are_those_of_the_tools():
    settings = squeal.environment()
    assert settings["OMPI_ALLOW_RUN_AS_ROOT"] == "1" and settings["PATH"] == os.environ["PATH"]
