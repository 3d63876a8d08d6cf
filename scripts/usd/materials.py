"""Converts bound materials to glTF materials, with `extras.caustique` for features that glTF lacks."""

import copy
import math

import materialx
import preview
from network import Primvar, Reader, Texture
from pxr import UsdShade
from stage import custom_keys, finite
from surface import Surface
from faults import Fault, Invalid
from textures import Textures


# {identifier of a surface shader: function that reads it}
_READ = {
    "UsdPreviewSurface": preview.surface, preview.MATERIALX: preview.surface, materialx.OPEN_PBR: materialx.surface,
    materialx.STANDARD: materialx.surface,
}


class MeshMaterial:
    """A glTF material (`index`), and the primvars that it needs: texture coordinates (`sets`) and `color`."""

    def __init__(self, index, sets, color):
        self.index, self.sets, self.color = index, sets, color


class Materials:
    """Materials, converted when a mesh needs them. Closed and open meshes have separate transmissive materials."""

    def __init__(self, stage, document):
        self._stage, self._document = stage, document
        self._textures = Textures(stage, document)
        self._reader = Reader(stage, self._textures)
        self._mesh_materials, self._surfaces = {}, {}

    def bound(self, prim):
        """The material bound to a prim or subset (UsdShade.Material), or None."""
        material, relationship = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial(UsdShade.Tokens.full)
        if not material and relationship and relationship.GetTargets():
            self._stage.losses.add(prim.GetPath(), f"the material {relationship.GetTargets()[0]} is not there")
        return material if material else None

    def for_mesh(self, material, closed, light_radiance=None, fades=False):
        """The `MeshMaterial` of a material, or of displayColor if None. `closed`: whether the mesh is.
        `light_radiance`: radiance (3 numbers) of a light on the mesh, or None. `fades`: whether the mesh has
        displayOpacity."""
        where = material.GetPath() if material else None
        key = (where, closed, light_radiance, fades)
        try:
            closed = closed or not self._surface(material).has_inside
            key = (where, closed, light_radiance, fades)
            if key not in self._mesh_materials:
                self._mesh_materials[key] = self._convert(material, closed, light_radiance, fades)
        except Invalid as invalid:
            self._stage.losses.add(invalid.where or where, f"{invalid.fault}: displayColor takes the place of its material")
            self._mesh_materials[key] = self._convert(None, closed, light_radiance, fades)
        except Fault as fault:
            raise fault if fault.where else Fault(where, fault.fault, fault.hint)
        return self._mesh_materials[key]

    def _convert(self, material, closed, light_radiance, fades):
        name = str(material.GetPath()) if material else "displayColor"
        surface = self._surface(material)
        if light_radiance is not None:
            surface = copy.copy(surface)
            surface.emission = light_radiance
        entry, sets = {"name": name}, []
        surface = self._below(surface, closed, entry)
        color = surface.base.name if isinstance(surface.base, Primvar) else None
        self._base_properties(surface, entry, sets)
        self._normal(surface, entry, sets)
        self._emission(surface, entry, sets)
        keys = custom_keys(material.GetPrim(), self._stage) if material else {}
        self._extensions(surface, entry, sets, closed, keys, name)
        if keys:
            entry["extras"] = {"caustique": keys}
        if color == "displayColor" and fades:
            entry["alphaMode"] = "BLEND"
        entry["doubleSided"] = light_radiance is None
        return MeshMaterial(self._document.add("materials", entry), sets, color)

    def _surface(self, material):
        if material is None:
            return Surface(base=Primvar("displayColor"), roughness=1.0, specular=0.0)
        key = material.GetPath()
        if key not in self._surfaces:
            self._surfaces[key] = self._read(material)
        return self._surfaces[key]

    def _read(self, material):
        losses, where, identifier = self._stage.losses, material.GetPath(), self._reader.identifier
        mtlx = material.ComputeSurfaceSource("mtlx")[0]
        kind = identifier(mtlx) if mtlx else None
        if kind in _READ:
            return _READ[kind](mtlx, self._reader, losses)
        plain = material.ComputeSurfaceSource()[0]
        if kind and plain and plain.GetPath() != mtlx.GetPath():
            losses.add(where, f"a surface {kind} is not read: its {identifier(plain)} takes its place")
        id_ = identifier(plain) if plain else None
        if id_ in _READ:
            return _READ[id_](plain, self._reader, losses)
        found = kind or id_
        what = f"a surface {found} is not read" if found else "it has no surface that is read"
        losses.add(where, f"{what} (UsdPreviewSurface, OpenPBR, Standard Surface are): displayColor takes its place")
        return Surface(base=Primvar("displayColor"), roughness=1.0, specular=0.0)

    def _base_properties(self, surface, entry, sets):
        core = entry.setdefault("pbrMetallicRoughness", {})
        alpha = 1.0
        if isinstance(surface.presence, Texture):
            base = (1.0,) * 3 if isinstance(surface.base, Primvar) else surface.base
            image, factor = self._textures.with_alpha(base, surface.presence)
            shown = base if isinstance(base, Texture) else surface.presence
            core["baseColorTexture"] = self._textures.reference(shown, sets, image)
        elif isinstance(surface.base, Texture):
            image, factor = self._textures.color(surface.base)
            core["baseColorTexture"] = self._textures.reference(surface.base, sets, image)
            alpha = surface.presence
        else:
            factor = (1.0,) * 3 if isinstance(surface.base, Primvar) else surface.base
            alpha = surface.presence
        if not isinstance(alpha, (int, float)):
            self._add_loss(entry, "what feeds its opacity is not carried: it is opaque")
            alpha = 1.0
        self._check(entry, "colour", tuple(factor))
        core["baseColorFactor"] = [*self._clip(entry, "base colour", factor), alpha]
        if isinstance(surface.presence, Texture) or alpha < 1:
            entry["alphaMode"] = "MASK" if surface.threshold > 0 else "BLEND"
            if surface.threshold > 0:
                entry["alphaCutoff"] = surface.threshold
        self._roughness_metalness(surface, entry, core, sets)

    def _roughness_metalness(self, surface, entry, core, sets):
        """Set roughness and metalness, which share an image in glTF (green and blue)."""
        parts = {1: surface.roughness, 2: surface.metallic}
        for at, value in parts.items():
            if not isinstance(value, (int, float, Texture)):
                self._add_loss(entry, "what feeds its roughness or metalness is not carried")
                parts[at] = {1: 0.5, 2: 0.0}[at]
        names = {1: "roughnessFactor", 2: "metallicFactor"}
        textured = {at: part for at, part in parts.items() if isinstance(part, Texture)}
        for at, part in parts.items():
            core[names[at]] = 1.0 if at in textured else self._clip(entry, names[at], (part,))[0]
        if not textured:
            return
        placed = {(t.uv, t.transform, t.wraps) for t in textured.values()}
        if len(placed) > 1:
            self._add_loss(entry, "roughness and metalness are placed by different coordinates: roughness's place both")
        first = textured[min(textured)]
        images = {at: self._textures.data_as_is(part, at) for at, part in textured.items()}
        # An image for roughness alone needs no blue channel if metalness is 0; one for metalness always needs green.
        fits = len(textured) == 2 or (1 in textured and core["metallicFactor"] == 0)
        image = images[min(images)] if fits and len(set(images.values())) == 1 else None
        if image is None:
            image = self._textures.packed(textured)
        core["metallicRoughnessTexture"] = self._textures.reference(first, sets, image)

    def _normal(self, surface, entry, sets):
        if not isinstance(surface.normal, Texture):
            return
        image, strength = self._textures.normals(surface.normal)
        entry["normalTexture"] = self._textures.reference(surface.normal, sets, image)
        if strength != 1:
            entry["normalTexture"]["scale"] = strength

    def _emission(self, surface, entry, sets):
        radiance = surface.emission
        if isinstance(radiance, Texture):
            image, radiance = self._textures.emission(radiance)
            entry["emissiveTexture"] = self._textures.reference(surface.emission, sets, image)
        elif isinstance(radiance, Primvar):
            return self._add_loss(entry, "emission by a primvar is not carried: it does not emit light")
        self._check(entry, "emission", tuple(radiance))
        set_emission(self._document, entry, radiance)

    def _extensions(self, surface, entry, sets, closed, keys, name):
        def add(extension, value):
            entry.setdefault("extensions", {})[self._document.use(extension)] = value

        if isinstance(surface.diffuse_roughness, Texture):
            image = self._textures.data_as_is(surface.diffuse_roughness, 0)
            image = self._textures.packed({0: surface.diffuse_roughness}) if image is None else image
            self._own_texture(keys, "diffuse_roughness", 1.0, self._textures.reference(surface.diffuse_roughness, sets, image))
        elif surface.diffuse_roughness:
            keys.setdefault("diffuse_roughness", surface.diffuse_roughness)
        if surface.ior != 1.5:
            add("KHR_materials_ior", {"ior": max(surface.ior, 1.0)})
        if surface.specular != 1 or surface.specular_color != (1.0,) * 3:
            add("KHR_materials_specular", {"specularFactor": self._clip(entry, "specular", (surface.specular,))[0],
                                           "specularColorFactor": list(surface.specular_color)})
        if surface.anisotropy:
            add("KHR_materials_anisotropy", {"anisotropyStrength": surface.anisotropy})
        if surface.coat != 0:
            add("KHR_materials_clearcoat", self._textured(entry, sets, {
                "clearcoat": (surface.coat, 0), "clearcoatRoughness": (surface.coat_roughness, 1)}))
            self._coat(surface, entry, sets, keys)
        if surface.film > 0 and (isinstance(surface.film_thickness, Texture) or surface.film_thickness > 0):
            film = {"iridescenceFactor": min(surface.film, 1.0), "iridescenceIor": max(surface.film_ior, 1.0)}
            if isinstance(surface.film_thickness, Texture):
                image, film["iridescenceThicknessMaximum"] = self._textures.above(surface.film_thickness, 0.0)
                film["iridescenceThicknessMinimum"] = 0.0
                film["iridescenceThicknessTexture"] = self._textures.reference(surface.film_thickness, sets, image)
            else:
                film["iridescenceThicknessMaximum"] = surface.film_thickness
            add("KHR_materials_iridescence", film)
        if any(surface.sheen):
            add("KHR_materials_sheen", {"sheenColorFactor": list(surface.sheen),
                                        "sheenRoughnessFactor": surface.sheen_roughness})
            if surface.sheen_model != "charlie":
                keys.setdefault("sheen_model", surface.sheen_model)
        if surface.sheet:
            self._diffuse_transmission(surface, entry, sets, add)
        if surface.transmission == 0:
            return
        add("KHR_materials_transmission", self._textured(entry, sets, {"transmission": (surface.transmission, 0)}))
        thin = surface.thin or not closed
        if not closed and surface.thin is not True:
            self._stage.losses.add(name, "a mesh with holes uses it, which has no inside: it is a thin pane there")
        volume = {"thicknessFactor": 0.0 if thin else 1.0}
        if surface.depth > 0 and not thin:
            volume.update(attenuationColor=list(surface.inside), attenuationDistance=surface.depth * self._stage.metres)
        add("KHR_materials_volume", volume)
        if surface.dispersion and not thin:
            add("KHR_materials_dispersion", {"dispersion": surface.dispersion})
        if any(surface.scatter) and not thin and "medium" not in keys:
            keys["medium"] = _medium(surface, self._stage.metres)

    def _below(self, surface, closed, entry):
        """The surface with the base colour of the diffuse light that does not pass it, and the share that does, `sheet`."""
        share, color = surface.subsurface, surface.subsurface_color
        surface = copy.copy(surface)
        surface.sheet = 0.0
        if not share:
            return surface
        if surface.transmission != 0:
            self._add_loss(entry, "subsurface scattering is not carried beside transmission")
        elif surface.thin:
            # Half of the light that scatters in a thin sheet leaves on either side, or more ahead by its anisotropy.
            surface.sheet = share * (1 + surface.subsurface_g) / 2
            surface.base = self._mixed(entry, surface.base, color, (share - surface.sheet) / (1 - surface.sheet))
        elif closed:
            surface.sheet = share
        else:
            self._add_loss(entry, "subsurface scattering needs a closed mesh, and one that uses it has holes: it is diffuse "
                           "there")
            surface.base = self._mixed(entry, surface.base, color, share)
        return surface

    def _mixed(self, entry, first, second, share):
        """A colour with this share of `second`; the one with the larger share, with a loss, if they vary."""
        if share in (0.0, 1.0) or first == second:
            return second if share == 1.0 else first
        if isinstance(first, tuple) and isinstance(second, tuple):
            return tuple(a + (b - a) * share for a, b in zip(first, second))
        self._add_loss(entry, "colours of its base and its subsurface scattering that vary are not mixed: the stronger one "
                       "is taken")
        return second if share >= 0.5 else first

    def _diffuse_transmission(self, surface, entry, sets, add):
        """Set the light that passes a thin sheet, or that scatters inside of a closed mesh."""
        solid, color = not surface.thin, surface.subsurface_color
        content = {"diffuseTransmissionFactor": surface.sheet}
        if isinstance(color, Texture):
            seen = (lambda c: _medium_color(c, surface)) if solid else (lambda c: c)
            image, color = self._textures.tint(color, seen, 0.5 if solid else 1.0)
            content["diffuseTransmissionColorTexture"] = self._textures.reference(surface.subsurface_color, sets, image)
        elif solid:
            color = [float(_medium_color(c, surface)) for c in color]
        content["diffuseTransmissionColorFactor"] = [1.0] * 3 if solid else self._clip(entry, "subsurface colour", color)
        add("KHR_materials_diffuse_transmission", content)
        if not solid:
            return
        paths = [max(r, 1e-6) * self._stage.metres for r in surface.subsurface_radius]
        # Channels whose paths differ by more would underflow.
        paths = [max(path, max(paths) / 100) for path in paths]
        add("KHR_materials_volume", {"thicknessFactor": 1.0, "attenuationDistance": min(paths),
                                     "attenuationColor": [math.exp(-min(paths) / path) for path in paths]})
        add("KHR_materials_volume_scatter", {"multiscatterColor": self._clip(entry, "subsurface colour", color),
                                             "scatterAnisotropy": surface.subsurface_g})

    def _coat(self, surface, entry, sets, keys):
        """Set the colour and the index of a coat."""
        if isinstance(surface.coat_color, Texture):
            image, factor = self._textures.color(surface.coat_color)
            self._own_texture(keys, "coat_color", factor, self._textures.reference(surface.coat_color, sets, image))
        elif tuple(surface.coat_color) != (1.0,) * 3:
            keys.setdefault("coat_color", list(self._clip(entry, "the colour of its coat", surface.coat_color)))
        if isinstance(surface.coat_ior, Texture):
            image, largest = self._textures.above(surface.coat_ior, 1.0)
            self._own_texture(keys, "coat_ior", largest, self._textures.reference(surface.coat_ior, sets, image))
        elif surface.coat_ior != 1.5:
            keys.setdefault("coat_ior", max(surface.coat_ior, 1.0))

    def _own_texture(self, keys, name, factor, reference):
        """Set a key of caustique and its texture, unless the stage gives the key itself."""
        if name not in keys:
            keys[name] = factor
            keys.setdefault(name + "_texture", reference)

    def _textured(self, entry, sets, parts):
        """Set `NAMEFactor`, and `NAMETexture` if a texture provides the value in the extension's channel."""
        out = {}
        for name, (value, at) in parts.items():
            if isinstance(value, Texture):
                image = self._textures.data_as_is(value, at)
                image = self._textures.packed({at: value}) if image is None else image
                out[name + "Texture"] = self._textures.reference(value, sets, image)
                value = 1.0
            elif not isinstance(value, (int, float)):
                self._add_loss(entry, f"what feeds {name} is not carried")
                value = 0.0
            out[name + "Factor"] = self._clip(entry, name, (value,))[0]
        return out

    def _clip(self, entry, what, values):
        """Values clipped to 0 to 1, with a loss if one was outside."""
        if any(not 0 <= x <= 1 for x in values):
            self._add_loss(entry, f"{what} {', '.join(f'{x:g}' for x in values)} is clipped to 0 to 1")
        return [min(max(float(x), 0.0), 1.0) for x in values]

    def _check(self, entry, what, values):
        if not finite(values):
            raise Invalid(entry["name"], f"its {what} is not finite", "give it numbers")

    def _add_loss(self, entry, what):
        self._stage.losses.add(entry["name"], what)


def _medium_color(color, surface):
    """The colour of a medium with which light that enters it leaves with `color`, a number or an array.

    The surface reflects a part of the light from inside back: by its facets (their mean reflectance by the fit of [Kulla
    and Conty 2017]), and diffusely, by the share that it does not transmit.
    """
    facets = surface.specular * (surface.ior - 1) / (4.08567 + 1.00071 * surface.ior) if surface.ior > 1 else 0.0
    base = sum(surface.base) / 3 if isinstance(surface.base, tuple) else 0.5
    inside = facets + (1 - facets) * (1 - surface.sheet) * base
    return color / ((1 - facets) * surface.sheet + color * inside)


def set_emission(document, entry, radiance):
    """Set a material's emission (W/(sr m2)) as glTF's factor, at most 1, and strength."""
    strongest = max(radiance)
    if strongest <= 0:
        return
    entry["emissiveFactor"] = [max(c, 0.0) / strongest for c in radiance] if strongest > 1 else \
        [max(c, 0.0) for c in radiance]
    if strongest > 1:
        name = document.use("KHR_materials_emissive_strength")
        entry.setdefault("extensions", {})[name] = {"emissiveStrength": strongest}


def _medium(surface, metres):
    """Returns the absorption and scattering coefficients (1/m) inside an OpenPBR surface.

    Extinction follows from the colour after the depth; scattering is scatter / depth. Absorption is their difference,
    shifted so that no channel is negative.
    """
    depth = surface.depth * metres
    extinction = [-math.log(max(c, 1e-6)) / depth for c in surface.inside]
    scatter = [s / depth for s in surface.scatter]
    absorbed = [e - s for e, s in zip(extinction, scatter)]
    least = min(absorbed)
    if least < 0:
        absorbed = [a - least for a in absorbed]
    return {"sigma_a": absorbed, "sigma_s": scatter, "g": surface.scatter_g}
