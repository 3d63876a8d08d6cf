"""Blender's own panels that show what the exporter carries: materials, worlds, cameras, output.

A panel of Blender lists the engines it is for. Those that Blender shows beside Cycles are for this engine, too, less
those of features that are not rendered. Cycles' own panels have one list in common, so they cannot be had one by one;
the panels of EEVEE for the same nodes and lenses stand in for them.
"""

import bpy

from .engine import Engine

_LIKE_CYCLES = (
    "EEVEE_MATERIAL_PT_context_material", "EEVEE_MATERIAL_PT_surface", "EEVEE_MATERIAL_PT_volume",
    "EEVEE_WORLD_PT_surface", "EEVEE_WORLD_PT_volume", "DATA_PT_camera_dof", "DATA_PT_camera_dof_aperture",
    "DATA_PT_spot", "RENDER_PT_post_processing",
)
#: Beginnings of names: what is not rendered, and Cycles' own.
_NOT = ("CYCLES_", "RENDER_PT_freestyle", "VIEWLAYER_PT_freestyle", "MATERIAL_PT_freestyle", "RENDER_PT_gpencil",
        "RENDER_PT_stereoscopy", "DATA_PT_camera_stereoscopy", "RENDER_PT_simplify", "RENDER_PT_hair",
        "EEVEE_MATERIAL_PT_viewport_settings", "DATA_PT_falloff_curve", "DATA_PT_lightprobe")


def _panels():
    """The panels, as far as this Blender has them, whose list of engines is their own."""
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
    """Put the engine on the panels' lists."""
    for engines in _panels():
        engines.add(Engine.bl_idname)


def unregister():
    """Take it off all lists."""
    for panel in _subclasses(bpy.types.Panel):
        getattr(panel, "COMPAT_ENGINES", set()).discard(Engine.bl_idname)
