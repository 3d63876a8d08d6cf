"""Subsurface scattering: the random walk of Cycles as a medium behind a surface that transmits light diffusely."""

import math
from dataclasses import dataclass

from closures import mean_reflectance
from graph import is_constant

_LARGEST_RATIO = 100.0  # of the mean free paths of the channels
_SKIN = "RANDOM_WALK_SKIN"


@dataclass(frozen=True)
class Subsurface:
    """The medium inside: its colour as a half-space, mean free paths (m) by channel, and anisotropy."""
    colour: tuple
    free_path: tuple
    anisotropy: float


def read(base, weight, given, entry, surface, method):
    """The `Subsurface` of a shader, or None if an input varies or no light scatters.

    `base`: colour of the surface in Cycles. `weight`: share of the diffuse light that enters. `given`: the values
    (radius, scale, index of refraction, anisotropy). `entry`: index of refraction and GGX's alpha with which light enters in
    Cycles. `surface`: index of refraction and strength of the facets above, or
    None. `method`: Blender's name of the model.
    """
    if not all(is_constant(value) for value in (base, weight, *given, *entry, *(surface or ()))):
        return None
    radius, scale, ior, anisotropy = given
    base = tuple(min(max(c, 0.0), 1.0) for c in base)
    reflected = surface[1] * mean_reflectance(surface[0]) if surface else 0.0
    free_path = [max(r * scale, 0.0) * _scale(c, min(max(ior, 1.01), 3.8), method) for r, c in zip(radius, base)]
    longest = max(free_path)
    if longest <= 0 or max(base) <= 0:
        return None
    anisotropy = min(max(anisotropy, 0.0), 0.9)
    # Cycles' radius gives the mean free path of isotropic scattering that looks the same.
    free_path = tuple(max(path, longest / _LARGEST_RATIO) * (1 - anisotropy) for path in free_path)
    if method == "RANDOM_WALK":
        shown = [_shown(c, min(max(entry[0], 1.01), 3.8), min(max(entry[1], 0.0), 1.0)) for c in base]
    else:  # half of the light, or all, enters diffusely
        shown = base
    return Subsurface(tuple(_colour(c, weight, reflected) for c in shown), free_path, anisotropy)


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
    """Mean free path of Cycles relative to Blender's radius."""
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


def _colour(base, weight, reflected):
    """The colour of the medium with which light that enters leaves with the colour `base`.

    The surface reflects light from inside, too: by facets (`reflected` on average), and diffusely, by the share of the
    base that does not transmit. In Cycles it lets out all light.
    """
    inside = reflected + (1 - reflected) * (1 - weight) * base
    return min(base / ((1 - reflected) * weight + base * inside), 1.0)


def write(entry, medium, thickness):
    """Add the medium to a glTF material. `thickness`: a length inside the mesh (m)."""
    extensions, shortest = entry.setdefault("extensions", {}), min(medium.free_path)
    extensions["KHR_materials_volume"] = {
        "thicknessFactor": thickness, "attenuationDistance": shortest,
        "attenuationColor": [math.exp(-shortest / path) for path in medium.free_path]}
    extensions["KHR_materials_volume_scatter"] = {
        "multiscatterColor": list(medium.colour), "scatterAnisotropy": medium.anisotropy}
