"""A magnifying glass held over old paper by a brass stand, a wine glass, and a small bare bulb under a shade: sharp caustics in a dark study."""

import math
import os
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "scripts", "blender"))
import build as b
import numpy as np

b.start(1280, 720)
random = np.random.default_rng(5)


def chart(height=384, width=512):
    """A map on yellowed paper: contours of an island, a graticule, a coast."""
    land = b.noise(height, width, 2, 6, 12) + 0.35 * np.exp(-((np.mgrid[0:height, 0:width][1] / width - 0.5) ** 2 + (np.mgrid[0:height, 0:width][0] / height - 0.5) ** 2) * 9) - 0.25
    y, x = np.mgrid[0:height, 0:width]
    ink = np.clip(1 - np.abs((land * 18) % 1 - 0.5) / 0.10, 0, 1) * (land > 0.42) * 0.6
    ink = np.maximum(ink, np.clip(1 - np.abs(land - 0.42) / 0.006, 0, 1))
    ink = np.maximum(ink, 0.5 * (((x % 64) < 1.2) | ((y % 64) < 1.2)))
    edge = np.minimum(np.minimum(x, width - x), np.minimum(y, height - y))
    ink = np.maximum(ink * (edge > 18), ((edge > 12) & (edge < 15)) * 1.0)
    paper = b.blend((0.70, 0.57, 0.38), (0.90, 0.82, 0.66), np.clip(b.noise(height, width, 3, 5, 9) * np.minimum(edge / 40 + 0.6, 1), 0, 1))
    return b.blend(b.blend((0, 0, 0), (0.12, 0.06, -0.02), (land > 0.42) * 0.5) * -1 + paper, (0.20, 0.13, 0.09), ink * 0.8)


def leather(size=256):
    return b.blend((0.10, 0.20, 0.15), (0.20, 0.31, 0.23), b.noise(size, size, 24, 4, 3))


def mahogany(size=384):
    return b.blend((0.24, 0.10, 0.06), (0.47, 0.24, 0.14), np.clip(1.4 * b.noise(size, size, 2, 7, 6, (22, 1)) - 0.2, 0, 1))


wood = b.principled("mahogany", roughness=0.35, texture=b.image("mahogany", mahogany()), Coat_Weight=0.4, Coat_Roughness=0.12)
hide = b.principled("leather", roughness=0.55, texture=b.image("leather", leather()))
paper = b.principled("map", roughness=0.9, texture=b.image("map", chart()), Specular_IOR_Level=0.1)
leaf = b.principled("paper", (0.82, 0.77, 0.66), 0.95, Specular_IOR_Level=0.0)
brass = b.metal("brass", (0.88, 0.68, 0.36), 0.16)
enamel = b.principled("enamel", (0.03, 0.14, 0.09), 0.2, Coat_Weight=1.0, Coat_Roughness=0.03)
inside = b.principled("enamel white", (0.85, 0.84, 0.80), 0.6)
black = b.principled("black", (0.02, 0.02, 0.022), 0.3)
glass, wine = b.glass("glass", 1.52), b.glass("wine", 1.34, absorption=(22, 210, 240))
glass["caustique"] = {"priority": 1}

b.add_object("desk", b.box("desk", (1.5, 0.85, 0.04), 0.006, uv=0.7), wood, (0, 0.05, -0.0215))
b.add_object("pad", b.box("pad", (0.72, 0.46, 0.004), 0.0018, 2, uv=0.12), hide, (0, -0.06, 0.0005))
b.add_object("wall", b.plane("wall", 3, 1.8), b.principled("wall", (0.30, 0.22, 0.17), 0.9), (0, 0.48, 0.7), (90, 0, 0))
sheet = b.sheet("map", 48, 36, lambda u, v: ((u - 0.5) * 0.44, (v - 0.5) * 0.32, 0.0028 + 0.016 * max(abs(u - 0.5) - 0.40, 0) ** 2 * 40 + 0.0006 * (1 + math.sin(9 * u + 4 * v))), uv=True)
b.add_object("map", sheet, paper, (0.01, -0.06, 0), (0, 0, -7))

# The magnifier: a biconvex lens of 9 cm in a ring, 11 cm above the map on an arm of a small stand.
R, SAG = 0.045, 0.0105
BOW = (R * R + SAG * SAG) / (2 * SAG)
cap = [(R * k / 20, math.sqrt(BOW * BOW - (R * k / 20) ** 2) - (BOW - SAG) + 0.0012) for k in range(21)]
lens = b.lathe("lens", [(r, -z) for r, z in cap] + cap[::-1], 112, sharp=40)
at, tilt = (0.045, -0.045, 0.112), (20, 12, 0)
b.add_object("lens", lens, glass, at, tilt)
b.add_object("lens ring", b.torus("lens ring", R + 0.0012, 0.0032, 72, 14), brass, at, tilt)
b.add_object("arm", b.tube("arm", b.arc([(0.0475, 0, 0), (0.10, 0, 0), (0.115, 0.03, 0.01), (0.115, 0.06, 0.01)], 0.03, 6), 0.003, 12), brass, at, tilt)
b.add_object("stand", b.lathe("stand", b.rounded([(0, 0), (0.036, 0), (0.034, 0.010), (0.006, 0.016), (0.004, 0.095), (0.007, 0.103), (0, 0.106)], 0.004, 3), 48), brass, (0.162, 0.011, 0.0026))

# A glass of red wine to the left; the wine reaches half a millimetre into its bowl.
bowl_in = b.rounded([(0, 0.082), (0.020, 0.086), (0.040, 0.125), (0.034, 0.195)], 0.025, 7)
bowl_out = b.rounded([(0.0352, 0.195), (0.0416, 0.125), (0.022, 0.084), (0.0045, 0.074), (0.0038, 0.02), (0.010, 0.005), (0.034, 0.0025), (0.034, 0.0), (0, 0.0012)], 0.012, 6)
SPOT = (-0.235, 0.045, 0.0028)
b.add_object("wine glass", b.lathe("wine glass", bowl_in + bowl_out, 96, sharp=50), glass, SPOT)
fill = [(r + 0.0005 * (r > 0), z - 0.0005) for r, z in bowl_in if z < 0.132]
b.add_object("wine", b.lathe("wine", fill + [(fill[-1][0], 0.1325), (0, 0.1325)], 96), wine, SPOT)

# The lamp, behind on the right: a foot, a bent arm, a conical shade with a small hot bulb.
base, head = (0.36, 0.20, 0), (0.135, -0.005, 0.425)
b.add_object("lamp foot", b.lathe("lamp foot", b.rounded([(0, 0), (0.075, 0), (0.07, 0.016), (0.012, 0.03), (0.012, 0.05), (0, 0.05)], 0.006, 4), 56), enamel, (base[0], base[1], 0.0002))
b.add_object("lamp arm", b.tube("lamp arm", b.arc([(base[0], base[1], 0.04), (0.40, 0.235, 0.32), (0.27, 0.12, 0.56), (0.15, 0.008, 0.492)], 0.08, 8), 0.007, 12), brass)
aim = (b.Vector((0.03, -0.05, 0.0)) - b.Vector(head)).to_track_quat("-Z", "Y").to_matrix().to_4x4()
cone = b.rounded([(0.018, 0.055), (0.026, 0.048), (0.075, -0.035)], 0.02, 5)
there = b.Matrix.Translation(head) @ aim
b.add_object("shade", b.lathe("shade", cone, 64), enamel).matrix_world = there
b.add_object("shade lining", b.lathe("shade lining", [(r - 0.0012, z) for r, z in cone], 64), inside).matrix_world = there
b.add_object("shade top", b.lathe("shade top", b.rounded([(0, 0.075), (0.014, 0.073), (0.019, 0.054), (0, 0.052)], 0.004, 3), 40), brass).matrix_world = there
b.add_object("bulb", b.sphere("bulb", 0.011, 4), b.emission("bulb", (3600, 2500, 1450))).matrix_world = there @ b.Matrix.Translation((0, 0, 0.012))

# A stack of books, a pen, an inkwell, letters.
for k, (size, paint) in enumerate((((0.25, 0.17, 0.036), (0.30, 0.06, 0.05)), ((0.23, 0.16, 0.028), (0.06, 0.11, 0.20)), ((0.20, 0.14, 0.032), (0.42, 0.29, 0.12)))):
    z, turn = (0.0185, 0.051, 0.0815)[k] + 0.0003 * k, 14 - 9 * k
    b.add_object("book", b.box("book", size, 0.003, 2), b.principled(f"book {k}", paint, 0.5), (-0.40, 0.26, z), (0, 0, turn))
    b.add_object("pages", b.box("pages", (size[0] - 0.006, size[1] - 0.002, size[2] - 0.008)), leaf, (-0.396, 0.2575, z), (0, 0, turn))
b.add_object("inkwell", b.lathe("inkwell", b.rounded([(0, 0), (0.030, 0), (0.030, 0.03), (0.014, 0.04), (0.015, 0.05), (0.011, 0.05), (0.010, 0.03), (0, 0.03)], 0.006, 4), 48), black, (-0.05, 0.22, 0.0002))
b.add_object("pen", b.tube("pen", [(0, 0, 0.0), (0.10, 0, 0.0), (0.135, 0, 0.0)], 0.0045, 16), black, (-0.13, -0.215, 0.0085), (0, 0, 21))
b.add_object("nib", b.lathe("nib", [(0, 0), (0.0035, 0), (0.0006, 0.02), (0, 0.02)], 16), brass, (-0.13, -0.215, 0.0085), (0, -90, 21))
for turn, x in ((30, -0.02), (12, 0.02)):
    b.add_object("letter", b.box("letter", (0.16, 0.11, 0.0006)), leaf, (x + 0.02, 0.30 - x, 0.0008 + 0.0008 * (x > 0)), (0, 0, turn))

b.sky((0.006, 0.007, 0.010))
b.camera((-0.03, -0.62, 0.46), (0.005, 0.005, 0.075), lens=40)
b.finish(__file__)
