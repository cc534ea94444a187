#!/usr/bin/env bash
#SBATCH --job-name=squeal-long
#SBATCH --ntasks=2
#SBATCH --time=12:00:00
# The judge of the shooting: direct integration from the energy estimate, long enough for the transient to die out, and
# from near the equilibrium beside it (the two starts of the mean-energy figure).
# Knobs: SCENE, PERIODS, STEPS (a period), RANKS, OUTPUT, and any further arguments for squeal.
set -eu
cd "${SLURM_SUBMIT_DIR:-$(dirname "$0")/..}"
. tools/environment
scene=${SCENE:-inputs/tgv/scene.toml}
output=${OUTPUT:-results/long_run}
for start in estimate mode; do
  mpirun -n "${RANKS:-${SLURM_NTASKS:-2}}" build/squeal "$scene" --set cycle.enabled=false \
    --set transient.start="$start" --set transient.periods="${PERIODS:-400}" \
    --set transient.steps_per_period="${STEPS:-100}" --output "$output/$start" "$@"
done
tools/plot "$output/estimate" "$output/mode"
