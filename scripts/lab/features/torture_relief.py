"""Features of relief by normal maps: a matt and a metal plane with ridges of two slopes, seen at two angles."""

import math

import bpy
import numpy
from mathutils import Vector

from .torture_stage import feature

SLOPES = {"gentle": 1.0, "steep": 3.0}  # of the ridges
ANGLES = {"": 45.0, "_grazing": 80.0}  # degrees between the line of sight and the plane's normal
PLANE_SCALE = 40  # so that the plane fills the view


def waves(stage, steep):
    """A tangent-space normal map of ridges with the slope `steep`."""
    v, u = numpy.mgrid[0:64, 0:64] / 64
    normal = numpy.stack([steep * numpy.sin(8 * numpy.pi * u), steep * numpy.cos(8 * numpy.pi * v), 0 * u + 1], 2)
    normal /= numpy.linalg.norm(normal, axis=2)[..., None]
    return stage.image("waves", normal * 0.5 + 0.5, True)


def _plane(stage, steep, angle, **inputs):
    """A plane that fills the view, under a uniform white sky; the camera is `angle` degrees off the plane's normal."""
    stage.shape("plane")
    for thing in (stage.floor, stage.lamp):
        bpy.data.objects.remove(thing)
    stage.background.inputs["Color"].default_value = (1, 1, 1, 1)
    stage.body.rotation_euler, stage.body.location = (0, 0, 0.4), (0, 0, 0)
    for vertex in stage.body.data.vertices:
        vertex.co *= PLANE_SCALE
    for corner in stage.body.data.uv_layers.active.data:
        corner.uv *= PLANE_SCALE
    turned = math.radians(angle)
    stage.camera.location = Vector((0, -math.sin(turned), math.cos(turned))) * 4
    stage.camera.rotation_euler = (turned, 0, 0)
    stage.camera.data.angle = math.radians(12)
    lamp = bpy.data.lights.new("sun", "SUN")
    lamp.energy, lamp.angle = 3, 0.2
    stage.place("sun", lamp, (2, -1, 3), (0, 0, 0))
    node = stage.node("NormalMap", Color=stage.node("TexImage", image=waves(stage, steep)))
    stage.principled(Normal=node, **inputs)


MATERIALS = {
    "matt": {"Base_Color": (0.7, 0.7, 0.7), "Specular_IOR_Level": 0.0},
    "metal": {"Base_Color": (0.9, 0.9, 0.9), "Metallic": 1.0, "Roughness": 0.3},
}


def _relief(slope, angle, inputs):
    return lambda stage: _plane(stage, slope, angle, **inputs)


for _material, _inputs in MATERIALS.items():
    for _steepness, _slope in SLOPES.items():
        for _suffix, _angle in ANGLES.items():
            _build = _relief(_slope, _angle, _inputs)
            _build.__name__ = f"relief_{_material}_{_steepness}{_suffix}"
            feature(_build)
