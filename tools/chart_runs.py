"""The runs of tools/chart: which there are, which are made, and what became of them."""

import json
import sys

import squeal
from squeal import read_report

CYCLES = ("converged", "not converged")  # outcomes that have a cycle


def growth_cases(a):
    rest = {"cycle.enabled": "false", "transient.enabled": "false"}
    cases = {"modes_full": ({**rest, "modes.method": "full"}, [])}
    marched = {"cycle.enabled": "false", "transient.enabled": "true", "transient.start": "mode", "transient.periods": 2}
    for n in a.steps:
        cases[f"growth_{n}"] = ({**marched, "transient.steps_per_period": n}, [])
    return cases


def cycle_cases(a):
    cases = {}

    def shoot(name, steps, tolerance, *words, **values):
        settings = {"transient.enabled": "false", "cycle.enabled": "true", "cycle.steps_per_period": steps,
                    "cycle.tolerance": tolerance, "fidelity": "full", **values}
        cases[name] = (settings, ["-cycle_multipliers", "0", *map(str, words)])

    near = {"fidelity": "auto"}  # from the reduced model's cycle
    for n in sorted({*a.steps, a.at, a.reference // 2, a.reference}):
        shoot(f"step_{n}", n, 1e-8, **near)
    for n in a.steps:
        shoot(f"full_{n}", n, 1e-5)
        shoot(f"start_{n}", n, 1e-5, **near)
    for tolerance in a.residuals:
        shoot(f"near_{tolerance:.0e}", a.at, tolerance, **near)
    for tolerance in [*a.residuals, 1e-8]:
        shoot(f"far_{tolerance:.0e}", a.at, tolerance)
    shoot("seven", a.at, 1e-8, "-cycle_finish", "none", "-cycle_subspace_newtons", 10)
    for tolerance in a.contact:
        shoot(f"contact_{tolerance:.0e}", a.at, 1e-8, "-transient_contact_tolerance", tolerance, **near)
    for n in a.direct:
        cases[f"direct_{n}"] = ({"cycle.enabled": "false", "transient.enabled": "true", "transient.start": "estimate",
                                 "transient.periods": a.periods, "transient.steps_per_period": n}, [])
    for count in [*a.reduced, "all"]:
        words = [] if count == "all" else ["-reduced_modes", count]
        shoot(f"reduced_{count}", a.at, 1e-6, *words, fidelity="reduced")
    for accuracy in a.accuracies:
        cases[f"auto_{accuracy:.0e}"] = ({"transient.enabled": "false", "cycle.enabled": "true", "fidelity": "auto",
                                      "cycle.steps_per_period": 0, "cycle.tolerance": 0, "accuracy": accuracy}, ["-cycle_multipliers", "0"])
    return cases


def tidy(name):
    """1e-04 is 1e-4."""
    return name.replace("e-0", "e-")


class Runs:
    """The folder of runs: what is there, and what did not finish."""

    def __init__(self, a):
        self.folder, self.a = a.runs, a
        self.cases = {tidy(name): case for name, case in {**growth_cases(a), **cycle_cases(a)}.items()}

    def report(self, name):
        file = self.folder / name / "report.json"
        return read_report(file.parent) if file.exists() else None

    def stopped(self, name):
        """The limit [s] at which a run was stopped; 0 where none was."""
        file = self.folder / name / "stopped_after"
        return float(file.read_text()) if file.exists() else 0

    def remarks(self):
        """What a reader must know of a run: it was stopped, found no cycle, or took another way than it was asked to."""
        words = {}
        for name in self.cases:
            report = self.report(name)
            if not report and self.stopped(name):
                words[name] = f"stopped after {self.stopped(name):g} s"
            elif report and report["cycle"]["outcome"] not in ("off", *CYCLES):
                words[name] = report["cycle"]["outcome"]
            elif report and report["fidelity"].get("used") == "full" and report["fidelity"].get("reason"):
                words[name] = report["fidelity"]["reason"]
        return words

    def make(self, name):
        """The run, unless it is there, or was stopped at this limit before."""
        settings, words = self.cases[name]
        place = self.folder / name
        command = json.dumps([str(self.a.scene), settings, words, self.a.options, self.a.ranks])
        note = place / "command.json"
        if note.exists() and note.read_text() != command and self.report(name):
            sys.exit(f"chart: {place} was made by another command than this one; remove it, or use another --runs")
        if self.report(name) or self.stopped(name) >= self.a.limit:
            return
        place.mkdir(parents=True, exist_ok=True)
        note.write_text(command)
        print(f"chart: {name}", end=" ", flush=True)
        try:
            done = squeal.run(self.a.scene, settings, self.a.ranks, [*self.a.options, *words], place, self.a.limit)
        except squeal.TookTooLong:
            done = None
        for file in place.glob("fields.*"):
            file.unlink()  # large, and not drawn
        if done is None:
            (place / "stopped_after").write_text(str(self.a.limit))
        stages = done.report["processor_seconds"] if done else {}
        print(", ".join(f"{stage} {seconds:.1f} s" for stage, seconds in stages.items() if seconds > 0.05)
              if done else f"stopped after {self.a.limit:g} s", flush=True)

    def make_all(self):
        wanted = [name for name in self.cases if not self.a.only or {name, name.split("_")[0]} & set(self.a.only)]
        for name in wanted:
            self.make(name)

    def list(self):
        for name in self.cases:
            print(f"{name:16s} {self.remarks().get(name, 'there' if self.report(name) else '-')}")
