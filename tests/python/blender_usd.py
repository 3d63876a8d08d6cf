"""Compares Blender's USD export with the glTF export: both give the same picture."""

import os
import unittest

import bpy
import support
from cycles_comparison import CyclesComparison, eye, lamp, shared, square


class UsdAgainstGltf(CyclesComparison):
    """Renders one scene through both exports."""

    def through_usd(self, iterations, *options):
        """Render the USD stage that Blender writes. Returns the picture and the warnings."""
        path, out = (os.path.join(self.folder, name) for name in ("stage.usda", "usd.exr"))
        bpy.ops.wm.usd_export(filepath=path, generate_materialx_network=True, export_animation=False)
        done = support.run(["render", path, "-o", out, "--iterations", iterations, "--no-combine", "--progress", "none",
                            "--width", self.scene.render.resolution_x, "--layers", "beauty", *options], check=0)
        return shared.pixels(out), done.stderr

    def ball(self, name, at, **inputs):
        """Add a ball with a Principled BSDF with these inputs."""
        bpy.ops.mesh.primitive_uv_sphere_add(radius=0.35, location=at, segments=48, ring_count=24)
        material = shared.node_material(name, "ShaderNodeBsdfPrincipled", **{
            key.replace("_", " "): value for key, value in inputs.items()})
        bpy.context.object.data.materials.append(material)
        bpy.ops.object.shade_smooth()

    def set_up(self):
        """Add a glass and a metal ball on a floor. Not with Diffuse BSDF, which Blender exports as a glossy surface."""
        floor = shared.node_material("floor", "ShaderNodeBsdfPrincipled", **{
            "Base Color": (0.8, 0.8, 0.8, 1), "Roughness": 1.0, "Specular IOR Level": 0.0})
        shared.place("floor", square(floor, 3.0, "floor"))
        self.ball("glass", (-0.4, 0, 0.4), Transmission_Weight=1.0, Roughness=0.0, IOR=1.45, Base_Color=(1, 1, 1, 1))
        self.ball("metal", (0.4, 0, 0.4), Metallic=1.0, Roughness=0.3, Base_Color=(0.9, 0.6, 0.3, 1))
        eye((0, -2.5, 1.5), (0, 0, 0.3), lens=50)

    def test_a_point_an_area_and_a_sun(self):
        self.set_up()
        lamp("POINT", (1, 1, 2), 40, shadow_soft_size=0.2)
        lamp("AREA", (-1, 0, 2), 40, size=0.8)
        lamp("SUN", (0, 0, 3), 0.6, angle=0.1)
        ours = self.caustique(96)
        theirs, warnings = self.through_usd(96)
        self.alike(ours, theirs)
        self.assertIn("Blender 4 writes suns", warnings)
        # The test detects a lamp that is 25 % brighter.
        bpy.data.objects["area"].data.energy *= 1.25
        with self.assertRaises(AssertionError):
            self.alike(ours, self.through_usd(96)[0])

    def test_a_world_and_a_spot_with_a_hard_edge(self):
        self.set_up()
        self.sky()
        lamp("SPOT", (0.5, 0, 2), 60, shadow_soft_size=0.05, spot_blend=0.0, spot_size=1.0)
        theirs, _ = self.through_usd(96)
        self.alike(self.caustique(96), theirs)

    def sky(self):
        """Add a world of one colour."""
        world = bpy.data.worlds.new("sky")
        self.scene.world = world
        world.use_nodes = True
        background = world.node_tree.nodes["Background"]
        background.inputs["Color"].default_value = (0.2, 0.4, 0.8, 1)
        background.inputs["Strength"].default_value = 0.5

    def test_scenes_of_the_project(self):
        for name in ("torus", "blocks"):
            with self.subTest(name):
                bpy.ops.wm.read_factory_settings(use_empty=True)
                bpy.ops.import_scene.gltf(filepath=str(support.scene(name)))
                self.scene = bpy.context.scene
                self.scene.render.resolution_x = self.scene.render.resolution_y = 32
                # Blender writes no volumes.
                for material in bpy.data.materials:
                    output = next(node for node in material.node_tree.nodes if node.type == "OUTPUT_MATERIAL")
                    for link in output.inputs["Volume"].links:
                        material.node_tree.links.remove(link)
                self.scene.camera = next(thing for thing in self.scene.objects if thing.type == "CAMERA")
                theirs, _ = self.through_usd(64)
                self.alike(self.caustique(64), theirs, tolerance=0.03)


if __name__ == "__main__":
    unittest.main()
