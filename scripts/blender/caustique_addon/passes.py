"""Which layers of the program become which passes of Blender, and how they get there."""

import json
import pathlib
import re
from collections import namedtuple

import numpy

#: A pass: its name in Blender (and in the EXR under `--exr-naming blender`), its components, what Blender's compositor
#: takes it for, its name in `--layers`, the switch of the view layer that asks for it, and whether every scene has it.
Pass = namedtuple("Pass", "name components kind layer switch always")

_COMBINED = "Combined"
#: What no layer's name can have.
_NO_LETTER = re.compile("[^0-9A-Za-z]")
#: The program's table of layers: tests/generated.rs writes the file.
_TABLE = json.loads(pathlib.Path(__file__).with_name("layers.json").read_text("utf-8"))
_PARTS, _GROUPS = _TABLE["parts"], tuple(_TABLE["groups"])
#: What Blender's compositor takes other components than colours for.
_KINDS = {"X": "VALUE", "Z": "VALUE", "XYZ": "VECTOR"}


def _pass(name, components, layer, switch, always):
    return Pass(name, components.upper(), _KINDS.get(components, "COLOR"), layer, switch, always)


PASSES = tuple(_pass(**one) for one in _TABLE["passes"])


def wanted(view_layer):
    """The passes that a view layer asks for, besides the picture."""
    def asked(switch):
        # The others are in `properties.Passes`.
        return getattr(view_layer if switch.startswith("use_pass_") else view_layer.caustique, switch)

    return [one for one in PASSES if asked(one.switch)] + _of_groups(view_layer)


def _of_groups(view_layer):
    """The finished light of each light group, and its caustics; the estimates too, where those of parts are asked for."""
    found = dict.fromkeys(_NO_LETTER.sub("_", group.name) for group in getattr(view_layer, "lightgroups", ()))
    beginnings = [_COMBINED, ""] if view_layer.caustique.noisy_parts else [_COMBINED]
    names = (f"{beginning}{kind}{group}" for group in found for beginning in beginnings for kind in _GROUPS)
    return [Pass(name, "RGB", "COLOR", name, None, False) for name in names]


def layers(chosen):
    """What `--layers` has to say for these passes: the program refuses names that the scene cannot have."""
    if not all(one.always for one in chosen):
        return "all"
    return ",".join(dict.fromkeys(["beauty", *(one.layer for one in chosen)]))


def fill(render_layer, picture, frame=None):
    """Put the channels of an `exr.Picture` into the passes of Blender's `render_layer`.

    `frame` is x, y (from the top left), width and height of the part that Blender renders, in pixels of the whole
    picture; without it everything. Returns the names of the passes that stay black because the program has not made
    them. Parts and light groups are not among these: where one is absent, the scene has no such light, and black is
    right; a method that does not tell lights apart says so itself.
    """
    missing = []
    for one in render_layer.passes:
        planes = _planes(picture, one.name, one.channel_id)
        if planes is None:
            plain = one.name.replace(_COMBINED, "", 1)
            if plain not in _PARTS and not plain.startswith(_GROUPS):
                missing.append(one.name)
            continue
        put(one, planes, picture, frame)
    return missing


def fill_combined(render_layer, picture, frame=None):
    """Put the picture so far, with channels R G B A, into the pass that Blender shows."""
    for one in render_layer.passes:
        if one.name == _COMBINED:
            put(one, [picture.channels[name] for name in "RGBA"], picture, frame)


def put(one, planes, picture, frame=None):
    """Put planes (height, width), the first row on top, into a pass, whose first row is at the bottom."""
    if frame is not None:
        x, y, width, height = frame
        left, top = x - picture.window[0], y - picture.window[1]
        planes = [plane[top:top + height, left:left + width] for plane in planes]
    pixels = numpy.ascontiguousarray(numpy.stack(planes, -1)[::-1], numpy.float32).reshape(-1, len(planes))
    try:
        one.rect.foreach_set(pixels.ravel())
    except TypeError:  # Blender 3 wants as many elements as there are pixels, and takes all their components
        one.rect.foreach_set(pixels)


def _planes(picture, name, components):
    """The channels of a pass, or None. Cryptomattes have components of lower case."""
    for spelt in (components, components.lower()):
        names = [f"ViewLayer.{name}.{component}" for component in spelt]
        if all(name in picture.channels for name in names):
            return [picture.channels[name] for name in names]
    return None


def stamp(result, picture, view_layer):
    """Give Blender's result the manifests of the cryptomattes, under the name of its own view layer."""
    for name, value in picture.text.items():
        if name.startswith("cryptomatte/"):
            result.stamp_data_add_field(name, value.replace("ViewLayer.", f"{view_layer}.", 1)
                                        if name.endswith("/name") else value)
