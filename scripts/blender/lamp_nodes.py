"""Measures lamps whose nodes only Cycles can evaluate, by small renders of their light."""

import contextlib
import math
import os
import tempfile

import bpy
import numpy
from mathutils import Matrix, Vector

import panorama

_PIXELS = 16  # height of the picture; a picture of all directions around a lamp is twice as wide
_SAMPLES = 16


def strength(light, distance, lights_scene):
    """The factor per channel by which the nodes of a lamp change its light at `distance` (m).

    It is the mean over the directions from the lamp, in its own axes, for which `lights_scene(direction)` is true.
    """
    plain = light.copy()
    try:
        if hasattr(plain, "normalize"):
            plain.normalize = True
        plain.energy, plain.color = 1.0, (1.0, 1.0, 1.0)
        shaped = _received(plain, distance)
        switch_nodes_off(plain)
        reference = _received(plain, distance)
    finally:
        bpy.data.lights.remove(plain)
    weights = numpy.ones(shaped.shape[:2])
    if light.type != "SUN":
        directions, weights = _directions(*shaped.shape[:2])
        seen = weights * [[lights_scene(Vector(one)) for one in row] for row in directions]
        weights = seen if (reference * seen[..., None]).any() else weights
    shaped, reference = ((weights[..., None] * picture).sum((0, 1)) for picture in (shaped, reference))
    return [float(a / b) if b > 0 else 0.0 for a, b in zip(shaped, reference)]


def _directions(rows, columns):
    """The directions from a lamp to the pixels of `_received`, (rows, columns, 3), and their relative solid angles."""
    up = math.pi * ((numpy.arange(rows)[:, None] + 0.5) / rows - 0.5) + numpy.zeros((1, columns))
    turn = 2 * math.pi * (0.5 - (numpy.arange(columns)[None] + 0.5) / columns) + numpy.zeros((rows, 1))
    around = numpy.cos(up)
    return numpy.stack([around * numpy.cos(turn), around * numpy.sin(turn), numpy.sin(up)], -1), around


def switch_nodes_off(light):
    if bpy.app.version < (5, 0, 0):
        light.use_nodes = False
        return
    tree = light.node_tree  # Blender 5 ignores the switch
    if tree is None:
        return
    tree.nodes.clear()
    shader = tree.nodes.new("ShaderNodeEmission")
    tree.links.new(shader.outputs[0], tree.nodes.new("ShaderNodeOutputLight").inputs["Surface"])


def _received(light, distance):
    """The light on a white sphere around a lamp by direction, or on a white plane below a sun: a picture."""
    sun = light.type == "SUN"
    with contextlib.ExitStack() as undo:
        stage, observer = undo.enter_context(panorama.stage(None, "lamp"))
        lamp = bpy.data.objects.new("lamp", light)
        undo.callback(bpy.data.objects.remove, lamp)
        screen = bpy.data.objects.new("screen", _plane(undo) if sun else sphere(undo, distance))
        undo.callback(bpy.data.objects.remove, screen)
        for thing in (lamp, screen):
            stage.collection.objects.link(thing)
        stage.cycles.max_bounces = 0
        if sun:
            observer.matrix_world = Matrix.Translation((0, 0, 1))
            observer.data.type, observer.data.ortho_scale = "ORTHO", 1.0
            size = _PIXELS, _PIXELS
        else:
            lamp.visible_camera = False
            panorama.look_around(observer)
            size = 2 * _PIXELS, _PIXELS
        folder = undo.enter_context(tempfile.TemporaryDirectory())
        return panorama.render(stage, os.path.join(folder, "lamp.exr"), *size, _SAMPLES)


def _plane(undo):
    return _mesh(undo, [(-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0)], [(0, 1, 2, 3)])


def sphere(undo, radius, rings=12):
    """A sphere about the origin, as a mesh of 2 * rings * rings quadrangles."""
    turns = [(math.pi * i / rings, math.pi * j / rings) for i in range(rings + 1) for j in range(2 * rings)]
    corners = [(radius * math.sin(a) * math.cos(b), radius * math.sin(a) * math.sin(b), radius * math.cos(a))
               for a, b in turns]
    across = 2 * rings
    faces = [(i * across + j, i * across + (j + 1) % across, (i + 1) * across + (j + 1) % across, (i + 1) * across + j)
             for i in range(rings) for j in range(across)]
    return _mesh(undo, corners, faces)


def _mesh(undo, corners, faces):
    mesh = bpy.data.meshes.new("screen")
    undo.callback(bpy.data.meshes.remove, mesh)
    mesh.from_pydata(corners, [], faces)
    return mesh
