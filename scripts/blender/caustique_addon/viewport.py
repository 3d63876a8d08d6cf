"""The viewport with the shading 'Rendered': exports the scene, keeps the program running, and draws its pictures.

Blender calls `update` when the scene has changed and `draw` when it draws; both return at once. A timer in the main
thread starts exports and redraws the viewports, because neither `draw` nor other threads may do that.
"""

import os
import shutil
import tempfile
import threading
import time
import weakref
from typing import NamedTuple

import bpy
import numpy

from . import command, handoff, live, preferences, program, server, session, wording
from .fault import Cancelled, Fault, fault_from_error

_TIMER_SECONDS = 0.05
_QUIET_SECONDS = 0.4  # without changes, before the scene is exported again
_MATTERS = (bpy.types.Curve, bpy.types.Image, bpy.types.Texture, bpy.types.Collection, bpy.types.MetaBall)
#: Types of objects that have a place in the picture.
_PLACED = frozenset({"MESH", "LIGHT", "CURVE", "SURFACE", "FONT", "META", "CURVES", "POINTCLOUD", "VOLUME"})
_VISIBILITY = ("visible_camera", "visible_diffuse", "visible_glossy", "visible_transmission", "visible_volume_scatter",
               "visible_shadow", "is_shadow_catcher", "is_holdout")
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
        self._state = _NOTHING  # what the program shows
        self._due = set()  # names of changed objects, to be exported again
        self._exported = {}  # {object: its matrix in the exported files, or by an edit since}
        self._moved = {}  # {object: its matrix by an edit since its export}
        self._parts = []  # exports of single objects since that of the scene: (names, path)
        self._old = []  # folders of exports that newer ones replace
        self._loaded_words = None  # the settings that the program has loaded the scene with
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
        state = _state_of(depsgraph)
        same = (state.places.keys() == self._state.places.keys() and state.worn == self._state.worn
                and state.visible == self._state.visible)
        names = _concerned(depsgraph, state) if same else None
        if names is None or not names <= self._exported.keys():
            self._live.needs_export = True
        else:
            self._due |= names
        if names is None or names:
            self._changed_at = time.monotonic()
        if self._exporting is None and not self._live.needs_export and not self._due:
            self._move(state)

    def _move(self, state):
        """Place the objects that have moved. Those that have to be exported again are due, and the whole scene is after a move
        of an object that the program does not know by its name, or on which others depend."""
        edits = {}
        for name, place in state.places.items():
            before, known = self._state.places[name], self._exported.get(name)
            if numpy.array_equal(place, before):
                continue
            if known is None or name in state.whole:
                self._live.needs_export = True
                self._changed_at = time.monotonic()
                continue
            changed = live.moved(before, place, known, name in state.lights)
            if changed is None:
                self._due.add(name)
                self._changed_at = time.monotonic()
            else:
                self._exported[name], self._moved[name] = changed, live.columns(changed)
                edits[name] = self._moved[name]
        self._state = state
        self._live.edit(edits)

    def want(self, view_matrix, window_matrix, back, size, lens=None):
        """Show the scene through this view."""
        camera = {**live.camera(view_matrix, window_matrix, back), **(lens or {})}
        self._live.want({"camera": camera, "width": size[0], "height": size[1], "arguments": []})

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
        return self._message(), None if fault is None else Fault(*map(wording.of_interface, fault))

    def _message(self):
        if self._exporting is not None:
            return "caustique: exporting"
        return self._live.message if self.is_current() else "caustique: updating"

    def is_current(self):
        """Whether the last picture shows the scene with all changes, through the view that was asked for last."""
        return self._exporting is None and not self._due and self._live.is_current()

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
            if self._path is not None and self._words != self._loaded_words:
                self._load()  # the settings have changed after the export had been loaded
            state = self._scene_state()
            if not self._live.needs_export and state.places.keys() == self._state.places.keys():
                self._move(state)  # what has moved meanwhile
        due = (self._live.needs_export or self._due) and time.monotonic() - self._changed_at >= _QUIET_SECONDS
        if due and self._exporting is None and not self._closed:
            self._start_export()
        return self._live.take_change()

    def _start_export(self):
        scene = bpy.data.scenes.get(self._scene)
        if scene is None:
            return
        self._exports += 1
        while self._old:
            shutil.rmtree(self._old.pop(), ignore_errors=True)
        folder = os.path.join(self._folder, str(self._exports))
        os.mkdir(folder)
        try:
            state = self._scene_state()
            if state.places.keys() != self._state.places.keys():
                self._live.needs_export = True
            elif not self._live.needs_export:
                self._move(state)  # others than those to be exported may have moved, and may have to be exported, too
            # Taken before the copy: the program may ask for another export at any time.
            whole, self._live.needs_export = self._live.needs_export, False
            only, self._due, self._state = None if whole else sorted(self._due), set(), state
            chosen = preferences.get(bpy.context)
            frame = scene.frame_current + scene.frame_subframe
            job = handoff.Job(scene, self._layer, frame, folder, chosen.exporter, only)
            warnings = job.copy()
        except Exception as error:  # a timer would be removed
            self._fail(error)
            return
        self._exporting = threading.Thread(target=self._export, args=(job, folder, warnings), daemon=True)
        self._exporting.start()

    def _scene_state(self):
        """The state of the viewport's scene, which is not always that of the context: windows may show several scenes."""
        scene = bpy.data.scenes[self._scene]
        with bpy.context.temp_override(scene=scene, view_layer=scene.view_layers[self._layer]):
            return _state_of(bpy.context.evaluated_depsgraph_get())

    # --- other threads ------------------------------------------------------------------------------------------------------

    def _export(self, job, folder, warnings):
        try:
            warnings = warnings + job.run(lambda: self._closed)
            path = os.path.join(folder, handoff.GLB)
            with open(path, "rb") as file:
                places = live.exported_places(live.document(file.read()))
            if job.only is None:
                self._take_scene(path, places)
                session.warnings[self._scene] = warnings
            elif places.keys() >= set(job.only):
                self._take_part(path, {name: places[name] for name in job.only})
                known = session.warnings.setdefault(self._scene, [])
                known += [line for line in warnings if line not in known]
            else:  # an object has no faces any more, or several have its name
                self._live.needs_export = True
        except Cancelled:
            pass
        except Exception as error:  # a thread would lose it
            self._fail(error)

    def _take_scene(self, path, places):
        """Show an export of the scene."""
        self._old += [os.path.dirname(old) for old in [self._path, *(part for _, part in self._parts)] if old]
        self._path, self._exported, self._moved, self._parts = path, places, {}, []
        self._load()

    def _take_part(self, path, places):
        """Show an export of single objects."""
        self._old += [os.path.dirname(old) for names, old in self._parts if names <= places.keys()]
        self._parts = [part for part in self._parts if not part[0] <= places.keys()] + [(set(places), path)]
        self._exported.update(places)
        self._moved = {name: matrix for name, matrix in self._moved.items() if name not in places}
        if self._words == self._loaded_words:
            self._live.edit({}, [path])
        else:  # the settings have changed during the export
            self._load()

    def _load(self):
        self._loaded_words = words = self._words
        # A viewport shows one moment, without motion blur.
        self._live.load(self._path, [*words, "--shutter", "0"])
        self._live.edit(self._moved, [path for _, path in self._parts])

    def _fail(self, error):
        self._state = _NOTHING  # so that the next change exports the whole scene
        fault = fault_from_error(error)
        self._live.answered({"event": "error", "message": fault.what, "hint": fault.remedy})

    def _answered(self, answer):
        if not self._closed:
            self._live.answered(answer)

    def _shown(self, picture):
        if not self._closed:
            self._live.shown(picture)


def _concerned(depsgraph, state):
    """The names of the objects that have to be exported again after the changes of a depsgraph; None for the whole scene. A
    changed place, camera or window needs no export."""
    names, materials, data, copies = set(), set(), set(), set()
    for update in depsgraph.updates:
        thing = update.id
        if isinstance(thing, bpy.types.Object):
            if update.is_updated_geometry and thing.type != "CAMERA":
                names.add(thing.name)
            elif update.is_updated_shading and thing.name not in state.worn:  # shown by its instances alone
                copies.add(thing.name)
        elif isinstance(thing, bpy.types.Material):
            materials.add(thing.name)
        elif isinstance(thing, (bpy.types.Mesh, bpy.types.Light)):
            if update.is_updated_geometry:
                data.add(thing.name)
        elif isinstance(thing, bpy.types.NodeTree):
            if not thing.original.is_embedded_data:  # the owner of one that is embedded is listed, too
                return None
        elif isinstance(thing, bpy.types.World):
            return None
        elif isinstance(thing, _MATTERS) and (update.is_updated_geometry or update.is_updated_shading):
            return None
    if materials:
        names |= copies
    return names | {thing.name for thing in depsgraph.objects if materials.intersection(state.worn[thing.name])
                    or (thing.type in _PLACED and thing.data.name in data)}


class _State(NamedTuple):
    """What a viewport compares of a scene: the matrices of objects that are no instances, {name: matrix}; the names of the
    materials of all objects, {name: names}; to which rays they are visible, {name: switches}; the names of lights; and the names
    of objects whose move is a change of the whole scene."""

    places: dict
    worn: dict
    visible: dict
    lights: set
    whole: set


_NOTHING = _State({}, {}, {}, set(), set())


def _state_of(depsgraph):
    places, worn, visible, lights, whole = {}, {}, {}, set(), set()
    for thing in depsgraph.objects:
        # Modifiers add materials to the evaluated mesh.
        used = [slot.material for slot in thing.material_slots] + list(getattr(thing.data, "materials", ()))
        worn[thing.name] = tuple(dict.fromkeys(material.name for material in used if material is not None))
        visible[thing.name] = tuple(getattr(thing, switch) for switch in _VISIBILITY)
        # Instances move with their instancer, and meta balls merge with others.
        is_whole = thing.is_instancer or thing.type == "META"
        if (thing.type in _PLACED or is_whole) and not thing.hide_render:
            places[thing.name] = numpy.array(thing.matrix_world, float)
            if thing.type == "LIGHT":
                lights.add(thing.name)
            if is_whole:
                whole.add(thing.name)
    return _State(places, worn, visible, lights, whole)


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
