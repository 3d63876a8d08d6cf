"""Tests the extension with a wheel inside, as a user installs it: no path is set, and F12 renders. Needs bpy.

CAUSTIQUE_WHEEL names a wheel of scripts/package.sh. Without it the tests make a wheel whose program runs the one under
test.
"""

import os
import tempfile
import unittest
import zipfile
from unittest import mock

import bpy

import support
from addon import ADDON, Installed, part_of_addon

_METADATA = {
    "METADATA": "Metadata-Version: 2.1\nName: caustique\nVersion: 0.2.0\n",
    "WHEEL": "Wheel-Version: 1.0\nRoot-Is-Purelib: false\nTag: cp310-abi3-manylinux_2_28_x86_64\n",
    "RECORD": "caustique/__init__.py,,\ncaustique/bin/caustique,,\n",
}


class Wheel(Installed):
    installs = True

    def setUp(self):
        # Blender extracts wheels below this folder.
        resources = self.enterContext(tempfile.TemporaryDirectory())
        self.enterContext(mock.patch.dict(os.environ, BLENDER_USER_RESOURCES=resources))
        super().setUp()
        self.resources = os.path.realpath(resources)
        self.preferences.program = ""
        # The PATH has no caustique.
        self.enterContext(mock.patch.dict(os.environ, PATH="/usr/bin:/bin"))

    def wheel(self):
        given = os.environ.get("CAUSTIQUE_WHEEL")
        if given:
            return given
        path = self.dir / "caustique-0.2.0-cp310-abi3-manylinux_2_28_x86_64.whl"
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("caustique/__init__.py", "")
            archive.writestr("caustique/bin/caustique", f'#!/bin/sh\nexec "{support.binary()}" "$@"\n')
            for name, text in _METADATA.items():
                archive.writestr(f"caustique-0.2.0.dist-info/{name}", text)
        return str(path)

    def test_f12_renders_with_the_program_in_the_wheel(self):
        found = part_of_addon("program").find("")
        self.assertTrue(os.path.realpath(found).startswith(self.resources), found)
        self.stage()
        self.assertTrue(self.render())

    def test_a_program_in_the_preferences_is_preferred(self):
        chosen = str(support.binary())
        self.assertEqual(part_of_addon("program").find(chosen), chosen)

    def test_uninstalling_removes_the_program(self):
        found = part_of_addon("program").find("")
        self.uninstall()
        self.assertNotIn(ADDON, bpy.context.preferences.addons)
        self.assertFalse(os.path.exists(found))


if __name__ == "__main__":
    unittest.main()
