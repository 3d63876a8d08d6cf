"""Features that had differed from Cycles without a word: each agrees now, or a warning names it."""

import math
import unittest

import cycles_comparison  # first: it sets the search path
import bpy
import export
import glb
import numpy
from cycles_comparison import eye, glow, lamp, shared, square


class Agrees(cycles_comparison.CyclesComparison):
    def world(self, color=(0.5, 0.5, 0.5)):
        world = self.scene.world = bpy.data.worlds.new("world")
        if bpy.app.version < (5, 0, 0):
            world.use_nodes = True
        next(n for n in world.node_tree.nodes if n.type == "BACKGROUND").inputs["Color"].default_value = (*color, 1)
        return world

    def material(self, kind="Principled", **inputs):
        return shared.node_material("tested", f"ShaderNodeBsdf{kind}", **inputs)

    def shader(self, material):
        return next(n for n in material.node_tree.nodes if n.type.startswith("BSDF") or n.type == "EMISSION")

    def test_drivers_are_baked_at_the_current_frame(self):
        material = glow("tested", (1, 1, 1))
        tree = material.node_tree
        noise, scale = tree.nodes.new("ShaderNodeTexNoise"), tree.nodes.new("ShaderNodeValue")
        noise.noise_dimensions = "4D"
        scale.outputs[0].driver_add("default_value").driver.expression = "frame / 3"
        tree.links.new(scale.outputs[0], noise.inputs["W"])
        tree.links.new(noise.outputs["Color"], self.shader(material).inputs["Color"])
        shared.place("wall", square(material, 1.0)).data.uv_layers.new()
        eye((0, 0, 2), (0, 0, 0), lens=60)
        for frame in (1, 40):
            self.scene.frame_set(frame)
            ours = self.caustique(16)
            self.alike(ours, self.cycles(32), parts=4, tolerance=0.03)

    def test_bumps_on_scaled_bodies(self):
        """A bump on a body with scale is evaluated in world space, its texture in object space."""
        material = self.material("Diffuse", Color=(0.8, 0.8, 0.8, 1))
        tree = material.node_tree
        place, wave, bump = (tree.nodes.new("ShaderNode" + kind) for kind in ("TexCoord", "TexWave", "Bump"))
        wave.inputs["Scale"].default_value, wave.wave_profile = 1.0, "SIN"
        bump.inputs["Distance"].default_value = 0.3
        tree.links.new(place.outputs["Object"], wave.inputs["Vector"])
        tree.links.new(wave.outputs[0], bump.inputs["Height"])
        tree.links.new(bump.outputs[0], self.shader(material).inputs["Normal"])
        body = shared.place("wall", square(material, 1.0))
        sun = lamp("SUN", (0, 0, 3), 3.0, angle=0.1)
        sun.rotation_euler = (0, 1.0, 0)
        eye((0, 0, 3), (0, 0, 0), type="ORTHO", ortho_scale=1.9)
        for scale in ((1, 3, 0.2), (2, 2, 2), (1.5, 2, -1)):
            body.scale = scale
            self.alike(self.caustique(32), self.cycles(64), parts=2, tolerance=0.03)

    def waves(self):
        """A normal map of waves along u and v, of slopes up to 1.2 and 0.6."""
        image = bpy.data.images.new("waves", 64, 64, is_data=True)
        rows, columns = numpy.mgrid[0:64, 0:64] / 64 * 2 * math.pi
        bent = numpy.stack([1.2 * numpy.cos(3 * columns), 0.6 * numpy.cos(2 * rows), numpy.ones((64, 64))], axis=-1)
        bent = bent / numpy.linalg.norm(bent, axis=-1, keepdims=True) * 0.5 + 0.5
        image.pixels.foreach_set(numpy.dstack([bent, numpy.ones((64, 64))]).astype(numpy.float32).ravel())
        image.pack()
        return image

    def test_normal_maps_on_scaled_bodies(self):
        """Uneven scale stretches the slopes of a normal map; bodies that share the mesh have each their own scale."""
        material = self.material("Diffuse", Color=(0.8, 0.8, 0.8, 1))
        tree = material.node_tree
        picture, bend = (tree.nodes.new("ShaderNode" + kind) for kind in ("TexImage", "NormalMap"))
        picture.image = self.waves()
        tree.links.new(picture.outputs["Color"], bend.inputs["Color"])
        tree.links.new(bend.outputs[0], self.shader(material).inputs["Normal"])
        mesh = bpy.data.meshes.new("square")
        mesh.materials.append(material)
        mesh.from_pydata([(x, y, 0) for x, y in ((-0.4, -0.4), (0.4, -0.4), (0.5, 0), (0.4, 0.4), (-0.4, 0.4))],
                         [], [range(5)])
        layer = mesh.uv_layers.new()
        for corner, loop in zip(layer.data, mesh.loops):
            x, y, _ = mesh.vertices[loop.vertex_index].co
            corner.uv = 0.5 + 0.9 * x - 0.5 * y, 0.5 + 0.5 * x + 0.9 * y
        for at, turn, scale in (((-1, 0.5, 0), 0.4, (0.8, 1, 0.25)), ((0, 0.5, 0), 0.0, (1, 1, 1)),
                                ((1, 0.5, 0), -0.7, (0.5, 1.2, 3)), ((-0.5, -0.5, 0), 2.0, (1, 0.7, -0.5))):
            body = shared.place("wall", mesh, at)
            body.rotation_euler, body.scale = (0.3, 0, turn), scale
        sun = lamp("SUN", (0, 0, 3), 3.0, angle=0.1)
        sun.rotation_euler = (0, 0.8, 0)
        eye((0, 0, 3), (0, 0, 0), type="ORTHO", ortho_scale=2.6)
        for strength in (1.5, 1.0):
            bend.inputs["Strength"].default_value = strength
            self.alike(self.caustique(64), self.cycles(64), parts=2, tolerance=0.02)
            self.assertEqual([w for w in self.warnings if "baked" not in w and "40 degrees" not in w], [])
        self.assertIn("stretches normal maps", "".join(export.write(self.path, bake_size=0)))

    def test_single_scattering_metal(self):
        self.world((1, 1, 1))
        for roughness in (0.4, 0.8):
            material = self.material(Base_Color=(0.9, 0.6, 0.3, 1), Metallic=1.0, Roughness=roughness)
            self.shader(material).distribution = "GGX"
            body = shared.place("wall", square(material, 1.0))
            eye((0, -2, 2), (0, 0, 0), type="ORTHO", ortho_scale=1.0)
            self.alike(self.caustique(32), self.cycles(64), parts=1, tolerance=0.07)
            self.assertEqual(len(self.warnings), roughness == 0.8, self.warnings)
            bpy.data.objects.remove(body)

    def test_the_layers_filter_of_the_environment(self):
        self.world((1, 0, 0))
        self.floor(1.0)
        lamp("POINT", (0, 0, 2), 100, shadow_soft_size=0.0)
        eye((0, -3, 3), (0, 0, 0), lens=45)
        self.scene.view_layers[0].use_sky = False
        self.alike(self.caustique(64), self.cycles(64), parts=1, tolerance=0.03)

    def test_vertex_colours_without_material(self):
        """Blender's exporter writes them, and glTF multiplies by them; Cycles reads them in nodes alone."""
        self.world((0.5, 0.5, 0.5))
        body = shared.place("wall", square(None, 1.0))
        for corner in body.data.color_attributes.new("paint", "FLOAT_COLOR", "CORNER").data:
            corner.color = (1, 0.1, 0.1, 1)
        eye((0, 0, 2), (0, 0, 0), type="ORTHO", ortho_scale=1)
        self.alike(self.caustique(16), self.cycles(16))

    def test_random_numbers_of_objects(self):
        """Object Info's Random depends on the names of objects, and on the instance."""
        material = glow("tested", (1, 1, 1))
        tree = material.node_tree
        tree.links.new(tree.nodes.new("ShaderNodeObjectInfo").outputs["Random"], self.shader(material).inputs["Color"])
        inside = bpy.data.collections.new("inside")
        for x in (-0.5, 0.5):
            shared.place("wall", square(material, 0.5), (x, -0.5, 0))
        inner = shared.place("inner", square(material, 0.5))
        self.scene.collection.objects.unlink(inner)
        inside.objects.link(inner)
        for x in (-0.5, 0.5):
            copy = shared.place("copy", None, (x, 0.5, 0))
            copy.instance_type, copy.instance_collection = "COLLECTION", inside
        eye((0, 0, 3), (0, 0, 0), type="ORTHO", ortho_scale=2)
        theirs = self.cycles(16)
        self.assertGreater(theirs.std(), 0.1)
        self.alike(self.caustique(16), theirs)
        self.assertNotIn("random", str(glb.read(self.path)[0]))

    def reading(self, kind, name):
        """A material that emits the attribute `name` of the type `kind`."""
        material = glow("tested", (1, 1, 1))
        tree = material.node_tree
        node = tree.nodes.new("ShaderNodeAttribute")
        node.attribute_type, node.attribute_name = kind, name
        tree.links.new(node.outputs["Color"], self.shader(material).inputs["Color"])
        return material

    def test_attributes_of_objects(self):
        """Materials read attributes of points, objects, meshes, instancers and view layers, as in Cycles."""
        points = shared.place("points", square(self.reading("GEOMETRY", "tint"), 0.4), (-1, -0.5, 0))
        points.data.attributes.new("tint", "FLOAT_COLOR", "POINT").data.foreach_set("color", [0.1, 0.7, 0.3, 1] * 4)
        of_object, of_instancer = self.reading("OBJECT", "tint"), self.reading("INSTANCER", "tint")
        shared.place("object", square(of_object, 0.4), (0, -0.5, 0))["tint"] = (0.9, 0.2, 0.4)
        of_mesh = shared.place("mesh", square(of_object, 0.4), (1, -0.5, 0))
        of_mesh.data["tint"] = (0.2, 0.2, 0.8)
        self.scene["tint"], self.scene.view_layers[0]["tint"] = (1.0, 0.0, 0.0), (0.5, 0.1, 0.9)
        shared.place("layer", square(self.reading("VIEW_LAYER", "tint"), 0.4), (-1, 0.5, 0))
        inside = bpy.data.collections.new("inside")
        inner = shared.place("inner", square(of_instancer, 0.4))
        inner["tint"] = (0.8, 0.8, 0.1)
        self.scene.collection.objects.unlink(inner)
        inside.objects.link(inner)
        for x, tint in ((0, (0.1, 0.3, 0.9)), (1, None)):
            copy = shared.place("copy", None, (x, 0.5, 0))
            copy.instance_type, copy.instance_collection = "COLLECTION", inside
            if tint:
                copy["tint"] = tint
        eye((0, 0, 3), (0, 0, 0), type="ORTHO", ortho_scale=3)
        theirs = self.cycles(64)
        self.assertGreater(theirs.std((0, 1)).min(), 0.1)
        self.alike(self.caustique(64), theirs)

    @unittest.skipIf(bpy.app.version < (4, 5, 0), "Python reads attributes of instances from Blender 4.5 on")
    def test_attributes_of_instances(self):
        """The instances of geometry nodes have each their own attribute, those of objects and those of meshes."""
        inner = shared.place("inner", square(self.reading("INSTANCER", "tint"), 0.4), (0, 0, -9))
        for y, of_object in ((-0.5, True), (0.5, False)):
            tree = bpy.data.node_groups.new("instances", "GeometryNodeTree")
            tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
            line, copies, store, index, share, wear, end = (tree.nodes.new(kind) for kind in (
                "GeometryNodeMeshLine", "GeometryNodeInstanceOnPoints", "GeometryNodeStoreNamedAttribute",
                "GeometryNodeInputIndex", "ShaderNodeMath", "GeometryNodeSetMaterial", "NodeGroupOutput"))
            line.inputs["Count"].default_value, line.inputs["Offset"].default_value = 3, (1, 0, 0)
            made = tree.nodes.new("GeometryNodeObjectInfo" if of_object else "GeometryNodeMeshGrid")
            if of_object:
                made.inputs["Object"].default_value, made.inputs["As Instance"].default_value = inner, True
                tree.links.new(made.outputs["Geometry"], copies.inputs["Instance"])
            else:
                made.inputs["Size X"].default_value = made.inputs["Size Y"].default_value = 0.8
                wear.inputs["Material"].default_value = inner.data.materials[0]
                tree.links.new(made.outputs["Mesh"], wear.inputs["Geometry"])
                tree.links.new(wear.outputs[0], copies.inputs["Instance"])
            share.operation, share.inputs[1].default_value = "MULTIPLY_ADD", 0.3
            share.inputs[2].default_value = 0.2
            store.data_type, store.domain, store.inputs["Name"].default_value = "FLOAT_COLOR", "INSTANCE", "tint"
            tree.links.new(line.outputs[0], copies.inputs["Points"])
            tree.links.new(index.outputs[0], share.inputs[0])
            tree.links.new(share.outputs[0], next(s for s in store.inputs if s.type == "RGBA"))
            tree.links.new(copies.outputs[0], store.inputs[0])
            tree.links.new(store.outputs[0], end.inputs[0])
            shared.place("nodes", square(None), (-1, y, 0)).modifiers.new("nodes", "NODES").node_group = tree
        eye((0, 0, 3), (0, 0, 0), type="ORTHO", ortho_scale=3)
        theirs = self.cycles(64)
        self.assertGreater(theirs.std(), 0.2)
        self.alike(self.caustique(64), theirs)

    def test_cameras_under_scaled_parents(self):
        self.floor(1.0)
        self.world((1, 1, 1))
        rig = shared.place("rig", None)
        rig.scale, rig.rotation_euler = (1, 1, 3), (0.4, 0, 0)
        camera = eye((0, -1, 1), (0, 0, 0), lens=45)
        camera.parent = rig
        bpy.context.view_layer.update()
        self.caustique(4)
        self.assertIn("skews its picture", "".join(self.warnings))
        rig.rotation_euler, camera.rotation_euler = (0, 0, 0), (0, 0, 0)
        self.silhouettes_agree(self.caustique(16), self.cycles(16))
        self.assertEqual(self.warnings, [])

    def test_window_coordinates(self):
        """They are a function of the position, also for a shifted film."""
        material = glow("tested", (1, 1, 1))
        tree = material.node_tree
        shared.place("floor", square(material, 1.5, "floor"), (0, 0, 0))
        eye((0.3, -2.5, 1.5), (0, 0, 0), lens=40, shift_x=0.1)
        tree.links.new(tree.nodes.new("ShaderNodeTexCoord").outputs["Window"],
                       next(n for n in tree.nodes if n.type == "EMISSION").inputs["Color"])
        self.alike(self.caustique(), self.cycles())
        self.assertNotIn("depends on the view", "".join(self.warnings))

    def test_panoramas(self):
        """Equirectangular cameras and fisheyes see what they see in Cycles; others become perspective cameras."""
        self.floor(1.0)
        lamp("POINT", (0.2, 0.1, 1), 20, shadow_soft_size=0.0)
        camera = eye((0.1, -0.4, 0.5), (0, 0, 0.4), type="PANO").data
        settings = camera if hasattr(camera, "panorama_type") else camera.cycles
        for kind in ("EQUIRECTANGULAR", "FISHEYE_EQUIDISTANT", "FISHEYE_EQUISOLID"):
            settings.panorama_type = kind
            with self.subTest(kind):
                self.silhouettes_agree(self.caustique(16), self.cycles(16))
                self.assertEqual(self.warnings, [])
        settings.panorama_type = "MIRRORBALL"
        self.assertIn("of panoramic cameras only", "".join(export.write(self.path)))
        self.assertEqual(glb.read(self.path)[0]["cameras"][0]["type"], "perspective")
        self.assertEqual(camera.type, "PANO")


class Named(cycles_comparison.CyclesComparison):
    def named(self, *lines):
        warnings = "\n".join(export.write(self.path, bake_size=16))
        for line in lines:
            self.assertIn(line, warnings)

    def test_settings_of_the_scene(self):
        self.floor(1.0)
        scene = self.scene
        scene.render.engine = "CYCLES"
        self.assertEqual(export.write(self.path), [])
        scene.cycles.max_bounces, scene.cycles.sample_clamp_direct = 2, 3.0
        scene.cycles.transparent_max_bounces, scene.cycles.caustics_refractive = 1, False
        scene.render.film_transparent = scene.cycles.film_transparent_glass = True
        if bpy.app.version < (5, 0, 0):
            scene.use_nodes = True
            tree = scene.node_tree
        else:
            tree = scene.compositing_node_group = bpy.data.node_groups.new("compositor", "CompositorNodeTree")
        tree.nodes.new("CompositorNodeBlur")
        self.named("limits on light paths are not carried (max bounces 2, transparent max bounces 1)",
                   "switches of caustics are not carried (refractive ones are off)", "clamping of bright samples",
                   "Transparent Glass", "its compositor is not carried")
        scene.render.use_compositing = False
        self.assertNotIn("compositor", "".join(export.write(self.path)))

    def test_glass_whose_normals_lean(self):
        glass = shared.node_material("glass", "ShaderNodeBsdfGlass")
        body = shared.cube(glass)
        self.assertEqual(export.write(self.path), [])
        body.data.shade_smooth()
        self.named('object "cube": its smooth shading leans by more than 25 degrees from its faces on 100% of its area: '
                   "there it is brighter than in Cycles")
        body.data.materials[0] = self.floor().data.materials[0]
        self.named("brighter or darker than in Cycles")

    def test_glass_that_differs_from_cycles(self):
        """Coats of glass are named, tints are not."""
        principled = {"Transmission Weight": 1.0, "Roughness": 0.0}
        for kind, inputs, line in (
                ("Principled", {**principled, "Coat Weight": 0.5}, "set Coat > Weight to 0"),
                ("Principled", principled, None),
                ("Glass", {"Color": (0.5, 0.5, 0.5, 1)}, None)):
            material = shared.node_material("glass", f"ShaderNodeBsdf{kind}", **{
                name.replace(" ", "_"): value for name, value in inputs.items()})
            body = shared.cube(material)
            warnings = "".join(export.write(self.path))
            self.assertIn(line or "", warnings)
            self.assertEqual(bool(line), bool(warnings), warnings)
            bpy.data.objects.remove(body)

    def test_normals_of_an_objects_own(self):
        """Normals that lean one way by 13 degrees change glass; a polished surface shows 20 degrees, a matt one none."""
        bpy.ops.mesh.primitive_uv_sphere_add(segments=64, ring_count=32)
        body = bpy.context.object
        mesh = body.data
        mesh.shade_smooth()
        smooth = [corner.vector.copy() for corner in mesh.corner_normals]
        for degrees, kind, inputs, line in (
                (13, "Glass", {}, "by more than 10 degrees"), (3, "Glass", {}, None),
                (20, "Principled", {"Roughness": 0.1}, "by more than 17 degrees"),
                (20, "Principled", {"Roughness": 0.8}, None), (20, "Diffuse", {}, None)):
            lean = math.tan(math.radians(degrees))
            mesh.normals_split_custom_set([(n + lean * n.orthogonal().normalized()).normalized() for n in smooth])
            mesh.materials.clear()
            mesh.materials.append(shared.node_material("tested", f"ShaderNodeBsdf{kind}", **inputs))
            warnings = "".join(export.write(self.path))
            self.assertEqual("Clear Custom Split Normals Data" in warnings, bool(line), warnings)
            self.assertIn(line or "", warnings)

    def test_indices_below_one(self):
        shared.place("wall", square(shared.node_material("tested", "ShaderNodeBsdfPrincipled", IOR=0.0), 1.0))
        self.named("its IOR of 0 is below 1")

    def test_cameras_in_glass(self):
        body = shared.cube(shared.node_material("water", "ShaderNodeBsdfGlass", IOR=1.333))
        eye((-1, 1, 0.25), (1, 1, 0.25))
        self.assertNotIn("inside", "".join(export.write(self.path)))
        body.location, body.scale = (-1.5, 0, 0), (1, 1, -3)
        body.location.z = 1
        self.named('camera "eye": it is inside object "cube"')

    def test_rough_metal(self):
        """Cycles brightens the highlight of rough metal; caustique adds the light that is scattered between facets."""
        line = "the light that its rough metal scatters between facets leaves in all directions"
        material = shared.node_material("tested", "ShaderNodeBsdfPrincipled", Metallic=1.0, Roughness=0.4)
        shader = next(n for n in material.node_tree.nodes if n.type == "BSDF_PRINCIPLED")
        wall = shared.place("wall", square(material, 1.0))
        wall.data.uv_layers.new()
        self.assertNotIn(line, "".join(export.write(self.path, bake_size=16)))
        shader.inputs["Roughness"].default_value = 0.5
        self.named(line)
        image = bpy.data.images.new("rough", 4, 4, is_data=True)
        picture = material.node_tree.nodes.new("ShaderNodeTexImage")
        picture.image = image
        for extension in ("REPEAT", "CLIP"):  # one that the exporter writes, one that it bakes
            picture.extension = extension
            material.node_tree.links.new(picture.outputs["Color"], shader.inputs["Roughness"])
            for value in (0.3, 0.6):
                image.pixels.foreach_set([value] * 64)
                image.pack()
                found = line in "".join(export.write(self.path, bake_size=16))
                self.assertEqual(found, value > 0.5, (extension, value))

    def test_volumes_that_nodes_make(self):
        body = shared.place("cloud", square(glow("tested", (1, 1, 1)), 1.0))
        tree = bpy.data.node_groups.new("cloud", "GeometryNodeTree")
        for direction in ("INPUT", "OUTPUT"):
            tree.interface.new_socket("Geometry", in_out=direction, socket_type="NodeSocketGeometry")
        source, end, cube = (tree.nodes.new(kind) for kind in ("NodeGroupInput", "NodeGroupOutput",
                                                               "GeometryNodeVolumeCube"))
        tree.links.new(cube.outputs[0], end.inputs[0])
        body.modifiers.new("nodes", "NODES").node_group = tree
        self.named('object "cloud": volumes that vary in space are not carried')


if __name__ == "__main__":
    unittest.main()
