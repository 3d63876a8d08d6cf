"""Tests that a later frame or export bakes again only what has changed, and writes the bytes of a fresh export."""

import os
import unittest
from unittest import mock

import support

import bpy
import numpy

import bake
import export
import panorama
import sky
from lab.features import torture_stage


class Unchanged(support.Scratch):
    """A body with a baked material, in a world that is baked too."""

    def setUp(self):
        super().setUp()
        self.folder, self.fresh, self.bakes = str(self.dir), 0, 0
        self.stage = torture_stage.Stage("plane")
        self.noise = self.stage.node("TexNoise", Scale=3.0)
        self.direction = self.stage.node("Normal", self.stage.node("NewGeometry").outputs["Normal"])
        self.stage.principled(Base_Color=self.noise.outputs["Color"], Roughness=self.direction.outputs["Dot"],
                              Metallic=self.stage.node("Math", 0.2, 0.3, operation="ADD"))
        tree = self.stage.scene.world.node_tree
        self.sky = tree.nodes.new("ShaderNodeTexGradient")
        tree.links.new(self.sky.outputs["Color"], self.stage.background.inputs["Color"])
        self.enterContext(mock.patch.object(sky.bake_world, "__defaults__", (64,)))
        for owner, name in ((bake.Baker, "_texels"), (panorama, "render")):
            self.enterContext(mock.patch.object(owner, name, self.counting(getattr(owner, name))))

    def counting(self, work):
        def counted(*arguments, **named):
            self.bakes += 1
            return work(*arguments, **named)
        return counted

    def write(self, cache):
        """Export with a cache. Returns the bytes of all files (pixels of pictures), and the number of bakes."""
        self.bakes = 0
        path = os.path.join(self.folder, "out", "scene.glb")
        os.makedirs(os.path.dirname(path), exist_ok=True)
        with mock.patch.dict(os.environ, XDG_CACHE_HOME=os.path.join(self.folder, cache)):
            export.write(path, bake_size=16)
        files = {}
        for entry in os.scandir(os.path.dirname(path)):
            if entry.name.endswith(".exr"):  # its header has the time that Cycles took
                image = bpy.data.images.load(entry.path)
                files[entry.name] = numpy.array(image.pixels[:]).tobytes()
                bpy.data.images.remove(image)
                continue
            with open(entry.path, "rb") as file:
                files[entry.name] = file.read()
        return files, self.bakes

    def check(self, changed, bakes):
        """Compare an export with that of an empty cache."""
        found, count = self.write("kept")
        self.fresh += 1
        self.assertTrue(found == self.write(f"fresh {self.fresh}")[0], changed)
        (self.assertGreater if bakes else self.assertEqual)(count, 0, changed)

    def test_only_what_changes_is_baked_again_and_no_file_is_stale(self):
        self.check("first export", True)
        self.check("nothing", False)
        self.stage.lamp.data.energy = 50
        self.check("a lamp", False)
        self.noise.inputs["Scale"].default_value = 4
        self.check("a value of a material", True)
        self.direction.outputs["Normal"].default_value = (1, 0, 0)
        self.check("the value of an output", True)
        self.stage.body.data.vertices[0].co.x -= 0.2
        self.check("a mesh", True)
        self.sky.gradient_type = "RADIAL"
        self.check("the world", True)
        self.stage.scene.frame_set(2)
        self.check("the frame", False)
        driver = self.noise.inputs["Detail"].driver_add("default_value").driver
        driver.expression = "frame / 2"
        self.stage.scene.frame_set(3)
        self.check("a driven value", True)
        self.stage.scene.frame_set(3, subframe=0.5)
        self.check("a driven value between frames", True)


if __name__ == "__main__":
    unittest.main()
