"""The table of the 2021 paper: errors at equal core-seconds on its four kinds of scenes, relative to plain `sppm`.

Rows: `sppm` with one level; the networks of scripts/lab.sh training that have a checkpoint, on `sppm` with five levels
and two camera paths, or one; the deep combiner, whose budget is half `bdpt` and half `sppm`; path tracing denoised by OIDN; and
the default finish of `sppm`. The networks' own time is not in the budget; the last
column has it in core-seconds, with the start of PyTorch.
"""

from pathlib import Path

from .. import references, renders
from ..accuracy import geometric
from ..cache import Failed, create, digest, installed, load, program, run_timed, save
from ..options import names, options
from ..picture_errors import Layers, Reference
from ..record import record
from ..train import data
from .training import FOLDER, RUNS

# A glossy interior, a pool, a room with glass, and a caustic of water.
ARGUMENTS = references.ARGUMENTS | {
    "scenes": ["interior", "pool", "second/dining", "second/bath"],
    "budgets": [10.0, 40.0, 160.0],
    "seeds": 3,
    "threads": 1,
    "clock": "cpu",
}
# relMSE of SPPM and of the paper's combination (figure 7 and table 1), by the kind of scene.
PAPER = {"interior": (0.0082, 0.0017), "pool": (0.0219, 0.0052)}
PAPER |= {"second/dining": (0.0196, 0.0017), "second/bath": (0.0023, 0.0014)}
KEYS = ("relmse", "relmse_trimmed", "flip")


def add_arguments(parser):
    parser.add_argument("--folder", type=Path, default=FOLDER, help=f"folder of the runs [default: {FOLDER}]")
    parser.add_argument("--runs", type=names, default=list(RUNS), help=f"runs to measure [default: {','.join(RUNS)}]")


def render(scene, method, denoise, budget, seed, *words):
    """A render from the cache; returns its folder."""
    options.render_options = list(words)
    return renders.render(scene, method, denoise, budget, seed)


def layers(scene):
    """The layers that the networks read; a small picture shows which of them the scene has."""
    found = render(scene, "sppm", "none", 0.2, 0, "--levels", "5")
    note = data.scales(data.channels_of(found / "picture.exr"), scene)
    always = ["beauty", "Noisy", "Level", "Variance", "Quarter", "albedo", "normal", "depth"]
    return ",".join([*always, *note["parts"], *note["radii"]])


def combine(scene, run, picture, independent=None):
    """A network's combination of a picture, from the cache if possible; returns the file and the core-seconds."""
    checkpoint = options.folder / "runs" / run / "last.pt"
    folder = picture / f"{run}-{digest(checkpoint)}{'-' + digest(independent) if independent else ''}"
    if not folder.exists():
        with create(folder) as draft:
            words = ["--checkpoint", checkpoint, "--scene", scene, picture / "picture.exr", "-o", draft / "picture.exr"]
            words += ["--independent", independent] if independent else []
            _, _, spent = run_timed([installed(".venv-train"), "-m", "lab.train.apply", *words])
            save(draft / "run.json", {"core_seconds": spent})
    return folder / "picture.exr", load(folder / "run.json")["core_seconds"]


def plain(scene, budget, seed):
    return Layers(render(scene, "sppm", "none", budget, seed, "--levels", "1") / "picture.exr").get("Noisy"), 0.0


def network(run, names):
    """A function that renders and combines with a network."""

    def make(scene, budget, seed):
        deep = run.startswith("deep")
        share = budget / 2 if deep else budget
        paths = "1" if "--paths" in RUNS[run] else "2"
        denoise = "" if run == "finished" else "none"
        picture = render(scene, "sppm", denoise, share, seed, "--levels", "5", "--eye-paths", paths, "--layers", names)
        other = render(scene, "bdpt", "none", share, seed, "--layers", "beauty,Quarter") if deep else None
        file, seconds = combine(scene, run, picture, other / "picture.exr" if other else None)
        return Layers(file).get(""), seconds

    return make


def denoised_path(scene, budget, seed):
    return renders.pictures(render(scene, "path", "none", budget, seed)).get("oidn"), 0.0


def finished(scene, budget, seed):
    return Layers(render(scene, "sppm", "", budget, seed, "--levels", "1") / "picture.exr").get(""), 0.0


def rows(names):
    """The rows of the table: functions of scene, budget and seed that return a picture and the network's seconds."""
    trained = [run for run in options.runs if (options.folder / "runs" / run / "last.pt").exists()]
    found = {"sppm": plain, **{run: network(run, names) for run in trained}}
    return found | {"path, OIDN": denoised_path, "sppm, finished": finished}


def measure(scene, budget, reference, names):
    """The mean errors over the seeds of each row, and the network's seconds."""
    found = {}
    for name, make in rows(names).items():
        errors, seconds = [], 0.0
        try:
            for seed in range(1, options.seeds + 1):
                picture, seconds = make(scene, budget, seed)
                if picture is None:
                    raise Failed("not available: there is no .venv-peers")
                errors.append(reference.measure(picture))
        except Failed as failed:
            print(f"    {name:<16}{failed}", flush=True)
            continue
        found[name] = {key: sum(one[key] for one in errors) / len(errors) for key in KEYS} | {"seconds": seconds}
        ratio = found[name]["relmse_trimmed"] / found["sppm"]["relmse_trimmed"]
        values = "".join(f"{found[name][key]:>11.4g}" for key in KEYS)
        print(f"    {name:<16}{values}{ratio:>10.3f}{seconds:>9.1f}", flush=True)
    return found


def main():
    cells = []
    for scene in references.scenes():
        halves, _ = references.reference(scene)
        reference, known = Reference.read(halves), layers(scene)
        paper = PAPER.get(references.name(scene))
        for budget in options.budgets:
            print(
                f"\n{references.name(scene)}, {budget:g} core-seconds"
                + (f"; the paper: {paper[0]} to {paper[1]}" if paper else "")
            )
            print(f"{'':<20}{'relMSE':>11}{'trimmed':>11}{'FLIP':>11}{'to sppm':>10}{'network':>9}", flush=True)
            cells.append(
                {"scene": references.name(scene), "budget": budget, "rows": measure(scene, budget, reference, known)}
            )
    print(f"\ngeometric means relative to sppm, trimmed relMSE{'':<4}")
    means = {}
    for name in {name: 0 for cell in cells for name in cell["rows"]}:
        ratios = [
            cell["rows"][name]["relmse_trimmed"] / cell["rows"]["sppm"]["relmse_trimmed"]
            for cell in cells
            if name in cell["rows"]
        ]
        means[name] = geometric([max(ratio, 1e-6) for ratio in ratios])
        print(f"    {name:<16}{means[name]:>10.3f}")
    settings = {"program": program(), **{key: getattr(options, key) for key in ("width", "threads", "seeds")}}
    record("combiner", {**settings, "geometric_means": means, "cells": cells})
