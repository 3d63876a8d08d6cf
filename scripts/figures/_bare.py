"""The programs of bare.sh, taking turns. What else goes on on a machine only ever adds to a run's time: the ratio told is that of the means of the fastest quarter of the
runs of either, with an interval of 90 % by bootstrap."""

import os
import random
import statistics
import tempfile
from pathlib import Path

from _iteration import WHOLE, iteration, read
from record import record

BARE = os.environ["BARE_BIN"]
ROUNDS = int(os.environ.get("ROUNDS", "24"))
WIDTH = int(os.environ.get("WIDTH", "320"))
SCENES = ["blocks", "cornell"]
METHODS = {"sppm": 6, "path": 12, "vcm": 4}
RESAMPLED = 2000


def fastest(times):
    """Mean of the fastest quarter."""
    return statistics.mean(sorted(times)[: max(1, len(times) // 4)])


def interval(whole, bare):
    """90 % of the ratios that resampled runs would have told."""
    draw = random.Random(1)
    ratios = sorted(fastest(draw.choices(whole, k=len(whole))) / fastest(draw.choices(bare, k=len(bare))) for _ in range(RESAMPLED))
    return ratios[RESAMPLED // 20], ratios[-RESAMPLED // 20]


def main():
    rows = []
    for scene in SCENES:
        for method in METHODS:
            with tempfile.TemporaryDirectory() as folder:
                files = [Path(folder) / name for name in ("whole.exr", "bare.exr")]
                times = ([], [])
                for turn in range(ROUNDS):
                    # Neither is always the first.
                    for k in (0, 1) if turn % 2 == 0 else (1, 0):
                        options = ["--method", method, "--width", str(WIDTH)] + ([] if method == "path" else ["--levels", "1"])
                        times[k].append(iteration((WHOLE, BARE)[k], scene, options, METHODS[method], files[k]))
                same = read("compare", *files)["mse"] == 0.0
            whole, bare = times
            ratio, (low, high) = fastest(whole) / fastest(bare), interval(whole, bare)
            rows.append({"scene": scene, "method": method, "ratio": ratio, "interval": [low, high], "bare_core_seconds": fastest(bare), "same_picture": same})
            print(f"{scene:<10}{method:<6} {fastest(bare):.4f} core-s bare, whole program {ratio:.3f} times as much ({low:.3f} to {high:.3f}), " + ("same picture" if same else "DIFFERENT PICTURES"), flush=True)
    record("bare", {"rounds": ROUNDS, "width": WIDTH, "rows": rows})


if __name__ == "__main__":
    main()
