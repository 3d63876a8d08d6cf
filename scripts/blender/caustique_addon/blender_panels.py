"""Enables Blender's own panels for settings that the exporter supports: materials, worlds, cameras, output.

Each panel of Blender lists its engines. This engine is added to the panels that Blender shows with Cycles, except for
unsupported features. Cycles' own panels share one list, so the equivalent panels of EEVEE are used in their place.
"""

import bpy

from .engine import Engine

_LIKE_CYCLES = (
    "EEVEE_MATERIAL_PT_context_material", "EEVEE_MATERIAL_PT_surface", "EEVEE_MATERIAL_PT_volume",
    "EEVEE_WORLD_PT_surface", "EEVEE_WORLD_PT_volume", "DATA_PT_camera_dof", "DATA_PT_camera_dof_aperture",
    "DATA_PT_spot", "RENDER_PT_post_processing",
)
#: Prefixes of the names of excluded panels: unsupported features, and Cycles' own.
_NOT = ("CYCLES_", "RENDER_PT_freestyle", "VIEWLAYER_PT_freestyle", "MATERIAL_PT_freestyle", "RENDER_PT_gpencil",
        "RENDER_PT_stereoscopy", "DATA_PT_camera_stereoscopy", "RENDER_PT_simplify", "RENDER_PT_hair",
        "EEVEE_MATERIAL_PT_viewport_settings", "DATA_PT_falloff_curve", "DATA_PT_lightprobe")


def _panels():
    """The panels of this Blender version that have their own list of engines."""
    for panel in _subclasses(bpy.types.Panel):
        engines = panel.__dict__.get("COMPAT_ENGINES")
        name = panel.__name__
        if isinstance(engines, set) and (name in _LIKE_CYCLES or "CYCLES" in engines and not name.startswith(_NOT)):
            yield engines


def _subclasses(kind):
    for below in kind.__subclasses__():
        yield below
        yield from _subclasses(below)


def register():
    """Add the engine to the panels' lists."""
    for engines in _panels():
        engines.add(Engine.bl_idname)


def unregister():
    """Remove the engine from the panels' lists."""
    for panel in _subclasses(bpy.types.Panel):
        getattr(panel, "COMPAT_ENGINES", set()).discard(Engine.bl_idname)
