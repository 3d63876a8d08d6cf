"""`plan --target-error` against the render that it predicts: predicted and needed iterations and core-seconds, with those
of choosing the method and of the finish.

A render checks its error at some iterations only, a factor of about 1.4 apart, so it needs up to that much more than the
target asks for. Stores the figure `outlook`.
"""

import statistics
import subprocess
import tempfile
from pathlib import Path

from ..accuracy import short
from ..cache import program
from ..commands import command, read
from ..options import options
from ..record import ROOT, record

SCENES = ["blocks", "cornell", "fog", "gems", "godrays", "interior", "lamp", "pool", "prism", "slide"]
ARGUMENTS = {"scenes": SCENES, "width": 120, "target": 0.03, "seconds": 45.0, "threads": 2}
# Ratios of predicted and needed iterations that count as right.
FACTOR = 2


def measure(name):
    """The row of a scene: predicted and needed iterations and core-seconds, and whether the time was up before."""
    scene = ROOT / "scenes" / f"{name}.glb"
    stop = command(program="plan", target_error=options.target, width=options.width, threads=options.threads)[1:]
    outlook = read("plan", scene, *stop).get("outlook") or {}
    with tempfile.TemporaryDirectory() as folder:
        picture = Path(folder) / "picture.exr"
        # The render ends with its picture. With --time, `auto` would choose for another length.
        limit = ["timeout", "--signal=INT", f"{options.seconds}"]
        render = command("render", scene, "-o", picture, *stop, seed=2, progress="none")
        subprocess.run([*limit, *render], stderr=subprocess.DEVNULL)
        # A render that is stopped before its first iteration has no picture.
        found = read("info", picture) if picture.exists() else None
    needed = [None, None]
    if found:
        last = found["history"][-1]
        needed = [last["iterations"], last["cpu_seconds"] + found["phases"]["layers_and_finish"]]
    return {
        "scene": name,
        "predicted": [outlook.get("iterations"), outlook.get("core_seconds")],
        "needed": needed,
        "reached": found is not None and found["stopped"] == "error",
    }


def main():
    rows = []
    print(f"{'':<10}{'iterations':>12}{'needed':>8}{'core-seconds':>14}{'needed':>8}")
    for name in options.scenes:
        row = measure(name)
        rows.append(row)
        cells = [value for pair in zip(row["predicted"], row["needed"]) for value in pair]
        text = ("-" if value is None else f"{value:.0f}" for value in cells)
        more = "" if row["reached"] else "  and more"
        print(f"{name:<10}" + "".join(f"{cell:>{width}}" for cell, width in zip(text, (12, 8, 14, 8))) + more, flush=True)
    known = [row for row in rows if row["predicted"][0] and row["reached"]]
    ratios = [row["predicted"][0] / row["needed"][0] for row in known]
    right = sum(1 / FACTOR <= ratio <= FACTOR for ratio in ratios)
    print(f"\nwithin a factor of {FACTOR}: {right} of {len(known)}; median ratio {statistics.median(ratios):.2f}")
    settings = {"program": program(), "width": options.width, "threads": options.threads, "error": options.target}
    stored = [row | {key: [short(x) for x in row[key]] for key in ("predicted", "needed")} for row in rows]
    record("outlook", settings | {"known": len(known), "right": right, "rows": stored})
