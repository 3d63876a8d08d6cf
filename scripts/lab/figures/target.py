"""Renders with `--target-error`: the true error over the target, the time over the shortest possible time, and the time
that the progress line predicted. `outlook` has the predictions of `caustique plan`.

The target is the geometric mean of the true errors of calibration.py's pictures at the last budget but one. The shortest
time follows from the true errors at all budgets, interpolated in the logarithms. Times are wall-clock times, so the
machine must be idle. Stores the figures `target` and `prediction`.
"""

import math
import statistics

from .. import accuracy
from .. import references
from ..accuracy import geometric, short
from ..cache import program
from ..options import options as given
from ..record import record

# Predictions count from this share of the time on; a correct one is off by at most this share.
FROM, WITHIN = 0.1, 0.3
ARGUMENTS = accuracy.ARGUMENTS
# The largest ratios of true error and target, and of time and shortest time, that count as good.
FACTOR, LONGER = 1.5, 1.3


def crossing(points, error):
    """The seconds at which the error falls to `error`, as a power law between two points; outside all points, the nearest
    two are extrapolated."""
    points = sorted(points)
    pairs = list(zip(points, points[1:]))
    chosen = next((pair for pair in pairs if pair[0][1] >= error >= pair[1][1]), None)
    chosen = chosen or (pairs[0] if error > points[0][1] else pairs[-1])
    (t0, e0), (t1, e1) = chosen
    power = math.log(e1 / e0) / math.log(t1 / t0)
    return t0 * (error / e0) ** (1 / power) if power < -0.02 else math.nan


def predictions(folder, error, end):
    """The predictions of a render's end by its progress reports: pairs of the time of the report and the predicted time of
    the end, both relative to the real end."""
    reports = [(line["seconds"], line["expected"]) for line in accuracy.progress(folder) if line.get("expected")]
    found = [(now, expected["seconds"]) for now, expected in reports if abs(expected["error"] - error) < 1e-9]
    return [(now / end, (now + more) / end) for now, more in found]


def measure(scene, method, truth):
    """The row of a scene."""
    points = []
    for budget in given.budgets:
        folders = [accuracy.render(scene, method, ["--time", budget], seed) for seed in range(1, given.seeds + 1)]
        results = [accuracy.evaluate(folder, truth) for folder in folders]
        seconds = statistics.mean(one["seconds"] for one in results)
        points.append((seconds, geometric([max(one["true"], 1e-6) for one in results])))
    error = float(f"{points[-2][1]:.3g}")
    rows = []
    for seed in range(1, given.seeds + 1):
        # The time limit is far above the expected time.
        stop = ["--target-error", error, "--time", 10 * given.budgets[-1]]
        folder = accuracy.render(scene, method, stop, 100 + seed)
        end = accuracy.progress(folder)[-1]["seconds"]
        rows.append(accuracy.evaluate(folder, truth) | {"predictions": predictions(folder, error, end)})
    shortest = crossing(points, error)
    taken = statistics.mean(row["seconds"] for row in rows)
    late = [predicted for row in rows for share, predicted in row["predictions"] if share >= FROM]
    return {
        "scene": references.name(scene),
        "method": method,
        "error": error,
        "true": geometric([max(row["true"], 1e-6) for row in rows]) / error,
        "seconds": taken,
        "longer": taken / shortest,
        "predicted": statistics.median(late) if late else None,
        "right": sum(abs(predicted - 1) <= WITHIN for predicted in late) / len(late) if late else None,
    }


def main():
    rows = []
    columns = {"target": 8, "true over it": 14, "seconds": 9, "over shortest": 15, "predicted": 11, "in 30 %": 9}
    print(" " * 22 + "".join(f"{name:>{width}}" for name, width in columns.items()))
    for scene, truth in accuracy.truths():
        for method in given.methods:
            row = measure(scene, method, truth)
            rows.append(row)
            text = f"{row['scene']:<22}{row['error']:>8.2%}{row['true']:>14.2f}"
            text += f"{row['seconds']:>9.1f}{row['longer']:>15.2f}"
            text += f"{row['predicted']:>11.2f}{row['right']:>9.0%}" if row["predicted"] else f"{'-':>11}{'-':>9}"
            print(text, flush=True)
    known = [row for row in rows if row["predicted"]]
    settings = {"program": program(), **{key: getattr(given, key) for key in ("width", "threads", "seeds", "budgets")}}
    counts = {
        "scenes": len(rows),
        "true": sum(1 / FACTOR <= row["true"] <= FACTOR for row in rows),
        "longer": sum(row["longer"] <= LONGER for row in rows),
    }
    predicted = {
        "scenes": len(rows),
        "told": len(known),
        "predicted": sum(abs(row["predicted"] - 1) <= WITHIN for row in known),
    }
    print(f"\ntrue within {FACTOR} of it: {counts['true']} of {counts['scenes']}")
    print(f"no more than {LONGER} of the shortest: {counts['longer']} of {counts['scenes']}")
    print(f"predicted within 30 %: {predicted['predicted']} of {predicted['scenes']}")

    def stored(row, *keys):
        return {"scene": row["scene"], **{key: short(row[key]) for key in keys}}

    stops = [stored(row, "error", "true", "seconds", "longer") for row in rows]
    record("target", settings | counts | {"rows": stops})
    predictions_of = [stored(row, "predicted", "right") for row in rows]
    record("prediction", settings | predicted | {"rows": predictions_of})
