"""Colours, spectra and textures of Mitsuba's XML as RGB values and pictures."""

from dataclasses import dataclass
from xml.sax.saxutils import quoteattr

import mitsuba as mi
import numpy as np
from glb_package import meshes
from gltf import Unsupported

#: Pixels along a side of a picture that is computed.
BAKED_SIDE = 512
#: Luminance of Rec. 709 RGB.
LUMINANCE = np.array([0.212671, 0.715160, 0.072169], np.float32)
#: Largest difference of a transform of textures from rotation and scale.
MAX_SHEAR = 1e-3
#: Errors of Mitsuba and numpy for invalid values and files.
FAULTS = (ArithmeticError, AttributeError, LookupError, MemoryError, OSError, RuntimeError, TypeError, ValueError)
#: {Mitsuba's wrap mode: glTF's}
WRAPS = {"repeat": "repeat", "mirror": "mirror", "clamp": "clamp", "zero": "clamp", "one": "clamp"}
#: {kind of quantity: (plug-in, parameter) by which Mitsuba converts a spectrum of it}
CONVERTERS = {
    "light": ("emitter", "constant", "radiance"),
    "reflectance": ("bsdf", "diffuse", "reflectance"),
    "unbounded": ("bsdf", "conductor", "eta"),
}
#: Wavelengths in nm at which the emission of black bodies is evaluated.
WAVELENGTHS = np.arange(360, 831, 10)


@dataclass(eq=False)
class Picture:
    """An image over texture coordinates: linear values (H, W, C), placed by an affine matrix (2, 3)."""

    values: np.ndarray
    matrix: np.ndarray
    nearest: bool = False
    wrap: str = "repeat"

    def at(self, u, v):
        """Values at texture coordinates, interpolated as Mitsuba does."""
        height, width = self.values.shape[:2]
        x, y = (row[0] * u + row[1] * v + row[2] for row in self.matrix)
        x, y = x * width - 0.5, y * height - 0.5
        if self.nearest:
            return self.values[self.wrapped(np.rint(y), height), self.wrapped(np.rint(x), width)]
        left, top = np.floor(x), np.floor(y)
        s, t = (x - left)[..., None], (y - top)[..., None]
        rows, columns = [[self.wrapped(i + k, n) for k in (0, 1)] for i, n in ((top, height), (left, width))]
        value = lambda i, j: self.values[rows[i], columns[j]]
        return (value(0, 0) * (1 - s) + value(0, 1) * s) * (1 - t) + (value(1, 0) * (1 - s) + value(1, 1) * s) * t

    def wrapped(self, index, size):
        """Indices of pixels inside the image."""
        index = index.astype(np.int64)
        if self.wrap == "clamp":
            return np.clip(index, 0, size - 1)
        if self.wrap == "mirror":
            return np.minimum(index % (2 * size), 2 * size - 1 - index % (2 * size))
        return index % size


@dataclass(eq=False)
class Value:
    """A quantity over a surface: `color` times the picture or the vertices' attribute, if there is one."""

    color: np.ndarray
    picture: Picture | None = None
    attribute: str | None = None

    @property
    def mean(self):
        """Mean over the surface, for parameters that cannot vary."""
        return self.color if self.picture is None else self.color * self.picture.values.mean((0, 1))

    def scaled(self, factor):
        return Value(self.color * factor, self.picture, self.attribute)


def constant(value):
    """A value that is the same everywhere."""
    return Value(np.broadcast_to(np.asarray(value, float), 3).copy())


def colour(node, name, usual, kind="reflectance"):
    """A child as a `Value`; `usual` if it is absent. `kind` says how spectra are converted."""
    found = node.child(name)
    return constant(usual) if found is None else value(found, kind)


def scalar(node, name, usual):
    """A child as a `Value` of equal channels; `usual` if it is absent."""
    found = node.child(name)
    return constant(usual) if found is None else grey(value(found, "unbounded"))


def uniform(node, name, usual, kind="reflectance"):
    """A child as one colour; a warning names a texture, whose mean is used."""
    made = colour(node, name, usual, kind)
    if made.picture is not None or made.attribute:
        node.document.lose(f"{node.title}: its {name} is taken as the mean of the texture")
    return made.mean


def value(node, kind):
    """The `Value` of a texture or a colour."""
    return texture(node, kind) if node.tag == "texture" else constant(converted(node, kind))


def grey(made):
    """A `Value` with the luminance in all channels, as Mitsuba looks numbers up in colour textures."""
    made = Value(np.full(3, made.color @ LUMINANCE), made.picture, made.attribute)
    if made.picture is not None:
        luminance = (made.picture.values @ LUMINANCE)[..., None].repeat(3, -1)
        made.picture = Picture(luminance, made.picture.matrix, made.picture.nearest, made.picture.wrap)
    return made


def converted(node, kind):
    """RGB of a colour or spectrum."""
    text = node.attributes.get("value", "").strip()
    if node.tag in ("float", "integer"):
        numbers = node.numbers()
        if numbers.size != 1:
            raise node.fault("one number is needed")
        return np.broadcast_to(numbers, 3)
    if node.tag == "blackbody":
        return black_body(node, kind)
    if node.tag in ("vector", "point"):
        return node.three()
    if node.tag not in ("rgb", "spectrum", "color"):
        raise node.fault("a colour is needed: float, rgb, spectrum, or a texture")
    if node.tag == "rgb" and not text.startswith("#") or node.tag == "spectrum" and text and ":" not in text:
        numbers = node.numbers()
        # Mitsuba converts a constant emission spectrum from equal energy to its white point.
        if numbers.size == 3 or numbers.size == 1 and (node.tag == "rgb" or kind != "light"):
            return np.broadcast_to(numbers, 3)
        if numbers.size != 1:
            raise node.fault(f"a colour has 1 or 3 numbers, not {numbers.size}")
    return evaluated(node, kind)


def evaluated(node, kind):
    """RGB of a spectrum as Mitsuba's RGB variants convert it."""
    attributes = {key: value for key, value in node.attributes.items() if key not in ("id", "name")}
    if attributes.get("filename"):
        path = node.document.find(attributes["filename"])
        if path is None:
            raise node.fault(f'filename="{attributes["filename"]}": there is no such file; {node.document.searched()}')
        attributes["filename"] = str(path)
    if node.type == "blackbody":
        return black_body(node, kind)
    if node.attributes.get("value", "").startswith("#"):
        kind = "reflectance"
    inner = "".join(
        f"<{part.tag} {' '.join(f'{key}={quoteattr(value)}' for key, value in part.attributes.items())}/>"
        for part in node.children
    )
    for part in node.children:
        part.used = True
    tag, plugin, parameter = CONVERTERS[kind]
    words = " ".join(f"{key}={quoteattr(value)}" for key, value in attributes.items())
    text = f'<{tag} version="3.0.0" type="{plugin}"><{node.tag} name="{parameter}" {words}>{inner}</{node.tag}></{tag}>'
    try:
        found = mi.traverse(mi.load_string(text))
        return np.broadcast_to(np.array(found[f"{parameter}.value"], float).ravel(), 3)
    except FAULTS as error:
        raise node.fault(f"this spectrum cannot be read: {reason(error)}") from error


def reason(error):
    """The last part of an error of Mitsuba, on one line, without its place in source code."""
    return " ".join(str(error).split("] ")[-1].split()) or type(error).__name__


def black_body(node, kind):
    """RGB of a black body's emission; Mitsuba 0.x gives the temperature as an attribute, in kelvin."""
    if "temperature" in node.attributes:
        words = node.attributes["temperature"].strip().removesuffix("K").removesuffix("k")
        node.attributes["temperature"] = words
        numbers = node.numbers("temperature")
        scale = node.numbers("scale") if "scale" in node.attributes else np.ones(1)
    else:
        numbers, scale = np.array([node.number("temperature", 0.0)]), np.array([node.number("scale", 1.0)])
    if numbers.size != 1 or scale.size != 1 or not numbers[0] > 0.0:
        raise node.fault("a black body has a temperature above 0 K")
    metres = WAVELENGTHS * 1e-9
    with np.errstate(over="ignore"):
        # Planck's law, in W/(sr m2 nm).
        planck = 1.191042972e-25 / metres**5 / np.expm1(1.438776877e-2 / (metres * numbers[0]))
    described = type(node)("spectrum", {}, node.place)
    described.document = node.document
    # Mitsuba divides emission by the integral of the luminosity function, in nm.
    described.attributes["value"] = ", ".join(f"{w}:{x:.9g}" for w, x in zip(WAVELENGTHS, planck, strict=True))
    return evaluated(described, kind) * scale[0]


# --- textures ---------------------------------------------------------------------------------------------------------


def texture(node, kind):
    """A texture as a `Value`."""
    match node.type:
        case "bitmap":
            return Value(np.ones(3), bitmap(node))
        case "checkerboard":
            values = [colour(node, name, usual, kind).mean for name, usual in (("color0", 0.4), ("color1", 0.2))]
            dark = np.array([[values[0], values[1]], [values[1], values[0]]], np.float32)
            return Value(np.ones(3), Picture(dark, placement(node), nearest=True))
        case "mesh_attribute" | "vertexcolors":
            return Value(np.full(3, node.number("scale", 1.0)), attribute=node.text("name", "vertex_color"))
        case "scale":
            inner = node.child(tag="texture")
            if inner is None:
                raise node.fault("it scales no texture; put a texture inside")
            return texture(inner, kind).scaled(colour(node, "scale", 1.0, kind).mean)
        case "uniform" | "rawconstant" | "srgb":
            return colour(node, "value" if node.child("value") is not None else "color", 1.0, kind)
    node.drop("a texture of this type is taken as a half")
    return constant(0.5)


def bitmap(node):
    """The picture of a bitmap texture. Colours are linear values; `raw` values stay as they are."""
    path = node.document.file(node)
    try:
        image = mi.Bitmap(str(path))
        # Mitsuba 0.x says gamma="1".
        if node.boolean("raw") or node.number("gamma", -1.0) == 1.0:
            image.set_srgb_gamma(False)
        values = np.array(image.convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False), np.float32)
    except FAULTS as error:
        raise node.fault(f"{path.name}: this image cannot be read: {reason(error)}") from error
    if not values.size:
        raise node.fault(f"{path.name}: this image is empty")
    wrap = node.text("wrap_mode", "repeat")
    if wrap in ("zero", "one"):
        node.document.lose(f'{node.title}: outside of the image its edge is repeated, not "{wrap}"')
    return Picture(values, placement(node), node.text("filter_type") == "nearest", WRAPS.get(wrap, "repeat"))


def placement(node):
    """The matrix (2, 3) from texture coordinates to those of the image."""
    found = node.transform("to_uv")
    matrix = found[:2, [0, 1, 3]].copy()
    step = node.child("to_uv")
    if step is not None and step.children and all(part.numbers().size == 9 for part in step.children):
        # A matrix of three rows moves by its last column.
        matrix[:, 2] = found[:2, 2]
    # Mitsuba 0.x.
    for row, axis in enumerate("uv"):
        matrix[row] *= node.number(f"{axis}scale", node.number("uvscale", 1.0))
        matrix[row, 2] += node.number(f"{axis}offset", 0.0)
    return matrix


def sampled(values, lose, place):
    """Values on a common grid, and its placement: ([array (H, W, 3) or (3,)], matrix, nearest, wrap)."""
    pictures = [value.picture for value in values if value.picture is not None]
    if not pictures:
        return [value.color for value in values], None
    first = pictures[0]
    settings = (first.nearest, first.wrap)
    if all(np.allclose(p.matrix, first.matrix) and (p.nearest, p.wrap) == settings for p in pictures):
        matrix, wrap = first.matrix, first.wrap
    else:
        lose(f"{place}: textures of different placement are resampled to one of {BAKED_SIDE} x {BAKED_SIDE} pixels")
        matrix, settings, wrap = np.eye(2, 3), (False, "repeat"), "repeat"
    baked = settings == (False, "repeat") and matrix is not first.matrix
    height, width = (BAKED_SIDE,) * 2 if baked else np.max([p.values.shape[:2] for p in pictures], axis=0)
    u, v = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    found = []
    for value in values:
        picture = value.picture
        if picture is None:
            found.append(value.color)
            continue
        # On a common placement the grid is that of the image itself.
        plain = picture if baked else Picture(picture.values, np.eye(2, 3), picture.nearest, picture.wrap)
        found.append(value.color * plain.at(u, v))
    return found, (matrix, settings[0], wrap)


def combined(function, values, lose, place):
    """`function` of values, point by point, as a `Value`."""
    arrays, grid = sampled(values, lose, place)
    if any(value.attribute for value in values):
        lose(f"{place}: colours of vertices are left out where materials are mixed")
    if grid is None:
        return Value(np.asarray(function(*arrays), float))
    matrix, nearest, wrap = grid
    size = next(array.shape[:2] for array in arrays if array.ndim == 3)
    made = np.broadcast_to(function(*arrays), (*size, 3)).astype(np.float32)
    return Value(np.ones(3), Picture(made, matrix, nearest, wrap))


def to_texture(picture, pixels, lose, place):
    """A texture of glTF with the placement of a picture. `pixels` are its uint8 values."""
    (a, b, x), (c, d, y) = picture.matrix
    angle, across = np.arctan2(c, a), np.hypot(a, c)
    if not across > 0.0 or not abs(a * d - b * c) > 0.0:
        raise Unsupported(f"{place}: the transform of its texture is singular")
    if abs(a * b + c * d) > MAX_SHEAR * across * np.hypot(b, d):
        lose(f"{place}: the shear of its texture is left out")
    return meshes.Texture(
        pixels=pixels,
        offset=(x, y),
        rotation=float(np.degrees(angle)),
        scale=(across, (a * d - b * c) / across),
        nearest=picture.nearest,
        wrap=picture.wrap,
    )


def srgb(values):
    """sRGB bytes of linear values."""
    x = np.clip(values, 0.0, 1.0)
    return quantised(np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.power(np.maximum(x, 1e-9), 1 / 2.4) - 0.055))


def quantised(values):
    """Bytes of values from 0 to 1."""
    return np.rint(np.clip(values, 0.0, 1.0) * 255.0).astype(np.uint8)
