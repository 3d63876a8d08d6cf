#!/usr/bin/env bash
# Measures a figure of scripts/lab, prints it, and stores it in scripts/lab/results.jsonl with commit and machine.
#
#   scripts/lab.sh --list                  all figures
#   scripts/lab.sh FIGURE --help           the arguments of one
#   scripts/lab.sh FIGURE [ARGUMENTS]
#
# CAUSTIQUE_BIN names a program to measure instead of building one.

set -euo pipefail

# shellcheck source=scripts/setup.sh
. "$(dirname "${BASH_SOURCE[0]}")/setup.sh"

export PYTHONPATH=$ROOT/scripts:$ROOT:$MODULES
case "$*" in
'' | --list | *--help)
    need_python
    exec "$PYTHON" -m lab "$@"
    ;;
esac
setup python
case $1 in
compare) "$ROOT/scripts/compare/setup.sh" ;;
calibration) [ -x "$ROOT/.venv-python/bin/python" ] || setup wheel ;;
torture | training_data) setup test ;;
training) setup train ;;
esac
cd "$ROOT"
if [ -z "${CAUSTIQUE_BIN:-}" ]; then
    cargo build --locked --release
    CAUSTIQUE_BIN=$(realpath "${CARGO_TARGET_DIR:-target}/release/caustique")
    export CAUSTIQUE_BIN
fi
exec "$ROOT/.venv/bin/python" -m lab "$@"
