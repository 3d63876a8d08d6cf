"""The render engine, for F12, animations and the viewport.

Blender calls `render` for each view layer of each frame, in a thread beside the interface. `view_update` and `view_draw`
are for viewports with the shading 'Rendered', each of which has an engine of its own.
"""

import contextlib
import os
import shutil
import tempfile
import time

import bpy
import numpy

from . import (
    command, exr, handoff, ignored_settings, passes, persistent_data, preferences, program, resume, run, session, temporal_finish,
    viewport,
)
from .fault import Cancelled, fault_from_error

_POLL_SECONDS = 0.1  # between two checks of the program's progress
_PREVIEW = "--preview"


class Engine(bpy.types.RenderEngine):
    """Blender's interface to caustique as a render engine."""

    bl_idname = "CAUSTIQUE"
    bl_label = "caustique"
    bl_use_preview = False
    bl_use_eevee_viewport = True
    bl_use_shading_nodes_custom = False
    _viewport = None  # the `viewport.Viewport` of an engine that draws one

    def __del__(self):
        # Blender may have removed the engine of a render, which has no viewport.
        with contextlib.suppress(ReferenceError):
            if self._viewport is not None:
                self._viewport.close()

    def view_update(self, context, depsgraph):
        """Take changes of the scene that a viewport shows."""
        try:
            if self._viewport is None:
                self._viewport = viewport.Viewport(depsgraph.scene, depsgraph.view_layer)
            self._viewport.update(depsgraph)
        except Exception as error:  # Blender would print it and go on
            self.error_set(fault_from_error(error).message())

    def view_draw(self, context, depsgraph):
        """Draw the picture so far in a viewport."""
        if self._viewport is None:
            return
        region, space, view = context.region, context.space_data, context.region_data
        camera = space.camera if view.view_perspective == "CAMERA" else None
        is_camera = camera is not None and camera.type == "CAMERA"
        flat = is_camera and camera.data.type == "ORTHO"
        step = max(_pixel_size(depsgraph.scene.render.preview_pixel_size), 1)
        size = (max(region.width // step, 1), max(region.height // step, 1))
        back = 0.0 if view.is_perspective or is_camera else space.clip_end / 2
        lens = viewport.lens(camera, flat) if is_camera else None
        self._viewport.want(view.view_matrix, view.window_matrix, back, size, lens)
        text, fault = self._viewport.draw(self, depsgraph.scene, (region.width, region.height))
        self.update_stats("", text if fault is None else f"caustique: {fault.what}. {fault.remedy}")

    def update_render_passes(self, scene=None, renderlayer=None):
        """Register the passes that the view layer enables."""
        self.register_pass(scene, renderlayer, "Combined", 4, "RGBA", "COLOR")
        for one in passes.wanted(renderlayer):
            self.register_pass(scene, renderlayer, one.name, len(one.components), one.components, one.kind)

    def render(self, depsgraph):
        """Render one view layer of one frame."""
        folder = tempfile.mkdtemp(prefix="caustique-", dir=bpy.app.tempdir)
        try:
            self._render(depsgraph, folder)
        except Cancelled:
            persistent_data.end()
        except Exception as error:
            persistent_data.end()
            fault = fault_from_error(error)
            session.faults[depsgraph.scene.name] = fault
            self.report({"ERROR"}, fault.message())  # ends an animation, too; `error_set` would not
        finally:
            shutil.rmtree(folder, ignore_errors=True)

    def _render(self, depsgraph, folder):
        scene, view_layer = depsgraph.scene_eval, depsgraph.view_layer_eval
        part = _part(scene.render, self.resolution_x, self.resolution_y)
        with self._result(view_layer.name, part):
            pass  # black: Blender crashes when it writes a picture that was never begun
        chosen = preferences.get(bpy.context)
        path = program.find(chosen.program)
        self._warn(scene, ignored_settings.warnings(scene))
        self.update_stats("", "Exporting")
        frame = scene.frame_current + scene.frame_subframe
        job = handoff.Job(depsgraph.scene, view_layer.name, frame, folder, chosen.exporter)
        self._export(job)

        is_temporal = temporal_finish.applies(scene, self.is_animation)
        chosen_layers, method = passes.layers(passes.wanted(view_layer)), command.method(scene.caustique_render)
        if is_temporal:
            chosen_layers = temporal_finish.layers(chosen_layers)
            method = temporal_finish.with_seed_of_frame(method, scene.frame_current)
        output, preview = os.path.join(folder, "render.exr"), os.path.join(folder, "preview.exr")
        words = [path, "render", handoff.GLB, "--exr-naming", "blender", "--compression", "none",
                 "--layers", chosen_layers, "--progress", "json", "--verbose",
                 *command.resolution(self.resolution_x, self.resolution_y), *command.threads(scene.render),
                 *method]
        saved = resume.Checkpoint([program.version(path), *words], folder)
        words += ["-o", output, *saved.options()]
        if _PREVIEW in program.options(path):
            words += [_PREVIEW, preview]
        work = run.Run(words, folder)
        try:
            saved.started(work.process_id)
            stopped = self._watch(work, saved, preview, view_layer.name, part)
            work.finish()
            if stopped:
                persistent_data.end()
            if stopped and work.progress is not None:
                session.stopped[scene.name] = work.progress["iteration"]
        finally:
            work.kill()
            saved.end()
        self._warn(scene, work.warnings)
        if not os.path.isfile(output):  # stopped before the first iteration
            raise Cancelled()
        self._deliver(exr.Picture(output), scene, view_layer.name, part)
        if is_temporal and not stopped:
            self._warn(scene, temporal_finish.keep(scene, view_layer, scene.frame_current, output, path))

    def _export(self, job):
        """Export a frame."""
        def tell(text):
            self.update_stats("", text)

        scene = job.exporter.scene
        if persistent_data.applies(scene, self.is_animation):
            self._warn(scene, persistent_data.export(job, self._is_cancelled, tell))
            return
        self._warn(scene, handoff.in_main_thread(job.copy, self._is_cancelled))
        self._warn(scene, job.run(self._is_cancelled, tell))

    def _is_cancelled(self):
        """Whether the user has pressed Esc."""
        return self.test_break()

    def _watch(self, work, saved, preview, layer, part):
        """Show the program's progress and its picture so far until it ends. Returns whether the user has stopped it."""
        said, shown, cancelled = None, None, False
        begins = "Continuing the stopped render" if saved.exists() else "Rendering the first iteration"
        while work.is_running():
            cancelled = self._is_cancelled()
            if cancelled:
                saved.stopped()
                work.stop(saved.is_saved)
                text = "Stopping"
            elif work.progress is None:
                text = begins
            else:
                text = run.sentence(work.progress)
                self.update_progress(run.fraction(work.progress))
            if text != said:
                said = text
                self.update_stats("", text)
            written = os.stat(preview).st_mtime_ns if os.path.isfile(preview) else None
            if written != shown and not cancelled:
                shown = written
                self._show(exr.Picture(preview), layer, part)
            time.sleep(_POLL_SECONDS)
        return cancelled

    @contextlib.contextmanager
    def _result(self, layer, part):
        """Blender's result of a view layer, to be filled. Blender crashes if one is begun and not ended."""
        _, _, width, height = part
        result = self.begin_result(0, 0, width, height, layer=layer)
        try:
            yield result
        finally:
            self.end_result(result)

    def _show(self, picture, layer, part):
        """Copy the picture so far to Blender's result."""
        with self._result(layer, part) as result:
            passes.fill_combined(result.layers[0], picture, part)

    def _deliver(self, picture, scene, layer, part):
        """Copy the finished picture and its passes to Blender's result."""
        with self._result(layer, part) as result:
            black = passes.fill(result.layers[0], picture, part)
        passes.copy_manifests(self.get_result(), picture, layer)
        if black:
            self._warn(scene, [f"{', '.join(black)}: this method does not make these passes, and they are black: "
                               "choose another method, or switch them off"])

    def _warn(self, scene, lines):
        known = session.warnings.setdefault(scene.name, [])
        for line in lines:
            if line not in known:  # frames and view layers repeat most warnings
                known.append(line)
                self.report({"WARNING"}, line)


def _pixel_size(name):
    """The pixels of the region per pixel of the picture, by Blender's setting Pixel Size."""
    return 1 if name == "AUTO" else int(name)


def _part(render, width, height):
    """The render region: x, y (from the top left), width and height in pixels."""
    if not render.use_border:
        return 0, 0, width, height
    # In single precision and truncated, as in Blender.
    left, right, bottom, top = (int(numpy.float32(share) * numpy.float32(side)) for share, side in (
        (render.border_min_x, width), (render.border_max_x, width), (render.border_min_y, height),
        (render.border_max_y, height)))
    return left, height - top, right - left, top - bottom


@bpy.app.handlers.persistent
def _forget(scene, *_):
    """Clear the messages of the previous render when a new one begins, which may have many frames."""
    session.warnings.pop(scene.name, None)
    session.faults.pop(scene.name, None)
    session.stopped.pop(scene.name, None)


def register():
    """Register the engine."""
    bpy.utils.register_class(Engine)
    bpy.app.handlers.render_init.append(_forget)


def unregister():
    """Unregister the engine and clear its messages."""
    bpy.app.handlers.render_init.remove(_forget)
    bpy.utils.unregister_class(Engine)
    session.clear()
