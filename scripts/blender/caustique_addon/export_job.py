"""Export one frame of one scene, in a Blender of its own: `blender -b --python export_job.py -- JOB.json`.

The job is an object: `blend` (the file), `scene`, `view_layer`, `frame` (with its fraction), `scripts` (whether Python
in the file may run), `exporter` (the folder of export.py), `glb` (the file to write) and `report` (the file for what is
left to say: {"warnings": [..]}, or {"error": ".."}).
"""

import json
import os
import sys

import bpy


def export(job):
    """Do the job; the exporter's warnings."""
    bpy.ops.wm.open_mainfile(filepath=job["blend"], load_ui=False, use_scripts=job["scripts"])
    scene = bpy.data.scenes[job["scene"]]
    bpy.context.window.scene = scene
    for layer in [layer for layer in scene.view_layers if layer.name != job["view_layer"]]:
        scene.view_layers.remove(layer)
    scene.render.engine = "CYCLES"  # the add-on is not here, and the exporter reads the scene as Cycles would
    scene.render.use_border = False  # the add-on cuts the picture itself
    whole = int(job["frame"] // 1)
    scene.frame_set(whole, subframe=job["frame"] - whole)
    sys.path.insert(0, job["exporter"])
    import export as exporter  # it needs its folder on the path, which concerns this process alone

    return exporter.write(job["glb"])


def main(path):
    """Do the job at `path` and report."""
    with open(path, encoding="utf-8") as file:
        job = json.load(file)
    try:
        report = {"warnings": export(job)}
    except Exception as error:  # whatever Blender raises is told in the other Blender
        report = {"error": f"{type(error).__name__}: {error}"}
    with open(job["report"], "w", encoding="utf-8") as file:
        json.dump(report, file)


if __name__ == "__main__":
    main(sys.argv[-1])
    sys.stdout.flush()
    os._exit(0)  # Blender as a module may hang while it shuts down
