"""Renders features of Blender materials with Cycles and caustique: errors must not exceed docs/lab/blender-table.md.

With CAUSTIQUE_LONG it renders all features that this version of Blender has, otherwise a few.
"""

import os
import unittest
from unittest import mock

import bpy

import support

from lab.features import torture_stage
from lab.figures import torture

SHORT = (
    "principled_coat", "principled_glass_tinted", "image_alpha", "noise_roughness", "image_box", "bump",
    "group_of_textures", "diffuse_glossy_fresnel", "transparent_mask", "principled_mask", "leaves_clipped", "lamp_ies_uneven",
)
# Cycles before Blender 4.5 turns leaning normals towards the viewer, and before 4.4 it smooths bumps: warnings say so.
WARNED_BEFORE_4_5 = {
    "bump_mirror", "normal_map", "normal_map_weak", "normal_map_scaled", "normal_map_other_uv", "bump_over_normal_map",
    "bevel_node",
}


def warned_elsewhere():
    """Features that this version of Blender may show differently from the table's, because a warning names them."""
    if bpy.app.version[:2] == (4, 5):
        return set()
    return torture.named() | (WARNED_BEFORE_4_5 if bpy.app.version < (4, 5, 0) else set())


def exists(name):
    """Whether this version of Blender has the nodes and inputs of a feature: some came with 4.3 and 4.4."""
    try:
        torture_stage.FEATURES[name](torture_stage.Stage())
    except (KeyError, RuntimeError):
        return False
    return True


class Torture(support.Scratch):
    def setUp(self):
        super().setUp()
        self.enterContext(mock.patch.dict(os.environ, XDG_CACHE_HOME=str(self.dir)))

    def test_no_feature_is_worse_than_in_the_table(self):
        stored, elsewhere = torture.rows(), warned_elsewhere()
        names = [name for name in torture_stage.FEATURES if exists(name)]
        self.assertGreater(len(names), 0.95 * len(torture_stage.FEATURES))
        for name in names if os.environ.get("CAUSTIQUE_LONG") else SHORT:
            with self.subTest(name):
                result = torture.run(name)
                self.assertNotEqual(result.verdict, torture.WRONG, result)
                allowed = torture.WARNED if name in elsewhere else stored[name]
                self.assertLessEqual(torture.RANK.index(result.verdict), torture.RANK.index(allowed), result)

    def test_a_wrong_material_is_found_out(self):
        """The comparison must detect a difference of 5 % in a sphere's colour."""
        def off(stage):
            stage.principled(Base_Color=(0.5, 0.5, 0.5), Specular_IOR_Level=0.0)

        def meant(stage):
            stage.principled(Base_Color=(0.55, 0.55, 0.55), Specular_IOR_Level=0.0)
        with mock.patch.dict(torture_stage.FEATURES, off=off):
            theirs = self.cycles(meant)
            with mock.patch.object(torture, "by_cycles", side_effect=theirs):
                self.assertEqual(torture.run("off").verdict, torture.WRONG)

    @staticmethod
    def cycles(make):
        make(torture_stage.Stage())
        return [torture.by_cycles(seed) for seed in (1, 2)]

    def test_the_table_holds_every_feature_and_nothing_wrong(self):
        stored = torture.rows()
        self.assertEqual(list(stored), list(torture_stage.FEATURES))
        self.assertNotIn(torture.WRONG, stored.values())


if __name__ == "__main__":
    unittest.main()
