"""Tests the drivers of other renderers on small scenes, if `scripts/compare/setup.sh peers` installed the renderers;
and the drivers' common parts."""

import subprocess
import unittest

import numpy as np

import support
import caller
import driver
import pictures

COMPARE = support.ROOT / "scripts" / "compare"
DRIVERS = COMPARE / "peers"
PEERS = support.ROOT / ".venv-peers"
BPY = support.ROOT / ".venv-bpy"
SIZE = (48, 27)


def drive(name, scene, target, mode="path", budget=2.0):
    """Run a driver. Returns its answer."""
    size = {"width": SIZE[0], "height": SIZE[1]}
    command = caller.command(f"{name}_driver.py", scene, target, mode=mode, budget=budget, **size, threads=2, clock="cpu")
    env = {**caller.environment(f"{name}_driver.py"), "PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run(command, capture_output=True, text=True, env=env, timeout=300)
    said = caller.answer(done.stdout)
    assert said, done.stdout + done.stderr
    return said


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
        others |= {"xml_colours", "xml_lights", "xml_materials", "xml_shapes"}
        for name in {path.stem for path in DRIVERS.glob("*.py")} - others:
            self.assertIn(f'"../../scripts/compare/peers/{name}.py"', source)


if (PEERS / ".complete").exists() and (PEERS / "bpy" / ".complete").exists():

    class Installed(support.Scratch):
        def test_all_renderers_render_the_scene_as_caustique_does(self):
            scene, truth = support.ROOT / "scenes" / "blocks.glb", self.dir / "truth.exr"
            support.run(["render", scene, "-o", truth, "--method", "bdpt", "--width", SIZE[0], "--height", SIZE[1],
                         "--iterations", 300, "--no-combine", "--layers", "beauty", "--progress", "none"])
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
