#!/usr/bin/env bash
# Tests the packages for this machine's system, in a minute.
#
#   tests/installed.sh PACKAGES SYSTEM  PACKAGES is the folder with the packages of scripts/package.sh --target SYSTEM
#
# For bash 3.2 of macOS, and the bash of Git on Windows. The last lines give the time to the first picture, and count
# the checks.

set -euo pipefail

packages=$(cd "$1" && pwd)
system=$2
ROOT=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
# shellcheck source=tests/checks.sh
. "$ROOT/tests/checks.sh"

start=$SECONDS
mkdir 'ein schöner Ort'
if [ "$system" = windows-x86_64 ]; then
    unzip -q "$packages"/caustique-*-"$system.zip" -d 'ein schöner Ort'
    program=caustique.exe python=python venv=venv/Scripts tag=win_amd64
else
    tar -xzf "$packages"/caustique-*-"$system.tar.gz" -C 'ein schöner Ort'
    program=caustique python=python3 venv=venv/bin tag=*_${system#*-}
    [ "$system" != macos-aarch64 ] || tag=macosx_*
fi
home=$(echo 'ein schöner Ort'/caustique-*)
scenes=$home/share/caustique/scenes
# There is no Open Image Denoise for Linux on ARM, and Embree is the system's.
denoiser=own libraries=('ONNX Runtime')
[ "$system" = linux-aarch64 ] || denoiser=oidn libraries+=('Embree' 'Open Image Denoise')

test_program "$start" "$denoiser" "$scenes" "$home/bin/$program"
for library in "${libraries[@]}"; do
    check "doctor: $library" says "^$library .*from package" "$home/bin/$program" doctor
done

start=$SECONDS
"$python" -m venv venv
# shellcheck disable=SC2086
check 'wheel: pip install' "$venv/python" -m pip install -q --disable-pip-version-check "$packages"/caustique-*-$tag.whl
check 'wheel: render' "$venv/caustique" render "$scenes/pool.glb" -o wheel.exr "${picture[@]}"
first_picture wheel "$start"
check 'wheel: the picture of the archive' cmp wheel.exr pool.exr
check 'wheel: Python' "$venv/python" -c 'import sys, caustique
assert caustique.Scene(sys.argv[1]).render(width=32, iterations=2).picture.mean() > 0
assert all(it["found"] or sys.argv[2] == "linux-aarch64" for it in caustique.libraries().values())' \
    "$scenes/pool.glb" "$system"

report
