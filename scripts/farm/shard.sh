#!/usr/bin/env bash
# Renders one shard of a picture, or continues it. Every farm runs this script as a task.
#
#   scripts/farm/shard.sh SCENE OUT.exr I/N [--frame F] [options of caustique render]
#
# For a picture out/pool.exr the finished shard is out/pool.shards/shard-I.exr, with its checkpoint beside it until
# then. A repeated task continues from the checkpoint, and does nothing if the shard is finished. A single shard, 0/1,
# is the finished picture out/pool.exr, and may have options of the merge, which is not needed.
# CAUSTIQUE_BIN is the program. The exit code is the program's.

set -euo pipefail

# shellcheck source=scripts/farm/names.sh
. "$(dirname "${BASH_SOURCE[0]}")/names.sh"

[ $# -ge 3 ] || fail 'too few arguments' 'shard.sh SCENE OUT.exr I/N [--frame F] [options]'
scene=$1 out=$2 shard=$3
shift 3
if [ "${1:-}" = --frame ]; then
    out=$(numbered "$out" "$2")
    set -- --frames "$2" "${@:3}"
fi
index=${shard%/*} count=${shard#*/} folder=$(shards_of "$out")
part=$folder/part-$index.exr whole=$folder/shard-$index.exr
mkdir -p "$folder"

# All tasks of a folder must belong to one render. The first task records its arguments; `ln` is atomic.
render=$(printf '%q ' "$(sha256sum <"$scene")" "$count" "$@")
draft=$(mktemp "$folder/render.XXXXXX")
printf '%s\n' "$render" >"$draft"
ln "$draft" "$folder/render" 2>/dev/null || true
rm -f "$draft"
[ "$(cat "$folder/render")" = "$render" ] ||
    fail "$folder holds shards of another scene, other options or another number of shards" \
        'remove this folder, or give the same arguments'

[ ! -e "$whole" ] || exit 0
resume=()
if [ -e "$part.checkpoint" ]; then
    resume=(--resume "$part.checkpoint")
    echo "shard $shard continues from $part.checkpoint" >&2
fi

# Nobody views the picture of a shard: fewer layers halve the file, which still contains the complete sums.
layers=(--layers beauty)
[ "$count" -gt 1 ] || layers=()
# If this shell is killed, the render is killed, too: the farm starts another task.
setpriv --pdeathsig KILL "$CAUSTIQUE" render "$scene" -o "$part" --shard "$shard" "${layers[@]}" "${resume[@]}" "$@" &
child=$!
trap 'kill -TERM "$child" 2>/dev/null || true' TERM INT
status=0
wait "$child" || status=$?
# A signal interrupts `wait` before the render has written its checkpoint: wait again.
while kill -0 "$child" 2>/dev/null; do
    status=0
    wait "$child" || status=$?
done
[ "$status" -eq 0 ] || exit "$status"
if [ "$count" -gt 1 ]; then
    mv "$part" "$whole"
else
    mv "$part" "$out"
    rm -r "$folder"
fi
