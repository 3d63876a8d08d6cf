"""The programs of bare.sh, taking turns on one thread: core-seconds of an iteration, by the fastest stretches of all runs."""

import os
import tempfile
from pathlib import Path

from _iteration import WHOLE, fastest, read, stretches
from record import record

BARE = os.environ["BARE_BIN"]
ROUNDS = int(os.environ.get("ROUNDS", "8"))
WIDTH = int(os.environ.get("WIDTH", "320"))
SCENES = ["blocks", "cornell"]
METHODS = {"sppm": 5, "path": 8, "vcm": 3}


def main():
    rows = []
    for scene in SCENES:
        for method, iterations in METHODS.items():
            with tempfile.TemporaryDirectory() as folder:
                options = ["--method", method, "--width", str(WIDTH)] + ([] if method == "path" else ["--levels", "1"])
                files = [Path(folder) / name for name in ("whole.exr", "bare.exr")]
                runs = ([], [])
                for turn in range(ROUNDS):
                    # Neither is always the first.
                    for k in (0, 1) if turn % 2 == 0 else (1, 0):
                        runs[k].append(stretches((WHOLE, BARE)[k], scene, options, iterations, files[k]))
                same = read("compare", *files)["mse"] == 0.0
            # All runs, and those of either half of the rounds: how far the ratio is to be trusted.
            parts = [slice(None), slice(0, None, 2), slice(1, None, 2)]
            whole, bare = ([fastest(kept[part], iterations) for part in parts] for kept in runs)
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
