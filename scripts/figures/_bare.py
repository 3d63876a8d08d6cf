"""The programs of bare.sh, taking turns: each pair of runs gives a ratio, of which the median is told."""

import os
import statistics
import tempfile
from pathlib import Path

from _iteration import WHOLE, iteration, read
from record import record

BARE = os.environ["BARE_BIN"]
ROUNDS = int(os.environ.get("ROUNDS", "8"))
WIDTH = int(os.environ.get("WIDTH", "320"))
SCENES = ["blocks", "cornell"]
METHODS = {"sppm": 12, "path": 24, "vcm": 6}


def main():
    rows = []
    for scene in SCENES:
        for method in METHODS:
            with tempfile.TemporaryDirectory() as folder:
                files = [Path(folder) / name for name in ("whole.exr", "bare.exr")]
                pairs = []
                for turn in range(ROUNDS):
                    pair = [0.0, 0.0]
                    # Neither is always the first.
                    for k in (0, 1) if turn % 2 == 0 else (1, 0):
                        options = ["--method", method, "--width", str(WIDTH)] + ([] if method == "path" else ["--levels", "1"])
                        pair[k] = iteration((WHOLE, BARE)[k], scene, options, METHODS[method], files[k])
                    pairs.append(pair)
                same = read("compare", *files)["mse"] == 0.0
            ratios = sorted(whole / bare for whole, bare in pairs)
            middle = statistics.median(ratios)
            low, high = ratios[len(ratios) // 4], ratios[-1 - len(ratios) // 4]
            seconds = statistics.median(bare for _, bare in pairs)
            rows.append({"scene": scene, "method": method, "ratio": middle, "quartiles": [low, high], "bare_core_seconds": seconds, "same_picture": same})
            print(f"{scene:<10}{method:<6} {seconds:.4f} core-s bare, whole program {middle:.3f} times as much (quartiles {low:.3f} to {high:.3f}), " + ("same picture" if same else "DIFFERENT PICTURES"), flush=True)
    record("bare", {"rounds": ROUNDS, "width": WIDTH, "rows": rows})


if __name__ == "__main__":
    main()
