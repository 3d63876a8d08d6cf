"""Presets of the render settings, by Blender's own mechanism: those of the folder `presets`, and those that users add."""

import os

import bpy
from bl_operators.presets import AddPresetBase
from bl_ui.utils import PresetPanel

from . import properties

#: Folder of users' presets, below the folders `presets` of Blender's scripts.
SUBDIR = "caustique_render"
_SUPPLIED = os.path.join(os.path.dirname(os.path.abspath(__file__)), "presets")
_VALUES = ("method", "use_iterations", "iterations", "use_time", "time", "use_error", "error", "finish", "use_temporal", "arguments",
           *(f"use_{name}" for name in properties.EFFECTS))


class Presets(PresetPanel, bpy.types.Panel):
    """The menu of presets in the header of the panel Method."""

    bl_idname = "CAUSTIQUE_PT_presets"
    bl_label = "Render Presets"
    preset_subdir = SUBDIR
    preset_operator = "script.execute_preset"
    preset_add_operator = "caustique.add_preset"

    @classmethod
    def draw_panel_header(cls, layout):
        """Draw the button that opens the menu."""
        layout.emboss = "NONE"
        layout.popover(panel=cls.bl_idname, icon="PRESET", text="")

    def draw(self, context):
        """List the supplied presets, then the user's with a field to add one."""
        self.layout.emboss = "PULLDOWN_MENU"
        self.layout.operator_context = "EXEC_DEFAULT"
        self.path_menu([_SUPPLIED], self.preset_operator, filter_ext=lambda extension: extension == ".py")
        bpy.types.Menu.draw_preset(self, context)


class AddPreset(AddPresetBase, bpy.types.Operator):
    """Add the render settings as a preset, or remove one"""

    bl_idname = "caustique.add_preset"
    bl_label = "Add Render Preset"
    preset_menu = Presets.bl_idname
    preset_subdir = SUBDIR
    preset_defines = ["settings = bpy.context.scene.caustique_render"]
    preset_values = [f"settings.{name}" for name in _VALUES]


register, unregister = bpy.utils.register_classes_factory((Presets, AddPreset))
