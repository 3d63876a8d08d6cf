"""Exponents of what falls with iterations."""

import math


def fit(series, key):
    """Exponent and its standard error, from 128 iterations on, by weighted least squares in the logarithms."""
    points = [(math.log(s["iterations"]), *s[key]) for s in series if s["iterations"] >= 128 and s[key][0] > 0]
    # The same bandwidths with every seed have no error: all points count alike.
    weights = [(value / max(error, 1e-3 * value)) ** 2 for _, value, error in points]
    total = sum(weights)
    mean_x = sum(w * x for w, (x, _, _) in zip(weights, points)) / total
    mean_y = sum(w * math.log(v) for w, (_, v, _) in zip(weights, points)) / total
    spread = sum(w * (x - mean_x) ** 2 for w, (x, _, _) in zip(weights, points))
    slope = sum(w * (x - mean_x) * (math.log(v) - mean_y) for w, (x, v, _) in zip(weights, points)) / spread
    return slope, spread**-0.5
