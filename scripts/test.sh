#!/usr/bin/env bash
# Installs missing dependencies and runs all tests, then prints the slowest tests and a summary; the last line counts the
# tests: "123 passed, 0 failed". A part that fails hides no part after it, except those that need what it builds. A part
# that fails without a failed test (formatting, a lint, a build) counts as one.
#
#   scripts/test.sh                     the tests that every change must pass
#   scripts/test.sh --long              everything: also the tests marked long, and the hard cases by all methods
#   scripts/test.sh --long-within 900  also the tests marked long, if the others took fewer seconds than that

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
beside= # process group of the parts that run beside the others
WORK=$(mktemp -d)

finish() {
    local status=$?
    if [ -n "$beside" ]; then
        kill -- "-$beside" 2>/dev/null || true
        wait "$beside" 2>/dev/null || true
    fi
    if [ -s "$WORK/times" ]; then
        printf '\nslowest tests, in seconds\n'
        sort -rn "$WORK/times" | sed -n 1,20p
    fi
    rm -rf "$WORK"
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

# part NAME COMMAND...: runs the command, shows its output, and adds its tests to the counts. Sets verdict to ok or FAILED.
part() {
    local name=$1 start=$SECONDS status=0 log good bad skipped
    shift
    printf '\n== %s\n' "$name"
    log=$(mktemp -p "$WORK")
    "$@" 2>&1 | tee "$log" || status=$?
    read -r good bad skipped < <(awk -f "$ROOT/tests/test_counts.awk" "$log")
    awk -f "$ROOT/tests/test_times.awk" "$log" >>"$WORK/times"
    # Skipped tests are errors, because everything that they need is installed.
    if [ "$skipped" -gt 0 ] && [ "$status" -eq 0 ]; then
        printf '%d tests were skipped or ignored\n' "$skipped"
        status=1
    fi
    [ "$status" -eq 0 ] || [ "$bad" -gt 0 ] || bad=1
    passed=$((passed + good))
    failed=$((failed + bad))
    verdict=ok
    [ "$bad" -eq 0 ] || verdict=FAILED
    summary+=("$(printf '%-8s %-22s %4d passed, %d failed, %d s' "$verdict" "$name" "$good" "$bad" $((SECONDS - start)))")
}

# tests PART COMMAND...: a part that must run at least one test
tests() {
    local before=$passed name=$1
    part "$@"
    if [ "$passed" -eq "$before" ] && [ "$verdict" = ok ]; then
        summary+=("FAILED   $name: no test ran")
        failed=$((failed + 1))
    fi
}

# run_beside FUNCTION: runs the parts of a function in the background; most of them use one core alone
run_beside() {
    # Job control gives them a process group of their own, and does not let them ignore SIGINT, which tests send.
    set -m
    (
        trap 'printf "passed=\$((passed + %d))\nfailed=\$((failed + %d))\n" "$passed" "$failed" >"$WORK/beside_result"
              [ ${#summary[@]} -eq 0 ] || printf "summary+=(%q)\n" "${summary[@]}" >>"$WORK/beside_result"' EXIT
        passed=0 failed=0 summary=()
        "$1"
    ) </dev/null >"$WORK/beside_output" 2>&1 &
    beside=$!
    set +m
}

# join_beside: waits for them, shows their output, and adds their results
join_beside() {
    local status=0
    wait "$beside" || status=$?
    beside=
    cat "$WORK/beside_output"
    # shellcheck source=/dev/null
    . "$WORK/beside_result"
    if [ "$status" -ne 0 ]; then
        summary+=("FAILED   the parts beside: they ended before all had run")
        failed=$((failed + 1))
    fi
}

without() { summary+=("$(printf '%-8s %-22s %s' 'not run' "$1" "$2")"); }

setup render
cd "$ROOT"
# The tests' Pythons are fetched while the program is built.
setup test &
fetched=$!
CAUSTIQUE_BIN=$(realpath -m "${CARGO_TARGET_DIR:-target}/release/caustique")
export CAUSTIQUE_BIN
export RUSTC_WRAPPER=$ROOT/tests/rustc.sh

if cargo fmt --version >/dev/null 2>&1; then
    part 'cargo fmt' cargo fmt --all --check
else
    without 'cargo fmt' 'rustfmt is not installed: rustup component add rustfmt'
fi
part 'cargo build' cargo build --locked --release --workspace
if [ "$verdict" != ok ]; then
    without 'all other parts' 'they need the build'
    exit 1
fi
wait "$fetched"
# other_blenders TEST...: tests of the exporter in the oldest and the newest Blender
other_blenders() {
    local which python
    for which in oldest newest; do
        python=.venv-bpy-$which/bin/python
        if [ -x "$python" ]; then
            tests "Python, $which Blender" "$python" tests/python/timed.py "$@"
        else
            without "Python, $which Blender" 'it needs Python 3.11'
        fi
    done
}
program_tests() {
    tests 'Python' .venv/bin/python tests/python/timed.py discover -s tests/python -p 'test_*.py'
    tests 'Python with Blender' .venv-bpy/bin/python tests/python/timed.py discover -s tests/python -p 'blender_*.py'
    other_blenders blender_broken blender_export blender_motion blender_addon_wheel
    tests 'Python with USD' .venv-usd/bin/python tests/python/timed.py discover -s tests/python -p 'usd_*.py'
    if [ -x .venv-train/bin/python ]; then
        tests 'Python with PyTorch' .venv-train/bin/python tests/python/timed.py discover -s tests/python -p 'training_*.py'
    else
        without 'Python with PyTorch' 'scripts/setup.sh train installs it'
    fi
    tests 'Hard cases' tests/hard-cases.sh ${hard_cases[@]+"${hard_cases[@]}"}
    part 'Python wheel' scripts/python.sh
    if [ "$verdict" = ok ]; then
        tests 'Python package' .venv-python/bin/python -W error::DeprecationWarning tests/python/timed.py discover -s tests/python/package
    else
        without 'Python package' 'it needs the wheel'
    fi
}
run_beside program_tests
if cargo clippy --version >/dev/null 2>&1; then
    CLIPPY_CONF_DIR="$ROOT/scripts" part 'cargo clippy' cargo clippy --locked --release --workspace --all-targets -- -D warnings
else
    without 'cargo clippy' 'clippy is not installed: rustup component add clippy'
fi
RUSTDOCFLAGS='-D warnings' part 'cargo doc' cargo doc --locked --release --workspace --no-deps
# Stable Rust's test programs print the time of each test only if told that they may use unstable options. As the runner of
# the programs alone, `env` does not change what is built.
host=$(rustc -vV | sed -n 's/^host: //p' | tr 'a-z-' 'A-Z_')
export "CARGO_TARGET_${host}_RUNNER=env RUSTC_BOOTSTRAP=1"
rust=(cargo test --locked --release --workspace --no-fail-fast --lib --bins --tests -- -Z unstable-options --report-time)
tests 'cargo test' "${rust[@]}"
part 'cargo test --doc' cargo test --locked --release --workspace --doc
join_beside
# For Windows, a minute and a half. Compilers of C have nothing to do: checking Rust needs no objects.
if [ ${#hard_cases[@]} -gt 0 ]; then
    without 'cargo check, Windows' 'scripts/test.sh --long runs it'
elif has_target x86_64-pc-windows-gnu; then
    part 'cargo check, Windows' env {CC,CXX,AR}_x86_64_pc_windows_gnu=true RUSTFLAGS='-D warnings' \
        cargo check --quiet --locked --target x86_64-pc-windows-gnu --bin caustique
else
    without 'cargo check, Windows' 'it needs Rust for Windows: rustup target add x86_64-pc-windows-gnu'
fi
if [ "$SECONDS" -lt "$long_within" ]; then
    tests 'cargo test, long' "${rust[@]}" --ignored
    tests 'Python, long' .venv-bpy/bin/python tests/python/timed.py discover -s tests/python -p 'long_blender_*.py'
    # Comparisons of all features with Cycles.
    CAUSTIQUE_LONG=1 other_blenders blender_torture
    # Clippy's lint `incompatible_msrv` already names newer functions of the standard library.
    oldest=$(sed -n 's/^rust-version *= *"\([0-9.]*\)".*/\1/p' Cargo.toml | head -n 1)
    if cargo "+$oldest.0" --version >/dev/null 2>&1; then
        part "Rust $oldest" cargo "+$oldest.0" check --locked --target-dir target/oldest
    else
        without "Rust $oldest" "it is not installed: rustup toolchain install $oldest.0"
    fi
else
    without 'cargo test, long' 'scripts/test.sh --long runs them'
fi
