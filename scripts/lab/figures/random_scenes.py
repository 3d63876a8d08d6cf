"""Checks random scenes of new seeds for hours, at the lowest priority (see docs/lab/hard-cases.md). A run continues where
the last one ended.

The output folder has state.json, and a folder for each failure. RAYON_NUM_THREADS limits the threads.
"""

import os
import subprocess

from ..options import options
from ..record import ROOT


def add_arguments(parser):
    parser.add_argument("--hours", type=float, default=4.0, help="hours to run [default: 4]")
    parser.add_argument("--seed", type=int, help="the first seed, if the folder has no state.json [default: 1000]")
    parser.add_argument("--checks", type=int, help="checks of each scene by each of the four main methods [default: 4]")
    parser.add_argument("--output", metavar="FOLDER", help="folder of the state and of failures [default: out/random]")
    parser.add_argument("--replay", metavar="FILE", help="only check a saved scene again")


def main():
    given = {key: value for key, value in vars(options).items() if value is not None}
    words = [word for key, value in given.items() for word in (f"--{key}", str(value))]
    os.nice(19)
    subprocess.run(["cargo", "bench", "--quiet", "--bench", "random-scenes", "--", *words], cwd=ROOT, check=True)
