"""Panels for settings of Blender that the exporter reads, and whose own panels belong to Cycles alone."""

import bpy
from bpy_extras.node_utils import find_node_input

from .panel import Panel


def _draw_input(layout, block, kind, name):
    """Draw the nodes that are linked to an input of a block's output node."""
    tree = getattr(block, "node_tree", None)
    node = tree.get_output_node("CYCLES") if tree is not None else None
    socket = find_node_input(node, name) if node is not None else None
    if socket is None:
        layout.label(text=f"No {kind} output node")
    else:
        layout.template_node_view(tree, node, socket)


def _draw_light_group(column, context, owner):
    column.prop_search(owner, "lightgroup", context.view_layer, "lightgroups", text="Light Group")


class FilmPanel(Panel, bpy.types.Panel):
    """The transparent background, and the exposure of the PNG."""

    bl_idname = "CAUSTIQUE_PT_film"
    bl_label = "Film"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        column = self._column()
        column.prop(context.scene.render, "film_transparent", text="Transparent")
        if hasattr(context.scene, "cycles"):
            column.prop(context.scene.cycles, "film_exposure")


class PerformancePanel(Panel, bpy.types.Panel):
    """The number of threads, and what frames share."""

    bl_idname = "CAUSTIQUE_PT_performance"
    bl_label = "Performance"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        column, render = self._column(), context.scene.render
        column.prop(render, "threads_mode")
        value = column.row()
        value.active = render.threads_mode == "FIXED"
        value.prop(render, "threads")
        column.prop(render, "use_persistent_data", text="Persistent Data")


class SimplifyPanel(Panel, bpy.types.Panel):
    """Limits on the level of detail."""

    bl_idname = "CAUSTIQUE_PT_simplify"
    bl_label = "Simplify"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_header(self, context):
        self.layout.prop(context.scene.render, "use_simplify", text="")

    def draw(self, context):
        column, render = self._column(), context.scene.render
        column.active = render.use_simplify
        column.prop(render, "simplify_subdivision_render", text="Max Subdivision")
        column.prop(render, "simplify_child_particles_render", text="Child Particles")


class MotionBlurPanel(Panel, bpy.types.Panel):
    """The shutter of motion blur."""

    bl_idname = "CAUSTIQUE_PT_motion_blur"
    bl_label = "Motion Blur"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_header(self, context):
        self.layout.prop(context.scene.render, "use_motion_blur", text="")

    def draw(self, context):
        column, render = self._column(), context.scene.render
        column.active = render.use_motion_blur
        # Blender before 4.2 has the position among Cycles' settings.
        owner = render if hasattr(render, "motion_blur_position") else getattr(context.scene, "cycles", None)
        if owner is not None:
            column.prop(owner, "motion_blur_position", text="Position")
        column.prop(render, "motion_blur_shutter")


class ObjectMotionBlurPanel(Panel, bpy.types.Panel):
    """Whether an object's motion and deformation are blurred, and the number of sub-steps."""

    bl_idname = "CAUSTIQUE_PT_object_motion_blur"
    bl_label = "Motion Blur"
    bl_context = "object"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        return super().poll(context) and hasattr(context.object, "cycles")

    def draw_header(self, context):
        self.layout.prop(context.object.cycles, "use_motion_blur", text="")

    def draw(self, context):
        column, settings = self._column(), context.object.cycles
        column.active = context.scene.render.use_motion_blur and settings.use_motion_blur
        column.prop(settings, "motion_steps", text="Steps")
        if context.object.type not in {"CAMERA", "LIGHT"}:
            column.prop(settings, "use_deform_motion", text="Deformation")


class LayerPanel(Panel, bpy.types.Panel):
    """The view layer's filter and light groups."""

    bl_idname = "CAUSTIQUE_PT_layer"
    bl_label = "Filter and Light Groups"
    bl_context = "view_layer"

    def draw(self, context):
        layer, column = context.view_layer, self._column()
        column.prop(layer, "use_sky", text="Environment")
        row = self.layout.row()
        row.template_list("UI_UL_list", "lightgroups", layer, "lightgroups", layer, "active_lightgroup_index", rows=3)
        buttons = row.column(align=True)
        buttons.operator("scene.view_layer_add_lightgroup", icon="ADD", text="")
        buttons.operator("scene.view_layer_remove_lightgroup", icon="REMOVE", text="")


class ObjectPanel(Panel, bpy.types.Panel):
    """Whether renders and cameras see an object, and its light group."""

    bl_idname = "CAUSTIQUE_PT_object"
    bl_label = "Visibility"
    bl_context = "object"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.object is not None

    def draw(self, context):
        column, thing = self._column(), context.object
        column.prop(thing, "hide_render", text="Show in Renders", invert_checkbox=True)
        column.prop(thing, "visible_camera", text="Seen by Cameras")
        _draw_light_group(column, context, thing)


class LightNodesPanel(Panel, bpy.types.Panel):
    """The nodes of a light."""

    bl_idname = "CAUSTIQUE_PT_light_nodes"
    bl_label = "Nodes"
    bl_context = "data"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.light is not None

    def draw(self, context):
        light = context.light
        if bpy.app.version < (5, 1, 0):  # later, lights always have nodes
            self.layout.prop(light, "use_nodes", toggle=True)
        if bpy.app.version >= (5, 1, 0) or light.use_nodes:
            _draw_input(self.layout, light, "light", "Surface")


class DisplacementPanel(Panel, bpy.types.Panel):
    """The displacement of a material."""

    bl_idname = "CAUSTIQUE_PT_displacement"
    bl_label = "Displacement"
    bl_context = "material"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.material is not None

    def draw(self, context):
        material = context.material
        if hasattr(material, "displacement_method"):
            self._column().prop(material, "displacement_method", text="Method")
        _draw_input(self.layout, material, "material", "Displacement")


class WorldPanel(Panel, bpy.types.Panel):
    """Whether cameras see the world, and its light group."""

    bl_idname = "CAUSTIQUE_PT_world"
    bl_label = "Visibility"
    bl_context = "world"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.world is not None

    def draw(self, context):
        column, world = self._column(), context.world
        if hasattr(world, "cycles_visibility"):
            column.prop(world.cycles_visibility, "camera", text="Seen by Cameras")
        _draw_light_group(column, context, world)


register, unregister = bpy.utils.register_classes_factory((
    FilmPanel, PerformancePanel, SimplifyPanel, MotionBlurPanel, LayerPanel, ObjectPanel, ObjectMotionBlurPanel,
    LightNodesPanel, DisplacementPanel, WorldPanel,
))
