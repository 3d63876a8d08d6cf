"""Tests features that export.py adds to Blender's glTF exporter, against Cycles and closed forms. Needs bpy."""

import math
import os
import subprocess
import sys
import tempfile
import unittest

import support

import bpy
import build
import export
import glb
import lighting
import objects
import sky
import numpy
from contextlib import ExitStack

ROOT = str(support.ROOT)


def node_material(name, *shaders, mix=None, volume=None, **values):
    """A material with one shader node, or a mix or sum of two. `values`: input values of all nodes with such an
    input."""
    material = bpy.data.materials.new(name)
    if bpy.app.version < (5, 0, 0):
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    made = [tree.nodes.new(kind) for kind in shaders]
    if mix:
        mixer = tree.nodes.new(mix)
        sockets = [s for s in mixer.inputs if s.type == "SHADER"]
        for node, socket in zip(made, sockets):
            tree.links.new(node.outputs[0], socket)
        tree.links.new(mixer.outputs[0], output.inputs["Surface"])
    elif made:
        tree.links.new(made[0].outputs[0], output.inputs["Surface"])
    if volume:
        made.append(tree.nodes.new(volume))
        tree.links.new(made[-1].outputs[0], output.inputs["Volume"])
    for node in made:
        for key, value in values.items():
            socket = node.inputs.get(key.replace("_", " "))
            if socket is not None:
                socket.default_value = value
    return material


def group_of(kind, **values):
    """A node group with one shader of this kind. `values`: its input values by name."""
    group = bpy.data.node_groups.new("group", "ShaderNodeTree")
    group.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
    node, end = group.nodes.new(kind), group.nodes.new("NodeGroupOutput")
    for name, value in values.items():
        node.inputs[name].default_value = value
    group.links.new(node.outputs[0], end.inputs[0])
    return group


def group_node(tree, group):
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree = group
    return node


def cube(material, sides=6):
    corners = [(x, y, z) for x in (0, 2) for y in (0, 2) for z in (0, 0.5)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)][:sides]
    mesh = bpy.data.meshes.new("cube")
    mesh.from_pydata(corners, [], faces)
    mesh.materials.append(material)
    body = bpy.data.objects.new("cube", mesh)
    bpy.context.scene.collection.objects.link(body)
    return body


def place(name, data, at=(0, 0, 0)):
    body = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(body)
    body.location = at
    return body


def pixels(path):
    picture = bpy.data.images.load(path)
    picture.colorspace_settings.name = "Non-Color"  # Blender 5 takes another from the file
    width, height = picture.size
    values = numpy.empty(width * height * 4, numpy.float32)
    picture.pixels.foreach_get(values)
    bpy.data.images.remove(picture)
    return values.reshape(height, width, 4)[..., :3]


class Export(unittest.TestCase):
    def setUp(self):
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.path = os.path.join(self.folder.name, "scene.glb")

    def write(self, **options):
        warnings = export.write(self.path, **options)
        return glb.read(self.path)[0], warnings

    def material(self, material, sides=6):
        cube(material, sides)
        document, warnings = self.write()
        return document["materials"][0], warnings

    def render(self):
        scene = bpy.context.scene
        scene.render.engine, scene.cycles.samples, scene.cycles.use_denoising = "CYCLES", 256, False
        scene.render.resolution_x = scene.render.resolution_y = 16
        settings = scene.render.image_settings
        if hasattr(settings, "media_type"):
            settings.media_type = "IMAGE"
        settings.file_format, settings.color_depth = "OPEN_EXR", "32"
        scene.render.filepath = os.path.join(self.folder.name, "render.exr")
        bpy.ops.render.render(write_still=True)
        return pixels(scene.render.filepath)

    def test_glass_shader_becomes_solid(self):
        entry, warnings = self.material(node_material("g", "ShaderNodeBsdfGlass", Color=(0.9, 0.8, 0.7, 1), IOR=1.4, Roughness=0.25))
        self.assertEqual(warnings, [])
        self.assertEqual(entry["extensions"]["KHR_materials_transmission"], {"transmissionFactor": 1})
        self.assertEqual(entry["extensions"]["KHR_materials_volume"], {"thicknessFactor": 0.5})
        self.assertAlmostEqual(entry["extensions"]["KHR_materials_ior"]["ior"], 1.4, 5)
        self.assertAlmostEqual(entry["pbrMetallicRoughness"]["roughnessFactor"], 0.25, 5)
        numpy.testing.assert_allclose(entry["pbrMetallicRoughness"]["baseColorFactor"], (0.9, 0.8, 0.7, 1), rtol=1e-5)

    def test_normal_maps_on_uneven_scales_are_named(self):
        """Cycles reads a normal map in object space, and stretches it with the object. Baking does so, too."""
        for mapped, scale, named in ((True, (1, 1, 0.2), True), (True, (-2, 2, 2), False), (False, (3, 1, 1), False)):
            with self.subTest(mapped=mapped, scale=scale):
                bpy.ops.wm.read_factory_settings(use_empty=True)
                material = node_material("tile", "ShaderNodeBsdfPrincipled")
                if mapped:
                    image = bpy.data.images.new("bumps", 4, 4)
                    image.generated_color, image.colorspace_settings.name = (0.75, 0.6, 0.9, 1), "Non-Color"
                    image.pack()
                    tree = material.node_tree
                    picture, bend = tree.nodes.new("ShaderNodeTexImage"), tree.nodes.new("ShaderNodeNormalMap")
                    picture.image = image
                    tree.links.new(picture.outputs["Color"], bend.inputs["Color"])
                    tree.links.new(bend.outputs["Normal"], tree.nodes["Principled BSDF"].inputs["Normal"])
                body = cube(material)
                body.data.uv_layers.new()
                body.scale = scale
                _, warnings = self.write(bake_size=0)
                self.assertEqual(any('object "cube": its scale is uneven' in w for w in warnings), named, warnings)
                document, warnings = self.write(bake_size=16)
                self.assertNotIn("uneven", "".join(warnings))
                node = next(node for node in document["nodes"] if node["name"] == "cube")
                self.assertEqual(node.get("scale", [1, 1, 1]) == [1, 1, 1], named)

    def test_principled_glass_tints_once(self):
        entry, _ = self.material(node_material("g", "ShaderNodeBsdfPrincipled", Base_Color=(0.81, 0.64, 0.25, 1), Transmission_Weight=1.0))
        numpy.testing.assert_allclose(entry["pbrMetallicRoughness"]["baseColorFactor"], (0.9, 0.8, 0.5, 1), rtol=1e-5)

    def test_fresnel_mix_of_refraction_and_glossy_is_glass(self):
        material = node_material("g", "ShaderNodeBsdfRefraction", "ShaderNodeBsdfGlossy", mix="ShaderNodeMixShader", Color=(1, 1, 1, 1), IOR=1.33, Roughness=0.0)
        tree = material.node_tree
        fresnel, mixer = tree.nodes.new("ShaderNodeFresnel"), next(n for n in tree.nodes if n.type == "MIX_SHADER")
        fresnel.inputs["IOR"].default_value = 1.33
        tree.links.new(fresnel.outputs[0], mixer.inputs["Fac"])
        entry, warnings = self.material(material)
        self.assertEqual(warnings, [])
        self.assertAlmostEqual(entry["extensions"]["KHR_materials_ior"]["ior"], 1.33, 5)
        self.assertIn("KHR_materials_volume", entry["extensions"])

    def test_open_glass_stays_thin_with_a_warning(self):
        entry, warnings = self.material(node_material("pane", "ShaderNodeBsdfGlass"), sides=5)
        self.assertNotIn("KHR_materials_volume", entry["extensions"])
        self.assertEqual(len(warnings), 1)
        self.assertIn('material "pane": transmissive, but on a mesh that is not closed: it stays a thin sheet that bends no '
                      "light; close its holes", warnings[0])

    def test_diffuse_and_glossy(self):
        entry, _ = self.material(node_material("d", "ShaderNodeBsdfDiffuse", Color=(0.1, 0.2, 0.3, 1)))
        self.assertEqual(entry["extensions"]["KHR_materials_specular"], {"specularFactor": 0})
        numpy.testing.assert_allclose(entry["pbrMetallicRoughness"]["baseColorFactor"], (0.1, 0.2, 0.3, 1), rtol=1e-5)
        self.setUp()
        entry, _ = self.material(node_material("m", "ShaderNodeBsdfGlossy", Color=(0.9, 0.9, 0.9, 1), Roughness=0.4))
        self.assertEqual(entry["pbrMetallicRoughness"].get("metallicFactor", 1), 1)
        self.assertAlmostEqual(entry["pbrMetallicRoughness"]["roughnessFactor"], 0.4, 5)

    def test_dark_glossy_reflects_the_same_at_all_angles(self):
        for colour in ((0.2, 0.2, 0.2), (0.9, 0.4, 0.2)):
            gloss = node_material("m", "ShaderNodeBsdfGlossy", Color=(*colour, 1), Roughness=0.4)
            entry, warnings = self.material(gloss)
            self.assertEqual(warnings, [])
            self.assertEqual(entry["extensions"], {"KHR_materials_ior": {"ior": 0}})
            numpy.testing.assert_allclose(entry["extras"]["caustique"]["reflection_color"], colour, rtol=1e-5)
            self.assertEqual(entry["pbrMetallicRoughness"]["baseColorFactor"], [0, 0, 0, 1])
            self.setUp()

    def test_tinted_glass_reflects_its_tint(self):
        entry, warnings = self.material(node_material("m", "ShaderNodeBsdfGlass", Color=(0.8, 0.4, 0.2, 1), IOR=1.5))
        self.assertEqual(warnings, [])
        numpy.testing.assert_allclose(entry["extras"]["caustique"]["reflection_color"], (0.8, 0.4, 0.2), rtol=1e-5)
        self.assertNotIn("KHR_materials_specular", entry["extensions"])

    def test_sum_with_emission(self):
        material = node_material("e", "ShaderNodeBsdfDiffuse", "ShaderNodeEmission", mix="ShaderNodeAddShader", Color=(0.5, 0.25, 0.1, 1), Strength=8.0)
        entry, _ = self.material(material)
        strength = entry["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"]
        numpy.testing.assert_allclose([strength * e for e in entry["emissiveFactor"]], (4, 2, 0.8), rtol=1e-5)

    def test_absorption_keeps_the_coefficients_of_cycles(self):
        entry, _ = self.material(node_material("w", "ShaderNodeBsdfGlass", volume="ShaderNodeVolumeAbsorption", Color=(0.5, 0.75, 1, 1), Density=4.0))
        volume = entry["extensions"]["KHR_materials_volume"]
        sigma = [-math.log(c) / volume["attenuationDistance"] for c in volume["attenuationColor"]]
        numpy.testing.assert_allclose(sigma, (2, 1, 0), atol=1e-6)

    def test_scattering_volume_without_surface(self):
        entry, _ = self.material(node_material("fog", volume="ShaderNodeVolumeScatter", Color=(0.5, 0.25, 0.1, 1), Density=4.0, Anisotropy=0.3))
        medium = entry["extras"]["caustique"]["medium"]
        numpy.testing.assert_allclose(medium["sigma_s"], (2, 1, 0.4), rtol=1e-6)
        self.assertEqual(medium["sigma_a"], [0, 0, 0])
        self.assertAlmostEqual(medium["g"], 0.3, 6)
        self.assertEqual(entry["extensions"]["KHR_materials_ior"]["ior"], 1)
        self.assertIn("KHR_materials_volume", entry["extensions"])

    def test_volumes_in_groups_and_muted(self):
        material = node_material("fog", volume="ShaderNodeVolumeScatter")
        tree = material.node_tree
        output = next(n for n in tree.nodes if n.type == "OUTPUT_MATERIAL")
        group = group_node(tree, group_of("ShaderNodeVolumeScatter", Color=(0.5, 0.25, 0.125, 1), Density=4.0))
        tree.links.new(group.outputs[0], output.inputs["Volume"])
        entry, warnings = self.material(material)
        self.assertEqual(entry["extras"]["caustique"]["medium"]["sigma_s"], [2, 1, 0.5])
        self.assertEqual(warnings, [])
        group.mute = True
        self.assertNotIn("extras", self.write()[0]["materials"][0])

    def test_numbers_in_colours_of_volumes(self):
        material = node_material("w", "ShaderNodeBsdfGlass", volume="ShaderNodeVolumeAbsorption", Density=4.0)
        tree = material.node_tree
        number = tree.nodes.new("ShaderNodeValue")
        number.outputs[0].default_value = 0.75
        tree.links.new(number.outputs[0], next(n for n in tree.nodes if n.type == "VOLUME_ABSORPTION").inputs["Color"])
        entry, warnings = self.material(material)
        self.assertEqual(warnings, [])
        self.assertAlmostEqual(entry["extensions"]["KHR_materials_volume"]["attenuationDistance"], 1, 6)

    def test_phase_functions(self):
        """Other phase functions than Henyey and Greenstein's are named in meshes and in the world."""
        material = node_material("fog", volume="ShaderNodeVolumeScatter")
        inner = next(n for n in material.node_tree.nodes if n.type == "VOLUME_SCATTER")
        world = bpy.context.scene.world = bpy.data.worlds.new("world")
        if bpy.app.version < (5, 0, 0):
            world.use_nodes = True
        fog = world.node_tree.nodes.new("ShaderNodeVolumeScatter")
        world.node_tree.links.new(
            fog.outputs[0], next(n for n in world.node_tree.nodes if n.type == "OUTPUT_WORLD").inputs["Volume"])
        cube(material)

        def named():
            return [line.split(":")[0] for line in self.write()[1] if "its phase function" in line]
        self.assertEqual(named(), [])
        # Blender before 4.3 has one phase function.
        for phase in ("RAYLEIGH", "MIE", "DRAINE", "FOURNIER_FORAND") if hasattr(inner, "phase") else ():
            fog.phase = inner.phase = phase
            self.assertEqual(named(), ['world "world"', 'material "fog"'])

    def test_colours_in_numbers(self):
        """Numbers that are linked to a colour are its luminance."""
        material = node_material("m", "ShaderNodeBsdfPrincipled")
        tree = material.node_tree
        colour = tree.nodes.new("ShaderNodeRGB")
        colour.outputs[0].default_value = (1, 0, 0, 1)
        shader = next(n for n in tree.nodes if n.type == "BSDF_PRINCIPLED")
        tree.links.new(colour.outputs[0], shader.inputs["Roughness"])
        entry, warnings = self.material(material)
        self.assertAlmostEqual(entry["pbrMetallicRoughness"]["roughnessFactor"], 0.2126, 4)
        self.assertEqual(warnings, [])

    def test_backface_culling_is_ignored(self):
        material = node_material("m", "ShaderNodeBsdfPrincipled")
        material.use_backface_culling = True
        plain = bpy.data.materials.new("plain")
        if bpy.app.version < (5, 0, 0):
            plain.use_nodes = False
        plain.use_backface_culling = True
        cube(material)
        cube(plain)
        document, _ = self.write()
        self.assertEqual([entry.get("doubleSided") for entry in document["materials"]], [True, True])

    def test_materials_for_eevee_alone_are_black(self):
        material = node_material("m", "ShaderNodeBsdfDiffuse", Color=(1, 1, 1, 1))
        next(n for n in material.node_tree.nodes if n.type == "OUTPUT_MATERIAL").target = "EEVEE"
        entry, _ = self.material(material)
        self.assertEqual(entry["pbrMetallicRoughness"]["baseColorFactor"], [0, 0, 0, 1])

    def test_negative_emission(self):
        material = node_material("m", "ShaderNodeEmission")
        number = material.node_tree.nodes.new("ShaderNodeValue")
        number.outputs[0].default_value = -1
        emission = next(n for n in material.node_tree.nodes if n.type == "EMISSION")
        material.node_tree.links.new(number.outputs[0], emission.inputs["Strength"])
        entry, warnings = self.material(material)
        self.assertNotIn("emissiveFactor", entry)
        self.assertIn('material "m": its light is negative', "".join(warnings))

    def test_abbe_number(self):
        material = node_material("flint", "ShaderNodeBsdfGlass")
        material["abbe"] = 40.0
        entry, _ = self.material(material)
        self.assertEqual(entry["extensions"]["KHR_materials_dispersion"], {"dispersion": 0.5})

    def test_procedural_texture_is_named_where_it_is_not_baked(self):
        material = node_material("n", "ShaderNodeBsdfPrincipled")
        tree = material.node_tree
        noise, shader = tree.nodes.new("ShaderNodeTexNoise"), next(n for n in tree.nodes if n.type == "BSDF_PRINCIPLED")
        tree.links.new(noise.outputs[0], shader.inputs["Base Color"])
        cube(material)
        warnings = export.write(self.path, bake_size=0)
        self.assertEqual(warnings, ['material "n": Base Color comes from a Noise Texture node and is not baked; leave out '
                                    '--no-bake to carry it'])

    def test_camera(self):
        focus = place("focus", None, (0, 3, 4))
        for name, at in (("other", (1, 0, 0)), ("eye", (0, 0, 10))):
            data = bpy.data.cameras.new(name)
            data.lens, data.dof.use_dof, data.dof.aperture_fstop = 80, name == "eye", 2.0
            data.dof.focus_object = focus
            place(name, data, at)
        bpy.context.scene.camera = bpy.data.objects["eye"]
        bpy.context.view_layer.update()
        document, _ = self.write()
        self.assertEqual([c["name"] for c in document["cameras"]], ["eye", "other"])
        first = document["nodes"][document["scenes"][0]["nodes"][0]]
        said = first["extras"]["caustique"]
        self.assertAlmostEqual(said["aperture_radius"], 0.02, 6)
        self.assertAlmostEqual(said["focus_distance"], 6, 5)
        self.assertEqual((first["name"], first["camera"]), ("eye", 0))

    def test_frame_and_rate(self):
        scene = bpy.context.scene
        for fps, base, expected in ((24, 1, [24, 1]), (24, 1.001, [24000, 1001]), (25, 2, [25, 2])):
            scene.render.fps, scene.render.fps_base = fps, base
            scene.frame_set(fps)
            document, _ = self.write()
            said = document["scenes"][0]["extras"]["caustique"]
            self.assertEqual((said["frame"], said["frame_rate"]), (fps, expected))

    def test_closed_and_open_meshes_are_distinguished(self):
        def mesh(corners, faces):
            made = bpy.data.meshes.new("tested")
            made.from_pydata(corners, [], faces)
            return made
        whole = cube(node_material("m")).data
        corners, faces = [tuple(v.co) for v in whole.vertices], [tuple(p.vertices) for p in whole.polygons]
        # Separate vertices for every face, with a negative zero among the coordinates.
        apart = mesh([tuple(-0.0 if c == 0 and i % 2 else c for c in corners[v]) for i, f in enumerate(faces) for v in f],
                     [tuple(range(4 * i, 4 * i + 4)) for i in range(6)])
        twice = mesh(corners, faces + faces[:1])
        for made, expected in ((whole, True), (apart, True), (mesh(corners, faces[:5]), False), (twice, False),
                               (mesh(corners, []), False), (None, False)):
            self.assertIs(export._closed(made), expected)

    def test_lamps(self):
        for name, kind in (("p", "POINT"), ("s", "SUN")):
            data = bpy.data.lights.new(name, kind)
            place(name, data)
        bpy.data.lights["p"].energy, bpy.data.lights["p"].shadow_soft_size = 4 * math.pi, 0.25
        bpy.data.lights["s"].energy, bpy.data.lights["s"].angle = 2, math.radians(3)
        document, _ = self.write()
        lamps = {light["name"]: light["intensity"] for light in document["extensions"]["KHR_lights_punctual"]["lights"]}
        self.assertAlmostEqual(lamps["p"], 683, 2)
        self.assertAlmostEqual(lamps["s"], 2 * 683, 2)
        said = {node["name"]: node["extras"]["caustique"] for node in document["nodes"]}
        self.assertEqual(said["p"], {"radius": 0.25, "null_bsdf": True, "visible": {"camera": False}})
        self.assertAlmostEqual(said["s"]["angle_deg"], 3, 5)

    def test_shadow_catchers_and_bulbs_are_keys_of_nodes(self):
        for name in ("floor", "body"):
            body = cube(node_material(name))
            body.name, body.is_shadow_catcher = name, name == "floor"
        data = bpy.data.lights.new("spot", "SPOT")
        place("spot", data)
        data.shadow_soft_size = 0.25
        document, warnings = self.write()
        said = {node["name"]: node.get("extras", {}).get("caustique", {}) for node in document["nodes"]}
        self.assertIs(said["floor"]["shadow_catcher"], True)
        self.assertNotIn("shadow_catcher", said["body"])
        self.assertEqual((said["spot"]["radius"], said["spot"]["bulb"]), (0.25, True))
        self.assertFalse([line for line in warnings if "catcher" in line or "bulb" in line])

    def test_lamp_nodes_multiply(self):
        data = bpy.data.lights.new("p", "POINT")
        data.energy, data.color = 4 * math.pi, (1, 0.5, 0.5)
        if data.node_tree is None:  # from 5.1 on, every lamp has one
            data.use_nodes = True
        node = next((n for n in data.node_tree.nodes if n.type == "EMISSION"), None)
        if node is None:
            tree = data.node_tree
            node = tree.nodes.new("ShaderNodeEmission")
            tree.links.new(node.outputs[0], tree.nodes.new("ShaderNodeOutputLight").inputs["Surface"])
        node.inputs["Strength"].default_value, node.inputs["Color"].default_value = 3, (0.5, 1, 0.5, 1)
        place("p", data)
        document, _ = self.write()
        light = document["extensions"]["KHR_lights_punctual"]["lights"][0]
        numpy.testing.assert_allclose([c * light["intensity"] / 683 for c in light["color"]], (1.5, 1.5, 0.75), rtol=1e-5)

    def test_area_lights_light_as_in_cycles(self):
        plane = node_material("white", "ShaderNodeBsdfDiffuse", Color=(1, 1, 1, 1))
        mesh = bpy.data.meshes.new("plane")
        mesh.from_pydata([(-5, -5, 0), (5, -5, 0), (5, 5, 0), (-5, 5, 0)], [], [(0, 1, 2, 3)])
        mesh.materials.append(plane)
        place("plane", mesh)
        eye = bpy.data.cameras.new("eye")
        eye.type, eye.ortho_scale = "ORTHO", 0.2
        bpy.context.scene.camera = place("eye", eye, (0, 0, 1))
        for shape in ("SQUARE", "RECTANGLE", "DISK", "ELLIPSE"):
            data = bpy.data.lights.new(shape, "AREA")
            data.shape, data.size, data.size_y, data.energy, data.color = shape, 1.2, 0.6, 40, (1, 0.5, 0.25)
            lamp = place(shape, data, (1, 0.5, 3))
            lamp.rotation_euler, lamp.scale = (0.2, 0.3, 0.4), (1.5, 0.7, 1)
            bpy.context.view_layer.update()
            by_lamp = self.render().mean((0, 1))
            with ExitStack() as undo:
                flat = objects.FlatScene(bpy.context.scene, undo, lambda *lost: self.fail(lost))
                lighting.add_lamps(flat, lambda *lost: self.fail(lost))
                lamp.hide_render = True
                for body in flat.things:
                    if body.name.startswith(shape):
                        bpy.context.scene.collection.objects.link(body)
                by_mesh = self.render().mean((0, 1))
            numpy.testing.assert_allclose(by_mesh, by_lamp, rtol=0.01, err_msg=shape)

    def test_area_light_in_the_file(self):
        data = bpy.data.lights.new("panel", "AREA")
        data.size, data.energy = 2, 8 * math.pi
        place("panel", data)
        before = len(bpy.data.objects), len(bpy.data.meshes), len(bpy.data.materials)
        document, _ = self.write()
        entry = document["materials"][0]
        self.assertEqual(entry["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"], 2)
        self.assertFalse(entry.get("doubleSided", False))
        self.assertEqual(before, (len(bpy.data.objects), len(bpy.data.meshes), len(bpy.data.materials)))

    def test_nothing_is_left_behind(self):
        material = node_material("g", "ShaderNodeBsdfGlass", "ShaderNodeEmission", mix="ShaderNodeAddShader")
        body = cube(material)
        modifier = body.modifiers.new("smooth", "SUBSURF")
        modifier.levels, modifier.render_levels = 0, 3
        links = [(link.from_node.name, link.to_node.name, link.to_socket.identifier) for link in material.node_tree.links]
        document, _ = self.write()
        self.assertEqual(document["accessors"][document["meshes"][0]["primitives"][0]["indices"]]["count"], 6 * 4 ** 3 * 6)
        self.assertEqual(modifier.levels, 0)
        self.assertEqual(sorted(links), sorted((link.from_node.name, link.to_node.name, link.to_socket.identifier) for link in material.node_tree.links))
        self.assertEqual(len(material.node_tree.nodes), 4)

    def world(self, image, turn=None, strength=1.0):
        world = bpy.data.worlds.new("world")
        if bpy.app.version < (5, 0, 0):
            world.use_nodes = True
        bpy.context.scene.world = world
        tree = world.node_tree
        background = next(n for n in tree.nodes if n.type == "BACKGROUND")
        texture = tree.nodes.new("ShaderNodeTexEnvironment")
        texture.image = image
        tree.links.new(texture.outputs["Color"], background.inputs["Color"])
        background.inputs["Strength"].default_value = strength
        if turn is not None:
            mapping, coordinates = tree.nodes.new("ShaderNodeMapping"), tree.nodes.new("ShaderNodeTexCoord")
            mapping.vector_type = turn[0]
            mapping.inputs["Rotation"].default_value = (0, 0, math.radians(turn[1]))
            tree.links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
            tree.links.new(mapping.outputs["Vector"], texture.inputs["Vector"])

    def gradient(self, turn_deg=0):
        """A smooth lat-long image f(u + turn) without repetition: 64 x 32, bottom row first."""
        v, u = (numpy.mgrid[0:32, 0:64] + 0.5) / [[[32]], [[64]]]
        u = 2 * math.pi * (u + turn_deg / 360)
        return numpy.stack([1 + 0.5 * numpy.cos(u), 1 + 0.5 * numpy.sin(u), 0.2 + v, 1 + 0 * v], -1).astype(numpy.float32)

    def image(self):
        picture = bpy.data.images.new("sky", 64, 32, float_buffer=True)
        picture.pixels.foreach_set(self.gradient().ravel())
        return picture

    def test_environment_image_is_turned_as_in_cycles(self):
        for kind, degrees in (("POINT", 50), ("TEXTURE", 50), ("POINT", -20)):
            self.world(self.image(), (kind, degrees), 2.0)
            document, warnings = self.write()
            self.assertEqual(warnings, [])
            said = document["scenes"][0]["extras"]["caustique"]["environment"]
            self.assertEqual((said["file"], said["strength"]), ("scene.environment.exr", 2))
            numpy.testing.assert_allclose(pixels(os.path.join(self.folder.name, said["file"])), self.gradient()[..., :3], atol=1e-3)
            # The environment of Cycles in the layout of the .glb: the image rotated by rotation_deg about +Y.
            sky.bake_world(bpy.context.scene, self.path, 64)
            seen = pixels(os.path.join(self.folder.name, "scene.environment.exr")) / 2
            numpy.testing.assert_allclose(seen[1:-1], self.gradient(said["rotation_deg"])[1:-1, :, :3], atol=0.03, err_msg=f"{kind} {degrees}")

    def test_environment_images_have_the_colours_of_cycles(self):
        """Colour spaces and alpha of float and byte images, which are files or packed."""
        for kind, space, alpha in (("OPEN_EXR", "ACEScg", 1.0), ("OPEN_EXR", "sRGB", 1.0),
                                   ("OPEN_EXR", "Non-Color", 1.0), ("PNG", "sRGB", 0.5), ("PNG", "ACEScg", 1.0),
                                   ("PNG", "Linear Rec.709", 1.0)):
            for packs in (False, True):
                picture = bpy.data.images.new("drawn", 16, 8, float_buffer=kind == "OPEN_EXR", alpha=True)
                picture.pixels.foreach_set(numpy.tile(numpy.float32((0.9, 0.5, 0.1, alpha)), 128))
                picture.file_format = kind
                picture.filepath_raw = os.path.join(self.folder.name, f"sky.{kind[-3:].lower()}")
                picture.save()
                read = bpy.data.images.load(picture.filepath_raw)
                read.colorspace_settings.name = space
                if packs:
                    read.pack()
                self.world(read)
                document, warnings = self.write()
                self.assertEqual(warnings, [])
                said = document["scenes"][0]["extras"]["caustique"]["environment"]
                ours = pixels(os.path.join(self.folder.name, said["file"])).mean((0, 1)) * said["strength"]
                with tempfile.TemporaryDirectory() as folder:
                    baked = sky.bake_world(bpy.context.scene, os.path.join(folder, "x.glb"), 16)
                    theirs = pixels(os.path.join(folder, baked["file"])).mean((0, 1))
                numpy.testing.assert_allclose(ours, theirs, rtol=0.01, err_msg=f"{kind} {space} {alpha} {packs}")
                bpy.data.images.remove(picture)
                bpy.data.images.remove(read)

    def test_dome_puts_colours_where_cycles_sees_them(self):
        build.dome(lambda x, y, z: numpy.stack([2 + x, 2 + y, 2 + z], -1), 64)
        document, warnings = self.write()
        self.assertEqual(warnings, [])
        said = document["scenes"][0]["extras"]["caustique"]["environment"]
        written = pixels(os.path.join(self.folder.name, said["file"]))
        numpy.testing.assert_allclose(written[16, [0, 16, 32, 48]], [(1, 2, 2), (2, 3, 2), (3, 2, 2), (2, 1, 2)], atol=0.1)
        numpy.testing.assert_allclose(written[[0, 31], 0, 2], (1, 3), atol=0.1)

    def test_procedural_world_is_baked(self):
        self.world(self.image())
        tree = bpy.context.scene.world.node_tree
        gamma, background = tree.nodes.new("ShaderNodeGamma"), next(n for n in tree.nodes if n.type == "BACKGROUND")
        gamma.inputs["Gamma"].default_value = 2
        texture = next(n for n in tree.nodes if n.type == "TEX_ENVIRONMENT")
        tree.links.new(texture.outputs["Color"], gamma.inputs["Color"])
        tree.links.new(gamma.outputs[0], background.inputs["Color"])
        document, warnings = self.write()
        self.assertEqual(warnings, ['world "world": its nodes are baked to scene.environment.exr; '
                                    "keep that file beside the scene's file"])
        seen = pixels(os.path.join(self.folder.name, document["scenes"][0]["extras"]["caustique"]["environment"]["file"]))
        self.assertEqual(seen.shape, (512, 1024, 3))
        numpy.testing.assert_allclose(seen.reshape(32, 16, 64, 16, 3).mean((1, 3))[1:-1], self.gradient()[1:-1, :, :3] ** 2, atol=0.08)

    def test_command_line(self):
        cube(node_material("g", "ShaderNodeBsdfGlass"))
        blend = os.path.join(self.folder.name, "in.blend")
        bpy.ops.wm.save_as_mainfile(filepath=blend)
        script = os.path.join(ROOT, "scripts", "blender", "export.py")
        done = subprocess.run([sys.executable, script, blend, self.path], capture_output=True, text=True, timeout=120)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("KHR_materials_volume", glb.read(self.path)[0]["extensionsUsed"])
        done = subprocess.run([sys.executable, script, blend + "x", self.path], capture_output=True, text=True, timeout=120)
        self.assertEqual(done.returncode, 1)
        self.assertIn("in.blendx", done.stderr)
        self.assertEqual(subprocess.run([sys.executable, script], capture_output=True, timeout=120).returncode, 2)


if __name__ == "__main__":
    unittest.main()
