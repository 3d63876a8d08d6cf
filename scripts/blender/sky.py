"""Bakes worlds that only Cycles can evaluate to an image, and turns the sun in their sky into a lamp."""

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

_SKIES_WITHOUT_SUN = {"PREETHAM", "HOSEK_WILKIE"}
# Pixels per side of the picture that measures a sun's irradiance.
_SUN_PIXELS = 64


def sun(scene, undo, where, warn):
    """Remove the sun's disc from the world's sky texture until `undo` closes. Returns it as a `Sun`, or None.

    In an image the disc would be blurred over its texels, and so would its caustics.
    """
    skies = [node for node in nodes_of(scene.world).nodes if node.type == "TEX_SKY" and node.outputs[0].is_linked]
    discs = [node for node in skies if node.sky_type not in _SKIES_WITHOUT_SUN and node.sun_disc]
    if not discs:
        return None
    node = discs[0]
    if len(discs) > 1 or node.inputs and node.inputs[0].is_linked:
        warn(where, "the sun of its sky is baked with the sky, for its nodes turn it: caustics of it are soft")
        return None
    up, turn = node.sun_elevation, node.sun_rotation
    toward = Vector((math.sin(turn) * math.cos(up), math.cos(turn) * math.cos(up), math.sin(up)))
    with_disc = _irradiance(scene, toward, node.sun_size)
    undo.callback(setattr, node, "sun_disc", True)
    node.sun_disc = False
    irradiance = with_disc - _irradiance(scene, toward, node.sun_size)
    return Sun(toward, [max(float(x), 0.0) for x in irradiance], node.sun_size)


def add_sun(found, flat, hidden, group):
    """Add a `Sun` to the flat scene as a lamp, `hidden` from these kinds of rays, in a light group or None."""
    strongest = max(found.irradiance)
    if strongest <= 0:
        return
    light = flat.remove_later(bpy.data.lights.new("sky's sun", "SUN"))
    light.energy, light.color = strongest, [x / strongest for x in found.irradiance]
    light.angle = found.angle
    body = flat.add(light.name, light, found.toward.to_track_quat("Z", "Y").to_matrix().to_4x4(), hidden, group)
    flat.add_extras(body, angle_deg=math.degrees(found.angle))


def _irradiance(scene, toward, angle):
    """Irradiance (numpy, per channel) on a perpendicular surface from a square of the sky around the sun's disc."""
    width = 2 * math.tan(0.6 * angle)
    with tempfile.TemporaryDirectory() as folder, _stage(scene) as (stage, observer):
        observer.matrix_world = toward.to_track_quat("-Z", "Y").to_matrix().to_4x4()
        observer.data.angle = 2 * math.atan(width / 2)
        pixels = _render(stage, os.path.join(folder, "sun.exr"), _SUN_PIXELS, _SUN_PIXELS)
    across = (numpy.arange(_SUN_PIXELS) + 0.5) / _SUN_PIXELS * width - width / 2
    squared = 1 + across[:, None] ** 2 + across[None, :] ** 2
    return (pixels * (width / _SUN_PIXELS) ** 2 / squared[..., None] ** 2).sum((0, 1))


def bake_world(scene, path, width=1024):
    """Render the world with a panoramic Cycles camera to an .exr beside the .glb. Returns the key `environment`."""
    name = os.path.splitext(os.path.basename(path))[0] + ".environment.exr"
    with _stage(scene) as (stage, observer):
        # A camera along +X with +Z up gives the layout of an equirectangular texture.
        observer.matrix_world = Matrix(((0, 0, -1, 0), (-1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 0, 1)))
        camera = observer.data
        camera.type = "PANO"
        (camera if hasattr(camera, "panorama_type") else camera.cycles).panorama_type = "EQUIRECTANGULAR"
        _render(stage, os.path.join(os.path.dirname(path), name), width, width // 2)
    return {"file": name, "rotation_deg": 0, "strength": 1}


@contextlib.contextmanager
def _stage(scene):
    """A scene with the world alone at the current frame, and its camera."""
    stage = bpy.data.scenes.new("world")
    camera = bpy.data.cameras.new("world")
    observer = bpy.data.objects.new("world", camera)
    try:
        stage.world = scene.world
        stage.frame_set(scene.frame_current, subframe=scene.frame_subframe)
        stage.collection.objects.link(observer)
        stage.camera = observer
        yield stage, observer
    finally:
        bpy.data.scenes.remove(stage)
        bpy.data.objects.remove(observer)
        bpy.data.cameras.remove(camera)


def _render(stage, path, width, height):
    """Render a stage to an .exr. Returns its pixels, a numpy array (height, width, 3)."""
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
