"""A material's surface as weighted closures: mixes and sums of shaders, through groups. View-dependent values are
replaced by their means."""

from dataclasses import dataclass

import bpy

import attributes
import camera_coordinates
from graph import is_constant
from shading import source_socket, upstream

_DEPENDS_ON_VIEW = {
    "FRESNEL": {"Fac"}, "LAYER_WEIGHT": {"Fresnel", "Facing"}, "NEW_GEOMETRY": {"Incoming", "Backfacing"},
    "TEX_COORD": {"Camera", "Window", "Reflection"}, "CAMERA": {"View Vector", "View Z Depth", "View Distance"},
}
_GLOSSY = {"BSDF_GLOSSY", "BSDF_ANISOTROPIC"}


@dataclass
class Leaf:
    """A shader node. `ior`: index of a dielectric layer above it, whose facets are those of the Glossy shader
    `coat`."""
    node: bpy.types.Node
    path: tuple
    ior: object = None
    coat: object = None

    @property
    def type(self):
        """The type of the node. Blender 4.4 gives the Diffuse shader another name."""
        return "BSDF_DIFFUSE" if self.node.type == "DIFFUSE_BSDF" else self.node.type


@dataclass
class Mix:
    """A Mix Shader: two shader trees with weights 1 - f and f. `factor` is the input socket of f, at `path`."""
    factor: bpy.types.NodeSocket
    path: tuple
    first: object
    second: object


@dataclass
class Sum:
    """An Add Shader: the two shader trees below it, both with full weight. None stands for black."""
    first: object
    second: object


def read(socket, path=()):
    """The shader tree under a shader socket: Leaf, Mix, Sum, or None if black."""
    output, path = source_socket(socket, path)
    if output is None or not output.is_output:
        return None
    node = output.node
    if node.type == "MIX_SHADER":
        first, second = (read(s, path) for s in node.inputs if s.type == "SHADER")
        return _faceted(Mix(node.inputs[0], path, first, second))
    if node.type == "ADD_SHADER":
        return Sum(*(read(s, path) for s in node.inputs))
    return Leaf(node, path)


def _faceted(mix):
    """Turn a Fresnel mix of a Glossy shader over another into one leaf, a dielectric. Returns other mixes unchanged."""
    output, path = source_socket(mix.factor, mix.path)
    below, coat = mix.first, mix.second
    leaves = isinstance(below, Leaf) and isinstance(coat, Leaf) and below.coat is None
    if output is None or not leaves or coat.type not in _GLOSSY or not output.is_output:
        return mix
    if below.type not in {"BSDF_DIFFUSE", "BSDF_REFRACTION", "BSDF_TRANSPARENT"}:
        return mix
    node = output.node
    if node.type == "FRESNEL":
        return Leaf(below.node, below.path, (node.inputs["IOR"], path), coat)
    if node.type == "LAYER_WEIGHT" and output.name == "Fresnel":
        return Leaf(below.node, below.path, (node.inputs["Blend"], path), coat)
    return mix


def weigh(tree, graph, weight=1.0):
    """Returns the shaders (leaves) that a tree of mixes adds up, each with its weight, a value of `graph`. Shaders of
    weight 0 are left out."""
    if tree is None or (is_constant(weight) and weight == 0):
        return []
    if isinstance(tree, Leaf):
        return [(tree, weight)]
    if isinstance(tree, Sum):
        return weigh(tree.first, graph, weight) + weigh(tree.second, graph, weight)
    share = graph.clamp(graph.grey(graph.value(tree.factor, tree.path)))
    first = weigh(tree.first, graph, graph.multiply(weight, graph.subtract(1.0, share)))
    return first + weigh(tree.second, graph, graph.multiply(weight, share))


def adds_up(tree):
    """Whether the weights of a shader tree's leaves sum to one: it has no Add Shader and no black branch."""
    if isinstance(tree, Mix):
        return adds_up(tree.first) and adds_up(tree.second)
    return isinstance(tree, Leaf)


def facets(tree):
    """The leaves of a shader tree that have a dielectric coat, as a list."""
    if isinstance(tree, Leaf):
        return [tree] if tree.coat is not None else []
    return facets(tree.first) + facets(tree.second) if tree is not None else []


def fix_view_dependence(graph, surface, tree, say):
    """Replace values that depend on the view or the kind of ray by constants; `say` receives a warning for each.

    `surface` is the shader socket that `tree` was read from.
    """
    known = {leaf.ior[0].node.as_pointer() for leaf in facets(tree)}
    for node, output in upstream(surface).values():
        if node.type == "LIGHT_PATH":
            _replace(output, 1.0 if output.name == "Is Camera Ray" else 0.0)
            say("Light Path: all rays see what the camera sees; "
                "unlink it, because glass casts caustics here without such nodes")
        elif node.type == "PARTICLE_INFO":
            say(f"{output.name} of its Particle Info node is not carried: all particles look alike; give instances of geometry "
                "nodes an attribute instead (Store Named Attribute, Instance), and read it by an Attribute node of the type "
                "Instancer")
        elif node.type == "ATTRIBUTE" and node.attribute_type == "INSTANCER":
            attributes.read_from_object(node)
        elif output.name in _DEPENDS_ON_VIEW.get(node.type, ()) and not camera_coordinates.replace(output):
            _replace(output, _typical(node, output))
            if node.as_pointer() not in known:
                say(f"{output.name} of its {node.bl_label} node depends on the view: its mean over all directions is "
                    "taken; "
                    "link a Fresnel node as the factor of Glossy over Diffuse, Refraction or Transparent, which is "
                    "carried" if node.type in {"FRESNEL", "LAYER_WEIGHT"} else
                    f"{output.name} of its {node.bl_label} node depends on the view: it is taken as from the front; "
                    "link UV, Generated or Object coordinates instead")


def _replace(output, value):
    tree = output.node.id_data
    node = tree.nodes.new("ShaderNodeValue" if isinstance(value, float) else "ShaderNodeRGB")
    node.outputs[0].default_value = value if isinstance(value, float) else (*value, 1.0)
    for link in list(output.links):
        tree.links.new(node.outputs[0], link.to_socket)


def _typical(node, output):
    """The cosine-weighted mean of a node's output over directions, or its value at normal incidence."""
    if node.type == "FRESNEL":
        return mean_reflectance(_held(node.inputs["IOR"]))
    if node.type == "LAYER_WEIGHT":
        blend = min(max(_held(node.inputs["Blend"]), 0.0), 1 - 1e-5)
        if output.name == "Fresnel":
            return mean_reflectance(1 / (1 - blend))
        # Cycles: 1 - cos^b, with the cosine-weighted mean b / (b + 2).
        power = 2 * blend if blend < 0.5 else 0.5 / (1 - blend)
        return power / (power + 2) if blend != 0.5 else 1 / 3
    return 0.0 if output.type == "VALUE" else (0.5, 0.5, 0.5) if node.type == "TEX_COORD" else (0.0, 0.0, 1.0)


def _held(socket):
    output, _ = source_socket(socket)
    return output.default_value if output is not None and not output.is_output else socket.default_value


def mean_reflectance(ior, steps=256):
    """Diffuse reflectance of a smooth dielectric of relative index `ior`, from outside."""
    total = 0.0
    for step in range(steps):
        cos = (step + 0.5) / steps
        total += 2 * cos * reflectance(cos, ior) / steps
    return total


def reflectance(cos, ior):
    """Fresnel reflectance for unpolarised light."""
    g2 = ior * ior - 1 + cos * cos
    if g2 <= 0:
        return 1.0
    g = g2 ** 0.5
    near = (g - cos) / (g + cos)
    far = (cos * (g + cos) - 1) / (cos * (g - cos) + 1)
    return 0.5 * near * near * (1 + far * far)
