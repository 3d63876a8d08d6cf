"""Tests the parts of the comparison with Mitsuba that need no Mitsuba: glTF reader, scenes, statistics."""

import tempfile
import unittest
from pathlib import Path

import numpy as np

import support

import gltf
import tiles
from lab import compare_scenes as scenes


def renders(seed, count=8, shape=(48, 64), noise=0.2, scale=1.0):
    """Independent noisy renders of one ramp; the standard error of a tile's ratio is 0.4 %."""
    random = np.random.default_rng(seed)
    ramp = np.linspace(0.5, 2.0, shape[0] * shape[1] * 3).reshape(*shape, 3)
    return ramp * scale * (1 + noise * random.standard_normal((count, *ramp.shape)))


class Statistics(unittest.TestCase):
    def test_two_noisy_renders_of_one_scene_agree(self):
        for seed in range(20):
            values = tiles.compare(renders(seed), renders(1000 + seed))
            self.assertTrue(values["agrees"], values)
            self.assertLess(abs(values["mean_ratio"] - 1), 5 * values["mean_ratio_error"])

    def test_standard_errors_are_those_of_the_noise(self):
        # The mean square of 240 z values is 14/12 (t with 14 degrees of freedom), with a standard error of 0.12.
        squares = [tiles.compare(renders(seed), renders(2000 + seed))["chi2_per_tile"] for seed in range(20)]
        self.assertAlmostEqual(np.mean(squares), 14 / 12, delta=0.5)

    def test_one_tile_that_is_off_is_found_and_placed(self):
        ours = renders(1)
        ours[:, 16:32, 32:48] *= 1.06
        values = tiles.compare(ours, renders(2))
        self.assertFalse(values["agrees"])
        self.assertEqual([tile[:2] for tile in values["off"]], [[32, 16]])

    def test_a_mean_that_is_off_is_found(self):
        self.assertFalse(tiles.compare(renders(3, scale=1.02), renders(4))["agrees"])

    def test_too_much_noise_is_no_agreement(self):
        self.assertFalse(tiles.compare(renders(5, noise=1.0), renders(6))["agrees"])

    def test_values_that_are_not_finite_are_no_agreement(self):
        ours = renders(7)
        ours[0, 0, 0, 0] = np.nan
        values = tiles.compare(ours, renders(8))
        self.assertFalse(values["agrees"])
        self.assertEqual(values["not_finite"], 1)


class Reader(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.folder.cleanup)
        for make in scenes.ALL:
            make(Path(cls.folder.name))

    def read(self, name):
        return gltf.read(Path(self.folder.name) / f"{name}.glb")

    def test_the_program_takes_every_scene(self):
        for make in scenes.ALL:
            path = Path(self.folder.name) / f"{make.__name__}.glb"
            done = support.run(["info", path, "--json"], check=0)
            self.assertNotIn("warning", done.stderr)

    def test_instances_stand_where_their_nodes_say(self):
        scene = self.read("metal")
        volumes = {}
        for mesh in scene.meshes:
            a, b, c = mesh.positions[mesh.triangles].transpose(1, 0, 2)
            volumes[mesh.name] = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6
        # Volumes of faceted spheres are a little smaller. One node mirrors its mesh, whose front stays outside.
        for name, sizes in (("gold", (0.4, 0.4, 0.4)), ("steel", (0.5, 0.3, 0.35)), ("mirrored", (0.15, 0.15, 0.2))):
            self.assertAlmostEqual(volumes[name] / (4 / 3 * np.pi * np.prod(sizes)), 0.999, delta=0.002)
        for mesh in scene.meshes:
            a, b, c = mesh.positions[mesh.triangles].transpose(1, 0, 2)
            facets = np.cross(b - a, c - a)
            self.assertTrue((np.einsum("ij,ij->i", facets, mesh.normals[mesh.triangles[:, 0]]) > 0).all(), mesh.name)

    def test_closed_and_open_meshes(self):
        closed = {mesh.name: gltf.is_closed(mesh) for mesh in self.read("frosted").meshes}
        self.assertTrue(closed["frosted"] and closed["slab"])
        self.assertFalse(closed["floor"])

    def test_lamps_are_turned_into_watts(self):
        point = self.read("textures").lights[0]
        np.testing.assert_allclose(point.intensity, np.array([1, 0.9, 0.8]) * 800 / 683)

    def test_unknown_features_are_errors(self):
        path = Path(self.folder.name) / "unknown.gltf"
        path.write_text('{"asset": {"version": "2.0"}, "scenes": [{}], "extensionsUsed": ["KHR_materials_sheen"]}')
        with self.assertRaises(gltf.Unsupported):
            gltf.read(path)


if __name__ == "__main__":
    unittest.main()
