"""Tests the add-on's messages: faults with their remedy, warnings, and the diagnosis. Needs bpy."""

import json
import os
import shlex
import sys
import tempfile
import unittest
from unittest import mock

import bpy  # first: it brings bmesh
import bmesh

import support
from addon import Installed, part_of_addon


class Messages(Installed):
    """The interface shows faults, and warnings of ignored settings."""

    def fault(self):
        """Render, and return the error that Blender shows."""
        with self.assertRaises(RuntimeError) as raised:
            self.render()
        self.assertFalse((self.dir / "render.exr").exists())
        return " ".join(str(raised.exception).split())

    def said(self):
        return part_of_addon("session").warnings.get(self.scene.name, [])

    def program(self, text):
        """Replace the program by a shell script with this text."""
        path = self.dir / "stand-in"
        path.write_text(f"#!/bin/sh\n{text}\n")
        path.chmod(0o755)
        self.preferences.program = str(path)

    def test_a_program_that_is_not_there(self):
        self.stage()
        self.preferences.program = str(self.dir / "nowhere")
        message = self.fault()
        self.assertIn("nowhere is not a program", message)
        self.assertIn("Remedy: install the extension that contains", message)
        self.assertIn("nowhere", part_of_addon("session").faults[self.scene.name].what)

    def test_a_program_that_is_not_on_the_path(self):
        self.stage()
        self.preferences.program = ""
        with mock.patch.dict(os.environ, PATH=str(self.dir)):
            self.assertIn("the program caustique is neither in the extension nor on the PATH Remedy: ", self.fault())
        with mock.patch.dict(os.environ, PATH=f"{support.binary().parent}:{os.environ['PATH']}"):
            self.assertTrue(self.render())

    def test_a_program_that_is_too_old(self):
        self.stage()
        self.program("echo 'caustique 0.0.9 (commit 1a2b3c)'; echo Embree 4.4.0, /lib/libembree4.so.4")
        self.assertIn("is version 0.0.9, and the add-on needs 0.2.0 or newer Remedy: update", self.fault())

    def test_a_program_that_is_another(self):
        self.stage()
        self.program("echo something else 1.2.3")
        self.assertIn("does not answer as caustique does", self.fault())

    def test_a_program_that_dies(self):
        self.stage()
        self.program('[ "$1" = --version ] && echo caustique 9.9.9 && exit; [ "$2" = --help ] && exit; kill -9 $$')
        self.assertIn("caustique ended by signal 9", self.fault())

    def test_errors_of_the_program_are_shown_with_their_remedy(self):
        self.stage()
        self.settings.arguments = "--layers Nope"
        message = self.fault()
        self.assertIn('--layers: no layer "Nope" Remedy: there are beauty,', message)
        self.settings.arguments = "--seed 'open"
        self.assertIn("close every quotation mark", self.fault())

    def test_arguments_of_a_file_name_no_files(self):
        """A .blend may come from an untrusted source, so its arguments must not name files."""
        additional, fault = part_of_addon("command").additional, part_of_addon("fault").Fault
        for text in ("--checkpoint /tmp/x", "--checkpoint=x", "-o x", "-ox", "--output x", "--png x", "--preview x",
                     "--resume x", "--env x", "--allow-outside", "--model x", "--max-depth 8 --debug-techniques x",
                     "--usd-layer x", "--overwrite", "--", "--che x", "---png x", "--crop -o x", "-"):
            with self.subTest(text), self.assertRaisesRegex(fault, "a file may come from anybody"):
                additional(text)
        for text in ("--max-depth 8", "--effects -dispersion", "--effects=-dispersion", "--env-rotation -30", "--alpha .5",
                     "--env-strength -.5", "--filter 'gaussian 2'", ""):
            self.assertEqual(additional(text), shlex.split(text))
        self.stage()
        keep = self.dir / "keep.txt"
        keep.write_text("keep")
        self.settings.arguments = f"--checkpoint {keep}"
        self.assertIn("name --checkpoint, and a file may come from anybody Remedy: take it out", self.fault())
        self.assertEqual(keep.read_text(), "keep")

    def test_arguments_that_stages_may_give_files_may_give(self):
        listed = json.loads((support.ROOT / "scripts" / "usd" / "options.json").read_text())["files_may_give"]
        named = {name.replace("_", "-") for name in listed}
        self.assertGreater(len(named), 20)
        self.assertEqual(named - part_of_addon("command").OPTIONS, set())

    def test_scripts_run_where_the_preferences_allow_them(self):
        """Blender does not report a blocked driver in a hidden view layer."""
        hidden = bpy.data.collections.new("hidden")
        self.scene.collection.children.link(hidden)
        self.layer.name = "B"
        shown = self.scene.view_layers.new("A")
        shown.layer_collection.children["hidden"].exclude = True
        body, ran = bpy.data.objects.new("driven", None), self.dir / "ran"
        hidden.objects.link(body)
        driver = body.driver_add("location", 0).driver
        driver.type, driver.expression = "SCRIPTED", f'open("{ran}", "w").close() or 1.0'
        self.scene.view_layers["B"].use = False
        bpy.context.window.view_layer = shown
        path = str(self.dir / "scene.blend")
        bpy.ops.wm.save_as_mainfile(filepath=path)
        ran.unlink(missing_ok=True)
        handoff, preferences = part_of_addon("handoff"), bpy.context.preferences
        filepaths = preferences.filepaths
        bpy.ops.wm.open_mainfile(filepath=path, use_scripts=False)

        def export():
            folder = tempfile.mkdtemp(dir=self.dir)
            job = handoff.Job(bpy.context.scene, "A", 1.0, folder, "")
            job.copy()
            job.run(lambda: False)
            return ran.exists()

        for allowed, word, expected in ((False, None, False), (True, None, True), (True, "-Y", False)):
            filepaths.use_scripts_auto_execute = allowed
            with self.subTest(allowed=allowed, word=word), mock.patch.object(sys, "argv", ["blender", word or "-b"]):
                self.assertEqual(handoff.scripts_allowed(), expected)
        excluded = preferences.autoexec_paths.new()
        excluded.path = str(self.dir)
        self.assertFalse(handoff.scripts_allowed())
        preferences.autoexec_paths.remove(excluded)
        filepaths.use_scripts_auto_execute = False
        self.assertFalse(export())
        filepaths.use_scripts_auto_execute = True
        self.assertTrue(export())

    def test_pictures_that_cannot_be_read(self):
        self.stage()
        self.settings.arguments = "--compression zip"
        self.assertIn("is compressed Remedy: render with '--compression none'", self.fault())
        picture = self.dir / "part.exr"
        support.run(["render", support.scene("cornell"), "-o", picture, "--width", 8, "--iterations", 1,
                     "--compression", "none", "--progress", "none"], check=0)
        whole = picture.read_bytes()
        for data, message in ((whole[:-1], "is not complete"), (b"P6 8 8 255\n" + bytes(192), "is not an EXR file")):
            picture.write_bytes(data)
            with self.assertRaisesRegex(part_of_addon("fault").Fault, message):
                part_of_addon("exr").Picture(str(picture))

    def test_an_animation_ends_at_the_first_fault(self):
        self.stage()
        self.settings.arguments = "--layers Nope"
        self.scene.frame_end = 3
        with self.assertRaises(RuntimeError):
            self.render("frame", animation=True)
        self.assertEqual(list(self.dir.glob("frame-*")), [])

    def test_an_exporter_that_is_none(self):
        self.stage()
        self.preferences.exporter = "/bin/false"
        self.assertIn("the scene could not be exported", self.fault())
        self.preferences.exporter = "/nowhere/blender"
        self.assertIn("/nowhere/blender does not run: No such file or directory Remedy: choose", self.fault())
        with self.assertRaisesRegex(RuntimeError, "/nowhere/blender does not run"):
            bpy.ops.caustique.diagnose()
        self.assertEqual(self.temporary(), [])

    def test_faults_of_the_exporter_itself_are_named(self):
        self.stage()
        exporter = self.repository / "caustique" / "exporter" / "objects.py"
        text = exporter.read_text()
        self.addCleanup(exporter.write_text, text)  # the installation is shared
        exporter.write_text(text.replace("class FlatScene:", "class FlatScene(1 / 0):"))
        self.assertRegex(self.fault(), r"could not be exported: ZeroDivisionError: .* Remedy: this is a fault of caustique's "
                                       r"exporter \(objects.py, line \d+\): report it with the scene")

    def test_the_export_says_what_it_does(self):
        self.stage()
        tree = bpy.data.materials["white"].node_tree
        shader = next(n for n in tree.nodes if n.type == "BSDF_PRINCIPLED")
        tree.links.new(tree.nodes.new("ShaderNodeTexNoise").outputs[0], shader.inputs["Base Color"])
        said, job = [], part_of_addon("handoff").Job
        run = job.run
        watched = lambda job, stopped, tell: run(job, stopped, lambda text: (said.append(text), tell(text)))  # noqa: E731
        with mock.patch.object(job, "run", watched), \
                mock.patch.dict(os.environ, XDG_CACHE_HOME=str(self.dir / "cache")):
            self.render()
        self.assertIn("Baking materials, mesh 1 of 1", said)

    def test_unexpected_errors_are_shown(self):
        self.stage()
        with mock.patch.object(part_of_addon("program"), "find", lambda _: 1 / 0):
            message = self.fault()
        self.assertIn("the add-on has failed: ZeroDivisionError: division by zero Remedy: report it", message)

    def test_libraries_that_are_missing(self):
        nowhere = {"CAUSTIQUE_OIDN": "/nowhere/libOpenImageDenoise.so", "CAUSTIQUE_USD_PYTHON": "/nowhere/python"}
        with mock.patch.dict(os.environ, nowhere):
            faults = part_of_addon("program").missing_libraries(str(support.binary()))
        self.assertEqual([fault.what.split(":")[0] for fault in faults], ["oidn"])
        self.assertTrue(faults[0].remedy)

    def test_warnings_of_the_exporter_and_of_the_program(self):
        self.stage()
        self.ball("bowl", at=(1, 1, 1), closed=False)
        self.render()
        self.assertTrue([line for line in self.said() if line.startswith('material "bowl glass": ')], self.said())
        self.settings.use_caustic = False
        self.render()
        self.assertTrue([line for line in self.said() if "left out, though called for" in line], self.said())

    def test_options_are_called_as_in_the_panels(self):
        of_interface = part_of_addon("wording").of_interface
        for line, expected in (
            ("scene.glb: material \"a\": odd", 'material "a": odd'),
            ("--method bdpt does not find all light; choose --method sppm or vcm",
             "the method bdpt does not find all light; choose the Method sppm or vcm in the panel Method"),
            ("--effects -caustic: left out, though called for by x",
             "the effect 'caustic' is switched off in the panel Effects: left out, though called for by x"),
            ("ask for fewer --photons or more --time",
             "ask for fewer --photons or more Time in the panel Stop (Arguments in the panel Method takes options)"),
        ):
            self.assertEqual(of_interface(line), expected)

    def test_ignored_settings_of_blender_are_named(self):
        ignored_settings, render = part_of_addon("ignored_settings"), self.scene.render
        self.assertIn("it has no objects that renders show", "".join(ignored_settings.warnings(self.scene)))
        self.stage()
        self.assertEqual(ignored_settings.warnings(self.scene), [])
        for name in ("use_multiview", "use_freestyle"):
            setattr(render, name, True)
        render.pixel_aspect_x = 2
        lines = ignored_settings.warnings(self.scene)
        self.assertEqual(len(lines), 3)
        self.assertTrue(all(": " in line for line in lines))

    def test_simulations_are_named(self):
        self.stage()
        bpy.data.objects["plane"].modifiers.new("Flag", "CLOTH")
        bpy.data.objects["ball"].modifiers.new("Smooth", "SUBSURF")
        said = part_of_addon("ignored_settings").warnings(self.scene)
        self.assertEqual(len(said), 1)
        self.assertIn('object "plane": its modifier Flag is not simulated for the render: apply it', said[0])

    def test_passes_that_a_method_does_not_make(self):
        self.stage()
        self.settings.method = "path"
        self.passes("levels")
        found = self.render()
        self.assertFalse(found["Level5.G"].any())
        self.assertTrue([line for line in self.said() if "Level5" in line and "choose another method" in line])

    def test_an_image_with_changes_that_are_not_saved(self):
        self.stage()
        picture = bpy.data.images.new("paint", 4, 4)
        picture.pixels[0] = 0.5
        picture.use_fake_user = True
        self.render()
        self.assertTrue([line for line in self.said() if line.startswith('image "paint": ')], self.said())


class Diagnosis(Installed):
    def ask(self):
        bpy.ops.caustique.diagnose()
        return part_of_addon("session").plans[self.scene.name]

    def test_glass_that_is_a_thin_wall(self):
        self.plane()
        self.sun(3)
        self.eye()
        self.ball("bowl", closed=False)
        self.ball("ball", at=(1, 1, 1))
        plan = self.ask()
        self.assertTrue([line for line in plan.warnings if '"bowl"' in line and "thin wall" in line], plan.warnings)
        self.assertEqual([thing.name for thing in self.scene.objects if thing.select_get()], ["bowl"])
        self.assertEqual(bpy.context.view_layer.objects.active.name, "bowl")
        self.assertEqual(set(part_of_addon("properties").EFFECTS), {effect["name"] for effect in plan.said["effects"]})

    def test_a_lamp_in_a_box_names_the_box(self):
        self.plane()
        self.eye()
        self.ball()
        shape = bmesh.new()
        bmesh.ops.create_cube(shape, size=0.5)
        mesh = bpy.data.meshes.new("casing")
        shape.to_mesh(mesh)
        shape.free()
        mesh.materials.append(self.material("iron", Roughness=1.0))
        self.put("casing", mesh, (0, 1, 3))
        lamp = bpy.data.lights.new("lamp", "POINT")
        self.put("lamp", lamp, (0, 1, 3))
        self.ask()
        self.assertIn("casing", [thing.name for thing in self.scene.objects if thing.select_get()])

    def test_headlines(self):
        self.plane()
        self.sun(3)
        self.eye()
        self.assertIn("Nothing in the scene casts a caustic", self.ask().headline)
        self.ball()
        self.assertIn("Caustics are rendered, by photons", self.ask().headline)
        self.settings.use_caustic = self.settings.use_sds = False
        self.assertIn("they are left out", self.ask().headline)

    def test_the_selection_stays_if_all_is_well(self):
        self.stage()
        bpy.data.objects["sun"].select_set(True)
        self.assertEqual(self.ask().warnings, [])
        self.assertEqual([thing.name for thing in self.scene.objects if thing.select_get()], ["sun"])

    def test_a_fault(self):
        self.stage()
        self.preferences.program = "/nowhere"
        with self.assertRaises(RuntimeError):
            bpy.ops.caustique.diagnose()
        self.assertIn("Remedy", str(part_of_addon("session").plans[self.scene.name].fault))

    def test_names_in_lines(self):
        self.stage()
        named_objects = part_of_addon("program_plan").named_objects
        for line, names in (('object "ball": no light', ["ball"]),
                            ('material "ball glass" on "x" and 2 more', ["ball"]),
                            ('light "sun": all its light stays within "plane"', ["sun", "plane"]),
                            ('world "plane": its nodes', []), ("nothing", [])):
            self.assertEqual([thing.name for thing in named_objects(self.scene, [line])], names, line)


if __name__ == "__main__":
    unittest.main()
