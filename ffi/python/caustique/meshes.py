"""What a scene is made of, as numpy arrays and numbers: everything that `Scene.from_meshes` takes.

Lengths are metres, angles degrees, colours scene-linear Rec. 709; the world is right-handed with y up.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

Triple = Sequence[float]


@dataclass(kw_only=True)
class Medium:
    """A homogeneous medium."""

    #: Absorption coefficient, 1/m, per channel.
    sigma_a: Triple = (0.0, 0.0, 0.0)
    #: Scattering coefficient, 1/m, per channel.
    sigma_s: Triple = (0.0, 0.0, 0.0)
    #: Mean cosine of the Henyey-Greenstein phase function, between -1 and 1.
    g: float = 0.0


@dataclass(kw_only=True, eq=False)
class Material:
    """A surface as glTF describes it. Matte white unless told otherwise."""

    name: str = "material"
    #: Reflectance (r, g, b); of glass the tint.
    base_color: Triple = (1.0, 1.0, 1.0)
    #: (H, W, 3) uint8, sRGB, the top row first; multiplies base_color. The mesh needs uvs.
    base_color_texture: ArrayLike | None = None
    #: 0 dielectric, 1 conductor.
    metallic: float = 0.0
    #: Perceptual roughness, 0 to 1; the GGX alpha is its square.
    roughness: float = 1.0
    #: Strength of a dielectric's reflection, 0 to 1; 0 makes a matte surface Lambertian.
    specular: float = 1.0
    #: Share of light that is transmitted, 0 to 1: 1 is glass.
    transmission: float = 0.0
    #: Index of refraction, from 1 up.
    ior: float = 1.5
    #: Transmits as a thin pane, which bends no light; otherwise the mesh is the boundary of a solid and must be closed.
    thin: bool = False
    #: What fills the solid.
    medium: Medium | None = None
    #: 20 over the Abbe number; 0 is none.
    dispersion: float = 0.0
    #: Emitted radiance, W/(sr m2) per channel, from the front.
    emission: Triple = (0.0, 0.0, 0.0)
    #: Emits from its back, too; otherwise cameras look through the back of a surface that emits.
    double_sided: bool = False


@dataclass(kw_only=True, eq=False)
class Mesh:
    """Triangles that wear one material."""

    #: Positions (V, 3), m.
    vertices: ArrayLike
    #: Indices (T, 3) of vertices, counter-clockwise seen from the front.
    triangles: ArrayLike
    material: Material = field(default_factory=Material)
    #: Shading normals (V, 3); None: flat faces.
    normals: ArrayLike | None = None
    #: Texture coordinates (V, 2), v downwards.
    uvs: ArrayLike | None = None
    #: Mesh to world (4, 4), for column vectors.
    transform: ArrayLike | None = None
    name: str = "mesh"
    #: The layers LightGroup_NAME and Caustic_NAME that its light goes to.
    light_group: str | None = None


@dataclass(kw_only=True, eq=False)
class Camera:
    """A perspective camera."""

    position: Triple = (0.0, 0.0, 1.0)
    #: A point in the middle of the picture.
    target: Triple = (0.0, 0.0, 0.0)
    up: Triple = (0.0, 1.0, 0.0)
    #: Vertical field of view, degrees.
    fov: float = 40.0
    #: Width over height of a picture of which one of the two is asked for.
    aspect: float | None = None
    #: Radius of the thin lens, m; 0 is a pinhole.
    aperture_radius: float = 0.0
    #: Distance in focus, m; None: the target's.
    focus_distance: float | None = None
    name: str = "camera"


@dataclass(kw_only=True, eq=False)
class PointLight:
    """A light that shines alike in all directions."""

    position: Triple
    #: Radiant intensity, W/sr per channel.
    intensity: Triple
    #: Radius of the sphere that it is, m; 0 is a mathematical point.
    radius: float = 0.0
    name: str = "point"
    light_group: str | None = None


@dataclass(kw_only=True, eq=False)
class SpotLight:
    """A light that shines into a cone."""

    position: Triple
    target: Triple
    #: Radiant intensity in the middle, W/sr per channel.
    intensity: Triple
    #: Half angle of full intensity, degrees.
    inner: float = 0.0
    #: Half angle of no intensity, degrees.
    outer: float = 45.0
    #: Radius of the disc that it shines from, m.
    radius: float = 0.0
    name: str = "spot"
    light_group: str | None = None


@dataclass(kw_only=True, eq=False)
class SunLight:
    """A light from infinity."""

    #: Where its light travels to.
    direction: Triple
    #: Irradiance on a surface that faces it, W/m2 per channel.
    irradiance: Triple
    #: Angle of the whole disc, degrees.
    angle: float = 0.0
    name: str = "sun"
    light_group: str | None = None


Light = PointLight | SpotLight | SunLight


def looking(position: ArrayLike, target: ArrayLike, up: ArrayLike = (0.0, 1.0, 0.0)) -> np.ndarray:
    """A pose (4, 4) at `position` that looks along its -Z to `target`."""
    position, target = np.asarray(position, float), np.asarray(target, float)
    back = position - target
    length = np.linalg.norm(back)
    if not length > 0.0:
        raise ValueError(f"position and target are the same point: {position.tolist()}")
    back /= length
    right = np.cross(np.asarray(up, float), back)
    if np.linalg.norm(right) < 1e-9:
        # Straight up or down: any other axis tells which way the picture is turned.
        right = np.cross((0.0, 0.0, -1.0) if abs(back[2]) < 0.9 else (0.0, 1.0, 0.0), back)
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2], pose[:3, 3] = right, np.cross(back, right), back, position
    return pose
