"""Installs the extension in a Blender with a window, presses F12 and checks the picture. tests/extension.sh runs it.

    blender ... --python press_f12.py -- EXTENSION.zip PICTURE.png
"""

import os
import sys
import time
import traceback

import bpy

_ADDON = "bl_ext.user_default.caustique"
_TIMEOUT = 300  # seconds for the render


def stage():
    """Put a ball of glass on a table under a small lamp."""
    for thing in list(bpy.data.objects):
        bpy.data.objects.remove(thing)
    glass = bpy.data.materials.new("glass")
    glass.use_nodes = True
    sockets = glass.node_tree.nodes["Principled BSDF"].inputs
    sockets["Roughness"].default_value, sockets["Transmission Weight"].default_value = 0, 1
    bpy.ops.mesh.primitive_plane_add(size=8)
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.5, location=(0, 0, 0.5))
    bpy.context.object.data.materials.append(glass)
    bpy.ops.object.light_add(type="POINT", location=(-2, 1.5, 2.5))
    bpy.context.object.data.energy, bpy.context.object.data.shadow_soft_size = 300, 0.03
    bpy.ops.object.camera_add(location=(0, -4, 2.5), rotation=(1.05, 0, 0))
    scene = bpy.context.scene
    scene.camera = bpy.context.object
    scene.render.engine = "CAUSTIQUE"
    scene.render.resolution_x, scene.render.resolution_y = 160, 120
    scene.caustique_render.iterations = 8


def steps(archive, picture):
    """Install, render and check; yields the seconds to wait, because Blender works between calls of its timer."""
    start = time.monotonic()
    bpy.ops.extensions.package_install_files(filepath=archive, repo="user_default", enable_on_install=True)
    installed = time.monotonic()
    stage()
    program = sys.modules[f"{_ADDON}.program"].find("")
    assert program.startswith(os.path.realpath(os.environ["BLENDER_USER_RESOURCES"])), program
    assert not sys.modules[f"{_ADDON}.program"].missing_libraries(program)
    yield 1
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[0]):
        bpy.ops.render.render("INVOKE_DEFAULT")
    yield 1
    while bpy.app.is_job_running("RENDER"):
        assert time.monotonic() - installed < _TIMEOUT, "the render does not end"
        yield 0.2
    faults = sys.modules[f"{_ADDON}.session"].faults
    assert not faults, faults
    bpy.data.images["Render Result"].save_render(picture)
    image = bpy.data.images.load(picture)
    pixels = list(image.pixels)
    assert tuple(image.size) == (160, 120) and max(pixels[0::4]) > min(pixels[0::4]), "the picture is empty"
    print(f"installed in {installed - start:.0f} s, first picture after {time.monotonic() - start:.0f} s")
    print("1 passed, 0 failed", flush=True)


def main(archive, picture):
    """Run the steps, and end Blender."""
    bpy.context.preferences.view.show_splash = False
    left = steps(archive, picture)

    def step():
        try:
            return next(left)
        except StopIteration:
            os._exit(0)
        except Exception:  # Blender must not stay open.
            traceback.print_exc()
            os._exit(1)

    bpy.app.timers.register(step, first_interval=2)


if __name__ == "__main__":
    main(*sys.argv[sys.argv.index("--") + 1 :])
