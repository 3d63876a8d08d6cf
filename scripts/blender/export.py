"""Export a .blend to a .glb that caustique renders as Cycles would.

    .venv-bpy/bin/python scripts/blender/export.py IN.blend OUT.glb
    blender -b IN.blend --python scripts/blender/export.py -- OUT.glb
    ... OUT.####.glb --frames 1-24                                  one file per frame
    import export; export.write("OUT.glb")                          the scene open in bpy

`objects` evaluates the scene as a render would, and Blender's glTF exporter writes the file. Around the exporter:

- `lighting`: area lamps become emissive meshes that rays pass through; other lamps get size, edge and colour;
- `surfaces`: shaders, mixes of shaders and node groups become the nearest glTF material. Variation that glTF cannot
  express is baked to images (--bake-size N, --no-bake);
- `shading`: transmissive materials on closed meshes become solid (KHR_materials_volume), so that they refract, with
  Cycles' coefficients; a custom property `abbe` (number V_d) or `dispersion` (20/V_d) becomes KHR_materials_dispersion;
- `world` and `sky`: environment and medium; the sun of a sky texture becomes a lamp;
- `camera_export`: lens, shift, and the scene's picture settings;
- `motion` and `motion_gltf`: motion while the shutter is open, as an animation.

`extras.caustique` holds features that glTF lacks (docs/scene-format.md). Lights keep the exporter's standard units
(683 lm/W). A warning on stderr and in the file names each feature that is lost.
"""

import argparse
import contextlib
import math
import os
import re
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

try:
    import bpy  # first: it makes numpy importable
except ModuleNotFoundError as error:
    sys.exit(f"error: {error}\nhint: run this in Blender (blender -b IN.blend --python export.py -- OUT.glb), or in a "
             "Python that has bpy, such as the .venv-bpy/bin/python that 'scripts/setup.sh bpy' makes")

import numpy

import bake
import camera_export
import glb
import export_guard as guard
import lamp_pictures
import lamp_profiles
import lighting
import linking
import motion_gltf
import objects
import shading
import sky
import standin
import surfaces
import volumes
import world

# Angle between the shading normal and the face, and the share of a mesh's area, above which the picture differs visibly
# from Cycles, which softens such normals.
_LEANING_DEGREES, _MAX_LEANING_SHARE = 25, 0.02
# The same angles for normals of the object's own, which may all lean one way, on glass and on polished surfaces.
_OWN_LEANING_DEGREES = {"glass": 10, "polished": 17}
_POLISHED = 0.6  # roughness below which a mirror image shows


def write(path, scene=None, bake_size=bake.SIZE, progress=lambda text: None, only=None):
    """Export the open scene (or `scene`) at its current frame to the .glb at `path`. Returns the warnings, a list of
    texts.

    `bake_size`: texels per side of baked images; 0 bakes nothing and warns of each loss instead. `progress(text)`
    receives what the export does. The file repeats the warnings as the scene's `losses`. The scene is left unchanged.

    `only`: the objects to export (`selection`), without world and picture settings; None exports all.
    """
    path = os.path.abspath(path)
    scene = scene or bpy.context.scene
    warnings = []

    def warn(where, what):
        line = f"{where}: {what}"
        if line not in warnings:
            warnings.append(line)
            print("warning: " + line, file=sys.stderr)

    with contextlib.ExitStack() as undo:
        _open_scene(scene, undo)
        # The lighting mode of `_run_exporter`, so that the program need not guess it.
        said, sun = {"light_units": "photometric"}, None
        if only is None:
            progress("Exporting the world")
            around, sun = world.extras(scene, path, warn)
            said.update(around)
            said.update(guard.attempt(warn, f'scene "{scene.name}"', {}, "the picture has the program's own settings",
                                      camera_export.picture, scene, warn))
        progress("Exporting the objects")
        flat = objects.FlatScene(scene, undo, warn, bool(bake_size), only)
        _open_scene(flat.scene, undo)
        bpy.context.view_layer.update()
        camera_export.add_cameras(flat, warn)
        polished = _polished(flat.things)  # of the artist's materials, which stand-ins replace now
        worn = surfaces.Surfaces(flat, _materials_of(flat.things), undo, warn, bake_size, progress)
        lighting.warn_of_soft_falloff(flat, warn)
        lighting.add_lamps(flat, warn)
        if sun is not None:
            environment = said["environment"]
            hidden = ["camera"] if "background" in environment else []
            sky.add_sun(sun, flat, hidden, environment.get("light_group"))
        bodies = _solidity(flat.things)
        _warn_of_leaning_normals(flat, polished, warn)
        guard.attempt(warn, f'scene "{scene.name}"', None, "a camera within glass is not named",
                      _warn_of_immersed_camera, flat, bodies, warn)
        bpy.context.view_layer.update()
        progress("Writing the exported scene")
        _export_all_it_can(path, flat, warn)
    document, buffer = glb.read(path)
    bodies_of_nodes = [node.get("name") for node in document.get("nodes", [])]
    linking.write(document, flat.keys, bodies_of_nodes)
    _restore_names(document, flat.names)
    buffer = worn.finish(document, buffer, bodies)
    _warn_of_stretched_normals(document, warn)
    _correct_lamps(document, flat.lamps)
    camera_export.correct_sizes(document, scene.render)
    buffer = lamp_profiles.embed(document, buffer, flat.profiles)
    buffer = lamp_pictures.embed(document, buffer, flat.pictures)
    volumes.embed(document, flat.volumes, path, warn)
    _put_active_camera_first(document, scene)
    buffer = motion_gltf.write(document, buffer, flat.motion, bodies_of_nodes, warn)
    said.update(motion_gltf.scene_keys(flat.motion))
    _warn_of_refused_drivers(scene, warn)
    said["losses"] = warnings
    document["scenes"][document.get("scene", 0)].setdefault("extras", {})["caustique"] = said
    used = {name for part in document.get("materials", []) for name in part.get("extensions", {})}
    document["extensionsUsed"] = sorted(used | set(document.get("extensionsUsed", [])))
    if not document["extensionsUsed"]:
        del document["extensionsUsed"]
    glb.write(path, document, buffer)
    return warnings


def selection(scene, names):
    """The names of the objects to export after a change of the objects `names`: also those that share a transmissive
    material with them, because whether it is a solid depends on all its meshes. None if one of them has instances."""
    # Blender removes an instance when the next one is asked for.
    instanced = {thing.original.name for i in bpy.context.evaluated_depsgraph_get().object_instances if i.is_instance
                 for thing in (i.object, i.parent)}
    worn = {thing.name: {m.name for m in surfaces.materials_of(thing) if m is not None and may_transmit(m)}
            for thing in scene.objects if thing.type not in {"LIGHT", "CAMERA", "EMPTY"}}
    found, size = set(names), 0
    while len(found) > size:
        size = len(found)
        clear = set().union(*(worn.get(name, set()) for name in found))
        found |= {name for name, materials in worn.items() if materials & clear}
    return None if found & instanced else found


def write_frames(path, first, last, bake_size=bake.SIZE):
    """Export frames `first` to `last` of the open scene, one .glb each. The frame's number replaces `####` in
    `path`."""
    scene, warnings = bpy.context.scene, []
    before = scene.frame_current, scene.frame_subframe
    try:
        for frame in range(first, last + 1):
            scene.frame_set(frame)
            warnings += [w for w in write(_numbered(path, frame), bake_size=bake_size) if w not in warnings]
    finally:
        scene.frame_set(before[0], subframe=before[1])
    return warnings


def _numbered(path, frame):
    return re.sub("#+", lambda run: str(frame).zfill(len(run.group())), path)


def _open_scene(scene, undo):
    """Make `scene` the open one until `undo` closes."""
    window = bpy.context.window
    if window.scene != scene:
        # Undone last, because setting a scene also sets its first view layer.
        undo.callback(setattr, window, "view_layer", window.view_layer)
        undo.callback(setattr, window, "scene", window.scene)
        window.scene = scene


def _run_exporter(path):
    bpy.ops.export_scene.gltf(
        filepath=path, export_format="GLB", export_import_convert_lighting_mode="SPEC", export_yup=True,
        export_apply=False, export_cameras=True, export_lights=True, export_extras=True, use_active_scene=True,
        export_animations=False, export_current_frame=True, export_skins=False, export_morph=False,
        export_tangents=False, export_attributes=motion_gltf.has_labels(bpy.context.scene.objects),
        export_image_format="AUTO")


def _export_all_it_can(path, flat, warn):
    """Run Blender's exporter. If it fails, find the objects that it cannot export, and leave them out."""
    faults = []
    motion_gltf.keep_labels_alone(flat.things)

    def works(things):
        for thing in flat.things:
            (flat.hide if thing not in things else flat.show)(thing)
        try:
            _run_exporter(path)
        except Exception as error:  # the operator raises the errors of a whole add-on
            faults.append(guard.summary(error))
            return False
        return True

    if works(flat.things):
        return
    _, bad = guard.exportable(flat.things, works)
    for thing in bad:
        where = flat.where(thing)
        warn(where, f"Blender's exporter fails on it ({faults[0]}): it is left out; {guard.remedy(where)}")
        flat.remove(thing)
    if not works(flat.things):
        raise RuntimeError(f"Blender's glTF exporter fails: {faults[-1]}")


def _materials_of(things):
    """The materials in the material slots of the objects `things`."""
    found = {m.name: m for thing in things for m in surfaces.materials_of(thing) if m is not None}
    return list(found.values())


def _solidity(things):
    """For each material: whether all its meshes are closed, and the smallest extent of their bounding boxes (m)."""
    shapes, bodies = {}, {}
    for thing in things:
        materials = [slot.material for slot in thing.material_slots if slot.material is not None]
        if thing.type != "MESH" or not any(may_transmit(material) for material in materials):
            continue
        if thing.data not in shapes:
            shapes[thing.data] = _closed(thing.data)
        extent = min(d for d in thing.dimensions) or max(thing.dimensions) or 1.0
        for material in materials:
            closed, least = bodies.get(material.name, (True, extent))
            bodies[material.name] = (closed and shapes[thing.data], min(least, extent))
    return bodies


def _warn_of_leaning_normals(flat, polished, warn):
    """Warn of meshes whose shading normals lean far from their faces. `polished`: names of objects."""
    seen = set()
    for thing in flat.things:
        if thing.type != "MESH" or thing.data in seen:
            continue
        seen.add(thing.data)
        guard.attempt(warn, flat.where(thing), None, "its normals are not checked", _warn_of_leaning, thing, flat,
                      thing.name in polished, warn)


def _warn_of_leaning(thing, flat, polished, warn):
    glass = any(slot.material and may_transmit(slot.material) for slot in thing.material_slots)
    own, kind = thing.data.has_custom_normals, "glass" if glass else "polished" if polished else "matt"
    limit = _OWN_LEANING_DEGREES.get(kind, _LEANING_DEGREES) if own else _LEANING_DEGREES
    share = _leaning_share(thing.data, limit)
    if share > _MAX_LEANING_SHARE:
        remedy = ("clear its own normals (Object Data > Geometry Data > Clear Custom Split Normals Data), or model the shape "
                  "that they pretend" if own else "mark these edges sharp, or bevel them with more segments")
        warn(flat.where(thing), f"its smooth shading leans by more than {limit} degrees from its faces on {share:.0%} of its "
             f"area: there it is {'brighter' if glass else 'brighter or darker'} than in Cycles; {remedy}")


def _polished(things):
    """Names of the objects with a polished material."""
    return {thing.name for thing in things if any(m is not None and _is_polished(m) for m in surfaces.materials_of(thing))}


def _is_polished(material):
    """Whether the highlights of a material are sharp enough to show where its normals point."""
    with guard.naming(f'material "{material.name}"'):
        output = shading.output_of(shading.nodes_of(material))
        parts = shading.leaves(output.inputs["Surface"]) if output is not None else []
        roughness = [shading.constant(part.inputs["Roughness"], path, 0.0) for part, path in parts
                     if part.type not in {"BSDF_DIFFUSE", "DIFFUSE_BSDF"} and "Roughness" in part.inputs]
        return any(value < _POLISHED for value in roughness)


def _warn_of_immersed_camera(flat, bodies, warn):
    """Warn if the active camera is in water or glass, whose radiance is n^2 times that outside; Cycles leaves it out."""
    camera = flat.scene.camera
    if camera is None:
        return
    depsgraph, eye = bpy.context.evaluated_depsgraph_get(), camera.matrix_world.translation
    for thing in flat.things:
        closed = any(bodies.get(slot.material.name, (False,))[0] for slot in thing.material_slots if slot.material)
        if thing.type != "MESH" or not closed:
            continue
        inside = thing.matrix_world.inverted_safe() @ eye
        found, at, normal, _ = thing.closest_point_on_mesh(inside, depsgraph=depsgraph)
        if found and (inside - at).dot(normal) < 0:
            warn(flat.where(camera), f"it is inside {flat.where(thing)}: if that has an index n, the picture is n^2 times "
                 "as bright as in Cycles (1.77 times in water), as radiance is; lower the exposure to see the same")


def _warn_of_refused_drivers(scene, warn):
    """Warn if Blender has refused to run the Python of a driver in the file."""
    if bpy.app.autoexec_fail and bpy.app.autoexec_fail_message.startswith("Driver"):
        warn(f'scene "{scene.name}"', f"Python in the file does not run ({bpy.app.autoexec_fail_message}), and what it "
             "drives keeps its last value; use a simple expression, or bake the values to keyframes")


def _leaning_share(mesh, degrees):
    """The share of a mesh's area at whose corners the shading normal leans by more than `degrees` from the face."""
    count = len(mesh.polygons)
    corners, faces = numpy.empty(len(mesh.loops) * 3, numpy.float32), numpy.empty(count * 3, numpy.float32)
    areas, totals = numpy.empty(count, numpy.float32), numpy.empty(count, numpy.int32)
    mesh.corner_normals.foreach_get("vector", corners)
    for name, values in (("normal", faces), ("area", areas), ("loop_total", totals)):
        mesh.polygons.foreach_get(name, values)
    cosines = (corners.reshape(-1, 3) * numpy.repeat(faces.reshape(-1, 3), totals, axis=0)).sum(1)
    weights = numpy.repeat(areas / totals, totals)
    return float(weights[cosines < math.cos(math.radians(degrees))].sum() / max(weights.sum(), 1e-30))


def may_transmit(material):
    """Whether light may enter an object with this material."""
    with guard.naming(f'material "{material.name}"'):
        output = shading.output_of(shading.nodes_of(material))
        if output is None:
            return False
        if shading.source(output.inputs["Volume"])[0] is not None:
            return True
        parts = shading.leaves(output.inputs["Surface"])
        return any(shading.constant(p.inputs[name], path, 1.0) for p, path in parts if p.type == "BSDF_PRINCIPLED"
                   for name in ("Transmission Weight", "Subsurface Weight"))


def _closed(mesh):
    """Whether every edge has two faces, with vertices at equal positions merged."""
    if mesh is None or not mesh.polygons:
        return False
    places = numpy.empty(len(mesh.vertices) * 3, numpy.float32)
    mesh.vertices.foreach_get("co", places)
    corners = numpy.empty(len(mesh.loops), numpy.int32)
    mesh.loops.foreach_get("vertex_index", corners)
    starts, totals = (numpy.empty(len(mesh.polygons), numpy.int32) for _ in range(2))
    mesh.polygons.foreach_get("loop_start", starts)
    mesh.polygons.foreach_get("loop_total", totals)
    micrometres = numpy.rint(places.reshape(-1, 3).astype(float) * 1e6).astype(numpy.int64)
    _, merged = numpy.unique(micrometres, axis=0, return_inverse=True)
    following = numpy.arange(len(corners)) + 1
    following[starts + totals - 1] = starts
    ends = merged.reshape(-1)[corners].astype(numpy.int64)
    ends = numpy.sort(numpy.stack([ends, ends[following]]), axis=0)
    ends = ends[:, ends[0] != ends[1]]
    _, uses = numpy.unique(ends[0] * len(mesh.vertices) + ends[1], return_counts=True)
    return bool(numpy.all(uses % 2 == 0))


def _restore_names(document, names):
    """Restore the names of the original objects and meshes, which Blender reserves while the originals exist. Removes the
    random numbers of objects, which only baking needs."""
    for node in document.get("nodes", []):
        node.get("extras", {}).pop(standin.RANDOM, None)
        if node.get("extras") == {}:
            del node["extras"]
    for part in ("scenes", "nodes", "meshes"):
        for entry in document.get(part, []):
            entry["name"] = names.get(entry.get("name", ""), entry.get("name", ""))


def _correct_lamps(document, lamps):
    """Give the lights of a document the names, colours and intensities of `FlatScene.lamps`."""
    for entry in document.get("extensions", {}).get("KHR_lights_punctual", {}).get("lights", []):
        entry.update(lamps.get(entry.get("name"), {}))


def _warn_of_stretched_normals(document, warn):
    """Warn of unevenly scaled objects with normal maps, which Cycles stretches: it reads maps in object space."""
    mapped = {i for i, material in enumerate(document.get("materials", [])) if "normalTexture" in material}
    for node in document.get("nodes", []):
        scale = [abs(s) for s in node.get("scale", (1, 1, 1))]
        parts = document["meshes"][node["mesh"]]["primitives"] if "mesh" in node else ()
        if objects.is_uneven(scale) and any(part.get("material") in mapped for part in parts):
            warn(f'object "{node["name"]}"', objects.STRETCHED)


def _put_active_camera_first(document, scene):
    """Put Blender's active camera first, because readers take the first camera."""
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
    """Run the command line [IN.blend] OUT.glb. Returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="export.py", usage="export.py [options] IN.blend OUT.glb\n       "
        "blender -b IN.blend --python export.py -- [options] OUT.glb")
    parser.add_argument("files", nargs="+", metavar="FILE", help="[IN.blend] OUT.glb")
    parser.add_argument("--frames", type=_frames, metavar="A-B",
                        help="one file per frame from A to B; the frame's number replaces #### in OUT.glb")
    parser.add_argument("--bake-size", type=int, default=bake.SIZE, metavar="N",
                        help=f"texels per side of baked images (default {bake.SIZE})")
    parser.add_argument("--no-bake", action="store_true", help="bake nothing; warn of each loss instead")
    given = parser.parse_args(arguments)
    if len(given.files) > 2 or not given.files[-1].endswith(".glb"):
        parser.error("OUT.glb has to end in .glb, with at most one IN.blend before it")
    if not 4 <= given.bake_size <= 16384:
        parser.error("--bake-size has to lie between 4 and 16384 texels")
    if given.frames and "#" not in given.files[-1]:
        parser.error("--frames: OUT.glb has to have a place for the frame's number, as in shot.####.glb")
    try:
        if len(given.files) == 2:
            source = os.path.abspath(given.files[0])
            bpy.ops.wm.open_mainfile(filepath=source, load_ui=False, use_scripts=False)
        size = 0 if given.no_bake else given.bake_size
        if given.frames:
            write_frames(given.files[-1], *given.frames, size)
        else:
            write(given.files[-1], bake_size=size)
    except Exception as error:  # any error of Blender: a message and an exit code, never a hanging process
        place = f"{error.place}: " if hasattr(error, "place") else ""
        print(f"error: {given.files[0]}: {place}{error}".strip(), file=sys.stderr)
        return 1
    return 0


def _frames(text):
    """The first and the last frame of the range A-B."""
    match = re.fullmatch(r"(-?\d+)-(-?\d+)", text)
    if match is None or int(match[1]) > int(match[2]):
        raise argparse.ArgumentTypeError("give the first and the last frame, as in 1-24")
    return int(match[1]), int(match[2])


if __name__ == "__main__":
    given = sys.argv[sys.argv.index("--") + 1:] if "--" in sys.argv else sys.argv[1:]
    try:
        code = main(given)
    except SystemExit as stopped:  # help, or a wrong command line
        code = stopped.code
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)  # Blender as a module may hang while it shuts down
