"""Exports volume objects with OpenVDB files: grids, coefficients and emission, and what is not carried, by name."""

import os
import struct
import unittest

import bpy

import export
import glb
import numpy
import support
import volumes

from lab.features import torture_stage


def read(path):
    """Lower and upper corner of a grid file, and its values by z, y, x and channel."""
    with open(path, "rb") as file:
        content = file.read()
    magic, version, kind, *size, channels = struct.unpack("<3sB5I", content[:24])
    assert (magic, version, kind) == (b"VOL", 3, 1)
    corners = struct.unpack("<6f", content[24:48])
    return corners[:3], corners[3:], numpy.frombuffer(content[48:], "<f4").reshape(*size[::-1], channels)


@unittest.skipIf(volumes.openvdb() is None, "Blender before 4.4 has no module openvdb")
class Volumes(support.Scratch):
    def setUp(self):
        super().setUp()
        self.path = str(self.dir / "scene.glb")

    def export(self, name):
        """Exports a feature; returns its stage, the material and the warnings."""
        torture_stage.FEATURES[name](stage := torture_stage.Stage())
        warnings = export.write(self.path, bake_size=0)
        document, _ = glb.read(self.path)
        return stage, next(m for m in document["materials"] if m["name"] == "tested"), warnings

    def test_a_cloud(self):
        materials = len(bpy.data.materials)
        _, entry, warnings = self.export("volume_smoke")
        self.assertEqual(warnings, [])
        medium = entry["extras"]["caustique"]["medium"]
        numpy.testing.assert_allclose(medium["sigma_s"], [2.4, 1.8, 1.2], rtol=1e-5)
        self.assertAlmostEqual(medium["g"], 0.3, places=5)
        self.assertEqual(list(entry["extras"]), ["caustique"])
        low, high, values = read(self.dir / medium["density"]["file"])
        library = volumes.openvdb()
        path = bpy.data.volumes[0].filepath
        grid = library.read(path, "density")
        first, last = grid.evalActiveVoxelBoundingBox()
        self.assertEqual(values.shape[2::-1], tuple(numpy.subtract(last, first)[[0, 2, 1]] + 3))
        # glTF's axes are Blender's x, z and -y.
        accessor = grid.getConstAccessor()
        for voxel in ((0, 0, 0), (3, -2, 5), (-7, 4, -1)):
            place = numpy.array([voxel[0], voxel[2], -voxel[1]])
            x, y, z = numpy.floor(place - low).astype(int)
            self.assertAlmostEqual(values[z, y, x, 0], accessor.getValue(voxel), places=5)
        self.assertTrue(all(a < b for a, b in zip(low, high)))
        self.assertLessEqual(len(bpy.data.materials), materials + 2)

    def test_a_scaled_cloud_keeps_its_opacity(self):
        stage, entry, warnings = self.export("volume_scaled")
        self.assertEqual(warnings, [])
        length = float(numpy.linalg.norm(stage.body.scale) / 3 ** 0.5)
        found = entry["extras"]["caustique"]["medium"]["sigma_s"]
        numpy.testing.assert_allclose(found, [4.5 / length] * 3, rtol=1e-5)

    def test_a_fire(self):
        _, entry, warnings = self.export("volume_fire")
        self.assertEqual(warnings, [])
        medium = entry["extras"]["caustique"]["medium"]
        _, _, glow = read(self.dir / medium["emission"]["file"])
        red, green, blue = glow.reshape(-1, 3).max(0)
        self.assertGreater(red, 2 * green)
        self.assertGreater(green, 2 * blue)

    def test_losses_are_named(self):
        torture_stage.FEATURES["volume_smoke"](stage := torture_stage.Stage())
        noise = stage.tree.nodes.new("ShaderNodeTexNoise")
        shader = next(n for n in stage.tree.nodes if n.type == "PRINCIPLED_VOLUME")
        link = stage.tree.links.new(noise.outputs[0], shader.inputs["Density"])
        self.assertIn('object "cloud": its density is not one grid times a number: it is left out; link an Attribute node '
                      'to Density, at most times a number',
                      export.write(self.path, bake_size=0))
        stage.tree.links.remove(link)
        stage.tree.links.new(noise.outputs[0], shader.inputs["Emission Strength"])
        self.assertIn('material "tested": its emission is not one grid times constants: it is not carried; link an '
                      'Attribute node to Emission Strength, and unlink Emission Color',
                      export.write(self.path, bake_size=0))
        os.remove(bpy.data.volumes[0].filepath)
        bpy.data.volumes[0].grids.unload()
        self.assertTrue(any("its grids cannot be read" in line for line in export.write(self.path, bake_size=0)))


if __name__ == "__main__":
    unittest.main()
