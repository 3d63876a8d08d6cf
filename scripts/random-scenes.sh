#!/usr/bin/env bash
# Checks random scenes of new seeds for hours, on the lowest priority; see docs/hard-cases.md. A run goes on where the
# last one ended.
#
#   scripts/random-scenes.sh --hours 4             into out/random: state.json, and a folder for each failure
#   scripts/random-scenes.sh --replay FOLDER/smallest.json
#                                                  checks a saved scene again
#
# RAYON_NUM_THREADS limits its threads.

set -euo pipefail

# shellcheck source=scripts/setup.sh
. "$(dirname "${BASH_SOURCE[0]}")/setup.sh"

setup render
cd "$ROOT"
renice -n 19 $$ >/dev/null
exec cargo bench --quiet --bench random-scenes -- "$@"
