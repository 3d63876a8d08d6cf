"""The Cornell box with a mirror sphere and a glass sphere under a small lamp: caustics, and caustics seen in a mirror."""

import os
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "scripts", "blender"))
import build as b

SIDE = 2.0

b.start(960, 960)
white = b.principled("white", (0.73, 0.72, 0.70), 0.9, Specular_IOR_Level=0.0)
red = b.principled("red", (0.60, 0.06, 0.05), 0.9, Specular_IOR_Level=0.0)
green = b.principled("green", (0.10, 0.40, 0.10), 0.9, Specular_IOR_Level=0.0)
half = SIDE / 2
for name, material, at, turn in (
        ("floor", white, (0, 0, 0), (0, 0, 0)), ("ceiling", white, (0, 0, SIDE), (180, 0, 0)),
        ("back wall", white, (0, half, half), (90, 0, 0)), ("left wall", red, (-half, 0, half), (0, 90, 0)),
        ("right wall", green, (half, 0, half), (0, -90, 0))):
    b.add_object(name, b.plane(name, SIDE, SIDE), material, at, turn)

frame = b.principled("frame", (0.25, 0.25, 0.26), 0.4)
b.add_object("lamp frame", b.box("lamp frame", (0.42, 0.42, 0.03), 0.008), frame, (0.0, 0.0, SIDE - 0.015))
b.add_object("lamp", b.plane("lamp", 0.34, 0.34), b.emission("lamp", (62, 52, 38)), (0.0, 0.0, SIDE - 0.0305), (180, 0, 0))

b.add_object("mirror sphere", b.sphere("mirror sphere", 0.42, 6), b.metal("mirror", (0.95, 0.95, 0.96)), (-0.42, 0.38, 0.42))
b.add_object("glass sphere", b.sphere("glass sphere", 0.42, 7), b.glass("glass", 1.5), (0.42, -0.28, 0.42))

b.camera((0, -3.95, 1.0), (0, 0, 1.0), lens=54)
b.finish(__file__)
