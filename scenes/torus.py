"""A diffuse torus cast into a block of glass, in the sun: all its light comes through glass and leaves through glass."""

import os
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "scripts", "blender"))
import numpy as np

import build as b

b.start(1280, 720)


def slate(size=1024):
    """Honed stone: soft clouds, fine grain, a few pale veins."""
    clouds = b.noise(size, size, 3, 7, seed=3)
    veins = np.exp(-np.abs(b.noise(size, size, 2, 6, seed=8) - 0.5) * 55)
    grain = b.noise(size, size, 128, 2, seed=5)
    color = b.blend((0.50, 0.48, 0.45), (0.66, 0.63, 0.59), clouds)
    return b.blend(color, (0.80, 0.78, 0.74), veins * 0.35) * (0.94 + 0.12 * grain)[..., None]


stone = b.principled("stone", roughness=0.55, texture=b.image("stone", slate()))
b.add_object("floor", b.plane("floor", 12, 12, uv=0.8), stone)

plaster = b.principled("plaster", (0.62, 0.60, 0.56), 0.9, Specular_IOR_Level=0.2)
b.add_object("wall", b.box("wall", (3.2, 0.12, 0.34), 0.012, uv=None), plaster, (-0.55, 0.62, 0.17), (0, 0, -14))

b.add_object("block", b.box("block", (0.22, 0.22, 0.22), 0.004, 4), b.glass("glass", 1.5, absorption=(0.9, 0.25, 0.4)),
        (0, 0, 0.1101), (0, 0, 24))
b.add_object("torus", b.torus("torus", 0.058, 0.022), b.principled("terracotta", (0.72, 0.20, 0.06), 0.8, Specular_IOR_Level=0.0),
        (0, 0, 0.112), (58, 18, 24))

b.add_object("pebble", b.sphere("pebble", 1.0, 6), b.principled("pebble", (0.82, 0.80, 0.76), 0.35),
        (-0.34, 0.16, 0.043), (0, 0, 30), (0.085, 0.066, 0.043))
b.add_object("brass ball", b.sphere("brass ball", 0.038, 6), b.metal("brass", (0.91, 0.72, 0.38), 0.12), (-0.235, -0.065, 0.038))

b.sun("sun", (0.62, 0.42, -0.72), 3.6, (1.0, 0.93, 0.82))
b.sky((0.20, 0.29, 0.42))
b.camera((0.10, -1.14, 0.50), (0.055, 0.05, 0.085), lens=52)
b.finish(__file__)
