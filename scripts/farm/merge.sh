#!/usr/bin/env bash
# Merges the shards that shard.sh has rendered to the picture, and removes them once all of them are in it.
#
#   scripts/farm/merge.sh OUT.exr [--frame F] [options of caustique merge]
#
# CAUSTIQUE_BIN is the program. The exit code is the program's. All shards are kept if it fails, if it writes no new
# OUT.exr, and with --partial while shards are missing.

set -euo pipefail

# shellcheck source=scripts/farm/names.sh
. "$(dirname "${BASH_SOURCE[0]}")/names.sh"

[ $# -ge 1 ] || fail 'no output is named' 'merge.sh OUT.exr [--frame F] [options]'
out=$1
shift
if [ "${1:-}" = --frame ]; then
    out=$(numbered "$out" "$2")
    frame=$2
    shift 2
    # The PNG's name also gets the frame's number.
    for argument; do
        set -- "${@:2}" "$(numbered "$argument" "$frame")"
    done
fi
folder=$(shards_of "$out")
# Nothing to do if an earlier merge removed the shards, or if a single shard is the picture.
[ -d "$folder" ] || [ ! -s "$out" ] || exit 0
[ -e "$folder/render" ] || fail "$folder: there are no shards" 'shard.sh renders them'
shards=("$folder"/shard-*.exr)
# The second word of the recorded arguments, see shard.sh. Without -r, quoted spaces stay within their word.
# shellcheck disable=SC2162
read _ count _ <"$folder/render"
# A picture that is replaced has another number.
identity() { stat -c '%d %i %y' "$out" 2>/dev/null || true; }
before=$(identity)
"$CAUSTIQUE" merge "${shards[@]}" -o "$out" --layers all "$@"
if [ "$(identity)" = "$before" ]; then
    echo "$out is not written: the shards are kept in $folder" >&2
elif [ "${#shards[@]}" -lt "$count" ]; then
    echo "${#shards[@]} of $count shards are merged, and are kept in $folder" >&2
else
    rm -r "$folder"
fi
