#!/usr/bin/env bash
# Tests the packages that scripts/package.sh has made on a system without compilers, Rust, Embree and other libraries.
#
#   tests/package.sh PACKAGES       PACKAGES is the folder with the tarball and the wheel
#
# `tests/bare.sh --only package` runs it on bare Debian systems. It needs Python 3 with venv, and pip's registry for
# numpy and USD. The last lines count the checks, and give the time from the download to the first picture.

set -euo pipefail

packages=$(cd "$1" && pwd)
ROOT=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
# shellcheck source=tests/checks.sh
. "$ROOT/tests/checks.sh"

# uses_own FOLDER COMMAND...: succeeds if the program takes its three libraries from the folder
uses_own() {
    "${@:2}" --version >said && cat said || return 1
    [ "$(grep -c ", $1/" said)" -eq 3 ] && grep -Eq '^caustique .*commit [0-9a-f]+' said
}

for tool in cc gcc clang cargo rustc; do
    check "no $tool here" no command -v "$tool"
done
check 'no other libraries here' no says 'embree|OpenImageDenoise|onnxruntime|libtbb' /sbin/ldconfig -p

# The tarball.
start=$SECONDS
mkdir 'ein schöner Ort'
tar -xzf "$packages"/caustique-*-linux-x86_64.tar.gz -C 'ein schöner Ort'
home=$(echo "$work/ein schöner Ort"/caustique-*)
test_program "$start" oidn "$home/share/caustique/scenes" "$home/bin/caustique"
check 'tarball: its own libraries' uses_own "$home" "$home/bin/caustique"
check 'tarball: doctor without USD' says 'Embree .*from package' "$home/bin/caustique" doctor
share=$home/share
check 'tarball: manual' holds "$share"/man/man1/caustique{,-render,-plan,-serve}.1
check 'tarball: licences' holds "$share"/doc/caustique/LICENSE-{MIT,APACHE} \
    "$share"/doc/caustique/{README,embree,oidn,tbb,onnxruntime,onnxruntime-licence,rust}.txt
check 'tarball: completions' bash -n "$share/bash-completion/completions/caustique"
mkdir elsewhere
mv "$home" elsewhere/moved
ln -s "$work/elsewhere/moved/bin/caustique" linked
check 'tarball: its own libraries after a move, by a link' uses_own "$work/elsewhere/moved" ./linked
scene=$work/elsewhere/moved/share/caustique/scenes/pool.glb
check 'tarball: render after a move' ./linked render "$scene" -o moved.exr --png moved.png "${picture[@]}"

# The wheel.
start=$SECONDS
python3 -m venv venv
wheel=$(echo "$packages"/caustique-*_x86_64.whl)
pip=(venv/bin/pip install -q --disable-pip-version-check)
check 'wheel: pip install' "${pip[@]}" "$wheel"
check 'wheel: render' venv/bin/caustique render "$scene" -o wheel.exr --png wheel.png "${picture[@]}"
first_picture wheel "$start"
check 'wheel: its own libraries' uses_own "$work/venv" venv/bin/caustique
check 'wheel: the picture of the tarball' cmp wheel.exr moved.exr
check 'wheel: licences' holds venv/lib/python3*/site-packages/caustique-*/licenses/{embree,oidn,tbb,onnxruntime,rust}.txt
cat >render.py <<'PYTHON'
import sys
import caustique
scene = caustique.Scene(sys.argv[1])
picture = scene.render(width=64, iterations=2, denoise="oidn").picture
assert picture.shape == (36, 64, 3) and picture.mean() > 0, picture
for name, library in caustique.libraries().items():
    assert library["found"] and library["from"] == "package", (name, library)
PYTHON
check 'wheel: Python' venv/bin/python render.py "$scene"
check 'wheel: python -m' says '^Usage: caustique' venv/bin/python -m caustique --help
check 'wheel: pip install of USD' "${pip[@]}" "${wheel}[usd]"
check 'wheel: USD' says 'USD +[0-9]+\.' venv/bin/caustique doctor
stage=$(find "$ROOT/scenes/usd" -name '*.usda' | sort | sed -n 1p)
check 'wheel: a USD stage' venv/bin/caustique render "$stage" -o usd.exr --width 64 --iterations 4 --progress none

report
