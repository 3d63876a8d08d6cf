#!/usr/bin/env bash
# What effects cost scenes that do not call for them: core-seconds of an iteration of the whole program over those of one built without alpha, media, dispersion,
# textures and lenses. The pictures must be the same.
#
# CAUSTIQUE_BIN is the whole program; BARE_BIN the other one, built here if it is not given. ROUNDS (8) and WIDTH (320) shorten a trial.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
if [ -z "${BARE_BIN:-}" ]; then
    cargo build --release --features bare --bin caustique --target-dir target/bare
    BARE_BIN=target/bare/release/caustique
fi
BARE_BIN=$BARE_BIN python3 scripts/figures/_bare.py
