"""Sizes of EXRs at 1280x720 by what is in them (`--layers`) and how it is packed (`--compression`), and the core-seconds that packing adds to a render.

The scene is scenes/cornell.glb after --iterations; with zip also after four times as many, for what noise does to sizes.
"""

import resource
import subprocess
import tempfile
from pathlib import Path

from ..cache import BIN
from ..options import options
from ..record import ROOT, record

SCENE = "cornell"
SIZE = (1280, 720)
ARGUMENTS = {"iterations": 2}
LAYERS = ["beauty", "comp", "all"]
PACKED = ["none", "zip", "zips", "piz"]


def render(layers, packed, iterations):
    """Bytes of the file, and core-seconds of the render."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "picture.exr"
        command = [BIN, "render", ROOT / "scenes" / f"{SCENE}.glb", "-o", path, "--method", "vcm", "--progress", "none"]
        command += ["--width", str(SIZE[0]), "--height", str(SIZE[1]), "--iterations", str(iterations)]
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run([*command, "--layers", layers, "--compression", packed], check=True, stderr=subprocess.DEVNULL)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        return path.stat().st_size, spent


def main():
    rows = {}
    print(f"{'layers':<8}" + "".join(f"{packed:>18}" for packed in PACKED) + f"{'zip, less noise':>18}")
    for layers in LAYERS:
        found = {packed: render(layers, packed, options.iterations) for packed in PACKED}
        plain = found["none"][1]
        rows[layers] = {
            packed: {"bytes": size, "core_seconds": spent - plain} for packed, (size, spent) in found.items()
        }
        rows[layers]["longer"] = {"bytes": render(layers, "zip", 4 * options.iterations)[0]}
        cells = [
            f"{cell['bytes'] / 1e6:.1f} MB {cell.get('core_seconds', 0.0):+.1f} s" for cell in rows[layers].values()
        ]
        print(f"{layers:<8}" + "".join(f"{cell:>18}" for cell in cells), flush=True)
    record(
        "sizes", {"scene": SCENE, "width": SIZE[0], "height": SIZE[1], "iterations": options.iterations, "layers": rows}
    )
