"""Make a .blend whose compositor sums the parts of a rendered picture, with a control for its caustics.

    .venv-bpy/bin/python scripts/blender/compositor.py PICTURE.exr OUT.blend
    blender -b --python scripts/blender/compositor.py -- PICTURE.exr OUT.blend
    import compositor; compositor.build("PICTURE.exr")                      adds a scene to the open file

The node "Caustics" has two inputs for the artist: `Caustics`, a factor (1: the picture is unchanged, 0: no caustics),
and `Caustics Tint`, a colour that multiplies the caustics (white: unchanged).
"""

import argparse
import mmap
import os
import struct
import sys

try:
    import bpy
except ModuleNotFoundError as error:
    sys.exit(f"error: {error}\nhint: run this in Blender (blender -b --python compositor.py -- PICTURE.exr OUT.blend), or "
             "in a Python that has bpy, such as the .venv-bpy/bin/python that 'scripts/setup.sh bpy' makes")

PARTS = ("CombinedDirect", "CombinedIndirect", "CombinedEmission", "CombinedVolume")
CAUSTIC = "CombinedCaustic"
FACTOR, TINT = "Caustics", "Caustics Tint"
_MODERN = bpy.app.version >= (5, 0, 0)


def build(path):
    """A new scene that shows the multilayer EXR at `path` through the node "Caustics".

    Raises `SystemExit` if the file has no finished parts.
    """
    image = bpy.data.images.load(os.path.abspath(path))
    scene = bpy.data.scenes.new("caustique")
    scene.render.resolution_x, scene.render.resolution_y = _size(path)
    scene.render.resolution_percentage = 100
    scene.render.compositor_precision = "FULL"
    tree, shown = _tree(scene)
    source = tree.nodes.new("CompositorNodeImage")
    source.image = image
    if CAUSTIC not in source.outputs:
        raise SystemExit(f"error: {path}: it has no layer {CAUSTIC}\nhint: render it with --layers comp or all; "
                         f"a scene without glass, mirrors and gloss has no caustics")
    group = tree.nodes.new("CompositorNodeGroup")
    group.node_tree, group.name = _sum(), "Caustics"
    group.label = "Caustics"
    for name in ("Combined", CAUSTIC, *PARTS):
        if name in source.outputs:
            tree.links.new(source.outputs[name], group.inputs[name])
    tree.links.new(group.outputs["Image"], shown.inputs[0])
    for column, node in enumerate((source, group, shown)):
        node.location = (300 * column, 0)
    return scene


def _size(path):
    """Width and height of the whole picture from the file's header.

    Blender knows the size of a multilayer image only after displaying it.
    """
    with open(path, "rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        head = b"displayWindow\0box2i\0" + struct.pack("<i", 16)
        left, top, right, bottom = struct.unpack_from("<4i", data, data.find(head) + len(head))
        return right - left + 1, bottom - top + 1


def _tree(scene):
    """The empty compositor tree of a scene, and its output node."""
    if _MODERN:
        tree = scene.compositing_node_group = bpy.data.node_groups.new("caustique", "CompositorNodeTree")
        tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
        return tree, tree.nodes.new("NodeGroupOutput")
    scene.use_nodes = True
    tree = scene.node_tree
    tree.nodes.clear()
    return tree, tree.nodes.new("CompositorNodeComposite")


def _sum():
    """The node group: parts + `CombinedCaustic` x `Caustics Tint` x `Caustics`, with the alpha of `Combined`."""
    tree = bpy.data.node_groups.new("Caustics", "CompositorNodeTree")
    colours = {TINT: (1, 1, 1, 1), "Combined": (0, 0, 0, 1), CAUSTIC: (0, 0, 0, 1)}
    factor = tree.interface.new_socket(FACTOR, in_out="INPUT", socket_type="NodeSocketFloat")
    factor.default_value, factor.min_value, factor.max_value = 1, 0, 10
    for name in (TINT, "Combined", CAUSTIC, *PARTS):
        socket = tree.interface.new_socket(name, in_out="INPUT", socket_type="NodeSocketColor")
        socket.default_value = colours.get(name, (0, 0, 0, 1))
    tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    given = tree.nodes.new("NodeGroupInput").outputs
    tinted = _mix(tree, "MULTIPLY", given[CAUSTIC], given[TINT])
    total = _mix(tree, "MULTIPLY", tinted, given[FACTOR])
    for name in PARTS:
        total = _mix(tree, "ADD", total, given[name])
    split = tree.nodes.new("CompositorNodeSeparateColor")
    tree.links.new(given["Combined"], split.inputs[0])
    covered = tree.nodes.new("CompositorNodeSetAlpha")
    if _MODERN:
        covered.inputs["Type"].default_value = "Replace Alpha"
    else:
        covered.mode = "REPLACE_ALPHA"
    tree.links.new(total, covered.inputs["Image"])
    tree.links.new(split.outputs["Alpha"], covered.inputs["Alpha"])
    tree.links.new(covered.outputs[0], tree.nodes.new("NodeGroupOutput").inputs[0])
    for column, node in enumerate(tree.nodes):
        node.location = (200 * column, 0)
    return tree


def _mix(tree, operation, first, second):
    """Output of a new node that multiplies or adds two sockets without clamping."""
    if _MODERN:
        node = tree.nodes.new("ShaderNodeMix")
        node.data_type, node.clamp_result, node.clamp_factor = "RGBA", False, False
        sockets = {socket.identifier: socket for socket in [*node.inputs, *node.outputs]}
        *inputs, output = (sockets[name] for name in ("Factor_Float", "A_Color", "B_Color", "Result_Color"))
    else:
        node = tree.nodes.new("CompositorNodeMixRGB")
        inputs, output = node.inputs[:3], node.outputs[0]
    node.blend_type = operation
    inputs[0].default_value = 1
    for socket, value in zip(inputs[1:], (first, second)):
        tree.links.new(value, socket)
    return output


def main(arguments):
    """Run the command line PICTURE.exr OUT.blend. Returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="compositor.py", usage="compositor.py PICTURE.exr OUT.blend\n       "
        "blender -b --python compositor.py -- PICTURE.exr OUT.blend")
    parser.add_argument("picture", metavar="PICTURE.exr", help="a render with its finished parts (--layers comp or all)")
    parser.add_argument("blend", metavar="OUT.blend", help="the file to make")
    given = parser.parse_args(arguments)
    try:
        bpy.ops.wm.read_factory_settings(use_empty=True)
        before = bpy.context.scene
        bpy.context.window.scene = build(given.picture)
        bpy.data.scenes.remove(before)
        bpy.ops.wm.save_as_mainfile(filepath=os.path.abspath(given.blend))
    except Exception as error:  # any error of Blender: a message and an exit code, never a hanging process
        print(f"error: {given.picture}: {error}".strip(), file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    given = sys.argv[sys.argv.index("--") + 1:] if "--" in sys.argv else sys.argv[1:]
    try:
        code = main(given)
    except SystemExit as stopped:  # help, a wrong command line, or a picture without parts
        if isinstance(stopped.code, str):
            print(stopped.code, file=sys.stderr)
        code = stopped.code if isinstance(stopped.code, int) else 1
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)  # Blender as a module may hang while it shuts down
