#!/usr/bin/env python3
"""Bandwidths of SPPM and of CPPM on a torus in glass, in one scale of logarithms from black (small) to yellow: Figure 4 of [CPPM 2020]. Draws docs/surface.png: the picture by CPPM, SPPM's bandwidths, CPPM's.

Environment: WIDTH (240), ITERATIONS (64), PHOTONS (16384).
"""

import os

from _rules import run
from record import ROOT, record

WIDTH = int(os.environ.get("WIDTH", "240"))


def main():
    # The glass block, of a picture of 480 x 270.
    window = ",".join(str(round(n * WIDTH / 480)) for n in (115, 50, 190, 190))
    found = run("surface", scene="torus", width=WIDTH, window=window, iterations=os.environ.get("ITERATIONS", "64"),
                photons=os.environ.get("PHOTONS", "16384"), file=ROOT / "docs" / "surface.png")
    for method in ("sppm", "cppm"):
        print(f"{method}: bandwidths (m) at 5, 25, 50, 75 and 95 % of pixels: " + "  ".join(f"{r:.3g}" for r in found[method]))
    record("cppm-surface", found)


if __name__ == "__main__":
    main()
