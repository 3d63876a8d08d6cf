"""Warns of Blender's settings that a render with caustique ignores, and of scenes without objects, with remedies."""

_WITHOUT_SURFACE = {"LIGHT", "CAMERA", "EMPTY", "ARMATURE", "LATTICE", "SPEAKER", "LIGHT_PROBE"}
_SIMULATED = {"CLOTH", "SOFT_BODY", "FLUID", "DYNAMIC_PAINT"}


def warnings(scene):
    """A line for each setting of `scene` that is in use and ignored."""
    render = scene.render
    found = [
        (render.use_multiview, "stereoscopy is not rendered, and both eyes see the same: render from two cameras"),
        (render.pixel_aspect_x != render.pixel_aspect_y, "pixels are rendered as squares: set both pixel aspects to 1"),
        (render.use_freestyle, "Freestyle's lines are not drawn over the picture: render them with Cycles"),
    ]
    return [line for there, line in found if there] + list(_nothing(scene)) + list(_simulations(scene))


def _nothing(scene):
    """A line for a scene in which renders see no object."""
    if not any(thing.type not in _WITHOUT_SURFACE and not thing.hide_render or thing.instance_type == "COLLECTION"
               for thing in scene.objects):
        yield (f'scene "{scene.name}": it has no objects that renders show: add a mesh, or switch on the camera symbol beside '
               "its name in the outliner")


def _simulations(scene):
    """A line for each simulation: the exported copy of the scene has no simulation caches."""
    world = scene.rigidbody_world
    if world is not None and world.enabled:
        yield f'scene "{scene.name}": its rigid bodies are not simulated for the render: bake them to keyframes'
    for thing in scene.objects:
        for modifier in thing.modifiers:
            if modifier.type in _SIMULATED or getattr(modifier, "bakes", ()):
                yield (f'object "{thing.name}": its modifier {modifier.name} is not simulated for the render: '
                       "apply it, or put a mesh cache (Alembic) in its place")
