"""Bakes worlds that only Cycles can evaluate to an image, and turns the sun in their sky into a lamp."""

import collections
import math
import os
import tempfile

import bpy
import numpy
from mathutils import Vector

import bake_cache
import panorama
from shading import nodes_of, output_of, upstream

# A sun in the sky: the direction towards it, its irradiance per channel (W/m2), and the angle of its disc (rad).
Sun = collections.namedtuple("Sun", "toward irradiance angle")

_SKIES_WITHOUT_SUN = {"PREETHAM", "HOSEK_WILKIE"}
# Pixels per side of the picture that measures a sun's irradiance.
_SUN_PIXELS = 64


def sun(scene, undo, where, warn):
    """Remove the sun's disc from the world's sky texture until `undo` closes. Returns it as a `Sun`, or None.

    In an image the disc would be blurred over its texels, and so would its caustics.
    """
    used = upstream(output_of(nodes_of(scene.world)).inputs["Surface"])
    skies = [node for node, _ in used.values() if node.type == "TEX_SKY"]
    discs = [node for node in skies if node.sky_type not in _SKIES_WITHOUT_SUN and node.sun_disc]
    if not discs:
        return None
    node = discs[0]
    if len(discs) > 1 or node.inputs and node.inputs[0].is_linked:
        warn(where, "the sun of its sky is baked with the sky, for its nodes turn it: caustics of it are soft; "
                    "unlink the Vector of its Sky Texture, and turn the sun by Sun Rotation")
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
    key = bake_cache.world_key(scene, "sun", tuple(toward), angle)
    return bake_cache.recall(key, lambda: _measure_irradiance(scene, toward, angle))


def _measure_irradiance(scene, toward, angle):
    width = 2 * math.tan(0.6 * angle)
    with tempfile.TemporaryDirectory() as folder, _stage(scene) as (stage, observer):
        observer.matrix_world = toward.to_track_quat("-Z", "Y").to_matrix().to_4x4()
        observer.data.angle = 2 * math.atan(width / 2)
        pixels = panorama.render(stage, os.path.join(folder, "sun.exr"), _SUN_PIXELS, _SUN_PIXELS)
    across = (numpy.arange(_SUN_PIXELS) + 0.5) / _SUN_PIXELS * width - width / 2
    squared = 1 + across[:, None] ** 2 + across[None, :] ** 2
    return (pixels * (width / _SUN_PIXELS) ** 2 / squared[..., None] ** 2).sum((0, 1))


def unused_name(path, name):
    """`name`, changed unless no image of the .blend is stored in a file of that name beside `path`."""
    used = {os.path.realpath(bpy.path.abspath(image.filepath)) for image in bpy.data.images if image.filepath}
    while os.path.realpath(os.path.join(os.path.dirname(path), name)) in used:
        name = f"_{name}"
    return name


def bake_world(scene, path, width=1024, *, kind="environment"):
    """Render the world with a panoramic Cycles camera to an .exr beside the .glb, with `kind` in its name. Returns the
    key `environment`."""
    name = unused_name(path, os.path.splitext(os.path.basename(path))[0] + f".{kind}.exr")
    file = os.path.join(os.path.dirname(path), name)

    def bake():
        with _stage(scene) as (stage, observer):
            panorama.look_around(observer)
            panorama.render(stage, file, width, width // 2)
        return numpy.fromfile(file, numpy.uint8)

    bake_cache.recall(bake_cache.world_key(scene, "panorama", width), bake).tofile(file)
    return {"file": name, "rotation_deg": 0, "strength": 1}


def _stage(scene):
    return panorama.stage(scene.world, "world", scene.frame_current, scene.frame_subframe)
