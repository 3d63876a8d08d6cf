"""A new Blender that opens a .blend with the add-on, renders it once, and prints the seconds since the opening as JSON:
blender_session.py f12|viewport PROGRAM BLEND ITERATIONS WIDTH HEIGHT."""

import json
import os
import sys
import tempfile
import time
from pathlib import Path

import bpy

import package

REPOSITORY = "caustique_session"
ADDON = f"bl_ext.{REPOSITORY}.caustique"
PATIENCE_SECONDS = 600


def install(folder, program):
    """Installs and enables the add-on as a user does."""
    archive = Path(folder) / "caustique.zip"
    package.build(str(archive))
    places = bpy.context.preferences.extensions.repos
    places.new(name=REPOSITORY, module=REPOSITORY, custom_directory=str(Path(folder) / "extensions"))
    bpy.ops.extensions.package_install_files(filepath=str(archive), repo=REPOSITORY, enable_on_install=True)
    bpy.context.preferences.addons[ADDON].preferences.program = program


def viewport(scene, size, iterations, start):
    """Seconds of the first coarse picture, and of the last iteration's."""
    module, times = sys.modules[f"{ADDON}.viewport"], {}
    view, camera = module.Viewport(scene, scene.view_layers[0]), scene.camera
    depsgraph = bpy.context.evaluated_depsgraph_get()
    view.update(depsgraph)
    view.want(camera.matrix_world.inverted(), camera.calc_matrix_camera(depsgraph, x=size[0], y=size[1]), 0.0, size)
    while "finished" not in times:
        if view._live.fault or time.monotonic() - start > PATIENCE_SECONDS:
            raise SystemExit(f"the viewport shows no picture: {view._live.fault}")
        view.tick()
        if view.is_current():
            about = view._live.picture.about
            times.setdefault("coarse", time.monotonic() - start)
            if about["iteration"] >= iterations and not about["coarse"]:
                times["finished"] = time.monotonic() - start
        time.sleep(0.005)
    view.close()
    return times


def main(path, program, blend, iterations, width, height):
    with tempfile.TemporaryDirectory() as folder:
        install(folder, program)
        start = time.monotonic()
        bpy.ops.wm.open_mainfile(filepath=blend)
        scene, size = bpy.context.scene, (int(width), int(height))
        scene.render.engine, scene.render.resolution_percentage = "CAUSTIQUE", 100
        scene.render.resolution_x, scene.render.resolution_y = size
        scene.caustique_render.iterations = int(iterations)
        scene.render.filepath = str(Path(folder) / "picture.png")
        times = {}
        if path == "viewport":
            times = viewport(scene, size, int(iterations), start)
        else:
            bpy.ops.render.render(write_still=True)
            if not Path(scene.render.filepath).exists():
                raise SystemExit("F12 wrote no picture")
            times["finished"] = time.monotonic() - start
        print(json.dumps({name: round(seconds, 2) for name, seconds in times.items()}), flush=True)
    # Blender as a module may hang while it shuts down.
    os._exit(0)


if __name__ == "__main__":
    main(*sys.argv[1:])
