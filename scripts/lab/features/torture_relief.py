"""Features of relief by normal maps: a matt and a metal plane, each under ridges of two slopes, seen at two angles."""

import math

import bpy
import numpy
from mathutils import Vector

from .torture_stage import feature

GENTLE, STEEP = 1.0, 3.0  # slopes of ridges
SLANT, GRAZING = 45.0, 80.0  # degrees between the line of sight and the plane's normal
WIDE = 40  # times the stage's plane, which then fills the view


def waves(stage, steep):
    """A tangent-space normal map of ridges of this slope."""
    v, u = numpy.mgrid[0:64, 0:64] / 64
    normal = numpy.stack([steep * numpy.sin(8 * numpy.pi * u), steep * numpy.cos(8 * numpy.pi * v), 0 * u + 1], 2)
    normal /= numpy.linalg.norm(normal, axis=2)[..., None]
    return stage.image("waves", normal * 0.5 + 0.5, True)


def _plane(stage, steep, angle, **inputs):
    """A plane that fills the view under an even white sky, its camera so many degrees off its normal."""
    stage.shape("plane")
    for thing in (stage.floor, stage.lamp):
        bpy.data.objects.remove(thing)
    stage.background.inputs["Color"].default_value = (1, 1, 1, 1)
    stage.body.rotation_euler, stage.body.location = (0, 0, 0.4), (0, 0, 0)
    for vertex in stage.body.data.vertices:
        vertex.co *= WIDE
    for corner in stage.body.data.uv_layers.active.data:
        corner.uv *= WIDE
    turned = math.radians(angle)
    stage.camera.location = Vector((0, -math.sin(turned), math.cos(turned))) * 4
    stage.camera.rotation_euler = (turned, 0, 0)
    stage.camera.data.angle = math.radians(12)
    lamp = bpy.data.lights.new("sun", "SUN")
    lamp.energy, lamp.angle = 3, 0.2
    stage.place("sun", lamp, (2, -1, 3), (0, 0, 0))
    node = stage.node("NormalMap", Color=stage.node("TexImage", image=waves(stage, steep)))
    stage.principled(Normal=node, **inputs)


MATT = {"Base_Color": (0.7, 0.7, 0.7), "Specular_IOR_Level": 0.0}
METAL = {"Base_Color": (0.9, 0.9, 0.9), "Metallic": 1.0, "Roughness": 0.3}


@feature
def relief_matt_gentle(stage):
    _plane(stage, GENTLE, SLANT, **MATT)


@feature
def relief_matt_gentle_grazing(stage):
    _plane(stage, GENTLE, GRAZING, **MATT)


@feature
def relief_matt_steep(stage):
    _plane(stage, STEEP, SLANT, **MATT)


@feature
def relief_matt_steep_grazing(stage):
    _plane(stage, STEEP, GRAZING, **MATT)


@feature
def relief_metal_gentle(stage):
    _plane(stage, GENTLE, SLANT, **METAL)


@feature
def relief_metal_gentle_grazing(stage):
    _plane(stage, GENTLE, GRAZING, **METAL)


@feature
def relief_metal_steep(stage):
    _plane(stage, STEEP, SLANT, **METAL)


@feature
def relief_metal_steep_grazing(stage):
    _plane(stage, STEEP, GRAZING, **METAL)
