"""Errors of SPPM, APPM and CPPM by the number of neighbours that set the first bandwidth, and of APPM with one first
bandwidth for all pixels: figure 11 of [CPPM 2020]. Draws docs/lab/neighbours.svg.

References are kept in out/rules.
"""

from ..options import options
from ..rules_bench import bench_options, run
from ..record import ROOT, record

# The widest bandwidths reach their limit, a twentieth of the picture.
ARGUMENTS = {
    "scenes": ["pool", "blocks"],
    "iterations": 40,
    "seeds": 1,
    "width": 64,
    "photons": [8192],
    "reference_seconds": 80.0,
}


def mean(errors):
    return sum(e["display"] for e in errors) / len(errors)


def main():
    found = run(
        "neighbours", scene=",".join(options.scenes), file=ROOT / "docs" / "lab" / "neighbours.svg", **bench_options()
    )
    for scene in found["scenes"]:
        print(f"{scene['scene']}: squared error on a screen (0 to 255)")
        print("  neighbours" + "".join(f"{k:>9}" for k in found["neighbours"]))
        for row in scene["rows"]:
            print(f"  {row['method']:<10}" + "".join(f"{mean(e):>9.3g}" for e in row["errors"]))
        print(f"  appm from {scene['radius']:.3g} m everywhere: {mean(scene['everywhere']):.3g}")
    record("cppm-neighbours", found)
