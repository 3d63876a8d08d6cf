"""Fog, smoke, milk and wax."""

import build as b
import numpy as np

from .props import (
    add,
    clear,
    colour,
    fill_medium,
    ground,
    lamp_or_sun,
    look,
    matte,
    metal,
    pick,
    places,
    room,
    scattering,
    solid,
    still_life,
    surface,
    turned,
    vessel,
)


def foggy_room(r):
    """A room with fog, a spotlight, and a thing of glass or metal in its beam."""
    room(r, 4, 4.5, 2.6)
    at, high = r.uniform((-0.8, 0, 0), (0.8, 1, 0)), r.uniform(0.5, 0.9)
    add("pedestal", turned(r, high), surface(r), at)
    mesh, lift = solid(r, 0.36, 6)
    add("thing", mesh, pick(r, [clear, metal, clear])(r), (at[0], at[1], high + lift))
    side = r.choice([-1, 1])
    b.spot(
        "beam",
        (side * 1.8, r.uniform(0, 1), 2.3),
        (at[0], at[1], high + 0.15),
        r.uniform(600, 2000),
        r.uniform(14, 35),
        (1.0, 0.93, 0.8),
        0.2,
        0.02,
    )
    b.point("lantern", (-side * 1.6, -0.5, 2.0), r.uniform(40, 160), (0.5, 0.65, 1.0), 0.06)
    fill_medium(b.sky((0, 0, 0)).node_tree, r.uniform(0.05, 0.35), (0.95, 0.95, 0.95), r.uniform(0, 0.6))
    b.camera((r.uniform(-0.8, 0.8), -2.1, r.uniform(0.8, 1.6)), (at[0] * 0.5, 0.6, 0.9), r.uniform(24, 34))


def smoky_stage(r):
    """Beams of several spotlights in thin smoke."""
    ground(r, 6)
    add("wall", b.plane("wall", 6, 3.5, uv=1.5), matte(r, "wall"), (0, 1.6, 1.75), (90, 0, 0))
    still_life(r, int(r.integers(2, 6)), 1.0, 0.5, lambda r: pick(r, [surface, clear])(r))
    for _ in range(int(r.integers(2, 5))):
        b.spot(
            "spot",
            tuple(r.uniform((-2, -1, 2.2), (2, 1.2, 3.2))),
            tuple(r.uniform((-0.8, -0.5, 0), (0.8, 0.8, 0.4))),
            r.uniform(300, 1200),
            r.uniform(10, 30),
            colour(r, 0.3, 1, 0.2),
            0.2,
            0.02,
        )
    fill_medium(b.sky((0, 0, 0)).node_tree, r.uniform(0.03, 0.2), (0.9, 0.9, 0.9), r.uniform(0, 0.5))
    look(r, (0, 0.2, 0.6), 3.6, (4, 25), (-30, 30), (26, 40))


def milky(r):
    """Glasses with scattering drinks."""
    ground(r, 2.5)
    for at in places(r, int(r.integers(2, 5)), 0.2, 0.12):
        liquid = (
            scattering(r, "milk", r.uniform(60, 1500), 1.34, r.uniform(0, 0.5))
            if r.random() < 0.7
            else b.glass("tea", 1.333, absorption=(9, 42, 160))
        )
        vessel(
            r,
            r.uniform(0.03, 0.045),
            r.uniform(0.08, 0.14),
            b.glass("glass", 1.52),
            at,
            liquid,
            flare=r.uniform(0, 0.2),
        )
    still_life(r, 2, 0.3, 0.06, surface)
    lamp_or_sun(r, 0.8)
    look(r, (0, 0, 0.05), 0.75)


def wax(r):
    """Solids that scatter: wax, soap, jade."""
    ground(r, 2.5)
    for at in places(r, int(r.integers(2, 6)), 0.25, 0.15):
        mesh, lift = solid(r, r.uniform(0.07, 0.14))
        add(
            "wax",
            mesh,
            scattering(r, "wax", r.uniform(40, 600), r.uniform(1.3, 1.5)),
            (*at, lift + 0.0003),
            (0, 0, r.uniform(0, 360)),
        )
    lamp_or_sun(r, 0.9)
    look(r, (0, 0, 0.05), 0.85)


def dusty_window(r):
    """A dusty room with beams of a light that shines through openings."""
    room(r, 4, 5, 2.8, window=(r.uniform(-0.3, 0.8), 1.6, r.uniform(0.5, 1.2), r.uniform(0.6, 1.2)))
    for x in np.linspace(-0.4, 0.4, 4):
        add("bar", b.box("bar", (0.04, 0.04, 1.4)), matte(r), (-2.08, r.uniform(-0.5, 0.9) + x, 1.6))
    still_life(r, 4, 1.2, 0.6, surface)
    b.spot(
        "light",
        (-6, r.uniform(-1.5, 1.5), r.uniform(3.5, 6)),
        (0, 0.3, 0.5),
        20000,
        40,
        (1, 0.9, 0.7),
        0.1,
        r.uniform(0.02, 0.1),
    )
    fill_medium(b.sky((0, 0, 0)).node_tree, r.uniform(0.02, 0.12), (0.95, 0.95, 0.95), r.uniform(0, 0.6))
    b.camera((r.uniform(0, 1.2), -2.3, r.uniform(0.8, 1.6)), (-0.3, 0.8, 1.1), r.uniform(20, 28))
