"""Scenes of meshes and a few materials, written as glTF with the keys of docs/scene-format.md."""

import struct
import zlib
from dataclasses import dataclass, field, replace

import glb
import numpy as np

FLOAT, UNSIGNED = 5126, 5125


def diffuse(albedo):
    """A Lambertian surface; albedo: a number, or three."""
    return {
        "pbrMetallicRoughness": {"baseColorFactor": [*_rgb(albedo), 1], "metallicFactor": 0, "roughnessFactor": 1},
        "extensions": {"KHR_materials_specular": {"specularFactor": 0}},
    }


def metal(colour, roughness):
    """A metal with GGX facets of this reflectance; alpha is the squared roughness."""
    return {
        "pbrMetallicRoughness": {
            "baseColorFactor": [*_rgb(colour), 1],
            "metallicFactor": 1,
            "roughnessFactor": roughness,
        }
    }


def plastic(colour, roughness, ior=1.5):
    """A dielectric coat over a diffuse base."""
    return {
        "pbrMetallicRoughness": {
            "baseColorFactor": [*_rgb(colour), 1],
            "metallicFactor": 0,
            "roughnessFactor": roughness,
        },
        "extensions": {"KHR_materials_ior": {"ior": ior}},
    }


def glass(ior, roughness=0.0, priority=None, medium=None):
    """A solid of clear glass; medium: sigma_a, sigma_s (1/m, three numbers each) and g."""
    keys = {key: value for key, value in (("priority", priority), ("medium", medium)) if value is not None}
    return {
        "pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": roughness},
        "extensions": {
            "KHR_materials_transmission": {"transmissionFactor": 1},
            "KHR_materials_ior": {"ior": ior},
            "KHR_materials_volume": {"thicknessFactor": 1},
        },
        **_extras(keys),
    }


def emitter(radiance):
    """A black surface that emits from its front; radiance: W/(sr m²), a number or three."""
    return glowing(diffuse(0), radiance)


def glowing(material, radiance):
    """The material with emission added."""
    rgb = np.array(_rgb(radiance), float)
    strength = float(rgb.max())
    if strength == 0:
        return material
    extensions = {**material.get("extensions", {}), "KHR_materials_emissive_strength": {"emissiveStrength": strength}}
    return {**material, "emissiveFactor": (rgb / strength).tolist(), "extensions": extensions}


def medium(absorbed, scattered, g=0.0, density=None, emission=None):
    """The coefficients of a medium, 1/m; density and emission: names of files of grids (Scene.beside)."""
    grids = {key: {"file": name} for key, name in (("density", density), ("emission", emission)) if name}
    return {"sigma_a": _rgb(absorbed), "sigma_s": _rgb(scattered), "g": g, **grids}


def grid(values, low, high):
    """A grid file (.vol) of one channel: values by z, y and x, in the box between two corners."""
    header = struct.pack("<3sB5I6f", b"VOL", 3, 1, *values.shape[::-1], 1, *low, *high)
    return header + values.astype("<f4").tobytes()


def _rgb(value):
    return [float(c) for c in np.broadcast_to(np.asarray(value, float), 3)]


def _extras(keys):
    return {"extras": {"caustique": keys}} if keys else {}


@dataclass(frozen=True)
class Scene:
    """objects: (mesh, material, entries of the node); lights: (light of KHR_lights_punctual, matrix of the node, keys);
    camera: (eye, target, vertical field of view in degrees, up); keys: of the scene; root: the matrix of a node above
    all others; files: pairs of a name and the bytes of a file beside the scene."""

    objects: tuple = ()
    lights: tuple = ()
    camera: tuple = ((0, 0, 1), (0, 0, 0), 10, (0, 1, 0))
    keys: dict = field(default_factory=dict)
    root: np.ndarray | None = None
    files: tuple = ()

    def beside(self, name, content):
        """The scene with another file beside it."""
        return replace(self, files=(*self.files, (name, content)))

    def add(self, mesh, material, **node):
        """The scene with another object; `node`: entries of its node, such as scale."""
        return replace(self, objects=(*self.objects, (mesh, material, node)))

    def sun(self, direction, irradiance, angle_deg=0.0):
        """The scene with a sun that shines along `direction`; irradiance: perpendicular, in W/m²."""
        light = {"type": "directional", "color": [1, 1, 1], "intensity": irradiance}
        return self._lit(light, (0, 0, 0), direction, {"angle_deg": angle_deg} if angle_deg else {})

    def point(self, place, intensity):
        """The scene with a point light; intensity: in W/sr."""
        light = {"type": "point", "color": [1, 1, 1], "intensity": intensity}
        return self._lit(light, place, (0, 0, -1), {})

    def spot(self, place, direction, intensity, half_angle_deg, **keys):
        """The scene with a spot; keys: of its `extras.caustique`. The key `ies` may hold a profile's text as `profile`, the
        key `gobo` an image's PNG as `image`."""
        light = {"type": "spot", "color": [1, 1, 1], "intensity": intensity}
        light["spot"] = {"outerConeAngle": np.radians(half_angle_deg)}
        return self._lit(light, place, direction, keys)

    def _lit(self, light, place, direction, keys):
        matrix = _turned(place, -np.asarray(direction, float), _across(direction))
        return replace(self, lights=(*self.lights, (light, matrix, keys)))

    def seen(self, eye, target, field_deg, up=(0, 1, 0)):
        """The scene with this camera."""
        return replace(self, camera=(eye, target, field_deg, up))

    def within(self, radiance):
        """The scene with an environment of this radiance."""
        return replace(self, keys={**self.keys, "environment": {"color": _rgb(radiance)}})

    def scaled(self, factor):
        """The scene with all lengths multiplied by a factor, at equal radiance. It computes in single precision, so powers
        of two are exact."""
        objects = tuple(
            (replace(mesh, positions=np.float32(mesh.positions) * np.float32(factor)), material, node)
            for mesh, material, node in self.objects
        )
        eye, target, *rest = self.camera
        eye, target = (tuple(float(np.float32(c) * np.float32(factor)) for c in v) for v in (eye, target))
        # The direction of the view stays equal to the last bit.
        lights = tuple((light, _moved(matrix, factor), keys) for light, matrix, keys in self.lights)
        return replace(self, objects=objects, lights=lights, camera=(eye, target, *rest))

    def moved(self, offset):
        """The scene on a node that is translated by `offset`."""
        return self.under(_translation(offset))

    def under(self, matrix):
        """The scene on a node with this matrix."""
        return replace(self, root=matrix)

    def write(self, path):
        """Writes the scene as a .glb, and its files beside it."""
        _Writer(self).write(path)
        for name, content in self.files:
            path.with_name(name).write_bytes(content)


def _across(direction):
    """An up vector that is not parallel to `direction`."""
    return (0, 1, 0) if abs(direction[1]) < 0.9 * np.linalg.norm(direction) else (0, 0, -1)


def _turned(place, back, up):
    """The matrix of a node at `place` whose +Z is `back`."""
    back = np.asarray(back, float)
    back = back / np.linalg.norm(back)
    right = np.cross(up, back)
    right = right / np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3, 0], matrix[:3, 1], matrix[:3, 2], matrix[:3, 3] = right, np.cross(back, right), back, place
    return matrix


def _translation(offset):
    matrix = np.eye(4)
    matrix[:3, 3] = offset
    return matrix


def _moved(matrix, factor):
    scaled = matrix.copy()
    scaled[:3, 3] *= factor
    return scaled


class _Writer:
    """The glTF document of a scene, under construction."""

    def __init__(self, scene):
        self.buffer = bytearray()
        self.document = {"asset": {"version": "2.0", "generator": "caustique hard cases"}, "scene": 0, "nodes": []}
        keys = {"light_units": "radiometric", **scene.keys}
        nodes = [
            self._camera(scene.camera),
            *(self._light(*light) for light in scene.lights),
            *(self._object(*made) for made in scene.objects),
        ]
        if scene.root is not None:
            nodes = [self._append("nodes", {"matrix": _columns(scene.root), "children": nodes})]
        self.document["scenes"] = [{"nodes": nodes, **_extras(keys)}]
        self.document["extensionsUsed"] = sorted(self._extensions(self.document))
        self.document["buffers"] = [{"byteLength": len(self.buffer) + -len(self.buffer) % 4}]

    def write(self, path):
        if not self.buffer:
            del self.document["buffers"]
        glb.write(path, self.document, bytes(self.buffer))

    def _append(self, key, part):
        parts = self.document.setdefault(key, [])
        parts.append(part)
        return len(parts) - 1

    def _extensions(self, part):
        inner = part.values() if isinstance(part, dict) else part if isinstance(part, list) else ()
        own = set(part.get("extensions", ())) if isinstance(part, dict) else set()
        return own.union(*(self._extensions(one) for one in inner))

    def _camera(self, camera):
        eye, target, field_deg, up = camera
        lens = {"type": "perspective", "perspective": {"yfov": np.radians(field_deg), "aspectRatio": 1, "znear": 1e-6}}
        matrix = _turned(eye, np.subtract(eye, target), up)
        return self._append("nodes", {"camera": self._append("cameras", lens), "matrix": _columns(matrix)})

    def _light(self, light, matrix, keys):
        keys = dict(keys)
        if "ies" in keys:
            keys["ies"] = {"bufferView": self._view(keys["ies"]["profile"].encode())}
        if "gobo" in keys:
            image = {"bufferView": self._view(keys["gobo"]["image"]), "mimeType": "image/png"}
            keys["gobo"] = {"texture": self._append("textures", {"source": self._append("images", image)})}
        lights = self.document.setdefault("extensions", {}).setdefault("KHR_lights_punctual", {"lights": []})["lights"]
        lights.append(light)
        return self._append(
            "nodes",
            {
                "extensions": {"KHR_lights_punctual": {"light": len(lights) - 1}},
                "matrix": _columns(matrix),
                **_extras(keys),
            },
        )

    def _object(self, mesh, material, node):
        attributes = {"POSITION": self._accessor(mesh.positions.astype("<f4"), "VEC3", FLOAT)}
        if mesh.normals is not None:
            attributes["NORMAL"] = self._accessor(mesh.normals.astype("<f4"), "VEC3", FLOAT)
        indices = self._accessor(mesh.triangles.astype("<u4").ravel(), "SCALAR", UNSIGNED)
        materials = self.document.get("materials", [])
        index = materials.index(material) if material in materials else self._append("materials", material)
        part = {"attributes": attributes, "indices": indices, "material": index}
        return self._append("nodes", {"mesh": self._append("meshes", {"primitives": [part]}), **node})

    def _view(self, data):
        self.buffer += bytes(-len(self.buffer) % 4)
        view = {"buffer": 0, "byteOffset": len(self.buffer), "byteLength": len(data)}
        self.buffer += data
        return self._append("bufferViews", view)

    def _accessor(self, values, kind, component):
        accessor = {"componentType": component, "count": len(values), "type": kind}
        if len(values):
            accessor["bufferView"] = self._view(values.tobytes())
        if kind == "VEC3" and len(values):
            accessor.update(min=_finite(values.min(axis=0)), max=_finite(values.max(axis=0)))
        return self._append("accessors", accessor)


def grey_png(value):
    """A PNG of one texel, a grey of 8 bits."""

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", 1, 1, 8, 0, 0, 0, 0)
    texels = zlib.compress(bytes([0, value]))
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", texels) + chunk(b"IEND", b"")


def _finite(values):
    return [float(v) for v in np.nan_to_num(values)]


def _columns(matrix):
    """A 4 x 4 matrix in glTF's column-major order."""
    return [float(v) for v in np.asarray(matrix).T.ravel()]
