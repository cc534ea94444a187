#!/usr/bin/env bash
#SBATCH --job-name=squeal-chart
#SBATCH --nodes=1
#SBATCH --ntasks=1
#SBATCH --mem-per-cpu=3G
#SBATCH --output=%x-%j.txt
#SBATCH --time=12:00:00
# Accuracy against cost on the brake at 33 224 degrees of freedom, group by group, cheapest first: stop it when you like
# and start it again, what is done stays (tools/chart --help). The picture is drawn as soon as its reference is there.
# Knobs: GROUPS_OF_RUNS (of tools/chart), LIMIT (seconds a run), RANKS, OUTPUT.
set -eu
# Where squeal is: SQUEAL_ROOT, or the folder above this script, of which Slurm runs a copy.
script=$0
[ -z "${SLURM_JOB_ID:-}" ] || script=$(scontrol show job "$SLURM_JOB_ID" | sed -n 's/^ *Command=\([^ ]*\).*/\1/p' | head -1)
root=${SQUEAL_ROOT:-$(dirname "$(realpath "$script")")/..}
. "$root/jobs/common"
output=${OUTPUT:-results/chart/tgv_33k}
mkdir -p "$output"
for group in ${GROUPS_OF_RUNS:-auto modes step_64 start growth step full reduced direct seven near far contact}; do
  tools/chart inputs/tgv/scene.toml --runs "$output" --picture "$output/chart.png" --only "$group" \
    --ranks "${RANKS:-${SLURM_NTASKS:-1}}" --limit "${LIMIT:-3600}" --steps 64 128 256 --reference 512 --periods 200 \
    --real-modes 50 100 200 --reduced 20 60 --residuals 1e-2 1e-4 --contact 1e-2 1e-4 1e-6 \
    --direct 64 -- --set modes.method=full "$@" || { echo "$group: exit code $?"; failed=1; }
done
[ "$failed" = 0 ]
