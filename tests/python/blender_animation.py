"""Compares animations of Blender's own exporter with single frames of scripts/blender/export.py."""

import json
import math
import os
import unittest

import cycles_comparison  # first: it sets the search path
import bpy
import export
import support
from cycles_comparison import eye, lamp, shared, square


def matt(name, *color):
    """A material that both exporters write equally."""
    return shared.node_material(name, "ShaderNodeBsdfPrincipled", Base_Color=(*color, 1), Roughness=1, Specular_IOR_Level=0)


class Animation(cycles_comparison.CyclesComparison):
    """An object, a camera, a lamp, a shape key and an armature that move, rendered at frames 1, 7 and 12."""

    def keyed(self, thing, path, *values):
        for frame, value in zip((1, 12), values):
            setattr(thing, path, value)
            thing.keyframe_insert(path, frame=frame)

    def put(self, name, mesh):
        body = bpy.data.objects.new(name, mesh)
        self.scene.collection.objects.link(body)
        return body

    def stage(self):
        moving = self.put("moving", square(matt("red", 0.9, 0.1, 0.1)))
        self.keyed(moving, "location", (-1, 0, 0), (1, 1, 0))
        self.keyed(moving, "rotation_euler", (0, 0, 0), (0, 0.4, 2))
        shaped = self.put("shaped", square(matt("green", 0.1, 0.9, 0.1)))
        shaped.location = (0, -2, 0)
        shaped.shape_key_add(name="Basis")
        key = shaped.shape_key_add(name="wide")
        for point in key.data:
            point.co.x *= 3
        self.keyed(key, "value", 0.0, 1.0)
        self.rigged()
        self.scene.render.resolution_x = self.scene.render.resolution_y = 48
        eye((0, 0, 9), (0, 0, 0), type="ORTHO", ortho_scale=9)
        self.keyed(self.scene.camera, "location", (0, 0, 9), (0.5, 0, 9))
        self.put("floor", square(matt("grey", 0.8, 0.8, 0.8), 6)).location.z = -1
        self.keyed(lamp("POINT", (0, 0, 3), 100, shadow_soft_size=0), "location", (0, 0, 3), (2, 0, 3))

    def rigged(self):
        """A strip with a bone that bends its upper half."""
        bones = bpy.data.armatures.new("rig")
        rig = self.put("rig", bones)
        rig.location = (-2.5, 0, 0)
        bpy.context.view_layer.objects.active = rig
        bpy.ops.object.mode_set(mode="EDIT")
        lower, upper = bones.edit_bones.new("lower"), bones.edit_bones.new("upper")
        lower.head, lower.tail, upper.head, upper.tail = (0, 0, 0), (0, 1, 0), (0, 1, 0), (0, 2, 0)
        upper.parent = lower
        bpy.ops.object.mode_set(mode="OBJECT")
        strip = bpy.data.meshes.new("strip")
        strip.from_pydata([(x, y, 0) for y in (0, 1, 2) for x in (-0.4, 0.4)], [], [(0, 1, 3, 2), (2, 3, 5, 4)])
        strip.materials.append(matt("blue", 0.1, 0.1, 0.9))
        body = self.put("strip", strip)
        body.parent = rig
        for name, vertices in (("lower", (0, 1, 2, 3)), ("upper", (4, 5))):
            body.vertex_groups.new(name=name).add(vertices, 1.0, "REPLACE")
        body.vertex_groups["upper"].add((2, 3), 0.5, "REPLACE")
        body.vertex_groups["lower"].add((2, 3), 0.5, "REPLACE")
        body.modifiers.new("rig", "ARMATURE").object = rig
        bone = rig.pose.bones["upper"]
        bone.rotation_mode = "XYZ"
        self.keyed(bone, "rotation_euler", (0, 0, 0), (0, 0, 1.2))

    def picture(self, scene, frame, name, *options):
        """Render a frame with one ray per pixel. Returns the program's output."""
        self.out[name] = os.path.join(self.folder, name + ".exr")
        done = support.run(["render", scene, "--frames", frame, "-o", self.out[name], "--method", "path", "--iterations", 1,
                            "--no-combine", "--width", 48, "--height", 48, *options], check=0)
        return done.stderr

    def differ(self, layer):
        """The largest root-mean-square difference of a layer's channels between both pictures."""
        said = support.run(["compare", self.out["played"], self.out["alone"], "--layer", layer, "--json"], check=0)
        return math.sqrt(json.loads(said.stdout)["mse"])

    def test_frames_are_those_of_the_exporter(self):
        self.out = {}
        self.stage()
        self.scene.frame_start, self.scene.frame_end, self.scene.render.fps = 1, 12, 25
        whole, alone = (os.path.join(self.folder, name) for name in ("whole.glb", "shot.##.glb"))
        bpy.ops.export_scene.gltf(filepath=whole, export_cameras=True, export_lights=True, export_animations=True)
        export.write_frames(alone, 1, 12)
        for frame in (1, 7, 12):
            said = self.picture(whole, frame, "played", "--frame-rate", 25)
            self.assertNotIn("animation", said)
            self.picture(alone, frame, "alone")
            for layer in ("P", "normal", "Direct"):
                self.assertLess(self.differ(layer), 1e-5, f"{layer} of frame {frame}")
        # The test detects a time that is off by one frame.
        self.picture(alone, 11, "alone")
        for layer in ("P", "normal", "Direct"):
            self.assertGreater(self.differ(layer), 1e-3, layer)


if __name__ == "__main__":
    unittest.main()
