"""Signorini's law at four places of the time step, and the mass at the contact (the models of tools/atlas)."""

import sys

import numpy as np
import pytest
from conftest import INPUTS, ROOT

sys.dont_write_bytecode = True
sys.path.insert(0, str(ROOT / "tools"))  # where its modules are
import atlas_contact as atlas  # noqa: E402


@pytest.mark.parametrize("share", [1, 0])
def test_the_dense_march_is_squeal(tmp_path, share):
    """What follows is measured on the dense march of one contact: it is the program's, a massless node included."""
    bar = atlas.bouncing_bar(10, share)
    gap, reaction, _ = bar.march("modified", 0.02, 120)
    same, force, run = bar.squeal(tmp_path, 0.02, 120, "bar")
    assert run["transient"]["outcome"] == "completed"
    assert np.abs(gap - same).max() < 1e-8 * 5  # the contact tolerance of 1e-10, over 120 steps
    assert np.abs(reaction - force).max() < 1e-6 * reaction.max()


def test_a_fallen_mass_lies_still_by_the_modified_law_alone():
    """Motion left, largest over eight phases of the impact in its step; the impact is at 4.43 m/s."""
    for law, coarse, fine in (("modified", 0, 0), ("velocity", 0.09, 0.09 / 8), ("end", 0.9, 0.9), ("start", 0.25, 0.25)):
        for h, expected in ((0.02, coarse), (0.0025, fine)):
            left = atlas.spurious_motion(law, h)
            if law == "modified":
                assert left < 1e-13
            else:  # the velocity law's falls with h, the others' does not fall at all
                assert 0.6 * expected < left < 1.5 * expected, (law, h, left)


def test_a_pressed_mass_feels_its_weight_by_every_law():
    for law in atlas.LAWS:
        gap, reaction, _ = atlas.falling_mass(0).march(law, 1e-3, 50)
        assert np.abs(gap).max() < 1e-15 and np.abs(reaction - 19.62).max() < 1e-9, law


def test_the_bars_reaction_converges_by_the_modified_law_and_rings_by_the_law_on_end_displacements():
    noise = {law: [atlas.bar_reaction(n, 0.3, 1, law)[1] for n in (25, 100)] for law in ("modified", "velocity", "end")}
    for law in ("modified", "velocity"):
        assert noise[law][0] < 0.01 and noise[law][1] < 0.3 * noise[law][0], noise
    assert min(noise["end"]) > 0.2, noise


def test_an_impact_costs_the_contact_nodes_kinetic_energy_and_little_without_its_mass():
    """50 m v^2/2 a node of mass .5 x 10/N at 10 m/s: 250/N J; without the mass a tenth of it at this step."""
    for elements in (25, 50, 100):
        loss, noise = atlas.bar_reaction(elements, 0.1, 1)
        assert loss == pytest.approx(250 / elements, rel=0.02)
        massless, quiet = atlas.bar_reaction(elements, 0.1, 0)
        assert 0 < massless < 0.02 * loss and quiet < noise


def test_many_impacts_never_gain_energy_by_the_modified_law_and_little_is_lost_on_a_fine_mesh():
    """Six bounces: what the fall had was 500 J. The law on start displacements gains in single steps."""
    def steps_of(law, elements):
        h = 0.3 / (3 * elements)
        energy = atlas.bouncing_bar(elements).march(law, h, int(16 / h))[2]
        return np.diff(energy), energy[-1]

    for elements in (15, 30):
        assert steps_of("modified", elements)[0].max() < 1e-9
    assert steps_of("start", 15)[0].max() > 1e-2
    assert -steps_of("modified", 60)[1] < 0.6 * -steps_of("modified", 15)[1]
