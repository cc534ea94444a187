#!/usr/bin/env bash
#SBATCH --job-name=squeal-mu
#SBATCH --ntasks=2
#SBATCH --time=02:00:00
# Unstable modes of a scene against the friction coefficient: one run of equilibrium and modes a value.
# Knobs: SCENE, MU (list), RANKS, OUTPUT, and any further arguments for squeal.
set -eu
cd "${SLURM_SUBMIT_DIR:-$(dirname "$0")/..}"
. tools/environment
scene=${SCENE:-inputs/tgv/scene.toml}
output=${OUTPUT:-results/mu_sweep}
for mu in ${MU:-0 0.05 0.1 0.15 0.2 0.25 0.3 0.4}; do
  mpirun -n "${RANKS:-${SLURM_NTASKS:-2}}" build/squeal "$scene" --set friction.coefficient="$mu" \
    --set transient.enabled=false --set cycle.enabled=false --output "$output/mu_$mu" "$@" || echo "mu = $mu: exit code $?"
done
python3 - "$output" <<'TABLE'
import glob, json, sys
print(f"{'mu':>6} {'unstable':>8} {'frequency [Hz]':>15} {'growth [1/s]':>13} {'backward error':>15}")
for file in sorted(glob.glob(sys.argv[1] + "/mu_*/report.json"), key=lambda f: float(f.split("mu_")[-1].split("/")[0])):
    modes = json.load(open(file))["modes"]
    mu = file.split("mu_")[-1].split("/")[0]
    for mode in modes.get("modes", [])[: max(1, modes.get("unstable_count", 0))]:
        print(f"{mu:>6} {modes['unstable_count']:>8} {mode['frequency_hz']:15.3f} {mode['growth_rate']:13.4f} {mode['backward_error']:15.1e}")
TABLE
