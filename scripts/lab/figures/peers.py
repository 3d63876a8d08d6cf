"""Finished pictures at equal time beside Mitsuba, LuxCore and Cycles with OIDN, in one run, and the pictures of
docs/gallery.md: ours, the best of each renderer by trimmed relMSE, and the reference.

With several budgets, the pictures are those of the first. A figure with a name leaves the gallery's pictures as they are.
The errors inside glass and mirrors, also of scenes outside the repository:

    scripts/lab.sh peers --name glass --threads 1 --budgets 5,20 --scenes cornell,torus,pool,second/bath,PATH.glb

The budget of other renderers excludes their start-up (reading, compiling kernels, building caches). Ours includes
everything except reading the scene.
"""

import sys

import numpy as np
from PIL import Image

from .. import peer_runs, references, renders
from ..accuracy import geometric
from ..cache import Failed, program
from ..combiner_page import display
from ..goals import FIGURES
from ..options import options
from ..picture_errors import Reference
from ..record import ROOT, record
from . import finished

ARGUMENTS = finished.ARGUMENTS | {"set": "all", "budgets": [6.0], "methods": ["auto"], "clock": "cpu", "name": None}
GALLERY = ROOT / "docs" / "gallery"
# The width of a picture in a strip, and the quantile of its brightness that is shown as white.
SHOWN, WHITE = 240, 0.97
COMPARED = ("relmse", "relmse_trimmed", "flip", "grain_trimmed", "flip_inside", "grain_inside")
RENDERERS = {"mitsuba": "Mitsuba", "lux": "LuxCore", "cycles": "Cycles"}


def strip(name, pictures):
    """Writes the pictures side by side, with the exposure of the last one."""
    white = max(float(np.quantile(pictures[-1].max(-1), WHITE)), 1e-9)
    shown = []
    for picture in pictures:
        image = display(picture, 1 / white)
        shown.append(image.resize((SHOWN, round(SHOWN * image.height / image.width)), Image.Resampling.LANCZOS))
    sheet = Image.new("RGB", (SHOWN * len(shown) + 4 * (len(shown) - 1), shown[0].height), "white")
    for index, image in enumerate(shown):
        sheet.paste(image, (index * (SHOWN + 4), 0))
    GALLERY.mkdir(exist_ok=True)
    sheet.save(GALLERY / f"{name.replace('/', '-')}.jpg", quality=85, optimize=True)


def pictures(scene, peers, cell, halves):
    """The pictures of caustique, of the best method of each renderer, and of the reference, and their names."""
    found = [renders.pictures(renders.render(scene, "auto", "", options.budgets[0], 1))["delivered"]]
    names = ["caustique"]
    for prefix, renderer in RENDERERS.items():
        of = {peer: made["oidn"] for peer, made in cell["peers"].items() if peer.startswith(prefix) and "oidn" in made}
        if of:
            best = min(of, key=lambda peer: of[peer]["relmse_trimmed"])
            found.append(peers.pictures(peers.render(best, options.budgets[0], 1))["oidn"])
            names.append(f"{renderer} ({best.removeprefix(prefix).strip('_').replace('_', ' ')})")
    return [*found, halves.mean.astype(np.float32)], [*names, "reference"]


def compare(scene, names, budget):
    """Compares the renderers on a scene at a budget, and writes its strip at the first budget; returns the row."""
    halves, made = references.reference(scene)
    reference = Reference.read(halves)
    reference.inside = renders.inside(scene)
    peers = peer_runs.Peers(scene, reference.mean.shape[0])
    cell = finished.new_cell(scene, budget, reference)
    print(f"\n{cell['scene']}, {budget:g} s\n{finished.COLUMNS}", flush=True)
    finished.ours(scene, budget, reference, halves, cell)
    finished.others(peers, names, budget, reference, halves, cell)
    ours = cell["ours"]["auto"]["delivered"]
    theirs = {peer: made["oidn"] for peer, made in cell["peers"].items() if "oidn" in made}
    # Errors that the reference's noise hides have no ratio.
    ratios = {
        peer: {key: ours[key] / figures[key] for key in COMPARED if min(ours.get(key, 0), figures.get(key, 0)) > 0}
        for peer, figures in theirs.items()
    }
    shown, titles = pictures(scene, peers, cell, reference)
    # Another renderer has a picture.
    if not options.name and budget == options.budgets[0] and cell["core_seconds"].keys() - {"auto"}:
        strip(cell["scene"], shown)
    figures = {"auto": ours, **theirs}
    return {
        "scene": cell["scene"],
        "reference": made["options"][1],
        "titles": titles,
        "figures": {
            peer: [float(f"{of[key]:.4g}") if key in of else None for key in COMPARED] for peer, of in figures.items()
        },
        "ratios": {peer: {key: float(f"{value:.3g}") for key, value in of.items()} for peer, of in ratios.items()},
        "core_seconds": {peer: round(spent, 1) for peer, spent in cell["core_seconds"].items()},
        "notes": cell["notes"],
    }


def summary(rows):
    """Our errors over those of each peer, and of the best peer: geometric mean, worst, number of scenes where ours is
    better, number of scenes."""
    found = {}
    peers = list(dict.fromkeys(peer for row in rows for peer in row["ratios"]))
    for peer in [*peers, "best of all"]:
        for key in COMPARED:
            # Scenes without glass and mirrors have no errors inside.
            known = [{name: of[key] for name, of in row["ratios"].items() if key in of} for row in rows]
            best = [max(of.values()) for of in known if of]
            values = best if peer == "best of all" else [of[peer] for of in known if peer in of]
            if values:
                better = sum(value < 1 for value in values)
                of = found.setdefault(peer, {})
                of[key] = [round(geometric(values), 3), round(max(values), 2), better, len(values)]
    return found


def main():
    names, reason = peer_runs.select()
    if reason:
        sys.exit(f"peers: error: {reason}")
    budgets = [measure(names, budget) for budget in options.budgets]
    settings = {"program": program(), **{key: getattr(options, key) for key in ("width", "threads", "clock")}}
    if options.name or options.set == "twins":
        settings["set"] = options.name or "twins"
    more = {"later_budgets": budgets[1:]} if budgets[1:] else {}
    record("peers", {**settings, "compared": list(COMPARED), "all_figures": FIGURES, **budgets[0], **more})


def measure(names, budget):
    """Compares the renderers at a budget on all scenes, and prints our errors over theirs; returns the figures."""
    rows = []
    for scene in references.scenes():
        try:
            rows.append(compare(scene, names, budget))
        except Failed as failed:
            print(f"\n{references.name(scene)}: {failed}", flush=True)
    found = summary(rows)
    print(f"\n{f'{budget:g} s, ours over':<22}{'':<16}{'geometric mean':>15}{'worst':>8}{'better':>9}")
    for peer, of in found.items():
        for key, (mean, worst, better, count) in of.items():
            print(f"{peer:<22}{key:<16}{mean:>15.3f}{worst:>8.2f}{better:>6}/{count}")
    return {"seconds": budget, "summary": found, "rows": rows}
