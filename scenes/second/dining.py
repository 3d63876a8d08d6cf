"""A table laid for lunch: the low sun comes in stripes through a blind and draws a jug and three tumblers on the wood."""

import math
import os
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "scripts", "blender"))
import build as b
import numpy as np

b.start(1280, 720)
WIDE, DEEP, HIGH = 4.8, 4.4, 2.6


def planks(size=512, rows=4):
    v, u = np.mgrid[0:size, 0:size] / size
    tone = np.random.default_rng(9).random(rows)[np.floor(v * rows).astype(int)]
    figure = 0.5 + 0.5 * np.sin(45 * b.noise(size, size, 2, 4, 5, (6, 1)))
    color = b.blend((0.42, 0.26, 0.14), (0.66, 0.46, 0.28), np.clip(0.4 * tone + 0.3 * figure + 0.4 * b.noise(size, size, 2, 7, 8, (20, 1)), 0, 1))
    joint = np.minimum(v * rows % 1, 1 - v * rows % 1)
    return color * (0.55 + 0.45 * np.clip((joint - 0.004) / 0.01, 0, 1))[..., None]


def tiles(size=384):
    y, x = np.mgrid[0:size, 0:size] / size
    edge = np.minimum(np.minimum(x * 4 % 1, 1 - x * 4 % 1), np.minimum(y * 4 % 1, 1 - y * 4 % 1))
    color = b.blend((0.52, 0.27, 0.17), (0.70, 0.42, 0.28), b.noise(size, size, 5, 6, 21))
    return b.blend((0.50, 0.45, 0.40), (0, 0, 0), (edge > 0.02).astype(float)) + color * (edge > 0.02)[..., None]


oak = b.principled("oak", roughness=0.32, texture=b.image("planks", planks()))
terracotta = b.principled("tiles", roughness=0.45, texture=b.image("tiles", tiles()))
wall = b.principled("wall", (0.76, 0.73, 0.66), 0.9, Specular_IOR_Level=0.2)
blue = b.principled("blue wall", (0.22, 0.35, 0.43), 0.85, Specular_IOR_Level=0.2)
white = b.principled("white", (0.82, 0.81, 0.78), 0.5)
slat_paint = b.principled("slat", (0.78, 0.74, 0.66), 0.4)
dark = b.principled("dark wood", (0.11, 0.06, 0.035), 0.35)
china = b.principled("china", (0.84, 0.83, 0.80), 0.12)
lemon_skin = b.principled("lemon", (0.88, 0.62, 0.05), 0.4)
linen = b.principled("napkin", (0.30, 0.42, 0.46), 0.95, Specular_IOR_Level=0.1)
steel = b.metal("steel", (0.66, 0.65, 0.63), 0.12)
glass, water = b.glass("glass", 1.52), b.glass("water", 1.333)
glass["caustique"] = {"priority": 1}

# The room; its window is on the left, a thin pane behind a blind of slats.
b.add_object("floor", b.plane("floor", WIDE, DEEP, uv=1.2), terracotta)
b.add_object("ceiling", b.plane("ceiling", WIDE, DEEP), white, (0, 0, HIGH), (180, 0, 0))
for name, span, at, turn, paint in (("back wall", WIDE, (0, DEEP / 2), 0, blue), ("front wall", WIDE, (0, -DEEP / 2), 180, wall), ("right wall", DEEP, (WIDE / 2, 0), -90, wall)):
    b.add_object(name, b.plane(name, span, HIGH), paint, (*at, HIGH / 2), (90, 0, turn))
LEFT, LOW, TOP, FROM, TO = -WIDE / 2 - 0.1, 0.85, 2.25, -0.75, 1.35
middle, wide = (FROM + TO) / 2, TO - FROM
for size, at in (((0.2, DEEP, LOW), (0, LOW / 2)), ((0.2, DEEP, HIGH - TOP), (0, (HIGH + TOP) / 2))):
    b.add_object("left wall", b.box("left wall", size), wall, (LEFT, *at))
for start, end in ((-DEEP / 2, FROM), (TO, DEEP / 2)):
    b.add_object("left wall", b.box("left wall", (0.2, end - start, TOP - LOW)), wall, (LEFT, (start + end) / 2, (LOW + TOP) / 2))
pane = b.principled("pane", (1, 1, 1), 0.0, IOR=1.5, Transmission_Weight=1.0)
b.add_object("pane", b.plane("pane", TOP - LOW, wide), pane, (LEFT - 0.04, middle, (LOW + TOP) / 2), (0, 90, 0))
for y in (FROM, middle, TO):
    b.add_object("sash", b.box("sash", (0.05, 0.06, TOP - LOW), 0.006, 2), white, (LEFT - 0.04, y, (LOW + TOP) / 2))
b.add_object("sill", b.box("sill", (0.32, wide + 0.1, 0.035), 0.008), white, (LEFT + 0.08, middle, LOW))
slat = b.sheet("slat", 6, 1, lambda u, v: ((u - 0.5) * 0.08, (v - 0.5) * (wide - 0.05), 0.008 * (1 - (2 * u - 1) ** 2)))
for k in range(19):
    b.add_object("slat", slat, slat_paint, (LEFT + 0.07, middle, LOW + 0.07 + 0.07 * k), (0, 12, 0))
for y in (-0.8, 0, 0.8):
    b.add_object("cord", b.tube("cord", [(LEFT + 0.07, middle + y, LOW + 0.05), (LEFT + 0.07, middle + y, TOP)], 0.0015, 6), white)
b.add_object("blind head", b.box("blind head", (0.08, wide - 0.04, 0.05), 0.006, 2), slat_paint, (LEFT + 0.07, middle, TOP - 0.03))

# Table and chairs.
TOPZ = 0.75
b.add_object("table top", b.box("table top", (1.75, 0.95, 0.035), 0.006, uv=0.6), oak, (0, 0.15, TOPZ - 0.0175))
for tx in (-0.78, 0.78):
    for ty in (-0.25, 0.55):
        b.add_object("table leg", b.lathe("table leg", b.rounded([(0, 0), (0.022, 0), (0.035, 0.70), (0, 0.715)], 0.004, 2), 24), dark, (tx, ty, 0))
chair = [("seat", b.box("seat", (0.42, 0.42, 0.03), 0.012), (0, 0, 0.45), 0), ("top rail", b.box("top rail", (0.40, 0.022, 0.09), 0.008), (0, 0.245, 0.86), -8)]
chair += [("chair leg", b.tube("chair leg", [(x, y, 0), (x * 0.9, y * 0.9, 0.44)], 0.016, 12), (0, 0, 0), 0) for x in (-0.19, 0.19) for y in (-0.19, 0.19)]
chair += [("spindle", b.tube("spindle", [(x, 0.185, 0.45), (x * 1.05, 0.245, 0.87)], 0.008 if abs(x) < 0.15 else 0.014, 10), (0, 0, 0), 0) for x in (-0.18, -0.09, 0, 0.09, 0.18)]
for x, y, turn in ((-0.42, 0.78, 4), (0.42, 0.82, -9), (-1.14, 0.1, 96), (1.15, 0.22, -80)):
    for name, mesh, at, lean in chair:
        b.add_object(name, mesh, dark).matrix_world = b.Matrix.Translation((x, y, 0)) @ b.Matrix.Rotation(math.radians(turn), 4, "Z") @ b.Matrix.Translation(at) @ b.Matrix.Rotation(math.radians(lean), 4, "X")

# A jug of water, tumblers, one of them full, and what goes with them. Water reaches half a millimetre into its glass.
Z = TOPZ + 0.0002
jug_inside = b.rounded([(0, 0.008), (0.052, 0.010), (0.066, 0.09), (0.042, 0.185), (0.052, 0.235)], 0.04, 6)
jug_outside = b.rounded([(0.056, 0.235), (0.046, 0.185), (0.070, 0.09), (0.056, 0.0), (0, 0.0)], 0.012, 6)
b.add_object("jug", b.lathe("jug", jug_outside[::-1] + jug_inside[::-1], 80), glass, (0.10, 0.30, Z))
b.add_object("jug handle", b.tube("jug handle", b.arc([(0.0475, 0, 0.205), (0.115, 0, 0.215), (0.115, 0, 0.095), (0.0675, 0, 0.085)], 0.05, 7), 0.0075, 16), glass, (0.10, 0.30, Z), (0, 0, -35))
fill = [(r + 0.0005 * (r > 0), z - 0.0005) for r, z in jug_inside if z < 0.15]
b.add_object("jug water", b.lathe("jug water", fill + [(fill[-1][0], 0.15), (0, 0.15)], 80), water, (0.10, 0.30, Z))
tumbler_inside = b.rounded([(0, 0.009), (0.028, 0.009), (0.034, 0.100)], 0.006, 4)
tumbler = b.lathe("tumbler", b.rounded([(0, 0), (0.031, 0), (0.0362, 0.100)], 0.004, 4) + tumbler_inside[::-1], 72)
for x, y in ((-0.16, 0.20), (0.30, 0.07), (-0.05, -0.06)):
    b.add_object("tumbler", tumbler, glass, (x, y, Z))
fill = [(r + 0.0005 * (r > 0), z - 0.0005) for r, z in tumbler_inside if z < 0.07]
b.add_object("water", b.lathe("water", fill + [(0.0329, 0.07), (0, 0.07)], 72), water, (-0.16, 0.20, Z))
plate = b.lathe("plate", b.rounded([(0, 0), (0.075, 0), (0.13, 0.016), (0.129, 0.0195), (0.074, 0.004), (0, 0.004)], 0.02, 5), 80)
for x, y in ((-0.44, -0.10), (0.46, -0.12), (-0.42, 0.44), (0.46, 0.46)):
    b.add_object("plate", plate, china, (x, y, Z))
    b.add_object("napkin", b.box("napkin", (0.09, 0.19, 0.008), 0.0035), linen, (x + 0.20, y, Z + 0.004), (0, 0, 4))
    b.add_object("knife", b.box("knife", (0.014, 0.20, 0.003), 0.0012), steel, (x + 0.20, y, Z + 0.0097), (0, 0, 2))
bowl = b.lathe("bowl", b.rounded([(0, 0), (0.05, 0), (0.13, 0.07), (0.126, 0.074), (0.045, 0.006), (0, 0.006)], 0.03, 5), 80)
b.add_object("bowl", bowl, china, (-0.20, 0.47, Z))
lemon = b.lathe("lemon", [(max(0.030 * math.sin(t) ** 0.85, 0.006 * math.sin(t)), -0.042 * math.cos(t)) for t in np.linspace(0, math.pi, 19)], 32, sharp=0)
for x, y, z, turn in ((-0.24, 0.49, 0.042, 20), (-0.16, 0.485, 0.042, 100), (-0.205, 0.425, 0.042, 160), (-0.20, 0.475, 0.086, 60), (0.13, -0.17, 0.0297, 35)):
    b.add_object("lemon", lemon, lemon_skin, (x, y, Z + z), (88, 0, turn))

# A lamp that is off, a sideboard, two pictures.
b.add_object("lamp", b.lathe("lamp", b.rounded([(0.02, 0.20), (0.06, 0.19), (0.22, 0.0), (0.216, 0.0), (0.055, 0.184), (0.02, 0.194)], 0.05, 6), 64), dark, (0, 0.15, 1.62))
b.add_object("lamp cord", b.tube("lamp cord", [(0, 0.15, 1.80), (0, 0.15, HIGH)], 0.004, 8), dark)
b.add_object("sideboard", b.box("sideboard", (1.7, 0.42, 0.72), 0.008, uv=0.9), oak, (0.55, 1.97, 0.46))
for k in range(3):
    b.add_object("drawer", b.box("drawer", (0.54, 0.02, 0.60), 0.004, uv=0.9), oak, (0.0 + 0.555 * k, 1.755, 0.46))
for k, (x, high) in enumerate(((0.15, 0.62), (0.85, 0.62))):
    b.add_object("picture", b.box("picture", (0.46, 0.012, high)), (white, lemon_skin)[k], (x, DEEP / 2 - 0.02, 1.55))
    b.add_object("picture frame", b.box("picture frame", (0.50, 0.008, high + 0.04)), dark, (x, DEEP / 2 - 0.012, 1.55))
    b.add_object("motif", b.lathe("motif", [(0, 0), (0.12, 0)], 48), (blue, dark)[k], (x, DEEP / 2 - 0.0265, 1.60), (90, 0, 0))
b.add_object("yard", b.plane("yard", 40, 40), b.principled("yard", (0.42, 0.38, 0.32), 0.9), (-22.5, 0, -0.4))

b.sun("sun", (0.84, -0.14, -0.40), 60, (1.0, 0.86, 0.66))
b.sky((6.0, 7.6, 9.6))
b.camera((0.72, -1.62, 1.40), (-0.02, 0.22, 0.82), lens=35)
b.finish(__file__)
