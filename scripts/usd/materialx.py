"""Reads OpenPBR and Autodesk's Standard Surface (MaterialX nodes in a stage) as a `Surface`."""

from network import Primvar, Texture
from surface import Surface

OPEN_PBR = "ND_open_pbr_surface_surfaceshader"
STANDARD = "ND_standard_surface_surfaceshader"

# {model: {quantity: (name of its input, default)}}
_NAMES = {
    OPEN_PBR: {
        "base": ("base_color", (0.8,) * 3), "base_weight": ("base_weight", 1.0), "metal": ("base_metalness", 0.0),
        "roughness": ("specular_roughness", 0.3), "specular": ("specular_weight", 1.0),
        "specular_color": ("specular_color", (1.0,) * 3), "ior": ("specular_ior", 1.5),
        "anisotropy": ("specular_roughness_anisotropy", 0.0), "transmission": ("transmission_weight", 0.0),
        "inside": ("transmission_color", (1.0,) * 3), "depth": ("transmission_depth", 0.0),
        "scatter": ("transmission_scatter", (0.0,) * 3), "scatter_g": ("transmission_scatter_anisotropy", 0.0),
        "abbe": ("transmission_dispersion_abbe_number", 20.0), "dispersed": ("transmission_dispersion_scale", 0.0),
        "coat": ("coat_weight", 0.0), "coat_roughness": ("coat_roughness", 0.0),
        "coat_color": ("coat_color", (1.0,) * 3), "coat_ior": ("coat_ior", 1.6), "sheen": ("fuzz_weight", 0.0),
        "sheen_color": ("fuzz_color", (1.0,) * 3), "sheen_roughness": ("fuzz_roughness", 0.5),
        "emission": ("emission_luminance", 0.0), "emission_color": ("emission_color", (1.0,) * 3),
        "presence": ("geometry_opacity", 1.0), "thin": ("geometry_thin_walled", False),
        "normal": ("geometry_normal", None), "subsurface": ("subsurface_weight", 0.0),
        "subsurface_color": ("subsurface_color", (0.8,) * 3), "subsurface_radius": ("subsurface_radius_scale", (1.0, 0.5, 0.25)),
        "subsurface_scale": ("subsurface_radius", 1.0), "subsurface_g": ("subsurface_scatter_anisotropy", 0.0),
        "film": ("thin_film_weight", 0.0), "film_thickness": ("thin_film_thickness", 0.5),
        "film_ior": ("thin_film_ior", 1.4), "diffuse_roughness": ("base_diffuse_roughness", 0.0),
    },
    STANDARD: {
        "base": ("base_color", (0.8,) * 3), "base_weight": ("base", 1.0), "metal": ("metalness", 0.0),
        "roughness": ("specular_roughness", 0.2), "specular": ("specular", 1.0),
        "specular_color": ("specular_color", (1.0,) * 3), "ior": ("specular_IOR", 1.5),
        "anisotropy": ("specular_anisotropy", 0.0), "transmission": ("transmission", 0.0),
        "inside": ("transmission_color", (1.0,) * 3), "depth": ("transmission_depth", 0.0),
        "scatter": ("transmission_scatter", (0.0,) * 3), "scatter_g": ("transmission_scatter_anisotropy", 0.0),
        "abbe": ("transmission_dispersion", 0.0), "dispersed": (None, 1.0),
        "coat": ("coat", 0.0), "coat_roughness": ("coat_roughness", 0.1),
        "coat_color": ("coat_color", (1.0,) * 3), "coat_ior": ("coat_IOR", 1.5), "sheen": ("sheen", 0.0),
        "sheen_color": ("sheen_color", (1.0,) * 3), "sheen_roughness": ("sheen_roughness", 0.3),
        "emission": ("emission", 0.0), "emission_color": ("emission_color", (1.0,) * 3),
        "presence": ("opacity", (1.0,) * 3), "thin": ("thin_walled", False), "normal": ("normal", None),
        "subsurface": ("subsurface", 0.0), "subsurface_color": ("subsurface_color", (1.0,) * 3),
        "subsurface_radius": ("subsurface_radius", (1.0,) * 3), "subsurface_scale": ("subsurface_scale", 1.0),
        "subsurface_g": ("subsurface_anisotropy", 0.0), "film": (None, 1.0),
        "film_thickness": ("thin_film_thickness", 0.0), "film_ior": ("thin_film_IOR", 1.5),
        "diffuse_roughness": ("diffuse_roughness", 0.0),
    },
}
_FILM_UNITS = {OPEN_PBR: 1000.0, STANDARD: 1.0}  # unit of a film's thickness (nm)
# {quantity: quantity that must not be 0 for it to have an effect}
_DEPENDS_ON = {
    "inside": "transmission", "depth": "transmission", "scatter": "transmission", "scatter_g": "transmission",
    "abbe": "transmission", "dispersed": "transmission", "coat_roughness": "coat", "coat_color": "coat",
    "coat_ior": "coat", "subsurface_color": "subsurface", "subsurface_radius": "subsurface",
    "subsurface_scale": "subsurface", "subsurface_g": "subsurface",
    "film_thickness": "film", "film_ior": "film", "sheen_color": "sheen", "sheen_roughness": "sheen", "emission_color": "emission",
}
_TEXTURED = {"base", "metal", "roughness", "normal", "emission_color", "presence", "coat", "coat_roughness",
             "coat_color", "coat_ior", "diffuse_roughness", "film_thickness", "transmission", "subsurface_color"}


def surface(shader, reader, losses):
    """The `Surface` of a shader of either model."""
    where = shader.GetPath()
    given, names = {}, _NAMES[reader.identifier(shader)]
    for key, (name, default) in sorted(names.items(), key=lambda item: item[0] in _DEPENDS_ON):
        if not given.get(_DEPENDS_ON.get(key), True):
            given[key] = default
            continue
        value = _read(reader, shader, name, default, key) if name else default
        if isinstance(value, (Texture, Primvar)) and (key not in _TEXTURED or (
                isinstance(value, Primvar) and key != "base")):
            losses.add(where, f"what feeds {name} is not carried: it has its default")
            value = default
        given[key] = value
    presence = given["presence"]
    if isinstance(presence, tuple):
        presence = sum(presence) / 3
    out = Surface(base=_scaled(given["base"], given["base_weight"]), metallic=given["metal"],
                  roughness=given["roughness"], normal=None if isinstance(given["normal"], tuple) else given["normal"],
                  presence=presence, ior=given["ior"], specular=given["specular"],
                  specular_color=given["specular_color"], anisotropy=given["anisotropy"], coat=given["coat"],
                  coat_roughness=given["coat_roughness"], thin=bool(given["thin"]),
                  diffuse_roughness=given["diffuse_roughness"], coat_color=given["coat_color"],
                  coat_ior=given["coat_ior"])
    out.film, out.film_ior = given["film"], given["film_ior"]
    out.film_thickness = _scaled(given["film_thickness"], _FILM_UNITS[reader.identifier(shader)])
    out.emission = _scaled(given["emission_color"], given["emission"])
    if given["sheen"]:
        out.sheen_model = "fibers" if reader.identifier(shader) == OPEN_PBR else "charlie"
        out.sheen = _scaled(given["sheen_color"], given["sheen"])
        out.sheen_roughness = given["sheen_roughness"]
    if given["subsurface"]:
        out.subsurface, out.subsurface_color = min(max(given["subsurface"], 0.0), 1.0), given["subsurface_color"]
        out.subsurface_radius = _scaled(given["subsurface_radius"], given["subsurface_scale"])
        out.subsurface_g = min(max(given["subsurface_g"], -0.99), 0.99)
    _set_interior(out, given, where, losses)
    return out


def _read(reader, shader, name, default, key):
    """The value of an input. Presence is a number in one model and a colour in the other; both are accepted."""
    if key == "presence":
        found = reader.read(shader, name)
        if isinstance(found, (int, float)) or isinstance(found, tuple) and len(found) >= 3:
            return found
    return reader.read(shader, name, default)


def _set_interior(out, given, where, losses):
    """Set absorption, scattering and dispersion inside a transmissive surface from the values `given` of its inputs."""
    out.transmission = given["transmission"]
    if not out.transmission:
        return
    out.depth, out.inside, out.scatter = given["depth"], given["inside"], given["scatter"]
    out.scatter_g = given["scatter_g"]
    if given["dispersed"] and given["abbe"]:
        out.dispersion = 20 * given["dispersed"] / given["abbe"]
    if isinstance(out.transmission, Texture) or isinstance(out.base, (Texture, Primvar)) or out.transmission < 1:
        if out.depth == 0 and out.inside != out.base:
            losses.add(where, "its transmission has the colour of its base")
    else:
        out.base = out.inside if out.depth == 0 else (1.0,) * 3
    if any(out.scatter) and out.depth == 0:
        losses.add(where, "transmission_scatter without a depth is not carried")
        out.scatter = (0.0,) * 3


def _scaled(value, factor):
    """A number, a colour or a texture, multiplied by a number."""
    if isinstance(value, Texture):
        value.scale = tuple(s * factor for s in value.scale[:3]) + (value.scale[3],)
        value.bias = tuple(b * factor for b in value.bias[:3]) + (value.bias[3],)
        return value
    if isinstance(value, tuple):
        return tuple(c * factor for c in value)
    return value if isinstance(value, Primvar) else value * factor
