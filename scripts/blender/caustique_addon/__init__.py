"""caustique as a render engine of Blender: an add-on for Blender 3.4, an extension for 4.2 and newer.

A render writes a copy of the scene, exports it in a second Blender process (`handoff`), which the frames of an animation
may share (`persistent_data`), runs the program on the export (`run`), shows the picture so far, and loads the layers as
passes (`engine`, `passes`). A viewport keeps the program running (`viewport`, `live`, `server`). The program renders; the
panels show its messages in words of the interface (`wording`, `session`, `panels`).
"""

from . import (
    blender_panels, diagnosis, engine, handoff, material_panel, panels, persistent_data, preferences, presets_menu,
    properties, scene_panels, temporal_finish, viewport,
)

# Blender before 4.2 reads this dictionary, later versions blender_manifest.toml.
bl_info = {
    "name": "caustique",
    "author": "caustique",
    "description": "Renders the light that glass, water and mirrors focus",
    "version": (0, 2, 0),
    "blender": (3, 4, 0),
    "category": "Render",
    "support": "COMMUNITY",
}

# Order matters: the engine and the panels use the properties.
_PARTS = (preferences, properties, handoff, persistent_data, temporal_finish, viewport, engine, diagnosis, presets_menu, panels, scene_panels,
          material_panel, blender_panels)


def register():
    """Register the add-on's classes. Blender calls this when the user enables it."""
    for part in _PARTS:
        part.register()


def unregister():
    """Unregister all classes. Blender calls this when the user disables or removes the add-on."""
    for part in reversed(_PARTS):
        part.unregister()
