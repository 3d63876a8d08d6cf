#!/usr/bin/env bash
# Installs missing dependencies and runs the tests. Stops at the first failing part, then prints the slowest tests and a
# summary; the last line counts the tests: "123 passed, 0 failed". A part that fails without a failed test (formatting,
# a lint, a build) counts as one.
#
#   scripts/test.sh                     the tests that every change must pass
#   scripts/test.sh --long              everything: also the tests marked long, and the hard cases by all methods
#   scripts/test.sh --long-within 1300  also the tests marked long, if the others took fewer seconds than that

set -euo pipefail

# shellcheck source=scripts/setup.sh
. "$(dirname "${BASH_SOURCE[0]}")/setup.sh"

long_within=0
hard_cases=(--methods vcm)
case "$*" in
    '') ;;
    --long) long_within=1000000 hard_cases=() ;;
    '--long-within '[0-9]*) long_within=$2 ;;
    *) fail "unknown arguments: $*" "scripts/test.sh takes --long, --long-within SECONDS, or nothing" ;;
esac

passed=0
failed=0
summary=()
LOG=
TIMES=$(mktemp)

finish() {
    local status=$?
    if [ -s "$TIMES" ]; then
        printf '\nslowest tests, in seconds\n'
        sort -rn "$TIMES" | sed -n 1,20p
    fi
    rm -f "$TIMES" ${LOG:+"$LOG"}
    # An exit outside of the parts, during installation for example.
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

# part NAME COMMAND...: runs the command, shows its output, and adds its tests to the counts
part() {
    local name=$1 start=$SECONDS status=0 good bad skipped
    shift
    printf '\n== %s\n' "$name"
    LOG=$(mktemp)
    "$@" 2>&1 | tee "$LOG" || status=$?
    read -r good bad skipped < <(awk -f "$ROOT/tests/test_counts.awk" "$LOG")
    awk -f "$ROOT/tests/test_times.awk" "$LOG" >>"$TIMES"
    rm -f "$LOG"
    LOG=
    # Skipped tests are errors, because everything that they need is installed.
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

# tests PART COMMAND...: a part that must run at least one test
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
# Test programs of stable Rust print the time of each test only if unstable options are allowed, by a variable. The
# runner `env` sets it for the test programs alone, so the build is unchanged.
host=$(rustc -vV | sed -n 's/^host: //p' | tr 'a-z-' 'A-Z_')
export "CARGO_TARGET_${host}_RUNNER=env RUSTC_BOOTSTRAP=1"
rust=(cargo test --locked --release --workspace --no-fail-fast --lib --bins --tests -- -Z unstable-options --report-time)
tests 'cargo test' "${rust[@]}"
part 'cargo test --doc' cargo test --locked --release --workspace --doc
tests 'Python' .venv/bin/python tests/python/timed.py discover -s tests/python -p 'test_*.py'
tests 'Hard cases' tests/hard-cases.sh ${hard_cases[@]+"${hard_cases[@]}"}
part 'Python wheel' scripts/python.sh
tests 'Python package' .venv-python/bin/python -W error::DeprecationWarning tests/python/timed.py discover -s tests/python/package
tests 'Python with USD' .venv-usd/bin/python tests/python/timed.py discover -s tests/python -p 'usd_*.py'
tests 'Python with Blender' .venv-bpy/bin/python tests/python/timed.py discover -s tests/python -p 'blender_*.py'
if [ "$SECONDS" -lt "$long_within" ]; then
    tests 'cargo test, long' "${rust[@]}" --ignored
else
    without 'cargo test, long' 'scripts/test.sh --long runs them'
fi
