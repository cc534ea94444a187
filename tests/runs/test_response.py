"""Frequency responses of whole runs."""

import h5py
import numpy as np
import pytest
from conftest import INPUTS

OSCILLATOR = [INPUTS / "oscillator" / "scene.toml", "--set", "transient.enabled=false", "--set", "cycle.enabled=false"]
MATRICES = [INPUTS / "oscillator" / "matrices.toml", *OSCILLATOR[1:]]
PIN = [INPUTS / "pin_on_disc" / "scene.toml", "--set", "mesh.parameters.divisions=2", "--set", "cycle.enabled=false",
       "--set", "modes.method=full", "--set", "response.from=500", "--set", "response.to=12000", "--set", "response.count=150"]


def receptances(output):
    """Frequencies, and H by the probe that is driven and the one that is read."""
    with h5py.File(output / "history.h5") as file:
        group = file["response/receptance"]
        pairs = {(i, j): group[i][j][()] for i in group for j in group[i]}
        return file["response/frequency"][()], {key: value[:, 0] + 1j * value[:, 1] for key, value in pairs.items()}


def test_responses_are_reciprocal_without_friction_alone(converged):
    """Without friction the problem is symmetric: what is left is rounding at a condition number of 1e6. The holder's motion along
    the disc's axis and the pin's across it then hardly know each other, by the disc's symmetry."""
    for friction, least, greatest in ((0, 0, 1e-10), (0.3, 1e-2, 2)):
        run = converged(*PIN, "--set", f"friction.coefficient={friction}", ranks=1)
        _, h = receptances(run.output)
        size = np.sqrt(np.abs(h["holder", "holder"]).max() * np.abs(h["pin", "pin"]).max())
        assert least <= np.abs(h["holder", "pin"] - h["pin", "holder"]).max() / size <= greatest
        entry = run.report["response"]
        assert entry["outcome"] == "converged" and entry["residual"] <= 1e-5 and entry["change"] < 1e-3
        unstable = run.report["modes"]["unstable_count"]
        assert ("unstable" in " ".join(entry.get("warnings", []))) == (unstable > 0) == (friction > 0)


def test_ranks_agree(converged):
    """Residuals of 1e-5 on both sides leave 1e-10 times a compliance; ranks differ in rounding and in the order of passes."""
    answers = [receptances(converged(*PIN, ranks=ranks).output) for ranks in (1, 2, 3)]
    for frequency, h in answers[1:]:
        assert np.array_equal(frequency, answers[0][0])
        for key, value in h.items():
            assert np.abs(value - answers[0][1][key]).max() <= 1e-8 * np.abs(answers[0][1][key]).max(), key


def test_the_poles_are_the_modes(converged):
    """Two degrees of freedom slide: H is a polynomial of degree two in s = i omega over that of the four eigenvalues."""
    scene = [*OSCILLATOR, "--set", "friction.coefficient=0.05", "--set", "response.from=0.05", "--set", "response.to=0.4", "--set",
             "response.count=20", "--set", "response.excitation=pad_x"]
    run = converged(*scene, ranks=1)
    poles = [complex(mode["growth_rate"], 2 * np.pi * mode["frequency_hz"]) for mode in run.report["modes"]["modes"]]
    frequency, h = receptances(run.output)
    s = 2j * np.pi * frequency
    assert len(poles) == 2 and set(h) == {("pad_x", "pad_x"), ("pad_x", "pad_y")}
    for values in h.values():
        numerator = values * np.prod([(s - pole) * (s - pole.conjugate()) for pole in poles], axis=0)
        rows = np.column_stack([np.ones(20), s, s ** 2])
        wanted = rows @ np.linalg.lstsq(rows, numerator, rcond=None)[0]
        assert np.abs(numerator - wanted).max() <= 1e-12 * np.abs(numerator).max()


@pytest.mark.parametrize("words, message", [
    (["response.from=1", "response.to=2", "response.excitation=pad_z"], "pad_z"),
    (["response.from=1", "response.to=2", "response.excitation=['pad_x','pad_x']"], "twice"),
    (["response.from=2", "response.to=1"], "above 'from'"),
    (["response.from=0", "response.to=1"], "positive"),
    (["response.from=1"], "'to'"),
    (["response.from=1", "response.to=2", "response.count=0"], "positive"),
    (["response.from=1", "response.to=2", "response.count=1"], "from 2 to 100000"),
    (["response.from=1", "response.to=2", "response.count=1000000000"], "from 2 to 100000"),
    (["response.from=1", "response.to=2", "probe=[]"], "[[probe]]"),
])
def test_bad_input_is_one_message(squeal, words, message):
    run = squeal(*MATRICES, *[word for pair in words for word in ("--set", pair)], ranks=1)
    assert run.code == 1 and len(run.messages) == 1 and message in run.messages[0], run.errors


@pytest.mark.parametrize("word, message", [("damping.alpha=0.1", "[damping] alpha"), ("damping.beta=1e-3", "[damping] beta")])
def test_damping_of_parts_is_refused_without_parts(squeal, word, message):
    """Masses of points and springs carry none: it was silently without effect."""
    run = squeal(*OSCILLATOR, "--set", word, "--dry-run", ranks=1)
    assert run.code == 1 and len(run.messages) == 1, run.errors
    assert f"--set {word}: {message} has no effect" in run.messages[0] and "give each [[spring]] its damping" in run.messages[0]

