"""Tests invalid stages: each has a loss that names the prim, or a `Fault` if a renderer of OpenUSD would refuse it."""

import contextlib
import io
import itertools
import json
import os
import subprocess
import sys
import unittest

import numpy
from PIL import Image

import usd_support
from faults import Fault
from usd_support import convert

MESH = """def Mesh "Mesh" {
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    uniform token subdivisionScheme = "none"
    %s
}
"""
WORN = (MESH % "rel material:binding = </Material>").replace(
    '"Mesh" {', '"Mesh" (prepend apiSchemas = ["MaterialBindingAPI"]) {') + """def Material "Material" {
    token outputs:surface.connect = </Material/Surface.outputs:surface>
    def Shader "Surface" {
        %s
        token outputs:surface
    }
    %s
}
"""
PREVIEW = 'uniform token info:id = "UsdPreviewSurface"\n'


def worn(surface, nodes="", kind=PREVIEW):
    """A mesh with a surface with these inputs. `nodes`: other nodes of the material."""
    return WORN % (kind + surface, nodes)


def textured(surface, texture, output="float3 outputs:rgb", kind="UsdUVTexture"):
    """A mesh with a textured surface."""
    return worn(surface, f'def Shader "Texture" {{\nuniform token info:id = "{kind}"\n{texture}\n{output}\n}}')


def prim(kind, attributes):
    """A prim /P of a type."""
    return f'def {kind} "P" {{\n{attributes}\n}}\n'


BASE = "color3f inputs:diffuseColor.connect = </Material/Texture.outputs:{}>"
FILE = "asset inputs:file = @grey.png@\n"


class Faults(usd_support.Stages):
    names = itertools.count()

    def outcome(self, text, frame=None):
        """The text of the Fault or of the losses of a stage with this text."""
        # A new name, because USD caches files that it has read.
        self.path = self.dir / f"{next(self.names)}.usda"
        text = text if isinstance(text, bytes) else text.encode()
        self.path.write_bytes(text if text.startswith(b"version") else b"#usda 1.0\n" + text)
        try:
            lost = convert.write(str(self.path), str(self.dir / "out.glb"), frame)
            convert.arguments(str(self.path))
        except Fault as fault:
            return f"{fault} ({fault.hint})"
        return "\n".join(lost)

    def check(self, *cases):
        for text, said in cases:
            with self.subTest(said):
                self.assertIn(said, self.outcome(text))

    def test_values_of_another_type_than_their_schema_has(self):
        self.check(
            (prim("Sphere", 'string radius = "x"'), "/P: radius is a text, not a double"),
            (prim("Sphere", 'flot radius = 1'), "/P: radius is a value of an unknown type, not a double"),
            (MESH % "int2 holeIndices = (1, 2)", "/Mesh: holeIndices is a Vec2, not a int[]"),
            (prim("SphereLight", 'token inputs:intensity = "a"'), "/P: inputs:intensity is a text, not a float"),
            (prim("DomeLight", 'string inputs:texture:file = "a"'), "/P: inputs:texture:file is a text, not a asset"),
            (prim("RenderSettings", 'float resolution = 2'), "/P: resolution is a number, not a int2"),
        )

    def test_numbers_that_are_not_finite(self):
        self.check(
            (prim("Camera", 'float fStop = nan'), "/P: fStop is nan, which is not finite"),
            (prim("Camera", 'float exposure = 1e38'), "/P: its exposure brightens by inf"),
            (prim("SphereLight", 'float inputs:exposure = 1e38'), "/P: its colour or intensity is not finite"),
            (prim("DistantLight", 'float inputs:intensity = inf'), "/P: inputs:intensity is inf"),
            (worn("float inputs:roughness = nan"), "/Material/Surface: inputs:roughness is nan"),
            (MESH.replace("(1, 0, 0)", "(1e39, 0, 0)").replace("point3f", "point3d") % "", "points"),
            (prim("RenderSettings", 'custom float caustique:exposure = nan'), "/P: caustique:exposure is nan"),
            (prim("RenderSettings", "int2 resolution = (2, 2)\nfloat pixelAspectRatio = 0") + 'def Camera "C" {}',
             "/P: its pixelAspectRatio is 0"),
            ('(\ntimeCodesPerSecond = nan\n)', "timeCodesPerSecond is nan"),
            ('(\nstartTimeCode = inf\nendTimeCode = 2\n)', "its startTimeCode is inf"),
            ('(\nmetersPerUnit = 1e300\n)', "metersPerUnit is 1e+300"),
            (prim("Sphere", 'double3 xformOp:scale = (1e200, 1, 1)\nuniform token[] xformOpOrder = ["xformOp:scale"]'),
             "/P: its transform is not finite"),
        )
        self.assertIn("its frame is nan", self.outcome("", float("nan")))

    def test_unknown_tokens(self):
        self.image("L")
        self.check(
            (prim("Cone", 'uniform token axis = "W"'), "/P: its axis is W, which is none of X, Y and Z"),
            (prim("Plane", 'uniform token axis = ""'), "/P: its axis is "),
            (MESH % 'color3f[] primvars:displayColor = [(1, 0, 0)] ( interpolation = "most" )',
             "/Mesh: displayColor has an interpolation most"),
            (textured(BASE.format("q"), FILE, "float3 outputs:q"), "/Material/Texture: it has no output q"),
        )

    def test_images_of_other_formats_are_refused(self):
        # Pillow hands EPS to Ghostscript, whatever the file is called.
        program = b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 2 2\n%%EndComments\nshowpage\n"
        (self.dir / "e.png").write_bytes(program)
        text = textured(BASE.format("rgb"), 'asset inputs:file = @e.png@\ntoken inputs:sourceColorSpace = "raw"',
                        "float3 outputs:rgb")
        self.assertIn("the image e.png cannot be read: it is none of PNG, JPEG", self.outcome(text))

    def test_messages_are_short(self):
        """Whatever the length of a line that cannot be parsed, of the name of a prim, or of a value."""
        long = 20_000 * "x"
        for text in (f'def "{long}', f"def Mesh {long}", prim("Cone", f'uniform token axis = "{long}"'),
                     f'def Sphere "{long}" {{\nfloat radius = nan\n}}', f"(\nmetersPerUnit = {long}\n)"):
            self.assertLess(len(self.outcome(text)), 2000)

    def test_pointers_of_git_lfs(self):
        """The stage, a layer, an image and a profile."""
        pointer = b"version https://git-lfs.github.com/spec/v1\noid sha256:%s\nsize 12345\n" % (64 * b"0")
        for name in ("a.usdc", "a.png", "a.exr", "a.ies"):
            (self.dir / name).write_bytes(pointer)
        said = "the file is a pointer of Git LFS, not the file that it stands for (run 'git lfs pull' in its folder)"
        self.check(
            (pointer, said),
            ('(\nsubLayers = [@a.usdc@]\n)', said),
            ('def "A" (\nreferences = @a.usdc@\n) {}', said),
            (textured(BASE.format("rgb"), "asset inputs:file = @a.png@"), said),
            (prim("DomeLight", "asset inputs:texture:file = @a.exr@"), said),
            ('def SphereLight "L" ( prepend apiSchemas = ["ShapingAPI"] ) {\nasset inputs:shaping:ies:file = @a.ies@\n}',
             said),
        )

    def test_an_unknown_up_axis(self):
        self.assertEqual(self.outcome('(\nupAxis = "X"\n)'),
                         "/: upAxis is X, which is neither Y nor Z: Y is up (turn the stage by a transform)")

    def test_bytes_that_are_not_utf8(self):
        self.check(
            (b'def Sphere "S" { custom string caustique:name = "\xff" }', "not UTF-8"),
            (b'def \xff\xfe "S" {}', "UTF-8"),
            (b'(\ndoc = "\xff"\n)', "not UTF-8"),
            (b'\xff def Sphere {', "USD cannot read it"),
        )
        said = io.StringIO()
        with contextlib.redirect_stderr(said):
            self.assertEqual(convert.main([str(self.path), "--arguments"]), 1)
        self.assertIn("USD cannot read it", json.loads(said.getvalue())["fault"])

    def test_cycles_and_chains_that_are_too_long(self):
        node = ('def Shader "{0}" {{\nuniform token info:id = "ND_convert_color3_vector3"\n'
                "color3f inputs:in.connect = </Material/{1}.outputs:out>\nfloat3 outputs:out\n}}\n")
        surface = "color3f inputs:diffuseColor.connect = </Material/A.outputs:out>"
        place = ('def Shader "Place" {\nuniform token info:id = "UsdTransform2d"\n'
                 "float2 inputs:in.connect = </Material/Place.outputs:result>\nfloat2 outputs:result\n}\n")
        chain = "".join(node.format(f"N{k}", f"N{k + 1}") for k in range(400))
        self.image("L")
        self.check(
            (worn(surface, node.format("A", "B") + node.format("B", "A")),
             "/Material/A.inputs:in: its network feeds itself"),
            (worn(surface.replace("/A.", "/N0."), chain), "its network is more than 64 nodes deep"),
            (textured(BASE.format("rgb"), FILE + "float2 inputs:st.connect = </Material/Place.outputs:result>").replace(
                'def Shader "Texture"', place + 'def Shader "Texture"'),
             "/Material/Place.inputs:in: its network feeds itself"),
            ('def PointInstancer "I" {\nint[] protoIndices = [0]\npoint3f[] positions = [(0, 0, 0)]\n'
             "rel prototypes = </I>\n}", "/I: it is a part of its own prototypes"),
        )

    def test_constants_of_another_kind_than_an_input_takes(self):
        at = "/Material/Surface: what feeds "
        primvar = 'def Shader "Texture" {\nuniform token info:id = "UsdPrimvarReader_float"\n' \
                  'string inputs:varname = "v"\nfloat outputs:result\n}'
        connected = "float inputs:{}.connect = </Material/Texture.outputs:result>"
        open_pbr = 'uniform token info:id = "ND_open_pbr_surface_surfaceshader"\n'
        self.check(
            (worn('string inputs:roughness = "x"'), at + "roughness is a text, not a number: it has its default"),
            (worn("float inputs:diffuseColor = 1"), at + "diffuseColor is a number, not 3 numbers: it has its default"),
            (worn("float2 inputs:emissiveColor = (1, 2)"), at + "emissiveColor is 2 numbers, not 3 numbers"),
            (worn(connected.format("ior"), primvar), at + "ior is not carried: it has its default"),
            (worn(connected.format("opacity"), primvar), at + "opacity is not carried: it has its default"),
            (worn("int info:id = 4", kind=""), "/Material/Surface: info:id is a number, not a token"),
            (worn("float inputs:base_color = 1", kind=open_pbr).replace("surface.c", "mtlx:surface.c"),
             at + "base_color is a number, not 3 numbers"),
        )
        # A colour with opacity counts as one without.
        self.assertEqual(self.outcome(worn("color4f inputs:diffuseColor = (1, 0.5, 0, 1)")), "")
        document, _ = usd_support.read_glb(self.dir / "out.glb")
        self.assertEqual(document["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"], [1, 0.5, 0, 1])

    def image(self, mode):
        """A grey image in a mode of Pillow: "L", or "LA" with opacity."""
        Image.fromarray(numpy.full((2, 2) if mode == "L" else (2, 2, 2), 128, numpy.uint8)).save(self.dir / "grey.png")

    def test_textures(self):
        self.image("LA")
        # Grey with opacity, as a colour.
        self.assertEqual(self.outcome(textured(BASE.format("rgb"), FILE)), "/Mesh: it has no primvar st for the "
                         "textures of its material: they are one colour on it")
        (self.dir / "none.png").touch()
        self.check(
            (textured(BASE.format("rgb"), "asset inputs:file = @none.png@"),
             "/Material/Texture: the file none.png is empty"),
            (textured(BASE.format("rgb"), "asset inputs:file = @a\0.png@"), "/Material/Texture: no file has a name as"),
            (textured(BASE.format("rgb"), FILE + "float3 inputs:scale = (1, 1, 1)"), "it has no primvar st"),
            (textured(BASE.format("rgb"), FILE + "float inputs:scale = 1"),
             "/Material/Texture: what feeds scale is a number, not 4 numbers"),
        )

    def test_primvars_without_values_and_lights_without_surface(self):
        self.check(
            (MESH % "color3f[] primvars:displayColor = []",
             "/Mesh: its primvar displayColor has no values and is ignored"),
            (MESH % "float2[] primvars:normals = [(0, 1)] ( interpolation = \"uniform\" )",
             "/Mesh: normals has 2 numbers each: they are left out"),
            (prim("CylinderLight", 'float inputs:radius = 0'), "/P: it has no surface: it gives no light"),
        )
        self.assertEqual(self.outcome('def Cylinder "C" {\ndouble radius = 0\ndouble height = 0\n}'), "")
        self.assertEqual(self.outcome('def Camera "C" {\nfloat horizontalAperture = None\n}'), "")
        self.outcome('def SphereLight "L" ( prepend apiSchemas = ["ShapingAPI"] ) {\n'
                     "float inputs:shaping:cone:angle = 0\nfloat inputs:shaping:cone:softness = 0.5\n}")

    def test_attributes_that_are_no_option_are_ignored(self):
        self.check(
            ('def RenderSettings "R" {\ncustom int caustique:medium = 1\ncustom int caustique:medium:g = 2\n}',
             "/R: caustique:medium:g is ignored: what it is a part of has a value of its own"),
            (prim("RenderSettings", "custom int caustique:medium" + 1500 * ":a" + " = 1"),
             "/P: an attribute caustique:* has more than 64 colons: it is ignored"),
            (prim("RenderSettings", "custom quatf caustique:seed = (1, 0, 0, 0)"),
             "/P: caustique:seed is a quatf and is ignored"),
        )

    def test_prims_nested_deeper_than_pythons_recursion_limit(self):
        depth = 1500
        self.assertEqual(self.outcome(depth * 'def Xform "P" {\n' + prim("Sphere", "") + depth * "}\n"), "")
        document, _ = usd_support.read_glb(self.dir / "out.glb")
        self.assertEqual(document["nodes"][0]["name"], (depth + 1) * "/P")

    def test_layers_are_checked_before_they_are_opened(self):
        """A stage does not learn whether a file outside its folder exists, and nothing waits for a pipe."""
        outside, inside = self.dir / "outside", self.dir / "inside"
        outside.mkdir()
        inside.mkdir()
        (outside / "there.usda").write_text("#usda 1.0\n")
        os.mkfifo(outside / "pipe.usda")
        os.mkfifo(inside / "pipe.usda")
        (inside / "link.usda").symlink_to(outside / "there.usda")
        clips = 'def "A" (clips = {{ dictionary default = {{\n asset[] assetPaths = [@{}@]\nstring primPath = "/A"\n' \
            'double2[] active = [(0, 0)]\ndouble2[] times = [(0, 0)]\n}} }}) {{}}'
        arcs = (
            "(subLayers = [@{}@])", 'def "A" (references = @{}@</B>) {{}}', 'def "A" (payload = @{}@</B>) {{}}', clips,
            'def "A" (variantSets = "v"\n) {{\nvariantSet "v" = {{ "x" (references = @{}@) {{\n}}\n}}\n}}',
        )
        said = set()
        for name, arc in itertools.product(("there", "none", "pipe"), arcs):
            with self.subTest(name, arc=arc):
                stage = inside / f"{next(self.names)}.usda"
                stage.write_text("#usda 1.0\n" + arc.format(f"../outside/{name}.usda"))
                with self.assertRaises(Fault) as raised:
                    convert.write(str(stage), str(self.dir / "out.glb"))
                said.add(f"{raised.exception}".replace(name, "NAME"))
        self.assertEqual(said, {f"the stage: the file {outside}/NAME.usda is outside the scene's folder"})
        for name, what in (("pipe", "is not a regular file"), ("link", "is outside the scene's folder")):
            for arc in arcs:
                with self.subTest(name, arc=arc):
                    stage = inside / f"{next(self.names)}.usda"
                    stage.write_text("#usda 1.0\n" + arc.format(f"{name}.usda"))
                    with self.assertRaisesRegex(Fault, what):
                        convert.write(str(stage), str(self.dir / "out.glb"))
        os.mkfifo(inside / "grey.png")
        stage = inside / "texture.usda"
        stage.write_text("#usda 1.0\n" + prim("DomeLight", "asset inputs:texture:file = @grey.png@"))
        with self.assertRaisesRegex(Fault, "grey.png is not a regular file"):
            convert.write(str(stage), str(self.dir / "out.glb"))

    def test_the_files_of_a_stage_are_listed(self):
        """In a process of its own, which looks for files beside the stage alone."""
        (self.dir / "part.usda").write_text('#usda 1.0\n(subLayers = [@`"./${NAME}.usda"`@])\ndef Xform "B" {}\n')
        # Nothing reads the image of a second dome.
        domes = "".join(f'def DomeLight "{name}" {{\nasset inputs:texture:file = @./{name}.png@\n}}\n' for name in "ab")
        (self.dir / "base.usda").write_text(f"#usda 1.0\n{domes}")
        for name in "ab":
            Image.new("RGB", (2, 1)).save(self.dir / f"{name}.png")
        stage = self.dir / "whole.usda"
        stage.write_text('#usda 1.0\n(\nexpressionVariables = {\nstring NAME = "base"\n}\nsubLayers = [@part.usda@]\n)\n')
        command = [sys.executable, usd_support.SCRIPTS / "convert.py", "whole.usda", "-o", "out.glb", "--guard", "60", "0"]
        with subprocess.Popen(command, cwd=self.dir, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as program:
            printed = program.stdout.read()
        names = [str(self.dir / name) for name in ("a.png", "b.png", "base.usda", "part.usda", "whole.usda")]
        self.assertEqual(json.loads(printed), names)

    def test_a_binary_stage_cut_short(self):
        self.outcome(MESH % "")
        self.stage = usd_support.Usd.Stage.Open(str(self.path))
        binary = self.dir / "whole.usdc"
        self.stage.Export(str(binary))
        data = binary.read_bytes()
        for size in (10, len(data) // 2, len(data) - 1):
            (self.dir / "cut.usdc").write_bytes(data[:size])
            with self.assertRaisesRegex(Fault, "USD cannot read it"):
                convert.write(str(self.dir / "cut.usdc"), str(self.dir / "out.glb"))


if __name__ == "__main__":
    unittest.main()
