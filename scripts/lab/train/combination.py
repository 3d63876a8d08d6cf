"""Equations (5) and (6) of [Choi and Moon 2021], differentiable; they must agree with src/combine/{affinity,kernel}.rs.

out_c = 1/W sum_j sum_{i in window of c} w_i^j (y_i^j + z_c^j - z_i^j)

In equation (6) all y^j are level 1, and z^j is level j + 1. The sums and their derivatives are compiled from
equation6.cpp, or from equation6.cu for a GPU; tests compare them with `reference_*`, which torch differentiates.
"""

import ctypes
import functools
import hashlib
import os
import subprocess
from pathlib import Path
from typing import NamedTuple

import torch
from torch.nn.functional import pad

from ..cache import HOME

# Sources and how they are compiled, by the kind of device.
OPTIMISED = ["-O3", "-march=native", "-fno-math-errno", "-fno-trapping-math", "-fopenmp", "-fPIC"]
SOURCES = {
    "cpu": ("equation6.cpp", ["c++", "-std=c++20", "-shared", *OPTIMISED]),
    "cuda": ("equation6.cu", ["nvcc", "-std=c++20", "-shared", "-O3", "-arch=native", "-Xcompiler", "-fPIC"]),
}

# Largest exponent of an affinity, and bounds of the logarithms: they keep every weight positive in float32.
MAX_DISTANCE = 60.0
MAX_LOG_WEIGHT = 12.0
# The falloff is at most 1: with a larger one only the centre would count, and the gradient would vanish.
LOG_FALLOFF = (-20.0, 0.0)


class Form(NamedTuple):
    """How a network's output defines weights.

    `kind` is `features` (of `features` dimensions) or `weights`. The window has window^2 pixels, in steps of each of the
    `dilations`, for which each pair has weights of its own. `identities` lists pairs whose z_c has a weight alone, as if
    y^j were z^j: then neighbours add no noise.
    """

    kind: str
    window: int
    features: int = 0
    dilations: tuple = (1,)
    identities: tuple = ()

    def channels(self, pairs):
        """The number of channels of the network's output."""
        each = self.features + 3 if self.kind == "features" else self.window**2
        return len(self.dilations) * pairs * each + len(self.identities)


def combine(output, y, z, form):
    """`output` of the network [b, c, h, w], pictures y and z [b, pairs, 3, h, w] -> [b, 3, h, w]."""
    weights, value = pair_sums(output, y, z, form)
    return value.sum(1) / weights.sum(1, keepdim=True)


def pair_sums(output, y, z, form):
    """Sums over windows of the weights and of the weighted terms y_i + z_c - z_i, by pair, then for the identities."""
    difference, pairs = y - z, y.shape[1]
    identities = output[:, output.shape[1] - len(form.identities) :]
    groups = output[:, : output.shape[1] - len(form.identities)].chunk(len(form.dilations), 1)
    weights, values = [], []
    for group, dilation in zip(groups, form.dilations):
        if form.kind == "features":
            phi, source, falloff, centre = split_features(group, pairs, form.features)
            total, sums = AffinitySums.apply(phi, source, falloff, difference, form.window, dilation)
            total, sums = total * centre, sums * centre.unsqueeze(2)
        else:
            kernels = group.unflatten(1, (pairs, form.window**2))
            total, sums = KernelSums.apply(kernels, difference, form.window, dilation)
        weights.append(total)
        # The sums contain the weighted y_i - z_i; z_c is added with the total weight of its pair.
        values.append(sums + z * total.unsqueeze(2))
    if form.identities:
        weights.append(identities.clamp(-MAX_LOG_WEIGHT, MAX_LOG_WEIGHT).exp())
        values.append(weights[-1].unsqueeze(2) * z[:, list(form.identities)])
    return torch.cat(weights, 1), torch.cat(values, 1)


def split_features(output, pairs, features):
    """phi, exp(source), falloff and exp(centre) of the weights
    w_i^j = exp(source_i + centre_c - falloff_c |c - i|^2 - |phi_c - phi_i|^2)."""
    phi, scalars = output[:, : pairs * features], output[:, pairs * features :]
    source, centre, falloff = scalars.chunk(3, 1)
    source, centre = (x.clamp(-MAX_LOG_WEIGHT, MAX_LOG_WEIGHT).exp() for x in (source, centre))
    return phi.unflatten(1, (pairs, features)), source, falloff.clamp(*LOG_FALLOFF).exp(), centre


def reference_affinity(phi, weight, falloff, difference, window, dilation=1):
    """Sums over the window of w_i and of w_i d_i, w_i = weight_i exp(-falloff_c |c - i|^2 - |phi_c - phi_i|^2).

    Shapes: phi [b, j, f, h, w]; weight, falloff [b, j, h, w]; difference d [b, j, 3, h, w].
    """
    r, reach, total, sums = window // 2, window // 2 * dilation, 0, 0
    # Sources outside the image have no weight, so windows are clipped.
    phi_p, weight_p, d_p = (pad(x, [reach] * 4) for x in (phi, weight, difference))
    for dy in range(window):
        for dx in range(window):
            length = float((dx - r) ** 2 + (dy - r) ** 2)
            distance = (phi - shifted(phi_p, dy * dilation, dx * dilation, reach)).square().sum(2) + falloff * length
            w = shifted(weight_p, dy * dilation, dx * dilation, reach) * (-distance.clamp(max=MAX_DISTANCE)).exp()
            total, sums = total + w, sums + w.unsqueeze(2) * shifted(d_p, dy * dilation, dx * dilation, reach)
    return total, sums


def reference_kernel(weights, difference, window, dilation=1):
    """Sums over the window of w_i and of w_i d_i with explicit weights [b, j, window^2, h, w]."""
    reach, total, sums = window // 2 * dilation, 0, 0
    inside, d_p = pad(torch.ones_like(difference[:, :, 0]), [reach] * 4), pad(difference, [reach] * 4)
    for dy in range(window):
        for dx in range(window):
            w = weights[:, :, dy * window + dx] * shifted(inside, dy * dilation, dx * dilation, reach)
            total, sums = total + w, sums + w.unsqueeze(2) * shifted(d_p, dy * dilation, dx * dilation, reach)
    return total, sums


def shifted(x, dy, dx, r):
    """x at i = c + (dx - r, dy - r), where x is padded by r on the last two axes."""
    h, w = x.shape[-2] - 2 * r, x.shape[-1] - 2 * r
    return x[..., dy : dy + h, dx : dx + w]


@functools.cache
def library(kind):
    """The compiled source for the CPU or a GPU, from the cache if it was compiled on such a processor before."""
    name, compiler = SOURCES[kind]
    source = Path(__file__).with_name(name)
    key = hashlib.sha256(source.read_bytes() + f"{compiler}{processor(kind)}".encode()).hexdigest()[:16]
    path = HOME / "caustique" / f"equation6-{key}.so"
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        draft = path.with_suffix(f".{os.getpid()}.part")
        subprocess.run([*compiler, source, "-o", draft], check=True)
        draft.rename(path)
    return ctypes.CDLL(str(path))


def processor(kind):
    """A text that differs between processors for which compilers make different code."""
    if kind == "cuda":
        return torch.cuda.get_device_name()
    lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    return "".join(sorted({line for line in lines if line.startswith(("model name", "flags"))}))


def call(name, shape, *tensors):
    """Calls a function of the library for contiguous tensors of one type on one device."""
    suffix, kind = {torch.float32: "f32", torch.float64: "f64"}[tensors[0].dtype], tensors[0].device.type
    last = torch.cuda.current_stream().cuda_stream if kind == "cuda" else torch.get_num_threads()
    sizes = (ctypes.c_long * 7)(*shape, last)
    getattr(library(kind), f"{name}_{suffix}")(sizes, *(ctypes.c_void_p(x.data_ptr()) for x in tensors))


class AffinitySums(torch.autograd.Function):
    """`reference_affinity`, compiled; the difference is not differentiated."""

    @staticmethod
    def forward(ctx, phi, weight, falloff, difference, window, dilation=1):
        given = [x.contiguous() for x in (phi, weight, falloff, difference)]
        b, j, f, h, w = phi.shape
        ctx.shape = (b * j, f, h, w, window, dilation)
        ctx.save_for_backward(*given)
        total, sums = torch.zeros_like(given[1]), torch.zeros_like(given[3])
        call("affinity", ctx.shape, *given, total, sums)
        return total, sums

    @staticmethod
    def backward(ctx, total_grad, sums_grad):
        given = ctx.saved_tensors
        grads = [torch.zeros_like(x) for x in given[:3]]
        call("affinity_gradient", ctx.shape, *given, total_grad.contiguous(), sums_grad.contiguous(), *grads)
        return *grads, None, None, None


class KernelSums(torch.autograd.Function):
    """Computes the sums of `reference_kernel` by compiled code. Gradients do not flow into `difference`."""

    @staticmethod
    def forward(ctx, weights, difference, window, dilation=1):
        weights, difference = weights.contiguous(), difference.contiguous()
        b, j, _, h, w = weights.shape
        ctx.shape, ctx.weights = (b * j, 0, h, w, window, dilation), weights.shape
        ctx.save_for_backward(difference)
        total, sums = torch.zeros_like(difference[:, :, 0]), torch.zeros_like(difference)
        call("kernel", ctx.shape, weights, difference, total, sums)
        return total, sums

    @staticmethod
    def backward(ctx, total_grad, sums_grad):
        (difference,) = ctx.saved_tensors
        grad = difference.new_zeros(ctx.weights)
        call("kernel_gradient", ctx.shape, difference, total_grad.contiguous(), sums_grad.contiguous(), grad)
        return grad, None, None, None
