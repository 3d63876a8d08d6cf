"""Converts the materials of a scene to glTF: matches them, bakes what glTF cannot express, and assigns plain Principled
materials to the objects while the exporter runs."""

from dataclasses import dataclass

import bpy

import bake
import gltfmaterial
import export_guard as guard
import shading
import standin
import subsurface
from material_plan import Plan, matt

_EVEN_SIZE = 64  # texels per side of the images of materials that have one value on an object


def materials_of(thing):
    """The materials of an object by slot, None for an empty slot, then those that its modifiers add."""
    worn = [slot.material for slot in thing.material_slots]
    if any(modifier.type == "NODES" for modifier in thing.modifiers):
        evaluated = thing.evaluated_get(bpy.context.evaluated_depsgraph_get())
        made = [material and material.original for material in getattr(evaluated.data, "materials", ())]
        worn += made[len(worn):]
    return worn


@dataclass
class Surface:
    """The contents of a written material: the original material, and the channels for gltfmaterial.write."""
    material: bpy.types.Material
    channels: dict
    texcoord: int = 0


class Surfaces:
    """Matches the materials of a flat scene, whose objects have stand-ins until `undo` (a contextlib.ExitStack) closes.

    `size`: texels per side of baked images; 0 bakes nothing. `warn(where, what)` receives a warning for each loss,
    `progress(text)` how many meshes are baked.
    """

    def __init__(self, flat, materials, undo, warn, size=bake.SIZE, progress=lambda text: None):
        self.flat, self.undo, self.warn, self.size = flat, undo, warn, size
        self.baker = bake.Baker(size or bake.SIZE, undo)
        self.found = {}  # {name of the material that the exporter writes: Surface}
        self.plans = {}
        for material in materials:
            self._plan(material)
        self._bake(progress)
        for plan in self.plans.values():
            if not plan.passes:
                self._replace(plan.material, *self._attempt(plan.material, self._principled, plan))

    def _plan(self, material):
        if shading.nodes_of(material) is None:
            self.found[material.name] = Surface(material, matt(material.diffuse_color[:3]))
            return
        plan = self._attempt(material, Plan, material, self.baker, bool(self.size), self.undo, self.warn,
                             material.name in self.flat.stretched)
        if isinstance(plan, Plan):
            self.plans[material.name] = plan
        else:
            self._replace(material, *plan)

    def _attempt(self, material, work, *arguments):
        """The result of `work`; if it fails, a plain material and its channels, and a warning."""
        colour = tuple(material.diffuse_color[:3])
        found = guard.attempt(self.warn, f'material "{material.name}"', None,
                              "it is diffuse, of its colour in the viewport", work, *arguments)
        return found if found is not None else (self._plain(material.name), matt(colour))

    def _plain(self, name):
        made = bpy.data.materials.new(name)
        self.undo.callback(bpy.data.materials.remove, made)
        return made

    @staticmethod
    def _principled(plan):
        return plan.make_principled(), plan.channels

    def _replace(self, material, written, channels):
        self.found[written.name] = Surface(material, channels)
        material.user_remap(written)
        self.undo.callback(written.user_remap, material)

    def finish(self, document, buffer, bodies):
        """Complete the materials of a written document. Returns its buffer, with the baked images.

        `bodies`: {material: (whether all its meshes are closed, a length inside them in metres)}.
        """
        writer = gltfmaterial.Writer(document, buffer)
        for entry in document.get("materials", []):
            surface = self.found.get(entry.get("name")) or self._unbaked_surface(entry.get("name"))
            if surface is not None:
                solid = bodies.get(entry["name"], (False, 0.0))
                guard.attempt(self.warn, f'material "{surface.material.name}"', None,
                              "it is what Blender's exporter made of it",
                              self._finish, entry, surface, writer, *solid)
        gltfmaterial.give_default(document)
        gltfmaterial.remove_colours(document)
        return bytes(writer.buffer)

    def _finish(self, entry, surface, writer, closed, least):
        entry["name"] = surface.material.name
        # Cycles ignores Backface Culling, a setting of EEVEE.
        entry["doubleSided"] = shading.ONE_SIDED not in surface.material
        channels, inside = surface.channels, surface.channels["subsurface"]
        if inside is not None and not closed:
            self.warn(f'material "{surface.material.name}"',
                      "its subsurface scattering needs closed meshes: its light leaves where it arrives; "
                      "close its holes (Mesh > Clean Up > Fill Holes)")
            if channels["base"] is not gltfmaterial.PLAIN:
                channels = {**channels, "base": subsurface.at_surface(channels)}
            channels, inside = {**channels, "sheet": 0.0}, None
        if inside is not None:
            plain = channels["base"] is gltfmaterial.PLAIN
            inside, tint = subsurface.medium(inside, channels["sheet_colour"], channels["sheet"],
                                             channels["sheet_colour" if plain else "base"])
            channels = {**channels, "sheet_colour": tint}
        gltfmaterial.write(entry, channels, writer, surface.texcoord)
        shading.finish(entry, surface.material, closed, least, self.warn)
        if inside is not None:
            subsurface.write(entry, inside, least)

    def _unbaked_surface(self, name):
        """The surface of a material on an object that has no stand-in, or None."""
        plan = self.plans.get(name)
        if plan is None:
            return None
        if plan.passes:
            plan.say("it is used where nothing can be baked (objects linked from other files, instances that nodes "
                     "make): the channels to bake are plain there; make such objects local and real")
        return Surface(plan.material, plan.unbaked)

    def _bake(self, progress):
        wanted = list(self._bodies_to_bake())
        count = len({key for key, *_ in wanted})
        made = {}
        for key, thing, plans, own in wanted:
            if key in made:
                self._share_baked_mesh(thing, made[key])
                continue
            progress(f"Baking materials, mesh {len(made) + 1} of {count}")
            made[key] = guard.attempt(self.warn, self.flat.where(thing), thing.data,
                                      "the images of its materials are not baked", self._bake_one, thing, plans, own)

    def _bodies_to_bake(self):
        """Key of the baked mesh, object, plans by slot, and whether they depend on the object, of each object to bake."""
        for thing in self.flat.things:
            materials = materials_of(thing)
            plans = {i: self.plans[m.name] for i, m in enumerate(materials)
                     if m is not None and m.name in self.plans and self.plans[m.name].passes}
            if not plans or not thing.is_editable:
                continue
            own = any(plan.of_object for plan in plans.values())
            alone = own or thing.type != "MESH" or thing.modifiers or thing.data.shape_keys is not None
            key = thing.name if alone else (thing.data.as_pointer(), *(m and m.name for m in materials))
            yield key, thing, plans, own

    def _share_baked_mesh(self, thing, mesh):
        before, slots = thing.data, [(slot.link, slot.material) for slot in thing.material_slots]
        thing.data = mesh
        self.undo.callback(standin.restore, thing, before, slots)
        for slot in thing.material_slots:
            slot.link = "DATA"

    def _bake_one(self, thing, plans, own):
        body = standin.swap(thing, self.undo, lambda what: self.warn(self.flat.where(thing), what))
        mesh = body.data
        if not mesh.polygons:
            return mesh
        if any(plan.stretched for plan in plans.values()):
            standin.add_normal_map_axes(mesh)
        wanted = {slot: (plan.graph, plan.passes) for slot, plan in plans.items()}
        size = self.size if any(plan.varies_on_object for plan in plans.values()) else min(_EVEN_SIZE, self.size)
        with self.baker.on_stage(body):
            standin.unwrap(body, self.size)
            texels = self.baker.passes(body, wanted, own, size)
        texcoord = standin.keep_two_uv_maps(mesh)
        for slot, plan in plans.items():
            material = plan.make_principled()
            baked = {name: image for (at, name), image in texels.items() if at == slot}
            self.found[material.name] = Surface(plan.material, plan.resolve(baked), texcoord)
            mesh.materials[slot] = material
        return mesh
