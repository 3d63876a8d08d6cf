"""Exported motion blur: samples while the shutter is open, compared with Blender's own evaluation at these times."""

import math
import os
import unittest
from unittest import mock

import cycles_comparison  # first: it sets the search path
import bpy
import export
import glb
import motion
import motion_gltf
import numpy
from cycles_comparison import eye, glow, lamp, shared
from mathutils import Matrix, Quaternion, Vector

FRAME = 6
_SIZES = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}
_BLENDER = Matrix(((1, 0, 0, 0), (0, 0, -1, 0), (0, 1, 0, 0), (0, 0, 0, 1)))  # from glTF's axes


class Played:
    """An exported file, played at the keys of its animation."""

    def __init__(self, path):
        self.document, self.buffer = glb.read(path)
        self.said = self.document["scenes"][0]["extras"]["caustique"]
        self.tracks = {}
        for animation in self.document.get("animations", []):
            for channel in animation["channels"]:
                sampler, target = animation["samplers"][channel["sampler"]], channel["target"]
                pointer = target.get("extensions", {}).get("KHR_animation_pointer", {}).get("pointer")
                values = self.numbers(sampler["output"])
                times = self.numbers(sampler["input"]).ravel()
                self.tracks[pointer or (self.document["nodes"][target["node"]]["name"], target["path"])] = (
                    times, values.reshape(len(times), -1))

    def numbers(self, index):
        entry = self.document["accessors"][index]
        view = self.document["bufferViews"][entry["bufferView"]]
        kind = {5126: "<f4", 5125: "<u4", 5123: "<u2", 5121: "u1"}[entry["componentType"]]
        start = view.get("byteOffset", 0) + entry.get("byteOffset", 0)
        count = entry["count"] * _SIZES[entry["type"]]
        return numpy.frombuffer(self.buffer, kind, count, start).reshape(entry["count"], -1)

    def keys(self, target):
        """The times of the keys of a track, in frames relative to the frame."""
        numerator, denominator = self.said["frame_rate"]
        return (self.tracks[target][0] - self.said["time"]) * numerator / denominator

    def value(self, target, time, otherwise):
        """The value of a track at a time (frames relative to the frame), or `otherwise` without a track."""
        if target not in self.tracks:
            return otherwise
        keys, values = self.keys(target), self.tracks[target][1]
        return [numpy.interp(time, keys, column) for column in values.T]

    def matrix(self, name, time):
        """The matrix of a node at a key, in Blender's axes."""
        node = next(node for node in self.document["nodes"] if node["name"] == name)
        place, turn, scale = (self.value((name, path), time, node.get(path, otherwise)) for path, otherwise in (
            ("translation", (0, 0, 0)), ("rotation", (0, 0, 0, 1)), ("scale", (1, 1, 1))))
        turn = Quaternion((turn[3], *turn[:3]))
        return _BLENDER @ Matrix.LocRotScale(Vector(place), turn, Vector(scale))

    def vertices(self, name, time):
        """Positions and normals of the mesh of a node at a key, (count, 6), in Blender's world."""
        found = []
        for node in self.document["nodes"]:
            if node["name"] != name:
                continue
            matrix, mesh = numpy.array(self.matrix(name, time)), self.document["meshes"][node["mesh"]]
            weights = self.value((name, "weights"), time, mesh.get("weights", ()))
            for part in mesh["primitives"]:
                names = [each for each in part["attributes"] if each.startswith("_")]
                assert not names, names
                parts = []
                for kind in ("POSITION", "NORMAL"):
                    values = self.numbers(part["attributes"][kind]).astype(float)
                    for weight, target in zip(weights, part.get("targets", ())):
                        values = values + weight * self.numbers(target[kind])
                    parts.append(values)
                normals = parts[1] @ numpy.linalg.inv(matrix[:3, :3])
                normals /= numpy.linalg.norm(normals, axis=1)[:, None]
                found.append(numpy.concatenate([parts[0] @ matrix[:3, :3].T + matrix[:3, 3], normals], axis=1))
        return numpy.concatenate(found)


def evaluated(name):
    """Positions and normals of the corners of an object in Blender's world at the present frame, (count, 6)."""
    found = []
    for instance in bpy.context.evaluated_depsgraph_get().object_instances:
        thing = instance.object
        matrix, mesh = numpy.array(instance.matrix_world), thing.data
        shown = instance.is_instance or instance.show_self
        if thing.original.name != name or thing.type != "MESH" or not shown or not mesh.polygons:
            continue
        places = numpy.array([v.co for v in mesh.vertices])[[loop.vertex_index for loop in mesh.loops]]
        normals = numpy.array([n.vector for n in mesh.corner_normals]) @ numpy.linalg.inv(matrix[:3, :3])
        normals /= numpy.linalg.norm(normals, axis=1)[:, None]
        found.append(numpy.concatenate([places @ matrix[:3, :3].T + matrix[:3, 3], normals], axis=1))
    return numpy.concatenate(found)


class Moving(cycles_comparison.CyclesComparison):
    """A scene with motion blur and helpers that animate it around frame 6."""

    def setUp(self):
        super().setUp()
        self.scene.render.use_motion_blur, self.scene.render.motion_blur_shutter = True, 0.5
        self.scene.frame_set(FRAME)

    def keyed(self, thing, path, first, last, frames=(1, 11)):
        """Move a property from `first` to `last`, with constant speed."""
        for frame, value in zip(frames, (first, last)):
            setattr(thing, path, value)
            thing.keyframe_insert(path, frame=frame)
        for curve in _curves(thing.id_data):
            for point in curve.keyframe_points:
                point.interpolation = "LINEAR"

    def written(self, **options):
        warnings = export.write(self.path, **options)
        self.warnings = [line for line in warnings if "its smooth shading leans" not in line]
        return Played(self.path)

    def body(self, name="body", smooth=True, **options):
        """A cube of two materials, with flat faces and, if `smooth`, three smooth ones."""
        body = shared.cube(glow("white", (1, 1, 1)))
        body.name, body.data.name = name, name
        body.data.materials.append(glow("red", (1, 0, 0)))
        body.data.attributes.new("_own", "FLOAT", "POINT")  # which Blender's exporter would write
        for k, face in enumerate(body.data.polygons):
            face.material_index, face.use_smooth = k % 2, smooth and k < 3
        for key, value in options.items():
            setattr(body, key, value)
        return body

    def shaped(self, name="body", smooth=True):
        body = self.body(name, smooth)
        body.shape_key_add(name="Basis")
        key = body.shape_key_add(name="wide")
        for point in key.data:
            point.co = point.co.x * 1.5 + 0.2 * point.co.y, point.co.y, point.co.z * (1 + point.co.x)
        self.keyed(key, "value", 0.0, 1.0)
        return body

    def agrees(self, *names, counts=(3,), deforms=False, **options):
        """Assert that exported vertices are Blender's at all keys, and that there are `counts` keys."""
        played = self.written(bake_size=0, **options)
        found = {target[0]: played.keys(target) for target in played.tracks if isinstance(target, tuple)}
        for name, count in zip(names, counts * len(names)):
            self.assertIn(name, found)
            self.assertEqual(len(found[name]), count, name)
            self.assertEqual((name, "weights") in played.tracks, deforms, name)
            for time in found[name]:
                moment = FRAME + time
                self.scene.frame_set(math.floor(moment), subframe=moment - math.floor(moment))
                self.close(played.vertices(name, time), evaluated(name), f"{name} at {time}")
            still = evaluated(name)
            self.scene.frame_set(FRAME)
            self.assertGreater(_farthest(still, evaluated(name)), 1e-2, name)  # a fault would be seen
        return played

    def close(self, ours, theirs, where):
        self.assertLess(max(_farthest(ours, theirs), _farthest(theirs, ours)), 1e-3, where)


def _curves(block):
    action = block.animation_data.action
    if not hasattr(action, "layers"):  # before Blender 4.4
        return action.fcurves
    bags = (bag for layer in action.layers for strip in layer.strips for bag in strip.channelbags)
    return [curve for bag in bags for curve in bag.fcurves]


def _farthest(some, others):
    """The largest distance of the rows of one array to the nearest row of the other."""
    return max(numpy.linalg.norm(others - row, axis=1).min() for row in some)


class Shutter(Moving):
    def test_position_and_length(self):
        """The shutter opens and closes as in Cycles, and the keys lie between."""
        self.keyed(self.body(), "location", (0, 0, 0), (1, 2, 3))
        for position, length, shutter in (
                ("CENTER", 0.5, [-0.25, 0.25]), ("START", 0.5, [0, 0.5]), ("END", 1.5, [-1.5, 0])):
            self.scene.render.motion_blur_position, self.scene.render.motion_blur_shutter = position, length
            played = self.written()
            self.assertEqual((self.warnings, played.said["shutter"]), ([], shutter))
            keys = played.keys(("body", "translation"))
            numpy.testing.assert_allclose(keys, (shutter[0], sum(shutter) / 2, shutter[1]), atol=1e-6)
            at = [played.matrix("body", time).translation.z for time in keys]
            numpy.testing.assert_allclose(at, (FRAME - 1 + keys) * 0.3, atol=1e-5)

    def test_switches(self):
        """Nothing moves without motion blur: of the scene, of a view layer, or of an object."""
        body = self.shaped()
        self.keyed(body, "location", (0, 0, 0), (1, 0, 0))
        moved, deformed = ("body", "translation"), ("body", "weights")
        self.assertEqual(set(self.written().tracks), {moved, deformed})
        body.cycles.use_deform_motion = False
        self.assertEqual(set(self.written().tracks), {moved})
        body.cycles.use_motion_blur = False
        self.assertEqual(self.written().tracks, {})
        self.assertEqual(self.written().said["shutter"], [-0.25, 0.25])
        body.cycles.use_motion_blur = True
        for owner in (self.scene.render, bpy.context.view_layer):
            owner.use_motion_blur = False
            played = self.written()
            self.assertEqual(played.tracks, {})
            self.assertNotIn("shutter", played.said)
            owner.use_motion_blur = True

    def test_steps(self):
        """An object has 2^steps + 1 keys; an instancer's steps hold for its instances."""
        body = self.body()
        body.cycles.motion_steps = 3
        self.keyed(body, "rotation_euler", (0, 0, 0), (0, 0, 30))
        self.agrees("body", counts=(9,))

    def test_losses_are_named(self):
        self.scene.cycles.rolling_shutter_type = "TOP"
        curve = self.scene.render.motion_blur_shutter_curve
        curve.curves[0].points[0].location[1] = 0.0
        self.written()
        said = "\n".join(self.warnings)
        self.assertIn('scene "Scene": its rolling shutter is not carried', said)
        self.assertIn('scene "Scene": its shutter curve is not carried', said)

    def test_faults_leave_objects_still(self):
        """Whatever fails, the object is exported, and a warning names it."""
        self.keyed(self.shaped(), "location", (0, 0, 0), (1, 0, 0))
        object_stands, shape_stands = "it stands still", "its shape stands still"
        for owner, name, said in (
                (motion.Recorder, "expect", object_stands), (motion.Recorder, "record", "nothing moves"),
                (motion.Shape, "see", shape_stands), (motion.Shape, "settle", shape_stands),
                (motion.Recorder, "follow", object_stands), (motion_gltf._Writer, "move", object_stands)):
            with self.subTest(name), mock.patch.object(owner, name, side_effect=ArithmeticError("odd")):
                played = self.written()
                self.assertNotIn(("body", "weights"), played.tracks)
                self.assertEqual([node["name"] for node in played.document["nodes"]], ["body"])
                self.assertEqual(len(self.warnings), 1)
                self.assertIn(f"(ArithmeticError: odd): {said} while the shutter is open", self.warnings[0])

    def test_the_scene_stays_at_its_frame(self):
        self.keyed(self.body(), "location", (0, 0, 0), (1, 0, 0))
        self.scene.frame_set(FRAME, subframe=0.25)
        played = self.written()
        self.assertEqual((self.scene.frame_current, self.scene.frame_subframe), (FRAME, 0.25))
        numpy.testing.assert_allclose(played.matrix("body", 0.0).translation.x, 0.525, atol=1e-5)

    def test_frames_of_an_animation(self):
        self.keyed(self.body(), "location", (0, 0, 0), (1, 0, 0))
        export.write_frames(os.path.join(self.folder, "shot.##.glb"), 0, 2)
        for frame, (opens, closes) in ((0, (0.0, 0.0)), (1, (0.0, 0.025)), (2, (0.075, 0.125))):
            played = Played(os.path.join(self.folder, f"shot.{frame:02}.glb"))
            self.assertEqual((played.said["frame"], played.said["shutter"]), (frame, [-0.25, 0.25]))
            at = [played.matrix("body", time).translation.x for time in (-0.25, 0.25)]
            numpy.testing.assert_allclose(at, (opens, closes), atol=1e-5)


class Objects(Moving):
    """Vertices of moving objects, at every key and in every position of Blender's own evaluation."""

    def test_transforms(self):
        """Location, rotation and mirrored scale; several turns, with enough steps."""
        body, spun = self.body(), self.body("spun")
        self.keyed(body, "location", (0, 0, 0), (1, 2, 3))
        self.keyed(body, "rotation_euler", (0, 1, 0), (3, 0, 5))
        self.keyed(body, "scale", (-1, 2, 1), (-2, 2.5, 0.5))
        self.keyed(spun, "rotation_euler", (0, 0, 0), (0, 0, 200))
        spun.cycles.motion_steps = 3
        self.agrees("body", "spun", counts=(3, 9))

    def test_shear_moves_vertices(self):
        parent = shared.place("parent", None)
        parent.scale = (1, 2, 1)
        self.keyed(parent, "rotation_euler", (0, 0, 0), (0, 0, 3))
        for name in ("body", "other"):
            body = self.body(name, smooth=False, parent=parent)
            self.keyed(body, "rotation_euler", (0, 0, 0), (2, 0, 1))
        self.agrees("body", "other", deforms=True)

    def test_shear_that_stays(self):
        parent = shared.place("parent", None)
        parent.scale = (1, 2, 1)
        self.keyed(parent, "location", (0, 0, 0), (0, 1, 3))
        self.body(smooth=False, parent=parent, rotation_euler=(0.3, 0, 0.7))
        self.agrees("body")

    def test_scale_below_bumps(self):
        body = self.shaped(smooth=False)
        body.scale = (2, -1, 3)
        tree = body.data.materials[0].node_tree
        shader, bump = tree.nodes.new("ShaderNodeBsdfDiffuse"), tree.nodes.new("ShaderNodeBump")
        tree.links.new(tree.nodes.new("ShaderNodeTexNoise").outputs[0], bump.inputs["Height"])
        tree.links.new(bump.outputs[0], shader.inputs["Normal"])
        tree.links.new(shader.outputs[0], next(n for n in tree.nodes if n.type == "OUTPUT_MATERIAL").inputs[0])
        self.keyed(body, "rotation_euler", (0, 0, 0), (0, 3, 0))
        self.agrees("body", deforms=True)

    def test_instances(self):
        """Collection instances move as their instancers, with the mesh of the original."""
        collection = bpy.data.collections.new("many")
        body = self.shaped()
        self.scene.collection.objects.unlink(body)
        collection.objects.link(body)
        self.keyed(body, "location", (0, 0, 0), (1, 0, 0))
        for k, steps in enumerate((1, 2)):
            instancer = shared.place(f"instancer {k}", None, (3 * k, 0, 0))
            instancer.instance_type, instancer.instance_collection = "COLLECTION", collection
            instancer.cycles.motion_steps = steps
            self.keyed(instancer, "rotation_euler", (0, 0, k), (1, 0, 0))
        played = self.written()
        nodes = [i for i, node in enumerate(played.document["nodes"]) if node["name"] == "body"]
        channels = played.document["animations"][0]["channels"]
        moved = {(c["target"]["node"], c["target"]["path"]) for c in channels}
        self.assertEqual(moved, {(i, path) for i in nodes for path in ("translation", "rotation", "weights")})
        self.assertEqual(len(nodes), 2)
        samplers = played.document["animations"][0]["samplers"]
        self.assertEqual({len(played.numbers(sampler["input"])) for sampler in samplers}, {3, 5})
        self.assertEqual(len({node["mesh"] for node in played.document["nodes"] if "mesh" in node}), 1)


class Shapes(Moving):
    def test_shape_keys(self):
        self.keyed(self.shaped(), "location", (0, 0, 0), (1, 0, 0))
        self.shaped("other").modifiers.new("fine", "SUBSURF").levels = 2
        self.agrees("body", "other", deforms=True)

    def test_armature(self):
        bones = bpy.data.armatures.new("rig")
        rig = shared.place("rig", bones)
        bpy.context.view_layer.objects.active = rig
        bpy.ops.object.mode_set(mode="EDIT")
        bone = bones.edit_bones.new("bone")
        bone.head, bone.tail = (1, 1, 0), (1, 1, 1)
        bpy.ops.object.mode_set(mode="OBJECT")
        body = self.body()
        body.vertex_groups.new(name="bone").add(range(4), 1.0, "REPLACE")
        body.modifiers.new("rig", "ARMATURE").object = rig
        pose = rig.pose.bones["bone"]
        pose.rotation_mode = "XYZ"
        self.keyed(pose, "rotation_euler", (0, 0, 0), (1.5, 0, 1))
        self.agrees("body", deforms=True)

    def test_flat_faces_that_bend(self):
        """Faces that lie in one plane at the frame, and bend before and after, keep normals of their own."""
        mesh = bpy.data.meshes.new("strip")
        mesh.from_pydata([(x, y, 0) for x in (-1, 0, 1) for y in (0, 1)], [], [(0, 2, 3, 1), (2, 4, 5, 3)])
        mesh.materials.append(glow("white", (1, 1, 1)))
        body = shared.place("body", mesh)
        body.shape_key_add(name="Basis")
        key = body.shape_key_add(name="bent")
        key.data[4].co.z = key.data[5].co.z = 5.0
        key.slider_min = -1.0
        self.keyed(key, "value", -1.0, 1.0)
        self.agrees("body", deforms=True)

    def test_modifiers_curves_and_geometry_nodes(self):
        wave = self.body("wave")
        wave.modifiers.new("fine", "SUBSURF").levels = 2
        wave.modifiers.new("wave", "WAVE").speed = 0.5
        curve = bpy.data.curves.new("curve", "CURVE")
        curve.dimensions, spline = "3D", curve.splines.new("POLY")
        spline.points.add(1)
        spline.points[1].co = (1, 1, 1, 1)
        shared.place("curve", curve)
        self.keyed(curve, "bevel_depth", 0.1, 0.6)
        self.by_nodes("nodes")
        self.agrees("wave", "curve", "nodes", deforms=True)

    def by_nodes(self, name, instances=False):
        """A cube that geometry nodes move in time, itself or as instances of itself."""
        body = self.body(name)
        tree = bpy.data.node_groups.new(name, "GeometryNodeTree")
        tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
        tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
        come, go = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
        time, place = tree.nodes.new("GeometryNodeInputSceneTime"), tree.nodes.new("ShaderNodeCombineXYZ")
        tree.links.new(time.outputs["Frame"], place.inputs["X"])
        if instances:
            points, on = tree.nodes.new("GeometryNodePoints"), tree.nodes.new("GeometryNodeInstanceOnPoints")
            points.inputs["Count"].default_value = 2
            tree.links.new(place.outputs[0], points.inputs["Position"])
            tree.links.new(points.outputs[0], on.inputs["Points"])
            tree.links.new(come.outputs[0], on.inputs["Instance"])
            last = on
        else:
            last = tree.nodes.new("GeometryNodeSetPosition")
            tree.links.new(come.outputs[0], last.inputs["Geometry"])
            tree.links.new(place.outputs[0], last.inputs["Offset"])
        tree.links.new(last.outputs[0], go.inputs[0])
        body.modifiers.new("nodes", "NODES").node_group = tree
        return body

    def test_instances_of_geometry_nodes(self):
        self.by_nodes("nodes", instances=True)
        self.agrees("nodes")

    def test_baked_materials(self):
        """Morph targets fit the mesh that baking cuts into pieces."""
        body = self.shaped()
        tree = body.data.materials[0].node_tree
        shader = tree.nodes.new("ShaderNodeBsdfDiffuse")
        tree.links.new(tree.nodes.new("ShaderNodeTexNoise").outputs["Color"], shader.inputs["Color"])
        tree.links.new(shader.outputs[0], next(n for n in tree.nodes if n.type == "OUTPUT_MATERIAL").inputs[0])
        played = self.written(bake_size=16)
        self.assertIn("images", played.document)
        for time in (-0.25, 0.25):
            self.scene.frame_set(FRAME - (time < 0), subframe=time % 1)
            self.close(played.vertices("body", time), evaluated("body"), time)

    def changing(self, velocity):
        """A body whose faces change between frames, with or without a velocity of 24 m/s along x."""
        body = self.body()
        body.modifiers.new("fine", "SUBSURF").levels = 1
        array = body.modifiers.new("array", "ARRAY")
        self.scene.frame_set(FRAME)
        self.keyed(array, "count", 1, 21, frames=(FRAME, FRAME + 1))
        if velocity:
            layer = body.data.attributes.new("velocity", "FLOAT_VECTOR", "POINT")
            layer.data.foreach_set("vector", [24.0, 0.0, 0.0] * len(body.data.vertices))
        self.keyed(body, "location", (0, 0, 0), (0, 10, 0))
        self.scene.frame_set(FRAME)

    def test_changing_faces_are_named(self):
        self.changing(velocity=False)
        played = self.written()
        self.assertEqual(set(played.tracks), {("body", "translation")})
        self.assertEqual(len(self.warnings), 1)
        self.assertIn('object "body": its faces change while the shutter is open, and it has no attribute velocity: its '
                      "shape stands still while the shutter is open; switch on Speed Vectors", self.warnings[0])

    def test_changing_faces_move_by_their_velocity(self):
        self.changing(velocity=True)
        played = self.written()
        self.assertEqual(self.warnings, [])
        numpy.testing.assert_allclose(played.keys(("body", "weights")), (-0.25, 0, 0.25), atol=1e-6)
        before, now, after = (played.vertices("body", time)[:, :2].mean(0) for time in (-0.25, 0, 0.25))
        numpy.testing.assert_allclose((now - before, after - now), [(0.25, 0.25)] * 2, atol=1e-4)


class LightsAndCameras(Moving):
    def test_cameras(self):
        """Position and direction, whatever the camera's scale, angle, size and focus."""
        focus = shared.place("focus", None, (0, 0, -3))
        self.keyed(focus, "location", (0, 0, -3), (0, 0, -8))
        body = eye((0, 0, 1), (0, 0, 0), lens=30)
        body.scale, body.data.dof.use_dof, body.data.dof.focus_object = (2, 1, 3), True, focus
        self.keyed(body, "location", (0, 0, 1), (1, 2, 3))
        self.keyed(body, "rotation_euler", (0, 0, 0), (0.5, 0, 1))
        self.keyed(body.data, "lens", 20, 60)
        played = self.written()
        self.assertEqual(self.warnings, [])
        self.assertIn("KHR_animation_pointer", played.document["extensionsUsed"])
        node = next(i for i, node in enumerate(played.document["nodes"]) if node["name"] == "eye")
        said = f"/nodes/{node}/extras/caustique"
        for time in (-0.25, 0, 0.25):
            self.scene.frame_set(FRAME - (time < 0), subframe=time % 1)
            matrix = body.matrix_world.normalized()
            numpy.testing.assert_allclose(played.matrix("eye", time), matrix, atol=1e-5)
            angle = played.value("/cameras/0/perspective/yfov", time, None)
            numpy.testing.assert_allclose(angle, body.data.angle, rtol=1e-5)
            away = matrix.col[2].dot(matrix.translation.to_4d() - focus.matrix_world.translation.to_4d())
            numpy.testing.assert_allclose(played.value(said + "/focus_distance", time, None), abs(away), rtol=1e-5)
            radius = body.data.lens * 1e-3 / 2 / body.data.dof.aperture_fstop
            numpy.testing.assert_allclose(played.value(said + "/aperture_radius", time, None), radius, rtol=1e-5)

    def test_skewed_cameras(self):
        """Cameras below uneven scale keep their line of sight and the direction up, as in Cycles."""
        parent = shared.place("parent", None)
        parent.scale = (1, 3, 1)
        body = eye((0, 0, 5), (0, 0, 0))
        body.parent = parent
        self.keyed(body, "rotation_euler", (0, 0, 0), (1, 0.5, 1))
        played = self.written()
        for time in (-0.25, 0, 0.25):
            self.scene.frame_set(FRAME - (time < 0), subframe=time % 1)
            back, up = (body.matrix_world.col[k].xyz.normalized() for k in (2, 1))
            ours = played.matrix("eye", time)
            numpy.testing.assert_allclose(ours.col[2].xyz, back, atol=1e-5)
            self.assertAlmostEqual(ours.col[0].xyz.dot(up), 0.0, 5)

    def test_orthographic_and_hidden_cameras(self):
        body = eye((0, 0, 5), (0, 0, 0), type="ORTHO")
        body.hide_render = True
        self.keyed(body, "location", (0, 0, 5), (1, 0, 5))
        self.keyed(body.data, "ortho_scale", 2, 12)
        played = self.written()
        for name in ("xmag", "ymag"):
            sizes = [played.value(f"/cameras/0/orthographic/{name}", time, None)[0] for time in (-0.25, 0, 0.25)]
            numpy.testing.assert_allclose(sizes, (3.375, 3.5, 3.625), rtol=1e-5)
        self.assertIn(("eye", "translation"), played.tracks)

    def test_lights(self):
        """Lamps with their directions, and the meshes of area lamps."""
        for kind in ("POINT", "SPOT", "SUN", "AREA"):
            body = lamp(kind, (0, 0, 1), 10.0)
            self.keyed(body, "location", (0, 0, 1), (1, 2, 3))
            self.keyed(body, "rotation_euler", (0, 0, 0), (1, 0, 2))
        played = self.written()
        for time in (-0.25, 0, 0.25):
            self.scene.frame_set(FRAME - (time < 0), subframe=time % 1)
            for name in ("point", "spot", "sun", "area"):
                ours = played.matrix(name, time) if name != "area" else (
                    played.matrix("area (area light)", time) @ _BLENDER.inverted())  # a mesh, in other axes
                theirs = bpy.data.objects[name].matrix_world
                numpy.testing.assert_allclose(ours, theirs, atol=1e-5, err_msg=f"{name} at {time}")


if __name__ == "__main__":
    unittest.main()
