#!/usr/bin/env bash
# Pictures of the add-on's interface in Debian's own Blender, on a display that nobody sees.
#
#   scripts/blender/screenshots.sh FOLDER
#
# FOLDER/blender-render.png and FOLDER/blender-diagnosis.png are small enough for docs/.
#
# Needs what `scripts/setup.sh test` installs and a release build (or CAUSTIQUE_BIN); Blender, Xvfb and a renderer for
# OpenGL are installed here. Ends with an error where a render cannot be stopped by Esc.

set -euo pipefail

# shellcheck source=scripts/setup.sh
. "$(dirname "${BASH_SOURCE[0]}")/../setup.sh"

folder=${1:?usage: screenshots.sh FOLDER}
mkdir -p "$folder"
folder=$(realpath "$folder")
CAUSTIQUE_BIN=$(realpath "${CAUSTIQUE_BIN:-$ROOT/target/release/caustique}")
export CAUSTIQUE_BIN

packages=(blender python3-numpy xvfb xauth xdotool libgl1-mesa-dri)
dpkg -s "${packages[@]}" >/dev/null 2>&1 || apt_install "${packages[@]}"

scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
python3 "$ROOT/scripts/blender/package.py" "$scratch/caustique.zip"
# Settings of a user's own Blender are neither read nor written.
BLENDER_USER_RESOURCES=$scratch/user LIBGL_ALWAYS_SOFTWARE=1 CAUSTIQUE_EXPORTER=$ROOT/.venv-bpy/bin/python \
    timeout 300 xvfb-run -a -s '-screen 0 1280x800x24' \
    blender --factory-startup --window-geometry 0 0 1280 800 \
    --python "$ROOT/scripts/blender/screenshots.py" -- "$scratch/caustique.zip" "$folder"

# Without the timeline and what stands beside the panels, in 256 colours.
"$ROOT/.venv/bin/python" - "$folder" <<'PYTHON'
import pathlib
import sys

from PIL import Image

folder = pathlib.Path(sys.argv[1])
for shot, name in (("improves-4", "blender-render"), ("diagnosis", "blender-diagnosis")):
    picture = Image.open(folder / f"{shot}.png").convert("RGB").crop((0, 24, 1057, 724))
    colours = picture.quantize(256, method=Image.Quantize.MAXCOVERAGE, kmeans=3)
    picture.quantize(palette=colours, dither=Image.Dither.FLOYDSTEINBERG).save(folder / f"{name}.png", optimize=True)
PYTHON
