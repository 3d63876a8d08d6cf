"""A fluid from frame to frame, compared with Cycles; a minute."""

import os
import subprocess
import sys

import cycles_comparison  # first: it sets the search path
import bpy
import export
import glb
import numpy
import support
from cycles_comparison import shared


class Dam(cycles_comparison.CyclesComparison):
    def test_dam_break(self):
        """Frames of a fluid have other faces each, foam of many shades, and matt parts as in Cycles."""
        blend = os.path.join(self.folder, "dam.blend")
        subprocess.run([sys.executable, support.ROOT / "scenes" / "blender" / "dam.py", blend], check=True, capture_output=True)
        bpy.ops.wm.open_mainfile(filepath=blend)
        self.scene = bpy.context.scene
        self.scene.render.resolution_x, self.scene.render.resolution_y = 64, 40
        warnings = export.write_frames(os.path.join(self.folder, "dam.##.glb"), 11, 12)
        self.assertNotIn("its faces change", "".join(warnings))
        documents = [glb.read(os.path.join(self.folder, f"dam.{frame}.glb"))[0] for frame in (11, 12)]
        counts = [document["accessors"][part["attributes"]["POSITION"]]["count"] for document in documents
                  for mesh in document["meshes"] for part in mesh["primitives"] if mesh["name"] == "water" and "targets" in part]
        self.assertEqual((len(counts), len(set(counts))), (2, 2), "faces differ, and move by their velocity")
        shades = {tuple(material["pbrMetallicRoughness"]["baseColorFactor"]) for material in documents[1]["materials"]
                  if material["name"].startswith("foam")}
        self.assertGreater(len(shades), 20)
        out = os.path.join(self.folder, "dam.##.exr")
        support.run(["render", os.path.join(self.folder, "dam.##.glb"), "--frames", "11-12", "-o", out, "--iterations", 64,
                     "--width", 64, "--height", 40, "--no-combine", "--progress", "none", "--layers", "beauty"], check=0)
        self.scene.frame_set(12)
        ours, theirs = shared.pixels(os.path.join(self.folder, "dam.12.exr")), self.cycles(64)
        for part in (slice(1, 9), slice(30, 39)):  # rows of the floor, and of the wall
            numpy.testing.assert_allclose(ours[part].mean((0, 1)), theirs[part].mean((0, 1)), rtol=0.04)
