#!/usr/bin/env python3
"""What every effect costs: core-seconds of an iteration with everything and without one effect that the scene calls for, and the error (root of relMSE) of
leaving it out.

sppm with one level, on one thread; renders take turns, and the fastest stretches of all rounds count. CAUSTIQUE_BIN is the program. SCENES, ROUNDS (4), ITERATIONS (5) and
WIDTH (320) shorten a trial. Each scene is stored on its own.
"""

import math
import os
import tempfile
from pathlib import Path

from _iteration import WHOLE, fastest, read, stretches
from record import ROOT, record

ROUNDS = int(os.environ.get("ROUNDS", "4"))
ITERATIONS = int(os.environ.get("ITERATIONS", "5"))
WIDTH = os.environ.get("WIDTH", "320")
ALL = sorted(path.stem for path in (ROOT / "scenes").glob("*.glb"))
SCENES = os.environ["SCENES"].split(",") if "SCENES" in os.environ else ALL
OPTIONS = ["--method", "sppm", "--levels", "1", "--width", WIDTH]


def measure(scene, folder):
    """Seconds with everything, and by effect seconds without it and the error."""
    plan = read("plan", ROOT / "scenes" / f"{scene}.glb", "--method", "sppm")
    present = [effect["name"] for effect in plan["effects"] if effect["simulated"]]
    runs = {None: OPTIONS} | {name: OPTIONS + ["--effects", f"-{name}"] for name in present}
    rounds = {name: [] for name in runs}
    for turn in range(ROUNDS):
        # None is always the first.
        for name, options in list(runs.items())[:: 1 if turn % 2 == 0 else -1]:
            rounds[name].append(stretches(WHOLE, scene, options, ITERATIONS, folder / f"{name}.exr"))
    seconds = {name: fastest(each, ITERATIONS) for name, each in rounds.items()}
    errors = {name: math.sqrt(read("compare", folder / f"{name}.exr", folder / "None.exr")["relmse_trimmed"]) for name in present}
    return seconds.pop(None), {name: {"seconds_without": seconds[name], "error": errors[name]} for name in present}


def main():
    for scene in SCENES:
        with tempfile.TemporaryDirectory() as folder:
            whole, effects = measure(scene, Path(folder))
        print(f"{scene}: {whole:.3f} core-s an iteration")
        for name, effect in effects.items():
            saved = 1 - effect["seconds_without"] / whole
            print(f"    -{name:<16} {effect['seconds_without']:.3f} ({100 * saved:+.0f} % saved), error {100 * effect['error']:.0f} %", flush=True)
        said = {"scene": scene, "rounds": ROUNDS, "iterations": ITERATIONS, "width": int(WIDTH)}
        record("effects", {**said, "seconds": whole, "effects": effects})


if __name__ == "__main__":
    main()
