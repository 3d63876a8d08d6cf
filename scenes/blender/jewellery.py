"""A brilliant, a ring with a smaller one, and a sapphire, under soft boxes: .venv-bpy/bin/python jewellery.py OUT.blend"""

import math

import bpy  # noqa: F401  first, because it brings the others

import bmesh
import numpy
import stage


def brilliant(name, radius, material, at=(0, 0), turn=0.0):
    """A round brilliant of ideal proportions, which lies at a point of the table and shows its table after a turn."""
    def ring(r, z, count, turned):
        turns = (numpy.arange(count) + turned) * 2 * math.pi / count
        return [(r * math.cos(t), r * math.sin(t), z) for t in turns]

    # Heights and radii in units of the girdle's radius: table 57 %, crown 34.5 degrees, pavilion 40.75 degrees.
    depth, girdle = math.tan(math.radians(40.75)), 0.05
    crown = (1 - 0.57) * math.tan(math.radians(34.5))
    low, high, top = depth, depth + girdle, depth + girdle + crown
    middle = high + 0.55 * crown
    points = [*ring(0.57, top, 8, 0.5), *ring(0.80, middle, 8, 0), *ring(1, high, 16, 0), *ring(1, low, 16, 0),
              *ring(0.23, low * 0.22, 8, 0.5), (0, 0, 0)]
    table, star, upper, lower, main, culet = 0, 8, 16, 32, 48, 56
    faces = [tuple(range(8))]
    for i in range(8):
        j, k = (i + 1) % 8, (i - 1) % 8
        faces += [(table + k, star + i, table + i), (table + i, star + i, upper + 2 * i + 1),
                  (table + i, upper + 2 * i + 1, star + j), (star + i, upper + 2 * i, upper + 2 * i + 1),
                  (star + i, upper + (2 * i - 1) % 16, upper + 2 * i), (main + i, main + k, culet),
                  (lower + 2 * i, lower + 2 * i + 1, main + i), (lower + 2 * i, main + i, main + k),
                  (lower + 2 * i, main + k, lower + (2 * i - 1) % 16)]
    faces += [(upper + i, lower + i, lower + (i + 1) % 16, upper + (i + 1) % 16) for i in range(16)]
    scaled = [(x * radius, y * radius, z * radius) for x, y, z in points]
    thing = stage.mesh(name, scaled, faces, material)
    shape = bmesh.new()
    shape.from_mesh(thing.data)
    bmesh.ops.recalc_face_normals(shape, faces=shape.faces)
    shape.to_mesh(thing.data)
    shape.free()
    # It rests on a facet of its pavilion.
    thing.rotation_euler, thing.location = (math.atan(depth), 0, turn), (*at, 0.01 * radius)
    return thing


def soft_boxes(width=256):
    """A dim room with three bright boxes and a strip."""
    v, u = numpy.mgrid[: width // 2, :width] / numpy.array([width // 2, width]).reshape(2, 1, 1)
    room = numpy.dstack([0.03 + 0.05 * v] * 3)
    for x, y, wide, high, colour in ((0.2, 0.75, 0.05, 0.08, (30, 29, 27)), (0.55, 0.8, 0.03, 0.05, (24, 26, 30)),
                                     (0.85, 0.62, 0.02, 0.2, (14, 14, 14)), (0.4, 0.92, 0.3, 0.02, (4, 4, 4))):
        room[(abs(u - x) < wide) & (abs(v - y) < high)] = colour
    return room


stage.empty()
diamond = stage.glass("diamond", 2.417, abbe=55.3)
sapphire = stage.principled("sapphire", abbe=72.0, Roughness=0.0, Transmission_Weight=1.0, IOR=1.77,
                            Base_Color=(0.12, 0.22, 0.85))
gold = stage.principled("gold", Base_Color=(1.0, 0.77, 0.34), Metallic=1.0, Roughness=0.12)
cloth = stage.principled("table", Base_Color=(0.42, 0.39, 0.36), Roughness=0.6)
stage.mesh("table", [(-4, -4, 0), (4, -4, 0), (4, 4, 0), (-4, 4, 0)], [(0, 1, 2, 3)], cloth)

# One unit is a decimetre, so that the stones are some centimetres wide.
brilliant("brilliant", 0.12, diamond, (-0.17, -0.05), 0.25)
brilliant("sapphire", 0.07, sapphire, (0.2, -0.2), -0.5)
stone = brilliant("stone of the ring", 0.045, diamond)
stone.location, stone.rotation_euler = (0.14, 0.1, 0.238), (0.25, 0, 0)
major, minor, across, round_ = 0.11, 0.016, 96, 24
turns = [(2 * math.pi * i / across, 2 * math.pi * j / round_) for i in range(across) for j in range(round_)]
ring = [((major + minor * math.cos(b)) * math.cos(a), minor * math.sin(b), (major + minor * math.cos(b)) * math.sin(a))
        for a, b in turns]
quads = [(i * round_ + j, i * round_ + (j + 1) % round_, (i + 1) % across * round_ + (j + 1) % round_,
          (i + 1) % across * round_ + j) for i in range(across) for j in range(round_)]
stage.mesh("ring", ring, quads, gold, smooth=True).location = (0.14, 0.1, major + minor)
stage.environment("soft boxes", soft_boxes())
stage.lamp("spot light", "SPOT", 45, (-0.5, 0.5, 1.1), (-0.1, -0.05, 0), spot_size=0.5, shadow_soft_size=0.01)
stage.camera((0.05, -0.95, 0.46), (0.0, -0.01, 0.115), 58)
stage.save()
