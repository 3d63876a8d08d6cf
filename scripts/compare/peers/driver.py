"""What the drivers of other renderers have in common: their command line, their clocks, and the line they answer with.

    PYTHON NAME_driver.py SCENE.glb OUT.exr --mode MODE --width W --height H --budget SECONDS --threads T --seed S
                            [--camera NAME] [--clock wall|cpu] [--depth SEGMENTS]

A driver renders for SECONDS, writes a linear picture, and says in its last line what it did:

    PEER {"seconds": of rendering, "core_seconds": likewise, "startup_seconds": before that,
          "passes": samples per pixel, "version": of the renderer, "approximations": [of the scene, in words]}

or, where the renderer cannot say the scene, `PEER {"cannot": [why, in words]}` and writes nothing. Rendering is all
that follows the scene's being read and converted: acceleration structures, kernels and photon maps are in it. With
`--clock cpu` a budget is processor seconds over threads, for machines that others use too.

Public settings alone: one sample a pixel from a box filter, paths of DEPTH segments, nothing clamped, no adaptive
sampling, no denoiser, linear colours.
"""

import argparse
import json
import os
import site
import time
from pathlib import Path

# The program names packages for a Python that lacks some.
if "CAUSTIQUE_PEERS_PACKAGES" in os.environ:
    site.addsitedir(os.environ["CAUSTIQUE_PEERS_PACKAGES"])

#: The longest path, in segments, where a renderer needs a limit; caustique has none.
DEPTH = 32
START = time.perf_counter()


class Stopwatch:
    """Times of rendering, and whether its budget is spent."""

    def __init__(self, options):
        self.options, self.wall, self.cpu = options, time.perf_counter(), time.process_time()
        self.startup = self.wall - START

    def core_seconds(self):
        return time.process_time() - self.cpu

    def seconds(self):
        return time.perf_counter() - self.wall

    def spent(self):
        """Seconds on the clock that the budget is of."""
        return self.seconds() if self.options.clock == "wall" else self.core_seconds() / self.options.threads

    def left(self):
        return self.options.budget - self.spent()


def options(modes):
    """The command line."""
    parser = argparse.ArgumentParser()
    parser.add_argument("scene", type=Path)
    parser.add_argument("output", type=Path)
    parser.add_argument("--mode", choices=modes, default=modes[0])
    parser.add_argument("--width", type=int, required=True)
    parser.add_argument("--height", type=int, required=True)
    parser.add_argument("--camera")
    parser.add_argument("--budget", type=float, required=True)
    parser.add_argument("--threads", type=int, required=True)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--depth", type=int, default=DEPTH)
    parser.add_argument("--clock", choices=("wall", "cpu"), default="wall")
    return parser.parse_args()


def print_answer(**facts):
    """The line that the caller reads."""
    print("PEER " + json.dumps(facts), flush=True)


def run_passes(watch, render):
    """Calls `render(number)`, which returns samples a pixel, until another call would leave the budget by more than half
    of itself; returns all samples."""
    total = number = 0
    while True:
        before = watch.spent()
        total += render(number)
        number += 1
        if watch.left() < (watch.spent() - before) / 2:
            return total


def report(watch, samples, version, approximations):
    """Says what was rendered; called before the picture is written."""
    print_answer(
        seconds=round(watch.seconds(), 4),
        core_seconds=round(watch.core_seconds(), 4),
        startup_seconds=round(watch.startup, 4),
        passes=samples,
        version=version,
        approximations=approximations,
    )
