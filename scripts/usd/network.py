"""Reads shader networks: the value of an input as a constant, a texture or a primvar."""

import dataclasses

from pxr import Gf, Sdf, UsdShade

from stage import kind_of

_WRAPS = {"repeat": 10497, "useMetadata": 10497, "periodic": 10497, "clamp": 33071, "mirror": 33648}
_CHANNELS = ("r", "g", "b", "a", "rgb")
# Prefixes of MaterialX nodes that pass their input on.
_PASS_THROUGH = ("ND_convert_", "ND_dot_", "ND_normalmap", "ND_extract_", "ND_separate", "ND_swizzle_")
# Longest chain of nodes that is followed.
_MAX_DEPTH = 64


@dataclasses.dataclass
class Texture:
    """A texture as the value of an input: scale * texel + bias, of one channel or of "rgb".

    `asset`: Sdf.AssetPath. `prim`: its shader. `transform`: (scale, degrees, translation) of the primvar `uv`.
    `space`: "auto", "raw" or "sRGB". `wraps`: glTF's constants.
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
    """A primvar of the mesh as the value of a shader's input."""

    name: str


class Reader:
    """Reads the inputs of shaders at the stage's time code."""

    def __init__(self, stage, textures):
        self.stage, self._textures = stage, textures
        self._open = []  # stack of inputs that are being read

    def read(self, shader, name, default=None):
        """The constant, `Texture` or `Primvar` of an input.

        Returns `default` if the input is unset, or with a loss if its constant has another type than `default`. A
        default of None accepts any type.
        """
        shader_input = shader.GetInput(name)
        if not shader_input or not self._enter(shader_input):
            return default
        for attribute in shader_input.GetValueProducingAttributes():
            if UsdShade.Utils.GetType(attribute.GetName()) == UsdShade.AttributeType.Output:
                found = self._node(UsdShade.Shader(attribute.GetPrim()), attribute.GetBaseName())
            else:
                found = self.stage.get(attribute)
            if found is not None:
                break
        else:
            found = None
        self._open.pop()
        return default if found is None else self._convert(shader, name, _constant(found), default)

    def constant(self, shader, name, default):
        """Returns the constant value of an input. If a texture or a primvar feeds the input, returns `default` and
        records a warning."""
        found = self.read(shader, name, default)
        if isinstance(found, (Texture, Primvar)):
            self.stage.losses.add(shader.GetPath(), f"what feeds {name} is not carried: it has its default")
            return default
        return found

    def identifier(self, shader):
        """The identifier of a shader, or ""."""
        return self.stage.get(shader.GetIdAttr(), "")

    def _enter(self, shader_input):
        """Push an input onto the stack of open inputs. Returns false, and records a warning, if the network has a cycle
        or is too deep."""
        path = shader_input.GetAttr().GetPath()
        if path in self._open or len(self._open) >= _MAX_DEPTH:
            what = "feeds itself" if path in self._open else f"is more than {_MAX_DEPTH} nodes deep"
            self.stage.losses.add(path, f"its network {what}: it has its default")
            return False
        self._open.append(path)
        return True

    def _convert(self, shader, name, found, default):
        """Returns a constant, converted to the type of `default`. Longer vectors are truncated, such as a colour with
        opacity."""
        if default is None or isinstance(found, (Texture, Primvar)) or kind_of(found) == kind_of(default) == "text":
            return found
        if isinstance(default, tuple) and isinstance(found, tuple):
            if len(found) >= len(default):
                return found[:len(default)]
            if len(found) == 3:
                return found + default[3:]
        elif kind_of(found) == kind_of(default) == "number":
            return found
        wanted = f"{len(default)} numbers" if isinstance(default, tuple) else f"a {kind_of(default)}"
        shown = f"{len(found)} numbers" if isinstance(found, tuple) else f"a {kind_of(found)}"
        self.stage.losses.add(shader.GetPath(), f"what feeds {name} is {shown}, not {wanted}: it has its default")
        return default

    def _node(self, shader, output):
        """The value of a node's output; None, with a loss, if the node is not supported."""
        kind = self.identifier(shader) or shader.GetPrim().GetTypeName()
        if kind in ("UsdUVTexture", "ND_UsdUVTexture", "ND_UsdUVTexture_23"):
            return self._uv_texture(shader, output)
        if kind.startswith("UsdPrimvarReader") or kind.startswith("ND_geompropvalue") or kind.startswith("ND_UsdPrim"):
            name = self.constant(shader, "varname", "") or self.constant(shader, "geomprop", "")
            return Primvar(name) if name else self.read(shader, "fallback")
        if kind.startswith("ND_geomcolor"):
            return Primvar("displayColor")
        if kind.startswith(("ND_image_", "ND_tiledimage_")):
            return self._image(shader, output)
        if kind.startswith("ND_constant_"):
            return self.read(shader, "value")
        if kind.startswith(_PASS_THROUGH):
            return self._pass_through(shader, kind, output)
        self.stage.losses.add(shader.GetPath(), f"a node {kind} is not carried: what it feeds has its default")
        return None

    def _pass_through(self, shader, kind, output):
        found = self.read(shader, "in")
        channel = output[-1] if kind.startswith("ND_separate") else self.constant(shader, "channels", "")
        if kind.startswith("ND_extract_"):
            index = int(self.constant(shader, "index", 0))
            channel = "rgba"[index] if -4 <= index < 4 else f"at {index}"
        if isinstance(found, Texture) and channel:
            channel = {"x": "r", "y": "g", "z": "b", "w": "a", "xyz": "rgb"}.get(channel, channel)
            if channel in _CHANNELS:
                found = dataclasses.replace(found, channel=channel)
            else:
                self.stage.losses.add(shader.GetPath(), f"a channel {channel} is not carried: it hands on all of them")
        if isinstance(found, Texture) and kind.startswith("ND_normalmap"):
            strength = self.read(shader, "scale")
            if not isinstance(strength, (int, float)) and not (isinstance(strength, tuple) and len(strength) == 2):
                strength = 1.0
            if strength not in (1.0, (1.0, 1.0)):
                found = dataclasses.replace(found, scale=(2 * _first(strength),) * 2 + (2.0, 1.0), bias=(-1.0,) * 4)
        return found

    def _uv_texture(self, shader, output):
        asset = self._asset(shader)
        if asset is None:
            return self.read(shader, "fallback")
        if output not in _CHANNELS:
            self.stage.losses.add(shader.GetPath(), f"it has no output {output}: what that feeds has its default")
            return None
        constant = self.constant
        wraps = tuple(self._wrap(shader, constant(shader, name, "useMetadata")) for name in ("wrapS", "wrapT"))
        uv, transform = self._coordinates(shader, "st")
        return Texture(shader.GetPrim(), asset, output, constant(shader, "scale", (1.0,) * 4),
                       constant(shader, "bias", (0.0,) * 4), constant(shader, "sourceColorSpace", "auto"), wraps, uv,
                       transform)

    def _image(self, shader, output):
        asset = self._asset(shader)
        if asset is None:
            return self.read(shader, "default")
        wraps = tuple(self._wrap(shader, self.constant(shader, name, "periodic"))
                      for name in ("uaddressmode", "vaddressmode"))
        uv, transform = self._coordinates(shader, "texcoord")
        if self.read(shader, "uvtiling") is not None:
            transform = (self.constant(shader, "uvtiling", (1.0, 1.0)), *transform[1:])
        kind = self.identifier(shader)
        space = shader.GetInput("file").GetAttr().GetColorSpace() or ("sRGB" if "_color" in kind else "raw")
        space = "sRGB" if "srgb" in space.lower() else "raw"
        return Texture(shader.GetPrim(), asset, "r" if kind.endswith("_float") else "rgb", space=space, wraps=wraps,
                       uv=uv, transform=transform)

    def _asset(self, shader):
        """The Sdf.AssetPath of `inputs:file`, also through an interface input; None if unset, or with a loss if the file
        is no image."""
        for attribute in shader.GetInput("file").GetValueProducingAttributes() if shader.GetInput("file") else ():
            asset = self.stage.get(attribute)
            if isinstance(asset, Sdf.AssetPath) and asset.path and self._textures.check(shader.GetPrim(), asset):
                return asset
        return None

    def _wrap(self, shader, mode):
        if mode not in _WRAPS:
            self.stage.losses.add(shader.GetPath(), f"wrap mode {mode} is not carried: the image's edge goes on")
        return _WRAPS.get(mode, 33071)

    def _coordinates(self, shader, name):
        """The primvar of a texture's coordinates, and its transform."""
        still = ((1.0, 1.0), 0.0, (0.0, 0.0))
        given = shader.GetInput(name)
        if not given or not self._enter(given):
            return "st", still
        found = self._trace_coordinates(given, still)
        self._open.pop()
        return found

    def _trace_coordinates(self, given, still):
        for attribute in given.GetValueProducingAttributes():
            source = UsdShade.Shader(attribute.GetPrim())
            kind = self.identifier(source)
            if kind == "UsdTransform2d":
                uv, before = self._coordinates(source, "in")
                if before != still:
                    self.stage.losses.add(source.GetPath(), "a UsdTransform2d before this one is not carried")
                return uv, (self.constant(source, "scale", (1.0, 1.0)), self.constant(source, "rotation", 0.0),
                            self.constant(source, "translation", (0.0, 0.0)))
            if kind.startswith("ND_place2d"):
                self.stage.losses.add(source.GetPath(), "a node ND_place2d is not carried: texture coordinates stay")
                return self._coordinates(source, "texcoord")
            if kind.startswith("ND_texcoord"):
                index = self.constant(source, "index", 0)
                return f"st{index}" if index else "st", still
            found = self._node(source, attribute.GetBaseName())
            if isinstance(found, Primvar):
                return found.name, still
        return "st", still


def _constant(value):
    """Vectors as tuples of numbers; numbers and texts unchanged."""
    if isinstance(value, (Gf.Vec2f, Gf.Vec3f, Gf.Vec4f, Gf.Vec2d, Gf.Vec3d, Gf.Vec4d, Gf.Vec2h, Gf.Vec3h, Gf.Vec4h)):
        return tuple(float(x) for x in value)
    return value


def _first(value):
    return value[0] if isinstance(value, tuple) else value
