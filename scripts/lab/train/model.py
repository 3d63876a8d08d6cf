"""The networks that choose the weights of equations (5) and (6) of [Choi and Moon 2021].

For each pixel and pair, `Compact` computes a point phi in a small feature space and three scalars, from which
combination.py computes the pairwise weights. `Paper` is the paper's kernel-predicting network: ten 5x5 convolutions of
50 filters, and a weight for every pixel of the window and pair.
"""

import torch
from torch import nn

from . import normalise
from .combination import Form
from .pairs import PAIRS

# The paper's window; the compact network takes 15, at 0.6 times the cost.
PAPER_WINDOW, WINDOW = 19, 15
FEATURES = 4
# Steps of the windows of the wide form: photon noise is alike within a bandwidth, which is 4 to 34 pixels in real
# pictures.
WIDE = (1, 4)
# Bound of the logarithms of explicit weights: keeps every sum of weights well inside float32.
LOG_WEIGHT_BOUND = 8.0


def conv(inputs, outputs, size=3, stride=1):
    return nn.Conv2d(inputs, outputs, size, stride, size // 2)


class Block(nn.Module):
    """Two 3x3 convolutions with ReLU."""

    def __init__(self, inputs, outputs):
        super().__init__()
        self.first, self.second = conv(inputs, outputs), conv(outputs, outputs)

    def forward(self, x):
        return torch.relu(self.second(torch.relu(self.first(x))))


class Compact(nn.Module):
    """A U-Net at full, half and quarter resolution with added skips; 0.07 MFLOP per pixel.

    Widths are multiples of 16, for which ONNX Runtime's convolutions are fast. For each dilation of the window, the
    output has phi of all pairs, then source, centre and log falloff; the logarithms of the identities' weights come
    last.
    """

    output = "features"
    stride = 4
    # Receptive radius 32 of the layers below (a test looks for seams), rounded up to the stride.
    halo = 32

    def __init__(self, pairs, inputs, form, widths=(16, 32, 64), last=32):
        super().__init__()
        self.form = form
        full, half, quarter = widths
        self.stem = conv(inputs, full)
        self.down1, self.enc1 = conv(full, half, stride=2), Block(half, half)
        self.down2, self.enc2, self.middle = (
            conv(half, quarter, stride=2),
            Block(quarter, quarter),
            Block(quarter, quarter),
        )
        # A 1x1 convolution commutes with nearest-neighbour enlargement, so it comes first.
        self.up1, self.dec1 = conv(quarter, half, 1), Block(half, half)
        self.up0, self.skip0, self.dec0 = conv(half, last, 1), conv(full, last, 1), conv(last, last)
        self.head = conv(last, form.channels(pairs), 1)
        # The initial filter is about a pixel wide: close to the best level, and wide enough for gradients.
        with torch.no_grad():
            self.head.bias.zero_()
            groups = self.head.bias[: self.head.out_channels - len(form.identities)].view(len(form.dilations), -1)
            groups[:, -pairs:] = -1.0

    def forward(self, x):
        full = torch.relu(self.stem(x))
        half = self.enc1(torch.relu(self.down1(full)))
        quarter = self.enc2(torch.relu(self.down2(half)))
        quarter = quarter + self.middle(quarter)
        half = self.dec1(torch.relu(half + up(self.up1(quarter))))
        full = torch.relu(self.skip0(full) + up(self.up0(half)))
        return self.head(torch.relu(self.dec0(full)))


class Paper(nn.Module):
    """[Choi and Moon 2021, 4.3]: ten convolutions, 2.4 M parameters, 4.7 MFLOP per pixel with the paper's window."""

    output = "weights"
    stride = 1
    halo = 20

    def __init__(self, pairs, inputs, form, filters=50, depth=10):
        super().__init__()
        self.form = form
        sizes = [inputs] + [filters] * (depth - 1)
        self.layers = nn.ModuleList(conv(a, b, 5) for a, b in zip(sizes, sizes[1:]))
        self.last = conv(filters, form.channels(pairs), 5)
        for layer in [*self.layers, self.last]:
            nn.init.xavier_uniform_(layer.weight)
            nn.init.zeros_(layer.bias)

    def forward(self, x):
        for layer in self.layers:
            x = torch.relu(layer(x))
        return torch.exp(LOG_WEIGHT_BOUND * torch.tanh(self.last(x) / LOG_WEIGHT_BOUND))


def up(x):
    return nn.functional.interpolate(x, scale_factor=2.0, mode="nearest")


def build(arch, pairs="multi", version=None, levels=5, window=None, wide=False):
    """A network for pairs of pictures and a version of the input, by default the least that has what the pairs need.

    The paper's form has one window. The wide form has a second one in steps of 4 pixels, and the pictures z alone.
    """
    known = PAIRS[pairs]
    version = version or known.version
    more = {"dilations": WIDE, "identities": known.identities} if wide else {}
    if arch == "paper":
        net = Paper(known.count, normalise.channels(levels, version), Form("weights", window or PAPER_WINDOW))
    else:
        form = Form("features", window or WINDOW, FEATURES, **more)
        net = Compact(known.count, normalise.channels(levels, version), form)
    net.levels, net.pairs, net.version, net.arch = levels, pairs, version, arch
    return net
