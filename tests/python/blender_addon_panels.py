"""Tests the add-on's panels: settings that the exporter reads are reachable, presets of glass, and priorities. Needs bpy."""

import os
import pathlib
import types
import unittest
from unittest import mock

import bpy

import support
from addon import Installed, part_of_addon

import export
import glb


SUBDIR = "caustique_render"


class Panels(Installed):
    def drawn(self, module, name):
        """The names of the properties and operators that a panel draws."""
        kind = getattr(part_of_addon(module), name)
        layout = mock.MagicMock()
        self.assertTrue(kind.poll(self.context))
        kind.draw(types.SimpleNamespace(layout=layout, _column=lambda: layout.column()), self.context)
        calls = [call for call in layout.mock_calls if call[0].rsplit(".", 1)[-1] in {"prop", "prop_search", "template_node_view"}]
        return {call.args[1] if isinstance(call.args[1], str) else "nodes" for call in calls}

    def test_settings_that_are_exported_are_reachable(self):
        self.stage()
        light = bpy.data.lights.new("panel", "AREA")
        self.put("panel", light)
        if bpy.app.version < (5, 1, 0):
            light.use_nodes = True
        world = self.scene.world = bpy.data.worlds.new("world")
        ball = bpy.data.objects["ball"]
        region = types.SimpleNamespace(width=400)
        self.context = types.SimpleNamespace(
            engine="CAUSTIQUE", scene=self.scene, view_layer=self.layer, object=ball, light=light, world=world,
            material=ball.active_material, region=region,
            preferences=types.SimpleNamespace(system=types.SimpleNamespace(ui_scale=1.0)))
        for module, name, wanted in (
            ("scene_panels", "FilmPanel", {"film_transparent", "film_exposure"}),
            ("scene_panels", "PerformancePanel", {"threads", "threads_mode", "use_persistent_data"}),
            ("scene_panels", "SimplifyPanel", {"simplify_subdivision_render"}),
            ("scene_panels", "MotionBlurPanel", {"motion_blur_position", "motion_blur_shutter"}),
            ("scene_panels", "ObjectMotionBlurPanel", {"motion_steps", "use_deform_motion"}),
            ("scene_panels", "LayerPanel", {"use_sky"}),
            ("scene_panels", "ObjectPanel", {"hide_render", "visible_camera", "lightgroup"}),
            ("scene_panels", "LightNodesPanel", {"nodes"}),
            ("scene_panels", "DisplacementPanel", {"displacement_method", "nodes"}),
            ("scene_panels", "WorldPanel", {"camera", "lightgroup"}),
            ("panels", "LightPanel", {"spread", "shape", "energy"}),
            ("material_panel", "MaterialPanel", {"caustique_abbe", "caustique_priority"}),
        ):
            with self.subTest(name):
                self.assertEqual(wanted - self.drawn(module, name), set())
        self.scene.render.engine = self.context.engine = "CYCLES"
        self.assertFalse(part_of_addon("scene_panels").FilmPanel.poll(self.context))


class Presets(Installed):
    def test_supplied_presets_set_the_options(self):
        folder = pathlib.Path(part_of_addon("presets_menu").__file__).parent / "presets"
        given = {}
        for path in sorted(folder.glob("*.py")):
            self.settings.seed, self.settings.arguments = 7, "--max-depth 8"
            self.assertEqual(bpy.ops.script.execute_preset(filepath=str(path), menu_idname="CAUSTIQUE_PT_presets"), {"FINISHED"})
            words = part_of_addon("command").method(self.settings)
            self.assertEqual(words[words.index("--seed") + 1], "7", "a preset leaves the seed alone")
            self.assertIn("--max-depth", words)
            given[path.stem] = [word for word in words if word in {"--iterations", "--time", "--target-error"}]
        self.assertEqual(given, {"draft": ["--iterations"], "preview": ["--time"], "farm": ["--iterations"],
                                 "final": ["--iterations", "--target-error"]})

    def test_users_add_presets_and_remove_them(self):
        with mock.patch.dict(os.environ, {"BLENDER_USER_SCRIPTS": str(self.dir / "scripts")}), \
                mock.patch.object(bpy.utils, "user_resource", lambda *_, path="", **__: self.made(path)), \
                mock.patch.object(bpy.utils, "script_paths", lambda *_, **__: [str(self.dir / "scripts" / "presets")]):
            self.settings.iterations, self.settings.finish, self.settings.use_volume = 99, "own", False
            self.assertEqual(bpy.ops.caustique.add_preset(name="My own"), {"FINISHED"})
            path = self.dir / "scripts" / "presets" / "caustique_render" / "My_own.py"
            self.assertTrue(path.is_file())
            self.settings.iterations, self.settings.finish, self.settings.use_volume = 1, "off", True
            bpy.ops.script.execute_preset(filepath=str(path), menu_idname="CAUSTIQUE_PT_presets")
            found = self.settings.iterations, self.settings.finish, self.settings.use_volume
            self.assertEqual(found, (99, "own", False))
            bpy.ops.caustique.add_preset(name="My own", remove_name=True)
            self.assertFalse(path.exists())

    def made(self, path):
        """A folder of the user's scripts, which is made if it does not exist."""
        folder = self.dir / "scripts" / path
        folder.mkdir(parents=True, exist_ok=True)
        return str(folder)

    def test_the_menu_lists_supplied_presets_and_those_of_users(self):
        kind = part_of_addon("presets_menu").Presets
        layout, listed = mock.MagicMock(), []
        panel = types.SimpleNamespace(
            layout=layout, preset_operator=kind.preset_operator, preset_subdir=SUBDIR, bl_idname=kind.bl_idname,
            path_menu=lambda folders, *_, **__: listed.append(list(folders)))
        kind.draw(panel, bpy.context)
        self.assertEqual(len(listed), 2)
        self.assertEqual({"draft.py", "farm.py", "final.py", "preview.py"}, set(os.listdir(listed[0][0])) - {"__pycache__"})
        head = types.SimpleNamespace(layout=mock.MagicMock())
        part_of_addon("panels").MethodPanel.draw_header_preset(head, bpy.context)
        self.assertEqual(head.layout.popover.call_args.kwargs["panel"], "CAUSTIQUE_PT_presets")


class Substances(Installed):
    def make(self, material, preset):
        with bpy.context.temp_override(material=material):
            self.assertEqual(bpy.ops.caustique.make_glass(preset=preset), {"FINISHED"})

    def written(self):
        path = str(self.dir / "scene.glb")
        export.write(path)
        return next(m for m in glb.read(path)[0]["materials"] if m["name"] == "ball glass")

    def test_presets_and_fields_reach_the_file(self):
        self.stage()
        material = bpy.data.objects["ball"].active_material
        self.make(material, "DIAMOND")
        material.caustique_priority = 2
        entry = self.written()
        self.assertAlmostEqual(entry["extensions"]["KHR_materials_ior"]["ior"], 2.4175, 4)
        self.assertAlmostEqual(entry["extensions"]["KHR_materials_dispersion"]["dispersion"], 20 / 55.3, 4)
        self.assertEqual(entry["pbrMetallicRoughness"]["baseColorFactor"], [1, 1, 1, 1])
        self.assertEqual(entry["extras"]["caustique"]["priority"], 2)
        support.run(["info", self.dir / "scene.glb"], check=0)
        material.caustique_priority, material.caustique_abbe = 0, 0.0
        entry = self.written()
        self.assertNotIn("KHR_materials_dispersion", entry["extensions"])
        self.assertNotIn("priority", entry.get("extras", {}).get("caustique", {}))
        self.assertEqual(list(material.keys()), [])

    def test_any_material_becomes_any_substance(self):
        empty = bpy.data.materials.new("empty")
        if bpy.app.version < (5, 0, 0):
            empty.use_nodes = True
        empty.node_tree.nodes.clear()
        for name, (_, _, ior, abbe) in part_of_addon("material_panel").PRESETS.items():
            self.make(empty, name)
            shader = next(n for n in empty.node_tree.nodes if n.type == "BSDF_PRINCIPLED")
            self.assertAlmostEqual(shader.inputs["IOR"].default_value, ior, 4)
            self.assertAlmostEqual(empty.caustique_abbe, abbe, 4)

    def test_grey_glass_is_explained(self):
        hint = part_of_addon("material_panel").hint
        glass = self.material("glass", Transmission_Weight=1.0, Roughness=0.0)
        self.assertIn("dims the light behind this glass to 80%", hint(glass))
        self.make(glass, "WATER")
        self.assertIsNone(hint(glass))
        self.assertIsNone(hint(self.material("paint")))


if __name__ == "__main__":
    unittest.main()
