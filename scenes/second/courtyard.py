"""A cloistered court at noon: columns and arches, clipped box and an orange tree, and a shallow basin whose ripples light its stone and the arcade."""

import math
import os
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "scripts", "blender"))
import build as b
import numpy as np

b.start(1280, 720)
random = np.random.default_rng(31)
COURT, WALK, BAY, SPRING, CORNICE = 9.0, 2.6, 1.8, 2.35, 3.75


def flags(size=512):
    """Square slabs, half of them a shade darker, worn at their joints."""
    y, x = np.mgrid[0:size, 0:size] / size * 4
    odd = (np.floor(x) + np.floor(y)) % 2
    edge = np.minimum(np.minimum(x % 1, 1 - x % 1), np.minimum(y % 1, 1 - y % 1))
    color = b.blend((0.72, 0.64, 0.52), (0.62, 0.50, 0.40), odd) * (0.72 + 0.5 * b.noise(size, size, 6, 6, 2))[..., None]
    return color * (0.6 + 0.4 * np.clip((edge - 0.008) / 0.02, 0, 1))[..., None]


def render(size=256):
    return b.blend((0.70, 0.52, 0.36), (0.84, 0.70, 0.54), b.noise(size, size, 3, 6, 5))


paving = b.principled("flags", roughness=0.65, texture=b.image("flags", flags()))
wall = b.principled("render", roughness=0.95, texture=b.image("render", render()), Specular_IOR_Level=0.1)
stone = b.principled("limestone", (0.72, 0.66, 0.56), 0.7)
tile = b.principled("roof tile", (0.46, 0.20, 0.11), 0.7)
azulejo = b.principled("glaze", (0.14, 0.36, 0.46), 0.15)
terracotta = b.principled("terracotta", (0.50, 0.23, 0.13), 0.75)
bark = b.principled("bark", (0.20, 0.14, 0.09), 0.9)
orange = b.principled("orange", (0.85, 0.33, 0.03), 0.45)
greens = [b.principled(f"leaf {k}", c, 0.45) for k, c in enumerate(((0.06, 0.14, 0.035), (0.10, 0.21, 0.05)))]
dark = b.principled("door", (0.10, 0.17, 0.16), 0.5)

# The ground, and the walks' outer walls on three sides.
b.add_object("ground", b.plane("ground", 30, 30, uv=2.4), paving, (0, 0, 0))
edge = COURT / 2 + WALK
for name, at, turn in (("back wall", (0, edge), 0), ("left wall", (-edge, 0), 90), ("right wall", (edge, 0), -90)):
    b.add_object(name, b.plane(name, 2 * edge + 6, 5.6, uv=2.0), wall, (*at, 2.8), (90, 0, turn))
for x, y, turn in ((-1.8, edge - 0.02, 0), (3.0, edge - 0.02, 0), (-edge + 0.02, 0.9, 90)):
    b.add_object("door", b.box("door", (1.1, 0.08, 2.3), 0.02, 1), dark, (x, y, 1.15), (0, 0, turn))
    b.add_object("jamb", b.box("jamb", (1.4, 0.05, 2.46), 0.02, 1), stone, (x, y, 1.23), (0, 0, turn))

# Arcades: bays of a round arch cut from a wall 30 cm thick, on columns; a cornice, and a roof that slopes to the court.
outline = [(BAY / 2, SPRING)] + [(0.72 * math.cos(t), SPRING + 0.72 * math.sin(t)) for t in np.linspace(0, math.pi, 21)] + [(-BAY / 2, SPRING), (-BAY / 2, CORNICE), (BAY / 2, CORNICE)]
shape = b.bmesh.new()
front = [shape.verts.new((x, -0.15, z)) for x, z in outline]
back = [shape.verts.new((x, 0.15, z)) for x, z in outline]
shape.faces.new(front)
shape.faces.new(back[::-1])
for k in range(len(outline)):
    m = (k + 1) % len(outline)
    shape.faces.new((front[m], front[k], back[k], back[m]))
arch = b.finish_mesh("arch", shape, smooth=False, uv=2.0)
column = b.lathe("column", b.rounded([(0, 0.12), (0.17, 0.12), (0.17, 0.18), (0.135, 0.22), (0.125, 1.2), (0.108, 2.1), (0.15, 2.2), (0.17, 2.23), (0, 2.23)], 0.02, 3), 28)
plinth, abacus = b.box("plinth", (0.42, 0.42, 0.12), 0.012, 1), b.box("abacus", (0.40, 0.40, 0.12), 0.012, 1)
for place, turn in (((0, COURT / 2), 0), ((-COURT / 2, 0), 90), ((COURT / 2, 0), -90)):
    side = b.Matrix.Translation((*place, 0)) @ b.Matrix.Rotation(math.radians(turn), 4, "Z")
    for k in range(5):
        b.add_object("arch", arch, wall).matrix_world = side @ b.Matrix.Translation(((k - 2) * BAY, 0, 0))
    for k in range(6):
        for name, mesh, z in (("plinth", plinth, 0.06), ("column", column, 0), ("abacus", abacus, 2.29)):
            b.add_object(name, mesh, stone).matrix_world = side @ b.Matrix.Translation(((k - 2.5) * BAY, 0, z))
    b.add_object("cornice", b.box("cornice", (COURT + 0.5, 0.46, 0.14), 0.03, 2), stone).matrix_world = side @ b.Matrix.Translation((0, 0, CORNICE + 0.07))
    b.add_object("roof", b.box("roof", (COURT + 2 * WALK, WALK + 0.75, 0.10)), tile).matrix_world = side @ b.Matrix.Translation((0, 1.0, 4.3)) @ b.Matrix.Rotation(math.radians(16), 4, "X")
    half = b.lathe("ridge", [(0.075, 0), (0.075, 3.45)], 10)
    for k in range(44):
        b.add_object("ridge", half, tile).matrix_world = side @ b.Matrix.Translation(((k - 21.5) * 0.22, -0.68, 3.87)) @ b.Matrix.Rotation(math.radians(-74), 4, "X")

# The basin: a low rim of limestone, a glazed floor, water 20 cm deep that reaches a centimetre into the stone.
SIDE, LEVEL = 2.6, 0.30
for turn in range(4):
    spin = b.Matrix.Rotation(math.pi / 2 * turn, 4, "Z")
    b.add_object("rim", b.box("rim", (SIDE + 0.52, 0.26, 0.42), 0.02, 2), stone).matrix_world = spin @ b.Matrix.Translation((0, SIDE / 2 + 0.13, 0.211 - 0.001 * (turn % 2)))
b.add_object("basin floor", b.plane("basin floor", SIDE, SIDE), azulejo, (0, 0, 0.10))
b.add_object("foot", b.lathe("foot", b.rounded([(0, 0.10), (0.20, 0.10), (0.10, 0.25), (0.075, 0.70), (0.14, 0.80), (0, 0.80)], 0.04, 4), 40), stone)
b.add_object("bowl", b.lathe("bowl", b.rounded([(0, 0.78), (0.12, 0.78), (0.46, 0.96), (0.47, 1.00), (0.43, 1.00), (0.11, 0.83), (0, 0.82)], 0.04, 5), 64), stone)
drops = [(0.52 * math.cos(t), 0.52 * math.sin(t), p) for t, p in zip(random.uniform(0, 2 * math.pi, 7), random.uniform(0, 6.3, 7))]


def ripple(u, v):
    x, y = (u - 0.5) * (SIDE + 0.02), (v - 0.5) * (SIDE + 0.02)
    height = 0.0012 * math.sin(5.1 * x + 2.2 * y) + 0.0010 * math.sin(-3.3 * x + 7.4 * y + 1)
    for dx, dy, phase in drops:
        r = math.hypot(x - dx, y - dy)
        height += 0.0026 * math.sin(38 * r + phase) * math.exp(-1.9 * r) * min(r * 8, 1)
    return x, y, LEVEL + height


water = b.glass("water", 1.333, absorption=(0.42, 0.075, 0.035))
b.add_object("water", b.sheet("water", 100, 100, ripple, bottom=0.09), water)
still = b.lathe("bowl water", b.rounded([(0, 0.8205), (0.108, 0.8305), (0.415, 0.985), (0, 0.985)], 0.0005, 1), 64)
b.add_object("bowl water", still, water)

# Greenery: one tuft of leaves, many times: hedges of box round the court, an orange tree in each front corner, pots.
def tuft(name, count, size, spread):
    shape = b.bmesh.new()
    for _ in range(count):
        turn = b.Matrix.Translation(b.Vector(random.normal(0, 1, 3)).normalized() * spread * random.random() ** 0.4) @ b.Vector(random.normal(0, 1, 3)).to_track_quat("Z", "Y").to_matrix().to_4x4()
        shape.faces.new([shape.verts.new(turn @ b.Vector(p)) for p in ((-0.5 * size, 0, 0), (0, -size, 0.1 * size), (0.5 * size, 0, 0), (0, size, 0.1 * size))])
    return b.finish_mesh(name, shape, smooth=False)


box_leaf = [tuft(f"box {k}", 215, 0.028, 0.22) for k in range(2)]
tree_leaf = [tuft(f"orange leaf {k}", 170, 0.055, 0.32) for k in range(2)]
for mesh, green in zip(box_leaf + tree_leaf, greens * 2):
    mesh.materials.append(green)
core = b.box("hedge core", (1, 1, 1), 0.1, 1)
for x, y, long, turn in ((-2.9, 1.35, 2.3, 90), (2.9, 1.35, 2.3, 90), (-2.1, 2.75, 1.9, 0), (2.1, 2.75, 1.9, 0)):
    b.add_object("hedge core", core, greens[0], (x, y, 0.26), (0, 0, turn), (long, 0.30, 0.5))
    for k in range(int(long / 0.16)):
        for out, up in ((-0.12, 0.18), (0.12, 0.18), (-0.1, 0.44), (0.1, 0.44)):
            along = (k + 0.5) * 0.16 - long / 2
            at = (x + along, y + out, up) if turn == 0 else (x + out, y + along, up)
            b.add_object("box", box_leaf[(k + (up > 0.3)) % 2], None, at, tuple(random.uniform(0, 360, 3)), (0.72,) * 3)
fruit = b.sphere("orange", 0.042, 3)
for x, y in ((-2.9, 2.75), (2.9, 2.75)):
    b.add_object("trunk", b.tube("trunk", [(0, 0, 0), (0.02, 0.01, 0.8), (-0.02, 0.02, 1.35), (0.03, 0, 1.9)], 0.05, 10), bark, (x, y, 0))
    for k in range(36):
        away = b.Vector(random.normal(0, 1, 3)).normalized() * 0.72 * random.random() ** 0.33
        b.add_object("orange leaf", tree_leaf[k % 2], None, (x + away.x, y + away.y, 2.05 + 0.85 * away.z), tuple(random.uniform(0, 360, 3)))
    for k in range(14):
        away = b.Vector(random.normal(0, 1, 3)).normalized() * 0.90
        b.add_object("orange", fruit, orange, (x + away.x, y + away.y, 2.0 + 0.85 * away.z))
pot = b.lathe("pot", b.rounded([(0, 0), (0.15, 0), (0.22, 0.34), (0.24, 0.34), (0.24, 0.39), (0.205, 0.39), (0.19, 0.33), (0, 0.33)], 0.012, 3), 40)
for x, y in ((-1.78, -1.72), (1.78, -1.72)):
    b.add_object("pot", pot, terracotta, (x, y, 0))
    for k in range(9):
        b.add_object("box", box_leaf[k % 2], None, (x + random.normal(0, 0.08), y + random.normal(0, 0.08), 0.50 + 0.028 * k), tuple(random.uniform(0, 360, 3)), (0.85 - 0.03 * k,) * 3)

b.sun("sun", (0.50, 0.34, -0.80), 5.4, (1.0, 0.93, 0.83))
b.dome(lambda x, y, z: b.blend((0.80, 0.94, 1.12), (0.19, 0.36, 0.76), np.clip(z, 0, 1) ** 0.5) * (1 + 3 * np.clip(-0.5 * x - 0.34 * y + 0.8 * z, 0, 1) ** 16)[..., None])
b.camera((-1.45, -4.9, 1.85), (0.10, 0.9, 1.12), lens=26)
b.finish(__file__)
