"""Tests that the program reads a .blend. Needs bpy."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
import unittest

import bpy

import support
import package

QUICK = ("--width", 16, "--height", 16, "--iterations", 1, "--method", "path", "--no-finish", "--progress", "none")


class Blend(support.Scratch):
    """A .blend in a folder whose name has a space and an umlaut: a textured plane, and a ball that moves."""

    def setUp(self):
        super().setUp()
        self.folder = self.dir / "a ü"
        (self.folder / "maps").mkdir(parents=True)
        self.temporary = self.dir / "temporary"
        self.temporary.mkdir()
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self.scene = bpy.context.scene
        bpy.ops.mesh.primitive_plane_add(size=8)
        self.plane = bpy.context.object
        self.plane.data.materials.append(self.textured())
        bpy.ops.object.light_add(type="SUN")
        bpy.ops.object.camera_add(location=(0, 0, 10))
        self.scene.camera = bpy.context.object
        bpy.ops.mesh.primitive_uv_sphere_add(location=(0, 0, 1))
        for frame, x in ((1, -1), (3, 1)):
            bpy.context.object.location.x = x
            bpy.context.object.keyframe_insert("location", frame=frame)
        self.path = self.folder / "schöne kugel.blend"
        self.environment = {"CAUSTIQUE_BLENDER": sys.executable, "TMPDIR": self.temporary}

    def textured(self):
        image = bpy.data.images.new("red", 4, 4)
        image.pixels = [1, 0, 0, 1] * 16
        image.filepath_raw, image.file_format = str(self.folder / "maps" / "röt.png"), "PNG"
        image.save()
        material = bpy.data.materials.new("red")
        if bpy.app.version < (5, 0, 0):
            material.use_nodes = True
        tree = material.node_tree
        node = tree.nodes.new("ShaderNodeTexImage")
        node.image = image
        shader = next(n for n in tree.nodes if n.type == "BSDF_PRINCIPLED")
        tree.links.new(node.outputs[0], shader.inputs["Base Color"])
        return material

    def save(self, path=None):
        bpy.ops.wm.save_as_mainfile(filepath=str(path or self.path), relative_remap=True)

    def run_on(self, *words, **options):
        env = {**self.environment, **options.pop("env", {})}
        return support.run(words, env=env, **options)

    def test_frames_and_a_texture_beside_the_file(self):
        self.save()
        bpy.ops.file.make_paths_relative()
        self.save()
        done = self.run_on("render", self.path, "-o", self.dir / "out.####.exr", "--frames", "1-2", *QUICK, check=0)
        frames = [(self.dir / f"out.{n:04}.exr").read_bytes() for n in (1, 2)]
        self.assertNotEqual(*frames)
        self.assertNotIn("lumens", done.stderr)
        layers = self.run_on("info", self.dir / "out.0001.exr", check=0).stdout
        self.assertIn("CryptoObject", layers)
        self.assertNotIn("Level1", layers)
        self.assertEqual(list(self.temporary.iterdir()), [])

    def test_warnings_of_the_exporter_are_warnings_of_the_scene(self):
        tree = self.plane.data.materials[0].node_tree
        shader = tree.nodes.new("ShaderNodeBsdfToon")
        tree.links.new(shader.outputs[0], next(n for n in tree.nodes if n.type == "OUTPUT_MATERIAL").inputs["Surface"])
        self.save()
        said = json.loads(self.run_on("info", self.path, "--json", check=0).stdout)
        self.assertTrue([line for line in said["warnings"] if line.startswith('material "red": ')], said["warnings"])

    def test_scripts_in_the_file_do_not_run(self):
        ran = [self.dir / name for name in ("text", "driver")]
        text = bpy.data.texts.new("registers.py")
        text.write(f"open({str(ran[0])!r}, 'w')")
        text.use_module = True
        driver = self.plane.driver_add("location", 2).driver
        driver.type, driver.expression = "SCRIPTED", f"open({str(ran[1])!r}, 'w').close() or 0.0"
        self.save()
        for path in ran:
            path.unlink(missing_ok=True)
        said = self.run_on("plan", self.path, "--width", 16, check=0).stdout
        self.assertRegex(said, r'scene "Scene": Python in the file does not run \(Driver .*; use a simple expression')
        self.assertEqual([path for path in ran if path.exists()], [])
        # The file would write these where scripts are allowed.
        bpy.ops.wm.open_mainfile(filepath=str(self.path), use_scripts=True)
        self.assertTrue(ran[0].exists())

    def test_files_outside_the_folder_need_permission(self):
        path = self.dir / "elsewhere" / "shot.blend"
        path.parent.mkdir()
        self.save(path)
        done = self.run_on("info", path, check=1)
        self.assertIn("röt.png, which is outside its folder\nhint: ", done.stderr)
        self.run_on("info", path, "--allow-outside", check=0)
        image = bpy.data.images["red"]
        image.source, image.filepath = "TILED", str(self.folder / "maps" / "<UDIM>.png")
        image.name = "tiles"
        (self.folder / "maps" / "1001.png").write_bytes((self.folder / "maps" / "röt.png").read_bytes())
        self.save(path)
        self.assertIn("1001.png, which is outside its folder\n", self.run_on("info", path, check=1).stderr)

    def test_faults_say_what_to_do(self):
        self.save()
        nowhere = {"CAUSTIQUE_BLENDER": None, "PATH": self.dir, "CAUSTIQUE_HOME": self.dir}
        none = self.run_on("info", self.path, check=1, env=nowhere)
        self.assertIn("reading a .blend needs Blender, and none is installed\nhint: install Blender 4.2 or newer", none.stderr)
        self.path.write_bytes(b"BLENDER-v405" + bytes(100))
        self.assertIn("Blender cannot open it: ", self.run_on("info", self.path, check=1).stderr)
        self.assertEqual(list(self.temporary.iterdir()), [])

    def test_an_interrupt_ends_an_exporter_that_hangs(self):
        self.save()
        hanging = self.dir / "python-that-hangs-at-the-second-frame"
        hanging.write_text(f'#!/bin/sh\n[ -e "$0.ran" ] && touch "$TMPDIR/hangs" && exec sleep 100\n'
                           f'touch "$0.ran"\nexec {sys.executable} "$@"\n')
        hanging.chmod(0o755)
        env = {**os.environ, "CAUSTIQUE_BLENDER": str(hanging), "TMPDIR": str(self.temporary)}
        words = [support.binary(), "render", self.path, "-o", self.dir / "out.####.exr", "--frames", "1-2", *map(str, QUICK)]
        with subprocess.Popen(words, env=env, stderr=subprocess.PIPE, text=True) as program:
            while not list(self.temporary.glob("*/hangs")) and program.poll() is None:
                time.sleep(0.02)
            program.send_signal(signal.SIGINT)
            said = program.communicate(timeout=60)[1]
        self.assertIn(f"frame 2: {self.path}: interrupted while the scene was read\n", said)
        self.assertEqual((program.returncode, list(self.temporary.iterdir())), (130, []))

    def test_an_export_ends_with_its_program_or_its_time(self):
        self.save()
        for words, closes in ((["--seconds=600"], True), (["--seconds=0"], False)):
            folder = self.dir / "caustique-blend-x"
            folder.mkdir(exist_ok=True)
            script = shutil.copy(support.ROOT / "scripts" / "blender" / "export_blend.py", folder)
            command = [sys.executable, "-I", "-B", script, "--", self.path, folder / "out.glb", *words]
            with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
                if closes:
                    process.stdin.close()
                said = process.stderr.read()
                self.assertEqual(process.wait(timeout=60), 1)
            self.assertEqual(folder.exists(), not closes)
            self.assertEqual("takes longer than 0 s" in said, not closes, said)

    def test_the_program_contains_the_exporter(self):
        source = (support.ROOT / "src" / "scene" / "blend" / "mod.rs").read_text()
        names = {os.path.basename(path) for path in package._exporter()} | {"export_blend.py"}
        self.assertEqual({name for name in names if f'scripts/blender/{name}"' not in source}, set())


if __name__ == "__main__":
    unittest.main()
