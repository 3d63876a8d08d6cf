"""Motion vectors of exported scenes, compared with Cycles' pass Vector."""

import os

import blender_motion  # first: it sets the search path
import bpy
import export
import numpy
import support
from blender_motion import FRAME
from caustique_addon import exr
from cycles_comparison import eye, glow, shared, square

# Largest difference of a component (pixels), and the share of pixels, those on edges, that may differ by more.
_TOLERANCE, _EDGES = 0.02, 0.06


class Vectors(blender_motion.Moving):
    def setUp(self):
        super().setUp()
        self.scene.render.use_motion_blur = False
        self.layer = self.scene.view_layers[0]
        self.layer.use_pass_vector = True
        self.scene.render.resolution_x = self.scene.render.resolution_y = 64
        wall = shared.place("wall", square(glow("wall", (0.2, 0.2, 0.2)), 9.0), (0, 0, -2))
        wall.name = "wall"

    def ours(self):
        self.warnings = export.write(self.path, bake_size=0)
        out = os.path.join(self.folder, "ours.exr")
        support.run(["render", self.path, "-o", out, "--iterations", 1, "--method", "path", "--no-finish", "--layers",
                     "Motion", "--exr-naming", "blender", "--compression", "none", "--progress", "none"], check=0)
        return self.vectors(out)

    def theirs(self):
        scene = self.scene
        scene.render.engine, scene.cycles.samples, scene.cycles.use_denoising = "CYCLES", 1, False
        settings = scene.render.image_settings
        if hasattr(settings, "media_type"):
            settings.media_type = "MULTI_LAYER_IMAGE"
        settings.file_format, settings.color_depth, settings.exr_codec = "OPEN_EXR_MULTILAYER", "32", "NONE"
        scene.render.filepath = os.path.join(self.folder, "theirs.exr")
        bpy.ops.render.render(write_still=True)
        with open(scene.render.filepath, "r+b") as file:
            file.seek(5)
            file.write(b"\0")  # the flag of long names, which the reader does not expect
        return self.vectors(scene.render.filepath)

    def vectors(self, path):
        channels = exr.Picture(path).channels
        return numpy.stack([channels[f"ViewLayer.Vector.{c}"] for c in "XYZW"], -1)

    def differing(self, ours, theirs):
        """The share of pixels that differ."""
        return (abs(ours - theirs) > _TOLERANCE).any(-1).mean()

    def test_objects_that_move_turn_and_bend_before_a_moving_camera(self):
        """Sign, order and size are Cycles'. Other signs and another order are faults that the test refuses."""
        body = self.shaped(smooth=False)
        self.keyed(body, "location", (-1, 0, 0), (1, 1, 0.5))
        self.keyed(body, "rotation_euler", (0, 0, 0), (0.5, 0, 2))
        camera = eye((0, -1, 7), (0, 0, 0), lens=50)
        self.keyed(camera, "location", (-0.5, -1, 8), (1.5, -1, 6))
        ours, theirs = self.ours(), self.theirs()
        self.assertEqual(self.warnings, [])
        self.assertGreater(abs(theirs).max(), 1.0)
        self.assertLess(self.differing(ours, theirs), _EDGES)
        for fault in (-ours, ours[..., [2, 3, 0, 1]], ours * [1, -1, 1, -1]):
            self.assertGreater(self.differing(fault, theirs), 0.5)

    def test_vectors_leave_motion_blur_alone(self):
        """Keys of the frames around do not move what rests while the shutter is open."""
        moving, resting = self.body("moving"), self.body("resting")
        for body in (moving, resting):
            self.keyed(body, "location", (0, 0, 0), (10, 0, 0))
        resting.cycles.use_motion_blur = False
        self.scene.render.use_motion_blur = True
        played = self.written(bake_size=0)
        self.assertEqual(played.said["shutter"], [-0.25, 0.25])
        for name, blurred in (("moving", True), ("resting", False)):
            at = [played.matrix(name, time).translation.x for time in (-1, -0.25, 0, 0.25, 1)]
            expected = (4, 4.75 if blurred else 5, 5, 5.25 if blurred else 5, 6)
            numpy.testing.assert_allclose(at, expected, atol=1e-5)
        self.assertEqual(FRAME, self.scene.frame_current)
