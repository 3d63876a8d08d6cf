"""The add-on's preferences: the program's path, with the errors of the program there."""

import bpy

from . import program, text_layout
from .fault import Fault


class Preferences(bpy.types.AddonPreferences):
    """Edit > Preferences > Add-ons > caustique."""

    bl_idname = __package__

    program: bpy.props.StringProperty(
        name="Program", subtype="FILE_PATH", update=lambda _self, _context: program.clear_cache(),
        description="The program caustique; if empty, the one in this extension, else the one on the PATH")
    exporter: bpy.props.StringProperty(
        name="Exporter", subtype="FILE_PATH",
        description="Another Blender, or a Python that has bpy, to export the scene with; if empty, this Blender")

    def draw(self, context):
        """Draw the paths, and the program's version or fault."""
        layout = self.layout
        layout.prop(self, "program")
        try:
            path = program.find(self.program)
            layout.label(text=f"{path}, version {program.dotted(program.version(path))}", icon="CHECKMARK")
            for fault in program.missing_libraries(path):
                text_layout.draw_fault(layout, context, fault)
        except Fault as fault:
            text_layout.draw_fault(layout, context, fault)
        layout.prop(self, "exporter")


def get(context):
    """The add-on's preferences."""
    return context.preferences.addons[__package__].preferences


def register():
    """Register the preferences."""
    bpy.utils.register_class(Preferences)


def unregister():
    """Unregister the preferences."""
    bpy.utils.unregister_class(Preferences)
