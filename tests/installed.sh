#!/usr/bin/env bash
# Tests the packages for this machine's system, in a minute.
#
#   tests/installed.sh PACKAGES SYSTEM [RUNNER...]
#
# PACKAGES is the folder with the packages of scripts/package.sh --target SYSTEM. The words of RUNNER run a program of
# another system, such as `qemu-aarch64 -L ROOT`; then the wheel is not tested, because it needs a Python of that system,
# and ONNX Runtime neither: qemu 7.2 crashes in any program that opens its library.
# For bash 3.2 of macOS, and the bash of Git on Windows. The last lines give the time to the first picture, and count the
# checks.

set -euo pipefail

packages=$(cd "$1" && pwd)
system=$2
runner=("${@:3}")
ROOT=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
# shellcheck source=tests/checks.sh
. "$ROOT/tests/checks.sh"

start=$SECONDS
if [ "$system" = windows-x86_64 ]; then
    unzip -q "$packages"/caustique-*-"$system.zip"
    program=caustique.exe python=python venv=venv/Scripts tag=win_amd64
else
    tar -xzf "$packages"/caustique-*-"$system.tar.gz"
    program=caustique python=python3 venv=venv/bin tag=*_${system#*-}
    [ "$system" != macos-aarch64 ] || tag=macosx_*
fi
home=$(echo caustique-*)
caustique() { ${runner[@]+"${runner[@]}"} "$home/bin/$program" "$@"; }
[ ${#runner[@]} -eq 0 ] || export CAUSTIQUE_ONNXRUNTIME=none
scenes=$home/share/caustique/scenes
# There is no Open Image Denoise for Linux on ARM.
denoise=oidn
[ "$system" != linux-aarch64 ] || denoise=own
picture=(--width 96 --iterations 4 --denoise "$denoise" --strict --progress none)
small=(--width 32 --iterations 2 --progress none)

check 'render' caustique render "$scenes/pool.glb" -o pool.exr --png pool.png "${picture[@]}"
first_picture archive "$start"
check 'pictures' holds pool.exr pool.png
check '--version' says '^caustique .*commit [0-9a-f]+' caustique --version
if [ "$system" != linux-aarch64 ]; then
    check 'doctor: Embree' says '^Embree .*from package' caustique doctor
    check 'doctor: Open Image Denoise' says '^Open Image Denoise .*from package' caustique doctor
fi
check 'info' says pool caustique info "$scenes/pool.glb"
check 'plan' says caustic caustique plan "$scenes/pool.glb"
for i in 0 1; do check "shard $i" caustique render "$scenes/pool.glb" -o "shard$i.exr" --shard "$i/2" "${small[@]}"; done
check 'merge' caustique merge shard0.exr shard1.exr -o merged.exr
check 'a missing file is an error' no caustique render missing.glb -o missing.exr

if [ ${#runner[@]} -eq 0 ]; then
    check 'doctor: ONNX Runtime' says '^ONNX Runtime .*from package' caustique doctor
    check 'network' caustique render "$scenes/pool.glb" -o net.exr --model compact "${small[@]}"
    start=$SECONDS
    "$python" -m venv venv
    # shellcheck disable=SC2086
    check 'wheel: pip install' "$venv/python" -m pip install -q --disable-pip-version-check "$packages"/caustique-*-$tag.whl
    check 'wheel: render' "$venv/caustique" render "$scenes/pool.glb" -o wheel.exr "${picture[@]}"
    first_picture wheel "$start"
    check 'wheel: the picture of the archive' says '"relmse": 0\.0,' "$venv/caustique" compare wheel.exr pool.exr --json
    check 'wheel: Python' "$venv/python" -c 'import sys, caustique
assert caustique.Scene(sys.argv[1]).render(width=32, iterations=2).picture.mean() > 0
assert all(it["found"] or sys.argv[2] == "linux-aarch64" for it in caustique.libraries().values())' "$scenes/pool.glb" "$system"
fi

report
