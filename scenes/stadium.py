"""A glass ball of ten centimetres in a stadium of two hundred metres: fifty floodlights, a caustic from each."""

import math
import os
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "scripts", "blender"))
import build as b
import numpy as np

b.start(1280, 720)
random = np.random.default_rng(3)


def oval(turn, out):
    """A point of the ground plan: a rounded rectangle round a pitch of 105 m by 68 m, `out` metres beyond it."""
    c, s = math.cos(turn), math.sin(turn)
    x, y = math.copysign(abs(c) ** 0.62, c) * (58 + out), math.copysign(abs(s) ** 0.62, s) * (40 + out)
    return x, y


def ring(name, profile, sides=192):
    """Sweep a profile of (out, height) along the plan, faces flat."""
    shape = b.bmesh.new()
    rows = [[shape.verts.new((*oval(2 * math.pi * i / sides, out), z)) for i in range(sides)] for out, z in profile]
    for lower, upper in zip(rows, rows[1:]):
        for i in range(sides):
            j = (i + 1) % sides
            shape.faces.new((lower[i], lower[j], upper[j], upper[i]))
    mesh = b.bpy.data.meshes.new(name)
    shape.to_mesh(mesh)
    shape.free()
    return mesh


def turf(size=512):
    blades = b.noise(size, size, 40, 3, 1)
    tufts = b.noise(size, size, 6, 4, 2)
    return b.blend((0.16, 0.30, 0.10), (0.36, 0.50, 0.20), np.clip(0.6 * blades + 0.5 * tufts, 0, 1))


grass = b.principled("turf", roughness=0.9, texture=b.image("turf", turf()), Specular_IOR_Level=0.2)
dark = b.principled("turf dark", (0.045, 0.115, 0.025), 0.9, Specular_IOR_Level=0.2)
chalk = b.principled("chalk", (0.78, 0.78, 0.75), 0.9, Specular_IOR_Level=0.1)
concrete = b.principled("concrete", (0.42, 0.42, 0.41), 0.8)
stone = b.principled("plinth", (0.72, 0.71, 0.68), 0.6)
steel = b.metal("steel", (0.56, 0.57, 0.58), 0.3)

# Pitch: mown bands, lines of chalk, and the plinth on the centre spot.
for k in range(-11, 11):
    band = grass if k % 2 else dark
    b.add_object("band", b.plane("band", 6, 80, uv=1.5), band, (k * 6 + 3, 0, 0))
b.add_object("ground", b.plane("ground", 260, 220), dark, (0, 0, -0.02))
line = 0.12
for name, w, d, x, y in (("halfway line", line, 68, 0, 0), ("touchline", 105, line, 0, 34), ("touchline", 105, line, 0, -34),
                         ("goal line", line, 68, 52.5, 0), ("goal line", line, 68, -52.5, 0)):
    b.add_object(name, b.plane(name, w, d), chalk, (x, y, 0.004))
b.add_object("centre circle", b.lathe("centre circle", [(9.09, 0), (9.21, 0)], 256, sharp=0), chalk, (0, 0, 0.004))
b.add_object("plinth", b.box("plinth", (0.62, 0.62, 0.20), 0.012, 4), stone, (0, 0, 0.10), (0, 0, 28))
b.add_object("ball", b.sphere("ball", 0.05, 7), b.glass("glass", 1.52), (0, 0, 0.25005))

# Stands in two tiers, stepped; seats in blocks of colour; a roof.
lower = [(4.0, 0.0)]
for k in range(22):
    lower += [(4.0 + 0.85 * k, 1.2 + 0.42 * k), (4.85 + 0.85 * k, 1.2 + 0.42 * k)]
upper = [(20.0, 13.5)]
for k in range(22):
    upper += [(20.0 + 0.8 * k, 14.5 + 0.55 * k), (20.8 + 0.8 * k, 14.5 + 0.55 * k)]
b.add_object("lower tier", ring("lower tier", lower), concrete)
b.add_object("upper tier", ring("upper tier", upper), concrete)
b.add_object("outer wall", ring("outer wall", [(38, 0), (38, 32)]), concrete)
b.add_object("roof", ring("roof", [(12, 34.0), (12, 34.5), (40, 32.5), (40, 32.0), (12, 34.0)]), steel)
paints = [b.principled(f"seats {k}", c, 0.5) for k, c in enumerate(((0.10, 0.17, 0.36), (0.55, 0.09, 0.07), (0.66, 0.64, 0.60)))]
seat = [b.box("seats", (1, 0.5, 0.55), 0.05, 1) for _ in paints]
for mesh, paint in zip(seat, paints):
    mesh.materials.append(paint)
for tier, count, first, run, rise in (("lower", 22, 4.45, 0.85, 0.42), ("upper", 22, 20.4, 0.8, 0.55)):
    base = 1.2 if tier == "lower" else 14.5
    for k in range(0, count):
        for i in range(60):
            turn = 2 * math.pi * (i + 0.5) / 60
            x, y = oval(turn, first + run * k)
            x1, y1 = oval(turn - 0.05, first + run * k)
            x2, y2 = oval(turn + 0.05, first + run * k)
            length = math.hypot(x2 - x1, y2 - y1)
            pick = 2 if i % 5 == 0 else (0 if (i // 5 + k // 11) % 2 else 1)
            b.add_object("seats", seat[pick], None, (x, y, base + rise * k + 0.28), (0, 0, math.degrees(math.atan2(y2 - y1, x2 - x1))), (length * 0.88, 1, 1))

# Fifty floodlights under the rim of the roof, all aimed at the pitch.
housing = b.box("floodlight", (1.3, 0.5, 1.0), 0.05, 2)
face = b.plane("floodlight face", 1.1, 0.8)
face.materials.append(b.emission("floodlight face", (22, 21, 19)))
for k in range(50):
    x, y = oval(2 * math.pi * (k + 0.5) / 50, 11.2)
    aim = (0.12 * x * random.random(), 0.12 * y * random.random(), 0)
    b.spot(f"floodlight {k}", (x * 0.992, y * 0.992, 33.2), aim, 9000, 80, (1.0, 0.97, 0.91), 0.5, 0.25)
    turned = (b.Vector(aim) - b.Vector((x, y, 33.2))).to_track_quat("-Z", "Y").to_matrix().to_4x4()
    there = b.Matrix.Translation((x, y, 33.2)) @ turned
    b.add_object("floodlight", housing, steel).matrix_world = there @ b.Matrix.Translation((0, 0, 0.85)) @ b.Matrix.Rotation(math.pi / 2, 4, "X")
    b.add_object("floodlight face", face, None).matrix_world = there @ b.Matrix.Translation((0, 0, 0.55)) @ b.Matrix.Rotation(math.pi, 4, "X")

b.sky((0.012, 0.018, 0.036))
b.camera((-0.44, -0.215, 0.372), (0.5, 0.255, 0.408), lens=20)
b.camera((-0.32, -0.16, 0.45), (0.02, 0.01, 0.22), lens=50, name="Close up")
b.finish(__file__)
