"""Arithmetic on node trees, in a temporary copy of a material where any socket is available at the top level.

A *value* is a float, a colour of three floats, or an output socket at the top level of the copy. Arithmetic on values
adds nodes only if an operand is not constant.
"""

import bpy

from shading import constant, find_socket, group_output, luminance, output_of, source_socket, upstream

_SOCKETS = {"VALUE": "NodeSocketFloat", "INT": "NodeSocketFloat", "BOOLEAN": "NodeSocketFloat",
            "RGBA": "NodeSocketColor", "VECTOR": "NodeSocketVector"}
# Nodes whose outputs depend on their inputs alone.
FUNCTIONS = {
    "MATH", "VECT_MATH", "MIX", "MIX_RGB", "MAP_RANGE", "CLAMP", "GAMMA", "HUE_SAT", "INVERT", "BRIGHTCONTRAST",
    "VALTORGB", "CURVE_RGB", "CURVE_FLOAT", "CURVE_VEC", "BLACKBODY", "WAVELENGTH", "SEPARATE_COLOR", "COMBINE_COLOR",
    "SEPRGB", "COMBRGB", "SEPHSV", "COMBHSV", "SEPXYZ", "COMBXYZ", "RGBTOBW", "VECTOR_ROTATE", "VALUE", "RGB",
}


def is_constant(value):
    """Whether a value is a number or a colour, not a socket."""
    return not isinstance(value, bpy.types.NodeSocket)


def is_colour(value):
    """Whether a value has three components."""
    return isinstance(value, tuple) if is_constant(value) else value.type in {"RGBA", "VECTOR"}


class Graph:
    """A copy of `material` and, for each use, of its groups, until `undo` (a contextlib.ExitStack) closes.

    `output`: its output node, which a material without one is given.
    """

    def __init__(self, material, undo):
        self.original = material
        self.material = material.copy()
        undo.callback(lambda: bpy.data.materials.remove(self.material))
        self.tree = self.material.node_tree
        self.output = output_of(self.tree) or self.tree.nodes.new("ShaderNodeOutputMaterial")
        self._lifted = {}
        self._own_groups(self.tree, undo)
        # Image textures whose Alpha the surface uses, before the surface is replaced for baking.
        self._with_alpha = {node.as_pointer(): node for node, output in upstream(self.output.inputs["Surface"]).values()
                            if node.type == "TEX_IMAGE" and output.name == "Alpha"}

    def _own_groups(self, tree, undo):
        for node in tree.nodes:
            if node.type == "GROUP" and node.node_tree is not None:
                copy = node.node_tree.copy()
                undo.callback(bpy.data.node_groups.remove, copy)
                node.node_tree = copy
                self._own_groups(copy, undo)

    def trees(self):
        """The copied node tree and the trees of its groups."""
        def below(tree):
            yield tree
            for node in tree.nodes:
                if node.type == "GROUP" and node.node_tree is not None:
                    yield from below(node.node_tree)
        return list(below(self.tree))

    def keep_alpha(self):
        """Keep the Alpha of image textures in use where Color is read alone: Cycles divides Color by Alpha if, and only
        if, the material uses both.

        Returns {output socket: the socket that replaces it}, for values that are not linked yet.
        """
        made = {}
        for node in self._with_alpha.values():
            tree, colour = node.id_data, node.outputs["Color"]
            one, kept = tree.nodes.new("ShaderNodeMath"), tree.nodes.new("ShaderNodeVectorMath")
            one.operation, one.inputs[1].default_value, kept.operation = "GREATER_THAN", -1.0, "SCALE"
            links = [link.to_socket for link in colour.links]
            tree.links.new(node.outputs["Alpha"], one.inputs[0])
            tree.links.new(colour, kept.inputs["Vector"])
            tree.links.new(one.outputs[0], kept.inputs["Scale"])
            for socket in links:
                tree.links.new(kept.outputs["Vector"], socket)
            made[colour] = kept.outputs["Vector"]
        return made

    def value(self, socket, path=()):
        """The value of an input socket at any group depth."""
        held = constant(socket, path)
        if held is not None:
            return held
        output, path = source_socket(socket, path)
        top = self._top(output, path)
        if socket.type in {"RGBA", "VECTOR"} or top.type == "VALUE":
            return top
        return self.multiply(self.mean(top) if top.type == "VECTOR" else self.grey(top), 1.0)

    def grey(self, value):
        """A value as one number: colours become their luminance, as in Cycles."""
        if not is_colour(value):
            return value
        if is_constant(value):
            return luminance(value)
        node = self.tree.nodes.new("ShaderNodeRGBToBW")
        self.tree.links.new(value, node.inputs[0])
        return node.outputs[0]

    def mean(self, value):
        """The mean of the three components of a colour."""
        if not is_colour(value):
            return value
        if is_constant(value):
            return sum(value) / 3
        return self.node("ShaderNodeVectorMath", "DOT_PRODUCT", value, (1 / 3,) * 3, output="Value")

    def _top(self, output, path):
        key = (output.node.as_pointer(), output.identifier, tuple(n.as_pointer() for n in path))
        if key not in self._lifted:
            for group in reversed(path):
                inner = group.node_tree
                item = inner.interface.new_socket("lifted", in_out="OUTPUT", socket_type=_SOCKETS[output.type])
                inner.links.new(output, find_socket(group_output(inner).inputs, item.identifier))
                output = find_socket(group.outputs, item.identifier)
            self._lifted[key] = output
        return self._lifted[key]

    def node(self, kind, operation, *values, output=0):
        """An output of a new Math or Vector Math node at the top level with these inputs."""
        node = self.tree.nodes.new(kind)
        node.operation = operation
        for socket, value in zip(node.inputs, values):
            self.connect(value, socket)
        return node.outputs[output]

    def connect(self, value, socket):
        """Set the value of an input socket at the top level, or link it."""
        if not is_constant(value):
            self.tree.links.new(value, socket)
        elif socket.type == "VALUE":
            socket.default_value = value
        else:
            value = value if isinstance(value, tuple) else (value,) * 3
            socket.default_value = (*value, 1.0) if len(socket.default_value) == 4 else value

    def _binary(self, operation, function, a, b):
        if is_constant(a) and is_constant(b):
            if isinstance(a, tuple) or isinstance(b, tuple):
                a, b = (x if isinstance(x, tuple) else (x,) * 3 for x in (a, b))
                return tuple(function(x, y) for x, y in zip(a, b))
            return function(a, b)
        kind = "ShaderNodeVectorMath" if is_colour(a) or is_colour(b) else "ShaderNodeMath"
        return self.node(kind, operation, a, b)

    def multiply(self, a, b):
        """The product of two values, which are numbers, colours or sockets of shader nodes."""
        for one, other in ((a, b), (b, a)):
            if is_constant(one) and one in (1.0, (1.0,) * 3) and (is_colour(other) or not is_colour(one)):
                return other
            if is_constant(one) and one in (0.0, (0.0,) * 3):
                return (0.0,) * 3 if is_colour(one) or is_colour(other) else 0.0
        return self._binary("MULTIPLY", lambda x, y: x * y, a, b)

    def add(self, a, b):
        """The sum of two values, which are numbers, colours or sockets of shader nodes."""
        for one, other in ((a, b), (b, a)):
            if is_constant(one) and one in (0.0, (0.0,) * 3) and (is_colour(other) or not is_colour(one)):
                return other
        return self._binary("ADD", lambda x, y: x + y, a, b)

    def subtract(self, a, b):
        """The difference a - b of numbers, colours or sockets of shader nodes."""
        return self.add(a, self.multiply(b, -1.0))

    def divide(self, a, b):
        """The quotient of two values, 0 for a divisor of 0, as in Blender's nodes."""
        if is_constant(b) and b in (1.0, (1.0,) * 3):
            return a
        return self._binary("DIVIDE", lambda x, y: x / y if y else 0.0, a, b)

    def minimum(self, a, b):
        """The smaller of two values (numbers, colours or sockets of shader nodes), per component."""
        return self._binary("MINIMUM", min, a, b)

    def maximum(self, a, b):
        """The larger of two values (numbers, colours or sockets of shader nodes), per component."""
        return self._binary("MAXIMUM", max, a, b)

    def power(self, a, exponent):
        """Returns the socket, or the number, of `a` to a constant power. Negative values count as 0."""
        if is_constant(a) or not is_colour(a):
            return self._binary("POWER", lambda x, y: max(x, 0.0) ** y, a, exponent)
        split = self.tree.nodes.new("ShaderNodeSeparateXYZ")  # Vector Math has no power before Blender 4.5
        self.connect(a, split.inputs[0])
        return self.combine_channels([self.power(part, exponent) for part in split.outputs])

    def clamp(self, a):
        """The value `a`, a number, a colour or a socket of a shader node, clamped to [0, 1]."""
        return self.minimum(self.maximum(a, 0.0), 1.0)

    def max_component(self, colour):
        """The largest component of a colour."""
        if is_constant(colour):
            return max(colour) if isinstance(colour, tuple) else colour
        if not is_colour(colour):
            return colour
        split = self.tree.nodes.new("ShaderNodeSeparateXYZ")
        self.connect(colour, split.inputs[0])
        return self.maximum(self.maximum(*split.outputs[:2]), split.outputs[2])

    def combine_channels(self, values):
        """A colour of three values, its red, green and blue."""
        if all(map(is_constant, values)):
            return tuple(map(float, values))
        node = self.tree.nodes.new("ShaderNodeCombineXYZ")
        for value, socket in zip(values, node.inputs):
            self.connect(value, socket)
        return node.outputs[0]

    def varies(self, value, is_even=lambda node: False):
        """Whether a value varies over the surface: some node upstream depends on more than its inputs, and `is_even(node)`
        is false."""
        if is_constant(value):
            return False
        probe = self.tree.nodes.new("NodeReroute")
        self.tree.links.new(value, probe.inputs[0])
        nodes = [node for node, _ in upstream(probe.inputs[0]).values()]
        self.tree.nodes.remove(probe)
        return not all(node.type in FUNCTIONS or is_even(node) for node in nodes)
