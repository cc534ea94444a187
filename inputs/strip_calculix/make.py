#!/usr/bin/python3
"""Writes strip.inp, CalculiX's deck of a lining on a strip, and pairs.csv, the contact pairs of its nodes; then CalculiX
writes the matrices strip.sti and strip.mas and the map of their rows strip.dof. In mm, N, s and t.

Both parts are 8-node bricks on one grid, so that the nodes of the two faces coincide.
"""

import itertools
import subprocess
from pathlib import Path

FOLDER = Path(__file__).resolve().parent
CELL = (16.0, 15.0, 9.0)  # mm
# first and last cell along x, y, z; Young's modulus [MPa], Poisson's ratio, density [t/mm3]
PARTS = {"strip": ((0, 0, -2), (14, 2, 0), (210e3, 0.3, 7.85e-9)), "lining": ((4, 0, 0), (9, 2, 4), (3e3, 0.25, 2.5e-9))}
CORNERS = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]


def bricks(low, high):
    """Places of the eight nodes of each brick, in cells."""
    for cell in itertools.product(*(range(a, b) for a, b in zip(low, high))):
        yield [tuple(a + b for a, b in zip(cell, corner)) for corner in CORNERS]


def node_set(name, numbers):
    rows = [numbers[i : i + 12] for i in range(0, len(numbers), 12)]
    return [f"*NSET, NSET={name}"] + [", ".join(map(str, row)) + "," for row in rows]


def main():
    elements = {part: list(bricks(low, high)) for part, (low, high, _) in PARTS.items()}
    places = [(part, place) for part, cells in elements.items()
              for place in sorted({p for cell in cells for p in cell}, key=lambda p: p[::-1])]  # the lining's top is last
    nodes = {key: number for number, key in enumerate(places, 1)}

    def those(part, test):
        return [number for (of, place), number in nodes.items() if of == part and test(place)]

    text = ["*HEADING", "A lining on a strip: mm, N, s, t", "*NODE"]
    text += [f"{n}, " + ", ".join(f"{h * p:g}" for h, p in zip(CELL, place)) for (_, place), n in nodes.items()]
    number = itertools.count(1)
    for part, cells in elements.items():
        text.append(f"*ELEMENT, TYPE=C3D8, ELSET={part}")
        text += [f"{next(number)}, " + ", ".join(str(nodes[part, place]) for place in cell) for cell in cells]
    text += node_set("strip_ends", those("strip", lambda p: p[0] in (0, PARTS["strip"][1][0])))
    text += node_set("strip_top", those("strip", lambda p: p[2] == 0))
    text += node_set("lining_bottom", those("lining", lambda p: p[2] == 0))
    text += node_set("lining_top", those("lining", lambda p: p[2] == PARTS["lining"][1][2]))
    for part, (_, _, (young, poisson, density)) in PARTS.items():
        text += [f"*MATERIAL, NAME={part}", "*ELASTIC", f"{young:g}, {poisson}", "*DENSITY", f"{density:g}"]
        text.append(f"*SOLID SECTION, ELSET={part}, MATERIAL={part}")
    text += ["*BOUNDARY", "strip_ends, 1, 3", "lining_top, 1, 2", "*STEP", "*FREQUENCY, SOLVER=MATRIXSTORAGE", "*END STEP"]
    (FOLDER / "strip.inp").write_text("\n".join([*text, ""]))
    pairs = [(nodes["strip", place], n) for (of, place), n in nodes.items() if of == "lining" and place[2] == 0]
    (FOLDER / "pairs.csv").write_text("rotor, stator\n" + "".join(f"{a}, {b}\n" for a, b in pairs))
    subprocess.run(["ccx", "-i", "strip"], cwd=FOLDER, check=True, stdout=subprocess.DEVNULL)
    for ending in ("12d", "cvg", "dat", "frd", "sta"):
        (FOLDER / f"strip.{ending}").unlink(missing_ok=True)


if __name__ == "__main__":
    main()
