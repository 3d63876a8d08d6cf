"""Writes a matched surface as a glTF material: factors and baked images."""

import os
import tempfile

import bpy
import numpy

import glb

PLAIN = "plain"  # marks a channel whose image Blender's exporter has written
_UNIFORM = 1.5e-3  # largest difference of texels that count as equal


class Writer:
    """Adds images to a glTF document and its buffer."""

    def __init__(self, document, buffer):
        self.document, self.buffer = document, bytearray(buffer)

    def image(self, texels, name, texcoord):
        """Add a texture of an array (size, size, 3 or 4) of stored values in [0, 1]. Returns its textureInfo."""
        data = _png(texels)
        view = glb.add_view(self.document, self.buffer, data)
        images = self.document.setdefault("images", [])
        images.append({"name": name, "mimeType": "image/png", "bufferView": view})
        samplers = self.document.setdefault("samplers", [])
        clamped = {"magFilter": 9729, "minFilter": 9729, "wrapS": 33071, "wrapT": 33071}
        if clamped not in samplers:
            samplers.append(clamped)
        textures = self.document.setdefault("textures", [])
        textures.append({"source": len(images) - 1, "sampler": samplers.index(clamped)})
        return {"index": len(textures) - 1, "texCoord": texcoord} if texcoord else {"index": len(textures) - 1}


def _png(texels):
    size = texels.shape[0]
    whole = numpy.ones((size, size, 4), numpy.float32)
    whole[..., :texels.shape[2]] = numpy.clip(texels, 0, 1)
    image = bpy.data.images.new("baked", size, size, alpha=texels.shape[2] == 4, is_data=True)
    with tempfile.TemporaryDirectory() as folder:
        try:
            image.alpha_mode = "CHANNEL_PACKED"
            image.pixels.foreach_set(whole.ravel())
            image.file_format = "PNG"
            path = os.path.join(folder, "baked.png")
            image.save(filepath=path)
        finally:
            bpy.data.images.remove(image)
        with open(path, "rb") as file:
            return file.read()


def uniform(texels, covered):
    """The number or colour that all `covered` texels of an array share, or None."""
    inside = texels[covered]
    if len(inside) == 0:
        return (0.0,) * 3 if texels.ndim == 3 else 0.0
    spread = inside.max(0) - inside.min(0)
    if numpy.max(spread) > _UNIFORM * max(1.0, float(inside.max())):
        return None
    mean = inside.mean(0)
    return tuple(map(float, mean)) if texels.ndim == 3 else float(mean)


def srgb(x):
    """Linear values encoded as sRGB (IEC 61966-2-1)."""
    x = numpy.clip(x, 0, 1)
    return numpy.where(x <= 0.0031308, x * 12.92, 1.055 * x ** (1 / 2.4) - 0.055)


def remove_colours(document):
    """Remove vertex colours, which Blender's exporter adds to meshes without material: Cycles reads them in nodes alone,
    and glTF multiplies materials by them."""
    for mesh in document.get("meshes", []):
        for part in mesh["primitives"]:
            for name in [name for name in part["attributes"] if name.startswith("COLOR_")]:
                del part["attributes"][name]


def give_default(document):
    """Give primitives without a material the grey default of Cycles; glTF's default is a rough white metal."""
    bare = [primitive for mesh in document.get("meshes", []) for primitive in mesh["primitives"]
            if "material" not in primitive]
    if bare:
        materials = document.setdefault("materials", [])
        materials.append({
            "name": "no material", "doubleSided": True, "extensions": {"KHR_materials_specular": {"specularFactor": 0}},
            "pbrMetallicRoughness": {"baseColorFactor": [0.8, 0.8, 0.8, 1], "metallicFactor": 0}})
    for primitive in bare:
        primitive["material"] = len(materials) - 1


def write(entry, channels, writer, texcoord):
    """Complete the exporter's material `entry` with `channels`.

    A channel is a constant, PLAIN, or an array (size, size[, 3]) of linear values. There is one for each quantity of
    lobes.Lobe and matching.Matched, and `direction` (x, y) of the anisotropy. `texcoord`: UV set of the arrays.
    """
    _Entry(entry, channels, writer, texcoord).write()


class _Entry:
    def __init__(self, entry, channels, writer, texcoord):
        self.entry, self.channels, self.writer, self.texcoord = entry, channels, writer, texcoord
        self.name = entry.get("name", "")

    def varies(self, *names):
        return any(isinstance(self.channels[n], numpy.ndarray) for n in names)

    def factor(self, name, default=1.0):
        """The constant factor of a channel, with or without a texture."""
        value = self.channels[name]
        return default if isinstance(value, (numpy.ndarray, str)) else value

    def layer(self, name, size):
        value = self.channels[name]
        return value if isinstance(value, numpy.ndarray) else numpy.ones((size, size), numpy.float32)

    def image(self, what, *layers):
        return self.writer.image(numpy.dstack(layers), f"{self.name} {what}", self.texcoord)

    def grey_image(self, what, layer):
        return self.image(what, layer, layer, layer)

    def size(self, *names):
        return next(len(self.channels[n]) for n in names if isinstance(self.channels[n], numpy.ndarray))

    def extension(self, name, content):
        self.entry.setdefault("extensions", {})["KHR_materials_" + name] = content

    def own(self, **keys):
        """Set keys of the material's extras.caustique."""
        self.entry.setdefault("extras", {}).setdefault("caustique", {}).update(keys)

    def write(self):
        self.entry["extensions"] = {name: content for name, content in self.entry.get("extensions", {}).items()
                                    if not name.startswith("KHR_materials_")}
        self._base()
        self._surface()
        self._reflection()
        self._coverings()
        self._emission()
        if self.varies("normal"):
            self.entry["normalTexture"] = self.image("normal", self.channels["normal"] * 0.5 + 0.5)
        elif self.channels["normal"] is not PLAIN:
            self.entry.pop("normalTexture", None)
        if not self.entry["extensions"]:
            del self.entry["extensions"]

    def _base(self):
        pbr = self.entry.setdefault("pbrMetallicRoughness", {})
        base, alpha = self.factor("base", (1.0,) * 3), self.factor("alpha")
        pbr["baseColorFactor"] = [min(max(c, 0.0), 1.0) for c in base] + [min(max(alpha, 0.0), 1.0)]
        if self.varies("base", "alpha"):
            size = self.size("base", "alpha")
            layers = [srgb(self.channels["base"]) if self.varies("base") else numpy.ones((size, size, 3))]
            layers += [self.channels["alpha"]] if self.varies("alpha") else []
            pbr["baseColorTexture"] = self.image("base color", *layers)
        elif self.channels["base"] is not PLAIN:
            pbr.pop("baseColorTexture", None)
        for key in ("alphaMode", "alphaCutoff"):
            self.entry.pop(key, None)
        if self.varies("alpha") or self.channels["alpha"] is PLAIN or alpha < 1:
            self.entry["alphaMode"] = "BLEND"

    def _surface(self):
        pbr, names = self.entry["pbrMetallicRoughness"], ("transmission", "roughness", "metallic")
        pbr["metallicFactor"], pbr["roughnessFactor"] = self.factor("metallic"), self.factor("roughness")
        shared = None
        if self.varies(*names):
            size = self.size(*names)
            shared = self.image("surface", *(self.layer(n, size) for n in names))
        if self.varies("roughness", "metallic"):
            pbr["metallicRoughnessTexture"] = shared
        elif PLAIN not in (self.channels["roughness"], self.channels["metallic"]):
            pbr.pop("metallicRoughnessTexture", None)
        if self.factor("diffuse_roughness") > 0:
            self.own(diffuse_roughness=self.factor("diffuse_roughness"))
            if self.varies("diffuse_roughness"):
                self.own(diffuse_roughness_texture=self.grey_image("diffuse roughness", self.channels["diffuse_roughness"]))
        if self.factor("sheet") > 0:
            content = {"diffuseTransmissionFactor": self.factor("sheet"),
                       "diffuseTransmissionColorFactor": list(self.factor("sheet_colour", (1.0,) * 3))}
            if self.varies("sheet", "sheet_colour"):
                size = self.size("sheet", "sheet_colour")
                tint = self.channels["sheet_colour"]
                tint = srgb(tint) if self.varies("sheet_colour") else numpy.ones((size, size, 3))
                shared = self.image("diffuse transmission", tint, self.layer("sheet", size))
                content["diffuseTransmissionTexture"] = content["diffuseTransmissionColorTexture"] = shared
            self.extension("diffuse_transmission", content)
        transmission = self.factor("transmission")
        if transmission > 0:
            content = {"transmissionFactor": transmission}
            if self.varies("transmission"):
                content["transmissionTexture"] = shared
            self.extension("transmission", content)
            if self.channels["thin"]:
                self.extension("volume", {"thicknessFactor": 0})

    def _reflection(self):
        ior = self.factor("ior")
        if abs(ior - 1.5) > 1e-6:
            self.extension("ior", {"ior": ior})
        specular, colour = self.factor("specular"), self.factor("specular_colour", (1.0,) * 3)
        content = {}
        if specular < 1:
            content["specularFactor"] = specular
        if any(abs(c - 1) > 1e-6 for c in colour):
            content["specularColorFactor"] = list(colour)
        if self.varies("specular", "specular_colour"):
            size = self.size("specular", "specular_colour")
            tint = self.channels["specular_colour"]
            tint = srgb(tint) if self.varies("specular_colour") else numpy.ones((size, size, 3))
            shared = self.image("specular", tint, self.layer("specular", size))
            content.update({f"specular{what}Texture": shared for what, name in
                            (("", "specular"), ("Color", "specular_colour")) if self.varies(name)})
        if content and (self.varies("metallic") or self.factor("metallic") < 1):  # metals have none
            self.extension("specular", content)
        if min(self.channels["reflection"]) < 1:
            self.own(reflection_color=list(self.channels["reflection"]))
        if self.channels["single_scattering"]:
            self.own(single_scattering=True)
        self._film()
        if self.varies("direction", "anisotropy") or self.factor("anisotropy") > 0:
            content = {"anisotropyStrength": self.factor("anisotropy")}
            if self.varies("direction", "anisotropy"):
                size = self.size("direction", "anisotropy")
                content["anisotropyTexture"] = self.image(
                    "anisotropy", self.channels["direction"] * 0.5 + 0.5, self.layer("anisotropy", size))
            self.extension("anisotropy", content)

    def _coverings(self):
        if self.factor("coat") > 0:
            content = {"clearcoatFactor": self.factor("coat"),
                       "clearcoatRoughnessFactor": self.factor("coat_roughness")}
            if self.varies("coat", "coat_roughness"):
                size = self.size("coat", "coat_roughness")
                shared = self.image("coat", self.layer("coat", size), self.layer("coat_roughness", size),
                                    numpy.ones((size, size)))
                content["clearcoatTexture"] = content["clearcoatRoughnessTexture"] = shared
            self.extension("clearcoat", content)
            self._coat_ior()
            colour = self.factor("coat_colour", (1.0,) * 3)
            if min(colour) < 1:
                self.own(coat_color=[min(max(c, 0.0), 1.0) for c in colour])
            if self.varies("coat_colour"):
                self.own(coat_color_texture=self.image("coat color", srgb(self.channels["coat_colour"])))
        sheen = self.factor("sheen", (1.0,) * 3)
        if max(sheen) > 0:
            content = {"sheenColorFactor": [min(c, 1.0) for c in sheen],
                       "sheenRoughnessFactor": self.factor("sheen_roughness")}
            if self.varies("sheen", "sheen_roughness"):
                size = self.size("sheen", "sheen_roughness")
                tint = srgb(self.channels["sheen"]) if self.varies("sheen") else numpy.ones((size, size, 3))
                shared = self.image("sheen", tint, self.layer("sheen_roughness", size))
                content["sheenColorTexture"] = content["sheenRoughnessTexture"] = shared
            self.extension("sheen", content)
            self.own(sheen_model="fibers")

    def _film(self):
        """Write the thin film; with a texture, its largest thickness, and none where the texture is black."""
        film = self.channels["film"]
        thickest = float(film.max()) if self.varies("film") else self.factor("film", 0.0)
        if thickest <= 0:
            return
        content = {"iridescenceFactor": 1.0, "iridescenceIor": max(self.factor("film_ior"), 1.0),
                   "iridescenceThicknessMaximum": thickest}
        if self.varies("film"):
            content["iridescenceThicknessMinimum"] = 0.0
            content["iridescenceThicknessTexture"] = self.grey_image("film", film / thickest)
        self.extension("iridescence", content)

    def _coat_ior(self):
        """Write the index of the coat; with a texture, its largest one, and 1 where the texture is black."""
        index = self.channels["coat_ior"]
        if self.varies("coat_ior"):
            largest = max(float(index.max()), 1.0 + 1e-3)
            self.own(coat_ior=largest, coat_ior_texture=self.grey_image("coat index", (index - 1) / (largest - 1)))
        elif abs(self.factor("coat_ior") - 1.5) > 1e-6:
            self.own(coat_ior=self.factor("coat_ior"))

    def _emission(self):
        """Split emission above one into a strength and an image with values up to one."""
        emission, strength = self.channels["emission"], self.factor("strength")
        if emission is not PLAIN:
            self.entry.pop("emissiveTexture", None)
        self.entry.pop("emissiveFactor", None)
        if self.varies("emission"):
            strongest = max(float(emission.max()), 1e-30)
            self.entry["emissiveTexture"] = self.image("emission", srgb(emission / strongest))
            colour, strength = (1.0,) * 3, strength * strongest
        else:
            colour = self.factor("emission", (1.0,) * 3)
            strongest = max(colour)
            if strongest > 0 and strongest * strength > 1:
                colour, strength = tuple(c / strongest for c in colour), strength * strongest
            else:
                colour, strength = tuple(c * strength for c in colour), 1.0
        if max(colour) * strength > 0:
            self.entry["emissiveFactor"] = [max(c, 0.0) for c in colour]
            if strength != 1.0:
                self.extension("emissive_strength", {"emissiveStrength": strength})
