#!/usr/bin/env python3
"""Writes an elastic block on a moving belt with many contact pairs, SIDE x SIDE elements of its face and two layers.

    jobs/many_pairs.py 96 FOLDER
    build/squeal FOLDER/scene.toml

The run finds the equilibrium and makes ten steps from it while friction falls to a half. 96 x 96 elements have
9 409 pairs: their contact operator takes 6.4 GB.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tools"))
import bench_blocks

SCENE = """title = "block on a belt, {pairs} pairs"

[matrices]
folder = "matrices"

[friction]
coefficient = 0.4

[modes]
enabled = false

[estimate]
enabled = false

[transient]
start = "equilibrium"
steps = 10
step_size = 1e-6 # s: a wave crosses two and a half elements
friction_factor = [[0, 1], [5e-6, 0.5]]
"""

if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    side, folder = int(sys.argv[1]), Path(sys.argv[2])
    (folder / "matrices").mkdir(parents=True, exist_ok=True)
    bench_blocks.write_matrices(folder / "matrices", *bench_blocks.block_on_belt(side, side, 2))
    (folder / "scene.toml").write_text(SCENE.format(pairs=(side + 1) ** 2))
