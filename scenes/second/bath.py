"""A vaulted bath at night: all light comes from eight lamps under the water, through its ripples to the vault, and from two lanterns."""

import math
import os
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "scripts", "blender"))
import build as b
import numpy as np

b.start(1280, 720)
random = np.random.default_rng(6)
WIDE, LONG, DEEP, LEVEL, WALK = 4.0, 9.0, 1.3, -0.12, 1.5


def mosaic(size, across, colors, grout, seed):
    """Small tiles of a few shades in a pale joint."""
    pick = np.random.default_rng(seed).integers(0, len(colors), (across, across))
    cell = np.arange(size) * across / size
    inside = (np.abs(cell % 1 - 0.5) < 0.455).astype(float)
    mask = inside[:, None] * inside[None, :]
    return b.blend(grout, (0, 0, 0), mask) + np.asarray(colors)[pick][cell.astype(int)][:, cell.astype(int)] * mask[..., None]


def travertine(size=384):
    return b.blend((0.56, 0.48, 0.38), (0.80, 0.73, 0.62), np.clip(1.3 * b.noise(size, size, 2, 7, 4, (9, 1)) - 0.1, 0, 1))


green = b.principled("mosaic", roughness=0.25, texture=b.image("mosaic", mosaic(384, 24, [(0.40, 0.66, 0.62), (0.33, 0.60, 0.58), (0.52, 0.74, 0.68), (0.26, 0.50, 0.52)], (0.72, 0.74, 0.70), 4)))
stone = b.principled("travertine", roughness=0.3, texture=b.image("travertine", travertine()))
plain = b.principled("plain stone", (0.62, 0.54, 0.43), 0.6)
brick = b.principled("vault", roughness=0.9, texture=b.image("plaster", b.blend((0.60, 0.48, 0.36), (0.78, 0.67, 0.54), b.noise(256, 256, 4, 6, 8))), Specular_IOR_Level=0.2)
bronze = b.metal("bronze", (0.66, 0.46, 0.28), 0.25)
towel = b.principled("towel", (0.76, 0.72, 0.64), 0.95, Specular_IOR_Level=0.1)
wood = b.principled("cedar", (0.34, 0.18, 0.10), 0.5)

# The basin with a bench along its sides and steps at the far end, and the walk around it.
for x in (-1, 1):
    b.add_object("side", b.plane("side", LONG, DEEP, uv=0.8), green, (x * WIDE / 2, 0, -DEEP / 2), (90, 0, -90 * x))
    b.add_object("bench", b.box("bench", (0.45, LONG - 0.02, 0.45), 0.012, 2, uv=0.8), green, (x * (WIDE / 2 - 0.22), 0, -DEEP + 0.222))
    b.add_object("walk", b.plane("walk", WALK, LONG + 2 * WALK, uv=1.3), stone, (x * (WIDE + WALK) / 2, 0, 0))
    b.add_object("end", b.plane("end", WIDE, DEEP, uv=0.8), green, (0, x * LONG / 2, -DEEP / 2), (90, 0, 90 - 90 * x))
    b.add_object("end walk", b.plane("end walk", WIDE, WALK, uv=1.3), stone, (0, x * (LONG + WALK) / 2, 0))
b.add_object("basin floor", b.plane("basin floor", WIDE, LONG, uv=0.8), green, (0, 0, -DEEP))
for k in range(4):
    b.add_object("stair", b.box("stair", (1.8, 0.34 * (4 - k), 0.26), 0.01, 2, uv=0.8), green, (0, LONG / 2 - 0.17 * (4 - k) + 0.005, -DEEP + 0.13 + 0.26 * k))
for x in (-0.7, 0.7):
    b.add_object("rail", b.tube("rail", b.arc([(x, LONG / 2 + 0.35, 0), (x, LONG / 2 + 0.35, 0.85), (x, LONG / 2 - 1.1, 0.35), (x, LONG / 2 - 1.1, -0.9)], 0.25, 8), 0.022, 14), bronze)

# Water, with a calm of long waves and the rings of a few drops; it reaches a centimetre into the walls.
lengths, headings, phases = np.exp(random.uniform(math.log(0.25), math.log(1.4), 26)), random.normal(1.2, 1.0, 26), random.uniform(0, 6.28, 26)
heights, waves = 0.0016 * (lengths / 0.5) ** 1.4, np.stack([np.cos(headings), np.sin(headings)], 1) * (2 * math.pi / lengths)[:, None]


def surface(u, v):
    x, y = (u - 0.5) * (WIDE + 0.02), (v - 0.5) * (LONG + 0.02)
    r = math.hypot(x + 0.7, y - 0.4)
    return x, y, LEVEL + float(np.sum(heights * np.sin(waves @ (x, y) + phases))) + 0.003 * math.sin(26 * r) * math.exp(-0.9 * r) * min(6 * r, 1)


b.add_object("water", b.sheet("water", 88, 160, surface, bottom=-DEEP - 0.01), b.glass("water", 1.333, absorption=(0.42, 0.075, 0.035)))

# Lamps: discs in bronze rings in the long sides, half a metre down.
disc, ring = b.lathe("lamp", [(0, 0), (0.09, 0)], 32, sharp=0), b.torus("lamp ring", 0.10, 0.014, 48, 12)
if disc.polygons[0].normal.z < 0:
    disc.flip_normals()
glow = b.emission("lamp", (520, 480, 380))
for y in (-3.3, -1.1, 1.1, 3.3):
    for x in (-1, 1):
        b.add_object("lamp", disc, glow, (x * (WIDE / 2 - 0.006), y, -0.52), (0, -90 * x, 0))
        b.add_object("lamp ring", ring, bronze, (x * (WIDE / 2 - 0.006), y, -0.52), (0, 90, 0))

# The hall: walls with pilasters, a barrel vault of ribs, an apse of dark at the end; benches, towels, lanterns.
HALF, REACH = WIDE / 2 + WALK, LONG / 2 + WALK
for x in (-1, 1):
    b.add_object("wall", b.plane("wall", 2 * REACH, 2.2, uv=1.6), brick, (x * HALF, 0, 1.1), (90, 0, -90 * x))
    b.add_object("end wall", b.plane("end wall", 2 * HALF, 6, uv=1.6), brick, (0, x * REACH, 3.0), (90, 0, 90 - 90 * x))
    b.add_object("ledge", b.box("ledge", (0.16, 2 * REACH, 0.12), 0.03, 2), plain, (x * (HALF - 0.06), 0, 2.2))
arch = [(HALF * math.cos(t), 2.2 + HALF * math.sin(t)) for t in np.linspace(0, math.pi, 49)]
vault = b.sheet("vault", 48, 1, lambda u, v: (arch[round(u * 48)][0], (v - 0.5) * 2 * REACH, arch[round(u * 48)][1]), uv=True)
for loop in vault.uv_layers[0].data:
    loop.uv = (loop.uv[0] * 7, loop.uv[1] * 7.5)
b.add_object("vault", vault, brick)
rib = b.sheet("rib", 48, 3, lambda u, v: ((HALF - 0.14 * (0 < v < 1)) * math.cos(math.pi * u), (0, 0, 0.34, 0.34)[round(3 * v)] - 0.17, 2.2 + (HALF - 0.14 * (0 < v < 1)) * math.sin(math.pi * u)))
rib.shade_flat()
for y in (-4.4, -2.2, 0.0, 2.2, 4.4):
    b.add_object("rib", rib, plain, (0, y, 0))
    for x in (-1, 1):
        b.add_object("pilaster", b.box("pilaster", (0.16, 0.34, 2.2), 0.015, 1), plain, (x * (HALF - 0.07), y, 1.1))
door = b.box("door", (1.3, 0.1, 2.3), 0.02, 1)
b.add_object("door", door, wood, (0, REACH - 0.03, 1.15))
b.add_object("tympanum", b.torus("tympanum", 0.72, 0.06, 64, 14), plain, (0, REACH - 0.02, 3.1), (90, 0, 0))
for x, y in ((HALF - 0.45, 1.1), (-HALF + 0.45, 3.3)):
    b.add_object("seat", b.box("seat", (0.42, 1.4, 0.05), 0.012, 2), wood, (x, y, 0.43))
    for end in (-0.55, 0.55):
        b.add_object("trestle", b.box("trestle", (0.36, 0.06, 0.405), 0.01, 1), wood, (x, y + end, 0.203))
    for k in range(3):
        b.add_object("folded towel", b.box("folded towel", (0.30, 0.36, 0.06), 0.027, 4), towel, (x, y + 0.35, 0.487 + 0.062 * k), (0, 0, 5 * k - 4))
lantern = b.emission("lantern", (60, 36, 16))
for x in (-1, 1):
    b.add_object("lantern", b.lathe("lantern", b.rounded([(0, 0), (0.06, 0.01), (0.075, 0.10), (0.05, 0.20), (0, 0.21)], 0.03, 4), 32), lantern, (x * 1.35, REACH - 0.22, 1.75))
    b.add_object("bracket", b.tube("bracket", b.arc([(x * 1.35, REACH, 1.6), (x * 1.35, REACH - 0.22, 1.6), (x * 1.35, REACH - 0.22, 1.752)], 0.06, 5), 0.014, 10), bronze)
b.camera((-1.35, -5.3, 1.75), (0.25, 1.0, 0.55), lens=22)
b.finish(__file__)
