#!/usr/bin/env bash
# Installs missing dependencies, builds the program, and renders a scene to out/demo.exr and out/demo.png.
# Arguments are passed to `caustique render` and override the settings below:
#     scripts/demo.sh --width 1280 --iterations 256

set -euo pipefail

SCENE=${CAUSTIQUE_DEMO_SCENE:-scenes/pool.glb}

# shellcheck source=scripts/setup.sh
. "$(dirname "${BASH_SOURCE[0]}")/setup.sh"
setup render
cd "$ROOT"

cargo build --locked --release --bin caustique
PROGRAM=${CARGO_TARGET_DIR:-target}/release/caustique

# The render takes about a minute on two cores; the time limit is two minutes. The last of repeated options is used.
settings=(-o out/demo.exr --png out/demo.png)
[[ " $*" =~ ' --height' ]] || settings+=(--width 640)
[[ " $*" =~ ' --'(iterations|time|target-error) ]] || settings+=(--iterations 128 --time 100)

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
