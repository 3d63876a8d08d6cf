"""Matches a material's surface to the glTF material: weighted closures are merged where the model can represent the
mix, and otherwise averaged, with a warning."""

from dataclasses import dataclass, fields, replace

import closures
import standin
from graph import Graph, is_constant
from lobes import BLACK, WHITE, Lobe, Reader
from shading import positive, source

_DIFFUSE = {"BSDF_DIFFUSE", "SUBSURFACE_SCATTERING", "BSDF_TOON", "BSDF_HAIR", "BSDF_HAIR_PRINCIPLED"}
_GLOSSY = {"BSDF_GLOSSY", "BSDF_ANISOTROPIC"}


@dataclass
class Matched(Lobe):
    """A lobe that represents a whole surface, with its coverage and emission."""
    alpha: object = 1.0


def match(material, undo, say, stretched=False):
    """The graph of `material` and its matched surface. `say` receives a warning for each loss.

    `stretched`: its normal maps read their axes from attributes. A material without a surface shader is black, or the
    boundary of its medium.
    """
    graph = Graph(material, undo)
    if stretched:
        standin.read_normal_map_axes(graph)
    socket, inside = graph.output.inputs["Surface"], source(graph.output.inputs["Volume"])[0] is not None
    tree = closures.read(socket)
    if tree is None:
        return graph, replace(_film(WHITE), thin=False) if inside else Matched()
    closures.fix_view_dependence(graph, socket, tree, say)
    weighed = closures.weigh(tree, graph)
    return graph, _Match(graph, say, closures.adds_up(tree)).surface(weighed, inside)


def _film(colour):
    """A thin film of this transmittance, without refraction and reflection."""
    return Matched(base=colour, roughness=0.0, transmission=1.0, ior=1.0, thin=True)


class _Match:
    def __init__(self, graph, say, adds_up):
        self.graph, self.say, self.adds_up = graph, say, adds_up
        self.reader = Reader(graph, say)

    def surface(self, weighed, has_volume):
        """Returns the surface of a mix of shaders, in terms of glTF. `weighed`: pairs of a shader node (leaf) and its
        weight."""
        g, clear, lobes, shining, kinds = self.graph, [], [], [], []
        self.adds_up &= all(leaf.type not in {"EMISSION", "HOLDOUT", "BSDF_RAY_PORTAL"} for leaf, _ in weighed)
        for leaf, weight in weighed:
            if leaf.type == "BSDF_TRANSPARENT" and leaf.coat is None:
                clear.append((weight, self.reader.get(leaf, "Color")))
            elif leaf.type == "EMISSION":
                shining.append((weight, self.reader.get(leaf, "Color"), self.reader.get(leaf, "Strength")))
            elif leaf.type in {"HOLDOUT", "BSDF_RAY_PORTAL"}:
                self.say(f"its {leaf.node.bl_label} shader is not carried: it is black; "
                         "mask the object in the compositor by its cryptomatte")
            else:
                lobe, part = self.reader.lobe(leaf), weight
                if leaf.type == "BSDF_PRINCIPLED":
                    alpha = g.clamp(self.reader.get(leaf, "Alpha"))
                    if alpha != 1.0:
                        part = g.multiply(weight, alpha)
                        clear.append((g.multiply(weight, g.subtract(1.0, alpha)), WHITE))
                    if lobe.strength != 0.0 and lobe.emission != BLACK:
                        shining.append((part, lobe.emission, lobe.strength))
                lobes.append((lobe, part))
                kinds.append("fresnel" if leaf.coat is not None else leaf.type)
        if not lobes:
            return self._through(clear, shining, has_volume)
        alpha, within = self._alpha(clear, lobes)
        if clear and any(lobe.transmission == 1.0 and not lobe.thin for lobe, _ in lobes):
            self.say("glass that is partly transparent is approximated: light that came in through its transparent "
                     "share is not within the glass; "
                     "cut holes into the mesh instead")
        found = self._merge([(lobe, within(part)) for lobe, part in lobes], kinds)
        found = Matched(**{f.name: getattr(found, f.name) for f in fields(Lobe)}, alpha=alpha)
        found.emission, found.strength = self._emission([(within(w), c, s) for w, c, s in shining])
        return found

    def _through(self, clear, shining, has_volume):
        """A surface without scattering: a film if it tints, emits or bounds a medium, else a hole (alpha 0)."""
        g = self.graph
        tint = BLACK
        for weight, colour in clear:
            tint = g.add(tint, g.multiply(weight, colour))
        emission, strength = self._emission(shining)
        if tint == BLACK:
            return Matched(emission=emission, strength=strength)
        if tint == WHITE and not shining and not has_volume:
            return Matched(alpha=0.0)
        return replace(_film(tint), emission=emission, strength=strength, thin=not has_volume)

    def _alpha(self, clear, lobes):
        """Coverage, and a function from a share of the whole surface to a share of the covered part."""
        g = self.graph
        if not clear:
            return 1.0, lambda part: part
        if self.adds_up and all(tint == WHITE for _, tint in clear):
            alpha = 0.0
            for _, part in lobes:
                alpha = g.add(alpha, part)
        else:
            passed = BLACK
            for weight, tint in clear:
                passed = g.add(passed, g.multiply(weight, tint))
            if not (is_constant(passed) and len(set(passed)) == 1):
                self.say("the colour of its Transparent shader is not carried beside other shaders: its mean is taken; "
                         "make that colour grey, or use glass of IOR 1")
            alpha = g.clamp(g.subtract(1.0, g.mean(passed)))

        def within(part):
            if part is alpha or part == alpha:
                return 1.0
            return g.divide(part, alpha if is_constant(alpha) else g.maximum(alpha, 1e-4))
        return alpha, within

    def _emission(self, shining):
        g = self.graph
        for i, (weight, colour, strength) in enumerate(shining):
            if is_constant(colour) and is_constant(strength):
                shining[i] = weight, tuple(positive([c * strength for c in colour], self.say)), 1.0
        if len(shining) == 1 and shining[0][0] == 1.0:
            return shining[0][1:]
        total = BLACK
        for weight, colour, strength in shining:
            total = g.add(total, g.multiply(g.multiply(weight, strength), colour))
        return total, (1.0 if shining else 0.0)

    def _merge(self, lobes, kinds):
        """One lobe that represents several, each with its share."""
        g = self.graph
        if len(lobes) == 1 and lobes[0][1] == 1.0 and not self._is_dark_gloss(lobes[0][0], kinds[0]):
            return lobes[0][0]
        whole = 0.0
        for _, part in lobes:
            whole = g.add(whole, part)
        if is_constant(whole) and whole > 1 + 1e-5:
            self.say(f"its shaders add up to {whole:.3g} times the light they receive: colours are held within 1; "
                     "use a Mix Shader instead of an Add Shader")
        if self.adds_up or (is_constant(whole) and abs(whole - 1) < 1e-6):
            whole = 1.0
        parts = [g.divide(part, whole) for _, part in lobes]
        lobes = [self.reader.mixed(lobe) for lobe, _ in lobes]
        inside = self._inside(lobes)
        if inside is None:
            lobes = [replace(lobe, subsurface=None, sheet=0.0) if lobe.subsurface is not None else lobe for lobe in lobes]
        diffuse = [kind in _DIFFUSE for kind in kinds]
        if inside is None and all(kind in _DIFFUSE | _GLOSSY for kind in kinds) and not all(diffuse):
            found = self._under_constant_gloss(lobes, parts, diffuse)
        else:
            found = self._mean(lobes, parts)
        found.subsurface = inside
        found.base = g.multiply(found.base, whole)
        if found.specular != 0.0 and whole != 1.0:
            found.specular = g.multiply(found.specular, g.minimum(whole, 1.0))
        found.normal = self._normal(lobes, parts)
        return found

    def _inside(self, lobes):
        """The subsurface.Subsurface of mixed shaders, or None."""
        found = [lobe.subsurface for lobe in lobes if lobe.subsurface is not None]
        if not found:
            return None
        if any(lobe.subsurface is None and lobe.sheet != 0.0 for lobe in lobes):
            self.say("subsurface scattering is not carried beside Translucent shaders: its light leaves where it arrives; "
                     "give both a material of their own")
            return None
        if any(lobe.transmission != 0.0 for lobe in lobes):
            self.say("subsurface scattering is not carried beside transmission: its light leaves where it arrives; "
                     "give both a material of their own")
            return None
        if any(other != found[0] for other in found):
            self.say("its mixed shaders differ in their subsurface scattering: that of the first is taken; "
                     "give them equal Radius, Scale, IOR and Anisotropy")
        return found[0]

    @staticmethod
    def _is_dark_gloss(lobe, kind):
        """Whether a shader is so dark or coloured a gloss that a metal's rise at grazing angles would show."""
        constant = kind in _GLOSSY and is_constant(lobe.base)
        return constant and (max(lobe.base) < 0.7 or max(lobe.base) - min(lobe.base) > 0.1)

    def _sum(self, values, weights):
        """The weighted mean of values, exact if all are one constant. Weights need not sum to one."""
        g = self.graph
        if all(is_constant(v) and v == values[0] for v in values):
            return values[0]
        counted = [(v, w) for v, w in zip(values, weights) if not (is_constant(w) and w == 0)]
        if not counted:
            return values[0]
        if len(counted) == 1:
            return counted[0][0]
        top, below = 0.0, 0.0
        for value, weight in counted:
            top, below = g.add(top, g.multiply(value, weight)), g.add(below, weight)
        if is_constant(below) and abs(below - 1) < 1e-6:
            return top
        return g.divide(top, below if is_constant(below) else g.maximum(below, 1e-5))

    def _under_constant_gloss(self, lobes, parts, diffuse):
        """Glossy shaders as facets of constant reflectance over a diffuse base.

        The facets pass 1 - r to the base, with r their largest component; the base colour compensates for it.
        """
        g = self.graph
        under, gloss = BLACK, BLACK
        shiny = [(lobe, part) for lobe, part, matt in zip(lobes, parts, diffuse) if not matt]
        dull = [(lobe, part) for lobe, part, matt in zip(lobes, parts, diffuse) if matt]
        for lobe, part, matt in zip(lobes, parts, diffuse):
            # Undo the metal's rise at grazing angles.
            colour = lobe.base if matt else g.add(g.multiply(lobe.base, 20 / 21), 1 / 21)
            colour = g.multiply(colour, part)
            under, gloss = (g.add(under, colour), gloss) if matt else (under, g.add(gloss, colour))
        if self._differ([lobe.roughness for lobe, _ in shiny]):
            self.say("its mixed shaders differ in roughness: the mean is taken; "
                     "give its Glossy shaders one Roughness")
        if not dull and is_constant(gloss):
            return replace(shiny[0][0], base=BLACK, metallic=0.0, ior=0.0, specular=1.0, reflection=gloss,
                           roughness=self._sum([lobe.roughness for lobe, _ in shiny], [part for _, part in shiny]))
        strongest = g.max_component(gloss)
        rest = g.subtract(1.0, strongest)
        first = shiny[0][0]
        return Lobe(
            diffuse_roughness=self._sum([lobe.diffuse_roughness for lobe, _ in dull], [part for _, part in dull])
            if dull else Lobe.diffuse_roughness,
            base=g.clamp(g.divide(under, rest if is_constant(rest) else g.maximum(rest, 1e-3))),
            roughness=self._sum([lobe.roughness for lobe, _ in shiny], [part for _, part in shiny]),
            ior=0.0, specular=strongest, specular_colour=g.divide(gloss, g.maximum(strongest, 1e-6)),
            anisotropy=first.anisotropy, tangent=first.tangent, single_scattering=first.single_scattering)

    @staticmethod
    def _differ(values):
        return any(value is not values[0] and value != values[0] for value in values)

    def _mean(self, lobes, parts):
        """Each quantity averaged over the lobes that use it."""
        g = self.graph
        dull = [g.multiply(p, g.subtract(1.0, lobe.metallic)) for lobe, p in zip(lobes, parts)]
        shiny = [p if lobe.faceted else 0.0 for lobe, p in zip(lobes, parts)]
        coated = [g.multiply(d, lobe.specular) if lobe.faceted else 0.0 for lobe, d in zip(lobes, dull)]
        reflected = [g.multiply(p, g.subtract(1.0, lobe.sheet)) for lobe, p in zip(lobes, parts)]
        matt = [g.multiply(d, g.subtract(1.0, lobe.transmission)) for lobe, d in zip(lobes, dull)]
        over = {"metallic": parts, "diffuse_roughness": matt, "base": reflected, "transmission": dull, "specular": dull, "roughness": shiny,
                "ior": coated, "specular_colour": coated, "coat": parts, "sheen": parts, "anisotropy": shiny,
                "sheet": dull, "sheet_colour": [g.multiply(d, lobe.sheet) for lobe, d in zip(lobes, dull)],
                "film": shiny, "film_ior": [g.multiply(p, lobe.film) for lobe, p in zip(lobes, shiny)],
                **dict.fromkeys(("coat_roughness", "coat_ior", "coat_colour"),
                                [g.multiply(p, lobe.coat) for lobe, p in zip(lobes, parts)]),
                "sheen_roughness": [g.multiply(p, g.max_component(lobe.sheen)) for lobe, p in zip(lobes, parts)]}
        found = Lobe(**{name: self._sum([getattr(lobe, name) for lobe in lobes], weights)
                        for name, weights in over.items()})
        found.thin = any(lobe.thin for lobe in lobes)
        found.single_scattering = any(lobe.single_scattering for lobe in lobes)
        if found.thin:
            found.roughness = self._sum([lobe.roughness for lobe in lobes], parts)
        found.tangent = next((lobe.tangent for lobe in lobes if lobe.tangent is not None), None)
        apart = [name.replace("_", " ") for name, weights in over.items() if name not in {"base", "sheet"}
                 and self._differ([getattr(lobe, name) for lobe, w in zip(lobes, weights) if w != 0.0])]
        if apart:
            apart += ["base colour"] * self._differ([lobe.base for lobe in lobes])
            self.say(f"its mixed shaders differ in {', '.join(sorted(apart))}: each is mixed for itself, which is "
                     "exact only where one shader covers all; "
                     "assign the shaders to faces as materials of their own, or use one Principled BSDF with textures")
        return found

    def _normal(self, lobes, parts):
        normals = [lobe.normal for lobe in lobes]
        if all(normal == normals[0] for normal in normals):
            return normals[0]
        self.say("its mixed shaders differ in their normals: that of the strongest is taken; "
                 "link one normal to all of them")
        known = [part if is_constant(part) else 0.5 for part in parts]
        return normals[known.index(max(known))]
