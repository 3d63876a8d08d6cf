"""Features of scenes: lamps, worlds, cameras, shapes, visibility, media, and textures that depend on objects."""

import math

import bpy  # First, because it brings the others.

import numpy
from mathutils import Vector

from .torture_relief import waves
from .torture_stage import feature, matt, put

GREY = {"Base_Color": (0.6, 0.6, 0.6)}


def _lamp(stage, kind, energy, at, towards=(0, 0, 0.5), **settings):
    lamp = bpy.data.lights.new("added", kind)
    lamp.energy = energy
    for name, value in settings.items():
        setattr(lamp, name, value)
    stage.place("added", lamp, at, towards)
    stage.principled(**GREY)
    return lamp


def _world_node(stage, kind, source=None, **settings):
    """Make a node the colour of the world, with the directions `source` or its own."""
    tree = stage.scene.world.node_tree
    node = tree.nodes.new("ShaderNode" + kind)
    for name, value in settings.items():
        setattr(node, name, value)
    if source is not None:
        tree.links.new(source, node.inputs["Vector"])
    tree.links.new(node.outputs[0], stage.background.inputs["Color"])
    stage.principled(**GREY)


def _turned(stage, rotation):
    """The directions of the world, rotated."""
    tree = stage.scene.world.node_tree
    place, turn = tree.nodes.new("ShaderNodeTexCoord"), tree.nodes.new("ShaderNodeMapping")
    turn.inputs["Rotation"].default_value = rotation
    tree.links.new(place.outputs["Generated"], turn.inputs["Vector"])
    return turn.outputs[0]


def _gradient(stage, size=512):
    """An image whose red and green grow along v and u."""
    rows, columns = numpy.mgrid[0:size, 0:size] / size
    return stage.image("gradient", numpy.dstack([rows, columns, 0.3 + 0 * rows]))


def _normals(stage, **settings):
    return stage.node("NormalMap", Color=stage.node("TexImage", image=waves(stage, 0.4)), **settings)


@feature
def sun_soft(stage):
    _lamp(stage, "SUN", 3, (3, -2, 3), angle=math.radians(10))


@feature
def spot_edge(stage):
    _lamp(stage, "SPOT", 800, (-2, -2, 4), spot_size=0.6, spot_blend=0.5, shadow_soft_size=0.1, use_soft_falloff=False)


@feature
def point_size(stage):
    _lamp(stage, "POINT", 150, (-1.5, -1.5, 2.5), shadow_soft_size=0.2, use_soft_falloff=False)


def _profile(stage, text):
    """A point lamp that shines with an IES profile."""
    lamp = _lamp(stage, "POINT", 150, (-1.5, -1.5, 2.5), shadow_soft_size=0.05)
    if bpy.app.version < (5, 1, 0):
        lamp.use_nodes = True
    tree = lamp.node_tree
    tree.nodes.clear()
    profile, emission, output = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("TexIES", "Emission", "OutputLight"))
    profile.ies = bpy.data.texts.new("profile")
    profile.ies.write(text)
    tree.links.new(profile.outputs[0], emission.inputs["Strength"])
    tree.links.new(emission.outputs[0], output.inputs[0])


def _profile_alone(stage, text):
    """A point lamp that shines with an IES profile, alone in a dim world."""
    _profile(stage, text)
    stage.background.inputs["Strength"].default_value = 0.05
    bpy.data.objects.remove(stage.lamp)


@feature
def lamp_ies(stage):
    _profile(
        stage, "IESNA:LM-63-2002\nTILT=NONE\n1 1000 1 5 1 1 2 0 0 0 1 1 100\n0 30 60 90 180\n0\n1000 800 300 10 0\n"
    )


@feature
def lamp_ies_uneven(stage):
    """A narrow beam, measured at uneven angles."""
    _profile_alone(
        stage,
        "IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 7 1 1 2 0 0 0 1 1 100\n"
        "0 5 10 12.5 30 60 90\n0\n1000 2000 1500 100 50 5 0\n",
    )


@feature
def lamp_ies_turned(stage):
    """A profile that is mirrored at a plane."""
    _profile_alone(
        stage,
        "IESNA:LM-63-2002\nTILT=NONE\n1 1000 1 4 3 1 2 0 0 0 1 1 100\n"
        "0 30 60 90\n0 90 180\n1000 800 300 10\n1000 400 100 10\n1000 200 10 5\n",
    )


@feature
def lamp_disc_spread(stage):
    stage.lamp.data.shape, stage.lamp.data.spread = "DISK", math.radians(60)
    stage.principled(**GREY)


@feature
def lamp_scaled(stage):
    stage.lamp.data.shape, stage.lamp.data.size_y, stage.lamp.scale = "RECTANGLE", 0.4, (0.5, 2, 1)
    stage.principled(**GREY)


@feature
def lamp_seen_in_mirror(stage):
    stage.lamp.visible_camera = False
    stage.principled(Base_Color=(0.9, 0.9, 0.9), Metallic=1.0, Roughness=0.0)


@feature
def lamp_without_shadow(stage):
    stage.lamp.data.use_shadow = False
    stage.principled(**GREY)


@feature
def light_linking(stage):
    lit = bpy.data.collections.new("lit")
    lit.objects.link(stage.floor)
    stage.lamp.light_linking.receiver_collection = lit
    stage.principled(**GREY)


@feature
def light_linking_except(stage):
    """All objects but the body receive the light of the lamp; the body also shines on the floor alone."""
    unlit, lit = (bpy.data.collections.new(name) for name in ("unlit", "lit"))
    unlit.objects.link(stage.body)
    unlit.collection_objects[0].light_linking.link_state = "EXCLUDE"
    stage.lamp.light_linking.receiver_collection = unlit
    lit.objects.link(stage.floor)
    stage.body.light_linking.receiver_collection = lit
    stage.principled(**GREY, Emission_Color=(1, 0.5, 0.1), Emission_Strength=2.0)


@feature
def shadow_linking(stage):
    """The body does not block the light of the lamp."""
    clear = bpy.data.collections.new("clear")
    clear.objects.link(stage.body)
    clear.collection_objects[0].light_linking.link_state = "EXCLUDE"
    stage.lamp.light_linking.blocker_collection = clear
    stage.principled(**GREY)


@feature
def shadow_linking_only(stage):
    """Only the floor blocks the light of the lamp, and only the body that of a glowing sheet below the floor."""
    floor, body = (bpy.data.collections.new(name) for name in ("floor", "body"))
    floor.objects.link(stage.floor)
    body.objects.link(stage.body)
    stage.lamp.light_linking.blocker_collection = floor
    sheet = bpy.data.meshes.new("sheet")
    sheet.from_pydata([(-2, -3, 0), (1, -3, 0), (1, 0, 0), (-2, 0, 0)], [], [(0, 1, 2, 3)])
    sheet.materials.append(stage.material_of(lambda: stage.surface(stage.emission((1, 0.6, 0.2), 3))))
    stage.place("sheet", sheet, (0, 0, -0.7)).light_linking.blocker_collection = body
    stage.principled(Base_Color=(0.9, 0.9, 0.9), Metallic=1.0, Roughness=0.2)


@feature
def world_gradient(stage):
    _world_node(stage, "TexGradient", _turned(stage, (0, -math.pi / 2, 0.3)))


@feature
def world_image_tilted(stage):
    _world_node(stage, "TexEnvironment", _turned(stage, (0.4, 0, 1)), image=_gradient(stage, 128))


@feature
def world_for_cameras(stage):
    tree = stage.scene.world.node_tree
    mix, path, other = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("MixShader", "LightPath", "Background"))
    other.inputs["Color"].default_value = (1, 0, 0, 1)
    for output, socket in zip(
        (path.outputs["Is Camera Ray"], stage.background.outputs[0], other.outputs[0]), mix.inputs
    ):
        tree.links.new(output, socket)
    end = next(node for node in tree.nodes if node.type == "OUTPUT_WORLD")
    tree.links.new(mix.outputs[0], end.inputs["Surface"])
    stage.camera.location, stage.camera.rotation_euler = (0, -6, 1.5), (math.radians(88), 0, 0)
    stage.principled(**GREY)


@feature
def world_fog(stage):
    tree = stage.scene.world.node_tree
    fog = tree.nodes.new("ShaderNodeVolumeScatter")
    fog.inputs["Density"].default_value = 0.1
    tree.links.new(fog.outputs[0], next(node for node in tree.nodes if node.type == "OUTPUT_WORLD").inputs["Volume"])
    stage.background.inputs["Color"].default_value = (0, 0, 0, 1)
    stage.principled(**GREY)


@feature
def camera_orthographic(stage):
    stage.camera.data.type, stage.camera.data.ortho_scale = "ORTHO", 2.5
    stage.principled(**GREY)


@feature
def camera_shifted(stage):
    stage.scene.render.resolution_x = stage.scene.render.resolution_y = 32
    stage.camera.data.shift_x, stage.camera.data.shift_y = 0.2, -0.1
    stage.principled(**GREY)


@feature
def camera_focus(stage):
    focus = stage.camera.data.dof
    focus.use_dof, focus.focus_distance, focus.aperture_fstop = True, 2.5, 0.2
    stage.principled(**GREY)


@feature
def camera_panoramic(stage):
    stage.scene.render.resolution_x = stage.scene.render.resolution_y = 32
    stage.camera.data.type = "PANO"
    stage.principled(**GREY)


@feature
def camera_equirectangular(stage):
    settings = stage.camera.data
    settings.type = "PANO"
    settings = settings if hasattr(settings, "panorama_type") else settings.cycles
    settings.panorama_type = "EQUIRECTANGULAR"
    settings.longitude_min, settings.longitude_max, settings.latitude_min = -1.0, 0.5, -1.0
    stage.principled(**GREY)


@feature
def camera_in_water(stage):
    stage.floor.hide_render = stage.lamp.hide_render = True
    stage.surface(stage.glass(1.333))
    stage.camera.location = stage.body.location


@feature
def array_and_solidify(stage):
    stage.shape("plane")
    stage.principled(**GREY)
    stage.body.modifiers.new("thick", "SOLIDIFY").thickness = 0.2
    several = stage.body.modifiers.new("several", "ARRAY")
    several.count, several.relative_offset_displace = 3, (0, 0, 1.8)


@feature
def displace_modifier(stage):
    stage.principled(**GREY)
    texture = bpy.data.textures.new("clouds", "CLOUDS")
    texture.noise_scale = 0.4
    modifier = stage.body.modifiers.new("relief", "DISPLACE")
    modifier.texture, modifier.strength = texture, 0.3


@feature
def instances_by_nodes(stage):
    stage.principled(**GREY)
    tree = bpy.data.node_groups.new("instances", "GeometryNodeTree")
    for direction in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=direction, socket_type="NodeSocketGeometry")
    kinds = ("NodeGroupInput", "GeometryNodeMeshCube", "FunctionNodeRandomValue", "GeometryNodeInstanceOnPoints")
    start, cube, turn, scatter = map(tree.nodes.new, kinds)
    paint, end = tree.nodes.new("GeometryNodeSetMaterial"), tree.nodes.new("NodeGroupOutput")
    cube.inputs["Size"].default_value, turn.data_type = (0.3, 0.3, 0.3), "FLOAT_VECTOR"
    turn.inputs[1].default_value, paint.inputs["Material"].default_value = (3, 3, 3), stage.material
    for output, socket in (
        (start.outputs[0], scatter.inputs["Points"]),
        (cube.outputs[0], scatter.inputs["Instance"]),
        (turn.outputs[0], scatter.inputs["Rotation"]),
        (scatter.outputs[0], paint.inputs[0]),
        (paint.outputs[0], end.inputs[0]),
    ):
        tree.links.new(output, socket)
    stage.body.modifiers.new("instances", "NODES").node_group = tree


@feature
def shape_key(stage):
    stage.principled(**GREY)
    stage.body.shape_key_add(name="basis")
    key = stage.body.shape_key_add(name="tall")
    for point in key.data:
        point.co *= 1 if point.co.z < 0 else 1.2
    key.value = 0.7


@feature
def curve_bevelled(stage):
    stage.body.hide_render = True
    curve = bpy.data.curves.new("curve", "CURVE")
    curve.dimensions, curve.bevel_depth = "3D", 0.2
    points = curve.splines.new("BEZIER").bezier_points
    points.add(2)
    for point, place in zip(points, ((-1, 0, 0.5), (0, 0.5, 1.5), (1, 0, 0.4))):
        point.co, point.handle_left_type, point.handle_right_type = place, "AUTO", "AUTO"
        point.radius = 1 + 0.5 * place[0]
    stage.principled(**GREY)
    curve.materials.append(stage.material)
    stage.place("curve", curve)


@feature
def metaballs(stage):
    stage.body.hide_render = True
    balls = bpy.data.metaballs.new("balls")
    balls.resolution = balls.render_resolution = 0.08
    for x in (-0.4, 0.4):
        ball = balls.elements.new()
        ball.co, ball.radius = (x, 0, 0.9), 0.9
    stage.principled(**GREY)
    balls.materials.append(stage.material)
    stage.place("balls", balls)


@feature
def collection_instance_scaled(stage):
    stage.principled(**GREY)
    inside = bpy.data.collections.new("inside")
    stage.scene.collection.objects.unlink(stage.body)
    inside.objects.link(stage.body)
    copy = stage.place("copy", None)
    copy.instance_type, copy.instance_collection = "COLLECTION", inside
    copy.scale, copy.rotation_euler = (0.7, 1, 0.8), (0, 0.1, 0.2)


@feature
def material_of_object(stage):
    stage.principled(Base_Color=(0.8, 0.1, 0.1))
    slot = stage.body.material_slots[0]
    slot.link, slot.material = "OBJECT", matt("blue", (0.1, 0.1, 0.8))


@feature
def weighted_normals(stage):
    stage.shape("cube")
    stage.body.modifiers.new("bevel", "BEVEL").width = 0.15
    stage.body.data.shade_smooth()
    stage.body.modifiers.new("weights", "WEIGHTED_NORMAL")
    stage.principled(Base_Color=(0.6, 0.6, 0.6), Metallic=1.0, Roughness=0.1)


@feature
def custom_normals(stage):
    stage.body.data.normals_split_custom_set([Vector((0, 0, 1)) for _ in stage.body.data.loops])
    stage.principled(**GREY)


@feature
def smooth_cube(stage):
    stage.shape("cube")
    stage.body.data.shade_smooth()
    stage.principled(**GREY)


@feature
def faces_inwards(stage):
    stage.body.data.flip_normals()
    stage.principled(**GREY)


@feature
def hidden_from_diffuse(stage):
    stage.body.visible_diffuse = False
    stage.principled(Base_Color=(0.9, 0.1, 0.1), Emission_Color=(1, 0, 0), Emission_Strength=2.0)


@feature
def holdout_object(stage):
    stage.body.is_holdout = True
    stage.principled(**GREY)


@feature
def shadow_catcher(stage):
    stage.floor.is_shadow_catcher = True
    stage.scene.render.film_transparent = True
    stage.principled(**GREY)


@feature
def metal_rough(stage):
    stage.principled(Base_Color=(0.9, 0.9, 0.9), Metallic=1.0, Roughness=0.6)


@feature
def coat_over_metal(stage):
    stage.principled(Base_Color=(0.9, 0.4, 0.2), Metallic=1.0, Roughness=0.2, Coat_Weight=1.0, Coat_Roughness=0.1)


@feature
def coat_rough(stage):
    stage.principled(Base_Color=(0.05, 0.1, 0.3), Roughness=0.2, Coat_Weight=1.0, Coat_Roughness=0.5)


@feature
def coat_over_white(stage):
    stage.principled(Base_Color=(0.9, 0.9, 0.9), Specular_IOR_Level=0.0, Coat_Weight=1.0)


@feature
def coat_over_glow(stage):
    stage.principled(Emission_Color=(1, 0.6, 0.3), Emission_Strength=2.0, Coat_Weight=1.0)


@feature
def coat_over_bump(stage):
    relief = stage.node("Bump", Distance=0.1, Height=stage.node("TexNoise", Scale=3.0).outputs[0])
    stage.principled(Base_Color=(0.5, 0.1, 0.1), Coat_Weight=1.0, Coat_Roughness=0.1, Normal=relief)


@feature
def fog_in_cube(stage):
    stage.shape("cube")
    stage.output("Volume", stage.node("VolumeScatter", Color=(0.8, 0.8, 0.9), Density=1.0, Anisotropy=0.3))


@feature
def glass_milky(stage):
    stage.principled(Base_Color=(1, 1, 1), Roughness=0.0, Transmission_Weight=1.0, IOR=1.33)
    stage.output("Volume", stage.node("VolumeScatter", Color=(0.9, 0.8, 0.7), Density=3.0))


@feature
def glass_mirrored(stage):
    stage.surface(stage.glass(1.5))
    stage.body.scale = (-1, 1, 1)


@feature
def glass_of_low_index(stage):
    stage.surface(stage.glass(0.8))


@feature
def glass_of_index_one(stage):
    stage.principled(Base_Color=(0.5, 0.8, 0.9), IOR=1.0, Transmission_Weight=1.0, Roughness=0.0)


@feature
def normal_map_scaled(stage):
    stage.principled(Base_Color=(0.6, 0.6, 0.6), Roughness=0.4, Normal=_normals(stage))
    stage.body.scale = (1, 1.2, 0.6)


@feature
def normal_map_other_uv(stage):
    for corner in stage.body.data.uv_layers.new(name="other").data:
        corner.uv = (corner.uv[1] * 2, corner.uv[0])
    stage.principled(Base_Color=(0.6, 0.6, 0.6), Roughness=0.4, Normal=_normals(stage, uv_map="other"))


@feature
def bump_over_normal_map(stage):
    heights = stage.node("TexNoise", Scale=5.0).outputs[0]
    relief = stage.node("Bump", Distance=0.05, Height=heights, Normal=_normals(stage))
    stage.principled(Base_Color=(0.6, 0.6, 0.6), Normal=relief)


@feature
def bumps_chained(stage):
    coarse = stage.node("Bump", Distance=0.1, Height=stage.node("TexNoise", Scale=3.0).outputs[0])
    heights = stage.node("TexNoise", Scale=9.0).outputs[0]
    fine = stage.node("Bump", Distance=0.05, invert=True, Height=heights, Normal=coarse)
    stage.principled(Base_Color=(0.6, 0.6, 0.6), Roughness=0.4, Normal=fine)


@feature
def bevel_node(stage):
    stage.shape("cube")
    stage.principled(Base_Color=(0.6, 0.6, 0.6), Roughness=0.4, Normal=stage.node("Bevel", Radius=0.2))


@feature
def object_random(stage):
    number = stage.node("ObjectInfo").outputs["Random"]
    stage.principled(Base_Color=stage.node("ValToRGB", number))
    stage.place("other", stage.body.data, (1.2, 1, 0.5)).scale = (0.4, 0.4, 0.4)


@feature
def uv_by_attribute(stage):
    place = stage.node("Attribute", attribute_name="UVMap")
    stage.principled(Base_Color=stage.node("TexImage", place.outputs["Vector"], image=_gradient(stage)))


@feature
def image_mirrored(stage):
    place = stage.node("Mapping", Vector=stage.node("TexCoord").outputs["UV"], Scale=(2.5, 2.5, 1))
    stage.principled(Base_Color=stage.node("TexImage", place, image=_gradient(stage), extension="MIRROR"))


@feature
def vertex_colours_of_corners(stage):
    layer = stage.body.data.color_attributes.new("paint", "BYTE_COLOR", "CORNER")
    for index, corner in enumerate(layer.data):
        corner.color = (index % 3 / 3 + 0.2, index % 5 / 5, 0.4, 1)
    stage.principled(Base_Color=stage.node("VertexColor", layer_name="paint").outputs[0])


@feature
def vertex_colours_without_material(stage):
    layer = stage.body.data.color_attributes.new("paint", "BYTE_COLOR", "CORNER")
    for corner in layer.data:
        corner.color = (0.9, 0.1, 0.1, 1)


@feature
def ramp_of_hues(stage):
    place = stage.node("TexGradient", stage.node("TexCoord").outputs["Generated"])
    ramp = stage.node("ValToRGB", place.outputs[0])
    ramp.color_ramp.color_mode = "HSV"
    for element, colour in zip(ramp.color_ramp.elements, ((0.8, 0.1, 0.1, 1), (0.1, 0.3, 0.9, 1))):
        element.color = colour
    stage.principled(Base_Color=ramp)


@feature
def mix_soft_light(stage):
    node = stage.node("Mix", data_type="RGBA", blend_type="SOFT_LIGHT")
    noise = stage.node("TexNoise", Scale=4.0).outputs["Color"]
    for index, value in ((0, 1.0), (6, noise), (7, (0.7, 0.5, 0.2))):
        put(stage.tree, value, node.inputs[index])
    stage.principled(Base_Color=node.outputs[2])


@feature
def two_sided(stage):
    stage.shape("plane")
    side = stage.node("NewGeometry").outputs["Backfacing"]
    stage.mix(side, stage.diffuse((0.8, 0.1, 0.1)), stage.diffuse((0.1, 0.1, 0.8)))
    back = stage.place("back", stage.body.data, (1.1, 0.3, 0.9))
    back.rotation_euler, back.scale = (math.pi + 0.7, 0, 0), (0.4, 0.4, 0.4)
