"""Maps layers of the program to passes of Blender, and copies them."""

import json
import pathlib
import re
from collections import namedtuple

import numpy

#: A pass: its name in Blender (and in the EXR with `--exr-naming blender`), its components, its data type in Blender's
#: compositor, its name in `--layers`, the view layer's switch for it, and whether every scene has it.
Pass = namedtuple("Pass", "name components kind layer switch always")

_COMBINED = "Combined"
#: Characters that layer names cannot contain.
_NO_LETTER = re.compile("[^0-9A-Za-z]")
#: The program's table of layers: tests/generated.rs writes the file.
_TABLE = json.loads(pathlib.Path(__file__).with_name("layers.json").read_text("utf-8"))
_PARTS, _GROUPS = _TABLE["parts"], tuple(_TABLE["groups"])
#: Layers that `--layers all` leaves out.
_ON_REQUEST = _TABLE["on_request"]
#: {components: data type in Blender's compositor}; all others are colours.
_KINDS = {"X": "VALUE", "Z": "VALUE", "XYZ": "VECTOR", "XYZW": "VECTOR"}


def _pass(name, components, layer, switch, always):
    return Pass(name, components.upper(), _KINDS.get(components, "COLOR"), layer, switch, always)


PASSES = tuple(_pass(**one) for one in _TABLE["passes"])


def wanted(view_layer):
    """The passes that a view layer enables, besides the picture."""
    def is_enabled(switch):
        # All other switches are in `properties.Passes`.
        return getattr(view_layer if switch.startswith("use_pass_") else view_layer.caustique, switch)

    return [one for one in PASSES if is_enabled(one.switch)] + _group_passes(view_layer)


def _group_passes(view_layer):
    """Passes of each light group: its finished light and caustics, and with Noisy Parts also the noisy estimates."""
    found = dict.fromkeys(_NO_LETTER.sub("_", group.name) for group in getattr(view_layer, "lightgroups", ()))
    beginnings = [_COMBINED, ""] if view_layer.caustique.noisy_parts else [_COMBINED]
    names = (f"{beginning}{kind}{group}" for group in found for beginning in beginnings for kind in _GROUPS)
    return [Pass(name, "RGB", "COLOR", name, None, False) for name in names]


def layers(chosen):
    """The value of `--layers` for these passes. The program rejects names that the scene cannot have."""
    named = dict.fromkeys(one.layer for one in chosen)
    if not all(one.always for one in chosen):
        return ",".join(["all", *(name for name in named if name in _ON_REQUEST)])
    return ",".join(["beauty", *named])


def fill(render_layer, picture, frame=None):
    """Copy the channels of an `exr.Picture` to the passes of Blender's `render_layer`.

    `frame`: x, y (from the top left), width and height of the render region in pixels; None for the whole picture.
    Returns the names of passes that stay black because the program did not write them. Missing parts and light groups
    are not reported: black is right if the scene has no such light, and the program warns if a method cannot separate
    lights.
    """
    missing = []
    for one in render_layer.passes:
        planes = _planes(picture, one.name, one.channel_id)
        if planes is None:
            plain = one.name.replace(_COMBINED, "", 1)
            if plain not in _PARTS and not plain.startswith(_GROUPS):
                missing.append(one.name)
            continue
        copy_channels(one, planes, picture, frame)
    return missing


def fill_combined(render_layer, picture, frame=None):
    """Copy the picture so far, with channels R G B A, to the pass that Blender shows."""
    for one in render_layer.passes:
        if one.name == _COMBINED:
            copy_channels(one, [picture.channels[name] for name in "RGBA"], picture, frame)


def copy_channels(one, planes, picture, frame=None):
    """Copy channels (height, width), top row first, to a pass, which has the bottom row first."""
    if frame is not None:
        x, y, width, height = frame
        left, top = x - picture.window[0], y - picture.window[1]
        planes = [plane[top:top + height, left:left + width] for plane in planes]
    pixels = numpy.ascontiguousarray(numpy.stack(planes, -1)[::-1], numpy.float32).reshape(-1, len(planes))
    try:
        one.rect.foreach_set(pixels.ravel())
    except TypeError:  # Blender 3 expects a list of pixels, each with all components
        one.rect.foreach_set(pixels)


def _planes(picture, name, components):
    """The channels of a pass, or None. Cryptomattes have lower-case components."""
    for spelt in (components, components.lower()):
        names = [f"ViewLayer.{name}.{component}" for component in spelt]
        if all(name in picture.channels for name in names):
            return [picture.channels[name] for name in names]
    return None


def copy_manifests(result, picture, view_layer):
    """Add the manifests of the cryptomattes to Blender's result, under the name of its view layer."""
    for name, value in picture.text.items():
        if name.startswith("cryptomatte/"):
            result.stamp_data_add_field(name, value.replace("ViewLayer.", f"{view_layer}.", 1)
                                        if name.endswith("/name") else value)
