"""4. Refraction: indices from 1 to 4, nested and open solids, total reflection, long light guides."""

from functools import partial
from math import asin, cos, pi, radians, sin, sqrt, tan

from . import scene as s
from . import shapes
from .answers import Black, Equal, Value, Values, Warned
from .case import FEW, Case

TITLE = "Refraction"
WHITE = "Light of radiance 1 comes from everywhere and nothing absorbs, so radiance is 1 along every ray."
EYE = ("path", "bdpt", "vcm")


def reflectance(cos_i, ior):
    """Unpolarised Fresnel reflectance at the cosine `cos_i`; ior: index of the other side over the index of this side."""
    sin2 = (1 - cos_i**2) / ior**2
    if sin2 >= 1:
        return 1.0
    cos_t = sqrt(1 - sin2)
    parallel = (ior * cos_i - cos_t) / (ior * cos_i + cos_t)
    across = (cos_i - ior * cos_t) / (cos_i + ior * cos_t)
    return (parallel**2 + across**2) / 2


def stage(*solids):
    """Solids (mesh, material) on a floor under a light."""
    made = s.Scene().add(shapes.floor(1.5), s.diffuse((0.8, 0.6, 0.4))).add(shapes.ceiling(0.3, 2), s.emitter(6))
    for mesh, material in solids:
        made = made.add(mesh, material)
    return made.seen((0, 1.5, 3), (0, 0.3, 0), 30)


def furnace(*solids, eye=(0, 0.5, 4), field_deg=12):
    """Solids in a white environment."""
    made = s.Scene().within(1)
    for mesh, material in solids:
        made = made.add(mesh, material)
    return made.seen(eye, (0, 0, 0), field_deg)


def outdoors(material):
    """A floor with a black post under a white sky, and a ball of `material`, if any, in front of the post."""
    made = s.Scene().within(1).add(shapes.floor(1.5), s.diffuse((0.8, 0.6, 0.4)))
    made = made.add(shapes.box((-0.1, 0, -0.6), (0.1, 0.8, -0.5)), s.diffuse(0))
    return (made.add(ball(), material) if material else made).seen((0, 1.5, 3), (0, 0.3, 0), 30)


def ball(radius=0.5, middle=(0, 0.5, 0)):
    return shapes.sphere(middle, radius)


def block(half):
    return shapes.box((-half,) * 3, (half,) * 3)


def under_water(angle_deg):
    """A camera inside a block of glass (1.5), `angle_deg` from the normal of its upper face, below light of radiance 1."""
    tank = shapes.box((-2, -2, -2), (2, 0, 2))
    lamp = shapes.ceiling(60, 3)
    eye = (-tan(radians(angle_deg)) * 0.2, -0.2, 0)
    return (
        s.Scene()
        .add(tank, s.glass(1.5))
        .add(lamp, s.emitter(1))
        .add(shapes.floor(60, -3), s.diffuse(0))
        .seen(eye, (0, 0, 0), 0.2)
    )


def guide(bounces, ior=1.5, angle_deg=30.0):
    """A glass rod, 1 cm wide, between a light of radiance 1 and the camera. Its length is such that light at `angle_deg`
    to its axis hits its sides `bounces` times."""
    inside = asin(sin(radians(angle_deg)) / ior)
    half = 0.005
    length = 2 * half * bounces / tan(inside)
    rod = shapes.box((-half, -half, -length), (half, half, 0))
    lamp = shapes.quad((0, 0, -length - 0.001), (1, 0, 0), (0, 1, 0))
    # The view direction is in a vertical plane, so all reflections are at the rod's upper and lower face.
    eye = (0, sin(radians(angle_deg)) * 0.1, cos(radians(angle_deg)) * 0.1)
    return s.Scene().add(rod, s.glass(ior)).add(lamp, s.emitter(1)).seen(eye, (0, 0, 0), 0.5)


def nested(gap):
    """A block of glass with water inside, and a ball of glass in the water; gap: between glass and water, 0 if they
    coincide."""
    return [
        (block(0.5), s.glass(1.5, priority=1)),
        (block(0.4 - gap), s.glass(1.33, priority=2)),
        (shapes.sphere((0, 0, 0), 0.2), s.glass(1.5, priority=3)),
    ]


def shell(inner):
    """A tumbler: a block of glass with a cavity of half the edge `inner`, whose faces point inwards."""
    return shapes.joined(block(0.5), block(inner).flipped())


def lantern():
    """A point light of 1 W/sr in a ball of glass, in the middle of a matte sphere of radius 1 and albedo 1/2."""
    made = s.Scene().add(shapes.sphere((0, 0, 0), 1, 64).flipped(), s.diffuse(0.5))
    made = made.add(shapes.sphere((0, 0, 0), 0.3, 64), s.glass(1.5))
    return made.point((0, 0, 0), 1.0).seen((0.5, 0.1, 0.5), (0.9, 0.5, -0.4), 60)


GUIDE = reflectance(cos(radians(30)), 1.5)

CASES = [
    Case(
        "ior-1",
        "A solid of index 1 is invisible, smooth or rough",
        {"without": stage, "with": partial(stage, (ball(), s.glass(1.0)))},
        Equal("without", ("with",), "An index of 1 neither bends nor reflects.", resolves=0.06),
        iterations=4,
        seeds=FEW,
    ),
    Case(
        "ior-1-furnace",
        "A smooth and a rough solid of index 1 in a white furnace",
        {
            "smooth": partial(furnace, (block(0.3), s.glass(1.0))),
            "rough": partial(furnace, (block(0.3), s.glass(1.0, 0.5))),
        },
        Values({"smooth": 1.0, "rough": 1.0}, WHITE),
        EYE,
        seeds=FEW,
    ),
    Case(
        "ior-1.0001",
        "A solid of index 1.0001 is almost invisible",
        {"without": partial(outdoors, None), "with": partial(outdoors, s.glass(1.0001))},
        Equal(
            "without",
            ("with",),
            "Reflectance is 2.5e-9, and light is bent by less than 1e-3, except at the outline.",
            bound=0.01,
            resolves=0.05,
        ),
        EYE,
        iterations=32,
    ),
    Case(
        "ior-range",
        "Solids of index 1.0001, 1.33, 2.4 and 4 in a white furnace",
        {f"{ior:g}": partial(furnace, (block(0.3), s.glass(ior))) for ior in (1.0001, 1.33, 2.4, 4)},
        Values({f"{ior:g}": 1.0 for ior in (1.0001, 1.33, 2.4, 4)}, WHITE),
        EYE,
        seeds=FEW,
    ),
    Case(
        "ior-below-1",
        "A bubble of air in water: an index of 0.75 across its border",
        {
            "scene": partial(
                furnace, (block(0.4), s.glass(1.33)), (shapes.sphere((0, 0, 0), 0.25), s.glass(1.0, priority=1))
            )
        },
        Value(1.0, WHITE, bound=0.005),
        EYE,
    ),
    Case(
        "ior-file-below-1",
        "A file with an index of 0.8, which glTF does not allow",
        {"1": lambda: stage((ball(), s.glass(1.0))), "0.8": lambda: stage((ball(), s.glass(0.8)))},
        Equal(
            "1",
            ("0.8",),
            "glTF allows indices of 1 or more. The nearest allowed index is used, with a warning.",
            bound=0.0,
            warned="index of refraction of 0.8",
        ),
        EYE,
        seeds=FEW,
    ),
    Case(
        "critical-above",
        "Total reflection above the critical angle: a black tank below the glass stays black",
        {"scene": partial(under_water, 41.9)},
        Black(1e-6, "The critical angle is asin(1 / 1.5) = 41.81°. At 41.9° no light comes from outside."),
        EYE,
        seeds=2,
        iterations=1,
        size=8,
    ),
    Case(
        "nested",
        "Glass in water in glass in a white furnace, by priorities",
        {"scene": lambda: furnace(*nested(0.0))},
        Value(1.0, WHITE, bound=0.005),
        EYE,
    ),
    Case(
        "coincident",
        "Liquid and glass whose faces coincide, in a white furnace",
        {"scene": lambda: furnace((shell(0.4), s.glass(1.5)), (block(0.4), s.glass(1.33)))},
        Value(1.0, WHITE, bound=0.005),
        EYE,
        seeds=FEW,
    ),
    Case(
        "mesh-open",
        "A glass box without one of its faces, in a white furnace",
        {"scene": lambda: furnace((block(0.3).without([0, 1]), s.glass(1.5)))},
        Warned(
            "not closed",
            0.9999 / 2.25,
            2.2501,
            "The inside of an open solid is undefined. If a ray enters glass and leaves through the hole, radiance may "
            "be wrong by up to n², and a warning names the mesh.",
        ),
        EYE,
    ),
    Case(
        "mesh-inverted",
        "A glass box whose faces point inwards, in a white furnace",
        {"scene": lambda: furnace((block(0.3).flipped(), s.glass(1.5)))},
        Value(1.0, WHITE + " The orientation of faces does not matter.", bound=0.005),
        EYE,
        seeds=FEW,
    ),
    Case(
        "eye-in-glass",
        "A camera inside a ball of glass that is lit from everywhere",
        {"scene": lambda: furnace((shapes.sphere((0, 0, 0), 1), s.glass(1.5)), eye=(0, 0.1, 0.3), field_deg=40)},
        Value(
            2.25,
            "At equilibrium the basic radiance L / n² is constant, so radiance in glass is n² = 2.25.",
            bound=0.005,
        ),
        EYE,
        seeds=FEW,
    ),
    Case(
        "lamp-in-glass",
        "A point light in a ball of glass, in the middle of a matte sphere",
        {"scene": lantern},
        Value(
            1 / pi,
            "Every ray of the light hits the ball along its normal, and reflected light passes the middle again, so all"
            " light leaves the ball unbent. The ball does not change the light between the walls, because their radiance is"
            " uniform. L = albedo / pi I / r² / (1 - albedo). The facets of the outer sphere are up to 0.12 % closer than"
            " its radius.",
            bound=0.005,
            resolves=0.05,
        ),
        ("vcm", "sppm", "cppm", "bpm"),
        size=16,
        iterations={None: 3, "vcm": 80, "bpm": 80},
        options=("--initial-bandwidth", "0.2"),
    ),
    Case(
        "guide-60",
        "A rod of glass in which light is totally reflected 60 times",
        {"scene": partial(guide, 60)},
        Value(
            (1 - GUIDE) / (1 + GUIDE),
            "The rod's sides reflect everything, so it acts like a pane: it transmits "
            "(1 - R) / (1 + R) of the light's radiance, with the Fresnel reflectance R at 30°.",
            bound=0.005,
        ),
        EYE,
        size=8,
        iterations=80,
    ),
]
