# shellcheck shell=bash
# Common functions of the farm scripts: the program, and names of files. To be sourced.

CAUSTIQUE=${CAUSTIQUE_BIN:-$(dirname "${BASH_SOURCE[0]}")/../../target/release/caustique}
[ -x "$CAUSTIQUE" ] || CAUSTIQUE=caustique

# fail FAULT HINT
fail() {
    printf '%s: error: %s\nhint: %s\n' "$(basename "$0")" "$1" "$2" >&2
    exit 2
}

# numbered NAME FRAME: the name with the frame's number in place of a run of '#', padded to the length of the run
numbered() {
    local folder= name=$1
    [[ $name != */* ]] || folder=${name%/*}/ name=${name##*/}
    if [[ $name =~ ^([^#]*)(#+)(.*)$ ]]; then
        printf '%s%s%0*d%s\n' "$folder" "${BASH_REMATCH[1]}" "${#BASH_REMATCH[2]}" "$2" "${BASH_REMATCH[3]}"
    else
        printf '%s\n' "$1"
    fi
}

# shards_of OUT.exr: the folder of its shards
shards_of() { printf '%s.shards\n' "${1%.exr}"; }
