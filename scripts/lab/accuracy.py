"""What renders tell of their error, and what is true of it.

The truth is measured as renders tell it: the root of relMSE without the worst half per cent of the pixels, relative to
what is above 0.01 times the squared mean of the reference without its brightest hundredth (src/stat/floor.rs), against
two independent halves of a reference, whose own noise drops out.
"""

import json
import math
import subprocess
import sys

from . import references
import numpy as np
from .cache import BIN, CACHE, Failed, load, making, program, save, scene_key
from .options import options
from .reading import read
from .picture_errors import Layers, Reference, best

ARGUMENTS = references.ARGUMENTS | {"methods": ["auto"], "seeds": 3, "budgets": [2.0, 4.0, 8.0, 16.0]}
# The share of the pixels that are brightest, and what of the squared mean of the others stands for darkness.
BRIGHTEST, DARK = 0.01, 0.01
LAYERS = "beauty,Noisy,Error"
PLACE = CACHE / "accuracy" / program()


class Truth(Reference):
    """A reference, with errors relative to what renders take them relative to."""

    def __init__(self, first, second):
        super().__init__(first, second)
        values = np.sort(self.mean.mean(-1)[self.finite])
        kept = values[: len(values) - int(BRIGHTEST * len(values))]
        self.weight = 1.0 / (self.mean.mean(-1) ** 2 + DARK * kept.mean() ** 2)
        # What is left of the reference's own noise about a pixel: a window's mean of a quarter of the halves' squared
        # difference.
        self.noise = box(np.square(self.halves[0] - self.halves[1]) / 4)

    def distance(self, picture):
        """The root of trimmed relMSE, zero where the reference's noise hides it."""
        first, second = (picture - half for half in self.halves)
        kept = best(np.square(picture - self.mean).mean(-1) * self.weight, self.finite)
        told = ((first * second).mean(-1) * self.weight)[self.finite][kept]
        return math.sqrt(max(told.mean(), 0.0))

    def within(self, picture, error, times):
        """Share of the pixels and channels where the truth lies within so many times the error told."""
        return float((np.square(picture - self.mean) <= times**2 * (np.square(error) + self.noise)).mean())


def truths():
    """The scenes asked for that have a reference, each with its truth; what keeps others out is said."""
    for scene in references.scenes():
        try:
            halves, _ = references.reference(scene)
        except Failed as failed:
            print(f"{references.name(scene)}: no reference: {failed}", file=sys.stderr)
            continue
        yield scene, Truth.read(halves)


def box(values, reach=4):
    """Means over square windows, smaller at the rim."""
    for axis in (0, 1):
        count = values.shape[axis]
        sums = np.concatenate([np.zeros_like(np.take(values, [0], axis)), np.cumsum(values, axis)], axis)
        index = np.arange(count)
        low, high = np.maximum(index - reach, 0), np.minimum(index + reach + 1, count)
        shape = [-1 if i == axis else 1 for i in range(values.ndim)]
        values = (np.take(sums, high, axis) - np.take(sums, low, axis)) / (high - low).reshape(shape)
    return values


def rendered(scene, method, stop, seed):
    """Renders until a stop such as ("--time", 4), unless that is done; returns the folder: picture.exr, run.json and
    progress.jsonl."""
    name = f"{method}{'-'.join(map(str, stop))}-{options.threads}-seed{seed}-{options.width}"
    folder = PLACE / scene_key(scene) / name
    if not (folder / "run.json").exists():
        with making(folder) as draft:
            command = [BIN, "render", scene, "-o", draft / "picture.exr", "--method", method, "--seed", seed]
            command += [
                "--width",
                options.width,
                "--threads",
                options.threads,
                "--layers",
                LAYERS,
                "--progress",
                "json",
                *stop,
            ]
            with open(draft / "progress.jsonl", "w", encoding="utf-8") as log:
                subprocess.run(list(map(str, command)), check=True, stderr=log)
            save(draft / "run.json", read("info", str(draft / "picture.exr")))
    return folder


def progress(folder):
    """What a render has said while it went on."""
    lines = (folder / "progress.jsonl").read_text(encoding="utf-8").splitlines()
    return [json.loads(line) for line in lines if line.startswith("{")]


def judged(folder, truth):
    """What a render has told of its error, and the truth."""
    layers, run = Layers(folder / "picture.exr"), load(folder / "run.json")
    picture = layers.get("").astype(float)
    said = run.get("accuracy") or {}
    finished = run.get("error_of") == "finished picture"
    return {
        "told": run["error"] if finished else None,
        "interval": said.get("interval"),
        "rare": said.get("rare"),
        "true": truth.distance(picture),
        "told_noisy": run.get("error_noisy"),
        "true_noisy": truth.distance(layers.get("Noisy").astype(float)),
        "pixels_within_2": truth.within(picture, layers.get("Error").astype(float), 2) if finished else None,
        "seconds": run["history"][-1]["seconds"],
        "core_seconds": run["history"][-1]["cpu_seconds"],
        "iterations": run["iterations"],
        "method": run["method"],
    }


def short(value):
    """A figure for the record, to four digits; nothing for what is no number."""
    return float(f"{value:.4g}") if value is not None and math.isfinite(value) else None


def geometric(values):
    """The geometric mean."""
    return math.exp(sum(map(math.log, values)) / len(values))
