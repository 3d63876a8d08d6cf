"""Sizes of EXR files."""

from .markdown import table

PACKED = ["zip", "zips", "piz", "none"]


def sizes(figures):
    """Megabytes by layers and compression."""
    rows = []
    for layers, found in figures.one("sizes")["layers"].items():
        cells = [found[packed] for packed in PACKED] + [found["longer"]]
        rows.append([f"`{layers}`", *(f"{cell['bytes'] / 1e6:.1f}" for cell in cells)])
    return table(["`--layers`", *(f"`{packed}`" for packed in PACKED), "`zip`, half of the noise"], rows)


KINDS = {"sizes": sizes}
