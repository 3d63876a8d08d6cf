"""What `--target-error` stops at: the truth over the error asked for, and the time over the shortest that would have
done; and what the progress line and `caustique plan` have said of that time before.

The error asked for is the true one of calibration.py's pictures at the next to last of the budgets, their geometric
mean. The shortest time follows from the true errors of all its budgets, by interpolation in the logarithms. Clocks
count: the machine must be quiet. Stores the figures `target` and `prediction`.
"""

import math
import statistics

from .. import accuracy
from .. import references
from ..accuracy import geometric, short
from ..cache import program
from ..options import options as given
from ..reading import read
from ..record import record

# A prediction counts from this share of the time on, and should be so close to what comes true.
FROM, WITHIN = 0.1, 0.3
ARGUMENTS = accuracy.ARGUMENTS
FACTOR, LONGER = 1.5, 1.3


def crossing(points, error):
    """Seconds at which errors, falling as powers between points, are as small as one; from the nearest two outside."""
    points = sorted(points)
    pairs = list(zip(points, points[1:]))
    chosen = next((pair for pair in pairs if pair[0][1] >= error >= pair[1][1]), None)
    chosen = chosen or (pairs[0] if error > points[0][1] else pairs[-1])
    (t0, e0), (t1, e1) = chosen
    power = math.log(e1 / e0) / math.log(t1 / t0)
    return t0 * (error / e0) ** (1 / power) if power < -0.02 else math.nan


def predictions(folder, error, end):
    """What was said of the end while the render went on: the time then over the time it took, and the end told over the
    end."""
    said = [(line["seconds"], line["expected"]) for line in accuracy.progress(folder) if line.get("expected")]
    return [(now / end, (now + told["seconds"]) / end) for now, told in said if abs(told["error"] - error) < 1e-9]


def measure(scene, method, truth):
    """A row for a scene."""
    points = []
    for budget in given.budgets:
        judged = [
            accuracy.judged(accuracy.rendered(scene, method, ["--time", budget], seed), truth)
            for seed in range(1, given.seeds + 1)
        ]
        seconds = statistics.mean(one["seconds"] for one in judged)
        points.append((seconds, geometric([max(one["true"], 1e-6) for one in judged])))
    error = float(f"{points[-2][1]:.3g}")
    rows = []
    for seed in range(1, given.seeds + 1):
        # As long again as ought to do ten times over.
        stop = ["--target-error", error, "--time", 10 * given.budgets[-1]]
        folder = accuracy.rendered(scene, method, stop, 100 + seed)
        end = accuracy.progress(folder)[-1]["seconds"]
        rows.append(accuracy.judged(folder, truth) | {"said": predictions(folder, error, end)})
    shortest = crossing(points, error)
    taken = statistics.mean(row["seconds"] for row in rows)
    late = [told for row in rows for share, told in row["said"] if share >= FROM]
    options = [
        "--target-error",
        str(error),
        "--method",
        method,
        "--width",
        str(given.width),
        "--threads",
        str(given.threads),
    ]
    outlook = read("plan", str(scene), *options).get("outlook")
    return {
        "scene": references.name(scene),
        "method": method,
        "error": error,
        "true": geometric([max(row["true"], 1e-6) for row in rows]) / error,
        "seconds": taken,
        "longer": taken / shortest,
        "predicted": statistics.median(late) if late else None,
        "right": sum(abs(told - 1) <= WITHIN for told in late) / len(late) if late else None,
        "planned": outlook["seconds"] / taken if outlook else None,
    }


def main():
    rows = []
    columns = {
        "error": 8,
        "true over it": 14,
        "seconds": 9,
        "over shortest": 15,
        "predicted": 11,
        "in 30 %": 9,
        "plan": 7,
    }
    print(" " * 22 + "".join(f"{name:>{width}}" for name, width in columns.items()))
    for scene, truth in accuracy.truths():
        for method in given.methods:
            row = measure(scene, method, truth)
            rows.append(row)
            text = f"{row['scene']:<22}{row['error']:>8.2%}{row['true']:>14.2f}"
            text += f"{row['seconds']:>9.1f}{row['longer']:>15.2f}"
            text += f"{row['predicted']:>11.2f}{row['right']:>9.0%}" if row["predicted"] else f"{'-':>11}{'-':>9}"
            print(text + (f"{row['planned']:>7.2f}" if row["planned"] else f"{'-':>7}"), flush=True)
    known = [row for row in rows if row["predicted"]]
    said = {
        "program": program(),
        "width": given.width,
        "threads": given.threads,
        "seeds": given.seeds,
        "budgets": given.budgets,
    }
    counts = {
        "scenes": len(rows),
        "true": sum(1 / FACTOR <= row["true"] <= FACTOR for row in rows),
        "longer": sum(row["longer"] <= LONGER for row in rows),
    }
    foretold = {
        "scenes": len(rows),
        "told": len(known),
        "predicted": sum(abs(row["predicted"] - 1) <= WITHIN for row in known),
        "planned": sum(abs(math.log(row["planned"])) <= math.log(2) for row in rows if row["planned"]),
    }
    print(f"\ntrue within {FACTOR} of it: {counts['true']} of {counts['scenes']}")
    print(f"no more than {LONGER} of the shortest: {counts['longer']} of {counts['scenes']}")
    print(f"predicted within 30 %: {foretold['predicted']} of {foretold['scenes']}")
    print(f"planned within a factor of 2: {foretold['planned']} of {foretold['scenes']}")

    def stored(row, *keys):
        return {"scene": row["scene"], **{key: short(row[key]) for key in keys}}

    stops = [stored(row, "error", "true", "seconds", "longer") for row in rows]
    record("target", said | counts | {"rows": stops})
    predictions_of = [stored(row, "predicted", "right", "planned") for row in rows]
    record("prediction", said | foretold | {"rows": predictions_of})
