"""Reads UsdPreviewSurface (specification 2.6) as a `Surface`."""

from network import Primvar, Texture
from surface import Surface

# UsdPreviewSurface as a MaterialX node.
MATERIALX = "ND_UsdPreviewSurface_surfaceshader"


def surface(shader, reader, losses):
    """The `Surface` of a UsdPreviewSurface shader, under either name."""
    where, read, constant = shader.GetPath(), reader.read, reader.constant
    out = Surface(base=read(shader, "diffuseColor", (0.18, 0.18, 0.18)), metallic=read(shader, "metallic", 0.0),
                  roughness=read(shader, "roughness", 0.5), normal=read(shader, "normal"),
                  emission=read(shader, "emissiveColor", (0.0,) * 3), ior=constant(shader, "ior", 1.5),
                  coat=read(shader, "clearcoat", 0.0), coat_roughness=read(shader, "clearcoatRoughness", 0.01),
                  threshold=constant(shader, "opacityThreshold", 0.0))
    if isinstance(out.normal, tuple):
        out.normal = None
    if constant(shader, "useSpecularWorkflow", 0):
        _set_specular(out, read(shader, "specularColor", (0.0,) * 3), where, losses)
    displacement = read(shader, "displacement", 0.0)
    if displacement != 0:
        losses.add(where, "displacement is not carried: displace the mesh before it is exported")
    opacity = read(shader, "opacity", 1.0)
    if isinstance(opacity, Primvar):
        opacity = constant(shader, "opacity", 1.0)
    present = constant(shader, "opacityMode", "transparent") == "presence"
    if isinstance(opacity, Texture) or out.threshold > 0 or present:
        out.presence = opacity
        if isinstance(opacity, Texture) and out.threshold == 0 and opacity.channel != "a":
            losses.add(where, "its opacity texture is taken for presence: where it is 0 there is nothing, no glass")
    elif opacity != 1 and _is_metal(out.metallic):
        losses.add(where, f"opacity {opacity:g} is not carried: metal is opaque (opacityMode \"presence\" makes holes in it)")
    elif opacity != 1:
        out.transmission = 1 - opacity
        if opacity == 0:
            out.base = (1.0,) * 3
        else:
            losses.add(where, f"opacity {opacity:g} is taken for glass that its diffuseColor tints")
    return out


def _is_metal(metallic):
    return isinstance(metallic, (int, float)) and metallic >= 0.5


def _set_specular(out, color, where, losses):
    """Set the specular workflow: `color` is the reflectance at normal incidence; metalness is 0."""
    out.metallic = 0.0
    if isinstance(color, (Texture, Primvar)):
        losses.add(where, "a texture of specularColor is not carried: use the metallic workflow")
        return
    strongest = max(color)
    if strongest <= 0:
        out.specular = 0.0
        return
    # The index of refraction whose reflectance at normal incidence equals the largest of the three channels.
    root = min(strongest, 0.999) ** 0.5
    out.ior = (1 + root) / (1 - root)
    out.specular_color = tuple(c / strongest for c in color)
