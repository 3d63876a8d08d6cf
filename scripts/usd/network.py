"""Networks of shaders: what feeds an input, as a constant, a texture or a primvar."""

import dataclasses
import math

from pxr import Gf, Sdf, UsdShade

_WRAPS = {"repeat": 10497, "useMetadata": 10497, "periodic": 10497, "clamp": 33071, "mirror": 33648}
# Nodes of MaterialX that hand on what they get, and the input that they get it by.
_PASSING = ("ND_convert_", "ND_dot_", "ND_normalmap", "ND_extract_", "ND_separate", "ND_swizzle_")


@dataclasses.dataclass
class Texture:
    """An image as it feeds an input: value = scale * texel + bias, of one channel or of "rgb".

    `asset` is the Sdf.AssetPath, `prim` the shader that names it; `transform` (scale, degrees, translation) acts on the
    primvar `uv`; `space` is "auto", "raw" or "sRGB"; `wraps` are glTF's numbers.
    """

    prim: object
    asset: object
    channel: str = "rgb"
    scale: tuple = (1.0,) * 4
    bias: tuple = (0.0,) * 4
    space: str = "auto"
    wraps: tuple = (10497, 10497)
    uv: str = "st"
    transform: tuple = ((1.0, 1.0), 0.0, (0.0, 0.0))


@dataclasses.dataclass
class Primvar:
    """A primvar of the mesh that feeds an input."""

    name: str


class Reader:
    """Reads the inputs of a shader at a stage's moment."""

    def __init__(self, stage):
        self.stage = stage

    def read(self, shader, name, default=None):
        """The constant, `Texture` or `Primvar` that feeds an input; `default` where nothing does."""
        shader_input = shader.GetInput(name)
        if not shader_input:
            return default
        for attribute in shader_input.GetValueProducingAttributes():
            if UsdShade.Utils.GetType(attribute.GetName()) == UsdShade.AttributeType.Output:
                found = self._node(UsdShade.Shader(attribute.GetPrim()), attribute.GetBaseName())
            else:
                found = self.stage.get(attribute)
            if found is not None:
                return _constant(found)
        return default

    def _node(self, shader, output):
        """What a node puts out; None where that is beyond us, which is named."""
        kind = shader.GetIdAttr().Get() or shader.GetPrim().GetTypeName()
        if kind in ("UsdUVTexture", "ND_UsdUVTexture", "ND_UsdUVTexture_23"):
            return self._uv_texture(shader, output)
        if kind.startswith("UsdPrimvarReader") or kind.startswith("ND_geompropvalue") or kind.startswith("ND_UsdPrim"):
            name = self.read(shader, "varname", None) or self.read(shader, "geomprop", None)
            return Primvar(name) if name else self.read(shader, "fallback")
        if kind.startswith("ND_geomcolor"):
            return Primvar("displayColor")
        if kind.startswith(("ND_image_", "ND_tiledimage_")):
            return self._image(shader, output)
        if kind.startswith("ND_constant_"):
            return self.read(shader, "value")
        if kind.startswith(_PASSING):
            return self._passed(shader, kind, output)
        self.stage.losses.name(shader.GetPath(), f"a node {kind} is not carried: what it feeds has its default")
        return None

    def _passed(self, shader, kind, output):
        found = self.read(shader, "in")
        channel = output[-1] if kind.startswith("ND_separate") else self.read(shader, "channels")
        if kind.startswith("ND_extract_"):
            channel = "rgba"[int(self.read(shader, "index", 0))]
        if isinstance(found, Texture) and channel:
            channel = {"x": "r", "y": "g", "z": "b", "w": "a"}.get(channel, channel)
            found = dataclasses.replace(found, channel=channel)
        if isinstance(found, Texture) and kind.startswith("ND_normalmap"):
            strength = self.read(shader, "scale", 1.0)
            if strength not in (1.0, (1.0, 1.0)):
                found = dataclasses.replace(found, scale=(2 * _first(strength),) * 2 + (2.0, 1.0), bias=(-1.0,) * 4)
        return found

    def _uv_texture(self, shader, output):
        asset = self._asset(shader)
        if asset is None:
            return self.read(shader, "fallback")
        wraps = tuple(self._wrap(shader, self.read(shader, name, "useMetadata")) for name in ("wrapS", "wrapT"))
        uv, transform = self._coordinates(shader, "st")
        return Texture(shader.GetPrim(), asset, output, self.read(shader, "scale", (1.0,) * 4),
                       self.read(shader, "bias", (0.0,) * 4), self.read(shader, "sourceColorSpace", "auto"), wraps, uv,
                       transform)

    def _image(self, shader, output):
        asset = self._asset(shader)
        if asset is None:
            return self.read(shader, "default")
        wraps = tuple(self._wrap(shader, self.read(shader, name, "periodic"))
                      for name in ("uaddressmode", "vaddressmode"))
        uv, transform = self._coordinates(shader, "texcoord")
        tiling = self.read(shader, "uvtiling")
        if tiling is not None:
            transform = (tiling, *transform[1:])
        kind = shader.GetIdAttr().Get()
        space = shader.GetInput("file").GetAttr().GetColorSpace() or ("sRGB" if "_color" in kind else "raw")
        space = "sRGB" if "srgb" in space.lower() else "raw"
        return Texture(shader.GetPrim(), asset, "r" if kind.endswith("_float") else "rgb", space=space, wraps=wraps,
                       uv=uv, transform=transform)

    def _asset(self, shader):
        """The Sdf.AssetPath of `inputs:file`, also where it comes from an interface; None if there is none."""
        for attribute in shader.GetInput("file").GetValueProducingAttributes() if shader.GetInput("file") else ():
            asset = self.stage.get(attribute)
            if isinstance(asset, Sdf.AssetPath) and asset.path:
                return asset
        return None

    def _wrap(self, shader, mode):
        if mode not in _WRAPS:
            self.stage.losses.name(shader.GetPath(), f"wrap mode {mode} is not carried: the image's edge goes on")
        return _WRAPS.get(mode, 33071)

    def _coordinates(self, shader, name):
        """The primvar that places a texture, and what transforms it."""
        still = ((1.0, 1.0), 0.0, (0.0, 0.0))
        given = shader.GetInput(name)
        for attribute in given.GetValueProducingAttributes() if given else ():
            source = UsdShade.Shader(attribute.GetPrim())
            kind = source.GetIdAttr().Get() or ""
            if kind == "UsdTransform2d":
                uv, before = self._coordinates(source, "in")
                if before != still:
                    self.stage.losses.name(source.GetPath(), "a UsdTransform2d before this one is not carried")
                return uv, (self.read(source, "scale", (1.0, 1.0)), self.read(source, "rotation", 0.0),
                            self.read(source, "translation", (0.0, 0.0)))
            if kind.startswith("ND_place2d"):
                self.stage.losses.name(source.GetPath(), "a node ND_place2d is not carried: texture coordinates stay")
                return self._coordinates(source, "texcoord")
            if kind.startswith("ND_texcoord"):
                return "st" if not self.read(source, "index", 0) else f"st{self.read(source, 'index')}", still
            found = self._node(source, attribute.GetBaseName())
            if isinstance(found, Primvar):
                return found.name, still
        return "st", still


def _constant(value):
    """Vectors as tuples of numbers, numbers and texts as they are."""
    if isinstance(value, (Gf.Vec2f, Gf.Vec3f, Gf.Vec4f, Gf.Vec2d, Gf.Vec3d, Gf.Vec4d, Gf.Vec2h, Gf.Vec3h, Gf.Vec4h)):
        return tuple(float(x) for x in value)
    return value


def _first(value):
    return value[0] if isinstance(value, tuple) else value


def finite(value):
    """Whether a constant has finite numbers alone."""
    return all(math.isfinite(x) for x in (value if isinstance(value, tuple) else (value,)))
