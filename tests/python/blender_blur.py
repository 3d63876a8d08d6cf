"""Pictures with motion blur, compared with Cycles: six scenes in each of which one thing moves."""

import math
import os
import unittest

import blender_motion  # first: it sets the search path
import bpy
import export
import numpy
import support
from cycles_comparison import eye, glow, lamp, shared, square

# Relative root-mean-square difference of the means of tiles: at most, of pictures that agree, and at least, of one with a
# wrong shutter.
_AGREES, _DIFFERS = 0.03, 0.1
_TILES = 8


def difference(ours, theirs):
    """The root-mean-square difference of the means of tiles of two pictures, relative to the second one's."""
    side = theirs.shape[0] // _TILES
    ours, theirs = (p.reshape(_TILES, side, _TILES, side, 3).mean((1, 3)) for p in (ours, theirs))
    return float(numpy.sqrt(((ours - theirs) ** 2).mean() / (theirs ** 2).mean()))


class Blurred(blender_motion.Moving):
    def setUp(self):
        super().setUp()
        self.scene.render.motion_blur_shutter = 1.0
        eye((0, 0, 8), (0, 0, 0), type="ORTHO", ortho_scale=4)

    def agrees(self, theirs=None, iterations=128, samples=128):
        """Assert that the blurred picture is Cycles', and that shutters that are late or closed give others."""
        ours = self.caustique(iterations, "--method", "path")
        self.assertEqual(self.warnings, [])
        theirs = self.cycles(samples) if theirs is None else theirs
        self.assertLess(difference(ours, theirs), _AGREES)
        for fault in ("0,1", "0"):
            self.assertGreater(difference(self.again(iterations, fault), theirs), _DIFFERS, fault)

    def again(self, iterations, shutter):
        """The exported scene with another shutter."""
        out = os.path.join(self.folder, "again.exr")
        support.run(["render", self.path, "-o", out, "--iterations", iterations, "--method", "path", "--no-combine",
                     "--progress", "none", "--layers", "beauty", "--shutter", shutter], check=0)
        return shared.pixels(out)

    def square(self, half=0.6, color=(1, 0.5, 0.2)):
        return shared.place("square", square(glow("square", color), half))

    def test_moving_cube(self):
        body = shared.cube(glow("cube", (0.2, 0.5, 1)))
        self.keyed(body, "location", (-6, -3, 0), (4, 1, 0))
        self.agrees()

    def test_rotating_object(self):
        body = self.square()
        body.scale, body.cycles.motion_steps = (3, 0.3, 1), 4
        self.keyed(body, "rotation_euler", (0, 0, 0.3), (0, 0, 15))
        self.agrees()

    def test_armature(self):
        bones = bpy.data.armatures.new("rig")
        rig = shared.place("rig", bones)
        bpy.context.view_layer.objects.active = rig
        bpy.ops.object.mode_set(mode="EDIT")
        bone = bones.edit_bones.new("bone")
        bone.head, bone.tail = (0, 0, 0), (0, 1, 0)
        bpy.ops.object.mode_set(mode="OBJECT")
        mesh = bpy.data.meshes.new("strip")
        mesh.from_pydata([(x, y, 0) for y in (-1.5, 0, 1.5) for x in (-0.3, 0.3)], [], [(0, 1, 3, 2), (2, 3, 5, 4)])
        mesh.materials.append(glow("strip", (0.3, 1, 0.3)))
        body = shared.place("strip", mesh)
        body.vertex_groups.new(name="bone").add((4, 5), 1.0, "REPLACE")
        body.modifiers.new("rig", "ARMATURE").object = rig
        pose = rig.pose.bones["bone"]
        pose.rotation_mode, body.cycles.motion_steps = "XYZ", 3
        self.keyed(pose, "rotation_euler", (0, 0, -5), (0, 0, 5))
        self.agrees()

    def test_shape_key(self):
        body = self.square()
        body.shape_key_add(name="Basis")
        key = body.shape_key_add(name="moved")
        for point in key.data[2:]:
            point.co.x += 20
        key.slider_min = -1
        self.keyed(key, "value", -0.6, 0.4)
        self.agrees()

    def test_moving_camera(self):
        for x in range(-4, 5):
            for y in range(-4, 5):
                shared.place("tile", square(glow("tile", (0.5 + x / 8, 0.5 + y / 8, 0.5)), 0.3), (x, y, 0))
        body = eye((0, 0, 6), (0, 0, 0))
        self.keyed(body, "location", (-10, 0, 6), (10, 0, 6))
        self.keyed(body, "rotation_euler", (0, -0.8, -0.8), (0, 0.8, 0.8))
        self.keyed(body.data, "lens", 30, 60)
        self.agrees()

    def test_moving_light(self):
        self.floor()
        light = shared.place("light", square(glow("light", (20, 20, 20)), 0.2, "light"))
        light.rotation_euler, light.visible_camera = (3.14159, 0, 0), False
        self.keyed(light, "location", (-10, -5, 0.5), (10, 5, 0.5))
        self.agrees()

    def fluid(self, changes):
        """A sheet that geometry nodes make, with the attribute velocity: its faces change from frame to frame or stay."""
        tree = bpy.data.node_groups.new("fluid", "GeometryNodeTree")
        tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
        grid, store, wear, end, time = (tree.nodes.new(kind) for kind in (
            "GeometryNodeMeshGrid", "GeometryNodeStoreNamedAttribute", "GeometryNodeSetMaterial", "NodeGroupOutput",
            "GeometryNodeInputSceneTime"))
        grid.inputs["Size X"].default_value, grid.inputs["Size Y"].default_value = 0.8, 1.2
        if changes:
            tree.links.new(time.outputs["Frame"], grid.inputs["Vertices X"])
        store.data_type, store.domain = "FLOAT_VECTOR", "POINT"
        store.inputs["Name"].default_value = "velocity"
        next(s for s in store.inputs if s.type == "VECTOR").default_value = (36, 18, 0)
        wear.inputs["Material"].default_value = glow("fluid", (0.3, 0.6, 1))
        for one, other in zip((grid, store, wear), (store, wear, end)):
            tree.links.new(one.outputs[0], other.inputs[0])
        shared.place("fluid", square(None)).modifiers.new("nodes", "NODES").node_group = tree

    def test_fluids(self):
        """Meshes of any faces move by their attribute velocity while the shutter is open, as Cycles moves them."""
        for changes in (True, False):
            with self.subTest(changes=changes):
                self.fluid(changes)
                self.agrees()
                bpy.data.objects.remove(bpy.data.objects["fluid"])

    def test_frames(self):
        """A frame of a sequence is blurred as the frame alone."""
        self.keyed(self.square(), "location", (-6, -3, 0), (4, 1, 0))
        export.write_frames(os.path.join(self.folder, "shot.##.glb"), 5, 6)
        out = os.path.join(self.folder, "out.##.exr")
        options = ("--iterations", 16, "--method", "path", "--seed", 1, "--frame-seed", "same", "--no-combine",
                   "--progress", "none", "--layers", "beauty")
        support.run(["render", os.path.join(self.folder, "shot.##.glb"), "--frames", "5-6", "-o", out, *options], check=0)
        frames = [shared.pixels(os.path.join(self.folder, f"out.{frame:02}.exr")) for frame in (5, 6)]
        alone = self.caustique(16, *options[2:])
        numpy.testing.assert_array_equal(frames[1], alone)
        self.assertGreater(difference(frames[0], alone), _DIFFERS)

    def test_moving_lamp(self):
        """Cycles holds lamps still while the shutter is open, so the mean of its still pictures is compared."""
        self.floor()
        body = lamp("POINT", (0, 0, 0.5), 50, shadow_soft_size=0.1, use_soft_falloff=False)
        self.keyed(body, "location", (-10, -5, 0.5), (10, 5, 0.5))
        self.agrees(self.mean_of_stills(16))

    def mean_of_stills(self, count):
        """The mean of Cycles' still pictures at the middles of equal parts of the shutter's interval."""
        self.scene.render.use_motion_blur, total = False, 0
        for k in range(count):
            moment = blender_motion.FRAME - 0.5 + (k + 0.5) / count
            self.scene.frame_set(math.floor(moment), subframe=moment % 1)
            total = total + self.cycles(16)
        self.scene.frame_set(blender_motion.FRAME)
        self.scene.render.use_motion_blur = True
        return total / count


if __name__ == "__main__":
    unittest.main()
