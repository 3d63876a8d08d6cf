#!/usr/bin/env python3
"""Guided light paths against unguided ones at equal time: relMSE of sppm whose photons bring caustics alone and of vcm, with and without, of all pixels and without the worst 0.1 %.

Settings, references and environment variables are those of auto.py.
"""

import auto
from record import record

RUNS = {
    "sppm": auto.options("sppm") + " --indirect paths",
    "sppm guided": auto.options("sppm") + " --indirect paths --guide on",
    "vcm": auto.options("vcm"),
    "vcm guided": auto.options("vcm") + " --guide on",
}


def main():
    rows = []
    print(f"{'scene':<10}{'':<16}" + "".join(f"{name:>13}" for name in RUNS) + f"{'sppm gains':>12}{'vcm gains':>12}  mean ratios, guided")
    for scene in auto.SCENES:
        data, _ = auto.measure(scene, RUNS)
        runs = {name: [p for p in data["points"] if p["run"] == name] for name in RUNS}
        seconds = min(points[-1]["cpu_seconds"] for points in runs.values())
        means = {name: points[-1]["mean_ratio"] for name, points in runs.items()}
        row = {"scene": scene, "core_seconds": seconds, "mean_ratio": means}
        for figure in ("relmse", "relmse_trimmed"):
            own = data["reference"]["error"].get(figure) or 0.0
            for point in data["points"]:
                point[figure] -= own
            errors = {name: auto.at(points, figure, seconds) for name, points in runs.items()}
            row[figure] = errors
            gains = [errors[name] / errors[f"{name} guided"] for name in ("sppm", "vcm")]
            line = f"{scene:<10}{figure:<16}" + "".join(f"{error:>13.2g}" for error in errors.values())
            print(line + "".join(f"{gain:>12.2f}" for gain in gains) + f"  {means['sppm guided']:.4f} {means['vcm guided']:.4f}", flush=True)
        rows.append(row)
    record("guide", {"seconds": auto.SECONDS, "width": auto.WIDTH, "reference_seconds": auto.REFERENCE, "scenes": rows})


if __name__ == "__main__":
    main()
