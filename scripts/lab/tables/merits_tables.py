"""Squared errors times core-seconds: of this program beside an older one, beside other path tracers, and by photons; and
what bandwidths of their own could bring to `vcm`."""

from .markdown import table


def _ratio(row):
    """A ratio; in brackets where a picture is not of the scene."""
    return f"({row['ratio']:.2f})" if row["strange"] else f"{row['ratio']:.2f}"


def _by_scene(rows, key):
    """A column for each value of a key, a row for each scene."""
    columns = list(dict.fromkeys(row[key] for row in rows))
    found = {}
    for row in rows:
        found.setdefault(row["scene"], {})[row[key]] = _ratio(row)
    head = ["scene", *(f"`{column}`" for column in columns)]
    return table(head, [[scene, *(of.get(column, "-") for column in columns)] for scene, of in found.items()])


def before(figures):
    """After over before, by scene and method."""
    return _by_scene(figures.one("speed")["rows"], "method")


def peers(figures):
    """Ours over theirs, by scene and peer."""
    return _by_scene(figures.one("speed-peers")["rows"], "peer")


def _summary(values, first):
    rows = [
        [f"`{name}`", f"{of['geometric_mean']:.2f}", f"{of['worst']:.2f} ({of['where']})", str(of["of"])]
        for name, of in values["summary"].items()
        if of
    ]
    return table([first, "geometric mean", "worst", "of"], rows)


def before_summary(figures):
    """Geometric means and worst ratios, by method."""
    return _summary(figures.one("speed"), "method")


def peers_summary(figures):
    """Geometric means and worst ratios, by peer."""
    return _summary(figures.one("speed-peers"), "ours over")


def photons(figures):
    """What more photons gain, by set of scenes."""

    def cells(gain):
        return [f"{gain['geometric_mean']:.2f}", f"{gain['least']:.2f} ({gain['where']})", str(gain["of"])]

    rows = [
        [f"{int(count):,}", of, *cells(gain)]
        for count, sets in figures.one("speed-photons")["summary"].items()
        for of, gain in sets.items()
    ]
    return table(["light paths", "scenes", "gain, geometric mean", "least", "of"], rows)


def photons_by_scene(figures):
    """What more photons gain, by scene."""
    rows = figures.one("speed-photons")["rows"]
    counts = list(rows[0]["gains"])
    head = ["scene", *(f"{int(count):,} light paths" for count in counts)]
    return table(head, [[row["scene"], *(f"{row['gains'][count]:.2f}" for count in counts)] for row in rows])


def vcm_bandwidths(figures):
    """What the best bandwidth of each block gains over the best one for the picture, by scene."""
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
