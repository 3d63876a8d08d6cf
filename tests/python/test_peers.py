"""Tests the drivers of other renderers on small scenes, if `scripts/compare/setup.sh peers` installed the renderers;
and the drivers' common parts."""

import subprocess
import unittest

import numpy as np

import support
import caller
import driver
import pictures
import plain_scene
from lab import compare_scenes

COMPARE = support.ROOT / "scripts" / "compare"
DRIVERS = COMPARE / "peers"
PEERS = support.ROOT / ".venv-peers"
SIZE = (48, 27)


def drive(name, scene, target, mode="path", budget=2.0):
    """Run a driver. Returns its answer."""
    size = {"width": SIZE[0], "height": SIZE[1]}
    command = caller.command(
        f"{name}_driver.py", scene, target, mode=mode, budget=budget, **size, threads=2, clock="cpu"
    )
    env = {**caller.environment(f"{name}_driver.py"), "PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run(command, capture_output=True, text=True, env=env, timeout=300)
    said = caller.answer(done.stdout)
    assert said, done.stdout + done.stderr
    return said


def render_reference(scene, out):
    """Renders a scene by bdpt, without a finish."""
    size = ["--width", SIZE[0], "--height", SIZE[1], "--iterations", 300]
    line = ["render", scene, "-o", out, "--method", "bdpt", *size]
    support.run([*line, "--no-combine", "--layers", "beauty", "--progress", "none"])


def off(picture, truth):
    """Relative deviation of a picture's mean from the truth's, and its standard error."""
    noise = np.sqrt(np.square(picture - truth).mean(-1).sum()) / truth.mean(-1).sum()
    return abs(picture.mean() / truth.mean() - 1), noise


class Shared(unittest.TestCase):
    class Stopwatch:
        """A stopwatch that advances by `each` in every pass."""

        def __init__(self, each, budget):
            self.each, self.budget, self.time = each, budget, 0.0

        def spent(self):
            return self.time

        def left(self):
            return self.budget - self.time

    def test_passes_end_nearest_to_the_budget(self):
        for each, budget, expected in [(1.0, 10.4, 10), (1.0, 10.6, 11), (3.0, 1.0, 1), (4.0, 6.5, 2)]:
            watch = self.Stopwatch(each, budget)

            def render(number, watch=watch):
                watch.time += watch.each
                return 2

            self.assertEqual(driver.run_passes(watch, render), 2 * expected, (each, budget))

    def test_no_driver_is_left_out_of_the_program(self):
        source = (support.ROOT / "src" / "peers" / "drivers.rs").read_text()
        # Modules for scripts alone: comparisons, conversions of scenes, the denoiser.
        others = {"__main__", "caller", "from_xml", "glb_package", "mitsuba_xml", "oidn", "tiles", "to_xml"}
        others |= {"xml_colours", "xml_grids", "xml_lights", "xml_materials", "xml_shapes"}
        for name in {path.stem for path in DRIVERS.glob("*.py")} - others:
            self.assertIn(f'"../../scripts/compare/peers/{name}.py"', source)


def stage(coat=False):
    """A scene with a floor, and a ball of glass or two balls with a clear coat."""
    g = compare_scenes.Glb()
    g.extras(light_units="radiometric")
    floor = compare_scenes.quad([-2, 0, 2], [4, 0, 0], [0, 0, -4])
    g.node(name="floor", mesh=g.mesh(floor, g.matte("floor", (0.7, 0.7, 0.68))))
    shape = compare_scenes.sphere(64, 32)
    if coat:
        glossy = g.material("glossy", (0.6, 0.1, 0.08), 0.5, clearcoat={"clearcoatFactor": 1.0})
        layer = {"clearcoatFactor": 0.7, "clearcoatRoughnessFactor": 0.3}
        matte = g.matte("matte", (0.2, 0.4, 0.8), clearcoat=layer)
        compare_scenes.ball(g, "glossy", glossy, (-0.5, 0.5, 0), 0.4, shape)
        compare_scenes.ball(g, "matte", matte, (0.5, 0.5, 0), 0.4, shape)
    else:
        compare_scenes.ball(g, "ball", g.glass("clear"), (0, 0.5, 0), 0.4, shape)
    g.camera((0, 1.6, 4.0), (0, 0.35, 0), 0.6, SIZE[0] / SIZE[1])
    return g


class Simplified(support.Scratch):
    def test_lamps_suns_and_coats_are_kept_or_replaced(self):
        g = stage(coat=True)
        g.light("point", (0.6, 2.0, 0.4), (0, 0, 0), intensity=3.0, radius=0.08)
        g.light("directional", (1, 3, 1), (0, 0, 0), intensity=2.0, angle_deg=3.0)
        g.write(self.dir / "stage.glb")
        kept = plain_scene.Scene(self.dir / "stage.glb", lamps="lamps", suns="lamps")
        self.assertEqual((kept.blockers, len(kept.meshes), kept.environment), ([], 3, None))
        self.assertEqual([light.kind for light in kept.lights], ["point", "directional"])
        coats = [(of.coat, of.coat_roughness) for _, of in kept.meshes]
        self.assertEqual(coats, [(0.0, 0.0), (1.0, 0.0), (0.7, 0.3)])
        replaced = plain_scene.Scene(self.dir / "stage.glb")
        self.assertEqual((replaced.blockers, replaced.lights, len(replaced.meshes)), ([], [], 4))
        # The mesh has the lamp's intensity: radiance times a quarter of the surface of a convex body.
        mesh, of = replaced.meshes[3]
        corners = mesh.positions[mesh.triangles]
        cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        np.testing.assert_allclose(of.emission * np.linalg.norm(cross, axis=1).sum() / 8, 3.0)
        # The pixels have the sun's irradiance.
        height, width = replaced.environment.shape[:2]
        sine = np.sin((np.arange(height) + 0.5) / height * np.pi)[:, None, None]
        irradiance = (replaced.environment * sine).sum((0, 1)) * np.pi / height * 2 * np.pi / width
        np.testing.assert_allclose(irradiance, 2.0, rtol=1e-3)


if (PEERS / ".complete").exists() and (PEERS / "bpy" / ".complete").exists():

    class Installed(support.Scratch):
        def test_all_renderers_render_the_scene_as_caustique_does(self):
            scene, truth = support.ROOT / "scenes" / "blocks.glb", self.dir / "truth.exr"
            render_reference(scene, truth)
            truth = pictures.read(truth).astype(float)
            for name, mode in [("mitsuba", "path"), ("luxcore", "path"), ("luxcore", "bidir"), ("cycles", "path")]:
                with self.subTest(name=name, mode=mode):
                    said = drive(name, scene, self.dir / "picture.exr", mode)
                    # The budget is four core-seconds; passes do not end exactly then.
                    self.assertGreater(said["core_seconds"], 2.5)
                    self.assertLess(said["core_seconds"], 9.0)
                    self.assertGreater(min(said["core_seconds"], said["startup_seconds"], said["passes"]), 0)
                    picture = pictures.read(self.dir / "picture.exr").astype(float)
                    self.assertEqual(picture.shape, truth.shape)
                    far, noise = off(picture, truth)
                    self.assertLess(far, 0.01 + 3 * noise)
                    # The test detects a picture that is 10 % darker, or one row too low.
                    far, noise = off(0.9 * picture, truth)
                    self.assertGreater(far, 0.01 + 3 * noise)
                    moved = np.square(np.roll(picture, 1, 0) - truth)[2:].mean()
                    self.assertGreater(moved, 2 * np.square(picture - truth)[2:].mean())

        def test_lamps_suns_and_clear_coats_are_those_of_caustique(self):
            lamp, sun, coat = stage(), stage(), stage(coat=True)
            lamp.light("point", (0.6, 2.0, 0.4), (0, 0, 0), color=[1, 0.9, 0.8], intensity=3.0, radius=0.08)
            for scene in (sun, coat):
                scene.light("directional", (1, 3, 1), (0, 0, 0), intensity=2.0, angle_deg=3.0)
            coat.extras(environment={"color": [0.6, 0.6, 0.6]})
            for name, scene, peers in [
                ("lamp", lamp, ["cycles path", "luxcore path", "luxcore path_cache", "luxcore bidir"]),
                ("sun", sun, ["cycles path", "luxcore path"]),
                ("coat", coat, ["cycles path", "luxcore path"]),
            ]:
                file, exr = self.dir / f"{name}.glb", self.dir / f"{name}.exr"
                scene.write(file)
                render_reference(file, exr)
                truth = pictures.read(exr).astype(float)
                for peer in peers:
                    with self.subTest(scene=name, peer=peer):
                        driver_name, mode = peer.split()
                        drive(driver_name, file, self.dir / "picture.exr", mode)
                        far, noise = off(pictures.read(self.dir / "picture.exr").astype(float), truth)
                        self.assertLess(far, 0.02 + 3 * noise)
                        self.assertLess(0.02 + 3 * noise, 0.3)
                if name != "coat":
                    # Shadow caustics lack the light of all connections but one, and have less noise.
                    drive("cycles", file, self.dir / "picture.exr", "path_caustics")
                    ratio = pictures.read(self.dir / "picture.exr").mean() / truth.mean()
                    self.assertTrue(0.85 < ratio < 1.01, ratio)

        def test_a_caustic_cache_that_takes_all_of_the_budget_is_followed_by_a_pass(self):
            scene = support.ROOT / "scenes" / "blocks.glb"
            means = []
            for mode, budget in (("path_cache", 0.01), ("path", 2.0)):
                said = drive("luxcore", scene, self.dir / "picture.exr", mode, budget)
                self.assertGreaterEqual(said["passes"], 1)
                means.append(pictures.read(self.dir / "picture.exr").mean())
            self.assertAlmostEqual(means[0] / means[1], 1, delta=0.3)

        def test_unsupported_features_are_the_answer_of_a_driver(self):
            target = self.dir / "picture.exr"
            for name, scene, why in [
                ("mitsuba", "prism", "KHR_materials_dispersion is left out"),
                ("luxcore", "fog", "a medium fills the space"),
                ("cycles", "fog", "a medium fills the space"),
            ]:
                with self.assertRaisesRegex(caller.CannotTranslate, why):
                    drive(name, support.ROOT / "scenes" / f"{scene}.glb", target)
            self.assertFalse(target.exists())


if __name__ == "__main__":
    unittest.main()
