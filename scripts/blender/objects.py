"""The scene as a render would evaluate it, flat: each visible object once, in world space, without modifiers or
parents.

`FlatScene` is a temporary Blender scene for the exporter. Its meshes are evaluated (modifiers, shape keys, armatures,
geometry nodes) and shared by instances; lamps and cameras have their evaluated transforms.
"""

import math

import bpy  # first: it makes the others importable

import bmesh
import numpy
from mathutils import Matrix

import attributes
import camera_export
import export_guard as guard
import linking
import motion
import standin
import visibility
import volumes
from shading import VOLUME, nodes_of, output_of, source, upstream

_SOLID = {"MESH", "CURVE", "SURFACE", "FONT", "META"}
# Types of objects that are never visible in renders.
_INVISIBLE = {"EMPTY", "ARMATURE", "LATTICE", "SPEAKER", "LIGHT_PROBE"}
_OUT = "it is left out"
# Most copies of a mesh with bumps, one for each scale of its instances.
_MAX_SCALES = 16
# Largest ratio of two scale factors that counts as uniform.
_MAX_EVEN_RATIO = 1.001
STRETCHED = ("its scale is uneven, with which Cycles stretches normal maps: here they keep their slopes; apply the scale "
             "(Object > Apply > Scale) to see the same in both, or leave out --no-bake")
_PATHS = "convert them to meshes (in the object's menu, or a Curve to Mesh node)"
_LOST = {"CURVES": "hair curves are not carried; " + _PATHS,
         "POINTCLOUD": "point clouds are not carried; convert them to meshes",
         "GREASEPENCIL": "grease pencil is not carried: " + _PATHS,
         "GPENCIL": "grease pencil is not carried: " + _PATHS}


class FlatScene:
    """The evaluated scene until `undo` (a contextlib.ExitStack) closes.

    `things`: its objects. `names`: names of the original objects and meshes. `hidden`: for each of `things`, the kinds
    of rays that do not hit it. `groups`: the light group of each, or None. `keys`: for each, keys of
    `extras.caustique` that a property of Blender cannot hold. `lamp_factors`: for each measured lamp, the factors per
    channel of its nodes. `lamps`: name, colour and intensity of each lamp by the name that the exporter writes.
    `profiles`: the texts of IES profiles (bytes) that lamps name. `pictures`: PNGs that spots throw. `volumes`: grids,
    material and name of volumes that become boxes. `stretched`: names of materials with normal maps that uneven scale
    stretches, found if the materials may be baked (`bakes`). `motion`: how the objects move while the shutter is open.
    """

    def __init__(self, scene, undo, warn, bakes=True, only=None):
        """`only`: names of the objects to take; None for all."""
        visibility.as_rendered(scene, undo, warn)
        layer = bpy.context.view_layer
        layer.update()
        self.things, self.names, self.hidden, self.groups, self.lamp_factors = [], {}, {}, {}, {}
        self.keys, self.lamps, self._linking = {}, {}, linking.Links()
        self.profiles, self.pictures, self.volumes = [], [], []
        self.stretched, self._bakes = set(), bakes
        self._warn, self._meshes, self._shapes, self._made, self._applied = warn, {}, [], [], {}
        self._indirect, self._layer = visibility.indirect_only(layer), layer
        self.motion, self._attributes = motion.Recorder(scene, layer, warn), attributes.Attributes(warn)
        self.scene = bpy.data.scenes.new(scene.name)
        self.names[self.scene.name] = scene.name
        undo.callback(bpy.data.scenes.remove, self.scene)
        # One call, because Blender searches all data for every removal.
        undo.callback(lambda: bpy.data.batch_remove(self._made))
        for name in ("resolution_x", "resolution_y", "resolution_percentage", "pixel_aspect_x", "pixel_aspect_y"):
            setattr(self.scene.render, name, getattr(scene.render, name))
        for name, value in self._attributes.of_scene(scene, layer).items():
            self.scene[name] = value
        self.scene.frame_set(scene.frame_current, subframe=scene.frame_subframe)
        depsgraph = bpy.context.evaluated_depsgraph_get()
        # Collect all instances first: new objects invalidate the depsgraph's iterator.
        concerned = {thing for thing in scene.objects if thing.visible_get(view_layer=layer)}
        # Curves, text and metaballs occur twice: as themselves, and as their evaluated mesh.
        meshed = {i.object.original for i in depsgraph.object_instances if i.object.type == "MESH"}
        found = []
        for instance in depsgraph.object_instances:
            if only is not None and instance.object.original.name not in only:
                concerned.discard(instance.object.original)
                continue
            concerned.add(instance.object.original)
            kind = instance.object.type
            if kind in {"MESH", "VOLUME"} or kind in _LOST or instance.object.original not in meshed:
                found.append(guard.attempt(warn, f'object "{instance.object.name}"', None, _OUT,
                                           self._take, instance, depsgraph))
        if scene.camera is not None and not any(taken and taken[0] == scene.camera for taken in found):
            # The camera counts even if it is hidden.
            camera = scene.camera.evaluated_get(depsgraph)
            place, key = camera.matrix_world.copy(), motion.identity_of(scene.camera)
            self.motion.expect(key, camera, None, place)
            found.append((scene.camera, scene.camera.data, place, [], None, {}, {}, key))
        guard.attempt(warn, f'scene "{scene.name}"', None, "nothing moves while the shutter is open",
                      self.motion.record)
        for mesh, original in self._shapes:
            self._add_generated_coordinates(original, mesh)
        for taken in filter(None, found):
            guard.attempt(warn, f'object "{taken[0].name}"', None, _OUT, self._put, *taken)
        for thing in sorted(concerned, key=lambda thing: thing.name):
            guard.attempt(warn, f'object "{thing.name}"', None, "some of its losses are not named", self._warn_of, thing)

    def _add_generated_coordinates(self, original, mesh):
        where = f'object "{original.name}"'
        guard.attempt(self._warn, where, None, "textures by Generated coordinates lie differently",
                      standin.add_generated_coordinates, original, mesh, lambda what: self._warn(where, what))

    def add_extras(self, thing, **keys):
        """Set keys of `extras.caustique` on the node of one of `things`."""
        before = thing["caustique"].to_dict() if "caustique" in thing else {}
        thing["caustique"] = {**before, **keys}

    def where(self, thing):
        """How warnings name one of `things`."""
        kind = {"LIGHT": "light", "CAMERA": "camera"}.get(thing.type, "object")
        return f'{kind} "{self.names[thing.name]}"'

    def remove_later(self, block):
        """Remove a data block of Blender together with the flat scene. Returns the block."""
        self._made.append(block)
        return block

    def _take(self, instance, depsgraph):
        """Object, data, world matrix, hidden rays, light group, keys, properties and key (`motion.identity`) of an instance, or
        None if it is invisible. The properties are its random number (0 to 1), and the attributes that materials read."""
        thing = instance.object
        if not (instance.is_instance or instance.show_self) or thing.type in _INVISIBLE or _is_pattern(instance):
            return None
        if thing.type in _LOST:
            self._warn(f'object "{thing.name}"', _LOST[thing.type])
            return None
        data = thing.original.data
        random = instance.random_id & 0xFFFFFFFF if instance.is_instance else _random_of_name(thing.name)
        properties = {standin.RANDOM: random / 0xFFFFFFFF, **self._attributes.of_instance(instance)}
        if thing.type == "VOLUME":
            return self._volume(instance, properties)
        if any(m.type == "FLUID" and m.fluid_type == "DOMAIN" and m.domain_settings.domain_type == "GAS"
               for m in thing.modifiers):
            self._warn(f'object "{thing.name}"', f"its smoke is not carried: {_OUT}; save its cache as OpenVDB, and import "
                       "that as a volume object")
            return None
        if thing.type in _SOLID:
            data = self._mesh(instance, depsgraph)
        elif thing.type not in {"LIGHT", "CAMERA"}:
            self._warn(f'object "{thing.name}"', f"objects of type {thing.type} are not carried; "
                                                 "convert it to a mesh (Object > Convert)")
            return None
        parent, matrix = instance.parent if instance.is_instance else None, instance.matrix_world.copy()
        key = motion.identity(instance)
        if data:
            guard.attempt(self._warn, f'object "{thing.name}"', None, motion.STANDS_STILL, self.motion.expect,
                          key, thing, parent, matrix, self._deformable(instance, data))
        hidden = visibility.hidden_rays(thing, parent)
        if (instance.parent or thing).name in self._indirect and "camera" not in hidden:
            hidden.append("camera")
        group = visibility.light_group(thing, parent, self._layer)
        keys = self._keys(thing.original, parent and parent.original)
        return data and (thing.original, data, matrix, hidden, group, keys, properties, key)

    def _keys(self, thing, instancer):
        """The keys of an object, and of the instancer that it comes from: light linking, and whether it is a holdout."""
        keys = self._linking.of(thing, instancer)
        if thing.type != "LIGHT" and (instancer or thing).holdout_get(view_layer=self._layer):
            keys["holdout"] = True
        return keys

    def _volume(self, instance, properties):
        """`_take` of a volume: a box with a medium."""
        thing = instance.object
        made = volumes.box(thing, self._warn)
        if made is None:
            return None
        mesh, volume, material = made
        own = material.copy()  # volumes.embed removes it
        own[VOLUME] = len(self.volumes)
        self.volumes.append((volume, material, own))
        self.names[self.remove_later(mesh).name] = thing.original.data.name
        mesh.materials.append(own)
        parent, key = instance.parent if instance.is_instance else None, motion.identity(instance)
        hidden, group = visibility.hidden_rays(thing, parent), visibility.light_group(thing, parent, self._layer)
        matrix = instance.matrix_world @ volume.matrix
        keys = self._keys(thing.original, parent and parent.original)
        return thing.original, mesh, matrix, hidden, group, keys, properties, key

    def _mesh(self, instance, depsgraph):
        """The evaluated mesh of an instance, shared with equal instances; None without faces."""
        thing = instance.object
        name = thing.original.data.name
        by_nodes = _is_by_nodes(instance)
        key = (thing.original.name_full, thing.data.as_pointer())
        if not by_nodes and _is_unmodified(thing.original):
            key = thing.original.data.name_full
        if key in self._meshes:
            return self._meshes[key]
        if by_nodes and thing.type == "MESH":
            mesh = thing.data.copy()  # geometry nodes made it: it belongs to no object
        else:
            mesh = bpy.data.meshes.new_from_object(thing, preserve_all_data_layers=True, depsgraph=depsgraph)
            self._shapes.append((mesh, thing.original))
        self.names[self.remove_later(mesh).name] = name
        lost = _remove_points_that_are_no_numbers(mesh)
        if lost:
            self._warn(f'object "{thing.name}"', f"{lost} points of its shape are not numbers: they are left out; "
                                                 "check its modifiers and nodes for divisions by zero")
        for index, slot in enumerate(thing.material_slots):
            if slot.link == "OBJECT" and index < len(mesh.materials):
                mesh.materials[index] = slot.material and slot.material.original
        self._meshes[key] = mesh if mesh.polygons else None
        return self._meshes[key]

    @staticmethod
    def _deformable(instance, data):
        """`data` if it is a mesh that may deform while the shutter is open, else None."""
        still = not _is_by_nodes(instance) and _is_unmodified(instance.object.original)
        still = still and not (isinstance(data, bpy.types.Mesh) and motion.VELOCITY in data.attributes)
        return data if isinstance(data, bpy.types.Mesh) and not still else None

    def _put(self, original, data, matrix, hidden, group, keys, properties, key):
        if not all(math.isfinite(x) for row in matrix for x in row):
            self._warn(f'object "{original.name}"', f"its place is not a number: {_OUT}; "
                                                    "check its constraints and drivers for divisions by zero")
            return
        at_frame = matrix
        if isinstance(data, bpy.types.Mesh):
            data, matrix = self._transformed(original, data, matrix)
        elif not motion.has_no_shear(matrix):
            what = "skews its picture" if isinstance(data, bpy.types.Camera) else "shears it"
            self._warn(f'object "{original.name}"', f"the uneven scale of its parents {what} in Cycles, not here; "
                                                    "apply the scale of its parents (Object > Apply > Scale)")
        if isinstance(data, bpy.types.Camera):
            matrix = camera_export.without_scale(matrix)
        body = self.add(original.name, data, matrix, hidden, group)
        self.keys[body.name] = keys
        guard.attempt(self._warn, self.where(body), None, motion.STANDS_STILL,
                      self.motion.follow, key, body, matrix, at_frame, self)
        body.color, body.pass_index = original.color, original.pass_index
        for name, value in properties.items():
            body[name] = value
        if original.type != "LIGHT" and original.is_shadow_catcher:
            self.add_extras(body, shadow_catcher=True)
        if "caustique" in original:
            self.add_extras(body, **original["caustique"].to_dict())
        if original == bpy.context.scene.camera and self.scene.camera is None:
            self.scene.camera = body
        rest = [ray for ray in hidden if ray != "camera"]
        if rest:
            self._warn(self.where(body), f"it is hidden from {', '.join(rest)} rays in Cycles: here they meet it; "
                                         "switch these rays on (Object > Visibility > Ray Visibility) to see the same "
                                         "in Cycles")

    def _transformed(self, original, mesh, matrix):
        """The mesh and matrix of an object, with parts of the matrix applied to a copy of the mesh.

        These are shear, which location, rotation and scale cannot express, scale below bumps, because Cycles evaluates
        bumps in world space and bakes them in object space, and uneven scale below normal maps, which it stretches.
        """
        relief, (place, turn, scale) = _relief(mesh), matrix.decompose()
        sheared = not motion.has_no_shear(matrix)
        stretched = "NORMAL_MAP" in relief and (sheared or is_uneven(scale))
        if sheared:
            applied, rest = matrix, Matrix()
        elif stretched and self._bakes or "BUMP" in relief and any(
                abs(abs(s) - 1) > _MAX_EVEN_RATIO - 1 for s in scale):
            applied, rest = Matrix.Diagonal((*scale, 1)), Matrix.LocRotScale(place, turn, None)
        else:
            return mesh, matrix
        where, made = f'object "{original.name}"', self._applied.setdefault(mesh.name, {})
        key = tuple(round(x, 5) for row in applied for x in row)
        if key not in made and rest != Matrix() and len(made) >= _MAX_SCALES:
            self._warn(where, "its mesh has instances of many scales, and relief of one: it is as steep as without scale; "
                              "use at most 16 scales, or a Displace modifier")
            return mesh, matrix
        if stretched and not self._bakes:
            self._warn(where, STRETCHED)
        if key not in made:
            made[key] = self._apply(mesh, applied, stretched and self._bakes)
        return made[key], rest

    def _apply(self, mesh, matrix, stretched):
        made = mesh.copy()
        self.names[self.remove_later(made).name] = self.names[mesh.name]
        standin.add_object_coordinates(made)
        if stretched:
            standin.add_normal_map_axes(made, matrix.to_3x3())
            self.stretched |= {material.name for material in made.materials if material is not None}
        made.transform(matrix)
        if matrix.determinant() < 0:
            made.flip_normals()
        return made

    def add(self, name, data, matrix, hidden=(), group=None):
        """Add an object with this world matrix, the kinds of rays that do not hit it, and its light group."""
        body = self.remove_later(bpy.data.objects.new(name, data))
        self.names[body.name] = name
        self.scene.collection.objects.link(body)
        body.matrix_world = matrix
        self.things.append(body)
        self.hidden[body.name] = hidden
        if "camera" in hidden:
            self.add_extras(body, visible={"camera": False})
        self.groups[body.name] = group
        if group:
            self.add_extras(body, light_group=group)
        return body

    def hide(self, thing):
        """Take one of `things` out of the scene until `show`."""
        if thing.name in self.scene.collection.objects:
            self.scene.collection.objects.unlink(thing)

    def show(self, thing):
        """Put one of `things` back into the scene."""
        if thing.name not in self.scene.collection.objects:
            self.scene.collection.objects.link(thing)

    def remove(self, thing):
        """Remove one of `things` from the scene."""
        self.things.remove(thing)
        self.hide(thing)

    def _warn_of(self, thing):
        """Warn of an object's features that are visible in Cycles and lost here."""
        where = f'object "{thing.name}"'
        for system in getattr(thing, "particle_systems", ()):
            kind = system.settings.render_type
            if kind not in {"NONE", "OBJECT", "COLLECTION"}:
                what = "hair" if kind == "PATH" else f"particles that render as {kind}"
                self._warn(where, f'{what} of particle system "{system.name}" is not carried; convert it to a mesh')
        if getattr(thing.cycles, "use_adaptive_subdivision", False):
            self._warn(where, "adaptive subdivision is not carried: the modifier's render level is taken; "
                              "raise the Subdivision modifier's Levels > Render")


def _random_of_name(name):
    """The random number (32 bits) of an object that is no instance: Blender gives it to instances alone."""
    text = 0
    for byte in name.encode():
        text = (text * 37 + byte) & 0xFFFFFFFF
    # The final mixing of lookup3 [Jenkins 2006] of two words, the second one 0.
    words = {"a": 0xDEADBEEF + 21 + text & 0xFFFFFFFF, "b": 0xDEADBEEF + 21, "c": 0xDEADBEEF + 21}
    for to, other, turn in (("c", "b", 14), ("a", "c", 11), ("b", "a", 25), ("c", "b", 16), ("a", "c", 4),
                            ("b", "a", 14), ("c", "b", 24)):
        turned = words[other] << turn | words[other] >> 32 - turn
        words[to] = ((words[to] ^ words[other]) - turned) & 0xFFFFFFFF
    return words["c"]


def _remove_points_that_are_no_numbers(mesh):
    """Remove the vertices of a mesh whose position is not finite, as Cycles does. Returns their number."""
    places = numpy.empty(len(mesh.vertices) * 3, numpy.float32)
    mesh.vertices.foreach_get("co", places)
    odd = numpy.flatnonzero(~numpy.isfinite(places.reshape(-1, 3)).all(1))
    if len(odd):
        shape = bmesh.new()
        shape.from_mesh(mesh)
        shape.verts.ensure_lookup_table()
        bmesh.ops.delete(shape, geom=[shape.verts[i] for i in odd], context="VERTS")
        shape.to_mesh(mesh)
        shape.free()
    return len(odd)


def is_uneven(scale):
    """Whether the three factors of a scale differ."""
    return max(map(abs, scale)) > _MAX_EVEN_RATIO * min(map(abs, scale))


def _relief(mesh):
    """Which of "BUMP" (also displacement as bump) and "NORMAL_MAP" the materials of a mesh have."""
    found = set()
    for material in mesh.materials:
        tree = nodes_of(material) if material is not None else None
        output = output_of(tree)
        if output is not None:
            found |= {node.type for node, _ in upstream(output.inputs["Surface"]).values()} & {"BUMP", "NORMAL_MAP"}
            found |= {"BUMP"} if source(output.inputs["Displacement"])[0] is not None else set()
    return found


def _is_pattern(instance):
    """Whether renders show an object only as instances on the vertices or faces of its parent."""
    parent = instance.object.original.parent
    if parent is None or parent.instance_type not in {"VERTS", "FACES"}:
        return False
    return not instance.is_instance or instance.parent.original != parent


def _is_by_nodes(instance):
    """Whether the geometry nodes of an object made an instance."""
    return instance.is_instance and instance.instance_object.original == instance.parent.original


def _is_unmodified(thing):
    """Whether an object shows its mesh unmodified, so that objects with this mesh can share it."""
    plain = thing.type == "MESH" and not thing.modifiers and thing.data.shape_keys is None
    return plain and all(slot.link == "DATA" for slot in thing.material_slots)
