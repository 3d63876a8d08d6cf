"""Methods on scenes/godrays.glb at equal time: mean ratio and relMSE against a reference, and pictures to look at in out/media.

The reference is by bidirectional path tracing, with a seed of its own. What it does not find in reasonable time (the lamp's light through glass on to what is seen through glass) is little here.
"""

import json
import subprocess

from ..cache import BIN
from ..options import options
from ..record import ROOT, record

ARGUMENTS = {"seconds": 20.0, "reference_seconds": 180.0, "width": 240}
OUT = ROOT / "out" / "media"
METHODS = ["path", "bdpt", "vcm", "sppm", "cppm"]


def caustique(*arguments):
    command = [BIN, *map(str, arguments)]
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True).stdout


def render(name, method, seconds, seed):
    """Renders for a time without the combiner; returns the file and what `info` says of it."""
    file = OUT / f"{name}.exr"
    caustique(
        "render",
        ROOT / "scenes" / "godrays.glb",
        "-o",
        file,
        "--png",
        file.with_suffix(".png"),
        "--method",
        method,
        "--width",
        options.width,
        "--time",
        seconds,
        "--seed",
        seed,
        "--no-combine",
        "--progress",
        "none",
    )
    return file, json.loads(caustique("info", file, "--json"))


def main():
    OUT.mkdir(parents=True, exist_ok=True)
    reference, _ = render("reference", "bdpt", options.reference_seconds, 1000)
    values = {
        "scene": "godrays",
        "width": options.width,
        "seconds_each": options.seconds,
        "reference_seconds": options.reference_seconds,
        "methods": {},
    }
    print(f"{'method':<8} {'iterations':>10} {'mean ratio':>11} {'relMSE':>9} {'trimmed':>9} {'own estimate':>13}")
    for method in METHODS:
        file, info = render(method, method, options.seconds, 1)
        error = json.loads(caustique("compare", file, reference, "--json"))
        values["methods"][method] = {
            "iterations": info["iterations"],
            "mean_ratio": error["mean_ratio"],
            "relmse": error["relmse"],
            "relmse_trimmed": error["relmse_trimmed"],
            "estimated_relmse": info["error"] ** 2,
        }
        print(
            f"{method:<8} {info['iterations']:>10} {error['mean_ratio']:>11.4f} {error['relmse']:>9.5f} {error['relmse_trimmed']:>9.5f} {info['error'] ** 2:>13.5f}"
        )
    record("media", values)
