#!/usr/bin/env bash
# Installs the extension that scripts/package.sh has made in a real Blender with a window, and presses F12. No path is
# set, and the system has no other caustique, Embree or Open Image Denoise for it.
#
#   tests/extension.sh PACKAGES     PACKAGES is the folder with the extension
#
# `tests/bare.sh 13 --only blender` runs it on a bare Debian with its Blender, an X server without a screen, and OpenGL
# in software.

set -euo pipefail

extension=$(echo "$(cd "$1" && pwd)"/caustique-*-linux-x86_64-blender.zip)
script=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)/press_f12.py
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
export BLENDER_USER_RESOURCES=$work/user LIBGL_ALWAYS_SOFTWARE=1 HOME=$work

blender --version | sed -n 1p
xvfb-run -a -s "-screen 0 1280x800x24" blender --factory-startup --window-geometry 0 0 1280 800 \
    --python "$script" -- "$extension" "$work/picture.png"
[ -s "$work/picture.png" ]
