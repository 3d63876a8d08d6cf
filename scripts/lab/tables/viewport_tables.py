"""Latency of Blender's viewport."""

from .markdown import table

# Stored key of a pair of summaries, and its title.
_ROWS = (
    ("export, Blender started", "export"),
    ("load", "load"),
    ("from loading to the first picture, coarse", "first"),
    ("from loading to the first full picture", "first_full"),
    ("camera move to the coarse picture", "move"),
    ("camera move to the full picture", "move_full"),
    ("moved object to the coarse picture", "place"),
)


def _cell(one, key):
    """Seconds and core-seconds of a stored value."""
    if isinstance(one[key], dict):
        of = one[key]
        return f"{of['median']:.2f} (worst {of['worst']:.2f}; {of['core_seconds']:.2f} core-s)"
    cores = one.get(f"{key}_core_seconds")
    return f"{one[key]:.2f}" + ("" if cores is None else f" ({cores:.2f} core-s)")


def viewport(figures):
    """Seconds from changes to pictures, by scene."""
    scenes = sorted(figures.all("viewport"), key=lambda one: one["triangles"])
    rows = [[title, *(_cell(one, key) for one in scenes)] for title, key in _ROWS]
    rows.append(["coarse pictures a second while the camera moves", *(f"{1 / one['drag']:.1f}" for one in scenes)])
    rows.append(["ratio of sides of the last coarse picture", *(f"1 / {one['coarse']}" for one in scenes)])
    rows.append(["peak memory, GiB", *(f"{one['peak_bytes'] / 2**30:.2f}" for one in scenes)])
    rows.append(["load average", *(f"{one['load_average']:.1f}" for one in scenes)])
    return table(["seconds", *(one["scene"] for one in scenes)], rows)


KINDS = {"viewport": viewport}
