"""The gallery: all scenes by caustique and by other renderers."""

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
    "cycles_caustics": "Cycles, shadow caustics",
}
# Notes of stored figures, in the words that the drivers use today.
NOTES = {
    "what lies below a shine is coupled to it in another way": "gloss is coupled with the layer below it by another model",
    "the sun as a few pixels of the environment": "the sun is a few pixels of the environment",
    "metals reflect by another Fresnel term than Schlick's": "the Fresnel term of metals is not Schlick's",
    "a sun of some size before an image has no size": "a sun with a size becomes a point in front of an environment image",
}


def peers(figures):
    """Our errors over those of the other renderers."""
    values = figures.one("peers")
    rows = []
    for peer, of in values["summary"].items():
        for key, (mean, worst, better, count) in of.items():
            rows.append([NAMES.get(peer, peer), MEASURES[key], f"{mean:.2f}", f"{worst:.2f}", f"{better} of {count}"])
    return table(["caustique over", "of", "geometric mean", "worst", "better on"], rows)


def title(key):
    """The name of a renderer; a key may have a second word, as in "cycles_path approximates"."""
    peer, _, word = key.partition(" ")
    return f"{NAMES.get(peer, peer)} {word}".strip()


def plain(note):
    """A stored note in today's words."""
    for old, new in NOTES.items():
        note = note.replace(old, new)
    return note


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
        items = (f"- {title(of)}: {plain(note)}" for of, note in row["notes"].items())
        notes = [textwrap.fill(item, WIDTH, subsequent_indent="  ") for item in items]
        parts += ["\n".join(notes) + "\n"] if notes else []
    return "\n".join(parts)


KINDS = {"peers": peers, "gallery": gallery}
