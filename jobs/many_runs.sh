#!/usr/bin/env bash
#SBATCH --job-name=squeal-many
#SBATCH --ntasks=2
#SBATCH --mem-per-cpu=3G
#SBATCH --time=04:00:00
#SBATCH --signal=B:USR1@60
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --output=%x-%j.txt
# One number of a scene at many values: runs of one rank, as many side by side as the allocation has tasks. A table of what
# is heard at each value, and a chart of the runs done against time. Runs that are done stay done.
# Knobs: SCENE, KEY, VALUES (list), SIDE (runs side by side), OUTPUT, and any further arguments for squeal.
set -eu
# Where squeal is: SQUEAL_ROOT, or the folder above this script, of which Slurm runs a copy.
script=$0
[ -z "${SLURM_JOB_ID:-}" ] || script=$(scontrol show job "$SLURM_JOB_ID" | sed -n 's/^ *Command=\([^ ]*\).*/\1/p' | head -1)
root=${SQUEAL_ROOT:-$(dirname "$(realpath "$script")")/..}
. "$root/jobs/common"
output=${OUTPUT:-results/many_runs}
values=(${VALUES:-0.1 0.15 0.2 0.25 0.3 0.35 0.4 0.45})
whole_numbers SIDE "${SIDE:-1}"
mkdir -p "$output"

# one_run HOST VALUE: on one rank of that host. Its start and its end go to times.txt.
one_run() {
  local folder=$output/value_$2 start
  local arguments=("${SCENE:-inputs/pin_on_disc/scene.toml}" --set "${KEY:-friction.coefficient}=$2" "${@:3}")
  ! is_done "$folder" "${arguments[@]}" || return 0
  start=$(date +%s.%N)
  RANKS=1 LAUNCH="mpirun --bind-to none --host $1" squeal_run "$folder" "${arguments[@]}" >"$folder.txt" 2>&1
  ! is_done "$folder" "${arguments[@]}" || echo "$2 $start $(date +%s.%N)" >>"$output/times.txt"
  [ "$failed" = 0 ] || echo "$folder.txt: $(grep -m1 'error:' "$folder.txt" || echo 'see there')" >&2
}

side_by_side one_run "${values[@]}" -- "$@"
finish
python3 jobs/scaling.py many "$output" "${values[@]}"
