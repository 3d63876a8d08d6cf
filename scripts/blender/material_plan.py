"""What becomes of one material: which of its quantities are numbers, which are images that glTF can say as they are,
and which are baked."""

from dataclasses import fields

import bpy
import numpy

import gltfmaterial
import direct_images
import shading
import standin
from gltfmaterial import PLAIN
from graph import is_constant, source_socket
from matching import Matched, match

_PASSES = {
    "base": ("base",), "surface": ("transmission", "roughness", "metallic"),
    "cover": ("alpha", "coat", "coat_roughness"), "gloss": ("specular", "sheen_roughness", "ior"),
    "specular_colour": ("specular_colour",), "sheen": ("sheen",), "emission": ("emission",),
    "stretch": ("direction", "anisotropy"), "normal": ("normal",),
}
_SPOKEN = {
    "base": "Base Color", "transmission": "Transmission", "roughness": "Roughness", "metallic": "Metallic",
    "alpha": "Alpha", "coat": "Coat", "coat_roughness": "Coat Roughness", "specular": "Specular", "ior": "IOR",
    "sheen_roughness": "Sheen Roughness", "specular_colour": "Specular Tint", "sheen": "Sheen", "emission": "Emission",
    "anisotropy": "Anisotropy", "direction": "the direction of Anisotropy", "normal": "Normal",
}
_WITHOUT = {  # what stands where nothing may be baked
    "base": (0.8,) * 3, "emission": (1.0,) * 3, "roughness": 0.5, "metallic": 0.0, "transmission": 0.0, "alpha": 1.0,
    "ior": 1.5, "specular": 1.0, "specular_colour": (1.0,) * 3, "coat": 0.0, "coat_roughness": 0.0,
    "sheen": (0.0,) * 3, "sheen_roughness": 0.5, "anisotropy": 0.0, "normal": None,
}
_STEEP = 0.75  # cosine
_IS_STEEP = ("its normals lean by more than 40 degrees from the surface: its shine is brighter there than in Cycles, "
             "which loses part of it; use a Displace modifier for relief that steep")


def matt(colour):
    """The channels of a Lambertian surface, which is what Cycles makes of a material without nodes."""
    return {f.name: getattr(Matched(), f.name) for f in fields(Matched)} | {"base": tuple(colour), "direction": 0.0}


class Plan:
    """What becomes of one material: `channels` as gltfmaterial.write takes them, and `passes`, {name: value to bake}.

    `unbaked` are the channels where the baker cannot go. Without `may_bake` what would be baked is named instead.
    """

    def __init__(self, material, baker, may_bake, undo, warn):
        self.material, self.baker, self.may_bake, self.undo, self.warn = material, baker, may_bake, undo, warn
        self.passes, self.channels, self.unbaked, self.of_object = {}, {}, {}, False
        output = shading.output_of(shading.nodes_of(material))
        self.graph, self.matched = match(material, output, undo, self.say)
        self.links = {}
        self._plan(output)

    def say(self, what):
        self.warn(f'material "{self.material.name}"', what)

    def _plan(self, output):
        values = {f.name: getattr(self.matched, f.name) for f in fields(Matched)}
        del values["faceted"]
        tangent = values.pop("tangent")
        values["direction"] = self._direction(tangent) if tangent is not None else 0.0
        self._fold(values)
        if values["emission"] == (0.0,) * 3 or values["strength"] == 0.0:
            values["emission"], values["strength"] = (0.0,) * 3, 1.0
        self._displacement(output, values)
        self._name_plain(values)
        if not (is_constant(values["strength"]) and (is_constant(values["emission"]) or "emission" in self.links)):
            values["emission"] = self.graph.multiply(values["emission"], values["strength"])
            values["strength"] = 1.0
        varying = [n for n, v in values.items() if n not in self.links and not is_constant(v)]
        if self.bumped and "normal" not in varying:
            varying.append("normal")
        if not self.may_bake:
            self._without(values, varying)
            varying = []
        self.channels = {n: PLAIN if n in self.links else v for n, v in values.items()}
        self.unbaked = {n: _WITHOUT.get(n, 0.0) if n in varying else v for n, v in self.channels.items()}
        for name, parts in _PASSES.items():
            if any(part in varying for part in parts):
                self.passes[name] = self._packed(name, parts, values)
        if self.passes:
            if any(n.type == "AMBIENT_OCCLUSION" and not n.only_local for t in self.graph.trees() for n in t.nodes):
                self.say("its Ambient Occlusion node sees the object alone, without what stands around it")
            standin.read_generated(self.graph)
            self.of_object = standin.of_object(self.graph)
            names = [_SPOKEN[n] for n in varying if n not in {"direction"}]
            self.say(f"{', '.join(names)} {'is' if len(names) == 1 else 'are'} baked to images of {self.baker.size} x "
                     f"{self.baker.size} texels")
            if "ior" in varying:
                self.say("IOR varies: its mean is taken")

    def _fold(self, values):
        """Make numbers of what mere functions of numbers give."""
        folded = [n for n, v in values.items() if not is_constant(v) and n != "normal" and not self.graph.varies(v)]
        if folded:
            found = self.baker.constants(self.graph, [values[n] for n in folded])
            for name, value in zip(folded, found):
                colour = isinstance(getattr(Matched, name, 0.0), tuple)
                values[name] = (value,) * 3 if colour and isinstance(value, float) else value

    def _displacement(self, output, values):
        """Displacement bends normals in Cycles unless it is told to move the surface."""
        self.bumped = output.inputs["Displacement"].is_linked
        method = getattr(self.material, "displacement_method", "BUMP")
        if self.bumped and method != "BUMP":
            self.say("true displacement is not carried: use a Displace modifier")
        self.bumped = self.bumped and method != "DISPLACEMENT"

    def _direction(self, tangent):
        """The direction (x, y, 0) of a stretch against the tangents of the UV map that is baked."""
        g = self.graph
        along, geometry = g.tree.nodes.new("ShaderNodeTangent"), g.tree.nodes.new("ShaderNodeNewGeometry")
        along.direction_type, along.uv_map = "UV_MAP", standin.UV
        normal = geometry.outputs["Normal"]
        across = g.node("ShaderNodeVectorMath", "CROSS_PRODUCT", normal, along.outputs[0])
        x, y = (g.node("ShaderNodeVectorMath", "DOT_PRODUCT", tangent, axis, output="Value")
                for axis in (along.outputs[0], across))
        long = g.power(g.add(g.multiply(x, x), g.multiply(y, y)), 0.5)
        # As an image holds it, for a baked light is not negative.
        return g.combine_channels([g.add(g.multiply(g.divide(part, long), 0.5), 0.5) for part in (x, y)] + [0.0])

    def _name_plain(self, values):
        """Find what the exporter carries as it is: `self.links` by channel, the socket that it reads."""
        links, base, alpha = self.links, values["base"], values["alpha"]
        image = direct_images.image_of(base, data=False) if not is_constant(base) else None
        if image is not None:
            own = not is_constant(alpha) and alpha.node == image and alpha.name == "Alpha"
            if own or (is_constant(alpha) and direct_images.is_opaque(image.image)):
                links["base"] = base
                if own:
                    links["alpha"] = alpha
        found = {n: self._data(values[n], part) for n, part in (("roughness", "Green"), ("metallic", "Blue"))
                 if not is_constant(values[n])}
        if found and all(found.values()) and is_constant(values["transmission"]):
            if len({node.name for node, _ in found.values()}) == 1:
                links.update({name: socket for name, (_, socket) in found.items()})
        emission = values["emission"]
        if not is_constant(emission) and is_constant(values["strength"]):
            image = direct_images.image_of(emission, data=False)
            if image is not None and direct_images.is_opaque(image.image):
                links["emission"] = emission
        normal = values["normal"]
        stretched = not is_constant(values["direction"])
        if normal is not None and not self.bumped and not stretched and direct_images.normal_map(normal) is not None:
            links["normal"] = normal
            if direct_images.leaning_share(normal.node, _STEEP) > 0.01:
                self.say(_IS_STEEP)

    def _data(self, value, part):
        """The Image Texture node of which a number is the `part`, or the grey, and the socket to read; or None."""
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

    def _without(self, values, varying):
        for name in varying:
            value = values[name]
            if name == "direction":
                self.say("Anisotropy has no direction that is not baked: the highlight is round, leave out --no-bake")
                values["anisotropy"] = 0.0
                continue
            source = value.node.bl_label if isinstance(value, bpy.types.NodeSocket) else "Displacement"
            self.say(f"{_SPOKEN[name]} comes from a {source} node and is not baked: leave out --no-bake to carry it")
            values[name] = _WITHOUT.get(name)

    def _packed(self, name, parts, values):
        if name == "normal":
            return values["normal"]
        if name == "stretch":
            split = self.graph.tree.nodes.new("ShaderNodeSeparateXYZ")
            self.graph.connect(values["direction"], split.inputs[0])
            return self.graph.combine_channels([*split.outputs[:2], values["anisotropy"]])
        if len(parts) == 1:
            return values[parts[0]]
        return self.graph.combine_channels([self.graph.grey(values[part]) for part in parts])

    def resolved(self, baked):
        """The channels, with texels in the place of what was baked: {pass: texels}."""
        channels = dict(self.channels)
        for name, texels in baked.items():
            covered = texels[..., 3] > 0
            parts = _PASSES[name]
            if name == "normal":
                channels["normal"] = _normals(texels, covered)
                if channels["normal"] is not None and numpy.mean(channels["normal"][covered][:, 2] < _STEEP) > 0.01:
                    self.say(_IS_STEEP)
                continue
            if name == "stretch":
                channels["direction"] = texels[..., :2] * 2 - 1
                parts, texels = ("anisotropy",), texels[..., 2:]
            for i, part in enumerate(parts):
                if part in channels and is_constant(channels[part]):
                    continue
                one = texels[..., :3] if len(parts) == 1 and name != "stretch" else texels[..., i]
                same = gltfmaterial.uniform(one, covered)
                channels[part] = one if same is None else same
                if part == "ior" and same is None:
                    channels[part] = float(one[covered].mean())
        return channels

    def finished(self):
        """A material that ends in a Principled shader, with the images that the exporter carries."""
        graph, tree = self.graph, self.graph.tree
        node = tree.nodes.new("ShaderNodeBsdfPrincipled")
        sockets = {"base": "Base Color", "alpha": "Alpha", "roughness": "Roughness", "metallic": "Metallic",
                   "emission": "Emission Color", "normal": "Normal"}
        for name, value in self.links.items():
            graph.connect(value, node.inputs[sockets[name]])
        node.inputs["Emission Strength"].default_value = 1.0 if "emission" in self.links else 0.0
        transmission = self.channels["transmission"]
        node.inputs["Transmission Weight"].default_value = transmission if isinstance(transmission, float) else 1.0
        output = shading.output_of(tree)
        tree.links.new(node.outputs[0], output.inputs["Surface"])
        material = graph.material.copy()
        self.undo.callback(bpy.data.materials.remove, material)
        tree.nodes.remove(node)
        return material


def _normals(texels, covered):
    """Tangent-space normals (x, y, z), or None where none is bent."""
    bent = texels[..., :3] * 2 - 1
    if numpy.abs(bent[covered][:, :2]).max(initial=0.0) < 2e-3:
        return None
    bent[~covered] = (0, 0, 1)
    return bent
