#!/usr/bin/env python3
"""What bandwidths of their own could bring to `vcm`, place by place: the most that any rule can gain by them.

A render with five levels estimates the picture with five bandwidths from the same paths. Of each block of BLOCK x BLOCK
pixels the level with the least error is taken, by the reference: no rule knows that much. `gain` is the error of the
one level that is best for the whole picture over that of these. Chosen by one seed and judged by another (`fair`), it is
what a rule could hope for that tells errors as well as a render of this length lets one; chosen and judged by the same
(`bound`), it flatters the choice.

  SECONDS_EACH   core-seconds of a render [2]
  BLOCK          [8]
  SET [all], SCENES, SEEDS [2], WIDTH [96], THREADS [1], REFERENCE_SECONDS [30]   as in finished.py

Stores the figure `vcm_bandwidths`.
"""

import os
import sys

os.environ.setdefault("LEVELS", "default")

import _speed  # noqa: E402
import numpy as np  # noqa: E402
from _accuracy import geometric, short  # noqa: E402
from _cache import BIN, program  # noqa: E402
from _pictures import TRIM, Layers  # noqa: E402
from record import record  # noqa: E402

LEVELS = 5
BLOCK = int(os.environ.get("BLOCK", "8"))
OPTIONS = ["--method", "vcm", "--levels", str(LEVELS)]


def blocks(errors, kept):
    """Sums of errors (level, row, column) over the kept pixels of each block: (level, block)."""
    levels, height, width = errors.shape
    rows, columns = -(-height // BLOCK), -(-width // BLOCK)
    room = np.zeros((levels, rows * BLOCK, columns * BLOCK))
    room[:, :height, :width] = np.where(kept, errors, 0)
    return room.reshape(levels, rows, BLOCK, columns, BLOCK).sum((2, 4)).reshape(levels, -1)


def errors(layers, reference):
    """Squared errors of the levels (level, row, column), relative; the halves' noise drops out on average."""
    pictures = [layers.get(f"Level{level + 1}").astype(float) for level in range(LEVELS)]
    halves = reference.halves
    return np.stack([((one - halves[0]) * (one - halves[1])).mean(-1) * reference.weight for one in pictures])


def measure(found):
    """Gains by renders of some seeds, errors of the levels each."""
    # The pixels with the largest errors of any are left out, of all alike.
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
    one, rows = _speed.Program(BIN), []
    print(f"{'':<20}{'best':>6}{'fair':>7}{'bound':>7}  errors of the levels over the best one's")
    for scene, name, reference in _speed.references():
        try:
            seeds = range(1, _speed.SEEDS + 1)
            found = [errors(Layers(one.done(scene, OPTIONS, seed) / "picture.exr"), reference) for seed in seeds]
        except _speed.Failed as failed:
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
    settings = {**_speed.SETTINGS, "block": BLOCK, "program": program()}
    record("vcm_bandwidths", {**settings, **gains, "first_level": own, "rows": rows})


if __name__ == "__main__":
    main()
