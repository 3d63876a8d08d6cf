"""Seconds and bytes of a checkpoint at 1280 x 720, by method, and the share of the time that the usual one every 300 s
takes: from the report of an iteration to the moment when the new file has its name.

The glass torus, one state after every iteration.
"""

import json
import shutil
import statistics
import subprocess
import time

from ..cache import BIN
from ..options import options
from ..record import ROOT, record

OUT = ROOT / "out" / "checkpoints"
SCENE = ROOT / "scenes" / "torus.glb"
ARGUMENTS = {"methods": ["path", "vcm", "sppm", "cppm"], "saves": 5, "width": 1280}
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
    command = [
        BIN,
        "render",
        SCENE,
        "-o",
        OUT / "a.exr",
        "--width",
        options.width,
        "--height",
        options.width * 9 // 16,
        "--method",
        method,
    ]
    command += [
        "--iterations",
        options.saves,
        "--checkpoint",
        STATE,
        "--checkpoint-every",
        "0.001",
        "--layers",
        "beauty",
    ]
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
        if len(found) == options.saves:
            break
    process.stderr.read()
    assert process.wait() == 0, f"{method}: exit code {process.returncode}"
    return found


def main():
    rows = []
    for method in options.methods:
        shutil.rmtree(OUT, ignore_errors=True)
        OUT.mkdir(parents=True)
        seconds = saves(method)
        middle = statistics.median(seconds)
        row = {"method": method, "seconds": round(middle, 2), "slowest": round(max(seconds), 2)}
        row |= {"mib": round(STATE.stat().st_size / 2**20), "percent": round(100 * middle / (EVERY + middle), 2)}
        rows.append(row)
        print(row, flush=True)
    shutil.rmtree(OUT)
    record("checkpoints", {"width": options.width, "every": EVERY, "saves": options.saves, "rows": rows})
