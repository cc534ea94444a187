"""README.md and the pages of inputs, held against what the program prints and writes."""

import json
import os
import re
import subprocess
import sys
import tomllib

import h5py
import pytest
from conftest import INPUTS, ROOT, Run, Short

GUIDE, KEYS, RESULTS, FILES = (INPUTS / f"{name}.md" for name in ("README", "KEYS", "RESULTS", "RUNS"))

NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]\d+)?(?!\w)")
# Relative tolerance of the numbers of a line: which pair opens in which step moves with the rounding; times by the machine.
LOOSE = {"open pairs": 0.03, "  time  ": 100}


def block_of(file, first_words):
    """The lines of the fenced or indented block of a page that starts with these words."""
    lines = file.read_text().splitlines()
    start = next(i for i, line in enumerate(lines) if line.strip().startswith(first_words))
    indent = "    " if lines[start].startswith("    ") else ""
    end = next(i for i in range(start, len(lines)) if lines[i] == "```" or not lines[i].startswith(indent))
    return [line[len(indent):] for line in lines[start:end]]


def words_of(line):
    return " ".join(NUMBER.sub("#", line).split())


def agree(quoted, printed, tolerance):
    """An error measure, two digits or three and an exponent, may be another one of its order; what is rounding stays so."""
    a, b = float(quoted), float(printed)
    if re.fullmatch(r"[-+]?\d(\.\d{1,2})?e-\d+", quoted):
        return max(abs(a), abs(b)) < 1e-9 or 0.2 <= a / b <= 5
    return abs(a - b) <= tolerance * abs(a)


def same(quoted, printed):
    if words_of(quoted) != words_of(printed):
        return False
    tolerance = next((loose for words, loose in LOOSE.items() if words in quoted), 1e-3)
    return all(agree(a, b, tolerance) for a, b in zip(NUMBER.findall(quoted), NUMBER.findall(printed)))


def test_readme_prints_what_the_program_prints(tmp_path):
    """Every line that README quotes of the pin on a disc is printed, in this order; rows of modes may be left out."""
    run = Short([INPUTS / "pin_on_disc" / "scene.toml"], 2, tmp_path)
    shown = run.printed.replace(str(run.output), "results/pin_on_disc").replace(os.environ["SQUEAL"], "build/squeal")
    left = iter(shown.splitlines())
    for quoted in block_of(ROOT / "README.md", "pin on disc"):
        near = [line for line in shown.splitlines() if words_of(line) == words_of(quoted)]
        assert any(same(quoted, line) for line in left), f"README says\n{quoted}\nsqueal prints\n" + "\n".join(near[:3])


def test_the_first_command_names_a_scene_with_both_parts_of_damping():
    """README's first command runs the smallest mesh; the brake's hub and disc are damped by the mass part of Rayleigh damping."""
    first = block_of(ROOT / "README.md", "tools/")[0].split()
    assert first[:2] == ["tools/run", "inputs/pin_on_disc"]
    scene = (INPUTS / "tgv" / "scene.toml").read_text()
    assert re.search(r"^alpha = ", scene, re.M) and re.search(r"^beta = ", scene, re.M)


def test_own_model_runs(converged, tmp_path):
    """README's own model in ten lines, on the mesh whose groups it names."""
    scene = tmp_path / "scene.toml"
    scene.write_text("\n".join(block_of(ROOT / "README.md", "mesh = ")))
    run = converged(scene, "--set", f"mesh.file={INPUTS / 'pin_on_disc' / 'pin.geo'}", "-cycle_multipliers", "0", ranks=1)
    assert run.report["cycle"]["outcome"] == "converged"


def test_the_example_of_the_guide_is_the_pin():
    """The guide's whole small example, key by key."""
    shown = tomllib.loads("\n".join(block_of(GUIDE, 'title = "pin on disc"')))
    assert shown == tomllib.loads((INPUTS / "pin_on_disc" / "scene.toml").read_text())


def test_the_guide_is_short():
    assert GUIDE.stat().st_size <= 25000


def test_the_lock_in_chart_of_the_guide(converged, tmp_path):
    """The overrides that inputs/README.md gives for one's own mesh, here on the pin, and the picture that it names."""
    (command,) = [line.split() for line in GUIDE.read_text().splitlines() if line.startswith("    tools/run inputs/mine")
                  and "sweep.key" in line]
    run = converged(INPUTS / "pin_on_disc" / "scene.toml", *command[2:], "--set", "mesh.parameters.divisions=2", "--set",
                    "sweep.to=0.3", "--set", "sweep.points=3", ranks=1)
    subprocess.run([sys.executable, ROOT / "tools" / "plot", run.output, "--only", "sweep", "--output", tmp_path],
                   check=True)
    assert (tmp_path / "sweep.png").stat().st_size > 10000


def tables(page):
    """(heading, cells) of every row of the page's tables, without their heads; code marks are taken off."""
    heading, head = "", True
    for line in page.read_text().splitlines():
        if line.startswith("#"):
            heading = (re.findall(r"`([^`]+)`", line) or [line.lstrip("# ")])[0]
        if not line.startswith("|"):
            head = True
            continue
        cells = [cell.strip().strip("`") for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
        if not head:
            yield heading, cells
        head = head and not set(line) <= set("|-")


@pytest.fixture(scope="module")
def helped(tmp_path_factory):
    return Run(["-help"], 1, tmp_path_factory.mktemp("help")).printed


@pytest.mark.parametrize("page", [KEYS, RESULTS])
def test_pages_are_what_the_program_writes(page, tmp_path):
    """`squeal --reference keys > inputs/KEYS.md` renews the page, `--reference results` the other one."""
    assert Run(["--reference", page.stem.lower()], 1, tmp_path).printed == page.read_text()


def test_every_result_has_a_meaning():
    """In a row with all of its cells."""
    rows = [cells for _, cells in tables(RESULTS)]
    assert len(rows) > 300 and all(len(cells) == 3 and all(cells) for cells in rows)


def test_every_key_has_a_meaning():
    """In a row with all of its cells."""
    rows = [cells for _, cells in tables(KEYS) if len(cells) == 6]
    assert len(rows) > 60 and all(cells[-1] for cells in rows)


def test_every_option_is_explained(helped):
    known = dict(re.findall(r"^  (-\w+) .* \[(.*)\]$", helped, re.M))
    page = {cells[0]: cells[1] for heading, cells in tables(KEYS) if heading == "Options"}
    assert 10 < len(known) <= 20
    assert page == known
    guide = GUIDE.read_text()
    assert not [name for name in known if not re.search(rf"`[^`]*{name}\b", guide) and f" {name} " not in guide]


RUNS = {
    # every stage, from points; too small to be reduced, with the reason
    "oscillator": [INPUTS / "oscillator" / "scene.toml", "--set", "cycle.steps_per_period=100", "--set",
                   "transient.periods=20", "--set", "transient.steps_per_period=50", "--set", "fidelity=auto",
                   "--set", "branch.key=friction.coefficient", "--set", "branch.from=0.28", "--set", "branch.to=0.32",
                   "--set", "branch.points=4", "--set", "cycle.starts=2", "--set", "sweep.key=friction.coefficient", "--set",
                   "sweep.from=0.1", "--set", "sweep.to=0.3", "--set", "sweep.points=3", "--set",
                   "change=[{probe='pad_y',mass=1e-3}]", "--set", "robustness.samples=10",
                   "--set", "uncertain=[{key='friction.coefficient', deviation=0.01}]", "--set", "response.from=0.01",
                   "--set", "response.to=1", "--set", "response.count=20", "--set",
                   "sensitivity.numbers=friction.coefficient"],
    # the reduced model, a rotation, a mesh, SLEPc's modes; coarse, and damped like this, its cycle is found in a second
    "pin_on_disc": [INPUTS / "pin_on_disc" / "scene.toml", "--set", "mesh.parameters.divisions=2", "--set",
                    "damping.beta=6e-7", "--set", "cycle.steps_per_period=40", "--set", "modes.method=toar",
                    "-cycle_watched_periods", "40", "--set", "sensitivity.numbers=friction.coefficient", "--set",
                    "modes.mesh_error=refinement"],
    # no cycle attracts: a settled motion, whose kind stays undecided over so few periods
    "settled": [INPUTS / "pin_on_disc" / "scene.toml", "--set", "mesh.parameters.divisions=2", "--set",
                "friction.coefficient=0.4", "--set", "modes.method=full", "-cycle_free_periods", "10",
                "-settled_periods", "32", "--set", "cycle.tolerance=1e-9"],
    # stages that are skipped, with their reasons; a disc that is overdamped
    "stable": [INPUTS / "oscillator" / "scene.toml", "--set", "friction.coefficient=0", "--set", "modes.mesh_error=refinement",
               "--set", "spring.3.damping=9"],
}


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Folders of these runs."""
    runs = [Run(arguments, 1, tmp_path_factory.mktemp(name)) for name, arguments in RUNS.items()]
    assert [run.code for run in runs] == [0] * len(runs), [run.errors for run in runs]
    return [run.output for run in runs]


def paths_of(value, path=""):
    """Dotted names of what a JSON value holds."""
    if isinstance(value, dict):
        return {name for key, entry in value.items() for name in paths_of(entry, f"{path}.{key}" if path else key)}
    if isinstance(value, list):
        return {name for entry in value for name in paths_of(entry, path + "[]")}
    return {path}


def data_sets_of(file):
    """Names and units of an HDF5 file's data sets."""
    found = {}
    with h5py.File(file) as content:
        content.visititems(lambda name, item: found.update({name: item.attrs["unit"].decode()})
                           if isinstance(item, h5py.Dataset) else None)
    return found


# Written with a verdict that is unstable or undecided, or by the whole matrix in place of a projection: no run here ends so.
UNLESS_STABLE = {"cycle.multipliers.crossing", "cycle.multipliers.would_decide", "cycle.multipliers.refusal"}
# Written of points of a sweep that fail.
UNLESS_STABLE |= {"sweep.points[].reason"}
# Written of branches with events, which test_branch reads.
OF_SOME_BRANCHES = re.compile(r"branch\.events\[\]\.\w+")
# Written of pairs without a drive, which test_undriven and test_joint_cycles read.
UNLESS_STABLE |= {f"equilibrium.undriven_pairs.{key}" for key in ("stick", "slip", "open", "at_limit", "increments", "change", "index",
                                                                  "reciprocal_condition")} | {"transient.joint_work[]", "modes.dependent_rows", "estimate.slip_amplitude",
                                                                  *(f"equilibrium.bolts[].{key}" for key in ("name", "shortening", "tension"))}
UNLESS_STABLE |= {f"cycle.joints.{key}" for key in ("held", "slipping", "largest_use", "at_edge", "work[]", *(f"offsets[].{key}" for key in (
    "contact", "direction", "least", "greatest", "period_by_offset", "energy_by_offset")))} | {"cycle.multipliers.offsets_held"}


def compare(documented, written):
    """Both ways; documented names may hold <placeholders>."""
    patterns = {name: re.compile(re.sub(r"<\w+>", r"[^./]+", re.escape(name).replace(r"\<", "<").replace(r"\>", ">")))
                for name in documented}
    assert len(patterns) == len(documented)
    unknown = {name for name in written if not any(pattern.fullmatch(name) for pattern in patterns.values())}
    assert not unknown, f"written and not explained: {sorted(unknown)}"
    missing = {name for name, pattern in patterns.items() if not any(pattern.fullmatch(path) for path in written)}
    missing = {name for name in missing - UNLESS_STABLE if not OF_SOME_BRANCHES.fullmatch(name)}
    assert not missing, f"explained and never written: {sorted(missing)}"
    return patterns


def test_every_key_of_the_report_is_explained(written):
    found = set.union(*(paths_of(json.loads((folder / "report.json").read_text())) for folder in written))
    compare([cells[0] for heading, cells in tables(RESULTS) if heading == "report.json"], found)


@pytest.mark.parametrize("name", ["history.h5", "fields.h5"])
def test_every_data_set_is_explained(written, name):
    page = {cells[0]: cells[1] for heading, cells in tables(RESULTS) if heading == name}
    found = {}
    for folder in written:
        found.update(data_sets_of(folder / name))
    for documented, pattern in compare(page, found).items():
        units = {unit for data, unit in found.items() if pattern.fullmatch(data)}
        assert units == {page[documented]}, documented


def test_words_of_outcomes_and_choices_are_explained():
    """Every word that the program may write or read, from the tables of its sources."""
    pages = "".join(page.read_text() for page in (ROOT / "README.md", GUIDE, KEYS, RESULTS, FILES))
    found = 0
    for file in [*(ROOT / "include").rglob("*.hpp"), *(ROOT / "src").rglob("*.[ch]pp")]:
        for words in re.findall(r"std::array words_of<\w+>\s*=\s*\{(.*?)\}", file.read_text(), re.S):
            for word in re.findall(r'"([^"]+)"', words):
                found += 1
                # a start may be a file, which is named and not called "file"
                assert f"`{word}`" in pages or f'`"{word}"`' in pages or word == "file", f"{file.name}: {word}"
    assert found > 20


def test_quoted_usage_is_that_of_the_tools():
    """An indented line with brackets that names a tool stands in the tool's first lines, which are its help."""
    found = 0
    for page in pages_of_readers():
        for name, rest in re.findall(r"^    tools/(\w+)( [^#\n]*\[[^#\n]*)", page.read_text(), re.M):
            found += 1
            head = (ROOT / "tools" / name).read_text()[:3000]
            assert f"tools/{name}{rest.rstrip()}" in head, f"{page.relative_to(ROOT)}: tools/{name}{rest}"
    assert found


def test_every_tool_has_a_row():
    """Tools are the executable files of tools/; those that are installed are the ones that tools/README.md names so."""
    page = ROOT / "tools" / "README.md"
    rows = {name for heading, cells in tables(page) if heading == "The tools" for name in re.findall(r"\w+", cells[0])}
    tools = {file.name for file in (ROOT / "tools").iterdir() if not file.suffix and file.is_file()}
    assert tools and tools <= rows, tools - rows
    named = re.search(r"without the sources: ([^.]*)\.", page.read_text())[1]
    programs = re.search(r"install\(PROGRAMS ([^)]*?)\s+DESTINATION", (ROOT / "CMakeLists.txt").read_text())[1]
    assert set(re.findall(r"`(\w+)`", named)) == set(re.findall(r"tools/(\w+)", programs))


def test_every_test_has_a_row():
    """tests/README.md says of every file of tests what it proves, below the name of its folder, in cells that can be read."""
    page = ROOT / "tests" / "README.md"
    rows = {}
    for heading, cells in tables(page):
        rows.setdefault(heading.partition(":")[0], []).append(cells)
    for folder in ("unit", "verify", "stability", "runs"):
        files = {file.stem for file in [*(page.parent / folder).glob("*.cpp"), *(page.parent / folder).glob("test_*.py")]}
        names = [name for cells in rows[folder] for name in cells[0].split(", ")]
        assert sorted(names) == sorted(files), folder
        assert max(len(cell.split()) for cells in rows[folder] for cell in cells) <= 50, folder


def pages_of_readers():
    pages = [page for page in ROOT.rglob("README.md") if "build" not in page.relative_to(ROOT).parts]
    pages += sorted(INPUTS.glob("[A-Z]*S.md"))
    assert len(pages) >= 8
    return pages
