"""Tests materials that glTF cannot express: baked images against closed forms, mixed shaders, and clean-up."""

import math
import os
import subprocess
import sys
import tempfile
import types
import unittest
from unittest import mock

import support

import bpy
import numpy

import bake
import closures
import export
import glb
from lab.features import torture_stage

ROOT = str(support.ROOT)

SIZE = 64


class Case(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.enterContext(mock.patch.dict(os.environ, XDG_CACHE_HOME=os.path.join(self.folder.name, "cache")))
        self.path = os.path.join(self.folder.name, "scene.glb")
        self.stage = torture_stage.Stage("plane")
        self.stage.body.rotation_euler = (0, 0, 0)

    def write(self, size=SIZE):
        """Export. Returns the material "tested", and the warnings."""
        warnings = export.write(self.path, bake_size=size)
        self.document, self.buffer = glb.read(self.path)
        return next(m for m in self.document["materials"] if m["name"] == "tested"), warnings

    def texels(self, info):
        """The stored values of a textureInfo's image, 0 to 1, top row first."""
        image = self.document["images"][self.document["textures"][info["index"]]["source"]]
        view = self.document["bufferViews"][image["bufferView"]]
        path = os.path.join(self.folder.name, "image.png")
        with open(path, "wb") as file:
            file.write(self.buffer[view["byteOffset"]:view["byteOffset"] + view["byteLength"]])
        loaded = bpy.data.images.load(path)
        loaded.colorspace_settings.name, loaded.alpha_mode = "Non-Color", "CHANNEL_PACKED"
        values = numpy.empty(len(loaded.pixels), numpy.float32)
        loaded.pixels.foreach_get(values)
        shape = loaded.size[1], loaded.size[0], loaded.channels
        bpy.data.images.remove(loaded)
        return values.reshape(shape)[::-1]

    def points(self):
        """Positions (count, 3) of the body's exported vertices in Blender's axes, and the baked UV set."""
        node = next(n for n in self.document["nodes"] if n["name"] == "body")
        attributes = self.document["meshes"][node["mesh"]]["primitives"][0]["attributes"]

        def read(name, width):
            accessor = self.document["accessors"][attributes[name]]
            view = self.document["bufferViews"][accessor["bufferView"]]
            start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
            return numpy.frombuffer(self.buffer, numpy.float32, accessor["count"] * width, start).reshape(-1, width)
        places = read("POSITION", 3)
        return numpy.stack([places[:, 0], -places[:, 2], places[:, 1]], 1), read("TEXCOORD_1", 2)

    def look_up(self, info):
        """The stored texels at the body's inner vertices, and the vertices' positions."""
        places, uv = self.points()
        texels = self.texels(info)
        inner = numpy.abs(places[:, :2]).max(1) < 0.9
        x, y = (numpy.clip(uv[inner] * texels.shape[0] - 0.5, 0, texels.shape[0] - 1.001)).T
        i, j, s, t = y.astype(int), x.astype(int), (y % 1)[:, None], (x % 1)[:, None]
        mixed = ((texels[i, j] * (1 - t) + texels[i, j + 1] * t) * (1 - s)
                 + (texels[i + 1, j] * (1 - t) + texels[i + 1, j + 1] * t) * s)
        return places[inner], mixed


def linear(x):
    return numpy.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)


class Baked(Case):
    def across(self, axis=0):
        """A node output that increases from 0 to 1 along an axis of the plane."""
        split = self.stage.node("SeparateXYZ", self.stage.node("TexCoord").outputs["Object"])
        return self.stage.node("MapRange", split.outputs[axis], -1.0, 1.0, 0.0, 1.0).outputs[0]

    def test_a_baked_colour_is_that_of_the_position(self):
        self.stage.principled(Base_Color=self.stage.node("CombineXYZ", self.across(0), self.across(1), 0.25))
        entry, warnings = self.write()
        remedy = "which blur finer detail; use image textures there, or a larger --bake-size of export.py"
        self.assertEqual(warnings, [f'material "tested": Base Color is baked to images of 64 x 64 texels, {remedy}'])
        info = entry["pbrMetallicRoughness"]["baseColorTexture"]
        self.assertEqual(info["texCoord"], 1)
        places, found = self.look_up(info)
        expected = numpy.stack([(places[:, 0] + 1) / 2, (places[:, 1] + 1) / 2, 0 * places[:, 0] + 0.25], 1)
        numpy.testing.assert_allclose(linear(found[:, :3]), expected, atol=0.015)

    def test_numbers_share_an_image_by_channel(self):
        self.stage.principled(Roughness=self.across(0), Metallic=self.across(1), Transmission_Weight=0.0)
        entry, _ = self.write()
        places, found = self.look_up(entry["pbrMetallicRoughness"]["metallicRoughnessTexture"])
        numpy.testing.assert_allclose(found[:, 1], (places[:, 0] + 1) / 2, atol=0.015)
        numpy.testing.assert_allclose(found[:, 2], (places[:, 1] + 1) / 2, atol=0.015)
        self.assertNotIn("KHR_materials_transmission", entry.get("extensions", {}))

    def test_a_constant_value_becomes_a_factor(self):
        checker = self.stage.node("TexChecker", Color1=(0.3, 0.2, 0.1), Color2=(0.3, 0.2, 0.1))
        self.stage.principled(Base_Color=checker.outputs["Color"])
        entry, _ = self.write()
        numpy.testing.assert_allclose(entry["pbrMetallicRoughness"]["baseColorFactor"], (0.3, 0.2, 0.1, 1), rtol=1e-3)
        self.assertNotIn("images", self.document)

    def test_functions_of_numbers_need_no_image(self):
        ramp = self.stage.node("ValToRGB", self.stage.node("Math", 0.5, 0.25, operation="MULTIPLY"))
        self.stage.principled(Base_Color=ramp, Roughness=self.stage.node("Math", 0.5, 0.3, operation="ADD"))
        entry, warnings = self.write()
        self.assertEqual(warnings, [])
        numpy.testing.assert_allclose(entry["pbrMetallicRoughness"]["baseColorFactor"], (*[0.125] * 3, 1), rtol=1e-3)
        self.assertAlmostEqual(entry["pbrMetallicRoughness"]["roughnessFactor"], 0.8, 3)

    def test_bright_emission_keeps_its_strength(self):
        glow = self.stage.node("VectorMath", self.stage.node("CombineXYZ", self.across(0), 0.5, 0.0), (20, 20, 20),
                               operation="MULTIPLY")
        self.stage.surface(self.stage.node("Emission", Color=glow, Strength=2.0))
        entry, _ = self.write()
        places, found = self.look_up(entry["emissiveTexture"])
        strength = entry["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"]
        expected = 40 * numpy.stack([(places[:, 0] + 1) / 2, 0 * places[:, 0] + 0.5], 1)
        numpy.testing.assert_allclose(linear(found[:, :2]) * strength, expected, atol=0.6)

    def test_bump_becomes_the_normals_of_its_slope(self):
        """A constant slope of 0.3 tilts all normals equally. The file does not contain the height image."""
        heights = self.stage.node("Math", self.across(0), 0.6, operation="MULTIPLY")
        self.stage.principled(Normal=self.stage.node("Bump", Strength=1.0, Distance=1.0, Height=heights))
        entry, _ = self.write()
        self.assertEqual(len(self.document["images"]), 1)
        _, found = self.look_up(entry["normalTexture"])
        normals = found[:, :3] * 2 - 1
        numpy.testing.assert_allclose(numpy.hypot(normals[:, 0], normals[:, 1]) / normals[:, 2], 0.3, atol=0.02)

    def test_generated_coordinates_are_those_of_the_undeformed_shape(self):
        modifier = self.stage.body.modifiers.new("stretch", "SIMPLE_DEFORM")
        modifier.deform_method, modifier.factor, modifier.deform_axis = "STRETCH", 1.0, "X"
        self.stage.principled(Base_Color=self.stage.node("TexCoord").outputs["Generated"])
        entry, _ = self.write()
        places, found = self.look_up(entry["pbrMetallicRoughness"]["baseColorTexture"])
        reach = abs(self.points()[0][:, 0]).max()
        self.assertGreater(reach, 1.4)
        numpy.testing.assert_allclose(linear(found[:, 0]), places[:, 0] / (2 * reach) + 0.5, atol=0.015)

    def test_objects_that_share_a_mesh_share_an_image_unless_their_material_depends_on_the_object(self):
        self.stage.principled(Base_Color=self.across(0))
        twin = self.stage.place("twin", self.stage.body.data, (3, 0, 1))
        self.write()
        self.assertEqual(len(self.document["images"]), 1)
        self.stage.body.color, twin.color = (0.2, 0.2, 0.2, 1), (0.6, 0.6, 0.6, 1)
        self.stage.principled(Base_Color=self.stage.node("ObjectInfo").outputs["Color"])
        self.write()
        colours = [m["pbrMetallicRoughness"]["baseColorFactor"][0] for m in self.document["materials"]
                   if m["name"] == "tested"]
        numpy.testing.assert_allclose(sorted(colours), (0.2, 0.6), rtol=2e-3)

    def test_text_is_baked_too(self):
        text = bpy.data.curves.new("text", "FONT")
        text.body = "I"
        self.stage.principled(Base_Color=self.stage.node("TexNoise").outputs["Color"])
        text.materials.append(self.stage.material)
        self.stage.place("text", text)
        self.write()
        worn = [m for m in self.document["materials"] if m["name"] == "tested"]
        self.assertEqual(len([m for m in worn if "baseColorTexture" in m["pbrMetallicRoughness"]]), 2)
        self.assertFalse(bpy.data.objects["text"].hide_render)

    def test_a_second_export_bakes_nothing_until_something_changes(self):
        noise = self.stage.node("TexNoise", Scale=3.0)
        self.stage.principled(Base_Color=noise.outputs["Color"])
        first, _ = self.write()
        before = self.texels(first["pbrMetallicRoughness"]["baseColorTexture"])
        with mock.patch.object(bake.Baker, "_texels", side_effect=AssertionError("baked again")):
            second, warnings = self.write()
            self.assertNotIn("baked again", "".join(warnings))
            numpy.testing.assert_allclose(self.texels(second["pbrMetallicRoughness"]["baseColorTexture"]), before,
                                          atol=1 / 254)
            noise.inputs["Scale"].default_value = 4
            self.assertIn("baked again", "".join(self.write()[1]))
            noise.inputs["Scale"].default_value = 3
            self.stage.body.data.vertices[0].co.x -= 0.2
            self.assertIn("baked again", "".join(self.write()[1]))

    def test_nothing_is_left_behind(self):
        self.stage.principled(Base_Color=self.stage.group(
            lambda tree, inputs: self.stage.node("TexNoise", tree=tree).outputs["Color"]))
        modifier = self.stage.body.modifiers.new("finer", "SUBSURF")
        self.stage.body.material_slots[0].link = "OBJECT"
        self.stage.body.material_slots[0].material = self.stage.material

        def state():
            kinds = ("objects", "meshes", "materials", "images", "scenes", "node_groups", "curves")
            tree = self.stage.material.node_tree
            return ({kind: sorted(block.name for block in getattr(bpy.data, kind)) for kind in kinds},
                    len(tree.nodes), len(tree.links), bpy.context.scene.name, self.stage.body.data.name,
                    [uv.name for uv in self.stage.body.data.uv_layers], modifier.show_viewport,
                    self.stage.body.material_slots[0].link, self.stage.body.material_slots[0].material.name,
                    [c.name for c in self.stage.body.users_collection])
        before = state()
        entry, _ = self.write()
        self.assertIn("baseColorTexture", entry["pbrMetallicRoughness"])
        self.assertEqual(state(), before)

    def test_without_baking_each_loss_is_named(self):
        noise = self.stage.node("TexNoise")
        self.stage.principled(Base_Color=noise.outputs["Color"], Roughness=noise.outputs[0],
                              Normal=self.stage.node("Bump", Height=noise.outputs[0]))
        _, warnings = self.write(0)
        self.assertNotIn("images", self.document)
        for loss in ("Base Color comes from a Noise Texture", "Roughness comes from a Noise Texture",
                     "Normal comes from a Bump"):
            self.assertTrue(any(loss in line for line in warnings), (loss, warnings))

    def test_an_object_of_an_instanced_collection_is_baked(self):
        self.stage.principled(Base_Color=self.across(0))
        inside = bpy.data.collections.new("inside")
        inside.objects.link(self.stage.body)
        self.stage.scene.collection.objects.unlink(self.stage.body)
        instance = self.stage.place("instance", None, (0, 0, 1))
        instance.instance_type, instance.instance_collection = "COLLECTION", inside
        entry, _ = self.write()
        self.assertIn("baseColorTexture", entry["pbrMetallicRoughness"])
        self.assertEqual(len(self.document["images"]), 1)

    def test_objects_linked_from_another_file_are_baked(self):
        self.stage.principled(Base_Color=self.across(0), Roughness=0.25)
        library = os.path.join(self.folder.name, "library.blend")
        bpy.data.libraries.write(library, {self.stage.body})
        self.stage = torture_stage.Stage()
        with bpy.data.libraries.load(library, link=True) as (_, into):
            into.objects = ["body"]
        bpy.data.objects.remove(self.stage.body)
        self.stage.scene.collection.objects.link(into.objects[0])
        entry, _ = self.write()
        self.assertIn("baseColorTexture", entry["pbrMetallicRoughness"])
        self.assertAlmostEqual(entry["pbrMetallicRoughness"]["roughnessFactor"], 0.25, 5)

    def test_sizes_on_the_command_line(self):
        script = os.path.join(ROOT, "scripts", "blender", "export.py")
        for size in ("0", "x", "100000"):
            done = subprocess.run([sys.executable, script, "--bake-size", size, self.path], capture_output=True,
                                  text=True, timeout=120, check=False)
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertIn("--bake-size", done.stderr)
            self.assertNotIn("Traceback", done.stderr)


class Matched(Case):
    def test_transparent_share_is_alpha(self):
        self.stage.mix(0.25, self.stage.node("BsdfTransparent"), self.stage.node("BsdfDiffuse", Color=(0.4, 0.3, 0.2)))
        entry, warnings = self.write()
        self.assertEqual(warnings, [])
        self.assertEqual(entry["alphaMode"], "BLEND")
        numpy.testing.assert_allclose(entry["pbrMetallicRoughness"]["baseColorFactor"], (0.4, 0.3, 0.2, 0.25), rtol=1e-5)

    def test_fresnel_of_glossy_over_diffuse_is_a_dielectric(self):
        self.stage.mix(self.stage.node("Fresnel", IOR=1.8), self.stage.node("BsdfDiffuse", Color=(0.4, 0.3, 0.2)),
                       self.stage.node("BsdfGlossy", Color=(1, 1, 1), Roughness=0.3))
        entry, warnings = self.write()
        self.assertEqual(warnings, [])
        self.assertAlmostEqual(entry["extensions"]["KHR_materials_ior"]["ior"], 1.8, 5)
        self.assertAlmostEqual(entry["pbrMetallicRoughness"]["roughnessFactor"], 0.3, 5)
        numpy.testing.assert_allclose(entry["pbrMetallicRoughness"]["baseColorFactor"], (0.4, 0.3, 0.2, 1), rtol=1e-5)

    def test_gloss_over_diffuse_keeps_the_light_of_both(self):
        """A diffuse base of 0.7 x 0.5 below facets that reflect 0.3 x 0.8 and pass 1 - 0.24 of the base."""
        self.stage.mix(0.3, self.stage.node("BsdfDiffuse", Color=(0.5, 0.5, 0.5)),
                       self.stage.node("BsdfGlossy", Color=(0.8, 0.8, 0.8), Roughness=0.2))
        entry, warnings = self.write()
        self.assertEqual(warnings, [])
        self.assertAlmostEqual(entry["extensions"]["KHR_materials_specular"]["specularFactor"], 0.24, 5)
        base = entry["pbrMetallicRoughness"]["baseColorFactor"][0]
        self.assertAlmostEqual(base * (1 - 0.24), 0.35, 5)

    def test_a_film_tints_and_emits(self):
        self.stage.mix(0.4, self.stage.node("BsdfTransparent", Color=(0.5, 1, 1)),
                       self.stage.node("Emission", Color=(1, 0.5, 0.25), Strength=2.0))
        entry, warnings = self.write()
        self.assertEqual(warnings, [])
        self.assertEqual(entry["extensions"]["KHR_materials_volume"], {"thicknessFactor": 0})
        self.assertEqual(entry["extensions"]["KHR_materials_ior"], {"ior": 1})
        numpy.testing.assert_allclose(entry["pbrMetallicRoughness"]["baseColorFactor"], (0.3, 0.6, 0.6, 1), rtol=1e-5)
        numpy.testing.assert_allclose(entry["emissiveFactor"], (0.8, 0.4, 0.2), rtol=1e-5)

    def test_groups_reroutes_and_muted_nodes_are_followed(self):
        stage = self.stage

        def build(tree, inputs):
            hop = tree.nodes.new("NodeReroute")
            tree.links.new(inputs[0], hop.inputs[0])
            under = stage.node("BsdfDiffuse", Color=hop.outputs[0], tree=tree)
            over = stage.node("Emission", Strength=9.0, tree=tree)
            mixer = stage.node("MixShader", 0.9, under.outputs[0], over.outputs[0], tree=tree)
            mixer.mute = True
            return mixer.outputs[0]
        stage.surface(stage.group(build, Paint=(0.3, 0.2, 0.1)))
        entry, warnings = self.write()
        self.assertEqual(warnings, [])
        self.assertNotIn("emissiveFactor", entry)
        numpy.testing.assert_allclose(entry["pbrMetallicRoughness"]["baseColorFactor"], (0.3, 0.2, 0.1, 1), rtol=1e-5)

    def test_stretched_highlights_keep_both_widths(self):
        """Cycles: alpha / a along and alpha a across, a^2 = 1 - 0.9 x 0.8. It returns the light that round facets lose:
        0.119 of a white metal."""
        self.stage.principled(Base_Color=(0.5, 0.5, 0.5), Metallic=1.0, Roughness=0.5, Anisotropic=0.8)
        entry, _ = self.write()
        self.assertTrue(entry["extras"]["caustique"]["single_scattering"])
        self.assertAlmostEqual(entry["pbrMetallicRoughness"]["baseColorFactor"][0], 0.5 / (1 - 0.5 * 0.11944), 4)
        across = entry["pbrMetallicRoughness"]["roughnessFactor"] ** 2
        strength = entry["extensions"]["KHR_materials_anisotropy"]["anisotropyStrength"]
        aspect = math.sqrt(1 - 0.9 * 0.8)
        self.assertAlmostEqual(across, 0.25 * aspect, 5)
        self.assertAlmostEqual(across + (1 - across) * strength ** 2, 0.25 / aspect, 5)

    def test_the_specular_level_scales_the_reflectance_at_normal_incidence(self):
        self.stage.principled(IOR=1.5, Specular_IOR_Level=0.75)
        entry, _ = self.write()
        ior = entry["extensions"]["KHR_materials_ior"]["ior"]
        self.assertAlmostEqual(((ior - 1) / (ior + 1)) ** 2, 0.06, 5)

    def test_diffuse_reflectance_of_glass(self):
        """Duntley's closed form for diffuse light from outside at an index of 1.5: 9.18 %."""
        self.assertAlmostEqual(closures.mean_reflectance(1.5), 0.0918, 4)

    def test_blender_4_4_has_another_name_for_diffuse_shaders(self):
        for name in ("BSDF_DIFFUSE", "DIFFUSE_BSDF"):
            self.assertEqual(closures.Leaf(types.SimpleNamespace(type=name), ()).type, "BSDF_DIFFUSE")

    def test_translucency_is_diffuse_transmission(self):
        behind = self.stage.node("BsdfTranslucent", Color=(0.2, 0.6, 0.1))
        self.stage.mix(0.25, self.stage.diffuse((0.5, 0.4, 0.3)), behind)
        material, warnings = self.write()
        sheet = material["extensions"]["KHR_materials_diffuse_transmission"]
        self.assertAlmostEqual(sheet["diffuseTransmissionFactor"], 0.25, 5)
        numpy.testing.assert_allclose(sheet["diffuseTransmissionColorFactor"], (0.2, 0.6, 0.1), atol=1e-6)
        base = material["pbrMetallicRoughness"]["baseColorFactor"][:3]
        numpy.testing.assert_allclose(base, (0.5, 0.4, 0.3), atol=1e-6)
        self.assertFalse([line for line in warnings if "transmission" in line])

    def test_the_colour_of_translucency_may_vary(self):
        checker = self.stage.node("TexChecker", Color1=(0.8, 0.1, 0.1), Color2=(0.1, 0.8, 0.1))
        self.stage.surface(self.stage.node("BsdfTranslucent", Color=checker.outputs["Color"]))
        material, _ = self.write()
        sheet = material["extensions"]["KHR_materials_diffuse_transmission"]
        texels = self.texels(sheet["diffuseTransmissionColorTexture"])
        found = {(round(float(red), 1), round(float(green), 1)) for red, green in texels[..., :2].reshape(-1, 2)}
        self.assertLessEqual({(0.9, 0.3), (0.3, 0.9)}, found)
        self.assertEqual(sheet["diffuseTransmissionFactor"], 1.0)

    def test_thin_films_are_iridescence(self):
        self.stage.principled(Thin_Film_Thickness=300.0, Thin_Film_IOR=1.4)
        material, warnings = self.write()
        film = material["extensions"]["KHR_materials_iridescence"]
        self.assertEqual((film["iridescenceFactor"], film["iridescenceThicknessMaximum"]), (1.0, 300.0))
        self.assertAlmostEqual(film["iridescenceIor"], 1.4, 5)
        self.assertFalse([line for line in warnings if "film" in line])

    def test_shaders_with_and_without_a_film_are_mixed(self):
        """By a texture: indices of films without thickness do not count, and the thickness of the other is baked."""
        for thickness in (0.0, 300.0):
            with self.subTest(thickness=thickness):
                checker = self.stage.node("TexChecker")
                shaders = [self.stage.node("BsdfPrincipled", Thin_Film_IOR=ior, Thin_Film_Thickness=film, Base_Color=colour)
                           for ior, film, colour in ((1.33, 0.0, (0.8, 0.1, 0.1)), (1.6, thickness, (0.1, 0.8, 0.1)))]
                self.stage.mix(checker.outputs["Fac"], *shaders)
                material, warnings = self.write()
                self.assertIn("baseColorTexture", material["pbrMetallicRoughness"])
                film = material.get("extensions", {}).get("KHR_materials_iridescence")
                self.assertEqual(film is not None, thickness > 0)
                if film:
                    self.assertAlmostEqual(film["iridescenceThicknessMaximum"], thickness, 3)
                    self.assertAlmostEqual(film["iridescenceIor"], 1.6, 5)
                    found = {round(float(share), 1) for share in self.texels(film["iridescenceThicknessTexture"])[..., 1].ravel()}
                    self.assertLessEqual({0.0, 1.0}, found)
                self.assertFalse([line for line in warnings if "cannot be exported" in line or "film ior" in line])

    def test_metal_has_a_thin_film_from_blender_5_on(self):
        self.stage.principled(Thin_Film_Thickness=300.0, Metallic=1.0)
        material, _ = self.write()
        self.assertEqual("KHR_materials_iridescence" in material.get("extensions", {}), bpy.app.version >= (5, 0))

    def test_diffuse_roughness_is_a_key_of_the_extras(self):
        self.stage.surface(self.stage.node("BsdfDiffuse", Roughness=0.4))
        material, warnings = self.write()
        self.assertAlmostEqual(material["extras"]["caustique"]["diffuse_roughness"], 0.4, 5)
        self.assertFalse([line for line in warnings if "oughness" in line])
        if bpy.app.version >= (4, 3):
            self.setUp()
            self.stage.principled(Diffuse_Roughness=0.3)
            material, warnings = self.write()
            self.assertAlmostEqual(material["extras"]["caustique"]["diffuse_roughness"], 0.3, 5)
            self.assertFalse([line for line in warnings if "oughness" in line])

    def test_tint_and_index_of_coats_are_keys_of_the_extras(self):
        self.stage.principled(Coat_Weight=1.0, Coat_Tint=(1, 0.5, 0.25), Coat_IOR=1.75)
        material, warnings = self.write()
        own = material["extras"]["caustique"]
        self.assertEqual((own["coat_color"], own["coat_ior"]), ([1, 0.5, 0.25], 1.75))
        self.assertFalse([line for line in warnings if "oat" in line])

    def test_sheen_is_that_of_fibers(self):
        self.stage.principled(Sheen_Weight=0.5, Sheen_Tint=(1, 0.5, 0.25), Sheen_Roughness=0.25)
        material, warnings = self.write()
        self.assertEqual(material["extensions"]["KHR_materials_sheen"],
                         {"sheenColorFactor": [0.5, 0.25, 0.125], "sheenRoughnessFactor": 0.25})
        self.assertEqual(material["extras"]["caustique"]["sheen_model"], "fibers")
        self.assertEqual(len([line for line in warnings if "sheen" in line]), 1)

    def test_subsurface_scattering_is_a_medium(self):
        self.stage.shape("cube")
        self.stage.principled(Subsurface_Weight=1.0, Subsurface_Radius=(1, 0.5, 0.25), Subsurface_Scale=0.1,
                              Base_Color=(0.8, 0.4, 0.2), Specular_IOR_Level=0.0, Subsurface_Anisotropy=0.5)
        material, warnings = self.write()
        found = material["extensions"]
        self.assertEqual(found["KHR_materials_diffuse_transmission"]["diffuseTransmissionFactor"], 1)
        scatter, volume = found["KHR_materials_volume_scatter"], found["KHR_materials_volume"]
        # Refracted light returns less than diffuse light, and dark media lose more of it.
        ratios = numpy.divide(scatter["multiscatterColor"], [0.8, 0.4, 0.2])
        numpy.testing.assert_allclose(ratios, [0.966, 0.896, 0.860], atol=2e-3)
        self.assertEqual(scatter["scatterAnisotropy"], 0.5)
        self.assertGreater(volume["thicknessFactor"], 0)
        free = [volume["attenuationDistance"] / -math.log(c) for c in volume["attenuationColor"]]
        numpy.testing.assert_allclose(free, [0.1 * r * 0.5 / (4 * math.pi) for r in (1, 0.5, 0.25)], rtol=1e-5)
        self.assertFalse([line for line in warnings if "ubsurface" in line])

    def spread(self, low, high):
        """A node output that increases from `low` to `high` along the plane."""
        split = self.stage.node("SeparateXYZ", self.stage.node("TexCoord").outputs["Object"])
        return self.stage.node("MapRange", split.outputs[0], -1.0, 1.0, low, high).outputs[0]

    def test_roughness_of_diffuse_reflection_is_baked(self):
        self.stage.surface(self.stage.node("BsdfDiffuse", Roughness=self.spread(0.0, 1.0)))
        material, warnings = self.write()
        own = material["extras"]["caustique"]
        places, found = self.look_up(own["diffuse_roughness_texture"])
        numpy.testing.assert_allclose(own["diffuse_roughness"] * found[:, 0], (places[:, 0] + 1) / 2, atol=0.015)
        self.assertFalse([line for line in warnings if "mean is taken" in line])

    def test_tint_and_index_of_coats_are_baked(self):
        tint = self.stage.node("CombineXYZ", self.spread(0.25, 1.0), 1.0, 0.5)
        self.stage.principled(Coat_Weight=1.0, Coat_Tint=tint, Coat_IOR=self.spread(1.25, 2.0))
        material, warnings = self.write()
        own = material["extras"]["caustique"]
        places, found = self.look_up(own["coat_ior_texture"])
        index = 1.25 + 0.75 * (places[:, 0] + 1) / 2
        numpy.testing.assert_allclose(1 + (own["coat_ior"] - 1) * found[:, 0], index, atol=0.02)
        places, found = self.look_up(own["coat_color_texture"])
        expected = 0.25 + 0.75 * (places[:, 0] + 1) / 2
        numpy.testing.assert_allclose(linear(found[:, :2]), numpy.stack([expected, expected * 0 + 1], 1), atol=0.02)
        self.assertFalse([line for line in warnings if "mean is taken" in line])

    def test_the_thickness_of_a_film_is_baked(self):
        """glTF has no texture of its index, whose mean is taken."""
        self.stage.principled(Thin_Film_Thickness=self.spread(100.0, 500.0), Thin_Film_IOR=self.spread(1.3, 1.5))
        material, warnings = self.write()
        film = material["extensions"]["KHR_materials_iridescence"]
        self.assertEqual((film["iridescenceFactor"], film["iridescenceThicknessMinimum"]), (1.0, 0.0))
        self.assertAlmostEqual(film["iridescenceIor"], 1.4, delta=0.01)
        places, found = self.look_up(film["iridescenceThicknessTexture"])
        expected = 100 + 200 * (places[:, 0] + 1)
        numpy.testing.assert_allclose(film["iridescenceThicknessMaximum"] * found[:, 1], expected, atol=8)
        means = [line for line in warnings if "mean is taken" in line]
        self.assertEqual([line.split(": ")[1] for line in means], ["Thin Film IOR varies"])

    def test_colours_of_subsurface_scattering_vary_by_what_the_surface_transmits(self):
        """The medium has the brightest colour; what light loses on its way in and out makes the darker ones."""
        self.stage.shape("sphere")
        colour = self.stage.node("CombineXYZ", self.spread(0.2, 0.8), 0.4, 0.2)
        self.stage.principled(Subsurface_Weight=1.0, Subsurface_Radius=(1, 0.5, 0.25), Subsurface_Scale=0.1,
                              Base_Color=colour, Specular_IOR_Level=0.0, subsurface_method="BURLEY")
        material, warnings = self.write()
        found = material["extensions"]
        medium = found["KHR_materials_volume_scatter"]["multiscatterColor"]
        numpy.testing.assert_allclose(medium, [0.77, 0.4, 0.2], atol=0.01)  # at the end of the sphere
        places, tint = self.look_up(found["KHR_materials_diffuse_transmission"]["diffuseTransmissionColorTexture"])
        expected = 0.2 + 0.6 * (places[:, 0] + 1) / 2
        error = numpy.abs(linear(tint[:, 0]) ** 2 * medium[0] - expected)
        self.assertLess(numpy.quantile(error, 0.95), 0.03)
        self.assertFalse([line for line in warnings if "ubsurface" in line])

    def test_subsurface_scattering_is_mixed_with_diffuse_reflection(self):
        self.stage.shape("cube")
        inside = self.stage.node("SubsurfaceScattering", Color=(0.8, 0.4, 0.2), Radius=(1, 0.5, 0.25), Scale=0.1)
        outside = self.stage.node("BsdfDiffuse", Color=(0.2, 0.6, 0.4))
        self.stage.mix(0.25, inside, outside)
        material, warnings = self.write()
        found = material["extensions"]
        self.assertAlmostEqual(found["KHR_materials_diffuse_transmission"]["diffuseTransmissionFactor"], 0.75, 5)
        numpy.testing.assert_allclose(material["pbrMetallicRoughness"]["baseColorFactor"][:3], (0.2, 0.6, 0.4), atol=1e-4)
        self.assertIn("KHR_materials_volume_scatter", found)
        self.assertFalse([line for line in warnings if "ubsurface" in line])

    def test_losses_are_named(self):
        losses = {
            "sheen": dict(Sheen_Weight=1.0), "above it": dict(Sheen_Weight=1.0, Coat_Weight=0.5),
            "rim": dict(Metallic=1.0, Specular_Tint=(1, 0.5, 0.5)),
        }
        for words, inputs in losses.items():
            self.setUp()
            self.stage.principled(**inputs)
            _, warnings = self.write()
            self.assertTrue(any(words in line for line in warnings), (words, warnings))

    def test_no_material_is_grey(self):
        self.write_grey()
        bare = self.document["meshes"][next(n["mesh"] for n in self.document["nodes"] if n["name"] == "body")]
        entry = self.document["materials"][bare["primitives"][0]["material"]]
        self.assertEqual(entry["pbrMetallicRoughness"], {"baseColorFactor": [0.8, 0.8, 0.8, 1], "metallicFactor": 0})

    def write_grey(self):
        export.write(self.path, bake_size=SIZE)
        self.document, self.buffer = glb.read(self.path)


if __name__ == "__main__":
    unittest.main()
