"""The error of the mesh by elements, the sizes that it asks for, and the path to a bar that is small enough."""

import math
import re
import subprocess
import sys

import h5py
import numpy as np
import pytest
from conftest import INPUTS, ROOT
from mesh_cases import BAR, BAR_SCENE, ELEMENTS

sys.path.insert(0, str(ROOT / "tools"))
from squeal import Results, surface  # noqa: E402
from squeal.mesh_estimate import blocks_of, chords, estimate, mode_vectors, scene_of  # noqa: E402
from squeal.mesh_sizes import factors_for, present_sizes, wanted_factors, write_sizes  # noqa: E402

LAM = complex(-1e-6 / 2 * (2 * math.pi * 250)**2, 2 * math.pi * 250)  # of the first mode, exactly
BOX = """
SetFactory("OpenCASCADE");
Box(1) = {0, 0, 0, 1, 0.2, 0.2};
MeshSize{:} = 0.2;
Physical Volume("bar") = {1}; Physical Surface("end") = {1};
Physical Surface("y") = {3, 4}; Physical Surface("z") = {5, 6};
"""


def bar(squeal, folder, geometry, *options):
    (folder / "mesh.geo").write_text(geometry)
    (folder / "scene.toml").write_text(BAR_SCENE)
    run = squeal(folder / "scene.toml", "-modes_shapes", "all", *options, ranks=1)
    assert run.code == 0, run.printed + run.errors
    return Results(run.output)


@pytest.mark.parametrize("element", ELEMENTS)
def test_the_parts_of_the_elements_sum_to_the_true_error(squeal, tmp_path, element):
    """Of a clamped bar, within a factor of 2 (0.71 to 1.74 seen); all of them have the sign of the error."""
    first, extrusion, order = ELEMENTS[element]
    for n in (4, 8) if not order else (4,):
        mode = estimate(bar(squeal, tmp_path, BAR.format(n=n, surface=first, layers=extrusion, order=order))).modes[0]
        true = LAM - mode.lam
        for sum_of_parts, error in ((mode.change.imag, true.imag), (mode.change.real, true.real)):
            assert 0.5 < sum_of_parts / error < 2
        assert (mode.of_cells.imag <= 0).all()


def test_left_vectors_and_strains_give_the_derivatives_by_moduli(squeal, tmp_path):
    """E d lambda/dE = - psi'K_part phi (1 + beta lambda), to 1e-6: central differences; without
    friction's left vector the two would not agree in their real parts."""
    parts = ("disc", "pin")
    run = squeal(INPUTS / "pin_on_disc", "--set", "cycle.enabled=false", "--set", "estimate.enabled=false", "--set", "modes.band=6000", "--set", "friction.direction_damping=false",
                 "--set", "sensitivity.numbers=" + str([f"part.{part}.young" for part in parts]).replace("'", '"'), ranks=2)
    results = Results(run.output)
    by = {entry["key"]: complex(entry["growth_rate_by"], 2 * math.pi * entry["frequency_hz_by"])
          for entry in run.report["sensitivity"]["modes"][0]["derivatives"]}
    scene = scene_of(results)
    modes, fields, left = mode_vectors(results)
    lam = complex(modes[0]["growth_rate"], 2 * math.pi * modes[0]["frequency_hz"])
    blocks, _ = blocks_of(results, scene, np.array([lam]))
    for block, part in zip(blocks, scene["part"]):
        xi, weights = block.elements.kind.rule
        strain, (_, det) = block.elements.strains(xi, fields[block.nodes]), block.elements.at(xi)
        product = np.einsum("eqi,eij,eqj,eq->", strain[..., left[0]], block.elements.D, strain[..., 0], weights * det)
        expected = by[f"part.{part['name']}.young"] * part["young"]
        assert abs(-product * block.stiffening[0] - expected) < 1e-6 * abs(expected)


def test_equal_errors_make_the_fewest_elements():
    """The rule leaves what was asked for, with an equal error in each new element, and more elements by any other factors."""
    eta, q = np.array([1.0, 2.0, 5.0, 9.0]), np.full(4, 4.0)
    r = factors_for(eta, q, 0.4)
    assert (eta * r**q).sum() == pytest.approx(0.4 * eta.sum(), rel=1e-9)
    assert np.ptp(eta * r**(q + 3)) < 1e-9
    for k in range(4):
        other = r * np.where(np.arange(4) == k, 1.05, 1)
        other *= (0.4 * eta.sum() / (eta * other**q).sum())**(1 / 4)  # the same error
        assert (other**-3).sum() > (r**-3).sum()


def test_sizes_are_small_where_the_error_is(squeal, tmp_path):
    """The strain of the first mode changes most at the free end; the mesh that gmsh makes of the sizes is finer there than at the
    clamp, and its error is that which was to be left, within a factor of 2."""
    run = bar(squeal, tmp_path, BOX)
    found = estimate(run)
    factors = wanted_factors(found, {1: 0.25})
    write_sizes(tmp_path / "sizes.pos", found, factors, 1, "bar")
    sized = bar(squeal, tmp_path, BOX, "--set", f"mesh.size_field={tmp_path / 'sizes.pos'}")
    finer = estimate(sized)
    block, = finer.blocks
    x, size = block.elements.places.mean(axis=1)[:, 0], present_sizes(block)
    assert size[x > 0.7].mean() < 0.8 * size[x < 0.3].mean()
    before, after = (abs(LAM - one.modes[0].lam) for one in (found, finer))
    assert 0.5 < after / before / 0.25 < 2


def test_the_tool_writes_what_paraview_reads(squeal, tmp_path):
    """Parts of the elements in the file sum to the printed change, a number for each of its cells, and the page names both."""
    run = bar(squeal, tmp_path, BOX)
    done = subprocess.run([sys.executable, ROOT / "tools" / "mesh_error", run.folder, "--size-field", tmp_path / "sizes.pos"],
                          capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "sizes.pos").read_text().count("SS(") == len(run.field("mesh/part"))
    printed = float(re.search(r"^\| [\d.]+ \| [-\d.e]+ \| ([-\d.e+]+) \|", done.stdout, re.M)[1])
    with h5py.File(run.folder / "mesh_error.h5") as file:
        growth = file["modes/1/growth"][()]
    assert len(growth) == len(run.field("mesh/part")) and growth.sum() == pytest.approx(printed, rel=1e-2)
    text = (run.folder / "mesh_error.xdmf").read_text()
    assert "mesh_error.h5:/modes/1/growth" in text and f'NumberOfElements="{len(growth)}"' in text
    assert (run.folder / "mesh_error.png").stat().st_size > 5000


def ring(sides, quadratic):
    """A block round an axis with this many flat sides, of 8- or 20-node bricks: elements and nodes. quadratic: mid-side nodes are on the circles."""
    number, solids = {}, []
    for k in range(sides):
        corners = [np.array([r, j, z]) for z in (0, 1) for r, j in ((1, k), (2, k), (2, k + 1), (1, k + 1))]
        places = corners + [(corners[a] + corners[b]) / 2 for a, b in (surface.HEX_EDGES if quadratic else ())]
        solids.append((48 if quadratic else 9, [number.setdefault((r, j % sides, z), len(number)) for r, j, z in places]))
    angle = 2 * math.pi / sides
    return solids, np.array([(r * math.cos(j * angle), r * math.sin(j * angle), z) for r, j, z in number])


def test_flat_sides_of_round_parts_turn():
    """A ring of 24 bricks turns by 15 degrees at each of its sides, within and without, and by right angles at its edges; with
    mid-side nodes on the circles no face has straight sides."""
    turned = np.degrees(surface.turns(*ring(24, False)))
    assert np.sum(np.abs(turned - 15) < 1e-6) == 48 and np.sum(np.abs(turned - 90) < 1e-6) == 96 and len(turned) == 48 + 96 + 48
    assert not len(surface.turns(*ring(24, True)))


def test_a_mesh_file_with_chords_says_that_its_bars_do_not_hold_them(squeal, tmp_path):
    (tmp_path / "round.geo").write_text("""SetFactory("OpenCASCADE"); Cylinder(1) = {0, 0, 0, 1, 0, 0, 0.2}; MeshSize{:} = 0.1;
Physical Volume("bar") = {1}; Physical Surface("end") = {3};
""")
    scene = re.sub(r'support = .*', 'support = [ { on = "end", fixed = "all" } ]', BAR_SCENE)
    subprocess.run(["gmsh", "-3", "-o", tmp_path / "round.msh", tmp_path / "round.geo"], check=True, stdout=subprocess.DEVNULL)
    said = {}
    for file in ("round.msh", "round.geo"):
        (tmp_path / "scene.toml").write_text(scene.replace("mesh.geo", file))
        run = squeal(tmp_path / "scene.toml", "-modes_shapes", "all", ranks=1)
        assert run.code == 0, run.errors
        said[file] = chords(Results(run.output))
    assert "no bar holds" in said["round.msh"] and not said["round.geo"]


def converge(folder, *arguments):
    done = subprocess.run([sys.executable, ROOT / "tools" / "converge", folder, "--output", folder / "path", *arguments],
                          capture_output=True, text=True)
    assert not done.stderr, done.stderr
    dofs = [int(cells) for cells in re.findall(r"^\| [^|]+ \| (\d+) \|", done.stdout, re.M)]
    bars = [float(cells) for cells in re.findall(r"\| ([\d.e-]+) % \|$", done.stdout, re.M)]
    return done.returncode, done.stdout, dofs, bars


def test_converge_ends_where_the_bar_is_met_or_the_limit(tmp_path):
    """By sizes to 0.05 % of the growth rate, code 0, with fewer degrees of freedom than all sizes alike; code 2 at --most; transfinite
    curves take no sizes, which is said, and the bar falls by division of the elements or by a number of the geometry."""
    (tmp_path / "mesh.geo").write_text(BOX)
    (tmp_path / "scene.toml").write_text(BAR_SCENE)
    code, text, dofs, bars = converge(tmp_path, "--part", "0.0005", "--alone")
    assert code == 0 and len(dofs) > 1 and bars[-1] <= 0.05 < bars[0] and "sizes by the estimate" in text, text
    assert (tmp_path / "path" / "converge.png").stat().st_size > 5000
    code, text, dofs, _ = converge(tmp_path, "--part", "1e-4", "--alone", "--most", "200")
    assert code == 2 and max(dofs) <= 200 and "--most 200 allows no more" in text, text
    (tmp_path / "mesh.geo").write_text(BAR.replace("n = {n};", "DefineConstant[n = {n}];").format(n=2, surface="", layers="", order=""))
    (tmp_path / "scene.toml").write_text(BAR_SCENE.replace('"mesh.geo"', '"mesh.geo", parameters = { n = 2 }'))
    code, text, dofs, bars = converge(tmp_path, "--part", "0.01")
    assert code == 0 and "its mesh takes no sizes" in text and "mesh.refine = 1" in text, text
    code, text, dofs, bars = converge(tmp_path, "--part", "0.01", "--by", "mesh.parameters.n")
    assert code == 0 and "mesh.parameters.n = 3" in text, text


def test_a_size_field_is_for_geometries(squeal, tmp_path):
    """A mesh file has its sizes: one message; so has a field that is missing."""
    (tmp_path / "mesh.geo").write_text(BOX)
    (tmp_path / "scene.toml").write_text(BAR_SCENE)
    run = squeal(tmp_path / "scene.toml", "--set", "mesh.size_field=none.pos", ranks=1)
    assert run.code == 1 and len(run.messages) == 1 and "none.pos" in run.messages[0], run.errors
    (tmp_path / "bar.msh").write_text("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n")
    (tmp_path / "sizes.pos").write_text('View "bar" {};\n')
    run = squeal(tmp_path / "scene.toml", "--set", "mesh.size_field=sizes.pos", "--set", "mesh.file=bar.msh", ranks=1)
    assert run.code == 1 and len(run.messages) == 1 and "mesh.size_field need a .geo" in run.messages[0], run.errors
