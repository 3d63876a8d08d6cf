"""Common parts of the exporter's tests, which compare renders of caustique with Cycles. Needs bpy and the program."""

import os
import tempfile
import unittest

import blender_export as shared  # first: it sets the search path
import bpy
import export
import numpy
import support
from mathutils import Vector


def glow(name, color):
    """A material that emits a radiance and reflects nothing."""
    return shared.node_material(name, "ShaderNodeEmission", Color=(*color, 1), Strength=1.0)


def square(material, half=0.4, name="square"):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([(-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0)], [], [(0, 1, 2, 3)])
    mesh.materials.append(material)
    return mesh


def lamp(kind, at, energy, **values):
    """A lamp that emits downwards. `values`: its settings by name."""
    light = bpy.data.lights.new(kind.lower(), kind)
    light.energy = energy
    for name, value in values.items():
        setattr(light, name, value)
    return shared.place(kind.lower(), light, at)


def eye(at, to, **values):
    data = bpy.data.cameras.new("eye")
    for name, value in values.items():
        setattr(data, name, value)
    body = shared.place("eye", data, at)
    body.rotation_euler = (Vector(to) - Vector(at)).to_track_quat("-Z", "Y").to_euler()
    bpy.context.scene.camera = body
    return body


class CyclesComparison(unittest.TestCase):
    """Starts each test with an empty scene and small pictures."""

    def setUp(self):
        bpy.ops.wm.read_factory_settings(use_empty=True)
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = folder.name
        self.path = os.path.join(self.folder, "scene.glb")
        self.scene = bpy.context.scene
        self.scene.render.resolution_x = self.scene.render.resolution_y = 32

    def cycles(self, samples=256):
        """Render with Cycles. Returns the picture, bottom row first."""
        scene = self.scene
        scene.render.engine, scene.cycles.samples, scene.cycles.use_denoising = "CYCLES", samples, False
        settings = scene.render.image_settings
        if hasattr(settings, "media_type"):
            settings.media_type = "IMAGE"
        settings.file_format, settings.color_depth, settings.color_mode = "OPEN_EXR", "32", "RGB"
        scene.render.filepath = os.path.join(self.folder, "cycles.exr")
        bpy.ops.render.render(write_still=True)
        return shared.pixels(scene.render.filepath)

    def caustique(self, iterations=128, *options):
        """Export and render with caustique. Returns the picture, bottom row first."""
        self.warnings = export.write(self.path)
        out = os.path.join(self.folder, "caustique.exr")
        support.run(["render", self.path, "-o", out, "--iterations", iterations, "--no-combine", "--progress", "none",
                     "--layers", "beauty", *options], check=0)
        return shared.pixels(out)

    def alike(self, ours, theirs, tolerance=0.02, parts=2):
        """Assert that the means of the pictures, and of each of `parts` x `parts` tiles, agree within `tolerance`."""
        self.assertEqual(ours.shape, theirs.shape)
        self.assertGreater(theirs.mean(), 1e-3)
        height, width, _ = ours.shape

        def tiles(picture):
            return picture.reshape(parts, height // parts, parts, width // parts, 3).mean((1, 3))

        numpy.testing.assert_allclose(ours.mean((0, 1)), theirs.mean((0, 1)), rtol=tolerance)
        numpy.testing.assert_allclose(tiles(ours), tiles(theirs), rtol=2 * tolerance, atol=1e-4)

    def silhouettes_agree(self, ours, theirs):
        """Assert that fewer than 2 % of the pixels differ, because only pixels on edges may."""
        self.assertEqual(ours.shape, theirs.shape)
        differ = (abs(ours - theirs) > 0.2).any(-1)
        self.assertLess(differ.mean(), 0.02, f"rows, columns: {numpy.argwhere(differ)[:20].tolist()}")
        self.assertGreater((theirs > 0.3).any(-1).mean(), 0.03)

    def floor(self, half=3.0, color=(0.8, 0.8, 0.8)):
        grey = shared.node_material("grey", "ShaderNodeBsdfDiffuse", Color=(*color, 1))
        return shared.place("floor", square(grey, half, "floor"))
