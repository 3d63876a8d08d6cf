"""Errors against core-seconds on one thread, for estimates without a finish.

The cost of a method is its squared error (trimmed relMSE) times its core-seconds. It is constant if the squared error
falls as one over time. Programs render alternately, with the number of iterations that takes --seconds. Core-seconds are
those of the process, without its start and the reading of the scene. --levels is the number of bandwidth levels [1], or
`default`.
"""

import json
import subprocess
from pathlib import Path

from . import references
from .accuracy import geometric, short
from .cache import CACHE, Failed, create, digest, load, run_timed, save, scene_key
from .commands import command
from .options import options
from .picture_errors import Layers, Reference

# Small pictures, one thread.
ARGUMENTS = references.ARGUMENTS | {
    "set": "all",
    "width": 96,
    "threads": 1,
    "reference_seconds": 30.0,
    "seconds": 2.0,
    "seeds": 2,
    "levels": "1",
}
PLACE = CACHE / "speed"
# The share of --seconds that a trial takes, which measures the time of an iteration.
TRIAL_SHARE = 0.25
MIN_TRIAL_ITERATIONS = 4
# Smaller squared errors count as this.
MIN_SQUARED_ERROR = 1e-9


def settings():
    """The arguments of the measurement, for the record."""
    return {key: getattr(options, key) for key in ("width", "threads", "seconds", "seeds", "levels")}


class Program:
    """A build of the program, to measure."""

    def __init__(self, binary):
        self.binary = Path(binary)
        self.key = digest(self.binary)

    def _render(self, scene, method, stop, seed, file):
        """Renders with the options `method` and `stop`; returns the history. --no-combine is the name that old programs know."""
        levels = None if options.levels == "default" else options.levels
        settings = {"seed": seed, "width": options.width, "threads": options.threads, "levels": levels}
        words = ["render", scene, "-o", file, *method, *stop]
        line = command(*words, program=self.binary, **settings, no_combine=True, progress="none")
        run_timed(line, 600 + 50 * options.seconds)
        info = subprocess.run([self.binary, "info", file, "--json"], check=True, capture_output=True, text=True)
        return json.loads(info.stdout)["history"]

    def _folder(self, scene, method):
        name = "".join(c if c.isalnum() else "_" for c in " ".join(map(str, method))).strip("_")
        return PLACE / self.key / scene_key(scene) / f"{name}-{options.levels}-{options.seconds:g}s-{options.width}"

    def iterations(self, scene, method):
        """The number of iterations that takes --seconds, from a trial that measures the start and an iteration. If the
        start takes longer than the trial, a second trial has MIN_TRIAL_ITERATIONS."""
        folder = self._folder(scene, method) / "trial"
        if not (folder / "run.json").exists():
            with create(folder) as draft:
                file, stop = draft / "picture.exr", ["--time", TRIAL_SHARE * options.seconds]
                history = self._render(scene, method, stop, 0, file)
                if history[-1]["iterations"] < MIN_TRIAL_ITERATIONS:
                    history = self._render(scene, method, ["--iterations", MIN_TRIAL_ITERATIONS], 0, file)
                save(draft / "run.json", history)
        history = load(folder / "run.json")
        first, last = history[0], history[-1]
        each = (last["cpu_seconds"] - first["cpu_seconds"]) / (last["iterations"] - first["iterations"])
        fixed = max(first["cpu_seconds"] - first["iterations"] * each, 0)
        return max(1, round((options.seconds - fixed) / each))

    def render_folder(self, scene, method, seed):
        """Renders with a seed, unless the cache has the render; returns the folder of picture.exr and run.json."""
        folder = self._folder(scene, method) / f"seed{seed}"
        if not (folder / "run.json").exists():
            with create(folder) as draft:
                stop = ["--iterations", self.iterations(scene, method)]
                save(draft / "run.json", self._render(scene, method, stop, seed, draft / "picture.exr")[-1])
        return folder

    def render(self, scene, method, seed):
        """Renders with a seed; returns the picture and its core-seconds."""
        folder = self.render_folder(scene, method, seed)
        return Layers(folder / "picture.exr").get(""), load(folder / "run.json")["cpu_seconds"]


def merit(pairs, reference):
    """The cost of renders, given as pairs of picture and core-seconds, and their mean over the reference's."""
    found = [reference.measure(picture) for picture, _ in pairs]

    def mean(key):
        return sum(figures[key] for figures in found) / len(found)

    error, spent = max(mean("relmse_trimmed"), MIN_SQUARED_ERROR), sum(seconds for _, seconds in pairs) / len(pairs)
    return {
        "merit": error * spent,
        "error": error,
        "core_seconds": spent,
        "mean_ratio": mean("mean_ratio"),
        "mean_ratio_error": mean("mean_ratio_error") / len(found) ** 0.5,
    }


def measure_alternately(renders, reference):
    """Costs by name. `renders` has a function of the seed for each name; the functions are called alternately."""
    found = {name: [] for name in renders}
    for seed in range(1, options.seeds + 1):
        for name, render in renders.items():
            found[name].append(render(seed))
    return {name: merit(pairs, reference) for name, pairs in found.items()}


def with_references():
    """The selected scenes that have a reference, each with its name and reference; prints why others have none."""
    for scene in references.scenes():
        try:
            yield scene, references.name(scene), Reference.read(references.reference(scene)[0])
        except Failed as failed:
            print(f"{references.name(scene)}: no reference: {failed}", flush=True)


def rounded(found):
    """Costs by name, with their numbers rounded for the record."""
    return {name: {key: short(value) for key, value in of.items()} for name, of in found.items()}


def compare(found, first, second, mismatch):
    """A row for the record: the rounded costs, the ratio of the first and the second, and why the row does not count,
    if `mismatch` finds a reason for one of the pictures."""
    words = {of: mismatch(figures) for of, figures in found.items()}
    return {
        **rounded(found),
        "ratio": short(found[first]["merit"] / found[second]["merit"]),
        "strange": next(({"of": of, "why": why} for of, why in words.items() if why), None),
    }


def summary(ratios):
    """The geometric mean of ratios by name, the largest ratio with its name, and the number of ratios."""
    if not ratios:
        return None
    worst = max(ratios, key=ratios.get)
    mean = geometric(list(ratios.values()))
    return {"geometric_mean": short(mean), "worst": short(ratios[worst]), "where": worst, "of": len(ratios)}
