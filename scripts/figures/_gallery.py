#!/usr/bin/env python3
"""Finished pictures at equal time beside Mitsuba, LuxCore and Cycles with OIDN, a scene at a time, in one run; and the
pictures of docs/gallery.md: ours, the best of each renderer by trimmed relMSE, and the reference.

  SET [all], SCENES, WIDTH, THREADS, SEEDS, CLOCK [cpu], REFERENCE_SECONDS, PEERS   as in finished.py
  BUDGETS   one: seconds, times threads in core-seconds [6]

Start-up of the peers (reading, compiling kernels, caches) is not part of their budget. Ours is all of it but reading the
scene, with the finish.
"""

import os
import sys

DEFAULTS = {"SET": "all", "BUDGETS": "6", "METHODS": "auto", "CLOCK": "cpu"}
for variable, value in DEFAULTS.items():
    os.environ.setdefault(variable, value)

# First, for it finds the interpreters of the others.
import finished  # noqa: E402, I001
import _peers  # noqa: E402
import _references  # noqa: E402
import _renders  # noqa: E402
import numpy as np  # noqa: E402
from _accuracy import geometric  # noqa: E402
from _cache import THREADS, WIDTH, Failed, program  # noqa: E402
from _goals import FIGURES  # noqa: E402
from _pictures import Reference  # noqa: E402
from PIL import Image  # noqa: E402
from record import ROOT, record  # noqa: E402

BUDGET = finished.BUDGETS[0]
GALLERY = ROOT / "docs" / "gallery"
# The width of a picture in a strip, and the share of the pixels that are not brighter than white in it.
SHOWN, BRIGHT = 240, 0.97
COMPARED = ("relmse_trimmed", "flip", "grain_trimmed")
RENDERERS = {"mitsuba": "Mitsuba", "lux": "LuxCore", "cycles": "Cycles"}


def strip(name, pictures):
    """Pictures side by side, as bright as the last one asks for."""
    white = max(float(np.quantile(pictures[-1].max(-1), BRIGHT)), 1e-9)
    shown = []
    for picture in pictures:
        linear = np.clip(np.nan_to_num(picture) / white, 0, 1)
        display = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.power(linear, 1 / 2.4) - 0.055)
        image = Image.fromarray((255 * display + 0.5).astype(np.uint8))
        shown.append(image.resize((SHOWN, round(SHOWN * image.height / image.width)), Image.Resampling.LANCZOS))
    sheet = Image.new("RGB", (SHOWN * len(shown) + 4 * (len(shown) - 1), shown[0].height), "white")
    for index, image in enumerate(shown):
        sheet.paste(image, (index * (SHOWN + 4), 0))
    GALLERY.mkdir(exist_ok=True)
    sheet.save(GALLERY / f"{name.replace('/', '-')}.jpg", quality=85, optimize=True)


def pictures(scene, peers, cell, halves):
    """Ours, the best of each renderer, and the reference; and their names."""
    found = [_renders.pictures(_renders.render(scene, "auto", "", BUDGET, 1))["delivered"]]
    names = ["caustique"]
    for prefix, renderer in RENDERERS.items():
        of = {peer: made["oidn"] for peer, made in cell["peers"].items() if peer.startswith(prefix) and "oidn" in made}
        if of:
            best = min(of, key=lambda peer: of[peer]["relmse_trimmed"])
            found.append(peers.pictures(peers.render(best, BUDGET, 1))["oidn"])
            names.append(f"{renderer} ({best.removeprefix(prefix).strip('_').replace('_', ' ')})")
    return [*found, halves.mean.astype(np.float32)], [*names, "reference"]


def compared(scene, names):
    """A scene's row, and its strip."""
    halves, made = _references.reference(scene)
    reference = Reference.read(halves)
    peers = _peers.Peers(scene, reference.mean.shape[0])
    cell = {"scene": _references.name(scene), "budget": BUDGET, "floor": max(reference.error / 50, 1e-9)}
    cell.update({key: {} for key in ("ours", "peers", "core_seconds", "notes")})
    print(f"\n{cell['scene']}\n{finished.COLUMNS}", flush=True)
    finished.ours(scene, BUDGET, reference, halves, cell)
    finished.others(peers, names, BUDGET, reference, halves, cell)
    ours = cell["ours"]["auto"]["delivered"]
    theirs = {peer: made["oidn"] for peer, made in cell["peers"].items() if "oidn" in made}
    ratios = {
        peer: {key: max(ours[key], 1e-9) / max(figures[key], 1e-9) for key in COMPARED}
        for peer, figures in theirs.items()
    }
    shown, titles = pictures(scene, peers, cell, reference)
    strip(cell["scene"], shown)
    figures = {"auto": ours, **theirs}
    return {
        "scene": cell["scene"],
        "reference": made["options"][1],
        "titles": titles,
        "figures": {peer: [float(f"{of[key]:.4g}") for key in COMPARED] for peer, of in figures.items()},
        "ratios": {peer: {key: round(value, 3) for key, value in of.items()} for peer, of in ratios.items()},
        "core_seconds": {peer: round(spent, 1) for peer, spent in cell["core_seconds"].items()},
        "notes": cell["notes"],
    }


def summary(rows):
    """Ours over each peer, and over the best of all in each figure: geometric mean, worst, and how many are better."""
    found = {}
    peers = list(dict.fromkeys(peer for row in rows for peer in row["ratios"]))
    for peer in [*peers, "best of all"]:
        for key in COMPARED:
            values = [
                max(of[key] for of in row["ratios"].values()) if peer == "best of all" else row["ratios"][peer][key]
                for row in rows
                if row["ratios"] and (peer == "best of all" or peer in row["ratios"])
            ]
            if values:
                better = sum(value < 1 for value in values)
                of = found.setdefault(peer, {})
                of[key] = [round(geometric(values), 3), round(max(values), 2), better, len(values)]
    return found


def main():
    names, reason = _peers.chosen()
    if reason:
        sys.exit(f"peers: error: {reason}")
    rows = []
    for scene in _references.scenes():
        try:
            rows.append(compared(scene, names))
        except Failed as failed:
            print(f"\n{_references.name(scene)}: {failed}", flush=True)
    found = summary(rows)
    print(f"\n{'ours over':<22}{'':<16}{'geometric mean':>15}{'worst':>8}{'better':>9}")
    for peer, of in found.items():
        for key, (mean, worst, better, count) in of.items():
            print(f"{peer:<22}{key:<16}{mean:>15.3f}{worst:>8.2f}{better:>6}/{count}")
    said = {"program": program(), "width": WIDTH, "threads": THREADS, "seconds": BUDGET, "clock": _renders.CLOCK}
    record("peers", {**said, "compared": list(COMPARED), "all_figures": FIGURES, "summary": found, "rows": rows})


if __name__ == "__main__":
    main()
