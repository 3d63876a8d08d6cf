"""`--method auto` against every fixed method at equal time, on all scenes: relMSE relative to the best fixed method, over
all pixels and without the worst 0.5 %.

The renders have one level, no finish and no other option. Methods that refuse a scene, because they have no photons in
media, are left out there. All runs of a scene alternate in one `converge`; the time of auto includes its pilot. Runs are
compared at the largest number of core-seconds that all have spent. References are the two halves of one long run, kept
in out/auto, and their own squared error is subtracted.
"""

import json
import math
import subprocess

from ..commands import command, read
from ..options import options
from ..record import ROOT, record

OUT = ROOT / "out" / "auto"
ALL = sorted(path.stem for path in (ROOT / "scenes").glob("*.glb"))
ARGUMENTS = {"scenes": ALL, "seconds": 10.0, "reference_seconds": 120.0, "width": 320, "seeds": 1}
METHODS = ["auto", "path", "light", "bdpt", "vcm", "bpm", "sppm", "cppm", "appm", "ppm", "pm"]
# Scenes whose reference is guided vcm, because only guided light paths find the caustic of a small ball. The difference
# from a second such render gives its error.
GUIDED = ["stadium"]
# The reference method that converges fastest; elsewhere vcm, which finds all light.
REFERENCE_METHODS = {
    "blocks": "bdpt",
    "fog": "sppm",
    "godrays": "sppm",
    "interior": "bdpt",
    "torus": "vcm",
    "slide": "sppm",
}
# Factors of the reference's time. A bulb seen through fluted glass has one bright sample in hundreds with every method.
TIME_FACTORS = {"lamp": 4}


def guided(scene, reference, view=()):
    """Renders a reference by guided vcm, and a second one, unless they exist; returns the reference's relMSE. `view` has
    the camera's options."""
    other = reference.with_name(f"{reference.stem}-other.exr")
    for seed, path in enumerate((reference, other), 77):
        if not path.exists():
            words = [
                "render",
                ROOT / "scenes" / f"{scene}.glb",
                "-o",
                path,
                *fixed("vcm").split(),
                "--guide",
                "on",
                *view,
            ]
            settings = {"layers": "beauty", "width": options.width, "time": options.reference_seconds, "seed": seed}
            line = command(*words, **settings, progress="none")
            subprocess.run(line, check=True, stderr=subprocess.DEVNULL)
    return read("compare", other, reference)["relmse"] / 2


def fixed(method):
    """The options of a method with one level and no finish."""
    return f"--method {method} --levels 1 --no-finish"


def renders(scene, method):
    """Whether the program accepts a method for a scene; methods without photons in media refuse some."""
    line = command("plan", ROOT / "scenes" / f"{scene}.glb", *fixed("sppm" if method == "auto" else method).split())
    return subprocess.run(line, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL).returncode == 0


def measure(scene, runs, camera=None, seeds=1):
    """Measures runs (options by name) against a reference; returns the value of points.json, and the line with the choice
    of auto. `camera` is a camera's name, or None for the scene's first."""
    view = ["--camera", camera] if camera else []
    stem = f"{scene}-{camera.lower().replace(' ', '-')}" if camera else scene
    folder = OUT / stem
    OUT.mkdir(parents=True, exist_ok=True)
    reference_seconds = options.reference_seconds * TIME_FACTORS.get(scene, 1)
    reference = OUT / f"{stem}-{options.width}-{reference_seconds:g}s.exr"
    words = ["converge", ROOT / "scenes" / f"{scene}.glb", "-o", folder, *view]
    line = command(*words, progress="none", width=options.width, time=options.seconds, seed=1, seeds=seeds)
    for name, chosen in runs.items():
        line += ["--run", f"{name}: {chosen}"]
    if scene in GUIDED:
        line += ["--reference", reference, "--reference-error", str(guided(scene, reference, view))]
    elif reference.exists():
        line += ["--reference", reference]
    else:
        method = REFERENCE_METHODS.get(scene, "vcm")
        line += ["--reference-method", method, "--reference-time", str(reference_seconds)]
    done = subprocess.run(line, check=True, stderr=subprocess.PIPE, text=True)
    chosen = [line for line in done.stderr.splitlines() if 'run "auto"' in line]
    if not reference.exists():
        (folder / "reference.exr").rename(reference)
    return json.loads((folder / "points.json").read_text(encoding="utf-8")), chosen[0] if chosen else ""


def at(points, figure, seconds):
    """A figure after a number of core-seconds, interpolated linearly in the logarithms."""
    for before, after in zip(points, points[1:]):
        if before["cpu_seconds"] <= seconds <= after["cpu_seconds"]:
            a, b = (math.log(p["cpu_seconds"]) for p in (before, after))
            share = (math.log(seconds) - a) / (b - a) if b > a else 1.0
            x, y = (math.log(max(p[figure], 1e-12)) for p in (before, after))
            return math.exp((1 - share) * x + share * y)
    return max(points[-1][figure], 1e-12)


def main():
    rows = []
    figures = ("relmse", "relmse_trimmed")
    print(f"{'scene':<10}{'':<16}" + "".join(f"{m:>10}" for m in METHODS) + f"{'auto/best':>11}{'reference':>11}")
    for scene in options.scenes:
        methods = [method for method in METHODS if renders(scene, method)]
        data, chosen = measure(scene, {method: fixed(method) for method in methods}, seeds=options.seeds)
        own = data["reference"]["error"]
        runs = {
            m: [[p for p in data["points"] if p["run"] == m and p["seed"] == seed] for seed in data["seeds"]]
            for m in methods
        }
        seconds = min(points[-1]["cpu_seconds"] for seeds in runs.values() for points in seeds)
        row = {"scene": scene, "core_seconds": seconds, "reference": own, "chosen": chosen}
        for figure in figures:
            for point in data["points"]:
                point[figure] -= own.get(figure) or 0.0
            errors = {m: sum(at(points, figure, seconds) for points in seeds) / len(seeds) for m, seeds in runs.items()}
            best = min(error for method, error in errors.items() if method != "auto")
            row[figure] = {"errors": errors, "ratio": errors["auto"] / best}
            line = f"{scene:<10}{figure:<16}" + "".join(
                f"{errors[m]:>10.2g}" if m in errors else f"{'-':>10}" for m in METHODS
            )
            print(line + f"{errors['auto'] / best:>11.2f}{own.get(figure) or 0.0:>11.2g}", flush=True)
        print(f"{'':<10}{chosen}", flush=True)
        rows.append(row)
    for figure in figures:
        ratios = [row[figure]["ratio"] for row in rows]
        within, better = sum(ratio <= 1.1 for ratio in ratios), sum(ratio < 1.0 for ratio in ratios)
        counts = f"on {within} of {len(rows)} scenes, better than all on {better}"
        print(f"{figure}: auto within 10 % of the best fixed method {counts}")
    settings = {key: getattr(options, key) for key in ("seconds", "width", "reference_seconds", "seeds")}
    record("auto", {**settings, "scenes": rows})
