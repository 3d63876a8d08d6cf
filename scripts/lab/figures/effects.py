"""What every effect costs: core-seconds of an iteration with everything and without one effect that the scene calls for, and the error (root of relMSE) of
leaving it out.

sppm with one level, on one thread; renders take turns, and the fastest stretches of all rounds count. Each scene is stored on its own.
"""

import math
import tempfile
from pathlib import Path

from ..cache import BIN
from ..options import options
from ..reading import fastest, read, stretches
from ..record import ROOT, record

ALL = sorted(path.stem for path in (ROOT / "scenes").glob("*.glb"))
ARGUMENTS = {"scenes": ALL, "rounds": 4, "iterations": 5, "width": 320}


def measure(scene, folder):
    """Seconds with everything, and by effect seconds without it and the error."""
    plan = read("plan", ROOT / "scenes" / f"{scene}.glb", "--method", "sppm")
    present = [effect["name"] for effect in plan["effects"] if effect["simulated"]]
    whole = ["--method", "sppm", "--levels", "1", "--width", str(options.width)]
    runs = {None: whole} | {name: whole + ["--effects", f"-{name}"] for name in present}
    rounds = {name: [] for name in runs}
    for turn in range(options.rounds):
        # None is always the first.
        for name, words in list(runs.items())[:: 1 if turn % 2 == 0 else -1]:
            rounds[name].append(stretches(BIN, scene, words, options.iterations, folder / f"{name}.exr"))
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
            print(
                f"    -{name:<16} {effect['seconds_without']:.3f} ({100 * saved:+.0f} % saved), error {100 * effect['error']:.0f} %",
                flush=True,
            )
        said = {"scene": scene, "rounds": options.rounds, "iterations": options.iterations, "width": options.width}
        record("effects", {**said, "seconds": whole, "effects": effects})
