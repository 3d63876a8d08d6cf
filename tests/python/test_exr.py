"""Tests EXR files and error metrics against OpenEXR's library, numpy, and the authors' FLIP."""

import json
import re
import struct
import unittest
from pathlib import Path

import flip_evaluator
import numpy as np
import OpenEXR

import support

NAME = re.compile(r"^([A-Za-z][A-Za-z0-9_]*\.)?[RGBAXYZUVrgba]$")


def pixels(path):
    """All channels of a file by full name, as arrays of the type in the file."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        assert len(file.parts) == 1, f"{path}: {len(file.parts)} parts"
        return {name: channel.pixels for name, channel in file.channels().items()}


def header(path):
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return dict(file.header())


def write(path, channels, compression=OpenEXR.ZIP_COMPRESSION, tiles=False):
    kind = {"type": OpenEXR.tiledimage, "tiles": OpenEXR.TileDescription()} if tiles else {"type": OpenEXR.scanlineimage}
    OpenEXR.File({"compression": compression, **kind}, channels).write(str(path))
    return path


def edges_and_noise(width, height):
    """A reference and a noisy picture: gradients, steps, one square far brighter than white."""
    y, x, c = np.mgrid[0:height, 0:width, 0:3].astype(np.int64)
    reference = 0.05 + ((x * (c + 1) * 7 + y * 13) % 64) / 64
    reference = np.where((x >= 20) & (x < 30) & (y >= 10) & (y < 20), 20.0, reference)
    noise = ((x * 73856093) ^ (y * 19349663) ^ (c * 83492791)) % 256 / 255
    return reference.astype(np.float32), (reference * (0.75 + 0.5 * noise)).astype(np.float32)


class Written(support.Scratch):
    """Files of `render`, read by OpenEXR."""

    def render(self, name, *extra):
        path = self.dir / name
        size = ["--width", "33", "--height", "20", "--iterations", "2", "--photons", "2000"]
        command = ["render", support.scene("cornell"), "-o", path, *size, "--no-combine", "--progress", "none"]
        support.run([*command, *extra], check=0)
        return path

    def test_frames_of_films_say_their_number_and_rate(self):
        data = Path(support.scene("cornell")).read_bytes()
        size = struct.unpack_from("<I", data, 12)[0]
        document = json.loads(data[20:20 + size])
        document["scenes"][0].setdefault("extras", {}).setdefault("caustique", {}).update(frame=49, frame_rate=[24000, 1001])
        text = json.dumps(document).encode()
        text += b" " * (-len(text) % 4)
        rest = data[20 + size:]
        scene = self.dir / "frame.glb"
        scene.write_bytes(data[:8] + struct.pack("<III", 20 + len(text) + len(rest), len(text), 0x4E4F534A) + text + rest)
        path = self.dir / "frame.exr"
        size = ["--width", "9", "--iterations", "1", "--photons", "100", "--layers", "beauty", "--no-combine", "--allow-outside"]
        support.run(["render", scene, "-o", path, *size, "--progress", "none"], check=0)
        attributes = header(path)
        rate, code = attributes["framesPerSecond"], attributes["timeCode"]
        self.assertEqual((rate.numerator, rate.denominator), (24000, 1001))
        self.assertEqual((code.hours, code.minutes, code.seconds, code.frame), (0, 0, 2, 1))
        self.assertEqual(attributes["imageCounter"], 49)
        self.assertEqual(json.loads(attributes["caustique"])["frame"], 49)

    def test_layers_types_and_header(self):
        path = self.render("plain.exr")
        channels = pixels(path)
        levels = [f"{kind}{i}.{c}" for kind in ("Level", "Variance") for i in range(1, 6) for c in "RGB"]
        for name in [*"RGBAZ", *levels, "Noisy.R", "Radius1.X", "Error.B", "albedo.R", "normal.X", "depth.Z", "P.Y"]:
            self.assertIn(name, channels)
        for name, values in channels.items():
            self.assertRegex(name, NAME)
            self.assertLessEqual(len(name), 31)
            self.assertEqual(values.dtype, np.float32, name)
            self.assertEqual(values.shape, (20, 33), name)
            # Cryptomatte ids are arbitrary floats; all other values are finite quantities.
            self.assertTrue(np.isfinite(values).all(), name)
        normal = np.stack([channels[f"normal.{c}"] for c in "XYZ"])
        self.assertLessEqual(np.linalg.norm(normal, axis=0).max(), 1 + 1e-4)
        head = header(path)
        self.assertEqual(head["compression"], OpenEXR.ZIP_COMPRESSION)
        self.assertEqual(head["lineOrder"], OpenEXR.INCREASING_Y)
        said = json.loads(head["caustique"])
        self.assertTrue(head["caustique"].isascii())
        for key in ["version", "seed", "iterations", "light_paths", "history"]:
            self.assertIn(key, said)

    def test_every_compression_holds_the_same_values(self):
        reference = pixels(self.render("none.exr", "--compression", "none"))
        for name, compression in [
            ("zip", OpenEXR.ZIP_COMPRESSION),
            ("zips", OpenEXR.ZIPS_COMPRESSION),
            ("piz", OpenEXR.PIZ_COMPRESSION),
        ]:
            path = self.render(f"{name}.exr", "--compression", name)
            self.assertEqual(header(path)["compression"], compression)
            channels = pixels(path)
            self.assertEqual(channels.keys(), reference.keys())
            for channel, values in channels.items():
                self.assertEqual(values.tobytes(), reference[channel].tobytes(), f"{name}: {channel}")

    def test_names_for_blender(self):
        channels = pixels(self.render("blender.exr", "--exr-naming", "blender"))
        for name in ["Combined.R", "Combined.A", "Depth.Z", "Normal.X", "Denoising Albedo.R", "Level1.R"]:
            self.assertIn(f"ViewLayer.{name}", channels)

    def test_layers_that_are_asked_for(self):
        self.assertEqual(pixels(self.render("beauty.exr", "--layers", "beauty")).keys(), set("RGBA"))
        found = pixels(self.render("list.exr", "--layers", "beauty,albedo,Z")).keys()
        self.assertEqual(found, {*"RGBAZ", "albedo.R", "albedo.G", "albedo.B"})
        done = support.run(["render", support.scene("cornell"), "-o", self.dir / "x.exr", "--layers", "albeod"], check=2)
        self.assertIn('"albeod"', done.stderr)
        self.assertIn('did you mean "albedo"?', done.stderr)
        self.assertFalse((self.dir / "x.exr").exists())

    def test_cryptomatte_names_what_is_seen(self):
        path = self.render("crypto.exr")
        head, channels = header(path), pixels(path)
        names = {key.split("/")[1]: value for key, value in head.items() if re.fullmatch("cryptomatte/[0-9a-f]{7}/name", key)}
        self.assertIn("CryptoObject", names.values())
        for key, layer in names.items():
            self.assertEqual(head[f"cryptomatte/{key}/hash"], "MurmurHash3_32")
            self.assertEqual(head[f"cryptomatte/{key}/conversion"], "uint32_to_float32")
            ids = {int(value, 16) for value in json.loads(head[f"cryptomatte/{key}/manifest"]).values()}
            for plane, coverage in ("rg", "ba"):
                found = channels[f"{layer}00.{plane}"].view(np.uint32)
                covered = channels[f"{layer}00.{coverage}"]
                self.assertLessEqual(set(np.unique(found[covered > 0])), ids)
                self.assertTrue(((covered >= 0) & (covered <= 1 + 1e-5)).all())


class Compared(support.Scratch):
    """Output of `compare` for files that OpenEXR wrote."""

    def compare(self, image, reference, *extra):
        done = support.run(["compare", image, reference, "--json", *extra], check=0)
        return json.loads(done.stdout)

    def test_metrics_are_those_of_the_papers(self):
        reference, image = edges_and_noise(96, 64)
        files = [write(self.dir / name, {"RGB": data}) for name, data in (("a.exr", image), ("b.exr", reference))]
        result = self.compare(*files)
        a, b = image.astype(np.float64), reference.astype(np.float64)
        squared = ((a - b) ** 2).mean(axis=2)
        relative = np.sort((squared / (b.mean(axis=2) ** 2 + 0.01)).ravel())
        self.assertAlmostEqual(result["relmse"], relative.mean(), delta=1e-9 * relative.mean())
        trimmed = relative[: relative.size - int(0.005 * relative.size)].mean()
        self.assertAlmostEqual(result["relmse_trimmed"], trimmed, delta=1e-9 * trimmed)
        self.assertAlmostEqual(result["mse"], squared.mean(), delta=1e-9 * squared.mean())
        self.assertAlmostEqual(result["mean_ratio"], a.mean() / b.mean(), delta=1e-9)
        self.assertEqual(result["pixels_not_finite"], 0)
        _, flip, _ = flip_evaluator.evaluate(reference, image, "HDR", inputsRGB=False, applyMagma=False)
        self.assertAlmostEqual(result["flip"], float(flip), delta=1e-4)

    def test_flip_of_a_dim_picture(self):
        reference, image = (data[:40, :50] * 1e-3 for data in edges_and_noise(96, 64))
        files = [write(self.dir / name, {"RGB": data}) for name, data in (("a.exr", image), ("b.exr", reference))]
        _, flip, _ = flip_evaluator.evaluate(
            np.ascontiguousarray(reference), np.ascontiguousarray(image), "HDR", inputsRGB=False, applyMagma=False
        )
        self.assertAlmostEqual(self.compare(*files)["flip"], float(flip), delta=1e-3)

    def test_every_compression_and_layout_is_read(self):
        reference, _ = edges_and_noise(96, 64)
        plain = write(self.dir / "plain.exr", {"RGB": reference})
        for compression in ["NO", "RLE", "ZIPS", "ZIP", "PIZ", "PXR24", "B44", "DWAA", "DWAB"]:
            for tiles in (False, True):
                with self.subTest(compression=compression, tiles=tiles):
                    path = self.dir / f"{compression}{tiles}.exr"
                    write(path, {"RGB": reference}, getattr(OpenEXR, f"{compression}_COMPRESSION"), tiles)
                    # PXR24 rounds to 24 bits and DWA quantises; B44 leaves floats alone.
                    limit = {"PXR24": 1e-9, "DWAA": 1e-2, "DWAB": 1e-2}.get(compression, 0)
                    self.assertLessEqual(self.compare(path, plain)["relmse"], limit)

    def test_halves_and_names_of_other_programs(self):
        reference, _ = edges_and_noise(96, 64)
        halves = reference.astype(np.float16)
        expected = self.compare(
            write(self.dir / "rounded.exr", {"RGB": halves.astype(np.float32)}),
            write(self.dir / "plain.exr", {"RGB": reference}),
        )
        for prefix in ["", "ViewLayer.Combined.", "View.Layer.Combined.", "beauty.", "rgba."]:
            with self.subTest(prefix=prefix):
                channels = {f"{prefix}{c}": np.ascontiguousarray(halves[..., i]) for i, c in enumerate("RGB")}
                channels["albedo.R"] = np.ones(halves.shape[:2], np.float32)
                path = write(self.dir / "named.exr", channels)
                self.assertEqual(self.compare(path, self.dir / "plain.exr"), expected)

    def test_not_a_number(self):
        reference, image = edges_and_noise(96, 64)
        image[5, 6, 1] = np.nan
        reference[7, 8] = np.inf
        files = [write(self.dir / name, {"RGB": data}) for name, data in (("a.exr", image), ("b.exr", reference))]
        result = self.compare(*files)
        self.assertEqual(result["pixels_not_finite"], 2)
        self.assertTrue(np.isfinite([result["relmse"], result["flip"]]).all())

    def test_the_heat_map(self):
        reference, image = edges_and_noise(96, 64)
        files = [write(self.dir / name, {"RGB": data}) for name, data in (("a.exr", image), ("b.exr", reference))]
        self.compare(*files, "--png", self.dir / "heat.png")
        data = (self.dir / "heat.png").read_bytes()
        self.assertEqual(data[:8], b"\x89PNG\r\n\x1a\n")
        self.assertEqual(struct.unpack(">IIBB", data[16:26]), (96, 64, 8, 2))

    def test_pictures_that_cannot_be_compared_are_refused(self):
        reference, _ = edges_and_noise(96, 64)
        good = write(self.dir / "good.exr", {"RGB": reference})
        small = write(self.dir / "small.exr", {"RGB": reference[:10, :10].copy()})
        cut = self.dir / "cut.exr"
        cut.write_bytes(good.read_bytes()[:3000])
        other = self.dir / "other.exr"
        other.write_bytes(b"no picture at all")
        for path, words in [
            (small, "96 x 64"),
            (cut, "cut.exr: "),
            (other, "other.exr: not a valid EXR"),
            (self.dir / "missing.exr", "missing.exr: "),
        ]:
            with self.subTest(path=path.name):
                done = support.run(["compare", path, good], check=1)
                self.assertIn(words, done.stderr)
                self.assertNotIn("panicked", done.stderr)
                self.assertEqual(done.stdout, "")


if __name__ == "__main__":
    unittest.main()
