"""Gems, prisms, and curved metal: sharp caustics."""

import math

import build as b
import numpy as np

from .props import (
    METALS,
    add,
    ground,
    lamp_or_sun,
    look,
    matte,
    metal,
    pick,
    places,
    ripples,
    still_life,
    surface,
)


def cut_stone(r, name, sides, rows):
    """A convex stone with `rows` rows of facets above and below its girdle; it fits a cube of side 1."""
    planes = [((0, 0, 1), r.uniform(0.2, 0.3)), ((0, 0, -1), 0.5)]
    for sign, steep in ((1, r.uniform(30, 42)), (-1, r.uniform(36, 48))):
        for k in range(rows):
            tilt = math.radians(steep + 22 * k / max(rows, 1) * (1 if sign > 0 else -0.4))
            for side in range(sides):
                turn = 2 * math.pi * (side + 0.5 * (k % 2)) / sides
                normal = (math.cos(turn) * math.sin(tilt), math.sin(turn) * math.sin(tilt), sign * math.cos(tilt))
                planes.append((normal, 0.5 * math.sin(tilt) + 0.01))
    for side in range(2 * sides):
        turn = math.pi * side / sides
        planes.append(((math.cos(turn), math.sin(turn), 0), 0.5))
    return b.polyhedron(name, planes)


def jewels(r):
    """Cut stones of many colours on a cloth or a mirror."""
    ground(r, 1.5, pick(r, [matte, matte, metal])(r, "cloth"))
    for at in places(r, int(r.integers(4, 14)), 0.1, 0.04):
        size = r.uniform(0.018, 0.034)
        tint = tuple(r.uniform(0, 1, 3) ** 2 * r.uniform(0, 120))
        stone = b.glass(
            "stone",
            r.uniform(1.5, 2.4),
            absorption=tint if r.random() < 0.7 else None,
            abbe=r.uniform(25, 60) if r.random() < 0.3 else None,
        )
        add(
            "stone",
            cut_stone(r, "stone", int(r.integers(4, 9)), int(r.integers(1, 4))),
            stone,
            (*at, 0.52 * size),
            (r.uniform(-25, 25), r.uniform(-25, 25), r.uniform(0, 360)),
            (size, size, size),
        )
    lamp_or_sun(r, 0.4)
    look(r, (0, 0, 0.01), 0.33, (25, 65))


def prisms(r):
    """Prisms that disperse a narrow beam."""
    ground(r, 2.5, b.principled("paper", (0.72, 0.71, 0.69), 1.0, Specular_IOR_Level=0.0))
    for at in places(r, int(r.integers(1, 5)), 0.15, 0.1):
        side, high, turn = r.uniform(0.04, 0.07), r.uniform(0.04, 0.08), r.uniform(0, 2 * math.pi)
        planes = [((0, 0, 1), high), ((0, 0, -1), -1e-4)]
        planes += [((math.cos(turn + k), math.sin(turn + k), 0), side / math.sqrt(12)) for k in (0, 2.0944, 4.1888)]
        add(
            "prism",
            b.polyhedron("prism", planes),
            b.glass("flint", r.uniform(1.5, 1.8), abbe=r.uniform(22, 60)),
            (*at, 0.0),
        )
    b.sun("sun", (math.cos(1.0), -0.3, -r.uniform(0.1, 0.6)), r.uniform(4, 30))
    b.sky((0.1, 0.11, 0.13))
    still_life(r, 2, 0.35, 0.06, surface)
    look(r, (0.05, 0, 0.02), 0.7, (20, 55))


def rings(r):
    """Metal rings and bowls, with the cusps of light inside them."""
    ground(r, 2)
    for at in places(r, int(r.integers(2, 6)), 0.2, 0.14):
        radius, high, material = r.uniform(0.03, 0.06), r.uniform(0.01, 0.06), metal(r, "ring", 0.2)
        if r.random() < 0.6:
            profile = [(radius, 0), (radius, high), (radius - 0.003, high), (radius - 0.003, 0)]
            add("ring", b.lathe("ring", profile, 128, closed=True), material, (*at, 0.0003))
        else:
            t = np.linspace(0, 1.2, 12)
            outer = [(radius * math.sin(x) * 1.2, radius * (1 - math.cos(x)) * 1.2) for x in t]
            inner = [(max(x - 0.003, 0), z + 0.002) for x, z in outer]
            add("bowl", b.lathe("bowl", [*outer, *inner[::-1]], 128), material, (*at, 0.0003))
    lamp_or_sun(r, 0.7)
    look(r, (0, 0, 0.02), 0.65, (20, 60))


def reflectors(r):
    """Bent and rippled sheets of metal that throw light on the ground and a wall."""
    ground(r, 5)
    add("wall", b.plane("wall", 5, 2.5, uv=1.0), matte(r, "wall"), (0, 0.9, 1.25), (90, 0, 0))
    for at in places(r, int(r.integers(1, 4)), 0.5, 0.4):
        wave, size, bow = ripples(r, 0.5, r.uniform(0, 0.006)), r.uniform(0.25, 0.5), r.uniform(-0.6, 0.6)
        mesh = b.sheet(
            "sheet",
            90,
            90,
            lambda u, v: ((u - 0.5) * size, bow * (u - 0.5) ** 2 * size + wave(u - 0.5, v - 0.5), v * size * 0.8),
        )
        add("sheet", mesh, metal(r, "sheet", 0.1), (*at, 0.0005), (r.uniform(-25, 10), 0, r.uniform(-70, 70)))
    still_life(r, 3, 0.7, 0.15, surface)
    lamp_or_sun(r, 1.2)
    look(r, (0, 0.1, 0.2), 1.9, (15, 45))


def brushed(r):
    """Rough and smooth metals without glass."""
    ground(r, 3)
    still_life(r, int(r.integers(5, 12)), 0.45, 0.17, lambda r: b.metal("metal", pick(r, METALS), r.uniform(0.05, 0.6)))
    lamp_or_sun(r, 1.0)
    look(r, (0, 0, 0.07), 1.3, (12, 50))


def matte_things(r):
    """Matte and plastic things without focused light."""
    ground(r, 3)
    still_life(r, int(r.integers(5, 14)), 0.45, 0.17, lambda r: matte(r))
    lamp_or_sun(r, 1.0)
    look(r, (0, 0, 0.07), 1.3, (12, 50))
