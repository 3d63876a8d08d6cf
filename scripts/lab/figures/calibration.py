"""The estimated error of finished pictures beside the true error, by scene, budget and seed. Draws
docs/lab/calibration.svg from the stored figure if .venv-python exists (scripts/python.sh).

An estimate counts as correct if it is within a factor of 1.5 of the true error; the interval should contain the true
error in nine pictures of ten. If half a per cent of the pixels holds more than half of the noise, the render warns, and
the picture is counted separately.
"""

import subprocess

from .. import accuracy
from .. import references
from ..accuracy import geometric, short
from ..cache import program
from ..options import options
from ..record import ROOT, record

ARGUMENTS = accuracy.ARGUMENTS | {"name": None}
# The largest ratio of a correct estimate, and the largest share of the noise in few pixels without a warning.
FACTOR, RARE = 1.5, 0.5


def rows():
    """Yields the estimated and the true error of every picture, as a dict."""
    for scene, truth in accuracy.truths():
        for method in options.methods:
            for budget in options.budgets:
                for seed in range(1, options.seeds + 1):
                    folder = accuracy.render(scene, method, ["--time", budget], seed)
                    row = {"scene": references.name(scene), "asked": method, "budget": budget, "seed": seed}
                    yield row | accuracy.evaluate(folder, truth)


def summary(rows):
    """Statistics of the pictures that have an estimate: ratios to the true error, correct ones, correct intervals."""
    estimated = [row for row in rows if row["estimated"] and row["true"] > 0]
    ratios = [row["estimated"] / row["true"] for row in estimated]
    if not estimated:
        return {"pictures": len(rows), "told": 0}
    inside = sum(row["interval"][0] <= row["true"] <= row["interval"][1] for row in estimated)
    noisy = [row for row in estimated if row["estimated_noisy"] and row["true_noisy"] > 0]
    return {
        "pictures": len(rows),
        "told": len(estimated),
        "within": sum(1 / FACTOR <= ratio <= FACTOR for ratio in ratios),
        "geometric_mean": round(geometric(ratios), 3),
        "least": round(min(ratios), 3),
        "most": round(max(ratios), 3),
        "inside": inside,
        "noisy": round(geometric([row["estimated_noisy"] / row["true_noisy"] for row in noisy]), 3) if noisy else None,
        "pixels_within_2": round(sum(row["pixels_within_2"] for row in estimated) / len(estimated), 3),
    }


def line(label, found):
    """Returns a row of the printed table."""
    if not found.get("told"):
        return f"{label:<28}{found['pictures']:>9}{0:>6}"
    text = f"{label:<28}{found['pictures']:>9}{found['told']:>6}{found['within']:>8}{found['geometric_mean']:>8.2f}"
    text += f"{found['least']:>7.2f}{found['most']:>7.2f}{found['inside']:>8}{found['pixels_within_2']:>9.1%}"
    return text + (f"{found['noisy']:>8.2f}" if found["noisy"] else "")


def main():
    found = []
    for row in rows():
        found.append(row)
        estimated = f"{row['estimated']:.4f}" if row["estimated"] else "nothing"
        print(
            f"{row['scene']:<20}{row['asked']:<6}{row['budget']:>5g} s seed {row['seed']}: estimated {estimated:>8}, "
            f"true {row['true']:.4f}, rare {row['rare'] or 0:.2f}, {row['iterations']} iterations",
            flush=True,
        )
    usual = [row for row in found if (row["rare"] or 0) <= RARE]
    parts = {f"{budget:g} s": [row for row in usual if row["budget"] == budget] for budget in options.budgets}
    parts |= {name: [row for row in usual if row["scene"] == name] for name in dict.fromkeys(r["scene"] for r in usual)}
    parts |= {"all": usual, "warned of": [row for row in found if (row["rare"] or 0) > RARE]}
    columns = {"pictures": 9, "known": 6, "in 1.5": 8, "mean": 8, "least": 7, "most": 7, "inside": 8, "pixels": 9}
    columns["noisy"] = 8
    print("\n" + " " * 28 + "".join(f"{name:>{width}}" for name, width in columns.items()))
    summaries = {label: summary(part) for label, part in parts.items() if part}
    for label, one in summaries.items():
        print(line(label, one))
    values = {
        "program": program(),
        "width": options.width,
        "threads": options.threads,
        "seeds": options.seeds,
        "budgets": options.budgets,
    }
    values |= {"methods": options.methods, "parts": summaries}
    values |= {"set": options.name} if options.name else {}
    values["rows"] = [
        [row["scene"], row["budget"], row["seed"], *map(short, (row["estimated"], row["true"], row["rare"]))]
        for row in found
    ]
    record("calibration", values)
    python = ROOT / ".venv-python" / "bin" / "python"
    if python.exists():
        subprocess.run([python, "-m", "lab.calibration_plot"], check=True)
