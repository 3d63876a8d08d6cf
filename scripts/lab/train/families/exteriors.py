"""Outdoors: sun and sky, and streets by night."""

import math

import build as b
import numpy as np

from .props import (
    add,
    clear,
    colour,
    daylight,
    glowing,
    ground,
    look,
    matte,
    metal,
    pick,
    places,
    ripples,
    shiny,
    still_life,
    surface,
    turned,
)


def courtyard(r):
    """Arcades of columns around a paved court."""
    ground(r, 14)
    stone, column = (
        matte(r, "stone"),
        turned(r, 1.0) if r.random() < 0.4 else b.lathe("column", [(0, 0), (0.11, 0), (0.09, 1), (0, 1)], 40),
    )
    side, high = r.uniform(2.5, 4), r.uniform(2, 3)
    for turn in (0, 90, -90):
        for x in np.linspace(-side, side, int(r.integers(4, 8))):
            at = b.Matrix.Rotation(math.radians(turn), 3, "Z") @ b.Vector((x, side, 0))
            add("column", column, stone, at, (0, 0, turn), (1.2, 1.2, high))
        for depth, z, size in (
            (side, high + 0.3, (2 * side + 0.4, 0.4, 0.6)),
            (side + 1.5, 1.7, (2 * side + 3, 0.2, 3.4)),
        ):
            at = b.Matrix.Rotation(math.radians(turn), 3, "Z") @ b.Vector((0, depth, z))
            add("wall", b.box("wall", size, 0.02, 1, uv=1.5), stone, at, (0, 0, turn))
    still_life(r, int(r.integers(2, 7)), 0.6 * side, 0.9, surface)
    daylight(r, 25, 65)
    look(r, (0, 0.5, 0.9), 6.0, (6, 25), (-25, 25), (24, 36))


def facade(r):
    """A house front with panes of glass and sills, and its light on the pavement."""
    ground(r, 16)
    wall, frame = matte(r, "wall"), surface(r, "frame")
    add("house", b.box("house", (9, 1, 6), uv=1.5), wall, (0, 3, 3.0))
    for x in np.linspace(-3.4, 3.4, int(r.integers(3, 6))):
        for z in (1.3, 3.3):
            add("frame", b.box("frame", (1.0, 0.1, 1.3), 0.01, 1), frame, (x, 2.47, z))
            add(
                "pane",
                b.box("pane", (0.86, 0.01, 1.16)),
                clear(r, "pane", 0.1, 1.52) if r.random() < 0.5 else metal(r, "film", 0.05),
                (x, 2.40, z),
                (r.normal(0, 0.6), 0, r.normal(0, 0.6)),
            )
            add("sill", b.box("sill", (1.2, 0.25, 0.06), 0.01, 1), wall, (x, 2.4, z - 0.7))
    still_life(r, int(r.integers(2, 6)), 2.0, 0.8, surface)
    b.sun("sun", (r.uniform(-0.7, 0.7), 1, r.uniform(-1.0, -0.4)), r.uniform(3, 6), (1, 0.94, 0.85))
    b.sky(tuple(np.array([0.22, 0.3, 0.42]) * r.uniform(0.4, 1.5)))
    look(r, (0, 1.5, 1.2), 7.0, (4, 20), (-35, 35), (26, 40))


def garden(r):
    """Rolling ground with round and pointed trees under an uneven sky."""
    wave = ripples(r, 14, 0.12, 12)
    grass = matte(r, "grass")
    mesh = b.sheet(
        "ground", 80, 80, lambda u, v: (14 * (u - 0.5), 14 * (v - 0.5), wave(14 * (u - 0.5), 14 * (v - 0.5))), uv=True
    )
    add("ground", mesh, grass)
    leaf = [
        b.principled("leaf", (r.uniform(0.05, 0.3), r.uniform(0.2, 0.5), r.uniform(0.03, 0.15)), 0.7) for _ in range(3)
    ]
    crowns = [b.sphere("crown", 0.5, 4), b.lathe("cone", [(0, -0.5), (0.4, -0.5), (0.02, 0.6), (0, 0.6)], 32)]
    for x, y in places(r, int(r.integers(10, 40)), 5, 0.7):
        size, z = r.uniform(0.4, 1.2), wave(x, y)
        add(
            "trunk",
            b.lathe("trunk", [(0, 0), (0.06, 0), (0.05, 0.6), (0, 0.6)], 16),
            matte(r, "bark") if r.random() < 0.1 else leaf[0],
            (x, y, z - 0.05),
        )
        add(
            "crown",
            pick(r, crowns),
            pick(r, leaf),
            (x, y, z + 0.5 + 0.4 * size),
            (0, 0, r.uniform(0, 360)),
            (size, size, size * r.uniform(0.8, 1.8)),
        )
    bright = r.uniform(0.5, 3)
    b.dome(
        lambda x, y, z: (
            np.array([0.25, 0.35, 0.5]) * (0.4 + np.clip(z, 0, 1))[..., None]
            + np.array([1.0, 0.8, 0.5]) * (bright * np.clip(x * 0.6 + z * 0.5, 0, 1) ** 8)[..., None]
        )
    )
    if r.random() < 0.7:
        b.sun("sun", (r.uniform(-1, 1), r.uniform(-1, 1), r.uniform(-1, -0.4)), r.uniform(2, 5), (1, 0.93, 0.82))
    look(r, (0, 0.5, 0.6), 6.5, (8, 30), (-60, 60), (26, 42))


def night_street(r):
    """A wet street with lamps, lit windows and a few cars of boxes."""
    ground(r, 30, b.principled("asphalt", (0.05, 0.05, 0.055), r.uniform(0.1, 0.4), texture=None))
    for x in (-1, 1):
        add("pavement", b.box("pavement", (1.4, 24, 0.12), 0.02, 1, uv=1.0), matte(r, "pavement"), (x * 3.2, 4, 0.06))
        for y in np.linspace(-3, 14, int(r.integers(3, 7))):
            add(
                "house",
                b.box("house", (2, r.uniform(2, 3), r.uniform(3, 7)), uv=1.5),
                matte(r, "house"),
                (x * 5.2, y, 1.5),
            )
            if r.random() < 0.7:
                panel_at = (x * 4.19, y + r.uniform(-0.5, 0.5), r.uniform(1, 2.6))
                glow = b.emission("window", tuple(np.array(colour(r, 0.3, 1, 0.4)) * r.uniform(1, 8)))
                add(
                    "window",
                    b.plane("window", r.uniform(0.4, 0.9), r.uniform(0.6, 1.0)),
                    glow,
                    panel_at,
                    (0, -90 * x, 0),
                )
            if r.random() < 0.6:
                add(
                    "post",
                    b.lathe("post", [(0, 0), (0.05, 0), (0.03, 3), (0, 3)], 20),
                    metal(r, "post"),
                    (x * 2.6, y, 0.12),
                )
                glowing(r, (x * 2.6, y, 3.25), 0.12, r.uniform(10, 40))
    for _ in range(int(r.integers(1, 5))):
        x, y = r.choice([-1.1, 1.1]), r.uniform(-1, 9)
        paint = shiny(r, "paint")
        add("body", b.box("body", (1.5, 3.2, 0.6), 0.15, 3), paint, (x, y, 0.55))
        add("cabin", b.box("cabin", (1.3, 1.6, 0.5), 0.15, 3), metal(r, "windows", 0.1), (x, y, 1.05))
        for side in (-0.5, 0.5):
            add(
                "light",
                b.plane("light", 0.15, 0.1),
                b.emission("light", (60, 8, 6) if x < 0 else (90, 85, 70)),
                (x + side, y - 1.605, 0.6),
                (90, 0, 0),
            )
    b.sky((0.006, 0.008, 0.015))
    b.camera(
        (r.uniform(-1.5, 1.5), -5, r.uniform(0.8, 2.2)),
        (r.uniform(-0.5, 0.5), 5, r.uniform(0.8, 1.6)),
        r.uniform(24, 40),
    )


def terrace(r):
    """Things of glass and metal on a terrace in the sun."""
    ground(r, 10)
    add("wall", b.box("wall", (5, 0.2, 1.0), 0.02, 2, uv=1.0), matte(r, "wall"), (0, 1.3, 0.5))
    still_life(r, int(r.integers(4, 10)), 0.9, 0.35, lambda r: pick(r, [clear, surface, metal])(r))
    daylight(r, 15, 65)
    look(r, (0, 0.2, 0.15), 2.6, (10, 40))
