"""The settings of scenes and view layers that the panels show and .blend files store."""

import bpy

from . import definition

#: The methods for artists: identifier, label, description.
METHODS = tuple(
    (name, label, definition.help_of("method", name))
    for name, label in (("auto", "Auto"), ("vcm", "VCM"), ("path", "Path"), ("bdpt", "BDPT"), ("sppm", "SPPM")))

_DENOISERS = {"auto": "Auto", "full": "Smooth", "oidn": "Open Image Denoise", "own": "Own", "none": "No Denoiser"}
FINISHES = (
    *((name, _DENOISERS.get(name, name), definition.help_of("denoise", name)) for name in definition.names("denoise")),
    ("off", "Off", "The estimate itself, with its noise"),
)

#: {effect of the program: (label, description)}; `use_NAME` is its switch.
EFFECTS = {
    "emission": ("Emission", "Lamps and sky as the camera sees them"),
    "direct": ("Direct", "Light after one bounce"),
    "indirect": ("Indirect", "Light after several bounces"),
    "glossy": ("Glossy", "Rough reflections"),
    "caustic": ("Caustics", "Light that mirrors or glass focus on a surface"),
    "sds": ("Seen Caustics", "Caustics seen in mirrors, through glass or under water"),
    "volume": ("Volumes", "Light in media"),
    "dispersion": ("Dispersion", "Colours of the spectrum"),
    "depth_of_field": ("Depth of Field", "The lens"),
    "environment": ("Environment", "Light of the world"),
    "alpha": ("Cut-outs", "Partly transparent surfaces (alpha)"),
    "textures": ("Textures", "Images on surfaces"),
}


class Settings(bpy.types.PropertyGroup):
    """`scene.caustique_render`: the render settings.

    Not named `caustique`, because exporters write properties to a file's extras, where this key has another meaning.
    """

    method: bpy.props.EnumProperty(
        name="Method", items=METHODS, default="auto", description="The algorithm that finds the light")
    seed: bpy.props.IntProperty(
        name="Seed", **definition.limits("seed"),
        description="Another seed gives other noise. Animate it to vary the noise from frame to frame")

    use_iterations: bpy.props.BoolProperty(
        name="Iterations", default=True, description="Stop after this number of iterations")
    iterations: bpy.props.IntProperty(
        name="Iterations", default=64, **definition.limits("iterations"), soft_max=4096,
        description="Largest number of iterations per frame")
    use_time: bpy.props.BoolProperty(name="Time", description="Stop after this time")
    time: bpy.props.FloatProperty(
        name="Time", default=60, min=0.1, soft_max=3600, step=100, precision=1,
        description="Seconds per frame. The running iteration is discarded, unless it is the first")
    use_error: bpy.props.BoolProperty(name="Error", description="Stop when the estimated error is below a bound")
    error: bpy.props.FloatProperty(
        name="Error", default=5, min=0.01, max=100, subtype="PERCENTAGE",
        description="Estimated relative error of the finished picture")

    finish: bpy.props.EnumProperty(
        name="Finish", items=FINISHES, default="auto", description="How noise is removed from the finished picture")
    use_temporal: bpy.props.BoolProperty(
        name="Finish Animations with Neighbours",
        description="Finish each frame of an animation again, averaged with up to two frames before and after it, so that it "
                    "flickers less. The EXRs and PNGs are written to the folder 'temporal' beside Blender's frames. Needs "
                    "Passes > Data > Vector")
    arguments: bpy.props.StringProperty(
        name="Arguments", description="More options of the command line about the picture, such as --max-depth 8; "
                                      "they override the settings above")


for _name, (_label, _about) in EFFECTS.items():
    Settings.__annotations__[f"use_{_name}"] = bpy.props.BoolProperty(
        name=_label, default=True,
        description=f"{_about}. Simulated if the scene needs it; switch it off to leave it out")


class Passes(bpy.types.PropertyGroup):
    """`view_layer.caustique`: switches for passes that Blender has no switches for."""

    albedo: bpy.props.BoolProperty(
        name="Denoising Albedo", description="Reflectance at the first hit that is not a mirror or clear glass")
    parts: bpy.props.BoolProperty(
        name="Parts", description="CombinedDirect, CombinedIndirect, CombinedCaustic, CombinedEmission and "
                                  "CombinedVolume: finished parts, whose sum is the picture")
    noisy: bpy.props.BoolProperty(name="Noisy", description="The estimate before the finish")
    noisy_parts: bpy.props.BoolProperty(
        name="Noisy Parts",
        description="Direct, Indirect, Caustic, Emission and Volume: noisy parts, whose sum is Noisy")
    error: bpy.props.BoolProperty(
        name="Error", description="Estimated standard error of each pixel of the finished picture")
    volume_direct: bpy.props.BoolProperty(
        name="Volume Direct", description="Light of lamps that media scatter to the camera")
    volume_indirect: bpy.props.BoolProperty(
        name="Volume Indirect", description="Other light that media scatter to the camera")
    levels: bpy.props.BoolProperty(
        name="Bandwidths", description="The estimates at five bandwidths, Level1 to Level5, and their variances")


def register():
    """Add the settings to scenes and view layers."""
    for kind in (Settings, Passes):
        bpy.utils.register_class(kind)
    bpy.types.Scene.caustique_render = bpy.props.PointerProperty(type=Settings)
    bpy.types.ViewLayer.caustique = bpy.props.PointerProperty(type=Passes)


def unregister():
    """Remove the settings."""
    del bpy.types.ViewLayer.caustique
    del bpy.types.Scene.caustique_render
    for kind in (Passes, Settings):
        bpy.utils.unregister_class(kind)
