"""The gallery: all scenes by caustique and by other renderers."""

import re
import textwrap

from .markdown import digits, table

WIDTH = 120

MEASURES = {
    "relmse": "relMSE, all pixels",
    "relmse_trimmed": "relMSE, trimmed",
    "flip": "FLIP",
    "grain_trimmed": "grain, trimmed",
    "flip_inside": "FLIP in glass and mirrors",
    "grain_inside": "grain in glass and mirrors",
}
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


def losses(figures):
    """The scenes on which another renderer has less error, the greatest loss first."""
    values = figures.one("peers")
    found = []
    for row in values["rows"]:
        for key in values["compared"]:
            ratio, best = max(((of[key], peer) for peer, of in row["ratios"].items() if key in of), default=(0, None))
            if ratio > 1:
                found.append((ratio, row["scene"], key, best))
    rows = [
        [scene, MEASURES[key], NAMES.get(best, best), f"{ratio:.2f}"] for ratio, scene, key, best in sorted(found)[::-1]
    ]
    return table(["scene", "of", "best", "caustique over it"], rows)


def peers(figures):
    """Geometric means of our errors over those of the other renderers, and the numbers of scenes in which ours are less."""
    values = figures.one("peers")
    rows = []
    for peer, of in values["summary"].items():
        cells = [of.get(key) for key in values["compared"]]
        rows.append([NAMES.get(peer, peer), *(f"{one[0]:.2f} ({one[2]} of {one[3]})" if one else "-" for one in cells)])
    return table(["caustique over", *(MEASURES[key] for key in values["compared"])], rows)


def inside(figures):
    """FLIP inside glass and mirrors by scene and budget, of caustique and of the best of the other renderers."""
    values, rows = figures.one("peers"), []
    by = values["compared"].index("flip_inside")
    for measured in [values, *values.get("later_budgets", [])]:
        for row in measured["rows"]:
            ours = row["figures"]["auto"][by]
            theirs = {peer: of[by] for peer, of in row["figures"].items() if peer != "auto" and of[by] is not None}
            if ours is not None and theirs:
                peer, least = min(theirs.items(), key=lambda item: item[1])
                shown = [digits(ours), digits(least), NAMES.get(peer, peer), f"{ours / least:.2f}"]
                rows.append([row["scene"], f"{measured['seconds']:g}", *shown])
    return table(["scene", "core-s", "caustique", "best other", "renderer", "caustique over it"], rows)


def plain(note):
    """A stored note in today's words."""
    for old, new in NOTES.items():
        note = note.replace(old, new)
    return note


def incomparable(notes):
    """The names of the renderers whose pictures are not compared, by reason, with the ratio of the means where that is the
    reason."""
    found = {}
    for peer, note in notes.items():
        mean = re.fullmatch(r"not comparable: its mean is (\S+) of the reference's.*", note)
        reason = "another mean than the reference's" if mean else plain(note)
        found.setdefault(reason, []).append(NAMES.get(peer, peer) + (f" ({mean[1]})" if mean else ""))
    return found


def approximations(rows):
    """The programs that approximate something in any of the scenes, by what they approximate."""
    found = {}
    for row in rows:
        for key, note in row["notes"].items():
            peer, _, word = key.partition(" ")
            if word == "approximates":
                for part in plain(note).split("; "):
                    found.setdefault(part, {})[NAMES.get(peer, peer).split(",")[0]] = None
    return found


def _items(found):
    """A list with the names behind each text."""
    items = (f"- {', '.join(names)}: {text}" for text, names in found.items())
    return "".join(textwrap.fill(item, WIDTH, subsequent_indent="  ") + "\n" for item in items)


def best(figures, by):
    """The figures of each program's variant with the least error, the figure number `by`."""
    found = {}
    for peer, of in figures.items():
        found.setdefault(NAMES.get(peer, peer).split(",")[0], []).append((of[by], peer))
    return {peer: figures[peer] for _, peer in map(min, found.values())}


def _is_translated(row):
    """Whether any other renderer has a picture of a row's scene."""
    return bool(row["core_seconds"].keys() - {"auto"})


def gallery(figures):
    """A picture, and a table of the best variant of each renderer, for every scene of which another one has a picture."""
    values = figures.one("peers")
    parts = []
    for row in filter(_is_translated, values["rows"]):
        titles = ", ".join(row["titles"])
        name = row["scene"]
        picture = f"![{name}](gallery/{name.replace('/', '-')}.jpg)"
        lines = [f"### {name}", "", picture, "", textwrap.fill(f"From the left: {titles}.", WIDTH), ""]
        head = ["", "core-s", *(MEASURES[key] for key in values["compared"])]
        cells = [
            [NAMES.get(peer, peer), f"{row['core_seconds'].get(peer, float('nan')):.1f}", *map(digits, of)]
            for peer, of in best(row["figures"], values["compared"].index("relmse_trimmed")).items()
        ]
        parts.append("\n".join(lines) + "\n" + table(head, cells))
        notes = _items(incomparable({key: note for key, note in row["notes"].items() if " " not in key}))
        parts += [notes] if notes else []
    parts.append("### Approximations of the drivers\n\n" + _items(approximations(values["rows"])))
    return "\n".join(parts)


KINDS = {"losses": losses, "peers": peers, "inside": inside, "gallery": gallery}
