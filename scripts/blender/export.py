"""Turn a .blend into a .glb that caustique renders as Cycles would see it.

    python3 scripts/blender/export.py IN.blend OUT.glb               with bpy from PyPI (4.5 on Python 3.11, 5.2 on 3.13)
    blender -b IN.blend --python scripts/blender/export.py -- OUT.glb
    import export; export.write("OUT.glb")                           the scene that is open in bpy

Blender's own glTF exporter writes the file. Beyond its defaults this switches on cameras, lights, custom properties and
applied modifiers (at render level), and completes what it leaves out:

- area lights become one-sided emissive meshes of the same radiance;
- shaders, mixes of them and node groups become the nearest glTF material, and what varies in ways that glTF has no
  words for is baked into images (--bake-size N, --no-bake);
- transmissive materials on closed meshes become solid (KHR_materials_volume), so that they refract;
- absorption keeps Cycles' coefficients; a material's custom property `abbe` (number V_d) or `dispersion` (20/V_d, as in
  glTF) becomes KHR_materials_dispersion;
- `extras.caustique` holds the rest: of the scene `environment` and `medium`, of cameras `aperture_radius` and
  `focus_distance`, of light nodes `radius` or `angle_deg`, of materials a `medium` that scatters.

Lights keep the exporter's standard units (lm/W 683). Whatever cannot be carried is named in a warning on stderr.
"""

import argparse
import contextlib
import os
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

import bpy  # noqa: E402

import bake  # noqa: E402
import glb  # noqa: E402
import lighting  # noqa: E402
import shading  # noqa: E402
import surfaces  # noqa: E402

_CARRIED = {"MESH", "CURVE", "SURFACE", "FONT", "META", "EMPTY", "LIGHT", "CAMERA", "ARMATURE", "LATTICE", "SPEAKER"}


def write(path, scene=None, bake_size=bake.SIZE):
    """Export the open scene (or `scene`) to the .glb at `path`; return the warnings, a list of strings.

    `bake_size`: texels a side of the images into which materials are baked; 0 bakes none and names what is lost. The
    scene is left as it was found.
    """
    path = os.path.abspath(path)
    if scene is not None and scene != bpy.context.window.scene:
        bpy.context.window.scene = scene
    scene = bpy.context.scene
    warnings = []

    def warn(where, what):
        line = f"{where}: {what}"
        if line not in warnings:
            warnings.append(line)
            print("warning: " + line, file=sys.stderr)

    shown = [thing for thing in scene.objects if not thing.hide_render]
    with contextlib.ExitStack() as undo:
        for thing in shown:
            _render_level(thing, undo, warn)
        worn = surfaces.Surfaces(_with_instanced(shown), _worn(shown), undo, warn, bake_size)
        for thing in shown:
            if thing.type == "LIGHT" and thing.data.type == "AREA":
                lighting.area_mesh(thing, undo, warn)
        bpy.context.view_layer.update()
        bodies = _bodies()
        _run_exporter(path)
    document, buffer = glb.read(path)
    buffer = worn.finish(document, buffer, bodies)
    _finish_nodes(document, scene, warn)
    _finish_lamps(document)
    said = lighting.world_extras(scene, path, warn)
    document["scenes"][document.get("scene", 0)].setdefault("extras", {}).setdefault("caustique", {}).update(said)
    used = {name for part in document.get("materials", []) for name in part.get("extensions", {})}
    document["extensionsUsed"] = sorted(used | set(document.get("extensionsUsed", [])))
    if not document["extensionsUsed"]:
        del document["extensionsUsed"]
    glb.write(path, document, buffer)
    return warnings


def _run_exporter(path):
    bpy.ops.export_scene.gltf(
        filepath=path, export_format="GLB", export_import_convert_lighting_mode="SPEC", export_yup=True,
        export_apply=True, export_cameras=True, export_lights=True, export_extras=True, use_renderable=True,
        use_active_scene=True, export_animations=False, export_skins=False, export_morph=False,
        export_tangents=False, export_image_format="AUTO")


def _render_level(thing, undo, warn):
    """The exporter evaluates modifiers as the viewport shows them: let it show what a render would."""
    where = f'object "{thing.name}"'
    if thing.type not in _CARRIED:
        warn(where, f"objects of type {thing.type} are not carried")
    if getattr(thing, "particle_systems", None):
        warn(where, "particle systems are not carried: convert them to meshes")
    for ray in ("camera", "diffuse", "glossy", "transmission", "volume_scatter", "shadow"):
        lamp = thing.type == "LIGHT" and (ray != "camera" or thing.data.type == "AREA")
        if (lamp or thing.type == "MESH") and not getattr(thing, "visible_" + ray, True):
            warn(where, f"it is hidden from {ray} rays in Cycles: caustique shows it to all")
    for modifier in thing.modifiers:
        for name, value in (("levels", getattr(modifier, "render_levels", None)), ("show_viewport", modifier.show_render)):
            if value is not None and hasattr(modifier, name) and getattr(modifier, name) != value:
                undo.callback(setattr, modifier, name, getattr(modifier, name))
                setattr(modifier, name, value)


def _with_instanced(things):
    """Objects, and those of the collections that they are instances of."""
    inside = [o for t in things if t.instance_collection for o in t.instance_collection.all_objects]
    return list(dict.fromkeys([*things, *inside]))


def _worn(things):
    """Materials that something in the scene wears, instanced collections included."""
    found = {}
    for thing in _with_instanced(things):
        for material in surfaces.materials_of(thing):
            if material is not None:
                found[material.name] = material
    return list(found.values())


def _bodies():
    """For each worn material whether all its meshes are closed, and the least extent of their bounding boxes (m)."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    shapes, bodies = {}, {}
    for instance in depsgraph.object_instances:
        thing = instance.object
        if thing.type not in {"MESH", "CURVE", "SURFACE", "FONT", "META"}:
            continue
        materials = [slot.material.original for slot in thing.material_slots if slot.material is not None]
        if not any(may_transmit(m) for m in materials):
            continue
        key = thing.original.name
        if key not in shapes:
            mesh = thing.to_mesh()
            shapes[key] = _closed(mesh)
            thing.to_mesh_clear()
        extent = min(d for d in thing.dimensions) or max(thing.dimensions) or 1.0
        for material in materials:
            closed, least = bodies.get(material.name, (True, extent))
            bodies[material.name] = (closed and shapes[key], min(least, extent))
    return bodies


def may_transmit(material):
    """Whether light may pass into what wears this material."""
    output = shading.output_of(shading.nodes_of(material))
    if output is None:
        return False
    if output.inputs["Volume"].is_linked:
        return True
    parts = shading.leaves(shading.source(output.inputs["Surface"]))
    return any(shading.constant(p.inputs["Transmission Weight"], 1.0) for p in parts if p.type == "BSDF_PRINCIPLED")


def _closed(mesh):
    """Whether every edge has two faces once vertices in the same place count as one."""
    if mesh is None or not mesh.polygons:
        return False
    places, merged = {}, []
    for vertex in mesh.vertices:
        merged.append(places.setdefault(tuple(round(c, 6) for c in vertex.co), len(places)))
    uses = {}
    for polygon in mesh.polygons:
        ring = [merged[v] for v in polygon.vertices]
        for a, b in zip(ring, ring[1:] + ring[:1]):
            if a != b:
                uses[min(a, b), max(a, b)] = uses.get((min(a, b), max(a, b)), 0) + 1
    return all(count % 2 == 0 for count in uses.values())


def _finish_nodes(document, scene, warn):
    nodes = document.get("nodes", [])
    for node in nodes:
        thing = scene.objects.get(node.get("name", ""))
        if thing is None:
            continue
        if "camera" in node:
            said, holder = lighting.camera_extras(thing, warn), document["cameras"][node["camera"]]
        elif thing.type == "LIGHT" and thing.data.type != "AREA":
            said, holder = lighting.light_extras(thing, warn), node
        else:
            continue
        if said:
            holder.setdefault("extras", {}).setdefault("caustique", {}).update(said)
    _active_camera_first(document, scene)


def _finish_lamps(document):
    """A lamp's Emission node multiplies its power and colour; the exporter takes them one for the other."""
    for entry in document.get("extensions", {}).get("KHR_lights_punctual", {}).get("lights", []):
        light = bpy.data.lights.get(entry.get("name", ""))
        if light is not None and lighting.emission_node(light) is not None:
            entry.update(lighting.punctual(light))


def _active_camera_first(document, scene):
    """Readers take the first camera: make it the one that Blender renders through."""
    nodes, roots = document.get("nodes", []), document["scenes"][document.get("scene", 0)].get("nodes", [])
    active = scene.camera.name if scene.camera is not None else None
    index = next((i for i, n in enumerate(nodes) if n.get("name") == active and "camera" in n), None)
    if index is None:
        return
    first = nodes[index]["camera"]
    cameras = document["cameras"]
    cameras.insert(0, cameras.pop(first))
    for node in nodes:
        if "camera" in node:
            node["camera"] = 0 if node["camera"] == first else node["camera"] + (node["camera"] < first)
    above = {child: i for i, n in enumerate(nodes) for child in n.get("children", [])}
    while index in above:
        index = above[index]
    roots.sort(key=lambda root: root != index)


def main(arguments):
    """Command line: [IN.blend] OUT.glb; the exit code."""
    parser = argparse.ArgumentParser(
        prog="export.py", usage="export.py [options] IN.blend OUT.glb\n       "
        "blender -b IN.blend --python export.py -- [options] OUT.glb")
    parser.add_argument("files", nargs="+", metavar="FILE", help="[IN.blend] OUT.glb")
    parser.add_argument("--bake-size", type=int, default=bake.SIZE, metavar="N",
                        help=f"texels a side of the images into which materials are baked (default {bake.SIZE})")
    parser.add_argument("--no-bake", action="store_true", help="bake no material; each loss is named")
    given = parser.parse_args(arguments)
    if len(given.files) > 2 or not given.files[-1].endswith(".glb"):
        parser.error("OUT.glb has to end in .glb, with at most one IN.blend before it")
    if not 4 <= given.bake_size <= 16384:
        parser.error("--bake-size has to lie between 4 and 16384 texels")
    try:
        if len(given.files) == 2:
            source = os.path.abspath(given.files[0])
            bpy.ops.wm.open_mainfile(filepath=source, load_ui=False, use_scripts=False)
        write(given.files[-1], bake_size=0 if given.no_bake else given.bake_size)
    except Exception as error:  # whatever Blender raises: a message and a code, never a hanging process
        print(f"error: {given.files[0]}: {error}".strip(), file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    given = sys.argv[sys.argv.index("--") + 1:] if "--" in sys.argv else sys.argv[1:]
    try:
        code = main(given)
    except SystemExit as stopped:  # help, or a command line that is wrong
        code = stopped.code
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)  # Blender as a module may hang while it shuts down
