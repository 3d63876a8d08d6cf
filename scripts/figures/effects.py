#!/usr/bin/env python3
"""What every effect costs: core-seconds of an iteration with everything and without one effect that the scene calls for, and the error (root of relMSE) of
leaving it out.

sppm with one level, on one thread; renders take turns, and the fastest stretches of all rounds count. CAUSTIQUE_BIN is the program. SCENES, ROUNDS (4), ITERATIONS (5) and
WIDTH (320) shorten a trial. The last lines are a table for docs/measurements.md.
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
EFFECTS = "emission direct indirect glossy caustic sds volume dispersion depth_of_field environment alpha textures".split()
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


def table(rows):
    """Seconds with everything and without each effect, and the error of that in percent, as Markdown."""
    names = [name for name in EFFECTS if any(name in row["effects"] for row in rows)]
    lines = ["| scene | all | " + " | ".join(f"`{name}`" for name in names) + " |", "| --- " * (len(names) + 2) + "|"]
    for row in rows:
        told = [row["effects"].get(name) for name in names]
        cells = [f"{e['seconds_without']:.3f}, {100 * e['error']:.2g}" if e else "" for e in told]
        lines.append(f"| {row['scene']} | {row['seconds']:.3f} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


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
    print(table(rows))
    record("effects", {"rounds": ROUNDS, "iterations": ITERATIONS, "width": int(WIDTH), "scenes": rows})


if __name__ == "__main__":
    main()
