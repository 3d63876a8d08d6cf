"""Screenshots of the add-on in Debian's Blender on a virtual display: docs/blender-render.png and
docs/blender-diagnosis.png. Fails if Esc does not stop a render.

It needs the packages that `scripts/setup.sh test` installs, and Debian's packages blender, python3-numpy, xvfb, xauth,
xdotool and libgl1-mesa-dri.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

from ..cache import BIN
from ..options import options
from ..record import ROOT

#: Names of the screenshots, and their names in docs.
SHOTS = {"improves-4": "blender-render", "diagnosis": "blender-diagnosis"}
DISPLAY = ["xvfb-run", "-a", "-s", "-screen 0 1280x800x24"]


def add_arguments(parser):
    parser.add_argument("--output", type=Path, default=ROOT / "docs", help="folder of the pictures [default: docs]")


def main():
    missing = [program for program in ("blender", "xvfb-run", "xdotool") if shutil.which(program) is None]
    if missing:
        packages = "blender python3-numpy xvfb xauth xdotool libgl1-mesa-dri"
        sys.exit(f"screenshots: error: no {missing[0]}\nhint: apt-get install {packages}")
    options.output.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        archive = Path(folder) / "caustique.zip"
        subprocess.run([sys.executable, ROOT / "scripts" / "blender" / "package.py", archive], check=True)
        # The settings of the user's Blender are neither read nor written.
        own = {
            "BLENDER_USER_RESOURCES": str(Path(folder) / "user"),
            "LIBGL_ALWAYS_SOFTWARE": "1",
            "CAUSTIQUE_BIN": str(BIN),
            "CAUSTIQUE_EXPORTER": str(ROOT / ".venv-bpy" / "bin" / "python"),
        }
        blender = ["blender", "--factory-startup", "--window-geometry", "0", "0", "1280", "800"]
        script = ["--python", ROOT / "scripts" / "lab" / "blender_window.py", "--", archive, folder]
        subprocess.run([*DISPLAY, *blender, *script], env={**os.environ, **own}, check=True, timeout=300)
        for shot, name in SHOTS.items():
            save(Path(folder) / f"{shot}.png", options.output / f"{name}.png")


def save(shot, path):
    """Writes a screenshot in 256 colours, cropped to the picture and the panels."""
    picture = Image.open(shot).convert("RGB").crop((0, 24, 1057, 724))
    colours = picture.quantize(256, method=Image.Quantize.MAXCOVERAGE, kmeans=3)
    picture.quantize(palette=colours, dither=Image.Dither.FLOYDSTEINBERG).save(path, optimize=True)
