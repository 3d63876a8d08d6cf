"""The programs of bare.sh, taking turns on one thread: two threads of a core share its caches, and what else goes on on a machine only ever adds to a run's time. So of every
stretch of iterations that a render's history tells apart the fastest of all runs counts; the ratio is that of their sums."""

import os
import tempfile
from pathlib import Path

from _iteration import WHOLE, history, read
from record import record

BARE = os.environ["BARE_BIN"]
ROUNDS = int(os.environ.get("ROUNDS", "8"))
WIDTH = int(os.environ.get("WIDTH", "320"))
SCENES = ["blocks", "cornell"]
# Iterations after the first, which is cold, are told apart at 1, 2, 3, 5, 8.
METHODS = {"sppm": 5, "path": 8, "vcm": 3}


def stretches(program, scene, method, file):
    """Core-seconds between the entries of a render's history."""
    options = ["--method", method, "--width", str(WIDTH), "--threads", "1"] + ([] if method == "path" else ["--levels", "1"])
    times = [entry["cpu_seconds"] for entry in history(program, scene, options, METHODS[method], file)]
    return [after - before for before, after in zip(times, times[1:])]


def main():
    rows = []
    for scene in SCENES:
        for method, iterations in METHODS.items():
            with tempfile.TemporaryDirectory() as folder:
                files = [Path(folder) / name for name in ("whole.exr", "bare.exr")]
                runs = ([], [])
                for turn in range(ROUNDS):
                    # Neither is always the first.
                    for k in (0, 1) if turn % 2 == 0 else (1, 0):
                        runs[k].append(stretches((WHOLE, BARE)[k], scene, method, files[k]))
                same = read("compare", *files)["mse"] == 0.0
            # All runs, and those of either half of the rounds: how far the ratio is to be trusted.
            parts = [slice(None), slice(0, None, 2), slice(1, None, 2)]
            whole, bare = ([sum(map(min, zip(*kept[part]))) / (iterations - 1) for part in parts] for kept in runs)
            ratio, *halves = (w / b for w, b in zip(whole, bare))
            rows.append({"scene": scene, "method": method, "ratio": ratio, "halves": halves, "bare_core_seconds": bare[0], "same_picture": same})
            print(
                f"{scene:<10}{method:<6} {bare[0]:.4f} core-s bare, whole program {ratio:.3f} times as much ({halves[0]:.3f} and {halves[1]:.3f} by halves of the runs), "
                + ("same picture" if same else "DIFFERENT PICTURES"),
                flush=True,
            )
    mean = sum(row["ratio"] for row in rows) / len(rows)
    print(f"mean {mean:.3f}")
    record("bare", {"rounds": ROUNDS, "width": WIDTH, "threads": 1, "rows": rows, "mean": mean})


if __name__ == "__main__":
    main()
