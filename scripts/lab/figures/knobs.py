"""The cost and benefit of render options: error and core-seconds at equal numbers of iterations, on three scenes.

The scenes are caustics of glass, water in the sun, and a room without caustics. Errors are defined as in accuracy.py and
measured against a reference, for the estimate and for the finished picture, as geometric means over the scenes. `gain`
compares at equal time: squared error times core-seconds, relative to the first row of the group; below 1 is better.
"""

import os
import subprocess
import sys

from .. import accuracy
from .. import references
from ..accuracy import geometric, short
from ..cache import CACHE, Failed, create, load, program, save, scene_key
from ..commands import command, read
from ..options import options as given
from ..picture_errors import Layers
from ..record import record

ARGUMENTS = references.ARGUMENTS | {"scenes": ["torus", "pool", "second/still"], "iterations": 24}
PLACE = CACHE / "knobs" / program()
SPPM, VCM = ["--method", "sppm"], ["--method", "vcm"]
ONE = [*SPPM, "--levels", "1"]
# By group: the options that all rows share, and the options of each row. The first row is the baseline of the others.
GROUPS = {
    "levels of sppm": (SPPM, {"5 levels": [], **{f"{n} levels": ["--levels", str(n)] for n in (1, 2, 3, 4)}}),
    "photons of sppm": (
        SPPM,
        {"100,000": [], **{f"{n:,}": ["--photons", str(n)] for n in (10_000, 30_000, 300_000, 1_000_000)}},
    ),
    "neighbours of sppm": (ONE, {"--knn 10": [], **{f"--knn {k}": ["--knn", str(k)] for k in (5, 20, 40)}}),
    "alpha of sppm": (ONE, {"2/3": [], **{a: ["--alpha", a] for a in ("0.5", "0.75", "0.9", "1")}}),
    "kernel of sppm": (ONE, {"box": [], **{k: ["--kernel", k] for k in ("epanechnikov", "gaussian")}}),
    "eye paths of sppm": (SPPM, {"one": [], "two": ["--eye-paths", "2"]}),
    "light paths of vcm": (VCM, {"one a pixel": [], **{f"{n:,}": ["--photons", str(n)] for n in (10_000, 300_000)}}),
    "levels of vcm": (VCM, {"as it is": [], "1 level": ["--levels", "1"]}),
    "guide of vcm": (VCM, {"on": ["--guide", "on"], "off": ["--guide", "off"]}),
    "denoiser": (VCM, {"oidn": ["--denoise", "oidn"], "own": ["--denoise", "own"], "none": ["--denoise", "none"]}),
    "network": (SPPM, {"none": ["--eye-paths", "2"], "compact": ["--model", "compact"]}),
    "layers": (VCM, {"all": [], "comp": ["--layers", "comp"], "beauty": ["--layers", "beauty"]}),
    "pixel filter": (VCM, {"box 1": [], "blackman-harris": ["--filter", "blackman-harris"]}),
}


def render(scene, options):
    """Renders, unless the cache has the render; returns the folder."""
    name = "_".join(options).replace("/", "-")
    folder = PLACE / scene_key(scene) / f"{name}-{given.iterations}-{given.threads}-{given.width}"
    if not (folder / "run.json").exists():
        with create(folder) as draft:
            file = draft / "picture.exr"
            settings = {"iterations": given.iterations, "width": given.width, "seed": 1, "threads": given.threads}
            settings |= {"layers": None if "--layers" in options else "beauty,Noisy", "progress": "none"}
            line = command("render", scene, "-o", file, *options, **settings)
            before = os.times()
            done = subprocess.run(line, stderr=subprocess.PIPE, text=True)
            after = os.times()
            if done.returncode:
                raise Failed(done.stderr.strip().splitlines()[-1])
            spent = after.children_user + after.children_system - before.children_user - before.children_system
            save(draft / "run.json", {"core_seconds": spent, "bytes": file.stat().st_size, **read("info", file)})
    return folder


def measure(scene, options, truth):
    """Returns the core-seconds, the errors of the estimate and of the finished picture, and the bytes of a render."""
    folder = render(scene, options)
    run, layers = load(folder / "run.json"), Layers(folder / "picture.exr")
    noisy = layers.get("Noisy")
    picture = truth.distance(layers.get("").astype(float))
    estimate = truth.distance(noisy.astype(float)) if noisy is not None else picture
    return run["core_seconds"], max(estimate, 1e-6), max(picture, 1e-6), run["bytes"]


def main():
    truths = dict(accuracy.truths())
    rows = []
    for group, (common, knobs) in GROUPS.items():
        print(f"\n{group:<24}{'core-s':>9}{'estimate':>10}{'finished':>10}{'gain est.':>11}{'gain fin.':>11}{'MB':>7}")
        first = None
        for label, options in knobs.items():
            try:
                found = [measure(scene, [*common, *options], truth) for scene, truth in truths.items()]
            except Failed as failed:
                print(f"  {label}: {failed}", file=sys.stderr)
                continue
            spent, estimate, picture, size = (geometric(values) for values in zip(*found))
            now = [spent, estimate**2 * spent, picture**2 * spent]
            first = first or now
            gains = [now[1] / first[1], now[2] / first[2]]
            print(
                f"  {label:<22}{spent:>9.1f}{estimate:>10.2%}{picture:>10.2%}{gains[0]:>11.2f}{gains[1]:>11.2f}"
                f"{size / 1e6:>7.1f}",
                flush=True,
            )
            figures = [spent, estimate, picture, *gains, size / 1e6]
            rows.append([group, label, " ".join([*common, *options]), *map(short, figures)])
    settings = {"program": program(), "width": given.width, "iterations": given.iterations}
    record("knobs", {**settings, "scenes": [references.name(scene) for scene in truths], "rows": rows})
