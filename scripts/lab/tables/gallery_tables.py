"""All scenes beside other renderers: pictures and figures."""

import textwrap

from .markdown import digits, table

WIDTH = 120

MEASURES = {"relmse_trimmed": "relMSE, trimmed", "flip": "FLIP", "grain_trimmed": "grain, trimmed"}
NAMES = {
    "auto": "caustique",
    "mitsuba_path": "Mitsuba, path",
    "lux_path": "LuxCore, path",
    "lux_path_caustic": "LuxCore, path with caustic cache",
    "lux_bidir": "LuxCore, bidirectional",
    "lux_bidirvm": "LuxCore, bidirectional with merging",
    "cycles_path": "Cycles, path",
    "cycles_guiding": "Cycles, path guiding",
}


def peers(figures):
    """Ours over the others."""
    values = figures.one("peers")
    rows = []
    for peer, of in values["summary"].items():
        for key, (mean, worst, better, count) in of.items():
            rows.append([NAMES.get(peer, peer), MEASURES[key], f"{mean:.2f}", f"{worst:.2f}", f"{better} of {count}"])
    return table(["caustique over", "of", "geometric mean", "worst", "better on"], rows)


def told(key):
    """The name of a renderer for people; a key may have a word behind it: "cycles_path approximates"."""
    peer, _, word = key.partition(" ")
    return f"{NAMES.get(peer, peer)} {word}".strip()


def gallery(figures):
    """A picture and a table for every scene."""
    values = figures.one("peers")
    parts = []
    for row in values["rows"]:
        titles = ", ".join(row["titles"])
        name = row["scene"]
        picture = f"![{name}](gallery/{name.replace('/', '-')}.jpg)"
        lines = [f"### {name}", "", picture, "", textwrap.fill(f"From the left: {titles}.", WIDTH), ""]
        head = ["", "core-s", *(MEASURES[key] for key in values["compared"])]
        cells = [
            [NAMES.get(peer, peer), f"{row['core_seconds'].get(peer, float('nan')):.1f}", *map(digits, of)]
            for peer, of in row["figures"].items()
        ]
        parts.append("\n".join(lines) + "\n" + table(head, cells))
        said = (f"- {told(of)}: {note}" for of, note in row["notes"].items())
        notes = [textwrap.fill(note, WIDTH, subsequent_indent="  ") for note in said]
        parts += ["\n".join(notes) + "\n"] if notes else []
    return "\n".join(parts)


KINDS = {"peers": peers, "gallery": gallery}
