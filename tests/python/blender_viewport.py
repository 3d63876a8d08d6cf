"""Tests the add-on's viewport with stand-ins for Blender's window: views, edits, exports and the end. Needs bpy."""

import os
import signal
import threading
import time
import types
import unittest
from unittest import mock

import bpy  # first, because it brings the others

import bmesh
import numpy

from addon import Installed, part_of_addon

_PATIENCE_SECONDS = 60
_SIZE = 48, 36


class Viewport(Installed):
    def setUp(self):
        super().setUp()
        self.stage()
        self.settings.method, self.settings.finish = "path", "off"
        self.module = part_of_addon("viewport")
        self.view = self.module.Viewport(self.scene, self.layer)
        self.addCleanup(self.view.close)

    def until(self, condition):
        """Let the viewport work, as Blender's timer does, until a condition holds."""
        end = time.monotonic() + _PATIENCE_SECONDS
        while not condition():
            self.assertLess(time.monotonic(), end, f"fault: {self.view._live.fault}")
            self.view.tick()
            time.sleep(0.01)

    def update(self):
        """Tell the viewport of what has changed since the last update, as Blender does."""
        updates = []

        def collect(_, depsgraph):
            updates.extend(types.SimpleNamespace(
                id=of.id.original, is_updated_geometry=of.is_updated_geometry, is_updated_shading=of.is_updated_shading,
                is_updated_transform=of.is_updated_transform) for of in depsgraph.updates)

        bpy.app.handlers.depsgraph_update_post.append(collect)
        try:
            bpy.context.view_layer.update()
        finally:
            bpy.app.handlers.depsgraph_update_post.remove(collect)
        objects = bpy.context.evaluated_depsgraph_get().objects
        self.view.update(types.SimpleNamespace(scene=self.scene, objects=objects, updates=updates))

    def fresh(self, iterations=2):
        """The picture of a new viewport, which exports the whole scene."""
        old, self.view = self.view, self.module.Viewport(self.scene, self.layer)
        self.addCleanup(self.view.close)
        self.update()
        pixels = self.show(iterations)
        self.view.close()
        self.view = old
        return pixels

    def show(self, iterations=2):
        """Look through the scene's camera, and return the picture after the last iteration."""
        camera = self.scene.camera
        depsgraph = bpy.context.evaluated_depsgraph_get()
        window = camera.calc_matrix_camera(depsgraph, x=_SIZE[0], y=_SIZE[1])
        self.view.want(camera.matrix_world.inverted(), window, 0.0, _SIZE)

        def is_there():
            if not self.view.is_current():
                return False
            about = self.view._live.picture.about
            return about["iteration"] == iterations and not about["coarse"]

        self.until(is_there)
        return self.view._live.picture.pixels

    def test_the_viewport_follows_the_camera_the_objects_and_the_materials(self):
        self.update()
        first = self.show()
        self.assertEqual(first.shape, (_SIZE[1], _SIZE[0], 4))
        self.assertGreater(first[..., :3].max(), 0)
        self.assertEqual(self.view._exports, 1)

        self.scene.camera.location.x += 0.5  # no export
        self.update()
        moved = self.show()
        self.assertFalse(numpy.array_equal(first, moved))
        self.assertEqual(self.view._exports, 1)

        ball = bpy.data.objects["ball"]
        ball.location.x -= 0.4
        ball.rotation_euler.z = 0.3
        self.update()
        placed = self.show()
        self.assertEqual(self.view._exports, 1, "a moved object is not exported again")
        self.assertFalse(numpy.array_equal(moved, placed))

        # A new export of the scene gives the same picture, up to rounding.
        fresh = self.fresh()
        noise = numpy.abs(fresh - placed).mean() / placed[..., :3].mean()
        self.assertLess(noise, 0.02)

        bpy.data.objects.remove(ball)
        self.update()
        self.until(lambda: self.view._exports == 2)
        self.assertFalse(numpy.array_equal(self.show(), fresh))

    def test_changed_materials_meshes_and_lamps_are_exported_alone(self):
        second = self.ball("second", at=(1, 1, 0.5), radius=0.3)
        third = self.plane(size=1, at=(-1, 1, 0.5))
        lamp = bpy.data.lights.new("spot", "SPOT")
        self.put("spot", lamp, (0, 0, 3))
        self.update()
        before = self.show()
        exported = []
        take, self.view._take_part = self.view._take_part, lambda path, places: (exported.append(set(places)), take(path, places))

        def check(change, names):
            nonlocal before
            change()
            self.update()
            after = self.show()
            self.assertEqual(exported.pop(), names)
            self.assertFalse(exported)
            self.assertFalse(numpy.array_equal(before, after), "the change is not seen")
            self.assertTrue(numpy.array_equal(after, self.fresh()), "the picture differs from that of a whole export")
            before = after

        def shader(thing):
            return next(n for n in thing.active_material.node_tree.nodes if n.type == "BSDF_PRINCIPLED").inputs

        def paint():
            shader(third)["Base Color"].default_value = 0.9, 0.1, 0.1, 1

        def bend():
            third.data.vertices[0].co.z += 0.2
            third.data.update()

        def open_glass():
            # The material is no solid any more, so that the other ball changes, too.
            shape = bmesh.new()
            shape.from_mesh(second.data)
            bmesh.ops.delete(shape, geom=[v for v in shape.verts if v.co.z > 0.1], context="VERTS")
            shape.to_mesh(second.data)
            shape.free()
            second.data.update()

        second.data.materials[0] = bpy.data.objects["ball"].active_material
        self.update()
        before = self.show()
        self.assertEqual((self.view._exports, exported), (2, []), "another material is a change of the whole scene")
        check(paint, {third.name})
        check(bend, {third.name})
        check(lambda: setattr(lamp, "energy", 40), {"spot"})
        check(open_glass, {"ball", "second"})
        check(lambda: third.modifiers.new("thick", "SOLIDIFY"), {third.name})
        # Settings read the scene again, with all edits.
        third.location.x -= 0.3
        self.settings.iterations = 3
        self.update()
        moved = self.show(iterations=3)
        self.assertFalse(exported)
        self.assertLess(numpy.abs(moved - self.fresh(iterations=3)).mean() / moved[..., :3].mean(), 0.01)

    def test_other_changes_export_the_whole_scene(self):
        self.scene.world = bpy.data.worlds.new("world")
        empty = self.put("copies", None, (1, 0, 0))
        group = bpy.data.collections.new("group")
        group.objects.link(self.ball("copied", at=(0, 1, 0.3), radius=0.2))
        empty.instance_type, empty.instance_collection = "COLLECTION", group
        self.update()
        self.show()
        self.scene.world.color = 1, 0, 0
        self.update()
        self.show()
        self.assertEqual((self.view._exports, self.view._parts), (2, []))
        # An object with copies: the second Blender finds them.
        shader = next(n for n in bpy.data.objects["copied"].active_material.node_tree.nodes if n.type == "BSDF_PRINCIPLED")
        shader.inputs["Base Color"].default_value = 0, 1, 0, 1
        self.update()
        after = self.show()
        self.assertEqual((self.view._exports, self.view._parts), (3, []))
        self.assertTrue(numpy.array_equal(after, self.fresh()))

    def test_changes_that_move_or_hide_copies_text_and_curves_are_seen(self):
        group = bpy.data.collections.new("group")
        copied = self.ball("copied", at=(0, 1, 0.3), radius=0.2)
        self.scene.collection.objects.unlink(copied)
        group.objects.link(copied)
        empty = self.put("copies", None, (1, 0, 0))
        empty.instance_type, empty.instance_collection = "COLLECTION", group
        letters = bpy.data.curves.new("text", "FONT")
        letters.body = "abc"
        text = self.put("text", letters, (-1.5, -1, 0.3))
        lamp = bpy.data.lights.new("area", "AREA")
        lamp.energy = 50
        area = self.put("area", lamp, (0, 0, 3))
        self.update()
        before = self.show()

        def paint(name, colour):
            material = bpy.data.objects[name].active_material
            shader = next(n for n in material.node_tree.nodes if n.type == "BSDF_PRINCIPLED")
            shader.inputs["Base Color"].default_value = (*colour, 1)

        def paint_and_scale():
            paint("plane", (0.9, 0.1, 0.1))
            self.update()
            area.scale = 3, 3, 1  # while the plane waits for its export

        for change in (lambda: setattr(empty, "location", (1.3, -0.5, 0)), lambda: setattr(text, "location", (-1, 0, 0.3)),
                       lambda: paint("copied", (0, 1, 0)), lambda: setattr(text, "visible_camera", False),
                       lambda: setattr(lamp, "color", (1, 0.2, 0.2)), paint_and_scale):
            change()
            self.update()
            after, fresh = self.show(), self.fresh()
            self.assertFalse(numpy.array_equal(before, after), "the change is not seen")
            # Up to the rounding of places.
            noise, seen = (numpy.abs(fresh - other).sum() for other in (after, before))
            self.assertLess(noise, 0.2 * seen)
            before = after

    def test_changes_at_the_end_of_an_export_are_not_lost(self):
        self.update()
        load, take = self.view._live.load, self.view._take_scene
        loaded, go_on = threading.Event(), threading.Event()

        def slowly(path, places):
            take(path, places)
            loaded.set()
            go_on.wait(_PATIENCE_SECONDS)

        with mock.patch.object(self.view, "_take_scene", slowly):
            self.until(loaded.is_set)
        self.settings.iterations = 3  # after the export has been loaded, and before the main thread knows it
        with mock.patch.object(self.view._live, "load", mock.Mock(wraps=load)) as loads:
            self.update()
            go_on.set()
            self.show(iterations=3)
        self.assertEqual((loads.call_count, self.view._exports), (1, 1))

        # An edit that fails while single objects begin to be exported: the whole scene follows.
        job = part_of_addon("handoff").Job
        copy = job.copy

        def failing(this):
            self.view._live.needs_export = True
            return copy(this)

        bpy.data.objects["plane"].data.update()
        bpy.data.objects["plane"].update_tag(refresh={"DATA"})
        self.update()
        self.assertEqual(self.view._due, {"plane"})
        with mock.patch.object(job, "copy", failing):
            self.until(lambda: self.view._exports == 2)
        self.until(lambda: self.view._exports == 3)
        self.show(iterations=3)

    def test_a_failed_export_is_said_until_the_next_one(self):
        self.update()
        self.show()
        handoff = part_of_addon("handoff")
        with mock.patch.object(handoff.Job, "run", side_effect=OSError("no space")):
            bpy.data.objects["plane"].update_tag(refresh={"DATA"})
            self.update()
            self.until(lambda: self.view._live.fault is not None and self.view._exporting is None)
        self.view._live.shown(self.view._live.picture)  # a further picture of the older scene
        self.assertIn("no space", self.view._live.fault[0])
        self.assertFalse(self.view.is_current())
        bpy.data.objects["ball"].location.x += 0.1
        self.update()
        self.show()
        self.assertIsNone(self.view._live.fault)
        self.assertEqual((self.view._exports, self.view._parts), (3, []))

    def test_the_scene_of_another_window_is_not_taken_for_its_own(self):
        other = bpy.data.scenes.new("other")
        bpy.context.window.scene = other
        self.assertIn("ball", self.view._scene_state().places)

    def test_settings_apply_without_an_export(self):
        self.update()
        self.show()
        self.settings.iterations = 4
        self.update()
        self.show(iterations=4)
        self.assertEqual(self.view._exports, 1)

    def test_closing_ends_the_program_and_removes_the_files(self):
        self.update()
        self.show()
        folder, process = self.view._folder, self.view._server._process
        self.assertTrue(os.path.isdir(folder))
        self.view.close()
        process.wait(timeout=_PATIENCE_SECONDS)
        self.assertFalse(os.path.exists(folder))

    def test_a_program_that_ends_is_a_fault_and_not_a_crash(self):
        # As in Blender; Python as a program ignores this signal.
        self.addCleanup(signal.signal, signal.SIGPIPE, signal.signal(signal.SIGPIPE, signal.SIG_DFL))
        self.update()
        self.show()
        self.view._server._process.kill()
        self.view._server._process.wait()
        self.assertIsNone(self.view._server.send("stop"))
        self.until(lambda: self.view._live.fault is not None)
        self.update()
        self.view.tick()


class Cameras(Installed):
    def test_the_first_picture_takes_its_time_on_any_machine(self):
        live = part_of_addon("live")
        for pixel_seconds, expected in ((3e-4, 16), (6e-6, 5), (3e-7, 2)):
            coarse = live._COARSE
            for _ in range(8):
                coarse = live.coarser(coarse, 960 * 540 / coarse**2 * pixel_seconds)
                self.assertLessEqual(coarse, 16)
            self.assertEqual(coarse, live.coarser(coarse, 960 * 540 / coarse**2 * pixel_seconds), "it settles")
            self.assertEqual(coarse, expected)
        self.assertEqual(live.coarser(4, 100.0), 8, "one slow picture is no reason for a very coarse one")

    def test_blender_s_matrices_give_the_program_s_camera(self):
        live = part_of_addon("live")
        camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
        self.scene.collection.objects.link(camera)
        camera.data.sensor_fit, camera.data.angle, camera.data.shift_x = "VERTICAL", 0.6, 0.1
        depsgraph = bpy.context.evaluated_depsgraph_get()
        window = camera.calc_matrix_camera(depsgraph, x=80, y=60)
        found = live.camera(numpy.identity(4), window)
        self.assertAlmostEqual(found["yfov"], 0.6, places=5)
        # Blender's shift is in heights of the sensor here.
        self.assertAlmostEqual(found["shift"][0], 0.1 * 60 / 80, places=5)
        self.assertEqual(found["matrix"], live.columns(live.TO_GLTF))
        camera.data.type, camera.data.ortho_scale = "ORTHO", 3
        bpy.context.view_layer.update()
        depsgraph = bpy.context.evaluated_depsgraph_get()
        flat = live.camera(numpy.identity(4), camera.calc_matrix_camera(depsgraph, x=80, y=60), back=5)
        self.assertAlmostEqual(flat["ymag"], 1.5, places=5)
        self.assertEqual(flat["matrix"][13], 5)  # up in glTF is Blender's z

    def test_a_scaled_lamp_and_a_flat_object_are_exported_again(self):
        live = part_of_addon("live")
        before, scaled = numpy.identity(4), numpy.diag([2.0, 2, 2, 1])
        self.assertIsNone(live.moved(before, scaled, before, is_light=True))
        self.assertIsNotNone(live.moved(before, scaled, before, is_light=False))
        self.assertIsNone(live.moved(numpy.diag([1.0, 1, 0, 1]), scaled, before, is_light=False))
        shifted = numpy.identity(4)
        shifted[:3, 3] = 1, 2, 3
        exact = live.moved(before, shifted, numpy.identity(4), is_light=True)
        numpy.testing.assert_allclose(exact[:3, 3], (1, 3, -2))

    def test_views_wait_for_the_first_picture_of_the_last_one(self):
        live = part_of_addon("live")
        sent = []

        def send(command, **fields):
            sent.append((command, fields))
            return len(sent)

        state = live.Live(send)
        state.want({"width": 1})
        self.assertEqual(sent, [], "there is no scene yet")
        state.load("a.glb", [])
        state.answered({"event": "loaded", "id": 1})
        for width in (2, 3, 4):
            state.want({"width": width})
        self.assertEqual([fields.get("width") for _, fields in sent], [None, 1])
        coarse = sent[-1][1]["coarse"]
        about = {"id": 2, "iteration": 1, "iterations": 4, "coarse": True, "seconds": 0.6}
        state.shown(mock.Mock(about=about))
        self.assertEqual(sent[-1], ("view", {"width": 4, "coarse": 2 * coarse}), "the next one is coarser")
        self.assertEqual(len(sent), 3)
        state.answered({"event": "stopped", "id": 2})
        self.assertEqual(len(sent), 3)
        state.edit({"a": [0] * 16})
        state.answered({"event": "error", "id": 4, "message": "it cannot", "hint": ""})
        self.assertTrue(state.needs_export)

    def test_a_picture_of_an_older_scene_is_never_taken_for_the_current_one(self):
        live = part_of_addon("live")
        sent, seen, threads = [], [], []

        def send(command, **fields):
            # Another thread looks while the command is on its way, or waits until it is sent.
            looks = threading.Thread(target=lambda: seen.append(state.is_current()))
            looks.start()
            looks.join(0.1)
            threads.append(looks)
            sent.append(command)
            return len(sent)

        def show(number):
            state.shown(mock.Mock(about={"id": number, "iteration": 1, "iterations": 1, "coarse": False}))

        state = live.Live(send)
        state.want({"width": 1})
        for load, view in ((1, 2), (3, 4)):
            state.load("a.glb", [])
            state.needs_export = False
            state.answered({"event": "loaded", "id": load})
            self.assertEqual(len(sent), view)
            if view > 2:
                show(2)  # the last one of the older scene
            self.assertFalse(state.is_current())
            for looks in threads:
                looks.join()
            show(view)
            self.assertTrue(state.is_current())
        self.assertEqual(seen, [False] * 4)


if __name__ == "__main__":
    unittest.main()
