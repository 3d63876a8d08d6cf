"""Renders that are killed (SIGKILL) at random moments and resumed from their checkpoints, by method: compares the bytes
of the file with those of an uninterrupted render.

Each method is killed --moments times, at moments spread over a render of 48 x 32 pixels and about 60 iterations, which
saves a checkpoint after each. Without a checkpoint the render starts again, as on a farm.
"""

import json
import random
import shutil
import signal
import subprocess
import time

from ..commands import command
from ..options import options as given
from ..record import ROOT, record

OUT = ROOT / "out" / "kills"
SCENE = ROOT / "scenes" / "cornell.glb"
METHODS = json.loads((ROOT / "tests" / "methods.json").read_text("utf-8"))
ALL = [*(method["name"] for method in METHODS), "auto"]
ARGUMENTS = {"methods": ALL, "moments": 50, "seed": 1}
# Methods whose number of light paths is an option.
WITH_PHOTONS = {method["name"] for method in METHODS if method["photons"]}
# auto needs more iterations, because its pilot takes a share of the render.
ITERATIONS = {"auto": 200}
FINAL, STATE = OUT / "cut.exr", OUT / "cut.exr.checkpoint"


def render_command(method, file, *options):
    """The command of a render to a file."""
    settings = {
        "method": method,
        "width": 48,
        "height": 32,
        "seed": 5,
        "photons": 2000 if method in WITH_PHOTONS else None,
    }
    words = ["render", SCENE, "-o", file, *options]
    return command(*words, **settings, reproducible=True, no_finish=True, progress="none")


def run(words):
    """Runs a command to its end; returns its wall-clock seconds."""
    start = time.perf_counter()
    subprocess.run(words, check=True, stderr=subprocess.DEVNULL)
    return time.perf_counter() - start


def kill(words, moment):
    """Kills a command after `moment` seconds; returns False if it had already ended."""
    process = subprocess.Popen(words, stderr=subprocess.DEVNULL)
    try:
        process.wait(moment)
    except subprocess.TimeoutExpired:
        process.send_signal(signal.SIGKILL)
    return process.wait() == -signal.SIGKILL


def measure(method):
    """Measures one method: counts kills, resumes from a checkpoint, unfinished files left by a kill, and renders whose bytes
    equal the expected ones."""
    shutil.rmtree(OUT, ignore_errors=True)
    OUT.mkdir(parents=True)
    whole = OUT / "whole.exr"
    iterations = ["--iterations", ITERATIONS.get(method, 60)]
    run(render_command(method, whole, *iterations, "--no-checkpoint"))
    expected = whole.read_bytes()
    saving = [*iterations, "--checkpoint-every", "0.001"]
    seconds = run(render_command(method, FINAL, *saving))
    assert FINAL.read_bytes() == expected, f"{method}: saving changes the bytes"
    chance = random.Random(f"{given.seed} {method}")
    found = {"method": method, "iterations": iterations[1], "kills": 0, "resumed": 0, "halves": 0, "same": 0}
    while found["kills"] < given.moments:
        for file in OUT.glob("cut*"):
            file.unlink()
        if not kill(render_command(method, FINAL, *saving), chance.uniform(0, seconds)):
            continue
        found["kills"] += 1
        found["halves"] += any(OUT.glob("*.part"))
        found["resumed"] += STATE.exists()
        run(render_command(method, FINAL, *iterations, *(["--resume", STATE] if STATE.exists() else [])))
        found["same"] += FINAL.read_bytes() == expected
    return found


def main():
    rows = []
    for method in given.methods:
        rows.append(measure(method))
        print(rows[-1], flush=True)
    record("kills", {"seed": given.seed, "rows": rows})
    off = [row["method"] for row in rows if row["same"] != row["kills"]]
    assert not off, f"the bytes differ: {off}"
