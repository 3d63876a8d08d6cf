#!/usr/bin/env bash
# The chi-squared rule on its own: the size of its test by the number of photons, repeated looks at uniform light, and what it costs in time and memory.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
out=$(cargo bench --locked --quiet --bench cppm 2>/dev/null)
printf '%s\n' "$out" | sed '$d'
printf '%s\n' "$out" | tail -n 1 | python3 scripts/figures/_store.py cppm-rule
