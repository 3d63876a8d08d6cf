"""Converts UsdLux lights to glTF; their emission follows OpenUSD's reference implementation (hdEmbree).

Radiance is color * intensity * 2^exposure, times the colour of its temperature. With `normalize` it is divided by the
light's area in stage units (distant lights: by pi sin^2 of half the angle). One nit is read as one W/(sr m2), for
lights, domes and emissive surfaces.
"""

import math

import numpy
from pxr import Gf, UsdLux

import shapes
from faults import Invalid
from materials import set_emission
from stage import custom_keys

_DISC_SIDES = 64


class Light:
    """Common properties of all kinds of lights."""

    def __init__(self, prim, stage):
        self.prim, self.stage, self.api = prim, stage, UsdLux.LightAPI(prim)
        self.where = prim.GetPath()
        for name, what in (("diffuse", 1.0), ("specular", 1.0)):
            if self.get(name, 1.0) != what:
                self.add_loss(f"inputs:{name} is not carried: it lights all lobes alike")
        shadow = stage.get(UsdLux.ShadowAPI(prim).GetShadowEnableAttr(), True)
        if not shadow:
            self.add_loss("inputs:shadow:enable = false is not carried: it casts shadows")
        if self.api.GetFiltersRel().GetTargets():
            self.add_loss("light filters are not carried")

    def get(self, name, default):
        """The value of the light's input `name`, or `default` if it is unset."""
        return self.stage.get(self.prim.GetAttribute("inputs:" + name), default)

    def add_loss(self, what):
        """Record `what`, a feature of this light that the conversion ignores or approximates."""
        self.stage.losses.add(self.where, what)

    @property
    def normalized(self):
        """Whether the light's power is independent of its size."""
        return self.get("normalize", False)

    def emitted(self):
        """Colour times intensity (3 numbers), without `normalize`."""
        default = 50000.0 if self.prim.GetTypeName() == "DistantLight" else 1.0
        stops = self.get("exposure", 0.0)
        power = self.get("intensity", default) * (2.0 ** stops if stops < 1024 else math.inf)
        color = Gf.Vec3f(*map(float, self.get("color", Gf.Vec3f(1))))
        # Blender writes white lamps with 6500 K, which hdEmbree tints.
        white = self.stage.by_blender and self.get("colorTemperature", 6500.0) == 6500.0
        if self.get("enableColorTemperature", False) and not white:
            color = Gf.CompMult(color, UsdLux.BlackbodyTemperatureAsRgb(self.get("colorTemperature", 6500.0)))
        emitted = tuple(float(c) * power for c in color)
        if not all(math.isfinite(c) for c in emitted):
            raise Invalid(self.where, "its colour or intensity is not finite", "give it numbers")
        return emitted

    def radiance(self, area):
        """Radiance (3 numbers) of a light with this area in stage units."""
        share = area if self.normalized and area > 0 else 1.0
        return tuple(c / share for c in self.emitted())

    def profile(self):
        """The asset of the IES profile of UsdLuxShapingAPI, or None."""
        ies = self.get("shaping:ies:file", None) if self.prim.HasAPI(UsdLux.ShapingAPI) else None
        return ies if ies is not None and ies.path else None

    def cone(self, profile=False):
        """Half angle (radians) and softness of the cone of UsdLuxShapingAPI, or None. Records other shaping as losses,
        the profile unless `profile` says that the caller carries it."""
        if not self.prim.HasAPI(UsdLux.ShapingAPI):
            return None
        if self.get("shaping:focus", 0.0) > 0:
            self.add_loss("shaping:focus is not carried: it shines alike within its cone")
        ies = self.profile()
        if ies is not None and not profile:
            self.add_loss(f"its IES profile {ies.path} is not carried: it shines alike in all directions")
        angle = self.get("shaping:cone:angle", 90.0)
        softness = min(max(self.get("shaping:cone:softness", 0.0), 0.0), 1.0)
        if angle >= 180:
            return None
        return math.radians(angle), softness


def node(prim, stage, document, matrix):
    """The glTF node of a light prim with the transform `matrix` (in stage units)."""
    light = Light(prim, stage)
    kind = prim.GetTypeName()
    makers = {"SphereLight": _sphere, "RectLight": _rect, "DiskLight": _disk, "CylinderLight": _cylinder,
              "DistantLight": _distant}
    if kind not in makers:
        light.add_loss(f"a {kind} is not carried: it gives no light")
        return None
    made = makers[kind](light, document, matrix)
    if made is None:
        return None
    keys = {**made.pop("caustique", {}), **stage.links.of_light(prim), **custom_keys(prim, stage)}
    if keys:
        made["extras"] = {"caustique": keys}
    return made


def _axis_lengths(matrix):
    """Lengths of the X, Y and Z axes after the transform `matrix`."""
    return [matrix.TransformDir(Gf.Vec3d(*axis)).GetLength() for axis in ((1, 0, 0), (0, 1, 0), (0, 0, 1))]


def _sphere(light, document, matrix):
    as_point = light.stage.get(light.prim.GetAttribute("treatAsPoint"), False)
    radius = 0.0 if as_point and light.normalized else float(light.get("radius", 0.5))
    a, b, c = (radius * length for length in _axis_lengths(matrix))
    if radius < 0 or not math.isfinite(a + b + c):
        raise Invalid(light.where, f"its radius is {radius}", "give it a number that is not negative")
    if radius > 0 and max(a, b, c) > 1.001 * min(a, b, c):
        return _ellipsoid(light, document, radius, (a, b, c))
    if as_point and not light.normalized:
        light.add_loss("treatAsPoint counts with normalize alone: it stays a sphere")
    if a == 0 and not light.normalized:
        light.add_loss("a sphere of radius 0 has no light unless it is normalized: its intensity is taken as if it were")
    emitted = light.emitted()
    # A sphere of radiance L has intensity L pi r^2 and area 4 pi r^2.
    intensity = [e * (0.25 if light.normalized or a == 0 else math.pi * a * a) * light.stage.metres ** 2
                 for e in emitted]
    entry = {"name": str(light.where), "type": "point", **_strength(intensity)}
    keys, cone, profile = {"radius": a * light.stage.metres}, light.cone(profile=True), light.profile()
    if profile is not None:
        try:
            data, _ = light.stage.asset(light.prim, profile)
        except Invalid as invalid:
            light.add_loss(f"its IES profile is left out: {invalid.fault}")
            profile = None
    if profile is not None:
        # Horizontal angles run from the light's X axis to its Y axis, as in hdEmbree.
        keys["ies"] = {"bufferView": document.profile(data)}
        scale = float(light.get("shaping:ies:angleScale", 0.0))
        if scale != 0:
            keys["ies"]["angle_scale"] = scale
        if light.get("shaping:ies:normalize", False):
            keys["ies"]["normalize"] = "power"
    if cone is not None:
        entry["type"] = "spot"
        angle, softness = cone
        if angle > math.pi / 2:
            light.add_loss(f"its cone of {math.degrees(angle):g} degrees is taken as 90: beyond there is no light")
            angle = math.pi / 2
        entry["spot"] = {"outerConeAngle": angle, "innerConeAngle": 0.0}
        whole = 1 - math.cos(angle)
        keys["blend"] = 1 - (1 - math.cos((1 - softness) * angle)) / whole if softness > 0 and whole > 0 else 0.0
        if softness > 0:
            light.add_loss("the edge of its cone falls off by the cosine of the angle, not by the angle")
    if a > 0 and (entry["type"] == "spot" or profile is not None):
        keys["bulb"] = True
    return {"extensions": document.light(entry), "caustique": keys}


def _strength(values):
    strongest = max(max(values), 1e-30)
    return {"color": [max(v, 0.0) / strongest for v in values], "intensity": strongest}


def _ellipsoid(light, document, radius, axes):
    faces, normals = shapes.of_sphere(light.where, radius)
    # Knud Thomsen's formula for the area, as in hdEmbree.
    a, b, c = axes
    mean = (((a * b) ** 1.6 + (a * c) ** 1.6 + (b * c) ** 1.6) / 3) ** (1 / 1.6)
    if light.cone() is not None:
        light.add_loss("shaping of a stretched sphere is not carried: it shines in all directions")
    return _emissive_mesh(light, document, faces, light.radiance(4 * math.pi * mean), normals)


def _rect(light, document, matrix):
    x, y = light.get("width", 1.0) / 2, light.get("height", 1.0) / 2
    u, v = (matrix.TransformDir(Gf.Vec3d(*axis)) for axis in ((2 * x, 0, 0), (0, 2 * y, 0)))
    image = light.get("texture:file", None)
    if image is not None and image.path:
        light.add_loss(f"its texture {image.path} is not carried: it shines with its colour alone")
    # Clockwise seen from +Z, so the light emits along -Z.
    return _flat(light, document, [(-x, -y), (-x, y), (x, y), (x, -y)], Gf.Cross(u, v).GetLength())


def _disk(light, document, matrix):
    radius = light.get("radius", 0.5)
    # A polygon with the area of the circle.
    reach = radius * math.sqrt(2 * math.pi / _DISC_SIDES / math.sin(2 * math.pi / _DISC_SIDES))
    turns = [-2 * math.pi * k / _DISC_SIDES for k in range(_DISC_SIDES)]
    u, v = (matrix.TransformDir(Gf.Vec3d(*axis)) for axis in ((radius, 0, 0), (0, radius, 0)))
    corners = [(reach * math.cos(t), reach * math.sin(t)) for t in turns]
    return _flat(light, document, corners, math.pi * Gf.Cross(u, v).GetLength())


def _flat(light, document, corners, area):
    faces = shapes.polygon(light.where, corners)
    radiance, keys, cone = light.radiance(area), {}, light.cone()
    if cone is not None and (cone[0] < math.pi / 2 or cone[1] > 0):
        angle, softness = min(cone[0], math.pi / 2), cone[1]
        light.add_loss("its cone is taken for a spread of the same flux, which falls off towards its edge")
        keys["spread_deg"] = math.degrees(2 * angle)
        share = _cone_flux(angle, softness)
        radiance = tuple(r * share for r in radiance)
    return _emissive_mesh(light, document, faces, radiance, None, keys)


def _cone_flux(angle, softness):
    """Share of a Lambertian emitter's flux within a cone with a smoothstep edge in the angle, by Simpson's rule."""
    theta = numpy.linspace(0, angle, 2001)
    soft = (1 - softness) * angle
    t = numpy.clip((theta - soft) / max(angle - soft, 1e-12), 0, 1) if softness > 0 else numpy.zeros_like(theta)
    values = (1 - t * t * (3 - 2 * t)) * numpy.sin(2 * theta)
    return float((values[0] + 4 * values[1:-1:2].sum() + 2 * values[2:-1:2].sum() + values[-1]) * (angle / 2000) / 3)


def _cylinder(light, document, matrix):
    radius, half = light.get("radius", 0.5), light.get("length", 1.0) / 2
    if light.stage.get(light.prim.GetAttribute("treatAsLine"), False):
        light.add_loss("treatAsLine is not carried: it stays a cylinder")
    if light.cone() is not None:
        light.add_loss("shaping of a cylinder is not carried: it shines in all directions")
    a, b, c = (length * size for length, size in zip(_axis_lengths(matrix), (2 * half, radius, radius)))
    # Ramanujan's perimeter of an ellipse, as in hdEmbree; the caps do not emit.
    perimeter = math.pi * (3 * (b + c) - math.sqrt((3 * b + c) * (b + 3 * c)))
    reach = radius * math.pi / (_DISC_SIDES * math.sin(math.pi / _DISC_SIDES))
    faces, normals = shapes.revolved(light.where, [(reach, -half, 1.0, 0.0), (reach, half, 1.0, 0.0)], "X", _DISC_SIDES)
    return _emissive_mesh(light, document, faces, light.radiance(perimeter * a), normals)


def _distant(light, document, _matrix):
    angle = light.get("angle", 0.53)
    if not 0 <= angle <= 180:
        light.add_loss(f"its angle of {angle:g} degrees is taken as 180")
        angle = min(max(angle, 0.0), 180.0)
    if light.cone() is not None:
        light.add_loss("shaping of a distant light is not carried: it shines everywhere")
    irradiance = light.emitted()
    if light.stage.by_blender:
        light.add_loss("Blender 4 writes suns with a quarter of their strength and half their angle: both are taken back")
        irradiance, angle = tuple(4 * e for e in irradiance), min(2 * angle, 180.0)
    if angle > 0 and not light.normalized:
        share = math.pi * math.sin(math.radians(angle / 2)) ** 2
        irradiance = tuple(e * share for e in irradiance)
    entry = {"name": str(light.where), "type": "directional", **_strength(irradiance)}
    return {"extensions": document.light(entry), "caustique": {"angle_deg": angle}}


def _emissive_mesh(light, document, faces, radiance, normals, keys=None):
    """Add a black mesh that emits from its front."""
    triangles, _ = faces.triangles()
    if not len(triangles):
        return light.add_loss("it has no surface: it gives no light")
    entry = {"name": str(light.where), "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1]},
             "extras": {"caustique": {"null_bsdf": True, **(keys or {})}}}
    set_emission(document, entry, radiance)
    attributes = {"POSITION": document.floats(faces.points[faces.corners[triangles.reshape(-1)]], bounds=True)}
    if normals is not None:
        attributes["NORMAL"] = document.floats(normals[triangles.reshape(-1)])
    mesh = {"name": str(light.where), "primitives": [{"attributes": attributes,
                                                      "material": document.add("materials", entry)}]}
    return {"mesh": document.add("meshes", mesh)}
