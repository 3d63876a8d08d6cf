"""Common parts of the USD tests: writing stages with usd-core, converting and rendering them, and reading pictures."""

import json
import struct

import numpy
import OpenEXR
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade

import support
import convert

SCRIPTS = support.ROOT / "scripts" / "usd"


class Stages(support.Scratch):
    """A test case with a stage, `self.stage`, by default with y up and in metres."""

    def setUp(self):
        super().setUp()
        self.path = self.dir / "stage.usda"
        self.stage = Usd.Stage.CreateNew(str(self.path))
        UsdGeom.SetStageUpAxis(self.stage, UsdGeom.Tokens.y)
        UsdGeom.SetStageMetersPerUnit(self.stage, 1.0)

    def convert(self, path=None, **options):
        """Save and convert the stage (or the one at `path`). Returns the document, its buffer, and the losses."""
        self.stage.GetRootLayer().Save()
        lost = convert.write(str(path or self.path), str(self.dir / "out.glb"), **options)
        return *read_glb(self.dir / "out.glb"), lost

    def render(self, *options, layer="Noisy"):
        """Save, convert and render the stage. Returns the layer's picture (height, width, 3), in double precision."""
        self.convert()
        out = self.dir / "out.exr"
        support.run(["render", self.dir / "out.glb", "-o", out, "--progress", "none", *options], check=0)
        return read_exr(out, layer)

    def mesh(self, path, points, counts, indices, scheme="none"):
        """Add a mesh of polygons."""
        mesh = UsdGeom.Mesh.Define(self.stage, path)
        mesh.CreatePointsAttr(points)
        mesh.CreateFaceVertexCountsAttr(counts)
        mesh.CreateFaceVertexIndicesAttr(indices)
        mesh.CreateSubdivisionSchemeAttr(scheme)
        return mesh

    def floor(self, albedo=0.5, half=1.0):
        """Add a diffuse square around the origin that faces +y."""
        mesh = self.mesh("/Floor", [(-half, 0, half), (half, 0, half), (half, 0, -half), (-half, 0, -half)], [4],
                         [0, 1, 2, 3])
        mesh.CreateDisplayColorAttr([Gf.Vec3f(albedo)])
        return mesh

    def camera(self, eye, target=(0, 0, 0), width=0.02, up=(0, 1, 0)):
        """Add a camera with a square picture that shows `width` at the target's distance."""
        camera = UsdGeom.Camera.Define(self.stage, "/Camera")
        distance = (Gf.Vec3d(*target) - Gf.Vec3d(*eye)).GetLength()
        camera.CreateHorizontalApertureAttr(20.0)
        camera.CreateVerticalApertureAttr(20.0)
        camera.CreateFocalLengthAttr(20.0 * distance / width)
        look = Gf.Matrix4d().SetLookAt(Gf.Vec3d(*eye), Gf.Vec3d(*target), Gf.Vec3d(*up)).GetInverse()
        UsdGeom.Xformable(camera).MakeMatrixXform().Set(look)
        return camera

    def light(self, kind, path="/Light", matrix=None, **inputs):
        """Add a UsdLux light with a transform and inputs."""
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
        """Add a material with one shader with constant inputs."""
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
        """Bind a material to a prim."""
        UsdShade.MaterialBindingAPI.Apply(getattr(prim, "GetPrim", lambda: prim)()).Bind(material)


def down(height=0.0):
    """The matrix of a light at this height that points down."""
    return Gf.Matrix4d().SetRotate(Gf.Rotation(Gf.Vec3d(1, 0, 0), -90)) * Gf.Matrix4d().SetTranslate((0, height, 0))


def read_glb(path):
    """Read the document and the buffer of a .glb."""
    data = path.read_bytes()
    size = struct.unpack_from("<I", data, 12)[0]
    return json.loads(data[20:20 + size]), data[28 + size:]


def values(document, buffer, index):
    """The values (count, width) of an accessor."""
    accessor = document["accessors"][index]
    view = document["bufferViews"][accessor["bufferView"]]
    width = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}[accessor["type"]]
    kind = {5126: "<f4", 5125: "<u4"}[accessor["componentType"]]
    return numpy.frombuffer(buffer, kind, accessor["count"] * width, view["byteOffset"]).reshape(-1, width)


def corners(document, buffer, mesh=0, primitive=0):
    """Attributes at the corners of a primitive's triangles, {name: (3 * triangles, width)}."""
    entry = document["meshes"][mesh]["primitives"][primitive]
    index = values(document, buffer, entry["indices"]).reshape(-1)
    return {name: values(document, buffer, at)[index] for name, at in entry["attributes"].items()}


def read_exr(path, layer="Noisy"):
    """Read a layer of three channels (height, width, 3); "" is the picture."""
    channels = OpenEXR.File(str(path), separate_channels=True).channels()
    names = [f"{layer}.{c}" if layer else c for c in "RGB"]
    return numpy.stack([channels[name].pixels.astype(float) for name in names], axis=2)
