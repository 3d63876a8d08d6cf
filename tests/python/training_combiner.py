"""Tests the training code of the combiner (scripts/lab/train) with torch."""

import tempfile
import unittest
from pathlib import Path
from unittest import mock

import numpy as np
import onnx.reference
import torch

import support  # noqa: F401 (adds scripts to the path)

from lab.train import apply, combination, export_network, fixture, model, normalise, train

# Arrays of a stack of 70 x 101 pixels that the input of version 1 needs.
SHAPES = {"levels": (5, 70, 101, 3), "deviations": (5, 70, 101), "depth": (70, 101)}
SHAPES |= {"albedo": (70, 101, 3), "normal": (70, 101, 3)}
DEVICES = ["cpu", "cuda"] if torch.cuda.is_available() else ["cpu"]


def inputs(dimensions, dtype, window=7, size=(9, 12), seed=1, device="cpu"):
    """Random arguments of the sums: phi, weight, falloff, difference, window; some distances exceed their maximum."""
    generator = torch.Generator(device).manual_seed(seed)
    shape = (2, 3, *size)
    phi = 2.5 * torch.randn(2, 3, dimensions, *size, generator=generator, dtype=dtype)
    weight, falloff = (torch.rand(shape, generator=generator, dtype=dtype) for _ in range(2))
    difference = torch.randn(2, 3, 3, *size, generator=generator, dtype=dtype)
    return [phi.requires_grad_(), weight.requires_grad_(), (0.2 * falloff).requires_grad_()], difference, window


def results(sums, given, difference, *window):
    """The sums, and the gradients of a nonlinear function of them."""
    total, colour = sums(*given, difference, *window)
    gradients = torch.autograd.grad(total.square().mean() + colour.sin().sum(), given)
    return [total, colour, *gradients]


class Equation(unittest.TestCase):
    def assert_equal(self, got, wanted, tolerance):
        for k, (a, b) in enumerate(zip(got, wanted)):
            self.assertLess(((a - b).abs().max() / b.abs().max()).item(), tolerance, f"result {k}")

    def test_compiled_sums_and_gradients_equal_the_reference(self):
        for device in DEVICES:
            with torch.device(device):
                self.compare_sums(device)

    def compare_sums(self, device):
        for dtype, tolerance in ((torch.float64, 1e-13), (torch.float32, 5e-6)):
            for dimensions in range(1, 9):
                given, difference, window = inputs(dimensions, dtype, device=device)
                pair = (combination.AffinitySums.apply, combination.reference_affinity)
                for more in ((window,), (5, 2), (3, 7)):
                    self.assert_equal(*(results(sums, given, difference, *more) for sums in pair), tolerance)
            weights = torch.rand(2, 3, 25, 9, 12, dtype=dtype, requires_grad=True)
            pair = (combination.KernelSums.apply, combination.reference_kernel)
            for dilation in (1, 3):
                self.assert_equal(*(results(sums, [weights], difference, 5, dilation) for sums in pair), tolerance)

    def test_gradients_equal_finite_differences(self):
        given, difference, window = inputs(2, torch.float64, 3, (4, 5))
        scaled = [(given[0].detach() / 4).requires_grad_(), *given[1:]]
        self.assertTrue(
            torch.autograd.gradcheck(lambda *x: combination.AffinitySums.apply(*x, difference, window), scaled)
        )

    def test_a_wrong_gradient_is_noticed(self):
        given, difference, window = inputs(4, torch.float64)
        wanted = results(combination.reference_affinity, given, difference, window)
        wrong = [x.detach().clone() for x in wanted]
        wrong[2][0, 0, 0, 4, 5] *= 1.01
        with self.assertRaises(AssertionError):
            self.assert_equal(results(combination.AffinitySums.apply, given, difference, window), wrong, 1e-13)

    def test_equal_pictures_are_returned_unchanged_and_units_do_not_matter(self):
        torch.manual_seed(2)
        picture = torch.rand(1, 1, 3, 10, 11).expand(-1, 4, -1, -1, -1)
        y, z = picture + torch.randn(1, 4, 3, 10, 11), picture + torch.randn(1, 4, 3, 10, 11)
        wide = combination.Form("features", 5, 4, (1, 3), (0, 2))
        for form in (combination.Form("features", 5, 4), wide, combination.Form("weights", 5)):
            output = torch.randn(1, form.channels(4), 10, 11)
            output = output.exp() if form.kind == "weights" else output
            same = combination.combine(output, picture, picture, form)
            self.assertLess((same - picture[:, 0]).abs().max().item(), 1e-6)
            one, brighter = (combination.combine(output, k * y, k * z, form) for k in (1, 1024))
            self.assertTrue(torch.equal(1024 * one, brighter))


class Training(unittest.TestCase):
    def test_noisy_targets_move_the_absolute_loss_from_their_mean_and_the_squared_loss_hardly(self):
        # An exponential distribution, whose median is 0.69 times its mean; the noise of a target is 0.3 of its value.
        targets = 0.7 + 0.3 * torch.from_numpy(np.random.default_rng(3).exponential(1, (1, 3, 300, 300))).float()
        value = torch.full((1, 3, 300, 300), 1.0, requires_grad=True)
        (slope,) = torch.autograd.grad(train.squared_loss(value, targets), value)
        (biased,) = torch.autograd.grad(train.relative_loss(value, targets), value)
        self.assertLess(abs(slope.sum().item()), 0.1 * abs(biased.sum().item()))

    def test_networks_have_the_planes_of_their_input_and_equal_their_onnx_files(self):
        stack = fixture.random_stack(np.random.default_rng(4))
        for arch, pairs, wide in (("compact", "multi", False), ("compact", "dual4", True), ("paper", "dual3", False)):
            torch.manual_seed(5)
            net = model.build(arch, pairs, window=5, wide=wide).eval()
            image = normalise.tensor(stack, version=net.version)[None, :, :16, :20]
            self.assertEqual(image.shape[1], normalise.channels(5, net.version))
            with tempfile.TemporaryDirectory() as folder:
                file = Path(folder) / "network.onnx"
                export_network.export(net, str(file), "none")
                (got,) = onnx.reference.ReferenceEvaluator(str(file)).run(None, {"input": image})
            with torch.no_grad():
                wanted = net(torch.from_numpy(image)).numpy()
            self.assertLess(np.abs(got - wanted).max() / np.abs(wanted).max(), 1e-5)

    def test_tiles_equal_the_whole_picture(self):
        rng = np.random.default_rng(7)
        stored = {key: rng.uniform(0.1, 1, (1, *shape)).astype(np.float32) for key, shape in SHAPES.items()}
        stored |= {"iterations": np.array([8]), "halves": np.zeros((2, 70, 101, 3), np.float32)}
        torch.manual_seed(8)
        net = model.build("compact", wide=True).eval()
        whole, shares = apply.combined(net, stored)
        with mock.patch.object(apply, "TILE", 32):
            tiles, _ = apply.combined(net, stored)
        self.assertEqual(whole.shape, (70, 101, 3))
        self.assertLess(np.abs(tiles - whole).max(), 1e-5)
        with mock.patch.object(apply, "TILE", 32), mock.patch.object(apply, "BORDER", 8):
            self.assertGreater(np.abs(apply.combined(net, stored)[0] - whole).max(), 1e-5)
        np.testing.assert_allclose(shares.sum(0), 1, atol=1e-5)

    def test_the_input_does_not_depend_on_the_unit_of_light(self):
        stack = fixture.random_stack(np.random.default_rng(6))
        brighter = stack | {"levels": 1024 * stack["levels"], "variances": 1024**2 * stack["variances"]}
        np.testing.assert_array_equal(normalise.tensor(stack), normalise.tensor(brighter))


if __name__ == "__main__":
    unittest.main()
