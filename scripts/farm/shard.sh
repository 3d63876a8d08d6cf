#!/usr/bin/env bash
# Renders one shard of a picture, or goes on with it: what every farm runs as a task.
#
#   scripts/farm/shard.sh SCENE OUT.exr I/N [--frame F] [options of caustique render]
#
# The shard is out/pool.shards/shard-I.exr where the picture is to be out/pool.exr, once it is whole; its checkpoint lies
# beside it until then. A task that is run again goes on from the checkpoint, and does nothing where the shard is whole.
# A shard alone, 0/1, is the finished picture out/pool.exr, and may have the options of the merge that it does without.
# CAUSTIQUE_BIN is the program. Exit codes are the program's.

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

# All tasks of a folder belong to one render. The first one says which; `ln` has one winner.
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
    echo "shard $shard goes on from $part.checkpoint" >&2
fi

# The picture of a shard alone is not looked at: few layers halve what is written, and the sums behind it are whole.
layers=(--layers beauty)
[ "$count" -gt 1 ] || layers=()
# Where this shell is killed, the render is as well: its farm starts another.
setpriv --pdeathsig KILL "$CAUSTIQUE" render "$scene" -o "$part" --shard "$shard" "${layers[@]}" "${resume[@]}" "$@" &
child=$!
trap 'kill -TERM "$child" 2>/dev/null || true' TERM INT
status=0
wait "$child" || status=$?
# A signal ends `wait` before the render has written what there is.
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
