"""Exported lamps and skies, compared with Cycles."""

import json
import math
import os
import unittest

import cycles_comparison  # first: it sets the search path
import bpy
import export
import glb
import numpy
import support
from cycles_comparison import eye, glow, lamp, shared, square
from mathutils import Vector


def background(world):
    """The Background node of a world."""
    return next(node for node in world.node_tree.nodes if node.type == "BACKGROUND")


class Lamps(cycles_comparison.CyclesComparison):
    def world(self, color=None):
        """Gives the scene a new world with a background of this colour."""
        world = self.scene.world = bpy.data.worlds.new("world")
        if bpy.app.version < (5, 0, 0):
            world.use_nodes = True
        if color is not None:
            background(world).inputs["Color"].default_value = color
        return world

    def test_area_lamps_hide_and_let_light_through(self):
        """A camera above an area lamp sees the floor below it, which a sky lights through the lamp; so does one
        below."""
        self.floor()
        lamp("AREA", (0, 0, 1), 20, size=2.0)
        self.world((1, 0.5, 0.2, 1))
        for at in ((0.3, 0.2, 3), (0.4, 2.0, 0.5)):
            eye(at, (0, 0, 0), lens=40)
            theirs = self.cycles()
            self.alike(self.caustique(), theirs)
            self.assertEqual(self.warnings, [])

    def test_light_linking(self):
        """Lamps of all kinds and emissive meshes name the collections that receive or block their light; children of a
        linking collection have a state each, and copies of a collection are in those of their instancer."""
        self.floor()
        bodies = {name: shared.place(name, square(glow(name, (0, 0, 0)), 0.2), (0, 0, 0.5)) for name in "abcd"}
        linked, child, pair = (bpy.data.collections.new(name) for name in ("linked", "child", "pair"))
        linked.objects.link(bodies["a"])
        linked.children.link(child)
        for name in "bc":
            child.objects.link(bodies[name])
        linked.collection_children[0].light_linking.link_state = "EXCLUDE"
        pair.objects.link(bodies["d"])
        copies = bpy.data.objects.new("copies", None)
        copies.instance_type, copies.instance_collection = "COLLECTION", pair
        self.scene.collection.objects.link(copies)
        child.objects.link(copies)
        glowing = shared.place("glowing", square(glow("bright", (1, 1, 1)), 0.2), (0, 1, 0.5))
        for thing in (lamp("AREA", (0, 0, 1), 20), lamp("POINT", (1, 0, 1), 20), lamp("SUN", (1, 0, 1), 20), glowing):
            thing.light_linking.receiver_collection = thing.light_linking.blocker_collection = linked
        warnings = export.write(self.path)
        self.assertFalse([line for line in warnings if "link" in line], warnings)
        nodes = glb.read(self.path)[0]["nodes"]
        said = [(node["name"], node.get("extras", {}).get("caustique", {})) for node in nodes]
        lights = {name for name, keys in said if keys.get("receivers") == keys.get("blockers")
                  == {"include": ["linked"], "exclude": ["linked (excluded)"]}}
        self.assertEqual({name.replace(".", " ").split()[0].lower() for name in lights}, {"area", "point", "sun", "glowing"})
        sets = sorted((name, *keys["collections"]) for name, keys in said if "collections" in keys)
        self.assertEqual(sets, [("a", "linked"), ("b", "linked (excluded)"), ("c", "linked (excluded)"),
                                ("d", "linked (excluded)")])

    def test_light_groups(self):
        """Lamps, emissive meshes, their instances and the world have their light group, if the view layer has it."""
        self.floor()
        eye((0, -2.5, 2.5), (0, 0, 0), lens=35)
        for name in ("key", "Sky light"):
            bpy.ops.scene.view_layer_add_lightgroup(name=name)
        lamp("AREA", (0, 0, 1), 20, size=0.5).lightgroup = "key"
        lamp("POINT", (1, 0, 1), 20, shadow_soft_size=0.0).lightgroup = "key"
        lamp("SPOT", (-1, 0, 1), 20).lightgroup = "gone"
        panel = shared.place("panel", square(glow("glowing", (1, 1, 1)), 0.2), (0, 1, 0.5))
        panel.lightgroup = "Sky light"
        self.world().lightgroup = "Sky light"
        self.caustique(4, "--method", "path", "--layers", "beauty,LightGroup_key,LightGroup_Sky_light")
        document, _ = glb.read(self.path)
        said = {node["name"]: node.get("extras", {}).get("caustique", {}) for node in document["nodes"]}
        groups = {name: keys["light_group"] for name, keys in said.items() if "light_group" in keys}
        self.assertEqual(groups, {"area (area light)": "key", "point": "key", "panel": "Sky light"})
        environment = document["scenes"][0]["extras"]["caustique"]["environment"]
        self.assertEqual(environment["light_group"], "Sky light")

    def test_mirrored_lamps_and_cameras(self):
        """Lamps and cameras mirrored by a parent, their scale or a collection instance point as in Cycles."""
        self.floor(4)
        rig = shared.place("rig", None)
        rig.scale = (-1, 1, 1)
        tilted = (0.3, 0.2, 0.5)
        for row, kind in enumerate(("AREA", "SPOT")):
            for column, scale in enumerate(((1, 1, 1), (-1, 1, 1), (1, 1, -1), (-1, -1, -1))):
                body = lamp(kind, (2 * column - 3, 1.5 * row, 1), 30, **({"shape": "RECTANGLE", "size": 0.4, "size_y": 0.2} if kind == "AREA" else
                                             {"spot_size": 1.0, "shadow_soft_size": 0.1, "use_soft_falloff": False}))
                # Rotate the lamp down again if its scale points it upwards.
                body.scale, body.rotation_euler = scale, (0.3 + (math.pi if scale[2] < 0 else 0), 0.2, 0.5)
        parented = lamp("AREA", (1.0, -1.5, 1.5), 40, size=0.5)
        parented.parent, parented.rotation_euler = rig, tilted
        inside = bpy.data.collections.new("inside")
        instanced = lamp("AREA", (2.5, -1.5, 1.5), 60, size=0.5)
        instanced.rotation_euler = tilted
        self.scene.collection.objects.unlink(instanced)
        inside.objects.link(instanced)
        copy = shared.place("copy", None)
        copy.instance_type, copy.instance_collection, copy.scale = "COLLECTION", inside, (-1, 1, 1)
        camera = eye((1, -6, 5), (0, 0, 0), lens=30)
        plain = self.caustique(64, "--method", "path")
        self.alike(plain, self.cycles(128), parts=4, tolerance=0.03)
        camera.parent = rig
        mirrored = self.caustique(64, "--method", "path")
        self.alike(mirrored, self.cycles(128), parts=4, tolerance=0.03)
        self.assertGreater(abs(mirrored - plain).mean(), 0.1 * plain.mean())

    def test_area_lamps_spread(self):
        self.floor()
        eye((0, -2.5, 2.5), (0, 0, 0), lens=35)
        for degrees in (40, 60, 120):
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
        if bpy.app.version < (5, 1, 0):
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

    def nodes(self, body):
        """The node tree of a lamp, and its Emission node."""
        if bpy.app.version < (5, 1, 0):
            body.data.use_nodes = True
        tree = body.data.node_tree
        return tree, next(n for n in tree.nodes if n.type == "EMISSION")

    def test_suns_without_normalize(self):
        """The strength of a sun without Normalize is a radiance, so its light grows with its disc."""
        self.floor()
        eye((0, -3, 3), (0, 0, 0), lens=35)
        for angle in (0.02, 0.5, math.pi):
            with self.subTest(angle):
                body = lamp("SUN", (0, 0, 2), 2 / angle ** 2, angle=angle, normalize=False)
                self.alike(self.caustique(), self.cycles(), parts=1)
                bpy.data.objects.remove(body)

    def light(self, body, build):
        """The intensity per channel (W/sr) in the file of a point lamp whose nodes `build(tree, emission)` changes."""
        build(*self.nodes(body))
        self.warnings = export.write(self.path)
        lights = glb.read(self.path)[0]["extensions"]["KHR_lights_punctual"]["lights"]
        self.assertEqual([light["name"] for light in lights], [body.data.name])
        bpy.data.objects.remove(body)
        return [round(c * lights[0]["intensity"] / 683, 4) for c in lights[0]["color"]]

    def test_nodes_of_lamps_as_cycles_reads_them(self):
        """Links between colours and numbers, muted links and nodes, and node groups."""
        self.floor()

        def linked(kind, value, socket, mute=None):
            def build(tree, emission):
                node = tree.nodes.new(kind)
                node.outputs[0].default_value = value
                link = tree.links.new(node.outputs[0], emission.inputs[socket])
                if mute is not None:
                    setattr(*((link, "is_muted") if mute == "link" else (node, "mute")), True)
            return build

        def muted(tree, emission):
            emission.mute = True

        def grouped(tree, emission):
            group = shared.group_of("ShaderNodeEmission", Color=(0.5, 0.25, 1, 1))
            strength = group.interface.new_socket("Strength", in_out="INPUT", socket_type="NodeSocketFloat")
            inputs, inner = group.nodes.new("NodeGroupInput"), next(n for n in group.nodes if n.type == "EMISSION")
            group.links.new(inputs.outputs[strength.identifier], inner.inputs["Strength"])
            node = shared.group_node(tree, group)
            node.inputs[0].default_value = 2
            tree.links.new(node.outputs[0], next(n for n in tree.nodes if n.type == "OUTPUT_LIGHT").inputs["Surface"])

        red, grey = (1, 0, 0, 1), [0.2126] * 3
        for name, build, expected in (
                ("colour to number", linked("ShaderNodeRGB", red, "Strength"), grey),
                ("number to colour", linked("ShaderNodeValue", 0.25, "Color"), [0.25] * 3),
                ("muted link", linked("ShaderNodeValue", 5, "Strength", "link"), [1, 1, 1]),
                ("muted node", linked("ShaderNodeValue", 5, "Strength", "node"), [1, 1, 1]),
                ("muted emission", muted, [0, 0, 0]),
                ("group", grouped, [1, 0.5, 2])):
            with self.subTest(name):
                body = lamp("POINT", (0, 0, 2), 4 * math.pi, shadow_soft_size=0.0)
                self.assertEqual(self.light(body, build), expected)
                self.assertEqual(self.warnings, [])
        self.light(lamp("POINT", (0, 0, 2), -4 * math.pi, shadow_soft_size=0.0), lambda tree, emission: None)
        self.assertIn("its light is negative", "".join(self.warnings))

    def environment(self):
        """Export the scene. Returns its environment, with rounded colours."""
        self.warnings = export.write(self.path)
        said = glb.read(self.path)[0]["scenes"][0]["extras"]["caustique"]["environment"]
        return [round(c, 3) for c in said["color"]], said.get("background")

    def test_nodes_of_worlds_as_cycles_reads_them(self):
        """Links between colours and numbers, muted links and nodes, and node groups."""
        black = [0, 0, 0], {"color": [0, 0, 0]}

        def add(kind, value, socket):
            tree = self.world((1, 0.5, 0.25, 1)).node_tree
            node = tree.nodes.new(kind)
            node.outputs[0].default_value = value
            return node, tree.links.new(node.outputs[0], background(self.scene.world).inputs[socket])

        add("ShaderNodeRGB", (1, 0, 0, 1), "Strength")
        self.assertEqual(self.environment(), ([0.213, 0.106, 0.053], None))
        add("ShaderNodeValue", 0.25, "Color")
        self.assertEqual(self.environment(), ([0.25] * 3, None))
        add("ShaderNodeRGB", (1, 0, 0, 1), "Color")[1].is_muted = True
        self.assertEqual(self.environment(), ([1, 0.5, 0.25], None))
        add("ShaderNodeRGB", (1, 0, 0, 1), "Color")[0].mute = True
        self.assertEqual(self.environment(), ([1, 0.5, 0.25], None))
        add("ShaderNodeValue", -1, "Strength")
        self.assertEqual(self.environment(), black)
        self.assertIn("its light is negative", "".join(self.warnings))
        tree = self.world((1, 0.5, 0.25, 1)).node_tree
        background(self.scene.world).mute = True
        self.assertEqual(self.environment(), black)
        output = next(n for n in tree.nodes if n.type == "OUTPUT_WORLD")
        for kind, socket in (("ShaderNodeBackground", "Surface"), ("ShaderNodeVolumeScatter", "Volume")):
            group = shared.group_of(kind, Color=(1, 0.5, 0.25, 1))
            tree.links.new(shared.group_node(tree, group).outputs[0], output.inputs[socket])
        self.assertEqual(self.environment(), ([1, 0.5, 0.25], None))
        self.assertEqual(self.warnings, [])
        self.assertIn("medium", glb.read(self.path)[0]["scenes"][0]["extras"]["caustique"])
        for node in tree.nodes:
            node.mute = node.type == "GROUP"
        self.assertEqual(self.environment(), black)
        self.assertNotIn("medium", glb.read(self.path)[0]["scenes"][0]["extras"]["caustique"])
        self.scene.world = None
        self.assertEqual(self.environment(), black)

    def test_nodes_that_are_switched_off(self):
        """Lamps keep their nodes while these are switched off, before Blender 5.1."""
        body = lamp("POINT", (0, 0, 2), 4 * math.pi)
        body.data.use_nodes = True
        next(n for n in body.data.node_tree.nodes if n.type == "EMISSION").inputs["Strength"].default_value = 3
        body.data.use_nodes = False
        export.write(self.path)
        written = glb.read(self.path)[0]["extensions"]["KHR_lights_punctual"]["lights"][0]["intensity"]
        self.assertAlmostEqual(written / 683, 3 if body.data.use_nodes else 1, 4)

    def test_nodes_of_lamps_are_measured(self):
        """Strengths that nodes compute, light falloff, and textures shine with their mean strength."""
        self.floor()
        eye((0, -3, 3), (0, 0, 0), lens=35)
        for kind, at in (("POINT", (0, 0, 2)), ("SUN", (0, 0, 2)), ("AREA", (0, 0, 2)), ("SPOT", (0, 0, 2))):
            with self.subTest(kind):
                body = lamp(kind, at, 5.0 if kind == "SUN" else 300.0, color=(1, 0.8, 0.6))
                tree, node = self.nodes(body)
                dim = tree.nodes.new("ShaderNodeMath")
                dim.operation, dim.inputs[0].default_value, dim.inputs[1].default_value = "MULTIPLY", 0.5, 0.4
                tree.links.new(dim.outputs[0], node.inputs["Strength"])
                self.alike(self.caustique(), self.cycles(), parts=1, tolerance=0.03)
                self.assertFalse(any("shader nodes" in line for line in self.warnings), self.warnings)
                bpy.data.objects.remove(body)
        body = lamp("POINT", (0, 0, 2), 300.0, use_soft_falloff=False)
        tree, node = self.nodes(body)
        falloff = tree.nodes.new("ShaderNodeLightFalloff")
        falloff.inputs["Strength"].default_value = 0.013
        tree.links.new(falloff.outputs["Constant"], node.inputs["Strength"])
        self.alike(self.caustique(), self.cycles(), parts=1, tolerance=0.5)
        self.assertIn("its shader nodes are not carried: it shines alike", "".join(self.warnings))

    def test_profiles(self):
        """Points and spots with an IES profile that has no symmetry shine as in Cycles, which interpolates it with
        cubics."""
        def strength(vertical, horizontal):
            up, turn = math.radians(vertical), math.radians(horizontal)
            return 300 + 200 * math.cos(2 * up) + math.sin(up) * (80 * math.cos(turn - 0.9) + 60 * math.sin(2 * turn))

        vertical, horizontal = range(0, 91, 5), range(0, 361, 15)
        rows = [" ".join(f"{max(strength(v, h), 20):.3f}" for v in vertical) for h in horizontal]
        text = "\n".join(["IESNA:LM-63-2002", "TILT=NONE", f"1 1000 1 {len(vertical)} {len(horizontal)} 1 2 0 0 0",
                          "1 1 100", " ".join(map(str, vertical)), " ".join(map(str, horizontal)), *rows])
        path = os.path.join(self.folder, "lamp.ies")
        with open(path, "w") as file:
            file.write(text)
        self.floor(4)
        for kind, radius in (("POINT", 0.0), ("POINT", 0.2), ("SPOT", 0.0)):
            with self.subTest(kind=kind, radius=radius):
                body = lamp(kind, (0, 0, 1), 300.0, shadow_soft_size=radius, use_soft_falloff=False)
                body.rotation_euler = (0.2, 0.1, 0.4)
                if kind == "SPOT":
                    body.data.spot_size = 2.6
                tree, node = self.nodes(body)
                source, dim = tree.nodes.new("ShaderNodeTexIES"), tree.nodes.new("ShaderNodeMath")
                source.mode, source.filepath = "EXTERNAL", path
                dim.operation, dim.inputs[1].default_value = "MULTIPLY", 0.5
                tree.links.new(source.outputs[0], dim.inputs[0])
                tree.links.new(dim.outputs[0], node.inputs["Strength"])
                eye((0, 0, 5), (0, 0, 0), lens=50)
                self.alike(self.caustique(32, "--method", "path"), self.cycles(64), parts=4, tolerance=0.03)
                self.assertEqual(self.warnings, [])
                bpy.data.objects.remove(body)

    def test_profiles_of_coarse_angles(self):
        """Between measured angles Cycles' cubics are (9 (b + c) - a - d) / 16 in the middle; before Blender 5.0 it
        continues them by zero. A profile of another type stays as it is."""
        import lamp_profiles
        text = "\n".join(["IESNA:LM-63-2002", "TILT=NONE", "1 1000 2 4 1 {} 2 0 0 0", "1 1 100", "0 30 60 90", "0",
                          "100 80 30 10"]) + "\n"
        plain = text.format(2).encode()
        self.assertEqual(lamp_profiles._smoothed(plain), plain)
        lines = [line.split() for line in lamp_profiles._smoothed(text.format(1).encode()).decode().splitlines()]
        up, first = numpy.array(lines[4], float), numpy.array(lines[6], float)
        numpy.testing.assert_allclose(numpy.interp([0, 30, 60, 90], up, first), [200, 160, 60, 20], rtol=1e-5)
        beyond = 20 if bpy.app.version >= (5, 0) else 0
        middles = [(9 * (200 + 160) - 160 - 60) / 16, (9 * (160 + 60) - 200 - 20) / 16,
                   (9 * (60 + 20) - 160 - beyond) / 16]
        numpy.testing.assert_allclose(numpy.interp([15, 45, 75], up, first), middles, rtol=1e-5)
        # One horizontal angle is brighter by up to an eighth opposite to it in Cycles before Blender 5.0.
        around = [float(x) for x in lines[5]]
        self.assertEqual(len(around) == 1, bpy.app.version >= (5, 0))
        if len(around) > 1:
            self.assertAlmostEqual(float(lines[6 + around.index(180)][0]) / 200, 9 / 8, places=5)

    def slide(self):
        """A picture without symmetry."""
        image = bpy.data.images.new("slide", 64, 48)
        y, x = numpy.mgrid[:48, :64] / numpy.array([48.0, 64.0]).reshape(2, 1, 1)
        texels = numpy.ones((48, 64, 4), numpy.float32)
        texels[..., 0], texels[..., 1], texels[..., 2] = 0.3 + 0.7 * x, 0.3 + 0.7 * y, 0.3 + 0.7 * x * (1 - y)
        image.pixels.foreach_set(texels.ravel())
        image.pack()
        return image

    def test_pictures_of_spots(self):
        """A spot throws its image, by its own coordinates and by the direction of the light, as in Cycles."""
        self.floor(4)
        body = lamp("SPOT", (0, 0, 2), 300.0, spot_size=1.0, spot_blend=0.2, shadow_soft_size=0.0, color=(1, 0.8, 0.6))
        body.rotation_euler = (0.3, 0.1, 0.2)
        tree, node = self.nodes(body)
        picture = tree.nodes.new("ShaderNodeTexImage")
        picture.image = self.slide()
        tree.links.new(picture.outputs["Color"], node.inputs["Color"])
        eye((0.2, 0.6, 5), (0.2, 0.6, 0), lens=200)
        self.alike(self.caustique(32, "--method", "path"), self.cycles(64), parts=4)
        self.assertEqual(self.warnings, [])
        listed = json.loads(support.run(["info", self.path, "--json"], check=0).stdout)["lights"]
        self.assertEqual(listed["spot with a picture"], 1)
        around, place = (tree.nodes.new("ShaderNode" + kind) for kind in ("TexCoord", "Mapping"))
        place.inputs["Location"].default_value = (0.5, 0.4, 0)
        tree.links.new(around.outputs["Normal"], place.inputs["Vector"])
        tree.links.new(place.outputs["Vector"], picture.inputs["Vector"])
        self.alike(self.caustique(32, "--method", "path"), self.cycles(64), parts=4)
        self.assertEqual(self.warnings, [])

    def test_pictures_of_area_lamps(self):
        """Area lamps shine with their image, and are seen with it, as in Cycles."""
        floor = self.floor(4)
        for shape in ("RECTANGLE", "DISK"):
            with self.subTest(shape):
                floor.hide_render = False
                body = lamp("AREA", (0, 0, 0.5), 100.0, shape=shape, size=1.0)
                body.data.size_y = 0.6
                body.rotation_euler = (0.3, 0.1, 0.2)
                tree, node = self.nodes(body)
                picture = tree.nodes.new("ShaderNodeTexImage")
                picture.image = self.slide()
                tree.links.new(picture.outputs["Color"], node.inputs["Color"])
                eye((0, 0, 5), (0, 0, 0), lens=70)
                self.alike(self.caustique(64, "--method", "path"), self.cycles(256), parts=2, tolerance=0.03)
                self.assertEqual(self.warnings, [])
                floor.hide_render, body.visible_camera = True, True
                eye((0, 0, -1), body.location, lens=100)
                self.alike(self.caustique(16, "--method", "path"), self.cycles(64), parts=2, tolerance=0.03)
                bpy.data.objects.remove(body)

    def test_bulbs_let_light_through(self):
        """The bulb of a point lamp is seen directly and in a mirror, in front of the world, and casts no shadow."""
        self.world((1, 1, 1, 1))
        floor = self.floor(3)
        body = lamp("POINT", (0, 0, 0.6), 5.0, shadow_soft_size=0.4, use_soft_falloff=False)
        eye((0, -0.1, 0.1), (0, 0, 0), lens=80)
        self.alike(self.caustique(), self.cycles())
        self.assertEqual(self.warnings, [])
        floor.data.materials[0] = shared.node_material("mirror", "ShaderNodeBsdfGlossy", Roughness=0.0)
        eye((0, -1.6, 0.6), (0, -0.8, 0), lens=300)
        self.alike(self.caustique(), self.cycles(), tolerance=0.03)
        body.visible_camera = True
        eye((0, -2, 0.6), (0, 0, 0.6), lens=300)
        self.alike(self.caustique(), self.cycles(), tolerance=0.03)

    def test_bulbs_of_spots_are_seen_in_mirrors_and_block_no_light(self):
        self.world((1, 1, 1, 1))
        floor = self.floor(3)
        body = lamp("SPOT", (0, 0, 0.6), 5.0, shadow_soft_size=0.2, spot_size=2.6, spot_blend=0.1, use_soft_falloff=False)
        eye((0, -0.1, 0.1), (0, 0, 0), lens=80)
        self.alike(self.caustique(), self.cycles())
        self.assertEqual(self.warnings, [])
        floor.data.materials[0] = shared.node_material("mirror", "ShaderNodeBsdfGlossy", Roughness=0.0)
        eye((0, -1.0, 0.6), (0, -0.5, 0), lens=300)
        self.alike(self.caustique(), self.cycles(), tolerance=0.03)
        body.visible_camera = True
        eye((0, -0.4, 0.2), (0, 0, 0.6), lens=300)
        self.alike(self.caustique(), self.cycles(), tolerance=0.03)

    def test_measured_profiles_have_the_strength_of_directions_that_meet_objects(self):
        """A lamp with an IES profile that nodes rotate lights a small square in different directions."""
        profile = bpy.data.texts.new("profile")
        profile.write("IESNA:LM-63-2002\nTILT=NONE\n1 1000 1 3 5 1 2 0 0 0 1 1 100\n0 90 180\n0 90 180 270 360\n"
                      "500 1000 100\n500 300 100\n500 50 100\n500 200 100\n500 1000 100\n")
        body = lamp("POINT", (0, 0, 0), 300.0, shadow_soft_size=0.05, use_soft_falloff=False)
        body.rotation_euler = (0.3, 0.5, 0.8)
        tree, node = self.nodes(body)
        source = tree.nodes.new("ShaderNodeTexIES")
        source.ies = profile
        around, turned = tree.nodes.new("ShaderNodeTexCoord"), tree.nodes.new("ShaderNodeMapping")
        tree.links.new(around.outputs["Normal"], turned.inputs["Vector"])
        tree.links.new(turned.outputs["Vector"], source.inputs["Vector"])
        tree.links.new(source.outputs[0], node.inputs["Strength"])
        wall = shared.place("wall", square(shared.node_material("grey", "ShaderNodeBsdfDiffuse"), 0.5))
        seen = []
        for at in ((2, 0, 0), (-2, 0.5, 0), (0, 2, 1), (0, -2, 1), (0.3, 0, -2), (0, 0, 2)):
            wall.location = at
            wall.rotation_euler = Vector(at).to_track_quat("-Z", "Y").to_euler()
            eye((0, 0, 0), at, lens=80)
            theirs = self.cycles(64)
            self.alike(self.caustique(32), theirs, parts=1, tolerance=0.12)
            seen.append(theirs.mean())
        self.assertGreater(max(seen), 3 * min(seen))

    def test_a_sun_in_the_sky_is_a_lamp(self):
        self.floor()
        world = self.world()
        tree = world.node_tree
        sky = tree.nodes.new("ShaderNodeTexSky")
        if bpy.app.version < (5, 0, 0):
            sky.sky_type = "NISHITA"
        sky.sun_elevation, sky.sun_rotation, sky.sun_size = 0.6, 2.0, math.radians(2)
        background(world).inputs["Strength"].default_value = 0.3
        tree.links.new(sky.outputs[0], background(world).inputs["Color"])
        shared.place("post", square(bpy.data.materials["grey"], 0.3), (0, 0, 0.5))
        eye((0, -3, 3), (0, 0, 0), lens=45)
        theirs = self.cycles()
        self.alike(self.caustique(), theirs)
        self.assertTrue(sky.sun_disc)
        document = glb.read(self.path)[0]
        node = next(node for node in document["nodes"] if node["name"] == "sky's sun")
        self.assertAlmostEqual(node["extras"]["caustique"]["angle_deg"], 2, 4)

    def test_a_world_hidden_from_cameras(self):
        """The world lights the floor, and cameras see black. Other hidden rays are named losses."""
        self.floor(1.0)
        world = self.world((1, 0.5, 0.2, 1))
        world.cycles_visibility.camera = False
        eye((0, -3, 3), (0, 0, 0), lens=45)
        self.alike(self.caustique(), self.cycles())
        self.assertEqual(self.warnings, [])
        world.cycles_visibility.glossy = False
        self.assertIn("hidden from glossy rays", export.write(self.path)[0])
        world.cycles_visibility.camera = True
        paths, mix = (world.node_tree.nodes.new("ShaderNode" + kind) for kind in ("LightPath", "MixShader"))
        output = next(n for n in world.node_tree.nodes if n.type == "OUTPUT_WORLD")
        for socket, end in ((paths.outputs["Is Camera Ray"], mix.inputs[0]), (background(world).outputs[0], mix.inputs[2]),
                            (mix.outputs[0], output.inputs["Surface"])):
            world.node_tree.links.new(socket, end)
        export.write(self.path)
        document, _ = glb.read(self.path)
        said = document["scenes"][0]["extras"]["caustique"]["environment"]
        self.assertEqual((said["color"], said["background"]), ([0, 0, 0], {"color": [1, 0.5, float(numpy.float32(0.2))]}))
        world.node_tree.links.new(paths.outputs["Is Glossy Ray"], mix.inputs[0])
        self.assertIn("depends on Is Glossy Ray", "\n".join(export.write(self.path)))

    def test_a_world_that_cameras_see_otherwise(self):
        """The world lights the floor by one colour; cameras see another one, and mirrors the first."""
        self.floor(1.0)
        world = self.world((1, 0.5, 0.2, 1))
        tree = world.node_tree
        paths, mix, other = (tree.nodes.new("ShaderNode" + kind) for kind in ("LightPath", "MixShader", "Background"))
        other.inputs["Color"].default_value = (0, 0.2, 1, 1)
        output = next(n for n in tree.nodes if n.type == "OUTPUT_WORLD")
        for socket, end in ((paths.outputs["Is Camera Ray"], mix.inputs[0]), (background(world).outputs[0], mix.inputs[1]),
                            (other.outputs[0], mix.inputs[2]), (mix.outputs[0], output.inputs["Surface"])):
            tree.links.new(socket, end)
        eye((0, -6, 1), (0, 0, 1), lens=30)
        self.alike(self.caustique(), self.cycles())
        self.assertEqual(self.warnings, [])

    def test_losses_of_lamps_are_named(self):
        self.floor()
        eye((0, -3, 3), (0, 0, 0))
        lamp("POINT", (0, 0, 0.5), 10, shadow_soft_size=0.2)
        lamp("AREA", (1, 0, 1), 10).visible_glossy = False
        spot = lamp("SPOT", (0, 1, 9), 10, shadow_soft_size=0.0)
        spot.scale = (2, 1, 1)
        if bpy.app.version < (5, 1, 0):
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
        warnings = "\n".join(export.write(self.path))
        self.assertIn('light "area.001": it is a portal', warnings)
        made = [material["name"] for material in glb.read(self.path)[0]["materials"]]
        self.assertEqual(sum("area light" in name for name in made), 1, "portals are dark")


if __name__ == "__main__":
    unittest.main()
