"""Equation (6) of [Choi and Moon 2021], differentiable; it must agree with src/combine/{affinity,kernel}.rs.

y_c = 1/W sum_j sum_{i in window} w_i^j (y_i + z_c^j - z_i^j),   y = level 1, z^j = level j + 1
"""

import torch
from torch.nn.functional import pad
from torch.utils.checkpoint import checkpoint

# Largest exponent of an affinity, and bounds of the logarithms: they keep every weight positive in float32.
MAX_DISTANCE = 60.0
MAX_LOG_WEIGHT = 12.0
# The falloff is at most 1: with a larger one only the centre would count, and the gradient would vanish.
LOG_FALLOFF = (-20.0, 0.0)


def combine(output, levels, kind, window, features=0):
    """`output` of the network [b, c, h, w], `levels` [b, m, 3, h, w] -> [b, 3, h, w]."""
    pairs = levels.shape[1] - 1
    difference = levels[:, :1] - levels[:, 1:]
    if kind == "features":
        phi, source, falloff, centre = split_features(output, pairs, features)
        total, sums = AffinitySums.apply(phi, source, falloff, difference, window)
        total, sums = total * centre, sums * centre.unsqueeze(2)
    else:
        total = sums = 0
        for dy in range(window):
            # Rows of the window are recomputed in the backward pass, because 1444 weights per pixel do not fit in memory.
            w, s = checkpoint(
                weight_rows, dy, window, difference, output, use_reentrant=False, preserve_rng_state=False
            )
            total, sums = total + w, sums + s
    # The sums contain the weighted y_i - z_i; z_c is added with the total weight of its pair.
    value = (sums + levels[:, 1:] * total.unsqueeze(2)).sum(1)
    return value / total.sum(1, keepdim=True)


def split_features(output, pairs, features):
    """phi, exp(source), falloff and exp(centre) of w_i^j = exp(source_i + centre_c - falloff_c |c - i|^2 - |phi_c - phi_i|^2)."""
    b, _, h, w = output.shape
    phi, scalars = output[:, : pairs * features], output[:, pairs * features :]
    source, centre, falloff = scalars.chunk(3, 1)
    source, centre = (x.clamp(-MAX_LOG_WEIGHT, MAX_LOG_WEIGHT).exp() for x in (source, centre))
    return phi.reshape(b, pairs, features, h, w), source, falloff.clamp(*LOG_FALLOFF).exp(), centre


def shifted(x, dy, dx, r):
    """x at i = c + (dx - r, dy - r), where x is padded by r on the last two axes."""
    h, w = x.shape[-2] - 2 * r, x.shape[-1] - 2 * r
    return x[..., dy : dy + h, dx : dx + w]


class AffinitySums(torch.autograd.Function):
    """Sums over the window of w_i and of w_i d_i, w_i = weight_i exp(-falloff_c |c - i|^2 - |phi_c - phi_i|^2).

    Shapes: phi [b, j, f, h, w]; weight, falloff [b, j, h, w]; difference d [b, j, 3, h, w], which is not
    differentiated. The derivatives are explicit and recompute the weights: automatic differentiation would keep 1444
    weights per pixel, and is several times slower.
    """

    @staticmethod
    def forward(ctx, phi, weight, falloff, difference, window):
        ctx.save_for_backward(phi, weight, falloff, difference)
        ctx.window = window
        r = window // 2
        # Sources outside the image have no weight, so windows are clipped.
        phi_p, weight_p, d_p = (pad(x, [r] * 4) for x in (phi, weight, difference))
        total, sums = torch.zeros_like(weight), torch.zeros_like(difference)
        for dy, dx in offsets(window):
            w = affinity(phi, phi_p, falloff, dy, dx, r)[0].mul_(shifted(weight_p, dy, dx, r))
            total += w
            sums.addcmul_(w.unsqueeze(2), shifted(d_p, dy, dx, r))
        return total, sums

    @staticmethod
    def backward(ctx, total_grad, sums_grad):
        phi, weight, falloff, difference = ctx.saved_tensors
        r = ctx.window // 2
        phi_p, weight_p, d_p = (pad(x, [r] * 4) for x in (phi, weight, difference))
        phi_grad, falloff_grad = torch.zeros_like(phi), torch.zeros_like(falloff)
        phi_p_grad, weight_p_grad = torch.zeros_like(phi_p), torch.zeros_like(weight_p)
        for dy, dx in offsets(ctx.window):
            a, step, cut = affinity(phi, phi_p, falloff, dy, dx, r)
            w_grad = (sums_grad * shifted(d_p, dy, dx, r)).sum(2).add_(total_grad)
            a_grad = w_grad.mul_(a)  # The gradient of the source's weight; times that weight, of minus the distance.
            shifted(weight_p_grad, dy, dx, r).add_(a_grad)
            minus = (a_grad * shifted(weight_p, dy, dx, r)).masked_fill_(cut, 0)
            falloff_grad.sub_(minus, alpha=squared_length(dy, dx, r))
            step.mul_(minus.unsqueeze(2))
            phi_grad.sub_(step, alpha=2)
            shifted(phi_p_grad, dy, dx, r).add_(step, alpha=2)
        inner = (..., slice(r, r + phi.shape[-2]), slice(r, r + phi.shape[-1]))
        return phi_grad + phi_p_grad[inner], weight_p_grad[inner], falloff_grad, None, None


def offsets(window):
    return [(dy, dx) for dy in range(window) for dx in range(window)]


def squared_length(dy, dx, r):
    return float((dx - r) ** 2 + (dy - r) ** 2)


def affinity(phi, phi_p, falloff, dy, dx, r):
    """exp(-distance), phi_c - phi_i, and a mask of distances that are clamped to the maximum."""
    step = phi - shifted(phi_p, dy, dx, r)
    distance = step.square().sum(2).add_(falloff, alpha=squared_length(dy, dx, r))
    cut = distance > MAX_DISTANCE
    return distance.clamp_(max=MAX_DISTANCE).neg_().exp_(), step, cut


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
