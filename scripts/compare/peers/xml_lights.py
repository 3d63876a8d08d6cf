"""Emitters, media and cameras of Mitsuba's XML."""

import mitsuba as mi
import numpy as np
from glb_package import meshes
from xml_colours import FAULTS, reason, uniform, value

#: Largest width or height of a picture in pixels.
MAX_SIDE = 1 << 16
#: Width in pixels of the image of a computed sky.
SKY_WIDTH = 1024
#: Directions along a side of the square over which a sun's disc is integrated.
SUN_SAMPLES = 64
KNOWN_LIGHTS = "area, point, spot, directional, constant, envmap, sky, sun and sunsky"
KNOWN_CAMERAS = "perspective, thinlens and orthographic"
#: Parameters of Mitsuba's sky.
SKY_PARAMETERS = (
    "turbidity albedo latitude longitude timezone year month day hour minute second sun_scale sky_scale sun_aperture "
    "complex_sun scale"
).split()


def light(node, matrix):
    """A light without a surface, or None with a warning."""
    kind, name = node.type, node.id or node.name or node.type
    if kind == "point" or kind == "spot":
        given = node.vector("position")
        position = matrix[:3, 3] if given is None else matrix[:3, :3] @ given + matrix[:3, 3]
        intensity = uniform(node, "intensity", 1.0, "light")
        if kind == "point":
            return meshes.PointLight(name=name, position=position, intensity=intensity)
        return spot(node, name, matrix, position, intensity)
    if kind == "directional":
        given = node.vector("direction")
        direction = matrix[:3, 2] if given is None else matrix[:3, :3] @ given
        if not np.linalg.norm(direction) > 0.0:
            raise node.fault("its direction is zero")
        irradiance = uniform(node, "irradiance", 1.0, "light")
        return meshes.SunLight(name=name, direction=direction, irradiance=irradiance)
    node.drop(f"an emitter of type {kind} is left out; known are {KNOWN_LIGHTS}")
    return None


def spot(node, name, matrix, position, intensity):
    outer = node.number("cutoff_angle", 20.0)
    inner = node.number("beam_width", outer * 0.75)
    if not 0.0 < outer <= 90.0:
        raise node.fault(f"cutoff_angle is {outer:g}; it is above 0 and at most 90 degrees")
    if inner < outer:
        node.document.lose(f"{node.title}: the edge of a spot falls off otherwise")
    found = node.child(tag="texture")
    if found is not None:
        intensity = intensity * value(found, "light").mean
        found.dropped = True
        node.document.lose(f"{node.title}: its texture is taken as its mean")
    return meshes.SpotLight(
        name=name,
        position=position,
        target=position + matrix[:3, 2] / max(np.linalg.norm(matrix[:3, 2]), 1e-30),
        inner=min(max(inner, 0.0), outer - 1e-3),
        outer=outer,
        intensity=intensity,
    )


# --- environments -----------------------------------------------------------------------------------------------------


def environment_map(node, matrix):
    """The image (H, W, 3) of an environment map on caustique's grid. Mitsuba: u = atan2(x, -z) / 2 pi, first and last
    row at the poles."""
    path = node.document.file(node)
    try:
        source = mi.Bitmap(str(path))
        texels = np.array(source.convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False))
    except FAULTS as error:
        raise node.fault(f"{path.name}: this image cannot be read: {reason(error)}") from error
    height, width = texels.shape[:2]
    if not abs(np.linalg.det(matrix[:3, :3])) > 0.0:
        raise node.fault("its transform is singular")
    x, y, z = np.moveaxis(directions(height, width) @ np.linalg.inv(matrix[:3, :3]).T, -1, 0)
    column = np.arctan2(x, -z) / (2.0 * np.pi) * width - 0.5
    row = np.arccos(np.clip(y / np.sqrt(x * x + y * y + z * z), -1.0, 1.0)) / np.pi * (height - 1)
    left, top = np.floor(column).astype(int), np.clip(np.floor(row).astype(int), 0, max(height - 2, 0))
    s, t = (column - left)[..., None], (row - top)[..., None]
    below = np.minimum(top + 1, height - 1)
    at = lambda i, j: texels[i, j % width]
    picture = (at(top, left) * (1 - s) + at(top, left + 1) * s) * (1 - t)
    picture += (at(below, left) * (1 - s) + at(below, left + 1) * s) * t
    return picture.astype(np.float32)


def directions(height, width):
    """World directions (height, width, 3) of the pixels of caustique's environment images."""
    u, v = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    turn, polar = 2.0 * np.pi * (u - 0.5), np.pi * v
    return np.stack([np.sin(polar) * np.cos(turn), np.cos(polar), np.sin(polar) * np.sin(turn)], -1)


def sky(node, matrix):
    """(image of the sky or None, SunLight or None) of a sky, a sun, or both."""
    described = {"type": "sunsky", "to_world": mi.ScalarTransform4f(matrix)}
    for name in SKY_PARAMETERS:
        if node.child(name) is not None:
            number = float(uniform(node, name, 1.0).mean()) if name == "albedo" else node.number(name, 0.0)
            whole = name in ("year", "month", "day")
            described[name] = int(number) if whole else bool(number) if name == "complex_sun" else number
    direction = node.vector("sun_direction")
    if direction is not None:
        described["sun_direction"] = direction.tolist()
    scale = described.pop("scale", 1.0)
    parts = {"sky": node.type != "sun", "sun": node.type != "sky"}
    try:
        image = None
        if parts["sky"]:
            image = scale * evaluated(described | {"sun_scale": 0.0}, directions(SKY_WIDTH // 2, SKY_WIDTH))
        light = sun(described, scale) if parts["sun"] and described.get("sun_scale", 1.0) > 0.0 else None
    except FAULTS as error:
        raise node.fault(f"the sky cannot be computed: {reason(error)}") from error
    return None if image is None else image.astype(np.float32), light


def evaluated(described, toward):
    """Radiance of an environment emitter from directions (..., 3)."""
    scene = mi.load_dict({"type": "scene", "sky": described})
    emitter, interaction = scene.emitters()[0], mi.SurfaceInteraction3f()
    found = np.zeros(toward.shape)
    for index in np.ndindex(toward.shape[:-1]):
        interaction.wi = (-toward[index]).tolist()
        found[index] = np.array(emitter.eval(interaction)).ravel()
    return found


def sun(described, scale):
    """The sun of a sky: its radiance, integrated over a square around its disc."""
    described = {"sky_scale": 0.0} | {key: value for key, value in described.items() if key != "sky_scale"}
    angle = described.get("sun_aperture", 0.5358)
    toward = np.array(mi.traverse(mi.load_dict(described))["sun_direction"], float).ravel()
    toward /= np.linalg.norm(toward)
    side = np.cross(np.eye(3)[np.argmin(np.abs(toward))], toward)
    side /= np.linalg.norm(side)
    half = np.tan(np.radians(angle / 2.0) * 1.05)
    steps = (np.arange(SUN_SAMPLES) + 0.5) / SUN_SAMPLES * 2.0 * half - half
    a, b = np.meshgrid(steps, steps)
    around = toward + a[..., None] * side + b[..., None] * np.cross(toward, side)
    length = np.linalg.norm(around, axis=-1, keepdims=True)
    solid = (2.0 * half / SUN_SAMPLES) ** 2 / length**4
    irradiance = scale * (evaluated(described, around / length) * solid).sum((0, 1))
    return meshes.SunLight(name="sun", direction=-toward, irradiance=irradiance, angle=angle)


# --- media ------------------------------------------------------------------------------------------------------------


def medium(node, density=None):
    """A medium, or None with a warning. `density`: name of the file of a grid that multiplies the coefficients."""
    if node.dropped:
        return None
    if node.type not in ("homogeneous", "heterogeneous"):
        node.drop("a medium of this type is left out; known are homogeneous and heterogeneous")
        return None
    scale = node.number("scale", 1.0)
    if node.child("material") is not None:
        node.drop("a medium of a named material is left out; give sigma_s and sigma_a")
        return None
    if node.child("sigma_s") is not None or node.child("sigma_a") is not None:
        scattering, absorption = coefficient(node, "sigma_s", 0.0), coefficient(node, "sigma_a", 0.0)
    else:
        extinction = np.ones(3) if density else coefficient(node, "sigma_t", 1.0)
        albedo = coefficient(node, "albedo", 0.75)
        scattering, absorption = extinction * albedo, extinction * (1.0 - albedo)
    phase = node.child(tag="phase")
    if phase is not None and phase.type not in ("isotropic", "hg"):
        phase.drop("a phase function of this type is taken as isotropic")
    g = phase.number("g", 0.8) if phase is not None and phase.type == "hg" else 0.0
    limited = lambda values: tuple(float(x) for x in np.maximum(values * scale, 0.0))
    g = float(np.clip(g, -0.99, 0.99))
    return meshes.Medium(sigma_a=limited(absorption), sigma_s=limited(scattering), g=g, density=density)


def coefficient(node, name, usual):
    """A coefficient of a medium as RGB; of a volume its constant value."""
    found = node.child(name)
    if found is not None and found.tag == "volume":
        if found.type != "constvolume":
            node.drop_child(name, "varies over space, which is left out")
            return np.full(3, float(usual))
        return uniform(found, "value", usual, "unbounded")
    return uniform(node, name, usual, "unbounded")


# --- cameras ----------------------------------------------------------------------------------------------------------


def film(node):
    """(width, height, crop as fractions or None) of a sensor."""
    found = node.child(tag="film")
    if found is None:
        return 768, 576, None
    width, height = found.whole("width", 768, 1, MAX_SIDE), found.whole("height", 576, 1, MAX_SIDE)
    if found.child("crop_width") is None and found.child("crop_height") is None:
        return width, height, None
    left, top = found.whole("crop_offset_x", 0, 0, width - 1), found.whole("crop_offset_y", 0, 0, height - 1)
    across = found.whole("crop_width", width - left, 1, width - left)
    down = found.whole("crop_height", height - top, 1, height - top)
    return width, height, [left / width, top / height, across / width, down / height]


def camera(node, size):
    """The camera of a sensor, or None with a warning. `size` is the film's, in pixels."""
    matrix, (width, height) = node.transform(), size
    if node.type not in ("perspective", "thinlens", "orthographic"):
        node.drop(f"a sensor of type {node.type} is left out; known are {KNOWN_CAMERAS}")
        return None
    ahead = matrix[:3, 2]
    if not np.linalg.norm(ahead) > 0.0 or not abs(np.linalg.det(matrix[:3, :3])) > 0.0:
        raise node.fault("its transform is singular")
    if np.linalg.det(matrix[:3, :3]) < 0.0:
        node.document.lose(f"{node.title}: its transform mirrors the picture, which is left out")
    position = matrix[:3, 3]
    made = meshes.Camera(
        name=node.id or "camera",
        position=position,
        target=position + ahead / np.linalg.norm(ahead),
        up=matrix[:3, 1],
        aspect=width / height,
        shift=(-node.number("principal_point_offset_x", 0.0), node.number("principal_point_offset_y", 0.0)),
    )
    if node.type == "orthographic":
        # Mitsuba's film is two units wide.
        made.orthographic_height = 2.0 * float(np.linalg.norm(matrix[:3, 0])) * height / width
    else:
        made.fov = field_of_view(node, width, height)
    if node.type == "thinlens":
        made.aperture_radius = max(node.number("aperture_radius", 0.0), 0.0)
    made.focus_distance = node.number("focus_distance", 1.0)
    if not made.focus_distance > 0.0:
        raise node.fault(f"focus_distance is {made.focus_distance:g}; it is above 0")
    return made


def field_of_view(node, width, height):
    """The vertical field of view in degrees."""
    sides = {"x": width, "y": height, "diagonal": np.hypot(width, height)}
    sides |= {"smaller": min(width, height), "larger": max(width, height)}
    if node.child("fov") is not None:
        axis, fov = node.text("fov_axis", "x"), node.number("fov", 0.0)
        if not 0.0 < fov < 180.0:
            raise node.fault(f"fov is {fov:g}; it is between 0 and 180 degrees")
        if axis not in sides:
            raise node.fault(f'a field of view along "{axis}"; axes are {", ".join(sides)}')
        half = np.tan(np.radians(fov) / 2.0)
    else:
        # Of a 35 mm film, along its diagonal.
        axis, words = "diagonal", node.text("focal_length", "50mm").lower().removesuffix("mm")
        try:
            half = np.hypot(36.0, 24.0) / 2.0 / float(words)
        except (ValueError, ZeroDivisionError):
            half = 0.0
        if not 0.0 < half < np.inf:
            raise node.fault(f'focal_length="{words}" is no length in mm above 0')
    return float(2.0 * np.degrees(np.arctan(half * height / sides[axis])))
