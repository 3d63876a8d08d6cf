"""The network of the finish: for each pixel, weights that sum to one over the estimate, its denoised pictures, and means
of them over windows. Weights are linear in the last features, and all but that of the denoised picture start near 0:
positive weights, such as exponentials, lose at once what is noisier on average, and then have no gradient to return.

The terms are the estimate, the estimate denoised without its parts, the means of the denoised picture over 3 x 3 and
9 x 9 pixels, which smooth blots, and the denoised picture times the ratio of such means of the estimate and of the
denoised picture, as far as it is significant, which returns light that the denoiser has moved. A rare bright sample
says little about its pixel, so the terms limit the estimate to a multiple of the denoised picture. src/finish then
limits the displacement from the estimate, so the result converges with it for any weights.
"""

import math
from typing import NamedTuple

import torch
from torch import nn

from .finish_views import PLANES
from .model import conv, up

# Sides and steps of the windows of means, each over the means of the one before: 3 x 3 and 9 x 9 pixels.
MEANS = ((3, 1), (3, 3))
# Added to means before their ratio is taken, as a share of the mean of the picture, and bounds of the ratio.
RATIO_FLOOR, RATIOS = 0.01, (0.2, 5.0)
LEAST_VARIANCE = 1e-8
# A ratio counts by 1 - k / t^2, with t its difference from 1 in standard errors, and this k.
NOISE = 4.0
# Standard errors below this share of 1 + the estimate count as none.
DEVIATION_FLOOR = 1e-3
# Whether training computes convolutions with bfloat16: in two thirds of the time where processors have instructions for it.
BFLOAT16 = torch.cpu.get_capabilities().get("avx512_bf16", False)
# Factor of the denoised picture, and share of the mean of the picture, that limit the estimate.
BRIGHTEST = (3.0, 0.1)


def split(x):
    """The groups of input planes by name."""
    return dict(zip(PLANES, torch.split(x, list(PLANES.values()), 1)))


class Window(NamedTuple):
    """Means of the denoised picture over a window, the significant ratio to them of means of the estimate, and the
    difference of both [b, 1, h, w] in standard errors."""

    smooth: torch.Tensor
    ratio: torch.Tensor
    significance: torch.Tensor


def windows(groups, mean):
    """The windows of MEANS around all pixels; `mean` is the limited estimate."""
    denoised = groups["denoised"]
    deviation = torch.minimum(groups["deviation"], limited(denoised.mean(1, keepdim=True)))
    # Light paths that neighbours share make their noise alike: the mean of 3 x 3 pixels has more than a ninth.
    variance = deviation.square() * (9 * groups["correlation"]).clamp(min=1)
    means, pixels = torch.cat([denoised, mean - denoised, variance], 1), 1
    for side, step in MEANS:
        means, pixels = window_mean(means, side, step), pixels * side**2
        smooth, difference, variance = means.split([3, 3, 1], 1)
        significance = difference.mean(1, keepdim=True).abs() / torch.sqrt(variance / pixels + LEAST_VARIANCE)
        share = (1 - NOISE / (significance.square() + LEAST_VARIANCE)).clamp(min=0)
        ratio = (1 + share * difference / (smooth + RATIO_FLOOR)).clamp(*RATIOS)
        yield Window(smooth, ratio, significance)


def limited(denoised):
    """The most that a pixel of the estimate counts."""
    return BRIGHTEST[0] * denoised + BRIGHTEST[1]


def normalised(groups, found):
    """The planes that the convolutions read: radiance and errors on logarithmic scales, and those of the windows."""
    tone = lambda x: torch.log(1 + x)
    floor = math.log(DEVIATION_FLOOR)
    scale = 1 + groups["mean"].mean(1, keepdim=True)
    noise = lambda x: (torch.log(x / scale + DEVIATION_FLOOR) - floor) / -floor
    planes = [tone(groups[name]) for name in ("mean", "denoised", "whole", "effects")]
    planes += [noise(groups["deviation"]), noise(groups["reach"])]
    planes += [groups["albedo"], groups["normal"], groups["depth"] / (groups["depth"] + 1)]
    for window in found:
        planes += [torch.log(window.ratio.mean(1, keepdim=True)), tone(window.significance)]
    return torch.cat([*planes, groups["correlation"], groups["iterations"] / 8], 1)


def terms(mean, groups, found):
    """The pictures [b, 3, h, w] that the weights combine with the denoised picture, one after the other."""
    denoised = groups["denoised"]
    yield mean
    yield groups["whole"]
    for window in found:
        yield window.smooth
        yield denoised * window.ratio


def window_mean(x, side, step):
    """The means of seven planes over side x side pixels in steps of `step`; beyond the border, its pixels repeat."""
    # The exporter needs a constant number of channels.
    channels, reach = 7, side // 2 * step
    kernel = torch.full((channels, 1, side, side), 1 / side**2, device=x.device)
    padded = nn.functional.pad(x, [reach] * 4, mode="replicate")
    return nn.functional.conv2d(padded, kernel, dilation=step, groups=channels)


TERMS = 2 + 2 * len(MEANS)
INPUTS = sum(PLANES.values()) + 2 * len(MEANS)


class FinishNet(nn.Module):
    """A U-Net at half and quarter resolution; 0.03 MFLOP per pixel. Its output is the combined picture."""

    output = "picture"
    stride = 4
    # Receptive radius of the layers below (a test looks for seams), rounded up to the stride.
    halo = 32

    def __init__(self, half=24, quarter=48):
        super().__init__()
        self.half, self.quarter = half, quarter
        self.stem, self.enc0 = conv(4 * INPUTS, half), conv(half, half)
        self.down = conv(half, quarter, stride=2)
        self.middle = nn.ModuleList(conv(quarter, quarter) for _ in range(4))
        # A 1x1 convolution commutes with nearest-neighbour enlargement, so it comes first.
        self.up, self.dec0 = conv(quarter, half, 1), conv(half, half)
        self.head = conv(half, 4 * TERMS, 1)
        with torch.no_grad():
            self.head.weight.mul_(0.01)
            self.head.bias.zero_()

    def weights(self, groups, found):
        """The weights of all terms [b, TERMS, h, w]; the denoised picture has the rest of one."""
        planes = nn.functional.pixel_unshuffle(normalised(groups, found), 2)
        with torch.autocast(planes.device.type, torch.bfloat16, enabled=self.training and BFLOAT16):
            half = torch.relu(self.enc0(torch.relu(self.stem(planes))))
            x = torch.relu(self.down(half))
            for first, second in zip(self.middle[::2], self.middle[1::2]):
                x = torch.relu(x + second(torch.relu(first(x))))
            x = self.head(torch.relu(self.dec0(torch.relu(half + up(self.up(x))))))
        return nn.functional.pixel_shuffle(x.float(), 2)

    def forward(self, x):
        groups = split(x)
        mean = torch.minimum(groups["mean"], limited(groups["denoised"]))
        found = list(windows(groups, mean))
        weights, denoised = self.weights(groups, found), groups["denoised"]
        out = denoised
        for k, term in enumerate(terms(mean, groups, found)):
            out = out + weights[:, k : k + 1] * (term - denoised)
        return out.clamp(min=0)


def bounded(groups, picture):
    """The estimate after its displacement towards a picture, within its limit; never negative."""
    mean, reach = groups["mean"], groups["reach"]
    return (mean + (picture - mean).clamp(-reach, reach)).clamp(min=0)
