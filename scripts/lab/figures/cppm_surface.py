"""Bandwidths of SPPM and of CPPM on a torus in glass, in one scale of logarithms from black (small) to yellow: Figure 4 of [CPPM 2020]. Draws docs/lab/surface.png: the picture by CPPM, SPPM's bandwidths, CPPM's."""

from ..options import options
from ..rules_bench import run
from ..record import ROOT, record

ARGUMENTS = {"width": 240, "iterations": 64, "photons": [16384]}


def main():
    # The glass block, of a picture of 480 x 270.
    window = ",".join(str(round(n * options.width / 480)) for n in (115, 50, 190, 190))
    found = run(
        "surface",
        scene="torus",
        width=options.width,
        window=window,
        iterations=options.iterations,
        photons=options.photons[0],
        file=ROOT / "docs" / "lab" / "surface.png",
    )
    for method in ("sppm", "cppm"):
        print(
            f"{method}: bandwidths (m) at 5, 25, 50, 75 and 95 % of pixels: "
            + "  ".join(f"{r:.3g}" for r in found[method])
        )
    record("cppm-surface", found)
