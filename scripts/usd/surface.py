"""A surface in the terms that UsdPreviewSurface, OpenPBR and glTF share, before it is written as a glTF material."""

import dataclasses


@dataclasses.dataclass
class Surface:
    """Each value is a constant, a `network.Texture`, or, of `base`, a `network.Primvar`."""

    base: object = (0.18, 0.18, 0.18)
    metallic: object = 0.0
    roughness: object = 0.5
    normal: object = None
    emission: object = (0.0, 0.0, 0.0)
    # Share of the surface that is there at all, and below which value it is not (0: in shares).
    presence: object = 1.0
    threshold: float = 0.0
    ior: float = 1.5
    specular: float = 1.0
    specular_color: tuple = (1.0, 1.0, 1.0)
    anisotropy: float = 0.0
    coat: object = 0.0
    coat_roughness: object = 0.0
    sheen: tuple = (0.0, 0.0, 0.0)
    sheen_roughness: float = 0.3
    transmission: object = 0.0
    # Colour that is left after `depth` (stage units) inside; depth 0 tints at the surface, as `base` does.
    inside: tuple = (1.0, 1.0, 1.0)
    depth: float = 0.0
    scatter: tuple = (0.0, 0.0, 0.0)
    scatter_g: float = 0.0
    dispersion: float = 0.0
    thin: object = None
