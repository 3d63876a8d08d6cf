"""Renders the README's pictures: docs/pool.png, and docs/scenes.png from six scenes."""

import subprocess
import tempfile
from pathlib import Path

from PIL import Image

from ..commands import command
from ..options import options
from ..record import ROOT

ARGUMENTS = {"seconds": 60.0}
SHEET = ["interior", "lamp", "cornell", "gems", "torus", "stadium"]


def picture(folder, scene, width, height):
    """Renders a scene; returns the tone-mapped picture."""
    file = Path(folder) / f"{scene}.png"
    settings = {"png": file, "width": width, "height": height, "layers": "beauty", "time": options.seconds}
    words = ["render", ROOT / "scenes" / f"{scene}.glb", "-o", file.with_suffix(".exr")]
    subprocess.run(command(*words, **settings, progress="plain"), check=True)
    return Image.open(file).convert("RGB")


def main():
    with tempfile.TemporaryDirectory() as folder:
        picture(folder, "pool", 640, 360)
        (ROOT / "docs" / "pool.png").write_bytes((Path(folder) / "pool.png").read_bytes())
        pictures = [picture(folder, scene, 480, 270) for scene in SHEET]
    width, height = pictures[0].size
    sheet = Image.new("RGB", (2 * width, 3 * height))
    for index, one in enumerate(pictures):
        sheet.paste(one, (index % 2 * width, index // 2 * height))
    sheet.save(ROOT / "docs" / "scenes.png", optimize=True)
