"""CPPM's error by k and beta, by n_a and n_s, and by its significance: Tables 2 to 4 of [CPPM 2020].

Errors of photons' light against that with the paper's default (k 0.8, beta 1.2, n_a 2, n_s 6, significance 0.05), seed by seed: the mean ratio and its standard error. SPPM's is beside them.

References are kept in out/rules.
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


def ratio(errors, usual, key):
    """Mean over seeds of the ratio to the default, and its standard error."""
    ratios = [a[key] / b[key] for a, b in zip(errors, usual)]
    mean = sum(ratios) / len(ratios)
    return mean, (sum((r - mean) ** 2 for r in ratios) / max(len(ratios) * (len(ratios) - 1), 1)) ** 0.5


def main():
    for scene in options.scenes:
        found = run("parameters", scene=scene, **bench_options())
        usual = found["rows"][0]["errors"]
        for key, name in NAMES.items():
            print(f"{scene}, {name}: mean squared error {sum(e[key] for e in usual) / options.seeds:.4g} by default")
            for row in found["rows"][1:]:
                row[key] = ratio(row["errors"], usual, key)
                setting = (
                    f"k {row['k']:g}, beta {row['beta']:g}"
                    if row["table"] == "rate"
                    else f"significance {row['significance']:g}"
                )
                setting = f"n_a {row['annuli']}, n_s {row['sectors']}" if row["table"] == "partition" else setting
                print(f"  {setting:<20}{row[key][0]:.3f} +- {row[key][1]:.3f}", flush=True)
            found["sppm_" + key] = ratio(found["sppm"], usual, key)
            print("  {:<20}{:.3f} +- {:.3f}".format("sppm", *found["sppm_" + key]), flush=True)
        record("cppm-parameters", found)
