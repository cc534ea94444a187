#!/usr/bin/env bash
#SBATCH --job-name=squeal-long
#SBATCH --nodes=1
#SBATCH --ntasks=2
#SBATCH --mem-per-cpu=1500M
#SBATCH --time=12:00:00
#SBATCH --signal=B:USR1@60
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --output=%x-%j.txt
# The check of the shooting: direct integration from the energy estimate, long enough for the transient to die out, and
# from near the equilibrium beside it (the two starts of the mean-energy figure).
# Knobs: SCENE, PERIODS, STEPS (a period), RANKS, LAUNCH, OUTPUT, and any further arguments for squeal.
set -eu
# Where squeal is: SQUEAL_ROOT, or the folder above this script, of which Slurm runs a copy.
script=$0
[ -z "${SLURM_JOB_ID:-}" ] || script=$(scontrol show job "$SLURM_JOB_ID" | sed -n 's/^ *Command=\([^ ]*\).*/\1/p' | head -1)
root=${SQUEAL_ROOT:-$(dirname "$(realpath "$script")")/..}
. "$root/jobs/common"
scene=${SCENE:-inputs/tgv/scene.toml}
output=${OUTPUT:-results/long_run}
for start in estimate mode; do
  squeal_run "$output/$start" "$scene" --set cycle.enabled=false --set transient.start="$start" \
    --set transient.periods="${PERIODS:-400}" --set transient.steps_per_period="${STEPS:-100}" "$@"
done
finish
tools/plot "$output/estimate" "$output/mode"
