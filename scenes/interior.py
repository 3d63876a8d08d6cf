"""A living room by night, lit only by what ceiling and walls send back: two torchieres and two sconces shine upward."""

import math
import os
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "scripts", "blender"))
import build as b
import numpy as np

b.start(1280, 720)
random = np.random.default_rng(21)
WIDE, DEEP, HIGH = 6.0, 5.0, 2.75


def parquet(size=1024, rows=8):
    """Oak strips in a running bond: each with its own tone, grain along it, dark joints."""
    v, u = np.mgrid[0:size, 0:size] / size
    row = np.floor(v * rows).astype(int)
    along = u * 2 + np.array([0.0, 0.42, 0.17, 0.71, 0.33, 0.88, 0.55, 0.24])[row]
    strip = np.floor(along).astype(int) % 2
    tone = np.random.default_rng(4).random((rows, 2))[row, strip]
    grain = b.noise(size, size, 2, 7, 6, (24, 2))
    figure = 0.5 + 0.5 * np.sin(60 * b.noise(size, size, 2, 4, 8, (8, 1)))
    joint = np.minimum(np.minimum(v * rows % 1, 1 - v * rows % 1), 6 * np.minimum(along % 1, 1 - along % 1))
    color = b.blend((0.38, 0.24, 0.13), (0.66, 0.47, 0.29), np.clip(0.45 * grain + 0.2 * figure + 0.5 * tone, 0, 1))
    return color * (0.3 + 0.7 * np.clip((joint - 0.008) / 0.012, 0, 1))[..., None]


def walnut(size=512):
    grain = b.noise(size, size, 2, 7, 16, (1, 20))
    figure = 0.5 + 0.5 * np.sin(50 * b.noise(size, size, 1, 4, 18, (1, 6)))
    return b.blend((0.20, 0.11, 0.06), (0.46, 0.28, 0.16), np.clip(0.7 * grain + 0.3 * figure, 0, 1))


def kilim(width=512, height=352):
    """A woven rug: stepped diamonds in madder and indigo inside a border."""
    y, x = np.mgrid[0:height, 0:width]
    x, y = np.floor(x / 4) * 4, np.floor(y / 4) * 4
    edge = np.minimum(np.minimum(x, width - 4 - x), np.minimum(y, height - 4 - y))
    step = (np.abs((x - width / 2) % 96 - 48) + np.abs((y - height / 2 + 48) % 96 - 48))
    cream, madder, indigo, ochre = (0.80, 0.73, 0.60), (0.58, 0.20, 0.14), (0.14, 0.20, 0.34), (0.76, 0.54, 0.24)
    color = np.empty((height, width, 3))
    color[:] = madder
    for reach, tint in ((66, cream), (60, indigo), (42, cream), (36, ochre), (18, madder)):
        color[step < reach] = tint
    color[edge < 44] = cream
    color[(edge < 38) & ((np.floor((x + y) / 16) % 2) == 0)] = indigo
    color[edge < 20] = madder
    color[edge < 6] = indigo
    return color * (0.86 + 0.2 * b.noise(height, width, 40, 3, 2))[..., None]


def canvas(width=640, height=448):
    """A painting: dusk over hills, made of layered ridges."""
    y, x = np.mgrid[0:height, 0:width]
    x, y = x / width, y / height
    color = b.blend((0.93, 0.72, 0.50), (0.36, 0.47, 0.60), np.clip(y * 1.3 - 0.25 + 0.15 * b.noise(height, width, 3, 5, 2), 0, 1))
    glow = np.exp(-((x - 0.64) ** 2 + (y - 0.58) ** 2) * 60)
    color = b.blend(color, (1.0, 0.90, 0.66), glow)
    for k, (base, tint) in enumerate(((0.52, (0.60, 0.52, 0.55)), (0.42, (0.42, 0.40, 0.46)), (0.30, (0.26, 0.30, 0.33)), (0.16, (0.15, 0.18, 0.17)))):
        ridge = base + 0.14 * (b.noise(8, width, 3 + k, 6, 30 + k, (1, 1))[0] - 0.5) * 2
        color[y < ridge[None, :]] = tint
    return color * (0.9 + 0.2 * b.noise(height, width, 90, 2, 5))[..., None]


oak = b.principled("oak floor", roughness=0.16, texture=b.image("oak floor", parquet()))
wood = b.principled("walnut", roughness=0.18, texture=b.image("walnut", walnut()))
wall = b.principled("wall paint", (0.66, 0.63, 0.57), 0.9, Specular_IOR_Level=0.2)
accent = b.principled("accent paint", (0.36, 0.46, 0.45), 0.85, Specular_IOR_Level=0.2)
white = b.principled("ceiling", (0.84, 0.83, 0.80), 0.9, Specular_IOR_Level=0.0)
trim = b.principled("trim", (0.80, 0.79, 0.76), 0.35)
brass = b.metal("brass", (0.87, 0.67, 0.36), 0.18)
black = b.principled("black lacquer", (0.012, 0.012, 0.014), 0.05)
linen = b.principled("sofa linen", (0.50, 0.46, 0.40), 0.95, Specular_IOR_Level=0.2)
velvet = b.principled("velvet", (0.42, 0.15, 0.09), 0.8, Specular_IOR_Level=0.3)
teal = b.principled("teal cushion", (0.07, 0.24, 0.26), 0.85, Specular_IOR_Level=0.3)
ochre = b.principled("ochre cushion", (0.62, 0.38, 0.09), 0.85, Specular_IOR_Level=0.3)
porcelain = b.principled("porcelain", (0.80, 0.79, 0.76), 0.06)
celadon = b.principled("celadon glaze", (0.20, 0.40, 0.34), 0.08)
orange = b.principled("orange", (0.80, 0.30, 0.04), 0.4)
leaf_green = b.principled("leaf", (0.05, 0.15, 0.045), 0.3)
soil = b.principled("bark", (0.10, 0.065, 0.04), 0.9)

# The room, its skirting and cornice.
b.add_object("floor", b.plane("floor", WIDE, DEEP, uv=1.1), oak)
b.add_object("ceiling", b.plane("ceiling", WIDE, DEEP), white, (0, 0, HIGH), (180, 0, 0))
for name, span, at, turn, paint in (("back wall", WIDE, (0, DEEP / 2), 0, accent), ("front wall", WIDE, (0, -DEEP / 2), 180, wall),
                                    ("left wall", DEEP, (-WIDE / 2, 0), 90, wall), ("right wall", DEEP, (WIDE / 2, 0), -90, wall)):
    b.add_object(name, b.plane(name, span, HIGH), paint, (*at, HIGH / 2), (90, 0, turn))
    b.add_object("skirting", b.box("skirting", (span, 0.03, 0.11), 0.006), trim, (*at, 0.055), (0, 0, turn))
    b.add_object("cornice", b.box("cornice", (span, 0.10, 0.07), 0.025, 5), trim, (*at, HIGH - 0.035), (0, 0, turn))


def pillow(name, size, power=0.42, columns=64, rows=32):
    """A stuffed cushion: a superellipsoid, round in section and square in plan."""
    def curve(t, e):
        return math.copysign(abs(t) ** e, t)

    def position(u, v):
        a, c = 2 * math.pi * u, math.pi * (v - 0.5)
        plan = abs(math.cos(c)) ** 0.75
        return (size[0] / 2 * plan * curve(math.cos(a), power), size[1] / 2 * plan * curve(math.sin(a), power),
                size[2] / 2 * math.sin(c) * (1 - 0.35 * (abs(math.cos(a) * math.sin(a)) * 2) ** 2 * plan))

    mesh = b.sheet(name, columns, rows, position)
    shape = b.bmesh.new()
    shape.from_mesh(mesh)
    b.bmesh.ops.remove_doubles(shape, verts=shape.verts[:], dist=1e-5)
    b.bpy.data.meshes.remove(mesh)
    return b.finish_mesh(name, shape)


# Sofa before the back wall.
SOFA = (-0.25, 1.93)
for name, size, at in (("sofa base", (2.30, 0.90, 0.20), (0, 0, 0.25)), ("sofa back", (2.30, 0.20, 0.55), (0, 0.36, 0.56)),
                       ("sofa arm", (0.18, 0.92, 0.46), (-1.16, 0, 0.39)), ("sofa arm", (0.18, 0.92, 0.46), (1.16, 0, 0.39))):
    b.add_object(name, b.box(name, size, 0.05, 6), linen, (SOFA[0] + at[0], SOFA[1] + at[1], at[2]))
seat, back = b.box("seat cushion", (1.05, 0.72, 0.17), 0.065, 8), b.box("back cushion", (1.04, 0.19, 0.46), 0.075, 8)
for side in (-1, 1):
    b.add_object("seat cushion", seat, linen, (SOFA[0] + side * 0.53, SOFA[1] - 0.09, 0.43))
    b.add_object("back cushion", back, linen, (SOFA[0] + side * 0.53, SOFA[1] + 0.22, 0.69), (-10, 0, 0))
foot = b.lathe("foot", b.rounded([(0, 0), (0.014, 0), (0.024, 0.15), (0, 0.15)], 0.004), 32, uv=0.8)
for x in (-1.08, 1.08):
    for y in (-0.36, 0.36):
        b.add_object("foot", foot, wood, (SOFA[0] + x, SOFA[1] + y, 0))
cushion = pillow("cushion", (0.48, 0.48, 0.17))
for material, x, lean, turn in ((teal, -0.90, 62, 14), (ochre, -0.60, 58, -8), (velvet, 0.88, 60, -16)):
    mesh = cushion.copy()
    b.add_object("cushion", mesh, material, (SOFA[0] + x, SOFA[1] + 0.0, 0.72), (lean, 0, turn))

# A velvet armchair on the right, turned to the table.
CHAIR = b.Matrix.Translation((1.58, 0.40, 0)) @ b.Matrix.Rotation(math.radians(-68), 4, "Z")
for name, size, at, lean in (("chair seat", (0.66, 0.66, 0.20), (0, 0, 0.36), 0), ("chair back", (0.66, 0.17, 0.58), (0, 0.31, 0.62), -12),
                             ("chair arm", (0.13, 0.66, 0.36), (-0.37, 0.02, 0.43), 0), ("chair arm", (0.13, 0.66, 0.36), (0.37, 0.02, 0.43), 0)):
    body = b.add_object(name, b.box(name, size, 0.06, 8), velvet)
    body.matrix_world = CHAIR @ b.Matrix.Translation(at) @ b.Matrix.Rotation(math.radians(lean), 4, "X")
leg = b.tube("chair leg", [(0, 0, 0), (0, 0, 0.28)], 0.014)
for x in (-0.3, 0.3):
    for y in (-0.26, 0.28):
        body = b.add_object("chair leg", leg, brass)
        body.matrix_world = CHAIR @ b.Matrix.Translation((x, y, 0))

# The rug, every tuft of it geometry.
tufts = b.noise(260, 380, 64, 3, 41)


def pile(u, v):
    height = tufts[min(int(v * 259), 259), min(int(u * 379), 379)]
    border = min(u, 1 - u, v, 1 - v)
    return (u - 0.5) * 2.9, (v - 0.5) * 2.0, 0.004 + min(border * 60, 1) * (0.008 + 0.007 * height)


b.add_object("rug", b.sheet("rug", 232, 160, pile, uv=True), b.principled("rug", roughness=1.0, texture=b.image("rug", kilim()), Specular_IOR_Level=0.0), (-0.10, 0.45, 0), (0, 0, 3))

# A round table of black lacquer on brass legs: the glossy heart of the room.
TABLE = (-0.20, 0.52)
b.add_object("table top", b.lathe("table top", b.rounded([(0, 0), (0.49, 0), (0.50, 0.03), (0, 0.03)], 0.010), 160), black, (*TABLE, 0.40))
for k in range(3):
    turn = math.radians(120 * k + 40)
    ends = [(0.40 * math.cos(turn), 0.40 * math.sin(turn), 0.012), (0.20 * math.cos(turn), 0.20 * math.sin(turn), 0.40)]
    b.add_object("table leg", b.tube("table leg", ends, 0.012), brass, (*TABLE, 0))
b.add_object("table ring", b.torus("table ring", 0.30, 0.008, 96, 16), brass, (*TABLE, 0.21))
bowl = b.lathe("bowl", b.rounded([(0, 0), (0.05, 0), (0.14, 0.065), (0.136, 0.069), (0.045, 0.010), (0, 0.008)], 0.03, 8), 128)
b.add_object("bowl", bowl, celadon, (TABLE[0] + 0.14, TABLE[1] + 0.10, 0.4302))
fruit = b.sphere("orange", 0.038, 5)
for x, y, z in ((0.035, 0.0, 0.048), (-0.03, 0.03, 0.048), (-0.025, -0.036, 0.048), (0.0, 0.0, 0.105)):
    b.add_object("orange", fruit, orange, (TABLE[0] + 0.14 + x, TABLE[1] + 0.10 + y, 0.4302 + z))
cover = [b.principled(f"cover {k}", c, 0.4) for k, c in enumerate((
    (0.45, 0.08, 0.06), (0.07, 0.16, 0.30), (0.60, 0.50, 0.33), (0.10, 0.22, 0.15), (0.70, 0.66, 0.58), (0.62, 0.33, 0.08), (0.06, 0.06, 0.07)))]
paper = b.principled("paper", (0.76, 0.72, 0.62), 0.9, Specular_IOR_Level=0.0)
for k, (w, d, h, c) in enumerate(((0.27, 0.20, 0.028, 4), (0.25, 0.18, 0.022, 1), (0.21, 0.15, 0.025, 0))):
    z = 0.43 + (0.0005, 0.029, 0.0515)[k] + h / 2
    b.add_object("table book", b.box("table book", (w, d, h), 0.0025), cover[c], (TABLE[0] - 0.20, TABLE[1] - 0.08, z), (0, 0, 25 - 13 * k))
cup = b.lathe("cup", b.rounded([(0, 0), (0.024, 0), (0.038, 0.05), (0.036, 0.05), (0.022, 0.005), (0, 0.004)], 0.012, 6), 96)
b.add_object("cup", cup, porcelain, (TABLE[0] + 0.08, TABLE[1] - 0.27, 0.4365))
b.add_object("saucer", b.lathe("saucer", b.rounded([(0, 0), (0.03, 0), (0.07, 0.011), (0.068, 0.013), (0.03, 0.005), (0, 0.005)], 0.01, 6), 96), porcelain, (TABLE[0] + 0.08, TABLE[1] - 0.27, 0.4302))
b.add_object("coffee", b.lathe("coffee", [(0, 0), (0.0335, 0)], 64), b.principled("coffee", (0.05, 0.022, 0.01), 0.05), (TABLE[0] + 0.08, TABLE[1] - 0.27, 0.4765))

# The painting, in a thin brass frame.
b.add_object("painting", b.sheet("painting", 1, 1, lambda u, v: ((u - 0.5) * 1.30, 0, (v - 0.5) * 0.91), uv=True), b.principled("painting", roughness=0.55, texture=b.image("painting", canvas())), (SOFA[0], 2.465, 1.62))
for name, size, at in (("frame side", (0.03, 0.045, 0.97), (-0.665, 0, 0)), ("frame side", (0.03, 0.045, 0.97), (0.665, 0, 0)),
                       ("frame edge", (1.36, 0.045, 0.03), (0, 0, 0.47)), ("frame edge", (1.36, 0.045, 0.03), (0, 0, -0.47))):
    b.add_object(name, b.box(name, size, 0.005), brass, (SOFA[0] + at[0], 2.475, 1.62 + at[2]))

# Bookcase against the right wall, full of books.
CASE_X, CASE_Y, CASE_W, CASE_H = WIDE / 2 - 0.17, 1.35, 1.7, 2.05
for y in (-CASE_W / 2, 0, CASE_W / 2):
    b.add_object("case side", b.box("case side", (0.32, 0.03, CASE_H), 0.003, uv=0.8), wood, (CASE_X, CASE_Y + y, CASE_H / 2))
shelves = [0.08, 0.47, 0.86, 1.25, 1.64, CASE_H - 0.015]
for z in shelves:
    b.add_object("shelf", b.box("shelf", (0.31, CASE_W, 0.028), 0.003, uv=0.8), wood, (CASE_X + 0.002, CASE_Y, z))
b.add_object("case back", b.box("case back", (0.012, CASE_W, CASE_H), uv=0.8), wood, (WIDE / 2 - 0.012, CASE_Y, CASE_H / 2))
books = []
for k, material in enumerate(cover):
    mesh = b.box(f"book {k}", (1, 1, 1), 0.05, 2)
    mesh.materials.append(material)
    books.append(mesh)
for z in shelves[:-1]:
    for half in (-1, 1):
        y, end = CASE_Y + (half - 1) / 2 * CASE_W / 2 + 0.02, 0.0
        end = y + CASE_W / 2 - 0.05 - random.choice((0.02, 0.12, 0.30))
        while y < end:
            thick, tall, deep = random.uniform(0.018, 0.048), random.uniform(0.21, 0.31), random.uniform(0.15, 0.20)
            b.add_object("book", books[random.integers(len(books))], None, (CASE_X - 0.01 - (0.2 - deep) / 2, y + thick / 2, z + 0.015 + tall / 2), scale=(deep, thick - 0.001, tall))
            y += thick
vase = b.lathe("vase", b.rounded([(0, 0), (0.05, 0), (0.085, 0.10), (0.03, 0.20), (0.04, 0.24), (0.036, 0.24), (0.025, 0.2), (0.078, 0.10), (0.045, 0.008), (0, 0.008)], 0.05, 10), 128)
b.add_object("vase", vase, celadon, (CASE_X - 0.01, CASE_Y + 0.42, CASE_H + 0.0002))
b.add_object("vase", vase.copy(), None, (CASE_X - 0.02, CASE_Y + 0.12, CASE_H + 0.0002), scale=(0.7, 0.7, 0.62))

# Curtains on the left, falling in folds.
random_folds = random.uniform(0.7, 1.3, 14)


def drape(u, v):
    folds = 2 * math.pi * 7 * (u + 0.012 * math.sin(5 * v + 9 * u))
    swing = 0.045 * (0.75 + 0.25 * math.cos(3 * math.pi * u)) * (1.15 - 0.3 * v)
    return swing * math.sin(folds) + 0.01 * math.sin(2.3 * folds), (u - 0.5) * 1.35, 0.02 + 2.5 * v


curtain = b.sheet("curtain", 168, 48, drape)
cotton = b.principled("curtain", (0.60, 0.55, 0.47), 0.95, Specular_IOR_Level=0.1)
for y in (0.05, 1.42):
    b.add_object("curtain", curtain, cotton, (-WIDE / 2 + 0.13, y, 0))
b.add_object("curtain rod", b.tube("curtain rod", [(-WIDE / 2 + 0.13, -0.85, 2.54), (-WIDE / 2 + 0.13, 2.25, 2.54)], 0.014), brass)

# A fig in a glazed pot, in the corner behind the sofa's left end.
POT = (-1.93, 2.02)
b.add_object("pot", b.lathe("pot", b.rounded([(0, 0), (0.14, 0), (0.19, 0.34), (0.175, 0.34), (0.16, 0.30), (0, 0.30)], 0.03, 6), 128), porcelain, (*POT, 0))
b.add_object("soil", b.lathe("soil", [(0, 0.305), (0.165, 0.305)], 64), soil, (*POT, 0))


def blade(u, v):
    wide = 0.085 * math.sin(math.pi * v ** 0.75) ** 0.8 * (0.75 + 0.5 * v)
    side = (u - 0.5) * 2
    return side * wide, 0.24 * v, -0.045 * v * v + 0.012 * side * side + 0.006 * math.sin(18 * v) * side * side


leaf = b.sheet("leaf", 10, 24, blade)
for k in range(4):
    turn, lean = 90 * k + 20, 0.10 + 0.10 * random.random()
    high = 1.05 + 0.35 * random.random()
    path = [(math.cos(math.radians(turn)) * lean * s * s * 1.4, math.sin(math.radians(turn)) * lean * s * s * 1.4, 0.28 + s * high) for s in np.linspace(0, 1, 16)]
    b.add_object("trunk", b.tube("trunk", path, 0.010, 12), soil, (*POT, 0))
    for m in range(20):
        s = 0.35 + 0.65 * m / 19
        at = (POT[0] + math.cos(math.radians(turn)) * lean * s * s * 1.4, POT[1] + math.sin(math.radians(turn)) * lean * s * s * 1.4, 0.28 + s * high)
        b.add_object("leaf", leaf, leaf_green, at, (random.uniform(5, 55), random.uniform(-15, 15), 137.5 * m + 40 * k), (random.uniform(0.7, 1.15) * (1.15 - 0.4 * s),) * 3)

# Light: torchieres whose discs look at the ceiling over the rim of an opaque bowl, and sconces with a lamp inside.
shade = b.lathe("torchiere bowl", b.rounded([(0, 0), (0.03, 0), (0.16, 0.10), (0.165, 0.15), (0.16, 0.15), (0.153, 0.105), (0.025, 0.01), (0, 0.01)], 0.02, 8), 128)
disc = b.lathe("torchiere disc", [(0, 0), (0.10, 0)], 64, sharp=0)
disc.flip_normals() if disc.polygons[0].normal.z < 0 else None
glow = b.emission("torchiere disc", (1650, 1270, 860))
stand = b.lathe("torchiere stand", b.rounded([(0, 0), (0.15, 0), (0.15, 0.02), (0.011, 0.035), (0.011, 1.80), (0, 1.80)], 0.008, 4), 64)
for x, y in ((2.35, 2.20), (-2.55, 2.10)):
    b.add_object("torchiere stand", stand, brass, (x, y, 0))
    b.add_object("torchiere bowl", shade, brass, (x, y, 1.79))
    b.add_object("torchiere disc", disc, glow, (x, y, 1.86))
sconce = b.lathe("sconce", b.rounded([(0, 0), (0.05, 0), (0.09, 0.14), (0.085, 0.14), (0.045, 0.008), (0, 0.008)], 0.01, 6), 96)
for y in (-1.3, 0.1):
    b.add_object("sconce", sconce, brass, (WIDE / 2 - 0.11, y, 1.75))
    b.point("sconce lamp", (WIDE / 2 - 0.11, y, 1.835), 55, (1.0, 0.80, 0.56), 0.02)

b.camera((-1.55, -2.36, 1.35), (0.05, 1.35, 0.86), lens=29)
b.finish(__file__)
