"""Time and size of exports from Blender."""

from .markdown import table


def export(figures):
    """Seconds for scenes of many objects, with shared and with separate meshes."""
    rows = []
    for one in figures.all("export"):
        rows.append(
            [
                f"{one['objects']:,}",
                f"{one['meshes']:,}",
                f"{one['triangles'] / 1e6:.2f} million",
                f"{one['seconds']:.1f}",
                f"{one['core_seconds']:.1f}",
                f"{one['bytes'] / 1e6:.1f}",
            ]
        )
    return table(["objects", "meshes", "triangles in the picture", "seconds", "core-seconds", "MB"], rows)


KINDS = {"export": export}
