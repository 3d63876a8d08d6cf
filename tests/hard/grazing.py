"""5. Grazing: light and views at grazing angles, coarse meshes with smooth shading, very thin lights."""

from functools import partial
from math import atan2, cos, hypot, pi, radians, sin

from . import scene as s
from . import shapes
from .answers import Equal, Value
from .case import FEW, Case
from .furnace import WHITE

TITLE = "Grazing"
ALBEDO = 0.8
ANGLE = 89.999


def low_sun():
    """A sun 0.001 degrees above the horizon, on a floor seen from above."""
    made = s.Scene().add(shapes.floor(5), s.diffuse(ALBEDO))
    return made.sun((-sin(radians(ANGLE)), -cos(radians(ANGLE)), 0), 1e4).seen((0, 3, 0.5), (0, 0, 0), 2)


def reflected_sun():
    """A floor under a low sun, and a vertical mirror that reflects the sun onto the whole floor."""
    low, high = radians(90 - 89.9), 2 * sin(radians(90 - 89.9)) / cos(radians(90 - 89.9))
    mirror = shapes.quad((1, high / 2, 0), (0, high / 2, 0), (0, 0, 1))
    made = s.Scene().add(shapes.floor(1), s.diffuse(ALBEDO)).add(mirror, s.metal(1, 0.0))
    return made.sun((cos(low), -sin(low), 0), 1e3).seen((0, 3, 0.5), (0, 0, 0), 4)


def low_eye(material):
    """A floor in a white furnace, seen from 0.001 degrees above it."""
    far = 10.0
    return (
        s.Scene()
        .within(1)
        .add(shapes.floor(5), material)
        .seen((far * sin(radians(ANGLE)), far * cos(radians(ANGLE)), 0), (0, 0, 0), 1e-4)
    )


def coarse(rings, material):
    """A smooth-shaded sphere of `rings` rings in a white furnace."""
    return s.Scene().within(1).add(shapes.sphere((0, 0, 0), 1, rings), material).seen((0, 0.4, 6), (0, 0, 0), 12)


def terminator(rings):
    """A smooth-shaded matte sphere under a sun from the side; the terminator is in the middle of the picture."""
    return (
        s.Scene()
        .add(shapes.sphere((0, 0, 0), 1, rings), s.diffuse(ALBEDO))
        .sun((-1, 0, 0), 3.0)
        .seen((0, 0, 6), (0, 0, 0), 16)
    )


def slit(width):
    """A light of this width, one metre long, with the radiance 1 / width, 10 cm above a floor."""
    lamp = shapes.quad((0, 0.1, 0), (width / 2, 0, 0), (0, 0, 0.5))
    return (
        s.Scene()
        .add(shapes.floor(1), s.diffuse(0.5))
        .add(lamp, s.emitter(1 / width))
        .seen((0.05, 0.05, 0), (0, 0, 0), 0.2)
    )


def lit_by_slit(half=0.5, height=0.1):
    """Radiance below the middle of slit(): albedo / pi times the integral of h² / r⁴ along the light."""
    r = hypot(half, height)
    return 0.5 / pi * (half / r**2 + atan2(half, height) / height)


CASES = [
    Case(
        "grazing-light",
        "A sun at 89.999 degrees from the zenith",
        {"scene": low_sun},
        Value(
            ALBEDO / pi * 1e4 * cos(radians(ANGLE)),
            "L = albedo / pi E cos. Single precision rounds cos = 1.7e-5 by up to 3e-8, which gives the bound.",
            bound=0.004,
        ),
        size=8,
        seeds=FEW,
    ),
    Case(
        "grazing-photons",
        "Photons that a mirror reflects onto a floor at 89.9 degrees",
        {"scene": reflected_sun},
        Value(
            2 * ALBEDO / pi * 1e3 * cos(radians(89.9)),
            "The sun and its mirror image give equal light: L = 2 albedo / pi E cos.",
            bound=0.005,
            resolves=0.1,
        ),
        ("sppm",),
        size=8,
        iterations=16,
        photons=100000,
        options=("--initial-bandwidth", "0.2"),
    ),
    Case(
        "grazing-eye-matte",
        "A white matte floor in a white furnace, seen at 89.999 degrees",
        {"scene": partial(low_eye, s.diffuse(1))},
        Value(1.0, WHITE, resolves=0.1),
        size=8,
        iterations=48,
        photons=2000,
    ),
    Case(
        "grazing-eye-metal",
        "White metal in a white furnace, seen at 89.999 degrees",
        {"scene": partial(low_eye, s.metal(1, 0.3))},
        Value(1.0, WHITE, bound=0.01),
        ("path", "bdpt", "vcm"),
        size=8,
        iterations=16,
    ),
    Case(
        "grazing-eye-mirror",
        "A mirror in a white furnace, seen at 89.999 degrees",
        {"scene": partial(low_eye, s.metal(1, 0.0))},
        Value(1.0, WHITE),
        ("path", "bdpt", "vcm"),
        size=8,
        seeds=FEW,
    ),
    Case(
        "coarse-white",
        "A smooth-shaded sphere of 6 rings in a white furnace",
        {"scene": partial(coarse, 6, s.diffuse(1))},
        Value(1.0, WHITE + " Interpolated normals must not lose light.", bound=0.01, resolves=0.05),
        iterations=24,
    ),
    Case(
        "terminator",
        "A smooth-shaded sphere of 12 rings lit from the side, against one of 96",
        {"fine": partial(terminator, 96), "coarse": partial(terminator, 12)},
        Equal(
            "fine",
            ("coarse",),
            "Both meshes approximate one sphere. The outline of the coarse one loses 1.1 % of the area, "
            "and light ends one face too early at the terminator, where cosines are below 0.26: together below 6 %.",
            bound=0.06,
            resolves=0.05,
        ),
        iterations={None: 32, "sppm": 8},
        photons=2000,
    ),
    Case(
        "slit",
        "A slit of light, a metre long and 10 µm wide",
        {"scene": partial(slit, 1e-5)},
        Value(
            lit_by_slit(),
            "A line light: albedo / pi times the integral of h² / r⁴ over its length.",
            bound=0.005,
            resolves=0.06,
        ),
        size=8,
        iterations=128,
        photons=1000,
    ),
]
