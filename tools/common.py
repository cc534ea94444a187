"""What the Python tools share: a python that has their modules, runs of squeal, the style of the pictures, files in
PETSc's binary format."""

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

TOOL = Path(sys.argv[0]).name
ROOT = Path(__file__).resolve().parent.parent
BUILT, INSTALLED = ROOT / "build" / "squeal", ROOT.parent.parent / "bin" / "squeal"
PROGRAM = Path(os.environ.get("SQUEAL", BUILT if (ROOT / "CMakeLists.txt").exists() else INSTALLED)).resolve()
DEBIAN = "/usr/bin/python3"
MATRIX_ID, VECTOR_ID = 1211216, 1211214  # PETSc's class numbers, MAT_FILE_CLASSID and VEC_FILE_CLASSID
BLUE, RED, ORANGE, GREEN, GREY = "#1b6ca8", "#c0272d", "#d95f02", "#2e8b57", "#8a8a8a"


def needs(*modules):
    """Starts the tool again in Debian's python where this one lacks a module; to be called before they are imported."""
    missing = [module for module in modules if importlib.util.find_spec(module) is None]
    if not missing:
        return
    # A private python first in PATH hides the one whose modules Debian installs.
    if os.path.realpath(sys.executable) == os.path.realpath(DEBIAN) or not os.path.exists(DEBIAN):
        sys.exit(f"{TOOL}: no python module {', '.join(missing)}; tools/setup installs what the tools need")
    os.execv(DEBIAN, [DEBIAN, *sys.argv])


def pyplot(dpi=110, font_size=10):
    """matplotlib.pyplot, drawing to files, in the style of all pictures; not before needs()."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    plt.rcParams.update({"figure.dpi": dpi, "font.size": font_size, "axes.grid": True, "grid.alpha": 0.3,
                         "axes.spines.top": False, "axes.spines.right": False, "legend.framealpha": 0.9,
                         "figure.constrained_layout.use": True})
    return plt


def save_small(figure, file):
    """As a PNG of 256 colours: a third of the size."""
    from PIL import Image  # matplotlib's own dependency

    figure.savefig(file)
    Image.open(file).convert("RGB").quantize(256).save(file, optimize=True)


def arguments_and_options():
    """The tool's own arguments, and squeal's after a --."""
    words = sys.argv[1:]
    cut = words.index("--") if "--" in words else len(words)
    return words[:cut], words[cut + 1 :]


FORMAT_VERSION = 1  # of report.json and the HDF5 files, the latest these tools read


def read_report(folder):
    """report.json of a results folder; stops with a sentence where these tools cannot read it, or other files are of
    another run."""
    folder = Path(folder)
    file = folder / "report.json"
    if not file.exists():
        sys.exit(f"{TOOL}: {folder} has no report.json: the run goes on, or was killed; what it has is in {folder}.partial")
    report = json.loads(file.read_text())
    if report.get("format_version", 0) > FORMAT_VERSION:
        sys.exit(f"{TOOL}: {file} has format_version {report['format_version']}, these tools read up to {FORMAT_VERSION}: "
                 "take the tools of the squeal that wrote it")
    for name in ("history.h5", "fields.h5", "fields.xdmf", "resolved.toml", "options.txt"):
        if (folder / name).exists() and "run" in report and report["run"].encode() not in head_of(folder / name):
            sys.exit(f"{TOOL}: {file} is of the run {report['run']}, and {name} beside it is of another one: "
                     "run squeal again, or copy all files of one run")
    return report


def head_of(file):
    """The first bytes of a file, where the identity of its run stands."""
    with open(file, "rb") as content:
        return content.read(65536)


def run_squeal(scene, output, values, words=(), ranks=1, limit=None):
    """Exit code and report of a run; values: of the scene's keys. None: it took more than `limit` seconds.

    Bad input ends the tool with squeal's own words.
    """
    if not PROGRAM.exists():
        sys.exit(f"{TOOL}: {PROGRAM} is missing: tools/build makes it, or say where it is by SQUEAL=FILE")
    command = [*(["mpirun", "-n", ranks] if ranks > 1 else []), PROGRAM, scene, *words, "--output", output]
    for key, value in values.items():
        command += ["--set", f"{key}={value}"]
    command = [str(word) for word in command]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=limit)
    except subprocess.TimeoutExpired:
        return None
    if done.returncode not in (0, 2):
        sys.exit(f"{TOOL}: {' '.join(command)}\n{done.stderr.strip()}")
    return done.returncode, read_report(output)


def petsc_bytes(array):
    """A vector: id, size, values. A sparse or dense matrix: id, rows, columns, entries, entries of each row, columns, values."""
    import numpy as np  # not before needs()

    if not hasattr(array, "indptr"):
        array = np.atleast_1d(np.asarray(array, float))
        if array.ndim == 1:
            return np.array([VECTOR_ID, len(array)], ">i4").tobytes() + array.astype(">f8").tobytes()
        rows, columns = np.nonzero(array)
        lengths, values = np.bincount(rows, minlength=array.shape[0]), array[rows, columns]
    else:
        array.sort_indices()
        lengths, columns, values = np.diff(array.indptr), array.indices, array.data
    head = np.array([MATRIX_ID, *array.shape, len(values)], ">i4")
    return b"".join(part.tobytes() for part in (head, lengths.astype(">i4"), columns.astype(">i4"), values.astype(">f8")))


def write_petsc(file, *arrays):
    """Several vectors go one after the other."""
    file.write_bytes(b"".join(map(petsc_bytes, arrays)))
