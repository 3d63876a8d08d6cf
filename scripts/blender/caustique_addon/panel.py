"""The base of the add-on's panels."""

from .engine import Engine


class Panel:
    """Base of the panels: they are visible only if caustique is the scene's engine."""

    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"

    @classmethod
    def poll(cls, context):
        return context.engine == Engine.bl_idname

    def _column(self):
        self.layout.use_property_split, self.layout.use_property_decorate = True, False
        return self.layout.column()
