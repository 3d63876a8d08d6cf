#!/usr/bin/env bash
# Processor seconds of every method: of an iteration, of a million light paths, of a million eye paths.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
out=$(cargo bench --locked --quiet --bench methods 2>/dev/null)
printf '%s\n' "$out" | sed '$d'
printf '%s\n' "$out" | tail -n 1 | python3 scripts/figures/_store.py methods
