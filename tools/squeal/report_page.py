"""The page of tools/report, put together from what runs found: text, tables and pictures as one HTML document."""

import base64
import io
import tempfile
from pathlib import Path

from squeal import common
import numpy as np
from PIL import Image
from squeal.part_shares import part_shares
from squeal.plot_all import ANIMATION, FIGURES, caption_of, figures
from squeal.plot_basis import frequency_unit, length_unit, names_of
from squeal.plot_motion import lift_off_of
from squeal.plot_numbers import words_of
from squeal.plot_shape import animate
from squeal.report_alive import Alive
from squeal.report_charts import charts_of
from squeal.report_input import differences, input_of
from squeal.report_style import STYLE
from squeal.report_tables import SHAPES, number, numbers, paragraph, probability, rotation, strongest, table, text, values_of
from squeal import Missing

STAGES = ("equilibrium", "modes", "estimate", "response", "transient", "cycle", "settled", "attractors", "branch",
          "sensitivity", "sweep", "robustness")
FAILED = ("not converged", "no equilibrium", "refused", "collapsed to equilibrium", "not periodic", "unstable cycle", "interrupted")


def data(content, kind):
    return f"data:{kind};base64,{base64.b64encode(content).decode()}"


TURNED = ("model", "shape", "shapes", "animation")  # pictures that the 3D view stands for


def picture(content, kind, name, caption, charts="", whole=True):
    """Broad ones take the width of two. charts: what answers a pointer, in place of the picture if it is the whole of it."""
    width, height = Image.open(io.BytesIO(content)).size
    classes = [word for word, true in (("broad", width > 2 * height or charts.count('class="charts many"')), ("live", charts and whole),
                                       ("turned", name in TURNED)) if true]
    return (f'<figure class="{" ".join(classes)}">{charts}<div class="wide"><img src="{data(content, kind)}" alt="{text(name)}: {text(caption)}">'
            f"</div><figcaption>{text(caption)}</figcaption></figure>")


def drawn(runs, alive, names, prefix):
    """Pictures of these names, and why others are left out or lack a run."""
    found, left_out = [], []
    for name, figure, absent in figures(runs, names):
        left_out += [f"{name} lacks {reason}" for reason in absent]
        if isinstance(figure, Missing):
            left_out.append(f"{name}: {figure}")
            continue
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "picture.png"
            common.save_picture(figure, file, 110)
            charts, whole = charts_of(figure) if name not in TURNED else ([], True)
            title = figure._suptitle.get_text() if charts and figure._suptitle else ""
            found.append(picture(file.read_bytes(), "image/png", name, prefix + caption_of(name, runs, figure), alive.add(charts, title), whole))
    return found, left_out


def pictures(runs, alive, among=1):
    """All pictures of these runs, why the others are left out, and which runs they lack. among: runs on the page, where each
    picture of one says which."""
    names = [name for name, (_, alone, _) in FIGURES.items() if len(runs) == 1 or not alone]  # each run has its own, too
    prefix = f"{runs[0].folder.name}: " if among > 1 and len(runs) == 1 else ""
    found, left_out = drawn(runs, alive, names, prefix)
    if len(runs) == 1 and not alive.views:  # which move by themselves
        content = io.BytesIO()
        try:
            animate(runs[0], content)
            found.insert(1, picture(content.getvalue(), "image/gif", "animation", prefix + ANIMATION))
        except Missing:
            pass
    words = f'<details><summary>pictures that are left out</summary><ul>{"".join(f"<li>{text(w)}</li>" for w in left_out)}</ul></details>'
    return "".join(found) + (words if left_out else "")


def facts(run):
    """Name and value of what is asked first."""
    report = run.report
    modes, cycle = report.get("modes", {}), report.get("cycle", {})
    found = {}
    if modes.get("modes"):
        first = modes["modes"][0]
        size, unit = frequency_unit(modes["band_hz"])
        found["unstable modes"] = f"{modes['unstable_count']} of {len(modes['modes'])} below {modes['band_hz'] / size:g} {unit}"
        if first["unstable"]:
            found["fastest growing mode"] = f"{first['frequency_hz']:.5g} Hz, {first['growth_rate']:+.3g} 1/s"
            found |= moved_most(run)
    if cycle.get("outcome") == "converged":
        found["frequency of the squeal"] = f"{cycle['frequency_hz']:.6g} Hz"
        swings = cycle.get("peak_to_peak", {})
        if swings:
            name, swing = max(swings.items(), key=lambda item: item[1])
            size, unit = length_unit(np.array([swing]))
            found[f"swing of {name}"] = f"{swing / size:.3g} {unit} peak to peak"
        found |= lost_contact(run)
        stability = cycle.get("multipliers", {}).get("stability")
        if (run.folder / "sound.txt").exists():
            found["sound"] = (run.folder / "sound.txt").read_text().partition(",")[0] + " at the microphone"
        found["does it last"] = {"stable": "yes, it attracts", "unstable": "no, it repels"}.get(stability, "not decided")
    settled = report.get("settled", {})
    if settled.get("kind"):
        found["motion it settles on"] = settled["kind"]
        if settled.get("lines"):
            found["strongest line"] = f"{settled['lines'][0]['frequency_hz']:.5g} Hz"
    return found | study_facts(report)


def moved_most(run):
    """The part that has most of that mode's kinetic energy."""
    found = part_shares(run, SHAPES)
    if not found or found[0]["mode"] != 1 or len(found[0]["parts"]) < 2:
        return {}
    part = found[0]["parts"][0]
    return {"what moves in that mode": f"{part['name']}, {100 * part['kinetic']:.3g} % of the kinetic energy"}


def lost_contact(run):
    """By area, as the picture of it."""
    try:
        _, opened, _, area = lift_off_of(run)
    except Missing:
        return {}
    of = "area" if area != len(run.field("pairs/node")) else "pairs"
    return {"contact lost": f"{100 * opened.max():.3g} % of the {of} at most"}


def study_facts(report):
    """The same of sensitivity, sweep and random numbers."""
    found = {}
    causes = report.get("sensitivity", {}).get("modes", [])
    shown = strongest(causes[0]["derivatives"])[0] if causes else []
    if shown and shown[0]["value"]:
        effect = 0.01 * shown[0]["value"] * shown[0]["growth_rate_by"]
        found["what moves that mode most"] = f"{words_of(shown[0]['key'], shown[0]['name'])}: {effect:+.3g} 1/s for 1 %"
    sweep = report.get("sweep", {})
    if sweep.get("points"):
        failed = sum(p["outcome"] != "converged" and not p["inserted"] for p in sweep["points"])
        name = f"sweep of {' and '.join(map(words_of, sweep['keys'], sweep['names']))}"
        found[name] = f"unstable at {sum(p['unstable_modes'] > 0 for p in sweep['points'])} of {len(sweep['points'])} points"
        found[name] += f", {failed} failed" if failed else ""
        rising = [t for t in sweep["thresholds"] if t["change"] > 0]
        if rising:
            first = min(rising, key=lambda t: t["values"][0])
            found["first threshold"] = f"{values_of(first)}, at {first['frequency_hz']:.5g} Hz" + (
                f", rotation {rotation(first)}" if sweep["directions"] == "both" else "")
    if report.get("robustness", {}).get("samples"):
        found["probability of an unstable mode [%]"] = probability(report["robustness"]["any"])
    return found


def answers(runs):
    if len(runs) == 1:
        run = runs[0]
        heard = run.report.get("heard") or f"the run ended with exit code {run.exit_code}"
        cards = "".join(f"<div><dt>{text(name)}</dt><dd>{text(value)}</dd></div>" for name, value in facts(run).items())
        return f'<p class="heard">{text(heard[0].upper() + heard[1:])}.</p><dl class="cards">{cards}</dl>'
    found = [facts(run) for run in runs]
    heads = [text(run.folder.name) for run in runs]
    differ = differences(runs)
    first = table(["", *heads], differ, "further differences") if differ else paragraph("The scenes of these runs are alike.")
    rows = [["heard", *(text(run.report.get("heard", "")) for run in runs)]]
    rows += [[text(name), *(text(entry.get(name, "–")) for entry in found)] for name in dict.fromkeys(name for entry in found for name in entry)]
    return f"<h2>What differs</h2>{first}<h2>What comes of it</h2>{table(['', *heads], rows, 'further answers')}"


def warnings(run):
    found = [(stage, words) for stage in ("model", *STAGES) for words in run.report.get(stage, {}).get("warnings", [])]
    failed = [(stage, run.report[stage].get("reason") or run.report[stage]["outcome"]) for stage in STAGES
              if run.report.get(stage, {}).get("outcome") in FAILED]
    items = "".join(f"<li><b>{stage}</b>: {text(words)}</li>" for stage, words in failed + found)
    return f'<section class="warnings"><h2>Warnings</h2><ul>{items}</ul></section>' if items else ""


def stages(run):
    found = {stage: run.report[stage] for stage in STAGES if run.report.get(stage)}
    rows = [[stage, text(entry.get("outcome", "–")), text(entry.get("reason", "")), number(run.report["timings"].get(stage), 3)]
            for stage, entry in found.items() if entry.get("outcome") != "off"]
    off = [stage for stage, entry in found.items() if entry.get("outcome") == "off"]
    return ("<h3>Stages</h3>" + table(["stage", "outcome", "why", "time [s]"], rows, "later stages")
            + (paragraph(f"Not asked for: {', '.join(off)}.") if off else ""))


def sound(run):
    file = run.folder / "sound.wav"
    if not file.exists():
        return ""
    levels = run.folder / "sound.txt"
    said = f"<pre>{text(levels.read_text())}</pre>" if levels.exists() else ""
    words = f'<details class="print"><summary>levels, and what they assume</summary>{said}</details>' if said else ""
    return f'<h3>How it sounds</h3><audio controls src="{data(file.read_bytes(), "audio/wav")}"></audio>{words}'


def again(run):
    """The command and the files that run it again."""
    read = lambda name: (run.folder / name).read_text() if (run.folder / name).exists() else ""
    ranks, versions = run.report["model"]["ranks"], run.report.get("versions", {})
    command = f"mpirun -n {ranks} build/squeal {run.folder / 'resolved.toml'} -options_file {run.folder / 'options.txt'}"
    rows = [["scene", text(run.report.get("scene", ""))], ["run", text(run.report.get("run", ""))],
            ["size", f"{run.report['model']['dofs']} degrees of freedom, {run.report['model']['elements']} elements, "
                     f"{run.report['model']['pairs']} contact pairs, {ranks} ranks"],
            ["memory", f"{run.report['model']['memory_bytes'] / 1e9:.2f} GB"],
            ["versions", text(", ".join(f"{name} {version}" for name, version in versions.items()))]]
    return (f"<h3>How to run it again</h3><pre>{text(command)}</pre>" + table(["", ""], rows)
            + f"<details class='print'><summary>options.txt</summary><pre>{text(read('options.txt'))}</pre></details>"
            + f"<details class='print'><summary>resolved.toml, the scene with every default</summary><pre>{text(read('resolved.toml'))}</pre></details>")


def page(runs):
    title = runs[0].title if len(runs) == 1 else f"{names_of(runs)}: {len(runs)} runs"
    alive = Alive(runs)
    parts = [f"<header><p>squeal</p><h1>{text(title)}</h1></header>", f'<section class="answers">{answers(runs)}</section>']
    if len(runs) > 1:
        parts += [alive.stage(), f'<section><h2>Side by side</h2><div class="pictures">{pictures(runs, alive)}</div></section>']
    for run in runs:
        if len(runs) > 1:
            parts.append(f"<h2 class='run'>{text(run.folder.name)}: {text(run.report.get('heard', ''))}</h2>")
        shown = pictures([run], alive, len(runs))
        parts += [warnings(run), alive.stage() if len(runs) == 1 else "", input_of(run),
                  f'<section><h2>Pictures</h2><div class="pictures">{shown}</div>{sound(run)}</section>',
                  f"<section><h2>Numbers</h2>{numbers(run)}{stages(run)}{again(run)}</section>"]
    # The policy keeps a browser from asking the network for anything.
    policy = "default-src 'none'; img-src data: blob:; media-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
    return (f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{text(title)}</title>'
            f'<meta http-equiv="Content-Security-Policy" content="{policy}">'
            f'<meta name="viewport" content="width=device-width, initial-scale=1"><link rel="icon" href="data:,">'
            f"<style>{STYLE}</style></head><body><main>{''.join(parts)}</main>{alive.scripts()}</body></html>\n")
