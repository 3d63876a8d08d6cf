"""The operator that runs `caustique plan`: how the program would render the scene, and why there is no caustic."""

import shutil
import tempfile
import threading
from collections import namedtuple

import bpy

from . import command, handoff, ignored_settings, preferences, program, program_plan, session
from .fault import Cancelled, Fault, fault_from_error

#: A plan: a headline about caustics, the object that `caustique plan --json` prints, all warnings, and the fault if
#: there is no plan, else None.
Plan = namedtuple("Plan", "headline said warnings fault")

_POLL_SECONDS = 0.1


class Diagnose(bpy.types.Operator):
    """Show how the program would render the scene, and likely mistakes in it. Nothing is rendered"""

    bl_idname = "caustique.diagnose"
    bl_label = "Why is there no caustic?"

    select: bpy.props.BoolProperty(name="Select", default=True, description="Select the objects that are named")

    def invoke(self, context, _event):
        """Start from a button: the interface stays responsive."""
        self._begin(context)
        self._timer = context.window_manager.event_timer_add(_POLL_SECONDS, window=context.window)
        context.window_manager.modal_handler_add(self)
        context.workspace.status_text_set("caustique reads the scene. Esc: stop")
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        """Wait until the plan is ready or the user presses Esc."""
        if event.type == "ESC":
            self._stopped = True
        if event.type != "TIMER" or self._worker.is_alive():
            return {"PASS_THROUGH"}
        context.window_manager.event_timer_remove(self._timer)
        context.workspace.status_text_set(None)
        for area in context.screen.areas:
            area.tag_redraw()
        return self._end(context)

    def execute(self, context):
        """Run from a script: wait for the plan."""
        self._begin(context)
        self._worker.join()
        return self._end(context)

    def _begin(self, context):
        self._stopped, self._plan = False, None  # the plan stays None if the user cancels
        self._folder = tempfile.mkdtemp(prefix="caustique-", dir=bpy.app.tempdir)
        self._worker = threading.Thread(target=self._run_plan, args=self._collect_input(context), daemon=True)
        self._worker.start()

    def _collect_input(self, context):
        """Collect the data from Blender that the thread needs, because threads must not access Blender."""
        scene, chosen = context.scene, preferences.get(context)
        try:
            path = program.find(chosen.program)
            frame = scene.frame_current + scene.frame_subframe
            job = handoff.Job(scene, context.view_layer.name, frame, self._folder, chosen.exporter)
            warnings = ignored_settings.warnings(scene) + job.copy()
            scale = scene.render.resolution_percentage
            size = (side * scale // 100 for side in (scene.render.resolution_x, scene.render.resolution_y))
            words = [path, "plan", handoff.GLB, "--json", *command.resolution(*size), *command.threads(scene.render),
                     *command.method(scene.caustique_render)]
            return job, words, warnings, None
        except Fault as fault:
            return None, [], [], fault

    def _run_plan(self, job, words, warnings, fault):
        try:
            if fault is not None:
                raise fault
            warnings = warnings + job.run(lambda: self._stopped)
            said = program_plan.read(words, self._folder, lambda: self._stopped)
            self._plan = Plan(program_plan.headline(said), said, list(dict.fromkeys(warnings + said["warnings"])), None)
        except Cancelled:
            pass
        except Exception as error:  # a thread would lose it
            self._plan = Plan("", None, [], fault_from_error(error))

    def _end(self, context):
        shutil.rmtree(self._folder, ignore_errors=True)
        if self._plan is None:
            return {"CANCELLED"}
        session.plans[context.scene.name] = self._plan
        if self._plan.fault is not None:
            self.report({"ERROR"}, self._plan.fault.message())
            return {"CANCELLED"}
        named = program_plan.named_objects(context.scene, self._plan.warnings)
        if self.select and named:  # if all is well, the selection stays
            _select(context, named)
        self.report({"INFO"}, self._plan.headline)
        return {"FINISHED"}


class Select(bpy.types.Operator):
    """Select the objects named in this message"""

    bl_idname = "caustique.select"
    bl_label = "Select"
    bl_options = {"UNDO"}

    line: bpy.props.StringProperty(options={"HIDDEN"})

    def execute(self, context):
        """Select these objects and deselect all others."""
        _select(context, program_plan.named_objects(context.scene, [self.line]))
        return {"FINISHED"}


def _select(context, things):
    for thing in context.view_layer.objects:
        thing.select_set(False)
    here = [thing for thing in things if thing.name in context.view_layer.objects]
    for thing in here:
        thing.select_set(True)
    if here:
        context.view_layer.objects.active = here[0]


register, unregister = bpy.utils.register_classes_factory((Diagnose, Select))
