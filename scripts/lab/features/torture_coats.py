"""Features of single shaders: every input of Principled that matters, and each of the other shaders."""

from .torture_stage import feature


@feature
def principled_plain(stage):
    stage.principled(Base_Color=(0.7, 0.3, 0.2), Roughness=0.5)


@feature
def principled_smooth(stage):
    stage.principled(Base_Color=(0.1, 0.3, 0.6), Roughness=0.1)


@feature
def principled_ior(stage):
    stage.principled(Base_Color=(0.2, 0.2, 0.2), Roughness=0.3, IOR=2.2)


@feature
def principled_specular_level(stage):
    stage.principled(Base_Color=(0.2, 0.1, 0.05), Roughness=0.3, Specular_IOR_Level=0.9)


@feature
def principled_no_specular(stage):
    stage.principled(Base_Color=(0.5, 0.6, 0.2), Specular_IOR_Level=0.0)


@feature
def principled_specular_tint(stage):
    stage.principled(Base_Color=(0.05, 0.05, 0.05), Roughness=0.25, IOR=2.0, Specular_Tint=(1, 0.4, 0.1))


@feature
def principled_metal(stage):
    stage.principled(Base_Color=(0.9, 0.6, 0.3), Metallic=1.0, Roughness=0.3)


@feature
def principled_mirror(stage):
    stage.principled(Base_Color=(0.8, 0.8, 0.85), Metallic=1.0, Roughness=0.0)


@feature
def principled_metal_tint(stage):
    stage.principled(Base_Color=(0.6, 0.3, 0.1), Metallic=1.0, Roughness=0.2, Specular_Tint=(0.4, 0.5, 0.9))


@feature
def principled_half_metal(stage):
    stage.principled(Base_Color=(0.7, 0.4, 0.2), Metallic=0.5, Roughness=0.4)


@feature
def principled_coat(stage):
    stage.principled(Base_Color=(0.6, 0.05, 0.05), Roughness=0.6, Coat_Weight=1.0, Coat_Roughness=0.05)


@feature
def principled_coat_tint(stage):
    stage.principled(Base_Color=(0.7, 0.7, 0.7), Roughness=0.5, Coat_Weight=1.0, Coat_Tint=(0.9, 0.5, 0.2))


@feature
def principled_coat_ior(stage):
    stage.principled(Base_Color=(0.3, 0.3, 0.3), Roughness=0.5, Coat_Weight=1.0, Coat_IOR=2.0)


@feature
def principled_sheen(stage):
    stage.principled(Base_Color=(0.2, 0.05, 0.1), Roughness=0.8, Sheen_Weight=1.0, Sheen_Tint=(0.9, 0.8, 1.0))


@feature
def principled_anisotropic(stage):
    stage.principled(Base_Color=(0.8, 0.8, 0.8), Metallic=1.0, Roughness=0.4, Anisotropic=0.8)


@feature
def principled_anisotropic_turned(stage):
    stage.principled(
        Base_Color=(0.8, 0.7, 0.6), Metallic=1.0, Roughness=0.4, Anisotropic=0.8, Anisotropic_Rotation=0.25
    )


@feature
def principled_diffuse_roughness(stage):
    stage.principled(Base_Color=(0.7, 0.6, 0.5), Specular_IOR_Level=0.0, Diffuse_Roughness=1.0)


@feature
def principled_subsurface(stage):
    stage.principled(Base_Color=(0.8, 0.4, 0.3), Subsurface_Weight=1.0, Subsurface_Scale=0.1)


@feature
def principled_thin_film(stage):
    stage.principled(Base_Color=(0.1, 0.1, 0.1), Roughness=0.2, Thin_Film_Thickness=400.0)


@feature
def principled_alpha(stage):
    stage.principled(Base_Color=(0.6, 0.1, 0.1), Alpha=0.4)


@feature
def principled_emission(stage):
    stage.principled(Base_Color=(0.1, 0.1, 0.1), Emission_Color=(1, 0.5, 0.2), Emission_Strength=3.0)


@feature
def principled_glass(stage):
    stage.principled(Base_Color=(0.9, 0.95, 1), Roughness=0.0, Transmission_Weight=1.0)


@feature
def principled_glass_tinted(stage):
    stage.principled(Base_Color=(0.3, 0.8, 0.4), Roughness=0.0, Transmission_Weight=1.0)


@feature
def principled_glass_rough(stage):
    stage.principled(Base_Color=(1, 1, 1), Roughness=0.4, Transmission_Weight=1.0)


@feature
def principled_glass_half(stage):
    stage.principled(Base_Color=(0.5, 0.7, 0.9), Roughness=0.2, Transmission_Weight=0.5)


@feature
def principled_glass_specular(stage):
    stage.principled(Base_Color=(1, 1, 1), Roughness=0.1, Transmission_Weight=1.0, Specular_IOR_Level=0.2)


@feature
def principled_glass_absorbing(stage):
    stage.principled(Base_Color=(1, 1, 1), Roughness=0.0, Transmission_Weight=1.0)
    stage.output("Volume", stage.node("VolumeAbsorption", Color=(0.3, 0.7, 0.9), Density=1.0))


@feature
def diffuse(stage):
    stage.surface(stage.node("BsdfDiffuse", Color=(0.7, 0.5, 0.3)))


@feature
def diffuse_rough(stage):
    stage.surface(stage.node("BsdfDiffuse", Color=(0.7, 0.5, 0.3), Roughness=1.0))


@feature
def glossy(stage):
    stage.surface(stage.node("BsdfGlossy", Color=(0.7, 0.7, 0.7), Roughness=0.3))


@feature
def glossy_dark(stage):
    stage.surface(stage.node("BsdfGlossy", Color=(0.3, 0.15, 0.1), Roughness=0.3))


@feature
def glossy_tinted(stage):
    stage.surface(stage.node("BsdfGlossy", Color=(0.9, 0.6, 0.2), Roughness=0.3))


@feature
def glossy_anisotropic(stage):
    stage.surface(stage.node("BsdfAnisotropic", Color=(0.8, 0.8, 0.8), Roughness=0.4, Anisotropy=0.6))


@feature
def glossy_anisotropic_negative(stage):
    stage.surface(stage.node("BsdfAnisotropic", Color=(0.8, 0.8, 0.8), Roughness=0.4, Anisotropy=-0.6))


@feature
def glossy_beckmann(stage):
    stage.surface(stage.node("BsdfGlossy", Color=(0.8, 0.8, 0.8), Roughness=0.4, distribution="BECKMANN"))


@feature
def metallic(stage):
    stage.surface(stage.node("BsdfMetallic", Base_Color=(0.9, 0.7, 0.4), Edge_Tint=(1, 1, 1), Roughness=0.2))


@feature
def metallic_edge(stage):
    stage.surface(stage.node("BsdfMetallic", Base_Color=(0.9, 0.7, 0.4), Edge_Tint=(0.4, 0.6, 0.9), Roughness=0.2))


@feature
def metallic_conductor(stage):
    stage.surface(stage.node("BsdfMetallic", fresnel_type="PHYSICAL_CONDUCTOR", Roughness=0.2))


@feature
def glass(stage):
    stage.surface(stage.node("BsdfGlass", Color=(1, 1, 1), IOR=1.45))


@feature
def glass_tinted(stage):
    stage.surface(stage.node("BsdfGlass", Color=(0.5, 0.9, 0.6), IOR=1.5))


@feature
def glass_rough(stage):
    stage.surface(stage.node("BsdfGlass", Color=(1, 1, 1), Roughness=0.5, IOR=1.5))


@feature
def glass_thin_pane(stage):
    stage.shape("plane")
    stage.surface(stage.node("BsdfGlass", Color=(0.9, 0.9, 0.9), IOR=1.5))


@feature
def refraction(stage):
    stage.surface(stage.node("BsdfRefraction", Color=(0.9, 0.9, 0.9), IOR=1.3))


@feature
def translucent(stage):
    stage.surface(stage.node("BsdfTranslucent", Color=(0.8, 0.6, 0.4)))


@feature
def transparent_tinted(stage):
    stage.surface(stage.node("BsdfTransparent", Color=(0.9, 0.5, 0.2)))


@feature
def subsurface(stage):
    stage.surface(stage.node("SubsurfaceScattering", Color=(0.8, 0.6, 0.5), Scale=0.05))


@feature
def sheen(stage):
    stage.surface(stage.node("BsdfSheen", Color=(0.9, 0.8, 0.8), Roughness=0.5))


@feature
def toon(stage):
    stage.surface(stage.node("BsdfToon", Color=(0.7, 0.7, 0.3), Size=0.6))


@feature
def emission(stage):
    stage.surface(stage.node("Emission", Color=(0.3, 0.6, 1), Strength=2.0))


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
