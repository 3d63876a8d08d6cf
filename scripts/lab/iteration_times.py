"""Core-seconds of iterations, from the history in a render's header."""

import subprocess

from .commands import command, read
from .record import ROOT


def history(program, scene, options, iterations, file):
    """Renders a scene without its finish to a file; returns the history of the render."""
    words = ["render", ROOT / "scenes" / f"{scene}.glb", "-o", file, *options]
    line = command(*words, program=program, iterations=iterations, no_finish=True, progress="none")
    subprocess.run(line, check=True, stderr=subprocess.DEVNULL)
    return read("info", file)["history"]


def intervals(program, scene, options, iterations, file):
    """Core-seconds, on one thread, between the entries of a render's history, which has iterations 1, 2, 3, 5, 8, ....
    The first iteration is left out, because it fills the caches."""
    times = [entry["cpu_seconds"] for entry in history(program, scene, [*options, "--threads", "1"], iterations, file)]
    return [after - before for before, after in zip(times, times[1:])]


def fastest(runs, iterations):
    """Core-seconds of an iteration, from the intervals of several runs: for each interval, the least of all runs counts,
    because other work on the machine (also on the other thread of a core) only adds time."""
    return sum(map(min, zip(*runs))) / (iterations - 1)
