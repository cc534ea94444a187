"""What is alive on the page of tools/report: its arrays hold the run's own numbers, its charts those of the pictures."""

import base64
import html
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import zlib

import numpy as np
import pytest
from conftest import INPUTS, ROOT

sys.path.insert(0, str(ROOT / "tools"))
from squeal import plot_basis  # noqa: E402
from squeal import report_charts  # noqa: E402
from squeal import report_input  # noqa: E402
from squeal import report_tables  # noqa: E402
from squeal import report_view  # noqa: E402
import squeal  # noqa: E402
from squeal import surface  # noqa: E402
from squeal.part_shares import part_shares  # noqa: E402
from squeal.plot_numbers import axis_label, unit_of_key, words_of  # noqa: E402
from squeal.plot_places import Place, places_of  # noqa: E402


def unpacked(text, kind):
    return np.frombuffer(zlib.decompress(base64.b64decode(text)), kind)


@pytest.fixture(scope="module")
def pin(tmp_path_factory):
    """A cycle of the pin, coarse."""
    return squeal.run(INPUTS / "pin_on_disc", {"mesh.parameters.divisions": 2, "damping.beta": 6e-7, "cycle.steps_per_period": 40},
                      options=["-cycle_multipliers", "0"], output=tmp_path_factory.mktemp("alive") / "pin")


@pytest.fixture(scope="module")
def view(pin):
    return report_view.view_of(pin, 1e6)


def test_the_view_has_each_node_of_the_surface_once_and_closed_faces_of_each_part(pin, view):
    positions = unpacked(view["positions"], np.float32).reshape(-1, 3)
    assert len(positions) == view["nodes"] <= len(pin.nodes)
    assert [part["name"] for part in view["parts"]] == ["disc", "pin"]
    for part in view["parts"]:
        triangles = unpacked(part["triangles"], np.uint16).reshape(-1, 3)
        own = positions[np.unique(triangles)]
        assert len(np.unique(own, axis=0)) == len(own)  # nodes of two parts may share a place
        sides = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
        assert (np.unique(sides, axis=0, return_counts=True)[1] == 2).all()  # no hole, even where parts are hidden


def test_the_shape_of_a_mode_comes_whole(pin, view):
    motion = next(motion for motion in view["motions"] if motion["mode"] == 1)
    shape = unpacked(motion["shape"], np.float32).reshape(-1, 3, 2)
    kept = report_view.Surface(pin).kept
    assert shape[..., 0] + 1j * shape[..., 1] == pytest.approx(pin.shape(1)[kept], rel=1e-6, abs=1e-6 * np.abs(pin.shape(1)).max())


def test_the_harmonics_of_the_cycle_give_its_motion_again(pin, view):
    """At every sample that the run kept, as the browser adds them up; to what the page says that they lack."""
    motion = view["motions"][0]
    shapes = unpacked(motion["shape"], np.float32).reshape(motion["harmonics"], -1, 3, 2)
    time, moved = pin.motion()
    moved = (moved - moved.mean(axis=0))[:, report_view.Surface(pin).kept]
    phase = 2 * np.pi * np.arange(1, len(shapes) + 1)[:, None] * time / pin.report["cycle"]["period"]
    again = np.einsum("kt,knc->tnc", np.cos(phase), shapes[..., 0]) - np.einsum("kt,knc->tnc", np.sin(phase), shapes[..., 1])
    lacking = float(re.search(r"lack ([\d.e-]+) %", motion["words"])[1]) / 100
    assert motion["mode"] == 0 and np.linalg.norm(again - moved) <= (1.06 * lacking + 1e-6) * np.linalg.norm(moved)  # two digits are said
    assert lacking < report_view.REST_OF_MOTION


@pytest.mark.parametrize("geometry", ["pin.geo", "pin_tetrahedra.geo"])
def test_the_page_says_which_part_moves_and_how_to_ask_for_the_numbers(tmp_path, geometry):
    """Shares by the shapes alone are those of the program's own matrices; what is said to ask with does ask."""
    run = squeal.run(INPUTS / "pin_on_disc", {"mesh.file": geometry, "cycle.enabled": False, "damping.beta": 1e-7}, output=tmp_path / "run")
    found, text = part_shares(run, 3), report_tables.moving_parts(run)
    command = shlex.split(html.unescape(re.search("<pre>(.*?)</pre>", text)[1]))
    words = [word for word in command[1:] if word != "--set"]
    why = squeal.run(words[0], dict(word.split("=", 1) for word in words[3:]), output=words[2])
    causes = why.report["sensitivity"]["modes"]
    assert len(found) == min(3, len(causes)) and {"friction.coefficient", "part.pin.young"} <= {by["key"] for by in causes[0]["derivatives"]}
    for mode, cause in zip(found, causes):
        own = {share["name"]: share for share in cause["shares"] if share["table"] == "part"}
        for energy in ("kinetic", "strain"):
            held = sum(share[energy] for share in own.values())  # the page's are of solids
            assert {part["name"]: part[energy] for part in mode["parts"]} == pytest.approx({name: own[name][energy] / held for name in own}, abs=1e-6)
        assert all(f"{100 * part['kinetic']:.3g}" in text for part in mode["parts"])
    assert report_tables.moving_parts(why) == ""  # which says more


def test_modes_beyond_the_room_are_named(pin):
    assert report_view.view_of(pin, 10)["left_out"] == pin.mode_numbers()


def test_the_effective_radius_gives_the_torque(pin):
    """Friction of one coefficient, all along the way of the rotor: the torque is mu times force times radius."""
    (place,), contact = places_of(pin), pin.report["equilibrium"]["contacts"][0]
    mu = plot_basis.scene_of(pin)["friction"]["coefficient"]
    assert mu * place.force * place.radius == pytest.approx(abs(contact["torque"]), rel=1e-6)
    assert place.speed == pytest.approx(20 * place.radius) and place.leading[1] < place.centre[1] < place.trailing[1]
    assert place.marks()["name"] == "pin_face on disc_face"


def test_a_rotor_drives_the_contacts_of_its_part(pin, tmp_path):
    """As the contact's own rotation does; a part that touches no contact drives none."""
    for part, radius in (("disc", places_of(pin)[0].radius), ("pin", None)):
        shutil.copytree(pin.folder, tmp_path / part)
        file = tmp_path / part / "resolved.toml"
        text, count = re.subn(r"\nrotation = (\{.*rate.*\})", "", file.read_text())
        file.write_text(text + f'\n[[rotor]]\npart = "{part}"\naxis = [0, 0, 1]\nrate = 20\n')
        (place,) = places_of(squeal.Results(tmp_path / part))
        assert count == 1 and place.radius == radius


def test_numbers_by_name_drive_the_pictures_and_the_page(pin, tmp_path):
    """A rate and a coefficient by name, one with a minus: the same places of the contact, and the same input on the page."""
    shutil.copytree(pin.folder, tmp_path / "named")
    file = tmp_path / "named" / "resolved.toml"
    text, rates = re.subn(r"(\brate\S* = )20\b", r'\1"-speed"', file.read_text())
    text, laws = re.subn(r"(\ncoefficient = )[\d.]+", r'\1"mu"', text)
    file.write_text(text.replace("[mesh]", 'numbers = { "speed" = -20, "mu" = 0.3 }\n\n[mesh]', 1))
    named = squeal.Results(tmp_path / "named")
    assert rates == laws == 1 and [place.marks() for place in places_of(named)] == [place.marks() for place in places_of(pin)]
    assert "20 rad/s" in report_input.input_of(named) and report_input.input_of(named) == report_input.input_of(pin)


def test_marks_of_the_model_stand_apart_over_its_picture():
    """The white around the model is cut, the marks move with it, and names of edges that are seen at one place keep apart."""
    from squeal import plot_model

    picture = np.full((800, 1000, 3), 255, np.uint8)
    picture[300:500, 200:900] = 90
    same = np.array([400.0, 450.0])
    cut, ((centre, edges),) = plot_model.cropped(picture, [(same, {"leading": same, "trailing": same})])
    assert cut.shape == (259, 759, 3) and centre.tolist() == [230, 180] and edges["leading"].tolist() == [230, 180]
    figure, axes = plot_model.plt.subplots()
    plot_model.show(axes, cut, "")
    plot_model.draw_marks(axes, cut, [(centre, edges)])
    figure.canvas.draw()
    boxes = [text.get_bbox_patch().get_window_extent() for text in axes.texts]
    assert [text.get_text() for text in axes.texts] == ["leading", "trailing"] and not boxes[0].overlaps(boxes[1])
    assert axes.lines[0].get_color() == plot_model.RED


def test_the_slope_of_the_mechanical_energy_is_the_sum_of_powers(pin):
    from squeal import plot_motion

    powers = plot_motion.powers_of(pin)
    total = powers["contact_power"] - np.abs(powers["damping_power"]) + powers["load_power"]
    steps = np.diff(powers["energy"])
    assert steps == pytest.approx(total[1:] * np.diff(powers["time"]), abs=1e-6 * np.abs(steps).max())


def test_a_pad_all_round_the_axis_has_no_edges_and_one_on_a_belt_has():
    angle = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    turning = {"rotation": {"axis": "z", "rate": -3}}
    whole = Place(0, turning, ring, np.ones(60), np.array([0, 0, 1.0]))
    assert whole.leading is None and whole.way is None and whole.radius == pytest.approx(1)
    half = Place(0, turning, ring[:20], np.ones(20), np.array([0, 0, 1.0]))
    assert half.leading @ half.way < half.centre @ half.way < half.trailing @ half.way
    belt = Place(0, {"velocity": [0, 2, 0]}, ring, np.ones(60), np.array([0, 0, 1.0]))
    assert belt.speed == 2 and belt.leading[1] < -0.9 and belt.trailing[1] > 0.9 and belt.radius is None


def test_masses_are_those_of_the_volumes(pin):
    """A cube of each solid, and a shell; then the pin, whose faces are two sectors of a ring and what joins them."""
    cube = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], float) + 7
    assert surface.volume([(9, list(range(8)))], cube, 0) == pytest.approx(1)
    assert surface.volume([(6, [0, 1, 3, 4])], cube, 0) == pytest.approx(1 / 6)
    assert surface.volume([(8, [0, 1, 2, 4, 5, 6])], cube, 0) == pytest.approx(1 / 2)
    assert surface.volume([(5, [0, 1, 2, 3])], cube, 0.01) == pytest.approx(0.01)
    disc, pin_mass = report_input.masses(pin, plot_basis.scene_of(pin)["part"])
    x, y, z = pin.nodes[np.unique([node for _, of in surface.by_part(pin.field("mesh/topology"), pin.field("mesh/part"))[1] for node in of])].T
    assert pin_mass == pytest.approx(5000 * np.ptp(z) * surface.volume([(5, [0, 1, 2, 3])], corners_of(x, y), 1), rel=0.02) and disc > pin_mass


def corners_of(x, y):
    """Of the sector of a ring that points fill."""
    radius, angle = np.hypot(x, y), np.arctan2(y, x)
    return np.array([[r * np.cos(a), r * np.sin(a), 0] for r, a in ((radius.min(), angle.min()), (radius.max(), angle.min()),
                                                                    (radius.max(), angle.max()), (radius.min(), angle.max()))])


def test_a_chart_has_the_numbers_of_its_picture():
    figure, (above, below) = plot_basis.plt.subplots(2, 1, sharex=True)
    above.plot([0, 1, 2], [5, np.nan, 7], "o--", color="#123456", label="first $x^{1/2}$")
    above.axvline(1.5, color="#ff0000", ls=":")
    above.set_yscale("symlog", linthresh=1)
    above.set_yticks([0, 10])
    below.barh([0, 1], [3, 4], color="#00ff00")
    below.set_yticks([0, 1], ["one", "two"])
    below.vlines([1, 2], 0, [1, 2], lw=3)
    below.set_xlabel("length [m]")
    figure.canvas.draw()
    (line, bars), whole = report_charts.charts_of(figure)
    assert whole and line["x"]["label"] == "length [m]" and line["shares"] == bars["shares"] == 0
    (drawn,) = line["lines"]
    assert drawn["x"] == [0, 1, 2] and drawn["value"] == [5, None, 7] and drawn["name"] == "first x^1/2" and drawn["dash"] and drawn["mark"] == "o"
    assert line["at_x"] == [{"colour": "#ff0000ff", "width": pytest.approx(1.5), "dash": [2, 3], "value": 1.5, "name": ""}]
    assert [word for _, word in line["y"]["ticks"]] == ["0", "10"] and line["y"]["ticks"][1][0] != 10
    assert [area["corners"][0][2] for area in bars["areas"]] == [3, 4] and bars["y"]["ticks"] == [[0, "one"], [1, "two"]]
    assert [segment["ends"] for segment in bars["segments"]] == [[[1, 1], [0, 1]], [[2, 2], [0, 2]]] and bars["segments"][0]["width"] == 3


def test_a_map_becomes_a_picture_in_its_chart_and_its_colours_stay_beside_it():
    figure, axes = plot_basis.plt.subplots()
    axes.grid(False)
    drawn = axes.pcolormesh([0, 1, 4], [0, 2, 3], [[1, 2], [3, 4]])
    figure.colorbar(drawn, ax=axes)
    (chart,), whole = report_charts.charts_of(figure)
    assert not whole and chart["images"][0]["extent"] == [0, 4, 0, 3]


@pytest.mark.parametrize("key, name, words", [("friction.coefficient", "", "friction coefficient"), ("part.pin.young", "", "Young's modulus of pin"),
                                              ("force.0.vector.2", "holder", "force on holder along z"), ("pressure.0.value", "back", "pressure on back"),
                                              ("spring.1.stiffness", "", "stiffness of spring 1"), ("contact.0.rotation.rate", "", "rotation rate of contact 0"),
                                              ("damping.beta", "", "stiffness-proportional damping"), ("mesh.parameters.divisions", "", "mesh divisions")])
def test_numbers_of_a_scene_have_words(key, name, words):
    assert words_of(key, name) == words and axis_label(key, name, "N").endswith(" [N]")


def test_units_come_from_the_scene_with_every_default(pin):
    assert unit_of_key(pin, "force.0.vector.2") == "N" and unit_of_key(pin, "part.1.young") == "Pa" and unit_of_key(pin, "friction.coefficient") == "-"


def page_of(*words, folder, environment=None):
    """Without pictures by PyVista, which take long."""
    file = folder / "page.html"
    done = subprocess.run([sys.executable, ROOT / "tools" / "report", *map(str, words), "--output", file], capture_output=True, text=True, timeout=200,
                          env=os.environ | {"SQUEAL_PYTHON": str(folder)} | (environment or {}))
    assert done.returncode == 0, done.stderr
    return file.read_text()


def test_a_page_without_the_libraries_says_so_and_keeps_its_pictures(pin, tmp_path):
    text = page_of(pin.folder, folder=tmp_path, environment={"SQUEAL_JAVASCRIPT": str(tmp_path)})
    assert "pictures alone" in text and "libjs-three" in text and 'type="text/plain"' not in text and text.count("<img") > 8


def test_a_comparison_begins_with_what_differs(pin, tmp_path):
    other = squeal.run(INPUTS / "oscillator", {"transient.enabled": False, "cycle.enabled": False}, output=tmp_path / "oscillator")
    again = squeal.run(INPUTS / "oscillator", {"transient.enabled": False, "cycle.enabled": False, "friction.coefficient": 0.05}, output=tmp_path / "less")
    rows = report_input.differences([other, again])
    coefficients = [plot_basis.scene_of(run)["friction"]["coefficient"] for run in (other, again)]
    assert [row for row in rows if row[0].startswith("friction.coefficient")] == [["friction.coefficient", *(f"{mu:.5g}" for mu in coefficients)]]
    assert not report_input.differences([other, other])
    text = page_of(other.folder, again.folder, folder=tmp_path)
    assert text.index("What differs") < text.index("friction.coefficient") < text.index("What comes of it") < text.index("Side by side")
    assert "<th></th><th>oscillator</th><th>less</th>" in text
    captions = re.findall(r"<figcaption>(.*?)</figcaption>", text[text.index("class='run'"):])
    assert captions and all(caption.startswith(("oscillator: ", "less: ")) for caption in captions)
    assert plot_basis.heading([pin, other], "modes").startswith(f"{pin.title} and {other.title}:")


def test_what_a_click_shows_is_a_mode_of_the_run(pin):
    from squeal import plot_stability

    charts, _ = report_charts.charts_of(plot_stability.draw_modes([pin]))
    lines = [line for line in charts[0]["lines"] if "modes" in line]
    modes = pin.report["modes"]["modes"]
    for line in lines:
        assert line["run"] == pin.folder.name
        for x, number in zip(line["x"], line["modes"]):
            assert 1000 * x == pytest.approx(modes[number - 1]["frequency_hz"], rel=1e-7)
    assert sorted(number for line in lines for number in line["modes"]) == list(range(1, len(modes) + 1))
    assert json.dumps(charts)
