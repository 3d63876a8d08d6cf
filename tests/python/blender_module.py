"""Blender's Python module starts without a display, exports glTF and renders with Cycles."""

import json
import struct
import unittest

import bpy

import support


class Module(support.Scratch):
    def setUp(self):
        super().setUp()
        bpy.ops.wm.read_factory_settings(use_empty=True)
        bpy.ops.mesh.primitive_cube_add(size=2.0)

    def test_exports_a_cube_as_glb(self):
        path = self.dir / "cube.glb"
        bpy.ops.export_scene.gltf(filepath=str(path))
        data = path.read_bytes()
        magic, version, length = struct.unpack_from("<III", data)
        self.assertEqual((magic, version, length), (0x46546C67, 2, len(data)))
        size = struct.unpack_from("<I", data, 12)[0]
        gltf = json.loads(data[20 : 20 + size])
        position = gltf["accessors"][gltf["meshes"][0]["primitives"][0]["attributes"]["POSITION"]]
        self.assertEqual((position["min"], position["max"]), ([-1, -1, -1], [1, 1, 1]))

    def test_renders_with_cycles(self):
        scene = bpy.context.scene
        scene.render.engine = "CYCLES"
        scene.cycles.samples = 1
        scene.render.resolution_x, scene.render.resolution_y = 16, 8
        scene.world = bpy.data.worlds.new("World")
        bpy.ops.object.camera_add(location=(0.0, 0.0, 8.0))
        scene.camera = bpy.context.object
        scene.render.image_settings.file_format = "OPEN_EXR"
        scene.render.filepath = str(self.dir / "cube.exr")
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(str(self.dir / "cube.exr"))
        self.assertEqual(tuple(image.size), (16, 8))


if __name__ == "__main__":
    unittest.main()
