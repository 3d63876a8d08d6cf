"""Lights, cameras and the world in terms of what glTF and `extras.caustique` can say."""

import math
import os

import bpy
from mathutils import Matrix

from shading import constant, medium, nodes_of, output_of, source

_DISC_SIDES = 64


def emission_node(light):
    """The Emission node that shades a lamp, or None."""
    output = output_of(nodes_of(light))
    shader = source(output.inputs["Surface"]) if output is not None else None
    return shader if shader is not None and shader.type == "EMISSION" else None


def _power(light):
    """What a lamp gives off, per channel: W, or W/m2 of the sun."""
    power = light.energy * 2 ** getattr(light, "exposure", 0)
    tint = list(light.color)
    if getattr(light, "use_temperature", False):
        tint = [a * b for a, b in zip(tint, light.temperature_color)]
    node = emission_node(light)
    if node is not None:
        power *= constant(node.inputs["Strength"], 1.0)
        tint = [a * b for a, b in zip(tint, constant(node.inputs["Color"], [1.0] * 3))]
    return [c * power for c in tint]


def area_radiance(light):
    """Radiance (W/sr/m2) of an area light: a Lambertian emitter of area A gives off pi L A."""
    size_x, size_y = _size(light)
    area = size_x * size_y * (math.pi / 4 if light.shape in {"DISK", "ELLIPSE"} else 1)
    if not getattr(light, "normalize", True):
        area = 1  # the energy is then per square metre
    return [p / (math.pi * area) for p in _power(light)]


def punctual(light):
    """`color` and `intensity` (cd, or lx of the sun, 683 lm/W) of a point, spot or sun lamp, nodes counted."""
    power = _power(light)
    if light.type != "SUN" and not getattr(light, "normalize", True):
        power = [p * light.area() for p in power]
    strongest = max(max(power), 1e-30)
    lumens = 683 * (1 if light.type == "SUN" else 1 / (4 * math.pi))
    return {"color": [p / strongest for p in power], "intensity": strongest * lumens}


def _size(light):
    return light.size, light.size_y if light.shape in {"RECTANGLE", "ELLIPSE"} else light.size


def area_mesh(thing, undo, warn):
    """Until `undo` closes, put a one-sided emissive mesh where the area light object `thing` shines from."""
    light, where = thing.data, f'light "{thing.name}"'
    if light.spread < math.pi * 0.999:
        warn(where, "an area light's spread is not carried: it shines as a Lambertian emitter")
    _warn_of_nodes(light, where, warn)
    size_x, size_y = _size(light)
    if light.shape in {"DISK", "ELLIPSE"}:
        turns = [-2 * math.pi * i / _DISC_SIDES for i in range(_DISC_SIDES)]
        corners = [(math.cos(t) * size_x / 2, math.sin(t) * size_y / 2, 0) for t in turns]
    else:
        corners = [(x * size_x / 2, y * size_y / 2, 0) for x, y in ((-1, -1), (-1, 1), (1, 1), (1, -1))]
    name = thing.name + " (area light)"
    mesh = bpy.data.meshes.new(name)
    undo.callback(lambda: bpy.data.meshes.remove(mesh))
    mesh.from_pydata(corners, [], [range(len(corners))])  # clockwise: the face looks down -Z, as the light does
    radiance = area_radiance(light)
    strength = max(max(radiance), 1e-30)
    material = bpy.data.materials.new(name)
    undo.callback(lambda: bpy.data.materials.remove(material))
    if bpy.app.version < (5, 0, 0):
        material.use_nodes = True
    material.use_backface_culling = True
    tree = material.node_tree
    tree.nodes.clear()
    emission = tree.nodes.new("ShaderNodeEmission")
    emission.inputs["Color"].default_value = [c / strength for c in radiance] + [1]
    emission.inputs["Strength"].default_value = strength
    tree.links.new(emission.outputs[0], tree.nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])
    mesh.materials.append(material)
    body = bpy.data.objects.new(name, mesh)
    undo.callback(lambda: bpy.data.objects.remove(body))
    bpy.context.scene.collection.objects.link(body)
    body.matrix_world = thing.matrix_world.copy()


def light_extras(thing, warn):
    """`extras.caustique` of a light's node: `radius` (m) of point and spot, `angle_deg` (whole disc) of the sun."""
    light = thing.data
    _warn_of_nodes(light, f'light "{thing.name}"', warn)
    if light.type == "SUN":
        return {"angle_deg": math.degrees(light.angle)} if light.angle > 0 else {}
    return {"radius": light.shadow_soft_size} if light.shadow_soft_size > 0 else {}


def _warn_of_nodes(light, where, warn):
    output = output_of(nodes_of(light))
    if output is None or source(output.inputs["Surface"]) is None:
        return
    node = emission_node(light)
    if node is None or any(constant(node.inputs[name]) is None for name in ("Color", "Strength")):
        warn(where, "its shader nodes are not carried beyond a constant Emission")


def camera_extras(thing, warn):
    """`extras.caustique` of a camera: thin-lens `aperture_radius` and `focus_distance`, metres."""
    camera, where = thing.data, f'camera "{thing.name}"'
    if camera.type == "PANO":
        warn(where, "panoramic cameras are not carried")
    if camera.shift_x or camera.shift_y:
        warn(where, "lens shift is not carried")
    if not camera.dof.use_dof:
        return {}
    # Cycles: half of focal length over f-number; an orthographic camera counts as having a focal length of one unit.
    focal = camera.lens * 1e-3 if camera.type == "PERSP" else 1.0
    focus = camera.dof.focus_distance
    if camera.dof.focus_object is not None:
        axis = thing.matrix_world.col[2].xyz.normalized()
        focus = abs(axis.dot(camera.dof.focus_object.matrix_world.translation - thing.matrix_world.translation))
    if camera.dof.aperture_blades:
        warn(where, "the shape of the aperture is not carried: it is round")
    return {"aperture_radius": focal / (2 * camera.dof.aperture_fstop), "focus_distance": focus}


def world_extras(scene, path, warn):
    """`extras.caustique` of the scene: `environment`, also where it is black, and `medium`. Images are put beside the .glb at `path`."""
    world, said = scene.world, {"environment": {"color": [0.0, 0.0, 0.0]}}
    if world is None:
        return said
    where = f'world "{world.name}"'
    output = output_of(nodes_of(world))
    if output is None:
        if nodes_of(world) is None:
            said["environment"]["color"] = list(world.color)
        return said
    inside = medium(source(output.inputs["Volume"]), where, warn)
    if inside is not None:
        said["medium"] = inside
    shader = source(output.inputs["Surface"])
    if shader is None:
        return said
    said["environment"] = _background(shader, path)
    if said["environment"] is None:
        said["environment"] = _baked(scene, path)
        warn(where, f"its nodes are baked to {said['environment']['file']}")
    return said


def _background(shader, path):
    """What a plain Background shader says: one colour, or one environment texture turned about the vertical."""
    if shader.type not in {"BACKGROUND", "EMISSION"} or constant(shader.inputs["Strength"]) is None:
        return None
    strength = constant(shader.inputs["Strength"])
    colour = constant(shader.inputs["Color"])
    if colour is not None:
        return {"color": [c * strength for c in colour]}
    texture = source(shader.inputs["Color"])
    if texture.type != "TEX_ENVIRONMENT" or texture.image is None or texture.projection != "EQUIRECTANGULAR":
        return None
    turn = _turn(texture.inputs["Vector"])
    if turn is None:
        return None
    return {"file": _beside(texture.image, path), "rotation_deg": turn, "strength": strength}


def _turn(socket):
    """Degrees by which the nodes before an environment texture turn it about the vertical, or None."""
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
    if rotation is None or scale != [1, 1, 1] or any(rotation[:2]) or (node.vector_type in {"POINT", "TEXTURE"} and shift != [0, 0, 0]):
        return None
    before = _turn(node.inputs["Vector"])
    # A point mapping turns the direction that looks the image up, so the image turns the other way.
    return None if before is None else before + math.degrees(rotation[2]) * (1 if node.vector_type == "TEXTURE" else -1)


def _beside(image, path):
    """Put an image beside the .glb at `path`, as Radiance or OpenEXR; its file name there."""
    stem = os.path.splitext(os.path.basename(path))[0]
    kind = {"HDR": ".hdr", "OPEN_EXR": ".exr", "OPEN_EXR_MULTILAYER": None}.get(image.file_format)
    data = None
    if image.packed_file is not None:
        data = image.packed_file.data
    elif image.source == "FILE" and os.path.isfile(bpy.path.abspath(image.filepath)):
        with open(bpy.path.abspath(image.filepath), "rb") as file:
            data = file.read()
    if kind and data:
        name = f"{stem}.environment{kind}"
        with open(os.path.join(os.path.dirname(path), name), "wb") as file:
            file.write(data)
        return name
    name = f"{stem}.environment.exr"
    flat = bpy.data.images.new(name, *image.size, float_buffer=True)
    try:
        pixels = list(image.pixels)
        if image.colorspace_settings.name == "sRGB" and not image.is_float:
            pixels = [v if i % 4 == 3 else _linear(v) for i, v in enumerate(pixels)]
        flat.colorspace_settings.name = "Non-Color"  # save the numbers as they are
        flat.pixels = pixels
        flat.file_format = "OPEN_EXR"
        flat.filepath_raw = os.path.join(os.path.dirname(path), name)
        flat.save()
    finally:
        bpy.data.images.remove(flat)
    return name


def _linear(value):
    return value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4


def _baked(scene, path, width=1024):
    """Render the world alone with a panoramic Cycles camera to an .exr beside the .glb."""
    name = os.path.splitext(os.path.basename(path))[0] + ".environment.exr"
    stage = bpy.data.scenes.new("world")
    camera = bpy.data.cameras.new("world")
    eye = bpy.data.objects.new("world", camera)
    try:
        stage.world = scene.world
        stage.collection.objects.link(eye)
        stage.camera = eye
        # Looking along +X with +Z up puts the directions where an equirectangular texture expects them.
        eye.matrix_world = Matrix(((0, 0, -1, 0), (-1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 0, 1)))
        camera.type = "PANO"
        (camera if hasattr(camera, "panorama_type") else camera.cycles).panorama_type = "EQUIRECTANGULAR"
        stage.render.engine = "CYCLES"
        stage.cycles.samples = 16
        stage.cycles.use_denoising = False
        stage.render.resolution_x, stage.render.resolution_y = width, width // 2
        stage.render.resolution_percentage = 100
        settings = stage.render.image_settings
        if hasattr(settings, "media_type"):
            settings.media_type = "IMAGE"
        settings.file_format, settings.color_mode, settings.color_depth = "OPEN_EXR", "RGB", "32"
        stage.render.filepath = os.path.join(os.path.dirname(path), name)
        bpy.ops.render.render(write_still=True, scene=stage.name)
    finally:
        bpy.data.scenes.remove(stage)
        bpy.data.objects.remove(eye)
        bpy.data.cameras.remove(camera)
    return {"file": name, "rotation_deg": 0, "strength": 1}
