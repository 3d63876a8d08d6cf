"""Small renders by Cycles in scenes of their own, for the exporter's measurements."""

import contextlib

import bpy  # first: it makes the others importable

import numpy
from mathutils import Matrix


@contextlib.contextmanager
def stage(world, name, frame=1, subframe=0.0):
    """A scene with a world (or None) alone at this frame, and its camera."""
    made = bpy.data.scenes.new(name)
    camera = bpy.data.cameras.new(name)
    observer = bpy.data.objects.new(name, camera)
    try:
        made.world = world
        made.frame_set(frame, subframe=subframe)
        made.collection.objects.link(observer)
        made.camera = observer
        yield made, observer
    finally:
        bpy.data.scenes.remove(made)
        bpy.data.objects.remove(observer)
        bpy.data.cameras.remove(camera)


def look_around(observer):
    """Make a camera see all directions, in the layout of an equirectangular texture."""
    # Along +X with +Z up.
    observer.matrix_world = Matrix(((0, 0, -1, 0), (-1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 0, 1)))
    camera = observer.data
    camera.type = "PANO"
    (camera if hasattr(camera, "panorama_type") else camera.cycles).panorama_type = "EQUIRECTANGULAR"


def render(scene, path, width, height, samples=16):
    """Render a stage to an .exr. Returns its pixels, a numpy array (height, width, 3)."""
    scene.render.engine = "CYCLES"
    scene.cycles.samples = samples
    scene.cycles.use_denoising = False
    scene.render.resolution_x, scene.render.resolution_y = width, height
    scene.render.resolution_percentage = 100
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "IMAGE"
    settings.file_format, settings.color_mode, settings.color_depth = "OPEN_EXR", "RGB", "32"
    scene.render.filepath = path
    bpy.ops.render.render(write_still=True, scene=scene.name)
    image = bpy.data.images.load(path)
    values = numpy.empty(width * height * 4, numpy.float32)
    image.pixels.foreach_get(values)
    bpy.data.images.remove(image)
    return values.reshape(height, width, 4)[..., :3].astype(float)
