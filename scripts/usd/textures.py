"""Adds textures to the document: files unchanged if glTF can use them, otherwise baked images."""

import contextlib
import dataclasses
import io
import math
import os
import tempfile

import numpy
import OpenEXR
from PIL import Image, UnidentifiedImageError

from faults import Invalid

_MIMES = {b"\x89PNG": "image/png", b"\xff\xd8\xff": "image/jpeg"}
# Formats of Pillow that run no other program, as EPS does.
_FORMATS = ("PNG", "JPEG", "TIFF", "TGA", "BMP", "WEBP")
_CHANNELS = {"r": 0, "g": 1, "b": 2, "a": 3, "x": 0, "y": 1, "z": 2, "w": 3}


class Textures:
    """Adds the textures of materials to a document."""

    def __init__(self, stage, document):
        self._stage, self._document = stage, document
        self._data, self._texels = {}, {}

    def check(self, prim, asset):
        """Whether the file of a texture is an image. If not, there is a loss, and the texture has its fallback."""
        try:
            _check_format(*self._bytes(prim, asset), prim.GetPath())
            return True
        except Invalid as invalid:
            self._stage.losses.add(invalid.where, f"{invalid.fault}: it has its fallback ({invalid.hint})")
            return False

    def reference(self, texture, sets, image):
        """The textureInfo of an image. `sets`: the mesh's primvars of texture coordinates, extended if necessary."""
        sampler = self._document.share("samplers", {"wrapS": texture.wraps[0], "wrapT": texture.wraps[1]})
        entry = {"index": self._document.share("textures", {"source": image, "sampler": sampler})}
        if texture.uv not in sets:
            if len(sets) == 2:
                self._stage.losses.add(texture.prim.GetPath(), f"more than two sets of texture coordinates: {sets[0]} "
                                        f"takes the place of {texture.uv}")
            else:
                sets.append(texture.uv)
        at = sets.index(texture.uv) if texture.uv in sets else 0
        if at:
            entry["texCoord"] = at
        said = _transform(*texture.transform)
        if said:
            entry["extensions"] = {self._document.use("KHR_texture_transform"): said}
        return entry

    def color(self, texture):
        """Index of an image that glTF decodes from sRGB, and its factor (3 numbers)."""
        data, name = self._file(texture)
        scale, bias = texture.scale[:3], texture.bias[:3]
        srgb = self._is_srgb(texture)
        if texture.channel == "rgb" and not any(bias) and max(scale) <= 1 and srgb and _mime(data):
            return self._document.image(data, _mime(data), name), list(scale)
        values = self._linear(self._load(texture), srgb)
        if texture.channel != "rgb":
            values = numpy.repeat(self._channel(texture, values), 3, axis=2)
        else:
            values = _colors(values) * scale + bias
        self._clip(texture, values)
        return self._png(_to_srgb(values), name), [1.0] * 3

    def tint(self, texture, function, power):
        """Index of an image of `function` of a texture's colours, relative to the largest of each channel, raised to
        `power`, and these largest values (3 numbers)."""
        values = self._linear(self._load(texture), self._is_srgb(texture))
        values = (_colors(values) * texture.scale[:3] + texture.bias[:3] if texture.channel == "rgb" else
                  numpy.repeat(self._channel(texture, values), 3, axis=2))
        self._clip(texture, values)
        values = function(numpy.clip(values, 0, 1))
        most = numpy.maximum(values.reshape(-1, 3).max(0), 1e-3)
        return self._png(_to_srgb((values / most) ** power), self._file(texture)[1]), [float(x) for x in most]

    def emission(self, texture):
        """Index of an sRGB image as in `color`, and the radiance (3 numbers) that multiplies it."""
        scale = texture.scale[:3]
        most = max(max(scale), 1e-30)
        image, factor = self.color(dataclasses.replace(texture, scale=tuple(s / most for s in scale) + (1.0,),
                                                       bias=tuple(b / most for b in texture.bias)))
        return image, [f * most for f in factor]

    def normals(self, texture):
        """Index of a normal map, and its strength."""
        data, name = self._file(texture)
        standard = texture.scale[:3] in ((1.0,) * 3, (2.0,) * 3)
        if texture.channel == "rgb" and _mime(data) and standard:
            return self._document.image(data, _mime(data), name), 1.0
        scale, bias = texture.scale[:3], texture.bias[:3]
        if scale[0] == scale[1] and scale[2] == 2.0 and bias == (-1.0,) * 3 and _mime(data):
            return self._document.image(data, _mime(data), name), scale[0] / 2
        values = _colors(self._load(texture)) * scale + bias
        return self._png(values * 0.5 + 0.5, name), 1.0

    def packed(self, parts):
        """Index of an image with these channels: {channel of glTF: texture or number}; the others are 1."""
        arrays = {at: self.values(part) for at, part in parts.items() if not isinstance(part, (int, float))}
        shape = max((array.shape for array in arrays.values()), key=lambda s: s[0] * s[1])
        texels = numpy.ones((*shape, 4 if 3 in parts else 3))
        for at, part in parts.items():
            texels[:, :, at] = _resized(arrays[at], shape) if at in arrays else part
        name = next(part for part in parts.values() if not isinstance(part, (int, float)))
        return self._png(texels, self._file(name)[1])

    def above(self, texture, least):
        """Index of a grey image of a number from `least` to its largest texel, and that texel. Texels below `least` are
        raised to it."""
        values = numpy.maximum(self._channel(texture, self._linear(self._load(texture), self._is_srgb(texture))), least)
        largest = float(values.max())
        share = (values - least) / max(largest - least, 1e-9)
        return self._png(numpy.repeat(share, 3, axis=2), self._file(texture)[1]), largest

    def with_alpha(self, base, alpha):
        """Index of an image of a colour (a texture, or 3 numbers) with an alpha channel, and the factor of the
        colour."""
        data, name = self._file(alpha)
        same = not isinstance(base, tuple) and base.asset == alpha.asset and alpha.channel == "a"
        if same and self._is_srgb(alpha) and _mime(data) == "image/png" and base.channel == "rgb" and not any(base.bias) \
                and max(base.scale) <= 1 and alpha.scale[3] == 1 and not alpha.bias[3]:
            return self._document.image(data, "image/png", name), list(base.scale[:3])
        presence = self.values(alpha)
        if isinstance(base, tuple):
            color, factor = numpy.ones((*presence.shape, 3)), list(base)
        else:
            values = self._linear(self._load(base), self._is_srgb(base))
            values = (_colors(values) * base.scale[:3] + base.bias[:3] if base.channel == "rgb" else
                      numpy.repeat(self._channel(base, values), 3, axis=2))
            color, factor = _to_srgb(values), [1.0] * 3
        shape = max(presence.shape, color.shape[:2], key=lambda s: s[0] * s[1])
        planes = [_resized(color[:, :, k], shape) for k in range(3)] + [_resized(presence, shape)]
        return self._png(numpy.stack(planes, axis=2), name), factor

    def values(self, texture):
        """The values (height, width) of one channel of a texture."""
        values = self._channel(texture, self._linear(self._load(texture), self._is_srgb(texture)))[:, :, 0]
        self._clip(texture, values)
        return values

    def data_as_is(self, texture, at):
        """Index of the unchanged image if its channel `at` (glTF's) holds the texture's values; else None."""
        data, name = self._file(texture)
        channel = 0 if texture.channel == "rgb" else _CHANNELS[texture.channel]
        plain = texture.scale[channel] == 1 and texture.bias[channel] == 0 and not self._is_srgb(texture)
        if plain and _mime(data) and (channel == at or self._is_grey(texture, channel)):
            return self._document.image(data, _mime(data), name)
        return None

    def _is_grey(self, texture, channel):
        texels = self._load(texture)
        return texels.shape[2] < 3 or (channel < 3 and (texels[:, :, :3] == texels[:, :, :1]).all())

    def _channel(self, texture, values):
        at = 0 if texture.channel == "rgb" else _CHANNELS[texture.channel]
        if at >= values.shape[2]:
            at, values = 0, values if at < 3 else numpy.ones_like(values)
        return values[:, :, at:at + 1] * texture.scale[at] + texture.bias[at]

    def _clip(self, texture, values):
        if values.min() < -1e-4 or values.max() > 1 + 1e-4:
            self._stage.losses.add(texture.prim.GetPath(), "texels outside 0 to 1 are clipped")

    def _file(self, texture):
        return self._bytes(texture.prim, texture.asset)

    def _bytes(self, prim, asset):
        """The bytes and the name of the file of an image."""
        path = asset.resolvedPath or asset.path
        if path not in self._data:
            if "<UDIM>" in asset.path:
                raise Invalid(prim.GetPath(), "UDIM tiles are not read", "bake the tiles into one image")
            self._data[path] = self._stage.asset(prim, asset)
        return self._data[path]

    def _load(self, texture):
        """Returns the texels (height, width, channels) as stored in the file, integers scaled to 0 to 1."""
        return _scaled(*self._decoded(texture))[0]

    def _decoded(self, texture):
        data, name = self._file(texture)
        if name not in self._texels:
            self._texels[name] = _decode(data, name, texture.prim.GetPath())
        return self._texels[name]

    def _is_srgb(self, texture):
        """Whether an image is sRGB: with `space` "auto" if it has 8 bits and at least three channels
        (specification)."""
        if texture.space != "auto":
            return texture.space == "sRGB"
        channels = _channels_of_8_bits(self._file(texture)[0])
        if channels is None:
            texels, bits = self._decoded(texture)
            channels = texels.shape[2] if bits == 8 and texels.ndim == 3 else 1
        return channels >= 3

    def _linear(self, texels, srgb):
        if not srgb:
            return texels
        colors = min(texels.shape[2], 3)
        return numpy.concatenate([from_srgb(texels[:, :, :colors]), texels[:, :, colors:]], axis=2)

    def _png(self, values, name):
        """Add an 8-bit image of values (height, width, 3 or 4). Returns its index."""
        bytes_ = numpy.rint(numpy.clip(values, 0, 1) * 255).astype(numpy.uint8)
        file = io.BytesIO()
        Image.fromarray(bytes_).save(file, "PNG")
        return self._document.image(file.getvalue(), "image/png", name)


def read(data, name, where):
    """Decode the bytes of a file to texels (height, width, channels), grey or colour with or without alpha, and
    bits."""
    return _scaled(*_decode(data, name, where))


def _channels_of_8_bits(data):
    """The number of channels of an 8-bit image, from its header; None for others."""
    try:
        with Image.open(io.BytesIO(data), formats=_FORMATS) as image:
            return {"L": 1, "LA": 2, "RGB": 3, "RGBA": 4}.get(image.mode)
    except Exception:  # decoding reports the error later
        return None


def _scaled(texels, bits):
    """Texels in double precision with a channel axis, integers scaled to 0 to 1, and bits per channel."""
    scale = 1.0 if texels.dtype.kind == "f" else 2.0 ** bits - 1
    texels = texels.astype(numpy.float64) / scale
    return (texels[:, :, None] if texels.ndim == 2 else texels), bits


def _check_format(data, name, where):
    """Raise an Invalid if the bytes `data` of a file do not start as an image."""
    if not _is_exr(data):
        with _reported(name, where), Image.open(io.BytesIO(data), formats=_FORMATS):
            pass


def _is_exr(data):
    return data[:4] == b"\x76\x2f\x31\x01"


@contextlib.contextmanager
def _reported(name, where):
    """Report errors of Pillow as Invalid."""
    try:
        yield
    except MemoryError:
        raise
    except UnidentifiedImageError:
        raise Invalid(where, f"the image {os.path.basename(name)} cannot be read: it is none of {', '.join(_FORMATS)}",
                    "save it as PNG, JPEG or OpenEXR")
    except Exception as error:  # Pillow raises many kinds of errors about invalid files
        raise Invalid(where, f"the image {os.path.basename(name)} cannot be read: {error}",
                    "save it as PNG, JPEG or OpenEXR")


def _decode(data, name, where):
    """Texels of the image file with the bytes `data`, as stored, without colour conversion."""
    if _is_exr(data):
        return _read_exr(data, where), 32
    with _reported(name, where):
        image = Image.open(io.BytesIO(data), formats=_FORMATS)
        if image.mode in ("P", "CMYK", "YCbCr", "1"):
            image = image.convert("RGBA" if "transparency" in image.info else "RGB")
        texels = numpy.asarray(image)
    bits = 8 if texels.dtype == numpy.uint8 else 16
    if texels.dtype.kind not in "ui" and texels.dtype != numpy.float32:
        raise Invalid(where, f"the image {os.path.basename(name)} has texels of {texels.dtype}", "save it with 8 bits")
    return texels, bits


def _read_exr(data, where):
    with tempfile.NamedTemporaryFile(suffix=".exr") as file:
        file.write(data)
        file.flush()
        try:
            channels = OpenEXR.File(file.name).channels()
        except Exception as error:  # OpenEXR raises many kinds of errors about invalid files
            raise Invalid(where, f"the OpenEXR image cannot be read: {error}", "write it again")
        for name in ("RGBA", "RGB", "Y"):
            if name in channels:
                return channels[name].pixels
    raise Invalid(where, "the OpenEXR image has neither RGB nor Y", "write it with channels R, G and B")


def from_srgb(values):
    """Linear values of sRGB-encoded ones (IEC 61966-2-1)."""
    return numpy.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def _to_srgb(values):
    values = numpy.clip(values, 0, 1)
    return numpy.where(values <= 0.0031308, values * 12.92, 1.055 * values ** (1 / 2.4) - 0.055)


def _resized(values, shape):
    if values.shape[:2] == tuple(shape):
        return values
    image = Image.fromarray(values.astype(numpy.float32))
    return numpy.asarray(image.resize((shape[1], shape[0]), Image.Resampling.BILINEAR), numpy.float64)


def _transform(scale, degrees, translation):
    """KHR_texture_transform of a UsdTransform2d; v = 1 - t mirrors its matrix."""
    turn = math.radians(degrees)
    offset = [translation[0] - math.sin(turn) * scale[1], 1 - math.cos(turn) * scale[1] - translation[1]]
    said = {}
    if any(abs(x) > 1e-7 for x in offset):
        said["offset"] = offset
    if turn:
        said["rotation"] = turn
    if tuple(scale) != (1.0, 1.0):
        said["scale"] = list(scale)
    return said


def _colors(values):
    """The colour channels of values without opacity; grey is repeated three times."""
    return values[:, :, :3] if values.shape[2] >= 3 else numpy.repeat(values[:, :, :1], 3, axis=2)


def _mime(data):
    return next((mime for start, mime in _MIMES.items() if data.startswith(start)), None)
