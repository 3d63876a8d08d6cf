"""Blender reads the EXRs of caustique: every layer is a pass of the right name, in both naming styles."""

import unittest

import bpy

import support

LAYERS = ["Combined", "Depth", "Noisy", "Level1", "Level5", "Variance1", "Radius1", "Direct", "Caustic", "Emission", "Error"]


def passes(path):
    """Names of the passes in Blender's compositor for an image."""
    if bpy.app.version >= (5, 0, 0):
        tree = bpy.data.node_groups.new("compositor", "CompositorNodeTree")
    else:
        bpy.context.scene.use_nodes = True
        tree = bpy.context.scene.node_tree
    node = tree.nodes.new("CompositorNodeImage")
    node.image = bpy.data.images.load(str(path))
    return [socket.name for socket in node.outputs if socket.enabled]


class LoadsInBlender(support.Scratch):
    def render(self, *extra):
        path = self.dir / "cornell.exr"
        size = ["--width", "32", "--height", "24", "--iterations", "2", "--photons", "500"]
        command = ["render", support.scene("cornell"), "-o", path, *size, "--no-combine", "--progress", "none"]
        support.run([*command, *extra], check=0)
        return path

    def test_plain_names(self):
        names = passes(self.render())
        for name in [*LAYERS, "albedo", "normal", "depth"]:
            self.assertIn(name, names)

    def test_blender_names(self):
        names = passes(self.render("--exr-naming", "blender"))
        for name in [*LAYERS, "Denoising Albedo", "Normal"]:
            self.assertIn(name, names)

    def test_several_parts_are_the_passes_of_one(self):
        layers = ("--layers", "all")
        one, parts = passes(self.render(*layers)), passes(self.render(*layers, "--multi-part", "--overwrite"))
        self.assertEqual(parts[0], "Combined")
        # Blender gives Z its pass Depth only at the root of a single part.
        self.assertEqual(set(one) - {"Depth"}, set(parts) - {"Z"})

    def test_a_name_that_is_not_there_is_not_found(self):
        self.assertNotIn("Level6", passes(self.render()))


if __name__ == "__main__":
    unittest.main()
