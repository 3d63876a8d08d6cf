"""The world as keys of `extras.caustique`: the environment, and the medium that fills the scene."""

import contextlib
import math
import os

import bpy

import export_guard as guard
import sky
import visibility
from direct_images import is_missing, texels, warn_of_missing
from shading import constant, medium, nodes_of, output_of, positive, source, source_socket, upstream

_STILL = {"FILE", "GENERATED", "VIEWER"}  # kinds of images that do not depend on the frame
_ENDINGS = {"HDR": ".hdr", "OPEN_EXR": ".exr"}
_LINEAR = {"Linear Rec.709", "Non-Color"}  # colour spaces of files whose numbers the program takes for radiances
_BAKED_TEXELS = 1024, 4096  # least and most texels along the width of a baked world


def extras(scene, path, warn):
    """The scene's keys `environment` (even if black) and `medium`, and the `Sun` in its sky or None.

    Writes images beside the .glb at `path`.
    """
    said, disc = {"environment": {"color": [0.0, 0.0, 0.0]}}, None
    if scene.world is not None and visibility.rendered_layer(scene).use_sky:  # the layer's filter "Environment"
        said, disc = guard.attempt(warn, f'world "{scene.world.name}"', (said, None), "it is black",
                                   _world, scene, path, warn)
    if not any(said["environment"].get("color", [1.0])):
        # A black world is opaque in Cycles; without the key it would count as none.
        said["environment"].setdefault("background", {"color": [0.0, 0.0, 0.0]})
    return said, disc


def _world(scene, path, warn):
    world, said = scene.world, {"environment": {"color": [0.0, 0.0, 0.0]}}
    where = f'world "{world.name}"'
    output = output_of(nodes_of(world))
    if output is None:
        if nodes_of(world) is None:
            said["environment"]["color"] = list(world.color)
        return said, None
    inside = medium(output.inputs["Volume"], where, warn)
    if inside is not None:
        said["medium"] = inside
    used = list(upstream(output.inputs["Surface"]).values())
    warn_of_missing({node.id_data for node, _ in used}, where, warn)
    if not used:
        return said, None
    by_ray = list(dict.fromkeys(socket for node, socket in used if node.type == "LIGHT_PATH"))
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
    where = f'world "{scene.world.name}"'
    shader, around = source(output.inputs["Surface"])
    while shader is not None and shader.type == "MIX_SHADER" and constant(shader.inputs[0], around) in {0.0, 1.0}:
        shader, around = source(shader.inputs[1 + int(constant(shader.inputs[0], around))], around)
    if shader is None:
        return {"color": [0.0, 0.0, 0.0]}, None

    def bake():
        used = upstream(output.inputs["Surface"]).values()
        images = [node.image for node, _ in used if node.type == "TEX_ENVIRONMENT"]
        least, most = _BAKED_TEXELS
        width = min(max([least, *(image.size[0] for image in images if image is not None)]), most)
        return sky.bake_world(scene, path, width, kind=name)

    said, found = _background(shader, around, path, bake, where, warn), None
    if said is None:
        found = find_sun()
        said = bake()
        warn(where, f"its nodes are baked to {said['file']}; keep that file beside the scene's file")
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
        environment["background"] = {"color": [0.0, 0.0, 0.0]}
        hidden.remove("camera")
    if hidden:
        warn(where, f"it is hidden from {', '.join(rays[name] for name in hidden)} rays in Cycles: here they meet it; "
                    "switch these rays on (World > Ray Visibility) to see the same in Cycles")


def _background(shader, around, path, bake, where, warn):
    """The environment of a Background shader in the groups `around` with one colour or one rotated environment texture,
    which `bake` writes if the program cannot read its image; None for others."""
    if shader.type not in {"BACKGROUND", "EMISSION"} or constant(shader.inputs["Strength"], around) is None:
        return None
    strength = constant(shader.inputs["Strength"], around)
    colour = constant(shader.inputs["Color"], around)
    if colour is not None:
        return {"color": positive([c * strength for c in colour], lambda what: warn(where, what))}
    texture, around = source(shader.inputs["Color"], around)
    if texture.type == "TEX_ENVIRONMENT" and texture.image is not None and texture.image.source not in _STILL:
        return None
    if texture.type == "TEX_ENVIRONMENT" and is_missing(texture.image):
        return {"color": [strength, 0.0, strength]}  # magenta, as in Cycles
    if texture.type != "TEX_ENVIRONMENT" or texture.projection != "EQUIRECTANGULAR":
        return None
    turn = _turn(texture.inputs["Vector"], around)
    if turn is None or strength < 0:
        return None
    file = _write_linear(texture.image, path)
    return {"file": file, "rotation_deg": turn, "strength": strength} if file is not None else bake()


def _turn(socket, around):
    """Rotation in degrees about the vertical by the nodes before an environment texture, or None if they do more."""
    output, around = source_socket(socket, around)
    if output is None or not output.is_output:
        return 0.0
    node = output.node
    if node.type == "TEX_COORD":
        return 0.0 if output.name == "Generated" else None
    if node.type != "MAPPING" or node.vector_type not in {"POINT", "TEXTURE", "VECTOR", "NORMAL"}:
        return None
    rotation = constant(node.inputs["Rotation"], around)
    scale = constant(node.inputs["Scale"], around)
    shift = constant(node.inputs["Location"], around) if "Location" in node.inputs else (0, 0, 0)
    moved = node.vector_type in {"POINT", "TEXTURE"} and shift != (0, 0, 0)
    if rotation is None or scale != (1, 1, 1) or any(rotation[:2]) or moved:
        return None
    before = _turn(node.inputs["Vector"], around)
    # A point mapping rotates the lookup direction, so the image rotates by the negative angle.
    return None if before is None else before + math.degrees(rotation[2]) * (1 if node.vector_type == "TEXTURE" else -1)


def _write_linear(image, path):
    """Write an image of linear values beside the .glb at `path`, as Radiance or OpenEXR. Returns the file's name, or
    None for images of bytes, which Cycles has to convert."""
    stem = os.path.splitext(os.path.basename(path))[0]
    ending, data = _ENDINGS.get(image.file_format), None
    if image.packed_file is not None:
        data = image.packed_file.data
    elif image.source == "FILE" and os.path.isfile(bpy.path.abspath(image.filepath)):
        with open(bpy.path.abspath(image.filepath), "rb") as file:
            data = file.read()
    if ending and data and image.colorspace_settings.name in _LINEAR:
        name = sky.unused_name(path, f"{stem}.environment{ending}")
        with open(os.path.join(os.path.dirname(path), name), "wb") as file:
            file.write(data)
        return name
    if not image.is_float or image.channels != 4:
        return None
    name = sky.unused_name(path, f"{stem}.environment.exr")
    flat = bpy.data.images.new(name, *image.size, float_buffer=True)
    try:
        flat.colorspace_settings.name = "Non-Color"  # Blender has converted the values when it read the file.
        flat.pixels.foreach_set(texels(image).ravel())
        flat.file_format = "OPEN_EXR"
        flat.filepath_raw = os.path.join(os.path.dirname(path), name)
        flat.save()
    finally:
        bpy.data.images.remove(flat)
    return name
