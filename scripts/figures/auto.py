#!/usr/bin/env python3
"""`--method auto` against every fixed method at equal time, on all scenes: relMSE over that of the best fixed method.

One level, no combiner, no other option. All runs of a scene take turns in one `converge`; auto's pilot is in its time. They are compared at the largest
number of core-seconds that all have spent. References are made by two halves of one long run, kept in out/auto, and their own squared error is taken off.

CAUSTIQUE_BIN is the program. SCENES, SECONDS (10), REFERENCE_SECONDS (120) and WIDTH (320) shorten a trial; figures say what they were made with.
"""

import json
import math
import os
import subprocess
from pathlib import Path

from record import record

ROOT = Path(__file__).resolve().parents[2]
BIN = os.environ.get("CAUSTIQUE_BIN", ROOT / "target/release/caustique")
OUT = ROOT / "out" / "auto"
SECONDS = float(os.environ.get("SECONDS", "10"))
REFERENCE = float(os.environ.get("REFERENCE_SECONDS", "120"))
WIDTH = int(os.environ.get("WIDTH", "320"))
ALL = sorted(path.stem for path in (ROOT / "scenes").glob("*.glb"))
SCENES = os.environ["SCENES"].split(",") if "SCENES" in os.environ else ALL
METHODS = ["auto", "path", "bdpt", "vcm", "sppm", "cppm"]
# What converges soonest: elsewhere a long run of vcm, which finds all light.
SURELY = {"blocks": "bdpt", "fog": "sppm", "godrays": "sppm", "stadium": "auto", "interior": "bdpt", "torus": "vcm", "slide": "sppm"}


def measure(scene):
    """Runs all methods against a reference; returns what points.json says, and what auto has chosen."""
    folder = OUT / scene
    reference = OUT / f"{scene}-{WIDTH}-{REFERENCE:g}s.exr"
    command = [BIN, "converge", ROOT / "scenes" / f"{scene}.glb", "-o", folder, "--progress", "none"]
    command += ["--width", str(WIDTH), "--time", str(SECONDS), "--seed", "1"]
    for method in METHODS:
        levels = "" if method in ("path", "bdpt") else "--levels 1"
        command += ["--run", f"{method}: --method {method} {levels} --no-combine"]
    if reference.exists():
        command += ["--reference", reference]
    else:
        command += ["--reference-method", SURELY.get(scene, "vcm"), "--reference-time", str(REFERENCE)]
    done = subprocess.run(command, check=True, stderr=subprocess.PIPE, text=True)
    chosen = [line for line in done.stderr.splitlines() if 'run "auto"' in line]
    if not reference.exists():
        (folder / "reference.exr").rename(reference)
    return json.loads((folder / "points.json").read_text(encoding="utf-8")), chosen[0] if chosen else ""


def at(points, seconds):
    """relMSE after so many core-seconds: a straight line in the logarithms."""
    for before, after in zip(points, points[1:]):
        if before["cpu_seconds"] <= seconds <= after["cpu_seconds"]:
            a, b = (math.log(p["cpu_seconds"]) for p in (before, after))
            share = (math.log(seconds) - a) / (b - a) if b > a else 1.0
            x, y = (max(p["net"], 1e-12) for p in (before, after))
            return math.exp((1 - share) * math.log(x) + share * math.log(y))
    return max(points[-1]["net"], 1e-12)


def main():
    rows = []
    print(f"{'scene':<10}" + "".join(f"{m:>10}" for m in METHODS) + f"{'auto/best':>11}{'reference':>11}")
    for scene in SCENES:
        data, chosen = measure(scene)
        own = data["reference"]["error"]["relmse"]
        runs = {m: [p for p in data["points"] if p["run"] == m] for m in METHODS}
        for points in runs.values():
            for point in points:
                point["net"] = point["relmse"] - own
        seconds = min(points[-1]["cpu_seconds"] for points in runs.values())
        errors = {m: at(points, seconds) for m, points in runs.items()}
        best = min(error for method, error in errors.items() if method != "auto")
        line = f"{scene:<10}" + "".join(f"{errors[m]:>10.2g}" for m in METHODS)
        print(line + f"{errors['auto'] / best:>11.2f}{own:>11.2g}   {chosen}", flush=True)
        rows.append({"scene": scene, "relmse": errors, "core_seconds": seconds, "reference": own, "chosen": chosen})
    within = sum(row["relmse"]["auto"] <= 1.1 * min(v for m, v in row["relmse"].items() if m != "auto") for row in rows)
    better = sum(row["relmse"]["auto"] < min(v for m, v in row["relmse"].items() if m != "auto") for row in rows)
    print(f"auto within 10 % of the best fixed method on {within} of {len(rows)} scenes, better than all on {better}")
    record("auto", {"seconds": SECONDS, "width": WIDTH, "reference_seconds": REFERENCE, "scenes": rows})


if __name__ == "__main__":
    main()
