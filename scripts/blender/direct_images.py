"""Finds values that glTF can express directly: an image on the mesh's UV map, at most translated, rotated and
scaled."""

import numpy

from shading import source_socket

_WRAPS = {"REPEAT", "EXTEND", "MIRROR"}
_SMALL_IMAGE = 256  # texels


def image_of(value, data):
    """The Image Texture node whose Color is `value`, or None if glTF cannot express it.

    `data`: the image holds numbers, not colours.
    """
    node = value.node
    if node.type != "TEX_IMAGE" or value.name != "Color" or node.mute:
        return None
    image = node.image
    if is_missing(image) or image.source not in {"FILE", "GENERATED"} or node.projection != "FLAT":
        return None
    if node.extension not in _WRAPS or image.colorspace_settings.name != ("Non-Color" if data else "sRGB"):
        return None
    # Cycles filters encoded texels, glTF linear ones: the difference is visible in small images.
    if not data and node.interpolation != "Closest" and max(image.size) < _SMALL_IMAGE:
        return None
    if image.is_float or not _uses_render_uv(node.inputs["Vector"]):
        return None
    return node


def is_missing(image):
    """Whether there is no image, or its file cannot be read."""
    return image is None or 0 in image.size


def warn_of_missing(trees, where, warn):
    """Warn of the missing images that node trees use."""
    images = {n.image for t in trees for n in t.nodes if n.type in {"TEX_IMAGE", "TEX_ENVIRONMENT"} and not n.mute
              and any(s.is_linked for s in n.outputs) and n.image is not None and is_missing(n.image)}
    for image in sorted(images, key=lambda image: image.name):
        warn(where, f'its image "{image.name}" cannot be read ({image.filepath or "no file"}): it is magenta, as in '
             "Cycles; find it by File > External Data > Find Missing Files")


def is_opaque(image):
    """Whether no texel is transparent. Cycles multiplies colours by alpha, glTF does not."""
    if image.channels < 4 or image.alpha_mode in {"NONE", "CHANNEL_PACKED"}:
        return True
    return bool(texels(image)[..., 3].min() >= 1)


def is_grey(image):
    """Whether red, green and blue are equal in all texels."""
    if image.channels < 3:
        return True
    found = texels(image)
    return bool(numpy.abs(found[..., :3] - found[..., :1]).max() < 1e-3)


def texels(image):
    """The texels of an image: (count, channels)."""
    values = numpy.empty(len(image.pixels), numpy.float32)
    image.pixels.foreach_get(values)
    return values.reshape(-1, image.channels)


def normal_map(value):
    """The Normal Map node of full strength with a tangent-space image that glTF can use, or None."""
    node = value.node
    if node.type != "NORMAL_MAP" or node.space != "TANGENT" or node.uv_map or node.mute:
        return None
    strength, colour = node.inputs["Strength"], node.inputs["Color"]
    if strength.is_linked or strength.default_value != 1 or not colour.is_linked:
        return None
    output, path = source_socket(colour)
    plain = output is not None and output.is_output and not path and image_of(output, data=True) is not None
    return node if plain else None


def cosines(node):
    """The cosines between the normals of a Normal Map node's image and the surface normal, by texel."""
    output, _ = source_socket(node.inputs["Color"])
    return texels(output.node.image)[:, 2] * 2 - 1


def _uses_render_uv(socket):
    """Whether an image's coordinates are the mesh's render UV map, transformed by at most one Mapping node."""
    if not socket.is_linked:
        return True
    output, path = source_socket(socket)
    if output is None or not output.is_output or path:
        return False
    node = output.node
    if node.type == "TEX_COORD":
        return output.name == "UV" and not node.from_instancer
    if node.type == "UVMAP":
        return not node.uv_map and not node.from_instancer
    if node.type != "MAPPING" or node.vector_type != "POINT":
        return False
    values = [node.inputs[name] for name in ("Location", "Rotation", "Scale")]
    flat = not any(s.is_linked for s in values) and not any(node.inputs["Rotation"].default_value[:2])
    return flat and _uses_render_uv(node.inputs["Vector"]) and not _is_transformed(node.inputs["Vector"])


def _is_transformed(socket):
    output, _ = source_socket(socket)
    return output is not None and output.is_output and output.node.type == "MAPPING"
