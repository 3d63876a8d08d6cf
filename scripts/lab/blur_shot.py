"""The blurred shot of the figure blur_peers, in Blender: a glass ball flies through the light of a small lamp, and its
caustic runs over the floor.

    python -m lab.blur_shot export OUT.glb
    python -m lab.blur_shot cycles OUT.exr WIDTH SAMPLES DENOISE MODE

The second command renders with Cycles on one thread (MODE: path or path_caustics) and prints the core-seconds of the
render alone.
"""

import os
import sys
import time

import bpy
import build
import export
from mathutils import Vector

# Frame of the picture; the ball moves from frame 0 to frame 2.
FRAME = 1
FIRST, LAST = (-0.9, 0.1, 0.8), (0.9, -0.1, 0.8)


def made(name, kind, **values):
    """A material of one shader."""
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    shader, out = nodes.new(kind), nodes.new("ShaderNodeOutputMaterial")
    for key, value in values.items():
        shader.inputs[key].default_value = value
    links.new(shader.outputs[0], out.inputs["Surface"])
    return material


def placed(name, data, at):
    body = bpy.data.objects.new(name, data)
    body.location = at
    bpy.context.scene.collection.objects.link(body)
    return body


def turned(body, to):
    """Turns a camera or lamp towards a point."""
    body.rotation_euler = (Vector(to) - body.location).to_track_quat("-Z", "Y").to_euler()
    return body


def shot():
    """Makes the scene; returns the lamp, the ball and the floor."""
    build.start(160, 120)
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_plane_add(size=12)
    floor = bpy.context.object
    floor.data.materials.append(made("floor", "ShaderNodeBsdfDiffuse", Color=(0.6, 0.55, 0.5, 1)))
    bpy.ops.mesh.primitive_uv_sphere_add(segments=64, ring_count=32, radius=0.6)
    ball = bpy.context.object
    bpy.ops.object.shade_smooth()
    ball.data.materials.append(made("glass", "ShaderNodeBsdfGlass", Color=(1, 1, 1, 1), Roughness=0.0, IOR=1.5))
    for frame, at in ((FRAME - 1, FIRST), (FRAME + 1, LAST)):
        ball.location = at
        ball.keyframe_insert("location", frame=frame)
    action = ball.animation_data.action
    curves = action.fcurves if hasattr(action, "fcurves") else action.layers[0].strips[0].channelbags[0].fcurves
    for point in (point for curve in curves for point in curve.keyframe_points):
        point.interpolation = "LINEAR"
    light = bpy.data.lights.new("lamp", "POINT")
    light.energy, light.shadow_soft_size = 600.0, 0.1
    lamp = placed("lamp", light, (1.5, 1.0, 4.0))
    scene.camera = turned(placed("camera", bpy.data.cameras.new("camera"), (0, -5, 3.5)), (0, 0, 0.2))
    scene.camera.data.lens = 40
    scene.world = bpy.data.worlds.new("world")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.05, 0.05, 0.06, 1)
    scene.render.use_motion_blur, scene.render.motion_blur_shutter = True, 0.5
    scene.frame_set(FRAME)
    return lamp, ball, floor


def cycles(path, width, samples, denoise, mode):
    lamp, ball, floor = shot()
    scene = bpy.context.scene
    if mode == "path_caustics":
        lamp.data.cycles.is_caustics_light = True
        ball.cycles.is_caustics_caster = floor.cycles.is_caustics_receiver = True
    scene.render.engine, scene.cycles.samples, scene.cycles.use_denoising = "CYCLES", samples, denoise
    scene.cycles.denoiser, scene.cycles.use_adaptive_sampling = "OPENIMAGEDENOISE", False
    # Filtered glossiness and clamping lose the light of caustics.
    scene.cycles.blur_glossy, scene.cycles.sample_clamp_indirect = 0.0, 0.0
    scene.render.resolution_x, scene.render.resolution_y = width, width * 3 // 4
    scene.render.threads_mode, scene.render.threads = "FIXED", 1
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "IMAGE"
    settings.file_format, settings.color_depth, settings.color_mode = "OPEN_EXR", "32", "RGB"
    scene.render.filepath = path
    start = time.process_time()
    bpy.ops.render.render(write_still=True)
    print(f"\ncore-seconds {time.process_time() - start:.3f}", flush=True)


def main():
    words = sys.argv[1:]
    if words[0] == "export":
        shot()
        export.write(words[1])
    else:
        cycles(words[1], int(words[2]), int(words[3]), words[4] == "denoised", words[5])
    sys.stdout.flush()
    # Blender as a module may hang while it shuts down.
    os._exit(0)


if __name__ == "__main__":
    main()
