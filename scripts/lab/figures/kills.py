"""Renders killed (SIGKILL) at random moments that go on from their checkpoints: whether the bytes of the file are those
of a render that was not killed, by method.

Each method is killed --moments times, spread over the whole run of a render that saves itself all the time: 48 x 32 pixels, some 60
iterations. Where no state was saved yet, the render begins anew, as a farm has it.
"""

import json
import random
import shutil
import signal
import subprocess
import time

from ..cache import BIN
from ..options import options as given
from ..record import ROOT, record

OUT = ROOT / "out" / "kills"
SCENE = ROOT / "scenes" / "cornell.glb"
METHODS = json.loads((ROOT / "tests" / "methods.json").read_text("utf-8"))
ALL = [*(method["name"] for method in METHODS), "auto"]
ARGUMENTS = {"methods": ALL, "moments": 50, "seed": 1}
# Methods whose light paths are not as many as the pixels unless told so.
PHOTONS = {method["name"] for method in METHODS if method["photons"]}
# auto begins with a pilot that takes a share of them.
ITERATIONS = {"auto": 200}
FINAL, STATE = OUT / "cut.exr", OUT / "cut.exr.checkpoint"


def command(method, file, *options):
    """A render to a file."""
    words = [BIN, "render", SCENE, "-o", file, "--method", method, "--width", 48, "--height", 32, "--reproducible"]
    words += ["--photons", 2000] if method in PHOTONS else []
    return list(map(str, [*words, "--no-combine", "--seed", 5, "--progress", "none", *options]))


def run(words):
    """Runs to the end; seconds."""
    start = time.perf_counter()
    subprocess.run(words, check=True, stderr=subprocess.DEVNULL)
    return time.perf_counter() - start


def kill(words, moment):
    """Kills a run after so many seconds; whether it had not ended by itself."""
    process = subprocess.Popen(words, stderr=subprocess.DEVNULL)
    try:
        process.wait(moment)
    except subprocess.TimeoutExpired:
        process.send_signal(signal.SIGKILL)
    return process.wait() == -signal.SIGKILL


def measure(method):
    """Kills of one method: how many, how many went on from a saved state, how many while one was written, and after how
    many of them the bytes are the same."""
    shutil.rmtree(OUT, ignore_errors=True)
    OUT.mkdir(parents=True)
    whole = OUT / "whole.exr"
    iterations = ["--iterations", ITERATIONS.get(method, 60)]
    run(command(method, whole, *iterations, "--no-checkpoint"))
    expected = whole.read_bytes()
    saving = [*iterations, "--checkpoint-every", "0.001"]
    seconds = run(command(method, FINAL, *saving))
    assert FINAL.read_bytes() == expected, f"{method}: saving changes the bytes"
    chance = random.Random(f"{given.seed} {method}")
    found = {"method": method, "iterations": iterations[1], "kills": 0, "resumed": 0, "halves": 0, "same": 0}
    while found["kills"] < given.moments:
        for file in OUT.glob("cut*"):
            file.unlink()
        if not kill(command(method, FINAL, *saving), chance.uniform(0, seconds)):
            continue
        found["kills"] += 1
        found["halves"] += any(OUT.glob("*.part"))
        found["resumed"] += STATE.exists()
        run(command(method, FINAL, *iterations, *(["--resume", STATE] if STATE.exists() else [])))
        found["same"] += FINAL.read_bytes() == expected
    return found


def main():
    rows = []
    for method in given.methods:
        rows.append(measure(method))
        print(rows[-1], flush=True)
    record("kills", {"seed": given.seed, "rows": rows})
    off = [row["method"] for row in rows if row["same"] != row["kills"]]
    assert not off, f"other bytes: {off}"
