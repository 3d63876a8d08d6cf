"""Equation (6) of [Choi and Moon 2021], differentiable; the twin of src/combine/{affinity,kernel}.rs.

  y_c = 1/W sum_j sum_{i in window} w_i^j (y_i + z_c^j - z_i^j),   y = level 1, z^j = level j + 1
"""

import torch
from torch.nn.functional import pad
from torch.utils.checkpoint import checkpoint

# Largest exponent of an affinity: keeps every weight positive in float32.
MAX_DISTANCE = 60.0


def combine(output, levels, kind, window, features=0):
    """`output` of the network [b, c, h, w], `levels` [b, m, 3, h, w] -> [b, 3, h, w]."""
    pairs = levels.shape[1] - 1
    difference = levels[:, :1] - levels[:, 1:]
    rows = feature_rows if kind == "features" else weight_rows
    split = split_features(output, pairs, features) if kind == "features" else (output,)
    total = sums = 0
    for dy in range(window):
        # A row of the window at a time, recomputed in the backward pass: 1444 weights a pixel do not fit otherwise.
        w, s = checkpoint(rows, dy, window, difference, *split, use_reentrant=False)
        total, sums = total + w, sums + s
    if kind == "features":
        centre = split[2].exp()
        total, sums = total * centre, sums * centre.unsqueeze(2)
    # sums: weighted y_i - z_i; the centre's z joins them with the pair's whole weight.
    value = (sums + levels[:, 1:] * total.unsqueeze(2)).sum(1)
    return value / total.sum(1, keepdim=True)


def split_features(output, pairs, features):
    b, _, h, w = output.shape
    x = output.reshape(b, pairs, features + 3, h, w)
    return x[:, :, :features], x[:, :, features], x[:, :, features + 1], x[:, :, features + 2]


def shifted(x, dy, dx, r):
    """x at i = c + (dx - r, dy - r); the caller has padded x by r on the last two axes."""
    h, w = x.shape[-2] - 2 * r, x.shape[-1] - 2 * r
    return x[..., dy : dy + h, dx : dx + w]


def feature_rows(dy, window, difference, phi, source, centre, falloff):
    r = window // 2
    # Outside the image a source has no weight at all: windows are clipped.
    weight, phi_i, d_i = pad(source.exp(), [r] * 4), pad(phi, [r] * 4), pad(difference, [r] * 4)
    total = sums = 0
    for dx in range(window):
        squared = (phi - shifted(phi_i, dy, dx, r)).square().sum(2)
        squared = squared + falloff * float((dx - r) ** 2 + (dy - r) ** 2)
        w = shifted(weight, dy, dx, r) * torch.exp(-squared.clamp(max=MAX_DISTANCE))
        total, sums = total + w, sums + w.unsqueeze(2) * shifted(d_i, dy, dx, r)
    return total, sums


def weight_rows(dy, window, difference, weights):
    r = window // 2
    b, pairs, _, h, w = difference.shape
    inside = pad(difference.new_ones(1, 1, h, w), [r] * 4)
    d_i = pad(difference, [r] * 4)
    weights = weights.reshape(b, pairs, window, window, h, w)
    total = sums = 0
    for dx in range(window):
        wi = weights[:, :, dy, dx] * shifted(inside, dy, dx, r)
        total, sums = total + wi, sums + wi.unsqueeze(2) * shifted(d_i, dy, dx, r)
    return total, sums
