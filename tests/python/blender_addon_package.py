"""Tests the add-on's package: it is valid, its panels show, and uninstalling leaves nothing. Needs bpy."""

import os
import re
import subprocess
import sys
import tomllib
import unittest
import zipfile

import bpy

import support
import package
from addon import ADDON, Installed, part_of_addon


class Package(Installed):
    installs = True

    def test_uninstalled_nothing_is_left(self):
        self.assertNotEqual(self.registered(), self.before)
        self.uninstall()
        for found, before in zip(self.registered(), self.before):
            self.assertEqual(found, before)
        self.assertNotIn(ADDON, sys.modules)

    def validate(self, extension):
        paths = (os.path.join(folder, "bl_pkg", "cli", "blender_ext.py") for folder in sys.path)
        tool = next(filter(os.path.isfile, paths))
        done = subprocess.run([sys.executable, tool, "validate", extension], capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)

    def test_blender_finds_no_fault_with_the_package(self):
        self.validate(self.zip)

    def test_an_extension_is_for_the_system_of_its_wheel(self):
        for tag, platform in (("manylinux_2_28_x86_64", "linux-x64"), ("win_amd64", "windows-x64"),
                              ("macosx_13_0_arm64", "macos-arm64")):
            with self.subTest(platform):
                wheel, extension = self.dir / f"caustique-0.2.0-cp310-abi3-{tag}.whl", self.dir / f"{platform}.zip"
                zipfile.ZipFile(wheel, "w").close()
                package.build(extension, str(wheel))
                self.validate(extension)
                with zipfile.ZipFile(extension) as archive:
                    manifest = tomllib.loads(archive.read("caustique/blender_manifest.toml").decode())
                self.assertEqual((manifest["platforms"], manifest["wheels"]), ([platform], [f"./wheels/{wheel.name}"]))

    def test_versions_agree(self):
        addon = support.ROOT / "scripts" / "blender" / "caustique_addon"
        versions = set()
        for path in (support.ROOT / "Cargo.toml", addon / "blender_manifest.toml"):
            found = re.search(r'^version = "(\d+)\.(\d+)\.(\d+)"', path.read_text(), re.MULTILINE)
            versions.add(tuple(map(int, found.groups())))
        found = re.search(r'"version": \((\d+), (\d+), (\d+)\)', (addon / "__init__.py").read_text())
        versions.add(tuple(map(int, found.groups())))
        self.assertEqual(len(versions), 1)
        self.assertLessEqual(part_of_addon("program").OLDEST, versions.pop())

    def test_panels_of_blender_show(self):
        names = {panel.__name__ for panel in bpy.types.Panel.__subclasses__()
                 if "CAUSTIQUE" in getattr(panel, "COMPAT_ENGINES", ())}
        shown = {"EEVEE_MATERIAL_PT_surface", "EEVEE_WORLD_PT_surface", "DATA_PT_lens", "DATA_PT_camera_dof",
                 "RENDER_PT_output", "RENDER_PT_color_management", "VIEWLAYER_PT_layer"}
        self.assertLessEqual(shown, names)
        self.assertFalse([name for name in names if name.startswith("CYCLES_") or "freestyle" in name])


if __name__ == "__main__":
    unittest.main()
