"""The world as keys of `extras.caustique`: the environment, and the medium that fills the scene."""

import contextlib
import math
import os

import bpy

import export_guard as guard
import sky
import visibility
from direct_images import is_missing, warn_of_missing
from shading import constant, medium, nodes_of, output_of, source


_STILL = {"FILE", "GENERATED", "VIEWER"}  # kinds of images that do not depend on the frame


def extras(scene, path, warn):
    """The scene's keys `environment` (even if black) and `medium`, and the `Sun` in its sky or None.

    Writes images beside the .glb at `path`.
    """
    black = {"environment": {"color": [0.0, 0.0, 0.0]}}
    if scene.world is None or not visibility.rendered_layer(scene).use_sky:  # the layer's filter "Environment"
        return black, None
    return guard.attempt(warn, f'world "{scene.world.name}"', (black, None), "it is black",
                         _world, scene, path, black, warn)


def _world(scene, path, black, warn):
    world, said = scene.world, dict(black, environment=dict(black["environment"]))
    where = f'world "{world.name}"'
    output = output_of(nodes_of(world))
    if output is None:
        if nodes_of(world) is None:
            said["environment"]["color"] = list(world.color)
        return said, None
    inside = medium(source(output.inputs["Volume"]), where, warn)
    if inside is not None:
        said["medium"] = inside
    warn_of_missing([output.id_data], where, warn)
    shader = source(output.inputs["Surface"])
    if shader is None:
        return said, None
    by_ray = [s for node in output.id_data.nodes if node.type == "LIGHT_PATH" for s in node.outputs if s.is_linked]
    background = None
    with contextlib.ExitStack() as undo:
        for socket in by_ray:
            _cut(socket, float(socket.name == "Is Camera Ray"), undo)
        if by_ray:
            background, _ = _environment(scene, output, path, "background", lambda: None, warn)
    with contextlib.ExitStack() as undo:
        for socket in by_ray:
            _cut(socket, 0.0, undo)
        said["environment"], disc = _environment(
            scene, output, path, "environment", lambda: sky.sun(scene, undo, where, warn), warn)
    if background is not None:
        said["environment"]["background"] = background
    others = [socket.name for socket in by_ray if socket.name != "Is Camera Ray"]
    if others:
        warn(where, f"it depends on {', '.join(others)} of its Light Path node: all rays but those of the camera see it as "
                    "where these are 0; use Is Camera Ray alone to see the same in Cycles")
    _add_visibility(world, said["environment"], where, warn)
    group = visibility.light_group(world, None, bpy.context.view_layer)
    if group:
        said["environment"]["light_group"] = group
    return said, disc


def _environment(scene, output, path, name, find_sun, warn):
    """The key `environment` of the world's surface, and what `find_sun` returns if the world is baked, to an image with
    `name` in its file name."""
    shader = source(output.inputs["Surface"])
    while shader is not None and shader.type == "MIX_SHADER" and constant(shader.inputs[0]) in {0.0, 1.0}:
        shader = source(shader.inputs[1 + int(constant(shader.inputs[0]))])
    if shader is None:
        return {"color": [0.0, 0.0, 0.0]}, None
    said, found = _background(shader, path), None
    if said is None:
        found = find_sun()
        said = sky.bake_world(scene, path, kind=name)
        warn(f'world "{scene.world.name}"', f"its nodes are baked to {said['file']}; keep that file beside the scene's file")
    return said, found


def _cut(socket, value, undo):
    """Make the links of an output carry a number until `undo` closes."""
    tree = socket.id_data
    for link in list(socket.links):
        to = link.to_socket
        before = to.default_value if to.type == "VALUE" else tuple(to.default_value)
        undo.callback(tree.links.new, socket, to)
        undo.callback(setattr, to, "default_value", before)
        tree.links.remove(link)
        to.default_value = value if to.type == "VALUE" else [value] * len(before)


def _add_visibility(world, environment, where, warn):
    rays = {"camera": "camera", "diffuse": "diffuse", "glossy": "glossy", "transmission": "transmission",
            "scatter": "volume scatter"}
    shown = getattr(world, "cycles_visibility", None)
    hidden = [name for name in rays if not getattr(shown, name, True)]
    if "camera" in hidden:
        environment["visible"] = {"camera": False}
        hidden.remove("camera")
    if hidden:
        warn(where, f"it is hidden from {', '.join(rays[name] for name in hidden)} rays in Cycles: here they meet it; "
                    "switch these rays on (World > Ray Visibility) to see the same in Cycles")


def _background(shader, path):
    """The environment of a Background shader with one colour or one rotated environment texture; None for others."""
    if shader.type not in {"BACKGROUND", "EMISSION"} or constant(shader.inputs["Strength"]) is None:
        return None
    strength = constant(shader.inputs["Strength"])
    colour = constant(shader.inputs["Color"])
    if colour is not None:
        return {"color": [c * strength for c in colour]}
    texture = source(shader.inputs["Color"])
    if texture.type == "TEX_ENVIRONMENT" and texture.image is not None and texture.image.source not in _STILL:
        return None
    if texture.type == "TEX_ENVIRONMENT" and is_missing(texture.image):
        return {"color": [strength, 0.0, strength]}  # magenta, as in Cycles
    if texture.type != "TEX_ENVIRONMENT" or texture.projection != "EQUIRECTANGULAR":
        return None
    turn = _turn(texture.inputs["Vector"])
    if turn is None:
        return None
    return {"file": _beside(texture.image, path), "rotation_deg": turn, "strength": strength}


def _turn(socket):
    """Rotation in degrees about the vertical by the nodes before an environment texture, or None if they do more."""
    node = source(socket)
    if node is None:
        return 0.0
    if node.type == "TEX_COORD":
        return 0.0 if socket.links[0].from_socket.name == "Generated" else None
    if node.type != "MAPPING" or node.vector_type not in {"POINT", "TEXTURE", "VECTOR", "NORMAL"}:
        return None
    rotation = constant(node.inputs["Rotation"])
    scale = constant(node.inputs["Scale"])
    shift = constant(node.inputs["Location"]) if "Location" in node.inputs else [0, 0, 0]
    moved = node.vector_type in {"POINT", "TEXTURE"} and shift != [0, 0, 0]
    if rotation is None or scale != [1, 1, 1] or any(rotation[:2]) or moved:
        return None
    before = _turn(node.inputs["Vector"])
    # A point mapping rotates the lookup direction, so the image rotates by the negative angle.
    return None if before is None else before + math.degrees(rotation[2]) * (1 if node.vector_type == "TEXTURE" else -1)


def _beside(image, path):
    """Write an image beside the .glb at `path`, as Radiance or OpenEXR. Returns its file name."""
    stem = os.path.splitext(os.path.basename(path))[0]
    kind = {"HDR": ".hdr", "OPEN_EXR": ".exr", "OPEN_EXR_MULTILAYER": None}.get(image.file_format)
    data = None
    if image.packed_file is not None:
        data = image.packed_file.data
    elif image.source == "FILE" and os.path.isfile(bpy.path.abspath(image.filepath)):
        with open(bpy.path.abspath(image.filepath), "rb") as file:
            data = file.read()
    if kind and data:
        name = sky.unused_name(path, f"{stem}.environment{kind}")
        with open(os.path.join(os.path.dirname(path), name), "wb") as file:
            file.write(data)
        return name
    name = sky.unused_name(path, f"{stem}.environment.exr")
    flat = bpy.data.images.new(name, *image.size, float_buffer=True)
    try:
        pixels = list(image.pixels)
        if image.colorspace_settings.name == "sRGB" and not image.is_float:
            pixels = [v if i % 4 == 3 else _linear(v) for i, v in enumerate(pixels)]
        flat.colorspace_settings.name = "Non-Color"  # no colour conversion
        flat.pixels = pixels
        flat.file_format = "OPEN_EXR"
        flat.filepath_raw = os.path.join(os.path.dirname(path), name)
        flat.save()
    finally:
        bpy.data.images.remove(flat)
    return name


def _linear(value):
    return value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4
