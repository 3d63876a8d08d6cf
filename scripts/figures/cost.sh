#!/usr/bin/env bash
# What `--method auto` takes an iteration to cost beside what it costs, by scene and way to render.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
out=$(cargo bench --locked --quiet --bench cost -- scenes/*.glb width=320 2>/dev/null)
printf '%s\n' "$out" | sed '$d'
printf '%s\n' "$out" | tail -n 1 | python3 scripts/figures/_store.py counted-cost
