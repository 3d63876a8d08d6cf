"""Images: arrays without copies, files, errors of pictures, finishes, and types that tell the truth."""

import gc
import inspect
import os
import subprocess
import sys
import tempfile
import unittest
import warnings
from pathlib import Path

import numpy as np
from shared import ROOT, TORUS, ground, still_life

import caustique as cq


def pointer(array):
    return array.__array_interface__["data"][0]


class Layers(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        scene = ground([cq.SunLight(direction=(0, -1, 0), irradiance=(1, 1, 1))], albedo=0.5)
        cls.image = scene.render(method="path", iterations=4, width=6, height=4, finish=False)

    def test_notebooks_show_the_picture(self):
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "picture.png"
            self.image.save(file)
            self.assertEqual(self.image._repr_png_(), file.read_bytes())
        self.assertTrue(self.image._repr_png_().startswith(b"\x89PNG"))

    def test_files_may_have_the_names_of_blender(self):
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "picture.exr"
            self.image.save(file, exr_naming="blender")
            named = cq.read(file)
            self.assertIn("ViewLayer.Combined", named.keys())
            np.testing.assert_array_equal(named["ViewLayer.Combined.R"], self.image["R"])
            with self.assertRaisesRegex(cq.Error, "exr_naming='nuke' does not exist: plain, blender|one of"):
                self.image.save(file, exr_naming="nuke")

    def test_layers_are_described(self):
        described = self.image.descriptions
        self.assertEqual(list(described), self.image.keys())
        self.assertIn("[m]", described["Z"])
        self.assertEqual(cq.Image.from_arrays({"own": np.zeros((2, 2))}).descriptions, {})

    def test_planes_are_not_copied(self):
        image = self.image
        red = image.layers["Noisy"]["R"]
        self.assertEqual((red.shape, red.dtype, red.flags.owndata), ((4, 6), np.float32, False))
        self.assertIs(red.base, image)
        self.assertEqual(pointer(red), pointer(image["Noisy.R"]))
        self.assertEqual(pointer(image["Z"]), pointer(image.layers["Z"]["Z"]))
        stacked = image["Noisy"]
        self.assertEqual(stacked.shape, (4, 6, 3))
        np.testing.assert_array_equal(stacked[..., 0], red)
        self.assertFalse(np.shares_memory(stacked, red))

    def test_an_image_does_not_change(self):
        red = self.image["R"]
        with self.assertRaises(ValueError):
            red[0, 0] = 1.0
        with self.assertRaises(ValueError):
            red.flags.writeable = True

    def test_arrays_outlive_the_image(self):
        image = ground([]).render(method="path", iterations=1, width=64, height=64, finish=False)
        depth = image["Z"]
        expected = depth.copy()
        del image
        gc.collect()
        np.testing.assert_array_equal(depth, expected)

    def test_names(self):
        image = self.image
        self.assertIn("Noisy", image)
        self.assertIn("Noisy.R", image)
        self.assertNotIn("Nosy", image)
        self.assertEqual(list(image), image.keys())
        with self.assertRaisesRegex(KeyError, "Nosy.*'Noisy'"):
            image["Nosy"]

    def test_header(self):
        header = self.image.header
        self.assertEqual((header["iterations"], header["seed"], header["method"]), (4, 0, "path"))
        self.assertEqual(header["arguments"]["width"], 6)


class Files(unittest.TestCase):
    def test_written_and_read(self):
        values = np.arange(24, dtype=np.float32).reshape(4, 2, 3)
        image = cq.Image.from_arrays({"": values, "normal": values, "Z": values[..., 0]}, {"note": "made"})
        self.assertEqual(list(image.layers["normal"]), ["X", "Y", "Z"])
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "a.exr"
            image.save(path)
            again = cq.read(path)
            np.testing.assert_array_equal(again.picture, values)
            np.testing.assert_array_equal(again["Z"], values[..., 0])
            self.assertEqual(again.header, {"note": "made"})
            image.save(Path(folder) / "a.png", exposure=-2.0)
            self.assertEqual((Path(folder) / "a.png").read_bytes()[:4], b"\x89PNG")
            image.save(path, half=True, multi_part=True)
            np.testing.assert_array_equal(cq.read(path).picture, values)
            third = cq.Image.from_arrays({"": values / 3, "Z": values[..., 0] / 3})
            third.save(path, half=True)
            rounded = cq.read(path)
            np.testing.assert_array_equal(rounded.picture, (values / 3).astype(np.float16).astype(np.float32))
            np.testing.assert_array_equal(rounded["Z"], values[..., 0] / 3)
            for name in ("a.jpg", "no/such/a.exr"):
                with self.subTest(name), self.assertRaises(cq.Error):
                    image.save(Path(folder) / name)
            with self.assertRaises(cq.Error):
                cq.read(Path(folder) / "a.png")
        with self.assertRaises(cq.Error):
            cq.Image.from_arrays({"": values, "Z": np.zeros((3, 3))})


class Errors(unittest.TestCase):
    def test_figures_are_those_of_their_definitions(self):
        rng = np.random.default_rng(1)
        reference = rng.uniform(0.1, 2.0, (16, 24, 3)).astype(np.float32)
        image = (reference * rng.normal(1.0, 0.1, reference.shape)).astype(np.float32)
        metrics = cq.compare(image, reference)
        squares = (image.astype(float) - reference) ** 2
        floor = reference.astype(float).mean(-1) ** 2 + 0.01
        self.assertAlmostEqual(metrics["mse"], squares.mean(), delta=1e-6 * squares.mean())
        self.assertAlmostEqual(metrics["relmse"], (squares.mean(-1) / floor).mean(), delta=1e-6 * metrics["relmse"])
        self.assertAlmostEqual(metrics["mean_ratio"], image.mean(dtype=float) / reference.mean(dtype=float), places=5)
        self.assertEqual((metrics["flip_map"].shape, metrics["flip_map"].dtype), ((16, 24), np.float32))
        self.assertAlmostEqual(metrics["flip"], metrics["flip_map"].mean(dtype=float), places=5)
        as_image = cq.Image.from_arrays({"": image, "Level1": reference})
        self.assertEqual(cq.compare(as_image, reference)["mse"], metrics["mse"])
        self.assertEqual(cq.compare(as_image, as_image, layer="Level1")["mse"], 0.0)
        with self.assertRaises(cq.Error):
            cq.compare(image, reference[1:])

    def test_files_of_a_comparison(self):
        rng = np.random.default_rng(2)
        image, reference = rng.uniform(0.1, 2.0, (2, 16, 24, 3)).astype(np.float32)
        with_error = cq.Image.from_arrays({"": image, "Error": np.abs(image - reference)})
        with tempfile.TemporaryDirectory() as folder:
            png, page, other = (Path(folder) / name for name in ("flip.png", "page.html", "other.html"))
            figures = cq.compare(with_error, reference, png=png, page=page)
            self.assertEqual(figures["mse"], cq.compare(image, reference, page=other)["mse"])
            self.assertTrue(png.read_bytes().startswith(b"\x89PNG"))
            pages = [path.read_text("utf-8") for path in (page, other)]
            self.assertTrue(all("<html" in text for text in pages))
            # The estimated errors are on the page of the image that has some.
            self.assertGreater(len(pages[0]), len(pages[1]))
            with self.assertRaises(cq.Error):
                cq.compare(image, reference, page=Path(folder) / "no" / "such.html")

    def test_a_finish_has_the_header_of_the_command_line(self):
        """The error of the finished picture replaces that of the estimate."""
        program = os.environ.get("CAUSTIQUE_BIN", ROOT / "target" / "release" / "caustique")
        scene = cq.Scene(TORUS)
        raw = scene.render(method="vcm", iterations=8, width=48, height=32, finish=False, layers="all,Quarter")
        with tempfile.TemporaryDirectory() as folder:
            before, after = Path(folder) / "raw.exr", Path(folder) / "done.exr"
            raw.save(before)
            words = [program, "finish", before, "-o", after, "--denoise", "own"]
            subprocess.run(words, check=True, capture_output=True)
            expected = cq.read(after)
        finished = cq.finish(raw, denoise="own")
        self.assertEqual(finished.header, expected.header)
        self.assertNotEqual(finished.header["error_of"], raw.header["error_of"])
        np.testing.assert_array_equal(finished.picture, expected.picture)

    def test_frames_are_finished_as_by_the_command_line(self):
        program = os.environ.get("CAUSTIQUE_BIN", ROOT / "target" / "release" / "caustique")
        scene = still_life()
        with tempfile.TemporaryDirectory() as folder:
            pattern = Path(folder) / "shot.####.exr"
            for frame in (1, 2, 4):
                options = {"method": "path", "iterations": 8, "width": 24, "height": 16, "seed": frame}
                scene.render(layers="all,Motion", finish=False, **options).save(Path(folder) / f"shot.{frame:04}.exr")
            done = Path(folder) / "done.####.exr"
            subprocess.run([program, "finish", pattern, "-o", done, "--denoise", "own"], check=True, capture_output=True)
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                finished = dict(cq.finish_frames(pattern, denoise="own"))
            self.assertIn("frame 3 is missing", str(caught[0].message))
            self.assertEqual(list(finished), [1, 2, 4])
            for frame, image in finished.items():
                expected = cq.read(Path(folder) / f"done.{frame:04}.exr")
                self.assertEqual(image.header, expected.header)
                self.assertEqual(sorted(image.keys()), sorted(expected.keys()))
                np.testing.assert_array_equal(image.picture, expected.picture)
            self.assertEqual([frame for frame, _ in cq.finish_frames(pattern, frames=[2, 2], denoise="own")], [2])
            with self.assertRaisesRegex(cq.Error, "no frame 3\\nhint: .*leave it out of frames"):
                cq.finish_frames(pattern, frames=[3])
            with self.assertRaisesRegex(cq.Error, "no file has such a name"):
                cq.finish_frames(Path(folder) / "other.####.exr")

    def test_renders_of_different_seeds_are_averaged(self):
        program = os.environ.get("CAUSTIQUE_BIN", ROOT / "target" / "release" / "caustique")
        scene = cq.Scene(TORUS)
        options = {"method": "path", "width": 24, "height": 16, "finish": False}
        renders = [scene.render(seed=seed, iterations=4 * seed, **options) for seed in (1, 3)]
        with tempfile.TemporaryDirectory() as folder:
            files = [Path(folder) / f"{index}.exr" for index in range(2)]
            for render, file in zip(renders, files, strict=True):
                render.save(file)
            mean = cq.merge(files, finish=False)
            finished, beauty = cq.merge(files, denoise="own"), cq.merge(files, finish=False, layers="beauty")
            merged = Path(folder) / "merged.exr"
            words = [program, "merge", *files, "-o", merged, "--denoise", "own"]
            subprocess.run(words, check=True, capture_output=True)
            expected = cq.read(merged)
        weighted = (renders[0]["Noisy"] + 3 * renders[1]["Noisy"]) / 4
        np.testing.assert_allclose(mean["Noisy"], weighted, rtol=1e-5, atol=1e-7)
        self.assertEqual(beauty.keys(), [""])
        np.testing.assert_array_equal(finished.picture, expected.picture)
        self.assertEqual(finished.header, expected.header)

    def test_combine_knows_the_names_of_blender(self):
        """A render with Blender's layer names gives the same picture under caustique's names, with normals in its
        axes."""
        program = os.environ.get("CAUSTIQUE_BIN", ROOT / "target" / "release" / "caustique")
        pictures = []
        with tempfile.TemporaryDirectory() as folder:
            for naming in ("plain", "blender"):
                file = Path(folder) / "out.exr"
                words = [program, "render", TORUS, "-o", file, "--method", "path", "--iterations", "8", "--width", "32"]
                words += ["--no-combine", "--progress", "none", "--exr-naming", naming]
                subprocess.run(words, check=True, capture_output=True)
                pictures.append(cq.combine(cq.read(file), denoise="own"))
        plain, blender = pictures
        np.testing.assert_array_equal(plain.picture, blender.picture)
        np.testing.assert_array_equal(plain["normal"], blender["normal"])
        self.assertEqual(sorted(plain.keys()), sorted(blender.keys()))

    def test_combine_is_the_finish_of_a_render(self):
        """Layers of an unfinished render, finished afterwards, are the picture of a finished one."""
        scene = cq.Scene(TORUS)
        options = {"method": "vcm", "iterations": 8, "width": 48, "height": 32}
        raw = scene.render(finish=False, **options)
        before = raw.picture
        finished = cq.combine(raw, denoise="own")
        expected = scene.render(denoise="own", **options)
        np.testing.assert_array_equal(raw.picture, before)
        np.testing.assert_allclose(finished.picture, expected.picture, rtol=1e-5, atol=1e-7)
        self.assertFalse(np.array_equal(finished.picture, before))
        with self.assertRaises(cq.Error) as caught:
            cq.combine(cq.Image.from_arrays({"": before}))
        self.assertTrue(caught.exception.hint)


class Convergence(unittest.TestCase):
    def test_points_are_errors_of_renders(self):
        """A point after N iterations is the error that `compare` finds of a render of N iterations."""
        scene, steps = still_life(), []
        options = {"width": 16, "height": 12}
        reference = scene.render(method="bdpt", iterations=256, seed=9, finish=False, **options)
        result = scene.converge(
            methods=["path", "sppm"], reference=reference, iterations=16, moments=2.0,
            progress=lambda step: steps.append((step["run"], step["iterations"])), **options,
        )
        self.assertEqual(set(steps), {(run, n) for run in ("path", "sppm") for n in range(1, 17)})
        points = {(point["run"], point["iterations"]): point for point in result["points"]}
        self.assertEqual(set(points), {(run, n) for run in ("path", "sppm") for n in (1, 2, 4, 8, 16)})
        for run, n in [("path", 1), ("path", 16), ("sppm", 8)]:
            levels = {"levels": 1} if run == "sppm" else {}
            image = scene.render(method=run, iterations=n, finish=False, **levels, **options)
            error = cq.compare(image, reference)["relmse"]
            self.assertAlmostEqual(points[run, n]["relmse"], error, delta=1e-9 * error)
        self.assertEqual([run["theory"]["exponent"] for run in result["runs"]][0], -1.0)
        # Unbiased and without fireflies: a factor of 16 in the squared error, or more, for points are well spread.
        self.assertGreater(points["path", 1]["relmse"] / points["path", 16]["relmse"], 8)

    def test_a_reference_is_made_where_none_is_given(self):
        steps = []
        result = still_life().converge(
            methods=["path"], reference_iterations=8, iterations=2, width=8, height=8,
            progress=lambda step: steps.append(step["run"]),
        )
        self.assertEqual(steps.count(None), 8)
        self.assertGreater(result["reference"]["error"]["relmse"], 0.0)
        stopped = still_life().converge(
            methods=["path"], reference=np.ones((8, 8, 3)), iterations=100, width=8, height=8,
            progress=lambda step: step["iterations"] < 3,
        )
        self.assertEqual(stopped["points"][-1]["iterations"], 3)

    def test_named_runs_and_a_given_reference(self):
        scene = ground([cq.SunLight(direction=(0, -1, 0), irradiance=(1, 1, 1))])
        reference = np.full((8, 8, 3), 0.6 / np.pi, np.float32)
        runs = {"mine": {"method": "sppm", "photons": 500, "levels": 1, "finish": False}}
        result = scene.converge(runs=runs, reference=reference, iterations=2, width=8, height=8)
        self.assertEqual([run["name"] for run in result["runs"]], ["mine"])
        self.assertLess(result["points"][-1]["relmse"], 1e-4)
        with self.assertRaisesRegex(TypeError, "'photon'; did you mean 'photons'"):
            scene.converge(runs={"mine": {"photon": 3}}, iterations=1)
        with self.assertRaises(cq.Error):
            scene.converge(methods=["path"], reference=reference[1:], iterations=1, width=8, height=8)


class Types(unittest.TestCase):
    def check(self, *words):
        done = subprocess.run([sys.executable, "-m", *words], capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)

    def test_the_stubs_are_the_module(self):
        self.check("mypy.stubtest", "caustique._native")

    def test_the_types_of_the_package_agree(self):
        self.check("mypy", "--check-untyped-defs", ROOT / "ffi" / "python" / "caustique")

    def test_everything_is_documented(self):
        for name in cq.__all__:
            if name not in ("__version__", "Light"):
                self.assertTrue(getattr(cq, name).__doc__, name)
        for name in ("render", "plan", "converge", "from_meshes"):
            self.assertTrue(getattr(cq.Scene, name).__doc__, name)
        for call in (cq.Scene.render, cq.Scene.converge):
            shared = {"width", "height", "camera", "threads", "max_depth"} if call is cq.Scene.converge else set()
            for option in set(inspect.signature(call).parameters) - {"self"} - shared:
                self.assertRegex(call.__doc__, rf"\b{option}\b")


if __name__ == "__main__":
    unittest.main()
