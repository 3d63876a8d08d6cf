"""The cost of every effect: core-seconds of an iteration with all effects, and without each effect of the scene, and the
error (root of relMSE) without it.

The renders use sppm with one level on one thread. They alternate, and the fastest intervals of all rounds count. Each
scene is stored as a figure.
"""

import math
import subprocess
import tempfile
from pathlib import Path

from ..commands import command, read
from ..options import options
from ..record import ROOT, record

ALL = sorted(path.stem for path in (ROOT / "scenes").glob("*.glb"))
ARGUMENTS = {"scenes": ALL, "rounds": 4, "iterations": 5, "width": 320}


def intervals(scene, words, iterations, file):
    """Renders a scene without its finish to a file; returns the core-seconds between the entries of the render's history,
    which has iterations 1, 2, 3, 5, 8, .... The first iteration is left out, because it fills the caches."""
    render = ["render", ROOT / "scenes" / f"{scene}.glb", "-o", file, *words]
    line = command(*render, iterations=iterations, threads=1, no_finish=True, progress="none")
    subprocess.run(line, check=True, stderr=subprocess.DEVNULL)
    times = [entry["cpu_seconds"] for entry in read("info", file)["history"]]
    return [after - before for before, after in zip(times, times[1:])]


def fastest(runs, iterations):
    """Core-seconds of an iteration, from the intervals of several runs: for each interval, the least of all runs counts,
    because other work on the machine (also on the other thread of a core) only adds time."""
    return sum(map(min, zip(*runs))) / (iterations - 1)


def measure(scene, folder):
    """The core-seconds with all effects and, by effect, the core-seconds and the error without it."""
    plan = read("plan", ROOT / "scenes" / f"{scene}.glb", "--method", "sppm")
    present = [effect["name"] for effect in plan["effects"] if effect["simulated"]]
    whole = ["--method", "sppm", "--levels", "1", "--width", str(options.width)]
    runs = {None: whole} | {name: whole + ["--effects", f"-{name}"] for name in present}
    rounds = {name: [] for name in runs}
    for turn in range(options.rounds):
        # The order alternates between rounds.
        for name, words in list(runs.items())[:: 1 if turn % 2 == 0 else -1]:
            rounds[name].append(intervals(scene, words, options.iterations, folder / f"{name}.exr"))
    seconds = {name: fastest(each, options.iterations) for name, each in rounds.items()}
    errors = {
        name: math.sqrt(read("compare", folder / f"{name}.exr", folder / "None.exr")["relmse_trimmed"])
        for name in present
    }
    return seconds.pop(None), {name: {"seconds_without": seconds[name], "error": errors[name]} for name in present}


def main():
    for scene in options.scenes:
        with tempfile.TemporaryDirectory() as folder:
            whole, effects = measure(scene, Path(folder))
        print(f"{scene}: {whole:.3f} core-s an iteration")
        for name, effect in effects.items():
            saved = 1 - effect["seconds_without"] / whole
            cost = f"{effect['seconds_without']:.3f} ({100 * saved:+.0f} % saved)"
            print(f"    -{name:<16} {cost}, error {100 * effect['error']:.0f} %", flush=True)
        settings = {"rounds": options.rounds, "iterations": options.iterations, "width": options.width}
        record("effects", {"scene": scene, **settings, "seconds": whole, "effects": effects})
