#!/usr/bin/env bash
# Writes the files generated from the program's definitions: options and layers for the add-on and the USD converter,
# stubs and docstrings of the Python package, and lists in the documentation. Tests check that they are up to date.

set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

export CAUSTIQUE_WRITE=1
cargo test --quiet --release --workspace --test generated
cargo test --quiet --release --workspace --test cli generated::
