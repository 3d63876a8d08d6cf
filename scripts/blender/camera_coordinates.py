"""Camera and window coordinates of materials, as functions of the position. In Cycles all rays see them as the camera
does.
"""

import bpy

# Outputs of the nodes Texture Coordinate and Camera Data.
_WINDOW, _CAMERA, _VECTOR, _DEPTH, _DISTANCE = "Window", "Camera", "View Vector", "View Z Depth", "View Distance"


def replace(output):
    """Link what an output of a Texture Coordinate or Camera Data node leads to with the same coordinates, computed from the
    position. Returns False, and changes nothing, for other outputs, or if the scene has no camera that allows it."""
    scene, node = bpy.context.scene, output.node
    kind = output.name if node.type == "CAMERA" or output.name in {_WINDOW, _CAMERA} else None
    if node.type not in {"TEX_COORD", "CAMERA"} or kind is None or scene.camera is None:
        return False
    if scene.camera.data.type == "PANO":
        return False
    links = [link.to_socket for link in output.links]
    made = _Nodes(node.id_data).coordinates(kind, scene)
    for socket in links:
        node.id_data.links.new(made, socket)
    return True


class _Nodes:
    """Adds nodes to a tree."""

    def __init__(self, tree):
        self.tree = tree
        self.position = tree.nodes.new("ShaderNodeNewGeometry").outputs["Position"]

    def _add(self, kind, operation, *values, output=0):
        made = self.tree.nodes.new(f"ShaderNode{kind}")
        if operation is not None:
            made.operation = operation
        for socket, value in zip(made.inputs, values):
            if isinstance(value, bpy.types.NodeSocket):
                self.tree.links.new(value, socket)
            else:
                socket.default_value = value
        return made.outputs[output]

    def _row(self, row):
        """A row of a 4 x 4 matrix times the position."""
        return self._add("Math", "ADD", self._add("VectorMath", "DOT_PRODUCT", self.position, row[:3], output=1), row[3])

    def coordinates(self, kind, scene):
        """The socket of these coordinates."""
        camera, render = scene.camera, scene.render
        to_camera = camera.matrix_world.normalized().inverted()
        if kind == _WINDOW:
            film = camera.calc_matrix_camera(
                bpy.context.evaluated_depsgraph_get(), x=render.resolution_x, y=render.resolution_y,
                scale_x=render.pixel_aspect_x, scale_y=render.pixel_aspect_y) @ to_camera
            # From -1 to 1 on the film.
            w = self._row(film[3])
            x, y = (self._add("Math", "MULTIPLY_ADD", self._add("Math", "DIVIDE", self._row(film[k]), w), 0.5, 0.5)
                    for k in range(2))
            return self._add("CombineXYZ", None, x, y, 0.0)
        depth = self._row(-to_camera[2])
        if kind == _DEPTH:
            return depth
        at = self._add("CombineXYZ", None, self._row(to_camera[0]), self._row(to_camera[1]), depth)
        if kind == _DISTANCE:
            return self._add("VectorMath", "LENGTH", at, output=1)
        return self._add("VectorMath", "NORMALIZE", at) if kind == _VECTOR else at
