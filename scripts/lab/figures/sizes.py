"""Sizes of EXRs at 1280x720 by `--layers` and `--compression`, and the core-seconds of compression.

The scene is scenes/cornell.glb after --iterations, with zip also after four times --iterations, to show the effect of
noise.
"""

import resource
import subprocess
import tempfile
from pathlib import Path

from ..commands import command
from ..options import options
from ..record import ROOT, record

SCENE = "cornell"
SIZE = (1280, 720)
ARGUMENTS = {"iterations": 2}
LAYERS = ["beauty", "comp", "all"]
COMPRESSIONS = ["none", "zip", "zips", "piz"]


def render(layers, compression, iterations):
    """The bytes of the file, and the core-seconds of the render."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "picture.exr"
        settings = {"method": "vcm", "width": SIZE[0], "height": SIZE[1], "iterations": iterations, "progress": "none"}
        settings |= {"layers": layers, "compression": compression}
        line = command("render", ROOT / "scenes" / f"{SCENE}.glb", "-o", path, **settings)
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run(line, check=True, stderr=subprocess.DEVNULL)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        return path.stat().st_size, spent


def main():
    rows = {}
    print(f"{'layers':<8}" + "".join(f"{name:>18}" for name in COMPRESSIONS) + f"{'zip, less noise':>18}")
    for layers in LAYERS:
        found = {name: render(layers, name, options.iterations) for name in COMPRESSIONS}
        plain = found["none"][1]
        rows[layers] = {name: {"bytes": size, "core_seconds": spent - plain} for name, (size, spent) in found.items()}
        rows[layers]["longer"] = {"bytes": render(layers, "zip", 4 * options.iterations)[0]}
        cells = [
            f"{cell['bytes'] / 1e6:.1f} MB {cell.get('core_seconds', 0.0):+.1f} s" for cell in rows[layers].values()
        ]
        print(f"{layers:<8}" + "".join(f"{cell:>18}" for cell in cells), flush=True)
    settings = {"scene": SCENE, "width": SIZE[0], "height": SIZE[1], "iterations": options.iterations}
    record("sizes", {**settings, "layers": rows})
