#!/bin/sh
#SBATCH --job-name=posegrid
#SBATCH --ntasks=1
#SBATCH --cpus-per-task=1
#SBATCH --mem=2G
#SBATCH --requeue
# The tasks of a pipeline file as an array of jobs, one for each line of a list:
#
#     posegrid tasks fleet.toml > tasks.jsonl
#     sbatch --array=1-$(wc -l < tasks.jsonl)%200 pipelines/fleet/slurm.sh fleet.toml tasks.jsonl
#
# A task that a fault ended is put back into the queue, up to six times; a lost node's jobs are by Slurm itself. How a task ended is a
# line of JSON in its job's output. POSEGRID names the program where it is not on the path.
set -eu
[ $# -eq 2 ] || {
    echo "usage: sbatch --array=1-N $0 PIPELINE TASKS" >&2
    exit 2
}
code=0
sed -n "${SLURM_ARRAY_TASK_ID}p" "$2" | "${POSEGRID:-posegrid}" task "$1" || code=$?
if [ "$code" = 75 ] && [ "${SLURM_RESTART_COUNT:-0}" -lt 6 ]; then
    scontrol requeue "${SLURM_JOB_ID}"
fi
exit "$code"
