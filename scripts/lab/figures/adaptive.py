"""The gain of adaptive sampling, simulated on the renders of calibration.py. Tiles of 16 x 16 pixels get camera paths in
proportion to e^(1/(1 + 2 s)), where e is the squared error by the layer `Error`; this is optimal for errors e n^(-2 s).
Each tile gets at least half of the average, so that light without estimated error is found. The result is the remaining
share of the true squared error. `best` uses the true errors, which a render does not know. The simulation neglects the
cost of light paths, which all tiles share, so the real gain is smaller.
"""

from .. import accuracy
from .. import references
import numpy as np
from ..accuracy import geometric
from ..cache import program
from ..options import options
from ..picture_errors import TRIM, Layers
from ..record import record

ARGUMENTS = accuracy.ARGUMENTS
# Pixels of a tile's side, the exponent s, and the least number of paths, relative to the average.
SIDE, POWER, MIN_PATHS = 16, 0.35, 0.5


def tiles(values):
    """The means over the tiles that lie wholly in the picture."""
    height, width = (side // SIDE * SIDE for side in values.shape)
    return values[:height, :width].reshape(height // SIDE, SIDE, width // SIDE, SIDE).mean((1, 3)).ravel()


def remaining(true, estimated, least):
    """The remaining share of the true squared error if paths follow the estimated error."""
    paths = estimated ** (1 / (1 + 2 * POWER))
    paths = np.maximum(paths / paths.mean(), least)
    return float((true * (paths / paths.mean()) ** (-2 * POWER)).sum() / true.sum())


def measure(folder, truth):
    """The remaining shares of the squared error if paths follow the estimated, and the true, errors of a render."""
    layers = Layers(folder / "picture.exr")
    picture, error = layers.get("").astype(float), layers.get("Error").astype(float)
    first, second = (picture - half for half in truth.halves)
    square = np.square(picture - truth.mean).mean(-1) * truth.weight
    kept = square <= np.quantile(square, 1 - TRIM)
    true = np.maximum(tiles(np.where(kept, (first * second).mean(-1) * truth.weight, 0)), 0)
    estimated = np.maximum(tiles(np.square(error).mean(-1) * truth.weight), 1e-12)
    return remaining(true, estimated, MIN_PATHS), remaining(true, np.maximum(true, 1e-9), 0.01)


def main():
    rows = []
    print(f"{'':<22}{'Error':>8}{'best':>8}")
    for scene, truth in accuracy.truths():
        for method in options.methods:
            stop = ["--time", options.budgets[-1]]
            folders = [accuracy.render(scene, method, stop, seed) for seed in range(1, options.seeds + 1)]
            estimated, best = (geometric(values) for values in zip(*(measure(folder, truth) for folder in folders)))
            rows.append([references.name(scene), method, round(estimated, 3), round(best, 3)])
            print(f"{rows[-1][0]:<22}{estimated:>8.2f}{best:>8.2f}", flush=True)
    means = [round(geometric([row[column] for row in rows]), 3) for column in (2, 3)]
    print(f"{'geometric mean':<22}{means[0]:>8.2f}{means[1]:>8.2f}")
    values = {
        "program": program(),
        "width": options.width,
        "threads": options.threads,
        "seeds": options.seeds,
        "budget": options.budgets[-1],
    }
    record("adaptive", values | {"told": means[0], "best": means[1], "rows": rows})
