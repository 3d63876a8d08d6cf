"""The materials of a scene on their way to glTF: matched, baked where glTF has no words for how they vary, and worn as
plain Principled materials while the exporter runs."""

from dataclasses import dataclass

import bpy

import bake
import gltfmaterial
import shading
import standin
from material_plan import Plan, matt


def materials_of(thing):
    """The materials that an object's faces may wear, by slot, None where a slot is empty; with those of modifiers."""
    worn = [slot.material for slot in thing.material_slots]
    if any(modifier.type == "NODES" for modifier in thing.modifiers):
        evaluated = thing.evaluated_get(bpy.context.evaluated_depsgraph_get())
        made = [material and material.original for material in getattr(evaluated.data, "materials", ())]
        worn += made[len(worn):]
    return worn


@dataclass
class Surface:
    """What a written material is made of: the material it stands for, and channels as gltfmaterial.write takes them."""
    material: bpy.types.Material
    channels: dict
    texcoord: int = 0


class Surfaces:
    """Matches the materials that `things` wear; until `undo` (a contextlib.ExitStack) closes, they wear stand-ins.

    `size`: texels a side of baked images, 0 bakes nothing and names what is lost. `warn(where, what)` takes losses.
    """

    def __init__(self, things, materials, undo, warn, size=bake.SIZE):
        self.undo, self.warn, self.size = undo, warn, size
        self.baker = bake.Baker(size or bake.SIZE, undo)
        self.found = {}  # by the name of the material that the exporter sees
        self.plans = {}
        for material in materials:
            if shading.nodes_of(material) is None:
                self.found[material.name] = Surface(material, matt(material.diffuse_color[:3]))
            else:
                self.plans[material.name] = Plan(material, self.baker, bool(size), undo, warn)
        self._bake(things)
        for plan in self.plans.values():
            if not plan.passes:
                self._wear_everywhere(plan)

    def _wear_everywhere(self, plan):
        material = plan.finished()
        self.found[material.name] = Surface(plan.material, plan.channels)
        plan.material.user_remap(material)
        self.undo.callback(material.user_remap, plan.material)

    def finish(self, document, buffer, bodies):
        """Complete the materials of a written document; its buffer, with the baked images.

        `bodies`: by material whether all that wear it is closed, and a length inside it in metres.
        """
        writer = gltfmaterial.Writer(document, buffer)
        for entry in document.get("materials", []):
            surface = self.found.get(entry.get("name")) or self._unreached(entry.get("name"))
            if surface is not None:
                closed, least = bodies.get(entry["name"], (False, 0.0))
                entry["name"] = surface.material.name
                gltfmaterial.write(entry, surface.channels, writer, surface.texcoord)
                shading.finish(entry, surface.material, closed, least, self.warn)
        gltfmaterial.give_default(document)
        return bytes(writer.buffer)

    def _unreached(self, name):
        """The surface of a material that the exporter has met where nothing can stand in for it, or None."""
        plan = self.plans.get(name)
        if plan is None:
            return None
        if plan.passes:
            plan.say("it is worn where nothing can be baked (objects linked from other files, instances that nodes make): "
                     "there what would be baked is plain; make such objects local and real")
        return Surface(plan.material, plan.unbaked)

    def _bake(self, things):
        made = {}
        for thing in things:
            worn = materials_of(thing)
            plans = {i: self.plans[m.name] for i, m in enumerate(worn)
                     if m is not None and m.name in self.plans and self.plans[m.name].passes}
            if not plans or not thing.is_editable:
                continue
            own = any(plan.of_object for plan in plans.values())
            alone = own or thing.type != "MESH" or thing.modifiers or thing.data.shape_keys is not None
            key = thing.name if alone else (thing.data.as_pointer(), *(m and m.name for m in worn))
            if key in made:
                self._wear_again(thing, made[key])
            else:
                made[key] = self._bake_one(thing, plans, own)

    def _wear_again(self, thing, mesh):
        before, worn = thing.data, [(slot.link, slot.material) for slot in thing.material_slots]
        thing.data = mesh
        self.undo.callback(standin.restore, thing, before, worn)
        for slot in thing.material_slots:
            slot.link = "DATA"

    def _bake_one(self, thing, plans, own):
        body = standin.swap(thing, self.undo, lambda what: self.warn(f'object "{thing.name}"', what))
        mesh = body.data
        if not mesh.polygons:
            return mesh
        wanted = {slot: (plan.graph, plan.passes) for slot, plan in plans.items()}
        with self.baker.on_stage(body):
            standin.unwrap(body, self.size)
            texels = self.baker.passes(body, wanted, own)
        texcoord = standin.keep_two_uv_maps(mesh)
        for slot, plan in plans.items():
            material = plan.finished()
            baked = {name: image for (at, name), image in texels.items() if at == slot}
            self.found[material.name] = Surface(plan.material, plan.resolved(baked), texcoord)
            mesh.materials[slot] = material
        return mesh
