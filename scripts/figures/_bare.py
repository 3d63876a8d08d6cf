"""The programs of bare.sh, taking turns. What else goes on on a machine only ever adds to a run's time: of an order of functions the fastest run counts. The ratio told is that
of the means over orders, with an interval of 90 % by bootstrap over them."""

import math
import os
import random
import statistics
import tempfile
from pathlib import Path

from _iteration import iteration, read
from record import ROOT, record

LAYOUTS = int(os.environ["LAYOUTS"])
ROUNDS = int(os.environ.get("ROUNDS", "4"))
WIDTH = int(os.environ.get("WIDTH", "320"))
SCENES = ["blocks", "cornell"]
METHODS = {"sppm": 6, "path": 12, "vcm": 4}
RESAMPLED = 2000


def programs(folder):
    """The program of a folder in all its orders."""
    (first,) = (ROOT / "target" / folder / "release" / "deps").glob("caustique-*-1")
    return [first.with_name(f"{first.name.removesuffix('-1')}-{layout}") for layout in range(1, LAYOUTS + 1)]


def interval(statistic, whole, bare):
    """90 % of what resampled orders would have told."""
    draw = random.Random(1)
    told = sorted(statistic([draw.choices(times, k=LAYOUTS) for times in whole], [draw.choices(times, k=LAYOUTS) for times in bare]) for _ in range(RESAMPLED))
    return told[RESAMPLED // 20], told[-RESAMPLED // 20]


def ratio(whole, bare):
    """Geometric mean over cells of the ratio of the means over orders."""
    return math.exp(statistics.mean(math.log(statistics.mean(w) / statistics.mean(b)) for w, b in zip(whole, bare)))


def main():
    builds = [programs("layouts"), programs("layouts-bare")]
    rows, all_times = [], ([], [])
    for scene in SCENES:
        for method in METHODS:
            options = ["--method", method, "--width", str(WIDTH)] + ([] if method == "path" else ["--levels", "1"])
            times, same = ([math.inf] * LAYOUTS, [math.inf] * LAYOUTS), True
            with tempfile.TemporaryDirectory() as folder:
                files = [Path(folder) / name for name in ("whole.exr", "bare.exr")]
                for turn in range(ROUNDS):
                    for layout in range(LAYOUTS):
                        # Neither is always the first.
                        for k in (0, 1) if (turn + layout) % 2 == 0 else (1, 0):
                            seconds = iteration(builds[k][layout], scene, options, METHODS[method], files[k])
                            times[k][layout] = min(times[k][layout], seconds)
                        same = same and read("compare", *files)["mse"] == 0.0
            whole, bare = times
            low, high = interval(ratio, [whole], [bare])
            spread = [statistics.stdev(t) / statistics.mean(t) for t in times]
            row = {"scene": scene, "method": method, "ratio": ratio([whole], [bare]), "interval": [low, high], "spread": spread}
            rows.append({**row, "bare_core_seconds": statistics.mean(bare), "same_picture": same})
            print(
                f"{scene:<10}{method:<6} {statistics.mean(bare):.4f} core-s bare, whole program {row['ratio']:.3f} times as much ({low:.3f} to {high:.3f}), "
                f"orders differ by {100 * spread[0]:.1f} and {100 * spread[1]:.1f} %, " + ("same picture" if same else "DIFFERENT PICTURES"),
                flush=True,
            )
            for kept, new in zip(all_times, times):
                kept.append(new)
    mean, (low, high) = ratio(*all_times), interval(ratio, *all_times)
    print(f"mean of all {mean:.3f} ({low:.3f} to {high:.3f})")
    record("bare", {"layouts": LAYOUTS, "rounds": ROUNDS, "width": WIDTH, "rows": rows, "mean": mean, "interval": [low, high]})


if __name__ == "__main__":
    main()
