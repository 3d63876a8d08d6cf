#!/usr/bin/env bash
# Builds the program with profile-guided optimization: about 7 % less time per render for 15 minutes of building.
#
#   scripts/optimise.sh        writes target/optimised/caustique
#
# A first build counts how often every branch and call is taken while it renders small pictures of scenes/; the compiler
# arranges and inlines the second build by these counts. Pictures have the same bytes. It needs llvm-profdata of the
# compiler's LLVM: LLVM_PROFDATA names one, otherwise rustup's component llvm-tools is used, and added if it is missing.

set -euo pipefail
# shellcheck source=scripts/setup.sh
source "$(dirname "${BASH_SOURCE[0]}")/setup.sh"
cd "$ROOT"
setup render

llvm=$(rustc -vV | sed -n 's/^LLVM version: \([0-9]*\).*/\1/p')
host=$(rustc -vV | sed -n 's/^host: //p')
tool=${LLVM_PROFDATA:-$(rustc --print sysroot)/lib/rustlib/$host/bin/llvm-profdata}
if [ ! -x "$tool" ]; then
    tool=$(command -v "llvm-profdata-$llvm") || tool=
fi
if [ -z "$tool" ] && rustup component add llvm-tools >/dev/null 2>&1; then
    tool=$(rustc --print sysroot)/lib/rustlib/$host/bin/llvm-profdata
fi
[ -n "$tool" ] || fail "no llvm-profdata of LLVM $llvm found" \
    "run 'rustup component add llvm-tools', or name one: LLVM_PROFDATA=/usr/bin/llvm-profdata-$llvm scripts/optimise.sh"

# Flags in the environment replace those of .cargo/config.toml.
flags="-C target-cpu=x86-64-v3"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

say "building the program that counts"
CARGO_TARGET_DIR=target/counting RUSTFLAGS="$flags -C profile-generate=$work" \
    cargo build --locked --release --bin caustique
for scene in scenes/*.glb; do
    for method in path vcm sppm; do
        say "rendering $scene by $method"
        target/counting/release/caustique render "$scene" -o "$work/picture.exr" --method "$method" --iterations 2 \
            --width 160 --threads 1 --progress none
    done
done
"$tool" merge -o target/counting/counts.profdata "$work"/*.profraw

say "building the optimised program"
CARGO_TARGET_DIR=target/optimised RUSTFLAGS="$flags -C profile-use=$ROOT/target/counting/counts.profdata" \
    cargo build --locked --release --bin caustique
ln -sf release/caustique target/optimised/caustique
printf '%s\n' "$ROOT/target/optimised/caustique"
