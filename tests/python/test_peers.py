"""The drivers of other renderers, where `scripts/compare/setup.sh peers` has installed them, on a small scene each; and
what all of them share."""

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
    """Runs a driver; returns what it says."""
    size = {"width": SIZE[0], "height": SIZE[1]}
    command = caller.command(f"{name}_driver.py", scene, target, mode=mode, budget=budget, **size, threads=2, clock="cpu")
    env = {**caller.environment(f"{name}_driver.py"), "PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run(command, capture_output=True, text=True, env=env, timeout=300)
    said = caller.answer(done.stdout)
    assert said, done.stdout + done.stderr
    return said


def off(picture, truth):
    """How far a picture's mean is from the truth's, and the standard error of that."""
    noise = np.sqrt(np.square(picture - truth).mean(-1).sum()) / truth.mean(-1).sum()
    return abs(picture.mean() / truth.mean() - 1), noise


class Shared(unittest.TestCase):
    class Watch:
        """A watch on which every pass takes so long."""

        def __init__(self, each, budget):
            self.each, self.budget, self.time = each, budget, 0.0

        def spent(self):
            return self.time

        def left(self):
            return self.budget - self.time

    def test_passes_end_nearest_to_the_budget(self):
        for each, budget, expected in [(1.0, 10.4, 10), (1.0, 10.6, 11), (3.0, 1.0, 1), (4.0, 6.5, 2)]:
            watch = self.Watch(each, budget)

            def render(number, watch=watch):
                watch.time += watch.each
                return 2

            self.assertEqual(driver.run_passes(watch, render), 2 * expected, (each, budget))

    def test_no_driver_is_left_out_of_the_program(self):
        source = (support.ROOT / "src" / "peers" / "drivers.rs").read_text()
        # What only scripts run: comparisons, translations of scenes, the denoiser.
        others = {"__main__", "caller", "from_xml", "oidn", "tiles", "to_xml"}
        for name in {path.stem for path in DRIVERS.glob("*.py")} - others:
            self.assertIn(f'"../../scripts/compare/peers/{name}.py"', source)


if (PEERS / ".complete").exists() and (PEERS / "bpy" / ".complete").exists():

    class Installed(support.Scratch):
        def test_all_renderers_see_the_scene_that_we_see(self):
            scene, truth = support.ROOT / "scenes" / "blocks.glb", self.dir / "truth.exr"
            support.run(["render", scene, "-o", truth, "--method", "bdpt", "--width", SIZE[0], "--height", SIZE[1],
                         "--iterations", 300, "--no-combine", "--layers", "beauty", "--progress", "none"])
            truth = pictures.read(truth).astype(float)
            for name, mode in [("mitsuba", "path"), ("luxcore", "path"), ("luxcore", "bidir"), ("cycles", "path")]:
                with self.subTest(name=name, mode=mode):
                    said = drive(name, scene, self.dir / "picture.exr", mode)
                    # Of four core-seconds; a pass more or less, and LuxCore's slow farewell.
                    self.assertGreater(said["core_seconds"], 2.5)
                    self.assertLess(said["core_seconds"], 9.0)
                    self.assertGreater(min(said["core_seconds"], said["startup_seconds"], said["passes"]), 0)
                    picture = pictures.read(self.dir / "picture.exr").astype(float)
                    self.assertEqual(picture.shape, truth.shape)
                    far, noise = off(picture, truth)
                    self.assertLess(far, 0.01 + 3 * noise)
                    # A scene a tenth darker does not pass, nor does one a row too low.
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

        def test_what_a_renderer_cannot_say_is_its_answer(self):
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
