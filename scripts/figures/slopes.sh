#!/usr/bin/env bash
# Bias and variance against iterations on a field in closed form: the memoryless rule beside its finite sums, CPPM whose test always rejects. Draws docs/slopes.svg.
# About five minutes; ITERATIONS (4096) and SEEDS (8) shorten it.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
cargo bench --locked --quiet --bench slopes -- "${ITERATIONS:-4096}" "${SEEDS:-8}" "$PWD/docs/slopes.svg" 2>/dev/null |
    while read -r line; do printf '%s\n' "$line" | python3 scripts/figures/_store.py slopes; done
python3 scripts/figures/_slopes.py
