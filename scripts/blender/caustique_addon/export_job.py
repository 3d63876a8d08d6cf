"""Exports one frame of a scene in a second Blender process: `blender -b --python export_job.py -- JOB.json`.

The job is an object: `blend` (the file), `scene`, `view_layer`, `frame` (with its fraction), `scripts` (whether Python
in the file may run), `exporter` (the folder of export.py), `glb` (the file to write), `progress` (the file to write what
it does to), `only` (names of changed objects to export, or null for all) and `report` (the file to write
{"warnings": [..], "only": [..]} or {"error": "..", "place": ".."} to; `only` has the exported objects, or is null for all).
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
    whole = int(job["frame"] // 1)
    scene.frame_set(whole, subframe=job["frame"] - whole)
    sys.path.insert(0, job["exporter"])
    import export as exporter  # its folder is on the search path of this process alone

    def tell(text):
        with open(job["progress"] + ".new", "w", encoding="utf-8") as file:
            file.write(text)
        os.replace(job["progress"] + ".new", job["progress"])

    only = None if job["only"] is None else exporter.selection(scene, job["only"])
    warnings = exporter.write(job["glb"], progress=tell, only=only)
    return {"warnings": warnings, "only": None if only is None else sorted(only)}


def place_of(error, folder):
    """The last line of the exporter in an error's traceback; None if Blender's own glTF exporter has failed."""
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename.startswith(folder)]
    if not frames or "glTF exporter" in str(error):
        return None
    return f"{os.path.basename(frames[-1].filename)}, line {frames[-1].lineno}"


def main(path):
    """Do the job in the file `path` and write the report."""
    with open(path, encoding="utf-8") as file:
        job = json.load(file)
    try:
        report = export(job)
    except Exception as error:  # the first Blender shows any error of this one
        traceback.print_exc()
        report = {"error": f"{type(error).__name__}: {error}", "place": place_of(error, job["exporter"])}
    with open(job["report"], "w", encoding="utf-8") as file:
        json.dump(report, file)


if __name__ == "__main__":
    main(sys.argv[-1])
    sys.stdout.flush()
    os._exit(0)  # Blender as a module may hang while it shuts down
