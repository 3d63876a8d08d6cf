"""Sizes of EXR files."""

from .markdown import table

COMPRESSIONS = ["zip", "zips", "piz", "none"]


def sizes(figures):
    """Table of the sizes of EXR files in megabytes, by layers and compression."""
    rows = []
    for layers, found in figures.one("sizes")["layers"].items():
        cells = [found[name] for name in COMPRESSIONS] + [found["longer"]]
        rows.append([f"`{layers}`", *(f"{cell['bytes'] / 1e6:.1f}" for cell in cells)])
    return table(["`--layers`", *(f"`{name}`" for name in COMPRESSIONS), "`zip`, half of the noise"], rows)


KINDS = {"sizes": sizes}
