"""Iterations and core-seconds that APPM and CPPM need to reach the error of SPPM after 1,000 iterations, on six scenes: Table 1 of [CPPM 2020].

One level, bandwidths from ten neighbours, 2^16 light paths, the same seeds for all and so the same photon maps, pictures of 64 pixels across. Three
errors are measured: mean squared error of all light; of photons' light alone, which is what the rules differ in; and of what a screen shows (sRGB, 0 to 255), which no single
bright sample rules. References are two halves, by bidirectional path tracing or VCM where they converge and else by SPPM with four times the light paths in less than a quarter of the
area, kept in out/rules; what is measured leaves their noise out.

Scenes that are done are kept in out/time_to_target: two hours of one core.
"""

import json

from ..options import options
from ..rules_bench import run
from ..record import ROOT, record

OUT = ROOT / "out" / "time_to_target"
# Core-seconds of the references.
REFERENCES = {"torus": 200, "pool": 200, "cornell": 300, "gems": 200, "blocks": 200, "interior": 300}
ARGUMENTS = {
    "scenes": list(REFERENCES),
    "iterations": 1000,
    "seeds": 1,
    "width": 64,
    "photons": [65536],
    "reference_seconds": None,
}
ERRORS = ["all", "photons", "display"]


def measure(scene):
    """What the bench says of a scene."""
    reference = options.reference_seconds or REFERENCES.get(scene, 300)
    file = OUT / f"{scene}-{options.width}-{options.photons[0]}-{options.iterations}-{options.seeds}-{reference:g}.json"
    if not file.exists():
        found = run(
            "race",
            scene=scene,
            width=options.width,
            photons=options.photons[0],
            iterations=options.iterations,
            seeds=options.seeds,
            reference=f"{reference:g}",
        )
        file.write_text(json.dumps(found), encoding="utf-8")
    return json.loads(file.read_text(encoding="utf-8"))


def curve(seeds, column):
    """Mean over seeds: iterations, core-seconds, error."""
    return [tuple(sum(point[k] for point in points) / len(points) for k in (0, 1, column)) for points in zip(*seeds)]


def crossing(points, target):
    """Iterations and core-seconds at which the error falls to the target for good; None where it does not. An error that the reference's noise shifts is shifted for all methods alike, and
    may be below zero: between moments, errors are straight lines against the logarithms of the others."""
    found = None
    for (n, seconds, error), (m, more, less) in zip(points, points[1:]):
        if error > target >= less:
            share = (error - target) / (error - less)
            found = [n ** (1 - share) * m**share, seconds ** (1 - share) * more**share]
    return found if points[-1][2] <= target else None


def main():
    OUT.mkdir(parents=True, exist_ok=True)
    print(
        f"{'scene':<10}{'error':<9}{'sppm':>10}   iterations and core-seconds in percent of sppm's, error after {options.iterations} in percent of its"
    )
    for scene in options.scenes:
        data = measure(scene)
        row = {
            "scene": scene,
            "size": data["size"],
            "reference": data["reference"],
            "squared_biases": data["squared_biases"],
        }
        for column, name in enumerate(ERRORS, 2):
            curves = {method: curve(seeds, column) for method, seeds in data["runs"].items()}
            _, seconds, target = curves["sppm"][-1]
            row[name] = {"target": target, "seconds": seconds}
            line = f"{scene:<10}{name:<9}{target:>10.3g}"
            for method in ("appm", "cppm"):
                found = crossing(curves[method], target)
                each = [
                    crossing([(p[0], p[1], p[column]) for p in points], sppm[-1][column])
                    for points, sppm in zip(data["runs"][method], data["runs"]["sppm"])
                ]
                left = curves[method][-1][2] / target
                row[name][method] = {"reached": found, "by_seed": each, "error": left}
                shown = (
                    f"{100 * found[0] / options.iterations:.0f} % {100 * found[1] / seconds:.0f} %"
                    if found
                    else "not reached"
                )
                spread = "/".join(f"{100 * e[0] / options.iterations:.0f}" if e else "-" for e in each)
                line += f"   {method} {shown} ({spread}), {100 * left:.0f} %"
            print(line, flush=True)
        record(
            "time-to-target",
            {
                "iterations": options.iterations,
                "width": options.width,
                "light_paths": options.photons[0],
                "seeds": options.seeds,
                **row,
            },
        )
