"""Features of glass, water, leaves, and normals of an object's own: relief by bumps and normal maps, coats over frosted
glass, absorption beside a tint, leaves cut out by alpha."""

import math

import bpy  # First, because it brings the others.

import numpy

from .torture_relief import waves
from .torture_stage import feature

CLEAR = {"Base_Color": (1, 1, 1), "Roughness": 0.0, "Transmission_Weight": 1.0}


def _under_the_sky(stage):
    """Light the scene by a sky with a bright half alone, because a small lamp's caustics are noise in Cycles."""
    bpy.data.objects.remove(stage.lamp)
    tree = stage.scene.world.node_tree
    place, ramp = tree.nodes.new("ShaderNodeTexCoord"), tree.nodes.new("ShaderNodeTexGradient")
    turn = tree.nodes.new("ShaderNodeMapping")
    turn.inputs["Rotation"].default_value = (0.4, 0.9, 0.3)
    tree.links.new(place.outputs["Generated"], turn.inputs["Vector"])
    tree.links.new(turn.outputs[0], ramp.inputs["Vector"])
    tree.links.new(ramp.outputs[0], stage.background.inputs["Color"])
    stage.background.inputs["Strength"].default_value = 2.0


def _pool(stage, distance, scale, **inputs):
    """A box of water on the floor, whose faces a bump of noise bends."""
    stage.shape("cube")
    stage.body.scale, stage.body.location = (2.4, 2.4, 0.3), (0, 0, 0.21)
    relief = stage.node("Bump", Distance=distance, Height=stage.node("TexNoise", Scale=scale).outputs[0])
    stage.principled(**{**CLEAR, "IOR": 1.333, "Normal": relief, **inputs})


def _sheet(stage, **inputs):
    """An open sheet above the floor, which a bump of noise bends."""
    _under_the_sky(stage)
    stage.shape("plane")
    stage.body.scale, stage.body.rotation_euler, stage.body.location = (2, 2, 1), (0, 0, 0), (0, 0, 0.3)
    relief = stage.node("Bump", Distance=0.1, Height=stage.node("TexNoise", Scale=4.0).outputs[0])
    stage.principled(**inputs, Normal=relief)


@feature
def water_bump(stage):
    _under_the_sky(stage)
    _pool(stage, 0.1, 4.0)


@feature
def water_bump_fine(stage):
    _under_the_sky(stage)
    _pool(stage, 0.05, 12.0)


@feature
def water_bump_sheet(stage):
    """Water as an open sheet, as artists often model the sea."""
    _sheet(stage, **CLEAR, IOR=1.333)


@feature
def water_bump_opaque(stage):
    """The deep sea: dark, smooth, with a bump."""
    _sheet(stage, Base_Color=(0.01, 0.05, 0.08), Roughness=0.05, IOR=1.333)


def _bent(stage, slope, **inputs):
    node = stage.node("NormalMap", Color=stage.node("TexImage", image=waves(stage, slope)))
    stage.principled(**{**CLEAR, "IOR": 1.5, "Normal": node, **inputs})


@feature
def glass_normal_map(stage):
    _under_the_sky(stage)
    _bent(stage, 0.2)


@feature
def glass_normal_map_strong(stage):
    _under_the_sky(stage)
    _bent(stage, 0.5)


@feature
def glass_normal_map_cube(stage):
    _under_the_sky(stage)
    stage.shape("cube")
    _bent(stage, 0.3)


@feature
def glass_bump(stage):
    _under_the_sky(stage)
    relief = stage.node("Bump", Distance=0.05, Height=stage.node("TexNoise", Scale=4.0).outputs[0])
    stage.surface(stage.node("BsdfGlass", Color=(1, 1, 1), IOR=1.5, Normal=relief))


@feature
def glass_frosted_coated(stage):
    _under_the_sky(stage)
    stage.principled(**{**CLEAR, "Roughness": 0.4, "Coat_Weight": 1.0, "Coat_Roughness": 0.03})


@feature
def glass_frosted_coated_half(stage):
    _under_the_sky(stage)
    stage.principled(**{**CLEAR, "Roughness": 0.6, "Coat_Weight": 0.5, "Coat_Roughness": 0.1, "Coat_IOR": 1.8})


@feature
def glass_coated(stage):
    _under_the_sky(stage)
    stage.principled(**CLEAR, Coat_Weight=1.0, Coat_Roughness=0.0)


@feature
def glass_tinted_absorbing(stage):
    _under_the_sky(stage)
    stage.principled(**{**CLEAR, "Base_Color": (0.9, 0.6, 0.3)})
    stage.output("Volume", stage.node("VolumeAbsorption", Color=(0.4, 0.7, 0.9), Density=1.0))


@feature
def glass_shader_grey_absorbing(stage):
    _under_the_sky(stage)
    stage.surface(stage.node("BsdfGlass", Color=(0.5, 0.5, 0.5), IOR=1.5))
    stage.output("Volume", stage.node("VolumeAbsorption", Color=(0.4, 0.7, 0.9), Density=1.0))


@feature
def glass_shader_tinted_absorbing(stage):
    _under_the_sky(stage)
    stage.surface(stage.node("BsdfGlass", Color=(0.8, 0.9, 0.6), IOR=1.5))
    stage.output("Volume", stage.node("VolumeAbsorption", Color=(0.9, 0.5, 0.2), Density=1.5))


def _leaf_image(stage, soft=False):
    """A green leaf with an alpha that is 1 within a lens shape."""
    v, u = (numpy.mgrid[0:64, 0:64] + 0.5) / 64
    inside = 0.35 * numpy.sin(numpy.pi * v) - abs(u - 0.5)
    alpha = numpy.clip(inside * 8 + 0.5, 0, 1) if soft else (inside > 0).astype(float)
    return stage.image("leaf", numpy.dstack([0.1 + 0.1 * v, 0.4 + 0 * u, 0.05 + 0 * u, alpha]))


def _leaves(stage):
    stage.shape("plane")
    for i in range(1, 6):
        copy = stage.place(f"leaf {i}", stage.body.data, (0.3 * i - 0.9, 0.25 * (i % 3) - 0.2, 0.5 + 0.12 * i))
        copy.rotation_euler = (0.9 - 0.3 * i, 0.4 * i, 1.1 * i)
        copy.scale = (0.7, 0.7, 0.7)
    stage.tree  # The material belongs to the mesh, and so to all leaves.


@feature
def leaves_clipped(stage):
    _leaves(stage)
    image = stage.node("TexImage", image=_leaf_image(stage, True))
    clip = stage.node("Math", image.outputs["Alpha"], 0.5, operation="GREATER_THAN")
    stage.principled(Base_Color=image, Roughness=0.5, Alpha=clip)


@feature
def leaves_translucent(stage):
    _leaves(stage)
    image = stage.node("TexImage", image=_leaf_image(stage))
    front = stage.node("BsdfPrincipled", Base_Color=image, Roughness=0.5)
    through = stage.node("BsdfTranslucent", Color=image)
    body = stage.node("MixShader", 0.4, front.outputs[0], through.outputs[0])
    stage.mix(image.outputs["Alpha"], stage.node("BsdfTransparent", Color=(1, 1, 1)), body)


@feature
def leaves_alpha(stage):
    _leaves(stage)
    image = stage.node("TexImage", image=_leaf_image(stage))
    stage.principled(Base_Color=image, Roughness=0.5, Alpha=image.outputs["Alpha"])


def _own_normals(stage, degrees, **inputs):
    """A sphere whose normals all lean from its faces by this angle."""
    _under_the_sky(stage)
    mesh, lean = stage.body.data, math.tan(math.radians(degrees))
    normals = [corner.vector.copy() for corner in mesh.corner_normals]
    mesh.normals_split_custom_set([(n + lean * n.orthogonal().normalized()).normalized() for n in normals])
    stage.principled(**inputs)


@feature
def own_normals_matt(stage):
    _own_normals(stage, 20, Base_Color=(0.6, 0.6, 0.6), Roughness=0.7)


@feature
def own_normals_polished(stage):
    _own_normals(stage, 20, Base_Color=(0.02, 0.02, 0.02), Roughness=0.05)


@feature
def own_normals_glass(stage):
    _own_normals(stage, 13, **CLEAR)


@feature
def smooth_cube_glass(stage):
    _under_the_sky(stage)
    stage.shape("cube")
    stage.body.data.shade_smooth()
    stage.principled(**CLEAR)
