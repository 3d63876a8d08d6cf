"""The add-on as a package: what Blender thinks of it, where it shows, and that nothing stays of it. Needs bpy."""

import os
import re
import subprocess
import sys
import unittest

import bpy

import support
from addon import ADDON, Installed, part_of_addon


class Lives(Installed):
    def test_uninstalled_nothing_is_left(self):
        self.assertNotEqual(self.registered(), self.before)
        self.uninstall()
        for found, before in zip(self.registered(), self.before):
            self.assertEqual(found, before)
        self.assertNotIn(ADDON, sys.modules)

    def test_blender_finds_no_fault_with_the_package(self):
        tool = next(path for folder in sys.path for path in [os.path.join(folder, "bl_pkg", "cli", "blender_ext.py")]
                    if os.path.isfile(path))
        done = subprocess.run([sys.executable, tool, "validate", self.zip], capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)

    def test_versions_agree(self):
        versions = {tuple(map(int, re.search(pattern, (support.ROOT / name).read_text(), re.M)[1].split(".")))
                    for name, pattern in (("Cargo.toml", r'^version = "([\d.]+)"'),
                                          ("scripts/blender/caustique_addon/blender_manifest.toml", r'^version = "([\d.]+)"'))}
        source = (support.ROOT / "scripts/blender/caustique_addon/__init__.py").read_text()
        versions.add(tuple(map(int, re.search(r'"version": \((.+?)\)', source)[1].split(","))))
        versions.add(part_of_addon("program").OLDEST)
        self.assertEqual(len(versions), 1)

    def test_panels_of_blender_show(self):
        self.scene.render.engine = "CYCLES"
        panels = [panel for panel in bpy.types.Panel.__subclasses__() if "CAUSTIQUE" in getattr(panel, "COMPAT_ENGINES", ())]
        names = {panel.__name__ for panel in panels}
        self.assertLessEqual({"EEVEE_MATERIAL_PT_surface", "EEVEE_WORLD_PT_surface", "DATA_PT_lens", "DATA_PT_camera_dof",
                              "RENDER_PT_output", "RENDER_PT_color_management", "VIEWLAYER_PT_layer"}, names)
        self.assertFalse([name for name in names if name.startswith("CYCLES_") or "freestyle" in name])


if __name__ == "__main__":
    unittest.main()
