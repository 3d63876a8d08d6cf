"""A swimming pool from above: the sun through a wavy surface draws its net on the tiles, which are seen through it."""

import math
import os
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "scripts", "blender"))
import build as b
import numpy as np

WIDE, LONG, DEEP, LEVEL = 4.6, 6.4, 1.35, -0.13
b.start(1280, 720)
random = np.random.default_rng(11)


def mosaic(size, across, joint, colors, jitter, grout, seed):
    """Square tiles, `across` of them in the image's width, each of its own shade, with joints between."""
    shades = np.random.default_rng(seed)
    pick = shades.integers(0, len(colors), (across, across))
    bright = 1 + jitter * (shades.random((across, across)) - 0.5)
    color = np.asarray(colors)[pick] * bright[..., None]
    cell = np.arange(size) * across / size
    inside = (np.abs(cell % 1 - 0.5) < 0.5 - joint).astype(float)
    mask = inside[:, None] * inside[None, :]
    whole = color[cell.astype(int)][:, cell.astype(int)]
    grain = 0.95 + 0.1 * b.noise(size, size, 32, 3, seed)
    return b.blend(grout, (0, 0, 0), mask) + whole * (mask * grain)[..., None]


aqua = b.principled("mosaic", roughness=0.3, texture=b.image("mosaic", mosaic(
    1024, 40, 0.045, [(0.56, 0.80, 0.83), (0.50, 0.76, 0.82), (0.62, 0.84, 0.85), (0.45, 0.71, 0.80)], 0.10, (0.80, 0.84, 0.84), 1)))
navy = b.principled("lane", roughness=0.3, texture=b.image("lane", mosaic(
    512, 20, 0.045, [(0.05, 0.16, 0.36), (0.06, 0.19, 0.42), (0.09, 0.24, 0.46)], 0.15, (0.45, 0.52, 0.58), 2)))
paving = b.principled("paving", roughness=0.7, texture=b.image("paving", mosaic(
    1024, 4, 0.006, [(0.74, 0.70, 0.63), (0.70, 0.66, 0.60), (0.78, 0.73, 0.66)], 0.05, (0.50, 0.47, 0.42), 3)))
coping = b.principled("coping", (0.70, 0.67, 0.61), 0.6)

# The basin: floor in three strips with a dark lane, and four walls that reach above the water.
lane = 0.25
for name, material, x, width in (("floor left", aqua, -WIDE / 4 - lane / 4, WIDE / 2 - lane / 2),
                                 ("lane", navy, 0, lane), ("floor right", aqua, WIDE / 4 + lane / 4, WIDE / 2 - lane / 2)):
    b.add_object(name, b.plane(name, width, LONG, uv=2.0 if material is aqua else 1.0), material, (x, 0, -DEEP))
for name, width, at, turn in (("wall left", LONG, (-WIDE / 2, 0), 90), ("wall right", LONG, (WIDE / 2, 0), -90),
                              ("wall far", WIDE, (0, LONG / 2), 0), ("wall near", WIDE, (0, -LONG / 2), 180)):
    b.add_object(name, b.plane(name, width, DEEP, uv=2.0), aqua, (*at, -DEEP / 2), (90, 0, turn))

# The terrace around it, and the rounded stones of its rim.
stone = b.box("coping stone", (0.494, 0.34, 0.06), 0.014)
for k in range(int(WIDE / 0.5) + 2):
    for side in (-1, 1):
        b.add_object("coping", stone, coping, ((k + 0.5) * 0.5 - (int(WIDE / 0.5) + 2) * 0.25, side * (LONG / 2 + 0.14), 0.0))
for k in range(int(LONG / 0.5) + 1):
    for side in (-1, 1):
        b.add_object("coping", stone, coping, (side * (WIDE / 2 + 0.14), (k + 0.5) * 0.5 - (int(LONG / 0.5) + 1) * 0.25, 0.001), (0, 0, 90))
for name, size, at in (("terrace left", (6, 20), (-WIDE / 2 - 3.25, 0)), ("terrace right", (6, 20), (WIDE / 2 + 3.25, 0)),
                       ("terrace far", (WIDE + 0.5, 6), (0, LONG / 2 + 3.25)), ("terrace near", (WIDE + 0.5, 6), (0, -LONG / 2 - 3.25))):
    b.add_object(name, b.plane(name, *size, uv=2.4), paving, (*at, 0.0))

# Water: ripples of many wavelengths, the closed body reaching a centimetre into the walls.
lengths = np.exp(random.uniform(math.log(0.22), math.log(1.5), 40))
headings = random.normal(0.7, 0.75, 40)
phases = random.uniform(0, 2 * math.pi, 40)
heights = 0.0022 * (lengths / 0.5) ** 1.5 * np.exp(random.normal(0, 0.3, 40))
waves = np.stack([np.cos(headings), np.sin(headings)], 1) * (2 * math.pi / lengths)[:, None]


def surface(u, v):
    x, y = (u - 0.5) * (WIDE + 0.02), (v - 0.5) * (LONG + 0.02)
    return x, y, LEVEL + float(np.sum(heights * np.sin(waves @ (x, y) + phases)))


b.add_object("water", b.sheet("water", 184, 256, surface, bottom=-DEEP - 0.01), b.glass("water", 1.333, absorption=(0.42, 0.075, 0.035)))

# A swim ring, a ball and a ladder.
ring = b.torus("swim ring", 0.36, 0.115, 96, 48)
coral, cream = b.principled("coral", (0.86, 0.16, 0.10), 0.35), b.principled("cream", (0.86, 0.83, 0.76), 0.35)
ring.materials.append(coral)
ring.materials.append(cream)
for face in ring.polygons:
    turn = math.atan2(face.center.y, face.center.x) / (2 * math.pi) * 8
    face.material_index = int(math.floor(turn)) % 2
b.add_object("swim ring", ring, None, (-0.95, -0.35, LEVEL + 0.035), (4, -3, 20))
b.add_object("ball", b.sphere("ball", 0.17, 6), b.principled("yellow", (0.90, 0.62, 0.07), 0.3), (1.15, 1.55, LEVEL + 0.11))

chrome = b.metal("chrome", (0.78, 0.79, 0.81), 0.06)
for x in (-0.25, 0.25):
    path = b.arc([(x, 0.62, 0.0), (x, 0.62, 0.62), (x, -0.08, 0.62), (x, -0.08, -1.05)], 0.28, 14)
    b.add_object("ladder rail", b.tube("ladder rail", path, 0.021), chrome, (WIDE / 2 - 0.02, 1.35, 0), (0, 0, -90))
step = b.box("ladder step", (0.5, 0.08, 0.03), 0.01)
for z in (-0.32, -0.62, -0.92):
    b.add_object("ladder step", step, chrome, (WIDE / 2 - 0.10, 1.35, z), (0, 0, -90))

# A towel and a tumbler of lemonade on the terrace.
cloth = b.principled("towel", (0.90, 0.88, 0.84), 0.95, Specular_IOR_Level=0.1)
stripe = b.principled("towel stripe", (0.10, 0.30, 0.55), 0.95, Specular_IOR_Level=0.1)
for k in range(3):
    b.add_object("towel", b.box("towel", (0.62 - 0.01 * k, 0.42 - 0.008 * k, 0.034), 0.015), (cloth, stripe, cloth)[k],
            (-WIDE / 2 - 0.85, 0.9, 0.018 + 0.036 * k), (0, 0, 12 + 2 * k))

b.sun("sun", (-0.42, 0.38, -0.82), 3.9, (1.0, 0.95, 0.87))
b.sky((0.24, 0.36, 0.55))
b.camera((1.75, -4.7, 5.3), (0.12, -0.1, -0.5), lens=38)
b.finish(__file__)
