"""What the mesh leaves open on modes: a model with every element divided, and where both meshes lead."""

import math

import pytest
from conftest import INPUTS
from mesh_cases import ELEMENTS, write_case

@pytest.mark.parametrize("case, meshes", [("clamped bar", (1, 2, 4)), ("flutter pair", (1, 2, 4)), ("cantilever", (1,)), ("thick ring", (1,))])
@pytest.mark.parametrize("element", ELEMENTS)
def test_the_error_of_exact_cases_is_known(squeal, tmp_path, element, case, meshes):
    """The change that is expected of growth rate and frequency is between half and twice the true error, and the bar holds the exact
    values. The pair's growth is by friction: the bars' error moves it by a tenth and less."""
    for n in meshes:
        exact = write_case(tmp_path, case, element, n)
        report = squeal(tmp_path / "scene.toml", "--set", "modes.mesh_error=refinement", ranks=1).report
        mode = report["modes"]["mesh_error"]["modes"][0]
        for name, error, value in (("frequency_hz", "frequency_error", exact.imag / (2 * math.pi)), ("growth_rate", "growth_error", exact.real)):
            expected = abs(mode["corrected_" + name] - mode[name])
            assert 0.5 < expected / abs(value - mode[name]) < 2
            assert abs(mode["corrected_" + name] - value) <= mode[error]


@pytest.mark.parametrize("element", ["hex8", "wedge6", "tet4"])
def test_a_divided_mesh_is_as_round_as_its_geometry(squeal, tmp_path, element):
    """The ring's section is the polygon of all nodes on its circles: 8 n chords a quarter once the sides of n = 1, 2 were halved, and again
    8 n after one more division, which leaves the sides straight. Without nodes on the geometry there would be 4 n."""
    for n, refine in ((1, 0), (1, 1), (2, 1), (1, 2)):
        write_case(tmp_path, "thick ring", element, n)
        report = squeal(tmp_path / "scene.toml", "--set", f"mesh.refine={refine}", ranks=1).report
        chords = 4 * n * (2 if refine else 1)
        area = (0.32**2 - 0.145**2) / 2 * chords * math.sin(math.pi / 2 / chords)
        assert report["model"]["parts"][0]["mass"] == pytest.approx(7850 * 0.0225 * area, rel=1e-9)


COARSE_PIN = [INPUTS / "pin_on_disc" / "scene.toml", "--set", "mesh.parameters.divisions=2", "--set", "cycle.enabled=false", "--set",
              "estimate.enabled=false", "--set", "modes.band=6000"]


@pytest.fixture(scope="module")
def modes_of_finer_mesh(module_run):
    return module_run(*COARSE_PIN, "--set", "mesh.refine=1", ranks=1)["modes"]["modes"]


@pytest.mark.parametrize("ranks", [1, 2, 3])
def test_the_finer_modes_are_those_of_the_finer_mesh(squeal, modes_of_finer_mesh, ranks):
    """Those that a run on mesh.refine = 1 finds, to 1e-6: growth rates are off by 1e4 times a backward error of 1e-12."""
    for found in squeal(*COARSE_PIN, "--set", "modes.mesh_error=refinement", ranks=ranks).report["modes"]["mesh_error"]["modes"]:
        finer = min(modes_of_finer_mesh, key=lambda mode: abs(mode["frequency_hz"] - found["finer_frequency_hz"]))
        assert found["finer_growth_rate"] == pytest.approx(finer["growth_rate"], rel=1e-6)
        assert found["finer_frequency_hz"] == pytest.approx(finer["frequency_hz"], rel=1e-8)


@pytest.mark.parametrize("geometry", ["pin.geo", "pin_tetrahedra.geo"])
def test_pairs_that_open_on_the_finer_mesh_widen_the_bar(squeal, geometry):
    """Pairs open at the edge of the pin on the finer mesh alone, and the growth rate jumps. The bar holds 150 1/s, which meshes of twice
    as many divisions and more come to; held closed, the finer mesh moves the growth rate of the tetrahedra by less than a tenth of that."""
    scene = INPUTS / "pin_on_disc" / "scene.toml"
    run = squeal(scene, "--set", f"mesh.file={scene.with_name(geometry)}", "--set", "cycle.enabled=false", "--set", "estimate.enabled=false",
                 "--set", "modes.band=6000", "--set", "modes.mesh_error=refinement", ranks=1)
    mode = run.report["modes"]["mesh_error"]["modes"][0]
    jump, smooth = (abs(mode["finer_growth_rate"] - mode["held_growth_rate"]), abs(mode["held_growth_rate"] - mode["growth_rate"]))
    assert jump > 10 and mode["growth_error"] == pytest.approx(jump + 1.25 * smooth / 2, rel=1e-9)
    assert abs(mode["corrected_growth_rate"] - 150) <= mode["growth_error"] < 60
    assert mode["undecided"] is False
    assert geometry == "pin.geo" or smooth < 0.1 * jump


def test_a_stable_mode_that_a_finer_mesh_lets_grow_is_asked_about(squeal):
    """On 5048 degrees of freedom the mode of the brake that squeals is stable by 73 1/s, three times as much as others below it. On 33 224
    it grows by 9.5 1/s: by its damping ratio it is the first to be asked about, and the first sentence says that its sign is open."""
    run = squeal(INPUTS / "tgv", "--set", "mesh.parameters.size=4000", "--set", "modes.band=4000", "--set", "cycle.enabled=false",
                 "--set", "transient.enabled=false", "--set", "estimate.enabled=false", "--set", "modes.mesh_error=refinement", ranks=1)
    modes = run.report["modes"]["mesh_error"]["modes"]
    assert len(modes) == 2 and modes[0]["frequency_hz"] > 3000 and modes[0]["growth_rate"] < modes[1]["growth_rate"] < 0
    assert modes[0]["undecided"] and not modes[1]["undecided"]
    assert abs(modes[0]["corrected_growth_rate"] - 9.5) <= modes[0]["growth_error"]
    assert "undecided by the mesh" in run.printed
