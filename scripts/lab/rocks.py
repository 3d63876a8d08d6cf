"""A scene of rocks in Blender for measurements: any number of triangles, a mesh for each rock, and the same scene for a seed.
Needs bpy."""

import math

import bpy  # First, because it brings the others.

import bmesh
import numpy as np

#: Triangles of a rock.
ROCK = 5120
_SUBDIVISIONS = 5  # of the icosahedron; 20 * 4^(5 - 1) triangles
_GROUND = 32  # squares per side of the ground
_KINDS = 10  # materials of the rocks
_WAVES = 12  # that shape a rock


def material(name, **inputs):
    """A Principled material; `inputs` by the names of its sockets, with `_` for a space."""
    made = bpy.data.materials.new(name)
    if bpy.app.version < (5, 0, 0):
        made.use_nodes = True
    shader = next(node for node in made.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
    for socket, value in inputs.items():
        shader.inputs[socket.replace("_", " ")].default_value = value
    return made


def put(name, data, at, turn=(0, 0, 0)):
    """An object of the open scene."""
    thing = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(thing)
    thing.location, thing.rotation_euler = at, turn
    return thing


def _kind(index, random):
    """The material of every tenth rock: of ten, two are glass, two are metal, and the others are rough."""
    color = (*random.uniform(0.2, 0.8, 3), 1)
    rough = {"Roughness": random.uniform(0.4, 0.9)}
    special = {0: {"Transmission_Weight": 1.0, "Roughness": 0.0}, 5: {"Metallic": 1.0, "Roughness": 0.2}}
    return material(f"kind {index}", Base_Color=color, **special.get(index % 5, rough))


def _ball():
    form = bmesh.new()
    bmesh.ops.create_icosphere(form, subdivisions=_SUBDIVISIONS, radius=1)
    mesh = bpy.data.meshes.new("ball")
    form.to_mesh(mesh)
    form.free()
    mesh.shade_smooth()
    return mesh


def _rock(ball, places, index, random):
    """A ball with waves of random directions, so that no two rocks are alike."""
    waves, phases = random.normal(0, 2.0, (_WAVES, 3)), random.uniform(0, 2 * math.pi, _WAVES)
    radii = 1 + 0.4 / _WAVES * np.sin(places @ waves.T + phases).sum(1)
    mesh = ball.copy()
    mesh.name = f"rock {index}"
    mesh.vertices.foreach_set("co", (0.35 * places * radii[:, None]).astype(np.float32).ravel())
    mesh.update()
    return mesh


def build(triangles, seed=1):
    """Builds the scene anew: ground, rocks, a sun, an area lamp, a sky and a camera; returns its exact triangles."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene, random = bpy.context.scene, np.random.default_rng(seed)
    count = -(-triangles // ROCK)
    side = math.ceil(math.sqrt(count))
    form = bmesh.new()
    bmesh.ops.create_grid(form, x_segments=_GROUND, y_segments=_GROUND, size=side / 2 + 1)
    ground = bpy.data.meshes.new("ground")
    form.to_mesh(ground)
    form.free()
    ground.materials.append(material("ground", Base_Color=(0.4, 0.35, 0.3, 1), Roughness=0.9))
    put("ground", ground, (0, 0, 0))
    kinds = [_kind(index, random) for index in range(_KINDS)]
    ball = _ball()
    places = np.empty(3 * len(ball.vertices), np.float32)
    ball.vertices.foreach_get("co", places)
    for index in range(count):
        mesh = _rock(ball, places.reshape(-1, 3).astype(float), index, random)
        mesh.materials.append(kinds[index % _KINDS])
        at = index % side - (side - 1) / 2, index // side - (side - 1) / 2, 0.3
        put(f"rock {index}", mesh, at, random.uniform(0, 2 * math.pi, 3))
    bpy.data.meshes.remove(ball)
    sun = bpy.data.lights.new("sun", "SUN")
    sun.energy, sun.angle = 3, math.radians(0.5)
    put("sun", sun, (0, 0, 20), (0.7, 0.3, 0))
    area = bpy.data.lights.new("area", "AREA")
    area.energy, area.size = 40 * side, 2
    put("area", area, (0, 0, side + 2))
    scene.world = bpy.data.worlds.new("sky")
    if bpy.app.version < (5, 0, 0):
        scene.world.use_nodes = True
    background = next(node for node in scene.world.node_tree.nodes if node.type == "BACKGROUND")
    background.inputs["Color"].default_value = 0.3, 0.4, 0.6, 1
    scene.camera = put("eye", bpy.data.cameras.new("eye"), (0, -1.1 * side, 0.7 * side), (math.radians(58), 0, 0))
    return sum(len(face.vertices) - 2 for thing in scene.objects if thing.type == "MESH" for face in thing.data.polygons)
