"""Exported cameras, picture settings, objects hidden from cameras, frames and losses, compared with Cycles."""

import contextlib
import io
import math
import os
import unittest

import cycles_comparison  # first: it sets the search path
import bpy
import export
import glb
import numpy
import support
from cycles_comparison import eye, glow, lamp, shared, square


class Pictures(cycles_comparison.CyclesComparison):
    def test_shift_and_size(self):
        """Lens shift of wide and tall, perspective and orthographic pictures, at the scene's resolution."""
        for x in range(-3, 4):
            for y in range(-3, 4):
                body = shared.place("tile", square(glow("tile", (0.5 + x / 8, 0.5 + y / 8, 0.5)), 0.4), (x, y, 0))
                body.rotation_euler = (0, 0, 0.1 * x)
        for kind, width, height in (("PERSP", 96, 48), ("PERSP", 48, 96), ("ORTHO", 96, 48)):
            self.scene.render.resolution_x, self.scene.render.resolution_y = width, height
            self.scene.render.resolution_percentage = 50
            eye((0.3, 0.2, 5), (0.3, 0.2, 0), type=kind, lens=50, ortho_scale=4, shift_x=0.2, shift_y=-0.1)
            ours, theirs = self.caustique(16), self.cycles(16)
            self.assertEqual(ours.shape, (height // 2, width // 2, 3))
            self.silhouettes_agree(ours, theirs)

    def test_sensor_fit(self):
        """Cameras of every sensor fit see the frame that Blender shows, in wide and in tall pictures."""
        for fit in ("AUTO", "HORIZONTAL", "VERTICAL"):
            for width, height in ((64, 32), (32, 64)):
                self.scene.render.resolution_x, self.scene.render.resolution_y = width, height
                for kind in ("PERSP", "ORTHO"):
                    body = eye((0, 0, 5), (0, 0, 0), type=kind, sensor_fit=fit, sensor_height=20, ortho_scale=6)
                    corner = body.data.view_frame(scene=self.scene)[0]
                    export.write(self.path)
                    camera = glb.read(self.path)[0]["cameras"][0]
                    if kind == "ORTHO":
                        found, expected = [camera["orthographic"][key] for key in ("xmag", "ymag")], corner[:2]
                    else:
                        found, expected = [math.tan(camera["perspective"]["yfov"] / 2)], [corner[1] / -corner[2]]
                    numpy.testing.assert_allclose(found, expected, rtol=1e-5, err_msg=f"{fit} {width} {kind}")
                    bpy.data.objects.remove(body)

    def test_picture_settings_are_exported(self):
        self.floor()
        eye((0, -3, 3), (0, 0, 0), clip_start=1.0, clip_end=4.0)
        scene = self.scene
        scene.render.use_border, scene.render.border_min_x, scene.render.border_max_y = True, 0.25, 0.5
        scene.render.film_transparent, scene.cycles.film_exposure = True, 4.0
        scene.view_settings.view_transform, scene.view_settings.exposure = "Standard", -1.0
        scene.view_settings.look = "High Contrast"
        warnings = "\n".join(export.write(self.path))
        said = glb.read(self.path)[0]["scenes"][0]["extras"]["caustique"]
        self.assertEqual(said["resolution"], [32, 32])
        numpy.testing.assert_allclose(said["crop"], (0.25, 0.5, 0.75, 0.5), atol=1e-6)
        self.assertEqual((said["exposure"], said["tonemap"], said["film_transparent"]), (1.0, "srgb", True))
        self.assertIn('object "floor" is seen, also beyond its clip end of 4 m', warnings)
        self.assertNotIn("clip start", warnings)
        self.assertIn("film exposure of 4", warnings)
        self.assertIn('its look "High Contrast" is not carried', warnings)

    def test_looks_of_contrast_are_exported(self):
        view = self.scene.view_settings
        for transform, look, expected in (
            ("Filmic", "None", ("filmic", None)),
            ("Filmic", "Very High Contrast", ("filmic", "very-high")),
            ("AgX", "AgX - Medium Low Contrast", ("agx", "medium-low")),
            ("AgX", "AgX - Base Contrast", ("agx", "medium")),
        ):
            view.view_transform, view.look = transform, look
            warnings = export.write(self.path)
            said = glb.read(self.path)[0]["scenes"][0]["extras"]["caustique"]
            self.assertEqual((said["tonemap"], said.get("contrast")), expected)
            self.assertNotIn("look", "\n".join(warnings))
        view.look = "AgX - Punchy"
        self.assertIn('its look "AgX - Punchy" is not carried', "\n".join(export.write(self.path)))

    def test_losses_are_repeated_by_every_command(self):
        """info, plan, render and the EXR repeat the exporter's warnings, and --strict makes them errors."""
        self.floor().visible_shadow = False
        lamp("POINT", (0, 0, 2), 10, shadow_soft_size=0.0)
        eye((0, -3, 3), (0, 0, 0))
        lost = export.write(self.path)
        self.assertEqual(len(lost), 1)
        self.assertIn("hidden from shadow rays", lost[0])
        out = os.path.join(self.folder, "out.exr")
        for command in (["info", self.path], ["plan", self.path], ["render", self.path, "-o", out, "--iterations", 1],
                        ["info", out]):
            done = support.run(command, check=0)
            self.assertIn(lost[0], done.stdout + done.stderr, command)
        done = support.run(["render", self.path, "-o", out, "--iterations", 1, "--strict"], check=1)
        self.assertIn(lost[0], done.stderr)

    def test_objects_hidden_from_cameras(self):
        """Hidden and Indirect Only objects light the scene and cast shadows, and cameras see through them."""
        self.floor()
        shared.place("shown", square(glow("white", (3, 3, 3)), 0.5), (1.2, 0, 0.6))
        hidden = shared.place("hidden", square(glow("red", (9, 1, 1)), 0.5), (-0.5, 0, 0.6))
        hidden.visible_camera = False
        collection = bpy.data.collections.new("indirect")
        self.scene.collection.children.link(collection)
        body = bpy.data.objects.new("indirect", square(glow("blue", (1, 1, 9)), 0.4))
        collection.objects.link(body)
        body.location = (0, 1, 0.8)
        bpy.context.view_layer.layer_collection.children["indirect"].indirect_only = True
        eye((0, 0, 4), (0, 0, 0), lens=40)
        self.alike(self.caustique(256), self.cycles(512))
        self.assertEqual(self.warnings, [])

    def test_view_layers(self):
        """The current view layer is exported if it is enabled, and the others are named."""
        self.floor()
        for name in ("second", "third"):
            self.scene.view_layers.new(name)
        bpy.context.window.view_layer = self.scene.view_layers["second"]
        self.scene.view_layers["third"].use = False
        first = self.scene.view_layers[0]
        said = 'scene "Scene": of its view layers only "{}" is exported, not "{}"; '
        said += "render by F12, which renders all view layers, or make another one active"
        self.assertEqual(export.write(self.path), [said.format("second", first.name)])
        self.scene.view_layers["second"].use = False
        self.assertEqual(export.write(self.path), [])
        self.assertEqual(bpy.context.window.view_layer.name, "second")

    def test_frames(self):
        body = self.floor()
        for frame, x in ((1, 0.0), (3, 2.0)):
            body.location.x = x
            body.keyframe_insert("location", frame=frame)
        self.scene.frame_set(1)
        export.write_frames(os.path.join(self.folder, "shot.###.glb"), 2, 3)
        self.assertEqual(self.scene.frame_current, 1)
        files = [glb.read(os.path.join(self.folder, f"shot.00{frame}.glb"))[0] for frame in (2, 3)]
        numpy.testing.assert_allclose([f["nodes"][0]["translation"][0] for f in files], (1, 2), atol=0.3)
        for wrong in (["out.glb", "--frames", "1-2"], ["o.##.glb", "--frames", "2-1"], ["o.##.glb", "--frames", "two"]):
            with self.assertRaises(SystemExit) as stopped, contextlib.redirect_stderr(io.StringIO()):
                export.main(wrong)
            self.assertEqual(stopped.exception.code, 2)


if __name__ == "__main__":
    unittest.main()
