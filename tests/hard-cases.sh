#!/usr/bin/env bash
# Renders every hard case small with every method that it concerns, checks it against its answer, and writes a page of
# pictures and verdicts, out/hard/index.html. See docs/lab/hard-cases.md.
#
#   tests/hard-cases.sh                   the short form
#   tests/hard-cases.sh --long            the cases that take long as well
#   tests/hard-cases.sh --only NAME...    cases whose names begin so; --list prints all
#   tests/hard-cases.sh --with LIST       other renderers as well: mitsuba,luxcore,luxcore-vm,cycles
#   tests/hard-cases.sh --scenes -o DIR   the scenes and their answers alone, for other renderers
#
# CAUSTIQUE_BIN names a program to take instead of building one.

set -euo pipefail

# shellcheck source=scripts/setup.sh
. "$(dirname "${BASH_SOURCE[0]}")/../scripts/setup.sh"

setup python
if [ -z "${CAUSTIQUE_BIN:-}" ]; then
    (cd "$ROOT" && cargo build --locked --release --quiet)
    CAUSTIQUE_BIN=$(realpath -m "${CARGO_TARGET_DIR:-$ROOT/target}/release/caustique")
fi
for option in "$@"; do
    case $option in --with | --with=*) "$ROOT/scripts/compare/setup.sh" peers ;; esac
done
export PYTHONPATH=$ROOT:$MODULES
exec "$ROOT/.venv/bin/python" -m tests.hard --program "$CAUSTIQUE_BIN" "$@"
