"""Features of textures: varying inputs, coordinates, and nodes between textures and shaders."""

import bpy
import numpy

from .torture_relief import waves
from .torture_stage import feature, put


def _checks(stage, data=False, colours=((0.9, 0.2, 0.1), (0.1, 0.3, 0.8)), cells=4, size=512, alpha=None):
    """An image of squares in two stored colours; the second one may be transparent."""
    rows, columns = numpy.mgrid[0:size, 0:size] * cells // size
    odd = ((rows + columns) % 2)[..., None]
    pixels = numpy.where(odd, colours[1], colours[0])
    if alpha is not None:
        pixels = numpy.concatenate([pixels, numpy.where(odd, alpha, 1.0)], axis=2)
    return stage.image("checks", pixels, data)


def _image(stage, *arguments, **options):
    """A texture node with an image of squares."""
    return stage.node("TexImage", image=_checks(stage, *arguments, **options))


def _noise(stage, **inputs):
    return stage.node("TexNoise", **{"Scale": 3.0, **inputs})


def _coordinates(stage, output):
    return stage.node("TexCoord").outputs[output]


def _by(stage, coordinates):
    """A checker texture at these coordinates, as the base colour."""
    checker = stage.node("TexChecker", Vector=coordinates, Color1=(0.8, 0.7, 0.1), Color2=(0.1, 0.2, 0.5), Scale=3.0)
    stage.principled(Base_Color=checker.outputs["Color"], Roughness=0.5)


@feature
def image(stage):
    stage.principled(Base_Color=_image(stage))


@feature
def image_coarse(stage):
    stage.principled(Base_Color=_image(stage, size=32))


@feature
def image_tiled(stage):
    move = stage.node(
        "Mapping", Vector=_coordinates(stage, "UV"), Scale=(3, 2, 1), Rotation=(0, 0, 0.5), Location=(0.1, 0.2, 0)
    )
    stage.principled(Base_Color=stage.node("TexImage", move, image=_checks(stage)))


@feature
def image_clipped(stage):
    stage.shape("plane")
    move = stage.node("Mapping", Vector=_coordinates(stage, "UV"), Scale=(2, 2, 1), Location=(-0.5, -0.5, 0))
    stage.principled(Base_Color=stage.node("TexImage", move, image=_checks(stage), extension="CLIP"))


@feature
def image_subsurface(stage):
    stage.principled(Base_Color=_image(stage), Subsurface_Weight=1.0, Subsurface_Scale=0.1)


@feature
def image_beside_noise(stage):
    move = stage.node("Mapping", Vector=_coordinates(stage, "UV"), Scale=(3, 2, 1))
    stage.principled(Base_Color=stage.node("TexImage", move, image=_checks(stage)), Roughness=_noise(stage).outputs[0])


@feature
def two_materials(stage):
    other = stage.material_of(lambda: stage.principled(Base_Color=_noise(stage).outputs["Color"]))
    stage.principled(Base_Color=(0.2, 0.6, 0.3), Roughness=_noise(stage, Scale=1.5).outputs[0])
    stage.body.data.materials.append(other)
    for face in stage.body.data.polygons:
        face.material_index = int(face.center.z > 0.1)


@feature
def mirrored_and_bevelled(stage):
    stage.shape("cube")
    mirror = stage.body.modifiers.new("mirror", "MIRROR")
    mirror.use_axis = mirror.use_bisect_axis = (True, True, False)
    stage.body.modifiers.new("bevel", "BEVEL").width = 0.15
    _by(stage, _coordinates(stage, "Object"))


@feature
def text(stage):
    letters = bpy.data.curves.new("letters", "FONT")
    letters.body, letters.size, letters.extrude = "O8", 1.6, 0.2
    letters.align_x = "CENTER"
    stage.principled(Base_Color=_noise(stage).outputs["Color"])
    letters.materials.append(stage.material)
    stage.place("letters", letters, (0, -0.3, 0.3)).rotation_euler = (1.2, 0, 0)
    stage.body.hide_render = True


@feature
def image_box(stage):
    stage.shape("cube")
    stage.principled(
        Base_Color=stage.node(
            "TexImage", _coordinates(stage, "Object"), image=_checks(stage), projection="BOX", projection_blend=0.2
        )
    )


@feature
def image_generated(stage):
    stage.principled(Base_Color=stage.node("TexImage", _coordinates(stage, "Generated"), image=_checks(stage)))


@feature
def image_closest(stage):
    stage.principled(Base_Color=stage.node("TexImage", image=_checks(stage, size=8, cells=8), interpolation="Closest"))


@feature
def image_second_uv_map(stage):
    layer = stage.body.data.uv_layers.new(name="other")
    for loop in layer.data:
        loop.uv = (loop.uv[1] * 2, loop.uv[0])
    stage.principled(Base_Color=stage.node("TexImage", stage.node("UVMap", uv_map="other"), image=_checks(stage)))


@feature
def image_alpha(stage):
    node = _image(stage, alpha=0.0)
    stage.principled(Base_Color=node.outputs["Color"], Alpha=node.outputs["Alpha"])


@feature
def image_alpha_unused(stage):
    stage.principled(Base_Color=_image(stage, alpha=0.2).outputs["Color"])


@feature
def image_roughness(stage):
    grey = ((0.1,) * 3, (0.7,) * 3)
    stage.principled(Base_Color=(0.1, 0.1, 0.1), Roughness=_image(stage, True, grey))


@feature
def image_roughness_srgb(stage):
    grey = ((0.2,) * 3, (0.8,) * 3)
    stage.principled(Base_Color=(0.1, 0.1, 0.1), Roughness=_image(stage, False, grey))


@feature
def image_packed_channels(stage):
    packed = _image(stage, True, ((1, 0.2, 0), (1, 0.6, 1)))
    split = stage.node("SeparateColor", packed)
    stage.principled(Base_Color=(0.8, 0.6, 0.3), Roughness=split.outputs[1], Metallic=split.outputs[2])


@feature
def image_metallic_alone(stage):
    mask = _image(stage, True, ((0,) * 3, (1,) * 3))
    stage.principled(Base_Color=(0.8, 0.6, 0.3), Roughness=0.3, Metallic=mask)


@feature
def image_emission(stage):
    stage.principled(Base_Color=(0, 0, 0), Emission_Color=_image(stage), Emission_Strength=2.5)


@feature
def noise_colour(stage):
    stage.principled(Base_Color=_noise(stage).outputs["Color"])


@feature
def noise_roughness(stage):
    stage.principled(Base_Color=(0.05, 0.05, 0.05), Roughness=_noise(stage, Scale=2.0).outputs[0])


@feature
def noise_metallic(stage):
    stage.principled(Base_Color=(0.8, 0.6, 0.3), Roughness=0.3, Metallic=_noise(stage).outputs[0])


@feature
def noise_emission_bright(stage):
    glow = stage.node("VectorMath", _noise(stage).outputs["Color"], (8, 4, 2), operation="MULTIPLY")
    stage.principled(Base_Color=(0, 0, 0), Emission_Color=glow, Emission_Strength=1.0)


@feature
def noise_alpha(stage):
    stage.principled(Base_Color=(0.7, 0.2, 0.1), Alpha=_noise(stage).outputs[0])


@feature
def noise_transmission(stage):
    stage.principled(
        Base_Color=(1, 1, 1),
        Roughness=0.2,
        Transmission_Weight=stage.node("Math", _noise(stage).outputs[0], 0.5, operation="GREATER_THAN"),
    )


@feature
def noise_coat(stage):
    stage.principled(Base_Color=(0.5, 0.05, 0.05), Roughness=0.7, Coat_Weight=_noise(stage).outputs[0])


@feature
def noise_specular(stage):
    stage.principled(
        Base_Color=(0.05, 0.05, 0.05),
        Roughness=0.3,
        IOR=2.0,
        Specular_IOR_Level=stage.node("Math", _noise(stage).outputs[0], 0.5, operation="MULTIPLY"),
    )


@feature
def noise_thin_film(stage):
    thickness = stage.node("MapRange", _noise(stage).outputs[0], 0.3, 0.7, 200.0, 600.0)
    stage.principled(Base_Color=(0.05, 0.05, 0.05), Roughness=0.2, Thin_Film_Thickness=thickness.outputs[0])


@feature
def noise_ior(stage):
    stage.principled(
        Base_Color=(0.1, 0.1, 0.1),
        Roughness=0.3,
        IOR=stage.node("Math", _noise(stage).outputs[0], 1.0, operation="ADD"),
    )


@feature
def voronoi(stage):
    stage.principled(Base_Color=stage.node("TexVoronoi", Scale=4.0).outputs["Color"])


@feature
def wave(stage):
    stage.principled(Base_Color=stage.node("TexWave", Scale=2.0).outputs["Color"])


@feature
def brick(stage):
    stage.shape("cube")
    stage.principled(Base_Color=stage.node("TexBrick", _coordinates(stage, "UV"), Scale=4.0).outputs["Color"])


@feature
def magic(stage):
    stage.principled(Base_Color=stage.node("TexMagic", Scale=2.0).outputs["Color"])


@feature
def gradient(stage):
    stage.principled(Base_Color=stage.node("TexGradient").outputs["Color"])


@feature
def white_noise_cells(stage):
    cells = stage.node("VectorMath", _coordinates(stage, "Object"), (4, 4, 4), operation="MULTIPLY")
    floor = stage.node("VectorMath", cells, operation="FLOOR")
    stage.principled(Base_Color=stage.node("TexWhiteNoise", floor).outputs["Color"])


@feature
def by_generated(stage):
    _by(stage, _coordinates(stage, "Generated"))


@feature
def by_object(stage):
    _by(stage, _coordinates(stage, "Object"))


@feature
def by_uv(stage):
    _by(stage, _coordinates(stage, "UV"))


@feature
def by_normal(stage):
    _by(stage, _coordinates(stage, "Normal"))


@feature
def by_position(stage):
    _by(stage, stage.node("NewGeometry").outputs["Position"])


@feature
def by_other_object(stage):
    other = stage.place("other", None, (0.5, 0.3, 0.2))
    node = stage.node("TexCoord")
    node.object = other
    _by(stage, node.outputs["Object"])


@feature
def by_window(stage):
    stage.scene.render.resolution_x = stage.scene.render.resolution_y = 32
    _by(stage, _coordinates(stage, "Window"))


@feature
def by_camera(stage):
    _by(stage, _coordinates(stage, "Camera"))


@feature
def by_view_distance(stage):
    fade = stage.node("MapRange", stage.node("CameraData").outputs["View Distance"], 3.0, 5.0)
    stage.principled(Base_Color=fade.outputs[0], Roughness=0.5)


@feature
def generated_under_modifiers(stage):
    stage.shape("cube")
    modifier = stage.body.modifiers.new("round", "SUBSURF")
    modifier.render_levels = 3
    _by(stage, _coordinates(stage, "Generated"))


@feature
def generated_deformed(stage):
    stage.shape("cube")
    modifier = stage.body.modifiers.new("twist", "SIMPLE_DEFORM")
    modifier.deform_method, modifier.angle, modifier.deform_axis = "TAPER", 1.0, "Z"
    _by(stage, _coordinates(stage, "Generated"))


@feature
def object_colour(stage):
    stage.body.color = (0.8, 0.2, 0.5, 1)
    stage.principled(Base_Color=stage.node("ObjectInfo").outputs["Color"])


@feature
def vertex_colours(stage):
    layer = stage.body.data.color_attributes.new("paint", "FLOAT_COLOR", "POINT")
    for vertex, item in zip(stage.body.data.vertices, layer.data):
        item.color = (*(abs(c) for c in vertex.co), 1)
    stage.principled(Base_Color=stage.node("VertexColor", layer_name="paint").outputs["Color"])


@feature
def hue_saturation(stage):
    node = stage.node("HueSaturation", Hue=0.7, Saturation=0.8, Value=0.9, Color=_image(stage))
    stage.principled(Base_Color=node)


@feature
def rgb_curves(stage):
    node = stage.node("RGBCurve", Color=_image(stage))
    node.mapping.curves[3].points.new(0.5, 0.8)
    node.mapping.update()
    stage.principled(Base_Color=node)


@feature
def colour_ramp(stage):
    node = stage.node("ValToRGB", _noise(stage).outputs[0])
    node.color_ramp.elements[0].color, node.color_ramp.elements[0].position = (0.8, 0.1, 0.1, 1), 0.4
    node.color_ramp.elements[1].color, node.color_ramp.elements[1].position = (0.1, 0.2, 0.8, 1), 0.6
    stage.principled(Base_Color=node)


@feature
def colour_ramp_constant(stage):
    node = stage.node("ValToRGB", 0.3)
    node.color_ramp.elements[0].color = (0.9, 0.1, 0.1, 1)
    stage.principled(Base_Color=node)


@feature
def mix_colour(stage):
    node = stage.node("Mix", data_type="RGBA", blend_type="MULTIPLY")
    for index, value in ((0, 1.0), (6, _image(stage)), (7, (0.5, 0.9, 0.6))):
        put(stage.tree, value, node.inputs[index])
    stage.principled(Base_Color=node.outputs[2])


@feature
def brightness_contrast(stage):
    stage.principled(Base_Color=stage.node("BrightContrast", _image(stage), 0.1, 0.2))


@feature
def invert_gamma(stage):
    inverted = stage.node("Invert", Color=_image(stage))
    stage.principled(Base_Color=stage.node("Gamma", inverted, 1.8))


@feature
def group_of_constants(stage):
    def build(tree, inputs):
        node = stage.node("MixRGB", inputs[1], inputs[0], (0, 0, 1), tree=tree)
        return node.outputs[0]

    stage.principled(Base_Color=stage.group(build, Tint=(0.9, 0.5, 0.1), Share=0.25))


@feature
def group_of_textures(stage):
    def build(tree, inputs):
        noise = stage.node("TexNoise", Scale=3.0, tree=tree)
        return stage.node("MixRGB", noise.outputs[0], inputs[0], (0.1, 0.1, 0.4), tree=tree).outputs[0]

    stage.principled(Base_Color=stage.group(build, Tint=(0.9, 0.6, 0.2)))


@feature
def bump(stage):
    node = stage.node("Bump", Strength=1.0, Distance=0.15, Height=_noise(stage).outputs[0])
    stage.principled(Base_Color=(0.6, 0.6, 0.6), Roughness=0.4, Normal=node)


@feature
def bump_image(stage):
    heights = _image(stage, True, ((0,) * 3, (1,) * 3))
    stage.principled(
        Base_Color=(0.6, 0.6, 0.6),
        Roughness=0.4,
        Normal=stage.node("Bump", Strength=0.5, Distance=0.05, Height=heights),
    )


@feature
def bump_mirror(stage):
    node = stage.node("Bump", Distance=0.08, Height=_noise(stage, Scale=2.0).outputs[0])
    stage.principled(Base_Color=(0.9, 0.9, 0.9), Metallic=1.0, Roughness=0.1, Normal=node)


@feature
def normal_map(stage):
    node = stage.node("NormalMap", Color=stage.node("TexImage", image=waves(stage, 0.4)))
    stage.principled(Base_Color=(0.6, 0.5, 0.4), Roughness=0.4, Normal=node)


@feature
def normal_map_weak(stage):
    node = stage.node("NormalMap", Strength=0.4, Color=stage.node("TexImage", image=waves(stage, 1.0)))
    stage.principled(Base_Color=(0.6, 0.5, 0.4), Roughness=0.4, Normal=node)


@feature
def normal_map_steep(stage):
    node = stage.node("NormalMap", Color=stage.node("TexImage", image=waves(stage, 3.0)))
    stage.principled(Base_Color=(0.7, 0.7, 0.7), Roughness=0.5, Normal=node)


@feature
def normal_map_steep_metal(stage):
    node = stage.node("NormalMap", Color=stage.node("TexImage", image=waves(stage, 3.0)))
    stage.principled(Base_Color=(0.9, 0.9, 0.9), Metallic=1.0, Roughness=0.3, Normal=node)


@feature
def displacement_as_bump(stage):
    stage.principled(Base_Color=(0.6, 0.6, 0.6), Roughness=0.4)
    stage.output("Displacement", stage.node("Displacement", Height=_noise(stage).outputs[0], Scale=0.15))


@feature
def true_displacement(stage):
    stage.principled(Base_Color=(0.6, 0.6, 0.6), Roughness=0.4)
    stage.material.displacement_method = "DISPLACEMENT"
    stage.output("Displacement", stage.node("Displacement", Height=_noise(stage).outputs[0], Scale=0.15))


@feature
def fresnel_colour(stage):
    stage.principled(Base_Color=stage.node("LayerWeight").outputs["Facing"])


@feature
def ambient_occlusion(stage):
    stage.shape("cube")
    stage.principled(Base_Color=stage.node("AmbientOcclusion", Color=(0.8, 0.8, 0.8)).outputs["Color"])
