"""The network's input tensor; version 1 must agree with src/combine/tensor.rs.

A stack is a dict of float32 arrays, rows from the top, radiance in any unit:
  levels     [m, h, w, 3]  scene-linear radiance, smallest bandwidth first
  variances  [m, h, w, 3]  variance of the mean of each level; or deviations [m, h, w], their roots, averaged over RGB
  albedo [h, w, 3], normal [h, w, 3], depth [h, w]
and for later versions
  parts      [5, h, w, 3]  additive parts of the picture
  quarters   [4, h, w, 3]  the picture by each quarter of the iterations
  radius     [2, h, w]     largest bandwidths in pixels, of all photons and of those of caustics
  iterations               their number
  finished   [h, w, 3]     the denoised picture
  independent, correlated [k, h, w, 3], pair_deviations [2, h, w]   for the pairs of the deep combiner
A test compares version 1 with tensor.rs by the data of fixture.py.
"""

import numpy as np

VERSION = 1
# Standard deviations below this, in tone-mapped units, count as no noise.
DEVIATION_FLOOR = np.float32(1e-3)
# Larger depths are background (the EXR has 1e10 there).
BACKGROUND_DEPTH = np.float32(1e9)
LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)
# Groups of planes of each version, with the number of planes for m levels. 4 and 5 are for the deep combiner (Back et
# al. 2020), which reads one or four pairs of pictures instead of levels.
SURFACE = (("albedo", 3), ("normal", 3), ("depth", 1))
LEVELS = (("levels", "3m"), ("deviations", "m"), *SURFACE)
MORE = (("parts", 15), ("quarter_deviation", 1), ("bandwidth", 2), ("count", 1))
VERSIONS = {
    1: LEVELS,
    2: LEVELS + MORE,
    3: LEVELS + MORE + (("finished", 3),),
    4: (("independent", 3), ("correlated", 3), ("pair_deviations", 2), *SURFACE),
    5: (("independent", 12), ("correlated", 12), ("pair_deviations", 2), *SURFACE),
}


def channels(levels, version=VERSION):
    """The number of planes of a version of the input."""
    return sum({"3m": 3 * levels, "m": levels}.get(count, count) for _, count in VERSIONS[version])


def finite(x):
    return np.where(np.isfinite(x), x, np.float32(0))


def exposure(levels):
    """The reciprocal of a robust mean luminance of the smoothest level, which makes the input independent of light
    units.

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


def tensor(stack, scale=None, middle=None, version=VERSION):
    """The input, float32 of shape [channels, h, w]. For a crop, `scale` and `middle` are those of the whole image."""
    scale = exposure(stack["levels"]) if scale is None else np.float32(scale)
    middle = median_depth(stack["depth"]) if middle is None else middle
    planes = [PLANES[name](stack, scale, middle) for name, _ in VERSIONS[version]]
    return np.concatenate([plane.reshape(-1, *stack["depth"].shape) for plane in planes]).astype(np.float32)


def tone(name):
    """The planes of log(1 + x) of pictures [..., h, w, 3]."""

    def planes(stack, scale, middle):
        bright = np.maximum(finite(stack[name]).astype(np.float32), 0) * scale
        return np.moveaxis(np.log1p(bright), -1, -3)

    return planes


def noise(deviation, pictures, scale):
    """Planes of standard deviations of log(1 + x), which are those of x over 1 + x, on a logarithmic scale."""
    bright = np.maximum(finite(pictures).astype(np.float32), 0) * scale
    deviation = finite(deviation) * scale / (1 + bright.mean(axis=-1))
    floor = np.log(DEVIATION_FLOOR)
    return (np.log(deviation + DEVIATION_FLOOR) - floor) / -floor


def level_deviations(stack, scale, middle):
    deviations = stack.get("deviations")
    if deviations is None:
        deviations = np.sqrt(np.maximum(finite(stack["variances"]), 0).mean(axis=-1))
    return noise(deviations, stack["levels"], scale)


def quarter_deviation(stack, scale, middle):
    """The standard error of the picture by the scatter of its quarters."""
    quarters = finite(stack["quarters"])
    return noise(np.sqrt(quarters.var(0, ddof=1).mean(-1) / 4), quarters.mean(0), scale)


def depth_plane(stack, scale, middle):
    depth = stack["depth"]
    near = np.isfinite(depth) & (depth < BACKGROUND_DEPTH)
    depth = np.where(near, np.maximum(np.where(near, depth, 0), 0), 0)
    return np.where(near, depth / (depth + np.float32(middle)), 1)


def iteration_plane(stack, scale, middle):
    return np.full(stack["depth"].shape, np.log2(np.float32(stack["iterations"])) / 8)


def clamped(name, low, high):
    """Returns a function that makes input planes of the layer `name` of a stack, with values clamped to `low` and
    `high`."""
    return lambda stack, scale, middle: np.moveaxis(np.clip(finite(stack[name]), low, high), -1, 0)


PLANES = {
    "levels": tone("levels"),
    "deviations": level_deviations,
    "albedo": clamped("albedo", 0, 1),
    "normal": clamped("normal", -1, 1),
    "depth": depth_plane,
    "parts": tone("parts"),
    "quarter_deviation": quarter_deviation,
    "bandwidth": lambda stack, scale, middle: np.log2(np.clip(finite(stack["radius"]), 0.125, 256)) / 8,
    "count": iteration_plane,
    "finished": tone("finished"),
    "independent": tone("independent"),
    "correlated": tone("correlated"),
    "pair_deviations": lambda stack, scale, middle: noise(
        stack["pair_deviations"], np.stack([stack["independent"].mean(0), stack["correlated"].mean(0)]), scale
    ),
}
