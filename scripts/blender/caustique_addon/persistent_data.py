"""Blender's setting Persistent Data: all frames of an animation share a second Blender and one copy of the scene.

The second Blender opens the copy again for each frame, so that no frame depends on those before it. The scene is copied
again if it may have changed, and for each frame if a copy of another frame may not do.
"""

import shutil
import tempfile
from typing import NamedTuple

import bpy

from . import handoff
from .fault import Cancelled, Fault

#: Handlers that run between the exports of two frames.
_HANDLERS_BETWEEN_FRAMES = ("frame_change_pre", "frame_change_post", "render_pre", "render_post", "render_write", "render_stats",
                            "composite_pre", "composite_post")
_WITH_CACHE = {"CLOTH", "SOFT_BODY", "FLUID", "DYNAMIC_PAINT"}  # types of modifiers


class _Kept(NamedTuple):
    """The exporter of the animation that renders, and its folder."""

    exporter: handoff.Exporter
    folder: str


_kept = None
_changed = False  # whether the next frame needs a new copy of the scene


def applies(scene, is_animation):
    """Whether the frames of a render may share one copy of the scene and the Blender that exports it."""
    return is_animation and scene.render.use_persistent_data


def _has_handlers():
    """Whether Python runs between two frames that may change the scene. The second Blender does not run it."""
    functions = [function for name in _HANDLERS_BETWEEN_FRAMES for function in getattr(bpy.app.handlers, name)]
    return not all((getattr(one, "__module__", None) or "").startswith(__package__ + ".") for one in functions)


def _needs_copies():
    """Whether each frame needs a copy of its own."""
    # The second Blender would run scripts of the file again for each frame, on top of what they have registered before.
    if handoff.scripts_allowed() and any(text.use_module for text in bpy.data.texts):
        return True
    # A copy may hold the caches of simulations until its frame.
    return any(scene.rigidbody_world is not None for scene in bpy.data.scenes) or any(map(_has_cache, bpy.data.objects))


def _has_cache(thing):
    return len(thing.particle_systems) > 0 or any(
        modifier.type in _WITH_CACHE or getattr(modifier, "bakes", ()) for modifier in thing.modifiers)


def export(job, stopped, tell):
    """Export a frame as `Job.run` does. Returns warnings."""
    global _changed
    kept = _kept
    if kept is not None and (_changed or _has_handlers() or kept.exporter.source != job.exporter.source
                             or not kept.exporter.is_running()):
        end()
        kept = None
    job.keeps_exporter = True
    if kept is not None:
        job.exporter = kept.exporter
        try:
            return job.run(stopped, tell)
        except Fault:  # a new copy shows whether the kept process or the scene is at fault
            if _kept is not kept:
                raise Cancelled() from None
            end()
    warnings = _start(job, stopped) + job.run(stopped, tell)
    if not job.animates_all:
        _changed = True
    return warnings


def _start(job, stopped):
    """Give a job an exporter that later frames share, and copy the scene. Returns warnings."""
    global _kept
    folder = tempfile.mkdtemp(prefix="caustique-", dir=bpy.app.tempdir)
    job.exporter = handoff.Exporter(job.exporter.scene, folder, job.exporter.blender)
    _kept = _Kept(job.exporter, folder)

    def copy():
        global _changed
        _changed = _needs_copies()
        return job.copy()

    return handoff.in_main_thread(copy, stopped)


@bpy.app.handlers.persistent
def end(*_):
    """End the exporter that is kept between renders, if there is one, and delete its files."""
    global _kept
    kept, _kept = _kept, None
    if kept is not None:
        kept.exporter.end()
        shutil.rmtree(kept.folder, ignore_errors=True)


@bpy.app.handlers.persistent
def _note_change(_scene, depsgraph=None):
    """Note that the user or a script has changed something. Renders have dependency graphs of their own."""
    global _changed
    if depsgraph is None or depsgraph.mode != "RENDER":
        _changed = True


def _handlers():
    handlers = bpy.app.handlers
    ends = (handlers.render_init, handlers.render_complete, handlers.render_cancel, handlers.load_pre)
    return [(one, end) for one in ends] + [(handlers.depsgraph_update_post, _note_change),
                                           (handlers.frame_change_post, _note_change)]


def register():
    """Start to note changes and ends of renders."""
    for handlers, function in _handlers():
        handlers.append(function)


def unregister():
    """Stop that, and end the kept exporter."""
    for handlers, function in _handlers():
        handlers.remove(function)
    end()
