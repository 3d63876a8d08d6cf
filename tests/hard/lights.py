"""2. Lights: very small, very weak, very strong, many, and black ones."""

from functools import partial
from math import atan, pi, radians, cos, sin, sqrt

import numpy as np

from . import scene as s
from . import shapes
from .answers import Equal, Exact, Value, Values
from .case import FEW, Case

TITLE = "Lights"
ALBEDO, HEIGHT = 0.8, 2.0


def ground(field_deg=0.5):
    """A Lambertian floor; the camera sees a small patch in its middle, from the side."""
    return s.Scene().add(shapes.floor(5), s.diffuse(ALBEDO)).seen((3, 3, 0), (0, 0, 0), field_deg)


def form_factor(half, height):
    """The form factor from a point to a parallel square above it, with edges of 2 `half` [e.g. Howell, B-3, four times]."""
    x = half / height
    return 4 * x / sqrt(1 + x * x) * atan(x / sqrt(1 + x * x)) / pi


def lit_by_square(radiance, half):
    """Radiance of the floor below a square light: albedo times radiance times form factor."""
    return ALBEDO * radiance * form_factor(half, HEIGHT)


def shrinking(half):
    """A square light of any size with the intensity of a square metre of radiance 1."""
    return ground().add(shapes.ceiling(half, HEIGHT), s.emitter(0.25 / half**2))


def strong(power):
    """A floor, a glass sphere on it, and a light of radiance 2^power."""
    return (
        s.Scene()
        .add(shapes.floor(1.5), s.diffuse(ALBEDO))
        .add(shapes.ceiling(0.3, HEIGHT), s.emitter(2.0**power))
        .add(shapes.sphere((0, 0.5, 0), 0.4), s.glass(1.5))
        .seen((0, 1.5, 3), (0, 0.2, 0), 30)
    )


def many(count):
    """count x count tiny lights in a square of 2 m, with the total power of this square at radiance 1."""
    at = (np.arange(count) + 0.5) / count * 2 - 1
    x, z = (v.ravel() for v in np.meshgrid(at, at))
    half = 0.05 / count
    corners = np.array([(-half, 0, -half), (half, 0, -half), (half, 0, half), (-half, 0, half)])
    positions = (np.stack([x, np.full_like(x, HEIGHT), z], 1)[:, None] + corners).reshape(-1, 3)
    first = 4 * np.arange(len(x))[:, None, None]
    triangles = (first + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)
    return ground().add(shapes.Mesh(positions, triangles), s.emitter((1 / count / half) ** 2))


def crowd(black):
    """Four lights, and a black square that, with `black`, is a light of strength zero."""
    made = s.Scene().add(shapes.floor(1.5), s.diffuse(ALBEDO)).seen((0, 1.5, 3), (0, 0.2, 0), 30)
    for i in range(4):
        lamp = shapes.quad((0.6 * i - 0.9, HEIGHT, 0), (0.1, 0, 0), (0, 0, 0.1))
        made = made.add(lamp, s.emitter(2.0 + i))
    dark = shapes.quad((0, HEIGHT, 0.6), (0.3, 0, 0), (0, 0, 0.3))
    # Exporters write a strength of zero for lights that are switched off.
    lamp = {
        **s.diffuse(0),
        "emissiveFactor": [1, 1, 1],
        "extensions": {**s.diffuse(0)["extensions"], "KHR_materials_emissive_strength": {"emissiveStrength": 0}},
    }
    return made.add(dark, lamp if black else s.diffuse(0))


def sunny(angle_deg):
    """A sun 60 degrees from the zenith; its perpendicular irradiance is 3."""
    return ground().sun((-sin(radians(60)), -cos(radians(60)), 0), 3.0, angle_deg)


def pane(angle_deg):
    """A sun in the zenith through a pane of glass a metre above the floor."""
    glass = shapes.box((-0.1, 1, -0.1), (0.1, 1.02, 0.1))
    return (
        s.Scene()
        .add(shapes.floor(1), s.diffuse(0.5))
        .add(glass, s.glass(1.5))
        .sun((0, -1, 0), 3.0, angle_deg)
        .seen((1.2, 0.5, 0), (0, 0, 0), 1)
    )


#: A profile with 3 cd on its axis.
PROFILE = "IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 4 1 1 2 0 0 0\n1 1 30\n0 10 45 90\n0\n3 3 2 0\n"
#: The radius of a bulb, and the linear value of the sRGB value 188 of 255.
BULB, GREY = 0.05, ((188 / 255 + 0.055) / 1.055) ** 2.4


def below_a_bulb(**keys):
    """The bulb of a spot, seen from its axis."""
    made = s.Scene().spot((0, HEIGHT, 0), (0, -1, 0), 1.0, 40, radius=BULB, bulb=True, **keys)
    return made.seen((0, 0, 0), (0, HEIGHT, 0), 0.5, (0, 0, 1))


SIZES = {f"{half:g}": half for half in (1e-1, 1e-2, 1e-3, 1e-4, 1e-6)}
POWERS = {"2^-40": -40, "2^40": 40}
SUN = ALBEDO / pi * 3.0 * cos(radians(60))
PANE = 0.5 / pi * 3.0 * (1 - 0.04) / (1 + 0.04)

CASES = [
    Case(
        "light-shrinks",
        "A square light of constant intensity whose side shrinks from 20 cm to 2 µm",
        {label: partial(shrinking, half) for label, half in SIZES.items()},
        Values(
            {label: lit_by_square(0.25 / half**2, half) for label, half in SIZES.items()},
            "Albedo times radiance times the form factor of a square parallel to a point below its middle.",
        ),
        ("path", "bdpt", "vcm", "sppm"),
        size=8,
        iterations=8,
        photons=2000,
    ),
    Case(
        "light-point",
        "A point light with the intensity of the shrinking light",
        {"scene": lambda: ground().point((0, HEIGHT, 0), 1.0)},
        Value(ALBEDO / pi / HEIGHT**2, "Albedo / pi times I / d²."),
        size=8,
        seeds=FEW,
    ),
    Case(
        "light-strength",
        "A caustic by lights of radiance 2^-40 and 2^40 (about 1e-12 and 1e12), to the last bit",
        {"2^0": partial(strong, 0), **{label: partial(strong, p) for label, p in POWERS.items()}},
        Exact("2^0", POWERS, "Light transport is linear; a power of two changes only exponents."),
        ("path", "bdpt", "vcm", "sppm", "ppm", "appm", "cppm", "bpm", "pm", "light"),
        seeds=1,
    ),
    Case(
        "light-profile",
        "A spot with a photometric profile, seen on the floor, and the bulb of it",
        {
            "floor": lambda: ground().spot((0, HEIGHT, 0), (0, -1, 0), 1.0, 80, ies={"profile": PROFILE}),
            "bulb": lambda: below_a_bulb(ies={"profile": PROFILE}),
        },
        Values(
            {"floor": ALBEDO / pi * 3.0 / HEIGHT**2, "bulb": 3.0 / (pi * BULB**2)},
            "Albedo / pi times I / d² for the 3 cd along the axis; the bulb looks like a disc of radiance I / (pi r²).",
        ),
        ("path", "bdpt", "vcm"),
        size=8,
        seeds=FEW,
    ),
    Case(
        "light-gobo",
        "A spot that throws a grey picture, seen on the floor, and the bulb of it",
        {
            "floor": lambda: ground().spot((0, HEIGHT, 0), (0, -1, 0), 1.0, 40, gobo={"image": s.grey_png(188)}),
            "bulb": lambda: below_a_bulb(gobo={"image": s.grey_png(188)}),
        },
        Values(
            {"floor": ALBEDO / pi * GREY / HEIGHT**2, "bulb": GREY / (pi * BULB**2)},
            "Albedo / pi times I / d², times the linear value of the picture (sRGB 188); the bulb as for a profile.",
        ),
        ("path", "bdpt", "vcm"),
        size=8,
        seeds=FEW,
    ),
    Case(
        "light-sun",
        "A delta sun, and one of 0.5 degrees, with the same irradiance",
        {"delta": partial(sunny, 0), "half": partial(sunny, 0.5)},
        Values(
            {"delta": SUN, "half": SUN},
            "L = albedo / pi E cos 60°. A disc of uniform radiance above the horizon gives every plane the irradiance "
            "of its middle.",
        ),
        size=8,
    ),
    Case(
        "light-sun-pane",
        "A delta sun, and one of 0.5 degrees, through a pane of glass, so that photons carry the light",
        {"delta": partial(pane, 0), "half": partial(pane, 0.5)},
        Values(
            {"delta": PANE, "half": PANE},
            "Perpendicular Fresnel reflectance is R = 0.04; with all inner reflections a pane transmits (1 - R) / (1 + R)."
            " L = albedo / pi E times this. The pane returns less than 0.05 % of the floor's light.",
            resolves=0.1,
        ),
        ("vcm", "sppm"),
        size=16,
        iterations={None: 4, "vcm": 300},
        photons=25000,
        options={None: ("--initial-bandwidth", "0.06"), "vcm": ("--initial-bandwidth", "0.06", "--guide", "on")},
    ),
    Case(
        "light-many",
        "100,489 tiny lights with the total power of one square light",
        {"scene": partial(many, 317)},
        Value(
            lit_by_square(1.0, 1.0),
            "The sum over lights this dense equals the integral over the square within "
            "1e-5. L = albedo times the form factor.",
            bound=0.005,
            resolves=0.06,
        ),
        ("path", "vcm", "sppm"),
        size=8,
        seeds=8,
        iterations=32,
        photons=1000,
    ),
    Case(
        "light-black",
        "A light of radiance zero among four bright ones",
        {"without": partial(crowd, False), "with": partial(crowd, True)},
        Equal("without", ("with",), "A light that emits nothing is a black surface."),
        seeds=FEW,
    ),
]
