"""Finished pictures at equal time: our methods, their estimates, Intel OIDN alone on these estimates, and other renderers
with OIDN.

Every picture is compared with two independent halves of a reference, so that the reference's own noise cancels: relMSE
of all pixels and without the worst 0.5 %, HDR-FLIP (which includes the noise of the reference), grain (see
`caustique compare`) of all pixels and without the worst 0.5 %, and FLIP and grain inside glass and mirrors. Renders are cached, so an interrupted run continues.

CAUSTIQUE_BIN names the program, and CAUSTIQUE_CACHE the cache (by default caustique/finished in the user's cache).

scripts/compare/setup.sh peers installs the other renderers and OIDN; their drivers are in scripts/compare/peers. Other
renderers always have the budget in core-seconds (seconds times threads); with --clock wall, our renders have at most
that. Rows give the core-seconds used. --before PROGRAM adds the `auto` of another program, --model FILE that with a
network of the finish, and both are compared with `auto`. A last table lists what `auto` has chosen, and why.
"""

import sys
from pathlib import Path

from .. import peer_runs, references, renders
from ..cache import BIN, CACHE, Failed, load, program, save
from ..goals import FIGURES, goals, inputs
from ..options import options
from ..picture_errors import Reference
from ..record import record

ARGUMENTS = references.ARGUMENTS | {
    "budgets": [15.0, 60.0, 240.0],
    "seeds": 1,
    "methods": ["auto", "path", "bdpt", "vcm", "sppm", "cppm"],
    "before": "",
    "model": "",
    "denoise": ["default"],
    "render_options": [],
    "clock": "wall",
    "peers": peer_runs.DEFAULT,
}
SHORT = {"width": 240, "budgets": [10.0], "methods": ["auto", "path", "bdpt", "sppm", "vcm"], "reference_seconds": 60.0}
# Renders with --clock wall that used a smaller share of their cores get a note.
MIN_CORE_SHARE = 0.8
KINDS = {"second": "second", "twin": "twins"}
# Rows of `auto` by another program, and with a network of the finish.
BEFORE, NETWORK = "auto before", "auto network"
COLUMNS = f"{'':<36}{'core-s':>8}{'relMSE':>11}{'trimmed':>11}{'FLIP':>9}{'grain':>11}{'trimmed':>11}"
COLUMNS += f"{'inside:':>8}{'FLIP':>9}{'grain':>11}{'mean':>8}"


def denoisers():
    """The values of --denoise, with an empty text for the default."""
    return ["" if name == "default" else name for name in options.denoise]


def mean(runs):
    """The errors by picture, averaged over the seeds."""
    names = set.intersection(*(set(run) for run in runs))
    average = {}
    for name in sorted(names):
        keys = [key for key, value in runs[0][name].items() if value is not None]
        average[name] = {key: sum(run[name][key] for run in runs) / len(runs) for key in keys}
    return average


def line(label, spent, figures, note=""):
    """Prints a row of the table."""

    def value(key):
        width = 11 if "grain" in key or "relmse" in key else 17 if key == "flip_inside" else 9
        return f"{figures[key]:>{width}.{'4f' if key.startswith('flip') else '3g'}}" if key in figures else " " * width

    values = "".join(map(value, FIGURES))
    values += f"{figures.get('mean_ratio', 1):>8.3f}"
    print(f"    {label:<32}{spent:>8.1f}{values}{'  ' + note if note else ''}", flush=True)


def seeds(make, figures):
    """Renders with every seed; returns the mean errors by picture, the mean core-seconds, and the facts of a render."""
    runs, spent = [], []
    for seed in range(1, options.seeds + 1):
        folder = make(seed)
        runs.append(figures(folder))
        spent.append(load(folder / "run.json"))
    return mean(runs), sum(of["cpu_seconds"] for of in spent) / len(spent), spent[0]


def programs():
    """The methods with the program that renders each, the name of the row, and the network of the finish."""
    rows = [(method, BIN, method, None) for method in options.methods]
    if options.before:
        rows.append(("auto", Path(options.before).resolve(), BEFORE, None))
    if options.model:
        rows.append(("auto", BIN, NETWORK, Path(options.model).resolve()))
    return rows


def new_cell(scene, budget, reference):
    """A cell of a scene at a budget, before anything is measured."""
    cell = {"scene": references.name(scene), "budget": budget, "floor": max(reference.error / 50, 1e-9)}
    return cell | {key: {} for key in ("ours", "peers", "core_seconds", "notes", "chosen")}


def ours(scene, budget, reference, halves, cell):
    """Measures our renders of a scene at a budget, and adds them to a cell."""
    for denoise in denoisers():
        for method, binary, label, model in programs():
            name = f"{label} {denoise}".strip()
            try:
                pictures, spent, facts = seeds(
                    lambda seed: renders.render(scene, method, denoise, budget, seed, binary, model=model),
                    lambda folder: renders.figures(folder, reference, halves, renders.pictures),
                )
            except Failed as failed:
                cell["notes"][name] = str(failed)
                print(f"    {name:<32}{failed}", flush=True)
                continue
            cell["ours"][name], cell["core_seconds"][name] = pictures, spent
            if method == "auto":
                cell["chosen"][name] = facts["chosen"]
            if spent < MIN_CORE_SHARE * budget * options.threads:
                cell["notes"][name] = f"spent {spent:.1f} of {budget * options.threads:g} core-seconds: try --clock cpu"
            line(name, spent, pictures["delivered"], cell["notes"].get(name, ""))
            line("  its input", spent, pictures["noisy"])
            if len(inputs(pictures)) > 1:
                line("  best level", spent, min(inputs(pictures), key=lambda figures: figures["relmse_trimmed"]))
            if "oidn" in pictures:
                line("  OIDN alone", spent, pictures["oidn"])


def others(peers, names, budget, reference, halves, cell):
    """Measures the peers' renders of a scene at a budget, and adds them to a cell."""
    for name in names:
        try:
            pictures, spent, facts = seeds(
                lambda seed: peers.render(name, budget, seed),
                lambda folder: renders.figures(folder, reference, halves, peers.pictures),
            )
        except Failed as failed:
            cell["notes"][name] = str(failed)
            print(f"    {name:<32}{failed}", flush=True)
            continue
        note = peer_runs.mean_mismatch(pictures["noisy"])
        if note:
            cell["notes"][name] = note
        else:
            cell["peers"][name] = pictures
            if facts.get("approximations"):
                cell["notes"][f"{name} approximates"] = "; ".join(facts["approximations"])
        cell["core_seconds"][name] = spent
        line(name, spent, pictures["noisy"], note or "")
        if "oidn" in pictures:
            line("  with OIDN", spent, pictures["oidn"])


def short(cell):
    """A cell for the record, with the errors to four digits, None where they are unknown."""

    def digits(error):
        return None if error is None else float(f"{error:.4g}")

    def pictures(some):
        return {
            name: {picture: [digits(figures.get(key)) for key in FIGURES] for picture, figures in found.items()}
            for name, found in some.items()
        }

    spent = {name: round(value, 1) for name, value in cell["core_seconds"].items()}
    return {**cell, "ours": pictures(cell["ours"]), "peers": pictures(cell["peers"]), "core_seconds": spent}


def measure(scene, names):
    """Measures a scene; returns a cell for each budget, and the facts of its reference."""
    halves, made = references.reference(scene)
    reference = Reference.read(halves)
    reference.inside = renders.inside(scene)
    known = {"error": reference.error, **{key: made[key] for key in ("options", "core_seconds", "program")}}
    peers = peer_runs.Peers(scene, reference.mean.shape[0]) if names else None
    cells = []
    for budget in options.budgets:
        # Errors below a fiftieth of the reference's own count as this.
        cell = new_cell(scene, budget, reference)
        own = f"reference by {made['options'][1]}, its own relMSE {reference.error:.2g}"
        print(f"\n{cell['scene']}, {budget:g} s, {own}\n{COLUMNS}", flush=True)
        ours(scene, budget, reference, halves, cell)
        if peers:
            others(peers, names, budget, reference, halves, cell)
        cells.append(cell)
    return cells, known


def count(cells):
    """Prints and returns the ratios of errors (lab/goals.py) of each set of scenes and each budget."""
    counts = {}
    delivered = f"{'auto' if 'auto' in options.methods else options.methods[0]} {denoisers()[0]}".strip()
    for kind in ("first", "second", "twins"):
        for budget in options.budgets:
            chosen = [cell for cell in cells if cell["budget"] == budget]
            chosen = [cell for cell in chosen if KINDS.get(cell["scene"].partition("/")[0], "first") == kind]
            found = goals(chosen, delivered)
            if found:
                title = f"{kind} set, {budget:g} s"
                counts[title] = found
                print(f"\n{title:<66}{'geometric mean':>15}{'worst':>9}{'within':>9}")
            for text, value in found.items():
                within = f"{value['within']}/{value['of']}"
                print(f"    {text:<62}{value['geometric_mean']:>15.3f}{value['worst']:>9.2f}{within:>9}")
    return counts


def print_choices(cells):
    """Prints what `auto` has chosen for each scene and budget, and why."""
    print()
    for cell in cells:
        for name, reason in cell["chosen"].items():
            print(f"{cell['scene']}, {cell['budget']:g} s, {name}: {reason.removeprefix('auto: ')}")


def main():
    scenes = references.scenes()
    names, reason = peer_runs.select()
    if reason:
        print(reason, file=sys.stderr)
    if not renders.PYTHON:
        print(f"OIDN alone is left out: there is no .venv-peers; {peer_runs.INSTALL}", file=sys.stderr)
    if not scenes:
        print(f"--set {options.set} has no scenes yet", file=sys.stderr)
        return
    cells, known = [], {}
    for scene in scenes:
        try:
            found, known[references.name(scene)] = measure(scene, names)
            cells += found
        except Failed as failed:
            print(f"\n{references.name(scene)}: no reference: {failed}", flush=True)
    print_choices(cells)
    settings = {"program": program(), **{key: getattr(options, key) for key in ("width", "threads", "clock", "seeds")}}
    settings |= {"set": ",".join(options.scenes or []) or options.set, "options": options.render_options}
    values = {**settings, "figures": FIGURES, "counts": count(cells), "references": known}
    save(CACHE / "last.json", {**values, "cells": cells})
    record("finished", {**values, "cells": [short(cell) for cell in cells]})
