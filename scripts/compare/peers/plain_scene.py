"""Simplifies a scene for LuxCore and Cycles: four kinds of materials with a clear coat. Where a renderer asks for it, lamps
with size become meshes, and suns pixels of the environment.

Unsupported features are listed: `blockers` make a comparison meaningless; for `approximations` the mean of the picture
shows how much they matter. Mitsuba does not need this module: mitsuba_world.py converts scenes directly.
"""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

import gltf
import pictures

#: Width in pixels of an environment with a sun's disc: half a degree is three pixels.
SUN_MAP_WIDTH = 2048
#: Extensions of materials that the four kinds support.
SUPPORTED = {
    "KHR_materials_clearcoat",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_volume",
}


@dataclass
class Material:
    """A surface. `kind` is glass, metal, matte (Lambertian), or coated (a matte base below a dielectric interface)."""

    name: str
    kind: str
    base: np.ndarray
    roughness: float
    ior: float = 1.5
    #: Scale of the interface's reflectance.
    specular: float = 1.0
    #: Radiance that the front emits.
    emission: np.ndarray = field(default_factory=lambda: np.zeros(3))
    #: Absorption inside, per unit of length.
    absorption: np.ndarray = field(default_factory=lambda: np.zeros(3))
    #: An encoded image that replaces `base`.
    texture: bytes | None = None
    #: Share of the surface that has a clear coat with an index of refraction of 1.5.
    coat: float = 0.0
    #: Roughness of the coat.
    coat_roughness: float = 0.0


class Scene:
    """A simplified glTF file.

    meshes: pairs of a gltf.Mesh and a Material; lights: point lights and suns; camera: a gltf.Camera; environment:
    (height, width, 3), rows from the top, u = atan2(x, -z) / 2 pi, or None. `lamps`: whether point lights with size are
    "lamps" or "meshes"; `suns`: whether suns with a disc are "lamps" or "pixels" of the environment.
    """

    def __init__(self, path, camera=None, lamps="meshes", suns="pixels"):
        self.path, self.sized_lamps, self.sized_suns = Path(path), lamps == "lamps", suns == "lamps"
        self.meshes, self.lights, self.camera, self.environment = [], [], None, None
        self.blockers, self.approximations = [], []
        try:
            scene = gltf.read(path, known=SUPPORTED)
        except gltf.Unsupported as unsupported:
            self.blockers.append(str(unsupported))
            return
        self.document = scene.document
        cameras = [of for of in scene.cameras if camera in (None, of.name)]
        if cameras:
            self.camera = cameras[0]
        else:
            self.blockers.append("no camera" if camera is None else f'no camera "{camera}"')
        if scene.medium:
            self.blockers.append("a medium fills the space")
        self._meshes(scene)
        suns = self._lights(scene)
        self.environment = self._environment(scene, suns)

    def _note(self, where, text):
        if text not in where:
            where.append(text)

    def _meshes(self, scene):
        known = {}
        for mesh in scene.meshes:
            if mesh.material not in known:
                raw = {} if mesh.material is None else self.document["materials"][mesh.material]
                known[mesh.material] = self._material(scene, mesh, raw)
            self.meshes.append((mesh, known[mesh.material]))

    def _material(self, scene, mesh, raw):
        name = f'material "{raw.get("name", "")}"'
        surface, extensions = raw.get("pbrMetallicRoughness", {}), raw.get("extensions", {})
        self._faults(raw, surface, extensions, name)
        transmission = extensions.get("KHR_materials_transmission", {}).get("transmissionFactor", 0)
        metallic = surface.get("metallicFactor", 1.0)
        specular = extensions.get("KHR_materials_specular", {})
        strength = specular.get("specularFactor", 1.0)
        if transmission not in (0, 1) or metallic not in (0, 1):
            self._note(self.blockers, f"{name}: partly metal or glass")
        kind = "metal" if metallic else "glass" if transmission else "coated" if strength else "matte"
        made = Material(
            name,
            kind,
            np.array(surface.get("baseColorFactor", [1, 1, 1])[:3], float),
            surface.get("roughnessFactor", 1.0),
            extensions.get("KHR_materials_ior", {}).get("ior", 1.5),
        )
        glow = extensions.get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1.0)
        made.emission = np.array(raw.get("emissiveFactor", [0, 0, 0]), float) * glow
        if kind == "coated":
            made.specular = strength
            if list(specular.get("specularColorFactor", [1, 1, 1])) != [1, 1, 1]:
                self._note(self.approximations, f"{name}: its shine without a colour")
            self._note(self.approximations, "gloss is coupled with the layer below it by another model")
        if kind == "glass":
            made.absorption = self._absorption(mesh, raw, name)
        coat = extensions.get("KHR_materials_clearcoat", {})
        made.coat, made.coat_roughness = coat.get("clearcoatFactor", 0.0), coat.get("clearcoatRoughnessFactor", 0.0)
        if made.coat:
            self._note(self.approximations, "a clear coat is coupled with the layers below it by another model")
            if kind == "glass":
                self._note(self.blockers, f"{name}: a clear coat on glass")
        if made.emission.any() and raw.get("doubleSided"):
            self._note(self.approximations, f"{name} shines from its front only")
        if "baseColorTexture" in surface:
            made.texture = scene.image(surface["baseColorTexture"]["index"])[0]
        return made

    def _faults(self, raw, surface, extensions, name):
        """Returns texts on the features of a material that no `Surface` can hold."""
        strange = sorted(set(extensions) - SUPPORTED)
        textures = [key for key in ("normalTexture", "emissiveTexture") if key in raw]
        textures += [key for key in ("metallicRoughnessTexture",) if key in surface]
        for extension in extensions.values():
            textures += [key for key in extension if key.endswith("Texture")]
        base = surface.get("baseColorTexture") or {}
        faults = [*strange, *textures, *gltf.extras(raw)]
        if raw.get("alphaMode", "OPAQUE") != "OPAQUE":
            faults.append("cut-outs")
        if base.get("texCoord") or base.get("extensions"):
            faults.append("a texture that is placed anew")
        if base and surface.get("baseColorFactor", [1, 1, 1])[:3] != [1, 1, 1]:
            faults.append("a texture with a factor")
        if faults:
            self._note(self.blockers, f"{name}: {', '.join(faults)}")

    def _absorption(self, mesh, raw, name):
        volume = gltf.extension(raw, "KHR_materials_volume")
        solid = gltf.is_closed(mesh) if volume is None else volume.get("thicknessFactor", 0.0) > 0.0
        if not solid:
            self._note(self.blockers, f"{name}: thin panes")
        color = np.array((volume or {}).get("attenuationColor", [1, 1, 1]), float)
        return -np.log(np.maximum(color, 1e-6)) / (volume or {}).get("attenuationDistance", np.inf)

    def _lights(self, scene):
        """Keep lamps that the renderer has, convert those with a size to balls, and return the suns with a disc."""
        suns = []
        for light in scene.lights:
            if light.kind == "spot":
                self._note(self.blockers, "spots")
            elif light.kind == "point" and light.radius and not self.sized_lamps:
                self.meshes.append(ball(light))
            elif light.kind == "directional" and light.angle and not self.sized_suns:
                suns.append(light)
            else:
                self.lights.append(light)
        return suns

    def _environment(self, scene, suns):
        said, image = scene.environment or {}, None
        if "file" in said:
            file = self.path.parent / said["file"]
            if file.suffix != ".exr":
                self._note(self.blockers, f"an environment that is no EXR: {file.name}")
                return None
            image = pictures.read(file) * np.float32(said.get("strength", 1.0))
        elif max(said.get("color", [0])) > 0:
            image = np.full((32, 64, 3), said["color"], np.float32) * np.float32(said.get("strength", 1.0))
        if image is None and not suns:
            return None
        if image is None:
            image = np.zeros((32, 64, 3), np.float32)
        height, width = image.shape[:2]
        if suns:
            height, width = max(SUN_MAP_WIDTH // 2, height), max(SUN_MAP_WIDTH, width)
        # caustique: u = 1/2 + atan2(z, x) / 2 pi, a quarter turn further. A counter-clockwise rotation increases u.
        u = (np.arange(width) + 0.5) / width + 0.25 + said.get("rotation_deg", 0.0) / 360
        image = pictures.sample(image, u, (np.arange(height) + 0.5) / height)
        for sun in suns:
            toward = sun.to_world[:3, 2] / np.linalg.norm(sun.to_world[:3, 2])
            image += disc(toward, sun.angle / 2, sun.intensity, height, width)
            self._note(self.approximations, "the sun is a few pixels of the environment")
        return image


def ball(light):
    """A lamp's sphere as a mesh with the lamp's power. A convex body shows a quarter of its surface on average."""
    points, triangles = icosphere(1)
    corners = points[triangles] * light.radius
    surface = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2
    mesh = gltf.Mesh("lamp", None, points * light.radius + light.to_world[:3, 3], points, None, triangles)
    return mesh, Material("lamp", "matte", np.zeros(3), 1.0, emission=light.intensity / (surface / 4))


def disc(toward, radius, irradiance, height, width, fine=8):
    """Returns a picture of the sky, on the grid of `Scene.environment`, that holds a sun: a disc of angular `radius`
    around a direction, with a given irradiance."""
    v = (np.arange(height * fine) + 0.5) / (height * fine) * np.pi
    rows = np.abs(v - np.arccos(np.clip(toward[1], -1, 1))) < radius + np.pi / height
    rows = np.repeat(rows.reshape(height, fine).any(1), fine)
    a = (np.arange(width * fine) + 0.5) / (width * fine) * 2 * np.pi
    polar = v[rows][:, None]
    cosine = np.sin(polar) * (np.sin(a) * toward[0] - np.cos(a) * toward[2]) + np.cos(polar) * toward[1]
    inside = np.zeros((height, width))
    inside[rows.reshape(height, fine)[:, 0]] = (cosine > np.cos(radius)).reshape(-1, fine, width, fine).mean((1, 3))
    solid = np.sin((np.arange(height) + 0.5) / height * np.pi)[:, None] * (np.pi / height) * (2 * np.pi / width)
    return (inside / max((inside * solid).sum(), 1e-30))[..., None] * irradiance


def icosphere(times):
    """Points and triangles of the unit sphere: an icosahedron, with each triangle split into four, `times` times."""
    golden = (1 + 5**0.5) / 2
    points = [[0, s, t * golden] for s in (-1, 1) for t in (-1, 1)]
    points = np.array([np.roll(p, k) for k in range(3) for p in points], float)
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    near = np.linalg.norm(points[:, None] - points[None], axis=2) < 1.1
    triples = [(i, j, k) for i in range(12) for j in range(i) for k in range(j)]
    triangles = [(i, j, k) for i, j, k in triples if near[i, j] and near[j, k] and near[i, k]]
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
