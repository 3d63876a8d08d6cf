"""Tests how the combiner's training data are made and read (scripts/lab/train), without rendering."""

import json
import tempfile
import unittest
from pathlib import Path

import numpy as np

import support  # noqa: F401 (adds scripts to the path)

from lab.train import bound, data, families, finish_data, finish_fixture, finish_views, normalise, views


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


class FinishData(unittest.TestCase):
    def picture(self, rng, side=16):
        """The layers of a picture of four iterations, with an exact row, a black one without coverage, and background."""
        plane = lambda: rng.uniform(0.1, 1, (side, side)).astype(np.float32)
        layers = ("", "Noisy.", "Variance1.", "albedo.", "TransmissionColor.", *(f"Quarter{k}." for k in range(1, 5)))
        picture = {f"{layer}{c}": plane() for layer in layers for c in "RGB"} | {f"normal.{c}": plane() for c in "XYZ"}
        picture |= {"depth.Z": plane(), "A": np.ones((side, side), np.float32), "iterations": 4}
        for c in "RGB":
            picture[f"Variance1.{c}"][:2], picture[f"Noisy.{c}"][1] = 0, 0
            picture[f"Variance1.{c}"][5, 5] = -1
        picture["A"][1], picture["depth.Z"][2] = 0, 1e10
        return picture

    def test_views_have_two_windows_of_different_methods_and_all_numbers_of_iterations(self):
        chosen = data.views(Path("/nowhere"), 5, finish_data.View)
        self.assertTrue(all(len(set(view.methods)) == finish_data.METHODS_OF_VIEW for view in chosen))
        counts = {method: sum(method in view.methods for view in chosen) for method in finish_data.METHODS}
        self.assertEqual(max(counts, key=counts.get), "vcm")
        self.assertGreater(min(counts.values()), len(chosen) / 5)
        long = np.mean([view.iterations == finish_data.ITERATIONS for view in chosen if not view.held_out])
        self.assertTrue(0.2 < long < 0.5, long)

    def test_a_target_by_bdpt_has_fewer_light_paths_in_a_large_picture(self):
        windows = {"path": {"width": 1920, "height": 1080}, "bdpt": {"width": 240, "height": 135}}
        note = {"target_method": {"method": "bdpt"}, "windows": windows}
        self.assertEqual(data.target_options(note, "path")["light_paths"], 1 / 16)
        self.assertEqual(data.target_options(note, "bdpt")["light_paths"], 1)

    def test_limits_widen_for_few_samples(self):
        # Student's quantiles that exclude 0.27 %, from tables.
        for samples, expected in ((2, 235.8), (3, 19.21), (4, 9.219), (8, 4.530), (32, 3.261), (1_000_000, 3.0)):
            self.assertAlmostEqual(bound.limit(samples) / expected, 1, delta=1e-3)

    def test_the_spread_is_the_percentile_of_the_window_and_zero_where_there_is_nothing(self):
        rng = np.random.default_rng(8)
        mean, deviation = rng.uniform(0, 1, (2, 12, 15, 3)).astype(np.float32)
        deviation[3], deviation[4, 4] = 0, np.nan
        mean[0], deviation[0] = 0, 0
        alpha = np.ones((12, 15), np.float32)
        alpha[0] = 0
        found = bound.spread(mean, deviation, 8, alpha)
        self.assertTrue((found[0] == 0).all() and np.isinf(found[4, 4]).all())
        # Row 3 is exact: neighbours that are far below do not count either.
        for y, x, c in ((1, 0, 0), (6, 7, 1), (11, 14, 2), (8, 2, 0), (3, 2, 1), (3, 9, 0)):
            window = (slice(max(y - 3, 0), y + 4), slice(max(x - 3, 0), x + 4), c)
            errors = np.where(np.isnan(deviation[window]), np.inf, deviation[window])
            apart = mean[window] - mean[y, x, c]
            apart = np.abs(apart) if y == 3 else apart
            errors = np.sort(np.where(apart > bound.limit(8) * errors, 0, errors), axis=None)
            around = errors[int(0.8 * (errors.size - 1) + 0.5)]
            self.assertEqual(found[y, x, c], max(deviation[y, x, c], around))

    def test_independent_noise_has_the_least_correlation_and_shared_noise_a_large_one(self):
        noise = np.random.default_rng(9).uniform(0, 1, (4, 60, 60, 3)).astype(np.float32)
        blocks = noise[:, :20, :20].repeat(3, 1).repeat(3, 2)
        independent, shared = bound.correlation(noise).mean(), bound.correlation(blocks).mean()
        self.assertLess(independent, 0.2)
        self.assertGreater(shared, 0.45)
        noise[2] = 0
        self.assertTrue((bound.correlation(noise) == np.float32(1 / 9)).all())

    def test_the_planes_that_a_test_in_rust_reads_are_those_of_training(self):
        picture, wanted = finish_fixture.stored()
        found, _ = finish_fixture.planes(picture)
        np.testing.assert_allclose(found, wanted, rtol=1e-3, atol=1e-6)

    def test_stacks_of_a_picture_give_samples_of_the_network(self):
        rng = np.random.default_rng(10)
        note = {"exposure": 2.0, "depth": 0.5, "parts": ["Direct"]}
        picture = self.picture(rng)
        for c in "RGB":
            picture[f"Direct.{c}"] = picture[f"Noisy.{c}"] / 2
            picture[f"Whole.{c}"] = picture[f"Noisy.{c}"] / 4
        arrays = {key: value[None] for key, value in finish_data.stack(picture, note).items()}
        arrays |= {"iterations": np.array([4]), "halves": rng.uniform(0, 1, (2, 16, 16, 3)).astype(np.float32)}
        arrays["clean"] = arrays["halves"].mean(0)
        stack = views.snapshot(arrays, 0)
        image, targets, transmission = finish_views.sample(views.augment(stack, rng))
        self.assertEqual(image.shape, (sum(finish_views.PLANES.values()), 16, 16))
        self.assertEqual((targets.shape, transmission.shape), ((3, 3, 16, 16), (1, 16, 16)))
        np.testing.assert_allclose(targets[2], targets[:2].mean(0), rtol=1e-6)
        self.assertTrue(np.isfinite(image).all() and (image[:6] >= 0).all())
        image, _, _ = finish_views.sample(stack)
        groups = dict(zip(finish_views.PLANES, np.split(image, np.cumsum(list(finish_views.PLANES.values()))[:-1])))
        np.testing.assert_allclose(groups["mean"][0], 2 * picture["Noisy.R"], rtol=1e-3)
        np.testing.assert_allclose(groups["whole"], groups["mean"] / 4, rtol=2e-3)
        np.testing.assert_allclose(groups["effects"][1], groups["mean"].mean(0) / 2, rtol=2e-3)
        self.assertTrue((groups["reach"][:, 0] > 0).any() and (groups["reach"][:, 1] == 0).all())
        self.assertEqual(groups["reach"][0, 5, 5], np.float16(data.LARGEST))
        self.assertTrue((groups["iterations"] == 2).all())


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
