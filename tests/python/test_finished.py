"""Tests the parts of the figures of finished pictures: errors against noisy references, goals, simplified scenes."""

import json
import tempfile
import unittest
from pathlib import Path
from unittest import mock

import numpy as np

import support

import gltf
import pictures
import plain_scene
from lab import goals, picture_errors, twins

SCENES = support.ROOT / "scenes"


class Errors(unittest.TestCase):
    def setUp(self):
        self.random = np.random.default_rng(5)
        self.truth = np.broadcast_to(np.array([1.0, 2.0, 3.0]), (120, 160, 3))

    def noisy(self, size):
        return self.truth + size * self.random.standard_normal(self.truth.shape)

    def test_noise_of_the_reference_drops_out(self):
        reference = picture_errors.Reference(self.noisy(0.2), self.noisy(0.2))
        found = reference.measure(self.noisy(0.1))
        # With 57600 values, five standard errors of a product of two errors are 8 %.
        self.assertAlmostEqual(found["relmse"] / (0.01 / 4.01), 1, delta=0.08)
        self.assertAlmostEqual(found["grain"] / (0.01 / 4.01) * 9 / 8, 1, delta=0.1)
        self.assertAlmostEqual(reference.error / (0.02 / 4.01), 1, delta=0.03)
        self.assertLess(abs(found["mean_ratio"] - 1), 5 * found["mean_ratio_error"])

    def test_an_offset_has_no_grain(self):
        found = picture_errors.Reference(self.truth, self.truth).measure(self.truth + 0.3)
        self.assertAlmostEqual(found["relmse"], 0.09 / 4.01)
        self.assertLess(found["grain"], 1e-20)

    def test_the_worst_are_left_out_and_holes_are_counted(self):
        picture = self.truth + 0.3
        picture[3, 4] = 1e3
        picture[7, 8] = np.nan
        found = picture_errors.Reference(self.truth, self.truth).measure(picture)
        self.assertAlmostEqual(found["relmse_trimmed"], 0.09 / 4.01)
        self.assertLess(found["grain_trimmed"], 1e-20)
        self.assertGreater(found["relmse"], 1)
        self.assertEqual(found["pixels_not_finite"], 1)

    def test_the_program_computes_equal_errors(self):
        picture, truth = self.noisy(0.1).astype(np.float32), self.truth.astype(np.float32)
        found = picture_errors.Reference(truth, truth).measure(picture)
        with tempfile.TemporaryDirectory() as folder:
            paths = [Path(folder) / name for name in ("a.exr", "b.exr")]
            picture_errors.write(paths[0], picture=picture)
            picture_errors.write(paths[1], picture=truth)
            said = json.loads(support.run(["compare", *paths, "--json"]).stdout)
        for key in ("relmse", "grain", "mean_ratio"):
            self.assertAlmostEqual(found[key] / said[key], 1, delta=1e-5, msg=key)
        self.assertAlmostEqual(found["flip"] / said["flip"], 1, delta=2e-2)

    def test_errors_inside_glass_and_mirrors_equal_those_of_the_program(self):
        with tempfile.TemporaryDirectory() as folder:
            paths = [Path(folder) / name for name in ("a.exr", "b.exr")]
            for seed, path in enumerate(paths):
                words = ["render", SCENES / "cornell.glb", "-o", path, "--width", 24, "--method", "path"]
                support.run([*words, "--iterations", 2, "--no-finish", "--seed", seed], check=0)
            said = json.loads(support.run(["compare", *paths, "--json"]).stdout)
            masked = ["compare", *paths, "--json", "--layer", "albedo", "--mask"]
            by_layer = json.loads(support.run([*masked, f"{paths[0]}:Z"]).stdout)
            fault = support.run([*masked, f"{paths[0]}:nothing"], check=2).stderr
            picture, truth = map(picture_errors.Layers, paths)
        self.assertIn('no layer "nothing"', fault)
        self.assertEqual(by_layer["inside"]["pixels"], int((picture.channels["Z"] > 0.5).sum()))
        reference = picture_errors.Reference(truth.get(""), truth.get(""))
        reference.inside = picture.smooth()
        self.assertTrue(0 < reference.inside.sum() == said["inside"]["pixels"] < reference.inside.size / 2)
        found = reference.measure(picture.get(""))
        self.assertAlmostEqual(found["grain_inside"] / said["inside"]["grain"], 1, delta=1e-5)
        self.assertAlmostEqual(found["flip_inside"] / said["inside"]["flip"], 1, delta=5e-2)


class Goals(unittest.TestCase):
    def test_ratios_are_counted(self):
        def figures(value):
            return dict.fromkeys(goals.FIGURES, value)

        ours = {
            "auto": {
                "delivered": figures(0.02),
                "noisy": figures(0.08),
                "level1": figures(0.019),
                "oidn": figures(0.04),
            }
        }
        ours["auto network"] = {"delivered": figures(0.03)}
        ours["path"] = {"delivered": figures(0.01), "noisy": figures(0.01), "oidn": figures(0.01)}
        cell = {
            "floor": 1e-9,
            "ours": ours,
            "peers": {"other": {"oidn": figures(0.05)}, "worse": {"oidn": figures(0.5)}},
        }
        found = goals.goals([cell], "auto")
        self.assertEqual(found["auto / best peer with OIDN: flip"]["geometric_mean"], 0.4)
        self.assertEqual(found["auto / OIDN alone: grain"], {"geometric_mean": 0.5, "worst": 0.5, "within": 1, "of": 1})
        self.assertEqual(found["all methods / OIDN alone: grain"]["of"], 2)
        self.assertEqual(found["auto network / auto: flip"]["geometric_mean"], 1.5)
        self.assertEqual(found["auto / best fixed method, within 1.1: relmse"]["within"], 0)
        self.assertEqual(found["auto / best of its own inputs, within 1.02: relmse"]["within"], 0)
        self.assertEqual(found["all methods / best of its own inputs, within 1.02: relmse"]["within"], 1)


class Translation(unittest.TestCase):
    def test_features_that_drivers_lack_are_named(self):
        def blockers(name):
            return plain_scene.Scene(SCENES / f"{name}.glb").blockers

        self.assertEqual(blockers("cornell"), [])
        self.assertEqual(blockers("torus"), [])
        self.assertIn("a medium fills the space", blockers("fog"))
        self.assertIn("KHR_materials_dispersion", blockers("prism")[0])

    def test_glass_keeps_what_it_absorbs(self):
        found = plain_scene.Scene(SCENES / "torus.glb")
        document, _ = gltf.chunks((SCENES / "torus.glb").read_bytes())
        volumes = [gltf.extension(material, "KHR_materials_volume") for material in document["materials"]]
        volume = next(volume for volume in volumes if volume and "attenuationColor" in volume)
        glass = next(of for _, of in found.meshes if of.absorption.any())
        passed = np.exp(-glass.absorption * volume["attenuationDistance"])
        np.testing.assert_allclose(passed, volume["attenuationColor"], rtol=1e-12)

    def test_twins_have_only_features_that_drivers_support(self):
        with tempfile.TemporaryDirectory() as folder, mock.patch.object(twins, "CACHE", Path(folder)):
            for name in ("torus", "prism", "interior", "cornell"):
                twin = twins.twin(SCENES / f"{name}.glb")
                found = plain_scene.Scene(twin)
                self.assertEqual(found.blockers, [], name)
                self.assertFalse([text for text in found.approximations if "material" in text], name)
                kinds = {m["name"]: m.get("extensions", {}) for m in found.document["materials"]}
                self.assertEqual(set.union(*map(set, kinds.values())) - plain_scene.SUPPORTED, set())
                said = json.loads(support.run(["info", twin, "--json"], check=0).stdout)
                original = json.loads(support.run(["info", SCENES / f"{name}.glb", "--json"], check=0).stdout)
                self.assertEqual(said["triangles"], original["triangles"], name)
            # One scene has nothing to remove; the rest of the other is unsupported by every driver.
            self.assertIsNone(twins.twin(SCENES / "blocks.glb"))
            self.assertIsNone(twins.twin(SCENES / "fog.glb"))

    def test_a_lamp_keeps_its_light_as_a_ball(self):
        found = plain_scene.Scene(SCENES / "interior.glb")
        self.assertEqual(found.lights, [])
        balls = [(mesh, of) for mesh, of in found.meshes if mesh.name == "lamp" and len(mesh.triangles) == 80]
        before = gltf.read(SCENES / "interior.glb").lights
        self.assertEqual(len(balls), len(before))
        for (ball, of), light in zip(balls, before):
            a, b, c = ball.positions[ball.triangles].transpose(1, 0, 2)
            surface = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
            np.testing.assert_allclose(of.emission * surface / 4, light.intensity, rtol=1e-5)
            # An icosahedron divided once, whose corners lie on the sphere.
            self.assertAlmostEqual(surface / (4 * np.pi * light.radius**2), 0.93, delta=0.01)
            np.testing.assert_allclose(ball.positions.mean(0), light.to_world[:3, 3], atol=1e-5)

    def test_a_ball_is_closed_and_faces_outward(self):
        points, triangles = plain_scene.icosphere(2)
        self.assertEqual(len(triangles), 320)
        self.assertGreater(np.linalg.det(points[triangles]).min(), 0)

    def test_the_sun_stands_where_it_shines_from(self):
        toward = np.array([0.6, 0.64, -0.48])
        sun = plain_scene.disc(toward, np.radians(0.265), np.array([1.0, 2.0, 3.0]), 512, 1024)
        polar, turn = (np.arange(512) + 0.5) / 512 * np.pi, (np.arange(1024) + 0.5) / 1024 * 2 * np.pi
        solid = np.sin(polar)[:, None] * (np.pi / 512) * (2 * np.pi / 1024)
        np.testing.assert_allclose((sun * solid[..., None]).sum((0, 1)), [1, 2, 3])
        # The drivers' u is atan2(x, -z) / 2 pi.
        x, y, z = np.sin(polar)[:, None] * np.sin(turn), np.cos(polar)[:, None], -np.sin(polar)[:, None] * np.cos(turn)
        middle = [(sun[..., 0] * solid * axis).sum() for axis in (x, y, z)]
        np.testing.assert_allclose(middle, toward, atol=2e-3)

    def test_environments_are_turned(self):
        # +X is at u = 1/2 for u = 1/2 + atan2(z, x) / 2 pi, and at u = 1/4 for u = atan2(x, -z) / 2 pi.
        image = np.zeros((4, 64, 3), np.float32)
        image[:, 32] = 1
        at = (np.arange(64) + 0.5) / 64
        turned = pictures.sample(image, at + 0.25, (np.arange(4) + 0.5) / 4)
        self.assertEqual(int(turned[0, :, 0].argmax()), 16)


if __name__ == "__main__":
    unittest.main()
