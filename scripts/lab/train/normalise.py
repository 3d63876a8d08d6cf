"""The network's input tensor, version 1; it must agree with src/combine/tensor.rs.

A stack is a dict of float32 arrays, rows from the top:
  levels     [m, h, w, 3]  scene-linear radiance, smallest bandwidth first
  variances  [m, h, w, 3]  variance of the mean of each level
  albedo [h, w, 3], normal [h, w, 3], depth [h, w]
A test compares both files by the data of fixture.py.
"""

import numpy as np

VERSION = 1
CHANNELS_WITHOUT_LEVELS = 7
# Standard deviations below this, in tone-mapped units, count as no noise.
DEVIATION_FLOOR = np.float32(1e-3)
# Larger depths are background (the EXR has 1e10 there).
BACKGROUND_DEPTH = np.float32(1e9)
LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)


def channels(levels):
    return 4 * levels + CHANNELS_WITHOUT_LEVELS


def finite(x):
    return np.where(np.isfinite(x), x, np.float32(0))


def exposure(levels):
    """The reciprocal of a robust mean luminance of the smoothest level, which makes the input independent of light units.

    The mean leaves out black pixels, so that the amount of background does not matter, and the brightest hundredth,
    which may be fireflies.
    """
    luminance = finite(levels[-1]).astype(np.float32) @ LUMINANCE
    lit = np.sort(luminance[(luminance > 0) & np.isfinite(luminance)], axis=None)
    kept = lit[: max(1, lit.size - lit.size // 100)]
    mean = float(kept.astype(np.float64).mean()) if kept.size else 0.0
    return np.float32(1.0 / mean) if mean > 1e-30 else np.float32(1)


def median_depth(depth):
    ok = np.sort(depth[np.isfinite(depth) & (depth > 0) & (depth < BACKGROUND_DEPTH)], axis=None)
    return float(ok[ok.size // 2]) if ok.size else 1.0


def tensor(stack, scale=None, middle=None):
    """The input, float32 of shape [4 m + 7, h, w]. For a crop, `scale` and `middle` are those of the whole image."""
    levels = finite(stack["levels"]).astype(np.float32)
    scale = exposure(stack["levels"]) if scale is None else np.float32(scale)
    middle = median_depth(stack["depth"]) if middle is None else middle
    bright = np.maximum(levels, 0) * scale
    # The standard deviation of log(1 + x) is the one of x over 1 + x; it is mapped to a logarithmic scale.
    variance = np.maximum(finite(stack["variances"]), 0).mean(axis=-1)
    deviation = np.sqrt(variance) * scale / (1 + bright.mean(axis=-1))
    floor = np.log(DEVIATION_FLOOR)
    deviation = (np.log(deviation + DEVIATION_FLOOR) - floor) / -floor
    depth = stack["depth"]
    near = np.isfinite(depth) & (depth < BACKGROUND_DEPTH)
    depth = np.where(near, np.maximum(np.where(near, depth, 0), 0), 0)
    depth = np.where(near, depth / (depth + np.float32(middle)), 1)
    planes = [
        np.log1p(bright).transpose(0, 3, 1, 2).reshape(-1, *depth.shape),
        deviation,
        np.clip(finite(stack["albedo"]), 0, 1).transpose(2, 0, 1),
        np.clip(finite(stack["normal"]), -1, 1).transpose(2, 0, 1),
        depth[None],
    ]
    return np.concatenate(planes).astype(np.float32)
