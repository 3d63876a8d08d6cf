"""Seconds and bytes of a checkpoint at 1280 x 720, by method, and the share of the time that checkpoints take every 300 s.

The scene is the glass torus, with a checkpoint after every iteration. The time of a checkpoint runs from the report of
the iteration to the moment when the new file has its final name.
"""

import json
import shutil
import statistics
import subprocess
import time

from ..commands import command
from ..options import options
from ..record import ROOT, record

OUT = ROOT / "out" / "checkpoints"
SCENE = ROOT / "scenes" / "torus.glb"
ARGUMENTS = {"methods": ["path", "vcm", "sppm", "cppm"], "saves": 5, "width": 1280}
# Seconds between two checkpoints by default.
EVERY = 300
STATE = OUT / "state"


def inode():
    """The inode of the checkpoint, or 0 if there is none."""
    try:
        return STATE.stat().st_ino
    except FileNotFoundError:
        return 0


def saves(method):
    """The seconds of each checkpoint of a render."""
    size = {"width": options.width, "height": options.width * 9 // 16}
    settings = {"method": method, "iterations": options.saves, "checkpoint": STATE, "checkpoint_every": "0.001"}
    settings |= {"layers": "beauty", "no_finish": True, "progress": "json"}
    line = command("render", SCENE, "-o", OUT / "a.exr", **size, **settings)
    process = subprocess.Popen(line, stderr=subprocess.PIPE, text=True)
    found, before = [], 0
    for line in process.stderr:
        if not line.startswith("{") or "iteration" not in json.loads(line):
            continue
        start = time.perf_counter()
        while inode() == before:
            assert process.poll() is None, "the render has ended without a checkpoint"
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
