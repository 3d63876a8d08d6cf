#!/usr/bin/env bash
# Installs what is missing, builds, renders a scene and combines its levels into out/demo.exr and out/demo.png.
# Arguments go to `caustique render` and win over the settings here: scripts/demo.sh --width 1280 --iterations 256

set -euo pipefail

SCENE=${CAUSTIQUE_DEMO_SCENE:-scenes/pool.glb}

# shellcheck source=scripts/setup.sh
. "$(dirname "${BASH_SOURCE[0]}")/setup.sh"
setup render
cd "$ROOT"

cargo build --release --bin caustique
PROGRAM=${CARGO_TARGET_DIR:-target}/release/caustique

# given OPTION... -- ARGUMENT...: whether one of the options is among the arguments
given() {
    local options=() option argument
    while [ "$1" != -- ]; do
        options+=("$1")
        shift
    done
    shift
    for argument in "$@"; do
        for option in "${options[@]}"; do
            case $argument in "$option" | "$option"=*) return 0 ;; esac
        done
    done
    return 1
}

# A minute or so on two cores; the time limit holds slower machines to two.
settings=()
given --width --height -- "$@" || settings+=(--width 640)
given --iterations --time --target-error -- "$@" || settings+=(--iterations 128 --time 100)
given -o --output -- "$@" || settings+=(-o out/demo.exr)
given --png -- "$@" || settings+=(--png out/demo.png)

mkdir -p out
printf '%s render %s' "$PROGRAM" "$SCENE"
printf ' %s' "${settings[@]}" "$@"
printf '\n'
"$PROGRAM" render "$SCENE" "${settings[@]}" "$@"

for file in out/demo.png out/demo.exr; do
    if [ "$file" -nt "$PROGRAM" ]; then
        printf '%s\n' "$ROOT/$file"
    fi
done
