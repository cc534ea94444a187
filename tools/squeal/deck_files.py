"""Decks of other codes as text: lines and numbers, and keyword blocks of Abaqus and CalculiX, each with its place."""

import difflib
import math
import re
import warnings

import numpy as np


MOST_NAMES = 30  # that a message lists


class Problem(Exception):
    """What is wrong with the input, in one sentence that names file, line and what was expected."""


def undefined(place, what, name, known):
    """A reference to what the deck does not define: the nearest name of its kind, and those that there are."""
    shown = {str(other).upper(): str(other) for other in known}
    near = difflib.get_close_matches(str(name).upper(), shown, 1)
    others = list(shown.values())
    listed = ", ".join(others[:MOST_NAMES]) + (f" and {len(others) - MOST_NAMES} others" if len(others) > MOST_NAMES else "")
    return Problem(f"{place}: {what} '{name}' is not defined" + (f" (is it {shown[near[0]]}?)" if near else "") + f"; known are {listed or 'none'}")


def lines_of(file):
    """Numbered lines of a text file; a binary file is refused."""
    data = file.read_bytes()
    if b"\0" in data[:4096]:
        raise Problem(f"{file}: a binary file; expected text")
    return enumerate(data.decode("latin-1").splitlines(), 1)


def included(file, line, name, depth):
    """A file that a line of a deck includes, beside it."""
    place = f"{file}, line {line}"
    if depth > 8:
        raise Problem(f"{place}: includes go deeper than 8 files")
    other = file.parent / name.strip().strip("'\"")
    if not other.is_file():
        raise Problem(f"{place}: includes {name.strip()}, which is not there")
    return other


# ---- Abaqus and CalculiX

DATA_FILES = {"NODE", "ELEMENT", "NSET", "ELSET", "SURFACE", "BOUNDARY"}  # whose INPUT names a file of their data


class Block:
    """One keyword: *NAME, KEY=VALUE, ... and the lines of data below it."""

    def __init__(self, place, name, options):
        self.place, self.name, self.options = place, name, options
        self.texts, self.numbers, self.files = [], [], []  # of the lines; files as (first line that is theirs, file)

    def add(self, file, number, text):
        if not self.files or self.files[-1][1] is not file:
            self.files.append((len(self.texts), file))
        self.texts.append(text)
        self.numbers.append(number)

    def place_at(self, index):
        file = next(file for first, file in reversed(self.files) if first <= index)
        return f"{file}, line {self.numbers[index]}"

    def place_of(self, number):
        """Where a line begins with this number."""
        return next((self.place_at(i) for i, text in enumerate(self.texts) if text.split(",")[0].strip() == str(number)), self.place)

    def with_lines(self, texts):
        """A copy with other data in the same places."""
        copy = Block(self.place, self.name, dict(self.options))
        copy.texts, copy.numbers, copy.files = texts, self.numbers, self.files
        return copy

    @property
    def lines(self):
        return [(self.place_at(i), text) for i, text in enumerate(self.texts)]

    def rows(self, least=0, what=""):
        """(place, fields) of every line of data; one with fewer than the least number of fields is refused."""
        for index, line in enumerate(self.texts):
            place = self.place_at(index)
            fields = [field.strip() for field in line.split(",")]
            while fields and fields[-1] == "":
                fields.pop()
            if len(fields) < least:
                raise Problem(f"{place}: *{self.name}, '{line[:60]}': {len(fields)} fields; expected {what}")
            yield place, fields

    def table(self, width, kind):
        """The data as rows of this many numbers, each of which begins a line; None if some line is of another form."""
        texts = [text.rstrip(", \t") for text in self.texts]
        ends = np.cumsum([text.count(",") + 1 for text in texts])
        if not texts or ends[-1] % width or not np.isin(np.arange(width, ends[-1] + 1, width), ends).all():
            return None
        return numbers_in(",".join(texts), ends[-1], kind, width)


def numbers_in(text, count, kind, width):
    """So many numbers between commas as rows; None if there is anything else."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            values = np.fromstring(text, kind, sep=",")
        except (ValueError, DeprecationWarning):
            return None
    return values.reshape(-1, width) if len(values) == count and np.isfinite(values).all() else None


def blocks_of(file, depth=0, blocks=None):
    """The keyword blocks of an input deck, in order; an included file may go on with the data of the last keyword."""
    blocks, head = [] if blocks is None else blocks, ""
    for number, line in lines_of(file):
        line = line.strip()
        if not line or line.startswith("**"):
            continue
        if head or line[0] == "*":
            head += line
            if head.endswith(","):
                continue  # goes on in the next line
            name, *words = [word.strip() for word in head[1:].split(",")]
            head = ""
            options = {}
            for word in words:
                key, _, value = word.partition("=")
                options[" ".join(key.upper().split())] = value.strip().strip('"')
            if name.upper() == "INCLUDE":
                blocks_of(included(file, number, options.get("INPUT", ""), depth), depth + 1, blocks)
                continue
            blocks.append(Block(f"{file}, line {number}", " ".join(name.upper().split()), options))
            if blocks[-1].name in DATA_FILES and "INPUT" in options:
                blocks_of(included(file, number, options["INPUT"], depth), depth + 1, blocks)
        elif not blocks:
            raise Problem(f"{file}, line {number}: '{line[:60]}': expected a keyword, such as *NODE")
        else:
            blocks[-1].add(file, number, line.replace('"', ""))
    if head:
        raise Problem(f"{file}: ends within '{head[:60]}', which goes on behind its last comma")
    return blocks


def whole(text, place, what="a whole number"):
    try:
        if "_" in text:  # which Python takes between digits
            raise ValueError
        return int(text)
    except ValueError:
        raise Problem(f"{place}: '{text}': expected {what}") from None


MOST_NUMBERS = 10_000_000  # of one range


def span(first, last, step, place, to="to"):
    """The numbers of a range that a deck gives by its ends."""
    if step < 1 or last < first or (last - first) // step >= MOST_NUMBERS:
        raise Problem(f"{place}: {first} {to} {last} by steps of {step}: expected ascending numbers, {MOST_NUMBERS} at most")
    return range(first, last + 1, step)


def number(text, place, what="a number"):
    """Fortran's forms too: 1.5D+3, and Nastran's 1.5+3."""
    try:
        value = float(text)
    except ValueError:
        fixed = re.sub(r"(?<=[\d.])([+-])", r"E\1", re.sub("[dD]", "E", text.strip()))
        try:
            value = float(fixed.replace("EE", "E"))
        except ValueError:
            value = math.nan
    if not math.isfinite(value) or "_" in text:
        raise Problem(f"{place}: '{text}': expected {what}")
    return value


def node_table(nodes):
    """Numbers and positions of (place, number, position); a number may come again at the same position only."""
    found = {}
    for place, label, position in nodes:
        if not 0 < label < 2**31:
            raise Problem(f"{place}: node {label}: expected a number from 1 to {2**31 - 1}")
        before, known = found.setdefault(label, (place, position))
        if known is not position and tuple(known) != tuple(position):
            raise Problem(f"{place}: node {label} is at another position than in {before}: give it one position")
    return np.array(list(found), np.int64), np.array([at for _, at in found.values()], float).reshape(-1, 3)
