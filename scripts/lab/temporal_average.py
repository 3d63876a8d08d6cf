"""A prototype of a temporal finish: averages the estimates of neighbouring frames before they are denoised.

A neighbour's weight is 1 / (v + b^2), with the variance v of its estimate and an estimate b^2 of the squared
difference of the two true values, from 3 x 3 pixels. With exact b and n neighbours that all differ by b from a pixel of
variance v, the bias is at most n / (2 sqrt(n + 1)) standard errors: 0.9 for four neighbours. It vanishes with the
noise, because weights fall with v / b^2.
"""

from dataclasses import dataclass

import numpy as np

# Frames before and after a frame that count, and the radii in pixels of the windows that estimate variance and bias.
REACH, VARIANCE_RADIUS, BIAS_RADIUS = 2, 3, 1
LEVELS = range(1, 6)
MIN_VARIANCE = 1e-12


@dataclass
class Estimate:
    """The estimate of a frame, and the variance of the mean, smoothed: weights by the variance of the pixel itself
    would favour pixels that have missed bright samples."""

    picture: np.ndarray
    variance: np.ndarray

    @classmethod
    def of(cls, picture, variance):
        return cls(picture.astype(float), window_mean(variance.astype(float), VARIANCE_RADIUS) + MIN_VARIANCE)

    @classmethod
    def read(cls, layers):
        """The layer Noisy, with the variance of the level that it shows."""
        noisy = layers.get("Noisy")
        levels = {level: layers.get(f"Level{level}") for level in LEVELS}
        distances = {level: np.nanmax(np.abs(one - noisy)) for level, one in levels.items() if one is not None}
        level = min(distances, key=distances.get) if distances else 1
        return cls.of(noisy, layers.get(f"Variance{level}"))


def window_mean(values, radius):
    """Means over squares of 2 radius + 1 pixels; pixels beyond the edge mirror those inside."""
    padding = [(radius, radius)] * 2 + [(0, 0)] * (values.ndim - 2)
    sums = np.pad(np.pad(values, padding, mode="reflect").cumsum(0).cumsum(1), [(1, 0)] * 2 + padding[2:])
    side = 2 * radius + 1
    return (sums[side:, side:] - sums[:-side, side:] - sums[side:, :-side] + sums[:-side, :-side]) / side**2


def squared_bias(difference, variance, seen):
    """An estimate of the squared difference of the true values of two frames, from the difference of their estimates
    and its variance: the square of the mean beyond its noise, and the mean of the squares beyond theirs. The largest of
    the channels counts."""
    share = np.maximum(window_mean(seen.astype(float), BIAS_RADIUS), 1e-12)[..., None]
    mean, square, noise = (
        window_mean(np.where(seen[..., None], values, 0.0), BIAS_RADIUS) / share
        for values in (difference, np.square(difference), variance)
    )
    pixels = share * (2 * BIAS_RADIUS + 1) ** 2
    bias = np.maximum(np.square(mean) - noise / pixels, 0) + np.maximum(square - noise, 0)
    return bias.max(-1, keepdims=True)


def average(estimates, frame, match):
    """The weighted mean of a frame's estimate and its neighbours', and its variance. `match(frame, other)` returns
    temporal.counterparts."""
    own = estimates[frame]
    total, weights = own.picture / own.variance, 1 / own.variance
    used = 1 / own.variance
    for other in range(max(frame - REACH, 0), min(frame + REACH + 1, len(estimates))):
        if other == frame:
            continue
        rows, columns, seen = match(frame, other)
        picture, variance = (values[rows, columns] for values in (estimates[other].picture, estimates[other].variance))
        seen = seen & np.isfinite(picture).all(-1) & np.isfinite(own.picture).all(-1)
        difference = np.where(seen[..., None], picture - own.picture, 0.0)
        bias = squared_bias(difference, own.variance + variance, seen)
        weight = np.where(seen[..., None], 1 / (variance + bias), 0.0)
        total, weights = total + np.where(seen[..., None], weight * picture, 0.0), weights + weight
        used = used + weight**2 * variance
    return total / weights, used / weights**2
