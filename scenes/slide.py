"""A lantern slide on a white wall: a spotlight behind painted glass, whose picture is in the colour of its light and not in how much of it there is."""

import colorsys
import os
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "scripts", "blender"))
import numpy as np

import build as b

b.start(960, 720)


def painting(size=256):
    """Panes of saturated colours, all of the same brightest channel, and a rose in the middle."""
    rng = np.random.default_rng(4)
    y, x = np.mgrid[0:size, 0:size] / size - 0.5
    r, a = np.hypot(x, y), np.arctan2(y, x)
    panes = (np.floor((x + 0.5) * 6) + 7 * np.floor((y + 0.5) * 6)).astype(int)
    rose = (50 + np.floor((a + np.pi) / np.pi * 6) + 13 * np.floor(r * 9)).astype(int)
    which = np.where(r < 0.33, rose, panes)
    colors = np.array([colorsys.hsv_to_rgb(h, 0.92, 1.0) for h in rng.random(which.max() + 1)])
    # The corners of the image meet in the middle of the slide.
    return np.roll(colors[which], (size // 2, size // 2), (0, 1))


plaster = b.principled("plaster", (0.75, 0.75, 0.75), 1.0, Specular_IOR_Level=0.0)
b.add_object("wall", b.plane("wall", 4, 4), plaster, (0, 1.6, 0), (90, 0, 0))
b.add_object("floor", b.plane("floor", 6, 6), plaster, (0, 0, -0.8))
slide = b.principled("slide", (1, 1, 1), 0.0, texture=b.image("painting", painting(), quality=95), IOR=1.5, Transmission_Weight=1.0)
b.add_object("slide", b.plane("slide", 0.1, 0.1, uv=0.1), slide, (0, 0.1, 0), (90, 0, 0))
b.add_object("ball", b.sphere("ball", 0.22, 6), b.principled("chalk", (0.7, 0.7, 0.7), 1.0, Specular_IOR_Level=0.0), (0.62, 1.25, -0.58))
b.spot("lantern", (0, 0, 0), (0, 1, 0), 300, 42, blend=0.05, radius=0.0)
b.sky((0.01, 0.012, 0.016))
b.camera((0.55, -1.0, 0.12), (0.0, 1.6, -0.12), lens=35)
b.finish(__file__)
