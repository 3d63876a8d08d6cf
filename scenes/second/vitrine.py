"""A jeweller's vitrine: a shelf of glass before a tilted mirror, two spots above, rings and stones whose caustics are seen once more in the mirror."""

import math
import os
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "scripts", "blender"))
import build as b
import numpy as np

b.start(1280, 720)
random = np.random.default_rng(2)
velvet = b.principled("velvet", (0.16, 0.035, 0.06), 0.95, Specular_IOR_Level=0.1, Sheen_Weight=0.6, Sheen_Roughness=0.4)
stone = b.principled("limestone", roughness=0.7, texture=b.image("limestone", b.blend((0.24, 0.23, 0.22), (0.44, 0.42, 0.39), b.noise(256, 256, 4, 7, 3))))
plaster = b.principled("plaster", (0.66, 0.63, 0.58), 0.9, Specular_IOR_Level=0.1)
suede = b.principled("suede", (0.42, 0.37, 0.30), 0.95, Specular_IOR_Level=0.1)
mirror = b.metal("silvering", (0.93, 0.94, 0.94))
gold, rose, silver = b.metal("gold", (1.0, 0.77, 0.34), 0.06), b.metal("rose gold", (0.93, 0.62, 0.48), 0.10), b.metal("silver", (0.96, 0.95, 0.92), 0.04)
bronze = b.metal("bronze", (0.42, 0.28, 0.17), 0.3)
glass, crystal = b.glass("shelf glass", 1.52, absorption=(4.5, 1.2, 2.4)), b.glass("crystal", 1.62, abbe=36)
ruby, aqua = b.glass("ruby", 1.77, absorption=(18, 420, 330)), b.glass("aquamarine", 1.58, absorption=(75, 14, 9))

# The niche: limestone floor, plaster sides, a mirror with a bronze frame that leans at the back.
WIDE, DEEP, HIGH = 1.1, 0.62, 0.78
b.add_object("floor", b.plane("floor", WIDE, 1.6, uv=0.5), stone, (0, -0.5, 0))
for name, size, at, turn in (("back", (WIDE, HIGH), (0, 0.30, HIGH / 2), (90, 0, 0)), ("left", (1.6, HIGH), (-WIDE / 2, -0.5, HIGH / 2), (90, 0, 90)),
                             ("right", (1.6, HIGH), (WIDE / 2, -0.5, HIGH / 2), (90, 0, -90)), ("ceiling", (WIDE, 1.6), (0, -0.5, HIGH), (180, 0, 0)), ("front", (WIDE, HIGH), (0, -1.3, HIGH / 2), (90, 0, 180))):
    b.add_object(name, b.plane(name, *size), plaster, at, turn)
lean = b.Matrix.Translation((0.02, 0.235, 0.31)) @ b.Matrix.Rotation(math.radians(7), 4, "X")
b.add_object("mirror", b.box("mirror", (0.86, 0.006, 0.56)), mirror).matrix_world = lean
for size, at in (((0.90, 0.022, 0.022), (0, 0, 0.286)), ((0.90, 0.022, 0.022), (0, 0, -0.286)), ((0.022, 0.022, 0.594), (0.439, 0, 0)), ((0.022, 0.022, 0.594), (-0.439, 0, 0))):
    b.add_object("frame", b.box("frame", size, 0.005, 2), bronze).matrix_world = lean @ b.Matrix.Translation(at)

# The shelf of glass on four bronze posts.
SHELF = 0.205
b.add_object("shelf", b.box("shelf", (0.74, 0.24, 0.010), 0.0015, 2), glass, (-0.02, -0.02, SHELF))
for x in (-0.345, 0.315):
    for y in (-0.115, 0.075):
        b.add_object("post", b.lathe("post", b.rounded([(0, 0), (0.016, 0), (0.006, 0.012), (0.006, 0.185), (0.012, 0.1945), (0, 0.1945)], 0.003, 3), 32), bronze, (x, y, 0.0002))
TOP = SHELF + 0.0052


def cut(name, size, crown=0.34, pavilion=0.62, sides=8):
    """A stone of `sides` sides: table, crown and pavilion facets, girdle of this diameter, standing on its culet."""
    planes = [((0, 0, 1), 0.20)]
    for k in range(sides):
        for half, up, down in ((0, 1.0, 1.0), (0.5, 1.45, 0.80)):
            t = 2 * math.pi * (k + half) / sides
            planes += [((math.cos(t), math.sin(t), up / crown * 0.55), 0.5 + 0.012 * half), ((math.cos(t), math.sin(t), -down / pavilion * 0.72), 0.5 + 0.012 * half)]
    mesh = b.polyhedron(name, planes)
    for vertex in mesh.vertices:
        vertex.co *= size
    return mesh


def ring(at, paint, size, turn, jewel=None):
    """A band standing in a slit of a cushion, a stone on top of it."""
    spin = b.Matrix.Translation(at) @ b.Matrix.Rotation(math.radians(turn), 4, "Z")
    b.add_object("band", b.torus("band", size, size * 0.13, 64, 16), paint).matrix_world = spin @ b.Matrix.Rotation(math.radians(90), 4, "X")
    if jewel:
        b.add_object("jewel", jewel[0], jewel[1]).matrix_world = spin @ b.Matrix.Translation((0, 0, size * 1.13 + jewel[2]))
        b.add_object("collet", b.lathe("collet", [(size * 0.14, -size * 0.2), (size * 0.42, size * 0.36), (size * 0.38, size * 0.36), (size * 0.10, -size * 0.2)], 24, closed=True), paint).matrix_world = spin @ b.Matrix.Translation((0, 0, size * 1.2))


small, big = cut("small stone", 0.0095), cut("big stone", 0.038)
for x, turn, paint, kind in ((-0.255, 20, gold, crystal), (-0.185, -15, rose, ruby), (-0.115, 10, silver, aqua)):
    b.add_object("cushion", b.box("cushion", (0.05, 0.05, 0.022), 0.009, 5), suede, (x, -0.045, TOP + 0.0113), (0, 0, turn))
    ring((x, -0.045, TOP + 0.027), paint, 0.0098, turn, (small.copy(), kind, 0.0068))
low = -min(v.co.z for v in big.vertices)
for x, y, kind, lean_to, turn in ((0.035, -0.065, crystal, 128, 15), (0.115, -0.03, ruby, 128, 70), (0.205, -0.085, aqua, 128, 140)):
    mesh = big.copy()
    tilt = b.Matrix.Rotation(math.radians(turn), 4, "Z") @ b.Matrix.Rotation(math.radians(lean_to), 4, "Y")
    foot = min((tilt @ v.co).z for v in mesh.vertices)
    b.add_object("stone", mesh, kind).matrix_world = b.Matrix.Translation((x, y, TOP + 0.0001 - foot)) @ tilt
b.add_object("bangle", b.torus("bangle", 0.034, 0.0042, 96, 20), gold, (0.115, 0.045, TOP + 0.0046))
b.add_object("bangle", b.torus("thin bangle", 0.033, 0.0024, 96, 14), silver, (0.128, 0.043, TOP + 0.0116), (6, 3, 0))

# Below: a bowl of crystal, a string of pearls, a watch-chain in a heap of rings, cards.
b.add_object("bowl", b.lathe("bowl", b.rounded([(0, 0), (0.030, 0), (0.062, 0.048), (0.0565, 0.048), (0.024, 0.008), (0, 0.008)], 0.012, 6), 64), crystal, (0.19, -0.20, 0.0002))
pearl, nacre = b.sphere("pearl", 0.0046, 3), b.principled("pearl", (0.86, 0.82, 0.76), 0.22, Coat_Weight=0.8, Coat_Roughness=0.05)
for k in range(48):
    t = 2 * math.pi * k / 48
    r = 0.062 * (1 + 0.28 * math.cos(2 * t + 0.6) + 0.10 * math.sin(3 * t))
    b.add_object("pearl", pearl, nacre, (-0.16 + 1.35 * r * math.cos(t), -0.20 + 0.75 * r * math.sin(t), 0.0047))
for k in range(5):
    b.add_object("loose ring", b.torus("loose ring", 0.0102, 0.0013, 48, 12), (gold, rose, silver)[k % 3], (0.02 + 0.03 * random.random(), -0.235 + 0.03 * random.random(), 0.0016 + 0.0026 * k), (4 * k, 3 * k, 0))
b.add_object("bust", b.lathe("bust", b.rounded([(0, 0), (0.06, 0), (0.055, 0.012), (0.022, 0.03), (0.020, 0.10), (0.045, 0.145), (0.028, 0.21), (0.030, 0.24), (0, 0.25)], 0.03, 7), 56), velvet, (0.41, -0.07, 0.0002))
b.add_object("necklace", b.torus("necklace", 0.0435, 0.0019, 96, 10), gold, (0.41, -0.071, 0.165), (16, 0, 0))
b.add_object("pendant", cut("pendant", 0.02), aqua, (0.41, -0.1265, 0.143), (75, 0, 0))

# Two spots in brass cans, and a faint strip of warm light along the front.
can = b.lathe("can", b.rounded([(0, 0.055), (0.026, 0.055), (0.028, 0), (0.025, 0), (0.023, 0.05), (0, 0.05)], 0.004, 3), 40)
for x, y, to, watts in ((-0.24, -0.38, (-0.10, -0.04, 0.2), 48), (0.27, -0.33, (0.10, -0.06, 0.2), 42)):
    b.spot("spot", (x, y, HIGH - 0.075), to, watts, 46, (1.0, 0.88, 0.72), 0.25, 0.0)
    there = b.Matrix.Translation((x, y, HIGH - 0.075)) @ (b.Vector(to) - b.Vector((x, y, HIGH - 0.075))).to_track_quat("-Z", "Y").to_matrix().to_4x4()
    b.add_object("can", can, bronze).matrix_world = there @ b.Matrix.Translation((0, 0, -0.012))
b.add_object("strip", b.plane("strip", 0.9, 0.02), b.emission("strip", (20, 16, 12)), (0, -0.62, HIGH - 0.002), (180, 0, 0))
b.camera((-0.09, -0.60, 0.42), (0.005, 0.02, 0.222), lens=38)
b.finish(__file__)
