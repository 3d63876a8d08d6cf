"""Stages for the tests with USD: written by usd-core, converted, rendered, and their pictures read."""

import json
import struct

import numpy
import OpenEXR
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade

import support
import convert

SCRIPTS = support.ROOT / "scripts" / "usd"


class Stages(support.Scratch):
    """A test case that writes a stage, `self.stage`, y up and in metres unless a test changes that."""

    def setUp(self):
        super().setUp()
        self.path = self.dir / "stage.usda"
        self.stage = Usd.Stage.CreateNew(str(self.path))
        UsdGeom.SetStageUpAxis(self.stage, UsdGeom.Tokens.y)
        UsdGeom.SetStageMetersPerUnit(self.stage, 1.0)

    def convert(self, path=None, **options):
        """Saves the stage and converts it (or the one at `path`): the document, its buffer, and what was lost."""
        self.stage.GetRootLayer().Save()
        lost = convert.write(str(path or self.path), str(self.dir / "out.glb"), **options)
        return *read_glb(self.dir / "out.glb"), lost

    def render(self, *options, layer="Noisy"):
        """Saves, converts and renders: the layer's picture (height, width, 3) in double precision."""
        self.convert()
        out = self.dir / "out.exr"
        support.run(["render", self.dir / "out.glb", "-o", out, "--progress", "none", *options], check=0)
        return read_exr(out, layer)

    def mesh(self, path, points, counts, indices, scheme="none"):
        """A mesh of polygons."""
        mesh = UsdGeom.Mesh.Define(self.stage, path)
        mesh.CreatePointsAttr(points)
        mesh.CreateFaceVertexCountsAttr(counts)
        mesh.CreateFaceVertexIndicesAttr(indices)
        mesh.CreateSubdivisionSchemeAttr(scheme)
        return mesh

    def floor(self, albedo=0.5, half=1.0):
        """A diffuse square that faces up, the stage's y, around the origin."""
        mesh = self.mesh("/Floor", [(-half, 0, half), (half, 0, half), (half, 0, -half), (-half, 0, -half)], [4],
                         [0, 1, 2, 3])
        mesh.CreateDisplayColorAttr([Gf.Vec3f(albedo)])
        return mesh

    def camera(self, eye, target=(0, 0, 0), width=0.02, up=(0, 1, 0)):
        """A camera whose square picture shows so much across at the target's distance."""
        camera = UsdGeom.Camera.Define(self.stage, "/Camera")
        distance = (Gf.Vec3d(*target) - Gf.Vec3d(*eye)).GetLength()
        camera.CreateHorizontalApertureAttr(20.0)
        camera.CreateVerticalApertureAttr(20.0)
        camera.CreateFocalLengthAttr(20.0 * distance / width)
        look = Gf.Matrix4d().SetLookAt(Gf.Vec3d(*eye), Gf.Vec3d(*target), Gf.Vec3d(*up)).GetInverse()
        UsdGeom.Xformable(camera).MakeMatrixXform().Set(look)
        return camera

    def light(self, kind, path="/Light", matrix=None, **inputs):
        """A light of UsdLux with inputs, where a matrix puts it."""
        light = getattr(UsdLux, kind).Define(self.stage, path)
        for name, value in inputs.items():
            name = "inputs:" + name.replace("__", ":")
            known = light.GetPrim().GetAttribute(name)
            attribute = known or light.GetPrim().CreateAttribute(name, Sdf.ValueTypeNames.Float)
            attribute.Set(value)
        if matrix is not None:
            UsdGeom.Xformable(light).MakeMatrixXform().Set(matrix)
        return light

    def material(self, path="/Material", kind="UsdPreviewSurface", context="", **inputs):
        """A material of one shader with constant inputs."""
        material = UsdShade.Material.Define(self.stage, path)
        shader = UsdShade.Shader.Define(self.stage, path + "/Shader")
        shader.CreateIdAttr(kind)
        types = {float: Sdf.ValueTypeNames.Float, int: Sdf.ValueTypeNames.Int, tuple: Sdf.ValueTypeNames.Color3f,
                 str: Sdf.ValueTypeNames.Token, bool: Sdf.ValueTypeNames.Bool}
        for name, value in inputs.items():
            shader.CreateInput(name, types[type(value)]).Set(Gf.Vec3f(*value) if isinstance(value, tuple) else value)
        output = shader.CreateOutput("surface", Sdf.ValueTypeNames.Token)
        material.CreateSurfaceOutput(context).ConnectToSource(output)
        return material

    def bind(self, prim, material):
        """Lets a prim wear a material."""
        UsdShade.MaterialBindingAPI.Apply(getattr(prim, "GetPrim", lambda: prim)()).Bind(material)


def down(height=0.0):
    """From a light's own axes to one at this height that shines down."""
    return Gf.Matrix4d().SetRotate(Gf.Rotation(Gf.Vec3d(1, 0, 0), -90)) * Gf.Matrix4d().SetTranslate((0, height, 0))


def read_glb(path):
    """The document and the buffer of a .glb."""
    data = path.read_bytes()
    size = struct.unpack_from("<I", data, 12)[0]
    return json.loads(data[20:20 + size]), data[28 + size:]


def values(document, buffer, index):
    """The numbers (count, width) of an accessor."""
    accessor = document["accessors"][index]
    view = document["bufferViews"][accessor["bufferView"]]
    width = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}[accessor["type"]]
    kind = {5126: "<f4", 5125: "<u4"}[accessor["componentType"]]
    return numpy.frombuffer(buffer, kind, accessor["count"] * width, view["byteOffset"]).reshape(-1, width)


def corners(document, buffer, mesh=0, primitive=0):
    """Attributes of a primitive at the corners of its triangles, {name: (3 * triangles, width)}."""
    entry = document["meshes"][mesh]["primitives"][primitive]
    index = values(document, buffer, entry["indices"]).reshape(-1)
    return {name: values(document, buffer, at)[index] for name, at in entry["attributes"].items()}


def read_exr(path, layer="Noisy"):
    """A layer of three channels (height, width, 3); "" is the picture."""
    channels = OpenEXR.File(str(path), separate_channels=True).channels()
    names = [f"{layer}.{c}" if layer else c for c in "RGB"]
    return numpy.stack([channels[name].pixels.astype(float) for name in names], axis=2)
