"""Cut gems on a linen table under two small lamps: many colours of glass, dispersion, and caustics of every facet."""

import math
import os
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "scripts", "blender"))
import build as b
import numpy as np
from mathutils import Vector

MM = 0.001
b.start(1280, 720)


def around(radius, degrees, height):
    t = math.radians(degrees)
    return Vector((radius * math.cos(t), radius * math.sin(t), height))


def through(a, c, d):
    """The plane through three points, its normal away from the origin."""
    normal = (c - a).cross(d - a).normalized()
    return (normal, normal.dot(a)) if normal.dot(a) > 0 else (-normal, -normal.dot(a))


def brilliant(name, table=0.56, crown=34.5, pavilion=40.8, girdle=0.025, star=0.5, lower=0.78):
    """The round brilliant of 57 facets, girdle diameter 1: angles in degrees, lengths as gemmologists state them."""
    up, down, half = math.tan(math.radians(crown)), math.tan(math.radians(pavilion)), girdle / 2
    step, mean = 22.5, math.cos(math.radians(22.5))
    top = half + (0.5 - table / 2) * up
    tip = table / 2 * mean + star * (0.5 - table / 2 * mean)
    tip_height = half + (0.5 - tip * mean) * up
    low = 0.5 * (1 - lower)
    low_height = -half - (0.5 - low * mean) * down
    planes = [((0, 0, 1), top)]
    for k in range(8):
        main = 45 * k
        planes.append((around(math.sin(math.radians(crown)), main, math.cos(math.radians(crown))), 0))
        planes[-1] = (planes[-1][0], planes[-1][0].dot(around(0.5, main, half)))
        keel = around(math.sin(math.radians(pavilion)), main, -math.cos(math.radians(pavilion)))
        planes.append((keel, keel.dot(around(0.5, main, -half))))
        planes.append(through(around(table / 2, main, top), around(table / 2, main + 45, top), around(tip, main + step, tip_height)))
        for a, c in ((main, main + step), (main + 45, main + step)):
            planes.append(through(around(0.5, a, half), around(0.5, c, half), around(tip, main + step, tip_height)))
            planes.append(through(around(0.5, a, -half), around(0.5, c, -half), around(low, main + step, low_height)))
            planes.append(through(around(0.5, a, half), around(0.5, c, half), around(0.5, c, -half)))
    return b.polyhedron(name, planes)


def step_cut(name, width, length, corner, crown=((48, 0.05), (40, 0.05), (30, 0.04)), pavilion=((54, 0.17), (46, 0.14), (40, 0.5))):
    """The step (emerald) cut: an octagonal girdle and rows of facets, each an (angle, height) from the girdle on."""
    half, planes = 0.015, []
    slant = (width / 2 + length / 2) / math.sqrt(2) - corner
    for k, reach in enumerate((width / 2, slant, length / 2, slant) * 2):
        planes.append((around(1, 45 * k, 0), reach))
        for sign, rows in ((1, crown), (-1, pavilion)):
            out, height = reach, half
            for angle, rise in rows:
                tilt = math.radians(angle)
                normal = around(math.sin(tilt), 45 * k, sign * math.cos(tilt))
                planes.append((normal, normal.dot(around(out, 45 * k, sign * height))))
                out, height = out - rise / math.tan(tilt), height + rise
    planes.append(((0, 0, 1), half + sum(rise for _, rise in crown)))
    return b.polyhedron(name, planes)


def linen(size=1024):
    """Plain weave, slubs along both threads."""
    v, u = np.mgrid[0:size, 0:size] * (2 * math.pi * 96 / size)
    over = np.sin(u / 2) * np.sin(v / 2) > 0
    thread = np.where(over, np.abs(np.sin(u)), np.abs(np.sin(v))) ** 0.5
    slub = np.where(over, b.noise(size, size, 6, 5, 1, (8, 1)), b.noise(size, size, 6, 5, 2, (1, 8)))
    return b.blend((0.55, 0.52, 0.47), (0.79, 0.75, 0.69), np.clip(0.65 * thread + 0.7 * (slub - 0.3), 0, 1))


cloth = b.principled("linen", roughness=1.0, texture=b.image("linen", linen(), quality=75), Specular_IOR_Level=0.0)
b.add_object("table", b.plane("table", 0.9, 0.9, uv=0.06), cloth)

diamond = b.glass("diamond", 2.417, abbe=55.3)
ruby = b.glass("ruby", 1.765, absorption=(8, 330, 240), abbe=72)
sapphire = b.glass("sapphire", 1.765, absorption=(330, 170, 10), abbe=72)
emerald = b.glass("emerald", 1.58, absorption=(300, 14, 150), abbe=62)
citrine = b.glass("citrine", 1.55, absorption=(5, 50, 260), abbe=69)
amethyst = b.glass("amethyst", 1.55, absorption=(70, 190, 20), abbe=69)
round_cut = brilliant("round cut")
ruby_cut, quartz_cut = brilliant("oval cut", 0.58, 36, 42), brilliant("quartz cut", 0.55, 40, 43)
emerald_cut = step_cut("emerald cut", 0.74, 1.0, 0.12)


def lay(name, mesh, material, size, at, tilt, turn, stretch=1.0):
    """Set a gem down: tilted, so that it rests on the table with its lowest point."""
    mesh = mesh.copy()
    mesh.materials.clear()
    body = b.add_object(name, mesh, material, (0, 0, 0), (tilt, 0, turn), (size * stretch, size, size))
    b.bpy.context.view_layer.update()
    lowest = min((body.matrix_world @ v.co).z for v in mesh.vertices)
    body.location = (*at, 2e-5 - lowest)
    return body


# A stone on its side touches with culet and girdle: tilted by the slope of its pavilion.
lay("diamond", round_cut, diamond, 13 * MM, (0.001, 0.002), 41, 200)
lay("ruby", ruby_cut, ruby, 10 * MM, (0.0195, -0.004), 42, 150, 1.3)
lay("sapphire", round_cut, sapphire, 10.5 * MM, (-0.0215, 0.004), 41, 250)
lay("emerald", emerald_cut, emerald, 15 * MM, (0.012, 0.023), 36, 130)
lay("citrine", quartz_cut, citrine, 9 * MM, (-0.0125, -0.0145), 42, 285)
lay("amethyst", quartz_cut, amethyst, 11.5 * MM, (-0.0155, 0.025), 42, 215)
random = np.random.default_rng(4)
for k, (x, y) in enumerate(((-0.0015, -0.0235), (0.0065, -0.0165), (0.030, 0.0105), (-0.034, -0.0065), (-0.0015, 0.0185), (0.0345, 0.024), (-0.036, 0.0215))):
    lay("melee", round_cut, diamond, (3.0 + 1.6 * random.random()) * MM, (x, y), 41, 360 * random.random())

# A gold ring with a stone in a six-prong setting, lying on its band.
gold = b.metal("gold", (1.0, 0.77, 0.34), 0.08)
band = b.add_object("ring band", b.torus("ring band", 9.2 * MM, 1.15 * MM, 128, 48), gold)
band.matrix_world = b.Matrix.Translation((0.0245, -0.0185, 0.0012))
head = b.Matrix.Translation((0.0245, -0.0185, 0.0)) @ b.Matrix.Rotation(math.radians(210), 4, "Z") @ b.Matrix.Translation((12.2 * MM, 0, 2.9 * MM)) @ b.Matrix.Rotation(math.radians(72), 4, "Y")
stone = b.add_object("ring stone", round_cut.copy(), None, scale=(5.6 * MM,) * 3)
stone.data.materials.clear()
stone.data.materials.append(diamond)
stone.matrix_world = head @ b.Matrix.Diagonal((5.6 * MM, 5.6 * MM, 5.6 * MM, 1))
prong = b.tube("prong", b.arc([(0.4 * MM, 0, -2.4 * MM), (1.3 * MM, 0, -2.2 * MM), (2.95 * MM, 0, 0), (2.93 * MM, 0, 0.5 * MM), (2.3 * MM, 0, 0.75 * MM)], 0.5 * MM, 6), 0.24 * MM, 16)
for k in range(6):
    claw = b.add_object("prong", prong, gold)
    claw.matrix_world = head @ b.Matrix.Rotation(math.radians(60 * k + 11), 4, "Z")

b.spot("key", (-0.20, 0.34, 0.36), (0.0, 0.0, 0.0), 15.0, 30, (1.0, 0.94, 0.86), 0.4, 0.004)
b.spot("rim", (0.34, 0.20, 0.24), (0.004, 0.0, 0.0), 7.0, 30, (0.86, 0.93, 1.0), 0.4, 0.004)
panel = b.add_object("softbox", b.plane("softbox", 0.26, 0.16), b.emission("softbox", (2.2, 2.2, 2.3)))
panel.matrix_world = b.Matrix.Translation((-0.10, -0.12, 0.42)) @ Vector((-0.10, -0.12, 0.42)).to_track_quat("-Z", "Y").to_matrix().to_4x4()
b.sky((0.045, 0.05, 0.06))
b.camera((-0.012, -0.150, 0.098), (0.0012, -0.0008, 0.002), lens=76, fstop=20, focus=(0.0, -0.002, 0.004))
b.finish(__file__)
