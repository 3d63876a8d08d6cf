"""The largest possible gain of a rule that chooses local bandwidths for `vcm`.

A render with five levels estimates the picture with five bandwidths from the same paths. For each block of pixels the
level with the least error against the reference is chosen, which no rule knows. The gain is the error of the best single
level over the error of these choices. `fair` chooses by one seed and evaluates by another, like a rule that knows the
errors as well as a render of this length does. `bound` chooses and evaluates by one seed, which overestimates the gain.

Stores the figure `vcm_bandwidths`.
"""

import sys

import numpy as np

from .. import speed_runs
from ..accuracy import geometric, short
from ..cache import BIN, program
from ..options import options
from ..picture_errors import TRIM, Layers
from ..record import record

ARGUMENTS = speed_runs.ARGUMENTS | {"levels": "default", "block": 8}
LEVELS = 5
OPTIONS = ["--method", "vcm", "--levels", str(LEVELS)]


def blocks(errors, kept):
    """Sums of errors (level, row, column) over the kept pixels of each block, of shape (level, block)."""
    levels, height, width = errors.shape
    rows, columns = -(-height // options.block), -(-width // options.block)
    padded = np.zeros((levels, rows * options.block, columns * options.block))
    padded[:, :height, :width] = np.where(kept, errors, 0)
    return padded.reshape(levels, rows, options.block, columns, options.block).sum((2, 4)).reshape(levels, -1)


def errors(layers, reference):
    """Relative squared errors of the levels, of shape (level, row, column); the noise of the halves cancels on average."""
    pictures = [layers.get(f"Level{level + 1}").astype(float) for level in range(LEVELS)]
    halves = reference.halves
    return np.stack([((one - halves[0]) * (one - halves[1])).mean(-1) * reference.weight for one in pictures])


def measure(found):
    """The gains, from the errors of the levels for each seed."""
    # All renders leave out the same pixels, those with the largest errors of any level and seed.
    worst = sum(np.nan_to_num(one, nan=np.inf).max(0) for one in found)
    kept = worst <= np.quantile(worst, 1 - TRIM)
    sums = [blocks(one, kept) for one in found]
    own, fair, bound = [], [], []
    for judge, chooser in zip(sums, sums[1:] + sums[:1]):
        own.append(judge.sum(1))
        places = np.arange(judge.shape[1])
        fair.append(judge[chooser.argmin(0), places].sum())
        bound.append(judge.min(0).sum())
    whole = np.mean(own, 0)
    best = int(whole.argmin())
    return {
        "levels": [short(error / whole[best]) for error in whole],
        "best": best + 1,
        "fair": short(whole[best] / np.mean(fair)),
        "bound": short(whole[best] / np.mean(bound)),
    }


def main():
    one, rows = speed_runs.Program(BIN), []
    print(f"{'':<20}{'best':>6}{'fair':>7}{'bound':>7}  errors of the levels over the best one's")
    for scene, name, reference in speed_runs.with_references():
        try:
            seeds = range(1, options.seeds + 1)
            found = [
                errors(Layers(one.render_folder(scene, OPTIONS, seed) / "picture.exr"), reference) for seed in seeds
            ]
        except speed_runs.Failed as failed:
            print(f"{name:<20}{failed}", flush=True)
            continue
        rows.append({"scene": name, **measure(found)})
        row = rows[-1]
        levels = "".join(f"{level:>7.2f}" for level in row["levels"])
        print(f"{name:<20}{row['best']:>6}{row['fair']:>7.2f}{row['bound']:>7.2f}  {levels}", flush=True)
    if not rows:
        sys.exit("vcm_bandwidths: error: no scene could be measured")
    gains = {of: short(geometric([row[of] for row in rows])) for of in ("fair", "bound")}
    own = short(geometric([row["levels"][0] for row in rows]))
    print(f"geometric means: fair {gains['fair']:.2f}, bound {gains['bound']:.2f}; level 1 over the best {own:.2f}")
    settings = {**speed_runs.settings(), "block": options.block, "program": program()}
    record("vcm_bandwidths", {**settings, **gains, "first_level": own, "rows": rows})
