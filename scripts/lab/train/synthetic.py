"""Synthetic stacks of levels: photons in the image plane, without a renderer.

A caustic is the density of photons refracted by a wavy surface: points of a plane, displaced by the slope of a random
height field and counted per pixel. A picture is albedo x (caustic + smooth light) over a few flat regions. Its levels
imitate progressive photon mapping: Poisson counts of photons, averaged over discs whose radii differ by sqrt(2). The
noise of the camera paths is drawn once for level 1 and once for all other levels. Occlusion, kernels cut off at edges
and glossy transport are missing, so such data can only start a training.
"""

import argparse
import pathlib

import numpy as np
import torch
from torch.nn.functional import conv2d, interpolate, pad

from . import crops

BATCHES = 8


def smooth_noise(rng, size, cells):
    """Smooth noise [size, size] of about unit standard deviation, which varies over size / cells pixels."""
    coarse = torch.from_numpy(rng.standard_normal((1, 1, cells + 3, cells + 3)).astype(np.float32))
    return interpolate(coarse, (size, size), mode="bicubic", align_corners=True)[0, 0].numpy()


def caustic(rng, size, per_pixel=256):
    """The irradiance [size, size] of a plane lit through a wavy surface; its mean is about 1."""
    height = sum(smooth_noise(rng, size, int(c)) * w for c, w in zip(rng.integers(3, 14, 2), (1.0, 0.4)))
    slope_y, slope_x = np.gradient(height)
    strength = rng.uniform(5, 60)
    side = int(np.sqrt(per_pixel))
    rows = (np.arange(size * side) + 0.5) / side
    total = np.zeros(size * size)
    for row in rows:
        x = rows + rng.uniform(-0.5, 0.5, rows.size) / side
        y = row + rng.uniform(-0.5, 0.5, rows.size) / side
        iy, ix = np.clip(y, 0, size - 1).astype(int), np.clip(x, 0, size - 1).astype(int)
        u = np.mod(x + strength * slope_x[iy, ix], size).astype(int)
        v = np.mod(y + strength * slope_y[iy, ix], size).astype(int)
        total += np.bincount(np.minimum(v, size - 1) * size + np.minimum(u, size - 1), minlength=size * size)
    return (total / per_pixel).reshape(size, size).astype(np.float32)


def regions(rng, size):
    """The labels [size, size] of a few cells with straight edges, and their number."""
    centres = rng.uniform(0, size, (rng.integers(1, 8), 2))
    y, x = np.mgrid[:size, :size]
    return np.argmin([(x - cx) ** 2 + (y - cy) ** 2 for cx, cy in centres], axis=0), len(centres)


def disc(radius):
    r = int(np.ceil(radius))
    # The coverage of each pixel by the disc, from 5x5 points.
    p = (np.arange((2 * r + 1) * 5) + 0.5) / 5 - 0.5 - r
    inside = (p[:, None] ** 2 + p[None] ** 2 < radius**2).astype(np.float32)
    kernel = inside.reshape(2 * r + 1, 5, 2 * r + 1, 5).mean((1, 3))
    return kernel / kernel.sum()


def blur(images, radius):
    kernel = torch.from_numpy(disc(radius))[None, None]
    r = kernel.shape[-1] // 2
    x = pad(torch.from_numpy(images.astype(np.float32))[:, None], [r] * 4, mode="reflect")
    return conv2d(x, kernel)[:, 0].numpy()


def stack(seed, size=128, levels=5):
    """A stack (see normalise.py) with its `reference` [h, w, 3]."""
    rng = np.random.default_rng(seed)
    label, count = regions(rng, size)
    pick = lambda low, high, *shape: rng.uniform(low, high, (count, *shape)).astype(np.float32)[label]
    albedo = pick(0.05, 0.95, 3) * (1 + 0.3 * smooth_noise(rng, size, rng.integers(4, 40)))[..., None].clip(-0.9, 0.9)
    albedo = albedo.clip(0.01, 1).astype(np.float32)
    normal = pick(-1, 1, 3)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True) + 1e-6
    depth = pick(1, 10) * np.linspace(1, rng.uniform(1, 2), size, dtype=np.float32)[:, None]
    photons = caustic(rng, size) * rng.uniform(0.2, 3) + np.exp(0.5 * smooth_noise(rng, size, 3)) * rng.uniform(0.05, 1)
    photons *= 1 / (1 + np.exp(-smooth_noise(rng, size, 4) * rng.uniform(1, 20)))  # soft and hard shadows
    tint = rng.uniform(0.4, 1, 3).astype(np.float32)
    gloss = np.where(pick(0, 1) < 0.4, pick(0, 0.8), 0).astype(np.float32)
    exposure = np.float32(10 ** rng.uniform(-3, 3))
    reference = albedo * photons[..., None] * tint * exposure

    density = 10 ** rng.uniform(-2.2, 0.8)  # photons per pixel and batch at irradiance 1
    largest = rng.uniform(1.5, 9)
    counts = [rng.poisson(np.maximum(photons, 0) * density) / density for _ in range(BATCHES)]
    eye = [1 + gloss * rng.standard_normal((2, size, size)).clip(-1, 3).astype(np.float32) for _ in range(BATCHES)]
    means, variances = [], []
    for j in range(levels):
        blurred = blur(np.stack(counts), largest * 2 ** (-(levels - 1 - j) / 2))
        batch = np.stack([b * e[min(j, 1)] for b, e in zip(blurred, eye)])
        scale = albedo * tint * exposure
        means.append(batch.mean(0)[..., None] * scale)
        variances.append((batch.var(0, ddof=1) / BATCHES)[..., None] * scale**2)
    return {
        "levels": np.stack(means).astype(np.float32),
        "variances": np.stack(variances).astype(np.float32),
        "albedo": albedo,
        "normal": normal.astype(np.float32),
        "depth": depth.astype(np.float32),
        "reference": reference.astype(np.float32),
    }


def main():
    """Write stacks for train.py, every tenth of them for validation: python -m lab.train.synthetic -o DIR --count 200."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("-o", "--output", required=True)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--size", type=int, default=128)
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    pathlib.Path(args.output).mkdir(parents=True, exist_ok=True)
    for k in range(args.count):
        seed = args.seed * 100_000 + k
        crops.save(pathlib.Path(args.output) / f"synthetic{seed}--{min(k % 10, 1)}.npz", stack(seed, args.size))


if __name__ == "__main__":
    main()
