"""A cache of baked images and measured values in the user's cache folder, by a hash of all inputs of the bake.

Frames of an animation share it, as do renders of one scene: only what has changed is baked again.
"""

import glob
import hashlib
import os
import re
import time

import bpy
import numpy

_MAX_AGE_DAYS = 30
_IGNORED_PROPERTIES = {  # layout of a node in the editor, or hashed separately
    "rna_type", "location", "location_absolute", "width", "height", "width_hidden", "select", "dimensions", "parent",
    "color", "use_custom_color", "label", "name", "inputs", "outputs", "internal_links", "id_data", "show_options",
    "show_preview", "show_texture", "warning_propagation", "hide", "bl_width_default", "bl_width_min", "bl_width_max",
    "bl_height_default", "bl_height_min", "bl_height_max", "bl_description", "bl_label", "bl_icon", "interface",
    "color_tag", "node_tree", "debug_zone_body_lazy_function_graph", "debug_zone_lazy_function_graph",
}


# Nodes that read files or properties of other data, which the keys do not hold.
_UNKNOWN_INPUTS = {"SCRIPT", "TEX_IES"}


def folder():
    """The cache's folder: caustique/bake in $XDG_CACHE_HOME or ~/.cache."""
    base = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    return os.path.join(base, "caustique", "bake")


def load(key):
    """The array stored under `key`. None if it is missing or unreadable, or if `key` is None."""
    if key is None:
        return None
    path = os.path.join(folder(), key + ".npy")
    try:
        values = numpy.load(path, allow_pickle=False)
        os.utime(path)
    except (OSError, ValueError, EOFError):
        return None
    return values


def store(key, values):
    """Store an array under `key` unless it is None, and delete files that were not read for a month.

    An unwritable folder is no error: the next export bakes again.
    """
    if key is None:
        return
    try:
        os.makedirs(folder(), exist_ok=True)
        path = os.path.join(folder(), key + ".npy")
        with open(f"{path}.{os.getpid()}", "wb") as file:
            numpy.save(file, values)
        os.replace(file.name, path)
        for entry in os.scandir(folder()):
            if time.time() - entry.stat().st_mtime > _MAX_AGE_DAYS * 86400:
                os.remove(entry.path)
    except OSError:
        pass


def recall(key, bake):
    """The array stored under `key`; if there is none, the result of `bake()`, which is stored."""
    values = load(key)
    if values is None:
        values = bake()
        store(key, values)
    return values


def digest(*parts):
    """A key of the bake cache: a digest of Blender's version and the given texts, numbers, bytes and arrays."""
    total = hashlib.sha256(bpy.app.version_string.encode())
    for part in parts:
        part = part.tobytes() if isinstance(part, numpy.ndarray) else part
        part = part if isinstance(part, bytes) else repr(part).encode()
        total.update(b"%d:" % len(part) + part)
    return total.hexdigest()[:40]


def mesh_digest(mesh):
    """A digest of a mesh: shape, normals, material of each face, and all attributes."""
    parts = [[uv.name for uv in mesh.uv_layers if uv.active_render], mesh.color_attributes.render_color_index]
    for attribute in mesh.attributes:
        if len(attribute.data) == 0:
            continue
        field = next((n for n in ("vector", "color", "value") if hasattr(attribute.data[0], n)), None)
        if field is None or attribute.data_type == "STRING":
            continue
        first = getattr(attribute.data[0], field)
        whole = attribute.data_type in {"INT", "INT8", "BOOLEAN", "INT32_2D", "INT16_2D"}
        count = len(first) if hasattr(first, "__len__") else 1
        values = numpy.empty(len(attribute.data) * count, numpy.int32 if whole else numpy.float32)
        attribute.data.foreach_get(field, values)
        parts += [attribute.name, attribute.domain, values]
    corners = numpy.empty(len(mesh.loops) * 3, numpy.float32)
    mesh.corner_normals.foreach_get("vector", corners)
    starts = numpy.empty(len(mesh.polygons), numpy.int32)
    mesh.polygons.foreach_get("loop_start", starts)
    return digest(*parts, corners, starts, tuple(mesh.texspace_location), tuple(mesh.texspace_size))


def trees_of(tree):
    """A node tree and the trees of its groups."""
    yield tree
    for node in tree.nodes:
        if node.type == "GROUP" and node.node_tree is not None:
            yield from trees_of(node.node_tree)


def nodes_key(tree, frame, *parts):
    """A hash of all that the values depend on which Cycles evaluates from a node tree; None if it cannot be known.

    `frame`: number and fraction of the frame; part of the hash if the tree has animated values, image sequences or movies.
    """
    trees = list(trees_of(tree))
    nodes = [node for one in trees for node in one.nodes]
    if any(n.type in _UNKNOWN_INPUTS or getattr(n, "attribute_type", "GEOMETRY") != "GEOMETRY" for n in nodes):
        return None
    images = [node.image for node in nodes if isinstance(getattr(node, "image", None), bpy.types.Image)]
    moves = any(one.animation_data for one in trees) or any(i.source in {"SEQUENCE", "MOVIE"} for i in images)
    return digest(tree_digest(tree), frame if moves else None, *parts)


def world_key(scene, *parts):
    """A key of values that Cycles evaluates from the world of a scene at its frame; None as for `nodes_key`."""
    world = scene.world
    settings = [_properties(getattr(world, name), 1) for name in ("cycles", "cycles_visibility")
                if hasattr(world, name)]
    return nodes_key(world.node_tree, (scene.frame_current, scene.frame_subframe), "world", settings, *parts)


def tree_digest(tree):
    """A digest of a node tree: nodes, values, links, images, groups."""
    parts = []
    for node in tree.nodes:
        parts += [node.name, node.bl_idname, _properties(node)]
        parts += [_plain(s.default_value) for s in node.inputs if hasattr(s, "default_value")]
        parts += [_plain(s.default_value) for s in node.outputs if hasattr(s, "default_value")]
        if node.type == "GROUP" and node.node_tree is not None:
            parts.append(tree_digest(node.node_tree))
    parts += sorted((k.from_node.name, k.from_socket.identifier, k.to_node.name, k.to_socket.identifier, k.is_muted)
                    for k in tree.links)
    return digest(*parts)


def _plain(value):
    return tuple(value) if hasattr(value, "__len__") and not isinstance(value, str) else value


def _properties(struct, depth=0):
    """The properties of a node, ramp or curve as nested lists."""
    found = []
    for name in struct.bl_rna.properties.keys():
        if name in (_IGNORED_PROPERTIES if depth == 0 else {"rna_type", "id_data"}):
            continue
        value = getattr(struct, name, None)
        if isinstance(value, bpy.types.Image):
            value = _image(value)
        elif isinstance(value, bpy.types.Object):
            value = [tuple(row) for row in value.matrix_world]
        elif isinstance(value, bpy.types.ID):
            value = value.name
        elif isinstance(value, bpy.types.bpy_struct):
            value = _properties(value, depth + 1) if depth < 4 else None
        elif isinstance(value, bpy.types.bpy_prop_collection):
            value = [_properties(item, depth + 1) for item in value] if depth < 4 else None
        elif hasattr(value, "__len__") and not isinstance(value, (str, set)):
            value = tuple(value)
        found.append((name, sorted(value) if isinstance(value, set) else value))
    return found


def _image(image):
    """The identity of an image: its texels if changed in memory, else path, size and time of its files.

    A sequence and an image of several tiles have all files whose names differ in numbers.
    """
    settings = (image.source, image.colorspace_settings.name, image.alpha_mode, tuple(image.size),
                [tile.number for tile in image.tiles])
    if image.packed_file is not None and not image.is_dirty:
        return settings, digest(*(one.packed_file.data for one in image.packed_files))
    if image.source in {"FILE", "MOVIE", "SEQUENCE", "TILED"} and not image.is_dirty:
        path = bpy.path.abspath(image.filepath, library=image.library)
        files = [path]
        if image.source in {"SEQUENCE", "TILED"}:
            base, name = os.path.split(path)
            files = sorted(glob.glob(os.path.join(glob.escape(base), re.sub(r"<\w+>|\d+", "*", glob.escape(name)))))
        if files and all(map(os.path.isfile, files)):
            return settings, [(f, os.stat(f).st_size, os.stat(f).st_mtime_ns) for f in files]
    if image.source == "TILED":  # changed in memory, where only the first tile can be read
        return settings, time.time_ns()
    texels = numpy.empty(len(image.pixels), numpy.float32)
    image.pixels.foreach_get(texels)
    return settings, digest(texels)
