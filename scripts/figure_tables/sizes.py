"""Sizes of EXR files."""

from .markdown import table

PACKED = ["zip", "zips", "piz", "none"]


def sizes(figures):
    """Megabytes by layers and compression, with the core-seconds that packing takes."""
    rows = []
    for layers, found in figures.one("sizes")["layers"].items():
        cells = [f"{found[packed]['bytes'] / 1e6:.1f} ({max(found[packed]['core_seconds'], 0.0):.1f} s)" for packed in PACKED[:-1]]
        rows.append([f"`{layers}`", *cells, f"{found['none']['bytes'] / 1e6:.1f}", f"{found['longer']['bytes'] / 1e6:.1f}"])
    return table(["`--layers`", *(f"`{packed}`" for packed in PACKED), "`zip`, half of the noise"], rows)


KINDS = {"sizes": sizes}
