#!/usr/bin/env bash
# Makes the README's pictures again: docs/pool.png, and docs/scenes.png from six scenes, each in SECONDS_EACH (60) on all cores.

set -euo pipefail

ROOT=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
cd "$ROOT"
PROGRAM=${CAUSTIQUE_BIN:-target/release/caustique}
TIME=${SECONDS_EACH:-60}
FOLDER=$(mktemp -d)
trap 'rm -rf "$FOLDER"' EXIT

picture() {
    "$PROGRAM" render "scenes/$1.glb" -o "$FOLDER/$1.exr" --png "$FOLDER/$1.png" --width "$2" --height "$3" \
        --layers beauty --time "$TIME" --progress plain
}

picture pool 640 360
cp "$FOLDER/pool.png" docs/pool.png
for scene in interior lamp cornell gems torus stadium; do
    picture "$scene" 480 270
done
.venv/bin/python - "$FOLDER" <<'PYTHON'
import sys

from PIL import Image

names = ["interior", "lamp", "cornell", "gems", "torus", "stadium"]
pictures = [Image.open(f"{sys.argv[1]}/{name}.png").convert("RGB") for name in names]
width, height = pictures[0].size
sheet = Image.new("RGB", (2 * width, 3 * height))
for index, picture in enumerate(pictures):
    sheet.paste(picture, (index % 2 * width, index // 2 * height))
sheet.save("docs/scenes.png", optimize=True)
PYTHON
