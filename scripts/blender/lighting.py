"""Blender's lamps as glTF lights and keys of `extras.caustique`."""

import math

import bpy  # first: it makes the others importable

import numpy
from mathutils import Vector

import export_guard as guard
import lamp_nodes
import lamp_pictures
import lamp_profiles
from graph import FUNCTIONS
from shading import constant, nodes_of, output_of, positive, source, upstream

_DISC_SIDES = 64
# Cells along each side of an area lamp with a picture.
_CELLS = 16
# Distance, in radii of a lamp, within which soft falloff removes more than 2 % of the light: r^2 / (d^2 + r^2) at d.
_SOFT_RADII = 7


def _emission(light):
    """Strength and colour of the Emission node of a lamp, each None if it varies; (None, None) for other nodes."""
    output = output_of(nodes_of(light))
    shader, path = source(output.inputs["Surface"]) if output is not None else (None, ())
    if shader is None or shader.type != "EMISSION":
        return None, None
    return constant(shader.inputs["Strength"], path), _colour(shader.inputs["Color"], path)


def _power(light, factors):
    """Power of a lamp per channel: W, or W/m2 for a sun. `factors`: {lamp: measured factors of its nodes}."""
    power = light.energy * 2 ** getattr(light, "exposure", 0)
    tint = list(light.color)
    if getattr(light, "use_temperature", False):
        tint = [a * b for a, b in zip(tint, light.temperature_color)]
    strength, colour = _emission(light)
    if light.name in factors:
        tint = [a * b for a, b in zip(tint, factors[light.name])]
    elif strength is not None and colour is not None:
        tint = [a * b * strength for a, b in zip(tint, colour)]
    return [c * power for c in tint]


def _colour(socket, path):
    """The colour of a constant socket or of a blackbody of constant temperature, else None."""
    node, inner = source(socket, path)
    if node is None or node.type != "BLACKBODY":
        return constant(socket, path)
    temperature = constant(node.inputs["Temperature"], inner)
    if temperature is None:
        return None
    colours = blackbodies([temperature])
    return colours and colours[0]


def blackbodies(temperatures):
    """The colours of blackbodies, of luminance 1; None before Blender 4.5."""
    if "temperature" not in bpy.types.Light.bl_rna.properties:
        return None
    bulb = bpy.data.lights.new("blackbody", "POINT")
    try:
        bulb.use_temperature, colours = True, []
        for bulb.temperature in temperatures:
            colours.append([max(c, 0.0) for c in bulb.temperature_color])
        return colours
    finally:
        bpy.data.lights.remove(bulb)


def area_radiance(light, power, scale):
    """Radiance L (W/sr/m2) of an area light, from its power pi L A per channel. `scale`: the object's scale."""
    size_x, size_y = _size(light)
    area = size_x * scale[0] * size_y * scale[1] * (math.pi / 4 if light.shape in {"DISK", "ELLIPSE"} else 1)
    if not getattr(light, "normalize", True):
        area = 1  # the energy is per square metre
    return [p / (math.pi * area) for p in power]


def punctual(light, power):
    """`color` and `intensity` (cd, or lx for a sun, at 683 lm/W) of a point, spot or sun lamp. `power`: per channel."""
    if not getattr(light, "normalize", True):
        power = [p * light.area() for p in power]
    strongest = max(max(power), 1e-30)
    lumens = 683 * (1 if light.type == "SUN" else 1 / (4 * math.pi))
    return {"color": [p / strongest for p in power], "intensity": strongest * lumens}


def _size(light):
    return light.size, light.size_y if light.shape in {"RECTANGLE", "ELLIPSE"} else light.size


def add_lamps(flat, warn):
    """Prepare the lamps of a flat scene for the glTF exporter: area lamps become meshes, others get extras."""
    for thing in [t for t in flat.things if t.type == "LIGHT"]:
        guard.attempt(warn, flat.where(thing), None, "it may shine differently from Cycles, or not at all",
                      _add_lamp, thing, flat, warn)


def _add_lamp(thing, flat, warn):
    light = thing.data
    if light.type == "AREA" and getattr(light.cycles, "is_portal", False):
        warn(flat.where(thing), "it is a portal, which guides Cycles' samples of the sky: it is left out; "
                                                            "nothing is lost, because the sky is sampled without "
                                                            "portals")
        flat.remove(thing)
        return
    _warn_of(thing, flat.where(thing), warn)
    picture, profile = None, _add_profile(thing, flat)
    if not profile:
        picture = guard.attempt(warn, flat.where(thing), None, "its picture is not carried", _add_picture, thing, flat)
        if picture is None:
            _measure_nodes(thing, flat, warn)
    power = positive(_power(light, flat.lamp_factors), lambda what: warn(flat.where(thing), what))
    if light.type == "AREA":
        _area_mesh(thing, flat, power, picture)
        flat.remove(thing)
        return
    # Blender's exporter misreads nodes, and fails on groups of them.
    thing.data = flat.remove_later(light.copy())
    lamp_nodes.switch_nodes_off(thing.data)
    flat.lamps[thing.data.name] = {"name": light.name, **punctual(light, power)}
    if light.type == "SUN":
        flat.add_extras(thing, angle_deg=math.degrees(light.angle))
    else:
        flat.add_extras(thing, radius=light.shadow_soft_size)
        if light.type == "SPOT":
            flat.add_extras(thing, blend=light.spot_blend)
        if light.shadow_soft_size > 0:
            flat.add_extras(thing, **{"bulb" if profile or light.type == "SPOT" else "null_bsdf": True})


def _add_profile(thing, flat):
    """Carry a lamp with an IES profile and a constant colour. Returns whether that is all that its nodes do."""
    _, colour = _emission(thing.data)
    factor = lamp_profiles.add(thing, flat) if colour is not None else None
    if factor is None:
        return False
    flat.lamp_factors[thing.data.name] = [c * factor for c in colour]
    return True


def _add_picture(thing, flat):
    """Carry a lamp whose nodes vary its light over its cone or its surface. Returns None if they do not; for an area lamp
    its picture (`lamp_pictures.measure`), relative to the brightest value."""
    light = thing.data
    if light.type == "SPOT":
        peak, picture = lamp_pictures.add(thing, flat), True
    else:
        picture = lamp_pictures.measure(light, [abs(s) for s in thing.matrix_world.to_scale()[:2]])
        peak = None if picture is None else float(picture.max())
    if peak is None:
        return None
    flat.lamp_factors[light.name] = [peak] * 3
    return picture if picture is True else picture / peak


def _area_mesh(thing, flat, power, picture=None):
    """A one-sided emissive mesh in place of an area lamp, with the picture of its light if it varies."""
    light, scale = thing.data, thing.matrix_world.to_scale()
    size_x, size_y = _size(light)
    if light.shape in {"DISK", "ELLIPSE"}:
        turns = [-2 * math.pi * i / _DISC_SIDES for i in range(_DISC_SIDES)]
        corners = [(math.cos(t) * size_x / 2, math.sin(t) * size_y / 2, 0) for t in turns]
        faces = [range(_DISC_SIDES)]
    else:
        # Cells of a picture are lights of their own, which are sampled by their power.
        n = _CELLS if picture is not None else 1
        corners = [((j / n - 0.5) * size_x, (i / n - 0.5) * size_y, 0) for i in range(n + 1) for j in range(n + 1)]
        faces = [(a, a + n + 1, a + n + 2, a + 1) for a in (i * (n + 1) + j for i in range(n) for j in range(n))]
    name = flat.names[thing.name] + " (area light)"
    mesh = flat.remove_later(bpy.data.meshes.new(name))
    mesh.from_pydata(corners, [], faces)  # clockwise: the face points along -Z, as the light does
    radiance = area_radiance(light, power, [abs(s) for s in scale[:2]])
    strength = max(max(radiance), 1e-30)
    material = flat.remove_later(bpy.data.materials.new(name))
    if bpy.app.version < (5, 0, 0):
        material.use_nodes = True
    material.use_backface_culling = True
    material["caustique"] = {"null_bsdf": True}
    if light.spread < math.pi:
        material["caustique"] = {"null_bsdf": True, "spread_deg": math.degrees(light.spread)}
    tree = material.node_tree
    tree.nodes.clear()
    emission = tree.nodes.new("ShaderNodeEmission")
    emission.inputs["Color"].default_value = [c / strength for c in radiance] + [1]
    emission.inputs["Strength"].default_value = strength
    if picture is not None:
        _put_picture(mesh, tree, emission, (size_x, size_y), picture * [c / strength for c in radiance], flat)
    tree.links.new(emission.outputs[0], tree.nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])
    mesh.materials.append(material)
    # A mirrored transform keeps the front, because the lamp still emits along its local -Z.
    body = flat.add(name, mesh, thing.matrix_world.copy(), flat.hidden[thing.name], flat.groups[thing.name])
    flat.keys[body.name] = flat.keys.get(thing.name)
    flat.motion.pass_on(thing, body)


def _put_picture(mesh, tree, emission, size, picture, flat):
    """Make an emissive mesh shine with a picture, relative to its strength, that is seen from its front."""
    height, width, _ = picture.shape
    image = flat.remove_later(bpy.data.images.new(mesh.name, width, height))
    pixels = numpy.ones((height, width, 4), numpy.float32)
    pixels[..., :3] = lamp_pictures.encoded(picture)
    image.pixels.foreach_set(pixels.ravel())
    image.pack()
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image, node.extension = image, "EXTEND"
    tree.links.new(node.outputs["Color"], emission.inputs["Color"])
    layer = mesh.uv_layers.new(name="picture")
    for loop in mesh.loops:
        x, y, _ = mesh.vertices[loop.vertex_index].co
        # Seen from the front, X is to the left.
        layer.data[loop.index].uv = (0.5 - x / size[0], 0.5 + y / size[1])


def _warn_of(thing, where, warn):
    """Warn of a lamp's features that are lost."""
    light, scale = thing.data, [abs(s) for s in thing.matrix_world.to_scale()]
    if not getattr(light, "use_shadow", True):
        warn(where, "it casts no shadows in Cycles: here it does; "
                    "move it to where nothing blocks it")
    if light.type == "SPOT" and max(scale) > 1.001 * min(scale):
        warn(where, "a spot's uneven scale is not carried: its cone is round; "
                    "apply its scale (Object > Apply > Scale)")


def _measure_nodes(thing, flat, warn):
    """Measure a lamp whose nodes are more than an Emission of constant strength and colour."""
    light = thing.data
    output = output_of(nodes_of(light))
    if output is None or light.name in flat.lamp_factors:
        return
    if None not in _emission(light):
        return
    distance = _usual_distance(thing, flat)
    depsgraph, place = bpy.context.evaluated_depsgraph_get(), thing.matrix_world
    axes = place.to_3x3().normalized()

    def lights_scene(direction):
        return flat.scene.ray_cast(depsgraph, place.translation, axes @ direction)[0]

    flat.lamp_factors[light.name] = lamp_nodes.strength(light, distance, lights_scene)
    kinds = {n.type for n, _ in upstream(output.inputs["Surface"]).values()}
    if not kinds <= FUNCTIONS | {"EMISSION", "ADD_SHADER", "MIX_SHADER"}:
        what = "its IES profile is not carried" if "TEX_IES" in kinds else "its shader nodes are not carried"
        warn(flat.where(thing), f"{what}: it shines alike in all directions, with the mean strength of those that "
             f"meet objects, at {distance:.3g} m; "
             "give the nodes to a spot or an area light, whose pictures are carried")


def _usual_distance(thing, flat):
    """Median distance (m) of a lamp from the middles of the scene's meshes, at least ten times its size."""
    light, at = thing.data, thing.matrix_world.translation
    size = max(_size(light)) if light.type == "AREA" else getattr(light, "shadow_soft_size", 0.0)
    away = sorted((body.matrix_world @ (sum((Vector(c) for c in body.bound_box), Vector()) / 8) - at).length
                  for body in flat.things if body.type == "MESH")
    return max(away[len(away) // 2] if away else 1.0, 10 * size, 0.1)


def warn_of_soft_falloff(flat, warn):
    """Warn of lamps with objects near enough for Blender's soft falloff to dim their light visibly."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    bodies = [thing for thing in flat.things if thing.type == "MESH"]
    for thing in flat.things:
        light = thing.data
        if thing.type != "LIGHT" or not getattr(light, "use_soft_falloff", False) or light.shadow_soft_size <= 0:
            continue
        reach = _SOFT_RADII * light.shadow_soft_size
        near = next((body for body in bodies if _within(body, thing.matrix_world.translation, reach, depsgraph)), None)
        if near is not None:
            warn(flat.where(thing), f"its soft falloff is not carried: {flat.where(near)} is within {reach:.3g} m of "
                 "it and gets more light than in Cycles; switch Soft Falloff off to see the same in both")


def _within(body, point, reach, depsgraph):
    """Whether a mesh object comes within `reach` (m) of a point."""
    inverse = body.matrix_world.inverted_safe()
    found, at, _, _ = body.closest_point_on_mesh(inverse @ point, depsgraph=depsgraph)
    return found and (body.matrix_world @ at - point).length < reach
