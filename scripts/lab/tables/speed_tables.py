"""Tables of times."""

from .markdown import table


def first_picture(figures):
    """Seconds from the opening of a .blend to its finished picture by each path, and the size of its EXR."""
    times = ("render", "f12", "viewport_coarse", "viewport")
    rows = [
        [row["scene"], *(f"{row[key]:.1f}" for key in times), f"{row['exr_mb']:.1f} MB"]
        for row in figures.one("first_picture")["rows"]
    ]
    return table(["scene", "`caustique render`", "F12", "viewport: coarse", "whole", "EXR"], rows)


KINDS = {"first_picture": first_picture}
