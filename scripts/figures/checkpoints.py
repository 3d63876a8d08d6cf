#!/usr/bin/env python3
"""Seconds and bytes of a checkpoint at 1280 x 720, by method, and the share of the time that the usual one every 300 s
takes: from the report of an iteration to the moment when the new file has its name.

The glass torus, one state after every iteration. METHODS (path,vcm,sppm,cppm), SAVES (5) and WIDTH (1280) shorten a trial.
"""

import json
import os
import shutil
import statistics
import subprocess
import time

from _iteration import WHOLE as BIN
from record import ROOT, record

OUT = ROOT / "out" / "checkpoints"
SCENE = ROOT / "scenes" / "torus.glb"
METHODS = os.environ.get("METHODS", "path,vcm,sppm,cppm").split(",")
SAVES = int(os.environ.get("SAVES", "5"))
WIDTH = int(os.environ.get("WIDTH", "1280"))
# Seconds between two saves unless told otherwise.
EVERY = 300
STATE = OUT / "state"


def inode():
    """Which file has the name of the state; none: 0."""
    try:
        return STATE.stat().st_ino
    except FileNotFoundError:
        return 0


def saves(method):
    """Seconds of each save of a render."""
    command = [BIN, "render", SCENE, "-o", OUT / "a.exr", "--width", WIDTH, "--height", WIDTH * 9 // 16, "--method", method]
    command += ["--iterations", SAVES, "--checkpoint", STATE, "--checkpoint-every", "0.001", "--layers", "beauty"]
    command += ["--no-combine", "--progress", "json"]
    process = subprocess.Popen(list(map(str, command)), stderr=subprocess.PIPE, text=True)
    found, before = [], 0
    for line in process.stderr:
        if not line.startswith("{") or "iteration" not in json.loads(line):
            continue
        start = time.perf_counter()
        while inode() == before:
            assert process.poll() is None, "the render has ended without a state"
            time.sleep(0.002)
        found.append(time.perf_counter() - start)
        before = inode()
        if len(found) == SAVES:
            break
    process.stderr.read()
    assert process.wait() == 0, f"{method}: exit code {process.returncode}"
    return found


def main():
    rows = []
    for method in METHODS:
        shutil.rmtree(OUT, ignore_errors=True)
        OUT.mkdir(parents=True)
        seconds = saves(method)
        middle = statistics.median(seconds)
        row = {"method": method, "seconds": round(middle, 2), "slowest": round(max(seconds), 2)}
        row |= {"mib": round(STATE.stat().st_size / 2**20), "percent": round(100 * middle / (EVERY + middle), 2)}
        rows.append(row)
        print(row, flush=True)
    shutil.rmtree(OUT)
    record("checkpoints", {"width": WIDTH, "every": EVERY, "saves": SAVES, "rows": rows})


if __name__ == "__main__":
    main()
