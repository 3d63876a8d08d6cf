"""The limits within which the finish moves an estimate, and the correlation of its noise: NumPy twins of
src/finish/bound.rs and of `correlation` in src/finish/temporal.rs, with which a test compares them."""

import math

import numpy as np

# Standard errors of many samples that a pixel may move; the window's reach in pixels, and its percentile.
LIMIT, REACH, PERCENTILE = 3.0, 3, 0.8
# Largest ratio of standard error to estimate that rounding alone can produce.
ROUNDING = 8 * np.finfo(np.float32).eps
# Reaches of the windows of the correlation, and its value for independent noise.
MEAN_REACH, AVERAGE_REACH, INDEPENDENT = 1, 3, 1 / 9
# Contrasts of the quarters of the iterations, which have the noise of the estimate and no light.
CONTRASTS = ((1, 1, -1, -1), (1, -1, 1, -1), (1, -1, -1, 1))


def limit(samples):
    """Largest displacement, in standard errors that are estimated from a number of samples: the quantile of Student's
    distribution that excludes as much as LIMIT standard deviations of a normal one."""
    freedom = samples - 1
    if freedom < 1:
        return math.inf
    # The substitution t = sqrt(n) tan(a) turns the density into a power of the cosine.
    angles = np.linspace(0, math.pi / 2, 200_001)
    density = np.cos(angles) ** (freedom - 1)
    sums = np.concatenate([[0], np.cumsum((density[1:] + density[:-1]) / 2)])
    angle = np.interp(math.erf(LIMIT / math.sqrt(2)), sums / sums[-1], angles)
    return float(math.sqrt(freedom) * math.tan(angle))


def windows(plane, reach, outside):
    """The values [(2 reach + 1)^2, h, w] of a plane in the window of each pixel, `outside` beyond the border."""
    height, width = plane.shape
    padded = np.pad(plane, reach, constant_values=outside)
    steps = range(2 * reach + 1)
    return np.stack([padded[y : y + height, x : x + width] for y in steps for x in steps])


def window_means(planes, reach):
    """Means of planes [..., h, w] over windows, which the border cuts off."""

    def sums(x, axis):
        border = [(0, 0)] * (x.ndim + axis) + [(reach + 1, reach)] + [(0, 0)] * (-1 - axis)
        total = np.cumsum(np.pad(x, border), axis)
        size = x.shape[axis]
        high, low = (np.take(total, np.arange(size) + step, axis) for step in (2 * reach + 1, 0))
        return high - low

    total = lambda x: sums(sums(np.asarray(x, np.float64), -1), -2)
    return total(planes) / total(np.ones(np.shape(planes)[-2:]))


def spread(mean, deviation, samples, alpha=None):
    """The spread [h, w, 3] of an estimate: the larger of a pixel's standard error and a high percentile of its
    neighbours', of which those count that are not above the pixel by more than the limit of their errors, nor below it
    if all samples of the pixel are equal."""
    known = np.where(np.isfinite(deviation), np.maximum(deviation, 0), np.inf).astype(np.float32)
    brightest = np.maximum(mean.max(-1), 0)
    certain = (known <= ROUNDING * brightest[..., None]).all(-1)
    uncovered = np.zeros(certain.shape, bool) if alpha is None else alpha == 0
    black = certain & (brightest == 0) & uncovered
    exact = certain & (brightest > 0) | black
    # A medium shows light where alpha is 0.
    empty = black & ~(window_means(uncovered & (mean != 0).any(-1), REACH) > 0)
    most, found = limit(samples), []
    for c in range(3):
        error, value = known[..., c], mean[..., c]
        errors, values = windows(error, REACH, np.nan), windows(value, REACH, np.nan)
        with np.errstate(invalid="ignore"):
            apart = np.where(exact, np.abs(values - value), values - value)
            errors = np.where(apart > most * errors, 0, errors)
        ranked = np.sort(errors, 0)
        rank = (PERCENTILE * ((~np.isnan(ranked)).sum(0) - 1) + 0.5).astype(int)
        found.append(np.maximum(np.where(exact, 0, error), np.take_along_axis(ranked, rank[None], 0)[0]))
    return np.where(empty[..., None], 0, np.stack(found, -1))


def correlation(quarters):
    """Variance of the mean over 3 x 3 pixels relative to that of one pixel, averaged over 7 x 7 pixels, from the
    pictures [4, h, w, 3] by quarters of the iterations; independent noise where one is missing or black."""
    if not all(quarter.any() for quarter in quarters):
        return np.full(quarters.shape[1:3], INDEPENDENT, np.float32)
    contrasts = np.moveaxis(np.tensordot(np.array(CONTRASTS, np.float32), quarters, 1), -1, 1)
    contrasts = np.where(np.isfinite(contrasts), contrasts, 0)
    squares = [np.square(x).mean(1).sum(0) for x in (window_means(contrasts, MEAN_REACH), contrasts)]
    of_mean, of_pixel = window_means(np.stack(squares), AVERAGE_REACH)
    share = np.clip(of_mean / np.maximum(of_pixel, np.finfo(np.float32).tiny), INDEPENDENT, 1)
    return np.where(of_pixel > 0, share, 1).astype(np.float32)
