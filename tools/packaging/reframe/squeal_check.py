"""ReFrame's check of an installed squeal: its module runs the pin on the disc, which squeals at the frequency that it should.

    reframe -c squeal_check.py -r

Set valid_systems and valid_prog_environs to the site's, or take them from its configuration with -S.
"""

import reframe as rfm
import reframe.utility.sanity as sn
from reframe.core.builtins import parameter, performance_function, run_after, sanity_function


@rfm.simple_test
class SquealCheck(rfm.RunOnlyRegressionTest):
    """The least scene that squeals, on one rank and on several."""

    descr = "limit cycle of the pin on the disc"
    valid_systems = ["*"]
    valid_prog_environs = ["*"]
    modules = ["squeal/@VERSION@"]
    executable = "squeal"
    executable_opts = ["$SQUEAL_SCENES/pin_on_disc", "--output", "results"]
    prerun_cmds = ["export SQUEAL_SCENES=$(dirname $(command -v squeal))/../share/squeal/inputs"]
    ranks = parameter([1, 2, 4])
    tags = {"production"}

    @run_after("init")
    def set_ranks(self):
        self.num_tasks = self.ranks
        self.num_cpus_per_task = 1
        self.env_vars = {"OPENBLAS_NUM_THREADS": 1}

    @sanity_function
    def squeals(self):
        """Every stage converged, and one mode grows."""
        return sn.all([
            sn.assert_found(r'^  "exit_code": 0,', "results/report.json"),
            sn.assert_found(r'"unstable_count": 1\b', "results/report.json"),
        ])

    @performance_function("s")
    def seconds(self):
        return sn.extractsingle(r'"timings": \{[^}]*"cycle": ([\d.eE+-]+)', "results/report.json", 1, float)
