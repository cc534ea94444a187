#!/usr/bin/env bash
#SBATCH --job-name=squeal-strong
#SBATCH --ntasks=2
#SBATCH --mem-per-cpu=3G
#SBATCH --time=04:00:00
#SBATCH --signal=B:USR1@60
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --output=%x-%j.txt
# One scene on 1, 2, 4 … ranks, up to those of the allocation: seconds, efficiency and memory of each stage, as a table
# and a chart. Runs that are done stay done.
# Knobs: SCENE, COUNTS (of ranks), LAUNCH (mpirun, or "srun --mpi=pmix"), OUTPUT, and any further arguments for squeal.
set -eu
# Where squeal is: SQUEAL_ROOT, or the folder above this script, of which Slurm runs a copy.
script=$0
[ -z "${SLURM_JOB_ID:-}" ] || script=$(scontrol show job "$SLURM_JOB_ID" | sed -n 's/^ *Command=\([^ ]*\).*/\1/p' | head -1)
root=${SQUEAL_ROOT:-$(dirname "$(realpath "$script")")/..}
. "$root/jobs/common"
output=${OUTPUT:-results/strong_scaling}
counts=(${COUNTS:-$(rank_counts)})
whole_numbers COUNTS "${counts[@]}"
for ranks in "${counts[@]}"; do
  RANKS=$ranks squeal_run "$output/ranks_$ranks" "${SCENE:-inputs/tgv/scene.toml}" "$@"
done
finish
python3 jobs/scaling.py strong "$output" "${counts[@]}"
