"""Newton's experiment: the sun through a slit and a prism of flint draws a rainbow on a table; a brilliant behind a window throws sparks of all colours."""

import math
import os
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "scripts", "blender"))
import build as b
from mathutils import Vector

b.start(1280, 720)
FLINT, ABBE = 1.728, 28.4
ARRIVING, DESCENT = -50.0, 6.0


def heading(degrees):
    t = math.radians(degrees)
    return Vector((math.cos(t), math.sin(t), 0))


paper = b.principled("paper", (0.72, 0.71, 0.69), 1.0, Specular_IOR_Level=0.0)
b.add_object("table", b.plane("table", 2.4, 2.4), paper)

# The prism stands at the origin, turned to the angle of minimum deviation: inside it light flies along its base.
side, high = 0.055, 0.075
bend = 2 * math.degrees(math.asin(FLINT / 2)) - 60
along = ARRIVING + bend / 2
planes = [((0, 0, 1), high), ((0, 0, -1), -1e-4)]
planes += [(heading(along + turn), side / math.sqrt(12)) for turn in (90, 210, 330)]
b.add_object("prism", b.polyhedron("prism", planes), b.glass("flint", FLINT, abbe=ABBE))

# The shutter: a slit before the prism, a window before the brilliant.
travel, wide = heading(ARRIVING), heading(ARRIVING + 90)
middle = -side / 3 * heading(along) - 0.22 * travel
slit, window, top = 0.004, (-0.105, 0.013), 0.6
wood = b.principled("shutter", (0.05, 0.045, 0.04), 0.9, Specular_IOR_Level=0.1)


def panel(name, left, right, low, high):
    size = (0.012, right - left, high - low)
    b.add_object(name, b.box(name, size), wood, middle + wide * ((left + right) / 2) + Vector((0, 0, (low + high) / 2)), (0, 0, ARRIVING))


panel("shutter left", -1.1, window[0] - window[1], 0, top)
panel("shutter middle", window[0] + window[1], -slit, 0, top)
panel("shutter right", slit, 1.1, 0, top)
panel("lintel", window[0] - window[1], window[0] + window[1], 0.075, top)
panel("slit's lintel", -slit, slit, 0.1, top)


def through(a, c, d):
    normal = (c - a).cross(d - a).normalized()
    return (normal, normal.dot(a)) if normal.dot(a) > 0 else (-normal, -normal.dot(a))


def ring(radius, degrees, height):
    return heading(degrees) * radius + Vector((0, 0, height))


def brilliant(name):
    """The round brilliant of 57 facets, girdle diameter 1."""
    up, down, half, table, step = math.tan(math.radians(34.5)), math.tan(math.radians(40.8)), 0.0125, 0.56, 22.5
    mean, top = math.cos(math.radians(step)), half + (0.5 - table / 2) * up
    tip = 0.5 * (table / 2 * mean + 0.5)
    tip_height = half + (0.5 - tip * mean) * up
    low = 0.11
    low_height = -half - (0.5 - low * mean) * down
    planes = [((0, 0, 1), top)]
    for main in range(0, 360, 45):
        planes.append(through(ring(0.5, main, half), ring(table / 2, main, top), ring(0.5, main, half) + heading(main + 90)))
        planes.append(through(ring(0.5, main, -half), ring(0, 0, -half - 0.5 * down), ring(0.5, main, -half) + heading(main + 90)))
        planes.append(through(ring(table / 2, main, top), ring(table / 2, main + 45, top), ring(tip, main + step, tip_height)))
        for a, c in ((main, main + step), (main + 45, main + step)):
            planes.append(through(ring(0.5, a, half), ring(0.5, c, half), ring(tip, main + step, tip_height)))
            planes.append(through(ring(0.5, a, -half), ring(0.5, c, -half), ring(low, main + step, low_height)))
            planes.append(through(ring(0.5, a, half), ring(0.5, c, half), ring(0.5, c, -half)))
    return b.polyhedron(name, planes)


# It lies on its side, on culet and girdle.
stone = b.add_object("brilliant", brilliant("brilliant"), b.glass("diamond", 2.417, abbe=55.3), scale=(0.03,) * 3, turn=(41, 0, 205))
b.bpy.context.view_layer.update()
lowest = min((stone.matrix_world @ v.co).z for v in stone.data.vertices)
place = middle + wide * window[0] + travel * 0.36
stone.location = (place.x, place.y, 2e-5 - lowest)

# A card stops the rainbow.
end = heading(ARRIVING + bend + 1)
b.add_object("card", b.box("card", (0.004, 0.17, 0.11), 0.001), paper, end * 0.42 + Vector((0, 0, 0.0551)), (0, 0, ARRIVING + bend + 1))

b.sun("sun", travel - Vector((0, 0, math.tan(math.radians(DESCENT)))), 90.0)
b.sky((0.11, 0.125, 0.15))
b.camera((0.14, -0.54, 0.28), (0.138, -0.024, 0.018), lens=37.5)
b.finish(__file__)
