"""A schoolroom in the morning: sun and sky come through three panes on one side, and the far corners live on what desks and walls send back."""

import math
import os
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "scripts", "blender"))
import build as b
import numpy as np

b.start(1280, 720)
random = np.random.default_rng(8)
WIDE, DEEP, HIGH, SILL, HEAD = 7.0, 9.0, 3.2, 0.95, 2.85


def boards(size=512, rows=10):
    v, u = np.mgrid[0:size, 0:size] / size
    row = np.floor(v * rows).astype(int)
    tone = np.random.default_rng(2).random(rows)[row]
    joint = np.minimum(v * rows % 1, 1 - v * rows % 1)
    color = b.blend((0.33, 0.21, 0.12), (0.56, 0.38, 0.23), np.clip(0.6 * tone + 0.5 * b.noise(size, size, 2, 7, 3, (30, 2)), 0, 1))
    return color * (0.35 + 0.65 * np.clip((joint - 0.01) / 0.03, 0, 1))[..., None]


def lesson(height=192, width=512):
    """A wiped slate with a circle, its tangent and three lines of writing."""
    y, x = np.mgrid[0:height, 0:width] / height
    chalk = np.exp(-((np.hypot(x - 0.55, y - 0.5) - 0.28) / 0.008) ** 2) + np.exp(-((0.8 * (x - 0.55) + 0.6 * (y - 0.5) - 0.28) / 0.008) ** 2) * (np.abs(x - 0.75) < 0.3)
    for k, base in enumerate((0.74, 0.54, 0.34)):
        wave = base + 0.035 * np.sin(70 * x + 9 * np.sin(5 * x + k)) * np.sin(31 * x + k)
        chalk += np.exp(-((y - wave) / 0.010) ** 2) * (x > 1.3) * (x < 2.3 - 0.2 * k) * (np.sin(11 * x + 2 * k) > -0.8)
    dust = 0.10 * b.noise(height, width, 3, 5, 6)
    return b.blend((0.10, 0.17, 0.14), (0.85, 0.85, 0.80), np.clip(chalk * (0.5 + 0.5 * b.noise(height, width, 60, 2, 7)) + dust, 0, 1))


floor = b.principled("boards", roughness=0.28, texture=b.image("boards", boards()))
cream = b.principled("cream", (0.74, 0.69, 0.57), 0.85, Specular_IOR_Level=0.2)
green = b.principled("dado", (0.22, 0.34, 0.28), 0.45)
white = b.principled("white", (0.80, 0.80, 0.78), 0.6)
birch = b.principled("birch", (0.62, 0.44, 0.26), 0.3)
steel = b.principled("tube", (0.08, 0.12, 0.16), 0.35, Coat_Weight=0.5, Coat_Roughness=0.1)
slate = b.principled("slate", roughness=0.6, texture=b.image("lesson", lesson()))
pane = b.glass("pane", 1.52)

b.add_object("floor", b.plane("floor", WIDE, DEEP, uv=1.4), floor)
b.add_object("ceiling", b.plane("ceiling", WIDE, DEEP), white, (0, 0, HIGH), (180, 0, 0))
for name, span, at, turn in (("far wall", WIDE, (0, DEEP / 2), 0), ("near wall", WIDE, (0, -DEEP / 2), 180), ("right wall", DEEP, (WIDE / 2, 0), -90)):
    b.add_object(name, b.plane(name, span, HIGH), cream, (*at, HIGH / 2), (90, 0, turn))
    b.add_object("dado", b.box("dado", (span, 0.03, 1.1), 0.004), green, (*at, 0.55), (0, 0, turn))

# The window wall, 30 cm thick: a parapet, a lintel, piers, and three casements of six panes each.
x = -WIDE / 2 - 0.15
b.add_object("parapet", b.box("parapet", (0.3, DEEP, SILL)), green, (x, 0, SILL / 2))
b.add_object("lintel", b.box("lintel", (0.3, DEEP, HIGH - HEAD)), cream, (x, 0, (HIGH + HEAD) / 2))
for y, wide in ((-4.05, 0.9), (-1.4, 0.6), (1.4, 0.6), (4.05, 0.9)):
    b.add_object("pier", b.box("pier", (0.3, wide, HEAD - SILL)), cream, (x, y, (HEAD + SILL) / 2))
sash_mesh, bar, post = b.box("pane", (0.006, 0.78, 0.90)), b.box("bar", (0.05, 2.3, 0.05), 0.006, 2), b.box("post", (0.05, 0.05, HEAD - SILL), 0.006, 2)
for y in (-2.725, 0.0, 2.725):
    for k in range(4):
        b.add_object("post", post, white, (x - 0.03, y + (k - 1.5) * 0.742, (HEAD + SILL) / 2))
    for k in range(3):
        b.add_object("bar", bar, white, (x - 0.031, y, SILL + 0.02 + 0.93 * k))
        for z in (0, 1):
            b.add_object("pane", sash_mesh, pane, (x - 0.03, y + (k - 1) * 0.742, SILL + 0.485 + 0.93 * z))
    b.add_object("sill", b.box("sill", (0.40, 2.4, 0.04), 0.01), white, (x + 0.06, y, SILL))
for y in (-2.7, 0.0, 2.7):
    for k in range(14):
        b.add_object("radiator", b.box("radiator", (0.10, 0.06, 0.6), 0.025, 2), white, (-WIDE / 2 + 0.10, y + (k - 6.5) * 0.075, 0.45))

# Desks for two, each with two chairs and what was left on it.
top, shelf, seat = b.box("desk top", (1.25, 0.52, 0.028), 0.008), b.box("desk shelf", (1.15, 0.36, 0.014), 0.004), b.box("seat", (0.40, 0.38, 0.018), 0.008)
rest = b.sheet("rest", 10, 2, lambda u, v: ((u - 0.5) * 0.40, 0.05 * math.cos(math.pi * (u - 0.5)), v * 0.19), bottom=None)
frame = b.tube("desk frame", b.arc([(0, -0.22, 0.02), (0, -0.22, 0.70), (0, 0.22, 0.70), (0, 0.22, 0.02)], 0.06, 5), 0.014, 10)
legs = b.tube("chair frame", b.arc([(0, 0.19, 0.015), (0, 0.14, 0.44), (0, -0.17, 0.43), (0, -0.20, 0.84)], 0.05, 5), 0.011, 10)
foot = b.tube("chair foot", [(0, -0.19, 0.015), (0, -0.10, 0.43)], 0.011, 10)
covers = [b.principled(f"cover {k}", c, 0.45) for k, c in enumerate(((0.60, 0.11, 0.07), (0.08, 0.20, 0.42), (0.76, 0.60, 0.16), (0.15, 0.33, 0.16), (0.80, 0.78, 0.72)))]
books = [b.box(f"book {k}", (0.19, 0.26, 0.022), 0.003, 1) for k in range(len(covers))]
for row in range(4):
    for column in (-2.0, 0.0, 2.0):
        cx, cy = column + 0.25 + random.normal(0, 0.03), 1.75 - 1.45 * row + random.normal(0, 0.03)
        b.add_object("desk top", top, birch, (cx, cy, 0.73))
        b.add_object("desk shelf", shelf, birch, (cx, cy, 0.58))
        for side in (-0.56, 0.56):
            b.add_object("desk frame", frame, steel, (cx + side, cy, 0))
        for side in (-0.31, 0.31):
            sx, sy, turn = cx + side + random.normal(0, 0.02), cy - 0.50 - 0.12 * random.random(), random.normal(0, 9)
            spin = b.Matrix.Translation((sx, sy, 0)) @ b.Matrix.Rotation(math.radians(turn), 4, "Z")
            for name, mesh, paint, at in (("seat", seat, birch, (0, -0.01, 0.455)), ("rest", rest, birch, (0, -0.255, 0.66)), *(
                    (n, m, steel, (q, 0, 0)) for q in (-0.19, 0.19) for n, m in (("chair frame", legs), ("chair foot", foot)))):
                b.add_object(name, mesh, paint).matrix_world = spin @ b.Matrix.Translation(at)
            for level in range(random.integers(0, 4)):
                k = random.integers(len(covers))
                b.add_object("book", books[k], covers[k], (cx + side * 0.9, cy + 0.02, 0.7552 + 0.0225 * level), (0, 0, random.normal(0, 14)))

# The front: a platform, the teacher's desk with a globe, the board, a map, a clock; lamps that are off.
b.add_object("platform", b.box("platform", (5.0, 1.25, 0.16), 0.01), b.principled("step", (0.30, 0.19, 0.11), 0.35), (0.2, DEEP / 2 - 0.64, 0.08))
b.add_object("teacher's desk", b.box("teacher's desk", (1.5, 0.62, 0.72), 0.01), birch, (1.55, 3.55, 0.52))
ball = b.sphere("globe", 0.16, 5)
b.add_object("globe", ball, b.principled("sea", (0.10, 0.30, 0.46), 0.25), (1.95, 3.5, 1.16))
b.add_object("globe ring", b.torus("globe ring", 0.18, 0.008, 64, 10), b.metal("brass", (0.87, 0.67, 0.36), 0.25), (1.95, 3.5, 1.16), (67, 0, 30))
b.add_object("globe stand", b.lathe("globe stand", b.rounded([(0, 0), (0.10, 0), (0.09, 0.02), (0.015, 0.04), (0.015, 0.11), (0, 0.11)], 0.01), 40), steel, (1.95, 3.5, 0.8802))
board = b.sheet("slate", 1, 1, lambda u, v: ((u - 0.5) * 3.6, 0, (v - 0.5) * 1.35), uv=True)
b.add_object("slate", board, slate, (-0.3, DEEP / 2 - 0.035, 1.72))
for size, at in (((3.72, 0.06, 0.06), (-0.3, 4.48, 2.42)), ((3.72, 0.10, 0.06), (-0.3, 4.46, 1.02)), ((0.06, 0.06, 1.4), (-2.13, 4.48, 1.72)), ((0.06, 0.06, 1.4), (1.53, 4.48, 1.72))):
    b.add_object("board frame", b.box("board frame", size, 0.008, 1), birch, at)
b.add_object("clock", b.lathe("clock", b.rounded([(0, 0), (0.19, 0), (0.19, 0.05), (0.17, 0.05), (0.165, 0.035), (0, 0.035)], 0.006), 64), white, (0.9, DEEP / 2 - 0.002, 2.75), (90, 0, 0))
for length, turn in ((0.14, 40), (0.09, -75)):
    b.add_object("hand", b.box("hand", (0.012, 0.006, length)), steel, (0.9 + length / 2 * math.sin(math.radians(turn)), DEEP / 2 - 0.045, 2.75 + length / 2 * math.cos(math.radians(turn))), (0, turn, 0))
b.add_object("door", b.box("door", (0.06, 0.95, 2.1), 0.008), green, (WIDE / 2 - 0.01, 3.1, 1.05))
for y in (-2.5, 0.3, 3.1):
    for row in (-1.4, 1.6):
        b.add_object("lamp", b.box("lamp", (0.16, 1.4, 0.08), 0.02), white, (row, y, HIGH - 0.30))
b.add_object("lawn", b.plane("lawn", 120, 120), b.principled("lawn", (0.16, 0.22, 0.08), 0.9, Specular_IOR_Level=0.1), (-50, 0, -4.2))

b.sun("sun", (0.80, 0.30, -0.46), 60, (1.0, 0.91, 0.78))
b.dome(lambda x, y, z: b.blend((6.5, 7.4, 8.6), (2.2, 3.8, 7.4), np.clip(z, 0, 1) ** 0.5) * np.where(z < 0, 0.25, 1 + 1.5 * np.clip(-0.8 * x - 0.4 * y + 0.4 * z, 0, 1) ** 6)[..., None])
b.camera((2.35, -4.25, 1.62), (-0.55, 1.6, 1.12), lens=23)
b.finish(__file__)
