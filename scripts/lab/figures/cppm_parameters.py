"""CPPM's error by k and beta, by n_a and n_s, and by its significance: tables 2 to 4 of [CPPM 2020].

It measures errors of photons' light relative to those of the paper's default (k 0.8, beta 1.2, n_a 2, n_s 6,
significance 0.05), seed by seed: the mean ratio and its standard error, also of SPPM. References are kept in out/rules.
"""

from ..options import options
from ..rules_bench import bench_options, run
from ..record import record

ARGUMENTS = {
    "scenes": ["pool", "blocks"],
    "iterations": 150,
    "seeds": 8,
    "width": 64,
    "photons": [4096],
    "reference_seconds": 80.0,
}
NAMES = {"photons": "photons' light", "display": "on a screen"}


def ratio(errors, default, key):
    """The mean over seeds of the ratio to the default's error, and its standard error."""
    ratios = [a[key] / b[key] for a, b in zip(errors, default)]
    mean = sum(ratios) / len(ratios)
    return mean, (sum((r - mean) ** 2 for r in ratios) / max(len(ratios) * (len(ratios) - 1), 1)) ** 0.5


def setting(row):
    """The parameters that a row varies, as text."""
    return {
        "rate": f"k {row['k']:g}, beta {row['beta']:g}",
        "partition": f"n_a {row['annuli']}, n_s {row['sectors']}",
        "significance": f"significance {row['significance']:g}",
    }[row["table"]]


def main():
    for scene in options.scenes:
        found = run("parameters", scene=scene, **bench_options())
        default = found["rows"][0]["errors"]
        for key, name in NAMES.items():
            print(f"{scene}, {name}: mean squared error {sum(e[key] for e in default) / options.seeds:.4g} by default")
            for row in found["rows"][1:]:
                row[key] = ratio(row["errors"], default, key)
                print(f"  {setting(row):<20}{row[key][0]:.3f} +- {row[key][1]:.3f}", flush=True)
            found["sppm_" + key] = ratio(found["sppm"], default, key)
            print("  {:<20}{:.3f} +- {:.3f}".format("sppm", *found["sppm_" + key]), flush=True)
        record("cppm-parameters", found)
