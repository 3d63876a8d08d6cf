#!/usr/bin/env bash
# Renders a picture, or the frames of an animation, on a Slurm cluster: for each picture an array of jobs, one a shard,
# and a job that merges them when all are done.
#
#   scripts/farm/slurm.sh SCENE -o OUT.exr --shards N [--frames A-B[,STEP]] [--cores C] [--wait]
#                         [options of caustique render] [-- options of caustique merge]
#
#   scripts/farm/slurm.sh scenes/pool.glb -o out/pool.exr --shards 16 --iterations 256 -- --png out/pool.png
#
# --cores C     cores of a job (1)
# --retries R   times that a shard that fails or is killed is queued again (3)
# --wait        wait for the pictures; fails where one is not made
# --dry-run     print what would be submitted
#
# Scene, output and program have to be where all nodes see them. The same command again goes on from what is there.
# Slurm's own options go through its variables (SBATCH_PARTITION, SBATCH_TIMELIMIT, SBATCH_ACCOUNT ...).

set -euo pipefail

# shellcheck source=scripts/farm/names.sh
. "$(dirname "${BASH_SOURCE[0]}")/names.sh"

farm=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
scene='' out='' shards='' frames='' cores=1 retries=3 wait='' dry='' render=() merge=()
while [ $# -gt 0 ]; do
    case $1 in
    -o | --output) out=${2:-} && shift ;;
    --shards) shards=${2:-} && shift ;;
    --frames) frames=${2:-} && shift ;;
    --cores) cores=${2:-} && shift ;;
    --retries) retries=${2:-} && shift ;;
    --wait) wait=1 ;;
    --dry-run) dry=1 ;;
    --) merge=("${@:2}") && break ;;
    --shard | --resume | --checkpoint | --threads) fail "$1 is given by the farm" 'see the head of this script' ;;
    --png | --exposure | --tonemap | --preview | --layers) fail "$1: no shard is a picture" "give what the merge is to do behind --" ;;
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
    mapfile -t numbers < <(seq "${range%-*}" "$step" "${range#*-}")
else
    numbers=('')
fi
# A shard alone is the picture.
[ "$shards" -gt 1 ] || render+=("${merge[@]}")
scene=$(realpath "$scene")
out=$(realpath -m "$out")
mkdir -p "$(dirname "$out")"

# submit OPTIONS... : a job of the script on stdin; prints its number
submit() {
    if [ -n "$dry" ]; then
        { printf '# sbatch %s\n' "$*" && cat; } >&2
        echo 0
    else
        sbatch --parsable --export=ALL --cpus-per-task="$cores" --open-mode=append "$@" | cut -d';' -f1
    fi
}

# words ARGUMENTS... : as a shell reads them
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
    # A job that fails queues itself again: --requeue alone does so only for nodes that fail and jobs that give way.
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
    # Not afterok: that of an array minds a try that was killed even where the next one ends well (Slurm 22.05). A merge
    # whose shards are not all there fails, and its log names them.
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
    # A job that waits for all merges is the one that is waited for.
    ids=$(IFS=: && echo "${merges[*]}")
    sbatch --parsable --wait --dependency="afterok:$ids" --kill-on-invalid-dep=yes --output=/dev/null --job-name=wait \
        --wrap=true >/dev/null || fail 'not all pictures are made' "the logs in $(shards_of "$out") say why"
fi
