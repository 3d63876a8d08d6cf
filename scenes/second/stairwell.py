"""Down the well of a winding stair: twenty-three opal globes on four storeys, each of which lights some of the steps and hides from the others."""

import math
import os
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "scripts", "blender"))
import build as b
import numpy as np

b.start(1280, 720)
WELL, WALL, STEPS, TURNS, RISE = 0.95, 2.65, 24, 4, 0.168
STEP = 2 * math.pi / STEPS
LIFT = STEPS * RISE


def terrazzo(size=512):
    """Chips of three stones in a pale ground."""
    color = np.broadcast_to(np.asarray((0.74, 0.71, 0.65)), (size, size, 3))
    for k, tint in enumerate(((0.52, 0.49, 0.46), (0.70, 0.56, 0.47), (0.86, 0.84, 0.80))):
        chips = np.clip((b.noise(size, size, 56, 2, 3 + k) - 0.64) / 0.04, 0, 1)
        color = color * (1 - chips[..., None]) + np.asarray(tint) * chips[..., None]
    return color


def star(size=384):
    """The floor at the bottom: an eight-pointed star in two marbles inside rings."""
    y, x = (np.mgrid[0:size, 0:size] + 0.5) / size - 0.5
    r, a = np.hypot(x, y), np.arctan2(y, x) * 8 / (2 * np.pi) % 1
    point = 0.20 / (1 + 5 * np.minimum(a, 1 - a))
    dark = (r < point * 1.3) ^ (r < 0.06) | (np.abs(r - 0.30) < 0.012) | (np.abs(r - 0.34) < 0.004)
    return np.roll(b.blend((0.78, 0.74, 0.66), (0.12, 0.14, 0.15), dark.astype(float)) * (0.85 + 0.2 * b.noise(size, size, 5, 6, 4))[..., None], (size // 2, size // 2), (0, 1))


tread = b.principled("terrazzo", roughness=0.3, texture=b.image("terrazzo", terrazzo()))
plaster = b.principled("plaster", (0.72, 0.66, 0.55), 0.85, Specular_IOR_Level=0.2)
dado = b.principled("dado", (0.20, 0.30, 0.31), 0.4)
iron = b.principled("iron", (0.02, 0.022, 0.025), 0.35)
oak = b.principled("oak", (0.34, 0.17, 0.07), 0.25, Coat_Weight=0.6, Coat_Roughness=0.08)
brass = b.metal("brass", (0.87, 0.67, 0.36), 0.3)
globe = b.emission("globe", (56, 45, 32))


def helix(radius, height, start=0.0, end=TURNS, per=48):
    t = np.linspace(start, end, int((end - start) * per) + 1)
    return [(radius * math.cos(2 * math.pi * q), radius * math.sin(2 * math.pi * q), q * LIFT + height) for q in t]


def wedge(u, v):
    r, t = WELL + (WALL + 0.02 - WELL) * v, STEP * u
    return r * math.cos(t), r * math.sin(t), 0


step = b.sheet("step", 4, 1, wedge, bottom=-0.30)
slab = b.sheet("tread", 4, 1, lambda u, v: (*(np.asarray(wedge(u * 1.04 - 0.04, v)[:2]) * (1 - 0.012 * (1 - v))), 0), bottom=-0.04)
for mesh in (step, slab):
    layer = mesh.uv_layers.new() if not mesh.uv_layers else mesh.uv_layers[0]
    for loop in mesh.loops:
        layer.data[loop.index].uv = [c / 0.6 for c in mesh.vertices[loop.vertex_index].co[:2]]
nosing = b.box("nosing", (WALL - WELL, 0.035, 0.044), 0.006, 2)
baluster = b.lathe("baluster", b.rounded([(0, 0), (0.018, 0), (0.008, 0.05), (0.008, 0.42), (0.017, 0.46), (0.008, 0.50), (0.008, 0.97), (0, 0.97)], 0.01, 3), 10)
for k in range(STEPS * TURNS):
    height, turn = (k + 1) * RISE, math.degrees(STEP * k)
    b.add_object("step", step, plaster, (0, 0, height - 0.04), (0, 0, turn))
    b.add_object("tread", slab, tread, (0, 0, height), (0, 0, turn))
    b.add_object("nosing", nosing, dado, ((WALL + WELL) / 2 * math.cos(STEP * k), (WALL + WELL) / 2 * math.sin(STEP * k), height - 0.021), (0, 0, turn))
    for part in (0.25, 0.75):
        t = STEP * (k + part)
        b.add_object("baluster", baluster, iron, ((WELL + 0.05) * math.cos(t), (WELL + 0.05) * math.sin(t), height), (0, 0, turn))
b.add_object("handrail", b.tube("handrail", helix(WELL + 0.05, 1.05), 0.032, 14), oak)
b.add_object("wall rail", b.tube("wall rail", helix(WALL - 0.06, 1.05), 0.022, 10), oak)
b.add_object("dado line", b.tube("dado line", helix(WALL - 0.004, 1.35), 0.014, 6), dado)
skirt = b.sheet("skirt", TURNS * 48, 1, lambda u, v: (*helix(WALL - 0.006, 0, u * TURNS, u * TURNS + 1)[0][:2], u * TURNS * LIFT + 0.05 + 1.3 * v))
b.add_object("skirt", skirt, dado)
TOP = TURNS * LIFT + 3.0
b.add_object("wall", b.lathe("wall", [(WALL, -0.01), (WALL, TOP)], 96), plaster)
b.add_object("ceiling", b.lathe("ceiling", [(0, TOP), (WALL, TOP)], 96), plaster)
b.add_object("floor", b.plane("floor", 2 * WALL + 0.1, 2 * WALL + 0.1, uv=2.2), b.principled("star", roughness=0.2, texture=b.image("star", star())))

# Four globes a turn on the wall, and a chain of seven down the middle of the well.
ball, arm = b.sphere("globe", 0.10, 4), b.tube("arm", b.arc([(0.24, 0, -0.16), (0.0, 0, -0.20), (0, 0, -0.09)], 0.06, 6), 0.011, 10)
collar = b.lathe("collar", b.rounded([(0, -0.115), (0.045, -0.105), (0.05, -0.085), (0.03, -0.075), (0, -0.075)], 0.006, 3), 32)
for k in range(4 * TURNS):
    turn = k / 4 + 0.11
    at = helix(WALL - 0.22, 2.1, turn, turn + 1)[0]
    b.add_object("globe", ball, globe, at)
    b.add_object("arm", arm, brass, at, (0, 0, 360 * turn))
    b.add_object("collar", collar, brass, at)
b.add_object("cable", b.tube("cable", [(0, 0, 2.6), (0, 0, TOP)], 0.006, 8), iron)
for k in range(7):
    at = (0, 0, 2.5 + 2.1 * k)
    b.add_object("globe", ball, globe, at, (0, 0, 0), (1.2,) * 3)
    b.add_object("cap", collar, brass, at, (180, 0, 0), (1.2,) * 3)
b.camera((0.42, -0.50, TURNS * LIFT + 1.3), (-0.42, 0.36, 6.5), lens=18)
b.finish(__file__)
