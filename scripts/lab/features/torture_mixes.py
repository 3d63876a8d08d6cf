"""Features of mixed and added shaders: by constants, masks and Fresnel's equations."""

from .torture_stage import feature


def _mask(stage):
    """A mask of sharp-edged patches, 0 or 1."""
    noise = stage.node("TexNoise", Scale=2.5)
    return stage.node("Math", noise.outputs[0], 0.5, operation="GREATER_THAN").outputs[0]


def _soft(stage):
    return stage.node("TexNoise", Scale=2.5).outputs[0]


@feature
def two_diffuse(stage):
    stage.mix(0.3, stage.diffuse((0.8, 0.1, 0.1)), stage.diffuse((0.1, 0.1, 0.8)))


@feature
def diffuse_glossy(stage):
    stage.mix(0.3, stage.diffuse((0.6, 0.2, 0.1)), stage.glossy((0.8, 0.8, 0.8), 0.2))


@feature
def diffuse_glossy_tinted(stage):
    stage.mix(0.5, stage.diffuse((0.1, 0.3, 0.1)), stage.glossy((0.9, 0.6, 0.2), 0.3))


@feature
def diffuse_glossy_mask(stage):
    stage.mix(_soft(stage), stage.diffuse((0.6, 0.2, 0.1)), stage.glossy((0.8, 0.8, 0.8), 0.2))


@feature
def diffuse_glossy_fresnel(stage):
    stage.mix(stage.node("Fresnel", IOR=1.5), stage.diffuse((0.6, 0.1, 0.1)), stage.glossy((1, 1, 1), 0.1))


@feature
def diffuse_glossy_layer_weight(stage):
    stage.mix(
        stage.node("LayerWeight", Blend=0.5).outputs["Fresnel"],
        stage.diffuse((0.1, 0.1, 0.5)),
        stage.glossy((1, 1, 1), 0.2),
    )


@feature
def refraction_glossy_fresnel(stage):
    stage.mix(
        stage.node("Fresnel", IOR=1.4),
        stage.node("BsdfRefraction", Color=(1, 1, 1), IOR=1.4),
        stage.glossy((1, 1, 1), 0.0),
    )


@feature
def glossy_facing(stage):
    stage.mix(
        stage.node("LayerWeight", Blend=0.3).outputs["Facing"],
        stage.diffuse((0.5, 0.2, 0.1)),
        stage.glossy((0.9, 0.9, 0.9), 0.2),
    )


@feature
def transparent_diffuse(stage):
    stage.mix(0.6, stage.node("BsdfTransparent"), stage.diffuse((0.7, 0.2, 0.2)))


@feature
def transparent_mask(stage):
    stage.mix(_mask(stage), stage.node("BsdfTransparent"), stage.node("BsdfPrincipled", Base_Color=(0.2, 0.6, 0.2)))


@feature
def transparent_tinted_diffuse(stage):
    stage.mix(0.5, stage.node("BsdfTransparent", Color=(0.9, 0.4, 0.1)), stage.diffuse((0.5, 0.5, 0.5)))


@feature
def transparent_glass(stage):
    stage.mix(0.5, stage.node("BsdfTransparent"), stage.glass(1.45))


@feature
def transparent_glossy_fresnel(stage):
    stage.shape("plane")
    stage.mix(stage.node("Fresnel", IOR=1.5), stage.node("BsdfTransparent"), stage.glossy((1, 1, 1), 0.0))


@feature
def transparent_emission(stage):
    stage.mix(0.4, stage.node("BsdfTransparent"), stage.emission((0.3, 0.6, 1), 2.0))


@feature
def glow_added(stage):
    stage.add(stage.node("BsdfTransparent"), stage.emission((1, 0.4, 0.1), 0.5))


@feature
def glass_for_shadows(stage):
    rays = stage.node("LightPath")
    stage.mix(rays.outputs["Is Shadow Ray"], stage.glass(1.45), stage.node("BsdfTransparent"))


@feature
def diffuse_emission(stage):
    stage.add(stage.diffuse((0.6, 0.5, 0.4)), stage.node("Emission", Color=(0.1, 0.3, 0.6)))


@feature
def emission_mask(stage):
    stage.mix(_mask(stage), stage.diffuse((0.4, 0.4, 0.4)), stage.emission((1, 0.5, 0.1), 4.0))


@feature
def diffuse_translucent(stage):
    stage.shape("plane")
    stage.mix(0.5, stage.diffuse((0.3, 0.6, 0.2)), stage.node("BsdfTranslucent", Color=(0.3, 0.6, 0.2)))


@feature
def glass_diffuse(stage):
    stage.mix(0.4, stage.glass(1.5), stage.diffuse((0.8, 0.8, 0.8)))


@feature
def principled_mask(stage):
    stage.mix(
        _mask(stage),
        stage.node("BsdfPrincipled", Base_Color=(0.7, 0.1, 0.1), Roughness=0.6),
        stage.node("BsdfPrincipled", Base_Color=(0.9, 0.7, 0.3), Metallic=1.0, Roughness=0.2),
    )


@feature
def principled_soft_mask(stage):
    stage.mix(
        _soft(stage),
        stage.node("BsdfPrincipled", Base_Color=(0.7, 0.1, 0.1), Roughness=0.6),
        stage.node("BsdfPrincipled", Base_Color=(0.9, 0.7, 0.3), Metallic=1.0, Roughness=0.2),
    )


@feature
def principled_alike(stage):
    stage.mix(
        _soft(stage),
        stage.node("BsdfPrincipled", Base_Color=(0.7, 0.1, 0.1)),
        stage.node("BsdfPrincipled", Base_Color=(0.1, 0.1, 0.7)),
    )


@feature
def principled_over_glass(stage):
    stage.mix(
        _mask(stage), stage.glass(1.5), stage.node("BsdfPrincipled", Base_Color=(0.2, 0.4, 0.7), Roughness=0.5, IOR=1.5)
    )


@feature
def shader_in_group(stage):
    def build(tree, inputs):
        under = stage.node("BsdfDiffuse", Color=inputs[0], tree=tree)
        over = stage.node("BsdfGlossy", Color=(0.8, 0.8, 0.8), Roughness=0.3, tree=tree)
        return stage.node("MixShader", inputs[1], under.outputs[0], over.outputs[0], tree=tree).outputs[0]

    stage.surface(stage.group(build, Paint=stage.node("TexNoise", Scale=3.0).outputs["Color"], Shine=0.25))


@feature
def muted_mix(stage):
    mixed = stage.mix(0.8, stage.diffuse((0.7, 0.4, 0.1)), stage.node("Emission", Strength=5.0))
    mixed.mute = True


@feature
def two_sides(stage):
    stage.shape("plane")
    stage.mix(
        stage.node("NewGeometry").outputs["Backfacing"], stage.diffuse((0.7, 0.2, 0.2)), stage.diffuse((0.2, 0.2, 0.7))
    )


@feature
def half_black(stage):
    empty = stage.surface(stage.node("MixShader", 0.5, stage.diffuse((0.8, 0.7, 0.6)).outputs[0]))
    empty.label = "one side empty"


@feature
def too_bright_sum(stage):
    stage.add(stage.diffuse((0.3, 0.2, 0.1)), stage.diffuse((0.1, 0.2, 0.3)))


@feature
def holdout_mix(stage):
    stage.mix(0.5, stage.node("Holdout"), stage.diffuse((0.8, 0.7, 0.6)))
