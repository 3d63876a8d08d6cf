#!/usr/bin/env bash
# Makes packages that need no compiler and no other libraries: Linux on x86-64 with glibc 2.28 or newer.
#
#   scripts/package.sh            in target/package: caustique-VERSION-linux-x86_64.tar.gz, the Python wheel
#                                 caustique-VERSION-cp310-abi3-manylinux_2_28_x86_64.whl, and the extension
#                                 caustique-VERSION-blender.zip, which contains that wheel
#
# Each holds Embree, Open Image Denoise, TBB and ONNX Runtime, with licences and notices. Zig links the program to the
# symbols of glibc 2.28, and auditwheel checks the wheel.
# CAUSTIQUE_RUSTFLAGS are more flags for rustc, such as those of profile-guided optimisation.

set -euo pipefail
# shellcheck source=scripts/setup.sh
. "$(dirname "${BASH_SOURCE[0]}")/setup.sh"
cd "$ROOT"
setup package

GLIBC=2.28
TARGET=x86_64-unknown-linux-gnu
version=$(sed -n 's/^version *= *"\([0-9.]*\)".*/\1/p' Cargo.toml | head -n 1)
out=$ROOT/target/package
PATH=$ROOT/.venv-package/bin:$PATH
# The environment's flags replace those of .cargo/config.toml.
export RUSTFLAGS="-C target-cpu=x86-64-v3 ${CAUSTIQUE_RUSTFLAGS:-}" CARGO_TARGET_DIR=$out/build
export CARGO_INCREMENTAL=0 CARGO_PROFILE_RELEASE_STRIP=symbols CARGO_PROFILE_RELEASE_DEBUG=none
CAUSTIQUE_COMMIT=$(git rev-parse --short=12 HEAD 2>/dev/null || echo unknown)
[ -z "$(git status --porcelain --untracked-files=no 2>/dev/null)" ] || CAUSTIQUE_COMMIT+=-modified
# Equal commits give equal dates in the archives.
SOURCE_DATE_EPOCH=$(git log -1 --format=%ct 2>/dev/null || echo 1700000000)
export CAUSTIQUE_COMMIT SOURCE_DATE_EPOCH

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
tree=$work/caustique-$version
notices=$tree/share/doc/caustique

say "collecting the libraries"
mkdir -p "$work/wheels" "$out"
for name in embree oidn onnxruntime; do
    download_wheel "$name" .venv-package "$work/wheels"
done
python -I scripts/package_libraries.py "$work/wheels" "$tree/lib/caustique" "$notices"
python -I scripts/package_notices.py >"$notices/rust.txt"
cp scripts/notices/ltc-sheen.txt "$notices/"

say "building the program and the Python module"
# Together, because the module needs more features of some crates, which would otherwise be compiled twice. The module
# must not name a libpython: the Python that loads it has the symbols.
export PYO3_BUILD_EXTENSION_MODULE=1 PYO3_PYTHON=$ROOT/.venv-package/bin/python
cargo-zigbuild zigbuild --quiet --locked --release --target "$TARGET.$GLIBC" \
    --package caustique --bin caustique --package caustique-python --lib
built=$CARGO_TARGET_DIR/$TARGET/release
program=$built/caustique

say "making the tarball"
mkdir -p "$tree/bin" "$tree/share/caustique/scenes" "$tree/share/man/man1" "$tree/share/zsh/site-functions" \
    "$tree/share/bash-completion/completions" "$tree/share/fish/vendor_completions.d"
cp "$program" "$tree/bin/"
cp scenes/*.glb "$tree/share/caustique/scenes/"
cp README.md CHANGELOG.md CITATION.cff "$notices/"
"$program" completions bash >"$tree/share/bash-completion/completions/caustique"
"$program" completions zsh >"$tree/share/zsh/site-functions/_caustique"
"$program" completions fish >"$tree/share/fish/vendor_completions.d/caustique.fish"
"$program" man >"$tree/share/man/man1/caustique.1"
for command in $("$program" man | sed -n 's/^caustique\\-\([a-z]*\)(1)$/\1/p' | grep -v help); do
    "$program" man "$command" >"$tree/share/man/man1/caustique-$command.1"
done
archive=$out/caustique-$version-linux-x86_64.tar.gz
tar -C "$work" --sort=name --owner=0 --group=0 --numeric-owner --mode=u+w,go-w,a+rX --mtime="@$SOURCE_DATE_EPOCH" \
    -cf - "caustique-$version" | gzip -9n >"$archive"

say "making the wheel"
inside=$work/inside
info=$inside/caustique-$version.dist-info
mkdir -p "$inside/caustique/bin"
(cd ffi/python && maturin pep517 write-dist-info --metadata-directory "$inside" --interpreter "$PYO3_PYTHON") >/dev/null 2>&1
sed -i "s/^Tag: .*/Tag: cp310-abi3-manylinux_${GLIBC/./_}_x86_64/" "$info/WHEEL"
cp ffi/python/caustique/*.py* ffi/python/caustique/py.typed "$inside/caustique/"
cp "$built/lib_native.so" "$inside/caustique/_native.abi3.so"
cp "$program" "$inside/caustique/bin/"
cp -r "$tree/lib" "$inside/caustique/"
cp "$notices"/*.txt "$info/licenses/"
rm -f "$out"/caustique-*.whl
python -m wheel pack --dest-dir "$out" "$inside" >/dev/null
wheel=$(echo "$out"/caustique-*.whl)
auditwheel show "$wheel" | tee "$work/audit"
# The report wraps its lines.
tr -s '\n ' ' ' <"$work/audit" | grep -Eq "tag: \"manylinux_2_(1[0-9]|2[0-8])_x86_64\"" ||
    fail "the wheel needs a newer glibc than $GLIBC" "auditwheel's report above names the symbols"

say "making Blender's extension"
extension=$out/caustique-$version-blender.zip
python -I scripts/blender/package.py "$extension" --wheel "$wheel"

printf '%s  %s\n' "$(du -h "$archive" | cut -f 1)" "$archive" "$(du -h "$wheel" | cut -f 1)" "$wheel" \
    "$(du -h "$extension" | cut -f 1)" "$extension"
