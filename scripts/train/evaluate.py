"""relMSE (and trimmed relMSE) of the combined image against every level, scene by scene.

  python evaluate.py --checkpoint RUN/last.pt --data DIR [--all]

Without --all only the scenes that training held out. Level4 of five is what `Noisy` shows: the usual single bandwidth.
"""

import argparse

import numpy as np
import torch

import combination
import crops
import export


def relmse(image, reference):
    """Per pixel mean over RGB of (x - r)^2 / (mean_RGB(r)^2 + 0.01)."""
    return ((image - reference).square().mean(1) / (reference.mean(1).square() + 0.01)).flatten()


def trimmed(errors):
    """Mean without the worst 0.1 % of pixels."""
    kept = errors.sort().values[: errors.numel() - errors.numel() // 1000]
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
    parser.add_argument("--all", action="store_true", help="scenes that it was trained on too")
    args = parser.parse_args()
    net, _ = export.load(args.checkpoint)
    net.eval()
    scenes = crops.files(args.data)
    names = sorted(scenes) if args.all else crops.held_out(scenes)
    heads = ["combined"] + [f"Level{k + 1}" for k in range(net.levels)]
    print(f"{'scene':24}" + "".join(f"{h:>20}" for h in heads) + "    relMSE (trimmed), means over crops")
    table = []
    for name in names:
        rows = [[(e.mean().item(), trimmed(e)) for e in errors(net, file)] for file in scenes[name]]
        table.append(np.mean(rows, axis=0))
        print(f"{name:24}" + "".join(f"{a:11.5f} ({b:.5f})" for a, b in table[-1]))
    print(f"{'geometric mean':24}" + "".join(f"{a:11.5f} ({b:.5f})" for a, b in np.exp(np.log(table).mean(0))))


if __name__ == "__main__":
    main()
