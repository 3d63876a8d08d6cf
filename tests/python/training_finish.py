"""Tests the network of the finish and its trainer (scripts/lab/train) with torch."""

import json
import tempfile
import unittest
from pathlib import Path

import numpy as np
import onnx.reference
import torch

import support  # noqa: F401 (adds scripts to the path)

from lab.train import data, export_network, finish_data, finish_fixture, finish_model, finish_train, finish_views, train

PLANES = sum(finish_views.PLANES.values())


def image(rng, height=24, width=32):
    """A random input of the network."""
    planes = rng.uniform(0.1, 1, (1, PLANES, height, width)).astype(np.float32)
    return torch.from_numpy(planes)


def network():
    """A network whose weights differ between pixels."""
    torch.manual_seed(1)
    net = finish_model.FinishNet(16, 16)
    with torch.no_grad():
        net.head.weight.mul_(30)
    return net.eval()


def window(rng, side=48):
    """The arrays of a window: noise of 0.2 around a smooth picture, which the denoised picture blurs."""
    truth = 1 + 0.5 * np.sin(np.arange(side) / 3)[None, :, None] * np.ones((side, side, 3))
    noisy = lambda: truth + 0.2 * rng.normal(size=truth.shape)
    planar = lambda value: np.full((1, side, side), value, np.float16)
    flat = lambda value: np.full((1, side, side, 3), value, np.float16)
    arrays = {"mean": noisy()[None], "denoised": flat(1), "whole": flat(1.1), "reach": flat(0.6)}
    arrays |= {"effects": np.zeros((1, 5, side, side)), "albedo": flat(0.5), "normal": flat(0), "depth": planar(1)}
    arrays |= {"deviation": planar(0.2), "correlation": planar(1 / 9), "transmission": planar(0.5)}
    arrays = {key: value.astype(np.float16) for key, value in arrays.items()}
    return arrays | {"iterations": np.array([16])}, np.stack([noisy(), noisy()]).astype(np.float32)


class Network(unittest.TestCase):
    def test_equal_pictures_are_returned_unchanged_and_the_bound_limits_the_result(self):
        rng, net = np.random.default_rng(2), network()
        x = image(rng)
        x[:, :6] = x[:, -3:] = 0.7
        self.assertLess((net(x) - 0.7).abs().max().item(), 1e-5)
        x = image(rng)
        groups = finish_model.split(x)
        groups["reach"][:, :, :4] = 0
        moved = finish_model.bounded(groups, net(x))
        self.assertTrue(torch.equal(moved[:, :, :4], groups["mean"][:, :, :4]))
        self.assertTrue(((moved - groups["mean"]).abs() <= groups["reach"] * (1 + 1e-6)).all())

    def test_the_untrained_network_is_close_to_the_denoised_picture(self):
        x = image(np.random.default_rng(3))
        groups = finish_model.split(x)
        with torch.no_grad():
            found = finish_model.FinishNet()(x)
        error = lambda other: (found - other).square().mean().item()
        self.assertLess(error(groups["denoised"]), 0.1 * error(groups["mean"]))

    def test_a_pixel_does_not_depend_on_others_beyond_the_halo(self):
        net, x = network(), image(np.random.default_rng(4), 96, 96)
        with torch.no_grad():
            whole = net(x)
            for start in (0, 4):
                part = net(x[:, :, start:, :96])
                halo = net.halo if start else 0
                self.assertLess((part[:, :, halo:] - whole[:, :, start + halo :]).abs().max().item(), 1e-5)
            inside = net(x[:, :, 8:])[:, :, 8:] - whole[:, :, 16:]
        self.assertGreater(inside.abs().max().item(), 1e-5)

    def test_the_onnx_file_gives_the_same_picture(self):
        net, x = network(), image(np.random.default_rng(5))
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "network.onnx"
            export_network.export(net, str(file), "none")
            (got,) = onnx.reference.ReferenceEvaluator(str(file)).run(None, {"input": x.numpy()})
            known = {prop.key: prop.value for prop in onnx.load(file).metadata_props}
        self.assertEqual((known["caustique.kind"], known["caustique.version"]), ("finish", "2"))
        with torch.no_grad():
            wanted = net(x).numpy()
        self.assertLess(np.abs(got - wanted).max() / np.abs(wanted).max(), 1e-5)


class Fixture(unittest.TestCase):
    def test_the_files_that_rust_tests_read_are_those_of_this_code(self):
        for name, content in finish_fixture.content().items():
            stored = (finish_fixture.FOLDER / name).read_bytes()
            if name.endswith(".f32"):
                content, stored = (np.frombuffer(data, "<f4") for data in (content, stored))
                np.testing.assert_allclose(content, stored, rtol=1e-5, atol=1e-6)
            else:
                self.assertEqual(content, stored)


class Training(unittest.TestCase):
    def test_a_run_continues_from_its_file_and_removes_a_blur(self):
        rng = np.random.default_rng(6)
        with tempfile.TemporaryDirectory() as folder:
            folder, lines = Path(folder), []
            for name, held_out in (("a-0", False), ("b-0", True)):
                view = folder / "views" / name
                view.mkdir(parents=True)
                arrays, halves = window(rng)
                data.write(view / finish_data.file_name("path"), arrays)
                data.write(view / "path-target.npz", {"halves": halves})
                data.write(view / finish_data.clean_name("path"), {"clean": halves.mean(0)})
                files = {file.name: "" for file in view.iterdir()}
                lines.append(json.dumps({"view": name, "held_out": held_out, "files": files}))
            (folder / "manifest.jsonl").write_text("\n".join(lines) + "\n", encoding="utf-8")
            words = ["--data", folder, "--out", folder / "run", "--batch", 2, "--side", 32, "--steps", 30]
            args = train.common_arguments("").parse_args(list(map(str, [*words, "--rate", 0.03])))
            train.prepare(args)
            pool = finish_views.Pool(folder)
            first = finish_train.FinishRun(args)
            before = finish_train.validate(first.net, folder)
            for _ in range(15):
                first.train_step(pool)
            first.save()
            second = finish_train.FinishRun(args)
            self.assertEqual(second.step, 15)
            for _ in range(15):
                second.train_step(pool)
            after = finish_train.validate(second.net, folder)
            second.save()
            restored, _ = export_network.load(folder / "run" / "last.pt")
        self.assertEqual(after["snapshots"], 1)
        self.assertAlmostEqual(before["error"], 1, delta=0.2)
        self.assertLess(after["error"], 0.95 * before["error"])
        self.assertIsInstance(restored, finish_model.FinishNet)

    def test_the_loss_of_the_denoised_picture_is_that_of_the_default_finish(self):
        rng = np.random.default_rng(7)
        x, targets = image(rng), torch.from_numpy(rng.uniform(0.1, 1, (1, 3, 3, 24, 32)).astype(np.float32))
        same = lambda x: finish_model.split(x)["denoised"]
        self.assertAlmostEqual(finish_train.loss_of(same, (x, targets, x[:, :1])).item(), 0, delta=1e-6)


if __name__ == "__main__":
    unittest.main()
