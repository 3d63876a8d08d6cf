"""Many lights, hidden lights, and lights behind glass."""

import math

import build as b
import numpy as np

from .props import (
    add,
    clear,
    colour,
    glowing,
    ground,
    look,
    matte,
    metal,
    panel,
    pick,
    places,
    room,
    shiny,
    solid,
    still_life,
    surface,
)


def stage(r):
    """A stage under coloured spotlights."""
    ground(r, 8)
    add(
        "curtain",
        b.sheet("curtain", 160, 2, lambda u, v: (6 * (u - 0.5), 2 + 0.12 * math.sin(90 * u), 3 * v)),
        matte(r, "curtain"),
    )
    still_life(r, int(r.integers(3, 8)), 1.3, 0.6, lambda r: pick(r, [surface, surface, clear])(r))
    for _ in range(int(r.integers(3, 8))):
        at = r.uniform((-2.5, -2.5, 2), (2.5, 1, 4))
        b.spot(
            "spot",
            tuple(at),
            tuple(r.uniform((-1, -1, 0), (1, 1, 0.4))),
            r.uniform(150, 800),
            r.uniform(15, 50),
            colour(r, 0.1, 1, 0),
            r.uniform(0, 0.5),
            r.uniform(0.01, 0.1),
        )
    look(r, (0, 0, 0.3), 4.0, (5, 40))


def bulbs(r):
    """Bulbs in glass globes."""
    ground(r, 4)
    add("wall", b.plane("wall", 4, 2, uv=1.0), matte(r, "wall"), (0, 0.6, 1), (90, 0, 0))
    for at in places(r, int(r.integers(1, 5)), 0.35, 0.25):
        radius, high = r.uniform(0.05, 0.1), r.uniform(0.12, 0.35)
        add(
            "base",
            b.lathe(
                "base",
                b.rounded([(0, 0), (0.05, 0), (0.02, 0.02), (0.015, high - radius), (0, high - radius)], 0.01, 3),
                48,
            ),
            metal(r),
            (*at, 0.0002),
        )
        turns = np.linspace(0.35, math.pi, 32)
        shape = [
            (size * math.sin(t), -size * math.cos(t))
            for size, order in ((radius, turns), (0.94 * radius, turns[::-1]))
            for t in order
        ]
        shape = [(0 if abs(x) < 1e-6 else x, z) for x, z in shape]
        glass = b.glass("globe", 1.5, 0.0 if r.random() < 0.6 else r.uniform(0.1, 0.4))
        add("globe", b.lathe("globe", shape, 64, closed=True), glass, (*at, high + 0.002))
        glowing(r, (*at, high + 0.002), r.uniform(0.006, 0.02), r.uniform(2, 6))
    still_life(r, 4, 0.5, 0.1, surface)
    look(r, (0, 0, 0.15), 1.3, (5, 40))


def shades(r):
    """Lamps with opaque shades: light from above and below, the rest is indirect."""
    room(r, 3, 3, 2.4)
    add("table", b.box("table", (1.6, 0.9, 0.05), 0.01, 2, uv=0.6), pick(r, [matte, shiny])(r), (0, 0.3, 0.7))
    for at in places(r, int(r.integers(1, 4)), 0.5, 0.4):
        x, y = at[0], 0.3 + 0.5 * at[1]
        low, high, tall = r.uniform(0.1, 0.18), r.uniform(0.05, 0.12), r.uniform(0.14, 0.22)
        shade = b.lathe("shade", [(low, 0), (high, tall), (high - 0.004, tall), (low - 0.004, 0)], 64, closed=True)
        add("shade", shade, surface(r, "shade"), (x, y, 1.0))
        add(
            "stand",
            b.lathe("stand", [(0, 0), (0.06, 0), (0.06, 0.01), (0.008, 0.02), (0.008, 0.3), (0, 0.3)], 32),
            metal(r),
            (x, y, 0.7253),
        )
        glowing(r, (x, y, 1.08), 0.025, r.uniform(4, 10))
    for _ in range(5):
        mesh, lift = solid(r, 0.12)
        add("thing", mesh, pick(r, [surface, clear])(r), (r.uniform(-0.7, 0.7), r.uniform(-0.1, 0.6), 0.7255 + lift))
    look(r, (0, 0.3, 0.9), 1.6, (5, 35), (-35, 35), (26, 42))


def neon(r):
    """Glowing tubes near shiny things."""
    ground(r, 5, pick(r, [shiny, matte])(r, "ground"))
    add("wall", b.plane("wall", 5, 3, uv=1.2), matte(r, "wall"), (0, 0.9, 1.5), (90, 0, 0))
    for _ in range(int(r.integers(2, 6))):
        points = r.uniform((-0.8, 0.4, 0.1), (0.8, 0.8, 1.2), (4, 3))
        radiance = np.array(colour(r, 0.05, 1, 0)) * r.uniform(20, 60)
        add(
            "neon",
            b.tube("neon", b.arc([tuple(p) for p in points], 0.1, 6), 0.012, 12),
            b.emission("neon", tuple(radiance)),
        )
    still_life(r, int(r.integers(3, 8)), 0.6, 0.3, lambda r: pick(r, [shiny, metal, clear, matte])(r))
    look(r, (0, 0.2, 0.25), 2.2, (5, 35))


def small_lights(r):
    """Tens of small coloured lights among things on the ground."""
    ground(r, 5, pick(r, [shiny, matte])(r, "ground"))
    for at in r.uniform((-1, -1, 0.05), (1, 1, 0.7), (int(r.integers(12, 50)), 3)):
        glowing(r, at, r.uniform(0.006, 0.02), r.uniform(0.1, 1.0))
    still_life(r, int(r.integers(5, 12)), 0.9, 0.25, lambda r: pick(r, [surface, surface, clear])(r))
    b.sky((0.01, 0.012, 0.02))
    look(r, (0, 0, 0.15), 2.4, (10, 40))


def studio(r):
    """Products under soft boxes, some of them lacquered, brushed or of glass."""
    paper = b.principled("paper", colour(r, 0.3, 0.9, 0.8), 0.9)
    bend = lambda v: (
        (-1.5 + 2.2 * min(v / 0.5, 1), 0.0)
        if v < 0.5
        else (0.7 + 0.4 * math.sin(math.pi * (v - 0.5)), 1.6 * (1 - math.cos(math.pi * (v - 0.5))))
    )
    add("paper", b.sheet("paper", 2, 60, lambda u, v: (4 * (u - 0.5), *bend(v))), paper)
    still_life(r, int(r.integers(3, 9)), 0.4, 0.2, lambda r: pick(r, [shiny, metal, clear, surface])(r))
    for _ in range(int(r.integers(1, 4))):
        turn, lift = r.uniform(0, 6.3), r.uniform(0.8, 1.8)
        at = np.array([1.5 * math.cos(turn), 1.2 * math.sin(turn) - 0.4, lift])
        body = panel(r, tuple(at), tuple(r.uniform(0.3, 1.0, 2)), r.uniform(3, 10))
        body.rotation_euler = b.Vector(-at).to_track_quat("Z", "Y").to_euler()
    b.sky((0.05, 0.05, 0.05))
    look(r, (0, 0, 0.08), 1.3, (8, 40))
