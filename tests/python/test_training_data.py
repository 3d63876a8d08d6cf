"""Tests how the combiner's training data are made and read (scripts/lab/train), without rendering."""

import json
import tempfile
import unittest
from pathlib import Path

import numpy as np

import support  # noqa: F401 (adds scripts to the path)

from lab.train import data, families, normalise, views


def arrays(rng, side=16):
    """Random arrays of a noisy stack with two snapshots, as data.py stores them, and a target."""
    shapes = {"levels": (5, 3), "quarters": (4, 3), "parts": (5, 3), "deviations": (5,), "radius": (2,), "depth": ()}
    shapes |= {name: (3,) for name in ("finished", "albedo", "normal")}
    stored = {"iterations": np.array([8, 16]), "halves": rng.uniform(0, 1, (2, side, side, 3)).astype(np.float32)}
    for name, shape in shapes.items():
        front = shape if name in views.PLANAR else shape[:-1]
        back = () if name in views.PLANAR else (3,)
        stored[name] = rng.uniform(0.1, 1, (2, *front, side, side, *back)).astype(np.float16)
    return stored


class Data(unittest.TestCase):
    def test_views_cover_all_families_and_scenes_and_hold_some_out_whole(self):
        chosen = data.views(Path("/nowhere"), 5)
        self.assertGreaterEqual(len(families.names()), 30)
        self.assertEqual(len(set(families.names())), len(families.names()))
        self.assertEqual(len({view.name for view in chosen}), len(chosen))
        trained = {view.family for view in chosen if not view.held_out}
        self.assertEqual(set(families.names()) - trained, set(families.HELD_OUT))
        self.assertGreaterEqual(sum(not view.held_out for view in chosen), 200)
        held_out = {view.family.removeprefix("scenes_") for view in chosen if view.scene}
        scenes = support.ROOT / "scenes"
        self.assertEqual(held_out, {file.stem for file in [*scenes.glob("*.glb"), *scenes.glob("second/*.glb")]})
        # Stopped at any time, the data have views of all families.
        count = len(families.names())
        self.assertEqual({view.family for view in chosen[:count]}, set(families.names()))

    def test_windows_lie_in_pictures_of_the_widths_and_prefer_differences_of_bandwidths(self):
        levels = np.ones((5, 90, 160, 3), np.float32)
        levels[0, :45, :80] = 0.2
        corners = []
        for index in range(16):
            view = data.View(Path("/nowhere"), "pool", index)
            for method, (least, most) in data.WIDTHS.items():
                window = data.window(view, method, levels)
                (x, y), width, height = window["corner"], window["width"], window["height"]
                self.assertTrue(least - 8 <= width <= most + 8 and abs(height - width * 9 / 16) <= 1, window)
                self.assertTrue(0 <= x <= width - data.SIDE and 0 <= y <= height - data.SIDE, window)
                corners.append(x + data.SIDE / 2 < width / 2 and y + data.SIDE / 2 < height / 2)
        self.assertGreater(np.mean(corners), 0.5)

    def test_stored_values_are_finite_and_clamped(self):
        values = data.small(np.array([np.nan, np.inf, -np.inf, 1e9, 0.5]))
        np.testing.assert_array_equal(values, np.array([0, data.LARGEST, -data.LARGEST, data.LARGEST, 0.5], np.float16))

    def test_held_out_views_are_not_for_training_and_the_last_line_of_a_view_counts(self):
        with tempfile.TemporaryDirectory() as folder:
            lines = [("a-0", False, ["sppm-seed1.npz"]), ("b-0", True, ["vcm-seed1.npz", "vcm-target.npz"])]
            lines.append(("a-0", False, ["sppm-seed1.npz", "sppm-bdpt1.npz", "vcm-seed2.npz"]))
            text = [json.dumps({"view": v, "held_out": h, "files": dict.fromkeys(f, "")}) for v, h, f in lines]
            Path(folder, "manifest.jsonl").write_text("\n".join(text) + "\n", encoding="utf-8")
            stem = lambda name: Path(folder, "views", name)
            self.assertEqual(views.files(folder, False), [(stem("a-0"), "sppm", 1), (stem("a-0"), "vcm", 2)])
            self.assertEqual(views.files(folder, True), [(stem("b-0"), "vcm", 1)])
            self.assertEqual(views.files(folder, False, ["vcm"]), [(stem("a-0"), "vcm", 2)])
            self.assertEqual(views.files(folder, False, paths=[2]), [(stem("a-0"), "sppm", 1)])
            self.assertEqual(views.files(folder, False, pairs="deep-single"), [(stem("a-0"), "sppm", 1)])

    def test_mapped_files_equal_what_was_written(self):
        stored = arrays(np.random.default_rng(4))
        with tempfile.TemporaryDirectory() as folder:
            data.write(Path(folder, "stack.npz"), stored)
            found = views.mapped(Path(folder, "stack.npz"))
            self.assertEqual(set(found), set(stored))
            for name, value in stored.items():
                np.testing.assert_array_equal(found[name], value)
                self.assertEqual(found[name].dtype, value.dtype)


class Samples(unittest.TestCase):
    def test_all_inputs_have_their_channels_and_finite_values(self):
        stack = views.snapshot(arrays(np.random.default_rng(1)), 1)
        for pairs, version, count in (("multi", 1, 4), ("multi", 2, 4), ("finished", 3, 4), ("dual3", 2, 1)):
            image, y, z, halves = views.sample(stack, pairs, version)
            self.assertEqual(image.shape, (normalise.channels(5, version), 16, 16))
            self.assertEqual((y.shape, z.shape, halves.shape), ((count, 3, 16, 16), (count, 3, 16, 16), (2, 3, 16, 16)))
            self.assertTrue(np.isfinite(image).all())

    def test_the_deep_combiner_reads_pictures_of_two_methods_from_files(self):
        stored = arrays(np.random.default_rng(5))
        other = {"picture": stored["finished"], "quarters": stored["quarters"], "deviation": stored["depth"]}
        with tempfile.TemporaryDirectory() as folder:
            for name, content in (("seed2", stored), ("target", {"halves": stored["halves"]}), ("bdpt2", other)):
                content = {key: value for key, value in content.items() if (key == "halves") == (name == "target")}
                data.write(Path(folder, f"sppm-{name}.npz"), content | {"iterations": stored["iterations"]})
            found = views.read((Path(folder), "sppm", 2))
            for pairs, version, count in (("deep-single", 4, 1), ("deep-multi", 5, 4)):
                stack = views.snapshot(found, 1, pairs, (slice(2, 14), slice(3, 11)))
                image, y, z, _ = views.sample(stack, pairs, version)
                self.assertEqual(image.shape, (normalise.channels(5, version), 12, 8))
                self.assertEqual((y.shape, z.shape), ((count, 3, 12, 8),) * 2)
                wanted = other["quarters"][1, :, 2:14, 3:11] if count == 4 else other["picture"][1, None, 2:14, 3:11]
                np.testing.assert_array_equal(y, np.moveaxis(wanted, -1, 1).astype(np.float32))

    def test_augmentation_moves_all_pictures_alike_and_scales_radiance_alone(self):
        stored = arrays(np.random.default_rng(2))
        # Every picture holds the number of its pixel.
        number = np.arange(256, dtype=np.float32).reshape(16, 16) / 256
        for name, value in stored.items():
            if name != "iterations":
                stored[name] = np.broadcast_to(number if name in views.PLANAR else number[..., None], value.shape)
        rng = np.random.default_rng(3)
        for _ in range(20):
            stack = views.augment(views.snapshot(stored, 0, part=views.random_part(stored, rng, 8)), rng)
            albedo, gain = stack["albedo"][..., 0], stack["halves"][0, 0, 0, 0] / stack["albedo"][0, 0, 0]
            self.assertGreater(len(np.unique(albedo)), 60)
            for name, value in stack.items():
                if name != "iterations":
                    planar = value if name in views.PLANAR else value[..., 0]
                    wanted = albedo if name in views.DIMENSIONLESS else albedo * gain
                    np.testing.assert_allclose(planar, np.broadcast_to(wanted, planar.shape), rtol=1e-5, err_msg=name)


if __name__ == "__main__":
    unittest.main()
