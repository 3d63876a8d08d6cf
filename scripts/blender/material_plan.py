"""Decides how to export each quantity of a material: as a constant, as an image that glTF can use directly, or
baked."""

from dataclasses import fields

import bpy
import numpy

import gltfmaterial
import direct_images
import standin
from gltfmaterial import PLAIN
from graph import is_constant
from lobes import METALLIC, ROUGH, ROUGH_METAL_WARNING
from matching import Matched, match
from shading import source, source_socket

_PASSES = {
    "base": ("base",), "surface": ("transmission", "roughness", "metallic"),
    "cover": ("alpha", "coat", "coat_roughness"), "gloss": ("specular", "sheen_roughness", "ior"),
    "specular_colour": ("specular_colour",), "sheen": ("sheen",), "emission": ("emission",),
    "stretch": ("direction", "anisotropy"), "normal": ("normal",), "sheet": ("sheet",), "sheet_colour": ("sheet_colour",),
    "diffuse_roughness": ("diffuse_roughness",), "coat_ior": ("coat_ior",), "coat_colour": ("coat_colour",),
    "film": ("film", "film_ior"),
}
_DISPLAY_NAMES = {
    "base": "Base Color", "transmission": "Transmission", "roughness": "Roughness", "metallic": "Metallic",
    "alpha": "Alpha", "coat": "Coat", "coat_roughness": "Coat Roughness", "specular": "Specular", "ior": "IOR",
    "sheen_roughness": "Sheen Roughness", "specular_colour": "Specular Tint", "sheen": "Sheen", "emission": "Emission",
    "anisotropy": "Anisotropy", "direction": "the direction of Anisotropy", "normal": "Normal",
    "diffuse_roughness": "Diffuse Roughness", "coat_ior": "Coat IOR", "coat_colour": "Coat Tint", "sheet": "Translucency", "sheet_colour": "the colour of Translucency",
    "film": "Thin Film Thickness", "film_ior": "Thin Film IOR",
}
_UNBAKED_DEFAULTS = {  # values of varying quantities if nothing may be baked
    "base": (0.8,) * 3, "emission": (1.0,) * 3, "roughness": 0.5, "metallic": 0.0, "transmission": 0.0, "alpha": 1.0,
    "ior": 1.5, "specular": 1.0, "specular_colour": (1.0,) * 3, "coat": 0.0, "coat_roughness": 0.0,
    "sheen": (0.0,) * 3, "sheen_roughness": 0.5, "anisotropy": 0.0, "normal": None, "sheet": 0.0,
    "sheet_colour": (1.0,) * 3, "diffuse_roughness": 0.0, "coat_ior": 1.5, "coat_colour": (1.0,) * 3,
    "film": 0.0, "film_ior": 1.33,
}
_MEANS = ("ior", "film_ior")  # quantities that have no texture
_MIN_ROUGH_METAL = 0.05  # share of texels that is worth a warning
_STEEP_COSINE, _OLD_STEEP_COSINE = 0.75, 0.97  # between the shading and the surface normal; the latter before Blender 4.5
_GLASS_STEEP_COSINE = 0.955  # the same of glass
_MIN_STEEP = 0.01  # share of texels that is worth a warning
_STEEP_WARNING = (
    "its normals lean by more than 40 degrees from the surface: its shine is brighter there than in Cycles, "
    "which loses part of it; use a Displace modifier for relief that steep")
_GLASS_STEEP_WARNING = (
    "its normals lean by more than 17 degrees from the surface: its glass is a few per cent brighter there than in Cycles, "
    "which loses light at such normals; use a Displace modifier for relief that steep, or a weaker map")
_OLD_STEEP_WARNING = (
    "its normals lean by more than 14 degrees from the surface: Cycles of this version of Blender turns them towards the "
    "viewer, which Blender 4.5 and caustique do not; use a Displace modifier to see the same in both")
_OLD_BUMP_WARNING = (
    "Cycles before Blender 4.4 smooths its bumps over a pixel of the picture, which Blender 4.4 and caustique do not: in "
    "small pictures they are steeper here; "
    "render larger, or use a Displace modifier")


def matt(colour):
    """The channels of a diffuse surface, as Cycles renders a material without nodes."""
    return {f.name: getattr(Matched(), f.name) for f in fields(Matched)} | {"base": tuple(colour), "direction": 0.0}


class Plan:
    """How one material is exported: `channels` for gltfmaterial.write, and `passes`, {name: value to bake}.

    `unbaked`: the channels for objects that cannot be baked. Without `may_bake` nothing is baked, and a warning names
    each loss. `stretched`: some object with the material stretches its normal maps.
    """

    def __init__(self, material, baker, may_bake, undo, warn, stretched=False):
        self.material, self.baker, self.may_bake, self.undo, self.warn = material, baker, may_bake, undo, warn
        self.stretched = stretched
        self.passes, self.channels, self.unbaked, self.of_object = {}, {}, {}, False
        self.varies_on_object = True
        self.graph, self.matched = match(material, undo, self.say, stretched)
        direct_images.warn_of_missing(self.graph.trees(), f'material "{material.name}"', warn)
        self.links = {}
        self._plan()

    def say(self, what):
        self.warn(f'material "{self.material.name}"', what)

    def _plan(self):
        values = {f.name: getattr(self.matched, f.name) for f in fields(Matched)}
        del values["faceted"]
        inside = values.pop("subsurface")
        tangent = values.pop("tangent")
        values["direction"] = self._direction(tangent) if tangent is not None else 0.0
        self._fold_constants(values)
        if values["emission"] == (0.0,) * 3 or values["strength"] == 0.0:
            values["emission"], values["strength"] = (0.0,) * 3, 1.0
        self._displacement()
        self._find_direct_images(values)
        if not (is_constant(values["strength"]) and (is_constant(values["emission"]) or "emission" in self.links)):
            values["emission"] = self.graph.multiply(values["emission"], values["strength"])
            values["strength"] = 1.0
        varying = [n for n, v in values.items() if n not in self.links and not is_constant(v)]
        if self.bumped and "normal" not in varying:
            varying.append("normal")
        if not self.may_bake:
            self._drop_varying(values, varying)
            varying = []
        self.channels = {n: PLAIN if n in self.links else v for n, v in values.items()} | {"subsurface": inside}
        self.unbaked = {n: self._unbaked(n) if n in varying else v for n, v in self.channels.items()}
        for name, parts in _PASSES.items():
            if any(part in varying for part in parts):
                self.passes[name] = self._pack(name, parts, values)
        if self.passes:
            if any(n.type == "AMBIENT_OCCLUSION" and not n.only_local for t in self.graph.trees() for n in t.nodes):
                self.say("its Ambient Occlusion node sees the object alone, without what stands around it; "
                         "bake it to an image in Cycles, and link that image")
            made = standin.read_coordinates(self.graph) | self.graph.keep_alpha()
            self.passes = {name: value if value is None or is_constant(value) else made.get(value, value)
                           for name, value in self.passes.items()}
            self.of_object = standin.depends_on_object(self.graph)
            self.varies_on_object = any(value is None or self.graph.varies(value, standin.is_even_on_object)
                                        for value in self.passes.values())
            names = [_DISPLAY_NAMES[n] for n in varying if n != "direction" or len(varying) == 1]
            self.say(f"{', '.join(names)} {'is' if len(names) == 1 else 'are'} baked to images of {self.baker.size} x "
                     f"{self.baker.size} texels, which blur finer detail; use image textures there, or a larger "
                     "--bake-size of export.py")
            for name in _MEANS:
                if name in varying:
                    self.say(f"{_DISPLAY_NAMES[name]} varies: its mean is taken; "
                             "use one value, or assign two materials to the faces")

    def _fold_constants(self, values):
        """Replace values that depend on constants alone by numbers."""
        folded = [n for n, v in values.items() if not is_constant(v) and n != "normal" and not self.graph.varies(v)]
        if folded:
            found = self.baker.constants(self.graph, [values[n] for n in folded])
            for name, value in zip(folded, found):
                colour = isinstance(getattr(Matched, name, 0.0), tuple)
                values[name] = (value,) * 3 if colour and isinstance(value, float) else value

    def _displacement(self):
        """Set `bumped`: in Cycles, displacement changes normals alone unless the material moves the surface."""
        self.bumped = source(self.graph.output.inputs["Displacement"])[0] is not None
        method = getattr(self.material, "displacement_method", "BUMP")
        if self.bumped and method != "BUMP":
            self.say("true displacement is not carried; use a Displace modifier")
        self.bumped = self.bumped and method != "DISPLACEMENT"

    def _direction(self, tangent):
        """Direction (x, y, 0) of the anisotropy in the tangent frame of the baked UV map, mapped from [-1, 1] to [0,
        1]."""
        g = self.graph
        along, geometry = g.tree.nodes.new("ShaderNodeTangent"), g.tree.nodes.new("ShaderNodeNewGeometry")
        along.direction_type, along.uv_map = "UV_MAP", standin.UV
        normal = geometry.outputs["Normal"]
        across = g.node("ShaderNodeVectorMath", "CROSS_PRODUCT", normal, along.outputs[0])
        x, y = (g.node("ShaderNodeVectorMath", "DOT_PRODUCT", tangent, axis, output="Value")
                for axis in (along.outputs[0], across))
        long = g.power(g.add(g.multiply(x, x), g.multiply(y, y)), 0.5)
        # In [0, 1], because baked emission cannot be negative.
        return g.combine_channels([g.add(g.multiply(g.divide(part, long), 0.5), 0.5) for part in (x, y)] + [0.0])

    def _find_direct_images(self, values):
        """Find images that Blender's exporter writes itself: `self.links`, {channel: socket to export}."""
        links, base, alpha = self.links, values["base"], values["alpha"]
        image = direct_images.image_of(base, data=False) if not is_constant(base) else None
        if image is not None:
            own = not is_constant(alpha) and alpha.node == image and alpha.name == "Alpha"
            if own or (is_constant(alpha) and direct_images.is_opaque(image.image)):
                links["base"] = base
                if own:
                    links["alpha"] = alpha
        found = {n: self._data_image(values[n], part) for n, part in (("roughness", "Green"), ("metallic", "Blue"))
                 if not is_constant(values[n])}
        if found and all(found.values()) and is_constant(values["transmission"]):
            if len({node.name for node, _ in found.values()}) == 1:
                links.update({name: socket for name, (_, socket) in found.items()})
                texels = direct_images.texels(next(iter(found.values()))[0].image)
                green, blue = texels[:, 1:3].T if texels.shape[1] > 2 else (texels[:, 0],) * 2
                self._warn_of_rough_metal(green if "roughness" in found else values["roughness"],
                                          blue if "metallic" in found else values["metallic"])
        emission = values["emission"]
        if not is_constant(emission) and is_constant(values["strength"]):
            image = direct_images.image_of(emission, data=False)
            if image is not None and direct_images.is_opaque(image.image):
                links["emission"] = emission
        normal = values["normal"]
        stretched = not is_constant(values["direction"])
        if normal is not None and not self.bumped and not stretched and direct_images.normal_map(normal) is not None:
            links["normal"] = normal
            self._warn_of_steep_normals(direct_images.cosines(normal.node))

    def _data_image(self, value, part):
        """The Image Texture node whose channel `part` or grey value is `value`, and the socket to export; or None."""
        node = value.node
        grey = node.type == "RGBTOBW"
        if not grey and (node.type != "SEPARATE_COLOR" or node.mode != "RGB" or value.name != part):
            return None
        output, path = source_socket(node.inputs[0])
        if path or output is None or not output.is_output:
            return None
        image = direct_images.image_of(output, data=True)
        if image is None or (grey and not direct_images.is_grey(image.image)):
            return None
        return image, output if grey else value

    def _drop_varying(self, values, varying):
        for name in varying:
            value = values[name]
            if name == "direction":
                self.say("Anisotropy has no direction that is not baked: the highlight is round; leave out --no-bake")
                values["anisotropy"] = 0.0
                continue
            source = value.node.bl_label if isinstance(value, bpy.types.NodeSocket) else "Displacement"
            self.say(f"{_DISPLAY_NAMES[name]} comes from a {source} node and is not baked; "
                     "leave out --no-bake to carry it")
            values[name] = self._unbaked(name)

    def _unbaked(self, name):
        """The constant that stands for a quantity that varies where nothing may be baked."""
        if name == "sheet_colour" and self.matched.subsurface is not None:
            name = "base"
        return _UNBAKED_DEFAULTS.get(name, 0.0)

    def _pack(self, name, parts, values):
        if name == "normal":
            return values["normal"]
        if name == "stretch":
            split = self.graph.tree.nodes.new("ShaderNodeSeparateXYZ")
            self.graph.connect(values["direction"], split.inputs[0])
            return self.graph.combine_channels([*split.outputs[:2], values["anisotropy"]])
        if len(parts) == 1:
            return values[parts[0]]
        return self.graph.combine_channels([self.graph.grey(values[part]) for part in parts])

    def resolve(self, baked):
        """The channels with the baked texels filled in. `baked`: {pass: texels}."""
        channels = dict(self.channels)
        for name, texels in baked.items():
            covered = texels[..., 3] > 0
            parts = _PASSES[name]
            if name == "normal":
                channels["normal"] = _normals(texels, covered)
                normals = channels["normal"]
                if normals is not None:
                    self._warn_of_steep_normals(normals[covered][:, 2])
                continue
            if name == "stretch":
                channels["direction"] = texels[..., :2] * 2 - 1
                parts, texels = ("anisotropy",), texels[..., 2:]
            for i, part in enumerate(parts):
                if part in channels and is_constant(channels[part]):
                    continue
                one = texels[..., :3] if isinstance(getattr(Matched, part, 0.0), tuple) else texels[..., i]
                same = gltfmaterial.uniform(one, covered)
                channels[part] = one if same is None else same
                if part in _MEANS and same is None:
                    mean = one[covered].mean(0)
                    channels[part] = tuple(map(float, mean)) if mean.ndim else float(mean)
        if "surface" in baked:
            covered = baked["surface"][..., 3] > 0
            self._warn_of_rough_metal(*(value[covered] if isinstance(value, numpy.ndarray) else value
                                        for value in (channels["roughness"], channels["metallic"])))
        return channels

    def _warn_of_steep_normals(self, cosines):
        """Warn if shading normals lean too far from the surface. `cosines`: of the angles between both normals."""
        if bpy.app.version < (4, 4, 0) and (self.bumped or any(n.type == "BUMP" for t in self.graph.trees() for n in t.nodes)):
            self.say(_OLD_BUMP_WARNING)
        if numpy.mean(cosines < _STEEP_COSINE) > _MIN_STEEP:
            self.say(_STEEP_WARNING)
        elif self.matched.transmission != 0.0 and numpy.mean(cosines < _GLASS_STEEP_COSINE) > _MIN_STEEP:
            self.say(_GLASS_STEEP_WARNING)
        elif bpy.app.version < (4, 5, 0) and numpy.mean(cosines < _OLD_STEEP_COSINE) > _MIN_STEEP:
            self.say(_OLD_STEEP_WARNING)

    def _warn_of_rough_metal(self, rough, metal):
        """Warn of rough metal from texels or numbers, of which at least one is an array. Other values are unknown."""
        if all(isinstance(value, (float, numpy.ndarray)) for value in (rough, metal)):
            if numpy.mean((rough > ROUGH) & (metal > METALLIC)) > _MIN_ROUGH_METAL:
                self.say(ROUGH_METAL_WARNING)

    def make_principled(self):
        """A copy of the material with one Principled shader, linked to the images that the exporter writes."""
        graph, tree = self.graph, self.graph.tree
        node = tree.nodes.new("ShaderNodeBsdfPrincipled")
        sockets = {"base": "Base Color", "alpha": "Alpha", "roughness": "Roughness", "metallic": "Metallic",
                   "emission": "Emission Color", "normal": "Normal"}
        for name, value in self.links.items():
            graph.connect(value, node.inputs[sockets[name]])
        node.inputs["Emission Strength"].default_value = 1.0 if "emission" in self.links else 0.0
        transmission = self.channels["transmission"]
        node.inputs["Transmission Weight"].default_value = transmission if isinstance(transmission, float) else 1.0
        # What the exporter does not write, but looks for in materials of closed meshes.
        node.inputs["Subsurface Weight"].default_value = float(self.channels["subsurface"] is not None)
        tree.links.new(node.outputs[0], graph.output.inputs["Surface"])
        material = graph.material.copy()
        self.undo.callback(bpy.data.materials.remove, material)
        tree.nodes.remove(node)
        return material


def _normals(texels, covered):
    """Tangent-space normals (x, y, z), or None if all equal the surface normal."""
    bent = texels[..., :3] * 2 - 1
    if numpy.abs(bent[covered][:, :2]).max(initial=0.0) < 2e-3:
        return None
    bent[~covered] = (0, 0, 1)
    return bent
