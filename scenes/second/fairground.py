"""A fair after the rain: nearly four hundred coloured bulbs on a wheel, on stalls and on strings, once more in the wet asphalt."""

import math
import os
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "scripts", "blender"))
import build as b
import numpy as np

b.start(1280, 720)
random = np.random.default_rng(13)


def bumps(size=512):
    """A normal map: smooth where water stands, rough where the stones come through."""
    wet = np.clip((b.noise(size, size, 3, 4, 6) - 0.42) / 0.12, 0, 1)
    height = (b.noise(size, size, 60, 3, 2) - 0.5) * 0.9 * wet + (b.noise(size, size, 8, 3, 4) - 0.5) * 0.25
    gx, gy = (np.roll(height, -1, 1) - np.roll(height, 1, 1)), (np.roll(height, -1, 0) - np.roll(height, 1, 0))
    normal = np.stack([-gx * 0.6, -gy * 0.6, np.ones_like(gx)], -1)
    return normal / np.linalg.norm(normal, axis=-1, keepdims=True) * 0.5 + 0.5


asphalt = b.principled("wet asphalt", (0.030, 0.031, 0.034), 0.16, normal=b.image("bumps", bumps(), data=True, quality=90), Specular_IOR_Level=0.6)
steel = b.principled("painted steel", (0.62, 0.62, 0.60), 0.4)
red, cream, navy, teal = (b.principled(n, c, 0.5) for n, c in (("red", (0.55, 0.05, 0.04)), ("cream", (0.78, 0.71, 0.56)), ("navy", (0.04, 0.07, 0.19)), ("teal", (0.05, 0.30, 0.30))))
wood = b.principled("counter", (0.26, 0.15, 0.08), 0.5)
cable = b.principled("cable", (0.01, 0.01, 0.01), 0.6)
brick = b.principled("house", (0.14, 0.10, 0.08), 0.9)
plush = [b.principled(f"plush {k}", c, 0.9, Specular_IOR_Level=0.1) for k, c in enumerate(((0.75, 0.32, 0.42), (0.85, 0.65, 0.16), (0.30, 0.55, 0.70)))]
colors = {"warm": (150, 92, 40), "rose": (120, 18, 26), "amber": (140, 66, 8), "green": (16, 92, 30), "blue": (16, 34, 130), "white": (150, 138, 118)}
bulbs = {}
for name, radiance in colors.items():
    bulbs[name] = b.sphere("bulb " + name, 1.0, 2)
    bulbs[name].materials.append(b.emission("bulb " + name, radiance))


def bulb(name, at, radius=0.035):
    b.add_object("bulb", bulbs[name], None, at, scale=(radius,) * 3)


b.add_object("ground", b.plane("ground", 90, 90, uv=2.2), asphalt, (0, 20, 0))

# The wheel, 14 m across: two rims, twelve spokes with bulbs, gondolas.
R, HUB = 7.0, (4.2, 17.0, 8.2)
for y in (-0.7, 0.7):
    b.add_object("rim", b.torus("rim", R, 0.07, 96, 10), steel, (HUB[0], HUB[1] + y, HUB[2]), (90, 0, 0))
    for x in (-3.4, 3.4):
        b.add_object("strut", b.tube("strut", [(HUB[0] + x, HUB[1] + 1.9 * y, 0), (HUB[0], HUB[1] + 1.5 * y, HUB[2])], 0.14, 12), navy)
b.add_object("axle", b.lathe("axle", b.rounded([(0, -1.3), (0.45, -1.3), (0.45, 1.3), (0, 1.3)], 0.05, 2), 32), red, HUB, (90, 0, 0))
gondola = b.lathe("gondola", b.rounded([(0, -1.15), (0.55, -1.1), (0.72, -0.55), (0.68, -0.55), (0.5, -1.02), (0, -1.05)], 0.05, 3), 32)
canopy = b.lathe("canopy", b.rounded([(0.75, 0.0), (0.45, 0.22), (0, 0.34)], 0.05, 3), 32)
for k in range(12):
    t = 2 * math.pi * (k + 0.3) / 12
    out = b.Vector((math.cos(t), 0, math.sin(t)))
    centre = b.Vector(HUB)
    for y in (-0.7, 0.7):
        shift = b.Vector((0, y, 0))
        b.add_object("spoke", b.tube("spoke", [shift + out * 0.3, shift + out * R], 0.035, 8), steel, HUB)
    for m in range(8):
        bulb(("amber", "warm")[m % 2], centre + out * (1.2 + 0.72 * m) + b.Vector((0, -0.79, 0)), 0.05)
    for m in range(6):
        s = t + 2 * math.pi / 12 * m / 6
        bulb(("rose", "blue", "green")[k % 3], centre + b.Vector((math.cos(s), 0, math.sin(s))) * (R + 0.02) + b.Vector((0, -0.82, 0)), 0.06)
    seat = centre + out * R
    b.add_object("gondola", gondola.copy(), (red, cream, teal)[k % 3], seat)
    b.add_object("canopy", canopy.copy(), (cream, red, cream)[k % 3], seat)
    b.add_object("pole", b.tube("pole", [(0, 0, -1.1), (0, 0, 0.3)], 0.03, 8), steel, seat)


def stall(x, y, turn, wide, first, second, lights):
    """A booth: striped canopy with scallops, a counter, shelves of prizes, bulbs along its edges."""
    here = b.Matrix.Translation((x, y, 0)) @ b.Matrix.Rotation(math.radians(turn), 4, "Z")

    def put(name, mesh, paint, at, lean=0):
        b.add_object(name, mesh, paint).matrix_world = here @ b.Matrix.Translation(at) @ b.Matrix.Rotation(math.radians(lean), 4, "X")

    put("counter", b.box("counter", (wide, 0.5, 0.95), 0.02, 1), wood, (0, -0.9, 0.475))
    put("front", b.box("front", (wide - 0.1, 0.03, 0.75)), first, (0, -1.17, 0.5))
    put("back", b.box("back", (wide, 0.06, 2.5)), second, (0, 0.9, 1.25))
    count = int(wide / 0.3)
    stripe = b.sheet("stripe", 2, 8, lambda u, v: ((u - 0.5) * wide / count, (v - 0.5) * 2.5, 0.10 * math.sin(math.pi * v)))
    scallop = b.lathe("scallop", [(0, 0), (wide / count / 2, 0)], 16)
    paints = [stripe, stripe.copy()], [scallop, scallop.copy()]
    for k in range(count):
        across = (k + 0.5) * wide / count - wide / 2
        put("stripe", paints[0][k % 2], (first, cream)[k % 2], (across, -0.25, 2.75), 14)
        put("scallop", paints[1][k % 2], (first, cream)[k % 2], (across, -1.47, 2.44), 90)
        bulb(lights[k % len(lights)], here @ b.Vector((across, -1.52, 2.50)))
        bulb("warm", here @ b.Vector((across, -0.9, 2.60)), 0.03)
    for side in (-wide / 2 + 0.05, wide / 2 - 0.05):
        put("post", b.tube("post", [(side, -1.1, 0), (side, -1.1, 2.5)], 0.035, 10), cream, (0, 0, 0))
    toy = b.sphere("toy", 1.0, 3)
    toys = [toy.copy() for _ in plush]
    for shelf in (1.25, 1.75):
        put("shelf", b.box("shelf", (wide - 0.2, 0.35, 0.03)), wood, (0, 0.68, shelf))
        for k in range(int(wide / 0.32)):
            across, pick = (k + 0.7) * 0.32 - wide / 2, random.integers(3)
            for size, up in ((0.11, 0.12), (0.075, 0.27), (0.03, 0.34)):
                at = here @ b.Vector((across + (0.05 if up > 0.3 else 0), 0.66, shelf + up))
                b.add_object("toy", toys[pick], plush[pick], at, scale=(size,) * 3)


stall(-5.4, 9.0, 34, 4.2, red, navy, ("warm", "rose"))
stall(-4.2, 14.6, 14, 3.6, teal, navy, ("green", "white"))
stall(7.4, 9.0, -48, 3.9, navy, teal, ("blue", "amber"))

# Strings of bulbs between poles, and a row of dark houses behind.
poles = [(-3.3, 5.2), (-1.9, 12.0), (1.4, 15.0), (3.9, 6.3), (6.6, 12.5)]
for x, y in poles:
    b.add_object("pole", b.lathe("pole", b.rounded([(0, 0), (0.12, 0), (0.12, 0.3), (0.05, 0.35), (0.04, 4.6), (0, 4.62)], 0.01, 2), 16), navy, (x, y, 0))
for n, (i, j) in enumerate(((0, 1), (1, 2), (0, 3), (1, 3), (2, 4), (3, 4))):
    start, end = b.Vector((*poles[i], 4.55)), b.Vector((*poles[j], 4.55))
    length = (end - start).length
    path = [start.lerp(end, s) - b.Vector((0, 0, 0.34 * length / 4 * 4 * s * (1 - s) * 0.8)) for s in np.linspace(0, 1, 25)]
    b.add_object("cable", b.tube("cable", path, 0.009, 6), cable)
    for k in range(1, 25):
        here = start.lerp(end, k / 25) - b.Vector((0, 0, 0.34 * length / 4 * 4 * k / 25 * (1 - k / 25) * 0.8))
        bulb(("warm", "rose", "warm", "amber", "warm", "green", "white", "blue")[(k + n) % 8], here - b.Vector((0, 0, 0.06)))
window = b.emission("window", (2.6, 1.7, 0.8))
for k in range(9):
    high = 7 + 4 * random.random()
    b.add_object("house", b.box("house", (6.2, 5, high)), brick, (-24 + 6.3 * k, 36 + random.random(), high / 2))
    for row in range(2):
        for column in range(3):
            if random.random() < 0.35:
                b.add_object("window", b.plane("window", 0.9, 1.3), window, (-26 + 6.3 * k + 1.9 * column, 33.2, 2.6 + 2.7 * row), (90, 0, 0))

b.sky((0.010, 0.013, 0.026))
b.camera((-0.2, -1.6, 1.55), (0.75, 12.0, 3.25), lens=24)
b.finish(__file__)
