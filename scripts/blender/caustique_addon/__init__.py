"""caustique as a render engine of Blender: 3.4 as an add-on, 4.2 and newer as an extension.

A render writes a copy of the scene, exports it in a Blender of its own (`handoff`), runs the program on the export
(`run`), shows the picture so far, and loads the layers as passes (`engine`, `passes`). The program does the rendering,
and what it says of the scene is shown as it stands (`session`, `panels`).
"""

from . import blender_panels, diagnosis, engine, panels, preferences, properties

# Blender before 4.2 reads this, newer ones blender_manifest.toml.
bl_info = {
    "name": "caustique",
    "author": "caustique",
    "description": "Renders the light that glass, water and mirrors focus",
    "version": (0, 1, 0),
    "blender": (3, 4, 0),
    "category": "Render",
    "support": "COMMUNITY",
}

# In this order: the engine and the panels read the properties.
_PARTS = (preferences, properties, engine, diagnosis, panels, blender_panels)


def register():
    """Blender calls this when the add-on is switched on."""
    for part in _PARTS:
        part.register()


def unregister():
    """Blender calls this when the add-on is switched off or removed: nothing of it stays."""
    for part in reversed(_PARTS):
        part.unregister()
