#!/usr/bin/env python3
"""Errors of SPPM, APPM and CPPM by the number of neighbours that set the first bandwidth, and of APPM from one first bandwidth everywhere: Figure 11 of [CPPM 2020]. Draws docs/neighbours.svg.

Environment: SCENES (pool,blocks), ITERATIONS (40), SEEDS (1), WIDTH (64), PHOTONS (8192; wide bandwidths meet their cap, a twentieth of the picture) and
REFERENCE core-seconds (80), kept in out/rules.
"""

import os

from _rules import run
from record import ROOT, record

SETTINGS = {"iterations": ("ITERATIONS", "40"), "seeds": ("SEEDS", "1"), "width": ("WIDTH", "64"), "photons": ("PHOTONS", "8192"), "reference": ("REFERENCE", "80")}


def mean(errors):
    return sum(e["display"] for e in errors) / len(errors)


def main():
    options = {key: os.environ.get(*pair) for key, pair in SETTINGS.items()}
    found = run("neighbours", scene=os.environ.get("SCENES", "pool,blocks"), file=ROOT / "docs" / "neighbours.svg", **options)
    for scene in found["scenes"]:
        print(f"{scene['scene']}: squared error on a screen (0 to 255)")
        print("  neighbours" + "".join(f"{k:>9}" for k in found["neighbours"]))
        for row in scene["rows"]:
            print(f"  {row['method']:<10}" + "".join(f"{mean(e):>9.3g}" for e in row["errors"]))
        print(f"  appm from {scene['radius']:.3g} m everywhere: {mean(scene['everywhere']):.3g}")
    record("cppm-neighbours", found)


if __name__ == "__main__":
    main()
