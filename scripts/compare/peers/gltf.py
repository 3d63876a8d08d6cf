"""Reads glTF 2.0 for the comparison, independently of caustique's reader.

Meshes are in world space, with transforms composed in double precision. Unsupported features are errors.
"""

import base64
import json
import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

COMPONENTS = {5120: np.int8, 5121: np.uint8, 5122: np.int16, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
EXTENSIONS = {
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_volume",
    "KHR_texture_transform",
}
#: Lumens per watt in files of Blender's exporter.
EFFICACY = 683.0


class Unsupported(Exception):
    """The scene has a feature that one of the compared renderers cannot represent."""


def refuse(what):
    """Raise `Unsupported` for an approximation, if pictures have to agree."""
    raise Unsupported(what)


@dataclass
class Mesh:
    """Triangles in world space with one material."""

    name: str
    material: int | None
    positions: np.ndarray
    normals: np.ndarray | None
    uvs: np.ndarray | None
    triangles: np.ndarray


@dataclass
class Light:
    """A punctual light in radiometric units: W/sr, or W/m2 for a sun."""

    kind: str
    to_world: np.ndarray
    intensity: np.ndarray
    inner: float = 0.0
    outer: float = np.pi / 4
    radius: float = 0.0
    angle: float = 0.0


@dataclass
class Camera:
    """A perspective camera that looks along its -Z."""

    name: str
    to_world: np.ndarray
    yfov: float
    aspect: float
    aperture_radius: float
    focus_distance: float


@dataclass
class Scene:
    """The contents of the file's scene."""

    document: dict
    folder: Path
    buffers: list
    meshes: list = field(default_factory=list)
    lights: list = field(default_factory=list)
    cameras: list = field(default_factory=list)
    environment: dict | None = None
    medium: dict | None = None
    #: Called with a text for each feature that is approximated or left out.
    lose: Callable[[str], None] = refuse

    def image(self, texture):
        """The encoded image of a texture (bytes), and its sampler."""
        texture = self.document["textures"][texture]
        image = self.document["images"][texture["source"]]
        sampler = self.document["samplers"][texture["sampler"]] if "sampler" in texture else {}
        if "bufferView" in image:
            return _view(self, image["bufferView"]), sampler
        return _uri(image["uri"], self.folder), sampler


#: Keys of `extras.caustique` of materials that no other renderer gets.
OWN = {"diffuse_roughness", "coat_color", "coat_ior", "sheen_model"}


def extras(part):
    """The dict `extras.caustique` of a glTF object, such as a node or a material; empty if there is none."""
    return part.get("extras", {}).get("caustique", {})


def extension(part, name):
    """An extension of a part, or None."""
    return part.get("extensions", {}).get(name)


def read(path, lose=refuse, known=()):
    """Read the scene at `path` (.glb or .gltf). `lose` receives a text for each approximated or omitted feature; `known`
    are extensions of materials that the caller translates."""
    path = Path(path)
    data = path.read_bytes()
    if data[:4] == b"glTF":
        document, binary = chunks(data)
    else:
        document, binary = json.loads(data), None
    unknown = sorted(set(document.get("extensionsUsed", [])) - EXTENSIONS - set(known))
    if not all(name.startswith("KHR_materials_") for name in unknown):
        raise Unsupported(f"{path}: extensions {', '.join(unknown)}")
    for name in unknown:
        lose(f"{name} is left out")
    buffers = [_uri(b["uri"], path.parent) if "uri" in b else binary for b in document.get("buffers", [])]
    scene = Scene(document, path.parent, buffers, lose=lose)
    for material in document.get("materials", []):
        for key in sorted(OWN & set(extras(material))):
            lose(f"material {material.get('name')}: its {key} is left out")
    if document.get("animations"):
        lose("animations are left out: everything stands where its node does")
    root = document["scenes"][document.get("scene", 0)]
    said = extras(root)
    scene.medium, scene.environment = said.get("medium"), said.get("environment")
    scene_units = said.get("light_units")
    if scene_units is None:
        blender = document["asset"].get("generator", "").startswith("Khronos glTF Blender I/O")
        scene_units = "photometric" if blender else "radiometric"
    divisor = EFFICACY if scene_units == "photometric" else 1.0
    for node in root.get("nodes", []):
        _visit(scene, document["nodes"][node], np.eye(4), divisor)
    return scene


def chunks(data):
    """Split a .glb file into its document and its binary buffer."""
    document, binary, at = None, b"", 12
    while at < len(data):
        length, kind = struct.unpack_from("<I4s", data, at)
        chunk = data[at + 8 : at + 8 + length]
        if kind == b"JSON":
            document = json.loads(chunk)
        elif kind == b"BIN\0":
            binary = chunk
        at += 8 + length
    return document, binary


def pack(path, document, binary):
    """Write a .glb file from a document and its binary buffer."""
    document["buffers"][0]["byteLength"] = len(binary)
    text = json.dumps(document).encode()
    text, binary = text + b" " * (-len(text) % 4), bytes(binary) + bytes(-len(binary) % 4)
    with open(path, "wb") as sink:
        sink.write(struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(binary)))
        sink.write(struct.pack("<I4s", len(text), b"JSON") + text)
        sink.write(struct.pack("<I4s", len(binary), b"BIN\0") + binary)


def _uri(uri, folder):
    if uri.startswith("data:"):
        return base64.b64decode(uri.split(",", 1)[1])
    return (folder / uri).read_bytes()


def _view(scene, index):
    view = scene.document["bufferViews"][index]
    start = view.get("byteOffset", 0)
    return scene.buffers[view["buffer"]][start : start + view["byteLength"]]


def accessor(scene, index):
    """An accessor as an array of floats (normalised if flagged) or integers, one row per element."""
    raw = scene.document["accessors"][index]
    if "sparse" in raw or "bufferView" not in raw:
        raise Unsupported("sparse accessors")
    kind, width = np.dtype(COMPONENTS[raw["componentType"]]), WIDTHS[raw["type"]]
    stride = scene.document["bufferViews"][raw["bufferView"]].get("byteStride", kind.itemsize * width)
    data = np.frombuffer(_view(scene, raw["bufferView"]), np.uint8)[raw.get("byteOffset", 0) :]
    rows = np.lib.stride_tricks.as_strided(data, (raw["count"], kind.itemsize * width), (stride, 1))
    values = np.ascontiguousarray(rows).view(kind)
    if raw.get("normalized"):
        values = np.maximum(values / np.iinfo(kind).max, -1.0)
    return values


def matrix(node):
    """A node's local transform."""
    if "matrix" in node:
        return np.array(node["matrix"], float).reshape(4, 4).T
    x, y, z, w = np.array(node.get("rotation", [0, 0, 0, 1]), float)
    n = x * x + y * y + z * z + w * w
    rotation = np.eye(3) + 2 / n * np.array(
        [
            [-y * y - z * z, x * y - z * w, x * z + y * w],
            [x * y + z * w, -x * x - z * z, y * z - x * w],
            [x * z - y * w, y * z + x * w, -x * x - y * y],
        ]
    )
    matrix = np.eye(4)
    matrix[:3, :3] = rotation * np.array(node.get("scale", [1, 1, 1]), float)
    matrix[:3, 3] = node.get("translation", [0, 0, 0])
    return matrix


def _visit(scene, node, parent, divisor):
    to_world = parent @ matrix(node)
    if "skin" in node or extension(node, "EXT_mesh_gpu_instancing"):
        raise Unsupported(f"node {node.get('name')}: skins and instancing")
    if "mesh" in node:
        for primitive in scene.document["meshes"][node["mesh"]]["primitives"]:
            scene.meshes.append(_mesh(scene, node, primitive, to_world))
    if "camera" in node:
        scene.cameras.append(_camera(scene, node, to_world))
    light = extension(node, "KHR_lights_punctual")
    if light is not None:
        scene.lights.append(_light(scene, node, light["light"], to_world, divisor))
    for child in node.get("children", []):
        _visit(scene, scene.document["nodes"][child], to_world, divisor)


def _mesh(scene, node, primitive, to_world):
    name = node.get("name", "mesh")
    if primitive.get("mode", 4) != 4 or "targets" in primitive:
        raise Unsupported(f"{name}: only triangles without morph targets")
    attributes = primitive["attributes"]
    if "COLOR_0" in attributes:
        scene.lose(f"{name}: vertex colours are left out")
    if extras(node).get("visible"):
        scene.lose(f"{name}: it is visible to everything")
    positions = accessor(scene, attributes["POSITION"]).astype(float)
    count = len(positions)
    if "indices" in primitive:
        triangles = accessor(scene, primitive["indices"]).astype(np.uint32).reshape(-1, 3)
    else:
        triangles = np.arange(count - count % 3, dtype=np.uint32).reshape(-1, 3)
    linear = to_world[:3, :3]
    normals = None
    if "NORMAL" in attributes:
        normals = accessor(scene, attributes["NORMAL"]).astype(float) @ np.linalg.inv(linear)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    if np.linalg.det(linear) < 0:
        triangles = triangles[:, [0, 2, 1]]
    uvs = accessor(scene, attributes["TEXCOORD_0"]).astype(float) if "TEXCOORD_0" in attributes else None
    return Mesh(name, primitive.get("material"), positions @ linear.T + to_world[:3, 3], normals, uvs, triangles)


def _camera(scene, node, to_world):
    raw = scene.document["cameras"][node["camera"]]
    if raw["type"] != "perspective":
        raise Unsupported("orthographic cameras")
    said = {**extras(raw), **extras(node)}
    if any(said.get("shift", [])):
        scene.lose(f"camera {node.get('name')}: its shift is left out")
    perspective = raw["perspective"]
    return Camera(
        node.get("name", ""),
        to_world,
        perspective["yfov"],
        perspective.get("aspectRatio", 16 / 9),
        said.get("aperture_radius", 0.0),
        said.get("focus_distance", 1.0),
    )


def _light(scene, node, index, to_world, divisor):
    raw = scene.document["extensions"]["KHR_lights_punctual"]["lights"][index]
    said = {**extras(raw), **extras(node)}
    spot = raw.get("spot", {})
    intensity = np.array(raw.get("color", [1, 1, 1]), float) * raw.get("intensity", 1.0) / divisor
    return Light(
        raw["type"],
        to_world,
        intensity,
        spot.get("innerConeAngle", 0.0),
        spot.get("outerConeAngle", np.pi / 4),
        said.get("radius", 0.0),
        np.radians(said.get("angle_deg", 0.0)),
    )


def is_closed(mesh):
    """Whether two triangles of opposite winding share each edge, with vertices merged by position."""
    _, ids = np.unique(mesh.positions.astype(np.float32) + np.float32(0), axis=0, return_inverse=True)
    corners = ids.ravel()[mesh.triangles]
    corners = corners[(corners != np.roll(corners, 1, axis=1)).all(axis=1)].astype(np.int64)
    edges = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]])
    size = int(edges.max(initial=0)) + 1
    forth, back = np.sort(edges @ [size, 1]), np.sort(edges @ [1, size])
    return len(edges) > 0 and len(np.unique(forth)) == len(forth) and bool((forth == back).all())
