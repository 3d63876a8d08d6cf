#!/usr/bin/env bash
# Tests the packages for Linux on ARM under qemu, as root.
#
#   tests/qemu.sh PACKAGES [ROOT]   PACKAGES is the folder with the packages of scripts/package.sh for Linux on ARM, and
#                                   with the archive for x86-64, whose program renders the pictures to compare with.
#                                   ROOT (default /var/tmp/caustique-arm) is a folder for Debian 13's Python and Embree
#                                   for ARM, which are downloaded unless they are there.
#
# Without ONNX Runtime, because qemu 7.2 crashes in any program that opens its library. The last lines give the time to
# the first picture and the differences from the pictures of Linux on x86-64, and count the checks.

set -euo pipefail

# shellcheck source=scripts/setup.sh
. "$(dirname "${BASH_SOURCE[0]}")/../scripts/setup.sh"
unset CAUSTIQUE_HOME CAUSTIQUE_EMBREE CAUSTIQUE_OIDN
export CAUSTIQUE_ONNXRUNTIME=none

packages=$(cd "$1" && pwd)
arm=$(realpath -m "${2:-/var/tmp/caustique-arm}")
need_python
need_venv_module
command -v debootstrap >/dev/null || apt_install debootstrap
command -v qemu-aarch64-static >/dev/null || apt_install qemu-user-static
if [ ! -e "$arm/.complete" ]; then
    say "unpacking Debian's packages for ARM into $arm"
    debootstrap --arch=arm64 --variant=minbase --download-only --include=libembree4-4,python3 trixie "$arm/download" >&2
    for package in "$arm"/download/var/cache/apt/archives/*.deb; do
        dpkg-deb -x "$package" "$arm"
    done
    rm -r "$arm/download"
    touch "$arm/.complete"
fi
qemu=(qemu-aarch64-static -L "$arm")

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
# shellcheck source=tests/checks.sh
. "$ROOT/tests/checks.sh"

tar -xzf "$packages"/caustique-*-linux-x86_64.tar.gz
linux=$(echo "$work"/caustique-*/bin/caustique)
start=$SECONDS
mkdir 'ein schöner Ort'
tar -xzf "$packages"/caustique-*-linux-aarch64.tar.gz -C 'ein schöner Ort'
home=$(echo "$work/ein schöner Ort"/caustique-*)
scenes=$home/share/caustique/scenes
# Qemu takes ten times as long.
size=(--width 64 --iterations 4)
test_program "$start" own "$scenes" "${qemu[@]}" "$home/bin/caustique"
check 'doctor: Embree' says '^Embree .*libembree4' "${qemu[@]}" "$home/bin/caustique" doctor
compare_pictures "$scenes" "$linux"

# The pip of this machine installs for the Python of the folder.
python=$(echo "$arm"/usr/bin/python3.[0-9]*)
"$PYTHON" -I -m venv venv
check 'wheel: pip install' venv/bin/python -I -m pip install -q --disable-pip-version-check --target site \
    --platform manylinux_2_28_aarch64 --python-version "${python##*python}" --only-binary=:all: \
    "$packages"/caustique-*_aarch64.whl
check 'wheel: render' "${qemu[@]}" site/caustique/bin/caustique render "$scenes/pool.glb" -o wheel.exr "${picture[@]}"
check 'wheel: the picture of the archive' cmp wheel.exr pool.exr
check 'wheel: Python' env PYTHONPATH=site "${qemu[@]}" "$python" -c 'import sys, caustique
assert caustique.Scene(sys.argv[1]).render(width=32, iterations=2).picture.mean() > 0
assert caustique.libraries()["embree"]["found"]' "$scenes/pool.glb"

report
