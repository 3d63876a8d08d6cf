"""Our scenes as the peers' drivers take them: NAME.glb with NAME.json, lamps in watts, the environment as an image.

What the drivers cannot say is named: `blockers` make a comparison worthless, `approximations` are judged by the mean of
the picture.
"""

import json
import struct
import sys

import numpy as np

from _pictures import Layers, write
from record import ROOT

sys.path.append(str(ROOT / "scripts" / "compare"))
import gltf  # noqa: E402

# How wide an environment with a sun's disc in it is made: half a degree is three pixels.
WIDE = 2048
# The largest number in its image.
HALF = 30000.0
PLAIN = {
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_volume",
}


class Translation:
    """A scene's file, as it is turned into the drivers' terms."""

    def __init__(self, path):
        self.path = path
        self.document, binary = gltf.chunks(path.read_bytes())
        self.binary = bytearray(binary)
        self.root = self.document["scenes"][self.document.get("scene", 0)]
        self.blockers, self.approximations, self.suns = [], [], []
        said = gltf.extras(self.root)
        units = said.get("light_units")
        blender = self.document["asset"].get("generator", "").startswith("Khronos glTF Blender I/O")
        self.divisor = gltf.EFFICACY if units == "photometric" or units is None and blender else 1.0
        if said.get("medium"):
            self.blockers.append("a medium fills the space")
        self._file()
        for material in self.document.get("materials", []):
            self._material(material, f"material \"{material.get('name', '')}\"")
        self.cameras = 0
        for node in self.root.get("nodes", []):
            self._node(node, np.eye(4))
        self.environment = self._environment(said.get("environment"))

    def _file(self):
        """What the file as a whole may not hold."""
        for key, what in (("animations", "animations"), ("skins", "skins")):
            if self.document.get(key):
                self.blockers.append(what)
        for mesh in self.document.get("meshes", []):
            for primitive in mesh["primitives"]:
                attributes, named = primitive["attributes"], f"mesh \"{mesh.get('name', '')}\""
                if "material" not in primitive or "indices" not in primitive or "NORMAL" not in attributes:
                    self.blockers.append(f"{named} without material, indices or normals")
                if "COLOR_0" in attributes or "targets" in primitive:
                    self.blockers.append(f"{named} with vertex colours or morph targets")

    def _material(self, material, name):
        surface, extensions = material.get("pbrMetallicRoughness", {}), material.get("extensions", {})
        strange = sorted(set(extensions) - PLAIN)
        if strange:
            self.blockers.append(f"{name}: {', '.join(strange)}")
        textures = [key for key in ("normalTexture", "emissiveTexture") if key in material]
        textures += [key for key in ("metallicRoughnessTexture",) if key in surface]
        for extension in extensions.values():
            textures += [key for key in extension if key.endswith("Texture")]
        if textures:
            self.blockers.append(f"{name}: {', '.join(textures)}")
        if material.get("alphaMode", "OPAQUE") != "OPAQUE":
            self.blockers.append(f"{name}: cut-outs")
        base = surface.get("baseColorTexture")
        if base and (base.get("texCoord") or base.get("extensions")):
            self.blockers.append(f"{name}: a texture that is placed anew")
        if base and surface.get("baseColorFactor", [1, 1, 1])[:3] != [1, 1, 1]:
            self.blockers.append(f"{name}: a texture with a factor")
        said = gltf.extras(material)
        self.blockers += [f"{name}: {key}" for key in said]
        transmission = extensions.get("KHR_materials_transmission", {}).get("transmissionFactor", 0)
        metallic = surface.get("metallicFactor", 1.0)
        if transmission not in (0, 1) or metallic not in (0, 1):
            self.blockers.append(f"{name}: partly metal or glass")
        volume = extensions.get("KHR_materials_volume", {})
        if transmission and "attenuationDistance" in volume and volume.get("attenuationColor", [1, 1, 1]) != [1, 1, 1]:
            self.blockers.append(f"{name} absorbs")
        specular = extensions.get("KHR_materials_specular", {})
        if not transmission and not metallic:
            strength = specular.get("specularFactor", 1)
            if 0 < strength < 1 or strength and specular.get("specularColorFactor", [1, 1, 1]) != [1, 1, 1]:
                self.approximations.append(f"{name}: specular {strength:g} as 1")
            if strength and extensions.get("KHR_materials_ior", {}).get("ior", 1.5) != 1.5:
                self.approximations.append(f"{name}: index as 1.5")
        if max(material.get("emissiveFactor", [0])) > 0 and material.get("doubleSided"):
            self.approximations.append(f"{name} shines from its front only")

    def _node(self, index, parent):
        node = self.document["nodes"][index]
        to_world = parent @ gltf.matrix(node)
        if "camera" in node:
            self.cameras += 1
            camera = self.document["cameras"][node["camera"]]
            if self.cameras > 1:
                del node["camera"]
            elif camera["type"] != "perspective":
                self.blockers.append("an orthographic camera")
            elif {**gltf.extras(camera), **gltf.extras(node)}.get("aperture_radius"):
                self.blockers.append("depth of field")
        light = gltf.extension(node, "KHR_lights_punctual")
        if light is not None:
            self._light(node, light, to_world)
        for child in node.get("children", []):
            self._node(child, to_world)

    def _light(self, node, light, to_world):
        lights = self.document["extensions"]["KHR_lights_punctual"]["lights"]
        raw = lights[light["light"]]
        said = {**gltf.extras(raw), **gltf.extras(node)}
        value = np.array(raw.get("color", [1, 1, 1]), float) * raw.get("intensity", 1.0) / self.divisor
        if raw["type"] == "spot":
            self.blockers.append("spots")
            return
        del node["extensions"]["KHR_lights_punctual"]
        if raw["type"] == "point" and said.get("radius"):
            scale = np.linalg.norm(to_world[:3, :3], axis=0).mean()
            node.setdefault("children", []).append(self._sphere(said["radius"] / scale, value, scale))
        elif raw["type"] == "directional" and said.get("angle_deg"):
            self.suns.append(
                (to_world[:3, 2] / np.linalg.norm(to_world[:3, 2]), np.radians(said["angle_deg"]) / 2, value)
            )
        else:
            lights.append({"type": raw["type"], "color": [1, 1, 1], "intensity": 1.0})
            lights[-1]["color"], lights[-1]["intensity"] = (value / value.max()).tolist(), float(value.max())
            node["extensions"]["KHR_lights_punctual"] = {"light": len(lights) - 1}

    def _sphere(self, radius, intensity, scale):
        """A node with a glowing ball of facets. A convex body shows a quarter of its surface on average."""
        points, triangles = icosphere(3)
        corners = points[triangles] * radius * scale
        surface = (
            np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2
        )
        radiance = intensity / (surface / 4)
        self.document["materials"].append(
            {
                "name": "lamp",
                "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1], "metallicFactor": 0},
                "emissiveFactor": (radiance / radiance.max()).tolist(),
                "extensions": {
                    "KHR_materials_specular": {"specularFactor": 0},
                    "KHR_materials_emissive_strength": {"emissiveStrength": float(radiance.max())},
                },
            }
        )
        primitive = {
            "attributes": {
                "POSITION": self._accessor(points * radius, "VEC3"),
                "NORMAL": self._accessor(points, "VEC3"),
            },
            "indices": self._accessor(triangles.ravel(), "SCALAR"),
            "material": len(self.document["materials"]) - 1,
        }
        self.document["meshes"].append({"name": "lamp", "primitives": [primitive]})
        self.document["nodes"].append({"name": "lamp", "mesh": len(self.document["meshes"]) - 1})
        return len(self.document["nodes"]) - 1

    def _accessor(self, values, kind):
        data = values.astype("<u4" if kind == "SCALAR" else "<f4")
        self.binary += bytes(-len(self.binary) % 4)
        self.document["bufferViews"].append({"buffer": 0, "byteOffset": len(self.binary), "byteLength": data.nbytes})
        self.binary += data.tobytes()
        self.document["accessors"].append(
            {
                "bufferView": len(self.document["bufferViews"]) - 1,
                "type": kind,
                "componentType": 5125 if kind == "SCALAR" else 5126,
                "count": len(data),
            }
        )
        return len(self.document["accessors"]) - 1

    def _environment(self, said):
        """The environment as the drivers' image, suns in it: rows from the top, u = atan2(x, -z) / 2 pi. Or none."""
        said = said or {}
        image = None
        if "file" in said:
            path = self.path.parent / said["file"]
            if path.suffix != ".exr":
                self.blockers.append(f"an environment that is no EXR: {path.name}")
                return None
            image = Layers(path).get("") * said.get("strength", 1.0)
        elif max(said.get("color", [0])) > 0:
            image = np.full((32, 64, 3), said["color"], np.float32) * said.get("strength", 1.0)
        if image is None and not self.suns:
            return None
        if image is None:
            image = np.zeros((32, 64, 3), np.float32)
        height, width = (max(WIDE // 2, image.shape[0]), max(WIDE, image.shape[1])) if self.suns else image.shape[:2]
        # Ours has u = 1/2 + atan2(z, x) / 2 pi, a quarter turn on. Turned counter-clockwise,
        # it shows what was to the right.
        u = (np.arange(width) + 0.5) / width + 0.25 + said.get("rotation_deg", 0.0) / 360
        image = sample(image, u, (np.arange(height) + 0.5) / height)
        for sun in self.suns:
            image += disc(*sun, height, width)
        if self.suns:
            self.approximations.append("the sun as a few pixels of the environment")
        return image

    def save(self, folder, width, height):
        """Writes the files that the drivers read."""
        name = folder.name
        folder.mkdir(parents=True)
        environment = None
        if self.environment is not None:
            # Cycles and LuxCore keep images in half precision, whose largest number a sun surpasses.
            scale = max(float(self.environment.max()) / HALF, 1.0)
            write(folder / "environment.exr", picture=self.environment / scale)
            environment = {"file": "environment.exr", "scale": scale}
        settings = {"width": width, "height": height, "max_path_segments": 32, "environment": environment}
        (folder / f"{name}.json").write_text(json.dumps(settings), encoding="utf-8")
        pack(folder / f"{name}.glb", self.document, self.binary)


def pack(path, document, binary):
    """Writes a .glb file."""
    document["buffers"][0]["byteLength"] = len(binary)
    text = json.dumps(document).encode()
    text, binary = text + b" " * (-len(text) % 4), bytes(binary) + bytes(-len(binary) % 4)
    with open(path, "wb") as sink:
        sink.write(struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(binary)))
        sink.write(struct.pack("<I4s", len(text), b"JSON") + text)
        sink.write(struct.pack("<I4s", len(binary), b"BIN\0") + binary)


def sample(image, u, v):
    """A latitude-longitude image at columns u and rows v, bilinear."""
    height, width, _ = image.shape
    for axis, size, at in ((0, height, v * height - 0.5), (1, width, u * width - 0.5)):
        low = np.floor(at).astype(int)
        share = (at - low).astype(np.float32).reshape((-1, 1, 1) if axis == 0 else (1, -1, 1))
        index = (lambda i: np.clip(i, 0, size - 1)) if axis == 0 else (lambda i: i % size)
        image = np.take(image, index(low), axis) * (1 - share) + np.take(image, index(low + 1), axis) * share
    return image


def disc(toward, radius, irradiance, height, width, fine=8):
    """A sun of so many radians about a direction, on the drivers' grid: its pixels together have its irradiance."""
    v = (np.arange(height * fine) + 0.5) / (height * fine) * np.pi
    rows = np.abs(v - np.arccos(np.clip(toward[1], -1, 1))) < radius + np.pi / height
    rows = np.repeat(rows.reshape(height, fine).any(1), fine)
    a = (np.arange(width * fine) + 0.5) / (width * fine) * 2 * np.pi
    inside = np.zeros((height, width))
    polar = v[rows][:, None]
    cosine = np.sin(polar) * (np.sin(a) * toward[0] - np.cos(a) * toward[2]) + np.cos(polar) * toward[1]
    share = (cosine > np.cos(radius)).reshape(-1, fine, width, fine).mean((1, 3))
    inside[rows.reshape(height, fine)[:, 0]] = share
    solid = np.sin((np.arange(height) + 0.5) / height * np.pi)[:, None] * (np.pi / height) * (2 * np.pi / width)
    return (inside / max((inside * solid).sum(), 1e-30))[..., None] * irradiance


def icosphere(times):
    """Points of the unit sphere and triangles, an icosahedron's split into four so many times."""
    golden = (1 + 5**0.5) / 2
    points = [[0, s, t * golden] for s in (-1, 1) for t in (-1, 1)]
    points = np.array([np.roll(p, k) for k in range(3) for p in points], float)
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    near = np.linalg.norm(points[:, None] - points[None], axis=2) < 1.1
    triangles = [
        (i, j, k) for i in range(12) for j in range(i) for k in range(j) if near[i, j] and near[j, k] and near[i, k]
    ]
    triangles = np.array([t if np.linalg.det(points[list(t)]) > 0 else t[::-1] for t in triangles])
    for _ in range(times):
        edges = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
        unique, which = np.unique(edges, axis=0, return_inverse=True)
        middle = points[unique].sum(1)
        which = which.reshape(3, -1).T + len(points)
        points = np.concatenate([points, middle / np.linalg.norm(middle, axis=1, keepdims=True)])
        (a, b, c), (ab, bc, ca) = triangles.T, which.T
        triangles = np.concatenate([np.stack(t, 1) for t in ((a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca))])
    return points, triangles
