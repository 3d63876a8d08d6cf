"""A glass of water with ice beside a pool with waves, in the sun: .venv-bpy/bin/python water.py OUT.blend"""

import math

import bpy  # First, because it brings the others.

import numpy
import stage


def waves(side=2.6, count=160):
    """A block of water with a wavy top. Its sides and its bottom reach into the walls of the pool."""
    x, y = numpy.meshgrid(*2 * (numpy.linspace(-side / 2, side / 2, count),))
    z = numpy.zeros_like(x)
    for angle, length, height, phase in ((0.3, 0.55, 0.012, 0), (1.4, 0.38, 0.008, 2), (2.5, 0.27, 0.005, 4), (0.9, 0.19, 0.003, 1)):
        z += height * numpy.sin(2 * math.pi / length * (x * math.cos(angle) + y * math.sin(angle)) + phase)
    top = numpy.stack([x, y, z], axis=-1).reshape(-1, 3)
    rim = [*range(count), *range(2 * count - 1, count * count, count), *range(count * count - 2, count * (count - 1) - 1, -1),
           *range(count * (count - 2), 0, -count)]
    bottom = [(top[i][0], top[i][1], -0.62) for i in rim]
    faces = [(r * count + c, r * count + c + 1, (r + 1) * count + c + 1, (r + 1) * count + c)
             for r in range(count - 1) for c in range(count - 1)]
    first = len(top)
    faces += [(rim[i], first + i, first + (i + 1) % len(rim), rim[(i + 1) % len(rim)]) for i in range(len(rim))]
    faces += [tuple(first + i for i in reversed(range(len(rim))))]
    thing = stage.mesh("water of the pool", [*top, *bottom], faces, water)
    for polygon in thing.data.polygons[: (count - 1) ** 2]:
        polygon.use_smooth = True


def tiles():
    """Blue tiles with white joints."""
    material = stage.principled("tiles", Roughness=0.4)
    tree = material.node_tree
    place, brick = tree.nodes.new("ShaderNodeTexCoord"), tree.nodes.new("ShaderNodeTexBrick")
    for name, value in (("Color1", (0.10, 0.38, 0.48)), ("Color2", (0.14, 0.45, 0.55)), ("Mortar", (0.75, 0.75, 0.72))):
        brick.inputs[name].default_value = (*value, 1)
    for name, value in (("Scale", 1.0), ("Brick Width", 0.2), ("Row Height", 0.2), ("Mortar Size", 0.006)):
        brick.inputs[name].default_value = value
    brick.offset = 0.0
    tree.links.new(place.outputs["Object"], brick.inputs["Vector"])
    tree.links.new(brick.outputs["Color"], next(n for n in tree.nodes if n.type == "BSDF_PRINCIPLED").inputs["Base Color"])
    return material


scene = stage.empty()
water, clear = stage.glass("water", 1.333), stage.glass("glass", 1.5)
ice = stage.glass("ice", 1.31)
clear["priority"], ice["priority"], water["priority"] = 3, 2, 1
volume = water.node_tree.nodes.new("ShaderNodeVolumeAbsorption")
volume.inputs["Color"].default_value, volume.inputs["Density"].default_value = (0.35, 0.80, 0.90, 1), 0.4
water.node_tree.links.new(volume.outputs[0], next(n for n in water.node_tree.nodes if n.type == "OUTPUT_MATERIAL").inputs["Volume"])
stone = stage.principled("stone", Base_Color=(0.62, 0.58, 0.52), Roughness=0.7)
blue = tiles()
waves()
stage.box("floor", (-1.3, -1.3, -0.7), (1.3, 1.3, -0.6), blue)
for name, low, high in (("far wall", (-1.6, 1.25, -0.7), (1.6, 1.6, 0.10)), ("left wall", (-1.6, -1.6, -0.7), (-1.25, 1.25, 0.10)),
                        ("right wall", (1.25, -1.6, -0.7), (1.6, 1.25, 0.10)), ("near wall", (-1.25, -1.6, -0.7), (1.25, -1.25, 0.10))):
    stage.box(name, low, high, stone)
at = (0.42, -1.42, 0.10)
tumbler = [(0, 0), (0.062, 0), (0.066, 0.004), (0.078, 0.2), (0.0755, 0.202), (0.073, 0.2), (0.062, 0.016), (0, 0.016)]
stage.lathe("tumbler", tumbler, clear).location = at
# The water reaches into the glass, which has the higher priority.
stage.lathe("water of the tumbler", [(0, 0.012), (0.0625, 0.012), (0.0735, 0.16), (0, 0.16)], water).location = at
for i, (x, y, z) in enumerate(((-0.02, -0.01, 0.135), (0.022, 0.018, 0.125), (0.012, -0.026, 0.15))):
    cube = stage.box(f"ice {i + 1}", (-0.018,) * 3, (0.018,) * 3, ice)
    cube.location, cube.rotation_euler = (at[0] + x, at[1] + y, at[2] + z), (0.4 + i, 0.3 * i, 0.7 * i)
    bevel = cube.modifiers.new("bevel", "BEVEL")
    bevel.width, bevel.segments = 0.004, 3
for thing in bpy.data.objects:
    if thing.name.startswith(("tumbler", "water of the t")):
        thing.data.set_sharp_from_angle(angle=math.radians(30))
v = numpy.mgrid[:64, :128][0] / 63.0
sky = numpy.dstack([0.25 + 0.25 * (1 - v), 0.45 + 0.15 * (1 - v), 0.85 + 0 * v]) * numpy.where(v > 0.5, 1.0, 0.3)[..., None]
stage.environment("sky", sky)
stage.lamp("sun", "SUN", 4.5, (1.6, 1.0, 2.6), angle=math.radians(0.53))
stage.camera((0.30, -2.25, 0.72), (0.20, -0.90, 0.02), 36)
stage.save()
