"""Rooms: most of their light is indirect."""

import build as b
import numpy as np

from .props import (
    add,
    clear,
    colour,
    glowing,
    inside,
    light_colour,
    look,
    matte,
    metal,
    panel,
    pick,
    room,
    shiny,
    solid,
    still_life,
    surface,
    turned,
    vessel,
)


def closed_box(r):
    """A box with coloured walls, a panel light, and boxes and balls of any material."""
    side = r.uniform(1.6, 2.6)
    plain = lambda: b.principled("wall", colour(r, 0.2, 0.85, 0.0), 0.9, Specular_IOR_Level=0.0)
    room(r, side, side, side, [plain(), plain(), plain(), plain()], front=False)
    panel(r, (r.uniform(-0.3, 0.3), r.uniform(-0.3, 0.3), side - 0.002), (r.uniform(0.2, 0.8), r.uniform(0.2, 0.8)), 8)
    still_life(r, int(r.integers(2, 6)), 0.35 * side, 0.35 * side, lambda r: pick(r, [surface, clear])(r))
    look(r, (0, 0, 0.42 * side), 2.0 * side, (0, 12), (-12, 12), (38, 60))


def furniture(r, width, depth):
    """Cabinets along the walls, a table with things on it."""
    for k in range(int(r.integers(3, 7))):
        size = r.uniform((0.4, 0.3, 0.4), (1.2, 0.6, 1.8))
        side = r.integers(3)
        at = [
            (r.uniform(-0.4, 0.4) * width, depth / 2 - size[1] / 2),
            (width / 2 - size[1] / 2, r.uniform(-0.3, 0.4) * depth),
            (-width / 2 + size[1] / 2, r.uniform(0.2, 0.4) * depth),
        ][side]
        add(
            "cabinet",
            b.box("cabinet", tuple(size), 0.015, 2, uv=0.8),
            surface(r),
            (*at, size[2] / 2),
            (0, 0, 0 if side == 0 else 90),
        )
    high, at = r.uniform(0.4, 0.75), (r.uniform(-0.2, 0.2) * width, r.uniform(-0.05, 0.2) * depth)
    add("table", b.box("table", (1.2, 0.7, 0.04), 0.01, 2, uv=0.6), pick(r, [matte, shiny])(r), (*at, high))
    for x in (-0.5, 0.5):
        for y in (-0.28, 0.28):
            add("leg", b.box("leg", (0.05, 0.05, high - 0.02)), metal(r), (at[0] + x, at[1] + y, (high - 0.02) / 2))
    for _ in range(int(r.integers(2, 6))):
        mesh, lift = solid(r, r.uniform(0.1, 0.25))
        place = (at[0] + r.uniform(-0.45, 0.45), at[1] + r.uniform(-0.22, 0.22), high + 0.0205 + lift)
        add("thing", mesh, pick(r, [surface, clear])(r), place, (0, 0, r.uniform(0, 360)))


def window_room(r):
    """A room lit by the sun and the sky through a window without glass."""
    width, depth, height = r.uniform(3, 5), r.uniform(3.5, 6), r.uniform(2.3, 3)
    room(r, width, depth, height, window=(r.uniform(-0.5, 0.8), 1.4, r.uniform(0.8, 2), r.uniform(0.8, 1.3)))
    furniture(r, width, depth)
    b.sun("sun", (r.uniform(0.5, 1), r.uniform(-0.5, 0.5), r.uniform(-0.8, -0.25)), r.uniform(10, 40), (1, 0.92, 0.8))
    b.sky(tuple(np.array([0.5, 0.7, 1.0]) * r.uniform(1, 4)))
    inside(r, width, depth, height)


def glazed_room(r):
    """A room lit through a closed pane of glass."""
    width, depth, height = r.uniform(3, 5), r.uniform(3.5, 6), r.uniform(2.3, 3)
    y, z, across, up = window = (r.uniform(-0.3, 0.8), 1.4, r.uniform(0.9, 2), r.uniform(0.9, 1.3))
    room(r, width, depth, height, window=window)
    add("pane", b.box("pane", (0.006, across, up)), b.glass("pane", 1.52), (-width / 2 - 0.05, y, z))
    furniture(r, width, depth)
    b.sun("sun", (r.uniform(0.5, 1), r.uniform(-0.5, 0.5), r.uniform(-0.8, -0.25)), r.uniform(10, 40), (1, 0.9, 0.75))
    b.sky(tuple(np.array([0.6, 0.75, 1.0]) * r.uniform(0.5, 3)))
    inside(r, width, depth, height)


def lamp_room(r):
    """An evening room with a few glowing balls and point lights."""
    width, depth, height = r.uniform(3, 6), r.uniform(3.5, 6), r.uniform(2.3, 3)
    room(r, width, depth, height)
    furniture(r, width, depth)
    for _ in range(int(r.integers(2, 6))):
        at = r.uniform((-0.4 * width, -0.3 * depth, 0.9), (0.4 * width, 0.4 * depth, height - 0.2))
        glowing(r, at, r.uniform(0.02, 0.12), r.uniform(4, 20))
    inside(r, width, depth, height)


def mirror_room(r):
    """A polished room with mirrors on its walls."""
    width, depth, height = r.uniform(3, 5), r.uniform(3.5, 5), r.uniform(2.3, 3)
    materials = [matte(r), pick(r, [shiny, matte])(r), matte(r), shiny(r, "floor")]
    room(r, width, depth, height, materials)
    furniture(r, width, depth)
    for _ in range(int(r.integers(1, 4))):
        size, x = (r.uniform(0.6, 1.8), 0.02, r.uniform(0.6, 1.6)), r.uniform(-0.3, 0.3) * width
        back = r.random() < 0.6
        at = (x, depth / 2 - 0.012, 1.4) if back else (width / 2 - 0.012, x, 1.4)
        add("mirror", b.box("mirror", size, 0.004, 2), metal(r, "mirror", 0.08), at, (0, 0, 0 if back else 90))
    for x in np.linspace(-0.3, 0.3, int(r.integers(1, 4))) * width:
        panel(r, (x, r.uniform(-0.2, 0.2) * depth, height - 0.002), (0.4, 0.4), 12)
    inside(r, width, depth, height)


def corridor(r):
    """A long corridor with columns and a row of lights."""
    width, depth, height = r.uniform(1.6, 2.6), r.uniform(8, 14), r.uniform(2.3, 3.2)
    room(r, width, depth, height)
    column = turned(r, 1.0) if r.random() < 0.5 else b.lathe("column", [(0, 0), (0.3, 0), (0.25, 1), (0, 1)], 48)
    material = surface(r)
    for y in np.linspace(-0.4, 0.4, int(r.integers(4, 9))) * depth:
        for x in (-1, 1):
            add("column", column, material, (x * (width / 2 - 0.15), y, 0), scale=(0.35, 0.35, height - 0.001))
        if r.random() < 0.7:
            panel(r, (0, y + 0.5, height - 0.002), (0.3, 0.5), r.uniform(3, 12))
    panel(r, (0, 0.45 * depth, height - 0.002), (0.5, 0.5), 8)
    b.camera(
        (r.uniform(-0.2, 0.2), -0.47 * depth, r.uniform(0.8, 1.8)),
        (0, 0.4 * depth, r.uniform(0.6, 1.4)),
        r.uniform(20, 35),
    )


def bookshelf(r):
    """Shelves with books and ornaments behind a polished table; a lamp lights the ceiling."""
    width, depth, height = 3.2, 4.0, 2.6
    room(r, width, depth, height)
    wood = pick(r, [shiny, matte])(r, "wood")
    rows, span = int(r.integers(3, 6)), r.uniform(1.8, 2.8)
    covers = [pick(r, [matte, shiny, shiny])(r, "cover") for _ in range(7)]
    for k in range(rows + 1):
        z = 0.2 + k * 2.0 / rows
        add("shelf", b.box("shelf", (span, 0.32, 0.03), 0.004, 2, uv=0.7), wood, (0, depth / 2 - 0.17, z))
        x = -span / 2
        while k < rows and x < span / 2 - 0.1:
            thick, tall = r.uniform(0.02, 0.07), r.uniform(0.5, 0.85) * (2.0 / rows - 0.05)
            if r.random() < 0.08:
                mesh, lift = solid(r, min(tall, 0.2))
                add("ornament", mesh, pick(r, [metal, shiny, clear])(r), (x + 0.11, depth / 2 - 0.2, z + 0.0152 + lift))
                x += 0.25
                continue
            add(
                "book",
                b.box("book", (thick, 0.2, tall), 0.003, 1),
                pick(r, covers),
                (x + thick / 2, depth / 2 - 0.2, z + 0.0152 + tall / 2),
            )
            x += thick + 0.001
    add("table", b.box("table", (1.3, 0.8, 0.04), 0.01, 2, uv=0.6), shiny(r, "table"), (r.uniform(-0.4, 0.4), 0.3, 0.6))
    add("vase", turned(r, 0.3), pick(r, [metal, shiny])(r), (0, 0.3, 0.62))
    at = (r.choice([-1, 1]) * 1.2, r.uniform(0, 1), r.uniform(1.4, 2.0))
    b.spot("uplight", at, (at[0] * 0.5, at[1], height), 250, 100, light_colour(r), 0.3, 0.04)
    glowing(r, (-at[0], 1.0, 1.6), 0.05, 4)
    inside(r, width, depth, height, (24, 40))


def breakfast(r):
    """A table laid with glass, china and steel near a window."""
    width, depth, height = 3.4, 4.0, 2.5
    room(r, width, depth, height, window=(0.3, 1.4, r.uniform(1.2, 2.2), r.uniform(0.9, 1.4)))
    high = 0.7
    add(
        "table",
        b.lathe("table", [(0, high - 0.03), (0.6, high - 0.03), (0.6, high), (0, high)], 96),
        pick(r, [matte, shiny])(r),
        (0, 0.4, 0),
    )
    china = b.principled("china", (0.83, 0.81, 0.77), 0.1)
    plate = b.lathe(
        "plate", b.rounded([(0, 0), (0.06, 0), (0.11, 0.015), (0.108, 0.018), (0.06, 0.005), (0, 0.005)], 0.02, 5), 64
    )
    for angle in r.uniform(0, 6.3) + np.arange(3) * 2.1:
        x, y = 0.38 * np.cos(angle), 0.4 + 0.38 * np.sin(angle)
        add("plate", plate, china, (x, y, high + 0.0003))
        add(
            "knife",
            b.box("knife", (0.012, 0.2, 0.003), 0.001, 1),
            metal(r, "steel", 0.15),
            (x + 0.14, y, high + 0.002),
            (0, 0, r.uniform(-20, 20)),
        )
        x, y = 0.24 * np.cos(angle + 0.7), 0.4 + 0.24 * np.sin(angle + 0.7)
        liquid = b.glass("drink", 1.34, absorption=tuple(r.uniform(0, 60, 3)))
        lifted(
            lambda: vessel(r, r.uniform(0.025, 0.04), r.uniform(0.08, 0.15), b.glass("glass", 1.52), (x, y), liquid),
            high,
        )
    lifted(
        lambda: vessel(r, 0.055, 0.22, b.glass("jug", 1.52), (0, 0.4), b.glass("water", 1.333), flare=-0.2, wave=0.15),
        high,
    )
    b.sun("sun", (r.uniform(0.7, 1), r.uniform(-0.4, 0.3), r.uniform(-0.7, -0.3)), r.uniform(10, 40), (1, 0.9, 0.75))
    b.sky(tuple(np.array([0.6, 0.75, 1.0]) * r.uniform(0.5, 3)))
    look(r, (0, 0.4, high), 1.3, (15, 40), (-35, 60), (30, 50))


def lifted(make, height):
    """Moves the objects that `make` adds up by `height`."""
    before = set(b.bpy.data.objects)
    make()
    for body in set(b.bpy.data.objects) - before:
        body.location.z += height
