"""Maps layers of the program to passes of Blender, and copies them."""

import json
import pathlib
import re
from collections import namedtuple

import bpy
import numpy

#: A pass: its name in Blender (and in the EXR with `--exr-naming blender`), its components, its data type in Blender's
#: compositor, its name in `--layers`, the view layer's switch for it, and whether every scene has it.
Pass = namedtuple("Pass", "name components kind layer switch always")

_COMBINED = "Combined"
#: Beginnings of the names of finished layers by the lobe of the first hit, and of light groups.
_LOBE, _GROUP = "Lobe", "Finished"
#: Characters that layer names cannot contain.
_NO_LETTER = re.compile("[^0-9A-Za-z]")
#: The program's table of layers: tests/generated.rs writes the file.
_TABLE = json.loads(pathlib.Path(__file__).with_name("layers.json").read_text("utf-8"))
_PARTS, _GROUPS = _TABLE["parts"], tuple(_TABLE["groups"])
#: The value of `--layers` for all layers by the lobe of the first hit.
_LOBES = "lobes"
#: Layers that `--layers all` leaves out.
_ON_REQUEST = (*_TABLE["on_request"], _LOBES)
#: {components: data type in Blender's compositor}; all others are colours.
_KINDS = {"X": "VALUE", "Z": "VALUE", "XYZ": "VECTOR", "XYZW": "VECTOR"}


def _pass(name, components, layer, switch, always):
    return Pass(name, components.upper(), _KINDS.get(components, "COLOR"), layer, switch, always)


def _passes_of_cycles():
    """Passes that Cycles has, too: {name in Blender: (switch, the program's layer, layer to divide it by)}.

    Blender 5 has spelt their names out. Cycles divides light by the colour of the first hit.
    """
    lobes = (("Diffuse", "Diff", "diffuse"), ("Glossy", "Gloss", "glossy"), ("Transmission", "Trans", "transmission"))
    is_spelt_out = bpy.app.version >= (5, 0, 0)
    found = {}
    for long, short, switch in lobes:
        color = f"{short}Col"
        for part, abbreviation in (("Direct", "Dir"), ("Indirect", "Ind")):
            name = f"{long} {part}" if is_spelt_out else short + abbreviation
            found[name] = f"use_pass_{switch}_{part.lower()}", long + part, color
        found[f"{long} Color" if is_spelt_out else color] = f"use_pass_{switch}_color", color, None
    for part, abbreviation in (("Direct", "Dir"), ("Indirect", "Ind")):
        name = f"Volume {part}" if is_spelt_out else f"Volume{abbreviation}"
        found[name] = f"volume_{part.lower()}", f"Volume{part}", None
    found["Emission" if is_spelt_out else "Emit"] = "use_pass_emit", "Emit", None
    found["Environment" if is_spelt_out else "Env"] = "use_pass_environment", "Environment", None
    return found


_OF_CYCLES = _passes_of_cycles()
PASSES = (*(_pass(**one) for one in _TABLE["passes"]),
          *(_pass(name, "RGB", _LOBES, switch, True) for name, (switch, _, _) in _OF_CYCLES.items()))


def wanted(view_layer):
    """The passes that a view layer enables, besides the picture."""
    def is_enabled(switch):
        # All other switches are in `properties.Passes`.
        return getattr(view_layer if switch.startswith("use_pass_") else view_layer.caustique, switch)

    # Blender 5 calls the light of visible lamps Emission, which with Noisy Parts is the name of a noisy part.
    found = {one.name: one for one in reversed(PASSES) if is_enabled(one.switch)}
    return [one for one in PASSES if found.get(one.name) is one] + _group_passes(view_layer)


def _group_passes(view_layer):
    """Passes of each light group: its finished light and caustics, and with Noisy Parts also the noisy estimates."""
    found = dict.fromkeys(_NO_LETTER.sub("_", group.name) for group in getattr(view_layer, "lightgroups", ()))
    beginnings = [_GROUP, ""] if view_layer.caustique.noisy_parts else [_GROUP]
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
        planes = _planes_of_cycles(picture, one.name) or _planes(picture, one.name, one.channel_id)
        if planes is None:
            part, group = one.name.removeprefix(_COMBINED), one.name.removeprefix(_GROUP)
            if part not in _PARTS and not group.startswith(_GROUPS):
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


def _planes_of_cycles(picture, name):
    """The channels of a pass that Cycles has, too, finished if the picture is, or None."""
    _, layer, color = _OF_CYCLES.get(name, (None, None, None))
    if layer is None:
        return None
    planes = _planes(picture, _LOBE + layer, "RGB") or _planes(picture, layer, "RGB")
    colors = _planes(picture, color, "RGB") if color and planes else None
    if colors is None:
        # In Blender 5 a noisy part has the name of a pass of Cycles.
        return None if color else planes
    return [numpy.divide(light, of, out=numpy.zeros_like(light), where=of > 0)
            for light, of in zip(planes, colors)]


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
