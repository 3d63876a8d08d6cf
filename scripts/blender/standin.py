"""Stand-ins for baked meshes: the evaluated mesh with an additional UV map without overlaps."""

import contextlib

import bpy
import bmesh
import numpy

UV, GENERATED, OBJECT = "caustique bake", "caustique generated", "caustique object"
# The custom property of an object with Object Info's random number: it depends on the names of the original objects.
RANDOM = "caustique_random"
# Attributes with the axes of normal maps end in a letter and the UV map's name; nodes that read them have this name, too.
_AXES = "caustique normal map"
# Textures that use Generated coordinates if Vector is not linked.
_BY_GENERATED = {"TEX_NOISE", "TEX_VORONOI", "TEX_WAVE", "TEX_MAGIC", "TEX_BRICK", "TEX_CHECKER", "TEX_GRADIENT",
                 "TEX_GABOR", "TEX_MUSGRAVE"}
# Nodes that read the object's transform, lengths in world space, or the object's properties.
_BY_OBJECT = {
    "OBJECT_INFO", "NEW_GEOMETRY", "PARTICLE_INFO", "HAIR_INFO", "CAMERA", "VECT_TRANSFORM", "AMBIENT_OCCLUSION",
    "BEVEL", "WIREFRAME", "TEX_ENVIRONMENT", "TEX_SKY",
}
_BY_CAMERA = ("Camera", "Window", "Reflection")  # outputs of Texture Coordinate
_DEFORM = {
    "ARMATURE", "CAST", "CURVE", "DISPLACE", "HOOK", "LAPLACIANDEFORM", "LATTICE", "MESH_DEFORM", "SHRINKWRAP",
    "SIMPLE_DEFORM", "SMOOTH", "CORRECTIVE_SMOOTH", "LAPLACIANSMOOTH", "SURFACE_DEFORM", "WARP", "WAVE", "CLOTH",
    "SOFT_BODY", "VOLUME_DISPLACE",
}


def is_even_on_object(node):
    """Whether the outputs of a shader node have one value on an object."""
    return node.type == "OBJECT_INFO" or (
        node.type == "ATTRIBUTE" and node.attribute_type != "GEOMETRY")


def depends_on_object(graph):
    """Whether a material depends on its object: on the object's transform, index, colour or random number."""
    for tree in graph.trees():
        for node in tree.nodes:
            if node.name.startswith(_AXES):  # as steep on every object with this mesh
                continue
            if node.type in _BY_OBJECT or (
                    node.type == "ATTRIBUTE" and node.attribute_type != "GEOMETRY"):
                return True
            if node.type in {"TEX_COORD", "BUMP", "NORMAL_MAP", "TANGENT"} and (
                    getattr(node, "object", None) is not None or getattr(node, "space", "") in {"WORLD", "OBJECT"}):
                return True
            if node.type in {"DISPLACEMENT", "VECTOR_DISPLACEMENT"} and node.space == "WORLD":
                return True
            if node.type == "TEX_COORD" and any(node.outputs[name].is_linked for name in _BY_CAMERA):
                return True
    return False


def read_coordinates(graph):
    """Make a graph read coordinates from the attributes that `swap` adds: Generated ones are those of the undeformed
    shape, and Object ones those before a transform of the mesh. Random numbers are those of the original objects.

    Returns {output socket: the socket that replaces it}, for values that are not linked yet.
    """
    made = {}
    for tree in graph.trees():
        unlinked = [s for n in tree.nodes if n.type in _BY_GENERATED for s in n.inputs
                    if s.name == "Vector" and not s.is_linked]
        places = [n for n in tree.nodes if n.type == "TEX_COORD"]
        for name, kind, output, sources, wanting in (
                (GENERATED, "GEOMETRY", "Vector", [n.outputs["Generated"] for n in places], unlinked),
                (OBJECT, "GEOMETRY", "Vector", [n.outputs["Object"] for n in places if n.object is None], []),
                (RANDOM, "OBJECT", "Fac", [n.outputs["Random"] for n in tree.nodes if n.type == "OBJECT_INFO"], [])):
            if sources or wanting:
                node = tree.nodes.new("ShaderNodeAttribute")
                node.attribute_name, node.attribute_type = name, kind
                made |= {source: node.outputs[output] for source in sources}
                for socket in wanting + [link.to_socket for source in sources for link in source.links]:
                    tree.links.new(node.outputs[output], socket)
    return made


def read_normal_map_axes(graph):
    """Make a graph's tangent-space normal maps read their axes from the attributes of `add_normal_map_axes`."""
    for tree in graph.trees():
        for node in [n for n in tree.nodes if n.type == "NORMAL_MAP" and n.space == "TANGENT" and not n.mute]:
            bent = _on_axes(tree, node)
            for link in list(node.outputs["Normal"].links):
                tree.links.new(bent, link.to_socket)


def _on_axes(tree, node):
    """The normal (world space) of a Normal Map node, with the axes from attributes: its weights are Cycles'."""
    def new(kind, operation, *values, output=0):
        made = tree.nodes.new("ShaderNode" + kind)
        made.operation = operation
        for socket, value in zip(made.inputs, values):
            if isinstance(value, bpy.types.NodeSocket):
                tree.links.new(value, socket)
            elif value is not None:
                socket.default_value = value
        return made.outputs[output]

    colour, strength = (
        node.inputs[n].links[0].from_socket if node.inputs[n].is_linked else node.inputs[n].default_value
        for n in ("Color", "Strength"))
    colour = colour if isinstance(colour, bpy.types.NodeSocket) else tuple(colour)[:3]
    strength = new("Math", "MAXIMUM", strength, 0.0)
    split = tree.nodes.new("ShaderNodeSeparateXYZ")
    tree.links.new(new("VectorMath", "MULTIPLY_ADD", colour, (2, 2, 2), (-1, -1, -1)), split.inputs[0])
    x, y = (new("Math", "MULTIPLY", part, strength) for part in split.outputs[:2])
    z = new("Math", "MULTIPLY_ADD", new("Math", "SUBTRACT", split.outputs[2], 1.0),
            new("Math", "MINIMUM", strength, 1.0), 1.0)
    total = (0.0, 0.0, 0.0)
    for letter, weight in zip("tbn", (x, y, z)):
        axis = tree.nodes.new("ShaderNodeAttribute")
        axis.attribute_name = f"{_AXES} {letter} {node.uv_map}"
        scaled = new("VectorMath", "SCALE", axis.outputs["Vector"], None, None, weight)
        total = new("VectorMath", "ADD", total, scaled)
    turn = tree.nodes.new("ShaderNodeVectorTransform")
    turn.name, turn.vector_type, turn.convert_from, turn.convert_to = _AXES, "NORMAL", "OBJECT", "WORLD"
    tree.links.new(total, turn.inputs[0])
    return turn.outputs[0]


def add_normal_map_axes(mesh, matrix=None):
    """Add the axes of normal maps to the corners of a mesh that `matrix` (3 x 3) will transform, unless it has them.

    Cycles evaluates a map in object space and transforms the normal as a normal, by the inverse transpose; so do the
    axes: tangent, bitangent and normal. They are added for each UV map, and without name for the active one.
    """
    if any(name.startswith(_AXES) for name in mesh.attributes.keys()) or not mesh.polygons:
        return
    if max(len(face.vertices) for face in mesh.polygons) > 4:  # for which Blender computes no tangents
        _split_polygons(mesh)
    shown = next((layer.name for layer in mesh.uv_layers if layer.active_render), None)
    turn = numpy.array(matrix.inverted_safe() if matrix is not None else numpy.eye(3))  # on rows: times the inverse
    for name in ["", *(layer.name for layer in mesh.uv_layers)]:
        for letter, axis in zip("tbn", _axes(mesh, name or shown)):
            layer = mesh.attributes.new(f"{_AXES} {letter} {name}", "FLOAT_VECTOR", "CORNER")
            layer.data.foreach_set("vector", (axis @ turn).astype(numpy.float32).ravel())


def _split_polygons(mesh):
    shape = bmesh.new()
    shape.from_mesh(mesh)
    bmesh.ops.triangulate(shape, faces=[face for face in shape.faces if len(face.verts) > 4])
    shape.to_mesh(mesh)
    shape.free()


def _axes(mesh, uv_map):
    """Tangent, bitangent and normal of each corner of a mesh, (count, 3) each. Without a UV map the normal alone."""
    count = len(mesh.loops)
    normals, tangents = numpy.empty(count * 3, numpy.float32), numpy.zeros(count * 3, numpy.float32)
    signs = numpy.zeros(count, numpy.float32)
    if uv_map is not None:
        mesh.calc_tangents(uvmap=uv_map)
        mesh.loops.foreach_get("tangent", tangents)
        mesh.loops.foreach_get("bitangent_sign", signs)
        mesh.free_tangents()
    mesh.corner_normals.foreach_get("vector", normals)
    normals, tangents = normals.reshape(-1, 3), tangents.reshape(-1, 3)
    return tangents, signs[:, None] * numpy.cross(normals, tangents), normals


def _positions(thing):
    """Vertex positions of an evaluated object in object space: (count, 3)."""
    mesh = thing.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
    places = numpy.empty(len(mesh.vertices) * 3, numpy.float32)
    mesh.vertices.foreach_get("co", places)
    thing.to_mesh_clear()
    return places.reshape(-1, 3)


def add_object_coordinates(mesh):
    """Add Object coordinates to the vertices of a mesh, unless it has them from before a transform."""
    if mesh.vertices and OBJECT not in mesh.attributes:
        places = numpy.empty(len(mesh.vertices) * 3, numpy.float32)
        mesh.vertices.foreach_get("co", places)
        mesh.attributes.new(OBJECT, "FLOAT_VECTOR", "POINT").data.foreach_set("vector", places)


def add_generated_coordinates(thing, mesh, say):
    """Add Generated coordinates to the vertices of `mesh`, the evaluated mesh of `thing`.

    They are positions of the undeformed shape relative to the bounding box of the object's mesh, or of the shape itself
    if the object is no mesh.
    """
    if not mesh.vertices or GENERATED in mesh.attributes:
        return
    places = numpy.empty(len(mesh.vertices) * 3, numpy.float32)
    mesh.vertices.foreach_get("co", places)
    places = places.reshape(-1, 3)
    deforming = [m for m in thing.modifiers if m.type in _DEFORM and m.show_viewport]
    if deforming:
        with contextlib.ExitStack() as undo:
            for modifier in deforming:
                undo.callback(setattr, modifier, "show_viewport", True)
                modifier.show_viewport = False
            undeformed = _positions(thing)
        if len(undeformed) == len(places):
            places = undeformed
        else:
            say(f"Generated coordinates are those of the shape that {', '.join(m.name for m in deforming)} made; "
                "apply these modifiers, or use UV coordinates")
    box = thing.data if thing.type == "MESH" else mesh
    centre, half = numpy.array(box.texspace_location), numpy.array(box.texspace_size)
    inside = (places - centre) / (2 * numpy.maximum(half, 1e-12)) + 0.5
    layer = mesh.attributes.new(GENERATED, "FLOAT_VECTOR", "POINT")
    layer.data.foreach_set("vector", inside.astype(numpy.float32).ravel())


def swap(thing, undo, say):
    """Give `thing` its evaluated mesh until `undo` closes. Returns the object that represents it.

    An object that is no mesh is hidden, and a new mesh object replaces it. `say` receives warnings.
    """
    depsgraph = bpy.context.evaluated_depsgraph_get()
    evaluated = thing.evaluated_get(depsgraph)
    mesh = bpy.data.meshes.new_from_object(evaluated, preserve_all_data_layers=True, depsgraph=depsgraph)
    undo.callback(bpy.data.meshes.remove, mesh)
    if thing.type == "MESH" and thing.data.is_editable:
        name = thing.data.name
        undo.callback(setattr, thing.data, "name", name)
        undo.callback(setattr, mesh, "name", name + " baked")
        thing.data.name, mesh.name = name + " unbaked", name
    add_generated_coordinates(thing, mesh, say)
    add_object_coordinates(mesh)
    if thing.type == "MESH":
        body, before = thing, thing.data
        for modifier in thing.modifiers:
            for shown in ("show_viewport", "show_render"):
                undo.callback(setattr, modifier, shown, getattr(modifier, shown))
                setattr(modifier, shown, False)
        slots = [(slot.link, slot.material) for slot in thing.material_slots]
        thing.data = mesh
        undo.callback(restore, thing, before, slots)
        for i, (link, material) in enumerate(slots):
            thing.material_slots[i].link = "DATA"
            mesh.materials[i] = material
    else:
        body = bpy.data.objects.new(thing.name, mesh)
        undo.callback(bpy.data.objects.remove, body)
        for collection in thing.users_collection:
            collection.objects.link(body)
        body.matrix_world = thing.matrix_world.copy()
        undo.callback(setattr, thing, "hide_render", False)
        thing.hide_render = True
    return body


def restore(thing, mesh, slots):
    """Restore an object's mesh, and the link and material of each of its slots."""
    thing.data = mesh
    for slot, (link, material) in zip(thing.material_slots, slots):
        slot.link = link
        slot.material = material


def unwrap(body, size):
    """Add the UV map for images of `size` texels per side to the mesh of `body`, an object of the current view
    layer."""
    mesh = body.data
    mesh.uv_layers.active = mesh.uv_layers.new(name=UV)
    layer = bpy.context.view_layer
    for other in layer.objects:
        other.select_set(other == body)
    layer.objects.active = body
    bpy.ops.object.mode_set(mode="EDIT")
    try:
        bpy.ops.mesh.reveal(select=True)
        bpy.ops.mesh.select_all(action="SELECT")
        bpy.ops.uv.smart_project(angle_limit=1.15, island_margin=4 / size, area_weight=0.0)
    finally:
        bpy.ops.object.mode_set(mode="OBJECT")


def keep_two_uv_maps(mesh):
    """Keep the render UV map and the baked one alone, because caustique reads two. Returns the index of the baked
    one."""
    shown = next((uv.name for uv in mesh.uv_layers if uv.active_render), UV)
    for name in [uv.name for uv in mesh.uv_layers if uv.name not in {shown, UV}]:
        mesh.uv_layers.remove(mesh.uv_layers[name])
    return [uv.name for uv in mesh.uv_layers].index(UV)
