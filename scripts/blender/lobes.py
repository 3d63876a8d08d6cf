"""Translates each shader node of Cycles to a lobe of the glTF material, with a warning for each loss."""

from dataclasses import dataclass, replace

import bpy

import subsurface
from graph import is_constant

WHITE, BLACK = (1.0,) * 3, (0.0,) * 3
# Roughness and share of metal above which the shape of highlights differs visibly from Cycles.
ROUGH, METALLIC = 0.42, 0.5
_BRIGHT = 0.5  # largest component of the colour, below which little light scatters between facets
ROUGH_METAL_WARNING = (
    "the light that its rough metal scatters between facets leaves in all directions: in Cycles it stays in the highlight, "
    "which is up to a quarter brighter there; lower Roughness to 0.42 to see the same in both")


@dataclass
class Lobe:
    """Quantities of glTF's metallic-roughness model and its extensions, each a value of a graph.

    `roughness` is perceptual (GGX alpha is its square). With `ior` 0 the reflectance is `specular` times
    `specular_colour` at all angles. `anisotropy` is the extension's strength, `tangent` the direction of the larger
    alpha.
    """
    base: object = BLACK
    diffuse_roughness: object = 0.0
    metallic: object = 0.0
    roughness: object = 1.0
    transmission: object = 0.0
    ior: object = 1.5
    specular: object = 0.0
    specular_colour: object = WHITE
    reflection: tuple = WHITE  # factor on the reflectance at all angles, a constant
    single_scattering: bool = False  # light that facets scatter more than once is lost
    coat: object = 0.0
    coat_roughness: object = 0.0
    coat_ior: object = 1.5
    coat_colour: object = WHITE  # of light that passes the coat in and out along its normal
    sheen: object = BLACK
    sheen_roughness: object = 0.5
    anisotropy: object = 0.0
    film: object = 0.0  # thickness of a thin film (nm)
    film_ior: object = 1.33
    tangent: object = None
    normal: object = None
    emission: object = BLACK
    strength: object = 0.0
    sheet: object = 0.0  # share of the diffuse light that leaves on the other side, and its colour
    sheet_colour: object = WHITE
    subsurface: object = None  # subsurface.Subsurface behind the surface: `sheet` of the light enters, of `sheet_colour` it leaves
    thin: bool = False
    faceted: bool = True  # roughness and anisotropy have an effect


class Reader:
    """Translates leaves of a surface; `say` receives a warning for each loss or approximation."""

    def __init__(self, graph, say):
        self.graph, self.say = graph, say

    def lobe(self, leaf):
        """The lobe of a leaf, or None for a transparent or emissive shader."""
        node = leaf.node
        if leaf.coat is not None:
            return self._dielectric(leaf)
        read = _READERS.get(leaf.type)
        if read is None:
            self.say(f"its {node.bl_label} shader is approximated by diffuse reflection of its colour; "
                     "use a Principled BSDF, whose inputs are all carried")
            read = Reader._diffuse
        return read(self, leaf)

    def get(self, leaf, name):
        """The value of an input of the leaf's node, or None if this version of Blender lacks the input."""
        socket = leaf.node.inputs.get(name)
        return None if socket is None else self.graph.value(socket, leaf.path)

    def normal(self, leaf, name="Normal"):
        """The socket of the shading normal, or None if it is not linked."""
        value = self.get(leaf, name)
        return None if value is None or is_constant(value) else value

    def _diffuse(self, leaf):
        colour = self.get(leaf, "Color") or self.get(leaf, "Base Color") or BLACK
        lobe = Lobe(base=colour, normal=self.normal(leaf), faceted=False)
        if leaf.type == "BSDF_DIFFUSE":
            self._roughen(lobe, self._diffuse_roughness(leaf, "Roughness"))
        return lobe

    def _diffuse_roughness(self, leaf, name):
        value = self.get(leaf, name)
        return 0.0 if value is None else self.graph.clamp(value)

    def _roughen(self, lobe, roughness, share=1.0):
        """Make the share of the lobe that is diffuse rough, of the mean albedo that it has in Cycles.

        Cycles multiplies light that is scattered several times by the colour once more, and before Blender 4.3 leaves it
        out. The fit is within 0.005 of the albedo.
        """
        lobe.diffuse_roughness = roughness
        if is_constant(roughness) and roughness == 0:
            return
        g, base = self.graph, lobe.base
        lost = g.multiply(roughness, g.subtract(0.215, g.multiply(roughness, 0.069)))
        if bpy.app.version >= (4, 3):
            lost = g.multiply(lost, g.subtract(1.0, base))
        lobe.base = g.multiply(base, g.subtract(1.0, g.multiply(g.multiply(lost, base), share)))

    def _subsurface(self, leaf):
        lobe = self._diffuse(leaf)
        inputs = ("Radius", "Scale", "IOR", "Anisotropy")
        entry = self.get(leaf, "IOR"), self.get(leaf, "Roughness")
        self._enter(leaf, lobe, 1.0, (inputs, entry), None, getattr(leaf.node, "falloff", "RANDOM_WALK"))
        return lobe

    def _enter(self, leaf, lobe, weight, inputs_and_entry, surface, method):
        """Set the medium below the surface, and the share of the diffuse light that enters it."""
        # Blender hides the index of refraction where the method does not use it.
        inputs, entry = inputs_and_entry
        values = [[1.4 if value is None else value for value in given]
                  for given in ((self.get(leaf, name) for name in inputs), entry)]
        lobe.subsurface = subsurface.read(lobe.base, *values, surface, method)
        if lobe.subsurface is not None:
            lobe.sheet, lobe.sheet_colour = weight, lobe.base
        elif lobe.base != BLACK:
            self.say("subsurface scattering is carried where its radius, index and anisotropy are constant: its light "
                     "leaves where it arrives; "
                     "unlink Radius, Scale, IOR and Anisotropy")

    def _translucent(self, leaf):
        return Lobe(sheet=1.0, sheet_colour=self.get(leaf, "Color"), normal=self.normal(leaf), faceted=False)

    def _glossy(self, leaf):
        """Glossy reflectance is constant; a metal's rises at grazing angles, by 1/21 of the remainder on average."""
        colour = self.get(leaf, "Color")
        colour = self.graph.maximum(self.graph.multiply(self.graph.subtract(colour, 1 / 21), 21 / 20), 0.0)
        return self._facets(leaf, Lobe(base=colour, metallic=1.0, specular=0.0))

    def _metal(self, leaf):
        if getattr(leaf.node, "fresnel_type", "F82") == "PHYSICAL_CONDUCTOR":
            self.say("the conductor's reflectance is Schlick's from the one at normal incidence; "
                     "choose F82 Tint with a white Edge Tint to see the same in both")
            n, k = (self.graph.value(leaf.node.inputs[name], leaf.path) for name in ("IOR", "Extinction"))
            colour = self._conductor(n, k)
        else:
            colour = self.get(leaf, "Base Color")
            if self.get(leaf, "Edge Tint") != WHITE:
                self.say("the Edge Tint of its Metallic shader is not carried: the rim reflects white; "
                         "set Edge Tint to white to see the same in both")
        return self._facets(leaf, Lobe(base=colour, metallic=1.0))

    def _conductor(self, n, k):
        g = self.graph
        k2 = g.multiply(k, k)
        below, above = g.subtract(n, 1.0), g.add(n, 1.0)
        return g.divide(g.add(g.multiply(below, below), k2), g.add(g.multiply(above, above), k2))

    def _glass(self, leaf):
        colour = self.get(leaf, "Color")
        lobe = Lobe(base=colour, roughness=self.get(leaf, "Roughness"), transmission=1.0, ior=self.get(leaf, "IOR"),
                    normal=self.normal(leaf))
        if leaf.type == "BSDF_GLASS":  # Cycles also tints its reflection
            lobe.specular = 1.0
            if is_constant(colour):
                lobe.reflection = tuple(min(max(c, 0.0), 1.0) for c in colour)
            else:
                self._tint(lobe, colour)
        self._distribution(leaf, lobe)
        self._film(leaf, lobe)
        return lobe

    def _tint(self, lobe, colour):
        """Tint the reflection at steep angles."""
        lobe.specular = self.graph.minimum(self.graph.max_component(colour), 1.0)
        lobe.specular_colour = self.graph.divide(colour, self.graph.maximum(lobe.specular, 1e-6))

    def mixed(self, lobe):
        """The lobe as a part of a mix, without a factor on the reflectance at all angles."""
        if lobe.reflection == WHITE:
            return lobe
        if min(lobe.reflection) < 0.65:
            self.say("the tint of its Glass shader's reflections is carried at steep angles only: its rim is brighter "
                     "than in Cycles; tint a Principled BSDF with Transmission instead, whose reflections are white in "
                     "both")
        found = replace(lobe, reflection=WHITE)
        self._tint(found, lobe.reflection)
        return found

    def _film(self, leaf, lobe):
        """Set the thin film. Metals have one from Blender 5.0 on."""
        thickness = self.get(leaf, "Thin Film Thickness")
        if thickness is None or thickness == 0.0 or (bpy.app.version < (5, 0) and lobe.metallic == 1.0):
            return
        lobe.film, lobe.film_ior = thickness, self.get(leaf, "Thin Film IOR")

    def _dielectric(self, leaf):
        """Glossy facets over a diffuse, refractive or transparent shader, mixed by Fresnel's equations."""
        socket, path = leaf.ior
        ior = self.graph.value(socket, path)
        if socket.node.type == "LAYER_WEIGHT":
            ior = self.graph.divide(1.0, self.graph.maximum(self.graph.subtract(1.0, ior), 1e-5))
        coat = leaf.coat
        lobe = Lobe(base=self.get(leaf, "Color"), ior=ior, specular=1.0, normal=self.normal(leaf),
                    specular_colour=self.get(coat, "Color"))
        if leaf.type != "BSDF_DIFFUSE":
            lobe.transmission, lobe.thin = 1.0, leaf.type == "BSDF_TRANSPARENT"
        return self._facets(coat, lobe)

    def _facets(self, leaf, lobe):
        """Set roughness, anisotropy and normal of a shader with GGX facets."""
        lobe.roughness, lobe.normal = self.get(leaf, "Roughness"), self.normal(leaf)
        self._distribution(leaf, lobe)
        stretch = self.get(leaf, "Anisotropy") if "Anisotropy" in leaf.node.inputs else self.get(leaf, "Anisotropic")
        if stretch is None or (is_constant(stretch) and stretch == 0):
            return lobe
        return self._stretched(leaf, lobe, stretch)

    def _distribution(self, leaf, lobe):
        if lobe.roughness != 0.0 and getattr(leaf.node, "distribution", "GGX") in {"BECKMANN", "ASHIKHMIN_SHIRLEY"}:
            self.say(f"its {leaf.node.distribution.title()} facets are taken for GGX; "
                     "choose Multiscatter GGX to see the same in both")
        # Blender's MULTI_GGX keeps the light that scatters between facets, as caustique does; its GGX loses it.
        known = is_constant(lobe.roughness) and is_constant(lobe.metallic)
        bright = not is_constant(lobe.base) or max(lobe.base) > _BRIGHT
        if getattr(leaf.node, "distribution", "") != "GGX" or lobe.roughness == 0.0:
            if known and bright and lobe.roughness > ROUGH and lobe.metallic > METALLIC:
                self.say(ROUGH_METAL_WARNING)
            return
        if lobe.metallic != 0.0:
            lobe.base = self._darkened(lobe)
        if (lobe.metallic, lobe.transmission) != (0.0, 0.0) and not (is_constant(lobe.roughness) and lobe.roughness < ROUGH):
            what = "approximated by a darker metal" if lobe.transmission == 0.0 else "not carried for glass"
            self.say(f"its distribution GGX loses light between rough facets, which is {what}; choose Multiscatter GGX "
                     "to see the same in both")

    def _darkened(self, lobe):
        """The base colour c / (1 + loss c) with which a metal that loses no light reflects as one that does.

        Such a metal reflects c E / (1 - c (1 - E)) on average [Kulla and Conty 2017], with E = 1 - loss.
        """
        g = self.graph
        return self._of_metal(lobe, g.divide(lobe.base, g.add(1.0, g.multiply(lobe.base, self._loss(lobe)))))

    def _loss(self, lobe):
        """The share of light that round facets of the lobe's roughness lose. A fit over GGX's alpha, within 0.01."""
        g = self.graph
        alpha = g.multiply(lobe.roughness, lobe.roughness)
        return g.multiply(alpha, g.add(0.2914, g.multiply(alpha, g.subtract(0.8964, g.multiply(alpha, 0.6038)))))

    def _of_metal(self, lobe, colour):
        """The base colour of a lobe whose metal has this colour."""
        g, rest = self.graph, self.graph.subtract(1.0, lobe.metallic)
        return g.add(g.multiply(colour, lobe.metallic), g.multiply(lobe.base, rest))

    def _stretched(self, leaf, lobe, stretch):
        """Set anisotropy and tangent from the stretch s.

        Cycles: alpha / a along the tangent, alpha a across, with a^2 = 1 - 0.9 s in Principled, else a = 1 - s.
        glTF: alpha across; along, alpha and 1 are interpolated by the squared strength.
        """
        g, turn = self.graph, self.get(leaf, "Anisotropic Rotation")
        if lobe.transmission == 0.0:
            self._keep_light_of_round_facets(lobe)
        alpha = g.multiply(lobe.roughness, lobe.roughness)
        if leaf.type == "BSDF_PRINCIPLED":
            aspect = g.power(g.subtract(1.0, g.multiply(0.9, stretch)), 0.5)
        else:
            # The other shaders are smoother along the tangent where their anisotropy is positive.
            turn, negative = self.get(leaf, "Rotation"), is_constant(stretch) and stretch < 0
            turn = turn if negative else g.add(turn, 0.25)
            aspect = g.subtract(1.0, g.multiply(stretch, -1.0 if negative else 1.0))
        along, across = g.divide(alpha, aspect), g.multiply(alpha, aspect)
        along = g.minimum(along, 1.0)
        rest = g.maximum(g.subtract(1.0, across), 1e-6)
        lobe.anisotropy = g.power(g.maximum(g.divide(g.subtract(along, across), rest), 0.0), 0.5)
        lobe.roughness = g.power(across, 0.5)
        lobe.tangent = self._tangent(leaf, turn)
        return lobe

    def _keep_light_of_round_facets(self, lobe):
        """Let stretched facets lose the light that they lose in Cycles, which returns only what round facets lose.

        It multiplies their highlight by 1 / (1 - c loss) on average, with c the colour.
        """
        g, lobe.single_scattering = self.graph, True
        bright = g.divide(lobe.base, g.subtract(1.0, g.multiply(lobe.base, self._loss(lobe))))
        if is_constant(bright) and max(bright) > 1.02 and lobe.metallic != 0.0:
            self.say("its stretched highlights lose the few per cent of light that facets scatter more than once; "
                     "darken its colour below 0.9 to see the same in both")
        lobe.base = self._of_metal(lobe, g.minimum(bright, 1.0))

    def _tangent(self, leaf, turns):
        """The rotated tangent of an anisotropic shader: the Tangent input, or Blender's default about the object's
        axis."""
        g, tangent = self.graph, self.normal(leaf, "Tangent")
        geometry = g.tree.nodes.new("ShaderNodeNewGeometry")
        if tangent is None:
            tangent = geometry.outputs["Tangent"]
        if is_constant(turns) and turns == 0:
            return tangent
        node = g.tree.nodes.new("ShaderNodeVectorRotate")
        node.rotation_type = "AXIS_ANGLE"
        g.connect(tangent, node.inputs["Vector"])
        g.connect(geometry.outputs["Normal"], node.inputs["Axis"])
        g.connect(g.multiply(turns, 6.283185307179586), node.inputs["Angle"])
        return node.outputs[0]

    def _sheen(self, leaf):
        if getattr(leaf.node, "distribution", "") == "ASHIKHMIN":
            self.say("its Ashikhmin sheen is taken for Microfiber; "
                     "choose Microfiber to see the same in both")
        return Lobe(sheen=self.get(leaf, "Color"), faceted=False, normal=self.normal(leaf),
                    sheen_roughness=self.get(leaf, "Roughness"))

    def _principled(self, leaf):
        g = self.graph
        lobe = Lobe(
            base=self.get(leaf, "Base Color"), metallic=g.clamp(self.get(leaf, "Metallic")),
            transmission=g.clamp(self.get(leaf, "Transmission Weight")), ior=self.get(leaf, "IOR"), specular=1.0,
            specular_colour=self.get(leaf, "Specular Tint"), coat=g.clamp(self.get(leaf, "Coat Weight")),
            coat_roughness=self.get(leaf, "Coat Roughness"), emission=self.get(leaf, "Emission Color"),
            strength=self.get(leaf, "Emission Strength"))
        # Principled glass applies the square root of the colour at each of two surfaces.
        clear = g.multiply(lobe.transmission, g.subtract(1.0, lobe.metallic))
        lobe.base = g.add(g.multiply(lobe.base, g.subtract(1.0, clear)), g.multiply(g.power(lobe.base, 0.5), clear))
        both = is_constant(clear) and 0 < clear < 1
        if both and is_constant(lobe.base) and max(lobe.base) - min(lobe.base) > 0.1:
            self.say("the colour of its diffuse and of its transmitted light is one: their mean is taken; "
                     "set Transmission > Weight to 0 or 1, or make Base Color grey")
        self._reflectance(leaf, lobe)
        self._facets(leaf, lobe)
        self._coverings(leaf, lobe)
        if lobe.metallic != 0.0 and self.get(leaf, "Specular Tint") != WHITE:
            self.say("the tint of its metal's rim (Specular Tint) is not carried: the rim reflects white; "
                     "set Specular > Tint to white to see the same in both")
        if lobe.metallic != 1.0 and lobe.transmission != 1.0:
            share = g.multiply(g.subtract(1.0, lobe.metallic), g.subtract(1.0, lobe.transmission))
            self._roughen(lobe, self._diffuse_roughness(leaf, "Diffuse Roughness"), share)
            weight = g.clamp(self.get(leaf, "Subsurface Weight"))
            if weight != 0.0 and lobe.transmission == 0.0:
                inputs = ("Subsurface Radius", "Subsurface Scale", "Subsurface IOR", "Subsurface Anisotropy")
                entry = self.get(leaf, "IOR"), g.power(self.get(leaf, "Roughness"), 2.0)
                self._enter(leaf, lobe, weight, (inputs, entry), (lobe.ior, lobe.specular), leaf.node.subsurface_method)
            elif weight != 0.0:
                self.say("subsurface scattering is not carried beside transmission: light leaves where it arrives; "
                         "set Transmission > Weight or Subsurface > Weight to 0")
        self._film(leaf, lobe)
        return lobe

    def _reflectance(self, leaf, lobe):
        """Set specular and index: Cycles scales the reflectance at normal incidence by twice the specular level."""
        g, level = self.graph, self.get(leaf, "Specular IOR Level")
        if is_constant(lobe.ior) and lobe.ior < 1:
            self.say(f"its IOR of {lobe.ior:.3g} is below 1, where it reflects more than in Cycles; use 1 or more")
        if lobe.transmission == 1.0:  # the level does not affect glass
            return
        if is_constant(level) and is_constant(lobe.ior) and 0 < level:
            if level != 0.5:
                f0 = min(((lobe.ior - 1) / (lobe.ior + 1)) ** 2 * 2 * level, 0.99)
                lobe.ior = (1 + f0 ** 0.5) / (1 - f0 ** 0.5)
        elif level != 0.5:
            lobe.specular = g.minimum(g.multiply(level, 2.0), 1.0)

    def _coverings(self, leaf, lobe):
        g = self.graph
        if lobe.coat != 0.0:
            if lobe.transmission != 0.0:
                self.say("its coat over glass dims light by the directions of light and view alike, in Cycles by that of the "
                         "view alone: it is a few per cent darker here; set Coat > Weight to 0, because glass has "
                         "reflections of its own")
            lobe.coat_ior, lobe.coat_colour = g.maximum(self.get(leaf, "Coat IOR"), 1.0), self.get(leaf, "Coat Tint")
            if lobe.coat_colour != WHITE:
                # Cycles applies the whole tint to emission, glTF's reader that of one passage: 1.146 / 2 on average.
                passed = g.power(lobe.coat_colour, 0.573)
                lobe.emission = g.multiply(lobe.emission, g.add(g.multiply(passed, lobe.coat), g.subtract(1.0, lobe.coat)))
            if self.normal(leaf, "Coat Normal") is not None:
                self.say("Coat Normal is not carried: the coat follows the surface; "
                         "unlink Coat > Normal")
        weight = self.get(leaf, "Sheen Weight")
        if weight != 0.0:
            self.say("what lies below its sheen is dimmed for the directions of light and view alike, in Cycles for that of "
                     "the view alone; "
                     "lower Sheen > Weight to see less of the difference")
            if lobe.coat != 0.0:
                self.say("its sheen lies below its coat, in Cycles above it; "
                         "set Sheen > Weight or Coat > Weight to 0")
            lobe.sheen = g.multiply(self.get(leaf, "Sheen Tint"), weight)
            lobe.sheen_roughness = self.get(leaf, "Sheen Roughness")


_READERS = {
    "BSDF_DIFFUSE": Reader._diffuse, "SUBSURFACE_SCATTERING": Reader._subsurface,
    "BSDF_TRANSLUCENT": Reader._translucent, "BSDF_GLOSSY": Reader._glossy, "BSDF_ANISOTROPIC": Reader._glossy,
    "BSDF_METALLIC": Reader._metal, "BSDF_GLASS": Reader._glass, "BSDF_REFRACTION": Reader._glass,
    "BSDF_SHEEN": Reader._sheen, "BSDF_VELVET": Reader._sheen, "BSDF_PRINCIPLED": Reader._principled,
}
