"""BSDFs of Mitsuba's XML as materials with the parameters of glTF."""

from copy import copy
from dataclasses import dataclass, field, fields

import mitsuba as mi
import numpy as np
from glb_package import meshes
from xml_colours import (
    FAULTS,
    Picture,
    Value,
    colour,
    combined,
    constant,
    grey,
    quantised,
    reason,
    scalar,
    srgb,
    to_texture,
    uniform,
    value,
)

#: BSDFs whose parameters are translated, for messages.
KNOWN = (
    "diffuse plastic roughplastic dielectric roughdielectric thindielectric conductor roughconductor principled "
    "principledthin twosided bumpmap normalmap mask blendbsdf null"
)
#: Largest nesting of BSDFs in each other.
MAX_DEPTH = 16
#: Heights are interpolated before their slopes are taken: by at most this factor, up to this many pixels along a side.
MAX_REFINEMENT, MAX_REFINED_SIDE = 8, 1024


@dataclass(eq=False)
class Surface:
    """The parameters of a material; those that may vary over it are `Value`s."""

    base: Value = field(default_factory=lambda: constant(1.0))
    alpha: Value = field(default_factory=lambda: constant(1.0))
    roughness: Value = field(default_factory=lambda: constant(0.0))
    metallic: Value = field(default_factory=lambda: constant(0.0))
    specular: float = 1.0
    specular_color: np.ndarray = field(default_factory=lambda: np.ones(3))
    ior: float = 1.5
    transmission: float = 0.0
    clearcoat: float = 0.0
    clearcoat_roughness: float = 0.0
    sheen_color: np.ndarray = field(default_factory=lambda: np.zeros(3))
    sheen_roughness: float = 0.3
    anisotropy: float = 0.0
    anisotropy_rotation: float = 0.0
    thin: bool = False
    null: bool = False
    two_sided: bool = False
    #: A map of normals, and one of heights with its factor.
    normals: Picture | None = None
    heights: tuple[Picture, float] | None = None

    @property
    def fits_all_meshes(self):
        """Whether the material does not depend on the mesh."""
        return self.normals is None and self.heights is None


#: Fields of `Surface` that a blend takes from the heavier part.
FLAGS = ("thin", "null", "normals", "heights", "anisotropy_rotation")


def matte(reflectance):
    """A Lambertian surface."""
    return Surface(base=reflectance, roughness=constant(1.0), specular=0.0)


def surface(node, depth=0):
    """The `Surface` of a BSDF."""
    if node is None:
        return matte(constant(0.5))
    if depth > MAX_DEPTH:
        raise node.fault("BSDFs contain each other, or are nested too deep")
    node.used = True
    read = READERS.get(node.type)
    if read is None:
        made = matte(nearest_colour(node))
        node.drop(f"a BSDF of this type is taken as matte; known are {', '.join(KNOWN.split())}")
        return made
    if read in WRAPPERS:
        return read(node, depth)
    return read(node)


def inner(node, depth):
    """The `Surface` of the BSDF that another one wraps."""
    return surface(node.child(tag="bsdf"), depth + 1)


def nearest_colour(node):
    """The reflectance of an unknown BSDF, if it names one."""
    for name in ("reflectance", "diffuse_reflectance", "base_color"):
        if node.child(name) is not None:
            return colour(node, name, 0.5)
    return constant(0.5)


def relative_index(node, inside, outside="air"):
    """Index of refraction inside, relative to that outside."""
    return node.index("int_ior", inside) / node.index("ext_ior", outside)


def set_roughness(node, made):
    """Set roughness and anisotropy of a rough BSDF: glTF's roughness is the root of alpha."""
    place, lose = node.title, node.document.lose
    if node.text("distribution", "beckmann") not in ("ggx", "tr"):
        lose(f"{place}: facets by {node.text('distribution', 'beckmann')} are taken as GGX")
    node.child("sample_visible")
    root = lambda x: np.sqrt(np.clip(x, 0.0, 1.0))
    if node.child("alpha_u") is None and node.child("alpha_v") is None:
        made.roughness = combined(root, [scalar(node, "alpha", 0.1)], lose, place)
        return
    u, v = scalar(node, "alpha_u", 0.1), scalar(node, "alpha_v", 0.1)
    if u.picture is not None or v.picture is not None:
        lose(f"{place}: its anisotropy is left out, because alpha_u and alpha_v are textures")
        made.roughness = combined(lambda a, b: np.sqrt(root(a) * root(b)), [u, v], lose, place)
        return
    along, across = np.clip([u.color[0], v.color[0]], 0.0, 1.0)
    low, high = sorted((along, across))
    # KHR_materials_anisotropy: alpha along the tangent is mix(alpha, 1, strength^2), and alpha across it.
    made.roughness = constant(np.sqrt(low))
    made.anisotropy = float(np.sqrt((high - low) / max(1.0 - low, 1e-6)))
    made.anisotropy_rotation = 0.0 if along >= across else 90.0


def diffuse(node):
    if node.type == "roughdiffuse":
        node.drop_child("alpha")
    # Mitsuba 0.x knows both names.
    return matte(colour(node, "diffuse_reflectance" if node.child("diffuse_reflectance") else "reflectance", 0.5))


def plastic(node):
    made = Surface(base=colour(node, "diffuse_reflectance", 0.5), ior=relative_index(node, "polypropylene"))
    made.specular_color = uniform(node, "specular_reflectance", 1.0)
    if node.type == "roughplastic" or node.type == "pplastic" and node.child("alpha") is not None:
        set_roughness(node, made)
    if node.boolean("nonlinear"):
        node.document.lose(f"{node.title}: nonlinear colour shifts are left out")
    return made


def dielectric(node):
    made = Surface(base=colour(node, "specular_transmittance", 1.0), transmission=1.0, ior=relative_index(node, "bk7"))
    tint_reflection(node, made)
    if node.type == "roughdielectric":
        set_roughness(node, made)
    if made.ior < 1.0:
        node.document.lose(
            f"{node.title}: an index of {made.ior:.4g} relative to the outside is taken as 1; exchange int_ior and ext_ior, "
            "and turn the mesh inside out"
        )
        made.ior = 1.0
    if node.type == "thindielectric":
        made.thin = True
        node.document.lose(f"{node.title}: what is reflected to and fro inside of a thin pane is left out")
    return made


def tint_reflection(node, made):
    """Read the colour of a dielectric's reflection."""
    made.specular_color = uniform(node, "specular_reflectance", 1.0)


def conductor(node):
    described, preset = {"type": "conductor"}, node.text("material", "")
    made = Surface(metallic=constant(1.0))
    for name in ("eta", "k"):
        if node.child(name) is not None:
            described[name] = {"type": "rgb", "value": uniform(node, name, 0.0, "unbounded").tolist()}
    outside = node.index("ext_eta", "1") if node.child("ext_eta") is not None else 1.0
    for part in described.keys() & {"eta", "k"}:
        described[part]["value"] = [x / outside for x in described[part]["value"]]
    if preset == "none":
        reflectance = np.ones(3)
    else:
        if preset and len(described) == 1:
            described["material"] = preset
        try:
            reflectance = at_normal_incidence(described)
        except FAULTS as error:
            raise node.fault(f'its metal "{preset}" cannot be read: {reason(error)}') from error
        node.document.lose(
            f"{node.title}: a metal's reflectance follows Schlick's formula from that at normal incidence"
        )
    made.base = colour(node, "specular_reflectance", 1.0).scaled(reflectance)
    if node.type == "roughconductor":
        set_roughness(node, made)
    return made


def at_normal_incidence(described):
    """RGB reflectance of a Mitsuba conductor at normal incidence."""
    bsdf = mi.load_dict(described)
    interaction = mi.SurfaceInteraction3f()
    interaction.wi = [0.0, 0.0, 1.0]
    _, weight = bsdf.sample(mi.BSDFContext(), interaction, 0.5, [0.5, 0.5])
    return np.array(weight, float).ravel()


def principled(node):
    made = Surface(base=colour(node, "base_color", 0.5))
    made.roughness, made.metallic = scalar(node, "roughness", 0.5), scalar(node, "metallic", 0.0)
    number = lambda name, usual: float(uniform(node, name, usual, "unbounded").mean())
    specular = min(max(number("specular", 0.5), 0.0), 1.0)
    made.ior = node.index("eta", str(2.0 / (1.0 - np.sqrt(0.08 * specular)) - 1.0))
    made.transmission = number("spec_trans", 0.0)
    made.clearcoat = number("clearcoat", 0.0)
    made.clearcoat_roughness = float(np.sqrt(max(0.0, 0.1 - 0.099 * number("clearcoat_gloss", 0.0))))
    anisotropic, tint = number("anisotropic", 0.0), number("sheen_tint", 0.0)
    base = made.base.mean
    white = np.ones(3)
    tinted = base / max(float(base @ [0.2126, 0.7152, 0.0722]), 1e-6)
    made.sheen_color = np.clip(number("sheen", 0.0) * ((1 - tint) * white + tint * tinted), 0.0, 1.0)
    spec_tint = number("spec_tint", 0.0)
    made.specular_color = (1 - spec_tint) * white + spec_tint * tinted
    layers = {"clearcoat": made.clearcoat, "sheen": made.sheen_color.any(), "anisotropic": anisotropic}
    for name, strength in (layers | {"spec_tint": spec_tint}).items():
        if strength:
            node.document.lose(f"{node.title}: {name} follows glTF's model")
    if anisotropic:
        roughness = float(made.roughness.mean[0])
        aspect = np.sqrt(max(0.0, 1.0 - 0.9 * anisotropic))
        along, across = min(1.0, roughness**2 / aspect), roughness**2 * aspect
        if made.roughness.picture is None:
            made.roughness = constant(np.sqrt(across))
        made.anisotropy = float(np.sqrt((along - across) / max(1.0 - across, 1e-6)))
    for name in ("flatness", "diff_trans"):
        node.drop_child(name)
    if node.type == "principledthin":
        made.thin = True
        node.document.lose(f"{node.title}: it is taken as a thin pane of glTF's model")
    return made


def phong(node):
    """Modified Phong and Ward surfaces of Mitsuba 0.x: a matte base below a glossy reflection."""
    made = Surface(base=colour(node, "diffuse_reflectance", 0.5))
    gloss = uniform(node, "specular_reflectance", 0.2)
    node.document.lose(f"{node.title}: its gloss follows glTF's model")
    if node.type == "ward":
        set_roughness(node, made)
    else:
        made.roughness = constant(np.sqrt(np.sqrt(2.0 / (2.0 + max(node.number("exponent", 30.0), 0.0)))))
    # KHR_materials_specular: the reflectance at normal incidence is 0.04 times this colour.
    made.specular_color = gloss / 0.04
    return made


def null(node):
    return Surface(null=True)


def two_sided(node, depth):
    made = inner(node, depth)
    if len(node.all("bsdf")) > 1:
        node.document.lose(f"{node.title}: the BSDF of the back is left out, the front's is on both sides")
    made.two_sided = True
    return made


def mask(node, depth):
    made = inner(node, depth)
    opacity = scalar(node, "opacity", 0.5)
    made.alpha = combined(lambda a, b: a * b, [made.alpha, opacity], node.document.lose, node.title)
    made.two_sided = True
    return made


def normal_map(node, depth):
    made, found = inner(node, depth), node.child("normalmap") or node.child(tag="texture")
    made.normals = None if found is None else value(found, "unbounded").picture
    if made.normals is None:
        node.document.lose(f"{node.title}: it has no bitmap of normals")
    return made


def bump_map(node, depth):
    made, found = inner(node, depth), node.child(tag="texture")
    heights = None if found is None else grey(value(found, "unbounded"))
    if heights is None or heights.picture is None:
        node.document.lose(f"{node.title}: it has no bitmap of heights")
    else:
        made.heights = heights.picture, node.number("scale", 1.0) * float(heights.color[0])
    return made


def coating(node, depth):
    """A smooth or rough dielectric layer of Mitsuba 0.x."""
    made = inner(node, depth)
    made.clearcoat = 1.0
    if node.type == "roughcoating":
        made.clearcoat_roughness = float(np.sqrt(min(max(node.number("alpha", 0.1), 0.0), 1.0)))
    node.document.lose(f"{node.title}: the layer is taken as a clear coat of index 1.5")
    for name in ("int_ior", "ext_ior", "thickness", "sigma_a", "distribution", "specular_reflectance"):
        node.drop_child(name)
    return made


def blend(node, depth):
    parts = node.all("bsdf")
    if len(parts) != 2:
        raise node.fault(f"it blends two BSDFs, not {len(parts)}")
    weight = scalar(node, "weight", 0.5)
    return mixed(surface(parts[0], depth + 1), surface(parts[1], depth + 1), weight, node)


def mixture(node, depth):
    """The weighted sum of BSDFs of Mitsuba 0.x."""
    parts, found = node.all("bsdf"), node.child("weights")
    weights = np.ones(len(parts)) if found is None else found.numbers()
    if not parts or weights.size != len(parts) or not (weights >= 0).all() or not weights.sum() > 0:
        raise node.fault(f"it has {len(parts)} BSDFs and {weights.size} weights; give each a weight")
    made, total = surface(parts[0], depth + 1), weights[0]
    for part, weight in zip(parts[1:], weights[1:], strict=True):
        total += weight
        made = mixed(made, surface(part, depth + 1), constant(weight / total if total else 0.0), node)
    return made


def mixed(first, second, weight, node):
    """The mix of two surfaces: each parameter is interpolated."""
    lose, place, share = node.document.lose, node.title, float(np.clip(weight.mean[0], 0.0, 1.0))
    made = copy(first if share <= 0.5 else second)
    linear = lambda a, b, w: (1.0 - np.clip(w, 0.0, 1.0)) * a + np.clip(w, 0.0, 1.0) * b
    exact = True
    for item in fields(Surface):
        a, b = getattr(first, item.name), getattr(second, item.name)
        if item.name == "two_sided":
            made.two_sided = a or b
        elif isinstance(a, Value):
            setattr(made, item.name, combined(linear, [a, b, weight], lose, place))
            exact &= item.name in ("base", "alpha") or np.allclose(a.mean, b.mean)
        elif item.name in FLAGS:
            exact &= a is b or a == b
        else:
            setattr(made, item.name, linear(a, b, share) if isinstance(a, np.ndarray) else float(linear(a, b, share)))
            exact &= bool(np.all(a == b))
    if not exact:
        lose(f"{place}: the parameters of its materials are blended, not their light")
    return made


READERS = {
    "diffuse": diffuse,
    "roughdiffuse": diffuse,
    "plastic": plastic,
    "roughplastic": plastic,
    "pplastic": plastic,
    "dielectric": dielectric,
    "roughdielectric": dielectric,
    "thindielectric": dielectric,
    "conductor": conductor,
    "roughconductor": conductor,
    "principled": principled,
    "principledthin": principled,
    "phong": phong,
    "ward": phong,
    "null": null,
    "twosided": two_sided,
    "mask": mask,
    "normalmap": normal_map,
    "bumpmap": bump_map,
    "bump": bump_map,
    "coating": coating,
    "roughcoating": coating,
    "blendbsdf": blend,
    "mixturebsdf": mixture,
}
WRAPPERS = {two_sided, mask, normal_map, bump_map, coating, blend, mixture}


# --- the material of a mesh -------------------------------------------------------------------------------------------


def material(made, name, mesh, matrix, lose):
    """The material of glTF for a surface on a mesh with a transform."""
    place = name
    found = meshes.Material(
        name=name,
        specular=made.specular,
        specular_color=tuple(float(x) for x in made.specular_color),
        ior=float(made.ior),
        transmission=min(max(made.transmission, 0.0), 1.0),
        thin=made.thin,
        null_bsdf=made.null,
        clearcoat=min(max(made.clearcoat, 0.0), 1.0),
        clearcoat_roughness=min(max(made.clearcoat_roughness, 0.0), 1.0) if made.clearcoat else 0.0,
        sheen_color=tuple(float(x) for x in made.sheen_color),
        sheen_roughness=made.sheen_roughness if np.any(made.sheen_color) else 0.0,
        anisotropy=min(max(made.anisotropy, 0.0), 1.0),
        anisotropy_rotation=made.anisotropy_rotation,
    )
    set_base(found, made, lose, place)
    set_gloss(found, made, lose, place)
    set_normals(found, made, mesh, matrix, lose, place)
    return found


def set_base(found, made, lose, place):
    """Set base colour and alpha, and their texture."""
    base, alpha = made.base, made.alpha
    found.alpha = float(np.clip(alpha.color[0], 0.0, 1.0)) if alpha.picture is None else 1.0
    if base.picture is None and alpha.picture is None:
        found.base_color = unit(base.color, lose, place)
        return
    if alpha.picture is None:
        peak = base.picture.values.max()
        scale = float(peak) if peak > 1.0 else 1.0
        found.base_color = unit(base.color * scale, lose, place)
        found.base_color_texture = to_texture(base.picture, srgb(base.picture.values / scale), lose, place)
        return
    both = combined(lambda a, b: a, [base, alpha], lose, place).picture
    holes = combined(lambda a, b: b, [base, alpha], lose, place).picture
    pixels = np.concatenate([srgb(both.values), quantised(holes.values[..., :1])], -1)
    found.base_color, found.base_color_texture = (1.0, 1.0, 1.0), to_texture(both, pixels, lose, place)


def unit(color, lose, place):
    """Returns a colour clamped to 0 to 1, and records a warning by `lose` if that changes the colour."""
    limited = np.clip(color, 0.0, 1.0)
    if not np.allclose(limited, color, atol=1e-6):
        lose(f"{place}: its colour {np.round(color, 3).tolist()} is limited to 0 to 1")
    return tuple(float(x) for x in limited)


def set_gloss(found, made, lose, place):
    """Set roughness and metallic, and their texture."""
    roughness, metallic = made.roughness, made.metallic
    limit = lambda value: float(np.clip(value.color[0], 0.0, 1.0))
    if roughness.picture is None and metallic.picture is None:
        found.roughness, found.metallic = limit(roughness), limit(metallic)
        return
    green = combined(lambda a, b: a, [roughness, metallic], lose, place).picture
    blue = combined(lambda a, b: b, [roughness, metallic], lose, place).picture
    pixels = np.stack([np.ones_like(green.values[..., 0]), green.values[..., 0], blue.values[..., 0]], -1)
    found.roughness = found.metallic = 1.0
    found.metallic_roughness_texture = to_texture(green, quantised(pixels), lose, place)


def set_normals(found, made, mesh, matrix, lose, place):
    """Set the map of normals. Mitsuba's second tangent is normal x dp/du; glTF's points to smaller v."""
    if made.normals is None and made.heights is None:
        return
    derivatives = mesh.tangents()
    if derivatives is None:
        lose(f"{place}: its map of normals or heights is left out, because the mesh has no texture coordinates")
        return
    normal, along_u, along_v = derivatives
    turned = np.sign(np.sum(np.cross(normal, along_u) * along_v) * np.linalg.det(matrix[:3, :3]))
    if made.normals is not None:
        picture, values = made.normals, 2.0 * made.normals.values - 1.0
        values = values * [1.0, -turned, 1.0]
    else:
        picture, scale = made.heights
        lose(f"{place}: heights become normals, with the mean size of the texture on the mesh")
        sizes = [np.median(np.linalg.norm(along @ matrix[:3, :3].T, axis=1)) for along in (along_u, along_v)]
        values = slopes(picture, scale, np.maximum(sizes, 1e-12))
    values = values / np.maximum(np.linalg.norm(values, axis=-1, keepdims=True), 1e-6)
    found.normal_texture = to_texture(picture, quantised(0.5 * values + 0.5), lose, place)


def slopes(picture, scale, sizes):
    """Normals (H, W, 3) of heights in metres, on a finer grid. `sizes` are the lengths of a unit of u and of v."""
    finer = max(1, min(MAX_REFINEMENT, MAX_REFINED_SIDE // max(picture.values.shape[:2])))
    rows, columns = (finer * side for side in picture.values.shape[:2])
    u, v = np.meshgrid((np.arange(columns) + 0.5) / columns, (np.arange(rows) + 0.5) / rows)
    heights = scale * Picture(picture.values[..., :1].astype(float), np.eye(2, 3), wrap=picture.wrap).at(u, v)[..., 0]
    difference = lambda axis: (np.roll(heights, -1, axis) - np.roll(heights, 1, axis)) / 2.0
    down, across = difference(0) * rows, difference(1) * columns
    (a, b, _), (c, d, _) = picture.matrix
    by_u, by_v = across * a + down * c, across * b + down * d
    return np.stack([-by_u / sizes[0], by_v / sizes[1], np.ones_like(by_u)], -1)
