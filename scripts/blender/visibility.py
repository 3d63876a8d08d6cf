"""Makes the viewport show what a render would show, while the exporter evaluates the scene.

Blender evaluates geometry for Python with the viewport's settings. `as_rendered` copies the render settings to them:
which objects, collections, instancers and modifiers are shown, and their level of detail.
"""

import bpy

RAYS = ("camera", "diffuse", "glossy", "transmission", "volume_scatter", "shadow")
# {name of a render setting: name of the viewport setting}
_MODIFIER = {"show_render": "show_viewport", "render_levels": "levels", "resolution": "viewport_resolution"}
_CURVE = {"render_resolution_u": "resolution_u", "render_resolution_v": "resolution_v"}
_PARTICLES = {"rendered_child_count": "child_percent", "render_step": "display_step"}
_SIMPLIFY = {"simplify_subdivision_render": "simplify_subdivision",
             "simplify_child_particles_render": "simplify_child_particles"}


def as_rendered(scene, undo, warn):
    """Make the viewport of `scene` show what a render would show, until `undo` (a contextlib.ExitStack) closes."""

    def put(thing, name, value):
        before = getattr(thing, name)
        if before != value:
            undo.callback(setattr, thing, name, before)
            setattr(thing, name, value)

    def take(thing, names):
        for render, viewport in names.items():
            if hasattr(thing, render) and hasattr(thing, viewport):
                put(thing, viewport, getattr(thing, render))

    layer = _layer(scene, warn)
    if bpy.context.view_layer != layer:
        undo.callback(setattr, bpy.context.window, "view_layer", bpy.context.view_layer)
        bpy.context.window.view_layer = layer
    take(scene.render, _SIMPLIFY)
    for collection in bpy.data.collections:
        put(collection, "hide_viewport", collection.hide_render)
    _show_layers(layer.layer_collection, put)
    for thing in bpy.data.objects:
        # The scene's camera works even if it is hidden.
        put(thing, "hide_viewport", thing.hide_render and thing.type != "CAMERA")
        put(thing, "show_instancer_for_viewport", thing.show_instancer_for_render)
        for modifier in thing.modifiers:
            take(modifier, _MODIFIER)
            _warn_of_viewport_nodes(thing, modifier, warn)
    for thing in layer.objects:
        if thing.hide_get(view_layer=layer):
            undo.callback(thing.hide_set, True, view_layer=layer)
            thing.hide_set(False, view_layer=layer)
    for curve in bpy.data.curves:
        for render, viewport in _CURVE.items():
            if getattr(curve, render, 0) > 0:  # 0: as in the viewport
                put(curve, viewport, getattr(curve, render))
    for ball in bpy.data.metaballs:
        put(ball, "resolution", ball.render_resolution)
    for settings in bpy.data.particles:
        put(settings, "display_percentage", 100)
        take(settings, _PARTICLES)


def rendered_layer(scene):
    """The rendered view layer: the current one if it is enabled, else the first enabled one."""
    rendered = _rendered_layers(scene)
    current = bpy.context.window.view_layer
    return current if current in rendered else rendered[0]


def _rendered_layers(scene):
    return [layer for layer in scene.view_layers if layer.use] or [scene.view_layers[0]]


def _layer(scene, warn):
    layer, rendered = rendered_layer(scene), _rendered_layers(scene)
    rest = ", ".join(f'"{other.name}"' for other in rendered if other != layer)
    if rest:
        warn(f'scene "{scene.name}"', f'of its view layers only "{layer.name}" is exported, not {rest}; '
                                                            "render by F12, which renders all view layers, or make "
                                                            "another one active")
    parts = {"use_solid": "surfaces", "use_strand": "hair", "use_volumes": "volumes"}
    off = [name for switch, name in parts.items() if not getattr(layer, switch, True)]
    if off:
        warn(f'view layer "{layer.name}"', f"its filter leaves out {', '.join(off)}, which is not carried: they are seen; "
                                           "hide these objects in renders")
    if layer.material_override is not None:
        warn(f'view layer "{layer.name}"', "its material override is not carried: objects keep their own materials; "
                                           "assign the material to the objects")
    return layer


def _show_layers(branch, put):
    for child in branch.children:
        put(child, "hide_viewport", False)  # the outliner's eye: renders ignore it
        _show_layers(child, put)


def _warn_of_viewport_nodes(thing, modifier, warn):
    if modifier.type == "NODES" and modifier.show_render and _asks_for_viewport(modifier.node_group, set()):
        warn(f'object "{thing.name}"', f'its modifier "{modifier.name}" has an Is Viewport node, which says yes here; '
             "switch the node's use off before the export")


def _asks_for_viewport(tree, seen):
    if tree is None or tree in seen:
        return False
    seen.add(tree)
    return any(node.bl_idname == "GeometryNodeIsViewport" or _asks_for_viewport(getattr(node, "node_tree", None), seen)
               for node in tree.nodes)


def indirect_only(layer):
    """Names of objects that are only in collections with Indirect Only in the view layer."""
    seen, hidden = set(), set()

    def look(branch, indirect):
        if branch.exclude:
            return
        indirect = indirect or branch.indirect_only
        (hidden if indirect else seen).update(thing.name for thing in branch.collection.objects)
        for child in branch.children:
            look(child, indirect)

    look(layer.layer_collection, False)
    return hidden - seen


def hidden_rays(thing, instancer=None):
    """Kinds of rays that do not hit an object in Cycles, by its own settings or its instancer's."""
    return [ray for ray in RAYS if not all(getattr(t, "visible_" + ray, True) for t in (thing, instancer) if t)]


def light_group(thing, instancer, layer):
    """The light group of an object, else of its instancer, if the view layer has the group; else None."""
    known = {group.name for group in getattr(layer, "lightgroups", ())}
    names = (getattr(each, "lightgroup", "") for each in (thing, instancer) if each)
    return next((name for name in names if name in known), None)
