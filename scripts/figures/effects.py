#!/usr/bin/env python3
"""What every effect costs: core-seconds of an iteration with everything and without one effect that the scene calls for, and the error (root of relMSE) of
leaving it out.

sppm with one level; renders take turns, medians are told. CAUSTIQUE_BIN is the program. SCENES, ROUNDS (3), ITERATIONS (6) and WIDTH (320) shorten a trial.
"""

import math
import os
import statistics
import tempfile
from pathlib import Path

from _iteration import WHOLE, iteration, read
from record import ROOT, record

ROUNDS = int(os.environ.get("ROUNDS", "3"))
ITERATIONS = int(os.environ.get("ITERATIONS", "6"))
WIDTH = os.environ.get("WIDTH", "320")
ALL = sorted(path.stem for path in (ROOT / "scenes").glob("*.glb"))
SCENES = os.environ["SCENES"].split(",") if "SCENES" in os.environ else ALL
OPTIONS = ["--method", "sppm", "--levels", "1", "--width", WIDTH]


def measure(scene, folder):
    """Seconds with everything, and by effect seconds without it and the error."""
    plan = read("plan", ROOT / "scenes" / f"{scene}.glb", "--method", "sppm")
    present = [effect["name"] for effect in plan["effects"] if effect["simulated"]]
    runs = {None: OPTIONS} | {name: OPTIONS + ["--effects", f"-{name}"] for name in present}
    seconds = {name: [] for name in runs}
    for _ in range(ROUNDS):
        for name, options in runs.items():
            seconds[name].append(iteration(WHOLE, scene, options, ITERATIONS, folder / f"{name}.exr"))
    middle = {name: statistics.median(each) for name, each in seconds.items()}
    errors = {name: math.sqrt(read("compare", folder / f"{name}.exr", folder / "None.exr")["relmse_trimmed"]) for name in present}
    return middle.pop(None), {name: {"seconds_without": middle[name], "error": errors[name]} for name in present}


def main():
    rows = []
    for scene in SCENES:
        with tempfile.TemporaryDirectory() as folder:
            whole, effects = measure(scene, Path(folder))
        rows.append({"scene": scene, "seconds": whole, "effects": effects})
        print(f"{scene}: {whole:.3f} core-s an iteration")
        for name, effect in effects.items():
            saved = 1 - effect["seconds_without"] / whole
            print(f"    -{name:<16} {effect['seconds_without']:.3f} ({100 * saved:+.0f} % saved), error {100 * effect['error']:.0f} %", flush=True)
    record("effects", {"rounds": ROUNDS, "iterations": ITERATIONS, "width": int(WIDTH), "scenes": rows})


if __name__ == "__main__":
    main()
