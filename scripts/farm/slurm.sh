#!/usr/bin/env bash
# Renders a picture, or the frames of an animation, on a Slurm cluster: for each picture an array of jobs, one per
# shard, and a job that merges the shards afterwards.
#
#   scripts/farm/slurm.sh SCENE -o OUT.exr --shards N [--frames A-B[,STEP]] [--cores C] [--wait]
#                         [options of caustique render] [-- options of caustique merge]
#
#   scripts/farm/slurm.sh scenes/pool.glb -o out/pool.exr --shards 16 --iterations 256 -- --png out/pool.png
#
# --cores C     cores per job (1)
# --retries R   retries of a shard that fails or is killed (3)
# --wait        wait for the pictures; fails if one is missing
# --dry-run     print what would be submitted
#
# All nodes must have access to scene, output and program. Repeating the command continues from the existing shards.
# Slurm's options are set by its variables (SBATCH_PARTITION, SBATCH_TIMELIMIT, SBATCH_ACCOUNT ...).

set -euo pipefail

# shellcheck source=scripts/farm/names.sh
. "$(dirname "${BASH_SOURCE[0]}")/names.sh"

farm=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
scene='' out='' shards='' frames='' cores=1 retries=3 wait='' dry='' render=() merge=()
while [ $# -gt 0 ]; do
    # Also --option=value.
    case ${1%%=*} in
    --shard | --resume | --checkpoint | --threads) fail "$1 is given by the farm" 'see the head of this script' ;;
    --png | --exposure | --tonemap | --contrast | --preview | --layers) fail "$1: no shard is a picture" "give what the merge is to do behind --" ;;
    esac
    case $1 in
    -o | --output) out=${2:-} && shift ;;
    --shards) shards=${2:-} && shift ;;
    --frames) frames=${2:-} && shift ;;
    --cores) cores=${2:-} && shift ;;
    --retries) retries=${2:-} && shift ;;
    --wait) wait=1 ;;
    --dry-run) dry=1 ;;
    --) merge=("${@:2}") && break ;;
    *) if [ -z "$scene" ] && [[ $1 != -* ]]; then scene=$1; else render+=("$1"); fi ;;
    esac
    shift
done
[ -f "$scene" ] || fail "'$scene': no such scene" 'slurm.sh SCENE -o OUT.exr --shards N'
[[ $out == *.exr ]] || fail "'$out' is no name of an EXR" 'slurm.sh SCENE -o OUT.exr --shards N'
for count in "$shards" "$cores"; do
    [[ $count =~ ^[1-9][0-9]*$ ]] || fail "--shards and --cores: '$count' is no count" 'give 1 or more'
done
[[ $retries =~ ^[0-9]+$ ]] || fail "--retries: '$retries' is no count" 'give 0 or more'
[[ $frames =~ ^([0-9]+(-[0-9]+)?(,[1-9][0-9]*)?)?$ ]] || fail "--frames: '$frames'" 'give A-B or A-B,STEP, such as 1-100'
if [ -n "$frames" ]; then
    [[ $out == *\#* ]] || fail "$out: all frames have the same name" "put '####' where the frame's number belongs"
    step=${frames#*,} range=${frames%,*}
    [ "$step" != "$frames" ] || step=1
    [ "${range%-*}" -le "${range#*-}" ] || fail "--frames: '$frames' ends before it begins" 'give A-B, such as 1-100'
    mapfile -t numbers < <(seq "${range%-*}" "$step" "${range#*-}")
else
    numbers=('')
fi
# A single shard is the picture.
[ "$shards" -gt 1 ] || render+=("${merge[@]}")
scene=$(realpath "$scene")
out=$(realpath -m "$out")
mkdir -p "$(dirname "$out")"

# submit OPTIONS... : submits the script on stdin as a job; prints its number
submit() {
    if [ -n "$dry" ]; then
        { printf '# sbatch %s\n' "$*" && cat; } >&2
        echo 0
    else
        sbatch --parsable --export=ALL --cpus-per-task="$cores" --open-mode=append "$@" | cut -d';' -f1
    fi
}

# words ARGUMENTS... : the arguments, quoted for a shell
words() { printf ' %q' "$@"; }

if [ "$CAUSTIQUE" != caustique ]; then
    CAUSTIQUE=$(realpath "$CAUSTIQUE")
fi
merges=()
for number in "${numbers[@]}"; do
    of=()
    [ -z "$number" ] || of=(--frame "$number")
    folder=$(shards_of "$(numbered "$out" "${number:-0}")")
    [ -n "$dry" ] || mkdir -p "$folder"
    # A failed job requeues itself: --requeue does so only for failed nodes and preempted jobs.
    array=$(
        submit --requeue --array="0-$((shards - 1))" --job-name="shard${number:+-$number}" --output="$folder/%a.log" <<END
#!/bin/bash
export CAUSTIQUE_BIN=$(printf %q "$CAUSTIQUE")
$(words "$farm/shard.sh" "$scene" "$out") "\$SLURM_ARRAY_TASK_ID/$shards"$(words "${of[@]}" --threads "$cores" "${render[@]}") &
trap 'kill -TERM \$!' TERM
status=0
wait \$! || status=\$?
wait
if [ \$status -ne 0 ] && [ \$status -ne 2 ] && [ "\${SLURM_RESTART_COUNT:-0}" -lt $retries ]; then
    scontrol requeue "\$SLURM_JOB_ID"
    exec sleep 60
fi
exit \$status
END
    )
    # Not afterok, which for arrays fails after a killed attempt even if the next one succeeds (Slurm 22.05). A merge
    # with missing shards fails, and its log names them.
    merged=$(
        submit --requeue --dependency="afterany:$array" --job-name="merge${number:+-$number}" \
            --output="$folder/merge.log" <<END
#!/bin/bash
export CAUSTIQUE_BIN=$(printf %q "$CAUSTIQUE")
exec$(words "$farm/merge.sh" "$out" "${of[@]}" --threads "$cores" "${merge[@]}")
END
    )
    echo "${number:+frame $number: }shards $array, merge $merged"
    merges+=("$merged")
done
if [ -n "$wait" ] && [ -z "$dry" ]; then
    # Wait for an additional job that depends on all merges.
    ids=$(IFS=: && echo "${merges[*]}")
    sbatch --parsable --wait --dependency="afterok:$ids" --kill-on-invalid-dep=yes --output=/dev/null --job-name=wait \
        --wrap=true >/dev/null || fail 'not all pictures are made' "the logs in $(shards_of "$out") say why"
fi
