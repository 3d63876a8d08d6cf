"""What iterations that go where the error is would gain, by the renders of calibration.py: tiles of 16 x 16 pixels get
eye paths in proportion to e^(1/(1 + 2 s)), the best for errors that fall with e n^(-2 s), by the layer `Error` (at
least half of what all get on average, so that what is not told is found), and what is left of the true squared error is
summed. `best` allots by the true errors themselves, which nobody knows. Light paths, which all tiles share, are taken
to cost nothing: what is gained is less.
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
SIDE, POWER, LEAST = 16, 0.35, 0.5


def tiles(values):
    """Means over whole tiles."""
    height, width = (side // SIDE * SIDE for side in values.shape)
    return values[:height, :width].reshape(height // SIDE, SIDE, width // SIDE, SIDE).mean((1, 3)).ravel()


def left(true, told, least):
    """The share of the squared error that is left where paths go by what is told."""
    paths = told ** (1 / (1 + 2 * POWER))
    paths = np.maximum(paths / paths.mean(), least)
    return float((true * (paths / paths.mean()) ** (-2 * POWER)).sum() / true.sum())


def measured(folder, truth):
    """What is left by the errors told, and by the true ones."""
    layers = Layers(folder / "picture.exr")
    picture, error = layers.get("").astype(float), layers.get("Error").astype(float)
    first, second = (picture - half for half in truth.halves)
    square = np.square(picture - truth.mean).mean(-1) * truth.weight
    kept = square <= np.quantile(square, 1 - TRIM)
    true = np.maximum(tiles(np.where(kept, (first * second).mean(-1) * truth.weight, 0)), 0)
    told = np.maximum(tiles(np.square(error).mean(-1) * truth.weight), 1e-12)
    return left(true, told, LEAST), left(true, np.maximum(true, 1e-9), 0.01)


def main():
    rows = []
    print(f"{'':<22}{'told':>8}{'best':>8}")
    for scene, truth in accuracy.truths():
        for method in options.methods:
            folders = [
                accuracy.rendered(scene, method, ["--time", options.budgets[-1]], seed)
                for seed in range(1, options.seeds + 1)
            ]
            told, best = (geometric(values) for values in zip(*(measured(folder, truth) for folder in folders)))
            rows.append([references.name(scene), method, round(told, 3), round(best, 3)])
            print(f"{rows[-1][0]:<22}{told:>8.2f}{best:>8.2f}", flush=True)
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
