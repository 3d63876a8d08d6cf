"""The exporter names, replaces and passes over whatever is broken in a scene or fails in it."""

import unittest
from unittest import mock

import support

import bpy

import bake
import camera_export
import export
import glb
import lighting
import material_plan
import objects
import shading
import world
from lab.features import torture_stage

MAGENTA = [1, 0, 1]




class Broken(support.Scratch):
    def setUp(self):
        super().setUp()
        self.stage = torture_stage.Stage()
        self.path = str(self.dir / "scene.glb")

    def write(self):
        """Export, and load the file in the program. Returns the document, its objects' names and the warnings."""
        bpy.context.view_layer.update()
        warnings = export.write(self.path, bake_size=16)
        support.run(["info", self.path], check=0)
        self.document = glb.read(self.path)[0]
        return {node["name"] for node in self.document["nodes"]}, warnings

    def entry(self):
        """The written material of the body."""
        return next(m for m in self.document["materials"] if m["name"] == "tested")

    def named(self, warnings, *words):
        self.assertTrue(any(all(word in line for word in words) for line in warnings), (words, warnings))

    def missing(self, name):
        image = bpy.data.images.new(name, 4, 4)
        image.source, image.filepath = "FILE", "//not-there/" + name
        return image

    def test_a_material_without_an_output_is_black(self):
        for node in list(self.stage.tree.nodes):
            self.stage.tree.nodes.remove(node)
        self.write()
        self.assertEqual(self.entry()["pbrMetallicRoughness"]["baseColorFactor"], [0, 0, 0, 1])

    def test_groups_without_tree_or_output(self):
        empty = bpy.data.node_groups.new("empty", "ShaderNodeTree")
        for tree in (None, empty):
            node = self.stage.tree.nodes.new("ShaderNodeGroup")
            node.node_tree = tree
            if tree is None:
                self.stage.principled()
                continue
            empty.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
            self.stage.surface(node)
        self.write()

    def test_missing_images_are_magenta_and_named(self):
        for extension in ("Linear", "Closest"):
            texture = self.stage.node("TexImage", image=self.missing("wood.png"))
            texture.interpolation = extension
            self.stage.principled(Base_Color=texture, Specular_IOR_Level=0.0)
            _, warnings = self.write()
            self.named(warnings, 'material "tested"', 'image "wood.png" cannot be read')
            self.assertEqual([round(c, 3) for c in self.entry()["pbrMetallicRoughness"]["baseColorFactor"]], [*MAGENTA, 1])

    def test_a_missing_sky_is_magenta_and_named(self):
        tree = self.stage.scene.world.node_tree
        sky = tree.nodes.new("ShaderNodeTexEnvironment")
        sky.image = self.missing("sky.hdr")
        tree.links.new(sky.outputs[0], self.stage.background.inputs["Color"])
        _, warnings = self.write()
        self.named(warnings, 'world "world"', 'image "sky.hdr" cannot be read')
        self.assertEqual(self.document["scenes"][0]["extras"]["caustique"]["environment"]["color"], MAGENTA)

    def test_numbers_that_are_none(self):
        """Shapes and places that are not numbers, and matrices without inverse."""
        for at, scale in (((float("nan"), 0, 0), (1, 1, 1)), ((0, 0, 0), (0, 0, 0)), ((float("inf"), 0, 0), (1, 1, 1))):
            body = self.stage.place("odd", self.stage.body.data.copy(), at, (0, 0, 0))
            body.scale = scale
        self.stage.place("bent", self.stage.body.data.copy(), (0, 0, 1), (0, 0, 0)).data.vertices[0].co.x = float("nan")
        names, warnings = self.write()
        self.assertIn("body", names)
        self.named(warnings, 'object "odd', "is not a number", "left out")
        self.named(warnings, 'object "bent"', "1 points of its shape are not numbers", "left out")

    def test_whatever_fails_is_named_and_the_rest_is_exported(self):
        """A planted fault in each step of the export costs the thing that it strikes, and nothing else."""
        self.stage.principled(Base_Color=self.stage.node("TexNoise").outputs["Color"])
        self.stage.material.diffuse_color = (0.1, 0.2, 0.3, 1)
        other = torture_stage.matt("other", (0.5, 0.5, 0.5))
        extra = self.stage.place("extra", self.stage.body.data.copy(), (1, 0, 1), (0, 0, 0))
        extra.data.materials.clear()
        extra.data.materials.append(other)
        faults = (
            (material_plan, "match", "tested", 'material "tested"', "diffuse, of its colour in the viewport"),
            (bake.Baker, "passes", None, 'object "body"', "not baked"),
            (objects.FlatScene, "add", None, 'object "extra"', "left out"),
            (lighting, "_area_mesh", None, 'light "lamp"', "it may shine differently"),
            (camera_export, "extras", None, 'camera "', "no lens"),
            (camera_export, "picture", None, 'scene "', "program's own settings"),
            (world, "_world", None, 'world "world"', "black"),
        )
        for owner, function, strikes, where, instead in faults:
            with self.subTest(function), mock.patch.object(owner, function, self.planted(owner, function, strikes)):
                names, warnings = self.write()
                self.named(warnings, where, "planted fault", instead)
                of_nodes = where.startswith(("material", "light", "world"))
                self.named(warnings, where, "simplify its nodes" if of_nodes else "report the error with the file")
                self.assertFalse(of_nodes and any("apply its modifiers" in line for line in warnings), warnings)
                self.assertIn("floor", names)
                if function == "match":
                    base = self.entry()["pbrMetallicRoughness"]["baseColorFactor"]
                    self.assertEqual([round(c, 4) for c in base], [0.1, 0.2, 0.3, 1])
                self.assertEqual("extra" in names, function != "add")

    def test_an_export_that_ends_names_the_material(self):
        self.stage.principled()
        planted = mock.patch.object(shading, "leaves", side_effect=TypeError("planted"))
        with planted, self.assertRaises(TypeError) as end:
            self.write()
        self.assertRegex(end.exception.place, '^material "(tested|floor)"$')

    @staticmethod
    def planted(owner, function, strikes):
        true = getattr(owner, function)

        def fails(*arguments, **keys):
            names = [getattr(argument, "name", argument) for argument in arguments]
            if strikes in names if strikes else function != "add" or "extra" in names:
                raise RuntimeError("planted fault")
            return true(*arguments, **keys)
        return fails

    def test_objects_that_blenders_exporter_cannot_write(self):
        """Blender's exporter fails where two of the objects are in the scene: these are left out."""
        for name in ("bad one", "bad two"):
            self.stage.place(name, self.stage.body.data, (0, 0, 3), (0, 0, 0))
        true = export._run_exporter

        def fails(path):
            flat = bpy.context.scene.collection.objects
            if any(body.name.startswith("bad") for body in flat):
                raise RuntimeError('Error: Python: Traceback (most recent call last):\nKeyError: "planted"\nLocation: x')
            true(path)
        with mock.patch.object(export, "_run_exporter", fails):
            names, warnings = self.write()
        self.assertIn("body", names)
        self.assertFalse(any(name.startswith("bad") for name in names))
        for name in ("bad one", "bad two"):
            self.named(warnings, f'object "{name}"', 'KeyError: "planted"', "left out")


if __name__ == "__main__":
    unittest.main()
