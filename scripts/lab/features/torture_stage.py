"""The scene in which Cycles and caustique render one feature at a time: a body, a floor, a lamp, a grey world.

Lengths are in metres. A feature is a function that changes a Stage, registered by `feature`.
"""

import math

import bpy  # First, because it brings the others.

import bmesh
import numpy
from mathutils import Vector

FEATURES = {}


def feature(function):
    """Register a function that builds a feature on a Stage, under the function's name."""
    FEATURES[function.__name__] = function
    return function


class Stage:
    """A scene with a floor, an area lamp, a grey world, and a camera that looks at a body in the middle."""

    def __init__(self, shape="sphere"):
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self.scene = bpy.context.scene
        world = self.scene.world = bpy.data.worlds.new("world")
        if bpy.app.version < (5, 0, 0):
            world.use_nodes = True
        self.background = next(n for n in world.node_tree.nodes if n.type == "BACKGROUND")
        self.background.inputs["Color"].default_value = (0.5, 0.55, 0.6, 1)
        lamp = bpy.data.lights.new("lamp", "AREA")
        lamp.size, lamp.energy = 1.2, 200  # Small, because it shadows the world's light, unlike in Cycles.
        self.lamp = self.place("lamp", lamp, (1.5, -2.5, 4), (0, 0, 0.5))
        self.lamp.visible_camera = True
        floor = bpy.data.meshes.new("floor")
        floor.from_pydata([(-6, -6, 0), (6, -6, 0), (6, 6, 0), (-6, 6, 0)], [], [(0, 1, 2, 3)])
        self.floor = self.place("floor", floor)
        self.floor.data.materials.append(matt("floor", (0.5, 0.4, 0.3)))
        eye = bpy.data.cameras.new("eye")
        eye.sensor_fit, eye.angle = "VERTICAL", math.radians(32)
        self.camera = self.place("eye", eye, (0, -4.2, 2.6), (0, 0, 0.8))
        self.scene.camera = self.camera
        self.material, self.body = None, None
        self.shape(shape)

    def place(self, name, data, at=(0, 0, 0), towards=None):
        """Add an object to the scene, with its -Z axis towards a point; returns the object."""
        thing = bpy.data.objects.new(name, data)
        self.scene.collection.objects.link(thing)
        thing.location = at
        if towards is not None:
            thing.rotation_euler = (Vector(towards) - Vector(at)).to_track_quat("-Z", "Y").to_euler()
        return thing

    def shape(self, kind):
        """Replace the body by a "sphere", a "cube" or a "plane" (tilted towards the camera)."""
        if self.body is not None:
            bpy.data.objects.remove(self.body)
        form = bmesh.new()
        form.loops.layers.uv.new("UVMap")
        if kind == "sphere":
            bmesh.ops.create_uvsphere(form, u_segments=64, v_segments=32, radius=0.9, calc_uvs=True)
        elif kind == "cube":
            bmesh.ops.create_cube(form, size=1.3, calc_uvs=True)
        else:
            bmesh.ops.create_grid(form, x_segments=8, y_segments=8, size=1.0, calc_uvs=True)
        mesh = bpy.data.meshes.new("body")
        form.to_mesh(mesh)
        form.free()
        mesh.shade_smooth() if kind == "sphere" else mesh.shade_flat()
        self.body = self.place("body", mesh, (0, 0, 0.92))
        self.body.rotation_euler = {"sphere": (0.3, 0.2, 0.4), "cube": (0, 0, 0.5), "plane": (0.7, 0, 0)}[kind]
        self.material = None

    @property
    def tree(self):
        """The node tree of the body's material; at first it has only the output node."""
        if self.material is None:
            self.material = bpy.data.materials.new("tested")
            if bpy.app.version < (5, 0, 0):
                self.material.use_nodes = True
            self.body.data.materials.append(self.material)
            self.material.node_tree.nodes.clear()
            self.material.node_tree.nodes.new("ShaderNodeOutputMaterial")
        return self.material.node_tree

    def material_of(self, build):
        """The material that `build()` gives the body; the body has none afterwards."""
        build()
        made, self.material = self.material, None
        self.body.data.materials.clear()
        return made

    def node(self, kind, *inputs, tree=None, **named):
        """Add a node of the type "ShaderNode" + `kind`. Inputs are given by position, or by name with _ for spaces;
        lower-case names are settings."""
        tree = tree or self.tree
        node = tree.nodes.new("ShaderNode" + kind)
        for key, value in named.items():
            if key[0].islower():
                setattr(node, key, value)
        given = list(zip(node.inputs, inputs))
        given += [(node.inputs[key.replace("_", " ")], value) for key, value in named.items() if not key[0].islower()]
        for socket, value in given:
            if value is not None:
                put(tree, value, socket)
        return node

    def diffuse(self, color):
        """Add a Diffuse BSDF."""
        return self.node("BsdfDiffuse", Color=color)

    def glossy(self, color, roughness):
        """Add a Glossy BSDF."""
        return self.node("BsdfGlossy", Color=color, Roughness=roughness)

    def glass(self, ior):
        """Add a white Glass BSDF."""
        return self.node("BsdfGlass", Color=(1, 1, 1), IOR=ior)

    def emission(self, color, strength):
        """Add an Emission shader."""
        return self.node("Emission", Color=color, Strength=strength)

    def surface(self, shader):
        """Make a shader node the body's surface; returns the node."""
        output = next(n for n in self.tree.nodes if n.type == "OUTPUT_MATERIAL")
        self.tree.links.new(shader.outputs[0], output.inputs["Surface"])
        return shader

    def output(self, socket, value):
        """Set another input of the material's output."""
        put(self.tree, value, next(n for n in self.tree.nodes if n.type == "OUTPUT_MATERIAL").inputs[socket])

    def principled(self, **inputs):
        """Make a Principled shader with these inputs the surface."""
        return self.surface(self.node("BsdfPrincipled", **inputs))

    def mix(self, factor, first, second):
        """Make a Mix Shader the surface."""
        return self.surface(self.node("MixShader", factor, first.outputs[0], second.outputs[0]))

    def add(self, first, second):
        """Make an Add Shader the surface."""
        return self.surface(self.node("AddShader", first.outputs[0], second.outputs[0]))

    def group(self, build, **inputs):
        """Add a node group with these colour or number inputs; `build(tree, inputs)` returns the group's output."""
        inner = bpy.data.node_groups.new("group", "ShaderNodeTree")
        kinds = {
            name: "NodeSocketColor" if isinstance(value, tuple) else "NodeSocketFloat"
            for name, value in inputs.items()
            if not isinstance(value, bpy.types.NodeSocket)
        }
        for name in inputs:
            inner.interface.new_socket(name, in_out="INPUT", socket_type=kinds.get(name, "NodeSocketColor"))
        enter, leave = inner.nodes.new("NodeGroupInput"), inner.nodes.new("NodeGroupOutput")
        result = build(inner, enter.outputs)
        kind = {"VALUE": "Float", "RGBA": "Color", "VECTOR": "Vector", "SHADER": "Shader"}[result.type]
        inner.interface.new_socket("result", in_out="OUTPUT", socket_type="NodeSocket" + kind)
        inner.links.new(result, leave.inputs[0])
        node = self.tree.nodes.new("ShaderNodeGroup")
        node.node_tree = inner
        for name, value in inputs.items():
            put(self.tree, value, node.inputs[name])
        return node

    def image(self, name, pixels, data=False):
        """A packed image of stored values, an array (height, width, 3 or 4) with the first row at the bottom."""
        height, width, depth = pixels.shape
        whole = numpy.ones((height, width, 4), numpy.float32)
        whole[..., :depth] = pixels
        image = bpy.data.images.new(name, width, height, alpha=depth == 4, is_data=data)
        image.pixels.foreach_set(whole.ravel())
        image.pack()
        return image


def put(tree, value, socket):
    """Set a socket to a number, a colour or a vector, or link it to a node or socket."""
    if isinstance(value, bpy.types.Node):
        value = value.outputs[0]
    if isinstance(value, bpy.types.NodeSocket):
        tree.links.new(value, socket)
    elif isinstance(value, (int, float)):
        socket.default_value = value
    else:
        socket.default_value = (*value, 1.0) if len(socket.default_value) > len(value) else value


def matt(name, color):
    """A Lambertian material."""
    material = bpy.data.materials.new(name)
    if bpy.app.version < (5, 0, 0):
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    shader = tree.nodes.new("ShaderNodeBsdfDiffuse")
    shader.inputs["Color"].default_value = (*color, 1)
    tree.links.new(shader.outputs[0], tree.nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])
    return material
