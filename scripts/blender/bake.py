"""Bakes values of a material's node graph to images on a mesh, with Cycles' baker in a separate scene, the stage.

A *pass* bakes three numbers per texel: a colour, or three unrelated channels.
"""

import contextlib

import bpy
import numpy

import attributes
import bake_cache
import standin
from graph import is_constant

SIZE = 1024  # texels per side
_SAMPLES = 4  # per texel, against aliasing
_NOISY = {"AMBIENT_OCCLUSION", "BEVEL"}
_NOISY_SAMPLES = 64
_MARGIN = 8  # texels that extend each UV island


class Baker:
    """Bakes images of `size` texels per side. `undo` removes the scene and materials that it makes in Blender."""

    def __init__(self, size, undo):
        scene = bpy.context.scene
        self.size, self.undo, self.frame = size, undo, (scene.frame_current, scene.frame_subframe)
        self._made, self._attributes = None, attributes.numbers_of(scene)

    @property
    def stage(self):
        """The scene that baking uses, so that other objects cost no time and cast no shadows."""
        if self._made is None:
            self._made = bpy.data.scenes.new("bake")
            self.undo.callback(bpy.data.scenes.remove, self._made)
            self._made.render.engine = "CYCLES"
            # Drivers and image sequences are baked at the frame of the export.
            self._made.frame_set(self.frame[0], subframe=self.frame[1])
            for name, value in self._attributes.items():
                self._made[name] = value
            self._made.cycles.device = "CPU"
            self._made.cycles.use_denoising = False
            self._made.cycles.use_adaptive_sampling = False
            self._nobody = bpy.data.materials.new("nobody")
            self.undo.callback(bpy.data.materials.remove, self._nobody)
            if bpy.app.version < (5, 0, 0):
                self._nobody.use_nodes = True
        return self._made

    @contextlib.contextmanager
    def on_stage(self, body):
        """Make the stage the current scene, with `body` alone on it."""
        before, kept = bpy.context.window.scene, bpy.context.view_layer
        hidden = body.hide_render, body.hide_viewport
        self.stage.collection.objects.link(body)
        bpy.context.window.scene = self.stage
        body.hide_render = body.hide_viewport = False
        try:
            yield
        finally:
            self.stage.collection.objects.unlink(body)
            body.hide_render, body.hide_viewport = hidden
            bpy.context.window.scene = before
            bpy.context.window.view_layer = kept

    def constants(self, graph, values):
        """Colours or numbers of `values` that are equal everywhere."""
        found = []
        for value in values:
            shader = _connect_emission(graph, value)
            colour = bake_cache.recall(self._key(graph, "constant"), lambda: self._constant(graph))
            found.append(tuple(map(float, colour)) if _has_three(value) else float(colour[0]))
            graph.tree.nodes.remove(shader)
        return found

    def _constant(self, graph):
        """The constant colour that a graph emits, evaluated by baking a few texels of a square."""
        mesh = bpy.data.meshes.new("square")
        mesh.from_pydata([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [], [(0, 1, 2, 3)])
        body = bpy.data.objects.new("square", mesh)
        try:
            mesh.uv_layers.new(name=standin.UV)
            mesh.materials.append(graph.material)
            with self.on_stage(body):
                return self._texels(body, {0: graph}, "EMIT", 4)[0][..., :3].mean((0, 1))
        finally:
            bpy.data.objects.remove(body)
            bpy.data.meshes.remove(mesh)

    def _key(self, graph, *parts):
        """The key in the cache of what a graph emits; None as for `bake_cache.nodes_key`."""
        material = graph.material
        return bake_cache.nodes_key(graph.tree, self.frame, material.pass_index,
                                    getattr(material, "displacement_method", None), *parts)

    def passes(self, body, wanted, of_object, size):
        """Bake on `body`, whose mesh has the UV map. Returns {(slot, pass): texels (size, size, 4)}, alpha 0 where
        empty.

        `wanted`: {slot: (graph, {pass: value})}. The value of the pass "normal" is a normal, or None.
        """
        found = {}
        shape = bake_cache.mesh_digest(body.data)
        place = (body.name, [tuple(row) for row in body.matrix_world], tuple(body.color), body.pass_index,
                 sorted(attributes.numbers_of(body).items()), sorted(self._attributes.items()))
        names = sorted({name for _, values in wanted.values() for name in values})
        for name in names:
            now, keys, shaders = {}, {}, []
            for slot, (graph, values) in wanted.items():
                if name not in values:
                    continue
                connect = _connect_normal if name == "normal" else _connect_emission
                shaders.append((graph, connect(graph, values[name])))
                keys[slot] = self._key(graph, shape, slot, size, name, place if of_object else None)
                texels = bake_cache.load(keys[slot])
                if texels is None:
                    now[slot] = graph
                else:
                    found[slot, name] = texels.astype(numpy.float32)
            if now:
                made = self._texels(body, now, "NORMAL" if name == "normal" else "EMIT", size)
                for slot, texels in made.items():
                    stored = _rounded(texels)  # used by this export, too, so that the next one writes equal bytes
                    bake_cache.store(keys[slot], stored)
                    found[slot, name] = stored.astype(numpy.float32)
            for graph, shader in shaders:
                graph.tree.nodes.remove(shader)
        return found

    def _texels(self, body, graphs, kind, size):
        """Run the baker once. Returns {slot: texels} for the slots of `graphs`."""
        mesh = body.data
        materials = list(mesh.materials)
        noisy = any(n.type in _NOISY for graph in graphs.values() for tree in graph.trees() for n in tree.nodes)
        self.stage.cycles.samples = _NOISY_SAMPLES if noisy else _SAMPLES
        with contextlib.ExitStack() as undo:
            images = {}
            for slot in range(max(len(materials), 1)):
                graph = graphs.get(slot)
                material = graph.material if graph is not None else self._nobody
                side = size if graph is not None else 4
                image = images.get(slot if graph is not None else None)
                if image is None:
                    image = bpy.data.images.new("bake", side, side, alpha=True, float_buffer=True, is_data=True)
                    image.generated_color = (0, 0, 0, 0)
                    undo.callback(bpy.data.images.remove, image)
                    images[slot if graph is not None else None] = image
                    node = material.node_tree.nodes.new("ShaderNodeTexImage")
                    undo.callback(material.node_tree.nodes.remove, node)
                    node.image = image
                    material.node_tree.nodes.active = node
                if slot < len(materials):
                    mesh.materials[slot] = material
            for other in bpy.context.view_layer.objects:
                other.select_set(other == body)
            bpy.context.view_layer.objects.active = body
            bpy.ops.object.bake(
                type=kind, normal_space="TANGENT", margin=_MARGIN, margin_type="EXTEND", use_clear=False,
                target="IMAGE_TEXTURES", save_mode="INTERNAL", uv_layer=standin.UV,
                use_selected_to_active=False)
            found = {}
            for slot in graphs:
                texels = numpy.empty(size * size * 4, numpy.float32)
                images[slot].pixels.foreach_get(texels)
                found[slot] = texels.reshape(size, size, 4)
        for slot, material in enumerate(materials):
            mesh.materials[slot] = material
        return found


def _rounded(texels):
    """Texels as halves, if their range allows it."""
    return texels.astype(numpy.float16) if 1e-3 < numpy.abs(texels[..., :3]).max() < 6e4 else texels


def _has_three(value):
    return not is_constant(value) and value.type in {"RGBA", "VECTOR"}


def _connect_emission(graph, value):
    """Make the material emit a value. Returns the shader's node."""
    node = graph.tree.nodes.new("ShaderNodeEmission")
    graph.connect(value, node.inputs["Color"])
    graph.tree.links.new(node.outputs[0], graph.output.inputs["Surface"])
    return node


def _connect_normal(graph, normal):
    """Make the material diffuse with this normal, None for that of its displacement. Returns the shader's node."""
    node = graph.tree.nodes.new("ShaderNodeBsdfDiffuse")
    if normal is not None:
        graph.connect(normal, node.inputs["Normal"])
    graph.tree.links.new(node.outputs[0], graph.output.inputs["Surface"])
    return node
