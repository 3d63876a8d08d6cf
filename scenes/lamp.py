"""A washstand by night: two bulbs inside fluted glass casings before a mirror, so everything is lit through glass."""

import math
import os
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "scripts", "blender"))
import build as b
import numpy as np

b.start(1280, 720)
random = np.random.default_rng(7)


def zellige(size=1024, across=12, down=6):
    """Hand-made glazed tiles in a running bond, every one of its own green."""
    v, u = np.mgrid[0:size, 0:size] / size
    row = np.floor(v * down)
    x, y = (u * across / 2 + 0.5 * (row % 2)), v * down
    pick = np.random.default_rng(2).random((down, across // 2))[row.astype(int), np.floor(x).astype(int) % (across // 2)]
    joint = np.minimum(np.abs(x % 1 - 0.5) * 0 + np.minimum(x % 1, 1 - x % 1) * 2, np.minimum(y % 1, 1 - y % 1))
    mask = np.clip((joint - 0.02) / 0.012, 0, 1)
    color = b.blend((0.44, 0.58, 0.53), (0.60, 0.72, 0.65), pick) * (0.93 + 0.14 * b.noise(size, size, 12, 5, 9))[..., None]
    return b.blend((0.78, 0.77, 0.73), (0, 0, 0), mask) + color * mask[..., None]


def planks(size=1024, count=4, base=(0.40, 0.25, 0.14), light=(0.60, 0.41, 0.25)):
    """Boards of oiled wood along the rows: grain, rings, a dark gap between boards."""
    v = np.arange(size) / size
    board = np.floor(v * count).astype(int)
    shift = np.random.default_rng(5).integers(0, size, count)
    grain = b.noise(size, size, 2, 7, 6, (18, 1))
    rings = b.noise(size, size, 2, 4, 8, (6, 1))
    rows = np.stack([np.roll(0.6 * grain[i] + 0.4 * (0.5 + 0.5 * np.sin(rings[i] * 40)), shift[board[i]]) for i in range(size)])
    tone = np.random.default_rng(3).random(count)[board] * 0.25
    gap = np.clip((np.minimum(v * count % 1, 1 - v * count % 1) - 0.006) / 0.006, 0, 1)
    return b.blend(base, light, np.clip(rows * 0.9 + tone[:, None] - 0.1, 0, 1)) * (0.35 + 0.65 * gap)[:, None, None]


# The room, closed all round so that the mirror has something to show: wall with the mirror at y = 0.
WIDE, DEEP, HIGH = 2.6, 2.9, 2.5
plaster = b.principled("plaster", (0.72, 0.68, 0.62), 0.85, Specular_IOR_Level=0.2)
tiles = b.principled("tiles", roughness=0.14, texture=b.image("tiles", zellige()))
wood = b.principled("oak", roughness=0.35, texture=b.image("oak", planks()))
b.add_object("floor", b.plane("floor", WIDE, DEEP, uv=0.9), wood, (0, -DEEP / 2, 0))
b.add_object("ceiling", b.plane("ceiling", WIDE, DEEP), plaster, (0, -DEEP / 2, HIGH), (180, 0, 0))
b.add_object("mirror wall", b.plane("mirror wall", WIDE, HIGH, uv=0.84), tiles, (0, 0, HIGH / 2), (90, 0, 0))
b.add_object("back wall", b.plane("back wall", WIDE, HIGH), plaster, (0, -DEEP, HIGH / 2), (90, 0, 180))
for side in (-1, 1):
    b.add_object("side wall", b.plane("side wall", DEEP, HIGH), plaster, (side * WIDE / 2, -DEEP / 2, HIGH / 2), (90, 0, -90 * side))

brass = b.metal("brass", (0.88, 0.68, 0.36), 0.16)
silver = b.metal("silvering", (0.93, 0.94, 0.93))
lacquer = b.principled("walnut", (0.16, 0.075, 0.035), 0.3)
porcelain = b.principled("porcelain", (0.84, 0.83, 0.80), 0.06)
marble = b.principled("marble", roughness=0.12, texture=b.image("marble", b.blend(
    (0.86, 0.85, 0.83), (0.52, 0.52, 0.53), np.clip(np.exp(-np.abs(b.noise(512, 512, 2, 7, 12) - 0.5) * 60) * 0.8 + 0.25 * b.noise(512, 512, 3, 5, 1), 0, 1))))

# A round mirror in a brass rim.
b.add_object("mirror", b.lathe("mirror", [(0, 0), (0.36, 0), (0.36, 0.008), (0, 0.008)], 128), silver, (0, -0.012, 1.56), (90, 0, 0))
b.add_object("mirror rim", b.torus("mirror rim", 0.366, 0.012, 160, 32), brass, (0, -0.016, 1.56), (90, 0, 0))

# The casing: a hollow body of glass 3 to 6 mm thick, 20 flutes outside and smooth inside, open at its foot.
outer = [(0.034, -0.085), (0.060, -0.078), (0.082, -0.045), (0.088, 0.0), (0.082, 0.045), (0.058, 0.082), (0.028, 0.097), (0.0, 0.1)]
inner = [(0.0, 0.095), (0.027, 0.092), (0.054, 0.078), (0.0775, 0.043), (0.0835, 0.0), (0.0775, -0.043), (0.056, -0.073), (0.030, -0.081)]


def spline(points, steps=7):
    """Catmull-Rom through the points."""
    p = np.asarray([points[0], *points, points[-1]], float)
    t = np.linspace(0, 1, steps, endpoint=False)[:, None]
    parts = [0.5 * (2 * p[i] + (p[i + 1] - p[i - 1]) * t + (2 * p[i - 1] - 5 * p[i] + 4 * p[i + 1] - p[i + 2]) * t ** 2
                    + (3 * p[i] - p[i - 1] - 3 * p[i + 1] + p[i + 2]) * t ** 3) for i in range(1, len(p) - 2)]
    return [tuple(q) for q in np.concatenate(parts)] + [tuple(points[-1])]


outline, lining = spline(outer), spline(inner)
outline[-1], lining[0] = (0.0, 0.1), (0.0, 0.095)
casing = b.lathe("casing", outline + lining, 320, closed=True, sharp=60)
for vertex in casing.vertices:
    x, y, z = vertex.co
    radius, turn = math.hypot(x, y), math.atan2(y, x)
    limit = np.interp(z, [q[1] for q in outline], [q[0] for q in outline])
    if radius > limit - 0.001 and radius > 0.02:
        swell = 0.0022 * math.cos(20 * turn) * math.cos(math.pi * z / 0.2) ** 2
        vertex.co.x, vertex.co.y = x * (1 + swell / radius), y * (1 + swell / radius)
glass = b.glass("glass", 1.5)
bulb = b.emission("bulb", (1750, 1200, 690))
bulb_mesh = b.sphere("bulb", 0.017, 5)
collar = b.lathe("collar", b.rounded([(0, -0.125), (0.040, -0.125), (0.040, -0.092), (0.036, -0.0865), (0.012, -0.0865), (0.012, -0.03), (0, -0.03)], 0.004), 64)
plate = b.lathe("wall plate", b.rounded([(0, 0), (0.055, 0), (0.055, 0.012), (0, 0.018)], 0.006), 64)
arm = b.tube("arm", b.arc([(0, 0, -0.11), (0, 0, -0.18), (0, 0.16, -0.18)], 0.05, 12), 0.009)
for x in (-0.60, 0.60):
    at = (x, -0.16, 1.62)
    b.add_object("casing", casing, glass, at)
    b.add_object("bulb", bulb_mesh, bulb, at)
    b.add_object("collar", collar, brass, at)
    b.add_object("arm", arm, brass, at)
    b.add_object("wall plate", plate, brass, (x, 0, at[2] - 0.18), (90, 0, 0))

# The washstand: walnut cabinet, marble top, a vessel basin and a tall brass tap.
b.add_object("cabinet", b.box("cabinet", (1.30, 0.50, 0.42), 0.006), lacquer, (0, -0.26, 0.61))
for side in (-1, 1):
    b.add_object("drawer", b.box("drawer", (0.625, 0.02, 0.38), 0.004), lacquer, (side * 0.32, -0.52, 0.61))
    b.add_object("handle", b.tube("handle", b.arc([(-0.07, 0, 0), (-0.07, -0.028, 0), (0.07, -0.028, 0), (0.07, 0, 0)], 0.012), 0.005), brass, (side * 0.32, -0.53, 0.70))
    b.add_object("leg", b.box("leg", (0.05, 0.05, 0.40), 0.004), lacquer, (side * 0.60, -0.28, 0.20))
b.add_object("top", b.box("top", (1.36, 0.54, 0.03), 0.006, uv=0.7), marble, (0, -0.275, 0.835))
basin = b.lathe("basin", b.rounded([(0, 0.0), (0.11, 0.0), (0.185, 0.075), (0.205, 0.128), (0.196, 0.131), (0.175, 0.08), (0.10, 0.016), (0, 0.012)], 0.03, 8), 160)
b.add_object("basin", basin, porcelain, (0, -0.29, 0.85))
b.add_object("tap", b.tube("tap", b.arc([(0, 0, 0), (0, 0, 0.30), (0, -0.15, 0.30), (0, -0.15, 0.235)], 0.06, 14), 0.0115, 32), brass, (0, -0.055, 0.85))
b.add_object("tap foot", b.lathe("tap foot", b.rounded([(0, 0), (0.027, 0), (0.027, 0.01), (0.0, 0.014)], 0.004), 64), brass, (0, -0.055, 0.85))
for x in (-0.10, 0.10):
    knob = b.lathe("knob", b.rounded([(0, 0), (0.022, 0), (0.014, 0.02), (0.012, 0.045), (0.024, 0.05), (0.024, 0.066), (0, 0.068)], 0.006), 64)
    b.add_object("knob", knob, brass, (x, -0.06, 0.85))

# On the top: a tumbler of water, a bottle of amber soap, towels, a candle dish, a sprig in a vase.
tumbler = b.lathe("tumbler", b.rounded([(0, 0), (0.034, 0), (0.039, 0.10), (0.0365, 0.10), (0.0315, 0.012), (0, 0.010)], 0.003, 4), 128)
b.add_object("tumbler", tumbler, glass, (0.36, -0.42, 0.8502))
amber = b.glass("amber", 1.5, absorption=(12, 90, 420))
bottle = b.lathe("bottle", b.rounded([(0, 0), (0.034, 0), (0.034, 0.115), (0.013, 0.14), (0.013, 0.16), (0.0105, 0.16), (0.0105, 0.138), (0.031, 0.112), (0.031, 0.004), (0, 0.004)], 0.010, 6), 128)
b.add_object("bottle", bottle, amber, (-0.33, -0.30, 0.8502))
black = b.principled("black", (0.02, 0.02, 0.02), 0.25)
b.add_object("pump", b.tube("pump", b.arc([(0, 0, 0.145), (0, 0, 0.205), (0.03, -0.045, 0.20)], 0.012), 0.0055), black, (-0.33, -0.30, 0.8502))
b.add_object("cap", b.lathe("cap", b.rounded([(0, 0.158), (0.0155, 0.158), (0.0155, 0.178), (0, 0.18)], 0.003), 64), black, (-0.33, -0.30, 0.8502))
towel = b.principled("towel", (0.78, 0.74, 0.67), 0.95, Specular_IOR_Level=0.1)
blush = b.principled("blush towel", (0.62, 0.33, 0.26), 0.95, Specular_IOR_Level=0.1)
for k, (material, size) in enumerate(((towel, 0.235), (blush, 0.225), (towel, 0.228))):
    b.add_object("folded towel", b.box("folded towel", (size, 0.20, 0.042), 0.019, 6), material, (0.53, -0.22, 0.872 + 0.0435 * k), (0, 0, 4 * k - 5))
vase = b.lathe("vase", b.rounded([(0, 0), (0.03, 0), (0.05, 0.05), (0.018, 0.115), (0.024, 0.135), (0.021, 0.135), (0.014, 0.115), (0.044, 0.05), (0.026, 0.006), (0, 0.006)], 0.02, 8), 128)
b.add_object("vase", vase, porcelain, (-0.53, -0.20, 0.8502))
leaf_green = b.principled("leaf", (0.10, 0.22, 0.07), 0.45)
leaf = b.sheet("leaf", 6, 14, lambda u, v: ((u - 0.5) * 0.030 * math.sin(math.pi * v ** 0.8), 0.085 * v, 0.012 * math.sin(2.6 * v) - 0.25 * abs(u - 0.5) * 0.02))
for k in range(5):
    lean, turn = 10 + 9 * random.random(), 72 * k + 30 * random.random()
    bend = math.radians(lean)
    tip = 0.17 + 0.07 * random.random()
    axis = (math.cos(math.radians(turn)), math.sin(math.radians(turn)))
    path = [(axis[0] * 0.006 + axis[0] * math.tan(bend) * s * s * 0.9, axis[1] * 0.006 + axis[1] * math.tan(bend) * s * s * 0.9, 0.02 + s) for s in np.linspace(0, tip + 0.06, 14)]
    b.add_object("stem", b.tube("stem", path, 0.0013, 10), leaf_green, (-0.53, -0.20, 0.8502))
    for m in range(5, 14):
        b.add_object("leaf", leaf, leaf_green, (-0.53 + path[m][0], -0.20 + path[m][1], 0.8502 + path[m][2]),
                (28 + 25 * random.random(), 0, 137.5 * m + turn), (0.55 + 0.35 * random.random(),) * 3)

# What the mirror shows: a door, a picture, a rail with a towel, a stool.
paint = b.principled("door", (0.23, 0.31, 0.33), 0.35)
b.add_object("door", b.box("door", (0.82, 0.05, 2.05), 0.006), paint, (-0.48, -DEEP + 0.02, 1.025))
for z, high in ((0.55, 0.66), (1.45, 0.86)):
    b.add_object("door panel", b.box("door panel", (0.58, 0.02, high), 0.012), paint, (-0.48, -DEEP + 0.05, z))
b.add_object("door knob", b.sphere("door knob", 0.028, 5), brass, (-0.13, -DEEP + 0.10, 1.02))
yy, xx = np.mgrid[0:384, 0:288] / 384
hills = sum((yy < h).astype(float)[..., None] * (np.asarray(c) - np.asarray(p)) for h, c, p in (
    (0.62 + 0.06 * np.sin(6 * xx), (0.66, 0.52, 0.40), (0.90, 0.80, 0.66)), (0.45 + 0.08 * np.sin(9 * xx + 1), (0.44, 0.36, 0.32), (0.66, 0.52, 0.40)),
    (0.24 + 0.07 * np.sin(7 * xx + 3), (0.20, 0.25, 0.27), (0.44, 0.36, 0.32))))
sun_disc = (np.hypot(xx - 0.5, yy - 0.80) < 0.075)[..., None] * (np.asarray((0.85, 0.36, 0.20)) - np.asarray((0.90, 0.80, 0.66)))
print_mesh = b.sheet("print", 1, 1, lambda u, v: ((u - 0.5) * 0.45, 0, (v - 0.5) * 0.60), uv=True)
b.add_object("print", print_mesh, b.principled("print", roughness=0.5, texture=b.image("print", np.asarray((0.90, 0.80, 0.66)) + hills + sun_disc)), (0.62, -DEEP + 0.03, 1.55), (0, 0, 180))
b.add_object("print frame", b.box("print frame", (0.51, 0.024, 0.66), 0.004), lacquer, (0.62, -DEEP + 0.0125, 1.55))

b.camera((0.42, -2.02, 1.52), (-0.02, 0.0, 1.37), lens=31)
b.finish(__file__)
