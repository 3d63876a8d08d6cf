"""Tests conversion of UsdPreviewSurface, OpenPBR and Standard Surface, and of their textures."""

import io
import math
import unittest

import numpy
from PIL import Image
from pxr import Gf, Sdf, UsdGeom, UsdShade, Vt

import usd_support
from usd_support import corners

OPEN_PBR, STANDARD = "ND_open_pbr_surface_surfaceshader", "ND_standard_surface_surfaceshader"


class Materials(usd_support.Stages):
    def setUp(self):
        super().setUp()
        self.closed = UsdGeom.Cube.Define(self.stage, "/Cube")

    def worn(self, kind="UsdPreviewSurface", context="", prim=None, **inputs):
        """The glTF material of a shader with these inputs, and the losses."""
        self.bind(prim or self.closed, self.material(kind=kind, context=context, **inputs))
        document, _, lost = self.convert()
        return document["materials"][0], lost

    def test_preview_surface(self):
        found, lost = self.worn(diffuseColor=(0.1, 0.2, 0.3), metallic=0.25, roughness=0.75, ior=1.4, clearcoat=0.5,
                                clearcoatRoughness=0.2, emissiveColor=(4.0, 2.0, 0.0))
        core, extensions = found["pbrMetallicRoughness"], found["extensions"]
        numpy.testing.assert_allclose(core["baseColorFactor"], [0.1, 0.2, 0.3, 1], rtol=1e-6)
        self.assertEqual((core["metallicFactor"], core["roughnessFactor"]), (0.25, 0.75))
        self.assertAlmostEqual(extensions["KHR_materials_ior"]["ior"], 1.4, places=6)
        self.assertEqual(extensions["KHR_materials_clearcoat"]["clearcoatFactor"], 0.5)
        self.assertEqual(found["emissiveFactor"], [1, 0.5, 0])
        self.assertEqual(extensions["KHR_materials_emissive_strength"]["emissiveStrength"], 4)
        self.assertEqual(lost, [])

    def test_the_specular_workflow_keeps_the_reflectance(self):
        found, _ = self.worn(useSpecularWorkflow=1, specularColor=(0.2, 0.1, 0.0), metallic=0.5)
        ior = found["extensions"]["KHR_materials_ior"]["ior"]
        reflectance = ((ior - 1) / (ior + 1)) ** 2 * numpy.array(
            found["extensions"]["KHR_materials_specular"]["specularColorFactor"])
        numpy.testing.assert_allclose(reflectance, [0.2, 0.1, 0], atol=1e-6)
        self.assertEqual(found["pbrMetallicRoughness"]["metallicFactor"], 0)

    def test_opacity_is_glass_presence_or_a_cut_out(self):
        found, lost = self.worn(opacity=0.0, roughness=0.0, ior=1.45)
        self.assertEqual(found["extensions"]["KHR_materials_transmission"]["transmissionFactor"], 1)
        self.assertEqual(found["extensions"]["KHR_materials_volume"]["thicknessFactor"], 1)
        self.assertEqual((found["pbrMetallicRoughness"]["baseColorFactor"], lost), ([1, 1, 1, 1], []))
        found, _ = self.worn(opacity=0.5, opacityThreshold=0.25)
        self.assertEqual((found["alphaMode"], found["alphaCutoff"]), ("MASK", 0.25))
        self.assertNotIn("KHR_materials_transmission", found["extensions"])
        shader = UsdShade.Shader.Get(self.stage, "/Material/Shader")
        shader.GetInput("opacityThreshold").Set(0.0)
        shader.CreateInput("opacityMode", Sdf.ValueTypeNames.Token).Set("presence")
        self.assertEqual(self.convert()[0]["materials"][0]["alphaMode"], "BLEND")

    def test_metal_stays_opaque_with_a_warning(self):
        found, lost = self.worn(opacity=0.5, metallic=1.0)
        self.assertNotIn("KHR_materials_transmission", found.get("extensions", {}))
        self.assertEqual(lost, ['/Material/Shader: opacity 0.5 is not carried: metal is opaque (opacityMode "presence" '
                                "makes holes in it)"])

    def test_glass_on_a_mesh_with_holes_is_a_pane(self):
        pane = self.mesh("/Pane", [(0, 0, 0), (1, 0, 0), (1, 1, 0)], [3], [0, 1, 2])
        self.stage.RemovePrim("/Cube")
        found, lost = self.worn(prim=pane, opacity=0.0)
        self.assertEqual(found["extensions"]["KHR_materials_volume"]["thicknessFactor"], 0)
        self.assertIn("/Material: a mesh with holes uses it", lost[0])

    def test_glass_of_either_model_of_materialx(self):
        UsdGeom.SetStageMetersPerUnit(self.stage, 0.01)
        cases = {
            OPEN_PBR: dict(transmission_weight=1.0, transmission_color=(0.5, 0.25, 1.0), transmission_depth=2.0,
                           specular_ior=1.6, specular_roughness=0.0, transmission_dispersion_scale=1.0,
                           transmission_dispersion_abbe_number=40.0),
            STANDARD: dict(transmission=1.0, transmission_color=(0.5, 0.25, 1.0), transmission_depth=2.0,
                           specular_IOR=1.6, specular_roughness=0.0, transmission_dispersion=40.0),
        }
        for kind, inputs in cases.items():
            found, lost = self.worn(kind, "mtlx", **inputs)
            extensions = found["extensions"]
            self.assertEqual(extensions["KHR_materials_transmission"]["transmissionFactor"], 1)
            self.assertAlmostEqual(extensions["KHR_materials_ior"]["ior"], 1.6, places=6)
            self.assertEqual(extensions["KHR_materials_volume"], {
                "thicknessFactor": 1, "attenuationColor": [0.5, 0.25, 1], "attenuationDistance": 0.02})
            self.assertEqual(extensions["KHR_materials_dispersion"]["dispersion"], 0.5)
            self.assertEqual(found["pbrMetallicRoughness"]["baseColorFactor"], [1, 1, 1, 1])
            self.assertEqual(lost, [])
            self.stage.RemovePrim("/Material")

    def test_scattering_inside_is_a_medium(self):
        found, _ = self.worn(OPEN_PBR, "mtlx", transmission_weight=1.0, transmission_color=(0.5, 0.5, 0.5),
                             transmission_depth=0.5, transmission_scatter=(0.1, 0.2, 0.3))
        medium = found["extras"]["caustique"]["medium"]
        numpy.testing.assert_allclose(medium["sigma_s"], [0.2, 0.4, 0.6], rtol=1e-6)
        numpy.testing.assert_allclose(numpy.add(medium["sigma_a"], medium["sigma_s"]), [2 * math.log(2)] * 3, rtol=1e-6)

    def test_thin_films_are_iridescence(self):
        for kind, factor, inputs in (
                (OPEN_PBR, 0.5, {"thin_film_weight": 0.5, "thin_film_thickness": 0.4, "thin_film_ior": 1.25}),
                (STANDARD, 1.0, {"thin_film_thickness": 400.0, "thin_film_IOR": 1.25})):
            found, lost = self.worn(kind, "mtlx", **inputs)
            film = found["extensions"]["KHR_materials_iridescence"]
            self.assertEqual((film["iridescenceFactor"], film["iridescenceIor"]), (factor, 1.25))
            self.assertAlmostEqual(film["iridescenceThicknessMaximum"], 400, places=3)
            self.assertEqual(lost, [])
            self.stage.RemovePrim("/Material")

    def test_diffuse_roughness_is_a_key_of_the_extras(self):
        for kind, name in ((OPEN_PBR, "base_diffuse_roughness"), (STANDARD, "diffuse_roughness")):
            found, lost = self.worn(kind, "mtlx", **{name: 0.5})
            self.assertEqual((found["extras"]["caustique"], lost), ({"diffuse_roughness": 0.5}, []))
            self.stage.RemovePrim("/Material")

    def test_subsurface_scattering_of_a_thin_sheet_leaves_on_both_sides(self):
        """Seen against a white sky, reflected and transmitted light add up to the mixed colour."""
        for kind, thin, weight, ahead in (
                (OPEN_PBR, "geometry_thin_walled", "subsurface_weight", "subsurface_scatter_anisotropy"),
                (STANDARD, "thin_walled", "subsurface", "subsurface_anisotropy")):
            for share, g in ((1.0, 0.0), (0.6, 0.5)):
                found, lost = self.worn(kind, "mtlx", base_color=(0.2,) * 3, subsurface_color=(0.5, 0.25, 1.0),
                                        **{thin: True, weight: share, ahead: g})
                sheet = found["extensions"]["KHR_materials_diffuse_transmission"]
                through = sheet["diffuseTransmissionFactor"]
                self.assertAlmostEqual(through, share * (1 + g) / 2, places=6)
                numpy.testing.assert_allclose(sheet["diffuseTransmissionColorFactor"], [0.5, 0.25, 1])
                all_ = (1 - through) * numpy.array(found["pbrMetallicRoughness"]["baseColorFactor"][:3]) \
                    + through * numpy.array([0.5, 0.25, 1])
                numpy.testing.assert_allclose(all_, [0.2 * (1 - share) + share * c for c in (0.5, 0.25, 1)], rtol=1e-5)
                self.assertNotIn("KHR_materials_volume", found["extensions"])
                self.assertEqual(lost, [])
                self.stage.RemovePrim("/Material")

    def test_subsurface_scattering_of_a_closed_mesh_is_a_medium(self):
        """A cube of short mean free paths has the subsurface colour in a white sky, as a constant and as a texture."""
        self.camera((0, 0, 6), width=1.0)
        self.light("DomeLight", intensity=1.0)
        material = self.material(kind=OPEN_PBR, context="mtlx", subsurface_weight=1.0, base_color=(0.1, 0.1, 0.1),
                                 subsurface_color=(0.2, 0.5, 0.8), subsurface_radius=0.01, specular_weight=0.0)
        self.bind(self.closed, material)
        options = ("--width", 8, "--height", 8, "--iterations", 64, "--method", "path", "--no-combine")
        seen = self.render(*options).mean((0, 1))
        numpy.testing.assert_allclose(seen, [0.2, 0.5, 0.8], atol=0.02)
        document, _, lost = self.convert()
        self.assertEqual(lost, [])
        medium = document["materials"][0]["extensions"]["KHR_materials_volume"]
        self.assertAlmostEqual(medium["attenuationDistance"], 0.0025, places=6)
        numpy.testing.assert_allclose(medium["attenuationColor"], numpy.exp([-0.25, -0.5, -1]), rtol=1e-5)
        Image.fromarray(numpy.full((2, 2, 3), 188, numpy.uint8)).save(self.dir / "grey.png")
        image = UsdShade.Shader.Define(self.stage, "/Material/image")
        image.CreateIdAttr("ND_image_color3")
        image.CreateInput("file", Sdf.ValueTypeNames.Asset).Set("grey.png")
        shader = UsdShade.Shader.Get(self.stage, "/Material/Shader")
        shader.GetInput("subsurface_color").ConnectToSource(image.CreateOutput("out", Sdf.ValueTypeNames.Color3f))
        numpy.testing.assert_allclose(self.render(*options).mean((0, 1)), [0.503] * 3, atol=0.02)
        # Holes: there is no inside.
        open_ = self.mesh("/Open", [(0, 0, 0), (1, 0, 0), (0, 1, 0)], [3], [0, 1, 2])
        self.bind(open_, material)
        self.assertIn("/Material: subsurface scattering needs a closed mesh", "\n".join(self.convert()[2]))

    def test_losses_of_materialx_are_named(self):
        found, lost = self.worn("ND_disney_principled", "mtlx")
        self.assertIn("a surface ND_disney_principled is not read", lost[0])
        self.assertIn("/Material", lost[0])

    def test_a_network_that_is_not_read_leaves_the_preview(self):
        material = self.material(roughness=0.25)
        other = UsdShade.Shader.Define(self.stage, "/Material/Other")
        other.CreateIdAttr("ND_surface")
        material.CreateSurfaceOutput("mtlx").ConnectToSource(other.CreateOutput("surface", Sdf.ValueTypeNames.Token))
        self.bind(self.closed, material)
        document, _, lost = self.convert()
        self.assertEqual(document["materials"][0]["pbrMetallicRoughness"]["roughnessFactor"], 0.25)
        self.assertEqual(lost, ["/Material: a surface ND_surface is not read: its UsdPreviewSurface takes its place"])

    def test_the_preview_as_a_node_of_materialx(self):
        self.worn("ND_UsdPreviewSurface_surfaceshader", "mtlx", diffuseColor=(0.1, 0.2, 0.3))
        material = UsdShade.Material.Get(self.stage, "/Material")
        shader = UsdShade.Shader.Get(self.stage, "/Material/Shader")
        # As exporters write it: interface inputs of the material, some of them set.
        roughness = material.CreateInput("roughness", Sdf.ValueTypeNames.Float)
        roughness.Set(0.25)
        shader.CreateInput("roughness", Sdf.ValueTypeNames.Float).ConnectToSource(roughness)
        metallic = material.CreateInput("metallic", Sdf.ValueTypeNames.Float)
        shader.CreateInput("metallic", Sdf.ValueTypeNames.Float).ConnectToSource(metallic)
        document, _, lost = self.convert()
        core = document["materials"][0]["pbrMetallicRoughness"]
        numpy.testing.assert_allclose(core["baseColorFactor"], [0.1, 0.2, 0.3, 1], rtol=1e-6)
        self.assertEqual((core["roughnessFactor"], core["metallicFactor"], lost), (0.25, 0, []))

    def test_keys_of_caustique(self):
        material = self.material(opacity=0.0)
        prim = material.GetPrim()
        prim.CreateAttribute("caustique:priority", Sdf.ValueTypeNames.Int).Set(3)
        prim.CreateAttribute("caustique:medium:sigma_a", Sdf.ValueTypeNames.Float3).Set(Gf.Vec3f(1, 2, 3))
        self.closed.GetPrim().CreateAttribute("caustique:visible:camera", Sdf.ValueTypeNames.Bool).Set(False)
        self.bind(self.closed, material)
        document, _, _ = self.convert()
        self.assertEqual(document["materials"][0]["extras"]["caustique"],
                         {"priority": 3, "medium": {"sigma_a": [1, 2, 3]}})
        self.assertEqual(document["nodes"][0]["extras"]["caustique"], {"visible": {"camera": False}})

    def test_a_bound_material_that_does_not_exist_is_named(self):
        UsdShade.MaterialBindingAPI.Apply(self.closed.GetPrim()).GetPrim().CreateRelationship(
            "material:binding").SetTargets(["/Nothing"])
        self.assertIn("/Cube: the material /Nothing is not there", self.convert()[2])


class Textures(usd_support.Stages):
    """A square with coordinates `st` equal to its positions, and images of 2 by 2 texels, top row first."""

    def setUp(self):
        super().setUp()
        self.square = self.mesh("/Square", [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [4], [0, 1, 2, 3])
        st = UsdGeom.PrimvarsAPI(self.square).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, "vertex")
        st.Set(Vt.Vec2fArray([(0, 0), (1, 0), (1, 1), (0, 1)]))
        self.surface = self.material()
        self.shader = UsdShade.Shader.Get(self.stage, "/Material/Shader")
        self.bind(self.square, self.surface)

    def texture(self, name, texels, to, output="rgb", transform=None, **inputs):
        """Connect an image to the input `to`. `transform`: inputs of a UsdTransform2d."""
        Image.fromarray(numpy.array(texels, numpy.uint8)).save(self.dir / f"{name}.png")
        image = UsdShade.Shader.Define(self.stage, f"/Material/{name}")
        image.CreateIdAttr("UsdUVTexture")
        image.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(f"{name}.png")
        reader = UsdShade.Shader.Define(self.stage, f"/Material/{name}_st")
        reader.CreateIdAttr("UsdPrimvarReader_float2")
        reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("st")
        last = reader.CreateOutput("result", Sdf.ValueTypeNames.Float2)
        if transform:
            turn = UsdShade.Shader.Define(self.stage, f"/Material/{name}_transform")
            turn.CreateIdAttr("UsdTransform2d")
            turn.CreateInput("in", Sdf.ValueTypeNames.Float2).ConnectToSource(last)
            for key, value in transform.items():
                kind = Sdf.ValueTypeNames.Float if key == "rotation" else Sdf.ValueTypeNames.Float2
                turn.CreateInput(key, kind).Set(value)
            last = turn.CreateOutput("result", Sdf.ValueTypeNames.Float2)
        image.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(last)
        for key, value in inputs.items():
            kind = Sdf.ValueTypeNames.Token if isinstance(value, str) else Sdf.ValueTypeNames.Float4
            image.CreateInput(key, kind).Set(value if isinstance(value, str) else Gf.Vec4f(*value))
        kind = Sdf.ValueTypeNames.Float if len(output) == 1 else Sdf.ValueTypeNames.Float3
        given = self.shader.CreateInput(to, Sdf.ValueTypeNames.Color3f if kind == Sdf.ValueTypeNames.Float3 else kind)
        given.ConnectToSource(image.CreateOutput(output, kind))

    def made(self):
        """The material, its images (arrays of bytes), and the losses."""
        document, buffer, lost = self.convert()
        views = [document["bufferViews"][image["bufferView"]] for image in document.get("images", ())]
        images = [numpy.asarray(Image.open(io.BytesIO(buffer[v["byteOffset"]:v["byteOffset"] + v["byteLength"]])))
                  for v in views]
        self.sources = [texture["source"] for texture in document.get("textures", ())]
        return document["materials"][0], images, lost

    COLOURS = [[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [128, 128, 128]]]

    def test_a_colour_is_carried_as_it_is_and_upright(self):
        self.texture("colour", self.COLOURS, "diffuseColor", sourceColorSpace="sRGB", scale=(0.5, 0.5, 0.5, 1))
        found, images, lost = self.made()
        numpy.testing.assert_array_equal(images[0], self.COLOURS)
        self.assertEqual(found["pbrMetallicRoughness"]["baseColorFactor"][:3], [0.5] * 3)
        self.assertEqual(lost, [])
        document, buffer, _ = self.convert()
        at = corners(document, buffer)
        numpy.testing.assert_allclose(at["TEXCOORD_0"], numpy.stack(
            [at["POSITION"][:, 0], 1 - at["POSITION"][:, 1]], axis=1))

    def test_a_raw_colour_and_one_with_a_bias_are_baked(self):
        self.texture("colour", self.COLOURS, "diffuseColor", sourceColorSpace="raw", scale=(0.5,) * 4, bias=(0.25,) * 4)
        _, images, _ = self.made()
        linear = numpy.array(self.COLOURS) / 255 * 0.5 + 0.25
        encoded = 1.055 * linear ** (1 / 2.4) - 0.055
        numpy.testing.assert_allclose(images[0], encoded * 255, atol=0.51)

    def test_roughness_and_metalness_share_an_image(self):
        self.texture("rough", [[[10, 20, 30], [40, 50, 60]]] * 2, "roughness", "b", sourceColorSpace="raw")
        self.texture("metal", [[[1, 2, 3], [4, 5, 6]]] * 2, "metallic", "r", sourceColorSpace="raw")
        found, images, _ = self.made()
        self.assertEqual(images[0][0].tolist(), [[255, 30, 1], [255, 60, 4]])
        core = found["pbrMetallicRoughness"]
        self.assertEqual((core["roughnessFactor"], core["metallicFactor"]), (1, 1))

    def test_one_image_with_the_right_channels_is_taken_as_it_is(self):
        texels = [[[10, 20, 30], [40, 50, 60]]] * 2
        for to, output in (("roughness", "g"), ("metallic", "b")):
            self.texture("orm", texels, to, output, sourceColorSpace="raw")
        _, images, _ = self.made()
        self.assertEqual(images[0].tolist(), texels)
        self.assertEqual(len(images), 1)

    def test_presence_by_another_image(self):
        self.texture("colour", self.COLOURS, "diffuseColor", sourceColorSpace="sRGB")
        self.texture("mask", [[0, 255], [128, 255]], "opacity", "r", sourceColorSpace="raw")
        found, images, lost = self.made()
        self.assertEqual(images[0][:, :, 3].tolist(), [[0, 255], [128, 255]])
        numpy.testing.assert_allclose(images[0][:, :, :3], self.COLOURS, atol=1)
        self.assertEqual(found["alphaMode"], "BLEND")
        self.assertEqual(len(lost), 1)

    def test_normals(self):
        self.texture("normal", [[[128, 128, 255]]], "normal", sourceColorSpace="raw", scale=(2, 2, 2, 1),
                     bias=(-1, -1, -1, 0))
        found, images, lost = self.made()
        self.assertEqual((images[0].tolist(), lost), ([[[128, 128, 255]]], []))
        self.assertNotIn("scale", found["normalTexture"])

    def test_textures_of_coats_and_of_diffuse_roughness(self):
        """Of either model, with a factor; raw values are stored as they are, and colours as sRGB."""
        for kind, names in ((OPEN_PBR, ("base_diffuse_roughness", "coat_weight", "coat_color", "coat_ior")),
                            (STANDARD, ("diffuse_roughness", "coat", "coat_color", "coat_IOR"))):
            self.setUp()
            self.surface_of(kind, **{names[1]: 1.0})
            grey = [[[51] * 3, [102] * 3], [[204] * 3, [255] * 3]]
            self.texture("rough", grey, names[0], "r", sourceColorSpace="raw")
            self.texture("colour", self.COLOURS, names[2], sourceColorSpace="sRGB", scale=(0.5, 0.5, 0.5, 1))
            self.texture("index", grey, names[3], "r", sourceColorSpace="raw", scale=(2,) * 4, bias=(0.8,) * 4)
            found, images, lost = self.made()
            own = found["extras"]["caustique"]
            textures = [own[f"{name}_texture"]["index"] for name in ("diffuse_roughness", "coat_color", "coat_ior")]
            self.assertEqual(len(set(textures)), 3)
            rough, colour, index = (images[self.sources[at]] for at in textures)
            numpy.testing.assert_array_equal(rough, grey)
            numpy.testing.assert_array_equal(colour, self.COLOURS)
            self.assertEqual((own["diffuse_roughness"], own["coat_color"], lost), (1, [0.5] * 3, []))
            values = 1 + (own["coat_ior"] - 1) * index[:, :, 0] / 255
            numpy.testing.assert_allclose(values, numpy.array([[1.2, 1.6], [2.4, 2.8]]), atol=0.005)

    def test_the_thickness_of_a_film_by_a_texture(self):
        for kind, unit in ((OPEN_PBR, 1000.0), (STANDARD, 1.0)):
            self.setUp()
            self.surface_of(kind, **({"thin_film_weight": 1.0} if kind == OPEN_PBR else {}))
            self.texture("film", [[0, 51], [102, 204]], "thin_film_thickness", "r", sourceColorSpace="raw",
                         scale=(500 / unit,) * 4)
            found, images, lost = self.made()
            film = found["extensions"]["KHR_materials_iridescence"]
            self.assertAlmostEqual(film["iridescenceThicknessMaximum"], 400, 3)
            self.assertEqual((film["iridescenceThicknessMinimum"], lost), (0, []))
            texels = images[self.sources[film["iridescenceThicknessTexture"]["index"]]]
            numpy.testing.assert_allclose(texels[:, :, 1] / 255 * 400, [[0, 100], [200, 400]], atol=1)

    def test_a_key_of_caustique_replaces_a_texture(self):
        self.surface_of(STANDARD, coat=1.0)
        self.texture("colour", self.COLOURS, "coat_color", sourceColorSpace="sRGB")
        self.surface.GetPrim().CreateAttribute("caustique:coat_color", Sdf.ValueTypeNames.Float3).Set(Gf.Vec3f(1, 0.5, 0))
        self.assertEqual(self.made()[0]["extras"]["caustique"], {"coat_color": [1, 0.5, 0]})

    def surface_of(self, kind, **inputs):
        """Bind a material of MaterialX with these constants, whose shader `texture` connects."""
        self.stage.RemovePrim("/Material")
        self.surface = self.material(kind=kind, context="mtlx", **inputs)
        self.shader = UsdShade.Shader.Get(self.stage, "/Material/Shader")
        self.bind(self.square, self.surface)

    def test_a_transform_reads_the_same_texel(self):
        said = {"scale": Gf.Vec2f(0.5, 2), "rotation": 30.0, "translation": Gf.Vec2f(0.1, 0.2)}
        self.texture("colour", self.COLOURS, "diffuseColor", transform=said, sourceColorSpace="sRGB")
        found, _, _ = self.made()
        made = found["pbrMetallicRoughness"]["baseColorTexture"]["extensions"]["KHR_texture_transform"]
        # The glTF reader's matrix: counter-clockwise with v pointing down (src/scene/gltf/texture.rs).
        cos, sin = math.cos(made["rotation"]), math.sin(made["rotation"])
        x, y = made["scale"]
        matrix = numpy.array([[cos * x, sin * y], [-sin * x, cos * y]])
        for s, t in ((0, 0), (1, 0), (0, 1), (0.3, 0.8)):
            u, v = matrix @ (s, 1 - t) + made["offset"]
            a = math.radians(30)
            ours = (math.cos(a) * 0.5 * s - math.sin(a) * 2 * t + 0.1,
                    math.sin(a) * 0.5 * s + math.cos(a) * 2 * t + 0.2)
            numpy.testing.assert_allclose((u, 1 - v), ours, atol=1e-6)

    def test_displaycolor_by_a_primvar_reader(self):
        self.square.CreateDisplayColorAttr([Gf.Vec3f(0.25, 0.5, 0.75)])
        reader = UsdShade.Shader.Define(self.stage, "/Material/reader")
        reader.CreateIdAttr("UsdPrimvarReader_float3")
        reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("displayColor")
        self.shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).ConnectToSource(
            reader.CreateOutput("result", Sdf.ValueTypeNames.Float3))
        found = corners(*self.convert()[:2])
        numpy.testing.assert_allclose(found["COLOR_0"], [[0.25, 0.5, 0.75, 1]] * 6)

    def test_a_missing_and_a_damaged_file(self):
        self.texture("colour", self.COLOURS, "diffuseColor")
        (self.dir / "colour.png").write_bytes(b"\x89PNG no more")
        fallback = UsdShade.Shader.Get(self.stage, "/Material/colour").CreateInput("fallback", Sdf.ValueTypeNames.Float4)
        fallback.Set(Gf.Vec4f(1, 0.5, 0.25, 1))
        for what in ("the image colour.png cannot be read", "the file colour.png is not found"):
            document, _, lost = self.convert()
            self.assertIn(f"/Material/colour: {what}", lost[0])
            self.assertIn("it has its fallback", lost[0])
            self.assertEqual(document["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"], [1, 0.5, 0.25, 1])
            (self.dir / "colour.png").unlink(missing_ok=True)

    def test_textures_in_a_package(self):
        from pxr import UsdUtils
        self.texture("colour", self.COLOURS, "diffuseColor", sourceColorSpace="sRGB")
        self.stage.GetRootLayer().Save()
        package = self.dir / "packed.usdz"
        self.assertTrue(UsdUtils.CreateNewUsdzPackage(str(self.path), str(package)))
        (self.dir / "colour.png").unlink()
        document, _, lost = self.convert(package)
        self.assertEqual((len(document["images"]), lost), (1, []))


if __name__ == "__main__":
    unittest.main()
