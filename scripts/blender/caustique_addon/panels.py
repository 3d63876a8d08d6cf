"""The panels: method, stop conditions, effects with the plan's table, finish, messages, diagnosis, lights, passes."""

import bpy

from . import program_plan, properties, session, text_layout
from .diagnosis import Diagnose, Select
from .panel import Panel
from .presets_menu import Presets

_STOPS = ("iterations", "time", "error")


class MethodPanel(Panel, bpy.types.Panel):
    """The render method."""

    bl_idname = "CAUSTIQUE_PT_method"
    bl_label = "Method"

    def draw_header_preset(self, context):
        """Draw the button of the presets."""
        Presets.draw_panel_header(self.layout)

    def draw(self, context):
        column, settings = self._column(), context.scene.caustique_render
        for name in ("method", "seed", "arguments"):
            column.prop(settings, name)


class StopPanel(Panel, bpy.types.Panel):
    """The stop conditions of a render."""

    bl_idname = "CAUSTIQUE_PT_stop"
    bl_label = "Stop"

    def draw(self, context):
        column, settings = self._column(), context.scene.caustique_render
        for name in _STOPS:
            row = column.row(heading=name.capitalize())
            row.prop(settings, f"use_{name}", text="")
            value = row.row()
            value.active = getattr(settings, f"use_{name}")
            value.prop(settings, name, text="")
        if not any(getattr(settings, f"use_{name}") for name in _STOPS):
            text_layout.draw(column, context, "Nothing is chosen: a render stops after 64 iterations", "INFO")
        done = session.stopped.get(context.scene.name)
        if done is not None:
            text_layout.draw(column, context, f"The last render was stopped after {done} iterations. F12 continues it if scene "
                                              "and settings are as they were", "INFO")
            self.layout.operator("render.render", text="Continue Render", icon="PLAY")


class EffectsPanel(Panel, bpy.types.Panel):
    """The simulated effects, with the plan's table."""

    bl_idname = "CAUSTIQUE_PT_effects"
    bl_label = "Effects"

    def draw(self, context):
        layout, settings = self.layout, context.scene.caustique_render
        layout.operator(Diagnose.bl_idname, text="Read the Plan", icon="PRESET").select = False
        plan = session.plans.get(context.scene.name)
        said = {effect["name"]: effect for effect in plan.said["effects"]} if plan and plan.said else {}
        table = layout.column(align=True)
        if said:
            self._row(table, "label", "Effect", ("simulated by", "of light", "off costs"))
        for name in properties.EFFECTS:
            effect = said.get(name)
            cells = _cells(effect) if effect else ()
            self._row(table, "prop", name, cells, settings, active=not effect or effect["present"])
        if plan and plan.said:
            text_layout.draw(layout, context, plan.said["because"], "INFO")

    @staticmethod
    def _row(table, kind, name, cells, settings=None, active=True):
        row = table.split(factor=0.32)
        row.active = active
        if kind == "prop":
            row.prop(settings, f"use_{name}")
        else:
            row.label(text=name)
        rest = row.split(factor=0.55) if len(cells) > 1 else row
        for number, cell in enumerate(cells):
            rest.label(text=cell)
            if number == 0:
                rest = rest.row()


def _cells(effect):
    """A row of the plan's table: which part simulates the effect, its share of the light, the error without it."""
    if not effect["present"]:
        return ("not in the scene",)
    shares = (effect.get("energy"), effect.get("error_if_off"))
    return (effect["by"] or "left out", *("-" if share is None else f"{100 * share:.2g} %" for share in shares))


class FinishPanel(Panel, bpy.types.Panel):
    """Settings of the finish, which removes noise."""

    bl_idname = "CAUSTIQUE_PT_finish"
    bl_label = "Finish"

    def draw(self, context):
        column, settings = self._column(), context.scene.caustique_render
        column.prop(settings, "finish", text="Denoiser")
        value = column.row()
        value.active = settings.finish != "off"
        value.prop(settings, "use_temporal")


class DiagnosisPanel(Panel, bpy.types.Panel):
    """The diagnosis: why there is no caustic, and likely mistakes."""

    bl_idname = "CAUSTIQUE_PT_diagnosis"
    bl_label = "Caustics"

    def draw(self, context):
        layout, scene = self.layout, context.scene
        layout.operator(Diagnose.bl_idname, icon="VIEWZOOM")
        plan = session.plans.get(scene.name)
        if plan is None:
            return
        if plan.fault is not None:
            text_layout.draw_fault(layout, context, plan.fault)
            return
        text_layout.draw(layout, context, plan.headline, "INFO")
        for reason in program_plan.reasons(plan.said):
            text_layout.draw(layout, context, reason, "DOT")
        _messages(layout, context, plan.warnings)


class MessagesPanel(Panel, bpy.types.Panel):
    """Warnings of the last render, and the fault that ended it."""

    bl_idname = "CAUSTIQUE_PT_messages"
    bl_label = "Messages of the Last Render"

    @classmethod
    def poll(cls, context):
        name = context.scene.name
        return super().poll(context) and (name in session.faults or bool(session.warnings.get(name)))

    def draw(self, context):
        name = context.scene.name
        if name in session.faults:
            text_layout.draw_fault(self.layout, context, session.faults[name])
        _messages(self.layout, context, session.warnings.get(name, []))


def _messages(layout, context, messages):
    """Draw messages, each with a button that selects the objects it names."""
    for line in messages:
        row = layout.box().row()
        text_layout.draw(row, context, line, "ERROR")
        if program_plan.named_objects(context.scene, [line]):
            row.operator(Select.bl_idname, text="", icon="RESTRICT_SELECT_OFF").line = line


class PassesPanel(Panel, bpy.types.Panel):
    """The passes of a view layer."""

    bl_idname = "CAUSTIQUE_PT_passes"
    bl_label = "Passes"
    bl_context = "view_layer"

    def draw(self, context):
        layer = context.view_layer
        groups = (
            ("Data", layer, ("use_pass_z", "use_pass_position", "use_pass_normal", "use_pass_vector")),
            ("", layer.caustique, ("albedo",)),
            ("Light", layer.caustique, ("parts", "noisy_parts", "noisy")),
            *((lobe.capitalize(), layer, tuple(f"use_pass_{lobe}_{part}" for part in ("direct", "indirect", "color")))
              for lobe in ("diffuse", "glossy", "transmission")),
            ("Volume", layer.caustique, ("volume_direct", "volume_indirect")),
            ("Other", layer, ("use_pass_emit", "use_pass_environment")),
            ("Noise", layer.caustique, ("error", "levels")),
            ("Cryptomatte", layer, ("use_pass_cryptomatte_object", "use_pass_cryptomatte_material")),
        )
        for heading, owner, names in groups:
            column = self._column()
            if heading:
                column = self.layout.column(heading=heading)
            for name in names:
                column.prop(owner, name)


class LightPanel(Panel, bpy.types.Panel):
    """The supported settings of a light; Cycles' own panel has more."""

    bl_idname = "CAUSTIQUE_PT_light"
    bl_label = "Light"
    bl_context = "data"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.light is not None

    def draw(self, context):
        light = context.light
        self.layout.row().prop(light, "type", expand=True)
        column = self._column()
        names = ["color", "use_temperature", "temperature", "energy", "exposure", "normalize"]
        if light.type == "SUN":
            names.append("angle")
        elif light.type == "AREA":
            names += ["shape", "size"] + ["size_y"] * (light.shape in {"RECTANGLE", "ELLIPSE"}) + ["spread"]
        else:
            names.append("shadow_soft_size")
        for name in names:
            if hasattr(light, name):  # Blender 4.5 added some
                column.prop(light, name)


register, unregister = bpy.utils.register_classes_factory((
    MethodPanel, StopPanel, FinishPanel, DiagnosisPanel, MessagesPanel, EffectsPanel, PassesPanel, LightPanel,
))
