"""The programs of bare.sh, taking turns: each pair of runs gives a ratio, of which the median is told."""

import json
import os
import statistics
import subprocess
import tempfile
from pathlib import Path

from record import ROOT, record

WHOLE = os.environ.get("CAUSTIQUE_BIN", ROOT / "target/release/caustique")
BARE = os.environ["BARE_BIN"]
ROUNDS = int(os.environ.get("ROUNDS", "8"))
WIDTH = int(os.environ.get("WIDTH", "320"))
SCENES = ["blocks", "cornell"]
METHODS = {"sppm": 12, "path": 24, "vcm": 6}


def iteration(program, scene, method, file):
    """Core-seconds of an iteration after the first, which is cold."""
    command = [program, "render", ROOT / "scenes" / f"{scene}.glb", "-o", file, "--method", method, "--iterations", str(METHODS[method])]
    levels = [] if method == "path" else ["--levels", "1"]
    subprocess.run(command + levels + ["--width", str(WIDTH), "--no-combine", "--progress", "none"], check=True, stderr=subprocess.DEVNULL)
    history = read("info", file)["history"]
    first, last = history[0], history[-1]
    return (last["cpu_seconds"] - first["cpu_seconds"]) / (last["iterations"] - first["iterations"])


def read(*arguments):
    """What a command of the whole program says as JSON."""
    done = subprocess.run([WHOLE, *arguments, "--json"], check=True, stdout=subprocess.PIPE, text=True)
    return json.loads(done.stdout)


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
                        pair[k] = iteration((WHOLE, BARE)[k], scene, method, files[k])
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
