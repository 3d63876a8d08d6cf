"""Bandwidth and error of photons' light against iterations, in smooth light and at the edge of a caustic, by SPPM, APPM
and CPPM: figure 9 of [CPPM 2020]. Draws docs/lab/points.svg.

References are kept in out/rules.
"""

from ..options import options
from ..rules_bench import bench_options, run
from ..record import ROOT, record

ARGUMENTS = {
    "scenes": ["pool"],
    "places": "48,22,45,22",
    "iterations": 1000,
    "seeds": 2,
    "width": 64,
    "photons": [4096],
    "reference_seconds": 80.0,
}


def main():
    file = ROOT / "docs" / "lab" / "points.svg"
    found = run("points", scene=options.scenes[0], places=options.places, file=file, **bench_options())
    for place, radii, errors, noise in zip(
        ("smooth light", "edge of a caustic"), found["bandwidths"], found["errors"], found["noise"]
    ):
        print(f"{place}; the reference's own error is {100 * noise:.2g} %")
        for method, radius, error in zip(found["methods"], radii, errors):
            change = f"bandwidth {radius[0]:.3g} m at first, {radius[-1]:.3g} m in the end"
            print(f"  {method}: {change}; error {100 * error[-1]:.2g} %")
    record("cppm-points", found)
