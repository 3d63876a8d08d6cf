"""`--method auto` against every fixed method at equal time, on all scenes: relMSE over that of the best fixed method, of all pixels and without the worst 0.5 %.

One level, no combiner, no other option; methods that refuse a scene, for they have no photons in media, are left out there. All runs of a scene take turns in one `converge`; auto's pilot is in its time. They are compared at the largest
number of core-seconds that all have spent. References are made by two halves of one long run, kept in out/auto, and their own squared error is taken off.
"""

import json
import math
import subprocess

from ..cache import BIN
from ..options import options as options
from ..reading import read
from ..record import ROOT, record

OUT = ROOT / "out" / "auto"
ALL = sorted(path.stem for path in (ROOT / "scenes").glob("*.glb"))
ARGUMENTS = {"scenes": ALL, "seconds": 10.0, "reference_seconds": 120.0, "width": 320, "seeds": 1}
METHODS = ["auto", "path", "light", "bdpt", "vcm", "bpm", "sppm", "cppm", "appm", "ppm", "pm"]
# Only guided light paths find the caustic of a ball of ten centimetres: a render of vcm, whose error a second one tells.
GUIDED = ["stadium"]
# What converges soonest: elsewhere a long run of vcm, which finds all light.
SURELY = {"blocks": "bdpt", "fog": "sppm", "godrays": "sppm", "interior": "bdpt", "torus": "vcm", "slide": "sppm"}
# Where that takes so many times as long: of the lamp's bulb, seen through its fluted glass, every method has a bright sample in hundreds.
LONGER = {"lamp": 4}


def guided(scene, reference, view=()):
    """Makes a reference by guided vcm, if there is none, and another one; returns its error in relMSE. `view`: options of the camera."""
    other = reference.with_name(f"{reference.stem}-other.exr")
    for seed, path in enumerate((reference, other), 77):
        if not path.exists():
            command = [
                BIN,
                "render",
                ROOT / "scenes" / f"{scene}.glb",
                "-o",
                path,
                "--progress",
                "none",
                "--layers",
                "beauty",
            ]
            command += [
                "--method",
                "vcm",
                "--guide",
                "on",
                "--levels",
                "1",
                "--no-combine",
                "--width",
                str(options.width),
            ]
            subprocess.run(
                command + [*view, "--time", str(options.reference_seconds), "--seed", str(seed)],
                check=True,
                stderr=subprocess.DEVNULL,
            )
    return read("compare", other, reference)["relmse"] / 2


def fixed(method):
    """A method with one image and no combiner."""
    return f"--method {method} --levels 1 --no-combine"


def renders(scene, method):
    """Whether a method can render a scene: some have no photons in media."""
    command = [BIN, "plan", ROOT / "scenes" / f"{scene}.glb", *fixed("sppm" if method == "auto" else method).split()]
    return subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL).returncode == 0


def measure(scene, runs, camera=None, seeds=1):
    """Runs by name, with options, against a reference; returns what points.json says, and what auto has chosen. `camera`: another than the scene's first."""
    view = ["--camera", camera] if camera else []
    stem = f"{scene}-{camera.lower().replace(' ', '-')}" if camera else scene
    folder = OUT / stem
    OUT.mkdir(parents=True, exist_ok=True)
    reference_seconds = options.reference_seconds * LONGER.get(scene, 1)
    reference = OUT / f"{stem}-{options.width}-{reference_seconds:g}s.exr"
    command = [BIN, "converge", ROOT / "scenes" / f"{scene}.glb", "-o", folder, "--progress", "none"]
    command += [
        *view,
        "--width",
        str(options.width),
        "--time",
        str(options.seconds),
        "--seed",
        "1",
        "--seeds",
        str(seeds),
    ]
    for name, chosen in runs.items():
        command += ["--run", f"{name}: {chosen}"]
    if scene in GUIDED:
        command += ["--reference", reference, "--reference-error", str(guided(scene, reference, view))]
    elif reference.exists():
        command += ["--reference", reference]
    else:
        command += ["--reference-method", SURELY.get(scene, "vcm"), "--reference-time", str(reference_seconds)]
    done = subprocess.run(command, check=True, stderr=subprocess.PIPE, text=True)
    chosen = [line for line in done.stderr.splitlines() if 'run "auto"' in line]
    if not reference.exists():
        (folder / "reference.exr").rename(reference)
    return json.loads((folder / "points.json").read_text(encoding="utf-8")), chosen[0] if chosen else ""


def at(points, figure, seconds):
    """A figure after so many core-seconds: a straight line in the logarithms."""
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
        print(
            f"{figure}: auto within 10 % of the best fixed method on {within} of {len(rows)} scenes, better than all on {better}"
        )
    record(
        "auto",
        {
            "seconds": options.seconds,
            "width": options.width,
            "reference_seconds": options.reference_seconds,
            "seeds": options.seeds,
            "scenes": rows,
        },
    )
