"""Tables of tools/report: short ones, what matters most first, of the report's numbers."""

import html

import numpy as np
from squeal.common import counted
from squeal import Missing, number_label
from squeal.mesh_estimate import scene_of
from squeal.part_shares import part_shares

ROWS = 12  # of a table that stand open; the rest is folded away
WORDS = 40  # letters of a cell that stay on one line
NUMBERS = 6  # of the scene that are shown for a mode: those that move its growth most
SHAPES = 6  # unstable modes whose parts are told
MODES = 3  # unstable modes whose numbers stand open
FEEDS = {"contact_powers": "", "falling_friction_powers": "falling friction of ", "turning_friction_powers": "turning friction of "}
CHANGES = {"mass": ("mass", "kg"), "damping": ("dashpot", "N s/m"), "stiffness": ("spring", "N/m")}  # of a [[change]]


def text(value):
    return html.escape(str(value))


def number(value, digits=5):
    """A number as people write it, a word as it is."""
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.{digits}g}"
    return text(value)


def table(head, rows, summary=""):
    """Rows beyond some are folded away. Only cells of many words go on over several lines."""
    cell = lambda content: f'<td class="words">{content}</td>' if len(str(content)) > WORDS else f"<td>{content}</td>"

    def body(part):
        lines = "".join("<tr>" + "".join(map(cell, row)) + "</tr>" for row in part)
        heads = "".join(f"<th>{cell}</th>" for cell in head)
        return f'<div class="wide"><table><thead><tr>{heads}</tr></thead><tbody>{lines}</tbody></table></div>'

    rows = list(rows)
    folded = f"<details><summary>{summary or 'the rest'}, {len(rows) - ROWS} more</summary>{body(rows[ROWS:])}</details>"
    return body(rows[:ROWS]) + (folded if len(rows) > ROWS else "")


def paragraph(words):
    return f"<p>{text(words)}</p>"


def modes(report):
    found = report.get("modes", {}).get("modes", [])
    if not found:
        return ""
    rows = [[k, number(m["frequency_hz"], 7), number(m["growth_rate"]), number(100 * m["damping_ratio"], 3),
             number(m["backward_error"], 2), "<b>unstable</b>" if m["unstable"] else ""] for k, m in enumerate(found, 1)]
    head = ["mode", "frequency [Hz]", "growth rate [1/s]", "damping [%]", "backward error", ""]
    return "<h3>Modes</h3>" + table(head, rows, "less unstable modes")


def contacts(report):
    found = report.get("equilibrium", {}).get("contacts", [])
    if not found:
        return ""
    rows = [[text(c["stator"]), text(c["rotor"]), number(c["normal_force_sum"]), number(c.get("torque"))] for c in found]
    return "<h3>Contacts in steady sliding</h3>" + table(["stator", "rotor", "normal force [N]", "braking torque [N m]"], rows)


def cycle(report):
    """Swings, accuracy and Floquet multipliers."""
    found, parts = report.get("cycle", {}), []
    if found.get("peak_to_peak"):
        rows = [[text(name), number(1e6 * swing)] for name, swing in found["peak_to_peak"].items()]
        parts.append("<h3>Swings in the cycle</h3>" + table(["probe", "peak to peak [µm]"], rows))
    if found.get("period"):
        rows = [["full residual", number(found["residual_full"], 2)], ["steps a period", found["steps_per_period"]],
                ["periods integrated", found["periods_integrated"]]]
        rows += [[f"error of the {name.replace('_', ' ')}", number(value, 2)]
                 for name, value in report.get("fidelity", {}).get("error_estimates", {}).items()]
        parts.append("<h3>Accuracy of the cycle</h3>" + table(["measure", "value"], rows))
    multipliers = found.get("multipliers", {}).get("values", [])
    if multipliers:
        rows = [[number(float(np.hypot(m["real"], m["imaginary"])), 6), number(m["real"], 6), number(m["imaginary"], 6),
                 number(m["error"], 2)] for m in multipliers]
        parts.append("<h3>Floquet multipliers</h3>" + table(["modulus", "real", "imaginary", "error bar"], rows, "smaller ones"))
    return "".join(parts)


def strongest(derivatives):
    """Numbers by falling effect of 1 % of them on the growth rate, without those that hardly have one. A number at 0, which
    has a derivative but no per cent, was asked for by name and comes last."""
    known = [d for d in derivatives if d["known"]]
    effect = lambda d: abs(d["value"] * d["growth_rate_by"])
    least = 1e-6 * max(map(effect, known), default=0)
    moving = sorted((d for d in known if effect(d) > least), key=effect, reverse=True)
    return moving[:NUMBERS] + [d for d in known if d["value"] == 0], len(moving) - len(moving[:NUMBERS])


def derivatives(mode):
    shown, weaker = strongest(mode["derivatives"])
    by = lambda d, name: number(0.01 * d["value"] * d[name], 3) if d["value"] else "–"
    rows = [[text(number_label(d["key"], d["name"])), number(float(d["value"])), by(d, "growth_rate_by"), by(d, "frequency_hz_by"), number(d["growth_rate_by"], 4)]
            for d in shown]
    words = [f"{weaker} that move it less are in report.json"] if weaker else []
    unknown = [number_label(d["key"], d["name"]) for d in mode["derivatives"] if not d["known"]]
    words += [f"without a derivative, since pairs open or close there: {', '.join(unknown)}"] if unknown else []
    head = ["number of the scene", "value", "1 % more moves the growth by [1/s]", "and the frequency by [Hz]", "derivative of the growth [1/s per unit]"]
    return (table(head, rows) if rows else "") + (paragraph("; ".join(words) + ".") if words else "")


def shares(mode):
    """Where the energies of a mode are: what holds at least 1 % of one."""
    found = [s for s in mode["shares"] if max(s["kinetic"], s["strain"]) >= 0.01]
    found.sort(key=lambda s: -max(s["kinetic"], s["strain"]))
    rows = [[text(f"{s['table'].replace('_', ' ')} {s['name']}"), *(number(100 * s[name], 3) if abs(s[name]) >= 5e-4 else "" for name in ("kinetic", "strain"))]
            for s in found]
    return table(["energy is held by", "kinetic [%]", "strain [%]"], rows) if rows else ""


def driving_numbers(run):
    """The numbers that are asked about first: friction, damping and moduli, where they are not 0."""
    try:
        scene = scene_of(run)
    except Missing:
        return ["friction.coefficient"]
    found = [f"{table_of}.{name}" for table_of, name in (("friction", "coefficient"), ("damping", "beta")) if scene.get(table_of, {}).get(name)]
    return found + [f"part.{part['name']}.young" for part in scene.get("part", []) if part.get("young")]


def moving_parts(run):
    """Which part moves in each unstable mode, of a run that was not asked why they are unstable, and how to ask."""
    report = run.report
    if report.get("sensitivity", {}).get("modes") or not report.get("modes", {}).get("unstable_count"):
        return ""
    found = part_shares(run, SHAPES)
    rows = [[number(mode["frequency_hz"], 7), number(mode["growth_rate"]), *("<br>".join(number(100 * part[name], 3) for part in mode["parts"]) for name in ("kinetic", "strain"))]
            for mode in found]
    for row, mode in zip(rows, found):
        row.insert(2, "<br>".join(text(part["name"]) for part in mode["parts"]))
    head = ["unstable mode [Hz]", "growth rate [1/s]", "part", "kinetic energy [%]", "strain energy [%]"]
    drivers = driving_numbers(run)
    ask = (f'build/squeal {run.folder / "resolved.toml"} --output {run.folder}_why --set cycle.enabled=false --set transient.enabled=false '
           f'--set "sensitivity.numbers={drivers}"')
    parts = "<h3>Which part moves in unstable modes</h3>" + table(head, rows, "modes that grow more slowly") if rows else ""
    return parts + (paragraph("Which numbers drive unstable modes, and what each contact feeds in:") + f"<pre>{text(ask)}</pre>" if drivers else "")


def what_is_added(change):
    """Of a [[change]]: two at one probe are told apart."""
    parts = [f"{name} of {change[key]:g} {unit}" for key, (name, unit) in CHANGES.items() if change[key]]
    return f"{' and '.join(parts) or 'nothing'} at {change['probe']}"


def changes(found):
    """The [[change]]s, for each mode: growth and frequency as predicted by derivatives and as computed."""
    rows = [[number(mode["frequency_hz"], 6), text(what_is_added(change)), number(mode["growth_rate"], 6), number(change["predicted"]["growth_rate"], 6),
             number(change["computed"]["growth_rate"], 6) if "computed" in change else "not found",
             number(change.get("computed", change["predicted"])["frequency_hz"], 7)]
            for mode in found for change in mode["changes"]]
    head = ["mode [Hz]", "what is added", "growth rate without it [1/s]", "predicted by derivatives", "computed", "frequency with it [Hz]"]
    return "<h4>Proposed changes</h4>" + table(head, rows, "changes of other modes") if rows else ""


def additions(found):
    rows = [[number(mode["frequency_hz"], 6), text(probe["name"]), *(number(probe[f"growth_rate_by_{key}"], 3) for key in CHANGES)]
            for mode in found for probe in mode["probes"]]
    head = ["mode [Hz]", "probe", "growth rate by a mass [1/s per kg]", "by a dashpot [1/s per N s/m]", "by a spring [1/s per N/m]"]
    return "<h4>What additions at the probes would do</h4>" + table(head, rows, "of other modes") if rows else ""


def sensitivity(report):
    """Why modes are unstable: powers, numbers that matter, energies, additions."""
    found = report.get("sensitivity", {}).get("modes", [])
    if not found:
        return ""
    names = [f"{c['stator']} on {c['rotor']}" for c in report.get("equilibrium", {}).get("contacts", [])]
    powers = range(len(found[0]["contact_powers"]))
    names = names if len(names) == len(powers) else [f"contact {k}" for k in powers]
    feeds = [key for key in FEEDS if any(power for mode in found for power in mode[key])] or ["contact_powers"]
    rows = [[number(mode["frequency_hz"], 7), number(mode["growth_rate"]), *(number(p) for key in feeds for p in mode[key]), number(mode["damping_power"])]
            for mode in found]
    head = ["unstable mode [Hz]", "growth rate [1/s]", *(f"fed in by {FEEDS[key]}{text(name)} [1/s]" for key in feeds for name in names),
            "taken by damping [1/s]"]
    parts = ["<h3>Why modes are unstable</h3>", table(head, rows, "modes that grow more slowly"),
             paragraph("Powers are over the mean energy of the mode; what is fed in less what is taken is twice the growth rate. "
                       "A negative feed takes, as friction that turns with the motion does.")]
    of_modes = [f"<h4>Mode at {mode['frequency_hz']:.7g} Hz, {mode['growth_rate']:+.5g} 1/s</h4>" + derivatives(mode) + shares(mode)
                for mode in found]
    parts += of_modes[:MODES]
    if of_modes[MODES:]:
        parts.append(f"<details><summary>modes that grow more slowly, {len(of_modes) - MODES} more</summary>{''.join(of_modes[MODES:])}</details>")
    return "".join(parts) + changes(found) + additions(found)


def values_of(at):
    return ", ".join(f"{value:.7g}" for value in at["values"])


def rotation(at):
    return "as in the scene" if at["direction"] == 1 else "reversed"


def sweep(report):
    """What becomes unstable where: modes, thresholds, motions, points that failed."""
    found = report.get("sweep", {})
    if not found.get("points"):
        return ""
    keys = ", ".join(map(number_label, found["keys"], found["names"], found["units"]))
    both = found["directions"] == "both"
    at = lambda entry: [values_of(entry), *([rotation(entry)] if both else [])]
    where = [text(keys), *(["rotation"] if both else [])]
    inserted = sum(point["inserted"] for point in found["points"])
    words = counted(len(found["points"]), "point") + (f", of which {inserted} were inserted where modes were unclear or pairs open or close" if inserted else "")
    if found["followed_modes"]:
        words += (f"; {found['followed_modes']} modes followed with a MAC of at least {min(found['least_mac'], found['least_mac_across']):.2f}, "
                  f"{found['lost_modes']} lost on the way")
    if found["steps_cut_short"]:
        words += (f"; in {found['steps_cut_short']} of the steps more points in between are needed than are put there, "
                  "so that modes may be mistaken there and thresholds missed")
    parts = [f"<h3>Sweep of {text(' and '.join(map(number_label, found['keys'], found['names'])))}</h3>", paragraph(words + ".")]
    failed = [[*at(point), text(point["outcome"]), text(point.get("reason", ""))] for point in found["points"] if point["outcome"] != "converged"]
    if failed:
        parts.append("<h4>Points that failed</h4>" + table([*where, "outcome", "why"], failed))
    rows = [[*at(t), number(t["error"], 1), t["track"], number(t["frequency_hz"], 6), "unstable" if t["change"] > 0 else "stable"]
            for t in found["thresholds"]]
    if rows:
        parts.append("<h4>Thresholds</h4>" + table([*where, "error bar", "mode", "frequency [Hz]", "with a rising number it becomes"], rows, "further thresholds"))
    rows = [[t["track"], *at(t), number(t["frequency_hz"], 6), number(t["greatest_growth_rate"]),
             f"{t['unstable_points']} of {t['points']} points", number(t["least_mac"], 3)]
            for t in sorted(found["unstable_tracks"], key=lambda t: -t["greatest_growth_rate"])]
    if rows:
        head = ["mode", *(f"{of}, where it grows most" if k == 0 else of for k, of in enumerate(where)), "frequency [Hz]",
                "growth rate [1/s]", "unstable at", "least MAC"]
        parts.append("<h4>Modes that are unstable somewhere</h4>" + table(head, rows, "modes that grow less"))
    rows = [[*at(p), text(p["motion"]["heard"]), number(p["motion"]["mean_fluctuating_energy"], 4), text(p["motion"].get("reason", ""))]
            for p in found["points"] if "motion" in p]
    if rows:
        parts.append("<h4>Motions</h4>" + table([*where, "heard", "mean energy [J]", "remarks"], rows, "further motions"))
    return "".join(parts)


def response(report):
    found = report.get("response", {})
    if not found.get("peaks"):
        return ""
    rows = [[text(p["excitation"]), text(p["probe"]), number(p["frequency_hz"], 6), number(p["receptance"], 4), f"{20 * np.log10(p['receptance']):.1f}"]
            for p in sorted(found["peaks"], key=lambda p: -p["receptance"]) if p["receptance"] > 0]
    words = (f"{found['count']} frequencies from {found['from_hz']:.5g} to {found['to_hz']:.5g} Hz; the residual is "
             f"{found['residual']:.1e} of a unit force at most.")
    head = ["driven at", "read at", "largest at [Hz]", "displacement over force [m/N]", "[dB re 1 m/N]"]
    return "<h3>Frequency responses</h3>" + paragraph(words) + table(head, rows, "weaker ones")


def probability(entry):
    """With its interval."""
    return f"{100 * entry['probability']:.3g} ({100 * entry['lower']:.3g} to {100 * entry['upper']:.3g})"


def robustness(report):
    found = report.get("robustness", {})
    if not found.get("samples"):
        return ""
    quantiles = lambda mode, name, digits: " / ".join(number(mode.get(f"{name}_{k}"), digits) for k in (5, 50, 95))
    rows = [["any", probability(found["any"]), found["any"]["unstable_samples"], "", "", "", ""]]
    rows += [["others" if m["mode"] < 0 else m["mode"], f"<b>{probability(m)}</b>", m["unstable_samples"],
              *(number(m[f"median_{name}"], 6) if m["mode"] >= 0 else "–" for name in ("frequency_hz", "growth_rate")), quantiles(m, "frequency_hz", 5), quantiles(m, "growth_rate", 4)]
             for m in found["modes"]]
    head = ["mode", f"probability of instability [%] ({100 * found['confidence']:.4g} % interval)", "unstable samples", "at the medians: frequency [Hz]", "growth rate [1/s]",
            "where unstable: frequency [Hz], 5 / 50 / 95 %", "growth rate [1/s], 5 / 50 / 95 %"]
    words = f"{found['samples']} random samples. Their modes leave residuals of at most {found['residual']:.1e} in the full problem."
    drivers = [[text(number_label(n["key"], n["name"])), text(n["distribution"]), f"{n['rank_correlation']:+.2f}"]
               for n in sorted(found["numbers"], key=lambda n: -abs(n["rank_correlation"]))]
    return ("<h3>Random numbers</h3>" + paragraph(words) + table(head, rows, "rarer modes")
            + table(["random number", "distribution", "rank correlation with growth"], drivers, "weaker ones"))


def numbers(run):
    parts = [part(run.report) for part in (modes, sensitivity, sweep, robustness, response, contacts, cycle)]
    return "".join([parts[0], moving_parts(run), *parts[1:]])
