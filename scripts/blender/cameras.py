"""Cameras, and the picture that a scene was made for, in terms of `extras.caustique`."""

import math

import bpy

_TONEMAPS = {"AgX": "agx", "Filmic": "filmic", "Standard": "srgb"}
# Nearer than this share of the distance in between, a clipping plane takes away what is seen.
_APERTURE = "the shape of the aperture is not carried: it is round"


def extras(thing, render, where, warn):
    """Keys of a camera: `shift` (widths and heights of the picture), `aperture_radius` and `focus_distance` (m)."""
    camera, said = thing.data, {}
    if camera.type == "PANO":
        warn(where, "panoramic cameras are not carried: it is a perspective camera here")
    if camera.shift_x or camera.shift_y:
        width, height = render.resolution_x * render.pixel_aspect_x, render.resolution_y * render.pixel_aspect_y
        across = camera.sensor_fit == "HORIZONTAL" or camera.sensor_fit == "AUTO" and width >= height
        length = width if across else height
        said["shift"] = [camera.shift_x * length / width, camera.shift_y * length / height]
    if not camera.dof.use_dof:
        return said
    # Cycles: half of focal length over f-number; an orthographic camera counts as having a focal length of one unit.
    focal = camera.lens * 1e-3 if camera.type == "PERSP" else 1.0
    focus = camera.dof.focus_distance
    if camera.dof.focus_object is not None:
        at = camera.dof.focus_object.evaluated_get(bpy.context.evaluated_depsgraph_get()).matrix_world.translation
        focus = abs(thing.matrix_world.col[2].xyz.normalized().dot(at - thing.matrix_world.translation))
    if camera.dof.aperture_blades or camera.dof.aperture_ratio != 1:
        warn(where, _APERTURE)
    return {**said, "aperture_radius": focal / (2 * camera.dof.aperture_fstop), "focus_distance": focus}


def warn_of_clipping(thing, bodies, where, warn):
    """Names what the clipping planes of a camera cut away from the picture in Blender; `bodies` are mesh objects."""
    camera, near, far = thing.data, [], []
    to_camera = thing.matrix_world.inverted()
    for body in bodies:
        corners = [(to_camera @ body.matrix_world @ _vector(corner)) for corner in body.bound_box]
        depths = [-corner.z for corner in corners]
        if min(depths) < camera.clip_start and max(depths) > 0 and _around(corners):
            near.append(body)
        if max(depths) > camera.clip_end:
            far.append(body)
    for found, what in ((near, f"nearer than its clip start of {camera.clip_start:g} m"),
                        (far, f"beyond its clip end of {camera.clip_end:g} m")):
        if found:
            others = f" and {len(found) - 1} more" if len(found) > 1 else ""
            warn(where, f'clipping is not carried: object "{found[0].name}"{others} may be {what}, and is seen')
