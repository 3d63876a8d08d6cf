"""Converts a glTF scene to Mitsuba: shapes, lights, environment, camera."""

import mitsuba as mi
import numpy as np
from gltf import Unsupported
from mitsuba_materials import BLACK, Materials, medium

#: Distance of the sun's disc in scene radii.
SUN_DISTANCE = 1000.0


def build(scene, width, height, correct=False, glass="auto"):
    """Build the Mitsuba scene with its first camera and a film of this size."""
    return mi.load_dict(describe(scene, width, height, Materials(scene, correct, glass), make_mesh))


def describe(scene, width, height, materials, make):
    """The scene as a dictionary for `mi.load_dict`, with its first camera and a film of this size.

    `make(mesh, materials, inside)` makes a shape; `inside` is its medium or None.
    """
    if not scene.cameras:
        raise Unsupported("a file without a camera")
    world = {"type": "scene"}
    space = medium(scene.medium)
    has_media = space is not None
    for i, mesh in enumerate(scene.meshes):
        inside = None
        if _transmits(materials, mesh):
            if space is not None:
                raise Unsupported(f"{mesh.name}: glass in a medium that fills the space")
            inside = materials.medium(mesh.material)
        has_media |= inside is not None
        world[f"mesh{i}"] = make(mesh, materials, inside)
    low = np.min([m.positions.min(axis=0) for m in scene.meshes], axis=0)
    high = np.max([m.positions.max(axis=0) for m in scene.meshes], axis=0)
    center, radius = (low + high) / 2, np.linalg.norm(high - low) / 2
    for i, light in enumerate(scene.lights):
        if light.intensity.any():
            world[f"light{i}"] = _light(light, center, radius, scene)
    if scene.environment:
        world["environment"] = _environment(scene)
    # Without media the path integrator gives equal results faster.
    world["integrator"] = {"type": "volpathmis" if has_media else "path", "max_depth": -1, "rr_depth": 5}
    world["sensor"] = _camera(scene.cameras[0], width, height)
    if space is not None:
        world["sensor"]["medium"] = space
    return world


def _transmits(materials, mesh):
    extensions = materials.raw(mesh.material).get("extensions", {})
    return extensions.get("KHR_materials_transmission", {}).get("transmissionFactor", 0.0) > 0.0


def make_mesh(mesh, materials, inside):
    properties = mi.Properties()
    emission = materials.emission(mesh.material)
    properties["bsdf"] = materials.bsdf(mesh)
    if emission is not None:
        properties["emitter"] = mi.load_dict({"type": "area", "radiance": emission})
    if inside is not None:
        properties["interior"] = mi.load_dict(inside)
    smooth, textured = mesh.normals is not None and emission is None, mesh.uvs is not None
    # The winding decides the emitting front: an emissive shape has no vertex normals.
    properties["face_normals"] = not smooth
    shape = mi.Mesh(mesh.name, len(mesh.positions), len(mesh.triangles), properties, smooth, textured)
    values = mi.traverse(shape)
    # Convert to the parameters' types, which depend on the variant.
    given = {
        "vertex_positions": mesh.positions,
        "vertex_normals": mesh.normals if smooth else None,
        "vertex_texcoords": mesh.uvs if textured else None,
    }
    for name, array in given.items():
        if array is not None:
            values[name] = type(values[name])(array.astype(np.float32).ravel())
    values["faces"] = type(values["faces"])(mesh.triangles.astype(np.uint32).ravel())
    values.update()
    return shape


def _light(light, center, radius, scene):
    environment = scene.environment
    position, axis = light.to_world[:3, 3], -light.to_world[:3, 2] / np.linalg.norm(light.to_world[:3, 2])
    strength = {"type": "rgb", "value": [float(x) for x in light.intensity]}
    if light.kind == "point" and light.radius > 0.0:
        radiance = [float(x) for x in light.intensity / (np.pi * light.radius**2)]
        return {
            "type": "sphere",
            "center": position.tolist(),
            "radius": float(light.radius),
            "bsdf": BLACK,
            "emitter": {"type": "area", "radiance": {"type": "rgb", "value": radiance}},
        }
    if light.kind == "point":
        return {"type": "point", "position": position.tolist(), "intensity": strength}
    if light.kind == "spot":
        if light.radius > 0.0:
            scene.lose("spots have no size")
        inner = outer = np.degrees((light.outer + light.inner) / 2)
        if light.outer - light.inner > 0.01:
            scene.lose(
                "spots with a soft edge: glTF's is the square of a ramp in the cosine, Mitsuba's a ramp in the angle"
            )
            inner, outer = np.degrees(light.inner), np.degrees(light.outer)
        return {
            "type": "spot",
            "intensity": strength,
            "cutoff_angle": outer,
            "beam_width": inner,
            "to_world": _look(position, axis),
        }
    before_image = light.angle > 0.0 and environment and "color" not in environment
    if before_image:
        scene.lose("a sun with a size becomes a point in front of an environment image")
    if light.angle == 0.0 or before_image:
        return {"type": "directional", "direction": axis.tolist(), "irradiance": strength}
    # A disc far away, in nearly the same direction from everywhere. It hides the environment, so its radiance is added.
    half = light.angle / 2
    radiance = light.intensity / (np.pi * np.sin(half) ** 2) + np.array(
        environment["color"] if environment else [0, 0, 0]
    )
    radiance = [float(x) for x in radiance]
    away = _look(center - axis * SUN_DISTANCE * radius, axis)
    return {
        "type": "disk",
        "to_world": away @ mi.ScalarTransform4f().scale(float(SUN_DISTANCE * radius * np.tan(half))),
        "bsdf": BLACK,
        "emitter": {"type": "area", "radiance": {"type": "rgb", "value": radiance}},
    }


def _look(position, axis):
    up = [1, 0, 0] if abs(axis[1]) > 0.9 else [0, 1, 0]
    return mi.ScalarTransform4f().look_at(origin=position.tolist(), target=(position + axis).tolist(), up=up)


def _environment(scene):
    said = scene.environment
    if "color" in said:
        return {"type": "constant", "radiance": {"type": "rgb", "value": [float(x) for x in said["color"]]}}
    texels = np.array(
        mi.Bitmap(str(scene.folder / said["file"])).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False)
    ) * np.float32(said.get("strength", 1.0))
    # Mitsuba's first and last rows are at the poles, a file's half a row away. 2n + 1 rows contain all knots of the
    # file's bilinear function and so represent it exactly.
    height = len(texels)
    at = np.clip(np.arange(2 * height + 1) / 2 - 0.5, 0, height - 1)
    low = np.minimum(at.astype(int), height - 2)
    part = (at - low)[:, None, None].astype(np.float32)
    rows = texels[low] * (1 - part) + texels[low + 1] * part
    # Mitsuba: u = atan2(x, -z) / 2 pi. A file: u = 1/2 + atan2(z, x) / 2 pi, turned counter-clockwise.
    turn = mi.ScalarTransform4f().rotate([0, 1, 0], 90.0 + said.get("rotation_deg", 0.0))
    return {"type": "envmap", "bitmap": mi.Bitmap(np.ascontiguousarray(rows)), "to_world": turn}


def _camera(camera, width, height):
    matrix = camera.to_world.copy()
    matrix[:3, :3] /= np.linalg.norm(matrix[:3, :3], axis=0)
    sensor = {
        "type": "perspective",
        "fov_axis": "y",
        "fov": float(np.degrees(camera.yfov)),
        "near_clip": 1e-3,
        "far_clip": 1e5,
        # Mitsuba's cameras look along +Z, with +X to the left.
        "to_world": mi.ScalarTransform4f((matrix @ np.diag([-1.0, 1.0, -1.0, 1.0])).tolist()),
        "film": {
            "type": "hdrfilm",
            "width": width,
            "height": height,
            "rfilter": {"type": "box"},
            "pixel_format": "rgb",
            "component_format": "float32",
        },
        "sampler": {"type": "independent"},
    }
    if camera.aperture_radius > 0.0:
        sensor.update(type="thinlens", aperture_radius=camera.aperture_radius, focus_distance=camera.focus_distance)
    return sensor
