#!/usr/bin/env bash
# Rays against bare Embree, the photon map, EXR writing: ratios in one run.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
out=$(cargo bench --locked --quiet --bench spine 2>/dev/null)
printf '%s\n' "$out" | sed '$d'
printf '%s\n' "$out" | tail -n 1 | python3 scripts/figures/_store.py spine
