#!/usr/bin/env bash
# Core-seconds of one iteration with five levels on the interior scene, by phase, and what levels and the second eye path add.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
out=$(cargo bench --locked --quiet --bench iteration -- scenes/interior.glb 1280 "${ROUNDS:-3}" 2>/dev/null)
printf '%s\n' "$out" | sed '$d'
printf '%s\n' "$out" | tail -n 1 | python3 scripts/figures/_store.py interior-iteration
