"""Worlds that only Cycles can evaluate: baked to an image, and the sun in their sky to a lamp."""

import collections
import contextlib
import math
import os
import tempfile

import bpy
import numpy
from mathutils import Matrix, Vector

from shading import nodes_of

# A sun in the sky: the direction towards it, its irradiance per channel (W/m2), and the angle of its disc (rad).
Sun = collections.namedtuple("Sun", "toward irradiance angle")

_WITHOUT_SUN = {"PREETHAM", "HOSEK_WILKIE"}
# Pixels a side of the picture from which a sun's light is counted.
_SIDE = 64


def sun(scene, undo, where, warn):
    """Until `undo` closes, takes the disc of the sun out of the world's sky texture; the `Sun` that it was, or None.

    An image would smear the disc over its texels, and caustics of it with that.
    """
    skies = [node for node in nodes_of(scene.world).nodes if node.type == "TEX_SKY" and node.outputs[0].is_linked]
    discs = [node for node in skies if node.sky_type not in _WITHOUT_SUN and node.sun_disc]
    if not discs:
        return None
    node = discs[0]
    if len(discs) > 1 or node.inputs and node.inputs[0].is_linked:
        warn(where, "the sun of its sky is baked with the sky, for its nodes turn it: caustics of it are soft")
        return None
    up, turn = node.sun_elevation, node.sun_rotation
    toward = Vector((math.sin(turn) * math.cos(up), math.cos(turn) * math.cos(up), math.sin(up)))
    with_disc = _light_from(scene, toward, node.sun_size)
    undo.callback(setattr, node, "sun_disc", True)
    node.sun_disc = False
    irradiance = with_disc - _light_from(scene, toward, node.sun_size)
    return Sun(toward, [max(float(x), 0.0) for x in irradiance], node.sun_size)


def add_sun(found, flat, hidden, group):
    """Puts a `Sun` into the flat scene as a lamp, `hidden` from kinds of rays, in a group of lights or none."""
    strongest = max(found.irradiance)
    if strongest <= 0:
        return
    light = flat.remove_later(bpy.data.lights.new("sky's sun", "SUN"))
    light.energy, light.color = strongest, [x / strongest for x in found.irradiance]
    light.angle = found.angle
    body = flat.add(light.name, light, found.toward.to_track_quat("Z", "Y").to_matrix().to_4x4(), hidden, group)
    flat.add_extras(body, angle_deg=math.degrees(found.angle))


def _light_from(scene, toward, angle):
    """Irradiance (numpy, per channel) of a facing surface by all in a square about a disc of the sky."""
    width = 2 * math.tan(0.6 * angle)
    with tempfile.TemporaryDirectory() as folder, _stage(scene) as (stage, eye):
        eye.matrix_world = toward.to_track_quat("-Z", "Y").to_matrix().to_4x4()
        eye.data.angle = 2 * math.atan(width / 2)
        pixels = _render(stage, os.path.join(folder, "sun.exr"), _SIDE, _SIDE)
    across = (numpy.arange(_SIDE) + 0.5) / _SIDE * width - width / 2
    squared = 1 + across[:, None] ** 2 + across[None, :] ** 2
    return (pixels * (width / _SIDE) ** 2 / squared[..., None] ** 2).sum((0, 1))


def baked(scene, path, width=1024):
    """Renders the world alone with a panoramic Cycles camera to an .exr beside the .glb; its key `environment`."""
    name = os.path.splitext(os.path.basename(path))[0] + ".environment.exr"
    with _stage(scene) as (stage, eye):
        # Looking along +X with +Z up puts the directions where an equirectangular texture expects them.
        eye.matrix_world = Matrix(((0, 0, -1, 0), (-1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 0, 1)))
        camera = eye.data
        camera.type = "PANO"
        (camera if hasattr(camera, "panorama_type") else camera.cycles).panorama_type = "EQUIRECTANGULAR"
        _render(stage, os.path.join(os.path.dirname(path), name), width, width // 2)
    return {"file": name, "rotation_deg": 0, "strength": 1}


@contextlib.contextmanager
def _stage(scene):
    """A scene of the world alone at the same moment, and its camera."""
    stage = bpy.data.scenes.new("world")
    camera = bpy.data.cameras.new("world")
    eye = bpy.data.objects.new("world", camera)
    try:
        stage.world = scene.world
        stage.frame_set(scene.frame_current, subframe=scene.frame_subframe)
        stage.collection.objects.link(eye)
        stage.camera = eye
        yield stage, eye
    finally:
        bpy.data.scenes.remove(stage)
        bpy.data.objects.remove(eye)
        bpy.data.cameras.remove(camera)


def _render(stage, path, width, height):
    """Renders a stage to an .exr; its pixels (numpy, height by width by 3)."""
    stage.render.engine = "CYCLES"
    stage.cycles.samples = 16
    stage.cycles.use_denoising = False
    stage.render.resolution_x, stage.render.resolution_y = width, height
    stage.render.resolution_percentage = 100
    settings = stage.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "IMAGE"
    settings.file_format, settings.color_mode, settings.color_depth = "OPEN_EXR", "RGB", "32"
    stage.render.filepath = path
    bpy.ops.render.render(write_still=True, scene=stage.name)
    image = bpy.data.images.load(path)
    values = numpy.empty(width * height * 4, numpy.float32)
    image.pixels.foreach_get(values)
    bpy.data.images.remove(image)
    return values.reshape(height, width, 4)[..., :3].astype(float)
