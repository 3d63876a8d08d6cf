"""Common parts of the drivers of other renderers: command line, clocks, and the answer.

    PYTHON NAME_driver.py SCENE.glb OUT.exr --mode MODE --width W --height H --budget SECONDS --threads T --seed S
                            [--camera NAME] [--clock wall|cpu] [--depth SEGMENTS]

A driver renders for SECONDS, writes a linear picture, and prints its answer as the last line:

    PEER {"seconds": wall time of rendering, "core_seconds": CPU time of rendering, "startup_seconds": time before it,
          "passes": samples per pixel, "version": of the renderer, "approximations": [texts about the scene]}

If the renderer cannot represent the scene, the driver prints `PEER {"cannot": [reasons]}` and writes no picture.
Rendering time begins after reading and converting the scene; it includes acceleration structures, kernels and photon
maps. With `--clock cpu` the budget is CPU seconds divided by threads, for shared machines.

Settings are public ones: box filter of one pixel, paths of at most DEPTH segments, no clamping, no adaptive sampling,
no denoiser, linear colours.
"""

import argparse
import json
import os
import site
import time
from pathlib import Path

# The program passes a folder of packages that the chosen Python lacks.
if "CAUSTIQUE_PEERS_PACKAGES" in os.environ:
    site.addsitedir(os.environ["CAUSTIQUE_PEERS_PACKAGES"])

#: Longest path in segments, for renderers that need a limit; caustique has none.
DEPTH = 32
START = time.perf_counter()


class Stopwatch:
    """Measures the time of rendering against the budget."""

    def __init__(self, options):
        self.options, self.wall, self.cpu = options, time.perf_counter(), time.process_time()
        self.startup = self.wall - START

    def core_seconds(self):
        return time.process_time() - self.cpu

    def seconds(self):
        return time.perf_counter() - self.wall

    def spent(self):
        """Seconds since the start, on the budget's clock."""
        return self.seconds() if self.options.clock == "wall" else self.core_seconds() / self.options.threads

    def left(self):
        return self.options.budget - self.spent()


def options(modes):
    """Parse the command line."""
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
    """Print the answer for the caller."""
    print("PEER " + json.dumps(facts), flush=True)


def run_passes(watch, render):
    """Call `render(number)`, which returns samples per pixel, until the time is nearest to the budget.

    Returns the sum of samples. A call is expected to take as long as the last one.
    """
    total = number = 0
    while True:
        before = watch.spent()
        total += render(number)
        number += 1
        if watch.left() < (watch.spent() - before) / 2:
            return total


def report(watch, samples, version, approximations):
    """Print the answer of a finished render. Call it before writing the picture, whose time does not count."""
    print_answer(
        seconds=round(watch.seconds(), 4),
        core_seconds=round(watch.core_seconds(), 4),
        startup_seconds=round(watch.startup, 4),
        passes=samples,
        version=version,
        approximations=approximations,
    )
