#!/usr/bin/env bash
# What effects cost scenes that do not call for them: core-seconds of an iteration of the whole program over those of one built without alpha, media, dispersion,
# textures and lenses, either of them linked in LAYOUTS (12) orders of its functions. The pictures must be the same.
#
# ROUNDS (4) of every order and WIDTH (320) shorten a trial.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
export LAYOUTS=${LAYOUTS:-12}
build() {
    cargo rustc --release --bin caustique --target-dir "target/$1" "${@:2}" -- -C "linker=$PWD/scripts/figures/_layouts.sh"
}
build layouts
build layouts-bare --features bare
python3 scripts/figures/_bare.py
