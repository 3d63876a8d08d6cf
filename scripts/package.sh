#!/usr/bin/env bash
# Makes packages that need no compiler and no other libraries.
#
#   scripts/package.sh                   for Linux on x86-64 with glibc 2.28 or newer, in target/package: the archive
#                                        caustique-VERSION-linux-x86_64.tar.gz, the Python wheel
#                                        caustique-VERSION-cp310-abi3-manylinux_2_28_x86_64.whl, and the extension
#                                        caustique-VERSION-linux-x86_64-blender.zip, which contains that wheel
#   scripts/package.sh --target SYSTEM   the same for another system: windows-x86_64 (its archive is a .zip),
#                                        macos-aarch64, or linux-aarch64 (without the extension, because there is no
#                                        Blender)
#   scripts/package.sh --target all      for all systems whose toolchains are here or can be fetched
#
# Each holds Embree, Open Image Denoise, TBB and ONNX Runtime, with licences and notices, as far as they exist for the
# system. Zig links for the symbols of glibc 2.28, and for macOS 11; mingw-w64 links for Windows. auditwheel checks the
# wheels for Linux. Without a toolchain for a system, the script says which one it lacks.
# CAUSTIQUE_RUSTFLAGS are more flags for rustc, such as those of profile-guided optimisation.

set -euo pipefail
# shellcheck source=scripts/setup.sh
. "$(dirname "${BASH_SOURCE[0]}")/setup.sh"
cd "$ROOT"

GLIBC=2.28
SYSTEMS=(linux-x86_64 linux-aarch64 windows-x86_64 macos-aarch64)
system=linux-x86_64
[ "${1:-}" != --target ] || system=${2:-}
if [ "$system" = all ]; then
    lacking=()
    for one in "${SYSTEMS[@]}"; do scripts/package.sh --target "$one" || lacking+=("$one"); done
    [ ${#lacking[@]} -eq 0 ] || fail "there are no packages for ${lacking[*]}" "see the errors above"
    exit
fi
# pip: options by which pip finds the wheels of the system; linker: more flags for rustc; program, module: file names;
# tag: platform of the wheel
pip=()
linker=
program=caustique module=_native.abi3.so
case $system in
linux-x86_64) triple=x86_64-unknown-linux-gnu cpu=x86-64-v3 tag=manylinux_${GLIBC/./_}_x86_64 ;;
linux-aarch64)
    triple=aarch64-unknown-linux-gnu cpu=generic tag=manylinux_${GLIBC/./_}_aarch64
    pip=(--platform manylinux_2_28_aarch64 --platform manylinux_2_27_aarch64)
    ;;
windows-x86_64)
    triple=x86_64-pc-windows-gnu cpu=x86-64-v3 tag=win_amd64 pip=(--platform win_amd64)
    program=caustique.exe module=_native.pyd
    # As in .cargo/config.toml.
    linker='-C link-args=-static -C link-args=-Wl,--stack,8388608,-Bstatic'
    ;;
macos-aarch64)
    triple=aarch64-apple-darwin cpu=apple-m1 tag=macosx_13_0_arm64
    pip=(--platform macosx_14_0_arm64 --platform macosx_13_0_arm64 --platform macosx_12_0_arm64)
    ;;
*) fail "unknown system '$system'" "one of: ${SYSTEMS[*]} all" ;;
esac
setup package
need_target "$triple"
[ "$system" != windows-x86_64 ] || need_mingw

version=$(sed -n 's/^version *= *"\([0-9.]*\)".*/\1/p' Cargo.toml | head -n 1)
out=$ROOT/target/package
PATH=$ROOT/.venv-package/bin:$PATH
# The environment's flags replace those of .cargo/config.toml.
export RUSTFLAGS="-C target-cpu=$cpu $linker ${CAUSTIQUE_RUSTFLAGS:-}" CARGO_TARGET_DIR=$out/build
export CARGO_INCREMENTAL=0 CARGO_PROFILE_RELEASE_STRIP=symbols CARGO_PROFILE_RELEASE_DEBUG=none
# The first macOS for Apple silicon. The wheel's tag is that of Embree; ONNX Runtime, which networks need, is for 14.
export MACOSX_DEPLOYMENT_TARGET=11.0
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
wheels=(embree oidn onnxruntime)
[ "$system" != linux-aarch64 ] || wheels=(onnxruntime)
for name in "${wheels[@]}"; do
    download_wheel "$name" .venv-package "$work/wheels" "${pip[@]}"
done
[ "$system" != windows-x86_64 ] || download_wheel msvc .venv-package "$work/wheels" "${pip[@]}" --python-version 3.14
python -I scripts/package_libraries.py "$system" "$work/wheels" "$tree/lib/caustique" "$notices"
python -I scripts/package_notices.py "$triple" >"$notices/rust.txt"
cp scripts/notices/ltc-sheen.txt "$notices/"

say "building the program"
export PYO3_BUILD_EXTENSION_MODULE=1 PYO3_PYTHON=$ROOT/.venv-package/bin/python
# The program and the Python module together, because the module needs more features of some crates, which would
# otherwise be compiled twice. The module must not name a libpython: the Python that loads it has the symbols.
build=(--quiet --locked --release --package caustique --bin caustique --package caustique-python --lib)
case $system in
linux-*) cargo-zigbuild zigbuild --target "$triple.$GLIBC" "${build[@]}" ;;
macos-*) cargo-zigbuild zigbuild --target "$triple" "${build[@]}" ;;
windows-*) cargo build --target "$triple" "${build[@]}" ;;
esac
built=$CARGO_TARGET_DIR/$triple/release

say "making the archive"
mkdir -p "$tree/bin" "$tree/share/caustique/scenes"
cp "$built/$program" "$tree/bin/"
cp scenes/*.glb "$tree/share/caustique/scenes/"
cp README.md CHANGELOG.md CITATION.cff "$notices/"
# A program of this machine writes the manual; a package for Windows has none.
if [ "$system" != windows-x86_64 ]; then
    host=$(rustc -vV | sed -n 's/^host: //p') native=$CARGO_TARGET_DIR/$host/release/caustique
    [ -x "$native" ] || env -u RUSTFLAGS cargo build --quiet --locked --release --target "$host" --bin caustique
    mkdir -p "$tree/share/man/man1" "$tree/share/zsh/site-functions" "$tree/share/bash-completion/completions" \
        "$tree/share/fish/vendor_completions.d"
    "$native" completions bash >"$tree/share/bash-completion/completions/caustique"
    "$native" completions zsh >"$tree/share/zsh/site-functions/_caustique"
    "$native" completions fish >"$tree/share/fish/vendor_completions.d/caustique.fish"
    "$native" man >"$tree/share/man/man1/caustique.1"
    for command in $("$native" man | sed -n 's/^caustique\\-\([a-z]*\)(1)$/\1/p' | grep -v help); do
        "$native" man "$command" >"$tree/share/man/man1/caustique-$command.1"
    done
fi
archive=$out/caustique-$version-$system.tar.gz
if [ "$system" = windows-x86_64 ]; then
    archive=${archive%.tar.gz}.zip
    python -I scripts/package_zip.py "$work" "$archive"
else
    tar -C "$work" --sort=name --owner=0 --group=0 --numeric-owner --mode=u+w,go-w,a+rX --mtime="@$SOURCE_DATE_EPOCH" \
        -cf - "caustique-$version" | gzip -9n >"$archive"
fi

say "making the wheel"
inside=$work/inside
info=$inside/caustique-$version.dist-info
mkdir -p "$inside/caustique/bin"
(cd ffi/python && maturin pep517 write-dist-info --metadata-directory "$inside" --interpreter "$PYO3_PYTHON") >/dev/null 2>&1
sed -i "s/^Tag: .*/Tag: cp310-abi3-$tag/" "$info/WHEEL"
cp ffi/python/caustique/*.py* ffi/python/caustique/py.typed "$inside/caustique/"
for library in "$built"/{lib_native.so,lib_native.dylib,_native.dll}; do
    [ ! -e "$library" ] || cp "$library" "$inside/caustique/$module"
done
cp "$built/$program" "$inside/caustique/bin/"
cp -r "$tree/lib" "$inside/caustique/"
cp "$notices"/*.txt "$info/licenses/"
rm -f "$out"/caustique-*-"$tag".whl
python -m wheel pack --dest-dir "$out" "$inside" >/dev/null
wheel=$(echo "$out"/caustique-*-"$tag".whl)
made=("$archive" "$wheel")
case $system in linux-*)
    auditwheel show "$wheel" | tee "$work/audit"
    # The report wraps its lines.
    tr -s '\n ' ' ' <"$work/audit" | grep -Eq "tag: \"manylinux_2_(1[0-9]|2[0-8])_${system#linux-}\"" ||
        fail "the wheel needs a newer glibc than $GLIBC" "auditwheel's report above names the symbols"
    ;;
esac

if [ "$system" != linux-aarch64 ]; then
    say "making Blender's extension"
    made+=("$out/caustique-$version-$system-blender.zip")
    python -I scripts/blender/package.py "${made[2]}" --wheel "$wheel"
fi

for file in "${made[@]}"; do
    printf '%s  %s\n' "$(du -h "$file" | cut -f 1)" "$file"
    [ "$(stat -c %s "$file")" -lt $((100 << 20)) ] || fail "$file is larger than 100 MiB" "leave out a library"
done
