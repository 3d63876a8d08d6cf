"""Errors of the combined picture on held-out views, relative to the usual single level and to the delivered picture.

  python -m lab.train.evaluate --checkpoint RUN/last.pt --data DIR

The target of a view has two independent halves t and u; the mean of (x - t)(x - u) has no contribution from their
noise. Level4 of five is the layer `Noisy`, the picture of the default single bandwidth; `finished` is the bounded
denoised picture.
"""

import argparse
from pathlib import Path

import numpy as np
import torch

from . import combination, export_network, views

# Share of the pixels that the trimmed error leaves out: those with the largest noise of the target and of Level4.
TRIMMED = 0.005
# Snapshots that are evaluated, of those that a view has.
SNAPSHOTS = (0, 2, 4)
# Least error for geometric means, because an estimate of a small error can be negative.
LEAST = 1e-6


def pixel_errors(picture, halves, scale):
    """For each pixel, the mean over RGB of (x - t)(x - u) / scale, with the halves t and u of the target."""
    t, u = halves
    return ((picture - t) * (picture - u)).mean(0) / scale


def trimmed_mean(errors, order):
    """The mean without the last pixels of `order`."""
    kept = order[: order.numel() - int(TRIMMED * order.numel())]
    return max(errors.flatten()[kept].mean().item(), LEAST)


@torch.no_grad()
def errors(net, arrays, k, device="cpu"):
    """Trimmed errors of the combination, of Level4 and of the finished picture, for snapshot k of a stack. They are
    relative to the radiance of the finished picture, because dividing by a noisy target would favour dark pictures."""
    stack = views.snapshot(arrays, k, net.pairs)
    image, y, z, halves = (torch.from_numpy(x).to(device) for x in views.sample(stack, net.pairs, net.version))
    combined = combination.combine(net(image[None]), y[None], z[None], net.form)[0]
    planar = lambda picture: torch.from_numpy(picture).permute(2, 0, 1).to(device)
    usual, finished = planar(stack["levels"][3]), planar(stack["finished"])
    noise = (halves[0] - halves[1]).square().mean(0) + (usual - halves.mean(0)).square().mean(0)
    scale = finished.mean(0).square() + 0.01
    order = (noise / scale).flatten().argsort()
    return [trimmed_mean(pixel_errors(picture, halves, scale), order) for picture in (combined, usual, finished)]


def evaluated(arrays):
    """Returns the indices of the stored numbers of iterations at which a view is evaluated."""
    return [k for k in SNAPSHOTS if k < len(arrays["iterations"])]


def validate(net, folder, methods, paths, device="cpu", most=60):
    """Geometric means over at most `most` held-out snapshots: the error of the combination relative to Level4 and to
    the finished picture, by method; and the number of snapshots."""
    net.eval()
    found = {}
    for method in methods:
        items = views.files(folder, True, [method], paths, net.pairs)
        items = items[:: max(1, len(items) * len(SNAPSHOTS) // most)]
        rows = []
        for item in items:
            arrays = views.read(item)
            rows += [errors(net, arrays, k, device) for k in evaluated(arrays)]
        if rows:
            logs = np.log(rows)
            found[f"{method}_to_level4"] = round(float(np.exp((logs[:, 0] - logs[:, 1]).mean())), 4)
            found[f"{method}_to_finished"] = round(float(np.exp((logs[:, 0] - logs[:, 2]).mean())), 4)
            found[f"{method}_snapshots"] = len(rows)
    net.train()
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--checkpoint", required=True)
    parser.add_argument("--data", required=True, type=Path)
    parser.add_argument("--methods", nargs="+", default=["sppm", "vcm"])
    parser.add_argument("--paths", nargs="+", type=int, default=[2])
    args = parser.parse_args()
    net, _ = export_network.load(args.checkpoint)
    net.eval()
    print(f"{'view':28}{'method':8}{'iterations':>10}{'combined':>12}{'Level4':>12}{'finished':>12}")
    ratios = []
    for item in views.files(args.data, True, args.methods, args.paths, net.pairs):
        arrays = views.read(item)
        for k in evaluated(arrays):
            row = errors(net, arrays, k)
            ratios.append([row[0] / row[1], row[0] / row[2]])
            values = "".join(f"{value:12.5f}" for value in row)
            print(f"{item[0].name:28}{item[1]:8}{int(arrays['iterations'][k]):10}{values}", flush=True)
    if ratios:
        mean, worst = np.exp(np.log(ratios).mean(0)), np.max(ratios, axis=0)
        print(
            f"combined / Level4: {mean[0]:.3f} (worst {worst[0]:.2f}); "
            f"combined / finished: {mean[1]:.3f} (worst {worst[1]:.2f})"
        )


if __name__ == "__main__":
    main()
