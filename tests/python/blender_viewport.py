"""Tests the add-on's viewport with stand-ins for Blender's window: views, edits, exports and the end. Needs bpy."""

import os
import time
import types
import unittest
from unittest import mock

import bpy
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

    def update(self, *things, geometry=False):
        """Tell the viewport of changes, as Blender does."""
        depsgraph = bpy.context.evaluated_depsgraph_get()
        bpy.context.view_layer.update()
        changes = [types.SimpleNamespace(id=thing, is_updated_geometry=geometry, is_updated_shading=False,
                                         is_updated_transform=not geometry) for thing in things]
        self.view.update(types.SimpleNamespace(scene=self.scene, objects=depsgraph.objects, updates=changes))

    def show(self, iterations=2):
        """Look through the scene's camera, and return the picture after the last iteration."""
        camera = self.scene.camera
        depsgraph = bpy.context.evaluated_depsgraph_get()
        window = camera.calc_matrix_camera(depsgraph, x=_SIZE[0], y=_SIZE[1])
        self.view.want(camera.matrix_world.inverted(), window, 0.0, _SIZE)

        def is_there():
            picture = self.view._live.picture
            live = self.view._live
            return (picture is not None and picture.about["id"] == live._sent and not live.needs_export
                    and self.view._exporting is None and picture.about["iteration"] == iterations
                    and not picture.about["coarse"])

        self.until(is_there)
        return self.view._live.picture.pixels

    def test_the_viewport_follows_the_camera_the_objects_and_the_materials(self):
        self.update()
        first = self.show()
        self.assertEqual(first.shape, (_SIZE[1], _SIZE[0], 4))
        self.assertGreater(first[..., :3].max(), 0)
        self.assertEqual(self.view._exports, 1)

        self.scene.camera.location.x += 0.5  # no export
        self.update(self.scene.camera)
        moved = self.show()
        self.assertFalse(numpy.array_equal(first, moved))
        self.assertEqual(self.view._exports, 1)

        ball = bpy.data.objects["ball"]
        ball.location.x -= 0.4
        ball.rotation_euler.z = 0.3
        self.update(ball)
        placed = self.show()
        self.assertEqual(self.view._exports, 1, "a moved object is not exported again")
        self.assertFalse(numpy.array_equal(moved, placed))

        # A new export of the scene gives the same picture, up to rounding.
        self.update(bpy.data.materials[0])
        self.until(lambda: self.view._exports == 2)
        fresh = self.show()
        noise = numpy.abs(fresh - placed).mean() / placed[..., :3].mean()
        self.assertLess(noise, 0.02)

        bpy.data.objects.remove(ball)
        self.update()
        self.until(lambda: self.view._exports == 3)
        self.assertFalse(numpy.array_equal(self.show(), fresh))

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
        self.update()
        self.show()
        self.view._server._process.kill()
        self.until(lambda: self.view._live.fault is not None)
        self.update()
        self.view.tick()


class Cameras(Installed):
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
        about = {"id": 2, "iteration": 1, "iterations": 4, "coarse": True}
        state.shown(mock.Mock(about=about))
        self.assertEqual(sent[-1], ("view", {"width": 4}))
        self.assertEqual(len(sent), 3)
        state.answered({"event": "stopped", "id": 2})
        self.assertEqual(len(sent), 3)
        state.place({"a": [0] * 16})
        state.answered({"event": "error", "id": 4, "message": "it cannot", "hint": ""})
        self.assertTrue(state.needs_export)


if __name__ == "__main__":
    unittest.main()
