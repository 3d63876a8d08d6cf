"""Water: what lies in it is lit and seen through its ripples."""

import build as b
import numpy as np

from .props import (
    add,
    clear,
    daylight,
    ground,
    lamp_or_sun,
    look,
    matte,
    pick,
    ripples,
    shiny,
    solid,
    surface,
    water,
)


def basin(r, width, depth, deep, material, wall=0.2):
    """A basin with its rim at z = 0."""
    add("bottom", b.plane("bottom", width, depth, uv=r.uniform(0.3, 1) * width), material, (0, 0, -deep))
    for name, size, at, turn in (
        ("left", depth, (-width / 2, 0), 90),
        ("right", depth, (width / 2, 0), -90),
        ("far", width, (0, depth / 2), 0),
        ("near", width, (0, -depth / 2), 180),
    ):
        add(name, b.plane(name, size, deep, uv=0.5 * width), material, (*at, -deep / 2), (90, 0, turn))
    rim = pick(r, [matte, shiny])(r, "rim")
    for size, at in (
        ((wall, depth + 2 * wall, 0.04), (width / 2 + wall / 2, 0)),
        ((width, wall, 0.04), (0, depth / 2 + wall / 2)),
    ):
        for sign in (-1, 1):
            add("rim", b.box("rim", size, 0.008, 2, uv=0.6 * width), rim, (sign * at[0], sign * at[1], -0.02))


def sunken(r, count, extent, bottom, size):
    """Things on the bottom."""
    for _ in range(count):
        mesh, lift = solid(r, size * r.uniform(0.5, 1))
        add(
            "sunken",
            mesh,
            surface(r),
            (*r.uniform(-extent, extent, 2), bottom + lift + 0.001),
            (0, 0, r.uniform(0, 360)),
        )


def pool(r):
    """A pool under the sun."""
    width, depth, deep = r.uniform(2.5, 5), r.uniform(3, 6), r.uniform(0.7, 1.8)
    basin(r, width, depth, deep, pick(r, [matte, shiny])(r, "tiles"), 0.5)
    water(r, width + 0.02, depth + 0.02, -deep, -0.12, r.uniform(0.5, 1.6))
    sunken(r, int(r.integers(0, 5)), 0.3 * width, -deep, 0.5)
    daylight(r, 35, 75)
    look(r, (0, 0, -0.5), 6.5, (25, 65), (-70, 70), (30, 50))


def night_pool(r):
    """A pool lit by lights under water, before a wall."""
    width, depth, deep = r.uniform(2.5, 4), r.uniform(3, 5), r.uniform(0.8, 1.4)
    basin(r, width, depth, deep, pick(r, [matte, shiny])(r, "tiles"), 1.0)
    add("wall", b.plane("wall", 12, 5, uv=1.5), matte(r, "wall"), (0, depth / 2 + 1.0, 2.5), (90, 0, 0))
    water(r, width + 0.02, depth + 0.02, -deep, -0.1, r.uniform(0.4, 1.2))
    for y in np.linspace(-0.35, 0.35, int(r.integers(2, 4))) * depth:
        for x in (-1, 1):
            glow = b.emission("lamp", tuple(np.array([520, 480, 380]) * r.uniform(0.5, 1)))
            add("lamp", b.plane("lamp", 0.12, 0.12), glow, (x * (width / 2 - 0.01), y, -0.5), (0, -90 * x, 0))
    b.sky((0.004, 0.006, 0.012))
    look(r, (0, 0.5, 0.2), 5.5, (10, 35), (-30, 30), (26, 40))


def tub(r):
    """A small metal or stone tub under a lamp."""
    width, depth, deep = r.uniform(0.4, 0.8), r.uniform(0.4, 0.8), r.uniform(0.1, 0.25)
    basin(r, width, depth, deep, surface(r), 0.1)
    water(r, width + 0.002, depth + 0.002, -deep, -0.03, r.uniform(0.2, 0.7), False)
    sunken(r, int(r.integers(1, 7)), 0.3 * width, -deep, 0.12)
    lamp_or_sun(r, 1.2)
    look(r, (0, 0, -0.08), 1.3, (25, 65), (-60, 60), (30, 55))


def aquarium(r):
    """A glass tank with water, stones and plants of tubes."""
    width, depth, high = r.uniform(0.5, 0.9), r.uniform(0.25, 0.4), r.uniform(0.3, 0.45)
    ground(r, 4)
    add("wall", b.plane("wall", 4, 2, uv=0.8), matte(r), (0, 0.6, 1.0), (90, 0, 0))
    glass = b.glass("tank", 1.52)
    glass["caustique"] = {"priority": 1}
    for size, at in (((0.008, depth, high), (width / 2, 0)), ((width, 0.008, high), (0, depth / 2 - 0.004))):
        for sign in (-1, 1):
            add("pane", b.box("pane", size), glass, (sign * at[0], sign * at[1], high / 2 + 0.004))
    add("gravel", b.box("gravel", (width - 0.012, depth - 0.02, 0.03), uv=0.2), matte(r, "gravel"), (0, 0, 0.016))
    water(r, width - 0.004, depth - 0.012, 0.025, high * 0.85, 0.15)
    for _ in range(int(r.integers(3, 9))):
        mesh, lift = solid(r, r.uniform(0.04, 0.1))
        add(
            "stone",
            mesh,
            surface(r),
            (r.uniform(-0.4, 0.4) * width, r.uniform(-0.3, 0.3) * depth, 0.032 + lift),
            (0, 0, r.uniform(0, 360)),
        )
    green = b.principled("plant", (0.1, 0.4, 0.1), 0.5)
    for _ in range(int(r.integers(3, 10))):
        x, y, lean = r.uniform(-0.4, 0.4) * width, r.uniform(-0.3, 0.3) * depth, r.normal(0, 0.03, 2)
        path = [(x + lean[0] * t * t, y + lean[1] * t, 0.03 + 0.6 * high * t) for t in np.linspace(0, 1, 8)]
        add("plant", b.tube("plant", path, 0.003, 8), green)
    lamp_or_sun(r, 1.2)
    look(r, (0, 0, 0.5 * high), 1.5, (5, 30), (-40, 40), (35, 60))


def puddles(r):
    """Wet ground: thin sheets of water around half-immersed things."""
    ground(r, 8)
    water(r, r.uniform(1.5, 3), r.uniform(1.5, 3), -0.0001, r.uniform(0.02, 0.08), r.uniform(0.05, 0.3), False)
    for _ in range(int(r.integers(4, 10))):
        mesh, lift = solid(r, r.uniform(0.1, 0.4))
        add("thing", mesh, surface(r), (*r.uniform(-1, 1, 2), lift + 0.001), (0, 0, r.uniform(0, 360)))
    daylight(r, 15, 60)
    look(r, (0, 0, 0.1), 3.0, (10, 45))


def water_light(r):
    """A low sun on water, whose reflections play on a wall."""
    ground(r, 10)
    add("wall", b.box("wall", (6, 0.2, 3), uv=1.0), matte(r, "wall"), (0, 1.6, 1.5))
    water(r, 5, 3, -0.0001, r.uniform(0.1, 0.25), r.uniform(0.3, 0.9), False)
    for _ in range(int(r.integers(1, 5))):
        mesh, lift = solid(r, r.uniform(0.3, 0.8))
        add(
            "thing",
            mesh,
            surface(r),
            (r.uniform(-1.5, 1.5), r.uniform(0.2, 1.2), lift + 0.001),
            (0, 0, r.uniform(0, 360)),
        )
    b.sun("sun", (r.uniform(-0.6, 0.6), 1, r.uniform(-0.8, -0.2)), r.uniform(3, 8), (1, 0.85, 0.65))
    b.sky((0.06, 0.09, 0.14))
    look(r, (0, 0.9, 0.6), 4.5, (8, 30), (-40, 40), (28, 45))


def waves(r):
    """Glass plates with waves, which throw nets of light on the table."""
    ground(r, 3)
    for k in range(int(r.integers(1, 4))):
        size, wave = r.uniform(0.2, 0.45), ripples(r, 0.5, r.uniform(0.002, 0.012))
        mesh = b.sheet(
            "plate",
            100,
            100,
            lambda u, v: ((u - 0.5) * size, (v - 0.5) * size, 0.02 + wave((u - 0.5) * size, (v - 0.5) * size)),
            bottom=0.0,
        )
        add(
            "plate",
            mesh,
            clear(r, "plate", 0.3),
            (*r.uniform(-0.25, 0.25, 2), 0.05 + 0.09 * k),
            (r.uniform(-12, 12), r.uniform(-12, 12), r.uniform(0, 360)),
        )
    lamp_or_sun(r, 1.0)
    look(r, (0, 0, 0.05), 1.1, (20, 60))
