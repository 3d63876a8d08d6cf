"""The common quantities of UsdPreviewSurface, OpenPBR and glTF, between reading a surface and writing a material."""

import dataclasses


@dataclasses.dataclass
class Surface:
    """A surface shader's parameters. Each is a constant or a `network.Texture`; `base` may be a `network.Primvar`."""

    base: object = (0.18, 0.18, 0.18)
    diffuse_roughness: object = 0.0
    metallic: object = 0.0
    roughness: object = 0.5
    normal: object = None
    emission: object = (0.0, 0.0, 0.0)
    # Coverage, and the threshold below which it counts as 0 (threshold 0: partial coverage).
    presence: object = 1.0
    threshold: float = 0.0
    ior: float = 1.5
    specular: float = 1.0
    specular_color: tuple = (1.0, 1.0, 1.0)
    anisotropy: float = 0.0
    coat: object = 0.0
    coat_roughness: object = 0.0
    coat_color: object = (1.0, 1.0, 1.0)
    coat_ior: object = 1.5
    # Share of the diffuse light that enters, the colour it leaves with, mean free paths (stage units) and anisotropy.
    subsurface: float = 0.0
    subsurface_color: object = (0.8, 0.8, 0.8)
    subsurface_radius: tuple = (1.0, 1.0, 1.0)
    subsurface_g: float = 0.0
    sheen: tuple = (0.0, 0.0, 0.0)
    sheen_roughness: float = 0.3
    sheen_model: str = "charlie"
    film: float = 0.0  # share of a thin film, its thickness (nm) and its index of refraction
    film_thickness: object = 0.0
    film_ior: float = 1.4
    transmission: object = 0.0
    # Transmittance after `depth` (stage units) inside; with depth 0 it tints at the surface, as `base` does.
    inside: tuple = (1.0, 1.0, 1.0)
    depth: float = 0.0
    scatter: tuple = (0.0, 0.0, 0.0)
    scatter_g: float = 0.0
    dispersion: float = 0.0
    thin: object = None
    sheet: float = 0.0  # share of the diffuse light that passes, which `Materials` sets

    @property
    def has_inside(self):
        """Whether light enters closed meshes."""
        return self.transmission != 0 or (self.subsurface != 0 and not self.thin)
