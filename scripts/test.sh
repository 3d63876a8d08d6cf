#!/usr/bin/env bash
# Installs what is missing and runs every test that gates a change. Stops at the first part that fails, but always ends
# with the summary; its last line counts the tests: "123 passed, 0 failed". A part that fails without a failed test of
# its own (formatting, a lint, a build) counts as one.

set -euo pipefail

# shellcheck source=scripts/setup.sh
. "$(dirname "${BASH_SOURCE[0]}")/setup.sh"

passed=0
failed=0
summary=()
LOG=

finish() {
    local status=$?
    [ -z "$LOG" ] || rm -f "$LOG"
    # An exit that no part accounts for, in the installation for example.
    if [ "$status" -ne 0 ] && [ "$failed" -eq 0 ]; then
        summary+=("FAILED   before all parts had run")
        failed=1
    fi
    printf '\n'
    [ ${#summary[@]} -eq 0 ] || printf '%s\n' "${summary[@]}"
    printf '%d passed, %d failed\n' "$passed" "$failed"
    [ "$status" -ne 0 ] || [ "$failed" -eq 0 ] || status=1
    exit "$status"
}
trap finish EXIT
trap 'exit 130' INT TERM

# part NAME COMMAND...: runs the command, shows and keeps its output, adds its tests to the counts
part() {
    local name=$1 start=$SECONDS status=0 good bad skipped
    shift
    printf '\n== %s\n' "$name"
    LOG=$(mktemp)
    "$@" 2>&1 | tee "$LOG" || status=$?
    read -r good bad skipped < <(awk -f "$ROOT/tests/test_counts.awk" "$LOG")
    rm -f "$LOG"
    LOG=
    # A test that is skipped tests nothing, and everything it could lack is installed.
    if [ "$skipped" -gt 0 ] && [ "$status" -eq 0 ]; then
        printf '%d tests were skipped or ignored\n' "$skipped"
        status=1
    fi
    [ "$status" -eq 0 ] || [ "$bad" -gt 0 ] || bad=1
    passed=$((passed + good))
    failed=$((failed + bad))
    local verdict=ok
    [ "$bad" -eq 0 ] || verdict=FAILED
    summary+=("$(printf '%-8s %-22s %4d passed, %d failed, %d s' "$verdict" "$name" "$good" "$bad" $((SECONDS - start)))")
    [ "$bad" -eq 0 ] || exit 1
}

# tests PART COMMAND...: a part that must hold at least one test
tests() {
    local before=$passed name=$1
    part "$@"
    if [ "$passed" -eq "$before" ]; then
        summary+=("FAILED   $name: no test ran")
        failed=$((failed + 1))
        exit 1
    fi
}

without() { summary+=("$(printf '%-8s %-22s %s' 'not run' "$1" "$2")"); }

setup test
cd "$ROOT"
CAUSTIQUE_BIN=$(realpath -m "${CARGO_TARGET_DIR:-target}/release/caustique")
export CAUSTIQUE_BIN

if cargo fmt --version >/dev/null 2>&1; then
    part 'cargo fmt' cargo fmt --all --check
else
    without 'cargo fmt' 'rustfmt is not installed: rustup component add rustfmt'
fi
part 'cargo build' cargo build --locked --release --workspace
if cargo clippy --version >/dev/null 2>&1; then
    CLIPPY_CONF_DIR="$ROOT/scripts" part 'cargo clippy' cargo clippy --locked --release --workspace --all-targets -- -D warnings
else
    without 'cargo clippy' 'clippy is not installed: rustup component add clippy'
fi
RUSTDOCFLAGS='-D warnings' part 'cargo doc' cargo doc --locked --release --workspace --no-deps
tests 'cargo test' cargo test --locked --release --workspace --no-fail-fast
tests 'Python' .venv/bin/python -m unittest discover -s tests/python -p 'test_*.py'
# HARD_CASES narrows them, for machines whose time is short: HARD_CASES='--methods vcm'.
# shellcheck disable=SC2086
tests 'Hard cases' tests/hard-cases.sh ${HARD_CASES:-}
part 'Python wheel' scripts/python.sh
tests 'Python package' .venv-python/bin/python -W error::DeprecationWarning -m unittest discover -s tests/python/package
tests 'Python with USD' .venv-usd/bin/python -m unittest discover -s tests/python -p 'usd_*.py'
tests 'Python with Blender' .venv-bpy/bin/python -m unittest discover -s tests/python -p 'blender_*.py'
