"""Malformed input of tools/fuzz: each function spoils one thing of a small scene, at random."""

import re
import shutil
import struct
from pathlib import Path

from fuzz_decks import DECKS

ROOT = Path(__file__).resolve().parent.parent
OSCILLATOR = ROOT / "inputs" / "oscillator"

# A bar of two bricks, clamped at one end, in gmsh's format 2.2.
BAR = """$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
2
2 1 "end"
3 2 "bar"
$EndPhysicalNames
$Nodes
12
1 0 0 0
2 1 0 0
3 1 1 0
4 0 1 0
5 0 0 1
6 1 0 1
7 1 1 1
8 0 1 1
9 2 0 0
10 2 1 0
11 2 0 1
12 2 1 1
$EndNodes
$Elements
3
1 3 2 1 1 1 4 8 5
2 5 2 2 2 1 2 3 4 5 6 7 8
3 5 2 2 2 2 9 10 3 6 11 12 7
$EndElements
"""
BAR_GEO = """SetFactory("OpenCASCADE");
DefineConstant[ n = {2, Min 1, Name "n"} ];
Box(1) = {0, 0, 0, 1, 1, 1};
Transfinite Curve{:} = n + 1; Transfinite Surface{:}; Recombine Surface{:}; Transfinite Volume{:};
Physical Volume("bar") = {1};
Physical Surface("end") = {1};
"""
BAR_SCENE = """[mesh]
file = "bar.msh"
[[part]]
name = "bar"
young = 2.1e11
poisson = 0.3
density = 7850
[[support]]
on = "end"
fixed = "all"
[[force]]
on = "bar"
vector = [0, 0, 10.0]
[modes]
band = 5000
[[probe]]
name = "tip"
on = "bar"
at = [2, 0, 0]
direction = "z"
"""
# texts that are no message of squeal's own
RAW = re.compile(r"PETSC ERROR|MPI_ABORT|MPI_Abort|terminate called|what\(\)|\.[ch]pp\b|\.c:\d|filesystem error|std::|Segmentation|"
                 r"HDF5-DIAG|Traceback|Caught signal|PETSc error|bad_alloc|basic_string|Backtrace|double free|corrupted")
# Statements that must change nothing; a file of this name betrays them.
CANARY = "PWNED"
HOSTILE = [f'SystemCall "touch {CANARY}";', f"System 'touch {CANARY}';", f'Printf("x") > "{CANARY}";', f'Save "{CANARY}";',
           f'Field[1] = ExternalProcess; Field[1].CommandLine = "touch {CANARY}"; Background Field = 1;',
           'Merge "other.msh";', 'Include "bar.geo";', 'Include "/dev/zero";', f'CreateDir "{CANARY}";', "Exit;", "Abort;",
           f'OnelabRun("x", "touch {CANARY}");', "Call Nothing;", "x = GetEnv(\"HOME\");",
           "Point(1) = {0, 0, 0", "}", '"', "/*", "Physical Volume(\"bar\") = {99};", "Macro A Call A; Return Call A;"]
NUMBERS = ["0", "-1", "1e308", "-1e308", "1e-308", "nan", "inf", "-inf", "1e15", "2147483648", "9223372036854775808", "1.5",
           "0x10", "1e", "", '"text"', "true", "[]", "{}", "[1, 2]", "[[1]]", "1979-05-27", "-0.0", "1_000", "0.5"]
TEXTS = ["", ".", "..", "/", "a/b", "x" * 3000, "é€𝄞", "\\u0000", "ground", "pad", "disc", "no such", "*", "%s%n", "-help", "$HOME"]
OPTIONS = ["-log_view", "-info", "-history", "-options_file", "-malloc_debug", "-options_left", "-fp_trap", "-log_trace",
           "-mat_type", "-vec_type", "-on_error_abort", "-start_in_debugger", "-cycle_snes_type", "-cycle_snes_monitor",
           "-cycle_snes_max_it", "-modes_pep_type", "-modes_st_type",
           "-modes_pep_nev", "-nox", "-no_such", "--help", "--version", "--output", "--set", "--force", "-", "--", "-3", "−x",
           "-cycle_snes_view", "-cycle_snes_linesearch_type", "-cycle_pc_type", "-cycle_ksp_type"]
VALUES = ["magic", "0", "-1", "1", "1e400", "nan", "inf", "4294967297", ":/no/such/x", "/dev/null", ".", "", "true", "x" * 3000,
          "a:b:c", "-", "é", "'", "1 2"]
# So that what is accepted ends soon.
SHORT = ["-cycle_max_periods", "20", "-cycle_free_periods", "20", "-settled_periods", "8"]


def number_places(text):
    """Places (start, end) of the values behind = in a scene."""
    places, at = [], 0
    for line in text.splitlines(keepends=True):
        if "=" in line and not line.lstrip().startswith("#"):
            start = at + line.index("=") + 1
            places.append((start, at + len(line.rstrip("\n"))))
        at += len(line)
    return places


def spoil_lines(text, random):
    lines = text.splitlines() or [""]
    i, j = random.randrange(len(lines)), random.randrange(len(lines))
    how = random.choice(["drop", "twice", "swap", "cut", "words", "joined"]) if len(lines) > 1 else "cut"
    if how == "drop":
        del lines[i]
    elif how == "twice":
        lines.insert(j, lines[i])
    elif how == "swap":
        lines[i], lines[j] = lines[j], lines[i]
    elif how == "cut":
        lines = lines[:i] + [lines[i][: random.randrange(len(lines[i]) + 1)]]
    elif how == "words":
        words = lines[i].split(" ")
        words[random.randrange(len(words))] = random.choice(NUMBERS + TEXTS[:8])
        lines[i] = " ".join(words)
    elif i + 1 < len(lines):
        lines[i] += lines.pop(i + 1)
    return "\n".join(lines) + "\n"


def spoil_value(text, random):
    start, end = random.choice(number_places(text))
    value = random.choice(NUMBERS) if random.random() < 0.7 else '"' + random.choice(TEXTS) + '"'
    return text[:start] + " " + value + text[end:]


def write_points(folder):
    (folder / "scene.toml").write_text((OSCILLATOR / "scene.toml").read_text())


def write_bar(folder, mesh="bar.msh"):
    (folder / "bar.msh").write_text(BAR)
    (folder / "bar.geo").write_text(BAR_GEO)
    (folder / "scene.toml").write_text(BAR_SCENE.replace("bar.msh", mesh))


def write_matrices(folder):
    shutil.copytree(OSCILLATOR / "matrices", folder / "matrices")
    shutil.copy(OSCILLATOR / "matrices.toml", folder / "scene.toml")


def scenes(folder, random):
    random.choice([write_points, write_bar, write_matrices])(folder)
    text = (folder / "scene.toml").read_text()
    for _ in range(random.randint(1, 3)):
        text = (spoil_value if random.random() < 0.6 and number_places(text) else spoil_lines)(text, random)
    (folder / "scene.toml").write_text(text)
    return []


def overrides(folder, random):
    random.choice([write_points, write_bar])(folder)
    keys = ["friction.coefficient", "contact.0.gap", "contact.0.velocity", "modes.band", "cycle.steps_per_period",
            "cycle.tolerance", "transient.periods", "transient.start", "part.bar.young", "mesh.scale", "mesh.file", "force.0.vector.2",
            "probe.0.name", "spring.0.stiffness", "title", "fidelity", "accuracy", "branch.key", "cycle.starts", "a.b.c", "", ".", "..",
            "part", "contact", "point.pad.mass", "cycle.save_state", "transient.save_state", "support.0.fixed", "é", "x" * 1000]
    arguments = []
    for _ in range(random.randint(1, 3)):
        value = random.choice(NUMBERS + TEXTS)
        arguments += ["--set", random.choice(["{}={}", "{}={}", "{}={}", "{}", "{}==", "{} = {}"]).format(random.choice(keys), value)]
    return arguments


def options(folder, random):
    write_points(folder)
    arguments = []
    for _ in range(random.randint(1, 3)):
        arguments.append(random.choice(OPTIONS + random.known))
        if random.random() < 0.8:
            arguments.append(random.choice(VALUES))
    if random.random() < 0.2:
        (folder / "options").write_text(" ".join(arguments) + "\n")
        arguments = ["-options_file", "options"]
    return arguments


def meshes(folder, random):
    if random.random() < 0.5:
        write_bar(folder)
        text = BAR
        for _ in range(random.randint(1, 3)):
            text = spoil_lines(text, random)
        if random.random() < 0.15:
            text = random.choice(HOSTILE) + "\n" + text
        (folder / "bar.msh").write_text(text)
    else:
        write_bar(folder, "bar.geo")
        lines = BAR_GEO.splitlines()
        for _ in range(random.randint(1, 2)):
            lines.insert(random.randrange(len(lines) + 1), random.choice(HOSTILE))
        text = "\n".join(lines) + "\n"
        (folder / "bar.geo").write_text(spoil_lines(text, random) if random.random() < 0.5 else text)
        (folder / "other.msh").write_text(random.choice(HOSTILE))
    return []


def matrices(folder, random):
    write_matrices(folder)
    file = folder / "matrices" / random.choice(["M", "C", "K", "B", "F", "gap", "drive"])
    file = file.with_suffix(".petsc")
    data = bytearray(file.read_bytes())
    how = random.choice(["header", "cut", "long", "value", "vector", "gone", "folder"])
    if how == "header":
        struct.pack_into(">i", data, 4 * random.randrange(min(len(data) // 4, 4)), random.choice([0, -1, 1, 7, 2**31 - 1, -(2**31)]))
    elif how == "cut":
        data = data[: random.randrange(len(data))]
    elif how == "long":
        data += bytes(random.randrange(1, 100))
    elif how == "value":
        struct.pack_into(">d", data, len(data) - 8 * random.randint(1, max(1, len(data) // 16)),
                         random.choice([float("nan"), float("inf"), -1.0, 0.0, 1e308, -1e-308]))
    elif how == "vector":
        n = random.choice([0, 1, 2, 1000])
        data = struct.pack(">ii", 1211214, n) + struct.pack(f">{n}d", *[random.uniform(-1, 1) for _ in range(n)])
    file.unlink()
    if how == "folder":
        file.mkdir()
    elif how != "gone":
        file.write_bytes(bytes(data))
    return []


def flips(folder, random):
    random.choice([write_points, write_bar, lambda f: write_bar(f, "bar.geo"), write_matrices])(folder)
    files = sorted(file for file in folder.rglob("*") if file.is_file())
    file = random.choice(files)
    data = bytearray(file.read_bytes())
    for _ in range(random.choice([1, 1, 2, 5, 20])):
        data[random.randrange(len(data))] ^= 1 << random.randrange(8)
    file.write_bytes(bytes(data))
    return []


def spoil_field(text, random):
    """Another number or word in one field of a line."""
    lines = text.splitlines()
    i = random.randrange(len(lines))
    fields = lines[i].split(",") if "," in lines[i] else [lines[i][k : k + 8] for k in range(0, len(lines[i]), 8)] or [""]
    fields[random.randrange(len(fields))] = random.choice(NUMBERS + TEXTS[:10] + ["-", "*", "1 2", "0.0", "-7", "999", " " * 8])
    lines[i] = ("," if "," in lines[i] else "").join(fields)
    return "\n".join(lines) + "\n"


def decks(folder, random):
    name = random.choice(list(DECKS))
    text = DECKS[name]
    for _ in range(random.randint(1, 3)):
        text = (spoil_field if random.random() < 0.6 else spoil_lines)(text, random)
    (folder / name).write_text(text, errors="replace")
    return [name, "out", *random.choice([[], [], ["--length", "0.001"]])]


KINDS = {"scenes": scenes, "overrides": overrides, "options": options, "meshes": meshes, "matrices": matrices, "flips": flips, "decks": decks}
