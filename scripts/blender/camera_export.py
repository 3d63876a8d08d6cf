"""Cameras, and the scene's picture settings, as keys of `extras.caustique`."""

import fractions
import itertools
import math

import bpy  # first: it makes the others importable

from mathutils import Matrix

import export_guard as guard

_TONEMAPS = {"AgX": "agx", "Filmic": "filmic", "Khronos PBR Neutral": "neutral", "Standard": "srgb"}
# Names of looks, without the prefix of their view transform.
_CONTRASTS = {"None": None, "": None, "Very High Contrast": "very-high", "High Contrast": "high",
              "Medium High Contrast": "medium-high", "Medium Contrast": "medium", "Base Contrast": "medium",
              "Medium Low Contrast": "medium-low", "Low Contrast": "low", "Very Low Contrast": "very-low"}
# Rays along each side of the picture that search for clipped objects.
_GRID = 16


def add_cameras(flat, warn):
    """Give the cameras of a flat scene their keys of `extras.caustique`, and warn of the active one's clipping."""
    for thing in (thing for thing in flat.things if thing.type == "CAMERA"):
        if thing.data.type == "PANO":  # Blender's exporter would leave it out
            thing.data = flat.remove_later(thing.data.copy())
            thing.data.type = "PERSP"
            view = _panorama(thing.data, flat.scene.render)
            if view is None:
                warn(flat.where(thing), "of panoramic cameras only equirectangular ones and fisheyes are carried: it is a "
                                        "perspective camera here; choose Lens > Panorama Type > Equirectangular")
            else:
                flat.add_extras(thing, panorama=view)
                if thing.data.dof.use_dof:
                    warn(flat.where(thing), "the depth of field of a panorama is not carried: all is sharp; switch Depth of "
                                            "Field off to see the same in Cycles")
        keys = guard.attempt(warn, flat.where(thing), {}, "it has no lens, shift or other projection",
                             extras, thing, flat, warn)
        flat.add_extras(thing, **keys)
    if flat.scene.camera is not None:
        guard.attempt(warn, flat.where(flat.scene.camera), None, "clipped objects are not found",
                      warn_of_clipping, flat.scene.camera, flat, warn)


def _panorama(camera, render):
    """The key `panorama` of a panoramic camera, or None if its type is not carried."""
    settings = camera if hasattr(camera, "panorama_type") else camera.cycles
    if settings.panorama_type == "EQUIRECTANGULAR":
        return {f"{name}_deg": [math.degrees(getattr(settings, f"{name}_{end}")) for end in ("min", "max")]
                for name in ("longitude", "latitude")}
    fov = settings.fisheye_fov
    if settings.panorama_type == "FISHEYE_EQUIDISTANT":
        # Cycles stretches the circle over the whole picture.
        return {"fisheye": "equidistant", "fov_deg": math.degrees(fov), "half_size": [fov / 2, fov / 2]}
    if settings.panorama_type != "FISHEYE_EQUISOLID":
        return None
    width, height, side = _fit(camera, render)
    length = camera.sensor_height if camera.sensor_fit == "VERTICAL" else camera.sensor_width
    half = length / 2 / settings.fisheye_lens / side
    return {"fisheye": "equisolid", "fov_deg": math.degrees(fov), "half_size": [half * width, half * height]}


def _fit(camera, render):
    """Width and height of the picture, and that of them to which a camera's sensor or orthographic scale is fitted."""
    width, height = render.resolution_x * render.pixel_aspect_x, render.resolution_y * render.pixel_aspect_y
    across = camera.sensor_fit == "HORIZONTAL" or camera.sensor_fit == "AUTO" and width >= height
    return width, height, width if across else height


def correct_sizes(document, render):
    """Correct the sizes of orthographic cameras, whose sensor fit Blender's exporter ignores."""
    for entry in document.get("cameras", []):
        camera = bpy.data.cameras.get(entry.get("name", ""))
        if camera is not None and "orthographic" in entry:
            width, height, side = _fit(camera, render)
            half = camera.ortho_scale / 2 / side
            entry["orthographic"].update(xmag=half * width, ymag=half * height)


def extras(thing, flat, warn):
    """Keys of the camera object `thing`: `shift` (in widths and heights of the picture), `aperture_radius` and
    `focus_distance` (m).
    """
    dof = thing.data.dof
    if dof.use_dof and (dof.aperture_blades or dof.aperture_ratio != 1):
        warn(flat.where(thing), "the shape of the aperture is not carried: it is round; "
                                "set Depth of Field > Aperture > Blades to 0 and Ratio to 1 to see the same in both")
    keys = optics(thing, flat.scene.render)
    del keys["view"]
    return keys


def optics(thing, render):
    """Keys of the camera object `thing`, and its `view`: the tangent of half its angle, or its size, up to a constant
    factor."""
    camera = thing.data
    said = {"view": camera.ortho_scale if camera.type == "ORTHO" else camera.sensor_width / camera.lens}
    if camera.shift_x or camera.shift_y:
        width, height, side = _fit(camera, render)
        said["shift"] = [camera.shift_x * side / width, camera.shift_y * side / height]
    if not camera.dof.use_dof:
        return said
    # Cycles: half of focal length over f-number; an orthographic camera has a focal length of one unit.
    focal = camera.lens * 1e-3 if camera.type == "PERSP" else 1.0
    focus = camera.dof.focus_distance
    if camera.dof.focus_object is not None:
        at = camera.dof.focus_object.evaluated_get(bpy.context.evaluated_depsgraph_get()).matrix_world.translation
        focus = abs(thing.matrix_world.col[2].xyz.normalized().dot(at - thing.matrix_world.translation))
    return {**said, "aperture_radius": focal / (2 * camera.dof.aperture_fstop), "focus_distance": focus}


def without_scale(matrix):
    """A camera's matrix without scale and shear, as Cycles reads it: its line of sight and the direction up."""
    back, up = matrix.col[2].xyz.normalized(), matrix.col[1].xyz
    right = up.cross(back).normalized()
    if right.length == 0:
        return matrix
    if matrix.determinant() < 0:
        right = -right  # a mirrored picture
    axes = Matrix((right, back.cross(right) * (-1 if matrix.determinant() < 0 else 1), back)).transposed()
    return Matrix.Translation(matrix.translation) @ axes.to_4x4()


def warn_of_clipping(thing, flat, warn):
    """Warn of objects that the camera's clipping planes hide in Blender, found by a grid of rays."""
    camera, found = thing.data, {}
    depsgraph = bpy.context.evaluated_depsgraph_get()
    corners = [thing.matrix_world @ corner for corner in camera.view_frame(scene=flat.scene)]
    eye, axis = thing.matrix_world.translation, -thing.matrix_world.col[2].xyz.normalized()
    steps = [(k + 0.5) / _GRID for k in range(_GRID)]
    for x, y in itertools.product(steps, steps):
        through = corners[2].lerp(corners[1], x).lerp(corners[3].lerp(corners[0], x), y)
        origin = through if camera.type == "ORTHO" else eye
        along = axis if camera.type == "ORTHO" else (through - eye).normalized()
        hit, at, _, _, body, _ = flat.scene.ray_cast(depsgraph, origin, along)
        depth = (at - eye).dot(axis)
        if hit and not camera.clip_start <= depth <= camera.clip_end:
            found.setdefault(depth < camera.clip_start, body)
    for near, body in found.items():
        plane = f"before its clip start of {camera.clip_start:g} m"
        if not near:
            plane = f"beyond its clip end of {camera.clip_end:g} m"
        warn(flat.where(thing), f"clipping is not carried: {flat.where(body)} is seen, also {plane}; hide it in renders if "
             "that is not meant")


def picture(scene, warn):
    """Keys of the scene: `resolution` (pixels), `crop` (x, y from the top left, width, height, as shares of the
    picture), `exposure` (stops), `tonemap`, `contrast`, `film_transparent`, `frame` and `frame_rate` (numerator, denominator)."""
    render, view, where = scene.render, scene.view_settings, f'scene "{scene.name}"'
    share = render.resolution_percentage / 100
    said = {"resolution": [max(round(n * share), 1) for n in (render.resolution_x, render.resolution_y)]}
    if render.pixel_aspect_x != render.pixel_aspect_y:
        warn(where, "its pixels are rendered as squares; set both pixel aspects to 1")
    if render.use_border:
        left, right, low, high = (getattr(render, f"border_{name}") for name in ("min_x", "max_x", "min_y", "max_y"))
        said["crop"] = [left, 1 - high, right - left, high - low]
    if scene.render.film_transparent:
        said["film_transparent"] = True
        if hasattr(scene, "cycles") and scene.cycles.film_transparent_glass:
            warn(where, "Transparent Glass of its film is not carried: glass covers the background; compose over a "
                        "background that is rendered, too")
    film = getattr(scene.cycles, "film_exposure", 1.0) if hasattr(scene, "cycles") else 1.0
    if film != 1:
        warn(where, f"its film exposure of {film:g} brightens the PNG alone: the EXR holds radiance as it is; multiply it "
             "when you compose")
    exposure = view.exposure + math.log2(max(film, 1e-6))
    if exposure:
        said["exposure"] = exposure
    if view.view_transform in _TONEMAPS:
        said["tonemap"] = _TONEMAPS[view.view_transform]
    else:
        warn(where, f'its view transform "{view.view_transform}" is not carried: the PNG is made with agx; open the EXR '
             "in Blender to see it with this transform")
    look = view.look.removeprefix(f"{view.view_transform} - ")
    if look not in _CONTRASTS or (_CONTRASTS[look] and said.get("tonemap") not in {"agx", "filmic"}):
        warn(where, f'its look "{view.look}" is not carried: it concerns the PNG alone; open the EXR in Blender to see it '
             "with this look")
    elif _CONTRASTS[look]:
        said["contrast"] = _CONTRASTS[look]
    if view.gamma != 1 or view.use_curve_mapping:
        warn(where, "gamma and curves of its colour management are not carried: they concern the PNG alone; open the EXR "
             "in Blender to see them")
    # Through decimals, because Blender stores 1.001 in single precision.
    rate = fractions.Fraction(f"{render.fps:.6g}") / fractions.Fraction(f"{render.fps_base:.6g}")
    if rate > 0:
        said["frame_rate"] = [rate.numerator, rate.denominator]
    said["frame"] = scene.frame_current
    _warn_of_limits(scene, where, warn)
    if _has_compositor(scene):
        warn(where, "its compositor is not carried: the picture is the one before compositing; load the EXR by an Image "
             "node")
    return said


def _warn_of_limits(scene, where, warn):
    """Warn of Cycles' limits on light paths where they are tighter than Blender's defaults."""
    cycles = getattr(scene, "cycles", None)
    if cycles is None:
        return
    usual = {"max_bounces": 12, "diffuse_bounces": 4, "glossy_bounces": 4, "transmission_bounces": 12,
             "transparent_max_bounces": 8}
    tight = [f"{name.replace('_', ' ')} {getattr(cycles, name)}" for name, number in usual.items()
             if getattr(cycles, name) < number]
    if tight:
        warn(where, f"Cycles' limits on light paths are not carried ({', '.join(tight)}): there is more light here; "
                    "--max-depth cuts paths, too")
    off = [name for name in ("reflective", "refractive") if not getattr(cycles, f"caustics_{name}")]
    if off:
        warn(where, f"Cycles' switches of caustics are not carried ({' and '.join(off)} ones are off): there are "
                    "caustics here; switch them on (Light Paths > Caustics) to see the same in Cycles")
    clamp = [f"{name} {getattr(cycles, 'sample_clamp_' + name):g}" for name, usual in (("direct", 0), ("indirect", 10))
             if 0 < getattr(cycles, "sample_clamp_" + name) != usual]
    if clamp:
        warn(where, f"Cycles' clamping of bright samples is not carried ({', '.join(clamp)}): there is more light here, "
                    "as with clamps of 0 in Cycles; "
                    "set Light Paths > Clamping to 0 to see the same in Cycles")


def _has_compositor(scene):
    """Whether Blender would change the picture by its compositor."""
    tree = getattr(scene, "compositing_node_group", None) or getattr(scene, "node_tree", None)
    if not scene.render.use_compositing or tree is None or not getattr(scene, "use_nodes", True):
        return False
    return any(n.type not in {"R_LAYERS", "COMPOSITE", "VIEWER", "REROUTE", "FRAME", "GROUP_OUTPUT"} for n in tree.nodes)
