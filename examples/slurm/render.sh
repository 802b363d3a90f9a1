#!/usr/bin/env bash
# A Slurm array renders a sequence: with N tasks, each renders every Nth frame. docs/farms.md explains it.
#
#   sbatch --array=0-7 examples/slurm/render.sh SCENE FIRST LAST [OPTION OF `splatblur render`]...
#
#SBATCH --job-name=splatblur
#SBATCH --output=splatblur-%A_%a.log
#SBATCH --open-mode=append
#SBATCH --requeue
#SBATCH --cpus-per-task=1
set -u

if [ $# -lt 3 ] || [ -z "${SLURM_ARRAY_TASK_COUNT:-}" ]; then
    echo 'render.sh: sbatch --array=0-7 render.sh SCENE FIRST LAST [OPTION]...' >&2
    exit 2
fi
scene=$1 first=$2 last=$3
shift 3
first=$((first + SLURM_ARRAY_TASK_ID - SLURM_ARRAY_TASK_MIN))
if [ "$first" -gt "$last" ]; then
    echo 'There are more tasks than frames: nothing to do here.'
    exit
fi

# The CPU everywhere, because the two backends differ by rounding.
splatblur render "$scene" --frames "$first..${last}x$SLURM_ARRAY_TASK_COUNT" --resume \
    --backend cpu --threads "${SLURM_CPUS_PER_TASK:-1}" "$@"
status=$?

# Above 128 a signal ended the program: its frames so far are good, and --resume goes on. Status 2 is an error in the
# scene or the options, which would come again.
if [ "$status" -gt 128 ] && [ "${SLURM_RESTART_COUNT:-0}" -lt 3 ]; then
    echo "Status $status: back into the queue."
    scontrol requeue "$SLURM_JOB_ID"
fi
exit "$status"
