#!/usr/bin/env bash
# Range queries: our tree against a hash grid and a kd-tree, clustered photons and widely spread bandwidths.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
cargo bench --locked --quiet --bench photons 2>/dev/null | tee /dev/stderr | awk 'NR > 2 { printf "{\"scene\": \"%s\", \"spread\": %s, \"tree_us\": %s, \"grid_us\": %s, \"kd_us\": %s}\n", $1, $2, $4, $5, $6 }' |
    while read -r line; do printf '%s\n' "$line" | python3 scripts/figures/_store.py photon-structure; done
