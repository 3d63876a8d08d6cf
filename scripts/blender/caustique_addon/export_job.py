"""Exports frames of scenes in a second Blender process: `blender -b --python export_job.py`.

It reads jobs from standard input, one per line, and ends with the input. A job is an object in JSON: `blend` (the file),
`scene`, `view_layer`, `frame` (with its fraction), `scripts` (whether Python in the file may run), `exporter` (the folder of
export.py), `glb` (the file to write), `progress` (the file to write what it does to), `only` (names of changed objects to
export, or null for all) and `report` (the file to write {"warnings": [..], "only": [..], "animates_all": ..} or
{"error": "..", "place": ".."} to at last; `only` has the exported objects, or is null for all; `animates_all`: whether this
Blender knows all properties that the file animates).
"""

import json
import os
import sys
import traceback

import bpy


def export(job):
    """Export the scene and frame that `job` names to its GLB file. Returns the report."""
    bpy.ops.wm.open_mainfile(filepath=job["blend"], load_ui=False, use_scripts=job["scripts"])
    scene = bpy.data.scenes[job["scene"]]
    bpy.context.window.scene = scene
    for layer in [layer for layer in scene.view_layers if layer.name != job["view_layer"]]:
        scene.view_layers.remove(layer)
    scene.render.engine = "CYCLES"  # this Blender lacks the add-on, and the exporter reads the scene as Cycles would
    scene.render.use_border = False  # the add-on crops the picture itself
    scene.render.use_compositing = False  # the first Blender composes the picture
    scene.render.pixel_aspect_x = scene.render.pixel_aspect_y = 1  # the add-on itself warns
    # Makes the dependency graph the active one: only that writes animated values of materials to their data.
    bpy.context.evaluated_depsgraph_get()
    whole = int(job["frame"] // 1)
    scene.frame_set(whole, subframe=job["frame"] - whole)
    if job["exporter"] not in sys.path:
        sys.path.insert(0, job["exporter"])
    import export as exporter  # its folder is on the search path of this process alone

    def tell(text):
        write(job["progress"], text)

    only = None if job["only"] is None else exporter.selection(scene, job["only"])
    warnings = exporter.write(job["glb"], progress=tell, only=only)
    return {"warnings": warnings, "only": None if only is None else sorted(only), "animates_all": animates_all()}


def animates_all():
    """Whether this Blender knows all properties that the file animates. It does not know those of the user's add-ons, whose
    values in the file are those of the frame at which the first Blender wrote it."""
    for kind in bpy.data.bl_rna.properties:
        for block in getattr(bpy.data, kind.identifier) if kind.type == "COLLECTION" else ():
            for owner in (block, getattr(block, "node_tree", None)):
                animation = getattr(owner, "animation_data", None)
                if animation is not None and not all(knows(owner, curve) for curve in curves(animation)):
                    return False
    return True


def knows(owner, curve):
    """Whether the property that a curve animates exists."""
    try:
        owner.path_resolve(curve.data_path, False)
    except ValueError:
        return False
    return True


def curves(animation):
    """The curves of a data block's animation, its drivers included."""
    yield from animation.drivers
    yield from curves_of_action(animation)
    strips = [strip for track in animation.nla_tracks for strip in track.strips]
    while strips:
        strip = strips.pop()
        yield from curves_of_action(strip)
        yield from strip.fcurves
        strips += getattr(strip, "strips", ())  # of a meta strip


def curves_of_action(owner):
    """The curves of the action of an animation or a strip. Since Blender 4.4 an action has curves of several data blocks."""
    action = owner.action
    if action is None:
        return ()
    if not hasattr(owner, "action_slot_handle"):
        return action.fcurves
    return [curve for layer in action.layers for strip in layer.strips for bag in strip.channelbags
            if bag.slot_handle == owner.action_slot_handle for curve in bag.fcurves]


def write(path, text):
    """Write a whole file at once, because the first Blender may look for it at any time."""
    with open(path + ".new", "w", encoding="utf-8") as file:
        file.write(text)
    os.replace(path + ".new", path)


def place_of(error, folder):
    """The last line of the exporter in an error's traceback; None if Blender's own glTF exporter has failed."""
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename.startswith(folder)]
    if not frames or "glTF exporter" in str(error):
        return None
    return f"{os.path.basename(frames[-1].filename)}, line {frames[-1].lineno}"


def main(job):
    """Do a job and write its report."""
    try:
        report = export(job)
    except Exception as error:  # the first Blender shows any error of this one
        traceback.print_exc()
        report = {"error": f"{type(error).__name__}: {error}", "place": place_of(error, job["exporter"])}
    write(job["report"], json.dumps(report))


if __name__ == "__main__":
    for line in sys.stdin:
        main(json.loads(line))
    sys.stdout.flush()
    os._exit(0)  # Blender as a module may hang while it shuts down
