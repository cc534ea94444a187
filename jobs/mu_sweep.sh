#!/usr/bin/env bash
#SBATCH --job-name=squeal-mu
#SBATCH --nodes=1
#SBATCH --ntasks=2
#SBATCH --mem-per-cpu=1500M
#SBATCH --time=02:00:00
#SBATCH --signal=B:USR1@60
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --output=%x-%j.txt
# Unstable modes of a scene against the friction coefficient: one run of equilibrium and modes a value. Values that are done
# stay done, and the job fails if any of its runs has an error. As an array (--array=1-8), each task takes one value.
# Knobs: SCENE, MU (list), RANKS, LAUNCH (mpirun, or "srun --mpi=pmix"), OUTPUT, and any further arguments for squeal.
set -eu
# Where squeal is: SQUEAL_ROOT, or the folder above this script, of which Slurm runs a copy.
script=$0
[ -z "${SLURM_JOB_ID:-}" ] || script=$(scontrol show job "$SLURM_JOB_ID" | sed -n 's/^ *Command=\([^ ]*\).*/\1/p' | head -1)
root=${SQUEAL_ROOT:-$(dirname "$(realpath "$script")")/..}
. "$root/jobs/common"
scene=${SCENE:-inputs/tgv/scene.toml}
output=${OUTPUT:-results/mu_sweep}
all=(${MU:-0 0.05 0.1 0.15 0.2 0.25 0.3 0.4})
values=("${all[@]}")
[ -z "${SLURM_ARRAY_TASK_ID:-}" ] || values=("${all[SLURM_ARRAY_TASK_ID - 1]}")
for mu in "${values[@]}"; do
  squeal_run "$output/mu_$mu" "$scene" --set friction.coefficient="$mu" --set transient.enabled=false \
    --set cycle.enabled=false "$@"
done
finish
python3 - "$output" "${values[@]}" <<'TABLE'
import json, sys
print(f"{'mu':>6} {'unstable':>8} {'frequency [Hz]':>15} {'growth [1/s]':>13} {'backward error':>15}")
for mu in sys.argv[2:]:
    modes = json.load(open(f"{sys.argv[1]}/mu_{mu}/report.json"))["modes"]
    for mode in modes.get("modes", [])[: max(1, modes.get("unstable_count", 0))]:
        print(f"{mu:>6} {modes['unstable_count']:>8} {mode['frequency_hz']:15.3f} {mode['growth_rate']:13.4f} {mode['backward_error']:15.1e}")
TABLE
