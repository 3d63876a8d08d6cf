#!/usr/bin/env python3
"""Bandwidth and error of photons' light against iterations, at a smooth place and at the edge of a caustic, by SPPM, APPM and CPPM: Figure 9 of [CPPM 2020]. Draws docs/points.svg.

Environment: SCENE (pool), PLACES (x,y,x,y in pixels), ITERATIONS (1000), SEEDS (2), WIDTH (64), PHOTONS (4096) and REFERENCE core-seconds (80), kept in out/rules.
"""

import os

from _rules import run
from record import ROOT, record

SETTINGS = {
    "scene": ("SCENE", "pool"), "places": ("PLACES", "48,22,45,22"), "iterations": ("ITERATIONS", "1000"), "seeds": ("SEEDS", "2"),
    "width": ("WIDTH", "64"), "photons": ("PHOTONS", "4096"), "reference": ("REFERENCE", "80"),
}


def main():
    found = run("points", file=ROOT / "docs" / "points.svg", **{key: os.environ.get(*pair) for key, pair in SETTINGS.items()})
    for place, radii, errors, noise in zip(("smooth light", "edge of a caustic"), found["bandwidths"], found["errors"], found["noise"]):
        print(f"{place}; the reference's own error is {100 * noise:.2g} %")
        for method, radius, error in zip(found["methods"], radii, errors):
            print(f"  {method}: bandwidth {radius[0]:.3g} m at first, {radius[-1]:.3g} m in the end; error {100 * error[-1]:.2g} %")
    record("cppm-points", found)


if __name__ == "__main__":
    main()
