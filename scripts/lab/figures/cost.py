"""The predicted cost of an iteration in `--method auto` beside the measured cost, by scene and candidate."""

import json
import subprocess

from ..record import ROOT, record


def main():
    scenes = sorted((ROOT / "scenes").glob("*.glb"))
    command = ["cargo", "bench", "--locked", "--quiet", "--bench", "cost", "--", *map(str, scenes), "width=320"]
    done = subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    *shown, last = done.stdout.splitlines()
    print("\n".join(shown))
    record("counted-cost", json.loads(last))
