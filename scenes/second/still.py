"""Matte pots, wooden blocks and plastic cups under one area lamp: no glass, no mirror, nothing that focuses light."""

import math
import os
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "scripts", "blender"))
import build as b
import numpy as np

b.start(1280, 720)


def beech(size=256):
    grain = b.noise(size, size, 2, 6, 3, (1, 18))
    return b.blend((0.60, 0.43, 0.27), (0.80, 0.64, 0.45), np.clip(grain * 1.4 - 0.2, 0, 1))


def weave(size=256):
    v, u = np.mgrid[0:size, 0:size] / size * 48
    thread = 0.5 + 0.25 * np.sin(2 * np.pi * u) * np.sin(np.pi * np.floor(v)) + 0.25 * np.cos(2 * np.pi * (u + v))
    return b.blend((0.52, 0.53, 0.50), (0.66, 0.66, 0.62), thread * 0.6 + 0.4 * b.noise(size, size, 6, 5, 1))


linen = b.principled("linen", roughness=0.95, texture=b.image("weave", weave()), Specular_IOR_Level=0.1)
wood = b.principled("beech", roughness=0.5, texture=b.image("beech", beech()))
clay = b.principled("clay", (0.55, 0.22, 0.11), 0.85, Specular_IOR_Level=0.2)
bisque = b.principled("bisque", (0.78, 0.72, 0.64), 0.8, Specular_IOR_Level=0.2)
slip = b.principled("slip", (0.11, 0.19, 0.27), 0.5)
chalk = b.principled("chalk", (0.82, 0.81, 0.79), 0.95, Specular_IOR_Level=0.0)
yellow, coral, mint = (b.principled(n, c, 0.38) for n, c in (("yellow", (0.84, 0.55, 0.05)), ("coral", (0.78, 0.16, 0.10)), ("mint", (0.25, 0.55, 0.42))))

# A cloth falls over the edge of a box behind and runs to the front in soft folds.
def cloth(u, v):
    x, along = (u - 0.5) * 2.6, v * 1.9
    fold = 0.012 * math.sin(9 * x + 1.3 * math.sin(3 * along)) + 0.007 * math.sin(23 * x + 4 * along)
    if along < 1.1:
        return x, along - 0.75, 0.35 * abs(fold) * min(1, 3 * abs(along - 0.65))
    rise = along - 1.1
    lift = max(rise - 0.12, 0)
    return x, 0.35 + 0.12 * math.sin(min(rise / 0.12, math.pi / 2)) - 2.2 * fold * min(lift * 4, 1), 0.06 * min(rise / 0.12, 1) ** 2 + lift


b.add_object("cloth", b.sheet("cloth", 96, 64, cloth, uv=True), linen)
b.add_object("table", b.plane("table", 4, 3), bisque, (0, -0.6, -0.012))

jug = b.lathe("jug", b.rounded([(0, 0.0), (0.062, 0.0), (0.112, 0.10), (0.098, 0.19), (0.046, 0.245), (0.058, 0.31), (0.050, 0.31), (0.038, 0.245), (0.088, 0.185), (0.102, 0.10), (0.055, 0.010), (0, 0.010)], 0.05, 6), 56)
b.add_object("jug", jug, clay, (-0.19, 0.06, 0.0))
b.add_object("jug handle", b.tube("jug handle", b.arc([(0.05, 0, 0.29), (0.15, 0, 0.30), (0.155, 0, 0.16), (0.102, 0, 0.12)], 0.07, 8), 0.0115, 16), clay, (-0.19, 0.06, 0), (0, 0, 155))
vase = b.lathe("vase", b.rounded([(0, 0), (0.045, 0), (0.03, 0.05), (0.085, 0.17), (0.026, 0.30), (0.026, 0.42), (0.036, 0.44), (0.030, 0.44), (0.019, 0.42), (0.018, 0.30), (0, 0.29)], 0.05, 6), 56)
b.add_object("vase", vase, slip, (0.02, 0.18, 0.0))
bowl = b.lathe("bowl", b.rounded([(0, 0), (0.045, 0), (0.05, 0.012), (0.125, 0.085), (0.120, 0.090), (0.045, 0.020), (0, 0.017)], 0.03, 6), 72)
b.add_object("bowl", bowl, bisque, (0.20, -0.05, 0.0))
pear = b.lathe("pear", b.rounded([(0, 0.002), (0.024, 0), (0.044, 0.03), (0.028, 0.075), (0.015, 0.094), (0, 0.092)], 0.03, 6), 36)
for name, paint, at, turn in (("pear", yellow, (0.185, -0.03, 0.028), (0, 12, 30)), ("pear", mint, (0.235, -0.075, 0.066), (74, 0, 65)), ("pear", yellow, (-0.06, -0.155, 0.036), (80, 0, 128))):
    b.add_object(name, pear.copy(), paint, at, turn)
cup = b.lathe("cup", b.rounded([(0, 0.0), (0.029, 0.0), (0.038, 0.095), (0.035, 0.095), (0.026, 0.005), (0, 0.005)], 0.004, 4), 64)
for paint, at, turn in ((coral, (0.40, 0.10, 0.0), (0, 0, 0)), (mint, (0.40, 0.10, 0.028), (0, 2, 0)), (yellow, (0.335, -0.205, 0.0372), (0, 95.4, 52))):
    b.add_object("cup", cup.copy(), paint, at, turn)
b.add_object("plank", b.box("plank", (0.26, 0.15, 0.018), 0.003, uv=0.3), wood, (-0.33, -0.17, 0.009), (0, 0, 22))
for size, at, turn in (((0.06, 0.06, 0.06), (-0.38, -0.17, 0.048), 40), ((0.06, 0.06, 0.06), (-0.29, -0.12, 0.048), 12), ((0.045, 0.045, 0.12), (-0.42, 0.05, 0.06), 25)):
    b.add_object("block", b.box("block", size, 0.002, uv=0.2), wood, at, (0, 0, turn))
b.add_object("chalk ball", b.sphere("chalk ball", 0.045, 4), chalk, (-0.335, -0.145, 0.123))
egg = b.lathe("egg", [(0.022 * math.sin(t) * (1 + 0.12 * math.cos(t)), -0.029 * math.cos(t)) for t in np.linspace(0, math.pi, 25)], 48, sharp=0)
for x, y, turn in ((0.06, -0.21, 20), (0.105, -0.185, 100)):
    b.add_object("egg", egg, chalk if x > 0.1 else bisque, (x, y, 0.0215), (88, 0, turn))

lamp = b.add_object("lamp", b.plane("lamp", 0.5, 0.5), b.emission("lamp", (31, 28.5, 25)), (-0.85, -0.55, 0.95))
lamp.rotation_euler = (b.Vector((0.0, 0.0, 0.1)) - lamp.location).to_track_quat("Z", "Y").to_euler()
b.sky((0.05, 0.06, 0.08))
b.camera((0.12, -1.36, 0.50), (-0.005, 0.02, 0.165), lens=50)
b.finish(__file__)
