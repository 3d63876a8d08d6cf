"""Fits of convergence exponents."""

import math


def fit(series, key):
    """The exponent of the values `key` over iterations, and its standard error: weighted least squares of the logarithms,
    from 128 iterations on."""
    points = [(math.log(s["iterations"]), *s[key]) for s in series if s["iterations"] >= 128 and s[key][0] > 0]
    # A value without noise (equal bandwidths with every seed) gets a nominal error of 0.1 %.
    weights = [(value / max(error, 1e-3 * value)) ** 2 for _, value, error in points]
    total = sum(weights)
    mean_x = sum(w * x for w, (x, _, _) in zip(weights, points)) / total
    mean_y = sum(w * math.log(v) for w, (_, v, _) in zip(weights, points)) / total
    spread = sum(w * (x - mean_x) ** 2 for w, (x, _, _) in zip(weights, points))
    slope = sum(w * (x - mean_x) * (math.log(v) - mean_y) for w, (x, v, _) in zip(weights, points)) / spread
    return slope, spread**-0.5
