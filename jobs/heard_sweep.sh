#!/usr/bin/env bash
#SBATCH --job-name=squeal-heard
#SBATCH --nodes=1
#SBATCH --ntasks=1
#SBATCH --mem-per-cpu=3G
#SBATCH --time=08:00:00
#SBATCH --signal=B:USR1@60
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --output=%x-%j.txt
# What squeal says is heard against the friction coefficient, beside an independent direct integration from another start:
# the unstable mode at AMPLITUDE times the estimate's. Its kind and means are found here, by the table's own script.
# What is done stays: stop it when you like and start it again.
# Knobs: SCENE, MU (list), PERIODS (of the direct integration), STEPS (a period, of both), AMPLITUDE, RANKS, LAUNCH,
# OUTPUT, and any further arguments for squeal. The small brake: SCENE=inputs/tgv/scene.toml MU="$(seq 0.2 0.02 0.4)" STEPS=64 with
# the arguments of tests/evidence/README.md.
set -eu
# Where squeal is: SQUEAL_ROOT, or the folder above this script, of which Slurm runs a copy.
script=$0
[ -z "${SLURM_JOB_ID:-}" ] || script=$(scontrol show job "$SLURM_JOB_ID" | sed -n 's/^ *Command=\([^ ]*\).*/\1/p' | head -1)
root=${SQUEAL_ROOT:-$(dirname "$(realpath "$script")")/..}
. "$root/jobs/common"
scene=${SCENE:-inputs/pin_on_disc/scene.toml}
output=${OUTPUT:-results/heard_sweep}
steps=${STEPS:-60}
values=(${MU:-$(seq 0.25 0.05 0.8)})
for mu in "${values[@]}"; do
  said=$output/mu_$mu/said
  arguments=("$scene" --set modes.method=full --set friction.coefficient="$mu" --set transient.enabled=false
    --set cycle.steps_per_period="$steps" "$@")
  squeal_run "$said" "${arguments[@]}"
  is_done "$said" "${arguments[@]}" || continue
  amplitude=$(python3 -c "import json; e = json.load(open('$said/report.json'))['estimate']
print(${AMPLITUDE:-1.5} * (e.get('amplitude') or 2 * (e.get('lift_off_amplitude') or 0)))")
  [ "$amplitude" != 0 ] && [ "$amplitude" != 0.0 ] || { echo "mu = $mu: no mode grows"; continue; }
  squeal_run "$output/mu_$mu/direct" "$scene" --set modes.method=full --set friction.coefficient="$mu" \
    --set cycle.enabled=false --set transient.enabled=true --set transient.start=mode \
    --set transient.amplitude="$amplitude" --set transient.periods="${PERIODS:-1000}" \
    --set transient.steps_per_period="$steps" "$@"
done
finish
/usr/bin/python3 - "$output" "${values[@]}" <<'TABLE'
"""The last half of the direct integration, in windows of the squeal's strongest line, and what squeal said."""
import json, sys
import h5py
import numpy as np


def lines_of(signal, step):
    """Frequencies and amplitudes of local maxima above 1e-3 of the largest, by a parabola through the logarithms."""
    x = (signal - signal.mean()) * np.hanning(len(signal))
    a = np.abs(np.fft.rfft(x))
    i = np.flatnonzero((a[1:-1] > a[:-2]) & (a[1:-1] >= a[2:]) & (a[1:-1] > 1e-3 * a.max())) + 1
    l, m, r = (np.log(a[i + k]) for k in (-1, 0, 1))
    order = np.argsort(-a[i])
    return ((i + 0.5 * (l - r) / (l - 2 * m + r)) / (len(x) * step))[order], a[i][order]


def direct(file):
    """Mean fluctuating energy with its bar, strongest lines, and a kind from the energies of windows and the lines."""
    with h5py.File(file) as history:
        group = history["transient"]
        half = len(group["time"]) // 2
        step = group["time"][1] - group["time"][0]
        energy = group["fluctuating_energy"][half:]
        probes = [probe[half:] for probe in group["probes"].values()] if "probes" in group else [group["normal_force"][half:]]
    probe = max(probes, key=np.ptp)
    frequency, height = lines_of(probe, step)
    window = max(1, round(1 / frequency[0] / step))
    count = len(energy) // window
    windows = energy[: count * window].reshape(count, window).mean(axis=1)
    bars = []
    for batches, student in ((8, 2.365), (16, 2.131), (32, 2.04)):
        means = windows[len(windows) % batches :].reshape(batches, -1).mean(axis=1)
        bars.append(student * means.std(ddof=1) / np.sqrt(batches))
    spread = windows.std() / windows.mean()
    resolution = 1 / (len(probe) * step)
    beside = np.abs(frequency / frequency[0] - np.round(frequency / frequency[0])) * frequency[0] > 2 * resolution
    beside &= height > 0.01 * height[0]
    kind = "cycle" if spread < 5e-3 else f"no cycle, {beside.sum()} side lines"
    return kind, windows.mean(), max(bars), spread, frequency[:1]


print("| mu | squeal says | mean energy [J] | direct integration | mean energy [J] | spread of windows | strongest line [Hz] |")
print("|---|---|---|---|---|---|---|")
for mu in sys.argv[2:]:
    folder = f"{sys.argv[1]}/mu_{mu}"
    report = json.load(open(folder + "/said/report.json"))
    settled, cycle = report["settled"], report["cycle"]
    if "mean_fluctuating_energy" in settled:
        mean = settled["mean_fluctuating_energy"]
        said = f"{mean['mean']:.3e} +- {mean['error']:.0e}"
    else:
        said = f"{cycle['mean_fluctuating_energy']:.3e}" if "mean_fluctuating_energy" in cycle else ""
    row = [mu, report["heard"], said]
    try:
        kind, energy, bar, spread, lines = direct(folder + "/direct/history.h5")
        row += [kind, f"{energy:.3e} +- {bar:.0e}", f"{spread:.1e}", f"{lines[0]:.1f}"]
    except (OSError, KeyError):
        row += [""] * 4
    print("| " + " | ".join(row) + " |")
TABLE
