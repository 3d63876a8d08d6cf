"""Bandwidths of SPPM and of CPPM on a torus in glass, on a common logarithmic scale from black (small) to yellow: figure
4 of [CPPM 2020]. Draws docs/lab/surface.png: the picture by CPPM, SPPM's bandwidths, CPPM's bandwidths."""

from ..options import options
from ..rules_bench import run
from ..record import ROOT, record

ARGUMENTS = {"width": 240, "iterations": 64, "photons": [16384]}


def main():
    # The glass block's window in a picture of 480 x 270 pixels.
    window = ",".join(str(round(n * options.width / 480)) for n in (115, 50, 190, 190))
    file, photons = ROOT / "docs" / "lab" / "surface.png", options.photons[0]
    size = {"width": options.width, "window": window, "iterations": options.iterations}
    found = run("surface", scene="torus", **size, photons=photons, file=file)
    for method in ("sppm", "cppm"):
        radii = "  ".join(f"{radius:.3g}" for radius in found[method])
        print(f"{method}: bandwidths (m) at 5, 25, 50, 75 and 95 % of pixels: {radii}")
    record("cppm-surface", found)
