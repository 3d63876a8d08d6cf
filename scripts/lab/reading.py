"""What iterations take, from a render's own history."""

import json
import subprocess

from .cache import BIN
from .record import ROOT


def read(*arguments):
    """What a command says as JSON."""
    done = subprocess.run(
        [BIN, *arguments, "--json"], check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    return json.loads(done.stdout)


def history(program, scene, options, iterations, file):
    """Renders without combiner to a file; returns the entries of its history."""
    command = [
        program,
        "render",
        ROOT / "scenes" / f"{scene}.glb",
        "-o",
        file,
        "--iterations",
        str(iterations),
        "--no-combine",
        "--progress",
        "none",
    ]
    subprocess.run(command + options, check=True, stderr=subprocess.DEVNULL)
    return read("info", file)["history"]


def stretches(program, scene, options, iterations, file):
    """Core-seconds on one thread between the entries of a render's history: of iterations after the first, which is cold, told apart at 1, 2, 3, 5, 8."""
    times = [entry["cpu_seconds"] for entry in history(program, scene, [*options, "--threads", "1"], iterations, file)]
    return [after - before for before, after in zip(times, times[1:])]


def fastest(runs, iterations):
    """Core-seconds of an iteration from the stretches of some runs. Two threads of a core share its caches, and what else goes on on a machine only ever adds to a run's
    time: so of every stretch the fastest of all runs counts."""
    return sum(map(min, zip(*runs))) / (iterations - 1)
