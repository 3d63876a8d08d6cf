"""Growth of costs by `path`, `vcm` and `sppm`: core-seconds of an iteration against triangles, lights, pixels and light
paths, seconds against threads, and core-seconds of loading against triangles.

The scene is a rough floor under emissive triangles, each a separate light, with a glass ball. Core-seconds are those of
iterations after the first on one thread, which other work on the machine changes little; the least of --rounds counts.
An exponent is the slope of a least-squares fit in the logarithms; the steepest step is the largest exponent between
neighbouring sizes. Draws docs/lab/scaling.svg if .venv-python exists (scripts/python.sh). Fails if a step costs more
than n log n.
"""

import math
import shutil
import sys

import numpy as np
from tests.hard import scene as s
from tests.hard import shapes

from ..cache import BIN
from ..commands import command
from ..iteration_times import fastest, history, intervals
from ..options import options as given
from ..plots import draw
from ..processes import measure_process
from ..record import ROOT, record


OUT = ROOT / "out" / "scaling"
METHODS = ("path", "vcm", "sppm")
ARGUMENTS = {"rounds": 2, "largest": 10_000_000}
ITERATIONS = 4
# The sizes that stay constant while another one grows.
TRIANGLES, LAMPS, WIDTH, PATHS = 10_000, 1, 128, 20_000
# By axis: the sizes, and the methods that depend on them. `path` and `vcm` have no number of light paths.
AXES = {
    "triangles": ([10**4, 10**5, 10**6, 10**7], METHODS),
    "lamps": ([1, 10, 100, 1000, 10**4, 10**5], METHODS),
    "pixels": ([64**2, 128**2, 256**2, 512**2], METHODS),
    "light paths": ([10**4, 10**5, 10**6], ("sppm",)),
}


def floor(triangles):
    """A floor of about `triangles` triangles, uneven so that no two neighbours are coplanar."""
    made = shapes.grid(1.5, round(math.sqrt(triangles / 2)))
    x, _, z = made.positions.T
    made.positions[:, 1] = 0.02 * np.sin(9 * x) * np.cos(7 * z)
    return made


def lamps(count):
    """`count` triangles that face down, with a constant total area."""
    side = math.ceil(math.sqrt(count))
    row, column = np.divmod(np.arange(count), side)
    middle = np.stack([(column + 0.5) / side - 0.5, np.full(count, 1.5), (row + 0.5) / side - 0.5], axis=-1)
    corners = np.array([[0.5, 0, -0.5], [0.5, 0, 0.5], [-0.5, 0, 0]]) * 0.4 / math.sqrt(count)
    return shapes.Mesh((middle[:, None] + corners).reshape(-1, 3), np.arange(3 * count).reshape(-1, 3))


def scene(triangles=TRIANGLES, lights=LAMPS):
    """Writes the file of a scene; returns its path without the suffix."""
    file = OUT / f"{triangles}-{lights}"
    if not file.with_suffix(".glb").exists():
        made = s.Scene().add(floor(triangles), s.diffuse(0.6)).add(lamps(lights), s.emitter(20))
        made = made.add(shapes.sphere((0, 0.4, 0), 0.3), s.glass(1.5)).seen((0, 1, 2.5), (0, 0.3, 0), 40)
        made.write(file.with_suffix(".glb"))
    return str(file)


def options(method, pixels=WIDTH**2, paths=PATHS):
    """The options of a render."""
    width = str(math.isqrt(pixels))
    of = ["--method", method, "--width", width, "--height", width, "--layers", "beauty"]
    return [*of, "--photons", str(paths)] if method == "sppm" else of


def cost(axis, size, method):
    """The core-seconds of an iteration by a method, at a size along an axis."""
    scenes = {"triangles": {"triangles": size}, "lamps": {"lights": size}}
    settings = {"pixels": {"pixels": size}, "light paths": {"paths": size}}
    file, words = scene(**scenes.get(axis, {})), options(method, **settings.get(axis, {}))
    runs = [intervals(BIN, file, words, ITERATIONS, OUT / "a.exr") for _ in range(given.rounds)]
    return fastest(runs, ITERATIONS)


def growth(sizes, costs):
    """The exponent of costs over sizes, the exponent of the steepest step, and whether all steps stay within n log n."""
    steps = list(zip(zip(sizes, costs), zip(sizes[1:], costs[1:])))
    slopes = [math.log(after[1] / before[1]) / math.log(after[0] / before[0]) for before, after in steps]
    heavy = [after[0] * math.log(1 + after[0]) / (before[0] * math.log(1 + before[0])) for before, after in steps]
    within = all(after[1] / before[1] <= most for (before, after), most in zip(steps, heavy))
    exponent = np.polyfit(np.log(sizes), np.log(costs), 1)[0]
    return {"exponent": round(float(exponent), 2), "steepest": round(max(slopes), 2), "within": within}


def threads(method):
    """The seconds of an iteration on one thread and on two."""
    found = []
    for count in (1, 2):
        of = [*options(method, pixels=256**2), "--threads", str(count)]
        runs = [history(BIN, scene(), of, ITERATIONS, OUT / "a.exr") for _ in range(given.rounds)]
        times = [[entry["seconds"] for entry in run] for run in runs]
        runs = [[after - before for before, after in zip(run, run[1:])] for run in times]
        found.append(round(fastest(runs, ITERATIONS), 4))
    return {"method": method, "seconds": found}


def load(triangles):
    """The core-seconds of a render of one pixel, most of which is loading."""
    settings = {"iterations": 1, "width": 1, "height": 1, "method": "path", "threads": 1, "no_finish": True}
    line = command("render", scene(triangles) + ".glb", "-o", OUT / "a.exr", **settings)
    runs = [measure_process(line) for _ in range(given.rounds)]
    return min(run["core_seconds"] for run in runs)


def main():
    # `growth` distinguishes an exponent of 1.5 from n log n, also at large sizes.
    assert not growth([10**5, 10**6], [1, 10**1.5])["within"] and growth([10**5, 10**6], [1, 11])["within"]
    shutil.rmtree(OUT, ignore_errors=True)
    OUT.mkdir(parents=True)
    rows = []
    for axis, (sizes, methods) in AXES.items():
        if axis == "triangles":
            sizes = [size for size in sizes if size <= given.largest]
        for method in methods:
            costs = [cost(axis, size, method) for size in sizes]
            row = {"axis": axis, "method": method, "sizes": sizes, "core_seconds": [round(c, 4) for c in costs]}
            rows.append(row | growth(sizes, costs))
            print(rows[-1], flush=True)
    sizes = [size for size in AXES["triangles"][0] if size <= given.largest]
    taken = [load(size) for size in sizes]
    row = {"axis": "triangles", "method": "loading", "sizes": sizes, "core_seconds": taken}
    rows.append(row | growth(sizes, taken))
    print(rows[-1], flush=True)
    values = {"rows": rows, "threads": [threads(method) for method in METHODS]}
    print(values["threads"])
    shutil.rmtree(OUT)
    record("scaling", values)
    draw("scaling")
    worse = [f"{row['method']} by {row['axis']}" for row in rows if not row["within"]]
    if worse:
        sys.exit(f"scaling: error: faster than n log n: {', '.join(worse)}")
