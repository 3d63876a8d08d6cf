"""Trains the network of the finish on the windows of finish_data.py.

  python -m lab.train.finish_train --data DIR --out RUN --minutes 120

A repeated command with the same --out continues, as in train.py. The loss of a crop is the logarithm of its error over
that of the finish without a network, so that crops of little and of much noise count alike, and none prevails that the
network makes much worse at first.
"""

import numpy as np
import torch

from . import finish_views, views
from .evaluate import pixel_errors, trimmed_mean
from .finish_model import FinishNet, bounded, split
from .finish_views import VERSION
from .train import Run, common_arguments, prepare, train

# Extra weight of pixels whose first hit transmits all light; least loss of the finish without a network.
GLASS, LEAST_LOSS = 3.0, 1e-4
# Held-out snapshots that a validation reads.
VALIDATED = 80


def rough(x):
    """The part of pictures that their means over 3 x 3 pixels do not show: grain."""
    return x - torch.nn.functional.avg_pool2d(x, 3, 1, 1, count_include_pad=False)


def crop_losses(picture, target, scale, weight):
    """The loss of each crop: the relative squared errors of the picture and of its grain, compressed where they exceed
    1, so that single pixels do not rule. `scale` [b, h, w] must not depend on the target, whose noise would then not
    average out."""
    errors = [difference.square().mean(1) / scale for difference in (picture - target, rough(picture - target))]
    return sum((weight * torch.log1p(error)).mean((1, 2)) for error in errors)


def loss_of(net, batch):
    """The mean loss of the crops of a batch (input, halves, transmission): 0 for the finish without a network."""
    image, halves, transmission = batch
    groups, target = split(image), halves.mean(1)
    default = bounded(groups, groups["denoised"])
    scale, weight = default.mean(1).square() + 0.01, 1 + GLASS * transmission[:, 0].clamp(0, 1)
    loss = lambda picture: torch.log(crop_losses(picture, target, scale, weight) + LEAST_LOSS)
    return (loss(bounded(groups, net(image))) - loss(default)).mean()


@torch.no_grad()
def errors(net, arrays, k, device="cpu"):
    """Trimmed errors and grain of snapshot k of a window: with the network, and without one."""
    image, halves, _ = (torch.from_numpy(x).to(device) for x in finish_views.sample(views.snapshot(arrays, k)))
    groups = split(image[None])
    pictures = [bounded(groups, picture)[0] for picture in (net(image[None]), groups["denoised"])]
    scale = halves.mean(0).mean(0).square() + 0.01
    noise = (halves[0] - halves[1]).square().mean(0) + (pictures[1] - halves.mean(0)).square().mean(0)
    order = (noise / scale).flatten().argsort()
    grain = lambda picture: (rough(picture - halves[0]) * rough(picture - halves[1])).mean(0) / scale
    return [
        trimmed_mean(of(picture), order) for of in (lambda p: pixel_errors(p, halves), grain) for picture in pictures
    ]


def validate(net, folder, device="cpu", most=VALIDATED):
    """Figures over at most `most` held-out snapshots: geometric means of error and grain relative to the finish without
    the network, in all and by method, the largest relative error, and the number of snapshots."""
    net.eval()
    items = [(item, k) for item in finish_views.files(folder, True) for k in range(snapshots(item))]
    items, rows = items[:: max(1, -(-len(items) // most))], {}
    for item, k in items:
        rows.setdefault(item[1], []).append(np.log(errors(net, finish_views.read(item), k, device)))
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
