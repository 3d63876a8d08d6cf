"""What the exporter makes of whole scenes, rendered by caustique beside Cycles. Needs bpy and the program."""

import contextlib
import io
import math
import os
import tempfile
import unittest

import blender_export as shared  # first: it finds the scripts
import bpy
import export
import glb
import numpy
import support
from mathutils import Matrix, Vector


def glow(name, color):
    """A material that gives off a radiance and reflects nothing."""
    return shared.node_material(name, "ShaderNodeEmission", Color=(*color, 1), Strength=1.0)


def square(material, half=0.4, name="square"):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([(-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0)], [], [(0, 1, 2, 3)])
    mesh.materials.append(material)
    return mesh


def lamp(kind, at, energy, **values):
    """A lamp that shines down, its settings by name."""
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


class Scene(unittest.TestCase):
    def setUp(self):
        bpy.ops.wm.read_factory_settings(use_empty=True)
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = folder.name
        self.path = os.path.join(self.folder, "scene.glb")
        self.scene = bpy.context.scene
        self.scene.render.resolution_x = self.scene.render.resolution_y = 32

    def cycles(self, samples=256):
        """What Cycles sees, rows from the bottom."""
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
        """What caustique sees of the exported scene."""
        self.warnings = export.write(self.path)
        out = os.path.join(self.folder, "caustique.exr")
        support.run(["render", self.path, "-o", out, "--iterations", iterations, "--no-combine", "--progress", "none",
                     "--layers", "beauty", *options], check=0)
        return shared.pixels(out)

    def alike(self, ours, theirs, tolerance=0.02, parts=2):
        """The pictures' means, also of each of `parts` x `parts` tiles, differ by no more than this share."""
        self.assertEqual(ours.shape, theirs.shape)
        self.assertGreater(theirs.mean(), 1e-3)
        height, width, _ = ours.shape

        def tiles(picture):
            return picture.reshape(parts, height // parts, parts, width // parts, 3).mean((1, 3))

        numpy.testing.assert_allclose(ours.mean((0, 1)), theirs.mean((0, 1)), rtol=tolerance)
        numpy.testing.assert_allclose(tiles(ours), tiles(theirs), rtol=2 * tolerance, atol=1e-4)

    def silhouettes_agree(self, ours, theirs):
        """But for pixels on edges the pictures are the same: those that differ are fewer than one in fifty."""
        self.assertEqual(ours.shape, theirs.shape)
        differ = (abs(ours - theirs) > 0.2).any(-1)
        self.assertLess(differ.mean(), 0.02, f"rows, columns: {numpy.argwhere(differ)[:20].tolist()}")
        self.assertGreater((theirs > 0.3).any(-1).mean(), 0.03)

    def floor(self, half=3.0, color=(0.8, 0.8, 0.8)):
        grey = shared.node_material("grey", "ShaderNodeBsdfDiffuse", Color=(*color, 1))
        return shared.place("floor", square(grey, half, "floor"))


class Geometry(Scene):
    def put(self, name, x, y, color, mesh=None, collection=None):
        body = bpy.data.objects.new(name, mesh or square(glow(name, color)))
        (collection or self.scene.collection).objects.link(body)
        body.location = (x, y, 0)
        return body

    def collection(self, name, parent=None):
        made = bpy.data.collections.new(name)
        if parent is None:
            self.scene.collection.children.link(made)
        return made

    def look(self, size=8):
        self.scene.render.resolution_x = self.scene.render.resolution_y = 64
        eye((size / 2 - 0.5, size / 2 - 0.5, 5), (size / 2 - 0.5, size / 2 - 0.5, 0), type="ORTHO", ortho_scale=size)

    def test_what_renders_show(self):
        """Visibility in renders, not in the viewport, of objects, parents, collections and modifiers."""
        hidden = bpy.data.objects.new("parent", None)
        self.scene.collection.objects.link(hidden)
        hidden.location, hidden.hide_viewport = (1, 0, 0), True
        self.put("child of what is hidden", 0, 0, (1, 0, 0)).parent = hidden
        self.put("hidden in the viewport", 2, 0, (0, 1, 0)).hide_viewport = True
        self.put("hidden by its eye", 3, 0, (0, 0, 1)).hide_set(True)
        self.put("hidden in renders", 4, 0, (1, 1, 1)).hide_render = True
        for x, name in enumerate(("excluded", "not rendered", "its eye closed", "off in the viewport")):
            self.put("in " + name, x, 1, (1, 1, 0), collection=self.collection(name))
        layers = bpy.context.view_layer.layer_collection.children
        layers["excluded"].exclude = True
        bpy.data.collections["not rendered"].hide_render = True
        layers["its eye closed"].hide_viewport = True
        bpy.data.collections["off in the viewport"].hide_viewport = True
        array = self.put("in renders twice", 0, 2, (0, 1, 1)).modifiers.new("array", "ARRAY")
        array.count, array.show_viewport, array.use_relative_offset = 2, False, False
        array.use_constant_offset, array.constant_offset_displace = True, (1, 0, 0)
        once = self.put("in renders once", 3, 2, (1, 0, 1)).modifiers.new("array", "ARRAY")
        once.count, once.show_render = 3, False
        self.look(6)
        self.silhouettes_agree(self.caustique(16), self.cycles(16))
        self.assertTrue(hidden.hide_viewport and layers["its eye closed"].hide_viewport and not array.show_viewport)

    def test_instances(self):
        """Of collections, vertices, faces and geometry nodes, nested and mirrored, each in its place."""
        inner = self.collection("inner", parent=False)
        self.put("red", 0.1, 0, (1, 0, 0), collection=inner)
        for x, scale in ((0, 1), (1.5, -0.5)):
            empty = bpy.data.objects.new("instance", None)
            self.scene.collection.objects.link(empty)
            empty.instance_type, empty.instance_collection = "COLLECTION", inner
            empty.location, empty.scale = (x, 0, 0), (scale, 1, 1)
        points = bpy.data.meshes.new("points")
        points.from_pydata([(0, 0, 0), (1.2, 0.5, 0), (2.4, 0, 0)], [], [])
        plant = self.put("plants", 0, 2, (0, 0, 0), points)
        plant.instance_type = "VERTS"
        self.put("plant", 0, 2, (0, 1, 0)).parent = plant
        nodes = self.put("nodes", 3.5, 2.5, (0, 0, 0), points.copy())
        self.instance_on_points(nodes, self.put("by nodes", 9, 9, (0, 0, 1)), None)
        raw = self.put("raw", 3, 1, (0, 0, 0), points.copy())
        self.instance_on_points(raw, None, glow("made by nodes", (1, 1, 0)))
        self.look(7)
        self.silhouettes_agree(self.caustique(16), self.cycles(16))
        self.assertEqual(self.warnings, [])
        document = glb.read(self.path)[0]
        uses = [node["mesh"] for node in document["nodes"] if node["name"] == "plant"]
        self.assertEqual((len(uses), len(set(uses))), (3, 1), "instances share their mesh")
        self.assertEqual({node["name"] for node in document["nodes"]}, {"red", "plant", "by nodes", "raw", "eye"})

    def instance_on_points(self, body, thing, material):
        tree = bpy.data.node_groups.new("instances", "GeometryNodeTree")
        for way in ("INPUT", "OUTPUT"):
            tree.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
        nodes = {kind: tree.nodes.new(kind) for kind in ("NodeGroupInput", "NodeGroupOutput",
                                                         "GeometryNodeInstanceOnPoints")}
        on_points = nodes["GeometryNodeInstanceOnPoints"]
        tree.links.new(nodes["NodeGroupInput"].outputs[0], on_points.inputs["Points"])
        if thing is not None:
            of = tree.nodes.new("GeometryNodeObjectInfo")
            of.inputs["Object"].default_value, of.inputs["As Instance"].default_value = thing, True
            tree.links.new(of.outputs["Geometry"], on_points.inputs["Instance"])
            on_points.inputs["Rotation"].default_value = (0, 0, 0.5)
        else:
            grid, worn = tree.nodes.new("GeometryNodeMeshGrid"), tree.nodes.new("GeometryNodeSetMaterial")
            worn.inputs["Material"].default_value = material
            tree.links.new(grid.outputs["Mesh"], worn.inputs["Geometry"])
            tree.links.new(worn.outputs[0], on_points.inputs["Instance"])
        tree.links.new(on_points.outputs[0], nodes["NodeGroupOutput"].inputs[0])
        body.modifiers.new("nodes", "NODES").node_group = tree

    def test_the_current_frame(self):
        """Moving objects, materials, shape keys, cameras and armatures as they are at frame 10; sheared ones, too."""
        moving = self.put("moving", 0, 0, (1, 0, 0))
        for frame, x in ((1, 0), (20, 4)):
            moving.location.x = x
            moving.keyframe_insert("location", frame=frame)
        changing = self.put("changing", 0, 2, (0, 1, 0))
        strength = next(n for n in changing.data.materials[0].node_tree.nodes if n.type == "EMISSION").inputs["Strength"]
        for frame, value in ((1, 0.0), (10, 1.0), (20, 0.0)):
            strength.default_value = value
            strength.keyframe_insert("default_value", frame=frame)
        keyed = self.put("keyed", 2, 2, (0, 0, 1))
        keyed.shape_key_add(name="Basis")
        key = keyed.shape_key_add(name="wide")
        for point in key.data:
            point.co.x *= 2
        key.value = 1.0
        parent = self.put("parent", 2, 4, (1, 1, 0))
        parent.scale = (2, 0.5, 1)
        child = self.put("sheared", 0, 1, (0, 1, 1))
        child.parent, child.rotation_euler = parent, (0, 0, 0.7)
        self.look(6)
        camera = self.scene.camera
        for frame, x in ((1, 0.0), (20, 4.0)):
            camera.location.x = x
            camera.keyframe_insert("location", frame=frame)
        self.scene.frame_set(10)
        self.silhouettes_agree(self.caustique(16), self.cycles(16))
        self.assertEqual(self.scene.frame_current, 10)

    def test_curves_and_text(self):
        """Curves and text at the resolution of renders, with the materials of their objects."""
        for x, kind in ((0, "FONT"), (2, "CURVE")):
            curve = bpy.data.curves.new(kind, kind)
            if kind == "FONT":
                curve.body = "ab"
            else:
                curve.dimensions, curve.fill_mode = "2D", "BOTH"
                spline = curve.splines.new("BEZIER")
                spline.bezier_points.add(1)
                spline.use_cyclic_u = True
                for point, at in zip(spline.bezier_points, ((0, 0, 0), (2, 2, 0))):
                    point.co, point.handle_left_type, point.handle_right_type = at, "AUTO", "AUTO"
                curve.resolution_u, curve.render_resolution_u = 1, 32
            body = self.put(kind, x, 0.2, (1, 1, 1), curve)
            body.scale = (2, 2, 1)
            curve.materials.append(glow("of the data", (1, 0, 0)))
            if kind == "CURVE":
                body.material_slots[0].link = "OBJECT"
                body.material_slots[0].material = glow("of the object", (0, 1, 0))
        self.look(5)
        self.silhouettes_agree(self.caustique(16), self.cycles(16))

    def test_nothing_is_left_behind(self):
        self.test_instances()
        blocks = {kind: len(getattr(bpy.data, kind)) for kind in ("objects", "meshes", "scenes", "materials", "lights",
                                                                   "cameras", "collections", "images")}
        lamp("AREA", (0, 0, 3), 10)
        blocks["objects"] += 1
        blocks["lights"] += 1
        export.write(self.path)
        self.assertEqual(blocks, {kind: len(getattr(bpy.data, kind)) for kind in blocks})
        self.assertEqual(bpy.context.scene, self.scene)


class Lamps(Scene):
    def test_area_lamps_hide_and_let_light_through(self):
        """A camera above an area lamp sees the floor below, which a sky lights past the lamp; and so does one below."""
        self.floor()
        lamp("AREA", (0, 0, 1), 20, size=2.0)
        world = bpy.data.worlds.new("world")
        if bpy.app.version < (5, 0, 0):
            world.use_nodes = True
        next(n for n in world.node_tree.nodes if n.type == "BACKGROUND").inputs["Color"].default_value = (1, 0.5, 0.2, 1)
        self.scene.world = world
        for at in ((0.3, 0.2, 3), (0.4, 2.0, 0.5)):
            eye(at, (0, 0, 0), lens=40)
            theirs = self.cycles()
            self.alike(self.caustique(), theirs)
            self.assertEqual(self.warnings, [])

    def test_area_lamps_spread(self):
        self.floor()
        eye((0, -2.5, 2.5), (0, 0, 0), lens=35)
        for degrees in (20, 60, 120):
            body = lamp("AREA", (0.3, 0, 2), 100, size=0.5, spread=math.radians(degrees))
            self.alike(self.caustique(), self.cycles())
            self.assertEqual(self.warnings, [])
            bpy.data.objects.remove(body)

    def test_spots_have_blenders_edge_and_size(self):
        self.floor()
        for blend, radius in ((0.0, 0.0), (1.0, 0.0), (0.5, 0.2)):
            body = lamp("SPOT", (0.3, 0, 2), 100, spot_size=1.2, spot_blend=blend, shadow_soft_size=radius)
            screen = shared.place("screen", square(bpy.data.materials["grey"], 0.25), (0.5, 0, 1))
            eye((0, -2.5, 2.5), (0.3, 0, 0), lens=45)
            theirs = self.cycles()
            ours = self.caustique()
            self.alike(ours, theirs, parts=1)
            for thing in (body, screen):
                bpy.data.objects.remove(thing)

    def test_lamps_of_all_colours(self):
        """Blackbody nodes, temperatures, exposures and plain colours of points and suns."""
        self.floor()
        eye((0, -3, 3), (0, 0, 0), lens=35)
        body = lamp("POINT", (0, 0, 2), 50, shadow_soft_size=0.1, use_soft_falloff=False)
        light = body.data
        if bpy.app.version < (5, 0, 0):
            light.use_nodes = True
        tree = light.node_tree
        node = next((n for n in tree.nodes if n.type == "EMISSION"), None)
        warm = tree.nodes.new("ShaderNodeBlackbody")
        warm.inputs["Temperature"].default_value = 2700
        tree.links.new(warm.outputs[0], node.inputs["Color"])
        self.alike(self.caustique(), self.cycles(), parts=1)
        self.assertEqual(self.warnings, [])
        tree.links.remove(node.inputs["Color"].links[0])
        light.use_temperature, light.temperature, light.exposure = True, 9000, 1.0
        self.alike(self.caustique(), self.cycles(), parts=1)
        bpy.data.objects.remove(body)
        body = lamp("SUN", (0, 0, 2), 2.0, angle=0.3, color=(1, 0.5, 0.25))
        body.rotation_euler = (0.5, 0.2, 0)
        self.alike(self.caustique(), self.cycles(), parts=1)

    def test_a_sun_in_the_sky_is_a_lamp(self):
        self.floor()
        world = bpy.data.worlds.new("world")
        if bpy.app.version < (5, 0, 0):
            world.use_nodes = True
        tree = world.node_tree
        sky = tree.nodes.new("ShaderNodeTexSky")
        if bpy.app.version < (5, 0, 0):
            sky.sky_type = "NISHITA"
        sky.sun_elevation, sky.sun_rotation, sky.sun_size = 0.6, 2.0, math.radians(2)
        background = next(n for n in tree.nodes if n.type == "BACKGROUND")
        background.inputs["Strength"].default_value = 0.3
        tree.links.new(sky.outputs[0], background.inputs["Color"])
        self.scene.world = world
        shared.place("post", square(bpy.data.materials["grey"], 0.3), (0, 0, 0.5))
        eye((0, -3, 3), (0, 0, 0), lens=45)
        theirs = self.cycles()
        self.alike(self.caustique(), theirs)
        self.assertTrue(sky.sun_disc)
        document = glb.read(self.path)[0]
        node = next(node for node in document["nodes"] if node["name"] == "sky's sun")
        self.assertAlmostEqual(node["extras"]["caustique"]["angle_deg"], 2, 4)

    def test_losses_of_lamps_are_named(self):
        self.floor()
        eye((0, -3, 3), (0, 0, 0))
        lamp("POINT", (0, 0, 0.5), 10, shadow_soft_size=0.2)
        lamp("AREA", (1, 0, 1), 10).visible_glossy = False
        spot = lamp("SPOT", (0, 1, 9), 10, shadow_soft_size=0.0)
        spot.scale = (2, 1, 1)
        if bpy.app.version < (5, 0, 0):
            spot.data.use_nodes = True
        tree = spot.data.node_tree
        profile = tree.nodes.new("ShaderNodeTexIES")
        node = next(n for n in tree.nodes if n.type == "EMISSION")
        tree.links.new(profile.outputs[0], node.inputs["Strength"])
        warnings = "\n".join(export.write(self.path))
        for what in ('light "point": its soft falloff is not carried', 'light "area": it is hidden from glossy rays',
                     'light "spot": a spot\'s uneven scale', 'its IES profile'):
            self.assertIn(what, warnings)
        lamp("AREA", (0, 0, 2), 1000).data.cycles.is_portal = True
        export.write(self.path)
        self.assertEqual(sum("area light" in m["name"] for m in glb.read(self.path)[0]["materials"]), 1, "portals are dark")


class Pictures(Scene):
    def test_shift_and_size(self):
        """Lens shift of wide and tall, perspective and orthographic pictures, at the size of the scene."""
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

    def test_the_picture_is_told(self):
        self.floor()
        eye((0, -3, 3), (0, 0, 0), clip_start=1.0, clip_end=4.0)
        scene = self.scene
        scene.render.use_border, scene.render.border_min_x, scene.render.border_max_y = True, 0.25, 0.5
        scene.render.film_transparent, scene.cycles.film_exposure = True, 4.0
        scene.view_settings.view_transform, scene.view_settings.exposure = "Standard", -1.0
        warnings = "\n".join(export.write(self.path))
        said = glb.read(self.path)[0]["scenes"][0]["extras"]["caustique"]
        self.assertEqual(said["resolution"], [32, 32])
        numpy.testing.assert_allclose(said["crop"], (0.25, 0.5, 0.75, 0.5), atol=1e-6)
        self.assertEqual((said["exposure"], said["tonemap"], said["film_transparent"]), (1.0, "srgb", True))
        self.assertIn('object "floor" is seen, also beyond its clip end of 4 m', warnings)
        self.assertNotIn("clip start", warnings)
        self.assertIn("film exposure of 4", warnings)

    def test_losses_travel(self):
        """What the exporter names is repeated by info, plan, render and the picture, and --strict stops at it."""
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
        """They light the scene and cast shadows, and cameras look through them; so do what is indirect only."""
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

    def test_frames(self):
        body = self.floor()
        for frame, x in ((1, 0.0), (3, 2.0)):
            body.location.x = x
            body.keyframe_insert("location", frame=frame)
        self.scene.frame_set(1)
        export.write_frames(os.path.join(self.folder, "shot.###.glb"), 2, 3)
        self.assertEqual(self.scene.frame_current, 1)
        places = [glb.read(os.path.join(self.folder, f"shot.00{n}.glb"))[0]["nodes"][0]["translation"][0] for n in (2, 3)]
        numpy.testing.assert_allclose(places, (1, 2), atol=0.3)
        for wrong in (["out.glb", "--frames", "1-2"], ["o.##.glb", "--frames", "2-1"], ["o.##.glb", "--frames", "two"]):
            with self.assertRaises(SystemExit) as stopped, contextlib.redirect_stderr(io.StringIO()):
                export.main(wrong)
            self.assertEqual(stopped.exception.code, 2)


del Scene  # the tests above have it; by itself it has none

if __name__ == "__main__":
    unittest.main()
