"""What a scene and its view layers say about a render: the settings that the panels show and `.blend` files keep."""

import bpy

from . import definition

#: Methods that artists choose from, and their names here.
METHODS = tuple(
    (name, label, definition.help_of("method", name))
    for name, label in (("auto", "Auto"), ("vcm", "VCM"), ("path", "Path"), ("bdpt", "BDPT"), ("sppm", "SPPM")))

_DENOISERS = {"auto": "Auto", "oidn": "Open Image Denoise", "own": "Own", "none": "No Denoiser"}
FINISHES = (
    *((name, _DENOISERS.get(name, name), definition.help_of("denoise", name)) for name in definition.names("denoise")),
    ("off", "Off", "The estimate itself, with its noise"),
)

#: Effects by the names that the program gives them (`use_NAME` is the switch): their names here, and what they are.
EFFECTS = {
    "emission": ("Emission", "Lamps and sky as the camera sees them"),
    "direct": ("Direct", "Light after one bounce"),
    "indirect": ("Indirect", "Light after several bounces"),
    "glossy": ("Glossy", "Shine and rough reflections"),
    "caustic": ("Caustics", "Light that mirrors or glass focus on a surface"),
    "sds": ("Seen Caustics", "Caustics seen in mirrors, through glass or under water"),
    "volume": ("Volumes", "Light in media"),
    "dispersion": ("Dispersion", "Colours of the spectrum"),
    "depth_of_field": ("Depth of Field", "The lens"),
    "environment": ("Environment", "Light of the world"),
    "alpha": ("Cut-outs", "Surfaces that are partly not there"),
    "textures": ("Textures", "Images on surfaces"),
}


class Settings(bpy.types.PropertyGroup):
    """`scene.caustique_render`: how to render.

    Exporters write such properties into a file's extras, where the name `caustique` has a meaning of its own.
    """

    method: bpy.props.EnumProperty(name="Method", items=METHODS, default="auto", description="How light is found")
    seed: bpy.props.IntProperty(
        name="Seed", **definition.limits("seed"), description="Another number, other noise. Animate it to vary the noise from frame to frame")

    use_iterations: bpy.props.BoolProperty(name="Iterations", default=True, description="Stop after so many iterations")
    iterations: bpy.props.IntProperty(
        name="Iterations", default=64, **definition.limits("iterations"), soft_max=4096, description="Most iterations of a frame")
    use_time: bpy.props.BoolProperty(name="Time", description="Stop after so much time")
    time: bpy.props.FloatProperty(
        name="Time", default=60, min=0.1, soft_max=3600, step=100, precision=1,
        description="Seconds of rendering; the running iteration is given up, but the first is finished")
    use_error: bpy.props.BoolProperty(name="Error", description="Stop when the picture is good enough")
    error: bpy.props.FloatProperty(
        name="Error", default=5, min=0.01, max=100, subtype="PERCENTAGE",
        description="Estimated relative error of the finished picture")

    finish: bpy.props.EnumProperty(
        name="Finish", items=FINISHES, default="auto", description="What cleans the picture of noise at the end")
    arguments: bpy.props.StringProperty(
        name="Arguments", description="More options of the command line about the picture, such as --max-depth 8; "
                                      "they come last, so they hold against the settings above")


for _name, (_label, _about) in EFFECTS.items():
    Settings.__annotations__[f"use_{_name}"] = bpy.props.BoolProperty(
        name=_label, default=True,
        description=f"{_about}. Simulated where the scene calls for it; switch it off to leave it out")


class Passes(bpy.types.PropertyGroup):
    """`view_layer.caustique`: passes that Blender has no switches for."""

    albedo: bpy.props.BoolProperty(
        name="Denoising Albedo", description="Reflectance at the first hit that is not a mirror or clear glass")
    parts: bpy.props.BoolProperty(
        name="Parts", description="CombinedDirect, CombinedIndirect, CombinedCaustic, CombinedEmission and "
                                  "CombinedVolume: finished, they sum to the picture")
    noisy: bpy.props.BoolProperty(name="Noisy", description="The estimate before the finish")
    noisy_parts: bpy.props.BoolProperty(
        name="Noisy Parts", description="Direct, Indirect, Caustic, Emission and Volume: they sum to Noisy")
    error: bpy.props.BoolProperty(name="Error", description="Estimated standard error of the picture as delivered, pixel by pixel")
    levels: bpy.props.BoolProperty(
        name="Bandwidths", description="The estimates at five bandwidths, Level1 to Level5, and their variances")


def register():
    """Give scenes and view layers their settings."""
    for kind in (Settings, Passes):
        bpy.utils.register_class(kind)
    bpy.types.Scene.caustique_render = bpy.props.PointerProperty(type=Settings)
    bpy.types.ViewLayer.caustique = bpy.props.PointerProperty(type=Passes)


def unregister():
    """Take them away."""
    del bpy.types.ViewLayer.caustique
    del bpy.types.Scene.caustique_render
    for kind in (Passes, Settings):
        bpy.utils.unregister_class(kind)
