"""A studio shot of cosmetics on a sweep: three softboxes in brushed metal, lacquer, clear coat and a heavy bottle of scent."""

import math
import os
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "scripts", "blender"))
import build as b
import numpy as np

b.start(1280, 720)


def brushed(size=256):
    """Fine grooves round the axis as a normal map."""
    slope = (b.noise(size, size, 1, 6, 2, (64, 1)) - 0.5) * 0.20
    normal = np.stack([np.zeros_like(slope), slope, np.ones_like(slope)], -1)
    return normal / np.linalg.norm(normal, axis=-1, keepdims=True) * 0.5 + 0.5


paper = b.principled("sweep", (0.42, 0.20, 0.19), 0.8, Specular_IOR_Level=0.2)
plinth = b.principled("plinth", (0.58, 0.33, 0.30), 0.55)
steel = b.principled("brushed steel", (0.72, 0.71, 0.70), 0.30, Metallic=1.0, Anisotropic=0.75)
gold = b.metal("gold", (0.98, 0.76, 0.42), 0.18)
grooved = b.principled("grooved gold", (0.98, 0.78, 0.48), 0.22, normal=b.image("grooves", brushed(), data=True, quality=92), Metallic=1.0)
black = b.principled("black lacquer", (0.012, 0.011, 0.013), 0.35, Coat_Weight=1.0, Coat_Roughness=0.02)
plum = b.principled("plum lacquer", (0.20, 0.018, 0.06), 0.45, Coat_Weight=1.0, Coat_Roughness=0.03)
wax = b.principled("lipstick", (0.62, 0.05, 0.07), 0.38)
cream = b.principled("cream", (0.86, 0.81, 0.75), 0.6)
powder = b.principled("powder", (0.74, 0.42, 0.34), 0.95, Specular_IOR_Level=0.1)
opal = b.principled("opal", (0.84, 0.82, 0.80), 0.25, Coat_Weight=0.7, Coat_Roughness=0.05)
glass, scent = b.glass("glass", 1.52), b.glass("scent", 1.36, absorption=(3.5, 14, 26))
glass["caustique"] = {"priority": 1}

# The sweep, and two plinths.
sweep = b.sheet("sweep", 2, 40, lambda u, v: ((u - 0.5) * 3.2, *((-1.2 + 1.6 * v / 0.5, 0) if v < 0.5 else (0.4 + 0.3 * math.sin(min((v - 0.5) / 0.25, 1) * math.pi / 2), 0.3 - 0.3 * math.cos(min((v - 0.5) / 0.25, 1) * math.pi / 2) + 4 * max(v - 0.75, 0)))))
b.add_object("sweep", sweep, paper)
for name, radius, high, at in (("plinth", 0.105, 0.035, (-0.07, 0.07)), ("tall plinth", 0.062, 0.075, (0.13, 0.10))):
    b.add_object(name, b.lathe(name, b.rounded([(0, 0), (radius, 0), (radius, high), (0, high)], 0.0025, 3), 96), plinth, (*at, 0.0002))

# The bottle: a slab of glass with rounded edges round a cavity full of scent, a collar, a cap of lacquer.
B = b.Matrix.Translation((-0.075, 0.07, 0.0354)) @ b.Matrix.Rotation(math.radians(-14), 4, "Z")
slab = b.box("bottle", (0.078, 0.040, 0.098), 0.007, 4)
cavity = b.box("cavity", (0.062, 0.0245, 0.076), 0.006, 4)
shape = b.bmesh.new()
shape.from_mesh(slab)
inner = b.bmesh.new()
inner.from_mesh(cavity)
b.bmesh.ops.translate(inner, verts=inner.verts, vec=(0, 0, 0.004))
b.bmesh.ops.reverse_faces(inner, faces=inner.faces)
join = b.bpy.data.meshes.new("lining")
inner.to_mesh(join)
shape.from_mesh(join)
hollow = b.bpy.data.meshes.new("bottle")
shape.to_mesh(hollow)
hollow.shade_smooth()
hollow.set_sharp_from_angle(angle=math.radians(30))
b.add_object("bottle", hollow, glass).matrix_world = B @ b.Matrix.Translation((0, 0, 0.049))
b.add_object("scent", b.box("scent", (0.0626, 0.0251, 0.058), 0.0063, 4), scent).matrix_world = B @ b.Matrix.Translation((0, 0, 0.0437))
b.add_object("straw", b.tube("straw", [(0.004, 0, -0.026), (0, 0, 0.046)], 0.0011, 8), cream).matrix_world = B @ b.Matrix.Translation((0, 0, 0.045))
b.add_object("collar", b.lathe("collar", b.rounded([(0, 0.0981), (0.013, 0.0981), (0.013, 0.108), (0, 0.108)], 0.001, 2), 56), gold).matrix_world = B
b.add_object("cap", b.box("cap", (0.034, 0.034, 0.036), 0.003, 4), black).matrix_world = B @ b.Matrix.Translation((0, 0, 0.1265))

# A jar of cream with a brushed lid, leaning lid in front of it.
jar = b.lathe("jar", b.rounded([(0, 0), (0.030, 0), (0.033, 0.006), (0.033, 0.034), (0.027, 0.034), (0.026, 0.028), (0, 0.028)], 0.004, 5), 80)
b.add_object("jar", jar, opal, (0.035, -0.015, 0.0002))
b.add_object("cream", b.lathe("cream", [(0, 0.0345), (0.003, 0.0335), (0.010, 0.0305), (0.018, 0.0315), (0.0266, 0.030)], 56, sharp=0), cream, (0.035, -0.015, 0.0002))
lid = b.lathe("lid", b.rounded([(0, 0.015), (0.0335, 0.015), (0.0345, 0.014), (0.0345, 0), (0.0325, 0), (0.0315, 0.012), (0, 0.0125)], 0.001, 3), 96)
layer = lid.uv_layers.new()
for loop in lid.loops:
    x, y, z = lid.vertices[loop.vertex_index].co
    layer.data[loop.index].uv = (x * 9, y * 9)
b.add_object("lid", lid, steel, (0.063, -0.060, 0.0308), (62, 0, 28))

# Two lipsticks, one standing open; a compact; a tube of mascara on the tall plinth's foot.
def turned(name, profile, paint, at, lean=(0, 0, 0), sides=64, spin=0.0):
    mesh = b.lathe(name, profile, sides)
    if paint is grooved:
        layer = mesh.uv_layers.new()
        for face in mesh.polygons:
            turns = [math.atan2(mesh.vertices[v].co.y, mesh.vertices[v].co.x) / (2 * math.pi) for v in face.vertices]
            for loop, turn in zip(face.loop_indices, turns):
                layer.data[loop].uv = (turn + (turn < max(turns) - 0.5), mesh.vertices[mesh.loops[loop].vertex_index].co.z * 30)
    b.add_object(name, mesh, paint, at, lean)


foot = (0.13, 0.10, 0.0754)
turned("lipstick base", b.rounded([(0, 0), (0.0115, 0), (0.0115, 0.030), (0, 0.030)], 0.001, 2), black, foot)
turned("lipstick sleeve", b.rounded([(0, 0.0301), (0.0098, 0.0301), (0.0098, 0.048), (0.0085, 0.048), (0.0085, 0.044), (0, 0.044)], 0.0006, 2), grooved, foot)
stick = b.lathe("stick", b.rounded([(0, 0.0445), (0.0080, 0.0445), (0.0080, 0.069), (0.006, 0.0745), (0, 0.076)], 0.003, 4), 48)
for vertex in stick.vertices:
    vertex.co.z -= max(vertex.co.z - 0.055, 0) * 0.40 * (1 + vertex.co.x / 0.008)
b.add_object("stick", stick, wax, foot, (0, 0, 130))
turned("lipstick cap", b.rounded([(0, 0), (0.0115, 0), (0.0115, 0.050), (0.0103, 0.050), (0.0103, 0.002), (0, 0.002)], 0.001, 2), grooved, (0.150, -0.055, 0.0118), (90, 0, 68))
turned("mascara", b.rounded([(0, 0), (0.0085, 0), (0.0085, 0.062), (0.0085, 0.0625), (0, 0.0625)], 0.001, 2), plum, (-0.155, -0.045, 0.0087), (90, 0, 112))
turned("mascara cap", b.rounded([(0, 0.0632), (0.0085, 0.0632), (0.0080, 0.11), (0, 0.11)], 0.0015, 2), gold, (-0.155, -0.045, 0.0087), (90, 0, 112))
turned("compact", b.rounded([(0, 0), (0.036, 0), (0.0365, 0.004), (0.035, 0.008), (0.031, 0.008), (0.0305, 0.006), (0, 0.006)], 0.001, 3), plum, (-0.20, 0.03, 0.0002), sides=80)
turned("powder", [(0, 0.0068), (0.0303, 0.0062)], powder, (-0.20, 0.03, 0.0002))
turned("polish", b.rounded([(0, 0), (0.014, 0), (0.0155, 0.004), (0.0155, 0.030), (0.008, 0.037), (0, 0.037)], 0.003, 4), plum, (0.215, 0.015, 0.0002))
turned("polish cap", b.rounded([(0, 0.0372), (0.0072, 0.0372), (0.0062, 0.070), (0, 0.071)], 0.001, 3), black, (0.215, 0.015, 0.0002))

# Softboxes: a large one from the left, a strip from the right, one overhead; black flags between them.
flag = b.principled("flag", (0.02, 0.02, 0.02), 0.9, Specular_IOR_Level=0.0)
for name, size, at, radiance in (("key", (0.7, 0.9), (-0.95, -0.35, 0.65), (7.0, 6.7, 6.4)), ("strip", (0.18, 0.9), (0.85, -0.15, 0.45), (7.5, 7.4, 7.4)), ("top", (0.8, 0.5), (0.05, 0.15, 1.05), (2.6, 2.5, 2.5))):
    box_at = b.Vector(at)
    turn = (b.Vector((0, 0.05, 0.06)) - box_at).to_track_quat("Z", "Y").to_matrix().to_4x4()
    b.add_object(name, b.plane(name, *size), b.emission(name, radiance)).matrix_world = b.Matrix.Translation(box_at) @ turn
    b.add_object(name + " case", b.box(name + " case", (size[0] + 0.04, size[1] + 0.04, 0.03)), flag).matrix_world = b.Matrix.Translation(box_at) @ turn @ b.Matrix.Translation((0, 0, -0.02))
b.sky((0.04, 0.04, 0.045))
b.camera((0.03, -0.64, 0.215), (0.01, 0.03, 0.068), lens=48, fstop=11, focus=(0.0, 0.03, 0.06))
b.finish(__file__)
