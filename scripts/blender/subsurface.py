"""Subsurface scattering: the random walk of Cycles as a medium behind a surface that transmits light diffusely."""

import math
from dataclasses import dataclass

import numpy

from closures import mean_reflectance
from graph import is_constant

_LARGEST_RATIO = 100.0  # of the mean free paths of the channels
_SKIN = "RANDOM_WALK_SKIN"
_DARKEST = 1e-3  # colour of the darkest medium


@dataclass(frozen=True)
class Subsurface:
    """The constant inputs of a shader's subsurface scattering. Its colour, and the share of light that enters, may vary.

    `radius`: Blender's radius times scale (m). `entry`: index of refraction and GGX's alpha with which light enters in
    Cycles. `reflected`: mean reflectance of the facets above. `method`: Blender's name of the model.
    """
    radius: tuple
    ior: float
    anisotropy: float
    entry: tuple
    reflected: float
    method: str


@dataclass(frozen=True)
class Medium:
    """The medium inside: its colour as a half-space, mean free paths (m) by channel, and anisotropy."""
    colour: tuple
    free_path: tuple
    anisotropy: float


def read(base, given, entry, surface, method):
    """The `Subsurface` of a shader, or None if an input but its colour varies or no light scatters.

    `base`: colour of the surface in Cycles. `given`: the values (radius, scale, index of refraction, anisotropy).
    `surface`: index of refraction and strength of the facets above, or None.
    """
    if not all(is_constant(value) for value in (*given, *entry, *(surface or ()))):
        return None
    radius, scale, ior, anisotropy = given
    radius = tuple(max(r * scale, 0.0) for r in radius)
    if max(radius) <= 0 or (is_constant(base) and max(base) <= 0):
        return None
    reflected = surface[1] * mean_reflectance(surface[0]) if surface else 0.0
    entry = min(max(entry[0], 1.01), 3.8), min(max(entry[1], 0.0), 1.0)
    return Subsurface(radius, min(max(ior, 1.01), 3.8), min(max(anisotropy, 0.0), 0.9), entry, reflected, method)


def medium(inside, colour, weight, base):
    """The `Medium` behind a surface, and the colour with which the surface transmits light.

    `colour` of the light that leaves in Cycles, `weight`, the share of the diffuse light that enters, and `base`, the
    colour of the rest, are constants or arrays of texels. The medium has the brightest colour. The surface takes the
    root of what a texel lacks of it from light that enters, and from light that leaves, so that light paths and camera
    paths agree, and light that leaves near its entry has the colour of the texel.
    """
    colour = numpy.clip(numpy.asarray(colour, numpy.float32), 0, 1)
    seen = colour.reshape(-1, 3)
    typical = seen[seen.max(1) > 0].mean(0) if seen.max() > 0 else seen[0]
    free_path = [r * _scale(float(c), inside.ior, inside.method) for r, c in zip(inside.radius, typical)]
    # Cycles' radius gives the mean free path of isotropic scattering that looks the same.
    free_path = tuple(max(path, max(free_path) / _LARGEST_RATIO) * (1 - inside.anisotropy) for path in free_path)
    shown = colour
    if inside.method == "RANDOM_WALK":  # with others half of the light, or all, enters diffusely
        grid = numpy.unique(colour) if colour.size <= 3 else numpy.linspace(0, 1, 257)
        shown = numpy.interp(colour, grid, [_shown(float(c), *inside.entry) for c in grid])
    weight = numpy.asarray(weight, numpy.float32)[..., None]
    needed = _colour(shown, weight, inside.reflected, numpy.asarray(base, numpy.float32))
    most = numpy.maximum(needed.reshape(-1, 3).max(0), _DARKEST)
    found = Medium(tuple(map(float, most)), free_path, inside.anisotropy)
    tint = numpy.sqrt(numpy.minimum(needed / most, 1.0))
    return found, (1.0,) * 3 if tint.ndim == 1 else tint


def at_surface(channels):
    """The base colour of a surface whose light does not enter it."""
    weight = numpy.asarray(channels["sheet"], numpy.float32)[..., None]
    mixed = numpy.asarray(channels["base"]) * (1 - weight) + numpy.asarray(channels["sheet_colour"]) * weight
    return mixed if mixed.ndim == 3 else tuple(map(float, mixed))


def _shown(colour, ior, alpha, steps=64):
    """The colour that Cycles' random walk shows: its medium has `colour` for light that enters diffusely.

    Refracted light enters steeply, so less of it returns: 1 - s H(cos), with H of [Chandrasekhar 1960] by Hapke's
    approximation. It spreads with the roughness alpha, and is about diffuse at 1.
    """
    s = 4.09712 + 4.20863 * colour - math.sqrt(9.59217 + 41.6808 * colour + 17.7126 * colour * colour)
    s = min(max(s, 0.0), 1.0)

    def returned(squares):
        return 1 - s * sum((1 + 2 * math.sqrt(c)) / (1 + 2 * s * math.sqrt(c)) for c in squares) / steps
    parts = [(step + 0.5) / steps for step in range(steps)]
    refracted = returned([1 - part / ior ** 2 for part in parts]) / max(returned(parts), 1e-6)
    return colour * (refracted + (1 - refracted) * alpha ** 2)


def _scale(colour, ior, method):
    """Returns the mean free path that Cycles uses, as a multiple of the radius that is set in Blender."""
    if method != _SKIN:
        return 0.25 / math.pi
    inverse = 1 / ior
    diffuse = inverse * (-1.44 * inverse + 0.71) + 0.668 + 0.0636 * ior
    edge = 4 / 3 * (1 + diffuse) / (1 - diffuse)
    return math.sqrt(3 * (1 - _reduced_albedo(colour, edge)))


def _reduced_albedo(colour, edge, steps=30):
    """The reduced albedo at which the dipole of [Jensen 2001] has the diffuse reflectance `colour`."""
    low, high = 0.0, 0.999999
    for _ in range(steps):
        middle = (low + high) / 2
        s = math.sqrt(3 * (1 - middle))
        reflectance = 0.5 * middle * (1 + math.exp(-edge * s)) * math.exp(-s)
        low, high = (middle, high) if reflectance < colour else (low, middle)
    return low


def _colour(leaves, weight, reflected, base):
    """The colour of the medium with which light that enters leaves with the colour `leaves`.

    The surface reflects light from inside, too: by facets (`reflected` on average), and diffusely, by the share that does
    not transmit, of the colour `base`. In Cycles it lets out all light.
    """
    inside = reflected + (1 - reflected) * (1 - weight) * base
    return numpy.minimum(leaves / numpy.maximum((1 - reflected) * weight + leaves * inside, 1e-6), 1.0)


def write(entry, medium, thickness):
    """Add the medium to a glTF material. `thickness`: a length inside the mesh (m)."""
    extensions, shortest = entry.setdefault("extensions", {}), min(medium.free_path)
    extensions["KHR_materials_volume"] = {
        "thicknessFactor": thickness, "attenuationDistance": shortest,
        "attenuationColor": [math.exp(-shortest / path) for path in medium.free_path]}
    extensions["KHR_materials_volume_scatter"] = {
        "multiscatterColor": list(medium.colour), "scatterAnisotropy": medium.anisotropy}
