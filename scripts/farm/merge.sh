#!/usr/bin/env bash
# Merges the shards that shard.sh has rendered to the picture, and removes them.
#
#   scripts/farm/merge.sh OUT.exr [--frame F] [options of caustique merge]
#
# CAUSTIQUE_BIN is the program. The exit code is the program's; if it fails, all shards are kept.

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
"$CAUSTIQUE" merge "$folder"/shard-*.exr -o "$out" --layers all "$@"
rm -r "$folder"
