"""Iterations and core-seconds in which APPM and CPPM reach the error of SPPM after 1,000 iterations, on six scenes: table 1
of [CPPM 2020].

Renders have one level, bandwidths from ten neighbours, 2^16 light paths, a width of 64 pixels, and equal seeds, hence
equal photon maps. Three mean squared errors are measured: of all light; of photons' light alone, in which the rules
differ; and of screen values (sRGB, 0 to 255), which single bright samples do not dominate. References have two halves,
so that their noise cancels, by bidirectional path tracing or VCM where these converge, else by SPPM with four times the
light paths in less than a quarter of the area. They are kept in out/rules.

Finished scenes are kept in out/time_to_target. All scenes take two hours of one core.
"""

import json

from ..options import options
from ..rules_bench import run
from ..record import ROOT, record

OUT = ROOT / "out" / "time_to_target"
# Core-seconds of the references, by scene.
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
    """The result of the bench for a scene."""
    reference = options.reference_seconds or REFERENCES.get(scene, 300)
    file = OUT / f"{scene}-{options.width}-{options.photons[0]}-{options.iterations}-{options.seeds}-{reference:g}.json"
    if not file.exists():
        settings = {"width": options.width, "photons": options.photons[0], "iterations": options.iterations}
        found = run("race", scene=scene, **settings, seeds=options.seeds, reference=f"{reference:g}")
        file.write_text(json.dumps(found), encoding="utf-8")
    return json.loads(file.read_text(encoding="utf-8"))


def curve(seeds, column):
    """The points (iterations, core-seconds, error) of a method, as means over the seeds."""
    return [tuple(sum(point[k] for point in points) / len(points) for k in (0, 1, column)) for points in zip(*seeds)]


def crossing(points, target):
    """The iterations and core-seconds from which the error stays at or below the target, or None. Errors are interpolated
    linearly against the logarithms of iterations and core-seconds, because the reference's noise can make them negative."""
    found = None
    for (n, seconds, error), (m, more, less) in zip(points, points[1:]):
        if error > target >= less:
            share = (error - target) / (error - less)
            found = [n ** (1 - share) * m**share, seconds ** (1 - share) * more**share]
    return found if points[-1][2] <= target else None


def main():
    OUT.mkdir(parents=True, exist_ok=True)
    columns = f"iterations and core-seconds, and error after {options.iterations}, in percent of sppm's"
    print(f"{'scene':<10}{'error':<9}{'sppm':>10}   {columns}")
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
                shown = "not reached"
                if found:
                    shown = f"{100 * found[0] / options.iterations:.0f} % {100 * found[1] / seconds:.0f} %"
                spread = "/".join(f"{100 * e[0] / options.iterations:.0f}" if e else "-" for e in each)
                line += f"   {method} {shown} ({spread}), {100 * left:.0f} %"
            print(line, flush=True)
        settings = {key: getattr(options, key) for key in ("iterations", "width", "seeds")}
        record("time-to-target", {**settings, "light_paths": options.photons[0], **row})
