"""What the Python tools share: a python that has their modules, the style of the pictures, errors, files in PETSc's
binary format."""

import importlib.util
import os
import shutil
import sys
from pathlib import Path

TOOL = Path(sys.argv[0]).name
ROOT = Path(__file__).resolve().parents[2]
BUILT, INSTALLED = ROOT / "build" / "squeal", ROOT.parent.parent / "bin" / "squeal"
DEBIAN = "/usr/bin/python3"
ENVIRONMENT = Path(os.environ.get("SQUEAL_PYTHON", ROOT / "build" / "python"))  # made by tools/setup
SETTINGS = next(file for file in (ROOT / "tools" / "environment", Path(__file__).with_name("environment")) if file.exists())
MATRIX_ID, VECTOR_ID = 1211216, 1211214  # PETSc's class numbers, MAT_FILE_CLASSID and VEC_FILE_CLASSID
BLUE, RED, ORANGE, GREEN, GREY = "#1b6ca8", "#c0272d", "#d95f02", "#2e8b57", "#8a8a8a"


class SquealError(Exception):
    """What went wrong, in a sentence."""


def _program() -> Path:
    """SQUEAL=FILE, else that of the sources or of the installation around this package, else the one in PATH."""
    if "SQUEAL" in os.environ:
        return Path(os.environ["SQUEAL"]).resolve()
    if (ROOT / "CMakeLists.txt").exists():
        return BUILT
    return INSTALLED if INSTALLED.exists() else Path(shutil.which("squeal") or INSTALLED).resolve()


PROGRAM = _program()


def program() -> Path:
    """The program, where it is there; else an error says how it is had."""
    if not PROGRAM.exists():
        raise SquealError(f"{PROGRAM} is missing: tools/build makes it, a Debian package or a container brings it "
                          "(tools/README.md); or say where it is by SQUEAL=FILE")
    return PROGRAM


def owns_process() -> bool:
    """Whether a tool or job of these sources, or of their installation, was started, and not another program that imports it."""
    main = getattr(sys.modules["__main__"], "__file__", None)
    return main is not None and Path(main).resolve().parent in (ROOT / "tools", ROOT / "jobs")


def use_environment() -> None:
    """Starts the tool again in the python of the build folder, which has PyVista beside Debian's modules, if it is there."""
    python = ENVIRONMENT / "bin" / "python"
    if owns_process() and python.exists() and Path(sys.prefix).resolve() != ENVIRONMENT.resolve():
        os.execv(python, [str(python), *sys.argv])


def needs(*modules: str) -> None:
    """Where this python lacks a module, starts the tool again in Debian's, which has it; an ImportError in a program of others. To
    be called before the modules are imported."""
    missing = [module for module in modules if importlib.util.find_spec(module) is None]
    if not missing:
        return
    names = ", ".join(missing)
    if not owns_process():
        raise ImportError(f"squeal needs the python module {names}, which {sys.executable} lacks: "
                          f"pip install {' '.join(missing)}, or take {DEBIAN} with the packages that tools/setup installs",
                          name=missing[0])
    # A private python first in PATH hides the one whose modules Debian installs.
    if os.path.realpath(sys.executable) == os.path.realpath(DEBIAN) or not os.path.exists(DEBIAN):
        sys.exit(f"{TOOL}: no python module {names}; tools/setup installs what the tools need")
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
    save_picture(figure, file, figure.dpi)


def save_picture(figure, file, dpi):
    """In the format of the file's ending; a PNG has 256 colours: a third of the size."""
    from PIL import Image  # matplotlib's own dependency

    figure.savefig(file, dpi=dpi)
    if Path(file).suffix == ".png":
        Image.open(file).convert("RGB").quantize(256, Image.Quantize.MAXCOVERAGE).save(file, optimize=True)


def counted(count, what):
    """A number of things: 1 line, 2 lines."""
    return f"{count} {what}" + ("" if count == 1 else "s")


def arguments_and_options():
    """The tool's own arguments, and squeal's after a --."""
    words = sys.argv[1:]
    cut = words.index("--") if "--" in words else len(words)
    return words[:cut], words[cut + 1 :]


def tool(main):
    """Runs a tool's main function; a SquealError ends it with that sentence, and so does a file that cannot be used."""
    try:
        main()
    except SquealError as error:
        sys.exit(f"{TOOL}: {error}")
    except BrokenPipeError:
        raise  # whoever read what is printed has gone; no file is to blame
    except OSError as error:
        sys.exit(f"{TOOL}: {error.filename}: {error.strerror}" if error.filename else f"{TOOL}: {error}")


def between(option, kind, low, high):
    """Type of an option of a tool: a whole or a real number of this range."""
    def read(word):
        try:
            value = kind(word)
        except ValueError:
            value = None
        if value is None or not low <= value <= high:  # not a number is in no range
            raise SquealError(f"{option} {word} is no {'whole ' if kind is int else ''}number from {low:g} to {high:g}")
        return value
    return read


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
