"""Values of a material's graph baked to images on a mesh, with Cycles' own baker on a stage of its own.

A *pass* bakes three numbers at once: a colour, or three channels that have nothing else in common.
"""

import contextlib

import bpy
import numpy

import bake_cache
import standin
from graph import is_constant
from shading import output_of

SIZE = 1024  # texels a side
_SAMPLES = 4  # a texel, against stairs
_NOISY = {"AMBIENT_OCCLUSION", "BEVEL"}
_NOISY_SAMPLES = 64
_MARGIN = 8  # texels that are repeated around an island


class Baker:
    """Bakes images of `size` texels a side; what it makes in Blender stays until `undo` closes."""

    def __init__(self, size, undo):
        self.size, self.undo = size, undo
        self._made = None

    @property
    def stage(self):
        """A scene of its own: the rest of the picture costs no time, and casts no shadow."""
        if self._made is None:
            self._made = bpy.data.scenes.new("bake")
            self.undo.callback(bpy.data.scenes.remove, self._made)
            self._made.render.engine = "CYCLES"
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
        """What values that vary nowhere are: colours or numbers, by baking a few texels of a square."""
        mesh = bpy.data.meshes.new("square")
        mesh.from_pydata([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [], [(0, 1, 2, 3)])
        body = bpy.data.objects.new("square", mesh)
        try:
            mesh.uv_layers.new(name=standin.UV)
            mesh.materials.append(graph.material)
            found = []
            with self.on_stage(body):
                for value in values:
                    shader = _shine(graph, value)
                    found.append(self._texels(body, {0: graph}, "EMIT", 4)[0][..., :3].mean((0, 1)))
                    graph.tree.nodes.remove(shader)
            return [tuple(map(float, f)) if g else float(f[0]) for f, g in zip(found, map(_has_three, values))]
        finally:
            bpy.data.objects.remove(body)
            bpy.data.meshes.remove(mesh)

    def passes(self, body, wanted, of_object):
        """Bake on `body`, whose mesh has the UV map: {(slot, pass): texels (size, size, 4), alpha where there are any}.

        `wanted`: {slot: (graph, {pass: value})}, the value of the pass "normal" a bent normal.
        """
        found = {}
        shape = bake_cache.mesh_digest(body.data)
        place = (body.name, [tuple(row) for row in body.matrix_world], tuple(body.color), body.pass_index)
        names = sorted({name for _, values in wanted.values() for name in values})
        for name in names:
            now, keys, shaders = {}, {}, []
            for slot, (graph, values) in wanted.items():
                if name not in values:
                    continue
                shaders.append((graph, (_bend if name == "normal" else _shine)(graph, values[name])))
                keys[slot] = bake_cache.digest(shape, slot, bake_cache.tree_digest(graph.tree), self.size, name,
                                              place if of_object else None)
                texels = bake_cache.load(keys[slot])
                if texels is None:
                    now[slot] = graph
                else:
                    found[slot, name] = texels
            if now:
                made = self._texels(body, now, "NORMAL" if name == "normal" else "EMIT", self.size)
                for slot, texels in made.items():
                    bake_cache.store(keys[slot], texels)
                    found[slot, name] = texels
            for graph, shader in shaders:
                graph.tree.nodes.remove(shader)
        return found

    def _texels(self, body, graphs, kind, size):
        """One run of the baker: {slot: texels} for the slots of `graphs`."""
        mesh = body.data
        worn = list(mesh.materials)
        noisy = any(n.type in _NOISY for graph in graphs.values() for tree in graph.trees() for n in tree.nodes)
        self.stage.cycles.samples = _NOISY_SAMPLES if noisy else _SAMPLES
        with contextlib.ExitStack() as undo:
            images = {}
            for slot in range(max(len(worn), 1)):
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
                if slot < len(worn):
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
        for slot, material in enumerate(worn):
            mesh.materials[slot] = material
        return found


def _has_three(value):
    return not is_constant(value) and value.type in {"RGBA", "VECTOR"}


def _surface(graph):
    return output_of(graph.tree).inputs["Surface"]


def _shine(graph, value):
    """Let the material shine with a value; the shader's node."""
    node = graph.tree.nodes.new("ShaderNodeEmission")
    graph.connect(value, node.inputs["Color"])
    graph.tree.links.new(node.outputs[0], _surface(graph))
    return node


def _bend(graph, normal):
    """Let the material be a matt white one with this normal, or with the one that its displacement makes; its node."""
    node = graph.tree.nodes.new("ShaderNodeBsdfDiffuse")
    if normal is not None:
        graph.connect(normal, node.inputs["Normal"])
    graph.tree.links.new(node.outputs[0], _surface(graph))
    return node
