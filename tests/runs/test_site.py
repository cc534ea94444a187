"""The documentation site: links of all pages, and the commands of its tutorials, run as they stand on the smallest scenes."""

import os
import re
import shutil
import subprocess
import sys

import pytest
from conftest import INPUTS, ROOT

SITE = ROOT / "tools" / "site"
sys.path.insert(0, str(SITE))
import pages  # noqa: E402

TUTORIALS = sorted((SITE / "tutorials").glob("*.md"))
HOWTO = sorted((SITE / "howto").glob("*.md"))


def test_links_lead_somewhere():
    """Every relative link and picture of every page exists, and so does the heading that a link names."""
    assert len(pages.pages()) > 40 and not pages.broken_links()


def test_broken_links_are_found(tmp_path):
    (tmp_path / "a.md").write_text("# One `[two]`\n[x](b.md) [y](#one-two) [z](#three) `[c](d.md)`\n```\n[e](f.md)\n```\n![p](g.png)\n")
    found = [problem.partition(": there")[0] for problem in pages.broken_links(tmp_path)]
    assert found == ["a.md: b.md", "a.md: #three", "a.md: g.png"]


def test_every_page_of_the_site_is_in_its_contents():
    named = set(re.findall(r": (\S+\.md)$", (SITE / "mkdocs.yml").read_text(), re.M))
    assert {str(page.relative_to(ROOT)) for page in SITE.rglob("*.md")} <= named
    assert all((ROOT / page).is_file() for page in named)


@pytest.fixture(scope="module")
def desk(tmp_path_factory):
    """A folder in which the pages' commands work: the program, tools and scenes are links; results stay here."""
    folder = tmp_path_factory.mktemp("desk")
    for name in ("build", "inputs"):
        (folder / name).mkdir()
    (folder / "build" / "squeal").symlink_to(os.environ["SQUEAL"])
    (folder / "tools").symlink_to(ROOT / "tools")
    for scene in INPUTS.iterdir():
        if scene.is_dir() and not scene.name.startswith("results"):
            (folder / "inputs" / scene.name).symlink_to(scene)
    return folder


def commands(page):
    return [line for line in pages.commands_of(page) if re.match(r"(build|tools)/", line)]


def run(line, folder):
    done = subprocess.run(line, shell=True, cwd=folder, capture_output=True, text=True, timeout=600)
    if "no python module" in done.stderr:
        pytest.skip(f"{line}: {done.stderr.strip()}")
    assert done.returncode == 0, f"{line}\n{done.stdout[-2000:]}{done.stderr[-2000:]}"
    return done.stdout


@pytest.mark.parametrize("page", TUTORIALS, ids=lambda page: page.stem)
def test_tutorials_run_as_they_stand(page, desk):
    """And they print what the page says: each line that it quotes of squeal's table, up to an ellipsis."""
    assert len(commands(page)) >= 3
    printed = " ".join(" ".join(run(line, desk) for line in commands(page)).split())
    for quoted in pages.commands_of(page):
        if re.match(r"(heard|modes|thresholds|\d)", quoted):
            words = quoted.partition(" …")[0].split()
            # what is computed may differ in its last digits between processors
            pattern = r"\s+".join(re.escape(word[:4]) + r"\S*" if re.search(r"\d", word) else re.escape(word) for word in words)
            assert re.search(pattern, printed), quoted


@pytest.mark.parametrize("page", HOWTO, ids=lambda page: page.stem)
def test_scenes_and_keys_of_the_howtos_are_right(page, desk):
    """Their runs are checked by --dry-run, which reads scene, mesh and every key; tools name themselves by --help."""
    for line in commands(page):
        if "inputs/mine" in line:
            continue  # the reader's own
        run(line.split()[0] + " --help" if line.startswith("tools/") else line + " --dry-run", desk)


@pytest.mark.skipif(not shutil.which("mkdocs"), reason="mkdocs is not installed")
def test_the_site_is_built(tmp_path):
    """Strictly, so that a warning is an error; the build checks that each page leads somewhere and loads nothing from a network."""
    run(f"{SITE / 'build'} {tmp_path}", ROOT)
    assert (tmp_path / "index.html").is_file() and (tmp_path / "tools/site/tutorials/lock_in.html").is_file()
