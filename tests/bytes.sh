#!/usr/bin/env bash
# Prints the checksum of a fixed set of small renders (every scene, every method) and of plans: the same list before and
# after a change that is to change nothing. One argument, the program; the default is the release build.
#     tests/bytes.sh > before.txt; ...; tests/bytes.sh | diff before.txt -
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
program=$(realpath "${1:-${CARGO_TARGET_DIR:-target}/release/caustique}")
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

one() { # SCENE METHOD OPTIONS...
    local scene=$1 method=$2
    shift 2
    if "$program" render "$scene" -o "$folder/x.exr" --method "$method" --iterations 3 --width 48 --reproducible \
        --seed 7 "$@" 2>"$folder/said"; then
        printf '%s  %s %s %s\n' "$(sha256sum <"$folder/x.exr" | cut -c1-16)" "$scene" "$method" "$*"
    else
        printf '%-16s  %s %s %s: %s\n' refused "$scene" "$method" "$*" "$(grep -m 1 -v '^warning\|^reading' "$folder/said")"
    fi
}

methods=$(python3 -c "import json; print(*(method['name'] for method in json.load(open('tests/methods.json'))))")
for scene in scenes/*.glb; do
    for method in $methods; do
        one "$scene" "$method" --no-combine
    done
    printf '%s  %s plan\n' "$("$program" plan "$scene" --json 2>/dev/null | sha256sum | cut -c1-16)" "$scene"
done
one scenes/torus.glb sppm --no-combine --radius-rule local
one scenes/torus.glb cppm --no-combine --cppm-plus
one scenes/prism.glb vcm --no-combine --shard 1/3
one scenes/pool.glb sppm
one scenes/pool.glb vcm
