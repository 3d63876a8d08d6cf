"""The Cornell box with two matte blocks: light that no mirror and no glass has touched."""

import os
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "scripts", "blender"))
import build as b

SIDE = 2.0

b.start(960, 960)
white = b.principled("white", (0.73, 0.72, 0.70), 1.0, Specular_IOR_Level=0.0)
red = b.principled("red", (0.60, 0.06, 0.05), 1.0, Specular_IOR_Level=0.0)
green = b.principled("green", (0.10, 0.40, 0.10), 1.0, Specular_IOR_Level=0.0)
half = SIDE / 2
for name, material, at, turn in (
        ("floor", white, (0, 0, 0), (0, 0, 0)), ("ceiling", white, (0, 0, SIDE), (180, 0, 0)),
        ("back wall", white, (0, half, half), (90, 0, 0)), ("left wall", red, (-half, 0, half), (0, 90, 0)),
        ("right wall", green, (half, 0, half), (0, -90, 0))):
    b.add_object(name, b.plane(name, SIDE, SIDE), material, at, turn)

b.add_object("lamp", b.plane("lamp", 0.5, 0.5), b.emission("lamp", (28, 23, 17)), (0.0, 0.0, SIDE - 0.001), (180, 0, 0))
b.add_object("tall block", b.box("tall block", (0.6, 0.6, 1.2), 0.004), white, (-0.34, 0.34, 0.6), (0, 0, 18))
b.add_object("short block", b.box("short block", (0.6, 0.6, 0.6), 0.004), white, (0.36, -0.3, 0.3), (0, 0, -16))

b.camera((0, -3.95, 1.0), (0, 0, 1.0), lens=54)
b.finish(__file__)
