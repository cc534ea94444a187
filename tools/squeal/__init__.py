"""squeal from Python: edits scenes, runs them, and reads what a run found.

    import squeal

    scene = squeal.Scene("inputs/pin_on_disc")
    scene.set("friction.coefficient", 0.25)           # a nested dict: scene["friction"]["coefficient"] as well
    results = squeal.run(scene, ranks=2)
    results                                           # its answer in a line, in a notebook as a table
    results.report["cycle"]["frequency_hz"]           # every number of report.json
    results.modes()                                   # tables: of modes, pairs, sweep, thresholds, derivatives, samples …
    results.mesh(mode=1)                              # the mesh with a mode's shape, for PyVista
    results.probes("cycle")                           # arrays against results.series("cycle", "time")
    squeal.study(scene, {"friction.coefficient": [0.2, 0.3, 0.4]})  # many runs, with a bar of progress

squeal.Results("results/pin_on_disc") reads a run made before. Tables are pandas' DataFrames. What a run did not compute raises
Missing, what goes wrong SquealError. In the sources the package lies in tools/, which has to be in sys.path.
"""

from squeal.common import SquealError, needs

needs("h5py", "numpy")
from squeal.results import FORMAT_VERSION, Missing, Results, number_label, read_report, table, table_of
from squeal.runs import TookTooLong, environment, run
from squeal.scene import Scene, toml
from squeal.study import Study, study

__all__ = ["FORMAT_VERSION", "Missing", "Results", "Scene", "SquealError", "Study", "TookTooLong", "environment", "number_label",
           "read_report", "run", "study", "table", "table_of", "toml"]
