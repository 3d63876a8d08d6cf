"""Writes the small scenes of the comparison with Mitsuba as .glb files. A path tracer finds all of their light.

glass     smooth glass, clear and absorbing, smooth matte, a mirror; a large light and a uniform environment
frosted   rough glass: a sphere and a slab in front of a pattern; a light and a uniform environment
metal     rough metals under a rotated environment image; instances with non-uniform scale; a thin lens
textures  colours, roughness and metalness from textures, every wrap mode, KHR_texture_transform; point, spot and sun
wide      metals and glass so rough that the models of the two renderers differ
"""

import json
import struct
import sys
from pathlib import Path

import numpy as np
import OpenEXR
import tiles


class Glb:
    """A glTF document under construction."""

    def __init__(self):
        self.binary = bytearray()
        self.document = {
            "asset": {"version": "2.0", "generator": "scripts/lab/compare_scenes.py"},
            "scene": 0,
            "scenes": [{"nodes": []}],
            "nodes": [],
            "meshes": [],
            "materials": [],
            "accessors": [],
            "bufferViews": [],
            "images": [],
            "textures": [],
            "samplers": [],
        }
        self.used = set()

    def add(self, key, part):
        """Appends a part to a list of the document; returns its index."""
        self.document.setdefault(key, []).append(part)
        return len(self.document[key]) - 1

    def view(self, data):
        """Adds a buffer view of bytes."""
        self.binary += b"\0" * (-len(self.binary) % 4)
        self.binary += data
        return self.add(
            "bufferViews", {"buffer": 0, "byteOffset": len(self.binary) - len(data), "byteLength": len(data)}
        )

    def accessor(self, values, kind, component):
        """Adds an accessor of an array."""
        part = {
            "bufferView": self.view(values.tobytes()),
            "componentType": component,
            "count": values.size if kind == "SCALAR" else len(values),
            "type": kind,
        }
        if kind == "VEC3":
            part.update(min=values.min(axis=0).tolist(), max=values.max(axis=0).tolist())
        return self.add("accessors", part)

    def mesh(self, shape, material):
        """Adds a mesh of one material; `shape` is (positions, normals, uvs or None, triangles)."""
        positions, normals, uvs, triangles = shape
        attributes = {
            "POSITION": self.accessor(positions.astype("<f4"), "VEC3", 5126),
            "NORMAL": self.accessor(normals.astype("<f4"), "VEC3", 5126),
        }
        if uvs is not None:
            attributes["TEXCOORD_0"] = self.accessor(uvs.astype("<f4"), "VEC2", 5126)
        indices = self.accessor(triangles.astype("<u2").ravel(), "SCALAR", 5123)
        return self.add(
            "meshes", {"primitives": [{"attributes": attributes, "indices": indices, "material": material}]}
        )

    def node(self, parent=None, **node):
        """Adds a node below a parent node, or below the scene."""
        index = self.add("nodes", node)
        above = (
            self.document["scenes"][0]["nodes"]
            if parent is None
            else self.document["nodes"][parent].setdefault("children", [])
        )
        above.append(index)
        return index

    def material(
        self, name, color=(0.8, 0.8, 0.8), roughness=1.0, metallic=0.0, texture=None, surface=None, **extensions
    ):
        """Adds a material; extensions are named without KHR_materials_."""
        pbr = {"baseColorFactor": [*color, 1.0], "roughnessFactor": roughness, "metallicFactor": metallic}
        if texture is not None:
            pbr["baseColorTexture"] = texture
        if surface is not None:
            pbr["metallicRoughnessTexture"] = surface
        part = {"name": name, "pbrMetallicRoughness": pbr}
        if extensions:
            part["extensions"] = {"KHR_materials_" + key: value for key, value in extensions.items()}
            self.used |= set(part["extensions"])
        return self.add("materials", part)

    def matte(self, name, color=(0.8, 0.8, 0.8), **more):
        """Adds a Lambertian material without a Fresnel layer."""
        return self.material(name, color, specular={"specularFactor": 0.0}, **more)

    def glass(self, name, roughness=0.0, ior=1.5, color=(1, 1, 1), **volume):
        """Adds a material of solid glass."""
        return self.material(
            name,
            color,
            roughness,
            ior={"ior": ior},
            transmission={"transmissionFactor": 1.0},
            volume={"thicknessFactor": 0.1, **volume},
        )

    def lamp(self, name, radiance):
        """Adds a black emitter."""
        strength = max(radiance)
        index = self.matte(name, (0, 0, 0), emissive_strength={"emissiveStrength": strength})
        self.document["materials"][index]["emissiveFactor"] = [c / strength for c in radiance]
        return index

    def texture(self, pixels, wrap=10497, scale=None, offset=None, rotation=None):
        """A texture reference to an image of display values in [0, 1], top row first."""
        encoded = tiles.png(pixels)
        image = self.add("images", {"bufferView": self.view(encoded), "mimeType": "image/png"})
        sampler = self.add("samplers", {"magFilter": 9729, "minFilter": 9729, "wrapS": wrap, "wrapT": wrap})
        info = {"index": self.add("textures", {"source": image, "sampler": sampler})}
        transform = {k: v for k, v in (("scale", scale), ("offset", offset), ("rotation", rotation)) if v is not None}
        if transform:
            self.used.add("KHR_texture_transform")
            info["extensions"] = {"KHR_texture_transform": transform}
        return info

    def camera(self, at, to, yfov=0.6, aspect=4 / 3, **extras):
        """Adds a camera with its `extras.caustique`."""
        part = {"type": "perspective", "perspective": {"yfov": yfov, "aspectRatio": aspect, "znear": 0.01}}
        if extras:
            part["extras"] = {"caustique": extras}
        self.node(name="eye", camera=self.add("cameras", part), matrix=look(at, to))

    def light(self, kind, at, to, **light):
        """Adds a punctual light."""
        extras = {key: light.pop(key) for key in ("radius", "angle_deg") if key in light}
        extension = self.document.setdefault("extensions", {}).setdefault("KHR_lights_punctual", {"lights": []})
        extension["lights"].append({"type": kind, **light})
        self.used.add("KHR_lights_punctual")
        node = {"extensions": {"KHR_lights_punctual": {"light": len(extension["lights"]) - 1}}, "matrix": look(at, to)}
        if extras:
            node["extras"] = {"caustique": extras}
        self.node(name=kind, **node)

    def extras(self, **keys):
        """Sets keys in `extras.caustique` of the scene."""
        self.document["scenes"][0].setdefault("extras", {}).setdefault("caustique", {}).update(keys)

    def write(self, path):
        """Writes the file."""
        self.document["extensionsUsed"] = sorted(self.used)
        self.document["buffers"] = [{"byteLength": len(self.binary)}]
        for key in [k for k, v in self.document.items() if v == []]:
            del self.document[key]
        text = json.dumps(self.document).encode()
        text += b" " * (-len(text) % 4)
        binary = bytes(self.binary) + b"\0" * (-len(self.binary) % 4)
        body = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
        path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body)


def look(at, to):
    """The matrix (column-major) of a node at `at` whose -Z points to `to`."""
    at, to = np.array(at, float), np.array(to, float)
    z = (at - to) / np.linalg.norm(at - to)
    x = np.cross([0.0, 1.0, 0.0] if abs(z[1]) < 0.99 else [1.0, 0.0, 0.0], z)
    x /= np.linalg.norm(x)
    matrix = np.eye(4)
    matrix[:3] = np.stack([x, np.cross(z, x), z, at], axis=1)
    return matrix.T.ravel().tolist()


def quad(corner, u, v):
    """A parallelogram whose front normal is u x v. Texture coordinates run from 0 to 1, v downwards from corner + v."""
    corner, u, v = (np.array(a, float) for a in (corner, u, v))
    normal = np.cross(u, v) / np.linalg.norm(np.cross(u, v))
    return (
        np.array([corner, corner + u, corner + u + v, corner + v]),
        np.tile(normal, (4, 1)),
        np.array([[0, 1], [1, 1], [1, 0], [0, 0]]),
        np.array([[0, 1, 2], [0, 2, 3]]),
    )


def box(low, high):
    """A box with flat faces."""
    low, size = np.array(low, float), np.array(high, float) - np.array(low, float)
    x, y, z = np.diag(size)
    faces = [
        quad(low, z, y),
        quad(low + x, y, z),
        quad(low, x, z),
        quad(low + y, z, x),
        quad(low, y, x),
        quad(low + z, x, y),
    ]
    return (
        *[np.concatenate([face[k] for face in faces]) for k in range(3)],
        np.concatenate([face[3] + 4 * i for i, face in enumerate(faces)]),
    )


def sphere(around=192, along=96):
    """The unit sphere, closed."""
    i, j = np.meshgrid(np.arange(around + 1), np.arange(along + 1))
    phi, theta = 2 * np.pi * (i % around) / around, np.pi * j / along
    sine = np.where((j == 0) | (j == along), 0.0, np.sin(theta))
    positions = np.stack([sine * np.cos(phi), np.cos(theta), -sine * np.sin(phi)], axis=-1).reshape(-1, 3)
    uvs = np.stack([i / around, j / along], axis=-1).reshape(-1, 2)
    a = (j[:-1, :-1] * (around + 1) + i[:-1, :-1]).ravel()
    b, c, d = a + 1, a + around + 1, a + around + 2
    triangles = np.concatenate([np.stack([a, c, d], axis=1), np.stack([a, d, b], axis=1)])
    p = positions[triangles]
    whole = np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1) > 1e-9
    return positions, positions, uvs, triangles[whole]


def pattern(size=64, seed=1, cells=8, low=0.15, high=0.9):
    """Coloured tiles with soft edges."""
    colors = np.random.default_rng(seed).uniform(low, high, (cells, cells, 3))
    fine = np.kron(colors, np.ones((size // cells, size // cells, 1)))
    return (fine + np.roll(fine, 1, 0) + np.roll(fine, 1, 1) + np.roll(fine, (1, 1), (0, 1))) / 4


def room(g, floor, walls, wide=1.5, high=2.0):
    """Floor, back wall, side walls; open to the front and above. `walls`: three materials."""
    w, h = wide, high
    for name, shape, material in (
        ("floor", quad([-w, 0, w], [2 * w, 0, 0], [0, 0, -2 * w]), floor),
        ("back", quad([-w, 0, -w], [2 * w, 0, 0], [0, h, 0]), walls[0]),
        ("left", quad([-w, 0, w], [0, 0, -2 * w], [0, h, 0]), walls[1]),
        ("right", quad([w, 0, -w], [0, 0, 2 * w], [0, h, 0]), walls[2]),
    ):
        g.node(name=name, mesh=g.mesh(shape, material))


def lamp_above(g, radiance, half=0.8, high=2.0):
    """A square lamp that shines down."""
    g.node(
        name="lamp",
        mesh=g.mesh(quad([-half, high, -half], [2 * half, 0, 0], [0, 0, 2 * half]), g.lamp("lamp", radiance)),
    )


def ball(g, name, material, at, radius, shape=None, **more):
    """A sphere on a node."""
    mesh = g.mesh(shape or sphere(), material)
    g.node(name=name, mesh=mesh, translation=list(at), scale=[radius] * 3, **more)


def glass(folder):
    """Builds the comparison scene of glass with smooth interfaces."""
    g = Glb()
    g.extras(environment={"color": [0.35, 0.4, 0.5]})
    white = g.matte("white", (0.7, 0.7, 0.68))
    room(
        g,
        g.matte("floor", (1, 1, 1), texture=g.texture(pattern())),
        [white, g.matte("red", (0.6, 0.1, 0.08)), g.matte("green", (0.12, 0.45, 0.15))],
    )
    lamp_above(g, (9, 8, 6.5))
    ball(g, "clear", g.glass("clear"), (-0.55, 0.46, 0.35), 0.45)
    ball(
        g,
        "dense",
        g.glass("dense", ior=1.8, attenuationColor=[0.35, 0.75, 0.9], attenuationDistance=0.5),
        (0.6, 0.41, 0.5),
        0.4,
    )
    ball(g, "glazed", g.material("glazed", (0.75, 0.35, 0.1), 0.0), (0.1, 0.36, -0.6), 0.35)
    ball(g, "mirror", g.material("mirror", (0.95, 0.8, 0.6), 0.0, 1.0), (-0.95, 0.5, -0.8), 0.5)
    g.camera((0.3, 1.5, 4.6), (0, 0.72, 0), 0.5)
    g.write(folder / "glass.glb")


def frosted(folder):
    """Builds the comparison scene of rough glass."""
    g = Glb()
    g.extras(environment={"color": [0.5, 0.5, 0.55]})
    white = g.matte("white", (0.75, 0.73, 0.7))
    back = g.matte("pattern", (1, 1, 1), texture=g.texture(pattern(seed=5)))
    room(g, white, [back, g.matte("blue", (0.15, 0.25, 0.6)), g.matte("sand", (0.7, 0.55, 0.3))])
    lamp_above(g, (8, 8, 8))
    ball(g, "frosted", g.glass("frosted", 0.25), (-0.5, 0.51, 0.3), 0.5)
    g.node(
        name="slab",
        mesh=g.mesh(box((-0.4, 0, -0.05), (0.4, 1.1, 0.05)), g.glass("slab", 0.2, 1.45, (0.8, 0.95, 0.9))),
        translation=[0.65, 0.01, 0.1],
        rotation=[0, -0.2588190451, 0, 0.9659258263],
    )
    g.camera((0.2, 1.2, 4.4), (0, 0.75, 0), 0.5)
    g.write(folder / "frosted.glb")


def sky(path):
    """Writes a soft sky (horizon, ground and a glow) as an environment image of 64 x 32 pixels."""
    v, u = np.mgrid[0:32, 0:64]
    theta, phi = np.pi * (v + 0.5) / 32, 2 * np.pi * ((u + 0.5) / 64 - 0.5)
    d = np.stack([np.sin(theta) * np.cos(phi), np.cos(theta), np.sin(theta) * np.sin(phi)], axis=-1)
    up = np.clip(d[..., 1:2], 0, 1)
    image = np.where(d[..., 1:2] > 0, [0.9, 0.95, 1.0] * (1 - up) + [0.25, 0.45, 0.9] * up, [0.3, 0.25, 0.2])
    glow = np.array([0.6, 0.5, 0.62])
    image = image + [9, 7, 5] * np.exp(18 * (d @ (glow / np.linalg.norm(glow)) - 1))[..., None]
    image[:, 40:43] += [0.8, 0.1, 0.1]
    channels = {c: np.ascontiguousarray(image[..., k], np.float32) for k, c in enumerate("RGB")}
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, channels).write(str(path))


def metal(folder):
    """Rough metal under an environment image."""
    g = Glb()
    sky(folder / "metal.environment.exr")
    g.extras(environment={"file": "metal.environment.exr", "rotation_deg": 50.0, "strength": 1.2})
    floor = g.matte(
        "floor", (0.8, 0.8, 0.8), texture=g.texture(pattern(seed=3), scale=[2.0, 1.5], rotation=0.4, offset=[0.1, 0.3])
    )
    g.node(name="floor", mesh=g.mesh(quad([-3, 0, 3], [6, 0, 0], [0, 0, -6]), floor))
    shape = sphere()
    group = g.node(name="group", rotation=[0, 0.2588190451, 0, 0.9659258263], translation=[0, 0.02, 0])
    for name, color, roughness, at, scale in (
        ("gold", (1.0, 0.77, 0.34), 0.2, (-1.0, 0.4, 0.3), (0.4, 0.4, 0.4)),
        ("copper", (0.95, 0.64, 0.54), 0.35, (0.0, 0.5, -0.3), (0.5, 0.5, 0.5)),
        ("steel", (0.56, 0.57, 0.58), 0.4, (0.9, 0.3, 0.4), (0.5, 0.3, 0.35)),
    ):
        mesh = g.mesh(shape, g.material(name, color, roughness, 1.0))
        g.node(group, name=name, mesh=mesh, translation=list(at), scale=list(scale))
        if name == "gold":
            g.node(group, name="small", mesh=mesh, translation=[0.1, 0.15, 0.75], scale=[0.15, 0.15, 0.15])
            g.node(group, name="mirrored", mesh=mesh, translation=[-0.4, 0.15, 0.75], scale=[-0.15, 0.15, 0.2])
    g.camera((0.0, 1.3, 3.6), (0, 0.35, 0), 0.5, aperture_radius=0.02, focus_distance=3.4)
    g.write(folder / "metal.glb")


def textures(folder):
    """Builds the comparison scene of textures and point lights."""
    g = Glb()
    g.extras(light_units="photometric", environment={"color": [1.0, 1.05, 1.15]})
    mirrored = g.texture(pattern(seed=7), wrap=33648, scale=[3, 3])
    clamped = g.texture(pattern(seed=8), wrap=33071, scale=[1.6, 1.4], offset=[-0.3, -0.2])
    turned = g.texture(pattern(seed=9), scale=[2, 2], rotation=0.7)
    half = g.material("right", (0.5, 0.7, 0.8), 0.5, specular={"specularFactor": 0.5})
    room(
        g,
        g.matte("floor", (1, 1, 1), texture=mirrored),
        [g.matte("back", (0.9, 0.9, 0.9), texture=clamped), g.matte("left", (0.8, 0.6, 0.5)), half],
    )
    surface = pattern(seed=11, cells=4)
    surface[..., 1] = 0.2 + 0.12 * surface[..., 1]
    surface[..., 2] = 1.0
    brushed = g.material("brushed", (0.9, 0.8, 0.6), 1.0, 1.0, surface=g.texture(surface, scale=[4, 2]))
    ball(g, "brushed", brushed, (-0.7, 0.41, 0.2), 0.4)
    mixed = pattern(seed=12, cells=4, low=0.0, high=1.0)
    mixed[..., 1] = 1.0
    patina = g.material("patina", (0.7, 0.5, 0.35), 0.3, 1.0, surface=g.texture(mixed, scale=[4, 2]))
    ball(g, "patina", patina, (0.75, 0.41, 0.1), 0.4)
    g.node(
        name="crate",
        mesh=g.mesh(box((-0.3, 0, -0.3), (0.3, 0.6, 0.3)), g.material("crate", (1, 1, 1), 0.4, texture=turned)),
        translation=[0, 0.01, -0.6],
        rotation=[0, 0.1736481777, 0, 0.9848077530],
    )
    ball(g, "glazed", g.material("glazed", (1, 1, 1), 0.3, texture=turned), (0.1, 0.26, 0.65), 0.25)
    g.light("point", (-1.0, 1.7, 0.8), (0, 0, 0), color=[1, 0.9, 0.8], intensity=800.0)
    g.light("point", (1.0, 2.4, 1.3), (0, 0, 0), color=[0.7, 0.8, 1], intensity=300.0, radius=0.3)
    g.light(
        "spot",
        (0.2, 2.6, 1.5),
        (0.3, 1.3, -1.5),
        color=[1, 1, 1],
        intensity=5000.0,
        spot={"innerConeAngle": 0.15, "outerConeAngle": 0.1501},
    )
    g.light("directional", (1, 3, 2.5), (0, 0, 0), color=[1, 0.95, 0.85], intensity=500.0, angle_deg=25.0)
    g.camera((0.1, 1.3, 4.2), (0, 0.65, 0), 0.5)
    g.write(folder / "textures.glb")


def wide(folder):
    """Builds the comparison scene of rough metal and glass."""
    g = Glb()
    g.extras(environment={"color": [1.0, 1.0, 1.0]})
    g.node(name="floor", mesh=g.mesh(quad([-3, 0, 3], [6, 0, 0], [0, 0, -6]), g.matte("floor", (0.5, 0.5, 0.5))))
    for i, roughness in enumerate((0.5, 0.7, 1.0)):
        ball(
            g,
            f"metal {i}",
            g.material(f"metal {i}", (1.0, 0.8, 0.4), roughness, 1.0),
            (1.1 * (i - 1), 0.46, -0.7),
            0.45,
        )
        ball(g, f"glass {i}", g.glass(f"glass {i}", roughness), (0.95 * (i - 1), 0.41, 0.5), 0.4)
    g.camera((0, 1.6, 4.4), (0, 0.45, 0), 0.5)
    g.write(folder / "wide.glb")


ALL = (glass, frosted, metal, textures, wide)


def main():
    """Writes all comparison scenes into the folder that the command line names."""
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for make in ALL:
        make(folder)


if __name__ == "__main__":
    main()
