#!/usr/bin/env python3
"""Iterations and seconds that APPM and CPPM need to reach the error of SPPM after 1,000 iterations, on six scenes: Table 1 of [CPPM 2020].

One level, 2^16 light paths an iteration, bandwidths from ten neighbours, the same photon maps for all (they have the same seed). References are made by vcm in two
halves, whose difference tells their error; they are kept in out/time_to_target and used again. A reference's own squared error is taken off what is measured
against it, which is what it adds on average.

CAUSTIQUE_BIN is the program. SCENES (default: all six), ITERATIONS (1000), REFERENCE_SECONDS (120) and WIDTH (96) shorten a trial; figures say what they were made with.
"""

import json
import math
import os
import subprocess
from pathlib import Path

from record import record

ROOT = Path(__file__).resolve().parents[2]
BIN = os.environ.get("CAUSTIQUE_BIN", ROOT / "target/release/caustique")
OUT = ROOT / "out" / "time_to_target"
ITERATIONS = int(os.environ.get("ITERATIONS", "1000"))
SECONDS = float(os.environ.get("REFERENCE_SECONDS", "120"))
WIDTH = int(os.environ.get("WIDTH", "96"))
SCENES = os.environ.get("SCENES", "torus,pool,cornell,gems,lamp,interior").split(",")
METHODS = ["sppm", "appm", "cppm"]
PHOTONS = 65536


def measure(scene):
    """Runs all methods against a reference; returns what points.json says."""
    folder = OUT / scene
    reference = OUT / f"{scene}-{WIDTH}-{SECONDS:g}s.exr"
    command = [BIN, "converge", ROOT / "scenes" / f"{scene}.glb", "-o", folder, "--progress", "none"]
    command += ["--width", str(WIDTH), "--iterations", str(ITERATIONS), "--moments", "1.19", "--error-metric", "mse"]
    for method in METHODS:
        command += ["--run", f"{method}: --method {method} --levels 1 --no-combine --photons {PHOTONS}"]
    command += ["--target-of", f"sppm@{ITERATIONS}"]
    if reference.exists():
        command += ["--reference", reference]
    else:
        command += ["--reference-method", "vcm", "--reference-time", str(SECONDS)]
    subprocess.run(command, check=True)
    if not reference.exists():
        (folder / "reference.exr").rename(reference)
    return json.loads((folder / "points.json").read_text(encoding="utf-8"))


def crossing(points, figure, target):
    """Iterations and core-seconds at which a run's error falls to the target for good: straight lines in the logarithms. None where it does not."""
    last = None
    for before, after in zip(points, points[1:]):
        a, b = before[figure], after[figure]
        if a > target >= b:
            share = (math.log(a) - math.log(target)) / (math.log(a) - math.log(b)) if a > 0 and b > 0 else 1.0
            mix = [
                math.exp((1 - share) * math.log(before[key]) + share * math.log(after[key]))
                for key in ("iterations", "cpu_seconds")
            ]
            last = mix
    return last if points[-1][figure] <= target else None


def main():
    rows = []
    print(f"{'scene':<10}{'figure':<8}{'target':>10}{'reference':>11}  iterations and core-seconds, by method, in percent of sppm's")
    for scene in SCENES:
        data = measure(scene)
        own = data["reference"]["error"]
        runs = {m: [p for p in data["points"] if p["run"] == m] for m in METHODS}
        row = {"scene": scene, "reference_error": own, "height": data["height"]}
        for figure in ("mse", "relmse"):
            for points in runs.values():
                for point in points:
                    point["net"] = point[figure] - own[figure]
            target = runs["sppm"][-1]["net"]
            line = f"{scene:<10}{figure:<8}{target:>10.3g}{own[figure]:>11.2g}"
            row[figure] = {"target": target}
            whole = runs["sppm"][-1]["cpu_seconds"]
            for method in METHODS[1:]:
                found = crossing(runs[method], "net", target)
                row[figure][method] = found
                line += f"   {method} " + (
                    f"{100 * found[0] / ITERATIONS:.0f} % {100 * found[1] / whole:.0f} %" if found else "not reached"
                )
            print(line, flush=True)
        rows.append(row)
    record(
        "time-to-target",
        {"iterations": ITERATIONS, "width": WIDTH, "photons": PHOTONS, "reference_seconds": SECONDS, "scenes": rows},
    )


if __name__ == "__main__":
    main()
