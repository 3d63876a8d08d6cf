"""Glass on a table: caustics, and what is seen through glass."""

import math

import build as b
import numpy as np

from .props import (
    add,
    clear,
    ground,
    lamp_or_sun,
    look,
    matte,
    metal,
    pick,
    places,
    solid,
    still_life,
    surface,
    turned,
    vessel,
)


def drink(r):
    """Returns a random liquid, clear or coloured, or None."""
    tints = [None, (0, 0, 0), (4, 30, 110), (9, 45, 160), (60, 90, 20), (3, 25, 25)]
    tint = pick(r, tints)
    return None if tint is None else b.glass("drink", r.uniform(1.33, 1.36), absorption=tint if any(tint) else None)


def tumblers(r):
    """Tumblers with and without drinks."""
    ground(r, 2.5)
    for at in places(r, int(r.integers(2, 6)), 0.22, 0.11):
        vessel(
            r,
            r.uniform(0.03, 0.042),
            r.uniform(0.07, 0.15),
            clear(r, tint=0.2, index=1.52),
            at,
            drink(r),
            r.uniform(0.05, 0.15),
            r.uniform(0, 0.25),
        )
    lamp_or_sun(r, 0.8)
    look(r, (0, 0, 0.05), 0.75)


def goblets(r):
    """Goblets: a foot, a stem, and a bowl with wine."""
    ground(r, 2.5)
    for at in places(r, int(r.integers(1, 5)), 0.22, 0.13):
        radius, stem, bowl = r.uniform(0.03, 0.045), r.uniform(0.05, 0.1), r.uniform(0.06, 0.1)
        t = np.linspace(0, math.pi * r.uniform(0.6, 0.75), 14)
        outer = [(radius * math.sin(x), stem + bowl * (1 - math.cos(x)) / 1.6) for x in t]
        inner = [(max(x - 0.0022, 0), z + 0.003) for x, z in outer]
        profile = [(0, 0), (0.034, 0), (0.033, 0.003), (0.005, 0.008), (0.004, stem - 0.004), *outer[1:], *inner[::-1]]
        glass = b.glass("goblet", 1.52)
        glass["caustique"] = {"priority": 1}
        add("goblet", b.lathe("goblet", profile, 80), glass, (*at, 0.0003))
        liquid = drink(r)
        if liquid is not None:
            level = stem + bowl * r.uniform(0.3, 0.7)
            low = [(x + 0.0006 * (x > 0), z - 0.0006) for x, z in inner if z < level]
            edge = float(np.interp(level, [z for _, z in inner], [x for x, _ in inner])) + 0.0006
            add("wine", b.lathe("wine", [*low, (edge, level), (0, level)], 80), liquid, (*at, 0.0003))
    lamp_or_sun(r, 0.8)
    look(r, (0, 0, 0.08), 0.8)


def bottles(r):
    """Bottles of coloured glass before a wall."""
    ground(r, 3)
    add("wall", b.plane("wall", 3, 1.2, uv=0.5), matte(r), (0, 0.45, 0.6), (90, 0, 0))
    for at in places(r, int(r.integers(2, 7)), 0.3, 0.12):
        w, h, neck = r.uniform(0.03, 0.045), r.uniform(0.18, 0.3), r.uniform(0.012, 0.016)
        shape = [(0, 0), (w, 0), (w, 0.6 * h), (neck, 0.78 * h), (neck, h)]
        inside = [(0, 0.006), (w - 0.003, 0.006), (w - 0.003, 0.6 * h), (neck - 0.003, 0.78 * h), (neck - 0.003, h)]
        profile = b.rounded(shape, 0.02, 6) + b.rounded(inside, 0.02, 6)[::-1]
        tint = pick(r, [(150, 40, 120), (20, 60, 200), (0, 0, 0), (5, 5, 8), (120, 100, 20)])
        add(
            "bottle",
            b.lathe("bottle", profile, 72),
            b.glass("bottle", 1.52, absorption=tint if any(tint) else None),
            (*at, 0.0003),
        )
    lamp_or_sun(r, 1.0)
    look(r, (0, 0, 0.1), 1.0, (5, 35))


def glass_balls(r):
    """Balls of clear and coloured glass among opaque ones."""
    ground(r, 3)
    for at in places(r, int(r.integers(4, 14)), 0.3, 0.12):
        radius = r.uniform(0.025, 0.058)
        add("ball", b.sphere("ball", radius, 6), pick(r, [clear, clear, clear, surface])(r), (*at, radius + 0.0002))
    lamp_or_sun(r, 1.0)
    look(r, (0, 0, 0.03), 0.95, (15, 60))


def glass_solids(r):
    """Boxes, cones, tori and turned solids of glass, some with a thing cast into them."""
    ground(r, 3)
    for at in places(r, int(r.integers(2, 7)), 0.28, 0.17):
        size = r.uniform(0.08, 0.16)
        mesh, lift = solid(r, size, 6)
        add("solid", mesh, clear(r), (*at, lift + 0.0002), (0, 0, r.uniform(0, 360)))
    at = (0, 0.42) if r.random() < 0.5 else (0.42, 0)
    add(
        "block",
        b.box("block", (0.17, 0.17, 0.17), 0.004, 4),
        b.glass("block", 1.5),
        (*at, 0.0852),
        (0, 0, r.uniform(0, 90)),
    )
    add("inclusion", b.torus("inclusion", 0.045, 0.016, 96, 32), surface(r), (*at, 0.085), tuple(r.uniform(0, 90, 3)))
    lamp_or_sun(r, 1.0)
    look(r, (0, 0.1, 0.05), 1.0)


def fluted(r):
    """Vases with fluted walls."""
    ground(r, 3)
    for at in places(r, int(r.integers(1, 4)), 0.2, 0.2):
        height, radius, flutes = r.uniform(0.15, 0.28), r.uniform(0.05, 0.08), int(r.integers(8, 24))
        depth, bulge, twist = r.uniform(0.02, 0.08), r.uniform(-0.3, 0.3), r.uniform(0, 1.5)

        def wall(u, v, inner):
            t = v if not inner else 1 - v
            z = 0.008 * inner + t * (height - 0.008 * inner)
            turn = 2 * math.pi * u
            size = (
                radius
                * (1 + bulge * math.sin(2.5 * t))
                * (1 + depth * math.cos(flutes * (turn + twist * t)) * (not inner))
                - 0.006 * inner
            )
            return size * math.cos(turn), size * math.sin(turn), z

        tall = 40
        shape = b.bmesh.new()
        sides = 12 * flutes
        rings = [
            [shape.verts.new(wall(i / sides, j / tall, inner)) for i in range(sides)]
            for inner in (False, True)
            for j in range(tall + 1)
        ]
        for low, high in zip(rings, rings[1:]):
            for i in range(sides):
                k = (i + 1) % sides
                shape.faces.new((low[i], low[k], high[k], high[i]))
        shape.faces.new(rings[0][::-1])
        shape.faces.new(rings[-1])
        add("vase", b.finish_mesh("vase", shape), clear(r, "vase", 0.5, 1.52), (*at, 0.0003))
    lamp_or_sun(r, 1.0)
    look(r, (0, 0, 0.1), 0.95)


def lenses(r):
    """Lenses and magnifiers that stand or lie over a patterned table."""
    ground(r, 2.5, matte(r, "paper"))
    for at in places(r, int(r.integers(2, 6)), 0.25, 0.16):
        radius, thick = r.uniform(0.04, 0.08), r.uniform(0.2, 0.6)
        add(
            "lens",
            b.sphere("lens", 1.0, 6),
            clear(r, "lens", 0.1),
            (*at, radius + 0.012),
            (r.choice([0, 90, r.uniform(0, 90)]), 0, r.uniform(0, 360)),
            (radius, radius, radius * thick),
        )
    still_life(r, 3, 0.4, 0.06, surface)
    lamp_or_sun(r, 1.0)
    look(r, (0, 0, 0.04), 0.9, (20, 60))


def frosted(r):
    """Rough glass, thin shells and turned solids of glass."""
    ground(r, 3)
    for at in places(r, int(r.integers(2, 6)), 0.28, 0.16):
        size = r.uniform(0.08, 0.15)
        material = b.glass("frosted", r.uniform(1.4, 1.7), r.uniform(0.05, 0.5), tuple(r.uniform(0, 8, 3)))
        if r.random() < 0.4:
            vessel(r, size / 3, size, material, at, drink(r))
        else:
            add("solid", turned(r, size), material, (*at, 0.0003))
    still_life(r, 2, 0.35, 0.07, metal)
    lamp_or_sun(r, 1.0)
    look(r, (0, 0, 0.05), 0.95)
