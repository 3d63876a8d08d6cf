"""Errors that renders estimate, and their true errors.

The true error is measured as renders define theirs: the root of relMSE without the worst half per cent of the pixels.
The denominator adds 0.01 times the squared mean of the reference, without its brightest hundredth (src/stat/floor.rs).
The reference consists of two independent halves, whose own noise cancels.
"""

import json
import math
import subprocess
import sys

from . import references
import numpy as np
from .cache import CACHE, Failed, create, load, program, save, scene_key
from .commands import command, read
from .options import options
from .picture_errors import Layers, Reference, keep_best

ARGUMENTS = references.ARGUMENTS | {"methods": ["auto"], "seeds": 3, "budgets": [2.0, 4.0, 8.0, 16.0]}
# The brightest share of the pixels, which the mean leaves out, and the factor of the squared mean in the denominator.
BRIGHTEST, DARK = 0.01, 0.01
LAYERS = "beauty,Noisy,Error"
PLACE = CACHE / "accuracy" / program()


class Truth(Reference):
    """A reference whose relative errors have the denominator that renders use."""

    def __init__(self, first, second):
        super().__init__(first, second)
        values = np.sort(self.mean.mean(-1)[self.finite])
        kept = values[: len(values) - int(BRIGHTEST * len(values))]
        self.weight = 1.0 / (self.mean.mean(-1) ** 2 + DARK * kept.mean() ** 2)
        # Variance of the reference's mean: a quarter of the squared difference of the halves, averaged over a window.
        self.noise = box(np.square(self.halves[0] - self.halves[1]) / 4)

    def distance(self, picture):
        """The root of trimmed relMSE; zero if the reference's noise hides the error."""
        first, second = (picture - half for half in self.halves)
        kept = keep_best(np.square(picture - self.mean).mean(-1) * self.weight, self.finite)
        squares = ((first * second).mean(-1) * self.weight)[self.finite][kept]
        return math.sqrt(max(squares.mean(), 0.0))

    def share_within(self, picture, error, factor):
        """Share of the pixels and channels whose true error is at most `factor` times the estimated error."""
        return float((np.square(picture - self.mean) <= factor**2 * (np.square(error) + self.noise)).mean())


def truths():
    """The selected scenes that have a reference, each with its truth; prints why others have none."""
    for scene in references.scenes():
        try:
            halves, _ = references.reference(scene)
        except Failed as failed:
            print(f"{references.name(scene)}: no reference: {failed}", file=sys.stderr)
            continue
        yield scene, Truth.read(halves)


def box(values, reach=4):
    """Means over square windows of 2 `reach` + 1 pixels, which are cut off at the rim of the picture."""
    for axis in (0, 1):
        count = values.shape[axis]
        sums = np.concatenate([np.zeros_like(np.take(values, [0], axis)), np.cumsum(values, axis)], axis)
        index = np.arange(count)
        low, high = np.maximum(index - reach, 0), np.minimum(index + reach + 1, count)
        shape = [-1 if i == axis else 1 for i in range(values.ndim)]
        values = (np.take(sums, high, axis) - np.take(sums, low, axis)) / (high - low).reshape(shape)
    return values


def render(scene, method, stop, seed):
    """Renders until a stop such as ("--time", 4), unless the cache has the render; returns its folder, which holds
    picture.exr, run.json and progress.jsonl."""
    name = f"{method}{'-'.join(map(str, stop))}-{options.threads}-seed{seed}-{options.width}"
    folder = PLACE / scene_key(scene) / name
    if not (folder / "run.json").exists():
        with create(folder) as draft:
            words = ["render", scene, "-o", draft / "picture.exr", *stop]
            size = {"width": options.width, "threads": options.threads}
            line = command(*words, method=method, seed=seed, **size, layers=LAYERS, progress="json")
            with open(draft / "progress.jsonl", "w", encoding="utf-8") as log:
                subprocess.run(line, check=True, stderr=log)
            save(draft / "run.json", read("info", draft / "picture.exr"))
    return folder


def progress(folder):
    """The progress reports of a render."""
    lines = (folder / "progress.jsonl").read_text(encoding="utf-8").splitlines()
    events = [json.loads(line) for line in lines if line.startswith("{")]
    return [event for event in events if "iteration" in event]


def evaluate(folder, truth):
    """The estimated errors of a render beside the true ones."""
    layers, run = Layers(folder / "picture.exr"), load(folder / "run.json")
    picture = layers.get("").astype(float)
    accuracy = run.get("accuracy") or {}
    finished = run.get("error_of") == "finished picture"
    return {
        "estimated": run["error"] if finished else None,
        "interval": accuracy.get("interval"),
        "rare": accuracy.get("rare"),
        "true": truth.distance(picture),
        "estimated_noisy": run.get("error_noisy"),
        "true_noisy": truth.distance(layers.get("Noisy").astype(float)),
        "pixels_within_2": truth.share_within(picture, layers.get("Error").astype(float), 2) if finished else None,
        "seconds": run["history"][-1]["seconds"],
        "core_seconds": run["history"][-1]["cpu_seconds"],
        "iterations": run["iterations"],
        "method": run["method"],
    }


def short(value):
    """A number to four digits; None if it is not finite."""
    return float(f"{value:.4g}") if value is not None and math.isfinite(value) else None


def geometric(values):
    """The geometric mean."""
    return math.exp(sum(map(math.log, values)) / len(values))
