"""Pictures of the light of lamps whose nodes vary it: slides of spots, and surfaces of area lamps."""

import contextlib
import math
import os
import struct
import tempfile
import zlib

import bpy  # first: it makes the others importable

import numpy
from mathutils import Matrix

import glb
import lamp_nodes
import panorama
from graph import FUNCTIONS
from shading import nodes_of, output_of, upstream

_PIXELS = 256  # along the longer side
_SAMPLES = 16
_WIDEST_SPOT = math.radians(150)
# Relative differences below this are no picture.
_LEAST_CONTRAST = 0.02
# Nodes whose outputs depend on the point of the lamp or on the direction of its light, but not on what it shines on.
_VARYING = {"TEX_IMAGE", "TEX_IES", "TEX_CHECKER", "TEX_NOISE", "TEX_VORONOI", "TEX_WAVE", "TEX_MAGIC", "TEX_GRADIENT",
            "TEX_BRICK", "TEX_WHITE_NOISE", "MAPPING", "NORMAL", "TEX_COORD"}
_COORDINATES = {"Normal", "UV"}


def measure(light, scale=(1, 1)):
    """The light of a spot by direction, or of an area lamp by place, relative to that without nodes.

    Returns an array (height, width, 3), bottom row first, or None if the nodes do anything else. The picture of a spot
    is square and as wide as its cone; that of an area lamp is seen from its front, with its X axis to the left.
    """
    if not _can_be_a_picture(light):
        return None
    plain = light.copy()
    try:
        plain.energy, plain.color = 1.0, (1.0, 1.0, 1.0)
        if hasattr(plain, "normalize"):
            plain.normalize = True
        if plain.type == "SPOT":
            plain.shadow_soft_size, plain.spot_blend = 0.0, 0.0
            size = _PIXELS, _PIXELS
        else:
            plain.spread = math.pi
            wide = [s * n for s, n in zip(_extent(light), scale)]
            size = [max(round(_PIXELS * w / max(wide)), 1) for w in wide]
        shaped = _seen(plain, *size)
        lamp_nodes.switch_nodes_off(plain)
        reference = _seen(plain, *size)
    finally:
        bpy.data.lights.remove(plain)
    there = reference.max(-1) > 0.01 * reference.max()
    picture = numpy.where(there[..., None], shaped / numpy.maximum(reference, 1e-30), 0.0)
    inside = picture[there]
    if inside.size == 0 or inside.max() <= 0 or inside.max() - inside.min() < _LEAST_CONTRAST * inside.max():
        return None
    return _extended(picture, there)


def _can_be_a_picture(light):
    """Whether the nodes of a lamp vary its light over its cone or its surface."""
    output = output_of(nodes_of(light))
    if output is None or light.type not in {"SPOT", "AREA"}:
        return False
    if light.type == "SPOT" and light.spot_size > _WIDEST_SPOT:
        return False
    used = list(upstream(output.inputs["Surface"]).values())
    kinds = {node.type for node, _ in used}
    known = FUNCTIONS | _VARYING | {"EMISSION", "ADD_SHADER", "MIX_SHADER"}
    coordinates = {socket.name for node, socket in used if node.type == "TEX_COORD"}
    return kinds <= known and bool(kinds & _VARYING) and coordinates <= _COORDINATES


def _extent(light):
    return light.size, light.size_y if light.shape in {"RECTANGLE", "ELLIPSE"} else light.size


def _extended(picture, there):
    """The picture with its border repeated beyond the lamp, so that interpolation does not darken its rim."""
    picture, there = picture.copy(), there.copy()
    for _ in range(3):
        total, count = numpy.zeros_like(picture), numpy.zeros(there.shape)
        for axis, step in ((0, 1), (0, -1), (1, 1), (1, -1)):
            near = numpy.roll(there, step, axis)
            total += numpy.roll(picture, step, axis) * near[..., None]
            count += near
        grow = ~there & (count > 0)
        picture[grow] = (total / numpy.maximum(count, 1)[..., None])[grow]
        there |= grow
    return picture


def _seen(light, width, height):
    """The light of a spot on a white sphere around it, as wide as its cone, or the front of an area lamp: a picture."""
    with contextlib.ExitStack() as undo:
        stage, observer = undo.enter_context(panorama.stage(None, "lamp"))
        lamp = bpy.data.objects.new("lamp", light)
        undo.callback(bpy.data.objects.remove, lamp)
        stage.collection.objects.link(lamp)
        stage.cycles.max_bounces = 0
        if light.type == "SPOT":
            lamp.visible_camera = False
            screen = bpy.data.objects.new("screen", lamp_nodes.sphere(undo, 1.0))
            undo.callback(bpy.data.objects.remove, screen)
            stage.collection.objects.link(screen)
            observer.data.type, observer.data.angle = "PERSP", light.spot_size
        else:
            lamp.visible_camera = True
            # From below, with the lamp's Y axis up.
            observer.matrix_world = Matrix.Translation((0, 0, -1)) @ Matrix.Rotation(math.pi, 4, "Y")
            light.size, light.size_y = 1.0, height / width if width >= height else 1.0
            light.size = 1.0 if width >= height else width / height
            observer.data.type, observer.data.ortho_scale = "ORTHO", 1.0
        observer.data.sensor_fit = "AUTO"
        observer.data.clip_start = 1e-3
        folder = undo.enter_context(tempfile.TemporaryDirectory())
        return panorama.render(stage, os.path.join(folder, "lamp.exr"), width, height, _SAMPLES)


def encoded(values):
    """Linear values from 0 to 1 as sRGB."""
    values = numpy.clip(values, 0.0, 1.0)
    return numpy.where(values <= 0.0031308, 12.92 * values, 1.055 * values ** (1 / 2.4) - 0.055)


def png(picture):
    """Returns the bytes of a PNG with 16 bits per channel of a picture of linear values from 0 to 1, bottom row
    first."""
    height, width, _ = picture.shape
    words = numpy.rint(encoded(picture[::-1]) * 65535).astype(">u2").reshape(height, -1)
    rows = b"".join(b"\0" + row.tobytes() for row in words)

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", width, height, 16, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


def add(thing, flat):
    """Carry the picture that a spot throws. Returns the factor on the lamp's strength where the picture is white, or None
    if it throws none. `flat.pictures` keeps the pictures."""
    picture = measure(thing.data) if thing.data.type == "SPOT" else None
    if picture is None:
        return None
    peak = float(picture.max())
    flat.pictures.append(png(picture / peak))
    flat.add_extras(thing, gobo={"picture": len(flat.pictures) - 1, "view_deg": math.degrees(thing.data.spot_size)})
    return peak


def embed(document, buffer, pictures):
    """Store the pictures as textures of a document, which the spots then name. Returns the buffer."""
    if not pictures:
        return buffer
    buffer, textures = bytearray(buffer), []
    samplers = document.setdefault("samplers", [])
    samplers.append({"wrapS": 33071, "wrapT": 33071})
    for picture in pictures:
        view = glb.add_view(document, buffer, picture)
        images = document.setdefault("images", [])
        images.append({"name": "picture of a spot", "bufferView": view, "mimeType": "image/png"})
        document.setdefault("textures", []).append({"source": len(images) - 1, "sampler": len(samplers) - 1})
        textures.append(len(document["textures"]) - 1)
    for node in document.get("nodes", []):
        gobo = node.get("extras", {}).get("caustique", {}).get("gobo")
        if gobo is not None:
            gobo["texture"] = textures[int(gobo.pop("picture"))]
    return bytes(buffer)
