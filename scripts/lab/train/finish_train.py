"""Trains the network of the finish on the windows of finish_data.py.

  python -m lab.train.finish_train --data DIR --out RUN --minutes 120

A repeated command with the same --out continues, as in train.py. The loss of a crop is the change of its error, over the
error of the finish without a network, so that crops of little and of much noise count alike, and none prevails that the
network makes much worse at first.
"""

import numpy as np
import torch

from . import finish_views, views
from .evaluate import TRIMMED
from .finish_model import FinishNet, bounded, split
from .finish_views import VERSION
from .train import Run, common_arguments, prepare, train

# Extra weight of pixels whose first hit transmits all light.
GLASS = 3.0
# Least error of the finish without a network, and share of the noise of the target that it has at least, by which changes
# are divided: smaller errors are not known.
LEAST_ERROR, NOISE_SHARE = 1e-4, 0.03
# Held-out snapshots that a validation reads.
VALIDATED = 80


def rough(x):
    """The part of pictures that their means over 3 x 3 pixels do not show: grain."""
    return x - torch.nn.functional.avg_pool2d(x, 3, 1, 1, count_include_pad=False)


def squared_errors(picture, halves, weight, of=lambda x: x):
    """Weighted sums of the squared errors of crops. As products of the differences to both halves of the target, they have
    no part of its noise in the mean."""
    return (weight * (of(picture - halves[:, 0]) * of(picture - halves[:, 1])).mean(1)).sum((1, 2))


def grain(picture, halves, weight):
    """The squared errors of the grain of crops."""
    return squared_errors(picture, halves, weight, rough)


def pixel_weights(default, halves, transmission):
    """Weights [b, h, w] with which squared differences have trimmed relative squared errors as their sum, and the noise
    of the target by them. Pixels have less weight where the target around them has much noise; a pixel's own noise would favour
    targets that lack bright samples."""
    scale, square = default.mean(1).square() + 0.01, lambda x: x.square().mean(1)
    apart = square(halves[:, 0] - halves[:, 1])
    # Rows and columns apart, because 15 x 15 pixels take a tenth of the training.
    noise = torch.nn.functional.avg_pool2d(apart[:, None] / 4, (15, 1), 1, (7, 0))
    noise = torch.nn.functional.avg_pool2d(noise, (1, 15), 1, (0, 7))
    weight = (1 + GLASS * transmission[:, 0].clamp(0, 1)) / (scale + noise[:, 0])
    error = (apart + square(default - halves.mean(1))) / scale
    weight = weight * (error <= error.flatten(1).quantile(1 - TRIMMED, 1)[:, None, None])
    total = (weight * scale).sum((1, 2), keepdim=True)
    return weight / total, (weight * noise[:, 0] / total).sum((1, 2))


def loss_of(net, batch):
    """The mean loss of the crops of a batch (input, targets, transmission): the change of their errors over those of the
    finish without a network, as a logarithm where it is positive."""
    image, targets, transmission = batch
    groups, clean = split(image), targets[:, 2:].expand(-1, 2, -1, -1, -1)
    default = bounded(groups, groups["denoised"])
    weight, noise = pixel_weights(default, targets[:, :2], transmission)
    error = lambda picture: squared_errors(picture, clean, weight) + grain(picture, clean, weight)
    known = error(default)
    change = (error(bounded(groups, net(image))) - known) / known.clamp(min=0).add(LEAST_ERROR + NOISE_SHARE * noise)
    return torch.where(change < 0, change, torch.log1p(change.clamp(min=0))).mean()


@torch.no_grad()
def errors(net, arrays, k, device="cpu"):
    """Trimmed errors and grain of snapshot k of a window: with the network, and without one. They are relative to the
    radiance of the default finish, because dividing by a noisy target would favour dark pictures."""
    image, targets, transmission = (
        torch.from_numpy(x).to(device)[None] for x in finish_views.sample(views.snapshot(arrays, k))
    )
    groups, halves = split(image), targets[:, :2]
    pictures = [bounded(groups, picture) for picture in (net(image), groups["denoised"])]
    weight, _ = pixel_weights(pictures[1], halves, transmission)
    return [error(picture, halves, weight).item() for error in (squared_errors, grain) for picture in pictures]


def validate(net, folder, device="cpu", most=VALIDATED):
    """Figures over at most `most` held-out snapshots: geometric means of error and grain relative to the finish without
    the network, in all and by method, the largest relative error, and the number of snapshots."""
    net.eval()
    items = [(item, k) for item in finish_views.files(folder, True) for k in range(snapshots(item))]
    items, rows = items[:: max(1, -(-len(items) // most))], {}
    for item, k in items:
        found = np.maximum(errors(net, finish_views.read(item), k, device), LEAST_ERROR)
        rows.setdefault(item[1], []).append(np.log(found))
    net.train()
    if not rows:
        return {}
    of_all = np.concatenate(list(rows.values()))
    ratio = lambda rows, first: round(float(np.exp(np.mean([row[first] - row[first + 1] for row in rows]))), 4)
    found = {"error": ratio(of_all, 0), "grain": ratio(of_all, 2), "snapshots": len(of_all)}
    found["worst"] = round(float(np.exp((of_all[:, 0] - of_all[:, 1]).max())), 4)
    return found | {f"{method}_error": ratio(logs, 0) for method, logs in sorted(rows.items())}


def snapshots(item):
    """The number of snapshots of a window."""
    return len(finish_views.read(item)["iterations"])


class FinishRun(Run):
    """A training run of the network of the finish."""

    stored = ("rate", "batch", "side", "steps", "seed")

    def build(self):
        net = FinishNet()
        net.version = VERSION
        return net

    def loss(self, batch):
        return loss_of(self.net, batch)

    def validate(self):
        return validate(self.average.module, self.args.data, self.device)

    def description(self):
        count = len({item[0] for item in finish_views.files(self.args.data, False)})
        sizes = {"half": self.net.half, "quarter": self.net.quarter}
        return {"arch": "finish", "version": VERSION, **sizes, "data": f"{count} views of {self.args.data.name}"}


def main():
    args = common_arguments(__doc__).parse_args()
    prepare(args)
    train(FinishRun(args), finish_views.Pool(args.data))


if __name__ == "__main__":
    main()
