"""Tables of squared errors times core-seconds: this program beside an older one and beside other path tracers, the effect
of more photons, and the possible gain from local bandwidths in `vcm`."""

from .gallery_tables import NAMES
from .markdown import table


def _ratio(row):
    """A ratio, in brackets if the mean of one of the pictures is not the reference's."""
    return f"({row['ratio']:.2f})" if row["strange"] else f"{row['ratio']:.2f}"


def _title(name):
    """The title of a method or of another renderer."""
    return NAMES.get(name, f"`{name}`")


def _by_scene(rows, key):
    """A table with a column for each value of a key, and a row for each scene."""
    columns = list(dict.fromkeys(row[key] for row in rows))
    found = {}
    for row in rows:
        found.setdefault(row["scene"], {})[row[key]] = _ratio(row)
    head = ["scene", *map(_title, columns)]
    return table(head, [[scene, *(of.get(column, "-") for column in columns)] for scene, of in found.items()])


def before(figures):
    """This program over the older one, by scene and method."""
    return _by_scene(figures.one("speed")["rows"], "method")


def peers(figures):
    """Our path tracing over another renderer's, by scene and renderer."""
    return _by_scene(figures.one("speed-peers")["rows"], "peer")


def _summary(values, first):
    rows = [
        [_title(name), f"{of['geometric_mean']:.2f}", f"{of['worst']:.2f} ({of['where']})", str(of["of"])]
        for name, of in values["summary"].items()
        if of
    ]
    return table([first, "geometric mean", "worst", "of"], rows)


def before_summary(figures):
    """The geometric mean and the worst ratio, by method."""
    return _summary(figures.one("speed"), "method")


def peers_summary(figures):
    """The geometric mean and the worst ratio, by renderer."""
    return _summary(figures.one("speed-peers"), "ours over")


def photons(figures):
    """The gain from more photons, by set of scenes."""

    def cells(gain):
        return [f"{gain['geometric_mean']:.2f}", f"{gain['least']:.2f} ({gain['where']})", str(gain["of"])]

    rows = [
        [f"{int(count):,}", of, *cells(gain)]
        for count, sets in figures.one("speed-photons")["summary"].items()
        for of, gain in sets.items()
    ]
    return table(["light paths", "scenes", "gain, geometric mean", "least", "of"], rows)


def photons_by_scene(figures):
    """The gain from more photons, by scene."""
    rows = figures.one("speed-photons")["rows"]
    counts = list(rows[0]["gains"])
    head = ["scene", *(f"{int(count):,} light paths" for count in counts)]
    return table(head, [[row["scene"], *(f"{row['gains'][count]:.2f}" for count in counts)] for row in rows])


def vcm_bandwidths(figures):
    """The gain from the best bandwidth of each block over the best one of the picture, by scene."""
    values = figures.one("vcm_bandwidths")
    rows = [
        [row["scene"], str(row["best"]), f"{row['fair']:.2f}", f"{row['bound']:.2f}", f"{row['levels'][-1]:.2f}"]
        for row in values["rows"]
    ]
    mean = ["geometric mean", "", f"{values['fair']:.2f}", f"{values['bound']:.2f}", ""]
    return table(["scene", "best level", "gain, fair", "gain, bound", "largest level"], [*rows, mean])


KINDS = {
    "before": before,
    "before-summary": before_summary,
    "path-peers": peers,
    "path-peers-summary": peers_summary,
    "photons-gain": photons,
    "photons-gain-scenes": photons_by_scene,
    "vcm-bandwidths": vcm_bandwidths,
}
