"""Features of single shaders: every input of Principled that matters, and each of the other shaders."""

from .torture_stage import feature

# Inputs of a Principled surface, by the name of the feature.
PRINCIPLED = {
    "plain": {"Base_Color": (0.7, 0.3, 0.2), "Roughness": 0.5},
    "smooth": {"Base_Color": (0.1, 0.3, 0.6), "Roughness": 0.1},
    "ior": {"Base_Color": (0.2, 0.2, 0.2), "Roughness": 0.3, "IOR": 2.2},
    "specular_level": {"Base_Color": (0.2, 0.1, 0.05), "Roughness": 0.3, "Specular_IOR_Level": 0.9},
    "no_specular": {"Base_Color": (0.5, 0.6, 0.2), "Specular_IOR_Level": 0.0},
    "specular_tint": {"Base_Color": (0.05, 0.05, 0.05), "Roughness": 0.25, "IOR": 2.0, "Specular_Tint": (1, 0.4, 0.1)},
    "metal": {"Base_Color": (0.9, 0.6, 0.3), "Metallic": 1.0, "Roughness": 0.3},
    "mirror": {"Base_Color": (0.8, 0.8, 0.85), "Metallic": 1.0, "Roughness": 0.0},
    "metal_tint": {"Base_Color": (0.6, 0.3, 0.1), "Metallic": 1.0, "Roughness": 0.2, "Specular_Tint": (0.4, 0.5, 0.9)},
    "half_metal": {"Base_Color": (0.7, 0.4, 0.2), "Metallic": 0.5, "Roughness": 0.4},
    "coat": {"Base_Color": (0.6, 0.05, 0.05), "Roughness": 0.6, "Coat_Weight": 1.0, "Coat_Roughness": 0.05},
    "coat_tint": {"Base_Color": (0.7, 0.7, 0.7), "Roughness": 0.5, "Coat_Weight": 1.0, "Coat_Tint": (0.9, 0.5, 0.2)},
    "coat_ior": {"Base_Color": (0.3, 0.3, 0.3), "Roughness": 0.5, "Coat_Weight": 1.0, "Coat_IOR": 2.0},
    "sheen": {"Base_Color": (0.2, 0.05, 0.1), "Roughness": 0.8, "Sheen_Weight": 1.0, "Sheen_Tint": (0.9, 0.8, 1.0)},
    "anisotropic": {"Base_Color": (0.8, 0.8, 0.8), "Metallic": 1.0, "Roughness": 0.4, "Anisotropic": 0.8},
    "anisotropic_turned": {
        "Base_Color": (0.8, 0.7, 0.6),
        "Metallic": 1.0,
        "Roughness": 0.4,
        "Anisotropic": 0.8,
        "Anisotropic_Rotation": 0.25,
    },
    "diffuse_roughness": {"Base_Color": (0.7, 0.6, 0.5), "Specular_IOR_Level": 0.0, "Diffuse_Roughness": 1.0},
    "subsurface": {"Base_Color": (0.8, 0.4, 0.3), "Subsurface_Weight": 1.0, "Subsurface_Scale": 0.1},
    "thin_film": {"Base_Color": (0.1, 0.1, 0.1), "Roughness": 0.2, "Thin_Film_Thickness": 400.0},
    "alpha": {"Base_Color": (0.6, 0.1, 0.1), "Alpha": 0.4},
    "emission": {"Base_Color": (0.1, 0.1, 0.1), "Emission_Color": (1, 0.5, 0.2), "Emission_Strength": 3.0},
    "glass": {"Base_Color": (0.9, 0.95, 1), "Roughness": 0.0, "Transmission_Weight": 1.0},
    "glass_tinted": {"Base_Color": (0.3, 0.8, 0.4), "Roughness": 0.0, "Transmission_Weight": 1.0},
    "glass_rough": {"Base_Color": (1, 1, 1), "Roughness": 0.4, "Transmission_Weight": 1.0},
    "glass_half": {"Base_Color": (0.5, 0.7, 0.9), "Roughness": 0.2, "Transmission_Weight": 0.5},
    "glass_specular": {
        "Base_Color": (1, 1, 1),
        "Roughness": 0.1,
        "Transmission_Weight": 1.0,
        "Specular_IOR_Level": 0.2,
    },
}

# The node of another surface with its inputs and settings, by the name of the feature.
SHADERS = {
    "diffuse": ("BsdfDiffuse", {"Color": (0.7, 0.5, 0.3)}),
    "diffuse_rough": ("BsdfDiffuse", {"Color": (0.7, 0.5, 0.3), "Roughness": 1.0}),
    "glossy": ("BsdfGlossy", {"Color": (0.7, 0.7, 0.7), "Roughness": 0.3}),
    "glossy_dark": ("BsdfGlossy", {"Color": (0.3, 0.15, 0.1), "Roughness": 0.3}),
    "glossy_tinted": ("BsdfGlossy", {"Color": (0.9, 0.6, 0.2), "Roughness": 0.3}),
    "glossy_anisotropic": ("BsdfAnisotropic", {"Color": (0.8, 0.8, 0.8), "Roughness": 0.4, "Anisotropy": 0.6}),
    "glossy_anisotropic_negative": (
        "BsdfAnisotropic",
        {"Color": (0.8, 0.8, 0.8), "Roughness": 0.4, "Anisotropy": -0.6},
    ),
    "glossy_beckmann": ("BsdfGlossy", {"Color": (0.8, 0.8, 0.8), "Roughness": 0.4, "distribution": "BECKMANN"}),
    "metallic": ("BsdfMetallic", {"Base_Color": (0.9, 0.7, 0.4), "Edge_Tint": (1, 1, 1), "Roughness": 0.2}),
    "metallic_edge": ("BsdfMetallic", {"Base_Color": (0.9, 0.7, 0.4), "Edge_Tint": (0.4, 0.6, 0.9), "Roughness": 0.2}),
    "metallic_conductor": ("BsdfMetallic", {"fresnel_type": "PHYSICAL_CONDUCTOR", "Roughness": 0.2}),
    "glass": ("BsdfGlass", {"Color": (1, 1, 1), "IOR": 1.45}),
    "glass_tinted": ("BsdfGlass", {"Color": (0.5, 0.9, 0.6), "IOR": 1.5}),
    "glass_rough": ("BsdfGlass", {"Color": (1, 1, 1), "Roughness": 0.5, "IOR": 1.5}),
    "glass_thin_pane": ("BsdfGlass", {"Color": (0.9, 0.9, 0.9), "IOR": 1.5}),
    "refraction": ("BsdfRefraction", {"Color": (0.9, 0.9, 0.9), "IOR": 1.3}),
    "translucent": ("BsdfTranslucent", {"Color": (0.8, 0.6, 0.4)}),
    "transparent_tinted": ("BsdfTransparent", {"Color": (0.9, 0.5, 0.2)}),
    "subsurface": ("SubsurfaceScattering", {"Color": (0.8, 0.6, 0.5), "Scale": 0.05}),
    "sheen": ("BsdfSheen", {"Color": (0.9, 0.8, 0.8), "Roughness": 0.5}),
    "toon": ("BsdfToon", {"Color": (0.7, 0.7, 0.3), "Size": 0.6}),
    "emission": ("Emission", {"Color": (0.3, 0.6, 1), "Strength": 2.0}),
}
# Shaders on a plane instead of a sphere.
ON_A_PLANE = {"glass_thin_pane"}


def _register(name, build):
    build.__name__ = name
    feature(build)


for _name, _inputs in PRINCIPLED.items():
    _register(f"principled_{_name}", lambda stage, inputs=_inputs: stage.principled(**inputs))


@feature
def principled_glass_absorbing(stage):
    stage.principled(Base_Color=(1, 1, 1), Roughness=0.0, Transmission_Weight=1.0)
    stage.output("Volume", stage.node("VolumeAbsorption", Color=(0.3, 0.7, 0.9), Density=1.0))


def _shader(stage, name):
    if name in ON_A_PLANE:
        stage.shape("plane")
    kind, inputs = SHADERS[name]
    stage.surface(stage.node(kind, **inputs))


for _name in SHADERS:
    _register(_name, lambda stage, name=_name: _shader(stage, name))


@feature
def emission_blackbody(stage):
    stage.surface(stage.node("Emission", Color=stage.node("Blackbody", 3000.0), Strength=1.5))


@feature
def no_surface(stage):
    stage.tree


@feature
def no_nodes(stage):
    stage.tree
    stage.material.use_nodes = False
    stage.material.diffuse_color = (0.7, 0.3, 0.2, 1)


@feature
def no_material(stage):
    stage.body.data.materials.clear()
