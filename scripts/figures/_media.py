"""Methods on scenes/godrays.glb at equal time: mean ratio and relMSE against a reference, and pictures to look at in out/media.

The reference is by bidirectional path tracing, with a seed of its own. What it does not find in reasonable time (the lamp's light through glass on to what is seen through glass) is little here.

Environment: SECONDS_EACH per render (20), REFERENCE seconds (180), WIDTH (240), CAUSTIQUE_BIN.
"""

import json
import os
import subprocess

from record import ROOT, record

SECONDS = float(os.environ.get("SECONDS_EACH", 20))
REFERENCE = float(os.environ.get("REFERENCE", 180))
WIDTH = int(os.environ.get("WIDTH", 240))
CAUSTIQUE = os.environ.get("CAUSTIQUE_BIN", str(ROOT / "target" / "release" / "caustique"))
OUT = ROOT / "out" / "media"
METHODS = ["path", "bdpt", "vcm", "sppm", "cppm"]


def caustique(*arguments):
    command = [CAUSTIQUE, *map(str, arguments)]
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True).stdout


def render(name, method, seconds, seed):
    """Renders for a time without the combiner; returns the file and what `info` says of it."""
    file = OUT / f"{name}.exr"
    caustique("render", ROOT / "scenes" / "godrays.glb", "-o", file, "--png", file.with_suffix(".png"), "--method", method, "--width", WIDTH,
              "--time", seconds, "--seed", seed, "--no-combine", "--progress", "none")
    return file, json.loads(caustique("info", file, "--json"))


def main():
    OUT.mkdir(parents=True, exist_ok=True)
    reference, _ = render("reference", "bdpt", REFERENCE, 1000)
    values = {"scene": "godrays", "width": WIDTH, "seconds_each": SECONDS, "reference_seconds": REFERENCE, "methods": {}}
    print(f"{'method':<8} {'iterations':>10} {'mean ratio':>11} {'relMSE':>9} {'trimmed':>9} {'own estimate':>13}")
    for method in METHODS:
        file, info = render(method, method, SECONDS, 1)
        error = json.loads(caustique("compare", file, reference, "--json"))
        values["methods"][method] = {"iterations": info["iterations"], "mean_ratio": error["mean_ratio"], "relmse": error["relmse"],
                                     "relmse_trimmed": error["relmse_trimmed"], "estimated_relmse": info["error"] ** 2}
        print(f"{method:<8} {info['iterations']:>10} {error['mean_ratio']:>11.4f} {error['relmse']:>9.5f} {error['relmse_trimmed']:>9.5f} {info['error'] ** 2:>13.5f}")
    record("media", values)


if __name__ == "__main__":
    main()
