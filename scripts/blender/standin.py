"""Stand-ins for meshes that are baked: the evaluated shape with a UV map of its own, in which nothing overlaps."""

import bpy

from graph import feed

UV = "caustique bake"
_DEFORM = {
    "ARMATURE", "CAST", "CURVE", "DISPLACE", "HOOK", "LAPLACIANDEFORM", "LATTICE", "MESH_DEFORM", "SHRINKWRAP",
    "SIMPLE_DEFORM", "SMOOTH", "CORRECTIVE_SMOOTH", "LAPLACIANSMOOTH", "SURFACE_DEFORM", "WARP", "WAVE", "CLOTH",
    "SOFT_BODY", "VOLUME_DISPLACE",
}


def of_object(graph):
    """Whether a material looks different on each object that wears it: it asks where, which or what colour that is."""
    for tree in graph.trees():
        for node in tree.nodes:
            if node.type in {"OBJECT_INFO", "NEW_GEOMETRY", "PARTICLE_INFO"} or (
                    node.type == "ATTRIBUTE" and node.attribute_type != "GEOMETRY"):
                return True
            if node.type in {"TEX_COORD", "BUMP", "NORMAL_MAP", "TANGENT"} and (
                    getattr(node, "object", None) is not None or getattr(node, "space", "") in {"WORLD", "OBJECT"}):
                return True
    return False


def asks_for_generated(graph):
    """Whether a material reads coordinates of the shape before it was deformed."""
    procedural = {"TEX_NOISE", "TEX_VORONOI", "TEX_WAVE", "TEX_MAGIC", "TEX_BRICK", "TEX_CHECKER", "TEX_GRADIENT",
                  "TEX_GABOR", "TEX_WHITE_NOISE"}
    for tree in graph.trees():
        for node in tree.nodes:
            if node.type == "TEX_COORD" and node.outputs["Generated"].is_linked:
                return True
            if node.type in procedural and feed(node.inputs["Vector"])[0] == node.inputs["Vector"]:
                return True
    return False


def swap(thing, graphs, undo, say):
    """Give `thing` its evaluated mesh until `undo` closes, and return the object that now stands for it.

    Objects that are no meshes are hidden behind a new one. `graphs` are those of the materials that are baked.
    """
    depsgraph = bpy.context.evaluated_depsgraph_get()
    evaluated = thing.evaluated_get(depsgraph)
    mesh = bpy.data.meshes.new_from_object(evaluated, preserve_all_data_layers=True, depsgraph=depsgraph)
    undo.callback(bpy.data.meshes.remove, mesh)
    if thing.type == "MESH":
        name = thing.data.name
        undo.callback(setattr, thing.data, "name", name)
        undo.callback(setattr, mesh, "name", name + " baked")
        thing.data.name, mesh.name = name + " unbaked", name
    deformed = [m.name for m in thing.modifiers if m.type in _DEFORM and m.show_viewport]
    if deformed and any(map(asks_for_generated, graphs)):
        say(f"Generated coordinates are taken from the shape that {', '.join(deformed)} made")
    if thing.type == "MESH":
        _keep_texture_space(thing.data, mesh)
        body, before = thing, thing.data
        for modifier in thing.modifiers:
            undo.callback(setattr, modifier, "show_viewport", modifier.show_viewport)
            modifier.show_viewport = False
        worn = [(slot.link, slot.material) for slot in thing.material_slots]
        thing.data = mesh
        undo.callback(restore, thing, before, worn)
        for i, (link, material) in enumerate(worn):
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


def restore(thing, mesh, worn):
    """Give an object back its mesh, and its slots where they hang and what they hold."""
    thing.data = mesh
    for slot, (link, material) in zip(thing.material_slots, worn):
        slot.link = link
        slot.material = material


def _keep_texture_space(old, new):
    """Generated coordinates are counted in the box of the mesh before its modifiers."""
    new.use_auto_texspace = False
    new.texspace_location, new.texspace_size = old.texspace_location, old.texspace_size


def unwrap(body, size):
    """Add the UV map for images of `size` texels a side to the mesh of `body`, which is in the current view layer."""
    mesh = body.data
    mesh.uv_layers.active = mesh.uv_layers.new(name=UV)
    layer = bpy.context.view_layer
    for other in layer.objects:
        other.select_set(other == body)
    layer.objects.active = body
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.reveal(select=True)
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.uv.smart_project(angle_limit=1.15, island_margin=4 / size, area_weight=0.0)
    bpy.ops.object.mode_set(mode="OBJECT")


def keep_two_uv_maps(mesh):
    """Leave the UV map that renders show and the one that is baked to: caustique reads two."""
    shown = next((uv.name for uv in mesh.uv_layers if uv.active_render), UV)
    for name in [uv.name for uv in mesh.uv_layers if uv.name not in {shown, UV}]:
        mesh.uv_layers.remove(mesh.uv_layers[name])
    return [uv.name for uv in mesh.uv_layers].index(UV)
