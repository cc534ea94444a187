#!/usr/bin/env bash
#SBATCH --job-name=squeal-chart
#SBATCH --ntasks=1
#SBATCH --time=12:00:00
# Accuracy against cost on the brake at 33 224 degrees of freedom, group by group, cheapest first: stop it when you like
# and start it again, what is done stays (tools/chart --help). The picture is drawn as soon as its reference is there.
# Knobs: GROUPS_OF_RUNS (of tools/chart), LIMIT (seconds a run), RANKS, OUTPUT.
set -eu
cd "${SLURM_SUBMIT_DIR:-$(dirname "$0")/..}"
. tools/environment
output=${OUTPUT:-results/chart/tgv_33k}
mkdir -p "$output"
for group in ${GROUPS_OF_RUNS:-auto modes step_64 start growth step full reduced direct seven near far contact}; do
  tools/chart inputs/tgv/scene.toml --runs "$output" --picture "$output/chart.png" --only "$group" \
    --ranks "${RANKS:-${SLURM_NTASKS:-1}}" --limit "${LIMIT:-3600}" --steps 64 128 256 --reference 512 --periods 200 \
    --real-modes 50 100 200 --reduced 20 60 --residuals 1e-2 1e-4 --contact 1e-2 1e-4 1e-6 \
    --direct 64 -- --set modes.method=full "$@" || echo "$group: exit code $?"
done
