"""The table of the 2021 paper: errors at equal core-seconds on its four kinds of scenes, relative to plain `sppm`.

Rows: `sppm` with one level; the bundled network, and those of scripts/lab.sh training that have a checkpoint, on `sppm`
with five levels and two camera paths, or one; the deep combiner, whose budget is half `bdpt` and half `sppm`; path
tracing denoised by OIDN; and the default finish of `sppm`. The time of networks, denoiser and finish is not in the
budget; the last column has that of the networks in core-seconds, with the start of PyTorch. out/combiner/ has a page of
pictures for each scene and budget, with maps of the networks' weights; docs/lab/combiner/ has those of the largest
budget, unless the figure has a name.
"""

from pathlib import Path
from typing import NamedTuple

from .. import references, renders
from ..cache import Failed, create, digest, installed, load, program, run_timed, save
from ..combiner_page import page
from ..commands import command
from ..options import names, options
from ..picture_errors import Layers, Reference
from ..record import ROOT, record
from ..tables.combiner_tables import relative
from ..train import data
from .training import FOLDER, RUNS

# A glossy interior, a pool, a room with glass, and a caustic of water.
ARGUMENTS = references.ARGUMENTS | {
    "scenes": ["interior", "pool", "second/dining", "second/bath"],
    "budgets": [3.0, 6.0, 12.0],
    "reference_seconds": 60.0,
    "seeds": 3,
    "threads": 1,
    "clock": "cpu",
    "name": "",
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


def made_from(picture, name, line):
    """The picture that a command makes of a render, given the file to write; from the cache under `name` if possible.
    Returns the file and the core-seconds."""
    folder = picture / name
    if not folder.exists():
        with create(folder) as draft:
            _, _, spent = run_timed(line(draft / "picture.exr"))
            save(draft / "run.json", {"core_seconds": spent})
    return folder / "picture.exr", load(folder / "run.json")["core_seconds"]


def combine(scene, run, picture, independent=None):
    """A network's combination of a picture; returns the file and the core-seconds."""
    checkpoint = options.folder / "runs" / run / "last.pt"

    def line(out):
        words = ["--checkpoint", checkpoint, "--scene", scene, picture / "picture.exr", "-o", out]
        words += ["--independent", independent] if independent else []
        return [installed(".venv-train"), "-m", "lab.train.apply", *words]

    name = f"{run}-{digest(checkpoint)}{'-' + digest(independent) if independent else ''}"
    return made_from(picture, name, line)


class Made(NamedTuple):
    """A picture of a row of the table, the share of each pair of pictures in the network's weights, and the network's
    core-seconds."""

    picture: object
    shares: dict = {}
    seconds: float = 0.0


def plain(layer):
    """A function that renders one level and returns a layer: the estimate, or the finished picture."""

    def make(scene, budget, seed):
        return Made(Layers(render(scene, "sppm", "", budget, seed, "--levels", "1") / "picture.exr").get(layer))

    return make


def network(run, names):
    """A function that renders and combines with a network."""
    deep, paths = run.startswith("deep"), "1" if "--paths" in RUNS[run] else "2"
    words = ["--levels", "5", "--eye-paths", paths, "--layers", names]

    def make(scene, budget, seed):
        share = budget / 2 if deep else budget
        picture = render(scene, "sppm", "" if run == "finished" else "none", share, seed, *words)
        other = render(scene, "bdpt", "none", share, seed, "--layers", "beauty,Quarter") if deep else None
        file, seconds = combine(scene, run, picture, other / "picture.exr" if other else None)
        found = Layers(file)
        shares = {name.removesuffix(".X"): value for name, value in found.channels.items() if name.startswith("Share")}
        return Made(found.get(""), shares, seconds)

    return make


def bundled(names):
    """A function that renders and combines with the network that the program has."""

    def make(scene, budget, seed):
        picture = render(scene, "sppm", "none", budget, seed, "--levels", "5", "--eye-paths", "2", "--layers", names)
        line = lambda out: command("finish", picture / "picture.exr", "-o", out, model="compact", denoise="none")
        file, seconds = made_from(picture, "bundled", line)
        return Made(Layers(file).get(""), {}, seconds)

    return make


def denoised_path(scene, budget, seed):
    picture = renders.pictures(render(scene, "path", "none", budget, seed)).get("oidn")
    if picture is None:
        raise Failed("not available: there is no .venv-peers")
    return Made(picture)


def rows(names):
    """The rows of the table: functions of scene, budget and seed."""
    trained = [run for run in options.runs if (options.folder / "runs" / run / "last.pt").exists()]
    found = {"sppm": plain("Noisy"), "bundled": bundled(names), **{run: network(run, names) for run in trained}}
    return found | {"path, OIDN": denoised_path, "sppm, finished": plain("")}


def measure(scene, budget, reference, names):
    """The mean errors over the seeds of each row, and the pictures of the last seed."""
    found, last = {}, {}
    for name, make in rows(names).items():
        try:
            made = [make(scene, budget, seed) for seed in range(1, options.seeds + 1)]
        except Failed as failed:
            print(f"    {name:<16}{failed}", flush=True)
            continue
        errors, last[name] = [reference.measure(one.picture) for one in made], made[-1]
        found[name] = {key: sum(one[key] for one in errors) / len(errors) for key in KEYS}
        found[name]["network_core_seconds"] = sum(one.seconds for one in made) / len(made)
        ratio = found[name]["relmse_trimmed"] / found["sppm"]["relmse_trimmed"]
        values = "".join(f"{found[name][key]:>11.4g}" for key in KEYS)
        print(f"    {name:<16}{values}{ratio:>10.3f}{last[name].seconds:>9.1f}", flush=True)
    return found, last


def draw(scene, budget, last, reference):
    """Writes the page of a scene: pictures, and the first and last shares of each network's weights."""
    stem, shares = references.name(scene).replace("/", "-"), {}
    for name, made in last.items():
        numbers = sorted(made.shares, key=lambda share: int(share.removeprefix("Share")))
        shares |= {f"{name} {number}": made.shares[number] for number in dict.fromkeys(numbers[:1] + numbers[-1:])}
    file = ROOT / "out" / "combiner" / f"{stem}-{budget:g}.png"
    if budget == max(options.budgets) and not options.name:
        file = ROOT / "docs" / "lab" / "combiner" / f"{stem}.jpg"
    page(file, {name: made.picture for name, made in last.items()}, shares, reference.mean)
    print(f"    {file}")


def main():
    cells = []
    for scene in references.scenes():
        halves, _ = references.reference(scene)
        reference, known, name = Reference.read(halves), layers(scene), references.name(scene)
        paper = f"; the paper: {PAPER[name][0]} to {PAPER[name][1]}" if name in PAPER else ""
        for budget in options.budgets:
            print(f"\n{name}, {budget:g} core-seconds{paper}")
            print(f"{'':<20}{'relMSE':>11}{'trimmed':>11}{'FLIP':>11}{'to sppm':>10}{'network':>9}", flush=True)
            found, last = measure(scene, budget, reference, known)
            draw(scene, budget, last, reference)
            cells.append({"scene": name, "budget": budget, "paper": PAPER.get(name), "rows": found})
    print("\ngeometric means of the trimmed relMSE relative to sppm")
    for name in {name: None for cell in cells for name in cell["rows"]}:
        print(f"    {name:<16}{relative(cells, name):>10.3f}")
    settings = {"program": program(), **{key: getattr(options, key) for key in ("width", "threads", "seeds")}}
    settings |= {"set": options.name} if options.name else {}
    record("combiner", {**settings, "cells": cells})
