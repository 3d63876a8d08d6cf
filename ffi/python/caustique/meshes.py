"""Meshes, materials, lights and cameras as numpy arrays and numbers, for `Scene.from_meshes`.

Lengths are metres, angles degrees, colours scene-linear Rec. 709; the world is right-handed with y up.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, fields

import numpy as np
from numpy.typing import ArrayLike

Triple = Sequence[float]


@dataclass(kw_only=True, eq=False)
class Described:
    """What the classes below share: numbers and triples of numbers are checked where they are given."""

    def __post_init__(self):
        for item in fields(self):
            value = getattr(self, item.name)
            for kind, shape, expected in ((float, (), "a number"), (Triple, (3,), "three numbers")):
                if item.type is kind and not _are_numbers(value, shape):
                    raise TypeError(f"{type(self).__name__}: {item.name} is {expected}, not {value!r}")


def _are_numbers(value, shape: tuple) -> bool:
    """Whether a value is an array of numbers of this shape; () is a single number."""
    try:
        array = np.asarray(value)
    except ValueError:  # Its rows differ in length.
        return False
    return array.shape == shape and (array.dtype == bool or np.issubdtype(array.dtype, np.number))


@dataclass(kw_only=True)
class Medium(Described):
    """A medium, such as water, fog or smoke, that absorbs and scatters light."""

    #: Absorption coefficient, 1/m, per channel.
    sigma_a: Triple = (0.0, 0.0, 0.0)
    #: Scattering coefficient, 1/m, per channel.
    sigma_s: Triple = (0.0, 0.0, 0.0)
    #: Mean cosine of the Henyey-Greenstein phase function, between -1 and 1.
    g: float = 0.0
    #: Name of a .vol file, in the folder of the scene, with a grid of factors of both coefficients. A mesh has to be
    #: around it. None: the medium is homogeneous.
    density: str | None = None


@dataclass(kw_only=True, eq=False)
class Texture(Described):
    """An image on a surface, with its placement: (u, v) looks up offset + rotation * (scale * (u, v))."""

    #: (H, W, 3) or (H, W, 4) uint8, the top row first.
    pixels: ArrayLike
    #: Offset (u, v), in images.
    offset: Sequence[float] = (0.0, 0.0)
    #: Rotation, degrees, from u to v.
    rotation: float = 0.0
    #: Repetitions of the image along u and v.
    scale: Sequence[float] = (1.0, 1.0)
    #: Whether lookups take the nearest pixel, and do not interpolate.
    nearest: bool = False
    #: Behaviour outside the image: "repeat", "mirror" or "clamp".
    wrap: str = "repeat"


@dataclass(kw_only=True, eq=False)
class Material(Described):
    """A surface with the parameters of glTF. The default is matte white."""

    name: str = "material"
    #: Reflectance (r, g, b); of glass the tint.
    base_color: Triple = (1.0, 1.0, 1.0)
    #: (H, W, 3) uint8, sRGB, the top row first; multiplies base_color. The mesh needs uvs. A fourth channel is alpha.
    base_color_texture: ArrayLike | Texture | None = None
    #: Share of the surface that exists, 0 to 1: 0 is a hole.
    alpha: float = 1.0
    #: 0 dielectric, 1 conductor.
    metallic: float = 0.0
    #: Perceptual roughness, 0 to 1; the GGX alpha is its square.
    roughness: float = 1.0
    #: (H, W, 3) uint8: green multiplies roughness, blue multiplies metallic.
    metallic_roughness_texture: ArrayLike | Texture | None = None
    #: (H, W, 3) uint8: normals in tangent space, as in glTF.
    normal_texture: ArrayLike | Texture | None = None
    #: Roughness of diffuse reflection: 0 is Lambertian, 1 is clay or dust.
    diffuse_roughness: float = 0.0
    #: (H, W, 3) uint8: red multiplies diffuse_roughness, which is 1 if it is left at 0.
    diffuse_roughness_texture: ArrayLike | Texture | None = None
    #: Strength of a dielectric's reflection, 0 to 1; 0 makes a matte surface Lambertian.
    specular: float = 1.0
    #: Colour (r, g, b) of a dielectric's reflection.
    specular_color: Triple = (1.0, 1.0, 1.0)
    #: Share of light that is transmitted, 0 to 1: 1 is glass.
    transmission: float = 0.0
    #: Index of refraction, from 1 up.
    ior: float = 1.5
    #: Whether the mesh is a thin pane, which does not refract; otherwise it bounds a solid and must be closed.
    thin: bool = False
    #: The medium inside the solid.
    medium: Medium | None = None
    #: Whether rays pass through the surface unchanged. Its emission stays.
    null_bsdf: bool = False
    #: 20 divided by the Abbe number; 0 is no dispersion.
    dispersion: float = 0.0
    #: Strength of a clear coat, 0 to 1.
    clearcoat: float = 0.0
    #: Perceptual roughness of the clear coat, 0 to 1.
    clearcoat_roughness: float = 0.0
    #: Index of refraction of the clear coat, and the colour (r, g, b) of light that passes it in and out.
    coat_ior: float = 1.5
    coat_color: Triple = (1.0, 1.0, 1.0)
    #: (H, W, 3) uint8: the index is 1 + (coat_ior - 1) times red.
    coat_ior_texture: ArrayLike | Texture | None = None
    #: (H, W, 3) uint8, sRGB; multiplies coat_color.
    coat_color_texture: ArrayLike | Texture | None = None
    #: Share of the surface that a thin film covers, 0 to 1, its index of refraction and its thickness, nm.
    iridescence: float = 0.0
    iridescence_ior: float = 1.3
    iridescence_thickness: float = 400.0
    #: (H, W, 3) uint8: red multiplies iridescence.
    iridescence_texture: ArrayLike | Texture | None = None
    #: (H, W, 3) uint8: green mixes iridescence_thickness_minimum, nm, where it is 0, and iridescence_thickness.
    iridescence_thickness_texture: ArrayLike | Texture | None = None
    iridescence_thickness_minimum: float = 100.0
    #: Share of the diffuse light that leaves on the other side of a thin sheet, 0 to 1, and its colour (r, g, b).
    diffuse_transmission: float = 0.0
    diffuse_transmission_color: Triple = (1.0, 1.0, 1.0)
    #: Reflectance (r, g, b) of the sheen of cloth; black is no sheen.
    sheen_color: Triple = (0.0, 0.0, 0.0)
    #: Perceptual roughness of the sheen, 0 to 1.
    sheen_roughness: float = 0.0
    #: Model of the sheen: "charlie" as in glTF, or "fibers" as in Blender and OpenPBR.
    sheen_model: str = "charlie"
    #: Strength of anisotropy, 0 to 1: the alpha along the tangent is a mix of the GGX alpha and 1, by its square.
    anisotropy: float = 0.0
    #: Rotation of the tangent, degrees.
    anisotropy_rotation: float = 0.0
    #: Emitted radiance, W/(sr m2) per channel, from the front.
    emission: Triple = (0.0, 0.0, 0.0)
    #: (H, W, 3) uint8, sRGB; multiplies emission.
    emission_texture: ArrayLike | Texture | None = None
    #: Whether the back emits, too; otherwise cameras see through the back of an emissive surface.
    double_sided: bool = False


@dataclass(kw_only=True, eq=False)
class Mesh(Described):
    """A triangle mesh of one material. Meshes of the same arrays and material become instances of one mesh."""

    #: Positions (V, 3), m.
    vertices: ArrayLike
    #: Indices (T, 3) of vertices, counter-clockwise seen from the front.
    triangles: ArrayLike
    material: Material = field(default_factory=Material)
    #: Shading normals (V, 3); None: flat faces.
    normals: ArrayLike | None = None
    #: Texture coordinates (V, 2), v downwards.
    uvs: ArrayLike | None = None
    #: Colours (V, 3), scene-linear, 0 to 1; multiply base_color.
    colors: ArrayLike | None = None
    #: Mesh to world (4, 4), for column vectors.
    transform: ArrayLike | None = None
    name: str = "mesh"
    #: The light group: its light is in the layers LightGroup_NAME and Caustic_NAME.
    light_group: str | None = None


@dataclass(kw_only=True, eq=False)
class Camera(Described):
    """A perspective camera, or an orthographic one."""

    position: Triple = (0.0, 0.0, 1.0)
    #: A point in the middle of the picture.
    target: Triple = (0.0, 0.0, 0.0)
    up: Triple = (0.0, 1.0, 0.0)
    #: Vertical field of view, degrees.
    fov: float = 40.0
    #: Height of the view of an orthographic camera, m; None is a perspective camera.
    orthographic_height: float | None = None
    #: Offset of the picture's centre from the axis, in widths to the right and heights up.
    shift: Sequence[float] = (0.0, 0.0)
    #: Width over height, if a render gives only one of the two.
    aspect: float | None = None
    #: Radius of the thin lens, m; 0 is a pinhole.
    aperture_radius: float = 0.0
    #: Distance in focus, m; None: the distance of the target.
    focus_distance: float | None = None
    name: str = "camera"


@dataclass(kw_only=True, eq=False)
class PointLight(Described):
    """A light that is equally bright in all directions."""

    position: Triple
    #: Radiant intensity, W/sr per channel.
    intensity: Triple
    #: Radius of the light, m: it is a sphere, or a mathematical point if 0.
    radius: float = 0.0
    name: str = "point"
    light_group: str | None = None


@dataclass(kw_only=True, eq=False)
class SpotLight(Described):
    """A light that emits into a cone."""

    position: Triple
    target: Triple
    #: Radiant intensity on the axis, W/sr per channel.
    intensity: Triple
    #: Half angle of full intensity, degrees.
    inner: float = 0.0
    #: Half angle of no intensity, degrees.
    outer: float = 45.0
    #: Radius of the emitting disc, m.
    radius: float = 0.0
    name: str = "spot"
    light_group: str | None = None


@dataclass(kw_only=True, eq=False)
class SunLight(Described):
    """A light from infinity."""

    #: Direction in which the light travels.
    direction: Triple
    #: Irradiance on a surface that faces the light, W/m2 per channel.
    irradiance: Triple
    #: Angular diameter, degrees.
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
        # The view is parallel to `up`: any other axis fixes the roll of the camera.
        right = np.cross((0.0, 0.0, -1.0) if abs(back[2]) < 0.9 else (0.0, 1.0, 0.0), back)
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2], pose[:3, 3] = right, np.cross(back, right), back, position
    return pose
