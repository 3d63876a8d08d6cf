"""Packs meshes, lights and cameras into the bytes of a .glb, so that scenes from numpy are read like all others."""

import io
import json
import struct
import zlib
from collections.abc import Sequence

import numpy as np

from .meshes import Camera, Light, Material, Medium, Mesh, PointLight, SpotLight, SunLight, Texture, looking

FLOAT, UINT = 5126, 5125
NEAREST = 9728
#: Far plane of orthographic cameras, m. caustique does not clip.
FAR = 1e6
WRAPS = {"repeat": 10497, "mirror": 33648, "clamp": 33071}
#: The largest index: glTF reserves the largest 32-bit number.
MAX_INDEX = 2**32 - 2
TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
#: {material field: its extension, its key, its default}, for fields that are written as they are
FACTORS = {
    "ior": ("KHR_materials_ior", "ior", 1.5),
    "specular": ("KHR_materials_specular", "specularFactor", 1.0),
    "specular_color": ("KHR_materials_specular", "specularColorFactor", (1.0, 1.0, 1.0)),
    "dispersion": ("KHR_materials_dispersion", "dispersion", 0.0),
    "clearcoat": ("KHR_materials_clearcoat", "clearcoatFactor", 0.0),
    "clearcoat_roughness": ("KHR_materials_clearcoat", "clearcoatRoughnessFactor", 0.0),
    "iridescence": ("KHR_materials_iridescence", "iridescenceFactor", 0.0),
    "iridescence_ior": ("KHR_materials_iridescence", "iridescenceIor", 1.3),
    "iridescence_thickness": ("KHR_materials_iridescence", "iridescenceThicknessMaximum", 400.0),
    "iridescence_thickness_minimum": ("KHR_materials_iridescence", "iridescenceThicknessMinimum", 100.0),
    "diffuse_transmission": ("KHR_materials_diffuse_transmission", "diffuseTransmissionFactor", 0.0),
    "diffuse_transmission_color": (
        "KHR_materials_diffuse_transmission", "diffuseTransmissionColorFactor", (1.0, 1.0, 1.0)),
    "sheen_color": ("KHR_materials_sheen", "sheenColorFactor", (0.0, 0.0, 0.0)),
    "sheen_roughness": ("KHR_materials_sheen", "sheenRoughnessFactor", 0.0),
    "anisotropy": ("KHR_materials_anisotropy", "anisotropyStrength", 0.0),
}
#: {material field of a texture: its extension, its key}
TEXTURES = {
    "iridescence_texture": ("KHR_materials_iridescence", "iridescenceTexture"),
    "iridescence_thickness_texture": ("KHR_materials_iridescence", "iridescenceThicknessTexture"),
}
#: {material field: its default}, for fields that are keys of `extras.caustique`
OWN = {"diffuse_roughness": 0.0, "coat_ior": 1.5, "coat_color": (1.0, 1.0, 1.0), "sheen_model": "charlie"}
#: Material fields of textures that are keys of `extras.caustique`
OWN_TEXTURES = ("diffuse_roughness_texture", "coat_ior_texture", "coat_color_texture")


def pack(
    meshes: Sequence[Mesh],
    *,
    lights: Sequence[Light] = (),
    cameras: Sequence[Camera] = (),
    medium: Medium | None = None,
    extras: dict | None = None,
) -> bytes:
    """Packs a scene into the bytes of a .glb for `caustique render`; `medium` fills the space.

    `extras` are further keys of the scene's `extras.caustique`, such as {"environment": {"file": "sky.exr"}}.

    Raises ValueError for arrays of wrong shapes.
    """
    writer = Writer()
    for mesh in meshes:
        writer.mesh(mesh)
    for light in lights:
        writer.light(light)
    for camera in cameras:
        writer.camera(camera)
    return writer.bytes({"light_units": "radiometric", **({"medium": coefficients(medium)} if medium else {}), **(extras or {})})


def png(name: str, texture) -> bytes:
    """Encodes a texture (H, W, 3) or (H, W, 4) of uint8 as the bytes of a PNG. `name` is for errors."""
    pixels = np.asarray(texture)
    if pixels.ndim != 3 or pixels.shape[2] not in (3, 4) or pixels.dtype != np.uint8 or 0 in pixels.shape:
        raise ValueError(f"{name}: a texture is (H, W, 3) or (H, W, 4) uint8, not {pixels.shape} {pixels.dtype}")
    height, width, channels = pixels.shape
    lines = np.zeros((height, 1 + channels * width), np.uint8)
    lines[:, 1:] = pixels.reshape(height, -1)

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", width, height, 8, 2 if channels == 3 else 6, 0, 0, 0)
    parts = [chunk(b"IHDR", head), chunk(b"IDAT", zlib.compress(lines.tobytes())), chunk(b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(parts)


def coefficients(medium: Medium) -> dict:
    found: dict = {"sigma_a": numbers(medium.sigma_a), "sigma_s": numbers(medium.sigma_s), "g": float(medium.g)}
    return found if medium.density is None else {**found, "density": {"file": medium.density}}


def numbers(values) -> list[float]:
    return [float(x) for x in values]


def channels(texture) -> int:
    """Number of channels of a texture, 0 without one."""
    pixels = texture.pixels if isinstance(texture, Texture) else texture
    return 0 if pixels is None else np.asarray(pixels).shape[-1]


class Writer:
    """A glTF document under construction, and its binary buffer."""

    def __init__(self) -> None:
        self.buffer = io.BytesIO()
        self.document: dict = {
            "asset": {"version": "2.0", "generator": "caustique for Python"},
            "nodes": [], "meshes": [], "materials": [], "cameras": [], "accessors": [], "bufferViews": [],
            "images": [], "textures": [], "samplers": [],
        }
        self.lights: list[dict] = []
        self.extensions: set[str] = set()
        # {identities of objects: the objects, index}, written once. They are kept, so that no other object gets an id.
        self.written: dict[tuple[int, ...], tuple[object, int]] = {}

    def add(self, kind: str, item: dict) -> int:
        self.document[kind].append(item)
        return len(self.document[kind]) - 1

    def view(self, data: bytes) -> int:
        self.buffer.write(b"\0" * (-self.buffer.tell() % 4))
        start = self.buffer.tell()
        self.buffer.write(data)
        return self.add("bufferViews", {"buffer": 0, "byteOffset": start, "byteLength": len(data)})

    def accessor(self, place: str, values, width: int, kind: int = FLOAT) -> int:
        """Adds an array (N, width) to the buffer and returns the index of its accessor. `place` is for errors."""
        array = np.asarray(values)
        if array.ndim != 2 or array.shape[1] != width:
            raise ValueError(f"{place}: an array of shape (N, {width}) is needed, not {array.shape}")
        if kind == UINT:
            if not np.issubdtype(array.dtype, np.integer) or (array.size and int(array.min()) < 0):
                raise ValueError(f"{place}: indices are whole numbers from 0 up")
            if array.size and int(array.max()) > MAX_INDEX:
                raise ValueError(f"{place}: index {array.max()} is past {MAX_INDEX}, the last that a scene can have")
            flat = np.ascontiguousarray(array, "<u4").reshape(-1)
            return self.add("accessors", {
                "bufferView": self.view(flat.tobytes()), "componentType": UINT, "count": len(flat), "type": "SCALAR",
            })
        array = np.ascontiguousarray(array, "<f4")
        item = {
            "bufferView": self.view(array.tobytes()), "componentType": FLOAT, "count": len(array), "type": TYPES[width],
        }
        if width == 3 and len(array) and np.isfinite(array).all():
            item |= {"min": numbers(array.min(axis=0)), "max": numbers(array.max(axis=0))}
        return self.add("accessors", item)

    def once(self, objects: tuple, write) -> int:
        """The index that `write` returns; of the same objects it is called once."""
        key = tuple(map(id, objects))
        if key not in self.written:
            self.written[key] = objects, write()
        return self.written[key][1]

    def mesh(self, mesh: Mesh):
        parts = (mesh.vertices, mesh.triangles, mesh.normals, mesh.uvs, mesh.colors, mesh.material)
        node: dict = {"name": mesh.name, "mesh": self.once(parts, lambda: self.primitive(mesh))}
        if mesh.transform is not None:
            node["matrix"] = matrix(f'mesh "{mesh.name}"', mesh.transform)
        self.node(node, {"light_group": mesh.light_group})

    def primitive(self, mesh: Mesh) -> int:
        """Adds the arrays and the material of a mesh, and returns its index."""
        place = f'mesh "{mesh.name}"'
        attributes = {"POSITION": self.accessor(f"{place}, vertices", mesh.vertices, 3)}
        if mesh.normals is not None:
            attributes["NORMAL"] = self.accessor(f"{place}, normals", mesh.normals, 3)
        if mesh.uvs is not None:
            attributes["TEXCOORD_0"] = self.accessor(f"{place}, uvs", mesh.uvs, 2)
        if mesh.colors is not None:
            attributes["COLOR_0"] = self.accessor(f"{place}, colors", mesh.colors, 3)
        primitive = {
            "attributes": attributes,
            "indices": self.accessor(f"{place}, triangles", mesh.triangles, 3, UINT),
            "material": self.material(mesh.material),
        }
        return self.add("meshes", {"name": mesh.name, "primitives": [primitive]})

    def node(self, node: dict, said: dict):
        said = {key: value for key, value in said.items() if value is not None}
        if said:
            node["extras"] = {"caustique": said}
        self.add("nodes", node)

    def texture(self, place: str, texture, strength: dict | None = None) -> dict:
        """Adds a texture and returns the reference to it."""
        texture = texture if isinstance(texture, Texture) else Texture(pixels=texture)
        if texture.wrap not in WRAPS:
            raise ValueError(f'{place}: wrap is "repeat", "mirror" or "clamp", not {texture.wrap!r}')

        def write() -> int:
            view = self.view(png(place, texture.pixels))
            return self.add("images", {"bufferView": view, "mimeType": "image/png"})

        item = {"source": self.once((texture.pixels,), write)}
        if texture.nearest or texture.wrap != "repeat":
            sampler = {"wrapS": WRAPS[texture.wrap], "wrapT": WRAPS[texture.wrap]}
            item["sampler"] = self.add("samplers", sampler | ({"magFilter": NEAREST} if texture.nearest else {}))
        found: dict = {"index": self.add("textures", item)}
        placed = {
            "offset": numbers(texture.offset), "rotation": -float(np.radians(texture.rotation)),
            "scale": numbers(texture.scale),
        }
        if placed != {"offset": [0.0, 0.0], "rotation": 0.0, "scale": [1.0, 1.0]}:
            found["extensions"] = {"KHR_texture_transform": placed}
            self.extensions.add("KHR_texture_transform")
        return found

    def material(self, material: Material) -> int:
        """Adds a material and returns its index. A material of several meshes is written once."""
        return self.once((material,), lambda: self.add("materials", self.described(material)))

    def described(self, material: Material) -> dict:
        """A material as glTF describes it."""
        place, emission = f'material "{material.name}"', np.asarray(material.emission, float)
        surface: dict = {
            "baseColorFactor": [*numbers(material.base_color), float(material.alpha)],
            "metallicFactor": float(material.metallic),
            "roughnessFactor": float(material.roughness),
        }
        # Cameras see through the back faces of single-sided surfaces.
        double_sided = bool(material.double_sided) or not emission.any()
        item: dict = {"name": material.name, "pbrMetallicRoughness": surface, "doubleSided": double_sided}
        for target, key, texture in (
            (surface, "baseColorTexture", material.base_color_texture),
            (surface, "metallicRoughnessTexture", material.metallic_roughness_texture),
            (item, "normalTexture", material.normal_texture),
            (item, "emissiveTexture", material.emission_texture),
        ):
            if texture is not None:
                target[key] = self.texture(f"{place}, {key}", texture)
        if material.alpha < 1.0 or channels(material.base_color_texture) == 4:
            item["alphaMode"] = "BLEND"
        extensions = self.layers(material)
        for name, (extension, key) in TEXTURES.items():
            if getattr(material, name) is not None:
                of_extension = extensions.setdefault(extension, {})
                of_extension[key] = self.texture(f"{place}, {key}", getattr(material, name))
        if emission.any():
            strength = max(1.0, float(emission.max()))
            item["emissiveFactor"] = numbers(emission / strength)
            extensions["KHR_materials_emissive_strength"] = {"emissiveStrength": strength}
        own: dict = {} if material.medium is None else {"medium": coefficients(material.medium)}
        if material.null_bsdf:
            own["null_bsdf"] = True
        for name, usual in OWN.items():
            value = getattr(material, name)
            if not isinstance(usual, str):
                value = float(value) if isinstance(usual, float) else tuple(numbers(value))
            if value != usual:
                own[name] = value
        for name in OWN_TEXTURES:
            if getattr(material, name) is not None:
                own[name] = self.texture(f"{place}, {name}", getattr(material, name))
        if own:
            item["extras"] = {"caustique": own}
        if extensions:
            item["extensions"] = extensions
            self.extensions.update(extensions)
        return item

    def layers(self, material: Material) -> dict:
        """The extensions of a material for all but its emission."""
        found: dict = {}
        if material.transmission > 0.0:
            found["KHR_materials_transmission"] = {"transmissionFactor": float(material.transmission)}
            found["KHR_materials_volume"] = {"thicknessFactor": 0.0 if material.thin else 1.0}
        for name, (extension, key, usual) in FACTORS.items():
            value = getattr(material, name)
            value = float(value) if isinstance(usual, float) else tuple(numbers(value))
            if value != usual:
                found.setdefault(extension, {})[key] = value
        if material.anisotropy and material.anisotropy_rotation:
            found["KHR_materials_anisotropy"]["anisotropyRotation"] = float(np.radians(material.anisotropy_rotation))
        return found

    def light(self, light: Light):
        said: dict = {"light_group": light.light_group}
        item: dict = {"name": light.name}
        match light:
            case PointLight():
                item |= {"type": "point"}
                pose = np.eye(4)
                pose[:3, 3] = light.position
                said["radius"], power = float(light.radius), light.intensity
            case SpotLight():
                angles = {"innerConeAngle": np.radians(light.inner), "outerConeAngle": np.radians(light.outer)}
                item |= {"type": "spot", "spot": angles}
                pose = looking(light.position, light.target)
                said["radius"], power = float(light.radius), light.intensity
            case SunLight():
                item |= {"type": "directional"}
                pose = looking((0.0, 0.0, 0.0), light.direction)
                said["angle_deg"], power = float(light.angle), light.irradiance
            case _:
                raise TypeError(f"a light is a PointLight, SpotLight or SunLight, not {type(light).__name__}")
        # glTF limits the colour of a light to one.
        strength = max(numbers(power)) or 1.0
        item |= {"color": [x / strength for x in numbers(power)], "intensity": strength}
        self.lights.append(item)
        self.extensions.add("KHR_lights_punctual")
        reference = {"KHR_lights_punctual": {"light": len(self.lights) - 1}}
        self.node({"name": light.name, "matrix": matrix(light.name, pose), "extensions": reference}, said)

    def camera(self, camera: Camera):
        view: dict
        if camera.orthographic_height is not None:
            kind, half = "orthographic", float(camera.orthographic_height) / 2.0
            view = {"xmag": half * float(camera.aspect or 1.0), "ymag": half, "znear": 0.0, "zfar": FAR}
        else:
            kind, view = "perspective", {"yfov": float(np.radians(camera.fov)), "znear": 0.01}
            if camera.aspect is not None:
                view["aspectRatio"] = float(camera.aspect)
        index = self.add("cameras", {"name": camera.name, "type": kind, kind: view})
        pose = looking(camera.position, camera.target, camera.up)
        to_target = float(np.linalg.norm(np.subtract(camera.target, camera.position)))
        distance = to_target if camera.focus_distance is None else float(camera.focus_distance)
        lens: dict = {"aperture_radius": float(camera.aperture_radius), "focus_distance": distance}
        if any(camera.shift):
            lens["shift"] = numbers(camera.shift)
        self.node({"name": camera.name, "camera": index, "matrix": matrix(camera.name, pose)}, lens)

    def bytes(self, said: dict) -> bytes:
        document = {key: value for key, value in self.document.items() if value}
        document["scenes"] = [{"nodes": list(range(len(self.document["nodes"]))), "extras": {"caustique": said}}]
        document["scene"] = 0
        if self.lights:
            document["extensions"] = {"KHR_lights_punctual": {"lights": self.lights}}
        if self.extensions:
            document["extensionsUsed"] = sorted(self.extensions)
        binary = self.buffer.getvalue()
        binary += b"\0" * (-len(binary) % 4)
        if binary:
            document["buffers"] = [{"byteLength": len(binary)}]
        try:
            text = json.dumps(document, allow_nan=False).encode()
        except ValueError as error:
            raise ValueError(f"a number of the scene is not finite: {error}") from error
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text
        if binary:
            chunks += struct.pack("<I4s", len(binary), b"BIN\0") + binary
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def matrix(place: str, values) -> list[float]:
    """The 16 numbers of a matrix (4, 4) in the column-major order of glTF. `place` is for errors."""
    array = np.asarray(values, float)
    if array.shape != (4, 4):
        raise ValueError(f"{place}: a transform is (4, 4), not {array.shape}")
    return numbers(array.T.reshape(-1))
