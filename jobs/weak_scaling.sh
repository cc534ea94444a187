#!/usr/bin/env bash
#SBATCH --job-name=squeal-weak
#SBATCH --ntasks=2
#SBATCH --mem-per-cpu=3G
#SBATCH --time=04:00:00
#SBATCH --signal=B:USR1@60
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --output=%x-%j.txt
# A model that grows with the number of ranks: its number KEY is PER_RANK times the ranks. Seconds, efficiency and memory
# of each stage for the degrees of freedom that came of it, as a table and a chart. Runs that are done stay done.
# Knobs: SCENE, KEY, PER_RANK, COUNTS (of ranks), LAUNCH, OUTPUT, and any further arguments for squeal.
set -eu
# Where squeal is: SQUEAL_ROOT, or the folder above this script, of which Slurm runs a copy.
script=$0
[ -z "${SLURM_JOB_ID:-}" ] || script=$(scontrol show job "$SLURM_JOB_ID" | sed -n 's/^ *Command=\([^ ]*\).*/\1/p' | head -1)
root=${SQUEAL_ROOT:-$(dirname "$(realpath "$script")")/..}
. "$root/jobs/common"
output=${OUTPUT:-results/weak_scaling}
counts=(${COUNTS:-$(rank_counts)})
whole_numbers COUNTS "${counts[@]}"
per_rank=${PER_RANK:-16000}
whole_numbers PER_RANK "$per_rank"
for ranks in "${counts[@]}"; do
  RANKS=$ranks squeal_run "$output/ranks_$ranks" "${SCENE:-inputs/tgv/scene.toml}" \
    --set "${KEY:-mesh.parameters.size}=$((ranks * per_rank))" "$@"
done
finish
python3 jobs/scaling.py weak "$output" "${counts[@]}"
