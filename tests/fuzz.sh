#!/usr/bin/env bash
# Fuzzes every reader of files, one after another, on one core at the lowest priority:
#     tests/fuzz.sh [SECONDS]             seconds for each reader (300)
#     READERS='glb exr' tests/fuzz.sh       some of them
# Installs what is missing: nightly Rust, cargo-fuzz, and what rendering needs. The corpus lies in
# ~/.cache/caustique-fuzz, and later runs continue with it; a fault ends its reader's turn and is kept there, below
# `faults`. tests/corpus/READER keeps the smallest of it, which `cargo test` reads again.
# The converter of USD has a fuzzer of its own, tests/python/fuzz_usd.py.

set -euo pipefail

# shellcheck source=scripts/setup.sh
. "$(dirname "${BASH_SOURCE[0]}")/../scripts/setup.sh"
setup render
cd "$ROOT"
seconds=${1:-300}
cache=${XDG_CACHE_HOME:-$HOME/.cache}/caustique-fuzz
read -ra readers <<<"${READERS:-glb scene gltf png jpeg webp ktx2 draco meshopt exr exr_environment hdr ies vol checkpoint shard model usd_options usd_fault}"

rustup toolchain list | grep -q ^nightly || rustup toolchain install nightly --profile minimal
cargo fuzz --version >/dev/null 2>&1 || cargo install --locked cargo-fuzz
# A file there is the session's priority: threads of a fuzzer are to wait for everything else.
{ echo 19 >/proc/self/autogroup; } 2>/dev/null || true
renice -n 19 $$ >/dev/null

say "building the program and the fuzz targets"
cargo build --locked --release
cargo +nightly fuzz build --fuzz-dir tests/fuzz
target=x86_64-unknown-linux-gnu
TMPDIR=$(mktemp -d)
export TMPDIR
trap 'rm -rf "$TMPDIR"' EXIT
tests/fuzz/target/$target/release/seeds "$ROOT/target/release/caustique" "$cache/seeds"

# Images are decoded whole, up to a gigabyte and a half, whatever their file's size is; see MOST_TEXELS, MOST_BYTES and
# WHOLE.
limits() {
    case $1 in
        png | jpeg | webp | ktx2 | hdr | exr | exr_environment | gltf) echo "-malloc_limit_mb=2048 -rss_limit_mb=4096" ;;
        *) echo "-malloc_limit_mb=512 -rss_limit_mb=2048" ;;
    esac
}

status=0
for reader in "${readers[@]}"; do
    mkdir -p "$cache/corpus/$reader" "$cache/faults/$reader" "$cache/seeds/$reader"
    say "$reader, $seconds s"
    fault=0
    # shellcheck disable=SC2046
    RAYON_NUM_THREADS=1 ASAN_OPTIONS=detect_leaks=0:detect_odr_violation=0 \
        "tests/fuzz/target/$target/release/$reader" "$cache/corpus/$reader" "$cache/seeds/$reader" "tests/corpus/$reader" \
        -artifact_prefix="$cache/faults/$reader/" -max_total_time="$seconds" -timeout=10 -max_len=65536 \
        -print_final_stats=1 -print_funcs=0 $(limits "$reader") >"$cache/$reader.log" 2>&1 || fault=$?
    grep -E 'stat::number_of_executed_units|SUMMARY' "$cache/$reader.log" | sed "s/^/$reader: /" || true
    [ $fault -eq 0 ] || say "$reader: a fault, see $cache/$reader.log"
    [ $fault -eq 0 ] || status=$fault
done
exit $status
