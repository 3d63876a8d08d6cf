"""relMSE (and trimmed relMSE) of the combined image and of every level, scene by scene.

  python -m lab.train.evaluate --checkpoint RUN/last.pt --data DIR [--all]

Without --all, only crops that training did not use, with a row for each picture and number of iterations. Level4 of five
is the layer `Noisy`, the image of the default single bandwidth.
"""

import argparse

import numpy as np
import torch

from . import combination
from . import crops
from . import export_network


def relmse(image, reference):
    """For each pixel, the mean over RGB of (x - r)^2 / (mean_RGB(r)^2 + 0.01)."""
    return ((image - reference).square().mean(1) / (reference.mean(1).square() + 0.01)).flatten()


def trimmed(errors):
    """Mean without the worst 0.5 % of pixels."""
    kept = errors.sort().values[: errors.numel() - int(0.005 * errors.numel())]
    return kept.mean().item()


@torch.no_grad()
def errors(net, file):
    image, levels, reference = (torch.from_numpy(x)[None] for x in crops.load(file))
    h, w = (n // net.stride * net.stride for n in image.shape[-2:])
    image, levels, reference = image[..., :h, :w], levels[..., :h, :w], reference[..., :h, :w]
    combined = combination.combine(net(image), levels, net.kind, net.window, net.features)
    return [relmse(x, reference) for x in [combined, *levels.unbind(1)]]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--checkpoint", required=True)
    parser.add_argument("--data", required=True)
    parser.add_argument("--held-out", nargs="*", default=crops.HELD_OUT, help="the value of train.py's --held-out")
    parser.add_argument("--all", action="store_true", help="also evaluate crops that training used")
    args = parser.parse_args()
    net, _ = export_network.load(args.checkpoint)
    net.eval()
    scenes = crops.files(args.data)
    scenes = scenes if args.all else crops.held_out(scenes, args.held_out)
    heads = ["combined"] + [f"Level{k + 1}" for k in range(net.levels)]
    print(
        f"{'scene variant-iterations':28}"
        + "".join(f"{h:>17}" for h in heads)
        + "    relMSE (trimmed), means over crops"
    )
    table = []
    for name, files in group(scenes).items():
        rows = [[(e.mean().item(), trimmed(e)) for e in errors(net, file)] for file in files]
        table.append(np.mean(rows, axis=0))
        print(f"{name:28}" + "".join(f"{a:8.4f} ({b:6.4f})" for a, b in table[-1]), flush=True)
    print(f"{'mean':28}" + "".join(f"{a:8.4f} ({b:6.4f})" for a, b in np.mean(table, axis=0)))
    print(f"{'geometric mean':28}" + "".join(f"{a:8.4f} ({b:6.4f})" for a, b in np.exp(np.log(table).mean(0))))


def group(scenes):
    """The files of each row by its title, from names SCENE--VARIANT-ITERATIONS-... (data.py)."""
    rows = {}
    for name, files in scenes.items():
        for file in files:
            rows.setdefault(f"{name} {'-'.join(file.stem.split('--')[1].split('-')[:2])}", []).append(file)
    return rows


if __name__ == "__main__":
    main()
