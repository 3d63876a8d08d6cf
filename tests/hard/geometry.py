"""6. Geometry: faulty meshes that exporters write, and correct meshes that renderers often get wrong."""

from dataclasses import replace
from functools import partial

import numpy as np

from . import scene as s
from . import shapes
from .answers import Equal, Exact, Refused, Value
from .case import FEW, Case

TITLE = "Geometry"
EYE = ("path", "bdpt", "vcm", "sppm")
GREY = s.diffuse((0.7, 0.6, 0.5))
#: A triangle whose corners coincide, one whose corners are collinear, and one that uses a corner twice.
DEGENERATE = shapes.Mesh(
    np.array([[0, 0.2, 0], [0, 0.2, 0], [0, 0.2, 0], [0.1, 0.2, 0], [0.2, 0.2, 0]], float),
    np.array([[0, 1, 2], [0, 3, 4], [0, 0, 4]]),
)


def stage(mesh, material=GREY, **node):
    """A mesh (or None) on a floor under a light."""
    made = s.Scene().add(shapes.floor(1.5), s.diffuse(0.8)).add(shapes.ceiling(0.3, 2), s.emitter(6))
    return (made if mesh is None else made.add(mesh, material, **node)).seen((0, 1.2, 3), (0, 0.3, 0), 30)


def ball(rings=24, smooth=True):
    return shapes.sphere((0, 0.5, 0), 0.4, rings, smooth)


def slivers(count=1000):
    """The floor as triangles with an aspect ratio of 1 : 1000, and needles of 1 : 10^6 between them."""
    x = np.linspace(-1.5, 1.5, count + 1)
    x = np.sort(np.concatenate([x, x[1:-1] + 1e-6]))
    near, far = (np.stack([x, np.zeros_like(x), np.full_like(x, z)], 1) for z in (1.5, -1.5))
    a = np.arange(len(x) - 1)
    b = a + len(x)
    return shapes.Mesh(
        np.concatenate([near, far]), np.concatenate([np.stack([a, a + 1, b + 1], 1), np.stack([a, b + 1, b], 1)])
    )


def ground(*meshes):
    """The ball above floors that are joined to one mesh."""
    made = s.Scene().add(shapes.joined(*meshes), s.diffuse(0.8)).add(shapes.ceiling(0.3, 2), s.emitter(6))
    return made.add(ball(), GREY).seen((0, 1.2, 3), (0, 0.3, 0), 30)


def floor_of(*meshes, eye=(0, 2, 0.01)):
    """Floors that are joined to one mesh, in a white furnace, seen from above."""
    return s.Scene().within(1).add(shapes.joined(*meshes), s.diffuse(1)).seen(eye, (0, 0, 0), 20)


def cracked():
    """A closed box of grey walls with T-junctions: one wall has squares whose corners are not on the other walls."""
    top = shapes.grid(1, 7, 1.0).flipped()
    sides = shapes.box((-1, -1, -1), (1, 1, 1)).flipped().without([4, 5])
    return s.Scene().add(shapes.joined(sides, top), s.glowing(s.diffuse(0.5), 1)).seen((0.1, 0.2, 0.3), (1, 1, 0), 40)


def normals(factor):
    """The ball with its normals multiplied by a factor."""
    made = ball()
    return stage(replace(made, normals=made.normals * factor))


def broken(key, value):
    """The ball with one value of an attribute replaced, for example by NaN."""
    made = ball()
    array = getattr(made, key).copy()
    array[7, 1] = value
    return stage(replace(made, **{key: array}))


def scaled(*factors):
    """A flat-shaded ball around the origin, on a node with these scale factors."""
    return stage(shapes.sphere((0, 0, 0), 0.4, smooth=False).flat(), translation=[0, 0.5, 0], scale=list(factors))


def mirrored():
    """The ball of `scaled`, with mirrored vertices instead of a scaled node."""
    made = shapes.sphere((0, 0.5, 0), 0.4, smooth=False).flat()
    return stage(shapes.Mesh(made.positions * (-1, 1, 1), made.triangles[:, ::-1]))


def heap(copies):
    """`copies` clear glass balls in one place."""
    made = stage(None)
    for _ in range(copies):
        made = made.add(shapes.sphere((0, 0.5, 0), 0.4), s.glass(1.5))
    return made


def million():
    """10^7 triangles: a floor of 2,237² squares."""
    return floor_of(shapes.grid(1.5, 2237))


SAME = "Both surfaces are the same set of points."
NOTHING = "No ray hits a triangle without area."

CASES = [
    Case(
        "degenerate",
        "Triangles without area, in a separate mesh and among other triangles",
        {
            "without": partial(stage, ball(smooth=False)),
            "own": lambda: stage(ball(smooth=False)).add(DEGENERATE, GREY),
            "among": lambda: stage(shapes.joined(ball(smooth=False), DEGENERATE)),
        },
        Equal("without", ("own", "among"), NOTHING, resolves=0.06),
        EYE,
        iterations=4,
        seeds=FEW,
    ),
    Case(
        "slivers",
        "A floor of slivers, some 10^6 times as long as wide",
        {"two": lambda: ground(shapes.floor(1.5)), "slivers": lambda: ground(slivers())},
        Equal("two", ("slivers",), SAME, bound=0.005, resolves=0.06),
        EYE,
        iterations=4,
        seeds=FEW,
    ),
    Case(
        "duplicated",
        "A mesh without shared vertices",
        {"shared": lambda: stage(ball(smooth=False)), "own": lambda: stage(ball(smooth=False).flat())},
        Equal("shared", ("own",), SAME, bound=1e-5),
        EYE,
        seeds=FEW,
    ),
    Case(
        "huge-and-tiny",
        "Floors of 100 km and of 0.1 mm in one mesh, in a white furnace",
        {"scene": lambda: floor_of(shapes.floor(5e4, -0.01), shapes.floor(5e-5), eye=(0, 1e-3, 1e-6))},
        Value(
            1.0,
            "Two white planes, one far below the other, in a white furnace: radiance is 1.",
            bound=0.01,
            resolves=0.1,
        ),
        EYE,
        iterations={None: 64, "sppm": 32},
        photons=2000,
    ),
    Case(
        "coplanar",
        "Two floors in one place",
        {"one": lambda: ground(shapes.floor(1.5)), "two": lambda: ground(shapes.floor(1.5), shapes.floor(1.5))},
        Equal("one", ("two",), SAME + " It does not matter which of the two floors a ray hits.", resolves=0.06),
        EYE,
        iterations=4,
        seeds=FEW,
    ),
    Case(
        "cracks",
        "A closed box with T-junctions, whose walls emit",
        {"scene": cracked},
        Value(2.0, "L = 1 + L / 2. Light that escapes through a crack is missing.", bound=0.01, resolves=0.06),
        ("path", "bdpt", "vcm"),
        iterations={None: 32, "vcm": 80, "bdpt": 80},
        size=8,
    ),
    Case(
        "normals-zero",
        "Normals of length zero",
        {"unit": partial(normals, 1.0), "zero": partial(normals, 0.0)},
        Equal(
            "unit",
            ("zero",),
            "A normal without a direction is replaced by the normals of the faces around it, which makes the ball smooth.",
            bound=0.005,
            warned="normal",
        ),
        EYE,
        iterations=4,
    ),
    Case(
        "normals-long",
        "Normals of length 1000 and 0.001",
        {"unit": partial(normals, 1.0), "long": partial(normals, 1000.0), "short": partial(normals, 0.001)},
        Equal("unit", ("long", "short"), "A normal is a direction; its length has no meaning.", bound=1e-4),
        EYE,
        seeds=FEW,
    ),
    Case(
        "nan-position",
        "A position that is not a number",
        {"scene": partial(broken, "positions", np.nan)},
        Refused(
            "position.*(finite|nan|not a number)|(finite|nan|not a number).*position",
            "The triangle has no place, and a guess would hide the fault.",
        ),
        ("path",),
    ),
    Case(
        "nan-normal",
        "A normal that is not a number",
        {"whole": partial(normals, 1.0), "broken": partial(broken, "normals", np.nan)},
        Equal(
            "whole",
            ("broken",),
            "A normal that is not a number is replaced by the normals of the faces around it, which makes the ball smooth,"
            " and a warning names the mesh.",
            bound=0.005,
            warned="normal",
        ),
        EYE,
        iterations=4,
        seeds=FEW,
    ),
    Case(
        "scale-negative",
        "A mirrored node, and one that is mirrored three times",
        {"by-hand": mirrored, "x": partial(scaled, -1, 1, 1), "xyz": partial(scaled, -1, -1, -1)},
        Equal(
            "by-hand",
            ("x", "xyz"),
            "A ball is symmetrical, and mirroring a node keeps the front of its faces.",
            bound=0.002,
            resolves=0.06,
        ),
        EYE,
        iterations=4,
        seeds=FEW,
    ),
    Case(
        "scale-singular",
        "A node that flattens a ball to a disc looks like the disc",
        {"thin": partial(scaled, 1, 1e-4, 1), "flat": partial(scaled, 1, 0, 1)},
        Equal("thin", ("flat",), "A scale of zero is the limit of small ones.", bound=0.01, resolves=0.06),
        EYE,
        iterations=8,
    ),
    Case(
        "mesh-empty",
        "A mesh without triangles",
        {
            "without": partial(stage, None),
            "with": lambda: stage(None).add(shapes.Mesh(np.zeros((3, 3)), np.zeros((0, 3), int)), GREY),
        },
        Exact("without", {"with": 0}, "A mesh without triangles has no effect."),
        EYE,
        seeds=2,
    ),
    Case(
        "heap",
        "Many copies of a glass ball in one place",
        {"one": partial(heap, 1), "12": partial(heap, 12)},
        Equal("one", ("12",), "The border between equal glasses has no effect.", resolves=0.06),
        EYE,
        iterations=4,
        seeds=FEW,
    ),
    Case(
        "triangles-10^7",
        "A floor of ten million triangles in a white furnace",
        {"scene": million},
        Value(1.0, "A white plane in a white furnace.", resolves=0.06),
        ("path", "vcm"),
        seeds=FEW,
        iterations=4096,
        size=8,
        long=True,
    ),
]
