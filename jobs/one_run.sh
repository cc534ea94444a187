#!/usr/bin/env bash
#SBATCH --ntasks=64 --cpus-per-task=1 --time=04:00:00 --signal=USR1@60
# sbatch jobs/one_run.sh SCENE: one run on 64 ranks, which goes on where an earlier one was ended.
export OPENBLAS_NUM_THREADS=1
srun --mpi=pmix squeal "${1:?a scene}" --output "results/$(basename "$1" .toml)" --restart "${@:2}"
