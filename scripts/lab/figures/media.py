"""Methods on scenes/godrays.glb at equal time: mean ratio and relMSE against a reference. Pictures are in out/media.

The reference is by bidirectional path tracing with another seed. The light that it misses in reasonable time (through
glass onto surfaces seen through glass) is negligible here.
"""

import subprocess

from ..commands import command, read
from ..options import options
from ..record import ROOT, record

ARGUMENTS = {"seconds": 20.0, "reference_seconds": 180.0, "width": 240}
OUT = ROOT / "out" / "media"
METHODS = ["path", "bdpt", "vcm", "sppm", "cppm"]


def render(name, method, seconds, seed):
    """Renders for a time without a finish; returns the file and its header."""
    file = OUT / f"{name}.exr"
    settings = {
        "png": file.with_suffix(".png"),
        "method": method,
        "width": options.width,
        "time": seconds,
        "seed": seed,
    }
    words = ["render", ROOT / "scenes" / "godrays.glb", "-o", file]
    line = command(*words, **settings, no_finish=True, progress="none")
    subprocess.run(line, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return file, read("info", file)


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
        error = read("compare", file, reference)
        iterations, estimate = info["iterations"], info["error"] ** 2
        errors = {key: error[key] for key in ("mean_ratio", "relmse", "relmse_trimmed")}
        values["methods"][method] = {"iterations": iterations, **errors, "estimated_relmse": estimate}
        shown = f"{error['mean_ratio']:>11.4f} {error['relmse']:>9.5f} {error['relmse_trimmed']:>9.5f}"
        print(f"{method:<8} {iterations:>10} {shown} {estimate:>13.5f}")
    record("media", values)
