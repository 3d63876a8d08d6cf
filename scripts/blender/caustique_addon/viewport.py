"""The viewport with the shading 'Rendered': exports the scene, keeps the program running, and draws its pictures.

Blender calls `update` when the scene has changed and `draw` when it draws; both return at once. A timer in the main
thread starts exports and redraws the viewports, because neither `draw` nor other threads may do that.
"""

import json
import os
import shutil
import struct
import tempfile
import threading
import time
import weakref

import bpy
import numpy

from . import command, handoff, live, preferences, program, server, session
from .fault import Cancelled, Fault, fault_from_error

_TIMER_SECONDS = 0.05
_QUIET_SECONDS = 0.4  # without changes, before the scene is exported again
_MATTERS = (bpy.types.Mesh, bpy.types.Curve, bpy.types.Material, bpy.types.World, bpy.types.Light, bpy.types.Image,
            bpy.types.NodeTree, bpy.types.Texture, bpy.types.Collection, bpy.types.MetaBall)
_PLACED = ("MESH", "LIGHT")
_open = weakref.WeakSet()


class Viewport:
    """One viewport that caustique renders."""

    def __init__(self, scene, view_layer):
        chosen = preferences.get(bpy.context)
        self._scene, self._layer = scene.name, view_layer.name
        self._live = live.Live(self._send)
        self._folder = tempfile.mkdtemp(prefix="caustique-", dir=bpy.app.tempdir)
        self._exporting, self._closed, self._exports = None, False, 0
        self._changed_at = -_QUIET_SECONDS  # the first export waits for nothing
        self._places, self._lights = {}, set()  # of the last export: {object: matrix}, names of lights
        self._next_places = None
        self._exported = {}  # {object: its matrix in the exported file}
        self._words, self._path, self._texture, self._drawn = None, None, None, None
        # The program answers at once, in another thread.
        self._server = server.Server(program.find(chosen.program), command.threads(scene.render), self._answered,
                                     self._shown)
        _open.add(self)

    # --- what the main thread calls ---------------------------------------------------------------------------------------

    def update(self, depsgraph):
        """Take the changes of the scene."""
        words = command.method(depsgraph.scene.caustique_render)
        if words != self._words:
            self._words = words
            if self._path is not None and self._exporting is None:
                self._load()
        places, _ = _places_of(depsgraph)
        if places.keys() != self._places.keys() or any(_is_new(update) for update in depsgraph.updates):
            self._live.needs_export, self._changed_at = True, time.monotonic()
        if self._live.needs_export or self._exporting is not None:
            return
        moved = {name: place for name, place in places.items() if not numpy.array_equal(place, self._places[name])}
        edits = {}
        for name, place in moved.items():
            known = self._exported.get(name)
            changed = None if known is None else live.moved(self._places[name], place, known, name in self._lights)
            if changed is None:
                self._live.needs_export, self._changed_at = True, time.monotonic()
                return
            edits[name], self._exported[name] = live.columns(changed), changed
        self._places = places
        self._live.place(edits)

    def want(self, view_matrix, window_matrix, back, size, lens=None):
        """Show the scene through this view."""
        camera = {**live.camera(view_matrix, window_matrix, back), **(lens or {})}
        self._live.want({"camera": camera, "width": size[0], "height": size[1], "coarse": live.COARSE,
                         "arguments": []})

    def draw(self, engine, scene, size):
        """Draw the last picture over a region of this size in pixels. Returns a message, and a Fault or None."""
        import gpu  # not in Blender without a window
        from gpu_extras.presets import draw_texture_2d

        picture = self._live.picture
        if picture is not None:
            if self._drawn is not picture:
                pixels = numpy.ascontiguousarray(picture.pixels[::-1], numpy.float32)
                height, width = pixels.shape[:2]
                data = gpu.types.Buffer("FLOAT", pixels.size, pixels.ravel())
                self._texture, self._drawn = gpu.types.GPUTexture((width, height), format="RGBA16F", data=data), picture
            gpu.state.blend_set("ALPHA_PREMULT")
            engine.bind_display_space_shader(scene)
            draw_texture_2d(self._texture, (0, 0), *size)
            engine.unbind_display_space_shader()
            gpu.state.blend_set("NONE")
        fault = self._live.fault
        return self._live.message, None if fault is None else Fault(*fault)

    def close(self):
        """End the program and remove the exported files."""
        self._closed = True
        self._server.close()
        shutil.rmtree(self._folder, ignore_errors=True)

    def _send(self, name, **fields):
        return self._server.send(name, **fields)

    # --- the timer ----------------------------------------------------------------------------------------------------------

    def tick(self):
        """Start an export if one is due. Returns whether the viewport has to be redrawn."""
        if self._exporting is not None and not self._exporting.is_alive():
            self._exporting = None
            self._places = self._next_places or {}
        due = self._live.needs_export and time.monotonic() - self._changed_at >= _QUIET_SECONDS
        if due and self._exporting is None and not self._closed:
            self._start_export()
        return self._live.take_change()

    def _start_export(self):
        scene = bpy.data.scenes.get(self._scene)
        if scene is None:
            return
        self._live.needs_export = False
        self._exports += 1
        folder = os.path.join(self._folder, str(self._exports))
        os.mkdir(folder)
        try:
            chosen = preferences.get(bpy.context)
            frame = scene.frame_current + scene.frame_subframe
            job = handoff.Job(scene, self._layer, frame, folder, chosen.exporter)
            depsgraph = bpy.context.evaluated_depsgraph_get()
            self._next_places, self._lights = _places_of(depsgraph)
            warnings = job.copy()
        except Exception as error:  # a timer would be removed
            self._fail(error)
            return
        self._live.message = "caustique: exporting"
        self._exporting = threading.Thread(target=self._export, args=(job, folder, warnings), daemon=True)
        self._exporting.start()

    # --- other threads ------------------------------------------------------------------------------------------------------

    def _export(self, job, folder, warnings):
        try:
            warnings = warnings + job.run(lambda: self._closed)
            self._path = os.path.join(folder, handoff.GLB)
            self._exported = live.exported_places(_document(self._path))
            self._load()
            session.warnings[self._scene] = warnings
        except Cancelled:
            pass
        except Exception as error:  # a thread would lose it
            self._fail(error)

    def _load(self):
        # A viewport shows one moment, without motion blur.
        self._live.load(self._path, [*self._words, "--shutter", "0"])

    def _fail(self, error):
        fault = fault_from_error(error)
        self._live.answered({"event": "error", "message": fault.what, "hint": fault.remedy})

    def _answered(self, answer):
        if not self._closed:
            self._live.answered(answer)

    def _shown(self, picture):
        if not self._closed:
            self._live.shown(picture)


def _is_new(update):
    """Whether a change is more than the place of an object, the camera or the window."""
    thing = update.id
    if isinstance(thing, bpy.types.Object):
        return update.is_updated_geometry and thing.type != "CAMERA"
    return isinstance(thing, _MATTERS) and (update.is_updated_geometry or update.is_updated_shading
                                            or isinstance(thing, (bpy.types.Material, bpy.types.World, bpy.types.NodeTree)))


def _places_of(depsgraph):
    """The matrices of the meshes and lights in a scene that are no instances, {name: matrix}, and the names of lights."""
    places, lights = {}, set()
    for thing in depsgraph.objects:
        if thing.type in _PLACED:
            places[thing.name] = numpy.array(thing.matrix_world, float)
            if thing.type == "LIGHT":
                lights.add(thing.name)
    return places, lights


def _document(path):
    """The JSON of a .glb file."""
    with open(path, "rb") as file:
        _, _, _, length, _ = struct.unpack("<5I", file.read(20))
        return json.loads(file.read(length))


def lens(camera, engine_is_orthographic):
    """The keys of the program's camera for the depth of field of Blender's camera; empty without one."""
    data = camera.data
    if not data.dof.use_dof:
        return {}
    size = 1 if engine_is_orthographic else data.lens * 1e-3
    distance = data.dof.focus_distance
    if data.dof.focus_object is not None:
        world = camera.matrix_world
        to_focus = data.dof.focus_object.matrix_world.translation - world.translation
        distance = abs(to_focus.dot(world.col[2].to_3d().normalized()))
    return {"aperture_radius": size / (2 * max(data.dof.aperture_fstop, 1e-3)), "focus_distance": max(distance, 1e-6)}


def _run_timer():
    """Let the viewports export, and redraw them."""
    if any([viewport.tick() for viewport in list(_open)]):
        for window in bpy.context.window_manager.windows:
            for area in window.screen.areas:
                if area.type == "VIEW_3D":
                    area.tag_redraw()
    return _TIMER_SECONDS


def register():
    """Start the timer."""
    bpy.app.timers.register(_run_timer, persistent=True)


def unregister():
    """Stop the timer, and end all programs."""
    if bpy.app.timers.is_registered(_run_timer):
        bpy.app.timers.unregister(_run_timer)
    for viewport in list(_open):
        viewport.close()
