"""1. Scale and place: a scaled scene, or a scene far from the origin, looks the same."""

from . import scene as s
from . import shapes
from .answers import Equal, Exact
from .case import FEW, Case

TITLE = "Scale"
METHODS = ("path", "bdpt", "vcm", "sppm")


def room():
    """An open room of two metres with coloured walls, a light, a glass sphere with its caustic, and a rough metal sphere."""
    sides = shapes.box((-1, 0, -1), (1, 2, 1)).flipped().without([8, 9])
    return (
        s.Scene()
        .add(sides, s.diffuse((0.6, 0.5, 0.4)))
        .add(shapes.ceiling(0.25, 1.98), s.emitter((8, 9, 10)))
        .add(shapes.sphere((0.35, 0.4, 0.2), 0.3), s.glass(1.5))
        .add(shapes.sphere((-0.4, 0.3, -0.2), 0.3), s.metal((0.9, 0.7, 0.4), 0.4))
        .seen((0, 1, 4), (0, 0.75, 0), 35)
    )


def _scales(factors):
    return {
        "one": lambda: room().scaled(1),
        **{name: lambda f=factor: room().scaled(f) for name, factor in factors.items()},
    }


def _places(metres):
    """A room at the origin, and one on a node far away, in a direction that is not along an axis."""
    return {"here": room, "there": lambda: room().moved((metres, 0.3 * metres, -0.6 * metres))}


SAME = "Radiance does not depend on the unit of length, because without media no property of the scene has a length."
PLACE = "Radiance does not depend on the place. Single precision rounds {0} to {1}, which gives the bound."
#: Exponents of two by label, for enlarged and for reduced rooms.
LARGE, SMALL = {"2^1": 1, "2^10": 10, "2^20": 20}, {"2^-10": -10}
EXACT = SAME + " A power of two changes only exponents, not rounding."


def _binary(name, title, powers, **more):
    return Case(
        name,
        title,
        _scales({label: 2.0**power for label, power in powers.items()}),
        Exact("one", {label: 0 for label in powers}, EXACT),
        METHODS,
        seeds=2,
        iterations=4,
        **more,
    )


CASES = [
    Case(
        "scale-decimal",
        "A room scaled by 1e-3, 1e3 and 1e6",
        _scales({"milli": 1e-3, "kilo": 1e3, "mega": 1e6}),
        Equal("one", ("milli", "kilo", "mega"), SAME, resolves=0.05),
        METHODS,
        iterations=4,
        seeds=FEW,
    ),
    _binary(
        "scale-binary-large",
        "A room scaled by 2, 2^10 and 2^20, to the last bit",
        LARGE,
    ),
    _binary(
        "scale-binary-small",
        "A room scaled by 2^-10, to 2 mm, to the last bit",
        SMALL,
    ),
    Case(
        "far-10km",
        "A room 13 km from the origin",
        _places(1e4),
        Equal("here", ("there",), PLACE.format("13 km", "0.5 mm"), bound=0.005, resolves=0.05),
        METHODS,
        iterations=4,
        seeds=FEW,
    ),
    Case(
        "far-1000km",
        "A room 1,300 km from the origin",
        _places(1e6),
        Equal(
            "here",
            ("there",),
            PLACE.format("1,300 km", "6 cm") + " A renderer that composes matrices in double "
            "precision and moves the origin loses nothing, which this case requires.",
            bound=0.02,
            resolves=0.1,
        ),
        METHODS,
        iterations=4,
        seeds=FEW,
    ),
]
