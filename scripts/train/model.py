"""The networks that choose the weights of [Choi and Moon 2021, equation (6)].

`Compact` gives per pixel and level pair a point phi in a small feature space, the logarithms of a weight as a source
and as a level at the centre, and how fast weights fall with distance; equation (6) makes the pairwise weights
  w_i^j = exp(source_i^j + centre_c^j - falloff_c^j |c - i|^2 - |phi_c^j - phi_i^j|^2)
from them. `Paper` is the paper's own kernel-predicting network: ten 5x5 convolutions of 50 filters and a weight for
every pixel of the window and level pair.
"""

import torch
from torch import nn

import normalise

WINDOW = 19
FEATURES = 4
# Bounds of the logarithmic weights: they keep every weight and every sum of weights well inside float32.
LOG_WEIGHT_BOUND = 8.0
FEATURE_BOUND = 30.0


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
    """A U-Net at full, half and quarter resolution; about 0.16 MFLOP a pixel."""

    kind, output = "features", "features"
    stride = 4
    # Receptive radius 33 of the layers below (a test perturbs pixels beyond the halo), rounded up to the stride.
    halo = 36

    def __init__(self, levels=5, window=WINDOW, features=FEATURES, widths=(24, 48, 80)):
        super().__init__()
        self.levels, self.window, self.features = levels, window, features
        full, half, quarter = widths
        self.stem = conv(normalise.channels(levels), full)
        self.down1, self.enc1 = conv(full, half, stride=2), Block(half, half)
        self.down2, self.enc2 = conv(half, quarter, stride=2), Block(quarter, quarter)
        self.middle = Block(quarter, quarter)
        self.dec1, self.dec0 = Block(quarter + half, half), Block(half + full, 32)
        self.head = nn.Conv2d(32, (levels - 1) * (features + 3), 1)

    def forward(self, x):
        full = torch.relu(self.stem(x))
        half = self.enc1(torch.relu(self.down1(full)))
        quarter = self.enc2(torch.relu(self.down2(half)))
        quarter = quarter + self.middle(quarter)
        half = self.dec1(torch.cat([up(quarter), half], 1))
        full = self.dec0(torch.cat([up(half), full], 1))
        raw = self.head(full)
        f, step = self.features, self.features + 3
        parts = []
        for j in range(self.levels - 1):
            phi, log_weight, falloff = torch.split(raw[:, j * step : (j + 1) * step], [f, 2, 1], 1)
            parts += [FEATURE_BOUND * torch.tanh(phi / FEATURE_BOUND)]
            parts += [LOG_WEIGHT_BOUND * torch.tanh(log_weight / LOG_WEIGHT_BOUND)]
            # exp, not softplus: useful values span from 1e-4 (the window's edge unpenalised) to 10 (centre alone).
            parts += [torch.exp(5.0 * torch.tanh(falloff / 5.0) - 4.0)]
        return torch.cat(parts, 1)


class Paper(nn.Module):
    """[Choi and Moon 2021, 4.3]: ten convolutions, 2.4 M parameters, 4.7 MFLOP a pixel."""

    kind, output = "weights", "weights"
    stride = 1
    halo = 20

    def __init__(self, levels=5, window=WINDOW, filters=50, depth=10):
        super().__init__()
        self.levels, self.window, self.features = levels, window, 0
        sizes = [normalise.channels(levels)] + [filters] * (depth - 1)
        self.layers = nn.ModuleList(conv(a, b, 5) for a, b in zip(sizes, sizes[1:]))
        self.last = conv(filters, (levels - 1) * window * window, 5)
        for layer in [*self.layers, self.last]:
            nn.init.xavier_uniform_(layer.weight)
            nn.init.zeros_(layer.bias)

    def forward(self, x):
        for layer in self.layers:
            x = torch.relu(layer(x))
        return torch.exp(LOG_WEIGHT_BOUND * torch.tanh(self.last(x) / LOG_WEIGHT_BOUND))


def up(x):
    return nn.functional.interpolate(x, scale_factor=2.0, mode="nearest")


def build(arch, levels=5, window=WINDOW):
    return {"compact": Compact, "paper": Paper}[arch](levels=levels, window=window)
