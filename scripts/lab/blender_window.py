"""Takes the pictures of `scripts/lab.sh screenshots`, inside a Blender that has a window.

    blender ... --python blender_window.py -- ADDON.zip FOLDER

Blender draws only between two calls of its timer, so the steps are a generator that yields the seconds to wait.
"""

import math
import os
import subprocess
import sys
import time
import traceback

import bpy

_PICTURE_SHARE = 0.6  # of the big area's width; the panels have the rest
_NOTCHES = 12  # of the mouse wheel, to scroll past the diagnosis
_TIMEOUT = 120  # seconds for a picture to improve, or a render to end


def install(archive):
    """Install the add-on as a user would, and set its program."""
    if hasattr(bpy.ops, "extensions") and bpy.app.version >= (4, 2, 0):
        bpy.ops.extensions.package_install_files(filepath=archive, repo="user_default", enable_on_install=True)
        name = "bl_ext.user_default.caustique"
    else:
        bpy.ops.preferences.addon_install(filepath=archive)
        bpy.ops.preferences.addon_enable(module="caustique")
        name = "caustique"
    preferences = bpy.context.preferences.addons[name].preferences
    preferences.program = os.environ["CAUSTIQUE_BIN"]
    if bpy.app.version < (4, 2, 0):
        preferences.exporter = os.environ["CAUSTIQUE_EXPORTER"]
    return name, preferences


def material(name, color, roughness, **inputs):
    """A Principled material; `inputs` has the names of Blender 4, with _ for spaces."""
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    sockets = made.node_tree.nodes["Principled BSDF"].inputs
    sockets["Base Color"].default_value, sockets["Roughness"].default_value = (*color, 1), roughness
    for key, value in inputs.items():
        socket = key.replace("_", " ")
        sockets[socket if socket in sockets else socket.replace(" Weight", "")].default_value = value
    return made


def stage():
    """Build the scene: a ball of glass, a ring of metal and a bowl that is not closed, on a table, under a small lamp."""
    for thing in list(bpy.data.objects):
        bpy.data.objects.remove(thing)
    glass = material("crystal", (1, 1, 1), 0, Transmission_Weight=1)
    pane = material("window glass", (0.9, 1, 0.95), 0, Transmission_Weight=1)
    gold = material("gold", (1, 0.75, 0.35), 0.05, Metallic=1)

    def finish(name, made):
        thing = bpy.context.object
        thing.name = name
        thing.data.materials.append(made)
        for face in thing.data.polygons:
            face.use_smooth = True
        return thing

    bpy.ops.mesh.primitive_plane_add(size=8)
    finish("table", material("wood", (0.5, 0.4, 0.32), 0.6))
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.5, segments=96, ring_count=48, location=(-0.75, 0, 0.5))
    finish("ball", glass)
    bpy.ops.mesh.primitive_cylinder_add(
        radius=0.55, depth=0.4, vertices=128, end_fill_type="NOTHING", location=(0.55, 0.45, 0.2)
    )
    finish("ring", gold)
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.45, segments=64, ring_count=32, location=(0.75, -0.75, 0.45))
    bowl = finish("bowl", pane)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.mesh.bisect(plane_co=(0.75, -0.75, 0.55), plane_no=(0, 0, 1), clear_outer=True)
    bpy.ops.object.mode_set(mode="OBJECT")
    bowl.select_set(False)
    bpy.ops.object.light_add(type="POINT", location=(-2.2, 1.6, 2.4))
    bpy.context.object.name = "lamp"
    bpy.context.object.data.energy, bpy.context.object.data.shadow_soft_size = 300, 0.03
    bpy.ops.object.camera_add(location=(0.4, -4.4, 2.6), rotation=(math.radians(61), 0, math.radians(4)))
    scene = bpy.context.scene
    scene.camera = bpy.context.object
    scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.5
    scene.render.engine = "CAUSTIQUE"
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 480, 360, 100


def steps_of(archive, folder):
    """Takes the pictures one after another; yields the seconds to wait."""
    window = bpy.context.window_manager.windows[0]
    name, preferences = install(archive)
    stage()
    scene, session = bpy.context.scene, sys.modules[f"{name}.session"]
    shown = count(sys.modules[f"{name}.engine"].Engine)
    left, panels = split(window)
    yield 1
    panels.spaces.active.context = "RENDER"
    scene.caustique_render.iterations = 5000
    left.type = "IMAGE_EDITOR"
    render(window)
    left.spaces.active.image = bpy.data.images["Render Result"]
    for number in (1, 4):
        yield from wait(lambda: len(shown) >= number, "the picture does not improve")
        yield 0.5
        take(window, folder, f"improves-{number}")
    press_escape()
    pressed = time.monotonic()
    yield from wait(lambda: not bpy.app.is_job_running("RENDER"), "Esc does not stop the render")
    print(f"stopped {time.monotonic() - pressed:.1f} s after Esc")
    yield 1
    take(window, folder, "stopped")

    left.type = "VIEW_3D"
    yield 0.5
    left.spaces.active.region_3d.view_perspective = "CAMERA"
    left.spaces.active.shading.type = "MATERIAL"
    scene.caustique_render.iterations = 64
    with bpy.context.temp_override(window=window):
        bpy.ops.caustique.diagnose("INVOKE_DEFAULT")
    yield from wait(lambda: session.plans, "the program does not answer")
    yield 15  # EEVEE compiles shaders
    take(window, folder, "diagnosis")
    scroll(window, panels)
    yield 1
    take(window, folder, "effects")
    panels.spaces.active.context = "VIEW_LAYER"
    yield 1
    take(window, folder, "passes")

    panels.spaces.active.context = "RENDER"
    preferences.program = "/opt/caustique"
    left.type = "IMAGE_EDITOR"
    render(window)
    yield 1.5
    take(window, folder, "error")
    assert session.faults


def wait(condition, otherwise):
    """Wait until `condition()` holds; raises an error with the text `otherwise` after the timeout."""
    end = time.monotonic() + _TIMEOUT
    while not condition():
        if time.monotonic() > end:
            raise RuntimeError(otherwise)
        yield 0.1


def count(engine):
    """A list that grows by one with every picture that the engine shows during a render."""
    shown, show = [], engine._show

    def counted(self, *arguments):
        show(self, *arguments)
        shown.append(True)

    engine._show = counted
    return shown


def split(window):
    """Split the largest area of the window; the right part shows the properties. Returns both parts."""
    big = max(window.screen.areas, key=lambda area: area.width * area.height)
    known = set(window.screen.areas)
    with bpy.context.temp_override(window=window, area=big):
        bpy.ops.screen.area_split(direction="VERTICAL", factor=_PICTURE_SHARE)
    fresh = next(area for area in window.screen.areas if area not in known)
    left, right = sorted((big, fresh), key=lambda area: area.x)
    right.type = "PROPERTIES"
    return left, right


def render(window):
    """Press F12."""
    with bpy.context.temp_override(window=window):
        bpy.ops.render.render("INVOKE_DEFAULT")


def press_escape():
    """Press Esc through the X server, because Blender ignores simulated events during a render."""
    subprocess.run("xdotool search --class Blender windowfocus mousemove 300 700 key Escape", shell=True, check=True)


def scroll(window, area):
    """Scroll an area down."""
    region = next(region for region in area.regions if region.type == "WINDOW")
    with bpy.context.temp_override(window=window, area=area, region=region):
        for _ in range(_NOTCHES):
            bpy.ops.view2d.scroll_down()


def take(window, folder, name):
    """Write a screenshot of the window."""
    with bpy.context.temp_override(window=window):
        bpy.ops.screen.screenshot(filepath=os.path.join(folder, f"{name}.png"), check_existing=False)


def main(archive, folder):
    """Take the pictures, and end Blender."""
    view = bpy.context.preferences.view
    view.show_splash, view.render_display_type, view.ui_scale = False, "NONE", 0.85
    steps = steps_of(archive, folder)

    def step():
        try:
            return next(steps)
        except StopIteration:
            os._exit(0)
        except Exception:  # Blender must not stay open.
            traceback.print_exc()
            os._exit(1)

    bpy.app.timers.register(step, first_interval=2)


if __name__ == "__main__":
    main(*sys.argv[sys.argv.index("--") + 1 :])
