#!/usr/bin/env bash
# Reads the damaged images of OpenEXR's own tests, each as a picture and as an environment: every one has to be read, or
# refused with a message (exit code 1), within 20 s and 4 GiB. They come from Debian's source package of openexr
# (BSD-3-Clause), which is fetched; a folder of other files can be given in its place:
#     tests/bad-files.sh [FOLDER]
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
program=$(realpath "${CAUSTIQUE_BIN:-target/release/caustique}")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

folder=${1:-}
if [ -z "$folder" ]; then
    . /etc/os-release
    printf 'Types: deb-src\nURIs: http://deb.debian.org/debian\nSuites: %s\nComponents: main\nSigned-By: %s\n' \
        "$VERSION_CODENAME" /usr/share/keyrings/debian-archive-keyring.gpg >"$work/debian.sources"
    mkdir -p "$work/lists/partial"
    apt=(apt-get -qq -o "Dir::Etc::sourcelist=$work/debian.sources" -o Dir::Etc::sourceparts=/dev/null
        -o "Dir::State::lists=$work/lists")
    "${apt[@]}" update
    (cd "$work" && "${apt[@]}" source --download-only openexr 2>/dev/null && tar xf openexr_*.orig.tar.*)
    folder=$work
fi

read=0 refused=0 bad=0
# once FILE ARGUMENT...: one run of the program
once() {
    local file=$1 status=0
    shift
    (ulimit -v $((4 << 20)) && timeout 20 "$program" "$@") >/dev/null 2>"$work/said" || status=$?
    case $status in
        0) read=$((read + 1)) ;;
        1)
            refused=$((refused + 1))
            grep -m 1 "$(basename "$file")" "$work/said" | sed "s|$work/||" ||
                { bad=$((bad + 1)) && printf 'FAULT %s: the message does not name it\n' "$file"; }
            ;;
        *) bad=$((bad + 1)) && printf 'FAULT %s: exit code %d of %s\n' "$file" "$status" "$1" ;;
    esac
}
while IFS= read -r -d '' file; do
    once "$file" info "$file"
    once "$file" render scenes/cornell.glb --env "$file" -o "$work/out.exr" --width 8 --iterations 1 --no-combine
done < <(find "$folder" -type f \( -name '*.exr' -o -path '*/Damaged/*' \) -print0 | sort -z)
printf '%d read, %d refused, %d faults\n' "$read" "$refused" "$bad"
[ $((read + refused)) -gt 0 ] && [ "$bad" -eq 0 ]
