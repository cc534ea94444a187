"""tools/report: the page says what the run found, needs no other file, and fits screens of 1280 and 390 pixels."""

import base64
import html.parser
import json
import re
import shutil
import subprocess
import sys

import pytest
from conftest import INPUTS, ROOT

sys.path.insert(0, str(ROOT / "tools"))
import squeal  # noqa: E402

BROWSER = shutil.which("chromium") or shutil.which("google-chrome")


class Page(html.parser.HTMLParser):
    """Texts, images, and whatever else a browser would fetch."""

    def __init__(self, file):
        super().__init__()
        self.text, self.pictures, self.fetched, self.open = [], [], [], []
        self.feed(file.read_text())

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        for name in ("src", "href", "srcset", "data", "action", "poster"):
            if name in attributes and not attributes[name].startswith("data:"):
                self.fetched.append((tag, attributes[name]))
        if tag == "img":
            self.pictures.append(attributes)
        if tag in ("script", "style"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        if tag in ("script", "style"):
            self.open.pop()

    def handle_data(self, words):
        if self.open:
            assert not re.search(r"url\(|@import|https?:|fetch|XMLHttp", words)
        else:
            self.text.append(words)


def report(*words):
    done = subprocess.run([sys.executable, ROOT / "tools" / "report", *map(str, words)], capture_output=True, text=True, timeout=200)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def brake(tmp_path_factory):
    """A run whose scene's title must be escaped, with a cycle and warnings."""
    folder = tmp_path_factory.mktemp("page")
    run = squeal.run(INPUTS / "pin_on_disc", {"mesh.parameters.divisions": 2, "damping.beta": 6e-7, "cycle.steps_per_period": 40,
                                              "title": '"pin <1> & disc"'}, options=["-cycle_multipliers", "0"], output=folder / "run")
    report(run.folder)
    return run


def test_the_page_says_what_the_run_found(brake):
    page = Page(brake.folder / "report.html")
    text = " ".join(" ".join(page.text).split())
    assert "pin <1> & disc" in text
    heard = brake.report["heard"]
    assert text.index(heard[1:]) < text.index("Pictures") < text.index("Numbers") < text.index("How to run it again")
    assert f"{brake.report['cycle']['frequency_hz']:.6g} Hz" in text
    for mode in brake.report["modes"]["modes"][:3]:
        assert f"{mode['frequency_hz']:.7g}" in text
    said = [words for stage in brake.report.values() if isinstance(stage, dict) for words in stage.get("warnings", [])]
    assert said and all(words in text for words in said)
    assert "[friction]" in text and "-options_file" in text and brake.report["versions"]["petsc"] in text


def test_the_page_needs_no_other_file(brake):
    page = Page(brake.folder / "report.html")
    assert not page.fetched
    assert "default-src 'none'" in (brake.folder / "report.html").read_text()
    names = {picture["alt"].split(":")[0] for picture in page.pictures}
    assert {"modes", "estimate", "spectrum", "cycle", "powers", "pressure", "contact", "liftoff", "newton"} <= names
    for picture in page.pictures:
        content = base64.b64decode(picture["src"].partition("base64,")[2])
        assert content.startswith((b"\x89PNG", b"GIF8")) and len(content) > 3000


def test_how_to_run_it_again_runs_it_again(brake, tmp_path):
    again = squeal.run(brake.folder / "resolved.toml", options=["-options_file", brake.folder / "options.txt"], output=tmp_path)
    assert again.report["cycle"]["frequency_hz"] == brake.report["cycle"]["frequency_hz"]


@pytest.fixture(scope="module")
def studies(tmp_path_factory):
    """The oscillator with every stage that studies a number; two changes at one probe."""
    values = {"transient.enabled": False, "cycle.enabled": False, "sweep.key": "friction.coefficient", "sweep.from": 0.1, "sweep.to": 0.3,
              "sweep.points": 3, "sensitivity.numbers": "['friction.coefficient', 'spring.0.stiffness']",
              "change": "[{probe='pad_x', mass=0.002}, {probe='pad_x', stiffness=0.003}]", "response.from": 0.05, "response.to": 0.5,
              "response.count": 20, "robustness.samples": 100, "uncertain": "[{key='friction.coefficient', deviation=0.03}]"}
    return squeal.run(INPUTS / "oscillator", values, output=tmp_path_factory.mktemp("studies") / "run")


def words_of(run):
    report(run.folder)
    return " ".join(" ".join(Page(run.folder / "report.html").text).split())


def test_the_page_has_what_studies_of_a_number_found(studies):
    text, found = words_of(studies), studies.report
    (threshold,) = found["sweep"]["thresholds"]
    assert f"{threshold['values'][0]:.7g}" in text and "Modes that are unstable somewhere" in text
    any_mode = found["robustness"]["any"]
    assert f"{100 * any_mode['probability']:.3g} ({100 * any_mode['lower']:.3g} to {100 * any_mode['upper']:.3g})" in text
    (mode,) = found["sensitivity"]["modes"]
    for derivative in mode["derivatives"]:
        assert f"{squeal.number_label(derivative['key'], derivative['name'])} {derivative['value']:.5g} {0.01 * derivative['value'] * derivative['growth_rate_by']:.3g}" in text
    assert all(f"{share['table']} {share['name']}" in text for share in mode["shares"] if max(share["kinetic"], share["strain"]) >= 0.01)
    assert f"{mode['contact_powers'][0]:.5g} {mode['damping_power']:.5g}" in text
    for change, what in zip(mode["changes"], ("mass of 0.002 kg at pad_x", "spring of 0.003 N/m at pad_x")):
        assert f"{what} {mode['growth_rate']:.6g} {change['predicted']['growth_rate']:.6g} {change['computed']['growth_rate']:.6g}" in text
    peak = max(found["response"]["peaks"], key=lambda peak: peak["receptance"])
    assert f"{peak['frequency_hz']:.6g} {peak['receptance']:.4g}" in text
    assert all(words in text[: text.index("Pictures")] for words in found["response"]["warnings"])


def test_the_page_says_which_points_of_a_sweep_failed_and_why(studies, tmp_path):
    """Of the same results with a point that failed."""
    shutil.copytree(studies.folder, tmp_path / "run")
    found = json.loads((tmp_path / "run" / "report.json").read_text())
    point = found["sweep"]["points"][-1]
    point |= {"outcome": "no equilibrium", "reason": "friction is <too> large"}
    found["sweep"] |= {"outcome": "not converged", "reason": "1 of 3 points failed"}
    (tmp_path / "run" / "report.json").write_text(json.dumps(found))
    text = words_of(squeal.Results(tmp_path / "run"))
    assert "1 of 3 points failed" in text[: text.index("Pictures")] and "1 failed" in text[: text.index("Warnings")]
    assert f"{point['values'][0]:.7g} no equilibrium friction is <too> large" in text
    assert "sweep not converged 1 of 3 points failed" in text  # the table of stages
    assert "Not asked for: estimate" in text or "Not asked for: transient" in text


# Puts the page into a frame of each width, says what sticks out of it and which pictures are there.
MEASURE = """<!DOCTYPE html><body><script>
const page = %s, found = {};
for (const width of [1280, 390]) {
  const frame = document.createElement("iframe");
  frame.style.width = width + "px"; frame.style.height = "900px"; frame.style.border = 0;
  frame.srcdoc = page;
  frame.onload = () => {
    const root = frame.contentDocument.documentElement, images = [...frame.contentDocument.images];
    found[width] = {wide: root.scrollWidth, high: root.scrollHeight, seen: images.filter(i => i.naturalWidth > 0).length,
      images: images.length, text: parseFloat(frame.contentWindow.getComputedStyle(frame.contentDocument.querySelector("td")).fontSize)};
    if (Object.keys(found).length == 2) document.title = JSON.stringify(found);
  };
  document.body.append(frame);
}
</script></body>"""


def browse(profile, *words):
    """Without WebGL, which a processor draws too slowly for the suite: tests/evidence/page.py turns the view."""
    done = subprocess.run([BROWSER, "--headless", "--no-sandbox", "--disable-gpu", "--disable-3d-apis", "--hide-scrollbars", "--disable-background-networking",
                           f"--user-data-dir={profile}", *map(str, words)], capture_output=True, text=True, timeout=150)
    assert done.returncode == 0, done.stderr[-1000:]
    return done.stdout


@pytest.mark.skipif(not BROWSER, reason="no browser is installed: apt-get install chromium")
def test_a_browser_shows_it_wide_and_narrow_and_prints_it(brake, tmp_path):
    from PIL import Image

    file = brake.folder / "report.html"
    (tmp_path / "frames.html").write_text(MEASURE % json.dumps(file.read_text()).replace("</", "<\\/"))
    dom = browse(tmp_path / "profile", "--virtual-time-budget=8000", "--dump-dom", tmp_path / "frames.html")
    found = json.loads(re.search(r"<title>(.*?)</title>", dom)[1])
    for width, page in found.items():
        assert page["wide"] <= int(width), found  # nothing sticks out
        assert page["seen"] == page["images"] > 8
        assert page["text"] >= 12
    assert found["390"]["high"] > found["1280"]["high"]  # one column of pictures
    browse(tmp_path / "profile", "--window-size=1280,1400", f"--screenshot={tmp_path / 'page.png'}",
           f"--print-to-pdf={tmp_path / 'page.pdf'}", file)
    shot = Image.open(tmp_path / "page.png").convert("RGB")
    assert shot.size[0] == 1280 and len(shot.getcolors(10**7)) > 200  # text and pictures, no blank page


def test_several_runs_on_one_page(tmp_path):
    runs = [squeal.run(INPUTS / "oscillator", {"friction.coefficient": mu, "transient.enabled": False, "cycle.steps_per_period": 60},
                       output=tmp_path / f"mu_{mu}") for mu in (0, 0.3)]
    report(*(run.folder for run in runs), "--output", tmp_path / "both.html")
    page = Page(tmp_path / "both.html")
    text = " ".join(" ".join(page.text).split())
    assert "Side by side" in text and text.count("How to run it again") == 2
    assert all(run.report["heard"] in text for run in runs)
    assert sum(picture["alt"].startswith("modes") for picture in page.pictures) == 3  # both together, and each
