#!/usr/bin/env bash
# Merges the shards of a picture that shard.sh has rendered, and removes them.
#
#   scripts/farm/merge.sh OUT.exr [--frame F] [options of caustique merge]
#
# CAUSTIQUE_BIN is the program. Exit codes are the program's; where it fails all shards stay.

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
    # A picture to look at has a number, too.
    for argument; do
        set -- "${@:2}" "$(numbered "$argument" "$frame")"
    done
fi
folder=$(shards_of "$out")
# A merge that is run again after its shards are removed is done, and so is that of a shard alone.
[ -d "$folder" ] || [ ! -s "$out" ] || exit 0
[ -e "$folder/render" ] || fail "$folder: there are no shards" 'shard.sh renders them'
"$CAUSTIQUE" merge "$folder"/shard-*.exr -o "$out" --layers all "$@"
rm -r "$folder"
