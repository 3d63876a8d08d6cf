"""A glass ball in a foggy cellar: one spotlight makes a cone in the air, and the ball folds it to a bright spike."""

import os
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "scripts", "blender"))
import build as b
import numpy as np

b.start(1280, 720)


def bricks(size=1024, across=8, rows=24):
    v, u = np.mgrid[0:size, 0:size] / size
    row = np.floor(v * rows)
    x, y = u * across + 0.5 * (row % 2), v * rows
    tone = np.random.default_rng(5).random((rows, across))[row.astype(int), np.floor(x).astype(int) % across]
    edge = np.minimum(np.minimum(x % 1, 1 - x % 1) * 3, np.minimum(y % 1, 1 - y % 1))
    mask = np.clip((edge - 0.06 - 0.05 * b.noise(size, size, 40, 3, 6)) / 0.05, 0, 1)
    color = b.blend((0.44, 0.27, 0.21), (0.64, 0.42, 0.33), tone) * (0.75 + 0.4 * b.noise(size, size, 30, 5, 9))[..., None]
    return b.blend((0.52, 0.49, 0.45), (0, 0, 0), mask) + color * mask[..., None]


def flags(size=512):
    return b.blend((0.36, 0.35, 0.33), (0.58, 0.56, 0.52), b.noise(size, size, 4, 7, 12))


wall = b.principled("brick", roughness=0.9, texture=b.image("brick", bricks()), Specular_IOR_Level=0.2)
floor = b.principled("flagstone", roughness=0.5, texture=b.image("flagstone", flags()))
WIDE, DEEP, HIGH = 4.4, 4.6, 2.6
b.add_object("floor", b.plane("floor", WIDE, DEEP, uv=1.6), floor)
b.add_object("ceiling", b.plane("ceiling", WIDE, DEEP), b.principled("ceiling", (0.5, 0.47, 0.43), 0.9), (0, 0, HIGH), (180, 0, 0))
for name, span, at, turn in (("back wall", WIDE, (0, DEEP / 2), 0), ("front wall", WIDE, (0, -DEEP / 2), 180),
                             ("left wall", DEEP, (-WIDE / 2, 0), 90), ("right wall", DEEP, (WIDE / 2, 0), -90)):
    b.add_object(name, b.plane(name, span, HIGH, uv=1.9), wall, (*at, HIGH / 2), (90, 0, turn))

column = b.lathe("pedestal", b.rounded([(0, 0), (0.23, 0), (0.23, 0.07), (0.15, 0.12), (0.13, 0.66), (0.19, 0.72), (0.19, 0.78), (0, 0.78)], 0.03, 8), 128)
b.add_object("pedestal", column, b.principled("pedestal", (0.62, 0.60, 0.56), 0.6), (-0.25, 0.5, 0))
b.add_object("ring foot", b.torus("ring foot", 0.075, 0.014, 96, 24), b.metal("bronze", (0.72, 0.50, 0.30), 0.25), (-0.25, 0.5, 0.794))
b.add_object("ball", b.sphere("ball", 0.19, 7), b.glass("glass", 1.5), (-0.25, 0.5, 0.978))
crate = b.principled("crate", (0.30, 0.19, 0.10), 0.75)
b.add_object("crate", b.box("crate", (0.55, 0.45, 0.40), 0.012), crate, (1.25, 1.35, 0.20), (0, 0, 22))
b.add_object("crate", b.box("small crate", (0.36, 0.32, 0.27), 0.010), crate, (1.22, 1.38, 0.535), (0, 0, -12))

b.spot("beam", (-2.05, 0.9, 2.42), (-0.25, 0.5, 0.978), 1500, 15.5, (1.0, 0.93, 0.80), 0.15, 0.02)
b.point("lantern", (1.9, -0.2, 2.2), 160, (0.45, 0.62, 1.0), 0.06)
world = b.sky((0, 0, 0))
tree = world.node_tree
fog = tree.nodes.new("ShaderNodeVolumeScatter")
fog.inputs["Color"].default_value = (0.95, 0.95, 0.95, 1)
fog.inputs["Density"].default_value, fog.inputs["Anisotropy"].default_value = 0.20, 0.35
tree.links.new(fog.outputs[0], b.export.shading.output_of(tree).inputs["Volume"])
b.camera((0.35, -2.15, 1.28), (0.05, 0.6, 0.98), lens=30)
b.finish(__file__)
