"""Common parts of the scenes that are written as .blend files: materials, meshes and a camera."""

import math
import sys

import bpy  # First, because it brings the others.

import numpy
from mathutils import Vector


def empty():
    """An empty scene."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    return bpy.context.scene


def principled(name, abbe=None, **inputs):
    """A material with one Principled BSDF. Inputs have _ for spaces; `abbe` is the number V_d of a dispersive glass."""
    material = bpy.data.materials.new(name)
    if bpy.app.version < (5, 0, 0):
        material.use_nodes = True
    shader = next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
    for key, value in inputs.items():
        socket = shader.inputs[key.replace("_", " ")]
        socket.default_value = (*value, 1.0) if isinstance(value, tuple) else value
    if abbe is not None:
        material["abbe"] = abbe
    return material


def glass(name, ior, **more):
    """Clear glass of this index."""
    return principled(name, Roughness=0.0, Transmission_Weight=1.0, IOR=ior, Base_Color=(1.0, 1.0, 1.0), **more)


def mesh(name, vertices, faces, material, smooth=False):
    """An object with a mesh of these vertices and faces."""
    data = bpy.data.meshes.new(name)
    data.from_pydata([tuple(map(float, v)) for v in vertices], [], [list(map(int, f)) for f in faces])
    data.materials.append(material)
    if smooth:
        data.shade_smooth()
    thing = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(thing)
    return thing


def lathe(name, profile, material, sides=96, smooth=True):
    """A closed surface of revolution. `profile`: (radius, z) from the bottom to the top, beginning and ending at radius 0."""
    turns = numpy.arange(sides) * 2 * math.pi / sides
    rings = [(r * math.cos(t), r * math.sin(t), z) for r, z in profile[1:-1] for t in turns]
    last = len(profile) - 3
    vertices = [*rings, (0, 0, profile[0][1]), (0, 0, profile[-1][1])]
    around = [(j, (j + 1) % sides) for j in range(sides)]
    faces = [(i * sides + a, i * sides + b, (i + 1) * sides + b, (i + 1) * sides + a) for i in range(last) for a, b in around]
    faces += [(b, a, len(rings)) for a, b in around]
    faces += [(last * sides + a, last * sides + b, len(rings) + 1) for a, b in around]
    return mesh(name, vertices, faces, material, smooth)


def box(name, low, high, material):
    """A box between two corners."""
    points = [[(low, high)[bit][axis] for axis, bit in enumerate(bits)] for bits in numpy.ndindex(2, 2, 2)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return mesh(name, points, faces, material)


def environment(name, picture):
    """Light the scene by an equirectangular picture (height, width, 3) of radiance, which is packed into the file."""
    height, width, _ = picture.shape
    image = bpy.data.images.new(name, width, height, float_buffer=True, is_data=True)
    image.pixels.foreach_set(numpy.dstack([picture, numpy.ones((height, width))]).astype(numpy.float32).ravel())
    image.file_format = "OPEN_EXR"
    image.pack()
    world = bpy.context.scene.world = bpy.data.worlds.new(name)
    if bpy.app.version < (5, 0, 0):
        world.use_nodes = True
    tree = world.node_tree
    node = tree.nodes.new("ShaderNodeTexEnvironment")
    node.image = image
    tree.links.new(node.outputs[0], next(n for n in tree.nodes if n.type == "BACKGROUND").inputs["Color"])


def lamp(name, kind, energy, at, towards=(0, 0, 0), **settings):
    """A lamp of this power that points towards a point."""
    light = bpy.data.lights.new(name, kind)
    light.energy = energy
    for key, value in settings.items():
        setattr(light, key, value)
    return _aimed(name, light, at, towards)


def camera(at, towards, lens, size=(320, 200)):
    """The camera, and the size of the picture."""
    data = bpy.data.cameras.new("camera")
    data.lens = lens
    scene = bpy.context.scene
    scene.camera = _aimed("camera", data, at, towards)
    scene.render.resolution_x, scene.render.resolution_y = size
    scene.view_settings.view_transform = "AgX"
    scene.render.engine = "CYCLES"
    return scene.camera


def _aimed(name, data, at, towards):
    thing = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(thing)
    thing.location = at
    thing.rotation_euler = (Vector(towards) - Vector(at)).to_track_quat("-Z", "Y").to_euler()
    return thing


def save():
    """Write the scene to the .blend that the command line names."""
    if len(sys.argv) < 2 or not sys.argv[-1].endswith(".blend"):
        sys.exit("error: no .blend to write\nhint: give its name, such as out.blend")
    bpy.ops.wm.save_as_mainfile(filepath=sys.argv[-1])
