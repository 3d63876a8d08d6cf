"""Dust in a dark room: a lamp behind slats draws rays in the air, and a glass ball gathers one of them to a bright spike, seen past and through a pane."""

import os
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "scripts", "blender"))
import build as b
from mathutils import Vector

b.start(1280, 720)
WIDE, DEEP, HIGH = 4.0, 4.2, 2.5
wall = b.principled("plaster", (0.46, 0.44, 0.41), 0.9, Specular_IOR_Level=0.2)
for name, size, at, turn in (("floor", (WIDE, DEEP), (0, 0, 0), (0, 0, 0)), ("ceiling", (WIDE, DEEP), (0, 0, HIGH), (180, 0, 0)),
                             ("back wall", (WIDE, HIGH), (0, DEEP / 2, HIGH / 2), (90, 0, 0)), ("front wall", (WIDE, HIGH), (0, -DEEP / 2, HIGH / 2), (90, 0, 180)),
                             ("left wall", (DEEP, HIGH), (-WIDE / 2, 0, HIGH / 2), (90, 0, 90)), ("right wall", (DEEP, HIGH), (WIDE / 2, 0, HIGH / 2), (90, 0, -90))):
    b.add_object(name, b.plane(name, *size), wall, at, turn)

# The lamp in a corner, the slats before it, the ball where its middle ray ends.
lamp, ball = Vector((-1.75, 1.1, 2.3)), Vector((0.05, 0.45, 1.0))
along = (ball - lamp).normalized()
aim = along.to_track_quat("Z", "Y").to_euler()
turn = [angle * 57.29577951308232 for angle in aim]
b.add_object("lamp", b.plane("lamp", 0.22, 0.22), b.emission("lamp", (330, 300, 255)), lamp, turn)
across = Vector((along.y, -along.x, 0)).normalized()
up = along.cross(across)
wood = b.principled("wood", (0.20, 0.13, 0.08), 0.8)
slat = b.box("slat", (1.6, 0.16, 0.02))
for i in range(-2, 4):
    b.add_object("slat", slat, wood, lamp + along * 0.55 + up * (0.21 * (i - 0.5)), turn)

b.add_object("ball", b.sphere("ball", 0.26, 6), b.glass("glass", 1.5), ball)
stand = b.lathe("stand", [(0, 0), (0.24, 0), (0.24, 0.06), (0.08, 0.10), (0.07, 0.66), (0.14, 0.735), (0, 0.735)], 64)
b.add_object("stand", stand, wood, (ball.x, ball.y, 0))
b.add_object("pane", b.box("pane", (1.1, 0.02, 1.5), 0.004), b.glass("pane", 1.5), (0.95, -0.55, 0.95), (0, 0, 8))

world = b.sky((0, 0, 0))
tree = world.node_tree
dust = tree.nodes.new("ShaderNodeVolumeScatter")
dust.inputs["Color"].default_value = (0.95, 0.95, 0.95, 1)
dust.inputs["Density"].default_value, dust.inputs["Anisotropy"].default_value = 0.22, 0.4
tree.links.new(dust.outputs[0], b.export.shading.output_of(tree).inputs["Volume"])
b.camera((0.30, -1.95, 1.25), (0.02, 0.5, 1.05), lens=27)
b.finish(__file__)
