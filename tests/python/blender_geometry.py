"""The exporter writes the geometry that a render shows, compared with Cycles."""

import unittest

import cycles_comparison  # first: it sets the search path
import bpy
import export
import glb
from cycles_comparison import eye, glow, lamp, square


class Geometry(cycles_comparison.CyclesComparison):
    def put(self, name, x, y, color, mesh=None, collection=None):
        body = bpy.data.objects.new(name, mesh or square(glow(name, color)))
        (collection or self.scene.collection).objects.link(body)
        body.location = (x, y, 0)
        return body

    def collection(self, name, parent=None):
        made = bpy.data.collections.new(name)
        if parent is None:
            self.scene.collection.children.link(made)
        return made

    def look(self, size=8):
        self.scene.render.resolution_x = self.scene.render.resolution_y = 64
        eye((size / 2 - 0.5, size / 2 - 0.5, 5), (size / 2 - 0.5, size / 2 - 0.5, 0), type="ORTHO", ortho_scale=size)

    def test_objects_visible_in_renders_are_exported(self):
        """Visibility of objects, parents, collections and modifiers is that of renders, not of the viewport."""
        hidden = bpy.data.objects.new("parent", None)
        self.scene.collection.objects.link(hidden)
        hidden.location, hidden.hide_viewport = (1, 0, 0), True
        self.put("child of a hidden object", 0, 0, (1, 0, 0)).parent = hidden
        self.put("hidden in the viewport", 2, 0, (0, 1, 0)).hide_viewport = True
        self.put("hidden by its eye", 3, 0, (0, 0, 1)).hide_set(True)
        self.put("hidden in renders", 4, 0, (1, 1, 1)).hide_render = True
        for x, name in enumerate(("excluded", "not rendered", "its eye closed", "off in the viewport")):
            self.put("in " + name, x, 1, (1, 1, 0), collection=self.collection(name))
        layers = bpy.context.view_layer.layer_collection.children
        layers["excluded"].exclude = True
        bpy.data.collections["not rendered"].hide_render = True
        layers["its eye closed"].hide_viewport = True
        bpy.data.collections["off in the viewport"].hide_viewport = True
        array = self.put("in renders twice", 0, 2, (0, 1, 1)).modifiers.new("array", "ARRAY")
        array.count, array.show_viewport, array.use_relative_offset = 2, False, False
        array.use_constant_offset, array.constant_offset_displace = True, (1, 0, 0)
        once = self.put("in renders once", 3, 2, (1, 0, 1)).modifiers.new("array", "ARRAY")
        once.count, once.show_render = 3, False
        self.look(6)
        self.silhouettes_agree(self.caustique(16), self.cycles(16))
        self.assertTrue(hidden.hide_viewport and layers["its eye closed"].hide_viewport and not array.show_viewport)

    def test_instances(self):
        """Instances of collections, vertices, faces and geometry nodes, nested and mirrored, are in the right
        places."""
        inner = self.collection("inner", parent=False)
        self.put("red", 0.1, 0, (1, 0, 0), collection=inner)
        for x, scale in ((0, 1), (1.5, -0.5)):
            empty = bpy.data.objects.new("instance", None)
            self.scene.collection.objects.link(empty)
            empty.instance_type, empty.instance_collection = "COLLECTION", inner
            empty.location, empty.scale = (x, 0, 0), (scale, 1, 1)
        points = bpy.data.meshes.new("points")
        points.from_pydata([(0, 0, 0), (1.2, 0.5, 0), (2.4, 0, 0)], [], [])
        plant = self.put("plants", 0, 2, (0, 0, 0), points)
        plant.instance_type = "VERTS"
        self.put("plant", 0, 2, (0, 1, 0)).parent = plant
        nodes = self.put("nodes", 3.5, 2.5, (0, 0, 0), points.copy())
        self.instance_on_points(nodes, self.put("by nodes", 9, 9, (0, 0, 1)), None)
        raw = self.put("raw", 3, 1, (0, 0, 0), points.copy())
        self.instance_on_points(raw, None, glow("made by nodes", (1, 1, 0)))
        self.look(7)
        self.silhouettes_agree(self.caustique(16), self.cycles(16))
        self.assertEqual(self.warnings, [])
        document = glb.read(self.path)[0]
        uses = [node["mesh"] for node in document["nodes"] if node["name"] == "plant"]
        self.assertEqual((len(uses), len(set(uses))), (3, 1), "instances share their mesh")
        self.assertEqual({node["name"] for node in document["nodes"]}, {"red", "plant", "by nodes", "raw", "eye"})

    def test_particles(self):
        """Particles have objects in the number of renders. Hair paths are a named loss."""
        mesh = square(glow("ground", (0.3, 0, 0)), 2)
        ground = self.put("ground", 2, 2, (0, 0, 0), mesh)
        leaf = self.put("leaf", 20, 20, (0, 1, 0))
        leaf.modifiers.new("solid", "SOLIDIFY").thickness = 0.5
        system = ground.modifiers.new("leaves", "PARTICLE_SYSTEM").particle_system
        hair = system.settings
        hair.type, hair.count, hair.render_type, hair.instance_object = "HAIR", 20, "OBJECT", leaf
        hair.use_advanced_hair, hair.particle_size, hair.display_percentage = True, 0.15, 10
        self.look(6)
        self.silhouettes_agree(self.caustique(16), self.cycles(16))
        self.assertEqual(self.warnings, [])
        hair.render_type = "PATH"
        lost = 'object "ground": hair of particle system "leaves" is not carried; convert it to a mesh'
        self.assertEqual(export.write(self.path), [lost])

    def instance_on_points(self, body, thing, material):
        tree = bpy.data.node_groups.new("instances", "GeometryNodeTree")
        for direction in ("INPUT", "OUTPUT"):
            tree.interface.new_socket("Geometry", in_out=direction, socket_type="NodeSocketGeometry")
        nodes = {kind: tree.nodes.new(kind) for kind in ("NodeGroupInput", "NodeGroupOutput",
                                                         "GeometryNodeInstanceOnPoints")}
        on_points = nodes["GeometryNodeInstanceOnPoints"]
        tree.links.new(nodes["NodeGroupInput"].outputs[0], on_points.inputs["Points"])
        if thing is not None:
            of = tree.nodes.new("GeometryNodeObjectInfo")
            of.inputs["Object"].default_value, of.inputs["As Instance"].default_value = thing, True
            tree.links.new(of.outputs["Geometry"], on_points.inputs["Instance"])
            on_points.inputs["Rotation"].default_value = (0, 0, 0.5)
        else:
            grid, worn = tree.nodes.new("GeometryNodeMeshGrid"), tree.nodes.new("GeometryNodeSetMaterial")
            worn.inputs["Material"].default_value = material
            tree.links.new(grid.outputs["Mesh"], worn.inputs["Geometry"])
            tree.links.new(worn.outputs[0], on_points.inputs["Instance"])
        tree.links.new(on_points.outputs[0], nodes["NodeGroupOutput"].inputs[0])
        body.modifiers.new("nodes", "NODES").node_group = tree

    def test_the_current_frame(self):
        """Animated objects, materials, shape keys, cameras and armatures at frame 10, also sheared ones."""
        moving = self.put("moving", 0, 0, (1, 0, 0))
        for frame, x in ((1, 0), (20, 4)):
            moving.location.x = x
            moving.keyframe_insert("location", frame=frame)
        changing = self.put("changing", 0, 2, (0, 1, 0))
        tree = changing.data.materials[0].node_tree
        strength = next(n for n in tree.nodes if n.type == "EMISSION").inputs["Strength"]
        for frame, value in ((1, 0.0), (10, 1.0), (20, 0.0)):
            strength.default_value = value
            strength.keyframe_insert("default_value", frame=frame)
        keyed = self.put("keyed", 2, 2, (0, 0, 1))
        keyed.shape_key_add(name="Basis")
        key = keyed.shape_key_add(name="wide")
        for point in key.data:
            point.co.x *= 2
        key.value = 1.0
        parent = self.put("parent", 2, 4, (1, 1, 0))
        parent.scale = (2, 0.5, 1)
        child = self.put("sheared", 0, 1, (0, 1, 1))
        child.parent, child.rotation_euler = parent, (0, 0, 0.7)
        self.look(6)
        camera = self.scene.camera
        for frame, x in ((1, 0.0), (20, 4.0)):
            camera.location.x = x
            camera.keyframe_insert("location", frame=frame)
        self.scene.frame_set(10)
        self.silhouettes_agree(self.caustique(16), self.cycles(16))
        self.assertEqual(self.scene.frame_current, 10)

    def test_curves_and_text(self):
        """Curves and text have the resolution of renders, and the materials of their objects."""
        for x, kind in ((0, "FONT"), (2, "CURVE")):
            curve = bpy.data.curves.new(kind, kind)
            if kind == "FONT":
                curve.body = "ab"
            else:
                curve.dimensions, curve.fill_mode = "2D", "BOTH"
                spline = curve.splines.new("BEZIER")
                spline.bezier_points.add(2)
                spline.use_cyclic_u = True
                for point, at in zip(spline.bezier_points, ((0, 0, 0), (1, 0, 0), (0.5, 1, 0))):
                    point.co, point.handle_left_type, point.handle_right_type = at, "AUTO", "AUTO"
                curve.resolution_u, curve.render_resolution_u = 1, 32
            body = self.put(kind, x, 0.2, (1, 1, 1), curve)
            body.scale = (2, 2, 1)
            curve.materials.append(glow("of the data", (1, 0, 0)))
            if kind == "CURVE":
                body.material_slots[0].link = "OBJECT"
                body.material_slots[0].material = glow("of the object", (0, 1, 0))
        self.look(5)
        self.silhouettes_agree(self.caustique(16), self.cycles(16))

    def test_holdouts(self):
        """Objects, and those of collections and instancers, are black without coverage where the camera sees them."""
        for x, name in ((0, "seen"), (1, "out"), (2, "of a collection")):
            self.put(name, x, 0, (1, 1, 1))
        bpy.data.objects["out"].is_holdout = True
        apart = self.collection("apart")
        apart.objects.link(bpy.data.objects["of a collection"])
        bpy.context.view_layer.layer_collection.children["apart"].holdout = True
        self.look(4)
        self.assertEqual(export.write(self.path), [])
        said = {node["name"]: node.get("extras", {}).get("caustique", {}).get("holdout", False)
                for node in glb.read(self.path)[0]["nodes"] if "mesh" in node}
        self.assertEqual(said, {"seen": False, "out": True, "of a collection": True})
        self.silhouettes_agree(self.caustique(16), self.cycles(16))

    def test_losses_are_named(self):
        """Hair, and nodes that act only in the viewport."""
        hair = bpy.data.hair_curves.new("hair")
        hair.add_curves([4])
        self.put("hair", 0, 0, None, hair)
        nodes = self.put("nodes", 3, 0, (0, 0, 0))
        self.instance_on_points(nodes, None, glow("made by nodes", (1, 1, 0)))
        nodes.modifiers[0].node_group.nodes.new("GeometryNodeIsViewport")
        gone = self.put("hidden hair", 4, 0, None, hair)
        gone.hide_render = True
        self.look(6)
        warnings = export.write(self.path)
        self.assertEqual(len(warnings), 2, warnings)
        for what, said in zip(('"hair": hair curves are', '"nodes": its modifier "nodes" has an '
                               'Is Viewport node'), sorted(warnings)):
            self.assertIn("object " + what, said)

    def test_nothing_is_left_behind(self):
        self.test_instances()
        blocks = {kind: len(getattr(bpy.data, kind)) for kind in ("objects", "meshes", "scenes", "materials", "lights",
                                                                   "cameras", "collections", "images")}
        lamp("AREA", (0, 0, 3), 10)
        blocks["objects"] += 1
        blocks["lights"] += 1
        export.write(self.path)
        self.assertEqual(blocks, {kind: len(getattr(bpy.data, kind)) for kind in blocks})
        self.assertEqual(bpy.context.scene, self.scene)


if __name__ == "__main__":
    unittest.main()
