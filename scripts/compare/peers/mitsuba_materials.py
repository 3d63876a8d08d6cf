"""Converts glTF materials to Mitsuba: for each lobe of caustique, the plug-in that computes the equal function.

Equal up to rounding:

    matte without a Fresnel layer   diffuse
    smooth matte                    plastic, linear: its diffuse base T(o) T(i) / ((1 - F_in) eta^2) is the coupling of
    Kelemen and
                                    Szirmay-Kalos, since (1 - F_in) eta^2 = 1 - F_out, the average transmittance from
                                    outside
    smooth glass                    dielectric
    absorption in it                a homogeneous medium of albedo 0
    any mixture of the above        blendbsdf

Equal except for masking (separable in Mitsuba, height-correlated in caustique), multiple scattering between facets
(Mitsuba loses it) and the base below rough facets; `mitsuba_lobes.py` corrects these:

    metal                           principled, metallic 1: GGX with Schlick's reflectance
    rough glass                     roughdielectric
    rough matte                     roughplastic, linear
"""

import mitsuba as mi
import mitsuba_lobes
import numpy as np
from gltf import extension, extras, is_closed

#: GGX alpha below which caustique treats a surface as perfectly smooth.
SMOOTH = 1e-3
WRAPS = {33071: "clamp", 33648: "mirror", 10497: "repeat"}
BLACK = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}}


class Materials:
    """The materials of a scene. `correct`: whether to correct Mitsuba's rough lobes (`mitsuba_lobes.py`)."""

    def __init__(self, scene, correct, glass="auto"):
        self.scene, self.correct, self.glass = scene, correct, glass
        self.known, self.textures = {}, {}

    def raw(self, index):
        """A material's JSON, or glTF's default material for None."""
        return {} if index is None else self.scene.document["materials"][index]

    def emission(self, index):
        """Emitted radiance as a texture or a colour, or None."""
        raw = self.raw(index)
        strength = (extension(raw, "KHR_materials_emissive_strength") or {}).get("emissiveStrength", 1.0)
        factor = np.array(raw.get("emissiveFactor", [0, 0, 0]), float) * strength
        if not factor.any():
            return None
        if raw.get("doubleSided"):
            self.scene.lose(f"material {raw.get('name')}: it shines from its front alone")
        return self.color(raw, raw.get("emissiveTexture"), factor)

    def is_solid(self, mesh):
        """Whether a transmissive mesh is a solid, not a thin sheet."""
        raw = self.raw(mesh.material)
        if extras(raw).get("medium"):
            return True
        volume = extension(raw, "KHR_materials_volume")
        if volume is not None:
            return volume.get("thicknessFactor", 0.0) > 0.0
        return self.glass == "solid" or (self.glass == "auto" and is_closed(mesh))

    def medium(self, index):
        """The medium inside a material, or None."""
        raw = self.raw(index)
        if extras(raw).get("priority") is not None:
            self.scene.lose(f"material {raw.get('name')}: its priority over other glass is left out")
        said = extras(raw).get("medium")
        if said is None:
            volume = extension(raw, "KHR_materials_volume") or {}
            color = np.array(volume.get("attenuationColor", [1, 1, 1]), float)
            said = {"sigma_a": -np.log(np.maximum(color, 1e-6)) / volume.get("attenuationDistance", np.inf)}
        return medium(said)

    def bsdf(self, mesh):
        """The BSDF of a mesh, cached by material."""
        if mesh.material not in self.known:
            self.known[mesh.material] = mi.load_dict(self.describe(mesh))
        return self.known[mesh.material]

    def describe(self, mesh):
        """The BSDF of a mesh, as a dictionary."""
        raw = self.raw(mesh.material)
        name = raw.get("name", "default")
        if "normalTexture" in raw:
            self.scene.lose(f"material {name}: its normal map is left out")
        pbr = raw.get("pbrMetallicRoughness", {})
        factor = pbr.get("baseColorFactor", [1, 1, 1, 1])
        base = self.color(raw, pbr.get("baseColorTexture"), factor[:3])
        surface = pbr.get("metallicRoughnessTexture")
        roughness, metallic = pbr.get("roughnessFactor", 1.0), pbr.get("metallicFactor", 1.0)
        if surface is not None:
            roughness = self.channel(surface, 1, roughness)
            metallic = self.channel(surface, 2, metallic)
        transmission = extension(raw, "KHR_materials_transmission") or {}
        if "transmissionTexture" in transmission:
            self.scene.lose(f"material {name}: its texture of transmission is left out")
        share = transmission.get("transmissionFactor", 0.0)
        ior = (extension(raw, "KHR_materials_ior") or {}).get("ior", 1.5)
        specular = extension(raw, "KHR_materials_specular") or {}
        if set(specular) - {"specularFactor", "specularColorFactor"}:
            self.scene.lose(f"material {name}: its textures of specular strength are left out")
        strength = specular.get("specularFactor", 1.0)
        if strength and list(specular.get("specularColorFactor", [1, 1, 1])) != [1, 1, 1]:
            self.scene.lose(f"material {name}: what it reflects is white")
        if raw.get("alphaMode", "OPAQUE") != "OPAQUE":
            self.scene.lose(f"material {name}: it is there where its alpha says that it is not")
        metal = {"type": "twosided", "nested": self._metal(base, roughness)}
        if metallic == 1.0:
            return metal
        parts = []
        if share > 0.0:
            parts.append(self._glass(name, base, roughness, ior, strength, self.is_solid(mesh)))
        if share < 1.0:
            matte = (
                {"type": "diffuse", "reflectance": base}
                if strength == 0.0
                else self._matte(name, base, roughness, ior, strength)
            )
            parts.append({"type": "twosided", "nested": matte})
        dielectric = parts[0] if len(parts) == 1 else _blend(parts[1], parts[0], share)
        return dielectric if metallic == 0.0 else _blend(dielectric, metal, metallic)

    def _matte(self, name, base, roughness, ior, strength):
        alpha = self._plain(roughness, name) ** 2
        if strength != 1.0 and (alpha < SMOOTH or not self.correct):
            self.scene.lose(f"material {name}: its specular strength is an index of refraction with that reflectance")
            root = abs(ior - 1) / (ior + 1) * np.sqrt(strength)
            ior, strength = (1 + root) / (1 - root), 1.0
        common = {"int_ior": float(ior), "ext_ior": 1.0, "nonlinear": False}
        if alpha < SMOOTH:
            return {"type": "plastic", "diffuse_reflectance": base, **common}
        rough = {"type": "roughplastic", "distribution": "ggx", "alpha": alpha, **common}
        if not self.correct:
            return {"diffuse_reflectance": base, **rough}
        # Only the reflecting facets.
        facets = {
            "specular_reflectance": {"type": "rgb", "value": strength},
            "diffuse_reflectance": {"type": "rgb", "value": 0.0},
        }
        return {
            "type": "corrected",
            "kind": "matte",
            "nested": {**rough, **facets},
            "alpha": alpha,
            "base": base,
            "ior": float(ior),
            "strength": float(strength),
        }

    def _metal(self, base, roughness):
        nested = {"type": "principled", "base_color": base, "metallic": 1.0, "roughness": roughness, "specular": 0.5}
        if not self.correct or not isinstance(roughness, float) or roughness**2 < SMOOTH:
            # A smooth mirror is principled's narrowest lobe, 0.001 radians wide.
            return nested
        return {"type": "corrected", "kind": "metal", "nested": nested, "alpha": roughness**2, "base": base}

    def _glass(self, name, base, roughness, ior, strength, solid):
        if strength != 1.0:
            self.scene.lose(f"material {name}: it reflects as glass does")
        alpha = self._plain(roughness, name) ** 2
        common = {"specular_transmittance": base, "int_ior": float(ior), "ext_ior": 1.0}
        if not solid:
            rough = ", and are smooth" if alpha >= SMOOTH else ""
            self.scene.lose(f"material {name}: Mitsuba's thin walls also scatter back and forth inside{rough}")
            return {"type": "thindielectric", **common}
        if alpha < SMOOTH:
            return {"type": "dielectric", **common}
        nested = {"type": "roughdielectric", "distribution": "ggx", "alpha": alpha, **common}
        if not self.correct:
            return nested
        return {"type": "corrected", "kind": "glass", "nested": nested, "alpha": alpha, "base": base, "ior": float(ior)}

    def color(self, raw, info, factor):
        """Returns an sRGB texture times a factor as a texture of Mitsuba, or the factor as a colour if `info` is
        None."""
        if info is None:
            return {"type": "rgb", "value": [float(x) for x in factor]}
        return self._bitmap(info, lambda texels: _linear(texels[..., :3]) * np.asarray(factor, np.float32))

    def channel(self, info, channel, factor):
        """One channel of a data texture times a factor; a number without a texture or with factor 0."""
        if factor == 0.0:
            return 0.0
        texels = self._texels(info)[..., channel]
        if texels.min() == texels.max():
            return float(texels.min()) / 255 * factor
        return self._bitmap(info, lambda texels: texels[..., channel : channel + 1] * np.float32(factor))

    def _plain(self, roughness, name):
        if isinstance(roughness, (int, float)):
            return float(roughness)
        self.scene.lose(f"material {name}: its texture of roughness is its mean")
        return float(np.mean(np.array(roughness["data"])))

    def _texels(self, info):
        """The RGBA bytes of a texture."""
        if info["index"] not in self.textures:
            stream = mi.MemoryStream()
            stream.write(self.scene.image(info["index"])[0])
            stream.seek(0)
            bitmap = mi.Bitmap(stream)
            bitmap = bitmap.convert(mi.Bitmap.PixelFormat.RGBA, mi.Struct.Type.UInt8, bitmap.srgb_gamma())
            self.textures[info["index"]] = np.array(bitmap)
        return self.textures[info["index"]]

    def _bitmap(self, info, convert):
        transform = extension(info, "KHR_texture_transform") or {}
        if transform.get("texCoord", info.get("texCoord", 0)) != 0:
            self.scene.lose("second texture coordinates: the first place the image")
        sampler = self.scene.image(info["index"])[1]
        wraps = {WRAPS[sampler.get(key, 10497)] for key in ("wrapS", "wrapT")}
        if len(wraps) > 1:
            self.scene.lose("two wrap modes on one texture are one")
        texels = self._texels(info).astype(np.float32) / np.float32(255)
        scale, offset = transform.get("scale", [1, 1]), transform.get("offset", [0, 0])
        sine, cosine = np.sin(transform.get("rotation", 0.0)), np.cos(transform.get("rotation", 0.0))
        matrix = [
            [cosine * scale[0], sine * scale[1], offset[0]],
            [-sine * scale[0], cosine * scale[1], offset[1]],
            [0, 0, 1],
        ]
        return {
            "type": "bitmap",
            "data": mi.TensorXf(np.ascontiguousarray(convert(texels))),
            "raw": True,
            "filter_type": "nearest" if sampler.get("magFilter") == 9728 else "bilinear",
            "wrap_mode": min(wraps),
            "to_uv": mi.ScalarTransform3f(matrix),
        }


def _linear(x):
    """Linear values of sRGB-encoded ones (IEC 61966-2-1)."""
    return np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4).astype(np.float32)


def medium(said):
    """A Mitsuba medium from coefficients (1/m), or None."""
    absorbs, scatters = (np.array((said or {}).get(key, [0, 0, 0]), float) for key in ("sigma_a", "sigma_s"))
    sigma = absorbs + scatters
    if not sigma.any():
        return None
    most = float(sigma.max())
    found = {
        "type": "homogeneous",
        "albedo": 0.0,
        "sigma_t": {"type": "rgb", "value": (sigma / most).tolist()},
        "scale": most,
    }
    if scatters.any():
        albedo = np.divide(scatters, sigma, out=np.zeros(3), where=sigma > 0)
        found |= {
            "albedo": {"type": "rgb", "value": albedo.tolist()},
            "phase": {"type": "hg", "g": float(said.get("g", 0.0))},
        }
    return found


def _blend(first, second, weight):
    return {"type": "blendbsdf", "weight": weight, "first": first, "second": second}


mitsuba_lobes.register()
