"""Breakfast outdoors under sun and sky: skimmed milk in a glass and in a bottle scatters light, tea and honey absorb it."""

import math
import os
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "scripts", "blender"))
import build as b
import numpy as np

b.start(1280, 720)
random = np.random.default_rng(17)


def gingham(size=256):
    """Squares of a woven check, the thread in them."""
    y, x = np.mgrid[0:size, 0:size] / size
    warp, weft = (x * 4 % 1 < 0.5) * 1.0, (y * 4 % 1 < 0.5) * 1.0
    color = b.blend((0.84, 0.83, 0.79), (0.50, 0.08, 0.09), (warp + weft) / 2)
    return color * (0.9 + 0.1 * np.sin(x * size * np.pi / 2) * np.sin(y * size * np.pi / 2))[..., None]


def weathered(size=384):
    grain = b.noise(size, size, 2, 7, 4, (28, 1))
    return b.blend((0.36, 0.32, 0.27), (0.64, 0.59, 0.52), np.clip(1.5 * grain - 0.25, 0, 1))


cloth = b.principled("gingham", roughness=0.95, texture=b.image("gingham", gingham()), Specular_IOR_Level=0.1)
wood = b.principled("weathered", roughness=0.7, texture=b.image("weathered", weathered()))
china = b.principled("china", (0.83, 0.81, 0.77), 0.1)
biscuit = b.principled("biscuit", (0.62, 0.38, 0.17), 0.85, Specular_IOR_Level=0.2)
foil = b.metal("foil", (0.86, 0.87, 0.88), 0.25)
steel = b.metal("steel", (0.68, 0.67, 0.65), 0.1)
glass = b.glass("glass", 1.52)
glass["caustique"] = {"priority": 1}
tea, honey = b.glass("tea", 1.333, absorption=(9, 42, 160)), b.glass("honey", 1.49, absorption=(6, 35, 230))

# Skimmed milk (scattering and absorption per metre as measured, isotropic): the reduced coefficients.
milk = b.principled("milk", (1, 1, 1), 0.0, IOR=1.345, Transmission_Weight=1.0)
tree = milk.node_tree
both = tree.nodes.new("ShaderNodeAddShader")
for slot, kind, color, density in ((0, "ShaderNodeVolumeScatter", (700 / 1900, 1220 / 1900, 1.0), 1900), (1, "ShaderNodeVolumeAbsorption", (1 - 1.4 / 14.2, 1 - 2.5 / 14.2, 0), 14.2)):
    node = tree.nodes.new(kind)
    node.inputs["Color"].default_value, node.inputs["Density"].default_value = (*color, 1), density
    tree.links.new(node.outputs[0], both.inputs[slot])
tree.links.new(both.outputs[0], b.export.shading.output_of(tree).inputs["Volume"])

for k in range(9):
    b.add_object("plank", b.box("plank", (2.4, 0.138, 0.03), 0.004, 2, uv=0.7), wood, (0, (k - 3.5) * 0.142, -0.015 - 0.003), (0, 0, 0))
drape = b.sheet("cloth", 72, 48, lambda u, v: ((u - 0.5) * 0.95, (v - 0.5) * 0.60, 0.0018 + 0.0014 * math.sin(19 * u + 3 * math.sin(9 * v)) * math.sin(math.pi * v)), uv=True)
for loop in drape.uv_layers[0].data:
    loop.uv = (loop.uv[0] * 4, loop.uv[1] * 2.5)
b.add_object("cloth", drape, cloth, (0.03, -0.02, 0), (0, 0, 11))
Z = 0.0035


def vessel(name, outside, inside, level, liquid, at, sides=64):
    """A glass and its filling, which reaches half a millimetre into the wall."""
    b.add_object(name, b.lathe(name, outside + inside[::-1], sides), glass, (*at, Z))
    low = [(r + 0.0005 * (r > 0), z - 0.0005) for r, z in inside if z < level]
    edge = float(np.interp(level, [z for _, z in inside], [r for r, _ in inside])) + 0.0005
    b.add_object(name + " filling", b.lathe(name + " filling", low + [(edge, level), (0, level)], sides), liquid, (*at, Z))


vessel("tall glass", b.rounded([(0, 0), (0.029, 0), (0.036, 0.135)], 0.004, 4), b.rounded([(0, 0.010), (0.0265, 0.010), (0.0342, 0.135)], 0.006, 4), 0.108, milk, (-0.06, -0.08))
vessel("bottle", b.rounded([(0, 0), (0.041, 0), (0.041, 0.125), (0.0195, 0.185), (0.0195, 0.21), (0.0225, 0.213), (0.0225, 0.222), (0.0185, 0.224)], 0.016, 6),
       b.rounded([(0, 0.006), (0.0378, 0.006), (0.0378, 0.124), (0.0165, 0.184), (0.0165, 0.223)], 0.016, 6), 0.135, milk, (-0.185, 0.06))
vessel("tea glass", b.rounded([(0, 0), (0.022, 0), (0.029, 0.03), (0.021, 0.055), (0.030, 0.088)], 0.015, 6), b.rounded([(0, 0.006), (0.0195, 0.006), (0.0268, 0.03), (0.0188, 0.055), (0.0285, 0.088)], 0.015, 6), 0.076, tea, (0.125, -0.045))
vessel("jar", b.rounded([(0, 0), (0.036, 0), (0.036, 0.062), (0.030, 0.072), (0.030, 0.085)], 0.008, 5), b.rounded([(0, 0.004), (0.0335, 0.004), (0.0335, 0.061), (0.0275, 0.071), (0.0275, 0.085)], 0.008, 5), 0.056, honey, (0.215, 0.09))
b.add_object("cap", b.lathe("cap", b.rounded([(0, 0.0045), (0.0245, 0.0045), (0.0252, -0.010), (0.0235, -0.010), (0.0228, 0.0025), (0, 0.0025)], 0.002, 3), 48), foil, (-0.185, 0.06, Z + 0.2225))
b.add_object("saucer", b.lathe("saucer", b.rounded([(0, 0), (0.035, 0), (0.062, 0.010), (0.061, 0.013), (0.034, 0.004), (0, 0.004)], 0.01, 5), 56), china, (0.125, -0.045, Z - 0.0042))
b.add_object("plate", b.lathe("plate", b.rounded([(0, 0), (0.06, 0), (0.098, 0.014), (0.097, 0.0175), (0.059, 0.004), (0, 0.004)], 0.02, 5), 64), china, (0.045, 0.125, Z))
round_one = b.lathe("biscuit", b.rounded([(0, 0), (0.028, 0), (0.030, 0.008), (0.026, 0.011), (0, 0.012)], 0.003, 3), 40)
for k, (x, y, lean) in enumerate(((0.015, 0.12, 0), (0.073, 0.14, 0), (0.045, 0.095, 0), (0.04, 0.135, 7))):
    b.add_object("biscuit", round_one, biscuit, (x, y, Z + 0.0045 + 0.0145 * (k == 3)), (lean, 0, 40 * k))
b.add_object("biscuit", round_one, biscuit, (-0.005, -0.175, Z + 0.0004), (0, 0, 15))
b.add_object("spoon", b.tube("spoon", b.arc([(0, 0, 0), (0.06, 0, 0.004), (0.13, 0, 0.002)], 0.03, 4), 0.0022, 10), steel, (0.15, -0.15, Z + 0.002), (0, 0, 24))
b.add_object("spoon bowl", b.sphere("spoon bowl", 1.0, 4), steel, (0.138, -0.155, Z + 0.0035), (0, 0, 24), (0.019, 0.013, 0.003))

# The garden behind: a lawn, and a hedge of a few hundred blunt leaves, out of focus.
b.add_object("lawn", b.plane("lawn", 60, 60), b.principled("lawn", (0.13, 0.24, 0.05), 0.9, Specular_IOR_Level=0.1), (0, 0, -0.74))
leaf, greens = b.sphere("leaf", 1.0, 2), [b.principled(f"leaf {k}", c, 0.6) for k, c in enumerate(((0.07, 0.17, 0.03), (0.12, 0.25, 0.05), (0.20, 0.32, 0.08)))]
leaves = [leaf.copy() for _ in greens]
for k in range(420):
    b.add_object("leaf", leaves[k % 3], greens[k % 3], (random.uniform(-5, 5), 4.6 + random.uniform(-0.5, 0.5), random.uniform(-0.7, 1.3)), tuple(random.uniform(0, 360, 3)), (0.24, 0.15, 0.05))
b.add_object("hedge", b.box("hedge", (12, 0.7, 1.9)), greens[0], (0, 4.9, 0.15))

b.sun("sun", (-0.58, -0.44, -0.68), 4.6, (1.0, 0.92, 0.80))
b.dome(lambda x, y, z: b.blend((0.62, 0.72, 0.84), (0.14, 0.26, 0.52), np.clip(z, 0, 1) ** 0.6) * (1 + 3 * np.clip(0.58 * x + 0.44 * y + 0.68 * z, 0, 1) ** 12)[..., None])
b.camera((0.06, -0.76, 0.28), (0.010, 0.0, 0.090), lens=46, fstop=5.6, focus=(-0.02, -0.06, 0.08))
b.finish(__file__)
