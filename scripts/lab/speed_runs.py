"""Errors against core-seconds on one thread: what a method's own estimate takes, without a finish.

The merit of some renders is their squared error, trimmed relMSE, times their core-seconds: how long a method takes to
an error, where the squared error falls as one over time. Programs render in turns, as many iterations as take
--seconds, and core-seconds are those of the process, the start and the reading of the scene left out. --levels is the
number of bandwidth levels [1], or `default`.
"""

import json
import subprocess
from pathlib import Path

from . import references
from .accuracy import geometric, short
from .cache import CACHE, Failed, digest, load, making, save, scene_key, timed
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
# The share of a render that tells how many iterations fill it.
TRIAL = 0.25
# Least iterations of it.
SOME = 4
# Squared errors are taken for no smaller.
LEAST = 1e-9


def settings():
    """What the figures were measured with, for the record."""
    return {key: getattr(options, key) for key in ("width", "threads", "seconds", "seeds", "levels")}


class Program:
    """A program to measure."""

    def __init__(self, binary):
        self.binary = Path(binary)
        self.key = digest(self.binary)

    def _render(self, scene, chosen, stop, seed, file):
        """Renders; returns its history."""
        command = [self.binary, "render", scene, "-o", file, *chosen, *stop, "--seed", seed, "--width", options.width]
        command += ["--threads", options.threads, "--no-combine", "--progress", "none"]
        command += [] if options.levels == "default" else ["--levels", options.levels]
        timed(command, 600 + 50 * options.seconds)
        said = subprocess.run([self.binary, "info", file, "--json"], check=True, capture_output=True, text=True)
        return json.loads(said.stdout)["history"]

    def _folder(self, scene, chosen):
        name = "".join(c if c.isalnum() else "_" for c in " ".join(map(str, chosen))).strip("_")
        return PLACE / self.key / scene_key(scene) / f"{name}-{options.levels}-{options.seconds:g}s-{options.width}"

    def iterations(self, scene, chosen):
        """How many iterations fill a render, by what a short one takes before its first and for each. A start that takes
        longer than the trial leaves one iteration in it, which tells nothing of the others: a second trial has more."""
        folder = self._folder(scene, chosen) / "trial"
        if not (folder / "run.json").exists():
            with making(folder) as draft:
                history = self._render(scene, chosen, ["--time", TRIAL * options.seconds], 0, draft / "picture.exr")
                if history[-1]["iterations"] < SOME:
                    history = self._render(scene, chosen, ["--iterations", SOME], 0, draft / "picture.exr")
                save(draft / "run.json", history)
        history = load(folder / "run.json")
        first, last = history[0], history[-1]
        each = (last["cpu_seconds"] - first["cpu_seconds"]) / (last["iterations"] - first["iterations"])
        fixed = max(first["cpu_seconds"] - first["iterations"] * each, 0)
        return max(1, round((options.seconds - fixed) / each))

    def done(self, scene, chosen, seed):
        """Renders a seed unless that is done; the folder of picture.exr and run.json."""
        folder = self._folder(scene, chosen) / f"seed{seed}"
        if not (folder / "run.json").exists():
            with making(folder) as draft:
                stop = ["--iterations", self.iterations(scene, chosen)]
                save(draft / "run.json", self._render(scene, chosen, stop, seed, draft / "picture.exr")[-1])
        return folder

    def render(self, scene, chosen, seed):
        """A render of a seed; its picture and what it spent."""
        folder = self.done(scene, chosen, seed)
        return Layers(folder / "picture.exr").get(""), load(folder / "run.json")["cpu_seconds"]


def merit(pairs, reference):
    """The merit of some renders of one kind, pictures with core-seconds, and their mean over the reference's."""
    found = [reference.measure(picture) for picture, _ in pairs]

    def mean(key):
        return sum(figures[key] for figures in found) / len(found)

    error, spent = max(mean("relmse_trimmed"), LEAST), sum(seconds for _, seconds in pairs) / len(pairs)
    return {
        "merit": error * spent,
        "error": error,
        "core_seconds": spent,
        "mean_ratio": mean("mean_ratio"),
        "mean_ratio_error": mean("mean_ratio_error") / len(found) ** 0.5,
    }


def taking_turns(renders, reference):
    """The merits of some kinds of renders by name, each a function of the seed, which take turns."""
    found = {name: [] for name in renders}
    for seed in range(1, options.seeds + 1):
        for name, render in renders.items():
            found[name].append(render(seed))
    return {name: merit(pairs, reference) for name, pairs in found.items()}


def with_references():
    """The scenes asked for, each with its name and its reference; what keeps others out is said."""
    for scene in references.scenes():
        try:
            yield scene, references.name(scene), Reference.read(references.reference(scene)[0])
        except Failed as failed:
            print(f"{references.name(scene)}: no reference: {failed}", flush=True)


def stored(found):
    """Merits for the record."""
    return {name: {key: short(value) for key, value in of.items()} for name, of in found.items()}


def compared(found, first, second, strange):
    """Merits for the record, that of the first over that of the second, and what keeps the row from counting: the
    first word that `strange` has of a picture, if any."""
    words = {of: strange(figures) for of, figures in found.items()}
    return {
        **stored(found),
        "ratio": short(found[first]["merit"] / found[second]["merit"]),
        "strange": next(({"of": of, "why": why} for of, why in words.items() if why), None),
    }


def summary(ratios):
    """Geometric mean, the largest with its name, and how many there are; `ratios`: by name."""
    if not ratios:
        return None
    worst = max(ratios, key=ratios.get)
    mean = geometric(list(ratios.values()))
    return {"geometric_mean": short(mean), "worst": short(ratios[worst]), "where": worst, "of": len(ratios)}
