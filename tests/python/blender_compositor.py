"""Tests the compositor's file in Blender: the sum of the parts, and the two controls of the caustics. Needs bpy."""

import unittest

import bpy
import numpy

import support
from addon import channels

import compositor


class Compositor(support.Scratch):
    def render(self, name, *extra):
        path = self.dir / name
        size = ["--width", "40", "--height", "24", "--iterations", "4", "--photons", "4000"]
        command = ["render", support.scene("cornell"), "-o", path, *size, "--progress", "none"]
        support.run([*command, *extra], check=0)
        return path

    def shown(self, scene, factor, tint):
        """The channels of the compositor's result with these inputs of its node."""
        tree = scene.compositing_node_group if bpy.app.version >= (5, 0, 0) else scene.node_tree
        inputs = tree.nodes["Caustics"].inputs
        inputs[compositor.FACTOR].default_value = factor
        inputs[compositor.TINT].default_value = (*tint, 1)
        settings = scene.render.image_settings
        if hasattr(settings, "media_type"):
            settings.media_type = "IMAGE"
        settings.file_format, settings.color_mode, settings.color_depth = "OPEN_EXR", "RGBA", "32"
        scene.render.filepath = str(self.dir / "shown.exr")
        bpy.ops.render.render(write_still=True)
        return channels(self.dir / "shown.exr")

    def test_factor_and_tint_change_the_caustics_alone(self):
        for naming in ("plain", "blender"):
            picture = self.render("a.exr", "--exr-naming", naming)
            blend = self.dir / "a.blend"
            self.assertEqual(compositor.main([str(picture), str(blend)]), 0)
            bpy.ops.wm.open_mainfile(filepath=str(blend))
            head = "ViewLayer." if naming == "blender" else ""
            found = channels(picture)
            finished = {c: found[f"{head}Combined.{c}" if head else c] for c in "RGBA"}
            for factor, tint in ((1, (1, 1, 1)), (0, (1, 1, 1)), (0.5, (1, 0.25, 0)), (3, (1, 1, 1))):
                shown = self.shown(bpy.context.scene, factor, tint)
                for channel, share in zip("RGB", tint):
                    caustic = found[f"{head}CombinedCaustic.{channel}"]
                    self.assertGreater(caustic.max(), 0.01)
                    expected = finished[channel] + (factor * share - 1) * caustic
                    numpy.testing.assert_allclose(shown[channel], expected, rtol=2e-6, atol=2e-6)
                numpy.testing.assert_array_equal(shown["A"], finished["A"])

    def test_pictures_without_parts_are_refused(self):
        picture = self.render("beauty.exr", "--layers", "beauty")
        with self.assertRaisesRegex(SystemExit, "no layer CombinedCaustic\nhint: render it with --layers comp or all"):
            compositor.main([str(picture), str(self.dir / "a.blend")])
        self.assertFalse((self.dir / "a.blend").exists())
        self.assertEqual(compositor.main([str(self.dir / "none.exr"), str(self.dir / "a.blend")]), 1)


if __name__ == "__main__":
    unittest.main()
