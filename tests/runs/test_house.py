"""The house rules that a machine can check: include order, no PETSc below the solids, formatting."""

import re
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
# What each room may include, besides itself and what stands in the same line before it.
CHAIN = ["base", "algebra", "solid", "contact", "equilibrium", "modes", "transient", "reduction", "cycle", "settled", "attractors", "branch", "study", "report"]
ALLOWED = {room: set(CHAIN[: place + 1]) | {"scene", "mesh"} for place, room in enumerate(CHAIN)}
ALLOWED |= {
    "base": {"base"},
    "algebra": {"base", "algebra"},
    "scene": {"base", "scene"},
    "mesh": {"base", "scene", "mesh"},
    "shooting": {"base", "algebra", "shooting"},
}
ALLOWED["cycle"] |= {"shooting"}
ALLOWED["settled"] |= {"shooting"}
ALLOWED["branch"] |= {"shooting"}
ALLOWED["study"] |= {"shooting"}
ALLOWED["report"] |= {"shooting"}
PROGRAM = set(ALLOWED["report"])  # src/*.cpp and include/squeal/*.hpp


def sources(*folders):
    return [f for folder in folders for f in sorted((ROOT / folder).rglob("*.[ch]pp"))]


def included(file):
    return re.findall(r'#include "([^"]+)"', file.read_text())


def test_includes_run_one_way():
    wrong = []
    for file in sources("src", "include"):
        allowed = ALLOWED.get(file.parent.name, PROGRAM)
        for name in included(file):
            room = re.match(r"squeal/(\w+)/", name)
            if room and room[1] not in allowed:
                wrong.append(f"{file.relative_to(ROOT)} includes {name}")
            if name.startswith("squeal/") and name.count("/") == 1 and file.parent.name in ALLOWED:
                wrong.append(f"{file.relative_to(ROOT)} includes the program's own {name}")
    assert not wrong, "\n".join(wrong)


def test_private_headers_stay_in_their_room():
    wrong = [
        f"{file.relative_to(ROOT)} includes {name}"
        for file in sources("src", "include")
        for name in included(file)
        if not name.startswith("squeal/") and not (file.parent == ROOT / "src" / file.parent.name and (file.parent / name).exists())
        or ".." in name
    ]
    assert not wrong, "\n".join(wrong)


def test_public_headers_cross_rooms():
    """A header that only sources of its own room include lies beside them."""
    users = {}
    for file in sources("src", "include", "tests", "tools"):
        inside = file.is_relative_to(ROOT / "src") or file.is_relative_to(ROOT / "include")
        public = file.is_relative_to(ROOT / "include")
        for name in included(file):
            users.setdefault(name, set()).add("public" if public else file.parent.name if inside else "tests")
    idle = [
        str(file.relative_to(ROOT))
        for file in sources("include")
        if users.get(str(file.relative_to(ROOT / "include")), set()) <= {file.parent.name}
    ]
    assert not idle, "\n".join(idle)


def test_no_room_holds_more_than_its_share():
    lines = {}
    for file in sources("src", "include"):
        room = file.parent.name if file.parent.name in ALLOWED else "program"
        lines[room] = lines.get(room, 0) + len(file.read_text().splitlines())
    total = sum(lines.values())
    assert all(count <= 0.15 * total for count in lines.values()), lines


def test_scene_and_mesh_know_nothing_of_petsc():
    petsc = re.compile(r'#include [<"](petsc|slepc|squeal/base/petsc)')
    assert not [f for f in sources("src", "include") if f.parent.name in ("scene", "mesh") and petsc.search(f.read_text())]


def includes_of(room):
    files = [f for f in sources("src", "include") if f.parent.name == room]
    return files, {(f.name, target) for f in files for target in re.findall(r'#include "squeal/(\w+)/', f.read_text())}


def test_shooting_knows_no_brake():
    """The shooting solver sees a flow: states, an energy product and a period map, whatever they belong to."""
    files, includes = includes_of("shooting")
    assert files and {target for _, target in includes} <= {"base", "algebra", "shooting"}, includes
    brake = re.compile(r"\b(structure|interface|equilibrium|contact|scene|transient|modes)/\w+\.hpp|Structure&|Interface&")
    assert not [f.name for f in files if brake.search(f.read_text())]


def test_continuation_knows_no_brake():
    """Nor does the tracing of a branch: it sees a family of flows."""
    generic = {"continuation.hpp", "continuation.cpp", "corrector.hpp", "corrector.cpp"}
    files, includes = includes_of("branch")
    assert generic <= {file.name for file in files}
    assert {target for name, target in includes if name in generic} <= {"base", "shooting", "branch"}
    assert not [f.name for f in files if f.name in generic and "brake" in f.read_text()]


def test_the_reduced_model_knows_no_flow():
    files, includes = includes_of("reduction")
    assert files and not {target for _, target in includes} & {"cycle", "shooting"}, includes


def numbers_in(text):
    """The sections that a text cites in the forms "section 2.4", "sections 3.6 and 3.7", "sections 4.1 to 4.3"."""
    text = re.sub(r"\s*\n\s*///?\s*", " ", text)
    lists = re.findall(r"src/README\.md, sections? (\d[\d.]*\d|\d)((?:(?:, | and | to )\d[\d.]*\d?)*)", text)
    return [number for first, rest in lists for number in [first, *re.findall(r"\d+(?:\.\d+)*", rest)]]


def method():
    """The sections of the method, and the chapters that its folder map gives to each room."""
    text = (ROOT / "src" / "README.md").read_text()
    rooms = dict(re.findall(r"^\| `(\w+)` \| .* \|([^|]*)\|$", text, re.M))
    return (
        set(re.findall(r"^##+ (\d+(?:\.\d+)*) ", text, re.M)),
        {room: {number.split(".")[0] for number in re.findall(r"\d+(?:\.\d+)?", cell)} for room, cell in rooms.items()},
    )


def test_cited_sections_exist():
    """Also those that no source cites, but a test, a tool or a page."""
    sections, rooms = method()
    assert {"1.2", "4.13", "9"} <= sections and set(ALLOWED) == set(rooms), set(ALLOWED) ^ set(rooms)
    files = [f for folder in ("src", "include", "tests", "tools", "inputs", "jobs") for f in sorted((ROOT / folder).rglob("*"))
             if f.suffix in (".cpp", ".hpp", ".py", ".sh", ".md")]
    wrong = [
        f"{file.relative_to(ROOT)} cites section {number}"
        for file in [*files, ROOT / "README.md"]
        for number in numbers_in(file.read_text())
        if number not in sections
    ]
    assert not wrong, "\n".join(wrong)


def test_sources_cite_the_chapters_of_their_room():
    """A file may cite other chapters beside one of its own room's."""
    _, rooms = method()
    wrong = []
    for file in sources("src", "include"):
        cited = {number.split(".")[0] for number in numbers_in(file.read_text())}
        chapters = rooms.get(file.parent.name, set())
        if cited and chapters and not cited & chapters:
            wrong.append(f"{file.relative_to(ROOT)} cites chapters {sorted(cited)}; its room has {sorted(chapters)}")
    assert not wrong, "\n".join(wrong)


def test_every_chapter_of_a_room_is_cited_there():
    """grep "section N" then leads from each chapter of equations to sources."""
    _, rooms = method()
    cited = {room: set() for room in rooms}
    for file in sources("src", "include"):
        if file.parent.name in cited:
            cited[file.parent.name] |= {number.split(".")[0] for number in numbers_in(file.read_text())}
    missing = {room: sorted(chapters - cited[room]) for room, chapters in rooms.items() if chapters - cited[room]}
    assert not missing, missing


def test_pages_name_sources_that_are_there():
    names = {f.name for f in sources("src", "include", "tests")}
    pages = [ROOT / "README.md", *(p for folder in ("src", "inputs", "tools") for p in (ROOT / folder).rglob("*.md"))]
    wrong = [f"{page.relative_to(ROOT)} names {name}" for page in pages
             for name in re.findall(r"`[\w/]*?(\w+\.[ch]pp)`", page.read_text()) if name not in names]
    assert not wrong, "\n".join(wrong)


def test_sources_are_formatted():
    files = [str(f) for f in sources("src", "include", "tests")]
    done = subprocess.run(["clang-format", "--dry-run", "--Werror", *files], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[:2000]


def test_functions_named_with_their_file_are_there():
    """As `judge` (`shooting/verdict.cpp`), or `run.cpp`: `exit_code_of`."""
    texts = [p.read_text() for folder in ("src", "inputs", "tools") for p in (ROOT / folder).rglob("*.md")]
    texts += [f.read_text() for f in sources("src", "include")]
    named = {pair for text in texts for pair in re.findall(r"`(\w+)` \(`?([\w/]+\.[ch]pp)`?\)", text)}
    named |= {(name, file) for text in texts for file, name in re.findall(r"`([\w/]+\.[ch]pp)`: `(\w+)`", text)}
    assert len(named) > 4
    wrong = [pair for pair in sorted(named) if not any(re.search(rf"\b{pair[0]}\(", f.read_text())
                                                       for f in sources("src", "include") if str(f).endswith("/" + pair[1]))]
    assert not wrong, wrong
